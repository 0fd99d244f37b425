"""Two streams of people cross a square and leave through two narrow exits, published live to throng.

A JuPedSim simulation with a step loop of its own, kept at real time. People enter while it runs, so
that it may go on for as long as one likes.

    throng-server --listen 127.0.0.1:7447 --cast CAST
    python jupedsim_bottleneck.py --seconds 60
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import time
from typing import List, Tuple

import jupedsim as jps
import shapely

import throng
from throng.jupedsim import Tee, ThrongWriter

STEP_S = 0.02
# A hall of 20 x 12 m, an entrance on its west and one on its south side, and two exits 1.6 m wide.
HALL = shapely.box(0, 0, 20, 12)
WEST_ENTRANCE = shapely.box(-7, 2.5, 0, 9.5)
SOUTH_ENTRANCE = shapely.box(4, -6, 11, 0)
EAST_EXIT = shapely.box(20, 4.2, 24, 5.8)
NORTH_EXIT = shapely.box(11.7, 12, 13.3, 16)
PILLARS = [shapely.box(9.6, 8.2, 10.2, 8.8), shapely.box(14.6, 8.2, 15.2, 8.8)]


class Stream:
    """People of one origin and one destination."""

    def __init__(self, simulation: jps.Simulation, area: shapely.Polygon, exit_area: shapely.Polygon):
        self.area = area
        self.stage = simulation.add_exit_stage(exit_area)
        self.journey = simulation.add_journey(jps.JourneyDescription([self.stage]))


def person(stream: Stream, position: Tuple[float, float], rng: random.Random):
    """Speeds as of adults on level ground (Weidmann 1993: 1.34 m/s, deviation 0.26)."""
    return jps.CollisionFreeSpeedModelV2AgentParameters(
        position=position, journey_id=stream.journey, stage_id=stream.stage,
        desired_speed=min(max(rng.gauss(1.34, 0.26), 0.7), 2.0), time_gap=rng.uniform(0.8, 1.2),
        radius=rng.uniform(0.17, 0.2), strength_neighbor_repulsion=rng.uniform(6.0, 8.0),
        range_neighbor_repulsion=rng.uniform(0.1, 0.2))


def add_people(simulation: jps.Simulation, stream: Stream, area: shapely.Polygon, count: int,
               rng: random.Random) -> int:
    """Adds up to `count` people at free places of `area`, and returns how many found one."""
    low_x, low_y, high_x, high_y = area.bounds
    others: List[Tuple[float, float]] = [agent.position for agent in simulation.agents()]
    added = 0
    for _ in range(40 * count):
        if added == count:
            break
        x, y = rng.uniform(low_x + 0.4, high_x - 0.4), rng.uniform(low_y + 0.4, high_y - 0.4)
        if any((x - ox) ** 2 + (y - oy) ** 2 < 0.85**2 for ox, oy in others):
            continue
        if any(pillar.buffer(0.4).contains(shapely.Point(x, y)) for pillar in PILLARS):
            continue
        simulation.add_agent(person(stream, (x, y), rng))
        others.append((x, y))
        added += 1
    return added


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long to run (default: 60)")
    parser.add_argument("--agents", type=int, default=240, help="people at the same time (default: 240)")
    parser.add_argument("--crowd", default="jupedsim", help="name of the crowd (default: jupedsim)")
    parser.add_argument("--url", help="HOST:PORT of throng-server (default: $THRONG_URL or 127.0.0.1:7447)")
    parser.add_argument("--sqlite", metavar="FILE", help="write JuPedSim's own trajectory file as well")
    parser.add_argument("--fast", action="store_true", help="do not wait for real time")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers (default: 1)")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))

    rng = random.Random(arguments.seed)
    area = shapely.union_all([HALL, WEST_ENTRANCE, SOUTH_ENTRANCE, EAST_EXIT, NORTH_EXIT])
    area = area.difference(shapely.union_all(PILLARS))
    with throng.connect(arguments.url, arguments.crowd, producer=f"jupedsim {jps.__version__}") as pub:
        writer = ThrongWriter(pub)
        if arguments.sqlite:
            writer = Tee(jps.SqliteTrajectoryWriter(output_file=arguments.sqlite, every_nth_frame=2), writer)
        simulation = jps.Simulation(model=jps.CollisionFreeSpeedModelV2(), geometry=area, dt=STEP_S,
                                    trajectory_writer=writer)
        west = Stream(simulation, WEST_ENTRANCE, shapely.box(22.5, 4.2, 24, 5.8))
        south = Stream(simulation, SOUTH_ENTRANCE, shapely.box(11.7, 14.5, 13.3, 16))

        # Most are there from the start; whoever leaves is replaced at an entrance.
        total = arguments.agents
        add_people(simulation, west, shapely.box(0, 1, 9, 11), int(0.33 * total), rng)
        add_people(simulation, south, shapely.box(5, 0, 16, 8), int(0.25 * total), rng)
        add_people(simulation, west, WEST_ENTRANCE, int(0.22 * total), rng)
        add_people(simulation, south, SOUTH_ENTRANCE, int(0.20 * total), rng)

        begin = time.monotonic()
        behind_s = 0.0
        try:
            while simulation.elapsed_time() < arguments.seconds:
                simulation.iterate()
                if simulation.iteration_count() % 25 == 0:
                    for stream, gate in ((west, shapely.box(-7, 2.5, -5, 9.5)), (south, shapely.box(4, -6, 11, -4))):
                        missing = total - simulation.agent_count()
                        if missing > 0:
                            add_people(simulation, stream, gate, min(missing, 2), rng)
                if not arguments.fast:
                    ahead_s = simulation.elapsed_time() - (time.monotonic() - begin)
                    if ahead_s > 0:
                        time.sleep(ahead_s)
                    else:
                        behind_s = max(behind_s, -ahead_s)
        except KeyboardInterrupt:
            pass
        if arguments.sqlite:
            writer.close()
    stats = pub.stats
    print(f"simulated {simulation.elapsed_time():.1f} s with {simulation.agent_count()} people at the end, "
          f"{behind_s:.2f} s behind real time at most; "
          f"{stats.published} frames published, {stats.applied} applied, {stats.dropped} dropped")
    if stats.last_error:
        print(f"last problem: {stats.last_error}", file=sys.stderr)
    return 0 if stats.applied > 0 else 1


if __name__ == "__main__":
    sys.exit(main())

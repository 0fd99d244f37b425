"""A few hundred people pass a bottleneck between two halls, published live to throng.

A JuPedSim simulation with a step loop of its own, kept at real time. Whoever leaves is replaced at
the far end of the first hall, so that it may go on for as long as one likes.

    throng-server --listen 127.0.0.1:7447 --cast CAST
    python jupedsim_bottleneck.py --seconds 60
"""

from __future__ import annotations

import argparse
import math
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
PEOPLE = 220  # for whom the halls below are made; more or fewer get larger or smaller ones


class Bottleneck:
    """Two halls of 14 x 12 m with a passage 5 m wide between them, and who is inside.

    Two agents in three queue or walk up in the first hall. Behind the passage each makes for one of
    three exits, so that the stream spreads again.
    """

    def __init__(self, writer: jps.TrajectoryWriter, agents: int, seed: int):
        self.agents = agents
        self._rng = random.Random(seed)
        scale = math.sqrt(max(agents, 1) / PEOPLE)
        length, width, passage = max(14 * scale, 6.0), max(12 * scale, 5.0), max(5 * scale, 1.6)
        self._first = shapely.box(-length, 0, 0, width)
        self._passage = shapely.box(0, (width - passage) / 2, 1.5, (width + passage) / 2)
        self._second = shapely.box(1.5, 0, length, width)
        self._entrance = shapely.box(-length, 0, -length + 2, width)
        self.simulation = jps.Simulation(
            model=jps.CollisionFreeSpeedModelV2(), dt=STEP_S, trajectory_writer=writer,
            geometry=shapely.union_all([self._first, self._passage, self._second]))

        self._ways: List[Tuple[int, int]] = []
        for part in range(3):
            low = width * part / 3
            exit_area = shapely.box(length - 1.0, low + 0.2, length - 0.1, low + width / 3 - 0.2)
            stage = self.simulation.add_exit_stage(exit_area)
            self._ways.append((stage, self.simulation.add_journey(jps.JourneyDescription([stage]))))
        self._add(self._first, round(0.60 * agents))
        self._add(self._passage, round(0.05 * agents))
        self._add(self._second, agents - self.simulation.agent_count())

    def step(self) -> None:
        self.simulation.iterate()
        missing = self.agents - self.simulation.agent_count()
        if missing > 0 and self.simulation.iteration_count() % 10 == 0:
            self._add(self._entrance, min(missing, 1 + self.agents // 100))

    def _add(self, area: shapely.Polygon, count: int) -> None:
        """Adds up to `count` people at random free places of `area`, at least 0.8 m apart."""
        low_x, low_y, high_x, high_y = area.bounds
        others = [agent.position for agent in self.simulation.agents()]
        added = 0
        for _ in range(30 * count):
            if added == count:
                return
            x, y = self._rng.uniform(low_x + 0.4, high_x - 0.4), self._rng.uniform(low_y + 0.4, high_y - 0.4)
            if any((x - other_x) ** 2 + (y - other_y) ** 2 < 0.8**2 for other_x, other_y in others):
                continue
            stage, journey = self._rng.choice(self._ways)
            # Free speeds of adults on level ground: 1.34 m/s, deviation 0.26 (Weidmann 1993).
            self.simulation.add_agent(jps.CollisionFreeSpeedModelV2AgentParameters(
                position=(x, y), stage_id=stage, journey_id=journey,
                desired_speed=min(max(self._rng.gauss(1.34, 0.26), 0.7), 2.0),
                time_gap=self._rng.uniform(0.7, 1.1), radius=self._rng.uniform(0.17, 0.2)))
            others.append((x, y))
            added += 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long to run (default: 60)")
    parser.add_argument("--agents", type=int, default=PEOPLE, help=f"people at the same time (default: {PEOPLE})")
    parser.add_argument("--crowd", default="jupedsim", help="name of the crowd (default: jupedsim)")
    parser.add_argument("--url", help="HOST:PORT of throng-server (default: $THRONG_URL or 127.0.0.1:7447)")
    parser.add_argument("--sqlite", metavar="FILE", help="write JuPedSim's own trajectory file as well")
    parser.add_argument("--fast", action="store_true", help="do not wait for real time")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers (default: 1)")
    arguments = parser.parse_args()
    if arguments.agents < 1 or not arguments.seconds > 0:
        parser.error("--agents and --seconds must be over 0")
    for number in (signal.SIGINT, signal.SIGTERM):  # even where a shell has them ignored
        signal.signal(number, signal.default_int_handler)

    behind_s = 0.0
    with throng.connect(arguments.url, arguments.crowd, producer=f"jupedsim {jps.__version__}") as pub:
        writer = ThrongWriter(pub)
        if arguments.sqlite:
            writer = Tee(jps.SqliteTrajectoryWriter(output_file=arguments.sqlite, every_nth_frame=2), writer)
        scene = Bottleneck(writer, arguments.agents, arguments.seed)
        begin = time.monotonic()
        told = False
        try:
            while scene.simulation.elapsed_time() < arguments.seconds:
                scene.step()
                if not told and pub.stats.applied:
                    told = True
                    print(f"crowd {arguments.crowd!r} is live, {scene.simulation.agent_count()} people", flush=True)
                ahead_s = scene.simulation.elapsed_time() - (time.monotonic() - begin)
                if ahead_s > 0 and not arguments.fast:
                    time.sleep(ahead_s)
                behind_s = max(behind_s, -ahead_s)
        except KeyboardInterrupt:
            print("stopped", file=sys.stderr)
        if arguments.sqlite:
            writer.close()
    stats = pub.stats
    print(f"simulated {scene.simulation.elapsed_time():.1f} s with {scene.simulation.agent_count()} people, "
          f"at most {behind_s:.2f} s behind real time; frames: {stats.published} published, "
          f"{stats.applied} applied, {stats.dropped} dropped")
    if stats.last_error:
        print(f"last problem: {stats.last_error}", file=sys.stderr)
    return 0 if stats.applied > 0 else 1


if __name__ == "__main__":
    sys.exit(main())

"""The JuPedSim writer with the real JuPedSim."""

import subprocess
import sqlite3
import sys
from pathlib import Path

import numpy as np
import pytest

import throng

jps = pytest.importorskip("jupedsim", reason="jupedsim is not installed")

from throng.jupedsim import Tee, ThrongWriter  # noqa: E402

EXAMPLE = Path(__file__).resolve().parents[3] / "client/python/examples/jupedsim_bottleneck.py"
AREA = "POLYGON ((0 0, 10 0, 10 4, 0 4, 0 0))"


def simulation(writer, people=3, step_s=0.02):
    made = jps.Simulation(model=jps.CollisionFreeSpeedModelV2(), geometry=AREA, dt=step_s, trajectory_writer=writer)
    stage = made.add_exit_stage([(9, 0), (10, 0), (10, 4), (9, 4)])
    journey = made.add_journey(jps.JourneyDescription([stage]))
    for row in range(people):
        made.add_agent(jps.CollisionFreeSpeedModelV2AgentParameters(
            position=(1.0, 0.6 + 0.9 * row), journey_id=journey, stage_id=stage))
    return made


def test_simulation_is_published_with_area_rate_and_positions(server):
    with throng.connect(server.url) as pub:
        running = simulation(ThrongWriter(pub))
        positions = {}
        for _ in range(20):
            running.iterate()
            positions[running.iteration_count()] = [agent.position for agent in running.agents()]
    assert len(server.frames) == 11  # the start and every second step: 25 per second
    assert server.starts[0].expected_rate_hz == pytest.approx(25)
    assert server.environments[0].startswith("POLYGON")
    last = server.frames[-1]
    assert last.time_us == 400_000 and last.headings is None
    np.testing.assert_allclose(last.positions[:, :2], positions[20], rtol=1e-6)
    assert pub.stats.errors == 0


def test_orientations_are_published_when_asked_for(server):
    with throng.connect(server.url) as pub:
        running = simulation(ThrongWriter(pub, every=1, headings=True), people=1)
        running.iterate(10)
    assert server.frames[-1].headings[0] == pytest.approx(0.16, abs=0.02)  # towards the middle of the exit


def test_people_who_reach_the_exit_leave_the_crowd(server):
    with throng.connect(server.url) as pub:
        running = simulation(ThrongWriter(pub, every=5), people=2)
        while running.agent_count() > 0:
            running.iterate(5)
    assert len(server.frames[0].ids) == 2 and len(server.frames[-1].ids) == 0


def test_tee_feeds_several_writers_each_at_its_own_interval(server, tmp_path):
    path = tmp_path / "run.sqlite"
    with throng.connect(server.url) as pub:
        writer = Tee(jps.SqliteTrajectoryWriter(output_file=path, every_nth_frame=6), ThrongWriter(pub, every=4))
        assert writer.every_nth_frame() == 2
        running = simulation(writer)
        running.iterate(24)
        writer.close()
    with sqlite3.connect(path) as database:
        assert database.execute("SELECT count(*) FROM frame_data").fetchone() == (5,)
    assert len(server.frames) == 7


def test_simulation_goes_on_without_a_server():
    pub = throng.connect("127.0.0.1:1")
    running = simulation(ThrongWriter(pub))
    running.iterate(50)
    assert running.iteration_count() == 50 and pub.stats.published == 26
    pub.close(0)


@pytest.mark.parametrize("arguments", [["--agents", "60"], ["--agents", "1"]])
def test_example_runs_and_publishes(server, arguments):
    result = subprocess.run(
        [sys.executable, EXAMPLE, "--fast", "--seconds", "2", "--crowd", "demo", "--url", server.url, *arguments],
        capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    assert server.starts[0].crowd_name == "demo"
    people = int(arguments[1])
    assert 0.9 * people <= len(server.frames[-1].ids) <= people  # who leaves is replaced, a little later


def test_example_without_a_server_fails_and_says_so():
    result = subprocess.run([sys.executable, EXAMPLE, "--fast", "--seconds", "0.5", "--agents", "5",
                             "--url", "127.0.0.1:1"], capture_output=True, text=True, timeout=120)
    assert result.returncode == 1 and "could not be sent" in result.stderr

"""The examples that come with the producers, against a real server."""

import json
import re
import subprocess
import sys

import pytest

from conftest import BUILD, ROOT


@pytest.fixture(scope="module")
def server():
    process = subprocess.Popen([str(BUILD / "bin/throng-server"), "--listen", "127.0.0.1:0", "--log-level", "off"],
                               stdout=subprocess.PIPE, text=True)
    for line in process.stdout:
        if ready := re.match(r"throng-server ready on (\S+),", line):
            break
    yield ready[1]
    process.terminate()
    process.wait()


def crowd_of(program, server, name):
    crowds = json.loads(program("throng", "crowds", "--json", THRONG_URL=server).stdout)["crowds"]
    return next(crowd for crowd in crowds if crowd["name"] == name)


def test_detour_crowd_walks_around_the_pillars(server, program):
    if not (BUILD / "bin/detour_crowd").exists():
        pytest.skip("detour_crowd was not built (librecast-dev)")
    done = program("detour_crowd", server, 12, 60, "fast")
    assert done.returncode == 0, done.stderr
    assert "240 frames published, 240 applied, 0 dropped" in done.stdout
    crowd = crowd_of(program, server, "detour")
    assert crowd["agents"] == 60


def test_generic_loop(server, program):
    done = subprocess.run([sys.executable, ROOT / "client/python/examples/generic_loop.py", "--url", server, "--fast",
                           "--seconds", "5"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert crowd_of(program, server, "loop")["agents"] == 200


def test_sumo_town(server, program):
    pytest.importorskip("sumo", reason="SUMO is not installed (deploy/setup --sumo)")
    done = subprocess.run([sys.executable, ROOT / "client/python/examples/sumo_town.py", "--url", server, "--fast",
                           "--seconds", "60"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert crowd_of(program, server, "town")["agents"] > 20

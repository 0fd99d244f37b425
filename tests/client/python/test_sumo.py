"""The SUMO helper with the real SUMO; `deploy/setup --sumo` installs it."""

import gzip
import os
import subprocess

import numpy as np
import pytest

import throng
from throng.sumo import PersonPublisher, streets

sumo = pytest.importorskip("sumo", reason="eclipse-sumo is not installed")

ROUTES = """<routes>
  <personFlow id="walker" begin="0" end="20" period="2"><walk from="A0B0" to="B1B2"/></personFlow>
</routes>"""


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    folder = tmp_path_factory.mktemp("town")
    netgenerate = os.path.join(sumo.SUMO_HOME, "bin", "netgenerate")
    subprocess.run([netgenerate, "--grid", "--grid.number", "3", "--grid.length", "60", "--sidewalks.guess", "true",
                    "--crossings.guess", "true", "-o", folder / "town.net.xml"], check=True, capture_output=True)
    (folder / "walk.rou.xml").write_text(ROUTES)
    return ["-n", str(folder / "town.net.xml"), "-r", str(folder / "walk.rou.xml"), "--step-length", "0.5",
            "--no-step-log"]


@pytest.mark.parametrize("library", ["traci", "libsumo"])
def test_walkers_are_published_with_names_positions_and_headings(server, town, library):
    traci = pytest.importorskip(library)
    traci.start([os.path.join(sumo.SUMO_HOME, "bin", "sumo"), *town])
    try:
        with throng.connect(server.url, queue_frames=1000) as pub:
            persons = PersonPublisher(pub, traci)
            seen = []
            for _ in range(60):
                traci.simulationStep()
                assert persons.publish()
                seen.append({name: traci.person.getPosition(name) for name in traci.person.getIDList()})
    finally:
        traci.close()
    assert pub.stats.errors == 0 and len(server.frames) == 60
    for frame, positions in zip(server.frames, seen):
        assert sorted(frame.names) == sorted(positions)
        for name, position in zip(frame.names, frame.positions):
            np.testing.assert_allclose(position[:2], positions[name], rtol=1e-5)
    assert server.frames[-1].ids[0] == throng.hash_id(server.frames[-1].names[0])
    assert [channel.name for channel in server.starts[0].channels] == ["speed"]
    assert server.environments == [streets(town[1])]
    # The heading is where the walker goes.
    before, after = server.frames[20], server.frames[21]
    name = before.names[0]
    step = after.positions[after.names.index(name)] - before.positions[0]
    heading = after.headings[after.names.index(name)]
    assert np.cos(heading - np.arctan2(step[1], step[0])) > 0.7


def test_streets_are_lanes_in_their_width_junctions_and_stripes(tmp_path):
    path = tmp_path / "a.net.xml.gz"
    path.write_bytes(gzip.compress(b"""<?xml version="1.0"?><net>
        <edge id=":a" function="internal"><lane shape="0,0 1,1"/></edge>
        <edge id="r"><lane shape="0,0 10,0 10,10" width="4"/><lane shape="0,5,1 10,5,1" allow="pedestrian" width="2"/>
        <lane shape="0,50 10,50" allow="rail_urban"/></edge>
        <edge id=":c" function="crossing"><lane shape="0,0 0,1" width="4"/></edge>
        <junction type="internal" shape="7,7 8,7 8,8"/><junction type="priority" shape="20,0 24,0 24,4"/></net>"""))
    assert streets(path).split("\n")[1:] == [
        ";ROAD MULTIPOLYGON (((0.00 2.00,8.00 2.00,8.00 10.00,12.00 10.00,12.00 -2.00,0.00 -2.00,0.00 2.00)), "
        "((20.00 0.00,24.00 0.00,24.00 4.00,20.00 0.00)))",
        ";WALK MULTIPOLYGON (((0.00 6.00,10.00 6.00,10.00 4.00,0.00 4.00,0.00 6.00)))",
        ";MARK MULTIPOLYGON (((-2.00 0.25,-2.00 0.75,2.00 0.75,2.00 0.25,-2.00 0.25)))"]
    crossing = '<net><edge id=":c" function="crossing"><lane shape="0,0 %s" width="%s"/></edge></net>'
    for text in (b"<routes/>", b"<net><edge", b"<net/>", gzip.compress(bytes(999))[:-9],
                 *((crossing % wrong).encode() for wrong in (
                     ("inf,0", 4), ("9e7,0", 4), ("nan,0", 4), ("7", 4), ("0,9", "inf"), ("0,9", "wide")))):
        path.write_bytes(text)
        with pytest.raises(ValueError, match="a.net.xml.gz: "):
            streets(path)

"""What `throng convert` writes, read without throng: by each format's own loader or library where there is one, else by
the few lines that its description asks for."""

import gzip
import json
import math
import sqlite3
import struct
import xml.etree.ElementTree

import pytest

FPS, STEPS = 25, 40
WKT = "POLYGON ((-2 -2, 12 -2, 12 12, -2 12, -2 -2), (5 5, 6 5, 6 6, 5 5))"


def there(step, agent):
    heading = 0.3 + agent
    return agent * 2 + math.cos(heading) * 0.05 * step, 1 + math.sin(heading) * 0.05 * step, heading


ROWS = [(step, agent, *there(step, agent)) for step in range(STEPS) for agent in (1, 2, 5)]


@pytest.fixture
def converted(tmp_path, program):
    """Writes the walkers (an input that has headings and a walkable area) as a file of that name, and gives its path."""

    def run(name, *options):
        with sqlite3.connect(tmp_path / "in.sqlite") as database:
            database.executescript(f"""CREATE TABLE trajectory_data(frame INTEGER, id INTEGER, pos_x REAL, pos_y REAL,
                ori_x REAL, ori_y REAL); CREATE TABLE metadata(key TEXT, value TEXT); CREATE TABLE geometry(wkt TEXT);
                INSERT INTO metadata VALUES ('version', '1'), ('fps', '{FPS}'); INSERT INTO geometry VALUES ('{WKT}');""")
            database.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?, ?, ?)",
                                 [(f, i, x, y, math.cos(h), math.sin(h)) for f, i, x, y, h in ROWS])
        done = program("throng", "convert", "in.sqlite", name, *options)
        assert done.returncode == 0, done.stderr
        return tmp_path / name

    return run


def test_hdf5_by_h5py(converted):
    h5py = pytest.importorskip("h5py")
    with h5py.File(converted("out.h5")) as file:
        table = file["trajectory"]
        assert table.attrs["fps"] == FPS and file.attrs["wkt_geometry"] == WKT
        assert table.dtype.names == ("frame", "id", "x", "y", "z", "ox", "oy")
        assert [str(table.dtype[name]) for name in ("frame", "id", "x")] == ["uint32", "uint32", "float64"]
        rows = [(int(r["frame"]), int(r["id"]), r["x"], r["y"], math.atan2(r["oy"], r["ox"])) for r in table[:]]
        assert [row[:4] for row in rows] == [row[:4] for row in ROWS]
        assert all(math.isclose(math.remainder(a[4] - b[4], math.tau), 0, abs_tol=1e-6) for a, b in zip(rows, ROWS))


def test_sqlite_by_sqlite3(converted):
    with sqlite3.connect(converted("out.sqlite")) as database:
        rows = database.execute("SELECT frame, id, pos_x, pos_y FROM trajectory_data ORDER BY frame, id").fetchall()
        assert rows == [row[:4] for row in ROWS]
        assert dict(database.execute("SELECT key, value FROM metadata"))["fps"] == str(FPS)
        assert database.execute("SELECT wkt FROM geometry").fetchone() == (WKT,)


@pytest.mark.parametrize("name", ["out.sqlite", "out.h5", "out.txt", "out.traj"])
def test_pedpy_loads(converted, name):
    pedpy = pytest.importorskip("pedpy")
    path = converted(name)
    loaded = {
        ".sqlite": lambda: pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=path),
        ".h5": lambda: pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=path),
        ".txt": lambda: pedpy.load_trajectory_from_txt(trajectory_file=path),
        ".traj": lambda: pedpy.load_trajectory_from_vadere(trajectory_file=path, frame_rate=FPS),
    }[path.suffix]()
    assert loaded.frame_rate == FPS
    rows = loaded.data.sort_values(["frame", "id"])[["frame", "id", "x", "y"]].to_numpy()
    assert rows == pytest.approx([list(row[:4]) for row in ROWS], abs=1e-6)


@pytest.mark.parametrize("name", ["out.xml", "out.xml.gz"])
def test_fcd_by_an_xml_parser(converted, name):
    path = converted(name)
    with (gzip.open if name.endswith(".gz") else open)(path) as file:
        root = xml.etree.ElementTree.parse(file).getroot()
    assert root.tag == "fcd-export"
    rows = [(round(float(step.get("time")) * FPS), int(who.get("id")), float(who.get("x")), float(who.get("y")),
             float(who.get("angle"))) for step in root.findall("timestep") for who in step.findall("person")]
    assert [row[:4] for row in rows] == [row[:4] for row in ROWS]
    # SUMO: degrees clockwise from north, 0 to 360
    assert all(0 <= row[4] < 360 for row in rows)
    assert [row[4] for row in rows] == pytest.approx([(90 - math.degrees(row[4])) % 360 for row in ROWS], abs=1e-3)


def test_vadere_by_its_columns(converted):
    head, *lines = converted("out.traj").read_text().splitlines()
    assert [word.split("-PID")[0] for word in head.split()] == [
        "pedestrianId", "simTime", "endTime", "startX", "startY", "endX", "endY"]
    steps = [[float(field) for field in line.split()] for line in lines]
    ways = {(int(i), round(t0 * FPS)): (t1 * FPS, x0, y0, x1, y1) for i, t0, t1, x0, y0, x1, y1 in steps}
    assert len(ways) == len(steps) == 3 * (STEPS - 1)
    for (agent, step), way in ways.items():
        assert way == pytest.approx((step + 1, *there(step, agent)[:2], *there(step + 1, agent)[:2]), abs=1e-9)


def test_scb_by_its_bytes(converted):
    data = converted("out.scb").read_bytes()
    assert data[:4] == b"2.4\0"
    agents, step = struct.unpack_from("<if", data, 4)
    assert agents == 3 and step == pytest.approx(1 / FPS) and data[12:24] == bytes(12)
    rows = list(struct.iter_unpack("<4f", data[24:]))  # x, elevation, z, yaw
    assert len(rows) == len(ROWS)
    for (x, elevation, z, yaw), (_, _, east, north, heading) in zip(rows, ROWS):
        assert (x, elevation, z) == pytest.approx((east, 0, north), abs=1e-5)
        assert math.remainder(yaw - heading, math.tau) == pytest.approx(0, abs=1e-5)


def test_trajnet_by_json(converted):
    found = [json.loads(line) for line in converted("out.ndjson").read_text().splitlines()]
    tracks = [one["track"] for one in found if "track" in one]
    assert [(t["f"], t["p"], t["x"], t["y"]) for t in tracks] == [row[:4] for row in ROWS]
    [scene] = [one["scene"] for one in found if "scene" in one]
    assert scene == {"id": 0, "p": 1, "s": 0, "e": STEPS - 1, "fps": FPS, "tag": 0}


def test_obsmat_by_numpy(converted):
    table = pytest.importorskip("numpy").loadtxt(converted("out.txt", "--to", "obsmat"))
    assert [(f, i, x, y) for f, i, x, _, y, *_ in table] == [row[:4] for row in ROWS]
    assert (table[:, (3, 6)] == 0).all()
    for row, (_, _, _, _, heading) in zip(table, ROWS):
        assert (row[5], row[7]) == pytest.approx((0.05 * FPS * math.cos(heading), 0.05 * FPS * math.sin(heading)), abs=1e-9)

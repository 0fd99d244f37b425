"""Each format that throng reads: a good file, told by its content, and malformed twins, each an error that names
the file and where it is wrong. A format that `throng info --format` gains without twins here fails."""

import json
import re
import sqlite3
import struct

import pytest

ROWS = [(0, 1, 0.5, 1.5), (0, 2, 3.0, 4.0), (1, 1, 0.6, 1.5), (1, 2, 3.1, 4.0)]  # frame, id, x, y


def sqlite(frames="frame", version="2", fps="10"):
    def make(path):
        with sqlite3.connect(path) as database:
            database.executescript(f"""CREATE TABLE trajectory_data({frames} INTEGER, id INTEGER, pos_x REAL, pos_y REAL,
                ori_x REAL, ori_y REAL); CREATE TABLE metadata(key TEXT PRIMARY KEY, value TEXT);
                CREATE TABLE geometry(hash INTEGER, wkt TEXT); CREATE TABLE frame_data(frame INTEGER, geometry_hash INTEGER);
                INSERT INTO metadata VALUES ('version', '{version}'), ('fps', '{fps}');
                INSERT INTO geometry VALUES (7, 'POLYGON ((0 0, 9 0, 9 9, 0 9, 0 0))');
                INSERT INTO frame_data VALUES (0, 7), (1, 7);""")
            database.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?, 1, 0)", ROWS)
    return make


def text(content):
    return lambda path: path.write_text(content)


def data(content):
    return lambda path: path.write_bytes(content)


def recording(cut=None, flip=None):
    def make(path):
        viewing = pytest.importorskip("throng._viewing")
        viewing._write_columns(str(path), {name: [row[k] for row in ROWS] for k, name in enumerate(("time", "id", "x", "y"))},
                               None)
        made = bytearray(path.read_bytes())
        if flip is not None:
            made[flip] ^= 1
        path.write_bytes(made[:cut])
    return make


def hdf5(column="frame", fps=10.0):
    def make(path):
        h5py, numpy = pytest.importorskip("h5py"), pytest.importorskip("numpy")
        with h5py.File(path, "w") as file:
            rows = numpy.array([(f, i, x, y, 0) for f, i, x, y in ROWS],
                               [(column, "i8"), ("id", "i8"), ("x", "f8"), ("y", "f8"), ("z", "f8")])
            made = file.create_dataset("trajectory", data=rows)
            if fps:
                made.attrs["fps"] = fps
    return make


def scb(version=b"2.1\0", count=2, step=0.1, frames=2, tail=b""):
    agents = b"".join(struct.pack("<4f", x, y, 0, 0) for _, _, x, y in ROWS)
    return data(version + struct.pack("<if", count, step) + struct.pack("<2I", 0, 0) + agents * (frames // 2) + tail)


def lines(head, row):
    return text(head + "".join(row.format(f=f, t=f / 10, i=i, x=x, y=y) + "\n" for f, i, x, y in ROWS))


FCD = """<fcd-export>
<timestep time="0.00"><person id="ana" x="0.5" y="1.5" angle="90" speed="1"/></timestep>
<timestep time="1.00"><person id="ana" x="1.5" y="1.5" angle="{angle}" speed="1"/></timestep>
{end}"""
VADERE = "pedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1 targetId-PID2\n"
TRACKS = '{"scene": {"id": 0, "p": 1, "s": 0, "e": 10, "fps": 2.5, "tag": 0}}\n'

# format: (name of a file, good one, [(twin, words of its error)]); words "line N" where it has lines
FORMATS = {
    "jupedsim-sqlite": ("a.sqlite", sqlite(), [
        (sqlite(frames="step"), "frame"), (sqlite(fps="-1"), "-1"), (sqlite(fps="fast"), "fast"),
        (data(b"SQLite format 3\0" + bytes(200)), "a.sqlite")]),
    "archive-text": ("a.txt", lines("# framerate: 10 fps\n# id frame x/m y/m z/m\n", "{i} {f} {x} {y} 1.7"), [
        (lines("# framerate: 10 fps\n# id frame x/m y/m z/m\n", "{i} {f} {x} oops 1.7"), "line 3.*oops"),
        (lines("# framerate: 10 fps\n# id frame x/m y/m z/m\n", "{i} {f} {x}"), "line 3"),
        (lines("# framerate: never\n# id frame x/m y/m z/m\n", "{i} {f} {x} {y} 1.7"), "line 1|frame rate")]),
    "jpscore-text": ("a.txt", lines("#framerate: 10.00\n#geometry: geo.xml\n#ID\tFR\tX\tY\tZ\tA\tB\tANGLE\tCOLOR\n",
                                    "{i}\t{f}\t{x}\t{y}\t0\t0.2\t0.2\t90\t255"), [
        (lines("#framerate: 10.00\n#ID\tFR\tX\tY\tZ\tA\tB\tANGLE\tCOLOR\n", "{i}\t{f}\tx\t{y}\t0\t0.2\t0.2\t90\t255"), "line 3")]),
    "obsmat": ("obsmat.txt", lines("", "{f}.0e+00 {i}.0e+00 {x} 0.0 {y} 0.1 0.0 0.0"), [
        (lines("", "{f}.5e+00 {i}.0e+00 {x} 0.0 {y} 0.1 0.0 0.0"), "line 1")]),
    "csv": ("a.csv", lines("time_s,id,x_m,y_m\n", "{t},{i},{x},{y}"), [
        (lines("time_s,id,x_m,y_m\n", "{t},{i},{x},oops"), "line 2.*oops"), (lines("time_s,id,x_m,y_m\n", "{t},{i},{x}"), "line 2"),
        (lines("time_s,id,x_m,y_m\n", "{t},{i},nan,{y}"), "line 2"), (lines("time_s,x_m,y_m\n", "{t},{x},{y}"), "line 1.*id"),
        (lines("time_s,id,x_m,y_m\n", "0,1,{x},{y}"), "line 3.*twice")]),
    "pathfinder-csv": ("a.csv", lines('"t","id","name","active","x","y","z","v"\n"s","","","","m","m","m","m/s"\n',
                                      "{t},{i},{i:05d},1,{x},{y},0,1"), [
        (lines('"t","id","name","active","x","y","z","v"\n"s","","","","m","furlongs","m","m/s"\n',
               "{t},{i},{i:05d},1,{x},{y},0,1"), "line 2"),
        (lines('"t","id","name","active","x","y","z","v"\n"s","","","","m","m","m","m/s"\n', '{t},{i},"{i:05d},1,{x},{y},0,1'),
         "line 3.*quote")]),
    "crowdit-csv": ("a.csv", lines("pedID,time,posX,posY\n", "{i},{t},{x},{y}"), [
        (lines("pedID,time,posX,posY\n", "{i},noon,{x},{y}"), "line 2.*noon")]),
    "sumo-fcd-csv": ("a.csv", lines("timestep_time;person_id;person_x;person_y;person_angle\n", "{t};p{i};{x};{y};90"), [
        (lines("timestep_time;person_id;person_x;person_y;person_angle\n", "{t};p{i};{x};east;90"), "line 2.*east"),
        (lines("timestep_time;vehicle_id;vehicle_x;vehicle_y\n", "{t};v{i};{x};{y}"), "person_id")]),
    "vadere-traj": ("a.traj", lines(VADERE, "{i} {f} {f}.9 {x} {y} {x} {y} 1"), [
        (lines(VADERE, "{i} {f}.5 {f}.1 {x} {y} {x} {y} 1"), "line 2.*endTime"), (lines(VADERE, "{i} {f} {f}.9 {x} {y} here {y} 1"), "line 2"),
        (lines(VADERE, "{i} {f} {f}.9"), "line 2")]),
    "sumo-fcd": ("a.xml", text(FCD.format(angle=90, end="</fcd-export>")), [
        (text(FCD.format(angle="north", end="</fcd-export>")), "line 3.*north"), (text(FCD.format(angle=90, end="")), "line"),
        (text(FCD.format(angle=90, end="</wrong>")), "line 4"),
        (data(b"\x1f\x8b\x08\0\0\0\0\0\0\3" + bytes(20)), "gzip")]),
    "menge-scb": ("a.scb", scb(), [
        (scb(version=b"9.9\0"), "9.9"), (scb(count=-3), "-3"), (scb(step=0.0), "step"), (scb(frames=0), "frame")]),
    "trajnet-ndjson": ("a.ndjson", lines(TRACKS, '{{"track": {{"f": {f}, "p": {i}, "x": {x}, "y": {y}}}}}'), [
        (lines(TRACKS, '{{"track": {{"f": {f}, "p": {i}, "x": "{x}", "y": {y}}}}}'), "line 2"),
        (lines(TRACKS, '{{"track": {{"f": {f}, "p": {i}, '), "line 2")]),
    "rvo2-text": ("a.txt", text("0 (0.5,1.5) (3,4)\n0.1 (0.6,1.5) (3.1,4)\n"), [
        (text("0 (0.5,1.5) (3,4)\n0.1 (0.6,1.5) (3.1,4\n"), "line 2"), (text("0 (0.5,1.5) (3,4)\n0.1 (0.6,1.5)\n"), "line 2")]),
    "jupedsim-hdf5": ("a.h5", hdf5(), [(hdf5(column="step"), "frame"), (hdf5(fps=None), "fps|frame rate"),
                                       (data(b"\x89HDF\r\n\x1a\n" + bytes(100)), "a.h5")]),
    "throng-recording": ("a.trec", recording(), [(recording(flip=40), "damaged|byte"), (recording(cut=30), "a.trec"),
                                                 (data(b"THRONGR1" + bytes(64)), "a.trec")]),
}


def test_every_format_is_in_this_list(program):
    named = re.search(r"--format TEXT:\{([^}]*)\}", program("throng", "info", "--help").stdout)[1].split(",")
    assert sorted(named) == sorted(FORMATS)


@pytest.mark.parametrize("name", FORMATS)
def test_good_file_is_told_by_its_content(name, program, tmp_path):
    file, good, _ = FORMATS[name]
    good(tmp_path / file)
    options = {"rvo2-text": ("--source-unit", "m")}.get(name, ())
    done = program("throng", "info", file, "--json", *options)
    assert done.returncode == 0, done.stderr
    info = json.loads(done.stdout)
    assert (info["format"], info["agents"]) == (name, 1 if name == "sumo-fcd" else 2)


@pytest.mark.parametrize("name, number", [(name, number) for name, made in FORMATS.items() for number in range(len(made[2]))])
def test_malformed_twin_is_an_error_that_says_where(name, number, program, tmp_path):
    file, _, twins = FORMATS[name]
    make, words = twins[number]
    make(tmp_path / file)
    options = {"rvo2-text": ("--source-unit", "m")}.get(name, ())
    done = program("throng", "info", file, "--json", *options)
    assert done.returncode == 3 and not done.stdout, (done.returncode, done.stdout, done.stderr)
    assert file in done.stderr and re.search(words, done.stderr, re.DOTALL), done.stderr

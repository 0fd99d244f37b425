"""Megabytes per second that throng reads, against PedPy's loaders on the same files.

    python tests/bench/import_bench.py --throng build/release/bin/throng [--rounds 3] [--megabytes 40] [FILE...]

Needs PedPy (pip install pedpy) and h5py in the Python that runs it. Makes one crowd and writes it in each
format that PedPy loads; FILEs are read as well where PedPy knows them. Both sides are timed by processor
time, in turns: `throng info FILE`, a process that reads every row; and PedPy's loader in a process of its
own whose imports are not counted. What throng has no loader of PedPy's to compare with (SUMO, Menge,
recordings) is measured alone. Prints one JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import platform
import resource
import sqlite3
import statistics
import subprocess
import sys
import tempfile

import numpy as np

AREA = "POLYGON ((-10 -10, 210 -10, 210 210, -10 210, -10 -10))"


def crowd(megabytes):
    """Rows (frame, id, x, y) by id and frame: people who walk straight, 25 frames a second."""
    rows = int(megabytes * 1e6 / 34)  # of archive text
    agents = 500
    frames = max(2, rows // agents)
    rng = np.random.default_rng(3)
    start, step = rng.uniform(0, 100, (agents, 2)), rng.normal(0, 0.04, (agents, 2))
    frame = np.tile(np.arange(frames), agents)
    ids = np.repeat(np.arange(1, agents + 1), frames)
    xy = start[ids - 1] + step[ids - 1] * frame[:, None]
    return frame, ids, xy


def write_archive(path, frame, ids, xy):
    with open(path, "w") as file:
        file.write("# framerate: 25.00 fps\n# id frame x/m y/m z/m\n")
        for f, i, (x, y) in zip(frame.tolist(), ids.tolist(), xy.tolist()):
            file.write(f"{i}\t{f}\t{x:.5f}\t{y:.5f}\t1.76\n")


def write_sqlite(path, frame, ids, xy):
    with sqlite3.connect(path) as database:
        database.executescript("""CREATE TABLE trajectory_data(frame INTEGER NOT NULL, id INTEGER NOT NULL,
            pos_x REAL NOT NULL, pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL);
            CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);
            CREATE TABLE geometry(hash INTEGER NOT NULL, wkt TEXT NOT NULL);
            CREATE TABLE frame_data(frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL);""")
        database.executemany("INSERT INTO metadata VALUES (?, ?)", [("version", "2"), ("fps", "25.0")])
        database.execute("INSERT INTO geometry VALUES (1, ?)", (AREA,))
        order = np.lexsort((ids, frame))
        database.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?, 1, 0)",
                             zip(frame[order].tolist(), ids[order].tolist(), *xy[order].T.tolist()))
        database.executemany("INSERT INTO frame_data VALUES (?, 1)", [(f,) for f in range(int(frame.max()) + 1)])
        database.execute("CREATE INDEX frame_id_idx ON trajectory_data(frame, id)")


def write_hdf5(path, frame, ids, xy):
    import h5py

    rows = np.zeros(len(ids), [("id", "i8"), ("frame", "i8"), ("x", "f8"), ("y", "f8"), ("z", "f8")])
    rows["id"], rows["frame"], rows["x"], rows["y"] = ids, frame, xy[:, 0], xy[:, 1]
    with h5py.File(path, "w") as file:
        file.attrs["wkt_geometry"] = AREA
        file.create_dataset("trajectory", data=rows).attrs["fps"] = 25.0


def write_vadere(path, frame, ids, xy):
    by = np.lexsort((frame, ids))
    frame, ids, xy = frame[by], ids[by], xy[by]
    same = (ids[1:] == ids[:-1])
    with open(path, "w") as file:
        file.write("#IDXCOL=2,DATACOL=6,SEP=' '\npedestrianId simTime endTime-PID1 startX-PID1 startY-PID1 endX-PID1 endY-PID1\n")
        for k in np.flatnonzero(same).tolist():
            file.write(f"{ids[k]} {frame[k] / 25:.4f} {frame[k + 1] / 25:.4f} {xy[k, 0]:.6f} {xy[k, 1]:.6f} "
                       f"{xy[k + 1, 0]:.6f} {xy[k + 1, 1]:.6f}\n")


def write_crowdit(path, frame, ids, xy):
    with open(path, "w") as file:
        file.write("pedID,time,posX,posY\n")
        for f, i, (x, y) in zip(frame.tolist(), ids.tolist(), xy.tolist()):
            file.write(f"{i},{f / 25:.2f},{x:.5f},{y:.5f}\n")


def write_pathfinder(path, frame, ids, xy):
    with open(path, "w") as file:
        file.write('"t","id","name","active","x","y","z","v"\n"s","","","","m","m","m","m/s"\n')
        for f, i, (x, y) in zip(frame.tolist(), ids.tolist(), xy.tolist()):
            file.write(f"{f / 25:.2f},{i},{i:05d},1,{x:.5f},{y:.5f},0.0,1.0\n")


LOADERS = {  # format: PedPy's call
    "archive-text": "pedpy.load_trajectory_from_txt(trajectory_file=path)",
    "jupedsim-sqlite": "pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=path)",
    "jupedsim-hdf5": "pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=path)",
    "vadere-traj": "pedpy.load_trajectory_from_vadere(trajectory_file=path, frame_rate=25.0)",
    "crowdit-csv": "pedpy.load_trajectory_from_crowdit(trajectory_file=path)",
    "pathfinder-csv": "pedpy.load_trajectory_from_pathfinder_csv(trajectory_file=path)",
}
WRITERS = {"archive-text": (write_archive, "txt"), "jupedsim-sqlite": (write_sqlite, "sqlite"),
           "jupedsim-hdf5": (write_hdf5, "h5"), "vadere-traj": (write_vadere, "traj"),
           "crowdit-csv": (write_crowdit, "csv"), "pathfinder-csv": (write_pathfinder, "csv")}


def children_cpu_s():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def throng_cpu_s(throng, path):
    before = children_cpu_s()
    done = subprocess.run([throng, "info", str(path), "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return children_cpu_s() - before, json.loads(done.stdout)


def pedpy_cpu_s(kind, path):
    """Processor time and rows; None where this PedPy cannot read the file."""
    program = ("import pathlib, sys, time, warnings\nwarnings.simplefilter('ignore')\nimport pedpy\n"
               "path = pathlib.Path(sys.argv[1])\nbegin = time.process_time()\n"
               f"data = {LOADERS[kind]}.data\nprint(time.process_time() - begin, len(data))\n")
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True)
    if done.returncode != 0:
        return None, done.stderr.strip().splitlines()[-1:] or ["failed"]
    seconds, rows = done.stdout.split()[-2:]
    return float(seconds), int(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    parser.add_argument("--throng", default="throng")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--megabytes", type=float, default=40.0, help="of the archive text; others follow")
    arguments = parser.parse_args()
    results = []
    with tempfile.TemporaryDirectory() as folder:
        rows = crowd(arguments.megabytes)
        files = list(arguments.files)
        for kind, (write, ending) in WRITERS.items():
            files.append(pathlib.Path(folder, f"{kind}.{ending}"))
            write(files[-1], *rows)
        for path in files:
            ours, theirs, note = [], [], None
            for _ in range(arguments.rounds):
                seconds, info = throng_cpu_s(arguments.throng, path)
                ours.append(seconds)
                if info["format"] in LOADERS and note is None:
                    other, count = pedpy_cpu_s(info["format"], path)
                    if other is None:
                        note = count[0]
                    else:
                        theirs.append(other)
            megabytes = path.stat().st_size / 1e6
            result = {"file": path.name, "format": info["format"], "megabytes": round(megabytes, 1),
                      "agents": info["agents"], "frames": info["frames"],
                      "throng_mb_per_cpu_s": round(megabytes / statistics.median(ours), 1)}
            if theirs:
                result["pedpy_mb_per_cpu_s"] = round(megabytes / statistics.median(theirs), 1)
                result["ratio"] = round(statistics.median(t / o for t, o in zip(theirs, ours)), 2)
            if note:
                result["pedpy_cannot"] = note
            results.append(result)
            print(json.dumps(result), file=sys.stderr, flush=True)
    print(json.dumps({"machine": {"cpu": platform.processor() or platform.machine(), "cores": os.cpu_count(),
                                  "load": os.getloadavg()[0]}, "rounds": arguments.rounds, "results": results}, indent=1))


if __name__ == "__main__":
    main()

"""Frames a second that one viewer of a live crowd gets from the default server, with 1,000 to 10,000 agents.

Agents walk circles, one on two square metres, published ten times a second through the Python producer; the
viewer is `throng watch` at 1280x720 from the overview, where everybody is in view. The server has its default
settings, so its controller picks the vertex budget N. The goal is 25 frames a second on two cores.
Usage: .venv/bin/python tests/bench/view_bench.py [--agents N,N,...] [--seconds N] [--json FILE]
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import threading

import numpy as np
import throng

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/client/browser"))

from conftest import BIN, Server  # noqa: E402


def publish(address, agents, stop):
    side = int(np.ceil(np.sqrt(agents)))
    index = np.arange(agents)
    centres = np.stack([index % side, index // side], axis=1) * 1.4
    start = np.random.default_rng(1).uniform(0, 2 * np.pi, agents)
    with throng.connect(address, "bench") as publisher:
        step = 0
        while not stop.is_set():
            angle = start + 0.13 * step  # 1.3 m/s on a circle of 1 m
            xy = centres + np.stack([np.cos(angle), np.sin(angle)], axis=1)
            publisher.publish(t=step * 0.1, ids=index, positions=xy)
            step += 1
            stop.wait(0.1)


def measure(agents, seconds):
    server = Server(budget=None)
    stop = threading.Event()
    producer = threading.Thread(target=publish, args=(server.address, agents, stop))
    producer.start()
    try:
        watch = subprocess.run(
            [str(BIN / "throng"), "watch", "--server", server.address, "--crowd", "bench", "--size", "1280x720",
             "--quality", "75", "--seconds", str(seconds)],
            capture_output=True, text=True, timeout=seconds + 120, check=True)
    finally:
        stop.set()
        producer.join()
        server.stop()
    seconds_seen = [{name: float(value) for name, value in re.findall(r"(\w+)=([0-9.]+)", line)}
                    for line in watch.stdout.splitlines()][4:]  # the controller has settled by then
    if not seconds_seen:
        sys.exit(f"view_bench: no line of numbers in {seconds} s")
    rates = sorted(second["fps"] for second in seconds_seen)
    vertices = sorted(second["vertices"] for second in seconds_seen)
    server_ms = sorted(second["server"] for second in seconds_seen)
    middle = len(rates) // 2
    return {"agents": agents, "visible": int(seconds_seen[-1]["visible"]), "fps_median": rates[middle],
            "fps_lowest_second": rates[0], "vertices_median": int(vertices[middle]),
            "server_ms_median": server_ms[middle]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", default="1000,2000,5000,10000")
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    rows = []
    load = os.getloadavg()[0]
    for agents in map(int, options.agents.split(",")):
        rows.append(measure(agents, options.seconds))
        print("  ".join(f"{name} {value}" for name, value in rows[-1].items()), flush=True)
    if options.json:
        options.json.write_text(json.dumps(
            {"size": "1280x720", "cores": os.cpu_count(), "load_at_start": load, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()

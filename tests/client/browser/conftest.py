"""A real server, a real producer and a real browser."""

import math
import os
import pathlib
import re
import signal
import subprocess
import sys

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import devtools  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[3]
BUILD = pathlib.Path(os.environ.get("THRONG_BUILD_DIR", ROOT / "build/release"))
BIN = pathlib.Path(os.environ.get("THRONG_BIN", BUILD / "bin"))


class Server:
    """throng-server, with the page that was compiled in."""

    def __init__(self, *arguments, listen="127.0.0.1:0", http="127.0.0.1:0", budget=40_000):
        self.process = subprocess.Popen(
            [str(BIN / "throng-server"), "--listen", listen, "--http", http,
             *(["--vertex-budget", str(budget)] if budget else []), *arguments],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        lines = []
        for line in self.process.stdout:
            lines.append(line)
            if line.startswith("throng-server ready on "):
                break
        text = "".join(lines)
        self.page = re.search(r"page at (\S+)", text).group(1)
        self.address = re.search(r"ready on ([^ ,]+)", text).group(1)

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=60)
        self.process.stdout.close()


def walkers(path, count=30, seconds=20.0, rate=10.0, ring_m=0.25):
    """People on circles around the origin, with their speed as a channel."""
    rows = ["time,id,x,y,speed"]
    for step in range(int(seconds * rate)):
        t = step / rate
        for i in range(count):
            radius, turn = 2.0 + ring_m * i, (0.3 + 0.01 * (i % 30)) * (-1) ** i
            angle = i * 2.4 + turn * t
            rows.append(f"{t:.2f},{i + 1},{radius * math.cos(angle):.3f},{radius * math.sin(angle):.3f},"
                        f"{abs(turn) * radius:.3f}")
    path.write_text("\n".join(rows) + "\n")
    return path


class Producer:
    def __init__(self, server, file, crowd, *arguments):
        self.process = subprocess.Popen(
            [str(BIN / "throng"), "publish", str(file), "--server", server.address, "--crowd", crowd, "--loop", *arguments],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=60)


@pytest.fixture(scope="session")
def walk_file(tmp_path_factory):
    return walkers(tmp_path_factory.mktemp("walk") / "walk.csv")


@pytest.fixture(scope="session")
def browser():
    if devtools.find_chromium() is None:
        pytest.skip("no chromium (Debian package chromium)")
    running = devtools.Browser()
    yield running
    running.close()


@pytest.fixture(scope="module")
def server():
    running = Server()
    yield running
    running.stop()


@pytest.fixture(scope="module")
def station(server, walk_file):
    """The server with one live crowd."""
    producer = Producer(server, walk_file, "station")
    yield server
    producer.stop()


@pytest.fixture
def page(browser, station):
    """A tab that shows the crowd; at the end nothing may have gone wrong in it."""
    opened = browser.page()
    opened.open(station.page)
    opened.wait("document.body.dataset.frame")
    yield opened
    errors = list(opened.errors)
    opened.close()
    assert errors == []

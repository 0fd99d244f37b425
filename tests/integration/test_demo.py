"""deploy/demo from the outside, shortened: a real simulator, a real server, a real recording."""

import os
import pathlib
import re
import signal
import subprocess
import time

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SMALL = ("--agents", "80", "--size", "640x360")


@pytest.fixture
def kept_recording():
    """Puts back the recording that was there before."""
    kept = {path: path.read_bytes() for path in (ROOT / "demo.mp4", ROOT / "demo.jpg") if path.exists()}
    yield
    for path in (ROOT / "demo.mp4", ROOT / "demo.jpg"):
        path.unlink(missing_ok=True)
        if path in kept:
            path.write_bytes(kept[path])


def running_servers():
    names = []
    for folder in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            names.append((folder / "cmdline").read_bytes().split(b"\0")[0].decode())
        except OSError:
            continue  # it ended meanwhile
    return sum(name.startswith(str(ROOT)) or name.startswith("build/release") for name in names)


def test_demo_shows_a_simulated_crowd(kept_recording):
    before = running_servers()
    demo = subprocess.run([str(ROOT / "deploy/demo"), "--seconds", "5", *SMALL], cwd=ROOT, capture_output=True,
                          text=True, timeout=600)
    assert demo.returncode == 0, demo.stdout + demo.stderr
    assert b"ftyp" in (ROOT / "demo.mp4").read_bytes()[:64]
    picture = (ROOT / "demo.jpg").read_bytes()
    assert picture[:2] == b"\xff\xd8" and len(picture) > 10_000
    assert "demo.mp4" in demo.stdout and "demo.jpg" in demo.stdout
    assert re.search(r"[1-9]\d* (agents|people)", demo.stdout), demo.stdout
    assert running_servers() == before


def test_interrupted_demo_leaves_nothing_running(kept_recording):
    before = running_servers()
    demo = subprocess.Popen([str(ROOT / "deploy/demo"), "--seconds", "60", *SMALL], cwd=ROOT, stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, text=True, start_new_session=True)
    deadline = time.monotonic() + 300
    while running_servers() < before + 3 and demo.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
    assert demo.poll() is None, demo.stdout.read()
    os.kill(demo.pid, signal.SIGINT)
    demo.communicate(timeout=120)
    assert demo.returncode == 130
    assert running_servers() == before

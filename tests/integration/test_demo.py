"""deploy/demo from the outside, shortened: a real simulator, a real server, a real recording."""

import os
import pathlib
import re
import signal
import subprocess

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


def processes_of_session(session):
    """Ids of the live processes of a session: whatever a demo started, its own shell left out."""
    found = []
    for folder in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue  # it ended meanwhile
        if int(fields[3]) == session and int(folder.name) != session and fields[0] != "Z":
            found.append(int(folder.name))
    return found


def start_demo(seconds):
    return subprocess.Popen([str(ROOT / "deploy/demo"), "--seconds", str(seconds), *SMALL], cwd=ROOT, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True)


def test_demo_shows_a_simulated_crowd(kept_recording):
    demo = start_demo(5)
    out, _ = demo.communicate(timeout=600)
    assert demo.returncode == 0, out
    assert b"ftyp" in (ROOT / "demo.mp4").read_bytes()[:64]
    picture = (ROOT / "demo.jpg").read_bytes()
    assert picture[:2] == b"\xff\xd8" and len(picture) > 10_000
    assert "demo.mp4" in out and "demo.jpg" in out
    assert re.search(r"[1-9]\d* (agents|people)", out), out
    assert processes_of_session(demo.pid) == []


def test_interrupted_demo_leaves_nothing_running(kept_recording):
    demo = start_demo(120)
    lines = []
    for line in demo.stdout:
        lines.append(line)
        if line.startswith("== record"):
            break
    assert demo.poll() is None, "".join(lines)
    assert len(processes_of_session(demo.pid)) >= 2, "a server and a simulator"
    os.kill(demo.pid, signal.SIGINT)
    out, _ = demo.communicate(timeout=120)
    assert demo.returncode == 130, "".join(lines) + out
    assert processes_of_session(demo.pid) == []

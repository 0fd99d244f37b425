"""deploy/demo's own work, with stand-ins for everything it builds and starts: what it starts, it ends."""

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

# Stand-ins note their process id; the long-running ones have a child, as a real program may.
LONG_RUNNING = '#!/usr/bin/env bash\necho $$ >>"$FAKE/pids"\n{ready}\nsleep 300 &\necho $! >>"$FAKE/pids"\nwait\n'
PROGRAMS = {
    "throng-bake": '#!/usr/bin/env bash\necho baked >>"$FAKE/baked"\nmkdir -p "${@: -1}"\n',
    "throng-server": LONG_RUNNING.format(ready="echo 'throng-server ready on 127.0.0.1:4711, cast of 3'"),
    "throng": '#!/usr/bin/env bash\necho $$ >>"$FAKE/pids"\necho "$*" >>"$FAKE/throng"\n'
              '[ ! -e "$FAKE/slow" ] || sleep 300\n'
              'echo "hall 2.0 s, 40 frames, 0 skipped, 220 agents, server 30 ms" >&2\n'
              'echo "throng record: 40 frames, 2.0 s, 1 skipped" >&2\necho picture >"${@: -1}"\n',
}
SIMULATOR = LONG_RUNNING.format(ready="echo \"crowd 'jupedsim' is live, 220 people\"")
CMAKE = '#!/usr/bin/env bash\nmkdir -p build/release/bin\ncp "$FAKE"/bin/* build/release/bin/\n'


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


@pytest.fixture
def demo(tmp_path):
    """Starts the demo in a tree of stand-ins; returns a function that does so and the stand-ins' folder."""
    tree, fake = tmp_path / "tree", tmp_path / "fake"
    write(tree / "deploy/demo", (ROOT / "deploy/demo").read_text())
    write(tree / "deploy/setup", "#!/usr/bin/env bash\n")
    write(tree / ".venv/bin/python", SIMULATOR)
    write(fake / "path/cmake", CMAKE)
    for name, text in PROGRAMS.items():
        write(fake / "bin" / name, text)
    environment = {**os.environ, "FAKE": str(fake), "PATH": f"{fake / 'path'}:{os.environ['PATH']}"}

    def start(*arguments):
        return subprocess.Popen([tree / "deploy/demo", *arguments], env=environment, text=True,
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler))

    return start, tree, fake


def running(fake):
    """Process ids of stand-ins that still run."""
    pids = (fake / "pids").read_text().split() if (fake / "pids").exists() else []
    return [pid for pid in pids if Path(f"/proc/{pid}/status").exists()
            and "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()]


def test_demo_ends_with_pictures_and_without_processes(demo):
    start, tree, fake = demo
    process = start("--seconds", "2")
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert err == ""
    assert (tree / "demo.mp4").exists() and (tree / "demo.jpg").exists()
    assert "40 frames in 2.0 s (20.0 per second), 1 skipped, 220 people" in out
    assert "127.0.0.1:4711" in (fake / "throng").read_text()
    assert running(fake) == []


@pytest.mark.parametrize("number, code", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signal_while_recording_ends_every_process(demo, number, code):
    start, _, fake = demo
    (fake / "slow").touch()
    process = start()
    deadline = time.monotonic() + 30
    while not (fake / "throng").exists() and time.monotonic() < deadline:
        os.sched_yield()
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == code
    assert "stopped during: record" in err
    assert running(fake) == []


@pytest.mark.parametrize("program, step, log", [
    ("throng-bake", "bake the built-in cast", "bake.log"),
    ("throng-server", "start throng-server", "server.log"),
    ("throng", "record 30 s", "record.log")])
def test_failure_names_step_and_log_and_ends_every_process(demo, program, step, log):
    start, _, fake = demo
    write(fake / "bin" / program, "#!/usr/bin/env bash\necho it broke because of X >&2\nexit 3\n")
    process = start()
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert f"failed at: {step}" in err and f"build/demo/{log}" in err and "it broke because of X" in err
    assert running(fake) == []


@pytest.mark.parametrize("arguments", [["--seconds", "0"], ["--seconds", "x"], ["--seconds"], ["--agents", "-1"],
                                       ["--size", "big"], ["--fast"]])
def test_wrong_usage_exits_with_2_before_anything_is_started(demo, arguments):
    start, _, fake = demo
    process = start(*arguments)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2 and "deploy/demo: " in err
    assert not (fake / "baked").exists()


def test_help_names_every_flag(demo):
    start, _, _ = demo
    out, _ = start("--help").communicate(timeout=60)
    assert all(flag in out for flag in ("--seconds", "--agents", "--size", "--help"))


def test_setup_refuses_unknown_arguments():
    result = subprocess.run([ROOT / "deploy/setup", "--everything"], capture_output=True, text=True, timeout=60)
    assert result.returncode == 2 and "--everything" in result.stderr

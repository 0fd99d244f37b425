"""throng-view as a whole: a hidden window, a real server, scripted mouse and keys, screenshots."""

import json
import math
import os
import pathlib
import re
import signal
import subprocess

import numpy as np
import pytest
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[3]
BIN = pathlib.Path(os.environ.get("THRONG_BIN", ROOT / "build/release/bin"))
VIEW = BIN / "throng-view"
pytestmark = pytest.mark.skipif(not VIEW.exists(), reason="throng-view was not built (libsdl2-dev, libimgui-dev)")


class Server:
    def __init__(self, listen="127.0.0.1:0"):
        self.process = subprocess.Popen([BIN / "throng-server", "--listen", listen, "--vertex-budget", "30000"],
                                        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        for line in self.process.stdout:
            if match := re.search(r"ready on ([^ ,]+)", line):
                self.address = match.group(1).strip()
                break
        self.producers = []

    def publish(self, file, crowd):
        self.producers.append(subprocess.Popen(
            [BIN / "throng", "publish", file, "--server", self.address, "--crowd", crowd, "--loop"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    def stop(self):
        for process in [*self.producers, self.process]:
            process.send_signal(signal.SIGTERM)
        for process in [*self.producers, self.process]:
            process.wait(timeout=60)
        self.process.stdout.close()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crowds")
    steps = [step / 10 for step in range(300)]
    (folder / "ring.csv").write_text("time,id,x,y,speed\n" + "".join(
        f"{t:.1f},{i + 1},{4 * math.cos(i + 0.25 * t):.3f},{4 * math.sin(i + 0.25 * t):.3f},{i / 4}\n"
        for t in steps for i in range(6)))
    (folder / "one.csv").write_text("time,id,x,y\n" + "".join(f"{t:.1f},42,7.0,3.0\n" for t in steps))
    return folder


@pytest.fixture(scope="module")
def server(files):
    running = Server()
    running.publish(files / "ring.csv", "ring")
    running.publish(files / "one.csv", "one")
    yield running
    running.stop()


@pytest.fixture
def view(server, tmp_path):
    """Plays a script and returns the states that it wrote, and the last."""

    def run(script, *arguments, crowd="ring", code=0):
        (tmp_path / "script.txt").write_text(script)
        result = subprocess.run([VIEW, "--server", server.address, "--crowd", crowd, "--size", "640x360", "--script",
                                 "script.txt", "--json", *arguments], cwd=tmp_path, capture_output=True, text=True,
                                env={**os.environ, "SDL_VIDEODRIVER": "dummy"}, timeout=300)
        assert result.returncode == code, result.stderr
        if code:
            return result.stderr
        written = tmp_path / "states.jsonl"
        states = [json.loads(line) for line in written.read_text().splitlines()] if written.exists() else []
        return [*states, json.loads(result.stdout)]

    return run


def picture(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def test_mouse_turns_moves_and_zooms_to_the_pointer(view):
    start, turned, moved, nearer = view("""
        wait frames>1
        state states.jsonl
        drag 320 200 420 240
        wait frames>3
        state states.jsonl
        drag 320 200 380 200 right
        wait frames>5
        state states.jsonl
        wheel 3 500 260
        wait frames>7""")
    assert start["overview"] and not turned["overview"]
    assert turned["yaw_rad"] == pytest.approx(start["yaw_rad"] - 0.6, abs=0.05)
    assert turned["pitch_rad"] == pytest.approx(start["pitch_rad"] + 0.24, abs=0.05)
    assert turned["target"] == pytest.approx(start["target"], abs=0.3)
    assert math.dist(moved["target"], turned["target"]) > 0.5
    assert moved["yaw_rad"] == turned["yaw_rad"]
    assert nearer["distance_m"] < 0.7 * moved["distance_m"]
    assert math.dist(nearer["target"], moved["target"]) > 0.2, "the point under the pointer stays"


def test_keys_fly_turn_and_look_from_above(view, tmp_path):
    start, flown, above, back = view("""
        wait frames>1
        drag 320 200 330 200
        state states.jsonl
        press w
        wait frames>6
        release w
        state states.jsonl
        key t
        wait gliding=false
        wait frames>9
        screenshot above.png
        state states.jsonl
        key t
        wait gliding=false
        key f
        wait overview=true""")
    ahead = [-math.cos(start["yaw_rad"]), -math.sin(start["yaw_rad"])]
    way = [flown["target"][0] - start["target"][0], flown["target"][1] - start["target"][1]]
    assert way[0] * ahead[0] + way[1] * ahead[1] > 0.95 * math.hypot(*way) > 0
    assert above["ortho"] and above["pitch_rad"] == pytest.approx(math.pi / 2)
    assert back["overview"] and not back["ortho"]
    assert picture(tmp_path / "above.png").shape == (360, 640, 3)


def test_a_click_follows_and_escape_lets_go(view):
    following, free = view("""
        wait frames>1
        click 320 180
        wait followed=42
        wait card=42
        wait frames>6
        state states.jsonl
        key Escape
        wait followed=0""", crowd="one")
    assert following["follow"] == 42 and following["distance_m"] <= 12.0
    assert following["target"][:2] == pytest.approx([7.0, 3.0], abs=0.05)
    assert free["follow"] == 0 and free["card"] == 0


def test_time_stops_steps_goes_back_and_returns_to_the_live_edge(view):
    paused, stepped, slow, sought, live = view("""
        wait time_s>3
        key Space
        wait settled=true
        state states.jsonl
        key ,
        wait settled=true
        key ,
        wait settled=true
        state states.jsonl
        key [
        key Space
        wait settled=true
        state states.jsonl
        key Space
        wait settled=true
        click 232 322
        wait time_s<1
        wait settled=true
        state states.jsonl
        key l
        wait settled=true
        wait live=true""")
    assert not paused["live"]
    assert stepped["time_s"] < paused["time_s"]
    assert slow["speed"] == 0.5 and not slow["live"]
    assert sought["time_s"] < 1 and not sought["live"], "a click on the time line's beginning"
    assert live["live"] and live["speed"] == 1.0


def test_colours_and_overlays_are_drawn(view, tmp_path):
    plain, coloured = view("""
        wait frames>2
        key Space
        wait paused=true
        wait frames>4
        screenshot plain.png
        state states.jsonl
        key c
        wait channel=speed
        key i
        key g
        key b
        key k
        key m
        key v
        wait agent_columns=6
        wait frames>8
        screenshot coloured.png""")
    assert plain["overlays"] == [] and plain["channel"] == ""
    assert coloured["overlays"] == ["ids", "trails", "density", "grid", "scale", "time"]
    assert (coloured["low"], coloured["high"]) == (0.0, 1.5), "the range of who is in view"
    changed = (picture(tmp_path / "plain.png") != picture(tmp_path / "coloured.png")).any(axis=2)
    assert changed[:300].mean() > 0.05
    assert changed[240:300, 12:160].any(), "scale bar and time stamp"
    assert changed[240:300, 470:].any(), "legends"


def test_panels_open_by_key_and_by_button(view, tmp_path):
    view("""
        wait frames>2
        key Space
        wait paused=true
        wait frames>5
        screenshot closed.png
        key x
        wait frames>5
        screenshot numbers.png
        key x
        click 310 34
        screenshot display.png
        click 310 34
        key ?
        screenshot help.png
        key Escape
        wheel 0 320 200
        screenshot again.png""")
    closed = picture(tmp_path / "closed.png")

    def changed(name):
        return (abs(picture(tmp_path / name) - closed) > 30).any(axis=2)

    assert changed("numbers.png")[70:300, 12:280].mean() > 0.7
    assert changed("display.png")[70:300, 360:620].mean() > 0.7
    assert changed("help.png")[60:300, 150:490].mean() > 0.7
    assert changed("again.png")[70:300].mean() < 0.05


def test_the_picture_fits_the_window_and_p_saves_it(view, tmp_path):
    *_, last = view("""
        wait frames>1
        size 512 512
        wait width_px=512
        wait height_px=512
        key p
        wheel 0 1 1
        screenshot whole.png""", "--pictures", str(tmp_path))
    assert (last["width_px"], last["height_px"]) == (512, 512)
    saved = [path for path in tmp_path.glob("ring-*.png")]
    assert len(saved) == 1 and Image.open(saved[0]).size == (512, 512)


@pytest.mark.parametrize("sharpness, factor", [("half", 0.5), ("normal", 1), ("fine", 2)])
def test_sharpness_is_pixels_for_each_of_the_windows(view, sharpness, factor):
    last = view("wait frames>1", "--sharpness", sharpness)[-1]
    assert last["width_px"] == pytest.approx(640 * factor, abs=8)
    assert last["height_px"] == pytest.approx(360 * factor, abs=8)


def test_r_records_a_video_until_the_size_changes(view, tmp_path):
    view("""
        wait frames>2
        key r
        wait frames>5
        key r
        wait frames>7
        key r
        wait frames>9
        size 320 240
        wait width_px=320
        wait frames>14""", "--pictures", str(tmp_path))
    videos = sorted(tmp_path.glob("ring-*.mp4"))
    assert len(videos) == 2 and all(b"ftyp" in video.read_bytes()[:64] for video in videos)


def test_a_screenshot_needs_no_script(server, tmp_path):
    result = subprocess.run([VIEW, "--server", server.address, "--crowd", "one", "--size", "320x200", "--screenshot",
                             "one.png", "--overlays", "time"], cwd=tmp_path, capture_output=True, text=True,
                            env={key: value for key, value in os.environ.items() if key != "SDL_VIDEODRIVER"})
    assert result.returncode == 0, result.stderr
    assert Image.open(tmp_path / "one.png").size == (320, 200)


def test_it_comes_back_with_a_banner_after_the_server_was_away(files, tmp_path):
    first = Server()
    first.publish(files / "ring.csv", "ring")
    (tmp_path / "script.txt").write_text("""
        wait frames>1
        drag 320 200 420 200
        wait frames>3
        state /dev/stdout
        wait link=lost
        screenshot lost.png
        state /dev/stdout
        wait link=open
        wait frames>8
        wait banner=
        state /dev/stdout""")
    process = subprocess.Popen([VIEW, "--server", first.address, "--size", "640x360", "--script", "script.txt"],
                               cwd=tmp_path, stdout=subprocess.PIPE, text=True,
                               env={**os.environ, "SDL_VIDEODRIVER": "dummy"})
    with process:
        seen = json.loads(process.stdout.readline())
        first.stop()
        lost = json.loads(process.stdout.readline())
        second = Server(first.address)
        second.publish(files / "ring.csv", "ring")
        back = json.loads(process.stdout.readline())
        assert process.wait(timeout=120) == 0
    second.stop()
    assert "Trying again" in lost["banner"]
    assert back["crowd"] == "ring" and back["yaw_rad"] == pytest.approx(seen["yaw_rad"], abs=1e-6)
    banner = picture(tmp_path / "lost.png")[70:100, 200:440]
    assert (banner.max(axis=2) < 90).mean() > 0.5, "a dark plate over the picture that was last seen"


@pytest.mark.parametrize("arguments, code, words", [
    (("--size", "10x10"), 2, "--size"),
    (("--overlays", "ids,clocks"), 2, "'clocks'"),
    (("--script", "nowhere.txt"), 2, "nowhere.txt"),
    (("--server", "ftp://x:1"), 2, "ftp://x:1"),
    (("--screenshot", "a.png", "--patience", "0.5", "--server", "127.0.0.1:9"), 1, "no picture within 0.5 s"),
])
def test_what_can_not_be_is_one_clear_error(tmp_path, arguments, code, words):
    result = subprocess.run([VIEW, *arguments], cwd=tmp_path, capture_output=True, text=True,
                            env={**os.environ, "SDL_VIDEODRIVER": "dummy"}, timeout=60)
    assert result.returncode == code, result.stderr
    assert words in result.stderr


def test_a_script_that_waits_in_vain_says_for_what(view):
    assert "wait followed=7" in view("wait frames>1\nwait followed=7", "--patience", "1", code=1)
    assert "wait: 'nobody=7'" in view("wait nobody=7", code=2)
    assert "line 2: 'jump'" in view("key t\njump", code=2)

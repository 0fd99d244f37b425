"""One spelling of cameras in every program: throng record, snapshot and throng-render."""

import json
import re
import subprocess

import numpy as np
import pytest
import throng
from PIL import Image

from conftest import BUILD

CAMERAS = ["overview", "top", "orbit", "follow:7", "1,-9,4:0,0,1", "path.json"]


@pytest.fixture(scope="module")
def url():
    process = subprocess.Popen([str(BUILD / "bin/throng-server"), "--listen", "127.0.0.1:0", "--log-level", "off",
                                "--vertex-budget", "20000"], stdout=subprocess.PIPE, text=True)
    for line in process.stdout:
        if ready := re.match(r"throng-server ready on (\S+),", line):
            break
    ids = np.arange(1, 21)
    xy = np.stack([ids % 5 * 2.0 - 4, ids // 5 * 2.0 - 4], axis=1)
    with throng.connect(ready[1], "hall", queue_frames=20) as crowd:
        for step in range(20):
            crowd.publish(t=step * 0.1, ids=ids, positions=xy + 0.05 * step)
        assert crowd.close(60.0), crowd.stats
    yield ready[1]
    process.terminate()
    assert process.wait() == 0


@pytest.fixture
def files(tmp_path):
    (tmp_path / "path.json").write_text(json.dumps({"keys": [
        {"time_s": 0, "eye": [-9, 0, 3], "target": [0, 0, 1]}, {"time_s": 5, "eye": [9, 0, 3], "target": [0, 0, 1]}]}))
    return tmp_path


def test_each_camera_shows_its_own_picture_now_and_then(program, url, files):
    pictures = []
    for camera in CAMERAS:
        for moment in ((), ("--time", "0.5")):
            done = program("throng", "snapshot", "--crowd", "hall", "--camera", camera, "--size", "320x180", "-o",
                           "one.png", *moment, THRONG_URL=url)
            assert done.returncode == 0, (camera, done.stderr)
            pictures.append(np.asarray(Image.open(files / "one.png").convert("RGB")).astype(int))
    for i, one in enumerate(pictures):
        assert one.std() > 5, CAMERAS[i // 2]
        for other in pictures[:i]:
            assert np.abs(one - other).max() > 20, "no two are the same"


def test_each_color_map_has_colours_of_its_own(program, url, files):
    names = ("viridis", "plasma", "inferno", "magma", "cividis")
    pictures = set()
    for name in names:
        done = program("throng", "snapshot", "--crowd", "hall", "--camera", "top", "--size", "160x90", "-o", "one.png",
                       "--time", "0.5", "--channel", "speed", "--color-map", name, THRONG_URL=url)
        assert done.returncode == 0, (name, done.stderr)
        pictures.add((files / "one.png").read_bytes())
    assert len(pictures) == len(names)


def test_record_takes_the_same_cameras(program, url, files):
    for camera in CAMERAS:
        done = program("throng", "record", "--crowd", "hall", "--camera", camera, "--size", "160x90", "-o", "one.jpg",
                       THRONG_URL=url)
        assert done.returncode == 0, (camera, done.stderr)


@pytest.mark.parametrize("camera", ["top", "overview"])
def test_snapshot_waits_for_a_crowd_that_comes_later(url, files, camera):
    waiting = subprocess.Popen([BUILD / "bin/throng", "snapshot", "--server", url, "--crowd", f"late-{camera}", "--camera",
                                camera, "--size", "160x90", "-o", "late.png", "--wait", "60"], cwd=files,
                               stderr=subprocess.PIPE, text=True)
    with pytest.raises(subprocess.TimeoutExpired):
        waiting.wait(1.0)
    with throng.connect(url, f"late-{camera}") as crowd:
        crowd.publish(t=0.0, ids=[1], positions=[[0.0, 0.0]])
        said = waiting.communicate()[1]
    assert waiting.returncode == 0, said


def test_snapshot_of_a_crowd_that_does_not_come_says_that_it_is_not_there(program, url, files):
    done = program("throng", "snapshot", "--crowd", "nobody", "-o", "a.png", "--camera", "top", "--wait", "0.5",
                   THRONG_URL=url)
    assert done.returncode == 1
    assert "there is no crowd 'nobody'" in done.stderr


@pytest.mark.parametrize("command", [("snapshot", "-o", "a.png"), ("record", "-o", "a.mp4")])
def test_whom_no_camera_can_follow_is_said(program, url, files, command):
    done = program("throng", *command, "--crowd", "hall", "--camera", "follow:999", THRONG_URL=url)
    assert done.returncode == 1
    assert re.search(r"there is no agent 999 in (crowd )?'hall'", done.stderr)


@pytest.mark.parametrize("arguments, words", [
    (("throng", "snapshot", "--crowd", "x", "-o", "a.png", "--camera", "1,2,3"), "'1,2,3' can't be opened"),
    (("throng", "record", "--crowd", "x", "-o", "a.mp4", "--channel-range", "2"), "--channel-range: '2'"),
    (("throng", "info", "x.csv", "--source-unit", "furlong"), "--source-unit: 'furlong'"),
    (("throng-render", "--synthetic", "5", "-o", "a.png", "--channel-range", "1:1"), "--channel-range: '1:1'"),
    (("throng-render", "x.csv", "-o", "a.png", "--source-unit", "0"), "--source-unit: '0'"),
    (("throng-server", "--record-sync-ms", "-1"), "--record-sync-ms"),
])
def test_an_option_that_makes_no_sense_is_refused_by_program_and_name(program, arguments, words):
    done = program(*arguments)
    assert done.returncode == 2
    assert done.stderr.startswith(arguments[0] + ": "), done.stderr
    assert words in done.stderr

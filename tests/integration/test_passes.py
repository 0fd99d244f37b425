"""Depth, agent ids and boxes of throng-render, read back by OpenEXR's own package."""

import json

import numpy as np
import pytest

OpenEXR = pytest.importorskip("OpenEXR")

WIDTH, HEIGHT = 320, 180
SMALL = ("--size", f"{WIDTH}x{HEIGHT}", "--vertex-budget", "40000", "--no-walls")
HUGE = 2**64 - 5  # ids are 64 bits wide
AGENTS = {3: (0.0, 0.0), 8: (2.0, 0.0), HUGE: (0.1, 1.2)}  # the last stands behind the first


@pytest.fixture
def crowd(tmp_path):
    """Three people who stand; the camera looks north from 8 m south of them."""
    (tmp_path / "crowd.csv").write_text("time,id,x,y\n" + "".join(
        f"{time},{agent},{x},{y}\n" for time in (0, 1) for agent, (x, y) in AGENTS.items()))
    (tmp_path / "camera.json").write_text(json.dumps({"eye": [0, -8, 1.6], "target": [0, 0, 1.2]}))
    (tmp_path / "top.json").write_text(json.dumps({"eye": [1, 0, 50], "target": [1, 0, 0], "ortho_height_m": 6}))
    return ("crowd.csv", "--camera", "camera.json", "--fps", 2, *SMALL)


def read(path):
    return {name: channel.pixels for name, channel in OpenEXR.File(str(path), separate_channels=True).channels().items()}


def agents_of(path):
    """[height, width] agent ids as Python sees them; None where there is no agent."""
    channels = read(path)
    assert {channels[name].dtype for name in ("id", "id_high", "class")} == {np.dtype(np.uint32)}
    ids = channels["id"].astype(np.uint64) | channels["id_high"].astype(np.uint64) << np.uint64(32)
    return {agent: mask for agent in AGENTS if (mask := (ids == np.uint64(agent)) & (channels["class"] == 1)).any()}


def boxes_of(path):
    boxes = {}
    for line in path.read_text().splitlines():
        frame, agent, left, top, width, height, *rest = line.split(",")
        assert rest == ["1", "-1", "-1", "-1"]
        boxes.setdefault(int(frame), {})[int(agent)] = tuple(map(int, (left, top, width, height)))
    return boxes


def box_of(mask):
    rows, columns = np.nonzero(mask)
    left, top = columns.min(), rows.min()
    return left + 1, top + 1, columns.max() - left + 1, rows.max() - top + 1


def test_boxes_are_those_of_the_pixels_that_show_an_agent(program, crowd, tmp_path):
    result = program("throng-render", *crowd, "-o", "{pass}/#.png", "--passes", "color,depth,id", "--boxes", "gt.txt")
    assert result.returncode == 0, result.stderr
    boxes = boxes_of(tmp_path / "gt.txt")
    assert list(boxes) == [1, 2, 3]
    for frame, expected in boxes.items():
        masks = agents_of(tmp_path / f"id/{frame}.exr")
        assert {agent: box_of(mask) for agent, mask in masks.items()} == expected
        assert list(expected) == sorted(AGENTS)
    assert sorted(path.name for path in (tmp_path / "depth").iterdir()) == ["1.exr", "2.exr", "3.exr"]


def test_whole_boxes_hold_what_others_hide(program, crowd, tmp_path):
    for extent in ("visible", "whole"):
        assert program("throng-render", *crowd, "-o", f"{extent}.png", "--frames", 1, "--boxes", f"{extent}.txt",
                       "--box-extent", extent).returncode == 0
    visible, whole = (boxes_of(tmp_path / f"{extent}.txt")[1] for extent in ("visible", "whole"))
    for agent, (left, top, width, height) in visible.items():
        outer = whole[agent]
        assert outer[0] <= left and outer[1] <= top
        assert outer[0] + outer[2] >= left + width and outer[1] + outer[3] >= top + height
    # nobody stands before the first; the last is behind it
    assert whole[3][2] - visible[3][2] <= 2 and whole[3][3] - visible[3][3] <= 2
    assert whole[HUGE][2] * whole[HUGE][3] > visible[HUGE][2] * visible[HUGE][3]


def test_depth_is_metres_along_the_viewing_axis(program, crowd, tmp_path):
    assert program("throng-render", *crowd, "-o", "{pass}.exr", "--passes", "depth,id", "--frames", 1).returncode == 0
    depth, masks = read(tmp_path / "depth.exr")["Z"], agents_of(tmp_path / "id.exr")
    assert depth.dtype == np.float32
    axis = np.array([0, 8, -0.4]) / np.hypot(8, 0.4)
    for agent, (x, y) in AGENTS.items():
        feet, head = np.array([x, y + 8, -1.6]) @ axis, np.array([x, y + 8, 0.2]) @ axis
        seen = depth[masks[agent]]
        assert min(feet, head) - 0.6 < seen.min() and seen.max() < max(feet, head) + 0.6
    assert np.isinf(depth[0]).all(), "the first row shows the sky"
    background = ~np.logical_or.reduce(list(masks.values()))
    # the ray through each pixel meets z = 0 where the pass says so
    up = np.cross(np.cross(axis, [0, 0, 1]), axis)
    tangent = (0.5 - (np.arange(HEIGHT) + 0.5) / HEIGHT) * 2 * np.tan(np.pi / 8)
    rise = axis[2] + tangent * up[2] / np.linalg.norm(up)
    expected = np.where(rise < 0, -1.6 / np.where(rise < 0, rise, 1), np.inf)
    for row in range(HEIGHT):
        assert np.allclose(depth[row][background[row]], expected[row], rtol=1e-4)


def test_depth_from_above_is_the_height(program, crowd, tmp_path):
    arguments = [{"camera.json": "top.json"}.get(word, word) for word in crowd]
    assert program("throng-render", *arguments, "-o", "{pass}.exr", "--passes", "depth,id", "--frames", 1).returncode == 0
    depth, masks = read(tmp_path / "depth.exr")["Z"], agents_of(tmp_path / "id.exr")
    background = ~np.logical_or.reduce(list(masks.values()))
    assert np.allclose(depth[background], 50.0, atol=0.01)
    for mask in masks.values():
        assert 1.4 < 50.0 - depth[mask].min() < 2.1


def test_without_ground_there_is_nothing_behind_the_agents(program, crowd, tmp_path):
    assert program("throng-render", *crowd, "-o", "{pass}.exr", "--passes", "depth,id", "--frames", 1,
                   "--no-ground").returncode == 0
    depth, kind = read(tmp_path / "depth.exr")["Z"], read(tmp_path / "id.exr")["class"]
    assert np.array_equal(np.isfinite(depth), kind == 1)


def test_passes_change_no_colour_and_no_thread_changes_them(program, crowd, tmp_path):
    assert program("throng-render", *crowd, "-o", "plain/{pass}#.png", "--frames", 2).returncode == 0
    for threads in (1, 3):
        assert program("throng-render", *crowd, "-o", f"{threads}/{{pass}}#.png", "--frames", 2, "--passes",
                       "id,depth,color", "--threads", threads).returncode == 0
    for name in ("color2.png", "depth2.exr", "id2.exr"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "3" / name).read_bytes()
    assert (tmp_path / "plain/color2.png").read_bytes() == (tmp_path / "1/color2.png").read_bytes()


def test_what_stands_around_is_a_class_of_its_own(program, crowd, tmp_path):
    (tmp_path / "area.wkt").write_text("POLYGON ((-4 -9, 6 -9, 6 4, -4 4, -4 -9))")
    arguments = [word for word in crowd if word != "--no-walls"]
    assert program("throng-render", *arguments, "-o", "{pass}.exr", "--passes", "id", "--frames", 1, "--environment",
                   "area.wkt", "--boxes", "gt.txt").returncode == 0
    assert set(np.unique(read(tmp_path / "id.exr")["class"])) == {0, 1, 2}
    assert set(boxes_of(tmp_path / "gt.txt")[1]) == set(AGENTS)


def test_an_empty_picture_has_passes_too(program, crowd, tmp_path):
    (tmp_path / "away.json").write_text(json.dumps({"eye": [0, -8, 1.6], "target": [0, -20, 1.6]}))
    arguments = [{"camera.json": "away.json"}.get(word, word) for word in crowd]
    result = program("throng-render", *arguments, "-o", "{pass}.exr", "--passes", "id,depth", "--frames", 1, "--boxes",
                     "gt.txt")
    assert result.returncode == 0, result.stderr
    assert not read(tmp_path / "id.exr")["class"].any()
    assert (tmp_path / "gt.txt").read_text() == ""


def test_skip_existing_wants_every_pass(program, crowd, tmp_path):
    command = ("throng-render", *crowd, "-o", "{pass}#.png", "--passes", "color,id", "--skip-existing")
    assert program(*command).returncode == 0
    (tmp_path / "id2.exr").unlink()
    assert "1 written, 2 there already" in program(*command).stderr
    assert (tmp_path / "id2.exr").exists()


def test_pictures_go_to_standard_output(program, crowd, tmp_path):
    import subprocess

    program("throng-render", *crowd, "-o", "#.png")
    from conftest import BUILD
    result = subprocess.run([BUILD / "bin/throng-render", *map(str, crowd), "-o", "-"], cwd=tmp_path, capture_output=True)
    assert result.returncode == 0, result.stderr
    header, size = b"P6\n320 180\n255\n", WIDTH * HEIGHT * 3
    assert len(result.stdout) == 3 * (len(header) + size)
    from PIL import Image
    for number in (1, 2, 3):
        one = result.stdout[(number - 1) * (len(header) + size):][:len(header) + size]
        assert one.startswith(header)
        assert one[len(header):] == Image.open(tmp_path / f"{number}.png").convert("RGB").tobytes()
    with open("/dev/full", "wb") as full:
        result = subprocess.run([BUILD / "bin/throng-render", *map(str, crowd), "-o", "-"], cwd=tmp_path, stdout=full,
                                stderr=subprocess.PIPE, text=True)
    assert result.returncode == 5 and "standard output" in result.stderr


@pytest.mark.parametrize("arguments, words", [
    (("-o", "{pass}#.png", "--passes", "color,normals"), "'normals'"),
    (("-o", "#.png", "--passes", "color,id"), "{pass}"),
    (("-o", "#.png", "--passes", "id"), ".exr"),
    (("-o", "a.mp4", "--passes", "color,id"), "{pass}"),
    (("-o", "{pass}.mp4", "--passes", "color,id"), "numbered pictures"),
    (("-o", "-", "--camera", "top", "--camera", "orbit"), "one --camera"),
    (("-o", "{pass}#.exr", "--passes", "id", "--raster", "gl"), "--raster"),
    (("-o", "{camera}#.png", "--camera", "top", "--camera", "orbit", "--boxes", "gt.txt"), "--boxes"),
])
def test_what_can_not_be_had_is_refused(program, arguments, words):
    result = program("throng-render", "--synthetic", 5, *arguments)
    assert result.returncode == 2, result.stderr
    assert words in result.stderr

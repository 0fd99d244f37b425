"""throng.render, throng.frames and throng.show with the program that is built."""

import json
import os
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import throng
from throng import _viewing

ROOT = Path(__file__).resolve().parents[3]
BIN = Path(os.environ.get("THRONG_BIN", ROOT / "build/release/bin"))
SMALL = dict(size=(160, 90), fps=2, vertex_budget=20000, program=str(BIN / "throng-render"))
TIMES = np.arange(5) / 4.0
POSITIONS = np.stack([np.stack([TIMES * 1.2 + agent, np.full(5, agent % 2)], axis=1) for agent in range(4)], axis=1)
COLUMNS = {"id": np.tile(np.arange(4), 5), "time": np.repeat(TIMES, 4),
           "x": POSITIONS[:, :, 0].ravel(), "y": POSITIONS[:, :, 1].ravel()}

needs_program = pytest.mark.skipif(not (BIN / "throng-render").exists(), reason="throng-render is not built")


@needs_program
def test_arrays_become_frames():
    pictures = throng.render((TIMES, POSITIONS), **SMALL)
    assert pictures.shape == (3, 90, 160, 3) and pictures.dtype == np.uint8
    assert all((one != other).any() for one, other in zip(pictures, pictures[1:])), "people walk"


@needs_program
def test_columns_files_and_arrays_show_the_same(tmp_path):
    expected = throng.render((TIMES, POSITIONS), **SMALL)
    assert (throng.render(COLUMNS, **SMALL) == expected).all()
    by_frame = {**COLUMNS, "frame": COLUMNS["time"] * 4}
    del by_frame["time"]
    assert (throng.render(by_frame, source_fps=4, **SMALL) == expected).all()
    assert (throng.render(SimpleNamespace(data=by_frame, frame_rate=4.0), **SMALL) == expected).all()
    path = tmp_path / "run.csv"
    path.write_text("time,id,x,y\n" + "".join(
        f"{time},{agent},{x},{y}\n" for time, agent, x, y in zip(*(COLUMNS[name].tolist() for name in
                                                                 ("time", "id", "x", "y")))))
    assert (throng.render(path, **SMALL) == expected).all()


@needs_program
def test_nobody_is_where_positions_are_nan():
    gone = POSITIONS.copy()
    gone[:, 1:] = np.nan
    camera = {"eye": np.array([2.0, -8.0, 2.0]), "target": [2, 0, 1]}
    one = throng.render((TIMES, gone), camera=camera, frames="1", **SMALL)
    assert (one == throng.render((TIMES, POSITIONS[:, :1]), camera=camera, frames="1", **SMALL)).all()
    assert (one != throng.render((TIMES, POSITIONS), camera=camera, frames="1", **SMALL)).any()


@needs_program
def test_names_and_walls_and_channels_are_taken():
    area = "POLYGON ((-3 -3, 8 -3, 8 5, -3 5, -3 -3))"
    plain = throng.render((TIMES, POSITIONS), ids=["ana", "bo", "cy", "di"], frames="1", **SMALL)
    walls = throng.render((TIMES, POSITIONS), ids=["ana", "bo", "cy", "di"], frames="1", environment=area, **SMALL)
    assert (plain != walls).any()
    speed = throng.render({**COLUMNS, "speed": COLUMNS["x"]}, frames="1", channel="speed", channel_range=(0, 3),
                          overlay=["legend"], **SMALL)
    assert (speed != throng.render(COLUMNS, frames="1", **SMALL)).any()
    other = throng.render({**COLUMNS, "speed": COLUMNS["x"]}, frames="1", channel="speed", channel_range=(0, 3),
                          color_map="plasma", overlay=["legend"], **SMALL)
    assert (speed != other).any()


@needs_program
def test_arrays_are_read_as_they_were_given(tmp_path):
    """Written as a recording and converted to rows by the program that reads it."""
    place = np.array([[692000.12345, 5337000.5, 2.25], [692010.5, 5337001.25, -1.0]])
    source = {"id": np.array(["ana", "bo", "ana"]), "time": np.array([2.0, 1.0, 1.0]), "x": place[[0, 1, 0], 0],
              "y": place[[0, 1, 0], 1], "z": place[[0, 1, 0], 2], "heading": np.array([0.5, np.nan, -3.0]),
              "mood": np.array([1.5, -2.5, np.nan]), "motion": np.array(["sit", "", "wave"]), "text": list("abc")}
    path = str(tmp_path / "a.trec")
    _viewing._write_columns(path, source, None)
    info = json.loads(subprocess.run([BIN / "throng", "info", path, "--json"], capture_output=True, text=True,
                                     check=True).stdout)
    assert (info["format"], info["frames"], info["agents"]) == ("throng-recording", 2, 2)
    assert (info["channels"], sorted(info["motions"])) == (["mood"], ["sit", "wave"])
    subprocess.run([BIN / "throng", "convert", path, tmp_path / "a.csv", "--quiet"], check=True)
    head, *rows = [line.split(",") for line in (tmp_path / "a.csv").read_text().splitlines() if line[0] != "#"]
    rows = [dict(zip(head, row)) for row in rows]
    assert sorted((float(row["time_s"]), row["id"]) for row in rows) == [(0, "ana"), (0, "bo"), (1, "ana")]
    for row in rows:
        at = place[int(row["id"] == "bo")]
        assert abs(float(row["x_m"]) - at[0]) < 1e-4 and abs(float(row["y_m"]) - at[1]) < 1e-4
        assert abs(float(row["z_m"]) - at[2]) < 1e-4
    last = next(row for row in rows if row["time_s"].startswith("1"))
    assert abs(float(last["heading_rad"]) - 0.5) < 1e-3 and float(last["mood"]) == 1.5


@needs_program
def test_a_moment_with_nobody_is_kept():
    gone = POSITIONS.copy()
    gone[2] = np.nan
    pictures = throng.render((TIMES, gone), **{**SMALL, "fps": 4})
    assert (pictures[2] != pictures[1]).any()
    later = {name: column[(COLUMNS["time"] < 0.5) | (COLUMNS["time"] > 0.9)] for name, column in COLUMNS.items()}
    assert throng.render(later, **SMALL).shape[0] == 3


@needs_program
def test_frames_come_one_at_a_time_and_nobody_waits_for_the_rest():
    iterator = throng.frames((np.array([0.0, 3600.0]), POSITIONS[:2]), **SMALL)
    assert next(iterator).shape == (90, 160, 3)
    iterator.close()


@needs_program
def test_a_notebook_gets_a_video(tmp_path):
    video = throng.show((TIMES, POSITIONS), **SMALL)
    assert b"ftyp" in video.mp4[:64]
    assert video._repr_html_().startswith("<video ") and "data:video/mp4;base64,AAAA" in video._repr_html_()
    video.save(tmp_path / "run.mp4")
    assert (tmp_path / "run.mp4").read_bytes() == video.mp4


def test_an_address_becomes_the_servers_page():
    page = throng.show('http://127.0.0.1:7448/?crowd="a"&t=1', size=(800, 300))
    assert 'src="http://127.0.0.1:7448/?crowd=&quot;a&quot;&amp;t=1"' in page._repr_html_()
    assert 'height="300"' in page._repr_html_()
    with pytest.raises(ValueError, match="camera"):
        throng.show("http://127.0.0.1:7448", camera="top")


@needs_program
@pytest.mark.parametrize("source, settings, words", [
    ("nowhere.sqlite", {}, "nowhere.sqlite"),
    ((TIMES, POSITIONS), {"camera": "sideways"}, "sideways"),
    ((TIMES, POSITIONS), {"channel": "heat"}, "'heat' is none of speed"),
    ((TIMES, POSITIONS), {"frames": "99"}, "--frames"),
    ((TIMES, POSITIONS), {"options": ["--no-such-flag"]}, "--no-such-flag"),
    ((TIMES, POSITIONS), {"environment": "POLYGON ((0 0"}, "environment.wkt"),
])
def test_what_throng_render_refuses_is_an_error_with_its_words(source, settings, words):
    with pytest.raises(throng.RenderError, match=words):
        throng.render(source, **{**SMALL, **settings})


@pytest.mark.parametrize("source, settings, words", [
    ((TIMES, POSITIONS[:2]), {}, "must be"),
    ((TIMES, POSITIONS[:, :, :1]), {}, "must be"),
    ((TIMES,), {}, "a tuple of 1"),
    ((TIMES, POSITIONS), {"ids": [1, 2]}, "ids: 2"),
    ((TIMES * np.nan, POSITIONS), {}, "finite"),
    ("run.csv", {"ids": [1, 2]}, "a file has its own"),
    ({"x": [1], "y": [2], "time": [0]}, {}, "'id'"),
    ({"id": [1], "x": [1], "y": [2]}, {}, "'frame'"),
    ({"id": [1], "x": [1], "y": [2], "frame": [0]}, {}, "source_fps"),
    ({"id": [1], "x": [1, 2], "y": [2], "time": [0]}, {}, r"must all be \[N\]"),
    ({"id": [1, 1], "x": [1, 2], "y": [2, 2], "time": [3, 3]}, {}, "agent 1 is there twice at time 3"),
    ({"id": [1], "x": [np.inf], "y": [2], "time": [0]}, {}, "finite"),
    ({"id": [], "x": [], "y": [], "time": []}, {}, "no row"),
    ((TIMES[:0], POSITIONS[:0]), {}, "no moment"),
    ((TIMES * 0, POSITIONS), {}, "same time"),
    ((TIMES, POSITIONS), {"ids": [1, 2, 2, 3]}, "twice"),
    ((TIMES, POSITIONS * 1e9), {}, "1e7"),
])
def test_arrays_that_do_not_fit_are_named(source, settings, words):
    with pytest.raises(ValueError, match=words):
        throng.render(source, **{**SMALL, **settings})


def test_a_missing_program_says_how_to_give_it(monkeypatch):
    monkeypatch.setenv("THRONG_RENDER", "/nowhere/throng-render")
    with pytest.raises(throng.RenderError, match="/nowhere/throng-render.*THRONG_RENDER"):
        throng.render((TIMES, POSITIONS))
    with pytest.raises(TypeError, match="neither a file"):
        throng.render(5)


@needs_program
def test_a_notebook_that_is_executed_shows_the_video():
    """In a real kernel, as Jupyter runs it."""
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(
        "import throng, numpy as np\n"
        "times = np.arange(4) / 4\n"
        "throng.show((times, np.stack([[times, times]] * 3).transpose(2, 0, 1)), size=(160, 90), fps=2,\n"
        f"            vertex_budget=20000, program={str(BIN / 'throng-render')!r})")])
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    [output] = notebook.cells[0].outputs
    assert output.output_type == "execute_result"
    assert 'src="data:video/mp4;base64,AAAA' in output.data["text/html"]

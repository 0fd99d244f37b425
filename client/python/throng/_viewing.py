"""Pictures of a crowd in Python: `render` gives NumPy frames, `show` a video for a notebook.

Both run the program throng-render, which needs no screen and no GPU.
"""

from __future__ import annotations

import base64
import html
import json
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import IO, Any, Dict, Iterable, Iterator, List, Mapping, Optional, Protocol, Sequence, Tuple, Union

import numpy as np

from throng import _recording
from throng._ids import hash_id


class Columns(Protocol):
    """What has columns by name, such as a data frame."""

    def keys(self) -> Iterable[Any]: ...

    def __getitem__(self, name: Any, /) -> Any: ...


class Trajectory(Protocol):
    """Such as PedPy's TrajectoryData."""

    @property
    def data(self) -> Any: ...

    @property
    def frame_rate(self) -> float: ...


Source = Union[str, "os.PathLike[str]", Tuple[Any, Any], Columns, Trajectory]
Camera = Union[str, Mapping[str, Any]]

_PROGRAM = "throng-render"
_HEADINGS = ("heading", "heading_rad", "yaw")


class RenderError(RuntimeError):
    """throng-render could not be found, refused its input, or failed. Says what it said."""


def frames(source: Source, *, size: Tuple[int, int] = (1280, 720), fps: float = 25.0,
           frames: Optional[str] = None, camera: Camera = "overview", ids: Optional[Sequence[Any]] = None,
           source_fps: Optional[float] = None, vertex_budget: int = 1_000_000, channel: Optional[str] = None,
           channel_range: Optional[Tuple[float, float]] = None, color_map: str = "viridis",
           environment: Optional[str] = None, seed: int = 0, overlay: Sequence[str] = (), options: Sequence[str] = (),
           program: Optional[str] = None) -> Iterator[np.ndarray]:
    """Yields pictures of the crowd one after the other: uint8 [height, width, 3], sRGB, rows from the top.

    @param source       a trajectory file that throng-render reads; or `(times, positions)`: seconds [T]
                        and metres [T, A, 2 or 3], NaN where an agent is not there; or columns by name,
                        a mapping or a data frame: `id`, `x`, `y`, perhaps `z`, and `time` in seconds or
                        `frame` with `source_fps`; perhaps `heading` in radians (or `ori_x`, `ori_y`) and
                        `motion` ("sit", "cheer" ...; "": by speed). Other columns of numbers are channels.
                        Arrays go to the program as a recording, to a tenth of a millimetre. What has such
                        a frame as `data` and a `frame_rate`, as PedPy's trajectories do, is taken too.
    @param size         width and height, px.
    @param fps          pictures for each second of the trajectory.
    @param frames       which of them, from 1: "5" or "1-100x2,205"; None: all.
    @param camera       "overview", "top", "orbit", "follow:AGENT", a JSON file, or what such a file
                        holds: {"eye": [x, y, z], "target": [x, y, z]}.
    @param ids          of the agents of `positions` [A], integers or strings; None: 0, 1, 2 ...
    @param channel      colours the agents by it, from `channel_range[0]` to `channel_range[1]`.
    @param color_map    of the channel: "viridis", "plasma", "inferno", "magma" or "cividis".
    @param environment  the walkable area as WKT, or a file of it; None: what the source holds.
    @param overlay      of "time", "agents", "scale", "legend".
    @param options      further arguments of throng-render, such as ["--no-shadows"].
    @param program      throng-render; None: THRONG_RENDER, or the one on PATH.

    Raises RenderError with what throng-render said, and ValueError for arrays that don't fit together.
    The program runs while pictures are asked for, and ends when the iterator does.
    """
    with tempfile.TemporaryDirectory(prefix="throng-") as folder:
        command = _command(Path(folder), "-", source, size=size, fps=fps, frames=frames, camera=camera, ids=ids,
                           source_fps=source_fps, vertex_budget=vertex_budget, channel=channel,
                           channel_range=channel_range, color_map=color_map, environment=environment, seed=seed,
                           overlay=overlay, options=options, program=program)
        with tempfile.TemporaryFile() as errors:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL,
                                       stdout=subprocess.PIPE, stderr=errors)
            assert process.stdout is not None
            try:
                while (picture := _read_picture(process.stdout)) is not None:
                    yield picture
                _check(process.wait(), errors)
            finally:
                if process.poll() is None:
                    process.kill()
                process.stdout.close()
                process.wait()


def render(source: Source, **settings: Any) -> np.ndarray:
    """All pictures at once: uint8 [F, height, width, 3]. Arguments and errors as `throng.frames`.

    1,000 pictures of 1280x720 are 2.8 GB; `throng.frames` gives them one by one.
    """
    pictures = list(frames(source, **settings))
    return np.stack(pictures)


class Video:
    """A finished video; a notebook shows it where a cell ends with it."""

    def __init__(self, mp4: bytes, size: Tuple[int, int]):
        self.mp4 = mp4
        self.size = size

    def save(self, path: Union[str, "os.PathLike[str]"]) -> None:
        Path(path).write_bytes(self.mp4)

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.mp4).decode("ascii")
        return (f'<video controls loop autoplay muted playsinline width="{self.size[0]}" '
                f'style="max-width:100%" src="data:video/mp4;base64,{data}"></video>')


class Page:
    """The live viewer of a throng-server; a notebook shows it where a cell ends with it."""

    def __init__(self, url: str, size: Tuple[int, int]):
        self.url = url
        self.size = size

    def _repr_html_(self) -> str:
        return (f'<iframe src="{html.escape(self.url, quote=True)}" width="100%" height="{self.size[1]}" '
                'style="border:0" allow="fullscreen"></iframe>')


def show(source: Source, *, size: Tuple[int, int] = (960, 540), **settings: Any) -> Union[Video, Page]:
    """What a notebook shows of a crowd: a video, or the live page of a server.

    @param source  as `throng.frames` takes it; or the address that `throng-server --http` tells,
                   "http://127.0.0.1:7448", perhaps with a crowd and a camera as its page writes them.
    Other arguments and errors as `throng.frames`; an address takes none but `size`.
    """
    if isinstance(source, str) and re.match(r"https?://", source):
        if settings:
            raise ValueError(f"show: {', '.join(settings)}: a server's page takes only size")
        return Page(source, size)
    with tempfile.TemporaryDirectory(prefix="throng-") as folder, tempfile.TemporaryFile() as errors:
        path = Path(folder) / "show.mp4"
        command = _command(Path(folder), str(path), source, size=size, **settings)
        _check(subprocess.run(command, stdin=subprocess.DEVNULL,
                              stdout=subprocess.DEVNULL, stderr=errors).returncode, errors)
        return Video(path.read_bytes(), size)


def _command(folder: Path, output: str, source: Source, *, size: Tuple[int, int], fps: float = 25.0,
             frames: Optional[str] = None, camera: Camera = "overview", ids: Optional[Sequence[Any]] = None,
             source_fps: Optional[float] = None, vertex_budget: int = 1_000_000, channel: Optional[str] = None,
             channel_range: Optional[Tuple[float, float]] = None, color_map: str = "viridis",
             environment: Optional[str] = None, seed: int = 0, overlay: Sequence[str] = (), options: Sequence[str] = (),
             program: Optional[str] = None) -> List[str]:
    """The program and its arguments; what it is to read is written into `folder`."""
    if not isinstance(source, (str, tuple)) and hasattr(source, "data") and hasattr(source, "frame_rate"):
        source_fps = source.frame_rate if source_fps is None else source_fps
        source = source.data
    is_file = isinstance(source, (str, os.PathLike))
    if is_file:
        file = os.fspath(source)  # type: ignore[arg-type]
        if ids is not None:
            raise ValueError("ids: a file has its own")
    else:
        file = str(folder / "source.trec")
        if isinstance(source, tuple):
            _write_dense(file, source, ids)
        else:
            _write_columns(file, source, source_fps)  # type: ignore[arg-type]
    command = [_find_program(program), "-o", output, "--size", f"{size[0]}x{size[1]}", "--fps", repr(float(fps)),
               "--seed", str(seed), "--vertex-budget", str(vertex_budget), "--quiet"]
    if isinstance(camera, Mapping):
        path = folder / "camera.json"
        path.write_text(json.dumps(camera, default=_as_list))
        camera = str(path)
    command += ["--camera", camera]
    if frames is not None:
        command += ["--frames", str(frames)]
    if is_file and source_fps is not None:
        command += ["--source-fps", repr(float(source_fps))]
    if channel is not None:
        command += ["--channel", channel, "--color-map", color_map]
    if channel_range is not None:
        command += ["--channel-range", f"{float(channel_range[0])!r}:{float(channel_range[1])!r}"]
    if environment is not None:
        if re.match(r"\s*(MULTI)?POLYGON|\s*GEOMETRYCOLLECTION", environment, re.IGNORECASE):
            wkt = folder / "environment.wkt"
            wkt.write_text(environment)
            environment = str(wkt)
        command += ["--environment", environment]
    if overlay:
        command += ["--overlay", ",".join(overlay)]
    return [*command, *options, "--", file]


def _find_program(program: Optional[str]) -> str:
    wanted = program or os.environ.get("THRONG_RENDER") or _PROGRAM
    found = shutil.which(wanted)
    if found is None:
        raise RenderError(f"{wanted}: not found; put throng-render on PATH, set THRONG_RENDER to it, or give "
                          "program=")
    return found


def _check(code: int, errors: IO[bytes]) -> None:
    if code == 0:
        return
    errors.seek(0)
    said = errors.read().decode("utf-8", "replace").strip()
    if code < 0:
        said = f"{said}\nended by signal {-code}".strip()
    raise RenderError(said or f"{_PROGRAM}: exit code {code}")


def _read_picture(stream: IO[bytes]) -> Optional[np.ndarray]:
    """The next binary PPM of a stream; None at its end, or where it breaks off."""
    if stream.readline() != b"P6\n":
        return None
    width, height = map(int, stream.readline().split())
    stream.readline()
    picture = np.empty((height, width, 3), np.uint8)
    view, done = memoryview(picture.data).cast("B"), 0
    while done < len(view):
        count = stream.readinto(view[done:])  # type: ignore[attr-defined]
        if not count:
            return None
        done += count
    return picture


def _as_list(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else list(value)


def _write_dense(file: str, source: Tuple[Any, Any], ids: Optional[Sequence[Any]]) -> None:
    if len(source) != 2:
        raise ValueError(f"source: a tuple of {len(source)}, must be (times, positions)")
    times, positions = np.asarray(source[0], np.float64), np.asarray(source[1], np.float64)
    if times.ndim != 1 or positions.ndim != 3 or positions.shape[0] != times.size or positions.shape[2] not in (2, 3):
        raise ValueError(f"source: times {times.shape} and positions {positions.shape}, must be [T] and "
                         "[T, A, 2] or [T, A, 3]")
    if not np.isfinite(times).all():
        raise ValueError("source: times must be finite")
    given = list(range(positions.shape[1])) if ids is None else list(ids)
    if len(given) != positions.shape[1]:
        raise ValueError(f"ids: {len(given)}, positions are of {positions.shape[1]} agents")
    agents, names = _agents(np.asarray(given))
    if len(np.unique(agents)) != len(agents):
        raise ValueError("ids: one is there twice")
    if not times.size:
        raise ValueError("source: has no moment")
    times_us = np.rint(times * 1e6).astype(np.int64)
    order = np.argsort(times_us, kind="stable")
    if (np.diff(times_us[order]) == 0).any():
        raise ValueError("source: two moments have the same time")
    low, high = np.nanmin(positions, (0, 1), initial=np.inf), np.nanmax(positions, (0, 1), initial=-np.inf)
    origin, reach = _origin(low, high)

    def moments() -> Iterator[_recording.Moment]:
        for t in order.tolist():
            there = np.isfinite(positions[t]).all(axis=1)
            places = np.zeros((int(there.sum()), 3))
            places[:, :positions.shape[2]] = positions[t][there]
            yield _recording.Moment(int(times_us[t]), agents[there], places, None, (), None)

    _recording.write(file, moments(), (), names, origin, reach)


def _write_columns(file: str, source: Mapping[str, Any], source_fps: Optional[float]) -> None:
    try:
        names = [str(name) for name in source.keys()]
        columns = {name: np.asarray(source[name]) for name in names}
    except (AttributeError, KeyError, TypeError):
        raise TypeError(f"source: {type(source).__name__} is neither a file, (times, positions) nor columns by "
                        "name") from None
    for name in ("id", "x", "y"):
        if name not in columns:
            raise ValueError(f"source: has no column {name!r}, only {', '.join(names)}")
    if "time" not in columns:
        if "frame" not in columns:
            raise ValueError("source: has neither a column 'time' nor 'frame'")
        if source_fps is None:
            raise ValueError("source: has frames and no times; give source_fps, frames per second")
        columns["time"] = np.asarray(columns["frame"], np.float64) / source_fps
    named = ("time", "frame", "id", "x", "y", "z", *_HEADINGS, "ori_x", "ori_y", "motion")
    channels = [name for name in names if name not in named and columns[name].dtype.kind in "fiub"]
    used = [name for name in names if name in named or name in channels]
    rows = {columns[name].shape for name in ("time", *used)}
    if len(rows) != 1 or len(next(iter(rows))) != 1:
        raise ValueError("source: columns must all be [N], are "
                         + ", ".join(f"{name} {columns[name].shape}" for name in ("time", *used)))
    times = np.asarray(columns["time"], np.float64)
    places = np.zeros((times.size, 3))
    for axis, name in enumerate("xyz"):
        if name in columns:
            places[:, axis] = columns[name]
    if not times.size:
        raise ValueError("source: has no row")
    if not (np.isfinite(times).all() and np.isfinite(places).all()):
        raise ValueError("source: times and positions must be finite")
    agents, agent_names = _agents(columns["id"])
    headings = next((np.asarray(columns[name], np.float64) for name in _HEADINGS if name in columns), None)
    if headings is None and "ori_x" in columns and "ori_y" in columns:
        x, y = np.asarray(columns["ori_x"], np.float64), np.asarray(columns["ori_y"], np.float64)
        headings = np.where((x == 0) & (y == 0), np.nan, np.arctan2(y, x))
    motions = None
    if "motion" in columns:
        motions = ["" if name in (None, "0", "nan") else name
                   for name in (None if one is None else str(one) for one in columns["motion"].tolist())]
    values = [np.asarray(columns[name], np.float32) for name in channels]
    times_us = np.rint(times * 1e6).astype(np.int64)
    order = np.lexsort((agents, times_us))
    same = (np.diff(times_us[order]) == 0) & (agents[order][1:] == agents[order][:-1])
    if same.any():
        row = order[1:][same][0]
        raise ValueError(f"source: agent {columns['id'][row]} is there twice at time {times[row]:g}")
    begins = np.flatnonzero(np.diff(times_us[order], prepend=times_us[order[0]] - 1))
    usual_us = int(np.median(np.diff(times_us[order[begins]]))) if len(begins) > 1 else 0

    def moments() -> Iterator[_recording.Moment]:
        before: Optional[_recording.Moment] = None
        for rows in np.split(order, begins[1:]):
            now = _recording.Moment(int(times_us[rows[0]]), agents[rows], places[rows],
                                    None if headings is None else headings[rows],
                                    [value[rows] for value in values],
                                    None if motions is None else [motions[row] for row in rows.tolist()])
            # rows list no moment with nobody: everybody has left before others come
            if (before is not None and now.time_us - before.time_us > 1.5 * usual_us
                    and not np.isin(now.ids, before.ids).any()):
                yield _recording.Moment(before.time_us + usual_us, agents[:0], places[:0], None,
                                        [value[:0] for value in values], None)
            before = now
            yield now

    origin, reach = _origin(places.min(axis=0), places.max(axis=0))
    _recording.write(file, moments(), channels, agent_names, origin, reach)


def _agents(given: np.ndarray) -> Tuple[np.ndarray, Dict[int, str]]:
    """Ids as the wire has them, and the names of those that are text."""
    if given.dtype.kind == "f" and (given == np.rint(given)).all():
        given = given.astype(np.int64)
    if given.dtype.kind in "iu" and (given.dtype.kind == "u" or (given >= 0).all()):
        return given.astype(np.uint64), {}
    texts = [str(one) for one in given.tolist()]
    hashes = {text: int(text) if text.isdecimal() and int(text) < 1 << 64 else hash_id(text) for text in set(texts)}
    names = {number: text for text, number in hashes.items() if not text.isdecimal()}
    if len(set(hashes.values())) != len(hashes):
        raise ValueError("ids: two names have the same hash, rename one")
    return np.array([hashes[text] for text in texts], np.uint64), names


def _origin(low: np.ndarray, high: np.ndarray) -> Tuple[np.ndarray, float]:
    """A point of whole kilometres near the middle, where one is needed, and how far anything is from it."""
    origin, reach = np.zeros(3), 0.0
    for axis, (least, most) in enumerate(zip(low, high)):
        if least <= most:
            if axis < 2 and max(abs(least), abs(most)) > 1e4:
                origin[axis] = 1000.0 * np.rint((least + most) / 2000.0)
            reach = max(reach, most - origin[axis], origin[axis] - least)
    return origin, reach

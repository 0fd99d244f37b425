"""A trajectory file beside the live crowd, for any simulator's loop.

    with throng.connect(crowd="station") as pub, SqliteTee(pub, "run.sqlite", fps=10) as tee:
        for step in range(1000):
            tee.publish(step * 0.1, ids, positions)

The file is JuPedSim's (sqlite, version 2): JuPedSim, PedPy, `throng publish` and `throng-render` read it.
For a JuPedSim simulation there is `throng.jupedsim.Tee`, which feeds JuPedSim's own writer.
"""

from __future__ import annotations

import math
import os
import sqlite3
from typing import TYPE_CHECKING, Any, Dict, Optional, Union

import numpy as np

from throng._ids import BadFrame

if TYPE_CHECKING:
    from throng import Publisher

_COMMIT_FRAMES = 100
_SCHEMA = """
    CREATE TABLE trajectory_data(frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL,
        pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL);
    CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);
    CREATE TABLE geometry(hash INTEGER NOT NULL, wkt TEXT NOT NULL);
    CREATE UNIQUE INDEX geometry_hash ON geometry(hash);
    CREATE TABLE frame_data(frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL);
    CREATE INDEX frame_id_idx ON trajectory_data(frame, id);
"""


class SqliteTee:
    """Publishes each frame and writes it to a file.

    Args:
        pub: a publisher; units, axes and origin told to `throng.connect` hold here too.
        path: of the file. What is there is replaced.
        fps: frames per second of scene time. A frame's number is its time after the first one's, times
            `fps`, rounded; a frame whose number is not new is published but not written.

    Raises only while it is made (a path that cannot be written). Later a disk that is full ends the file with
    one message, as of `Publisher`, and the simulation goes on. String ids become 1, 2, ... in order of
    appearance. Headings become orientations; an unknown one is (0, 0). Channels are not in such a file.
    """

    def __init__(self, pub: "Publisher", path: Union[str, "os.PathLike[str]"], fps: float) -> None:
        if not (math.isfinite(fps) and fps > 0):
            raise ValueError(f"SqliteTee: fps is {fps!r}, must be > 0")
        self._pub = pub
        self._fps = float(fps)
        self._path = os.fspath(path)
        if os.path.exists(self._path):
            os.remove(self._path)
        self._file: Optional[sqlite3.Connection] = sqlite3.connect(self._path, check_same_thread=False)
        self._file.executescript("PRAGMA synchronous=OFF;" + _SCHEMA)
        self._file.executemany("INSERT INTO metadata VALUES (?, ?)", [("version", "2"), ("fps", str(self._fps))])
        self._geometry = 0
        self._box = (math.inf, math.inf, -math.inf, -math.inf)
        self._first_s: Optional[float] = None
        self._last = -1
        self._numbers: Dict[str, int] = {}
        self._unsaved = 0
        pub.expect_rate(fps)

    def publish(self, t: float, ids: Any, positions: Any, headings: Any = None, *, motion: Any = None,
                **channels: Any) -> bool:
        """As Publisher.publish, and writes the frame (without `motion`: the file has no place for it)."""
        taken = self._pub.publish(t, ids, positions, headings, motion=motion, **channels)
        if taken and self._file is not None:
            try:
                self._write(float(t), ids, positions, headings)
            except (sqlite3.Error, OSError, BadFrame, ValueError, TypeError) as error:
                self._give_up(error)
        return taken

    def scene(self, wkt: str) -> bool:
        """As Publisher.scene; the frames from now on have this walkable area."""
        taken = self._pub.scene(wkt)
        if taken and self._file is not None:
            try:
                self._geometry += 1
                self._file.execute("INSERT INTO geometry VALUES (?, ?)", (self._geometry, self._pub._axes.wkt(str(wkt))))
            except sqlite3.Error as error:
                self._give_up(error)
        return taken

    def close(self) -> None:
        """Completes the file. The publisher stays open."""
        if self._file is None:
            return
        try:
            if self._box[0] <= self._box[2]:
                names = ("xmin", "ymin", "xmax", "ymax")
                self._file.executemany("INSERT INTO metadata VALUES (?, ?)",
                                       [(name, str(value)) for name, value in zip(names, self._box)])
            if self._geometry == 0 and self._box[0] <= self._box[2]:
                # The format wants an area: the box of everybody, 1 m wider.
                low_x, low_y, high_x, high_y = self._box[0] - 1, self._box[1] - 1, self._box[2] + 1, self._box[3] + 1
                self._file.execute("INSERT INTO geometry VALUES (0, ?)", (
                    f"POLYGON (({low_x} {low_y}, {high_x} {low_y}, {high_x} {high_y}, {low_x} {high_y}, {low_x} {low_y}))",))
            self._file.commit()
            self._file.close()
        except sqlite3.Error as error:
            self._give_up(error)
        self._file = None

    def __enter__(self) -> "SqliteTee":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def _write(self, seconds: float, ids: Any, positions: Any, headings: Any) -> None:
        assert self._file is not None
        if self._first_s is None:
            self._first_s = seconds
        frame = round((seconds - self._first_s) * self._fps)
        if frame <= self._last:
            return
        self._last = frame
        numbers = [self._number(one) for one in (ids.tolist() if isinstance(ids, np.ndarray) else ids)]
        axes = self._pub._axes
        places = axes.positions(positions, len(numbers)).astype(np.float64) + axes.origin_m
        ways = np.zeros((len(numbers), 2))
        if headings is not None:
            angles, _ = axes.headings(headings, len(numbers))
            if angles is not None:
                ways = np.nan_to_num(np.stack([np.cos(angles), np.sin(angles)], axis=1))
        known = np.asarray(np.isfinite(places).all(axis=1))
        rows = [(frame, number, place[0], place[1], way[0], way[1])
                for number, place, way, good in zip(numbers, places.tolist(), ways.tolist(), known.tolist()) if good]
        self._file.executemany("INSERT INTO trajectory_data VALUES (?, ?, ?, ?, ?, ?)", rows)
        self._file.execute("INSERT INTO frame_data VALUES (?, ?)", (frame, self._geometry))
        if known.any():
            low, high = places[known].min(axis=0), places[known].max(axis=0)
            self._box = (min(self._box[0], float(low[0])), min(self._box[1], float(low[1])),
                         max(self._box[2], float(high[0])), max(self._box[3], float(high[1])))
        self._unsaved += 1
        if self._unsaved >= _COMMIT_FRAMES:
            self._file.commit()
            self._unsaved = 0

    def _number(self, one: Any) -> int:
        return self._numbers.setdefault(one, len(self._numbers) + 1) if isinstance(one, str) else int(one)

    def _give_up(self, error: Exception) -> None:
        self._pub._report("sqlite", f"SqliteTee: {self._path} ends here: {error}")
        try:
            if self._file is not None:
                self._file.close()
        except sqlite3.Error:
            pass
        self._file = None

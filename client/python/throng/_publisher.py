"""The producer: checks and converts on the caller's thread, sends on one of its own."""

from __future__ import annotations

import atexit
import logging
import math
import os
import uuid
import weakref
from dataclasses import dataclass
from typing import Any, Dict, Iterable, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from throng._frame import COARSE_OFFSET_M, FARTHEST_OFFSET_M, MOST_MOTIONS, Axes, Frame, channel_columns, motion_column
from throng._ids import BadFrame, IdTable, Membership
from throng._sender import Endpoint, Sender

MOTIONS = ("idle", "sit", "cheer", "wave", "talk", "phone")  # what the built-in cast can be told to do
DEFAULT_URL = "127.0.0.1:7447"
_RESTART_S = 1.0   # time that runs back by more than this is a new run, by less a late frame
_log = logging.getLogger("throng")

ChannelSpec = Union[Mapping[str, str], Iterable[Union[str, Tuple[str, str]]]]


@dataclass(frozen=True)
class Stats:
    """Counters of a publisher since `connect`, all of one moment."""

    published: int = 0      # frames taken from the simulation
    sent: int = 0           # frames handed to the connection
    applied: int = 0        # frames that the server has acknowledged as applied
    dropped: int = 0        # frames the full queue dropped, oldest first, or left at close
    late: int = 0           # frames the server refused because a newer one was there
    incomplete: int = 0     # frames the server refused because a part was missing
    unknown_epoch: int = 0  # frames the server refused until it had the ids again
    errors: int = 0         # calls whose arguments made no sense; each kind is logged once
    bad_agents: int = 0     # rows left out: positions that are not finite or too far, ids given twice
    id_collisions: int = 0  # string ids left out because another one has the same hash
    memberships: int = 0    # times the ids were sent
    connections: int = 0    # times the server has accepted this producer
    queued: int = 0         # frames that wait now
    connected: bool = False
    viewers: int = 0        # that look at this crowd, as of the last acknowledgement
    last_error: str = ""    # the newest thing that went wrong, empty if nothing has


class Publisher:
    """Publishes one crowd. Made by `connect`; use it as a context manager or call `close`.

    `publish`, `scene` and `close` may be called from one thread at a time. None of them raises:
    what goes wrong is logged once per kind (logger "throng") and counted in `stats`.
    """

    def __init__(self, endpoint: Endpoint, crowd: str, axes: Axes, channels: Dict[str, str],
                 rate_hz: Optional[float], run_id: str, producer: str, seed: int, take_over: bool,
                 queue_frames: int, queue_bytes: int, motions: Tuple[str, ...] = MOTIONS):
        self._axes = axes
        self._motions = motions
        self._ids = IdTable()
        self._rate_hz = rate_hz
        self._channels = channels            # name: unit; empty until the first frame names them
        self._queue_frames = queue_frames
        self._queue_bytes = queue_bytes
        self._run = 0
        self._newest_us: Optional[int] = None
        self._partial: Optional[Tuple[Membership, np.ndarray, Membership]] = None  # last membership with rows left out
        self._logged: set = set()
        self._counts = {"published": 0, "dropped": 0, "errors": 0, "bad_agents": 0}
        self._last_error = ""
        self._closed = False
        self._sender = Sender(endpoint, crowd, run_id, axes.origin_m, seed, producer, take_over, self._report)
        atexit.register(_close_at_exit, weakref.ref(self))

    # --- for the simulation -------------------------------------------------------------------

    def publish(self, t: float, ids: Any, positions: Any, headings: Any = None, *, motion: Any = None,
                **channels: Any) -> bool:
        """Publishes the whole crowd at scene time `t`. An agent that is not listed has left.

        Args:
            t: seconds of scene time, rising. Going back by more than a second begins a new run.
            ids: [A] integers or [A] strings, each once. An array that stays the same is fastest.
            positions: [A, 2] on the ground or [A, 3], in the unit and axes told to `connect`.
            headings: [A] angles as `yaw` told to `connect`, NaN for unknown; or [A, 2] directions,
                (0, 0) for unknown; or [A, 4] quaternions x y z w. None: from the motion.
            motion: what agents do beside standing, walking and running by their speed: one name for
                all, [A] names ("sit", "cheer" ...; "" or None: by speed) or [A] integers (0: by speed,
                k: `motions[k - 1]` as told to `connect`). A name that the server's characters have no
                clip for is as "". A change is blended over half a second or so.
            channels: [A] numbers each (speed=..., density=...), to colour agents by. Their names
                are told to `connect` or else fixed by the first frame; one that is left out is NaN.

        Returns True if the frame was queued. Never blocks and never raises; a wrong argument makes
        this call do nothing but log (once per kind) and count in `stats.errors`. Arguments are
        copied, so the simulation may change them right after.
        """
        try:
            self._sender.watch()
            return self._publish(t, ids, positions, headings, motion, channels)
        except BadFrame as error:
            self._fail(error.key, str(error))
        except Exception as error:  # the promise to the simulation: nothing gets out
            self._fail(f"bug-{type(error).__name__}", f"publish: {type(error).__name__}: {error}", exc_info=True)
        return False

    def scene(self, wkt: Optional[str] = None) -> bool:
        """Tells what the agents walk in: one WKT polygon, multipolygon or collection, in the unit and
        axes told to `connect` (without `origin`: these are absolute), perhaps followed by surfaces such as
        `throng.sumo.streets` gives. Returns False if it was refused. What only the server finds wrong or too
        large is told as a warning, and the agents are shown without it."""
        try:
            if wkt is not None:
                self._sender.set_environment(self._axes.wkt(str(wkt)))
            return True
        except BadFrame as error:
            self._fail(error.key, str(error))
        except Exception as error:
            self._fail("scene", f"scene: {type(error).__name__}: {error}", exc_info=True)
        return False

    def close(self, timeout: float = 5.0) -> bool:
        """Sends what waits, for `timeout` seconds at most, and disconnects. The crowd stays as it is.

        Returns True if every queued frame was acknowledged. May be called more than once.
        """
        if self._closed:
            return self._sender.finished_clean
        self._closed = True
        try:
            left = self._sender.close(max(0.0, float(timeout)))
            self._counts["dropped"] += left
            if left:
                why = f" ({self._last_error})" if self._last_error else ""
                self._fail("close", f"close: {left} frames could not be sent within {timeout} s{why}", count=False)
            return self._sender.finished_clean
        except Exception as error:
            self._fail("close", f"close: {type(error).__name__}: {error}", exc_info=True)
            return False

    @property
    def stats(self) -> Stats:
        """Counters of this moment."""
        counts: Dict[str, Any] = {**self._counts, **self._sender.counts()}
        return Stats(id_collisions=self._ids.collisions, last_error=self._last_error, **counts)

    @property
    def yaw(self) -> str:
        """The meaning of `headings` told to `connect`."""
        return self._axes.yaw

    @property
    def channels(self) -> Tuple[str, ...]:
        """Names of the numbers that agents carry; empty until the first frame if `connect` was told none."""
        return tuple(self._channels)

    def expect_rate(self, rate_hz: float) -> None:
        """Tells how many frames per second of scene time will come, unless `connect` or a frame before did."""
        if self._rate_hz is None and self._newest_us is None and math.isfinite(rate_hz) and rate_hz > 0:
            self._rate_hz = float(rate_hz)

    def __enter__(self) -> "Publisher":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    # --- inside -------------------------------------------------------------------------------

    def _publish(self, t: float, ids: Any, positions: Any, headings: Any, motion: Any,
                 channels: Dict[str, Any]) -> bool:
        if self._closed:
            raise BadFrame("closed", "publish: called after close")
        try:
            seconds = float(t)
        except (TypeError, ValueError):
            raise BadFrame("t", f"publish: t is {t!r}, must be a number of seconds") from None
        if not math.isfinite(seconds) or abs(seconds) > 1e11:
            raise BadFrame("t", f"publish: t is {seconds} s, must be finite and within 1e11")
        time_us = round(seconds * 1e6)

        membership, rows = self._ids.lookup(ids)
        for key, text in self._ids.messages:
            self._report(key, text)
        self._ids.messages.clear()
        given = membership.ids.size if rows is None else _length(ids)
        position_column = self._axes.positions(positions, given)
        heading_column = quaternion_column = None
        if headings is not None:
            heading_column, quaternion_column = self._axes.headings(headings, given)
        motion_codes: Optional[np.ndarray] = None
        motion_names: Tuple[str, ...] = ()
        if motion is not None:
            motion_codes, motion_names = motion_column(motion, self._motions, given)
        if self._newest_us is None:
            self._start(channels)
        for name in channels:
            if name not in self._channels:
                self._fail(f"unknown-{name}", f"publish: channel {name!r} was not told to connect or to the first "
                                              f"frame (known: {', '.join(self._channels) or 'none'}); it is left out")
        columns = channel_columns(list(self._channels), channels, given, self._fail)
        if rows is not None:
            self._counts["bad_agents"] += given - rows.size
            position_column = position_column[rows]
            heading_column = None if heading_column is None else heading_column[rows]
            quaternion_column = None if quaternion_column is None else quaternion_column[rows]
            motion_codes = None if motion_codes is None else motion_codes[rows]
            columns = [column[rows] for column in columns]
        # The extremes find a row the server would refuse (NaN is both); only then are rows looked at.
        if position_column.size and not (position_column.min() >= -FARTHEST_OFFSET_M
                                         and position_column.max() <= FARTHEST_OFFSET_M):
            membership, position_column, heading_column, quaternion_column, columns, motion_codes = (
                self._without_bad_rows(membership, position_column, heading_column, quaternion_column, columns,
                                       motion_codes))
        if position_column.size and float(np.abs(position_column[:1, :2]).max()) > COARSE_OFFSET_M:
            self._report("origin", f"publish: agents are over {COARSE_OFFSET_M:.0f} m from the origin, where float32 "
                                   "is coarse; pass origin=(x, y) near them to connect")

        if self._newest_us is not None and time_us < self._newest_us - _RESTART_S * 1e6:
            self._run += 1
            self._newest_us = time_us
        self._newest_us = time_us if self._newest_us is None else max(time_us, self._newest_us)
        frame = Frame(self._run, time_us, membership, position_column, heading_column, quaternion_column, columns,
                      motion_codes, motion_names)
        self._counts["published"] += 1
        self._counts["dropped"] += self._sender.put(frame, self._queue_frames, self._queue_bytes)
        return True

    def _start(self, channels: Dict[str, Any]) -> None:
        if not self._channels:
            self._channels = {name: "" for name in channels}
        self._sender.start(self._channels, self._rate_hz or 0.0)

    def _without_bad_rows(self, membership: Membership, positions: np.ndarray, headings: Optional[np.ndarray],
                          quaternions: Optional[np.ndarray], columns: List[np.ndarray],
                          motions: Optional[np.ndarray]) -> Any:
        rows = np.flatnonzero((np.abs(positions) <= FARTHEST_OFFSET_M).all(axis=1))
        missing = positions.shape[0] - rows.size
        self._counts["bad_agents"] += missing
        self._report("not-finite", f"publish: {missing} agents have no finite position within {FARTHEST_OFFSET_M:.0f} m "
                                   "of the origin at some time; they are left out")
        if self._partial is None or self._partial[0] is not membership or not np.array_equal(self._partial[1], rows):
            names = None if membership.names is None else [membership.names[row] for row in rows]
            self._partial = (membership, rows, Membership(membership.ids[rows], names))
        return (self._partial[2], positions[rows],
                None if headings is None else headings[rows],
                None if quaternions is None else quaternions[rows],
                [column[rows] for column in columns],
                None if motions is None else motions[rows])

    def _fail(self, key: str, text: str, exc_info: bool = False, count: bool = True) -> None:
        if count:
            self._counts["errors"] += 1
        self._report(key, text, exc_info)

    def _report(self, key: str, text: str, exc_info: bool = False) -> None:
        """Logs the first message of each kind and remembers the newest. Called from both threads."""
        self._last_error = text
        if key not in self._logged:
            self._logged.add(key)
            _log.warning("%s", text, exc_info=exc_info)


def connect(url: Optional[str] = None, crowd: str = "default", *, channels: ChannelSpec = (),
            origin: Optional[Sequence[float]] = None, unit: Union[str, float] = "m", up: str = "z",
            handed: str = "right", yaw: str = "ccw_rad", rate_hz: Optional[float] = None,
            run_id: Optional[str] = None, token: Optional[str] = None, ca_file: Optional[str] = None,
            producer: str = "", seed: int = 0, take_over: bool = False, queue_frames: int = 256,
            queue_bytes: int = 64 << 20, motions: Sequence[str] = MOTIONS) -> Publisher:
    """Makes a publisher of one crowd. The connection itself is made in the background, by the first frame.

    Args:
        url: HOST:PORT, or grpcs://HOST:PORT for TLS. Default: $THRONG_URL, else 127.0.0.1:7447.
        crowd: 1 to 100 of A-Z a-z 0-9 _ . -
        channels: names of the numbers that agents carry, ("speed", "density") or {"speed": "m/s"}.
            Empty: the first frame's.
        origin: (x, y[, z]) in metres of the world frame, near the agents; they are sent as float32
            offsets from it. Give it where coordinates are large (UTM).
        unit: of positions: "m", "cm", "mm", "ft" ... or a number of metres.
        up: "z" or "y": the axis of positions that points up. With two columns they are the ground.
        handed: "right" or "left" (Unity is left-handed with up="y", Unreal with up="z").
        yaw: what angles in `headings` mean, seen from above: "ccw_rad", "ccw_deg", "cw_rad" or
            "cw_deg" from +X; "north_cw_deg" or "north_cw_rad" clockwise from +Y (SUMO).
        rate_hz: frames per second of scene time that will come, if known: sets how long the server waits
            before it shows them.
        run_id: a new one forgets what the server has of this crowd; the same one continues. Default: new.
        token: one of the server's tokens. Default: $THRONG_TOKEN, else the first line of the file
            $THRONG_TOKEN_FILE. Best not on a command line.
        ca_file: PEM file that a grpcs:// server's certificate is checked with. Default: $THRONG_CA_FILE,
            else the authorities that gRPC trusts.
        producer: who publishes, for the server's log: "jupedsim 1.4.2".
        seed: with the id, decides which character an agent gets.
        take_over: ends another producer's stream on this crowd instead of being refused.
        motions: names that integers in `motion` count, from 1.
        queue_frames, queue_bytes: what may wait to be sent; beyond either the oldest frames are dropped.

    Raises ValueError for an argument that is wrong by itself: the only call that raises, since the
    simulation has not begun. A server that is not there is no error; see `Publisher.stats`.
    """
    axes = Axes(unit, up, yaw, handed, origin)
    if not crowd or len(crowd) > 100 or not all(c.isascii() and (c.isalnum() or c in "_.-") for c in crowd):
        raise ValueError(f"connect: crowd is {crowd!r}, must be 1 to 100 of A-Z a-z 0-9 _ . -")
    if rate_hz is not None and not (math.isfinite(rate_hz) and rate_hz > 0):
        raise ValueError(f"connect: rate_hz is {rate_hz!r}, must be > 0")
    if queue_frames < 1 or queue_bytes < 1:
        raise ValueError(f"connect: queue_frames is {queue_frames} and queue_bytes {queue_bytes}, must be > 0")
    if not 0 <= seed < 1 << 64:
        raise ValueError(f"connect: seed is {seed}, must be 0 to 2**64 - 1")
    if isinstance(channels, str):
        raise ValueError(f"connect: channels is {channels!r}, must be a sequence of names or a mapping to units")
    if isinstance(motions, str) or len(motions) > MOST_MOTIONS or not all(motions):
        raise ValueError(f"connect: motions is {motions!r}, must be at most {MOST_MOTIONS} names")
    units: Dict[str, str] = {}
    for item in channels.items() if isinstance(channels, Mapping) else channels:
        name, channel_unit = (item, "") if isinstance(item, str) else item
        if not name:
            raise ValueError("connect: a channel's name is empty")
        units[str(name)] = str(channel_unit)
    endpoint = Endpoint.parse(url or os.environ.get("THRONG_URL") or DEFAULT_URL,
                              token or os.environ.get("THRONG_TOKEN") or _token_of_file(),
                              ca_file or os.environ.get("THRONG_CA_FILE") or None)
    return Publisher(endpoint, crowd, axes, units, rate_hz, run_id or uuid.uuid4().hex, producer or "throng-python",
                     seed, take_over, queue_frames, queue_bytes, tuple(motions))


def _token_of_file() -> Optional[str]:
    """The first token of $THRONG_TOKEN_FILE. ValueError when it can't be read or has none."""
    path = os.environ.get("THRONG_TOKEN_FILE")
    if not path:
        return None
    try:
        with open(path, encoding="utf-8") as file:
            lines = [line.strip() for line in file]
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"connect: THRONG_TOKEN_FILE can't be read: {error}") from None
    for line in lines:
        if line and not line.startswith("#"):
            return line
    raise ValueError(f"connect: THRONG_TOKEN_FILE names {path}, which has no token")


def _length(ids: Any) -> int:
    return len(ids) if hasattr(ids, "__len__") else sum(1 for _ in ids)


def _close_at_exit(reference: "weakref.ref[Publisher]") -> None:
    publisher = reference()
    if publisher is not None:
        publisher.close(2.0)

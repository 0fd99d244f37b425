"""From a simulator's columns to the wire's: units, axes, yaw, origin. World frame: see design of throng."""

from __future__ import annotations

import math
import re
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from throng._ids import BadFrame, Membership

UNITS_M: Dict[str, float] = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "km": 1000.0, "ft": 0.3048}

# name: (radians per unit, sign seen from above, where zero points)
YAWS: Dict[str, Tuple[float, float, float]] = {
    "ccw_rad": (1.0, 1.0, 0.0),
    "ccw_deg": (math.pi / 180, 1.0, 0.0),
    "cw_rad": (1.0, -1.0, 0.0),
    "cw_deg": (math.pi / 180, -1.0, 0.0),
    "north_cw_rad": (1.0, -1.0, math.pi / 2),
    "north_cw_deg": (math.pi / 180, -1.0, math.pi / 2),
}

# A float32 beyond this has steps of 8 mm and more, which shows as trembling feet.
COARSE_OFFSET_M = 65536.0
MOST_MOTIONS = 64
FARTHEST_OFFSET_M = 1e7  # the server refuses a frame with an agent beyond it


class Frame(NamedTuple):
    """One agent frame, ready to be cut into chunks. Columns have one row per member."""

    run: int
    time_us: int
    membership: Membership
    positions: np.ndarray                # float32 [A, 3], offsets from the origin
    headings: Optional[np.ndarray]       # float32 [A]
    quaternions: Optional[np.ndarray]    # float32 [A, 4], x y z w
    channels: List[np.ndarray]           # float32 [A] each
    motions: Optional[np.ndarray] = None  # uint8 [A]; 0: by speed; k: motion_names[k - 1]
    motion_names: Tuple[str, ...] = ()

    @property
    def size_bytes(self) -> int:
        columns = [self.positions, self.headings, self.quaternions, self.motions, *self.channels]
        return sum(column.nbytes for column in columns if column is not None)


class Axes:
    """Turns coordinates of the source into the world frame (right-handed, +Z up, metres, from origin)."""

    def __init__(self, unit: Union[str, float], up: str, yaw: str, handed: str,
                 origin: Optional[Sequence[float]]):
        if isinstance(unit, str):
            if unit not in UNITS_M:
                raise ValueError(f"connect: unit is {unit!r}, must be a number of metres or one of {', '.join(UNITS_M)}")
            self.unit_m = UNITS_M[unit]
        else:
            self.unit_m = float(unit)
            if not (math.isfinite(self.unit_m) and self.unit_m > 0):
                raise ValueError(f"connect: unit is {unit!r} metres, must be > 0")
        if up not in ("z", "y"):
            raise ValueError(f"connect: up is {up!r}, must be 'z' or 'y'")
        if handed not in ("right", "left"):
            raise ValueError(f"connect: handed is {handed!r}, must be 'right' or 'left'")
        if yaw not in YAWS:
            raise ValueError(f"connect: yaw is {yaw!r}, must be one of {', '.join(YAWS)}")
        self.up, self.handed, self.yaw = up, handed, yaw
        values = [0.0, 0.0, 0.0] if origin is None else [float(value) for value in origin]
        if len(values) not in (2, 3) or not all(math.isfinite(value) for value in values):
            raise ValueError(f"connect: origin is {origin!r}, must be two or three finite metres")
        self.origin_m = np.array((values + [0.0])[:3], np.float64)
        # The second ground axis runs against world +Y for right-handed Y-up and for left-handed Z-up.
        self._flip = (up == "y") == (handed == "right")

    def positions(self, positions: Any, count: int) -> np.ndarray:
        """float32 [A, 3] from [A, 2] (on the ground) or [A, 3]. Raises BadFrame."""
        source = _numbers(positions, "positions")
        if source.size == 0:
            source = source.reshape(0, 2)
        if source.ndim != 2 or source.shape[1] not in (2, 3) or source.shape[0] != count:
            raise BadFrame("positions", f"publish: positions has shape {source.shape}, "
                                        f"must be [{count}, 2] or [{count}, 3] for {count} ids")
        out = np.empty((count, 3), np.float32)
        flat = source.shape[1] == 2
        ground2, height = (1, 2) if self.up == "z" or flat else (2, 1)
        origin = self.origin_m
        self._axis(source[:, 0], self.unit_m, origin[0], out[:, 0])
        self._axis(source[:, ground2], -self.unit_m if self._flip else self.unit_m, origin[1], out[:, 1])
        if flat:
            out[:, 2] = -origin[2]
        else:
            self._axis(source[:, height], self.unit_m, origin[2], out[:, 2])
        return out

    @staticmethod
    def _axis(source: np.ndarray, scale: float, origin: float, out: np.ndarray) -> None:
        if scale == 1.0 and origin == 0.0:
            out[:] = source
        else:  # in float64: the difference is small where its terms are not
            np.subtract(np.multiply(source, scale, dtype=np.float64), origin, out=out, casting="same_kind")

    def headings(self, headings: Any, count: int) -> Tuple[Optional[np.ndarray], Optional[np.ndarray]]:
        """(headings [A], None) from angles [A] or directions [A, 2]; (None, quaternions) from [A, 4]."""
        source = _numbers(headings, "headings")
        if source.size == 0 and count == 0:
            return None, None
        if source.shape == (count,):
            scale, sign, zero = YAWS[self.yaw]
            if sign == 1.0 and scale == 1.0 and zero == 0.0:
                return source.astype(np.float32), None
            return (zero + (sign * scale) * source).astype(np.float32), None
        if source.shape == (count, 2):
            angle = np.arctan2(-source[:, 1] if self._flip else source[:, 1], source[:, 0]).astype(np.float32)
            angle[(source[:, 0] == 0) & (source[:, 1] == 0)] = np.nan  # a zero direction is no direction
            return angle, None
        if source.shape == (count, 4):
            if self.up != "z" or self.handed != "right":
                raise BadFrame("headings", "publish: quaternions are taken in the world frame only "
                                           "(up='z', handed='right'); pass angles instead")
            return None, source.astype(np.float32)
        raise BadFrame("headings", f"publish: headings has shape {source.shape}, must be [{count}] angles, "
                                   f"[{count}, 2] directions or [{count}, 4] quaternions x y z w")

    def wkt(self, text: str) -> str:
        """Walkable area in world metres. Raises BadFrame for what is no WKT."""
        if not _WKT.match(text):
            raise BadFrame("wkt", f"scene: wkt begins with {text[:20]!r}, must be WKT text such as POLYGON (...)")
        if self.unit_m == 1.0 and not self._flip:
            return text
        sign = -1.0 if self._flip else 1.0

        def point(match: "re.Match[str]") -> str:
            x, y = (float(match.group(i)) * self.unit_m for i in (1, 2))
            return f"{x!r} {sign * y!r}"

        return _WKT_POINT.sub(point, text)


_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_WKT = re.compile(r"\s*(MULTI)?(POINT|LINESTRING|POLYGON)|\s*GEOMETRYCOLLECTION|\s*;(ROAD|WALK|MARK) ", re.IGNORECASE)
_WKT_POINT = re.compile(rf"({_NUMBER})\s+({_NUMBER})(?:\s+{_NUMBER})?")


def channel_columns(names: Sequence[str], values: Dict[str, Any], count: int,
                    warn: Callable[[str, str], None]) -> List[np.ndarray]:
    """float32 [A] for each declared channel; one that is missing or unusable is NaN, and `warn` is told."""
    columns = []
    for name in names:
        column = np.full(count, np.nan, np.float32)
        if name in values:
            try:
                source = _numbers(values[name], f"channel {name}")
                if source.shape not in ((), (count,)):
                    raise BadFrame("", f"publish: channel {name} has shape {source.shape}, must be [{count}]")
                column[:] = source
            except BadFrame as error:
                warn(f"channel-{name}", str(error))
        columns.append(column)
    return columns


def motion_column(motion: Any, names: Sequence[str], count: int) -> Tuple[np.ndarray, Tuple[str, ...]]:
    """(uint8 [A], names) from one name for all, [A] names or [A] integers (0: by speed; k: names[k - 1]).
    None and "" are by speed. Raises BadFrame."""
    if isinstance(motion, str):
        return (np.full(count, 1, np.uint8), (_motion_name(motion),)) if motion else (np.zeros(count, np.uint8), ())
    array = np.asarray(motion)
    if array.shape != (count,):
        raise BadFrame("motion", f"publish: motion has shape {array.shape}, must be [{count}]")
    if array.dtype.kind in "iu":
        if array.size and not 0 <= array.min() <= array.max() <= len(names):
            raise BadFrame("motion", f"publish: motion is {array.min()} to {array.max()}, must be 0 to {len(names)} "
                                     f"({', '.join(names)})")
        return array.astype(np.uint8), tuple(names)
    if array.dtype.kind == "U":
        found, codes = np.unique(array, return_inverse=True)
        values = [str(name) for name in found]
        codes = codes.reshape(count)
    else:
        known: Dict[str, int] = {}
        codes = np.array([known.setdefault("" if name is None else str(name), len(known)) for name in array],
                         np.intp)
        values = list(known)
    used = [name for name in values if name]
    if len(used) > MOST_MOTIONS:
        raise BadFrame("motion", f"publish: motion has {len(used)} different names, at most {MOST_MOTIONS}")
    code_of = np.array([used.index(name) + 1 if name else 0 for name in values] or [0], np.uint8)
    return code_of[codes], tuple(_motion_name(name) for name in used)


def _motion_name(name: str) -> str:
    if not 0 < len(name.encode("utf-8")) <= 64:
        raise BadFrame("motion", f"publish: motion {name[:80]!r} must be 1 to 64 bytes long")
    return name


def _numbers(values: Any, what: str) -> np.ndarray:
    try:
        array = np.asarray(values)
        if array.dtype.kind == "c":
            raise BadFrame(what, f"publish: {what} are complex numbers, must be real")
        if array.dtype.kind not in "fiub":
            array = array.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise BadFrame(what, f"publish: {what} can't be read as numbers: {error}") from None
    return array

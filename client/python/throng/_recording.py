"""Writes arrays as a recording, the binary trajectory that throng-server keeps and every program reads.

The layout is that of client/trajectory/recording_format.hpp. Each frame is written so that it needs none
before it, and packed as zstd's raw blocks, which need no library.
"""

from __future__ import annotations

import json
import zlib
from typing import BinaryIO, Iterable, List, Mapping, NamedTuple, Optional, Sequence

import numpy as np

_STEP_M = 1e-4  # positions are kept in such steps, times two while they reach too far
_MOST_STEPS = 2e9
_BLOCK = 1 << 17
_HEADING, _CHANNELS, _KEY = 1, 2, 4
_TURN = 65535


class Moment(NamedTuple):
    """One sample. Columns are [A], in the order of `ids`."""

    time_us: int
    ids: np.ndarray                      # uint64, unique
    positions: np.ndarray                # float64 [A, 3], metres
    headings: Optional[np.ndarray]       # radians, NaN: unknown; None: nobody's is known
    channels: Sequence[np.ndarray]       # float32 each
    motions: Optional[Sequence[str]]     # "": by speed


def write(path: str, moments: Iterable[Moment], channels: Sequence[str], names: Mapping[int, str],
          origin_m: np.ndarray, reach_m: float) -> None:
    """Writes moments in order of time.

    @param names    of agents whose ids are hashes of strings.
    @param reach_m  how far positions are from `origin_m` along an axis at most.
    """
    doublings = max(0, int(np.ceil(np.log2(max(reach_m, 1e-9) / (_STEP_M * _MOST_STEPS)))))
    if doublings > 20 or reach_m > 1e7:
        raise ValueError(f"source: positions reach {reach_m:g} m from their middle, at most 1e7 are possible")
    step_m = _STEP_M * 2 ** doublings
    with open(path, "wb") as out:
        out.write(b"THRONGR1")
        start = {"crowd": "arrays", "producer": "throng.render", "origin_m": origin_m.tolist(),
                 "channels": list(channels)}
        _record(out, b"STRT", json.dumps(start).encode())
        last: Optional[Moment] = None
        for moment in moments:
            if last is None or not np.array_equal(moment.ids, last.ids):
                _record(out, b"MEMB", _of_agents(len(moment.ids), _members(moment.ids, names)))
                last = None
            if moment.motions is not None and (last is None or list(moment.motions) != list(last.motions or [])):
                _record(out, b"HINT", _of_agents(len(moment.ids), _hints(moment.motions)))
            last = moment
            steps = np.rint((moment.positions - origin_m) / step_m).astype(np.int64).astype(np.int32)
            columns = [_zigzag(steps[:, axis]) for axis in range(3)]
            if moment.headings is not None:
                turns = np.nan_to_num(np.asarray(moment.headings, np.float64) / (2 * np.pi), nan=0.0) + 0.5
                words = (np.rint((turns - np.floor(turns)) * _TURN).astype(np.int64) % _TURN).astype(np.int32)
                columns.append(_zigzag(np.where(np.isfinite(moment.headings), words, _TURN).astype(np.int32)))
            columns += [np.ascontiguousarray(channel, np.float32).view(np.uint32) for channel in moment.channels]
            flags = _KEY | (_HEADING if moment.headings is not None else 0) | (_CHANNELS if moment.channels else 0)
            planes = b"".join(np.ascontiguousarray(column.astype("<u4").view(np.uint8).reshape(-1, 4).T).tobytes()
                              for column in columns)
            head = np.int64(moment.time_us).astype("<i8").tobytes() + bytes([doublings, flags])
            _record(out, b"FRAM", head + _packed(planes))


def _record(out: BinaryIO, kind: bytes, payload: bytes) -> None:
    head = kind + len(payload).to_bytes(4, "little")
    out.write(head + zlib.crc32(payload, zlib.crc32(head)).to_bytes(4, "little") + payload)


def _packed(raw: bytes) -> bytes:
    """A zstd frame (RFC 8878) of raw blocks: a single segment with its size in eight bytes."""
    pieces: List[bytes] = [b"\x28\xb5\x2f\xfd\xe0", len(raw).to_bytes(8, "little")]
    for at in range(0, max(len(raw), 1), _BLOCK):
        block = raw[at:at + _BLOCK]
        is_last = at + _BLOCK >= len(raw)
        pieces += [(len(block) << 3 | is_last).to_bytes(3, "little"), block]
    return b"".join(pieces)


def _of_agents(agents: int, raw: bytes) -> bytes:
    return agents.to_bytes(4, "little") + len(raw).to_bytes(4, "little") + _packed(raw)


def _members(ids: np.ndarray, names: Mapping[int, str]) -> bytes:
    raw = ids.astype("<u8").tobytes()
    if not names:
        return raw
    pieces = [raw]
    for agent in ids.tolist():
        name = names.get(agent, "").encode("utf-8", "replace")[:4096]
        pieces += [len(name).to_bytes(2, "little"), name]
    return b"".join(pieces)


def _hints(motions: Sequence[str]) -> bytes:
    names = sorted({name for name in motions if name})
    if len(names) > 64 or any(len(name.encode()) > 64 for name in names):
        raise ValueError(f"motion: {len(names)} names at once, at most 64 of 64 bytes")
    code = {"": 0, **{name: 1 + i for i, name in enumerate(names)}}
    spelled = b"".join(bytes([len(name.encode())]) + name.encode() for name in names)
    return bytes([len(names)]) + spelled + bytes(code[name] for name in motions)


def _zigzag(values: np.ndarray) -> np.ndarray:
    words = values.astype(np.int32).view(np.uint32)
    return (words << np.uint32(1)) ^ (np.uint32(0) - (words >> np.uint32(31)))

"""Agent ids: integers as they are, strings by a hash that is the same in every producer and run."""

from __future__ import annotations

import operator
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

_FNV_OFFSET = 0xCBF29CE484222325
_FNV_PRIME = 0x100000001B3
_MASK = 0xFFFFFFFFFFFFFFFF


def hash_id(name: str) -> int:
    """FNV-1a, 64 bit, of the UTF-8 bytes of `name`: the id of an agent whose id is a string."""
    value = _FNV_OFFSET
    for byte in name.encode("utf-8", "surrogatepass"):
        value = ((value ^ byte) * _FNV_PRIME) & _MASK
    return value


class BadFrame(ValueError):
    """A frame that can't be published. `key` tells kinds of mistakes apart, each is logged once."""

    def __init__(self, key: str, message: str):
        super().__init__(message)
        self.key = key


class Membership:
    """Which ids the rows of a frame belong to. Compared by identity, never changed."""

    __slots__ = ("ids", "names", "_order")

    def __init__(self, ids: np.ndarray, names: Optional[List[str]]):
        self.ids = ids      # uint64 [A], unique
        self.names = names  # [A] where ids are hashes of strings
        self._order: Optional[np.ndarray] = None

    @property
    def order(self) -> np.ndarray:
        """Rows in ascending order of id [A]."""
        if self._order is None:
            self._order = np.argsort(self.ids, kind="stable")
        return self._order


class IdTable:
    """Turns the `ids` argument of `publish` into memberships, and tells when nothing has changed.

    Used by one thread at a time. A frame that lists the same ids in the same order costs one
    comparison; the same ids in another order are sorted back, so that the membership stays.
    """

    def __init__(self) -> None:
        self._current: Optional[Membership] = None
        self._raw: Any = None                       # what `ids` was when _current was made
        self._raw_rows: Optional[np.ndarray] = None  # rows that were kept of it, None: all
        self._hash_of: Dict[str, int] = {}
        self._name_of: Dict[int, str] = {}
        self.collisions = 0
        self.duplicates = 0
        self.messages: List[Tuple[str, str]] = []   # (kind, text) to be logged

    def lookup(self, ids: Any) -> Tuple[Membership, Optional[np.ndarray]]:
        """Returns the membership [A] and the rows of the caller's columns to take, None for all.

        Raises BadFrame for ids that are neither integers nor strings, or not one-dimensional.
        """
        if self._current is not None and self._same(ids):
            return self._current, self._raw_rows
        values, names, rows = self._convert(ids)
        membership, order = self._membership(values, names)
        if order is not None:
            rows = order if rows is None else rows[order]
        self._current, self._raw_rows = membership, rows
        self._raw = ids.copy() if isinstance(ids, np.ndarray) else list(ids)
        return membership, rows

    def _same(self, ids: Any) -> bool:
        if isinstance(ids, np.ndarray):
            return (isinstance(self._raw, np.ndarray) and ids.dtype == self._raw.dtype
                    and np.array_equal(ids, self._raw))
        if isinstance(self._raw, np.ndarray):
            return False
        return list(ids) == self._raw

    def _convert(self, ids: Any) -> Tuple[np.ndarray, Optional[List[str]], Optional[np.ndarray]]:
        array = ids if isinstance(ids, np.ndarray) else None
        if array is None:
            ids = list(ids)
            if ids and all(isinstance(value, str) for value in ids):
                return self._from_strings(ids)
            try:
                array = np.asarray(ids) if ids else np.zeros(0, np.uint64)
            except (OverflowError, ValueError) as error:
                raise BadFrame("ids", f"publish: ids can't be read as integers: {error}") from None
            if array.dtype.kind == "f" and array.ndim == 1:  # NumPy has no common type for -1 and 2**63
                array = np.array(ids, object)
        if array.ndim != 1:
            raise BadFrame("ids", f"publish: ids has shape {array.shape}, must be [A]")
        if array.dtype.kind == "U" or (array.dtype.kind == "O" and all(isinstance(v, str) for v in array)):
            return self._from_strings(array.tolist())
        if array.dtype.kind == "O":
            try:
                array = np.array([operator.index(value) & _MASK for value in array], np.uint64)
            except (TypeError, ValueError):
                raise BadFrame("ids", "publish: ids must be all integers or all strings") from None
        if array.dtype.kind not in "iu":
            raise BadFrame("ids", f"publish: ids are {array.dtype}, must be integers or strings")
        # A negative id becomes its two's complement, as a cast in C++ would make it.
        values = array.astype(np.int64).view(np.uint64) if array.dtype.kind == "i" else array.astype(np.uint64)
        unique, first = np.unique(values, return_index=True)
        if unique.size == values.size:
            return values, None, None
        rows = np.sort(first)
        self._note_duplicates(values.size - unique.size)
        return values[rows], None, rows

    def _from_strings(self, names: Sequence[str]) -> Tuple[np.ndarray, List[str], Optional[np.ndarray]]:
        values = np.empty(len(names), np.uint64)
        kept: List[int] = []
        seen = set()
        duplicates = 0
        for row, name in enumerate(names):
            value = self._hash_of.get(name)
            if value is None:
                value = self._intern(name)
            if value in seen or self._name_of.get(value) != name:
                duplicates += value in seen and self._name_of.get(value) == name
                continue
            seen.add(value)
            values[row] = value
            kept.append(row)
        if duplicates:
            self._note_duplicates(duplicates)
        if len(kept) == len(names):
            return values, list(names), None
        rows = np.array(kept, np.int64)
        return values[rows], [names[row] for row in kept], rows

    def _intern(self, name: str) -> int:
        value = hash_id(name)
        other = self._name_of.setdefault(value, name)
        if other != name:
            self.collisions += 1
            self.messages.append(("id-collision", f"publish: ids {other!r} and {name!r} have the same hash "
                                                  f"{value:#018x}; {name!r} is left out, rename one"))
        self._hash_of[name] = value
        return value

    def _note_duplicates(self, count: int) -> None:
        self.duplicates += count
        self.messages.append(("id-duplicate", f"publish: {count} ids appear more than once in a frame; "
                                              "the first row of each is used"))

    def _membership(self, values: np.ndarray,
                    names: Optional[List[str]]) -> Tuple[Membership, Optional[np.ndarray]]:
        """The current membership and a permutation where only the order changed, else a new one."""
        current = self._current
        if current is not None and current.ids.size == values.size and (names is None) == (current.names is None):
            if np.array_equal(current.ids, values):
                return current, None
            order = np.argsort(values, kind="stable")
            if np.array_equal(values[order], current.ids[current.order]):
                rows = np.empty_like(order)
                rows[current.order] = order
                return current, rows
        return Membership(values, names), None

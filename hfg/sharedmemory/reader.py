"""A consumer's side of a ring: read-only views, which give the slot back when the last of them is gone.

Stands on `names` and `layout`.
"""

from __future__ import annotations

import mmap
import os
import threading
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

from hfg.encoding.arrays import ArrayHead, bytes_of, view_of
from hfg.errors import SharedMemoryError
from hfg.sharedmemory.layout import HEAD, LANE_SIZE, MAGIC, MOST_SLOTS, PAGE, WORDS, segment_size
from hfg.sharedmemory.names import open_existing

__all__ = ["Reader"]


class Reader:
    """One consumer's views of the arrays in one ring.

    Args:
      segment: the name of the ring, as its producer has told it.
      lane: the number that its producer has given to this consumer.
      announced: says whether the agent of this host has announced a segment; no other is opened.

    Raises:
      SharedMemoryError: the segment was not announced, is gone, or is none of hfg's.
    """

    def __init__(self, segment: str, lane: int, announced: Callable[[str], bool]) -> None:
        if "/" in segment or not announced(segment):
            raise SharedMemoryError(
                f"shared memory {segment!r:.120} was not announced on this host, so it is not opened"
            )
        self.segment = segment
        self._mapped, size = _map(segment, mmap.PROT_READ)
        magic, slots, self._slot_size = HEAD.unpack_from(self._mapped) if size >= PAGE else (b"", 0, 0)
        if magic != MAGIC or not 1 <= slots <= MOST_SLOTS or size != segment_size(slots, self._slot_size):
            raise SharedMemoryError(f'shared memory "{segment}" is no ring of this version of hfg')
        lane_mapped, lane_size = _map(f"{segment}.{lane}", mmap.PROT_READ | mmap.PROT_WRITE)
        if lane_size != LANE_SIZE or HEAD.unpack_from(lane_mapped)[:2] != (MAGIC, slots):
            raise SharedMemoryError(f'shared memory "{segment}" has no lane {lane}')
        self._generations = memoryview(self._mapped)[WORDS : WORDS + 8 * slots].cast("Q")
        words = memoryview(lane_mapped)[WORDS : WORDS + 16 * slots].cast("Q")
        self._taken, self._returned = words[:slots], words[slots:]
        self._lock = threading.RLock()  # views may end in any thread, and while one is made
        self._roots: dict[int, tuple[int, weakref.ref[Any]]] = {}  # by slot: generation, and what all views are of
        self._slots = slots

    @property
    def held(self) -> int:
        """How many slots this consumer has not given back."""
        return sum(root() is not None for _, root in list(self._roots.values()))

    def view(self, head: ArrayHead) -> np.ndarray[Any, Any]:
        """Give the array that a lease stands for, read-only, without a copy.

        Raises:
          ValueError: the lease is not of this ring, reaches out of its slot, or is of a slot that was given to others.
        """
        lease = head.lease
        if lease is None or lease.segment != self.segment or not 0 <= lease.slot < self._slots:
            raise ValueError(f'it has no lease of "{self.segment}", which this end may read')
        size = bytes_of(head, self._slot_size)
        if not 0 <= lease.offset <= self._slot_size - size:
            raise ValueError(f"an array of {size} bytes at {lease.offset} reaches out of its slot")
        return view_of(head, self._root(lease.slot, lease.generation), lease.offset)

    def _root(self, slot: int, generation: int) -> np.ndarray[Any, Any]:
        """Give the bytes of a slot, the same for all who view one generation of it."""
        with self._lock:
            known, reference = self._roots.get(slot, (0, None))
            alive = reference() if reference is not None and known == generation else None
            if alive is not None:
                return alive  # type: ignore[no-any-return]
            if known != generation and reference is not None and reference() is not None:
                raise ValueError("its lease is stale: a later array of the same slot is still looked at")
            if self._generations[slot] != generation:
                raise ValueError("its lease is stale: the slot was given to a later array")
            self._returned[slot] = 0
            self._taken[slot] = generation  # first say so, then look again: see Ring._find
            if self._generations[slot] != generation:
                self._returned[slot] = generation
                raise ValueError("its lease is stale: the slot was given to a later array")
            begin = PAGE + slot * self._slot_size
            root: np.ndarray[Any, Any] = np.ndarray((self._slot_size,), np.uint8, self._mapped, begin)
            reference = weakref.ref(root)
            self._roots[slot] = generation, reference
            weakref.finalize(root, self._give_back, slot, generation, reference).atexit = False
            return root

    def _give_back(self, slot: int, generation: int, reference: weakref.ref[Any]) -> None:
        with self._lock:
            if self._roots.get(slot, (0, None))[1] is reference:  # else somebody has begun to view it again
                del self._roots[slot]
                self._returned[slot] = generation


def _map(name: str, protection: int) -> tuple[mmap.mmap, int]:
    file, size = open_existing(name, writable=bool(protection & mmap.PROT_WRITE))
    try:
        if size < LANE_SIZE:
            raise SharedMemoryError(f'shared memory "{name}" is not ready: its producer has died while it made it')
        return mmap.mmap(file, size, prot=protection), size
    finally:
        os.close(file)

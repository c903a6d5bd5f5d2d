"""A consumer's side of a ring: read-only views, which give the slot back when the last view is gone.

Depends on `names` and `layout`.
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


class Reader:
    """One consumer's views of the arrays in one ring.

    Args:
      segment: the name of the ring, as received from its producer.
      lane: the number that the producer has assigned to this consumer.
      announced: returns whether the agent of this host has announced a segment; other segments are not opened.

    Raises:
      SharedMemoryError: the segment was not announced, is gone, or is not one of hfg's.
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
            raise SharedMemoryError(f'shared memory "{segment}" is not a ring of this version of hfg')
        lane_mapped, lane_size = _map(f"{segment}.{lane}", mmap.PROT_READ | mmap.PROT_WRITE)
        if lane_size != LANE_SIZE or HEAD.unpack_from(lane_mapped)[:2] != (MAGIC, slots):
            raise SharedMemoryError(f'shared memory "{segment}" has no lane {lane}')
        self._generations = memoryview(self._mapped)[WORDS : WORDS + 8 * slots].cast("Q")
        words = memoryview(lane_mapped)[WORDS : WORDS + 16 * slots].cast("Q")
        self._taken, self._returned = words[:slots], words[slots:]
        self._lock = threading.RLock()  # views may end in any thread, even while another is made
        # by slot: generation, and the object that all views have as their base
        self._roots: dict[int, tuple[int, weakref.ref[Any]]] = {}
        self._slots = slots

    @property
    def held(self) -> int:
        """How many slots this consumer has not returned."""
        return sum(root() is not None for _, root in list(self._roots.values()))

    def view(self, head: ArrayHead) -> np.ndarray[Any, Any]:
        """Return a read-only view of the array of a lease, without a copy.

        Raises:
          ValueError: the lease does not belong to this ring, exceeds its slot, or its slot was reused since.
        """
        lease = head.lease
        if lease is None or lease.segment != self.segment or not 0 <= lease.slot < self._slots:
            raise ValueError(f'it does not have a lease of "{self.segment}" that this end may read')
        size = bytes_of(head, self._slot_size)
        if not 0 <= lease.offset <= self._slot_size - size:
            raise ValueError(f"an array of {size} bytes at {lease.offset} exceeds its slot")
        return view_of(head, self._root(lease.slot, lease.generation), lease.offset)

    def _root(self, slot: int, generation: int) -> np.ndarray[Any, Any]:
        """Return the bytes of a slot: the same object for all views of one generation."""
        with self._lock:
            known, reference = self._roots.get(slot, (0, None))
            alive = reference() if reference is not None and known == generation else None
            if alive is not None:
                return alive  # type: ignore[no-any-return]
            if known != generation and reference is not None and reference() is not None:
                raise ValueError("its lease is stale: a later array of the same slot is still in use")
            if self._generations[slot] != generation:
                raise ValueError("its lease is stale: the slot was reused for a later array")
            self._returned[slot] = 0
            self._taken[slot] = generation  # first write it, then check again: see Ring._find
            if self._generations[slot] != generation:
                self._returned[slot] = generation
                raise ValueError("its lease is stale: the slot was reused for a later array")
            begin = PAGE + slot * self._slot_size
            root: np.ndarray[Any, Any] = np.ndarray((self._slot_size,), np.uint8, self._mapped, begin)
            reference = weakref.ref(root)
            self._roots[slot] = generation, reference
            weakref.finalize(root, self._give_back, slot, generation, reference).atexit = False
            return root

    def _give_back(self, slot: int, generation: int, reference: weakref.ref[Any]) -> None:
        with self._lock:
            if self._roots.get(slot, (0, None))[1] is reference:  # otherwise a new view of it exists
                del self._roots[slot]
                self._returned[slot] = generation


def _map(name: str, protection: int) -> tuple[mmap.mmap, int]:
    file, size = open_existing(name, writable=bool(protection & mmap.PROT_WRITE))
    try:
        if size < LANE_SIZE:
            raise SharedMemoryError(f'shared memory "{name}" is not ready: its producer died while making it')
        return mmap.mmap(file, size, prot=protection), size
    finally:
        os.close(file)

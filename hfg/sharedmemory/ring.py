"""The producer's side of a ring: loans slots, puts arrays into them, and knows when one is free again.

Stands on `names` and `layout`.
"""

from __future__ import annotations

import math
import mmap
import os
import threading
import weakref
from typing import Any, Final

import msgspec
import numpy as np
import numpy.typing as npt

from hfg.encoding.arrays import Lease, array_problem
from hfg.errors import SharedMemoryError, UsageError
from hfg.sharedmemory.layout import HEAD, LANE_SIZE, MAGIC, MOST_SLOTS, PAGE, WORDS, pages, segment_size
from hfg.sharedmemory.names import create, remove

__all__ = ["Ring", "RingCounts"]

_SMALLEST: Final = 2**16
"""Below that a copy costs less than a lease."""


class RingCounts(msgspec.Struct):
    """What became of the arrays.

    Attributes:
      loaned: slots that were loaned to be written to.
      placed: arrays that were sent by a lease.
      copied: those of them that had to be copied into a slot first, for nobody had loaned it.
      without_slot: arrays that went the ordinary way because no slot was free.
      too_large: arrays that went the ordinary way because no slot is large enough.
    """

    loaned: int = 0
    placed: int = 0
    copied: int = 0
    without_slot: int = 0
    too_large: int = 0


class _Slot:
    """One slot, as its producer knows it.

    Attributes:
      generation: what lies in it now; leases of others are of no use.
      sendings: that are not done.
      is_viewed: by an array of this process.
    """

    __slots__ = ("generation", "is_viewed", "sendings")

    def __init__(self) -> None:
        self.generation = 0
        self.sendings = 0
        self.is_viewed = False

    def renew(self) -> int:
        """Something else will lie in it; give its generation."""
        self.generation += 1
        return self.generation

    def view(self, viewed: bool) -> None:
        """An array of this process lies there now, or is gone."""
        self.is_viewed = viewed

    def sent(self) -> None:
        """What lies in it goes to consumers, once more."""
        self.sendings += 1

    def done(self) -> None:
        """One of those is done with everywhere."""
        self.sendings -= 1


class _Lane:
    """What one consumer has taken and given back."""

    def __init__(self, name: str, slots: int) -> None:
        self.name = name
        file = create(name, LANE_SIZE)
        try:
            mapped = mmap.mmap(file, LANE_SIZE)
            HEAD.pack_into(mapped, 0, MAGIC, slots, 0)
        finally:
            os.close(file)
        words = memoryview(mapped)[WORDS : WORDS + 16 * slots].cast("Q")
        self.taken, self.returned = words[:slots], words[slots:]

    def holds(self, slot: int, generation: int) -> bool:
        return self.taken[slot] == generation != self.returned[slot]


class Ring:
    """Slots in shared memory for the arrays of one output.

    Args:
      name: of the segment, as `segment_name` gives it.
      slots: how many arrays may be on their way or looked at by consumers at the same time.
      slot_size: bytes of the largest array.
      smallest: bytes below which arrays are not placed.

    Raises:
      SharedMemoryError: there is no shared memory, no room in it, or one of that name.

    Examples:
      >>> from hfg.sharedmemory import segment_name
      >>> ring = Ring(segment_name("docs", "here", os.getpid(), "image"), slots=2, slot_size=2**20)
      >>> image = ring.loan((480, 640), np.uint8)
      >>> image[:] = 7  # straight into shared memory
      >>> lease = ring.place(image)
      >>> ring.free
      1
      >>> ring.done(lease)
      >>> del image
      >>> ring.free
      2
      >>> ring.close()
    """

    def __init__(self, name: str, slots: int, slot_size: int, *, smallest: int = _SMALLEST) -> None:
        if not 1 <= slots <= MOST_SLOTS or slot_size < 1:
            raise SharedMemoryError(
                f"a ring has 1 to {MOST_SLOTS} slots of at least one byte, not {slots} of {slot_size}"
            )
        self.name = name
        self.slot_size = pages(slot_size)
        self.smallest = smallest
        self.counts = RingCounts()
        size = segment_size(slots, self.slot_size)
        self._file = create(name, size)  # kept open: its lock says that the producer lives
        self._mapped = mmap.mmap(self._file, size)
        self._generations = memoryview(self._mapped)[WORDS : WORDS + 8 * slots].cast("Q")
        self._slots = [_Slot() for _ in range(slots)]
        self._next = 0
        self._turns = threading.RLock()  # nodes of thread groups loan while the loop sends; the same thread may collect
        self._loans: dict[int, tuple[int, int]] = {}  # by id of the array: slot and address
        self._lanes: dict[int, _Lane] = {}
        self._admitted = 0
        self._closed = False
        HEAD.pack_into(self._mapped, 0, MAGIC, slots, self.slot_size)

    @property
    def free(self) -> int:
        """How many slots are free: these are the credits."""
        return sum(self._is_free(number) for number in range(len(self._slots)))

    def _is_free(self, number: int) -> bool:
        slot = self._slots[number]
        if slot.sendings or slot.is_viewed:
            return False
        return not any(lane.holds(number, slot.generation) for lane in self._lanes.values())

    # --- consumers ---

    def admit(self) -> int:
        """Let a consumer in, or a new incarnation of one; give the number of the lane that it is to open.

        Raises:
          SharedMemoryError: there is no room.
        """
        self._must_be_open()
        self._admitted += 1
        self._lanes[self._admitted] = _Lane(f"{self.name}.{self._admitted}", len(self._slots))
        return self._admitted

    def dismiss(self, lane: int) -> None:
        """Take back what a consumer holds, since it is dead; what it still writes reaches nobody."""
        found = self._lanes.pop(lane, None)
        if found is not None:
            remove(found.name)

    # --- arrays ---

    def loan(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> np.ndarray[Any, Any] | None:
        """Give an array to write to that lies in a slot, or None if no slot is free.

        A loan that is never sent goes back when the array is gone.

        Raises:
          SharedMemoryError: no array of this shape and dtype can be in a slot.
        """
        kind = np.dtype(dtype)
        size = math.prod(shape) * kind.itemsize
        if array_problem(kind) is not None or size > self.slot_size:
            raise SharedMemoryError(
                f"an array of {kind}, {' x '.join(map(str, shape))}, does not fit a slot of {self.slot_size} bytes of "
                f'"{self.name}"'
            )
        with self._turns:
            self._must_be_open()
            number = self._find()
            if number is None:
                return None
            self.counts.loaned += 1
            return self._array(number, shape, kind)

    def _find(self) -> int | None:
        """Give a free slot a new generation, in turn, so that what was given back last is used last."""
        for turn in range(len(self._slots)):
            number = (self._next + turn) % len(self._slots)
            if not self._is_free(number):
                continue
            slot, old = self._slots[number], self._slots[number].generation
            self._generations[number] = slot.renew()
            # Who takes a slot says so before it looks at the generation, and here it is the other way round: a late
            # lease is seen by one of the two.
            if any(lane.holds(number, old) for lane in self._lanes.values()):
                continue
            self._next = number + 1
            return number
        return None

    def _array(self, number: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> np.ndarray[Any, Any]:
        made: np.ndarray[Any, Any] = np.ndarray(shape, dtype, self._mapped, PAGE + number * self.slot_size)
        self._slots[number].view(True)
        self._loans[id(made)] = number, _address(made)
        # All views of it, and views of views, have it as their base, so it is gone when the last of them is.
        weakref.finalize(made, self._forget, id(made), number).atexit = False
        return made

    def _forget(self, identity: int, number: int) -> None:
        del self._loans[identity]
        self._slots[number].view(False)

    def place(self, array: np.ndarray[Any, Any]) -> Lease | None:
        """Give the lease by which consumers view an array; None: it goes the ordinary way, and the counts say why.

        A loaned array, or a contiguous part of one, stays where it is; another is copied into a free slot. It must not
        be written to any more. Every lease that was given is to be told as `done`.
        """
        with self._turns:
            return self._place(array)

    def _place(self, array: np.ndarray[Any, Any]) -> Lease | None:
        self._must_be_open()
        root = array.base if isinstance(array.base, np.ndarray) else array
        loan = self._loans.get(id(root))
        if loan is not None and array.flags.c_contiguous:
            number, begin = loan
            root.flags.writeable = array.flags.writeable = False
            offset = _address(array) - begin if array.size else 0
        else:
            if array.nbytes < self.smallest:
                return None
            if array.nbytes > self.slot_size:
                self.counts.too_large += 1
                return None
            found = self._find()
            if found is None:
                self.counts.without_slot += 1
                return None
            number, offset = found, 0
            np.copyto(np.ndarray(array.shape, array.dtype, self._mapped, PAGE + number * self.slot_size), array)
            self.counts.copied += 1
        slot = self._slots[number]
        slot.sent()
        self.counts.placed += 1
        return Lease(self.name, number, slot.generation, offset)

    def done(self, lease: Lease) -> None:
        """Say that a token with this lease is done at all consumers, or was given up; views of it may still live.

        Raises:
          UsageError: the lease is not one of those that are still out.
        """
        slot = self._slots[lease.slot] if lease.segment == self.name and lease.slot < len(self._slots) else None
        if slot is None or slot.generation != lease.generation or not slot.sendings:
            raise UsageError(f'{lease} is no lease of "{self.name}" that is still out')
        slot.done()

    def close(self) -> None:
        """Remove the segment; arrays and views of it stay readable where they are."""
        with self._turns:
            if self._closed:
                return
            self._closed = True
        for lane in list(self._lanes):
            self.dismiss(lane)
        remove(self.name)
        os.close(self._file)

    def _must_be_open(self) -> None:
        if self._closed:
            raise UsageError(f'the ring "{self.name}" is closed')


def _address(array: np.ndarray[Any, Any]) -> int:
    found: int = array.__array_interface__["data"][0]
    return found

"""The producer's side of a ring: loans slots, puts arrays into them, and keeps track of free slots.

Depends on `names` and `layout`.
"""

from __future__ import annotations

import math
import mmap
import os
import secrets
import threading
import weakref
from typing import Any, Final

import msgspec
import numpy as np
import numpy.typing as npt

from hfg.encoding.arrays import Lease, array_problem
from hfg.errors import SharedMemoryError, UsageError
from hfg.sharedmemory.layout import HEAD, LANE_SIZE, MAGIC, MOST_LANE, MOST_SLOTS, PAGE, WORDS, pages, segment_size
from hfg.sharedmemory.names import create, remove

_SMALLEST: Final = 2**16
"""Below this size a copy is cheaper than a lease."""


class RingCounts(msgspec.Struct):
    """Counts of arrays by how they were sent.

    Attributes:
      loaned: slots that were loaned for writing.
      placed: arrays that were sent with a lease.
      copied: placed arrays that had to be copied into a slot first because they were not in a loaned slot.
      without_slot: arrays that went the ordinary way because no slot was free.
      too_large: arrays that went the ordinary way because no slot is large enough.
    """

    loaned: int = 0
    placed: int = 0
    copied: int = 0
    without_slot: int = 0
    too_large: int = 0


class _Slot:
    """The producer's state of one slot.

    Attributes:
      generation: the generation of its current array; leases of other generations are invalid.
      sendings: number of sendings that are not acknowledged.
      is_viewed: whether an array of this process uses it.
    """

    __slots__ = ("generation", "is_viewed", "sendings")

    def __init__(self) -> None:
        self.generation = 0
        self.sendings = 0
        self.is_viewed = False

    def renew(self) -> int:
        """Start the next generation, for other contents. Return it."""
        self.generation += 1
        return self.generation

    def view(self, viewed: bool) -> None:
        """Set whether an array of this process uses it."""
        self.is_viewed = viewed

    def sent(self) -> None:
        """Count one more sending of its array to consumers."""
        self.sendings += 1

    def done(self) -> None:
        """Count one sending as acknowledged by all consumers."""
        self.sendings -= 1


class _Lane:
    """The generations that one consumer has taken and returned."""

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
      name: name of the segment, from `segment_name`.
      slots: how many arrays may be in transit or in use by consumers at the same time.
      slot_size: size of the largest array in bytes.
      smallest: size below which arrays are not placed, in bytes.

    Raises:
      SharedMemoryError: there is no shared memory, no room in it, or a segment of that name already exists.

    Examples:
      >>> from hfg.sharedmemory import segment_name
      >>> ring = Ring(segment_name("docs", "here", os.getpid(), "image"), slots=2, slot_size=2**20)
      >>> image = ring.loan((480, 640), np.uint8)
      >>> image[:] = 7  # directly into shared memory
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
        self._file = create(name, size)  # kept open: its lock shows that the producer is alive
        self._mapped = mmap.mmap(self._file, size)
        self._generations = memoryview(self._mapped)[WORDS : WORDS + 8 * slots].cast("Q")
        self._slots = [_Slot() for _ in range(slots)]
        self._next = 0
        # nodes of thread groups loan while the loop sends; garbage collection may re-enter it in the same thread
        self._turns = threading.RLock()
        self._loans: dict[int, tuple[int, int]] = {}  # by id of the array: slot and address
        self._lanes: dict[int, _Lane] = {}
        self._closed = False
        HEAD.pack_into(self._mapped, 0, MAGIC, slots, self.slot_size)

    @property
    def free(self) -> int:
        """Number of free slots: these are the credits."""
        return sum(self._is_free(number) for number in range(len(self._slots)))

    def _is_free(self, number: int) -> bool:
        slot = self._slots[number]
        if slot.sendings or slot.is_viewed:
            return False
        return not any(lane.holds(number, slot.generation) for lane in self._lanes.values())

    # --- consumers ---

    def admit(self) -> int:
        """Admit a consumer, or a new incarnation of one. Return the number of the lane that it must open.

        Raises:
          SharedMemoryError: there is no room.
        """
        self._must_be_open()
        number = 1 + secrets.randbelow(MOST_LANE)  # one that no other user can take first, as the next of a row
        self._lanes[number] = _Lane(f"{self.name}.{number}", len(self._slots))
        return number

    def dismiss(self, lane: int) -> None:
        """Free the slots that a dead consumer holds; anything that it still writes has no effect."""
        found = self._lanes.pop(lane, None)
        if found is not None:
            remove(found.name)

    # --- arrays ---

    def loan(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> np.ndarray[Any, Any] | None:
        """Return a writable array in a slot, or None if no slot is free.

        A loan that is never sent is returned when the array is garbage-collected.

        Raises:
          SharedMemoryError: an array of this shape and dtype does not fit into a slot.
        """
        kind = np.dtype(dtype)
        size = math.prod(shape) * kind.itemsize
        if array_problem(kind) is not None or size > self.slot_size:
            raise SharedMemoryError(
                f"an array of {kind}, {' x '.join(map(str, shape))}, does not fit into a slot of "
                f'{self.slot_size} bytes of "{self.name}"'
            )
        with self._turns:
            self._must_be_open()
            number = self._find()
            if number is None:
                return None
            self.counts.loaned += 1
            return self._array(number, shape, kind)

    def _find(self) -> int | None:
        """Return a free slot with a new generation, round robin, so that the slot returned last is reused last."""
        for turn in range(len(self._slots)):
            number = (self._next + turn) % len(self._slots)
            if not self._is_free(number):
                continue
            slot, old = self._slots[number], self._slots[number].generation
            self._generations[number] = slot.renew()
            # A reader writes that it has taken a slot before it reads the generation; here it is the other way round:
            # the generation is written first, then the lanes are read. So with a late lease, one of the two sides
            # notices. If both read before writing, the reader could view a slot while it is overwritten.
            if any(lane.holds(number, old) for lane in self._lanes.values()):
                continue
            self._next = number + 1
            return number
        return None

    def _array(self, number: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> np.ndarray[Any, Any]:
        made: np.ndarray[Any, Any] = np.ndarray(shape, dtype, self._mapped, PAGE + number * self.slot_size)
        self._slots[number].view(True)
        self._loans[id(made)] = number, _address(made)
        # All views, and views of views, have it as their base, so it is garbage-collected after the last of them.
        weakref.finalize(made, self._forget, id(made), number).atexit = False
        return made

    def _forget(self, identity: int, number: int) -> None:
        del self._loans[identity]
        self._slots[number].view(False)

    def place(self, array: np.ndarray[Any, Any]) -> Lease | None:
        """Return the lease for consumers of an array; None: it has to be sent as bytes, and the counts have the reason.

        A loaned array, or a contiguous part of one, stays where it is; any other array is copied into a free slot. It
        must no longer be written to. Call `done` for every lease that was returned.
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
        """Record that a token with this lease was acknowledged by all consumers, or dropped; views may still exist.

        Raises:
          UsageError: the lease is not outstanding.
        """
        slot = self._slots[lease.slot] if lease.segment == self.name and lease.slot < len(self._slots) else None
        if slot is None or slot.generation != lease.generation or not slot.sendings:
            raise UsageError(f'{lease} is not an outstanding lease of "{self.name}"')
        slot.done()

    def close(self) -> None:
        """Remove the segment; arrays and views of it stay readable."""
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

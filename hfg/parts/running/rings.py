"""Large arrays on edges between processes of one host: they are in shared memory, and only leases are sent.

The producer of an edge makes a ring when the first large array is sent over it, and offers the ring to the consumer.
The consumer opens it and confirms, or cannot because it is on another host. Until then, and whenever no slot is free or
large enough, arrays are sent as bytes. A slot is returned when the link has an acknowledgement for its token. Nothing
here waits. Depends on `hfg.sharedmemory` and `messages`.
"""

from __future__ import annotations

import math
import secrets
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Final

import msgspec
import numpy as np

from hfg.base.logs import Log
from hfg.base.token import Token
from hfg.encoding import ArrayHead, Lease, TokenCodec
from hfg.encoding.arrays import array_problem
from hfg.errors import SharedMemoryError, UsageError
from hfg.parts.model.messages import Sees, Shares
from hfg.sharedmemory import Reader, Ring, RingCounts, segment_name, sweep, unavailable

_LOGGER = Log("hfg.parts")
_REALM: Final = "run"
_SMALLEST: Final = 2**16
"""Bytes of an array below which a copy costs less than a lease."""
_SPARE: Final = 2  # slots in addition to those of tokens in transit: one is being read, one is being written
_MOST_SLOTS: Final = 128
_LARGEST: Final = 2**28
"""Bytes of a ring that are not exceeded for the sake of a long queue: what finds no slot there waits for one."""


def segments_of(run: str) -> str:
    """Return the common prefix of the names of all shared memory of a run."""
    return f"hfg-{_REALM}-{run.rpartition('/')[2]}-"


def segment_of(run: str, incarnation: int, edge: int) -> str:
    """Return the beginning of the name of an edge's ring, up to the last "_"; each incarnation of its producer has one.

    What follows is random: whoever has seen the name of one ring could otherwise take the names of all that follow.
    """
    return segment_name(_REALM, run.rpartition("/")[2], incarnation, f"edge_{edge}")


def sweep_run(run: str) -> None:
    """Remove what processes of a run have left that were killed."""
    sweep(segments_of(run))


def sweep_runs() -> None:
    """Remove what whole runs of this user have left that were killed; those that live keep theirs."""
    sweep(f"hfg-{_REALM}-")


class LendingCounts(msgspec.Struct):
    """Why large arrays of an edge went the ordinary way although there is shared memory.

    Attributes:
      early: the consumer had not opened the ring yet.
      without_slot: no slot was free.
      too_large: no slot is large enough.
    """

    early: int = 0
    without_slot: int = 0
    too_large: int = 0


class Lending:
    """The producer's side of an edge.

    Attributes:
      ring: the ring for large arrays, once there was one.
      is_answered: the consumer has reported whether it can open the offered ring. Until then each large array has to be
        copied, up to a whole window of them.
    """

    def __init__(
        self,
        run: str,
        incarnation: int,
        edge: int,
        label: str,
        window: int,
        unfinished: Callable[[], int],
        say: Callable[[Shares], None],
    ) -> None:
        """Start without a ring.

        Args:
          run: the name by which all parts know the run.
          incarnation: of the producer.
          edge: its number.
          label: label of the edge.
          window: how many tokens may be in transit.
          unfinished: returns how many are in transit, according to the link.
          say: sends a message to the part of the consumer.
        """
        self.ring: Ring | None = None
        self._run = run
        self._incarnation = incarnation
        self._segment = f"{segment_of(run, incarnation, edge)}_{secrets.token_hex(4)}"
        self._label = label
        self._slots = window + _SPARE
        self._most = self._window = window
        self._unfinished = unfinished
        self._say = say
        self._thread = threading.get_ident()
        self._lane = 0
        self._is_seen = False
        self.is_answered = True
        self._is_refused = unavailable() is not None
        self._early = 0
        self._leases: deque[list[Lease]] = deque()  # of each token in transit, oldest first
        self._new: list[Lease] = []

    @property
    def counts(self) -> LendingCounts:
        """How many large arrays went the ordinary way, and why."""
        found = RingCounts() if self.ring is None else self.ring.counts
        return LendingCounts(self._early, found.without_slot, found.too_large)

    @property
    def room(self) -> int:
        """How many more tokens may leave so that each large array finds a slot that is not in transit."""
        return self._most - sum(map(bool, self._leases)) if self._is_seen else self._window

    def loan(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> np.ndarray[Any, Any] | None:
        """Return an array of the ring to fill; None if there is no ring, or no slot is free."""
        size = math.prod(shape) * dtype.itemsize
        if self._is_refused or size < _SMALLEST:
            return None
        if self.ring is None and threading.get_ident() == self._thread:  # messages to the consumer are sent from there
            self._make(size)
        ring = self.ring
        if ring is None or size > ring.slot_size or array_problem(dtype) is not None:
            return None
        try:
            return ring.loan(shape, dtype)
        except UsageError:  # closed at this very moment because the run is over
            return None

    def encode(self, codec: TokenCodec[Any], token: Token[Any]) -> tuple[bytes, bytes]:
        """Make bytes of a token, whose large arrays go into the ring; `sent` is called when the link has it."""
        self.settle()
        try:
            return codec.encode(token, place=self._place)
        except BaseException:
            self._give_back(self._new)
            self._new = []
            raise

    def sent(self) -> None:
        """The link has accepted the token, or found that it is not needed."""
        if self.ring is None:
            return
        new, self._new = self._new, []
        if self._unfinished() > len(self._leases):
            self._leases.append(new)
        else:
            self._give_back(new)
        self.settle()

    def settle(self) -> None:
        """The link is done with some tokens, perhaps: their slots are free."""
        if self.ring is None:
            return
        unfinished = self._unfinished()
        while len(self._leases) > unfinished:
            self._give_back(self._leases.popleft())

    def _give_back(self, leases: list[Lease]) -> None:
        ring = self.ring
        if ring is not None:
            for lease in leases:
                ring.done(lease)

    def _place(self, array: np.ndarray[Any, Any]) -> Lease | None:
        if self._is_refused or array.nbytes < _SMALLEST:
            return None
        if self.ring is None:
            self._make(array.nbytes)
        if self.ring is None or self._is_refused:
            return None
        if not self._is_seen:
            self._early += 1
            return None
        lease = self.ring.place(array)
        if lease is not None:
            self._new.append(lease)
        return lease

    def _make(self, size: int) -> None:
        try:
            if self._incarnation > 1:
                sweep_run(self._run)  # a previous incarnation of this part may have left a large one
            slots = max(1 + _SPARE, min(self._slots, _MOST_SLOTS, _LARGEST // size))
            self.ring = Ring(self._segment, slots, size, smallest=_SMALLEST)
            self._most = slots - _SPARE
            self._leases.extend([] for _ in range(self._unfinished()))
            self._offer()
        except (SharedMemoryError, OSError) as error:
            self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        _LOGGER.warning('edge "%s" copies its arrays: %s', self._label, error)
        self.close()

    def _offer(self) -> None:
        assert self.ring is not None
        self._lane = self.ring.admit()
        self.is_answered = False
        self._say(Shares(self._label, self._segment, self._lane))

    def admit(self) -> None:
        """The consumer is restarted: slots that it held are free, and it can open resent arrays."""
        if self.ring is None or self._is_refused:
            return
        self.ring.dismiss(self._lane)
        self._is_seen = False
        try:
            self._offer()
        except (SharedMemoryError, OSError) as error:
            if any(self._leases):  # without a lane, what is resent cannot be read
                raise
            self._give_up(error)

    def seen(self, message: Sees) -> None:
        """The consumer has opened what it was offered, or cannot."""
        if (message.segment, message.lane) != (self._segment, self._lane):
            return  # from a previous incarnation
        self.is_answered = True
        if message.refused:
            _LOGGER.debug('edge "%s" copies its arrays: %s', self._label, message.refused)
            if not any(self._leases):
                self.close()
            return
        self._is_seen = True

    def close(self) -> None:
        """Remove the ring; who looks at arrays in it keeps them."""
        self._is_refused = True
        self._is_seen = False
        self.is_answered = True
        ring = self.ring
        if ring is None:
            return
        counts = self.counts
        if counts.without_slot or counts.too_large:
            _LOGGER.info(
                'edge "%s" has sent %d large arrays through shared memory, and copied %d because no slot was free, '
                "%d because they were larger than the first",
                self._label,
                ring.counts.placed,
                counts.without_slot,
                counts.too_large,
            )
        self._leases.clear()
        ring.close()


class Borrowing:
    """The consumer's side of an edge.

    Attributes:
      is_awaited: a lease has arrived before the offer of its ring, which is in transit.
    """

    def __init__(self, run: str, say: Callable[[Sees], None]) -> None:
        """Start without an offer.

        Args:
          run: the name by which all parts know the run.
          say: sends a message to the part of the producer.
        """
        self.is_awaited = False
        self._segments = segments_of(run)
        self._say = say
        self._reader: Reader | None = None

    def open(self, message: Shares) -> None:
        """The producer has offered a ring."""
        refused = ""
        try:
            self._reader = Reader(message.segment, message.lane, self._is_announced)
        except (SharedMemoryError, OSError) as error:
            refused = str(error)
        self.is_awaited = False
        self._say(Sees(message.label, message.segment, message.lane, refused))

    def _is_announced(self, segment: str) -> bool:
        return segment.startswith(self._segments)

    def view(self, head: ArrayHead) -> np.ndarray[Any, Any]:
        """Return the array of a lease.

        Raises:
          ValueError: there is no such array, or its ring is not known yet.
        """
        lease = head.lease
        if self._reader is None or lease is None or lease.segment != self._reader.segment:
            self.is_awaited = lease is not None and self._is_announced(lease.segment)
            raise ValueError("it has an array in shared memory that was not offered to this end")
        return self._reader.view(head)

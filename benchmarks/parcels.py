"""The messages between processes in the benchmarks of links, and the recorder of their arrivals.

A letter has 100 bytes, a picture 6.2 megabytes: a frame of 1080p in colour, always the same one, which nobody writes
to. Both carry their number and the moment at which they were sent, of the clock that all processes of a host share: the
letter in its bytes, the picture beside it.
"""

from __future__ import annotations

import functools
import struct
import time
from collections.abc import Iterator
from time import monotonic_ns
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["LETTER", "Job", "Picture", "Post", "letter", "opened", "picture", "picture_bytes"]

LETTER = 100
SHAPE = (1080, 1920, 3)
HEAD = struct.Struct("<qq")
PADDING = bytes(range(LETTER - HEAD.size))

Picture = npt.NDArray[np.uint8]


class Job(NamedTuple):
    """The work of one pair of processes.

    Attributes:
      what: is sent.
      number: how many of it.
      rate_hz: at which rate; 0: as fast as it goes.
      leaky: what is too many may be lost, and nobody waits.
    """

    what: Literal["letter", "picture"]
    number: int
    rate_hz: float = 0.0
    leaky: bool = False

    @property
    def warm(self) -> int:
        """How many are the warm-up."""
        return max(1, self.number // 10)

    def numbers(self) -> Iterator[int]:
        """Count at the rate, by an absolute schedule, even if the caller blocks meanwhile."""
        began = time.monotonic()
        for number in range(self.number):
            if self.rate_hz:
                time.sleep(max(0.0, began + number / self.rate_hz - time.monotonic()))
            yield number

    def wait_s(self, began: float, number: int) -> float:
        """Return how long until this one's turn, for whoever may not; negative: it is late."""
        return began + number / self.rate_hz - time.monotonic() if self.rate_hz else -1.0


def letter(number: int) -> bytes:
    """Write one, now."""
    return HEAD.pack(number, monotonic_ns()) + PADDING


def opened(letter: Any) -> tuple[int, int]:
    """Return the number of a letter, or of what is written like one, and when it was sent."""
    return HEAD.unpack_from(letter)


@functools.cache
def picture_bytes() -> bytes:
    """The picture for senders of bytes: it has them without a copy."""
    return np.random.default_rng(1).integers(0, 255, SHAPE, dtype=np.uint8).tobytes()


@functools.cache
def picture() -> Picture:
    """The picture as an array, of the same bytes."""
    return np.frombuffer(picture_bytes(), np.uint8).reshape(SHAPE)


class Post:
    """Notes what arrives, and when.

    Attributes:
      job: what is to arrive.
    """

    current: Post
    """That of this process: nodes of a graph that is written as a text cannot be given one."""

    def __init__(self, job: Job) -> None:
        """Expect it."""
        self.job = job
        self.count = 0
        if job.what == "picture":
            _corners()  # not when the first arrives
        self._ages: list[int] = []
        self._began = self._ended = 0
        self._last = -1

    def take(self, number: int, sent_ns: int) -> None:
        """One has arrived; those before the first, by number, are for who needs more of a warm-up."""
        now = monotonic_ns()
        if number < 0:
            return
        if number <= self._last or (number > self._last + 1 and not self.job.leaky):
            raise RuntimeError(f"number {number} has arrived behind {self._last}")
        self.count += 1
        self._last = number
        if number >= self.job.warm:
            if not self._ages:
                self._began = now
            self._ages.append(now - sent_ns)
            self._ended = now

    def take_letter(self, letter: Any) -> None:
        """A letter has arrived."""
        self.take(*HEAD.unpack_from(letter))

    def take_picture(self, number: int, sent_ns: int, picture: Picture) -> None:
        """A picture has arrived, as an array; its corners show that it is the one."""
        self.take(number, sent_ns)
        if picture.shape != SHAPE or picture[0, 0, 0] != _corners()[0] or picture[-1, -1, -1] != _corners()[1]:
            raise RuntimeError(f"what has arrived as number {number} is not the picture")

    @property
    def is_over(self) -> bool:
        """Whether the last one has arrived."""
        return self._last == self.job.number - 1

    def figures(self) -> dict[str, float]:
        """Microseconds: between two that arrive where they are sent as fast as it goes, and how old they are.

        Raises:
          RuntimeError: too few have arrived; all have to, unless what is too many may be lost.
        """
        ages = sorted(self._ages)
        if len(ages) < 2 or (self.count < self.job.number and not self.job.leaky):
            raise RuntimeError(f"{self.count} of {self.job.number} have arrived")
        figures = {} if self.job.rate_hz else {"wall": (self._ended - self._began) / (len(ages) - 1) / 1000}
        return figures | {
            "p50": ages[len(ages) // 2] / 1000,
            "p99": ages[len(ages) * 99 // 100] / 1000,
            "lost": 100 * (1 - self.count / self.job.number),
        }


@functools.cache
def _corners() -> tuple[int, int]:
    return int(picture()[0, 0, 0]), int(picture()[-1, -1, -1])

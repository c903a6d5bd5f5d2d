"""Sources of numbers: ranges that end, lists, chance that is the same in every run, and waves.

Depends on nodetype, functions and ports.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any, Final, Literal, TypeVar

from annotated_types import Interval, MinLen, Predicate, Unit

from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State

T = TypeVar("T")


def is_not_zero(value: float) -> bool:
    """Say whether it is a number that leads on."""
    return value != 0 and math.isfinite(value)


def is_a_number(value: float) -> bool:
    """Say whether it is a number at all, or endless; no NaN."""
    return not math.isnan(value)


class IntRange(Node):
    """Count through a range of whole numbers, then end.

    Works as Python's `range`: the first number is `start`, each is `step` more than the one before, and `stop` is not
    reached, unless it is closed. The slot `reset` starts over. Parameters that change take effect with the next number.

    Attributes:
      start: the first number.
      stop: where it ends.
      step: the way from one to the next; negative counts down.
      closed: whether `stop` belongs to the range.
      out: the numbers.

    CS::APEX: csapex::IntRangeGenerator.
    """

    out = Output(int)
    start = Parameter(0)
    stop = Parameter(10)
    step = Parameter(1, Predicate(is_not_zero))
    closed = Parameter(False)

    def process(self) -> Iterator[int]:
        """Count."""
        number = self.start
        while number < self.stop if self.step > 0 else number > self.stop:
            yield number
            number += self.step
        if self.closed and number == self.stop:
            yield number


class FloatRange(Node):
    """Count through a range of numbers, then end.

    The numbers are `start + n * step`, so that no error adds up; one that is nearer to `stop` than a billionth of a
    step counts as `stop`, which is not reached unless the range is closed. The slot `reset` starts over.

    Attributes:
      start: the first number.
      stop: where it ends; infinity never does.
      step: the way from one to the next; negative counts down.
      closed: whether `stop` belongs to the range.
      out: the numbers.

    CS::APEX: csapex::DoubleRangeGenerator.
    """

    out = Output(float)
    start = Parameter(0.0, Predicate(math.isfinite), unit="of the value")
    stop = Parameter(1.0, Predicate(is_a_number), unit="of the value")
    step = Parameter(0.1, Predicate(is_not_zero), unit="of the value")
    closed = Parameter(False)

    def process(self) -> Iterator[float]:
        """Count."""
        start, step, number = self.start, self.step, 0
        while True:
            value = start + number * step
            # In steps from here to the end; an end of the same sign as the step lies ahead.
            left = (self.stop - value) / step
            if left > 1e-9:
                yield value
            elif self.closed and left >= -1e-9:
                yield self.stop
                return
            else:
                return
            number += 1


class LinearSpace(Node):
    """Send a number of equally spaced values, including both ends, then end.

    Attributes:
      start: the first number.
      stop: the last number.
      count: how many numbers; of one it is the first.
      out: the numbers.
    """

    out = Output(float)
    start = Parameter(0.0, Predicate(math.isfinite), unit="of the value")
    stop = Parameter(1.0, Predicate(math.isfinite), unit="of the value")
    count = Parameter(11, Interval(ge=1))

    def process(self) -> Iterator[float]:
        """Yield them."""
        last = self.count - 1
        for number in range(self.count):
            # Weighted ends instead of steps: the last one is met exactly, and nothing overflows between the two.
            yield self.start if not last else self.start * ((last - number) / last) + self.stop * (number / last)


class ListSource(Node):
    """Send the values of a list one by one, then end.

    None in the list is silence.

    Attributes:
      values: what is given.
      times: how often the list is gone through; 0 means without end.
      out: the values.
    """

    out = Output(Any)
    values = Parameter[Sequence[Any]]((), type=Sequence[Any])
    times = Parameter(1, Interval(ge=0))

    def process(self) -> Iterator[Any]:
        """Yield them."""
        values = list(self.values)
        turn = 0
        while values and (self.times == 0 or turn < self.times):
            yield from values
            turn += 1


# --- chance ---


class _Chance(Node):
    """Draws with a generator of its own, which begins in the same state in each run."""

    def _draw(self, count: int, seed: int | None, draw: Callable[[random.Random], T]) -> Iterator[T]:
        chance = random.Random(seed)
        number = 0
        while count == 0 or number < count:
            yield draw(chance)
            number += 1


class RandomUniform(_Chance):
    """Send random numbers that are all equally likely between two limits.

    Every run sends the same ones, and so do two nodes with the same seed.

    Attributes:
      low: the lower limit.
      high: the upper limit; below the lower one they change places.
      seed: another seed gives other numbers; with None, every run has different ones.
      count: how many are sent before it ends; 0 means without end.
      out: the numbers.
    """

    out = Output(float)
    low = Parameter(0.0, Predicate(math.isfinite), unit="of the value")
    high = Parameter(1.0, Predicate(math.isfinite), unit="of the value")
    seed = Parameter[int | None](0, type=int | None)
    count = Parameter(0, Interval(ge=0))

    def process(self) -> Iterator[float]:
        """Draw."""
        return self._draw(self.count, self.seed, lambda chance: chance.uniform(self.low, self.high))


class RandomNormal(_Chance):
    """Send random numbers of the normal distribution.

    Every run sends the same ones, and so do two nodes with the same seed.

    Attributes:
      mean: their mean.
      sigma: their standard deviation.
      seed: another seed gives other numbers; with None, every run has different ones.
      count: how many are sent before it ends; 0 means without end.
      out: the numbers.
    """

    out = Output(float)
    mean = Parameter(0.0, Predicate(math.isfinite), unit="of the value")
    sigma = Parameter(1.0, Interval(ge=0), Predicate(math.isfinite), unit="of the value")
    seed = Parameter[int | None](0, type=int | None)
    count = Parameter(0, Interval(ge=0))

    def process(self) -> Iterator[float]:
        """Draw."""
        return self._draw(self.count, self.seed, lambda chance: chance.gauss(self.mean, self.sigma))


class RandomInt(_Chance):
    """Send random whole numbers that are all equally likely, both limits among them.

    Every run sends the same ones, and so do two nodes with the same seed.

    Attributes:
      low: the smallest.
      high: the largest; below the smallest they change places.
      seed: another seed gives other numbers; with None, every run has different ones.
      count: how many are sent before it ends; 0 means without end.
      out: the numbers.
    """

    out = Output(int)
    low = Parameter(1)
    high = Parameter(6)
    seed = Parameter[int | None](0, type=int | None)
    count = Parameter(0, Interval(ge=0))

    def process(self) -> Iterator[int]:
        """Draw."""
        return self._draw(self.count, self.seed, lambda chance: chance.randint(*sorted((self.low, self.high))))


class RandomBool(_Chance):
    """Send random truth values.

    Every run sends the same ones, and so do two nodes with the same seed.

    Attributes:
      probability: how likely true is, 0 to 1.
      seed: another seed gives other values; with None, every run has different ones.
      count: how many are sent before it ends; 0 means without end.
      out: the values.
    """

    out = Output(bool)
    probability = Parameter(0.5, Interval(ge=0, le=1), unit="1")
    seed = Parameter[int | None](0, type=int | None)
    count = Parameter(0, Interval(ge=0))

    def process(self) -> Iterator[bool]:
        """Draw."""
        return self._draw(self.count, self.seed, lambda chance: chance.random() < self.probability)


class RandomChoice(_Chance):
    """Send values of a list at random, all equally likely.

    Every run sends the same ones, and so do two nodes with the same seed.

    Attributes:
      choices: what is chosen from; a value that is there twice is twice as likely.
      seed: another seed gives other values; with None, every run has different ones.
      count: how many are sent before it ends; 0 means without end.
      out: the values.
    """

    out = Output(Any)
    choices = Parameter[Sequence[Any]]((False, True), MinLen(1), type=Sequence[Any])
    seed = Parameter[int | None](0, type=int | None)
    count = Parameter(0, Interval(ge=0))

    def process(self) -> Iterator[Any]:
        """Draw."""
        return self._draw(self.count, self.seed, lambda chance: chance.choice(self.choices))


class AddNoise(Node):
    """Add random numbers of the normal distribution to a stream.

    Every run adds the same ones, and so do two nodes with the same seed.

    Attributes:
      value: a number.
      sigma: the standard deviation of the noise, in the unit of the value.
      seed: another seed gives other numbers; with None, every run has different ones.
      noisy: the number with the noise.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    noisy = Output(float)
    sigma = Parameter(1.0, Interval(ge=0), Predicate(math.isfinite), unit="of the value")
    seed = Parameter[int | None](0, type=int | None)
    chance = State[random.Random | None](None)

    def process(self, value: float) -> float:
        """Add it."""
        if self.chance is None:
            self.chance = random.Random(self.seed)
        return value + self.chance.gauss(0.0, self.sigma)


# --- waves ---

_SHAPES: Final[dict[str, Callable[[float], float]]] = {
    "sine": lambda part: math.sin(2 * math.pi * part),
    "square": lambda part: 1.0 if part < 0.5 else -1.0,
    "triangle": lambda part: 1 - 4 * abs((part + 0.25) % 1 - 0.5),
    "sawtooth": lambda part: 2 * ((part + 0.5) % 1) - 1,
}


@node
def waveform(
    time_s: float,
    *,
    shape: Literal["sine", "square", "triangle", "sawtooth"] = "sine",
    frequency_hz: Annotated[float, Unit("1/s")] = 1.0,
    amplitude: Annotated[float, Unit("of the value")] = 1.0,
    offset: Annotated[float, Unit("of the value")] = 0.0,
    phase: Annotated[float, Unit("1")] = 0.0,
) -> float:
    """Return the height of a wave at a time.

    All shapes begin at the offset and rise, apart from the square, which begins high.

    Args:
      time_s: seconds, as a clock of `hfg.nodes.time` gives them.
      shape: of the wave.
      frequency_hz: periods in a second.
      amplitude: the height above and below the offset.
      offset: the middle.
      phase: how far it is ahead, in periods, 0 to 1.

    Raises:
      OverflowError: the time is too large for a float.
    """
    part = time_s * frequency_hz + phase
    return offset + amplitude * _SHAPES[shape](part % 1 if math.isfinite(part) else math.nan)

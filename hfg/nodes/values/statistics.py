"""Statistics of a stream of numbers: of all so far, of the last ones, and of their changes.

Depends on nodetype and ports.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Sequence

from annotated_types import Interval, Predicate

from hfg.base.token import Token
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot


class Statistics(Node):
    """Send the mean and the spread of all numbers so far.

    Calculated by Welford's method, which stays exact over many numbers. Each token is answered; a NaN makes NaN of
    everything until `clear`.

    Attributes:
      value: a number.
      mean: of all numbers so far.
      std: their standard deviation (of a sample, divided by n - 1); 0 of a single number.
      variance: its square.
      count: how many numbers there were.
      clear: starts over.

    Raises:
      OverflowError: a whole number is too large for a float.

    CS::APEX: csapex::Statistics.
    """

    value = Input(float)
    mean = Output(float)
    std = Output(float)
    variance = Output(float)
    count = Output(int)
    seen = State(0)
    centre = State(0.0)
    squares = State(0.0)

    def process(self, value: float) -> tuple[float, float, float, int]:
        """Take one more."""
        number = float(value)
        self.seen += 1
        distance = number - self.centre
        self.centre += distance / self.seen
        self.squares += distance * (number - self.centre)
        variance = self.squares / (self.seen - 1) if self.seen > 1 else 0.0 * self.squares
        return self.centre, math.sqrt(variance) if variance >= 0 else variance, variance, self.seen

    @slot
    def clear(self) -> None:
        """Start over."""
        self.seen, self.centre, self.squares = 0, 0.0, 0.0


class Extremes(Node):
    """Send the smallest and the largest number so far, and signal each new one.

    A NaN is passed over. The first number is both.

    Attributes:
      value: a number.
      smallest: of all numbers so far.
      largest: of all numbers so far.
      new_smallest: the number, where it is smaller than all before.
      new_largest: the number, where it is larger than all before.
      clear: starts over.
    """

    value = Input(float)
    smallest = Output(float)
    largest = Output(float)
    new_smallest = Event(float)
    new_largest = Event(float)
    low = State[float | None](None)
    high = State[float | None](None)

    def process(self, value: float) -> tuple[float | None, float | None]:
        """Take one more."""
        if self.low is None or value < self.low:
            if value != value:
                return self.low, self.high
            self.low = value
            self.new_smallest.trigger(value)
        if self.high is None or value > self.high:
            self.high = value
            self.new_largest.trigger(value)
        return self.low, self.high

    @slot
    def clear(self) -> None:
        """Start over."""
        self.low = self.high = None


class CumulativeSum(Node):
    """Send the sum of all numbers so far.

    Attributes:
      value: a number.
      total: the sum, this number among them.
      clear: starts over at 0.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    total = Output(float)
    sum = State[float](0)

    def process(self, value: float) -> float:
        """Take one more."""
        self.sum += value
        return self.sum

    @slot
    def clear(self) -> None:
        """Start over."""
        self.sum = 0


class _Window(Node):
    """Keeps the last numbers."""

    kept = State(factory=deque[float])

    def _keep(self, value: float, size: int) -> Sequence[float]:
        self.kept.append(float(value))
        while len(self.kept) > size:
            self.kept.popleft()
        return self.kept

    @slot
    def clear(self) -> None:
        """Forget all."""
        self.kept = deque()


class WindowStatistics(_Window):
    """Send mean, median, spread, smallest and largest of the last numbers.

    Before there are so many, of those that there are.

    Attributes:
      value: a number.
      size: how many of the last numbers count.
      mean: their mean.
      median: their median; of an even number the mean of the two in the middle.
      std: their standard deviation (of a sample, divided by n - 1); 0 of a single number.
      smallest: the smallest.
      largest: the largest.
      clear: forgets all.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    mean = Output(float)
    median = Output(float)
    std = Output(float)
    smallest = Output(float)
    largest = Output(float)
    size = Parameter(10, Interval(ge=1))

    def process(self, value: float) -> tuple[float, float, float, float, float]:
        """Take one more."""
        kept = self._keep(value, self.size)
        mean = sum(kept) / len(kept)
        squares = sum((one - mean) * (one - mean) for one in kept)
        std = math.sqrt(squares / (len(kept) - 1)) if len(kept) > 1 else 0.0
        return mean, statistics.median(kept), std, min(kept), max(kept)


class MovingAverage(_Window):
    """Send the mean of the last numbers; before there are so many, of those that there are.

    Attributes:
      value: a number.
      size: how many of the last numbers count.
      mean: their mean.
      clear: forgets all.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    mean = Output(float)
    size = Parameter(10, Interval(ge=1))

    def process(self, value: float) -> float:
        """Take one more."""
        kept = self._keep(value, self.size)
        return sum(kept) / len(kept)


class MovingMedian(_Window):
    """Send the median of the last numbers, which single wrong ones do not move.

    Before there are so many, of those that there are.

    Attributes:
      value: a number.
      size: how many of the last numbers count.
      median: their median; of an even number the mean of the two in the middle.
      clear: forgets all.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    median = Output(float)
    size = Parameter(5, Interval(ge=1))

    def process(self, value: float) -> float:
        """Take one more."""
        return statistics.median(self._keep(value, self.size))


class Histogram(Node):
    """Count how many numbers so far fell into each of several equal ranges.

    A bin holds its lower end; the last one its upper end too. The list starts over when limits or bins are changed.

    Attributes:
      value: a number; what lies outside of the limits, and a NaN, is passed over.
      lower: where the first bin begins, in the unit of the value.
      upper: where the last bin ends.
      bins: number of bins.
      counts: how many numbers each bin has had, with each token.
      clear: starts over.

    Raises:
      ValueError: the upper limit is not above the lower one.
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    counts = Output(list[int])
    lower = Parameter(0.0, Predicate(math.isfinite), unit="of the value")
    upper = Parameter(1.0, Predicate(math.isfinite), unit="of the value")
    bins = Parameter(10, Interval(ge=1, le=100_000))
    made_for = State[tuple[float, float, int] | None](None)
    so_far = State(factory=list[int])

    def process(self, value: float) -> list[int]:
        """Take one more."""
        lower, upper, bins = self.lower, self.upper, self.bins
        if upper <= lower:
            raise ValueError(
                f"the upper limit {upper} of the histogram is not above the lower one {lower}: exchange them"
            )
        if self.made_for != (lower, upper, bins):
            self.made_for, self.so_far = (lower, upper, bins), [0] * bins
        if lower <= value <= upper:
            # Parts instead of a width: the difference of two very large limits would be too large for a float.
            part = (value / 2 - lower / 2) / (upper / 2 - lower / 2)
            self.so_far[min(int(part * bins), bins - 1)] += 1
        return list(self.so_far)

    @slot
    def clear(self) -> None:
        """Start over."""
        self.made_for = None


class ExponentialSmoothing(Node):
    """Smooth a stream of numbers: each answer is a part of the new number and the rest of the answer before.

    The first number is given as it is.

    Attributes:
      value: a number.
      alpha: how much of a new number is taken, 0 (none) to 1 (no smoothing).
      smooth: the smoothed number.
      clear: forgets the previous value.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    smooth = Output(float)
    alpha = Parameter(0.2, Interval(gt=0, le=1), unit="1")
    last = State[float | None](None)

    def process(self, value: float) -> float:
        """Take one more."""
        self.last = float(value) if self.last is None else self.alpha * value + (1 - self.alpha) * self.last
        return self.last

    @slot
    def clear(self) -> None:
        """Forget the previous value."""
        self.last = None


# --- in time: by the stamps of the tokens ---


class _Timed(Node):
    """Knows how long ago the token before was."""

    stamp = State[float | None](None)
    before = State(0.0)

    def _passed(self, token: Token[float]) -> float | None:
        """Return the seconds since the last token by their stamps; None of the first, or if no time has passed."""
        last, now = self.stamp, token.stamp
        if last is not None and now <= last:
            return None
        self.stamp = now
        return None if last is None else now - last

    @slot
    def clear(self) -> None:
        """Forget the previous value."""
        self.stamp = None


class LowPass(_Timed):
    """Smooth a stream of numbers as a low-pass filter of first order does, whatever the rate of the tokens.

    After `time_constant_s` a jump has been followed by 63 %. Times are those of the tokens' stamps. The first number is
    given as it is; of several with one stamp the first counts.

    Attributes:
      value: a number.
      time_constant_s: how slowly it follows; 0 passes on everything.
      smooth: the smoothed number.
      clear: forgets the previous value.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    smooth = Output(float)
    time_constant_s = Parameter(1.0, Interval(ge=0), unit="s")

    def process(self, value: Token[float]) -> float:
        """Take one more."""
        first = self.stamp is None
        passed = self._passed(value)
        if first or self.time_constant_s == 0:
            self.before = float(value.value)
        elif passed is not None:
            self.before += (value.value - self.before) * -math.expm1(-passed / self.time_constant_s)
        return self.before


class Derivative(_Timed):
    """Send by how much a number changes in a second.

    Times are those of the tokens' stamps. Silent for the first number, and for one that is not newer than the one
    before, which is passed over.

    Attributes:
      value: a number.
      slope: the change since the number before, for each second, in the unit of the value.
      clear: forgets the previous value.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    slope = Output(float)

    def process(self, value: Token[float]) -> float | None:
        """Take one more."""
        number, first = float(value.value), self.stamp is None
        passed = self._passed(value)
        if passed is None:
            self.before = number if first else self.before
            return None
        slope = (number - self.before) / passed
        self.before = number
        return slope


class Difference(Node):
    """Send by how much a number differs from the one before; silent for the first.

    Attributes:
      value: a number.
      difference: this number minus the one before.
      clear: forgets the previous value.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    difference = Output(float)
    last = State[float | None](None)

    def process(self, value: float) -> float | None:
        """Take one more."""
        last, self.last = self.last, value
        return None if last is None else value - last

    @slot
    def clear(self) -> None:
        """Forget the previous value."""
        self.last = None


class Integral(_Timed):
    """Add up a number over time, as the area below its curve.

    Between two numbers the curve is a straight line; times are those of the tokens' stamps. It begins with 0 at the
    first number; one that is not newer than the one before changes nothing.

    Attributes:
      value: a number.
      area: so far, in the unit of the value times seconds.
      clear: starts over at 0.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    value = Input(float)
    area = Output(float)
    total = State(0.0)

    def process(self, value: Token[float]) -> float:
        """Take one more."""
        number, first = float(value.value), self.stamp is None
        passed = self._passed(value)
        if passed is not None:
            self.total += (self.before / 2 + number / 2) * passed
        if passed is not None or first:
            self.before = number
        return self.total

    @slot
    def clear(self) -> None:
        """Start over."""
        self.stamp, self.total = None, 0.0


class PID(_Timed):
    """Control: turn an error into a command by its size, its sum over time and its change.

    Times are those of the tokens' stamps; for the first error, and one that is not newer than the one before, the
    command has no part for sum and change. The sum stops to grow where the command has reached a limit, so that it does
    not wind up.

    Attributes:
      error: what is wanted minus what is.
      kp: the part of the error itself.
      ki: the part of its sum over time, for each second.
      kd: the part of its change in a second.
      lower: the smallest command.
      upper: the largest command.
      command: what to do.
      clear: forgets sum and change.

    Raises:
      OverflowError: a whole number is too large for a float.
    """

    error = Input(float)
    command = Output(float)
    kp = Parameter(1.0, unit="1")
    ki = Parameter(0.0, unit="1/s")
    kd = Parameter(0.0, unit="s")
    lower = Parameter(-math.inf, unit="of the command")
    upper = Parameter(math.inf, unit="of the command")
    total = State(0.0)

    def process(self, error: Token[float]) -> float:
        """Take one more."""
        number, first = float(error.value), self.stamp is None
        passed = self._passed(error)
        total, slope = self.total, 0.0
        if passed is not None:
            total += number * passed
            slope = (number - self.before) / passed
        if passed is not None or first:
            self.before = number
        wanted = self.kp * number + self.ki * total + self.kd * slope
        command = min(max(wanted, self.lower), self.upper)
        # Anti-windup: a sum that only pushes further over a limit is not kept.
        pushes_on = (wanted - command) * self.ki * number > 0
        if not pushes_on:
            self.total = total
        return command

    @slot
    def clear(self) -> None:
        """Forget sum and change."""
        self.stamp, self.total = None, 0.0

"""Time: clocks, tickers, schedules, stamps; how long something took, how old it is, how often it comes, if at all.

Times are seconds on the run's clock, so everything here is exact in virtual time. `now` and stamps are Unix time on the
real clock and begin at 0 in virtual time; `elapsed` begins at 0 in both. Depends on nodetype, functions, ports and
clock.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from typing import Annotated, Any

from annotated_types import Ge, Gt, Unit

from hfg.base import clock
from hfg.base.token import Token
from hfg.nodes._alarm import Alarm
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot

__all__ = [
    "Clock",
    "Deadline",
    "RateMeter",
    "Schedule",
    "SetStamp",
    "SinceLast",
    "Stopwatch",
    "Ticker",
    "age",
    "duration",
    "elapsed",
    "now",
    "shift",
    "stamp_of",
]

_INSTANT_S = 1e-9
"""What is closer is at the same moment: sums of floats differ in the last digits."""

_FOR_EVER_S = 1e12
"""Longer than anybody waits: thirty thousand years."""


# --- sources ---


class Ticker(Node):
    """Send a number again and again, without drift.

    The first tick comes `phase_s` after the start of the node, and starts a grid. A tick that is late, because its
    consumers were not ready, does not move the grid; what was missed by more than a period is not made up, and its
    numbers are missing (rule F11). A new period holds from the next tick on. The stamp is the moment of the tick.

    Attributes:
      period_s: from one tick to the next, in seconds; of no effect if there is a rate.
      rate_hz: how many ticks a second; 0: the period says it.
      phase_s: how long before the first tick, in seconds.
      count: how many ticks there are before the end; 0: no end.
      tick: the number of the tick, from 0.
    """

    tick = Output(int)
    period_s = Parameter(1.0, Gt(0), unit="s")
    rate_hz = Parameter(0.0, Ge(0), unit="Hz")
    phase_s = Parameter(0.0, Ge(0), unit="s")
    count = Parameter(0, Ge(0))

    async def process(self) -> AsyncIterator[None]:
        """Tick."""
        begin, first, number, given = clock.elapsed() + self.phase_s, 0, 0, 0
        period = self._period()
        while not self.count or given < self.count:
            due = begin + (number - first) * period
            await _until(due)
            number += int((clock.elapsed() - due) / period + _INSTANT_S)
            self.tick.send(number, stamp=clock.now())
            yield
            if period != self._period():  # a new grid, which begins with the tick just given
                begin, first, period = begin + (number - first) * period, number, self._period()
            number, given = number + 1, given + 1

    def _period(self) -> float:
        period = 1 / self.rate_hz if self.rate_hz else self.period_s
        return min(max(period, _INSTANT_S), _FOR_EVER_S)  # so that no product of it leaves the numbers that there are


async def _until(due: float) -> None:
    rest = due - clock.elapsed()
    if rest > _INSTANT_S:
        await asyncio.sleep(rest)


class Schedule(Node):
    """Send each moment of a list when it comes, then end.

    Moments that have passed already when their turn comes, as when the consumers were not ready, are given at once. The
    stamp is the moment at which one is given.

    Attributes:
      instants_s: in seconds since the start of the run, in any order.
      instant: the moment, in seconds since the start of the run.
    """

    instant = Output(float)
    instants_s = Parameter((), type=tuple[float, ...], unit="s")

    async def process(self) -> AsyncIterator[None]:
        """Yield them."""
        for instant in sorted(self.instants_s):
            await _until(instant)
            self.instant.send(instant, stamp=clock.now())
            yield


class Clock(Node):
    """Send the time, again and again: an endless source.

    As fast as the consumers allow, or at the rate of its `max_rate_hz`, which the check asks for.

    Attributes:
      time: seconds on the run's clock.

    CS::APEX: csapex::Clock.
    """

    time = Output(float)

    def process(self) -> float:
        """Read the clock."""
        return clock.now()


# --- stamps ---


@node
def now(value: object) -> float:
    """Return the time at which a value arrives.

    Args:
      value: anything.
    """
    return clock.now()


@node
def elapsed(value: object) -> float:
    """Return the seconds since the start of the run at which a value arrives.

    Args:
      value: anything.
    """
    return clock.elapsed()


@node
def stamp_of(value: Token[object]) -> float:
    """Return the stamp of a value: the time of the measurement that it came from (rule T5).

    Args:
      value: anything.

    CS::APEX: csapex::ExtractTimeStamp.
    """
    return value.stamp


@node
def age(value: Token[object]) -> float:
    """Return the seconds from the stamp of a value to now: how long it took to come here.

    Args:
      value: anything.

    CS::APEX: csapex::StampDelayMeasurement.
    """
    return clock.now() - value.stamp


class SetStamp(Node):
    """Pass a value on with another stamp.

    Attributes:
      value: anything.
      stamp: seconds on the run's clock.
      out: the same value with that stamp.

    CS::APEX: csapex::OverwriteTimestamp.
    """

    value = Input(Any)
    stamp = Input(float)
    out = Output(Any)

    def process(self, value: Any, stamp: float) -> None:
        """Send it."""
        self.out.send(value, stamp=float(stamp))


# --- durations ---


@node
def shift(time: float, *, offset_s: Annotated[float, Unit("s")] = 0.0) -> float:
    """Add an offset to a time.

    Args:
      time: seconds.
      offset_s: seconds; negative is earlier.

    CS::APEX: csapex::TimeOffset.
    """
    return time + offset_s


@node
def duration(later: float, earlier: float | None = None) -> float:
    """Return the seconds from one time to another.

    Without an earlier one, to the present: then the result is negative if `later` has passed.

    Args:
      later: seconds on the run's clock.
      earlier: seconds on the run's clock; the present if it is absent.

    CS::APEX: csapex::CalculateDuration, csapex::DurationConvertion.
    """
    return later - (clock.now() if earlier is None else earlier)


class Stopwatch(Node):
    """Measure the seconds between two signals.

    `begin` starts over, `stop` tells and ends the measurement; without a beginning it tells nothing. A signal counts
    when its turn comes, or at its stamp, which says when it was measured.

    Attributes:
      begin: a measurement begins.
      stop: it is over.
      by_stamp: whether the time of a signal is its stamp.
      measured: the seconds between the two.

    CS::APEX: csapex::SignalDelayMeasurement.
    """

    measured = Event(float)
    by_stamp = Parameter(False)
    begun = State[float | None](None)

    @slot
    def begin(self, signal: Token[object]) -> None:
        """Begin."""
        self.begun = self._time(signal)

    @slot
    def stop(self, signal: Token[object]) -> None:
        """Tell it."""
        if self.begun is not None:
            begun, self.begun = self.begun, None
            self.measured.trigger(self._time(signal) - begun)

    def _time(self, signal: Token[object]) -> float:
        return signal.stamp if self.by_stamp else clock.now()


class SinceLast(Node):
    """Send the seconds between the stamps of a value and the one before.

    For the first value there is silence.

    Attributes:
      value: anything.
      seconds: from the value before to this one; negative if it is older.
    """

    value = Input(Any)
    seconds = Output(float)
    last = State[float | None](None)

    def process(self, value: Token[Any]) -> float | None:
        """Compare the stamps."""
        before, self.last = self.last, value.stamp
        return None if before is None else value.stamp - before


class RateMeter(Node):
    """Send the rate at which values come, by their stamps.

    The mean over the last values, with each from the second on; before there is silence, and so there is while all of
    them have one stamp.

    Attributes:
      value: anything.
      size: over how many values the mean is.
      rate_hz: how many values come in a second.
    """

    value = Input(Any)
    rate_hz = Output(float)
    size = Parameter(20, Ge(2))
    stamps = State(factory=deque[float])

    def process(self, value: Token[Any]) -> float | None:
        """Measure."""
        self.stamps.append(value.stamp)
        while len(self.stamps) > self.size:
            self.stamps.popleft()
        span = self.stamps[-1] - self.stamps[0]
        return (len(self.stamps) - 1) / span if span > 0 else None


# --- watching ---


class Deadline(Node):
    """Signal when nothing has arrived for some time, and when something arrives again.

    Values may come by the input, and are passed on, or by the slot; either is a sign of life. Silence is not. The watch
    begins with the run, or with the first value, and ends with the input. A missed deadline is signalled once.

    Attributes:
      value: anything; passed on.
      beat: a sign of life in addition to the input.
      out: the same values.
      seconds: how long nothing may come; looked at with each sign of life.
      from_start: whether the watch begins with the run, else with the first sign of life.
      missed: nothing has come; how long, in seconds.
      back: something has come again; how long there was nothing, in seconds.
    """

    value = Input(Any, optional=True)
    out = Output(Any)
    missed = Event(float)
    back = Event(float)
    seconds = Parameter(1.0, Gt(0), unit="s")
    from_start = Parameter(True)
    last = State[float | None](None)
    """When there was a sign of life, or the watch began."""
    was_missed = State(False)
    is_over = State(False)

    def setup(self) -> None:
        """Begin the watch."""
        self.alarm = Alarm(self, self._ring)
        if self.from_start:
            self._listen()

    def process(self, value: Any) -> Any:
        """Hear it, and pass it on."""
        self._hear()
        return value

    @slot
    def beat(self) -> None:
        """Hear it."""
        self._hear()

    def end(self) -> None:
        """Watch no more."""
        self.is_over = True
        self.alarm.cancel()

    def _hear(self) -> None:
        if self.was_missed and self.last is not None:
            self.was_missed = False
            self.back.trigger(clock.elapsed() - self.last)
        self._listen()

    def _listen(self) -> None:
        self.last = clock.elapsed()
        if not self.is_over:
            self.alarm.set(self.seconds)

    def _ring(self) -> None:
        assert self.last is not None
        self.was_missed = True
        self.missed.trigger(clock.elapsed() - self.last)

"""The nodes that the benchmarks put into graphs: each does as little as its kind can do."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import hfg
from benchmarks.meters import Arrivals, Laps

__all__ = [
    "Activator",
    "End",
    "Lapper",
    "Place",
    "Relay",
    "Starter",
    "Through",
    "join",
    "laps",
    "numbers",
    "sink",
    "through",
    "through_async",
    "through_waiting",
]


@hfg.node
def numbers(*, count: int = 10) -> Iterator[int]:
    """Count."""
    yield from range(count)


@hfg.node
def through(value: int) -> int:
    """Pass on."""
    return value


@hfg.node
async def through_async(value: int) -> int:
    """Pass on, without waiting."""
    return value


@hfg.node
async def through_waiting(value: int) -> int:
    """Pass on after one pass of the loop."""
    await asyncio.sleep(0)
    return value


@hfg.node
def join(left: int, right: int) -> int:
    """Wait for both."""
    return left


def sink(meter: Arrivals) -> hfg.Node:
    """Take what arrives, by an input."""
    return hfg.node(meter.take)()


def laps(meter: Laps) -> hfg.Node:
    """Count, and read the clock whenever the next number is asked for."""

    def numbers() -> Iterator[int]:
        for number in range(meter.tokens):
            meter.lap()
            yield number
        meter.lap()

    return hfg.node(numbers)()


class Through(hfg.Node):
    """Pass on, as a class."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        """Pass on."""
        return value


class Starter(hfg.Node):
    """Input to event."""

    value = hfg.Input(int)
    signal = hfg.Event(int)

    def process(self, value: int) -> None:
        """Trigger."""
        self.signal.trigger(value)


class Relay(hfg.Node):
    """Slot to event."""

    signal = hfg.Event(int)

    @hfg.slot
    def take(self, value: int) -> None:
        """Trigger again."""
        self.signal.trigger(value)


class End(hfg.Node):
    """Take what arrives, by a slot."""

    meter: Arrivals | None = None

    @hfg.slot
    def take(self, value: int) -> None:
        """Take."""
        if self.meter is not None:
            self.meter.take(value)


class Lapper(hfg.Node):
    """Send one signal round and round, and read the clock each time it is back."""

    go = hfg.Event(int)
    meter: Laps

    @hfg.slot
    def begin(self) -> None:
        """Let the first one go."""
        self.meter.lap()
        self.go.trigger(self.meter.tokens - 1)

    @hfg.slot
    def back(self, left: int) -> None:
        """Let the next one go."""
        self.meter.lap()
        if left:
            self.go.trigger(left - 1)


class Activator(hfg.Node):
    """Send every value with +1, as a node that is always active would."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        """Activate the next."""
        self.out.send(value, activity=+1)


class Place(hfg.Node):
    """A state: when it becomes active it hands the activity to the next one."""

    done = hfg.Event()
    meter: Arrivals

    @hfg.slot
    def begin(self) -> None:
        """Count the step, and go on to the next state while steps are left."""
        meter = self.meter
        meter.take(0)
        if meter.count < meter.tokens:
            self.done.trigger()

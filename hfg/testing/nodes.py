"""Small, deterministic node types for tests and examples, with every kind of port between them.

Their behaviour depends only on their inputs, never on time or chance, so that runs of the engine and of the oracle can
be compared.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from typing import Any

import hfg

__all__ = [
    "AsyncRelay",
    "Counter",
    "Doubter",
    "Failing",
    "Greeter",
    "Latch",
    "Merge",
    "OnlyTwice",
    "Passing",
    "Pulse",
    "Relay",
    "Scaled",
    "Script",
    "Sieve",
    "Stateful",
    "Tally",
    "Waiting",
    "add",
    "ascript",
    "double",
    "script",
    "sink",
    "slow_double",
    "some",
]


@hfg.node
def script(*, values: tuple[int | None, ...] = (1, 2, 3)) -> Iterator[int | None]:
    """Yield the values one by one; None is silence."""
    yield from values


@hfg.node
async def ascript(*, values: tuple[int | None, ...] = (1, 2, 3), pause_s: float = 0.0) -> AsyncIterator[int | None]:
    """Yield the values one by one, after a pause each."""
    for value in values:
        await asyncio.sleep(pause_s)
        yield value


@hfg.node
def double(value: int) -> int:
    """Return twice the value."""
    return 2 * value


@hfg.node
async def slow_double(value: int, *, pause_s: float = 0.01) -> int:
    """Return twice the value, later."""
    await asyncio.sleep(pause_s)
    return 2 * value


@hfg.node
def add(a: int, b: int) -> int:
    """Return the sum."""
    return a + b


@hfg.node
def some(value: int, *, modulus: int = 2) -> int | None:
    """Pass on what the modulus divides; silence otherwise."""
    return value if value % modulus == 0 else None


@hfg.node
def sink(value: int) -> None:
    """Take the value."""


class Script(hfg.Node):
    """A source as a class: numbers up to `count`, then the end; every `every`th is also an event."""

    out = hfg.Output(int)
    seen = hfg.Event(int)
    count = hfg.Parameter(3)
    every = hfg.Parameter(2)
    at = hfg.State(0)

    def process(self) -> None:
        """Send the next number."""
        if self.at >= self.count:
            raise hfg.EndOfStream
        self.at += 1
        if self.at % self.every == 0:
            self.seen.trigger(self.at)
        self.out.send(self.at)


class Passing(hfg.Node):
    """Passes tokens on, not values: modifiers and stamps stay (A4)."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    passed = hfg.Event(int)

    def process(self, value: hfg.Token[int]) -> None:
        """Pass it on twice."""
        self.passed.trigger(value)
        self.out.send(value)


class Merge(hfg.Node):
    """A mandatory and two optional inputs, two outputs."""

    value = hfg.Input(int)
    left = hfg.Input(int, optional=True)
    right = hfg.Input(int, optional=True, default=100)
    total = hfg.Output(int)
    lefts = hfg.Output(int)

    def process(self, value: int, left: int | None, right: int) -> tuple[int, int | None]:
        """Return the sum of what there is, and the left one."""
        return value + (left or 0) + right, left


class Latch(hfg.Node):
    """Nothing but optional inputs."""

    first = hfg.Input(int, optional=True)
    second = hfg.Input(int, optional=True)
    out = hfg.Output(int)
    last = hfg.State(0)

    def process(self, first: int | None, second: int | None) -> int:
        """Return what came, else what came last."""
        self.last = first if first is not None else second if second is not None else self.last
        return self.last


class Counter(hfg.Node):
    """Counts what it is given; tells the total by slot, and at its end."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    told = hfg.Event(int)
    total = hfg.State(0)

    def process(self, value: int) -> int:
        """Count."""
        self.total = self.total + 1  # not in place: what was set may be an array, which others have as well (T1)
        return self.total

    @hfg.slot
    def tell(self) -> None:
        """Trigger the total."""
        self.told.trigger(self.total)

    @hfg.slot
    def set(self, value: int) -> None:
        """Begin at another total."""
        self.total = value

    def end(self) -> None:
        """Send the last tokens both ways."""
        self.out.send(-self.total)
        self.told.trigger(-self.total)


class Relay(hfg.Node):
    """Lives by its slots: answers each signal by an event; every third with its token, so that the modifier stays."""

    said = hfg.Event(int)
    gave_up = hfg.Event()
    calls = hfg.State(0)

    @hfg.slot
    def say(self, value: int) -> None:
        """Pass the value on, a few hundred times at most, so that rings of relays end."""
        self.calls += 1
        if self.calls > 12:
            self.gave_up.trigger()
        else:
            self.said.trigger(value)

    @hfg.slot
    def hand_on(self, token: hfg.Token[int]) -> None:
        """Pass the token on."""
        self.calls += 1
        if self.calls <= 12:
            self.said.trigger(token)


class AsyncRelay(hfg.Node):
    """Answers signals later."""

    said = hfg.Event(int)
    calls = hfg.State(0)

    @hfg.slot
    async def say(self, value: int) -> None:
        """Trigger before and after a pause."""
        self.calls += 1
        if self.calls <= 8:
            self.said.trigger(value)
            await asyncio.sleep(0.005)
            self.said.trigger(-value)


class Pulse(hfg.Node):
    """Turns values into signals: as many as the value says, at most `most`."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    pulse = hfg.Event(int)
    most = hfg.Parameter(3)

    def process(self, value: int) -> int:
        """Trigger, then answer."""
        for number in range(min(abs(value), self.most)):
            self.pulse.trigger(number)
        return value


class Greeter(hfg.Node):
    """Speaks on activity: gives +1 by itself, or takes it back."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    sign = hfg.Event(int)
    every = hfg.Parameter(2)

    def process(self, value: int) -> None:
        """Send explicit modifiers in turn."""
        turn = value % (self.every + 1)
        if turn == 0:
            self.sign.trigger(value, activity=1)
            self.out.send(value)
        elif turn == 1:
            self.out.send(value, activity=-1)
            self.sign.trigger(value)
        else:
            self.out.send(value, activity=0)
            self.sign.trigger(value, activity=0)


class Stateful(hfg.Node):
    """Looks at its own activity."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    moved = hfg.Event(int)

    @hfg.slot
    def begin(self) -> None:
        """Do nothing: being called is enough."""

    def process(self, value: int) -> int:
        """Signal while active."""
        if self.active:
            self.moved.trigger(value)
        return int(self.active)


class Failing(hfg.Node):
    """Fails at every value that `at` divides; its slot too."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    warned = hfg.Event(int)
    at = hfg.Parameter(3)

    def process(self, value: int) -> int:
        """Warn, then fail or answer."""
        if value % self.at == 0:
            self.warned.trigger(value)
            raise ValueError(f"cannot do {value}")
        return value

    @hfg.slot
    def poke(self, value: int) -> None:
        """Fail in the same way."""
        self.warned.trigger(value)
        if value % self.at == 0:
            raise ValueError(f"poked with {value}")


class Scaled(hfg.Node):
    """Has parameters, as ports and with a trigger."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    factor = hfg.Parameter(2)
    offset = hfg.Parameter(0)
    ping = hfg.Parameter(trigger=True)

    def process(self, value: int) -> int:
        """Scale it."""
        return self.factor * value + self.offset


class OnlyTwice(hfg.Node):
    """Is ready for two firings; each call of its slot allows two more."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    left = hfg.State(2)

    def ready(self) -> bool:
        """Say whether something is left."""
        return bool(self.left > 0)

    def process(self, value: int) -> int:
        """Use one up."""
        self.left -= 1
        return value

    @hfg.slot
    def more(self) -> None:
        """Allow more."""
        self.left += 2


class Waiting(hfg.Node):
    """Waits during a firing and triggers before and after."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    before = hfg.Event(int)
    after = hfg.Event(int)
    pause_s = hfg.Parameter(0.01)

    async def process(self, value: int) -> int | None:
        """Trigger, wait, trigger, answer; odd values are answered with silence."""
        self.before.trigger(value)
        await asyncio.sleep(self.pause_s)
        self.after.trigger(value)
        return None if value % 2 else value


class Sieve(hfg.Node):
    """Splits a stream: even and odd values leave by different outputs."""

    value = hfg.Input(int)
    even = hfg.Output(int)
    odd = hfg.Output(int)
    zero = hfg.Event()

    def process(self, value: int) -> None:
        """Write one output, or signal."""
        if value == 0:
            self.zero.trigger()
        elif value % 2:
            self.odd.send(value)
        else:
            self.even.send(value)


class Tally(hfg.Node):
    """A sink with a slot: takes values one way and another."""

    value = hfg.Input(int)
    full = hfg.Event(int)
    count = hfg.State(0)

    def process(self, value: int) -> None:
        """Count, and signal every fourth."""
        self.count += 1
        if self.count % 4 == 0:
            self.full.trigger(self.count)

    @hfg.slot
    def note(self, value: int) -> None:
        """Count one more."""
        self.count += 1


class Doubter(hfg.Node):
    """Takes any signal and answers none; for automatic events."""

    heard: Any = hfg.State(0)
    again = hfg.Event(int)

    @hfg.slot
    def hear(self) -> None:
        """Count; answer the first two."""
        self.heard += 1
        if self.heard <= 2:
            self.again.trigger(self.heard)

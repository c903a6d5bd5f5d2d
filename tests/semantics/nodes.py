"""Small node types and helpers that the tests of the rules share."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar, cast

import hfg
from hfg.nodetypes.functions import NodeFunction
from hfg.registry import reference_of
from hfg.trace import ActivityChanged, FiringStarted, TokenSent, TraceEvent

T = TypeVar("T")


# --- how tests run graphs ---


def run(graph: hfg.Graph, fast: bool = True, **options: Any) -> hfg.Report:
    """Run a graph in virtual time to its end."""
    return hfg.run(graph, clock="virtual", fast=fast, **options)


def traced(graph: hfg.Graph, **options: Any) -> list[TraceEvent]:
    """Run a graph in virtual time and give its trace."""
    trace: list[TraceEvent] = []
    run(graph, trace=trace.append, **options)
    return trace


def drive(main: Callable[[], Coroutine[Any, Any, T]]) -> T:
    """Run a coroutine function on a loop in virtual time."""
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main())


def sent(trace: Iterable[TraceEvent], edge: str) -> list[Any]:
    """The values and markers put on an edge."""
    return [event.token.value for event in trace if isinstance(event, TokenSent) and event.edge == edge]


def tokens(trace: Iterable[TraceEvent], edge: str) -> list[hfg.Token[Any]]:
    """The tokens put on an edge."""
    return [event.token for event in trace if isinstance(event, TokenSent) and event.edge == edge]


def modifiers(trace: Iterable[TraceEvent], edge: str) -> list[int]:
    """The activity modifiers of the tokens put on an edge."""
    return [token.activity for token in tokens(trace, edge)]


def firings(trace: Iterable[TraceEvent], node: str) -> list[str]:
    """How each firing of a node was decided."""
    return [event.kind for event in trace if isinstance(event, FiringStarted) and event.node == node]


def activity(trace: Iterable[TraceEvent], node: str) -> list[bool]:
    """Each change of A(v)."""
    return [event.active for event in trace if isinstance(event, ActivityChanged) and event.node == node]


def value_of(token: Any) -> Any:
    """What is in a token; operators do not know that they are given tokens."""
    return token.value


def named(kind: type[hfg.Node] | NodeFunction[..., Any]) -> str:
    """The reference by which a type is found again."""
    reference = reference_of(kind)
    assert reference is not None
    return reference


def of_kind(trace: Iterable[TraceEvent], *kinds: type[T]) -> list[T]:
    """The events of these kinds."""
    return [event for event in trace if isinstance(event, kinds)]


# --- sources ---


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    """1, 2, 3 ..."""
    yield from range(1, count + 1)


@hfg.node
def gaps(*, count: int = 4) -> Iterator[int | None]:
    """Odd numbers, silence in place of the even ones."""
    for number in range(1, count + 1):
        yield number if number % 2 else None


@hfg.node
async def slow_numbers(*, count: int = 3, pause_s: float = 1.0) -> AsyncIterator[int]:
    """One number every so many seconds."""
    for number in range(1, count + 1):
        await asyncio.sleep(pause_s)
        yield number


class Countdown(hfg.Node):
    """A source by its process function, which ends by EndOfStream."""

    count = hfg.Parameter(3)
    out = hfg.Output(int)
    left = hfg.State(0)

    def setup(self) -> None:
        self.left = self.count

    def process(self) -> int:
        if not self.left:
            raise hfg.EndOfStream
        self.left -= 1
        return self.left


class Clock(hfg.Node):
    """A source that never ends; give it a rate."""

    out = hfg.Output(int)
    ticked = hfg.Event(int)
    ticks = hfg.State(0)

    def process(self) -> int:
        self.ticks += 1
        self.ticked.trigger(self.ticks)
        return self.ticks


class Ringing(hfg.Node):
    """A source that triggers instead of sending."""

    count = hfg.Parameter(3)
    burst = hfg.Parameter(1)
    rang = hfg.Event(int)
    done = hfg.State(0)

    def process(self) -> None:
        if self.done == self.count:
            raise hfg.EndOfStream
        self.done += 1
        for _ in range(self.burst):
            self.rang.trigger(self.done)


# --- nodes in the middle ---


@hfg.node
def forward(value: int) -> int:
    """Its value."""
    return value


@hfg.node
async def forward_async(value: int) -> int:
    """Its value, after a pass of the loop."""
    await asyncio.sleep(0)
    return value


@hfg.node
async def forward_later(value: int) -> int:
    """Its value, after a second."""
    await asyncio.sleep(1)
    return value


@hfg.node
def only_odd(value: int) -> int | None:
    """Odd values, silence for the others."""
    return value if value % 2 else None


@hfg.node
def add(a: int, b: int) -> int:
    """The sum."""
    return a + b


@hfg.node
def add_optional(a: int, b: int = 100) -> int:
    """The sum; b may be absent."""
    return a + b


@hfg.node
def merge(a: int | None = None, b: int | None = None) -> tuple[int | None, int | None]:
    """Both, as far as they are there: nothing is mandatory."""
    return (a, b)


@hfg.node
def scale(value: int, *, factor: int = 2) -> int:
    """Times a parameter."""
    return value * factor


@hfg.node
def fail_on(value: int, *, bad: int = 2) -> int:
    """Raises for one value."""
    if value == bad:
        raise ValueError(f"no {value}")
    return value


class Halves(NamedTuple):
    small: int
    big: int


@hfg.node(outputs=Halves)
def split(value: int) -> tuple[int | None, int | None]:
    """Small numbers to one output, big ones to the other."""
    return (value, None) if value < 3 else (None, value)


class Total(hfg.Node):
    """Writes only at its end."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    total = hfg.State(0)

    def process(self, value: int) -> None:
        self.total += value

    def end(self) -> None:
        self.out.send(self.total)


class Send(hfg.Node):
    """Sends each value on its output and its event, by send and trigger."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rang = hfg.Event(int)
    modifier = hfg.Parameter(None, type=int | None)

    def process(self, value: int) -> None:
        self.rang.trigger(value, activity=self.modifier)
        self.out.send(value, activity=self.modifier)


class Fork(hfg.Node):
    """One firing or call, several sendings."""

    value = hfg.Input(int)
    a = hfg.Output(int)
    b = hfg.Output(int)
    first = hfg.Event(int)
    second = hfg.Event(int)

    def process(self, value: int) -> None:
        self.first.trigger(value)
        self.second.trigger(value)
        self.a.send(value)
        self.b.send(value)

    @hfg.slot
    def poke(self) -> None:
        self.first.trigger(0)
        self.second.trigger(0)


# --- sinks and slots ---


class Keep(hfg.Node):
    """Keeps the values it gets."""

    value = hfg.Input(object)
    values = hfg.State(factory=list)

    def process(self, value: object) -> None:
        self.values.append(value)


class KeepTokens(hfg.Node):
    """Keeps whole tokens."""

    value = hfg.Input(object)
    tokens = hfg.State(factory=list)

    def process(self, value: hfg.Token[object]) -> None:
        self.tokens.append(value)


class Ear(hfg.Node):
    """Lives by its slots: keeps what it hears, passes it on."""

    begun = hfg.State(0)
    heard = hfg.State(factory=list)
    passed = hfg.Event(int)
    poked = hfg.Event()

    @hfg.slot
    def hear(self, value: object) -> None:
        self.heard.append(value)
        self.passed.trigger(cast(int, value))

    @hfg.slot
    def begin(self) -> None:
        self.begun += 1

    @hfg.slot
    def poke(self) -> None:
        self.poked.trigger()


class Both(hfg.Node):
    """Has everything: input, output, slot, event; writes what happens into `story`."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rang = hfg.Event(int)
    story = hfg.State(factory=list)

    def process(self, value: int) -> int:
        self.story.append(("fire", value))
        return value

    @hfg.slot
    def call(self, value: object) -> None:
        self.story.append(("call", value))
        self.rang.trigger(0)

    @hfg.slot
    def begin(self) -> None:
        pass


class Hooks(hfg.Node):
    """Writes down its hooks."""

    value = hfg.Input(int, optional=True)
    out = hfg.Output(int)
    story = hfg.State(factory=list)

    def setup(self) -> None:
        self.story.append("setup")

    def process(self, value: int | None) -> int | None:
        self.story.append(value)
        return value

    def end(self) -> None:
        self.story.append("end")

    def teardown(self) -> None:
        self.story.append("teardown")


class Timed(hfg.Node):
    """Keeps values with the time of their coming."""

    value = hfg.Input(object)
    seen = hfg.State(factory=list)

    def process(self, value: object) -> None:
        self.seen.append((value, hfg.now()))


class Burst(hfg.Node):
    """A source that triggers its event many times in one firing."""

    count = hfg.Parameter(5)
    rang = hfg.Event(int)
    over = hfg.State(False)

    def process(self) -> None:
        if self.over:
            raise hfg.EndOfStream
        self.over = True
        for number in range(1, self.count + 1):
            self.rang.trigger(number)


class KeepsModifiers(hfg.Node):
    seen = hfg.State(factory=list)
    passed = hfg.Event(object)

    @hfg.slot
    def hear(self, token: hfg.Token[object]) -> None:
        self.seen.append(token.activity)
        self.passed.trigger(token.value)


class Pair(hfg.Node):
    """Two inputs, so that two modifiers arrive in one firing."""

    a = hfg.Input(object)
    b = hfg.Input(object)
    seen = hfg.State(factory=list)

    def process(self, a: object, b: object) -> None:
        self.seen.append(self.active)


class Where(hfg.Node):
    """Which threads its code ran on, and whether two of its group ever ran at once."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    threads = hfg.State(factory=set)
    running: list[str] = []  # noqa: RUF012 - of all
    worst: list[int] = []  # noqa: RUF012

    def process(self, value: int) -> int:
        self.threads.add(threading.current_thread().name)
        self.running.append("x")
        self.worst.append(len(self.running))
        time.sleep(0.001)
        self.running.pop()
        return value

    @hfg.slot
    def hear(self, value: int) -> None:
        self.process(value)


class Runner(hfg.Node):
    """Can be made active, then fires."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rang = hfg.Event(int)
    seen = hfg.State(factory=list)

    @hfg.slot
    def begin(self) -> None:
        pass

    @hfg.slot
    def ring(self, value: int) -> None:
        self.rang.trigger(value)

    def process(self, value: int) -> int | None:
        self.seen.append(self.active)
        return value if value % 2 else None


class Last(hfg.Node):
    """Speaks at the end only."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        """Keep quiet."""

    def end(self) -> None:
        self.out.send(7)


class Farewell(hfg.Node):
    """A source that has nothing but a last word."""

    out = hfg.Output(int)

    def process(self) -> None:
        raise hfg.EndOfStream

    def end(self) -> None:
        self.out.send(7)

"""A small graph that runs for as long as somebody looks: numbers, a picture, and a mission of three states."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Interval

import hfg
from hfg.images import Gray

__all__ = [
    "LONG_S",
    "Clock",
    "Collect",
    "Drive",
    "Errand",
    "Stamp",
    "count",
    "fails_at",
    "halves",
    "jam",
    "look",
    "mission",
    "of_all_kinds",
    "picture",
    "scaled",
    "workshop",
]

LONG_S = 1000.0
"""A duration that no story waits for: it holds a `Drive` until the story sets another one."""


@hfg.node
def count() -> Iterator[int]:
    """Count."""
    yield from itertools.count()


@hfg.node
def scaled(value: int, *, factor: Annotated[int, Interval(ge=0, le=10)] = 2) -> int:
    """Multiply a number."""
    return value * factor


@hfg.node
def halves(value: int) -> int:
    """Halve a number."""
    return value // 2


@hfg.node
def picture(value: int) -> Gray:
    """Draw a bright square on a dark ground."""
    image = np.zeros((48, 64), np.uint8)
    image[8:24, 8:24] = 200
    return image


@hfg.node
def look(image: Gray) -> None:
    """Take a picture."""


@hfg.node
def fails_at(value: int, *, limit: Annotated[int, Ge(0)] = 1_000_000_000) -> int:
    """Fail once a number is too large."""
    if value >= limit:
        raise ValueError(f"{value} is too large")
    return value


class Collect(hfg.Node):
    """Keep what was received last, and how much."""

    first = hfg.State(-1)
    last = hfg.State(-1)
    seen = hfg.State(0)

    def process(self, value: int) -> None:
        """Keep it."""
        self.first = value if self.seen == 0 else self.first
        self.last = value
        self.seen += 1


class Stamp(hfg.Node):
    """Take words, never numbers."""

    @hfg.slot
    def write(self, words: str) -> None:
        """Write them."""


class Drive(hfg.Node):
    """Be active for a while, then hand on; another duration applies at once."""

    done = hfg.Event()
    duration = hfg.Parameter(0.4, Interval(gt=0, le=1000), unit="s")

    @hfg.slot
    async def begin(self) -> None:
        """Drive."""
        clock = asyncio.get_running_loop().time
        began = clock()
        while clock() < began + self.duration:
            await asyncio.sleep(0.02)
        self.done.trigger()


class Errand(hfg.Subgraph):
    """Go there and come back."""

    begin = hfg.slot(type=object)
    done = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        """Put one drive before the other."""
        there = graph.add(Drive(), name="there")
        back = graph.add(Drive(), name="back")
        self.begin.inner.activates(there.begin)
        there.done.activates(back.begin)
        back.done.activates(self.done.inner)


def mission() -> hfg.Graph:
    """Data above, a mission of three states beside it."""
    graph = hfg.Graph("mission")
    numbers = graph.add(count(), name="numbers", max_rate_hz=25)
    scale = graph.add(scaled(), name="scale")
    check = graph.add(fails_at(), name="check")
    store = graph.add(Collect(), name="store")
    draw = graph.add(picture(), name="draw")
    graph.add(Stamp(), name="stamp")
    graph.add(Collect(), name="spare")
    numbers >> scale >> check >> store
    numbers >> draw >> graph.add(look(), name="look")
    errand, rest = graph.add(Errand(), name="errand"), graph.add(Drive(), name="rest")
    graph.start.activates(errand.begin)
    errand.done.activates(rest.begin)
    rest.done.activates(errand.begin)
    return graph


class Clock(hfg.Node):
    """Send how often it has ticked."""

    tick = hfg.Event(int)
    ticks = hfg.State(0)

    @hfg.slot
    def begin(self) -> None:
        """Receive the activity."""

    async def do(self) -> None:
        """Tick while active."""
        while True:
            self.ticks += 1
            self.tick.trigger(self.ticks)
            await asyncio.sleep(0.02)


class Heard(hfg.Node):
    """Count what one hears."""

    count = hfg.State(0)

    @hfg.slot
    def hear(self, number: int) -> None:
        """Hear it."""
        self.count += 1


class Pace(hfg.Subgraph):
    """Let numbers pass, multiplied as one says outside."""

    rate = hfg.Parameter(3, Interval(ge=0, le=10))
    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        """Multiply."""
        times = graph.add(scaled(), name="times")
        graph.connect(self.value.inner, times.value)
        graph.connect(times.out, self.out.inner)


def workshop() -> hfg.Graph:
    """What editors of edges, gates and promotions need: signals, a loop, and a subgraph with a parameter."""
    graph = hfg.Graph("workshop")
    numbers = graph.add(count(), name="numbers", max_rate_hz=25)
    pace = graph.add(Pace(), name="pace")
    numbers >> pace >> graph.add(Collect(), name="store")
    clock = graph.add(Clock(), name="clock")
    graph.start.activates(clock.begin)
    graph.connect(clock.tick, graph.add(Heard(), name="heard").hear)
    graph.add(Drive(), name="drive")
    return graph


@hfg.node
async def stuck(value: int) -> int:
    """Take a number, and never finish."""
    await asyncio.Event().wait()
    return value


class Bell(hfg.Node):
    """Ring for each number."""

    value = hfg.Input(int)
    ring = hfg.Event(int)

    def process(self, value: int) -> None:
        """Ring."""
        self.ring.trigger(value)


class Deaf(hfg.Node):
    """Be busy with the first call for ever."""

    @hfg.slot
    async def hear(self, number: int) -> None:
        """Be busy."""
        await asyncio.Event().wait()


class Pair(NamedTuple):
    """Two numbers."""

    left: int
    right: int


@hfg.node(outputs=Pair)
def pair(value: int) -> Pair:
    """Send a number and its half."""
    return Pair(value, value // 2)


@hfg.node
def total(left: int, right: int) -> int:
    """Add two numbers."""
    return left + right


def jam() -> hfg.Graph:
    """A node that never finishes, a queue that is full, a node that is off; and two edges as a bundle."""
    graph = hfg.Graph("jam")
    numbers = graph.add(count(), name="numbers", max_rate_hz=25)
    numbers >> graph.add(scaled(), name="scale") >> graph.add(stuck(), name="stuck")
    other = graph.add(count(), name="other", max_rate_hz=25)
    bell, deaf = graph.add(Bell(), name="bell"), graph.add(Deaf(), name="deaf")
    graph.connect(other.out, bell.value)
    graph.connect(bell.ring, deaf.hear, capacity=3)
    third = graph.add(count(), name="third", max_rate_hz=25)
    both, add = graph.add(pair(), name="both"), graph.add(total(), name="add")
    third >> both
    graph.connect(both.ports.outputs["left"], add.left)
    graph.connect(both.ports.outputs["right"], add.right)
    third >> graph.add(halves(), name="off", enabled=False)
    return graph


@hfg.node
def of_all_kinds(
    value: int,
    *,
    loud: bool = False,
    way: Literal["forth", "back"] = "forth",
    seed: int | None = None,
    size: tuple[int, int] = (5, 5),
    days: frozenset[Literal["sat", "sun"]] = frozenset({"sat"}),
) -> int:
    """Have a parameter of each kind."""
    return value

"""Sources that certainly go on for ever, and those of which nobody can say (rules F2, R6)."""

from __future__ import annotations

import asyncio
import importlib
import itertools
import random
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.graph.checks.endless import endless, runs_for_ever
from hfg.graph.flat import flatten

LIMIT = 3


@hfg.node
def seven() -> int:
    """A constant."""
    return 7


@hfg.node
def product(*, factor: int = 2) -> int | None:
    half = factor * 3 / 2
    return max(int(half), 1) if factor > 1 else None


@hfg.node
def forever() -> Iterator[int]:
    number = 0
    yield number
    while True:
        number += 1
        if number % 2:
            yield number


class Clock(hfg.Node):
    out = hfg.Output(int)
    ticked = hfg.Event(int)
    step = hfg.Parameter(1)
    ticks = hfg.State(0)

    def setup(self) -> None:
        self.first = 1

    def process(self) -> int:
        self.ticks += self.step + self.first
        self.ticked.trigger(self.ticks, activity=1)
        return self.ticks


@pytest.mark.rule("F2")
@pytest.mark.parametrize("kind", [seven, product, forever, Clock])
def test_what_only_computes_writes_and_triggers_goes_on_for_ever(kind: Any) -> None:
    assert runs_for_ever(kind._type)


@hfg.node
def now() -> float:
    return time.monotonic()


@hfg.node
def twice() -> int:
    return seven.function() * 2


@hfg.node
def asks() -> str:
    return input()


@hfg.node
def limited() -> int:
    return LIMIT


@hfg.node
def raises() -> int:
    raise hfg.EndOfStream


@hfg.node
def calls(*, make: Callable[[], int] = int) -> int:
    return make()


@hfg.node
def divides(*, by: int = 1) -> float:
    return 1 / by


@hfg.node
def counts() -> Iterator[int]:
    yield from itertools.count()


@hfg.node
def breaks() -> Iterator[int]:
    while True:
        yield 1
        break


@hfg.node
def returns(*, often: int = 3) -> Iterator[int]:
    while True:
        if often > 3:
            return
        yield 1


@hfg.node
async def waits() -> int:
    await asyncio.sleep(1)
    return 1


class Helped(hfg.Node):
    out = hfg.Output(int)

    def process(self) -> int:
        return self.help()

    def help(self) -> int:
        raise hfg.EndOfStream


class Property(hfg.Node):
    out = hfg.Output(int)

    @property
    def next(self) -> int:
        raise hfg.EndOfStream

    def process(self) -> int:
        return self.next


class Asked(hfg.Node):
    out = hfg.Output(int)

    def ready(self) -> bool:
        return False

    def process(self) -> int:
        return 1


unseen = hfg.node(eval("lambda: 7"), outputs=int)
random_ = hfg.node(random.random, inputs={}, outputs=float)
DOUBTFUL = [now, twice, asks, limited, raises, calls, divides, counts, breaks, returns, waits, Helped, Property, Asked]


@pytest.mark.rule("F2")
@pytest.mark.parametrize("kind", [*DOUBTFUL, unseen, random_])
def test_what_may_end_or_wait_is_left_alone(kind: Any) -> None:
    assert not runs_for_ever(kind._type)


# --- what stands behind it ---


@hfg.node
def show(value: object) -> None: ...


@hfg.node
def add(a: object, b: object) -> None: ...


@hfg.node
async def slow(value: object) -> None:
    await asyncio.sleep(1)


class Ear(hfg.Node):
    @hfg.slot
    async def hear(self, value: object) -> None:
        await asyncio.sleep(1)


class Box(hfg.Subgraph):
    def build(self, graph: hfg.Graph) -> None:
        graph.add(Clock(), name="inside")


def build(behind: str) -> hfg.Graph:
    """A clock without a rate, and something behind it."""
    graph = hfg.Graph()
    graph.group("work", threads=1)
    clock: Any = graph.add(Clock(), max_rate_hz=5 if behind == "rate" else None, enabled=behind != "disabled")
    other = graph.add(Clock(), name="other", max_rate_hz=1)
    match behind:
        case "slow":
            graph.connect(clock.out, graph.add(slow()).value)
        case "fast" | "rate" | "disabled":
            graph.connect(clock.out, graph.add(show()).value)
        case "slow slot":
            graph.connect(clock.ticked, graph.add(Ear()).hear)
        case "lossy":
            graph.connect(clock.ticked, graph.add(Ear()).hear, overflow="latest")
        case "slow in the end":
            middle = graph.add(hfg.node(lambda value: value, inputs={"value": int}, outputs=int)())
            graph.connect(clock.out, middle.value)
            graph.connect(middle.out, graph.add(slow()).value)
        case "paced":
            graph.connect(clock.out, graph.add(show(), max_rate_hz=1).value)
        case "join":
            join = graph.add(add())
            graph.connect(clock.out, join.a)
            graph.connect(other.out, join.b)
        case "stop":
            graph.connect(other.ticked, graph.stop)
        case "parameter":
            graph.connect(other.out, clock.ports.parameters["step"])
        case "output":
            graph.connect(clock.out, graph.output("out", int))
        case "gate":
            graph.gate(clock, by=other)
        case "thread":
            graph.connect(clock.out, graph.add(show(), group="work").value)
        case "box":
            graph.nodes.pop("clock")
            graph.add(Box())
    return graph


CERTAIN = ("fast", "lossy", "box")
UNCERTAIN = (
    *("slow", "slow slot", "slow in the end", "paced", "join", "stop", "parameter", "output", "gate", "rate"),
    "disabled",
)


@pytest.mark.rule("R6", "F2")
@pytest.mark.parametrize("behind", CERTAIN)
def test_a_source_that_nothing_holds_back_is_refused_with_until_in_virtual_time(behind: str) -> None:
    graph = build(behind)
    path = "box/inside" if behind == "box" else "clock"
    with pytest.raises(
        hfg.errors.GraphError, match=f'^source "{path}" has no rate, waits for nothing and never ends, '
    ):
        hfg.run(graph, clock="virtual", until_s=3)
    assert [problem.path for problem in graph.check() if problem.check == "endless-source"] == [path]


@pytest.mark.rule("R6", "F2")
@pytest.mark.parametrize("behind", UNCERTAIN)
def test_a_source_that_something_holds_back_or_ends_is_left_alone(behind: str) -> None:
    graph = build(behind)
    assert not list(endless(flatten(graph), virtual=True))
    assert not [problem for problem in graph.check() if problem.check == "endless-source"]


@pytest.mark.rule("R6")
def test_a_source_that_a_slow_node_holds_back_runs_until() -> None:
    report = hfg.run(build("slow"), clock="virtual", until_s=3.5)
    assert (report.outcome, report.nodes["clock"].firings) == ("until", 4)


@pytest.mark.rule("R6")
def test_a_thread_holds_a_source_back_in_real_time_alone() -> None:
    graph = build("thread")
    assert not [problem for problem in graph.check() if problem.check == "endless-source"]
    with pytest.raises(hfg.errors.GraphError, match="has no rate"):
        hfg.run(graph, clock="virtual", until_s=3)


COUNTS = """
import hfg
from collections.abc import Iterator

@hfg.node
def counts() -> Iterator[int]:
    number = 0
    while True:
        number += 1
        yield number
"""


@pytest.mark.parametrize(
    "now", ["import hfg\nX = [\n 1,\n (2,\n '''\n", COUNTS.replace("counts", "other"), "\n\n", None]
)
def test_of_a_source_whose_file_has_changed_since_nobody_can_say(
    now: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "counting", raising=False)
    file = tmp_path / "counting.py"
    file.write_text(COUNTS)
    kind = importlib.import_module("counting").counts
    if now is None:
        assert runs_for_ever(kind._type)
        return
    file.write_text(now)
    assert not runs_for_ever(kind._type)
    graph = hfg.Graph()
    graph.add(kind())
    assert [problem for problem in graph.check() if problem.severity == "error"] == []

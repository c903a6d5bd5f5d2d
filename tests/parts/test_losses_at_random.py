"""Parts of every kind die at any moment: what is lost is counted, and no join pairs what does not belong together (L2).

Each value says which firing of the source it comes of. What is random: the components and their kinds (of which
nothing is lost, and of which something is), how many are in one group, what feeds what, where they join, and who dies
when: before the run has begun, in the middle, at its end, several at one moment, the same one twice.
"""

from __future__ import annotations

import asyncio
import logging
import os
import random
from collections.abc import AsyncIterator, Iterator
from typing import Any

import pytest

import hfg
from hfg.base.token import NO_MESSAGE
from hfg.parts.model.deaths import LIMIT
from hfg.parts.processes import launching
from hfg.trace import TokenTaken, TraceEvent
from hfg_transports.memory import Network
from tests.parts.test_deaths_at_random import BAD, BETWEEN_DEATHS_S

pytestmark = pytest.mark.slow

SOAK = int(os.environ.get("HFG_SOAK_LOSSES", "200"))
SOON_S = 120.0
COUNT = 40

TORN: list[tuple[int, int]] = []
"""What was paired and does not belong together."""


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    """Parts that die are told of each time."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@hfg.node
async def origins(*, count: int = COUNT) -> AsyncIterator[int]:
    for number in range(count):
        yield number
        await asyncio.sleep(0.003)


@hfg.node
async def passing(value: int, *, takes_s: float = 0.0) -> int:
    if takes_s:
        await asyncio.sleep(takes_s)
    return value


@hfg.node
async def meet(a: int, b: int, *, takes_s: float = 0.0) -> int:
    if a != b:
        TORN.append((a, b))
    if takes_s:
        await asyncio.sleep(takes_s)
    return a


class Telling(hfg.Node):
    """Says what passes."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    said = hfg.Event(int)

    def process(self, value: int) -> int:
        self.said.trigger(value)
        return value


class Hearing(hfg.Node):
    """Hears of it."""

    @hfg.slot
    def hear(self, value: int) -> None:
        """Do nothing."""


class Drawn:
    """A graph that is drawn at random."""

    def __init__(self, seed: int) -> None:
        self.choose = choose = random.Random(seed)
        self.graph = graph = hfg.Graph("drawn")
        self.source = graph.add(origins())
        self.groups = [f"p{number}" for number in range(choose.randint(1, 3))]
        self.first: list[Any] = []  # what leaves components that the source feeds
        self._names = 0
        ends: list[tuple[str, Any]] = []
        for group in self.groups:
            graph.group(group, process=True)
            for _ in range(choose.choice([1, 2, 2, 3])):
                ends.append((group, self._component(group, ends)))
        last: Any = None
        for _, end in ends:
            if last is None:
                last = end
                continue
            both = self._add(meet(), "loop")
            graph.connect(last, both.a)
            graph.connect(end, both.b)
            last = both.out
        graph.connect(last, graph.output("out", int))

    def _add(self, node: Any, group: str) -> Any:
        self._names += 1
        return self.graph.add(node, name=f"n{self._names}", group=group)

    def _component(self, group: str, ends: list[tuple[str, Any]]) -> Any:
        choose, graph = self.choose, self.graph
        takes_s = choose.choice([0.0, 0.004, 0.011, 0.03])
        elsewhere = [end for home, end in ends if home != group]
        feed = choose.choice(elsewhere) if elsewhere and choose.random() < 0.4 else self.source.out
        if choose.random() < 0.3:
            node = self._add(meet(takes_s=takes_s), group)
            other = choose.choice([self.source.out, *elsewhere])
            graph.connect(feed, node.a, buffer=choose.choice([0, 2, 20]))
            graph.connect(other, node.b, buffer=choose.choice([0, 2, 20]))
            is_first = feed is other is self.source.out
        else:
            node = self._add(passing(takes_s=takes_s), group)
            graph.connect(feed, node.value, buffer=choose.choice([0, 2, 20]))
            is_first = feed is self.source.out
        kind = choose.choice(["answers", "active", "told", "skips"])
        if kind == "answers":
            if choose.random() < 0.5:
                node = self._behind(node, passing(takes_s=takes_s), group)
        elif kind == "active":
            graph.start.activates(node.activate)
            node = self._behind(node, passing(takes_s=takes_s), group, active=True)
        elif kind == "told":
            node = self._behind(node, Telling(), group)
            graph.connect(node.said, self._add(Hearing(), group).hear)
        else:
            self._names += 1
            after = graph.add(passing(takes_s=takes_s), name=f"n{self._names}", group=group, on_error="skip")
            graph.connect(node.out, after.value)
            node = after
        if is_first:
            self.first.append(node.out)
        return node.out

    def _behind(self, node: Any, other: Any, group: str, **options: Any) -> Any:
        after = self._add(other, group)
        self.graph.connect(node.out, after.value, **options)
        return after


class Reaper(launching.LoopLauncher):
    """Begins parts on the loop, over a bad network, and kills some of them at random, never one too often."""

    def __init__(self, seed: int, mortal: list[str]) -> None:
        super().__init__(network=Network(BAD, seed=seed))
        self._choose = random.Random(seed)
        self._mortal = mortal
        self._parts: dict[str, Any] = {}
        self.deaths: dict[str, int] = dict.fromkeys(mortal, 0)
        self._reaping: asyncio.Task[None] | None = None

    async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> Any:
        self._parts[part] = launched = await super().launch(run, part, host, incarnations)
        if self._reaping is None:
            self._reaping = asyncio.create_task(self._reap())
        return launched

    async def _reap(self) -> None:
        choose = self._choose
        await asyncio.sleep(choose.choice([0.0, 0.01, choose.uniform(0.0, 0.3)]))
        for _ in range(choose.randint(1, 6)):
            for part in choose.sample(self._mortal, choose.choice([1, 1, 1, len(self._mortal)])):
                if self.deaths[part] < LIMIT and part in self._parts:
                    self.deaths[part] += 1
                    self._parts.pop(part).kill()
            await asyncio.sleep(choose.choice(BETWEEN_DEATHS_S) + choose.choice([0.0, choose.uniform(0.0, 0.1)]))

    async def close(self) -> None:
        if self._reaping is not None:
            self._reaping.cancel()
        await super().close()


def check(seed: int, monkeypatch: pytest.MonkeyPatch) -> tuple[int, int]:
    """How many deaths there were, and how many tokens were lost."""
    TORN.clear()
    drawn = Drawn(seed)
    made: list[Reaper] = []

    def make() -> Reaper:
        made.append(Reaper(seed, drawn.groups))
        return made[-1]

    taken: list[TraceEvent] = []
    monkeypatch.setattr(launching, "LoopLauncher", make)
    report = hfg.run(drawn.graph, clock="virtual", until_s=SOON_S, trace=taken.append)
    monkeypatch.undo()
    assert report.outcome == "done", f"seed {seed}: {report.outcome}"
    assert not TORN, f"seed {seed}: {TORN[:3]}"
    silent: dict[str, int] = {}
    for event in taken:
        if isinstance(event, TokenTaken) and event.token.value is NO_MESSAGE:
            silent[event.edge] = silent.get(event.edge, 0) + 1
    lost = {label: edge.lost for label, edge in report.edges.items() if edge.lost}
    for label in lost:
        assert any(label in error and "lost with a process" in error for error in report.errors), (
            f"seed {seed}: {label}"
        )
    first = {edge.label for edge in report_edges(drawn)}
    for label in first:
        assert silent.get(label, 0) == lost.get(label, 0), f"seed {seed}: {label}: {silent} {lost}"
    missing = COUNT - len(report.outputs["out"])
    assert bool(missing) <= bool(lost), f"seed {seed}: {missing} are missing and nothing was said to be lost"
    assert missing <= sum(lost.values()), f"seed {seed}: {missing} are missing, {lost} are counted"
    return sum(made[0].deaths.values()), sum(lost.values())


def report_edges(drawn: Drawn) -> list[Any]:
    """The edges from components that the source feeds into the main part, on which nothing else is silent."""
    from hfg.graph.flat import MAIN, cut, flatten

    cutting = cut(flatten(drawn.graph))
    ports = {id(port): True for port in drawn.first}
    return [edge for edge in cutting.edges if edge.target == MAIN and id(edge.edge.source.port) in ports]


@pytest.mark.rule("L2", "L3")
def test_whoever_dies_when_no_join_is_torn_and_each_loss_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [check(seed, monkeypatch) for seed in range(24)]
    assert sum(deaths for deaths, _ in found) > 40
    assert sum(lost > 0 for _, lost in found) > 1


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.rule("L2", "L3")
def test_many_deaths_of_every_kind_tear_no_join(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(50_000, 50_000 + SOAK):
        check(seed, monkeypatch)

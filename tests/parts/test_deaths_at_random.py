"""Parts that keep nothing die one after another, over a bad network; each value comes out once (rules L2, L3).

What is random: the graph (parts in chains, forks and joins, several edges between two of them, nodes of the main part
in between), its buffers, and who dies when: within the recovery of another, several at one moment, the same one twice.
"""

from __future__ import annotations

import asyncio
import logging
import os
import random
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest

import hfg
from hfg.graph.flat import cut, flatten
from hfg.parts.model.deaths import LIMIT
from hfg.parts.model.inheriting import inheriting, keeping
from hfg.parts.processes import launching
from hfg.parts.running.channels import Channel
from hfg_transports.memory import Faults, Network

pytestmark = pytest.mark.slow

SEEDS = int(os.environ.get("HFG_SOAK_DEATHS", "5000"))
BAD = Faults(loss=0.2, repetition=0.1, delay_s=(0.0, 0.004))
CYCLIC = 0.15  # of so many of the graphs two processes feed each other
SOON_S = 120.0  # of virtual time
BETWEEN_DEATHS_S = (0.0, 0.001, 0.004, 0.02, 0.09, 0.1, 0.11, 0.13, 0.2, 0.4)  # a new life begins after 0.1 s or more

EFFECTS: list[int] = []


@pytest.fixture(autouse=True)
def quiet() -> Iterator[None]:
    """Parts that die are told of each time."""
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


@hfg.node
def numbers(*, count: int = 40) -> Iterator[int]:
    yield from range(count)


@hfg.node
async def one(value: int, *, takes_s: float = 0.0, adds: int = 1) -> int:
    if takes_s:
        await asyncio.sleep(takes_s)
    return value + adds


@hfg.node
async def both(a: int, b: int, *, takes_s: float = 0.0) -> int:
    if takes_s:
        await asyncio.sleep(takes_s)
    return 31 * a + b


class Halves(NamedTuple):
    out: int
    rest: int


@hfg.node(outputs=Halves)
def split(value: int) -> Halves:
    return Halves(value // 7, value % 7)


@hfg.node
def not_thirds(value: int) -> int | None:
    return value if value % 3 else None


@hfg.node
async def effect(value: int, *, takes_s: float = 0.0) -> None:
    EFFECTS.append(value)
    if takes_s:
        await asyncio.sleep(takes_s)


class Drawn:
    """A graph that is drawn at random."""

    def __init__(self, seed: int, *, processes: bool, is_uneven: bool = False) -> None:
        self._choose = choose = random.Random(seed)
        self._processes = processes
        self.graph = hfg.Graph("drawn")
        self._names = 0
        self._open: list[tuple[str, Any]] = []  # ports to which nobody listens yet, and in which group they are
        self._source(choose.choice([1, 15, 40]))
        groups = [f"p{number}" for number in range(choose.randint(2, 4))]
        for group in groups:
            if processes:
                self.graph.group(group, process=True)
            if is_uneven and choose.random() < 0.5:
                self._source(choose.choice([1, 7, 20, 60]))
            self._draw(group)
            if choose.random() < 0.15:  # a node of the main part between two others
                self._open.append(("", self._node(one(), "", self._take()).out))
        if choose.random() < CYCLIC:
            self._come_back()
        for number, (_, port) in enumerate(self._open):
            self.graph.connect(port, self.graph.output(f"out{number}", int))

    def _source(self, count: int) -> None:
        self._names += 1
        self._open.append(("", self.graph.add(numbers(count=count), name=f"source{self._names}").out))

    def _take(self) -> Any:
        """Some port that nobody listens to yet, or one to which others will listen, too."""
        if not self._open:
            return self.graph["source1"].out
        at = self._choose.choice([-1, self._choose.randrange(len(self._open))])
        _, port = self._open[at] if self._choose.random() < 0.2 else self._open.pop(at)
        return port

    def _node(self, node: Any, group: str, *sources: Any) -> Any:
        self._names += 1
        options: dict[str, Any] = {"group": group} if group and self._processes else {}
        if self._choose.random() < 0.3:
            options["release"] = self._choose.choice(["sequential", "pipelined"])
        added = self.graph.add(node, name=f"n{self._names}", **options)
        for source, port in zip(sources, added.ports.inputs.values(), strict=True):
            is_sequential = options.get("release") == "sequential"
            self.graph.connect(source, port, buffer=0 if is_sequential else self._choose.choice([0, 0, 1, 2, 5, 20]))
        return added

    def _draw(self, group: str) -> None:
        choose = self._choose
        takes_s = choose.choice([0.0, 0.0, 0.001, 0.004, 0.011])
        if choose.random() < 0.4:
            node = self._node(both(takes_s=takes_s), group, self._take(), self._take())
        else:
            node = self._node(one(takes_s=takes_s), group, self._take())
        ends = [node.out]
        for _ in range(choose.choice([0, 1, 1, 2])):
            kind = choose.choice(["one", "split", "not thirds", "fork", "effect", "meet"])
            port = choose.choice(ends)
            if kind == "effect":
                self._node(effect(takes_s=takes_s), group, port)
                continue
            if kind == "one" or kind == "split" or (kind == "meet" and choose.random() < 0.5):
                ends.remove(port)
            if kind == "meet":
                ends.append(self._node(both(), group, *choose.sample([port, self._take()], 2)).out)
            elif kind == "split":
                halves = self._node(split(), group, port)
                ends += [halves.out, halves.rest]
            else:
                ends.append(self._node(not_thirds() if kind == "not thirds" else one(adds=10), group, port).out)
        self._open += [(group, end) for end in ends]

    def _come_back(self) -> None:
        """What a process has sent out into the world meets there again with what came of it elsewhere."""
        pairs = [(a, b) for a in self._open for b in self._open if a[0] and b[0] and a[0] < b[0]]
        if pairs:
            own, other = self._choose.choice(pairs)
            self._open = [one for one in self._open if one not in (own, other)]
            self._open.append((own[0], self._node(both(), own[0], own[1], other[1]).out))


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
        launched: Any = await super().launch(run, part, host, incarnations)
        launched.begins = self._begin
        self._parts[part] = launched
        return launched

    def _begin(self) -> None:
        """All are set up: who dies from now on has another life."""
        if self._reaping is None and self._mortal:
            self._reaping = asyncio.create_task(self._reap())

    async def _reap(self) -> None:
        choose = self._choose
        await asyncio.sleep(choose.uniform(0.0, 0.1))
        last = choose.choice(self._mortal)
        for _ in range(choose.randint(1, 7)):
            self._kill(last)
            at = self._mortal.index(last)
            beside = self._mortal[max(at - 1, 0) : at + 2]
            last = choose.choice([last, *beside, *beside, choose.choice(self._mortal)])
            await asyncio.sleep(choose.choice(BETWEEN_DEATHS_S) + choose.choice([0.0, choose.uniform(0.0, 0.005)]))

    def _kill(self, part: str) -> None:
        if self.deaths[part] < LIMIT and part in self._parts:
            self.deaths[part] += 1
            self._parts.pop(part).kill()  # there is nothing to kill until it lives again

    async def close(self) -> None:
        if self._reaping is not None:
            self._reaping.cancel()
        await super().close()


def values_of(graph: hfg.Graph) -> tuple[str, dict[str, Any], list[int]]:
    """How it ended, what every output had, and all effects."""
    EFFECTS.clear()
    report = hfg.run(graph, clock="virtual", until_s=SOON_S)
    return report.outcome, report.outputs, EFFECTS.copy()


def check(seed: int, monkeypatch: pytest.MonkeyPatch, *, is_uneven: bool = False) -> int:
    """How many deaths there were; none where sources are of unequal lengths, for then a ledger is needed."""
    outcome, wanted, effects = values_of(Drawn(seed, processes=False, is_uneven=is_uneven).graph)
    assert outcome == "done"
    graph = Drawn(seed, processes=True, is_uneven=is_uneven).graph
    cutting = cut(flatten(graph))
    assert not cutting.findings, cutting.findings
    mortal = [] if is_uneven else sorted(inheriting(cutting) | keeping(cutting).keys())
    made: list[Reaper] = []

    def make() -> Reaper:
        made.append(Reaper(seed, mortal))
        return made[-1]

    refused: list[str] = []
    monkeypatch.setattr(launching, "LoopLauncher", make)
    monkeypatch.setattr(Channel, "refuse", lambda _, why: refused.append(why))
    found = values_of(graph)
    monkeypatch.undo()
    assert found[0] == "done", f"seed {seed}"
    assert found[1] == wanted, f"seed {seed}"
    assert set(found[2]) == set(effects), f"seed {seed}"
    assert not refused, f"seed {seed}: {refused}"  # for all that was said is so (L4)
    return sum(made[0].deaths.values())


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("block", range(4))
def test_parts_that_die_one_after_another_lose_and_double_nothing(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    assert sum(check(seed, monkeypatch) for seed in range(15 * block, 15 * block + 15)) > 20


@pytest.mark.rule("L2")
@pytest.mark.parametrize("seed", [20298, 20779, 21091])
def test_a_ledger_counts_what_had_left_when_its_neighbour_says_that_it_has_nothing(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The neighbour takes some of it before its word arrives, and those count as well."""
    assert check(seed, monkeypatch) > 2


@pytest.mark.rule("L1", "F12")
def test_parts_whose_sources_end_at_different_times_carry_what_the_whole_does(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(40):
        check(seed, monkeypatch, is_uneven=True)


@pytest.mark.soak
@pytest.mark.timeout(3600)
def test_many_deaths_lose_and_double_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(10_000, 10_000 + SEEDS):
        check(seed, monkeypatch)
        check(seed, monkeypatch, is_uneven=True)

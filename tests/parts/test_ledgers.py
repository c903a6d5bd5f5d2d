"""Parts with a ledger: whoever dies, and whenever, the run gives what it gives undisturbed (rules L2, L3, F7)."""

from __future__ import annotations

import asyncio
import random
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.errors import RunError
from hfg.graph.flat import cut, flatten
from hfg.parts.model.ledgers import LedgerFile
from tests.parts.test_deaths import at, at_random, killed, numbers, relay

__all__ = ["killed"]  # the fixture


class Total(hfg.Node):
    """Adds up, and says how often."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    often = hfg.Event(int)
    total = hfg.State(0)
    count = hfg.State(0)

    async def process(self, value: int) -> int:
        await asyncio.sleep(0.003)
        self.total += value
        self.count += 1
        if self.count % 3 == 0:
            self.often.trigger(self.count)
        return self.total


class Sink(hfg.Node):
    """Keeps what comes, and hands it out at the end."""

    value = hfg.Input(int)
    all = hfg.Output(list[int])
    seen = hfg.State(factory=list[int])

    def process(self, value: int) -> None:
        self.seen.append(value)

    def end(self) -> None:
        self.all.send(self.seen)


class Counting(hfg.Node):
    """A source that knows where it goes on."""

    out = hfg.Output(int)
    count = hfg.Parameter(40)
    number = hfg.State(0)

    def process(self) -> int:
        if self.number == self.count:
            raise hfg.EndOfStream
        self.number += 1
        return self.number


class Join(hfg.Node):
    """Puts two together, with a memory."""

    a = hfg.Input(int)
    b = hfg.Input(int)
    out = hfg.Output(tuple[int, int, int])
    seen = hfg.State(0)

    def process(self, a: int, b: int) -> tuple[int, int, int]:
        self.seen += 1
        return a, b, self.seen


def totals(*, count: int = 40) -> hfg.Graph:
    graph = hfg.Graph("totals")
    graph.group("far", process=True, ledger=True)
    graph.group("sink", process=True, ledger=True)
    total, sink, often = (
        graph.add(Total(), group="far"),
        graph.add(Sink(), group="sink"),
        graph.add(Sink(), group="sink"),
    )
    graph.connect(graph.add(numbers(count=count)).out, total.value)
    graph.connect(total.out, sink.value)
    graph.connect(total.often, often.value)
    graph.connect(total.out, graph.output("out", int))
    graph.connect(sink.all, graph.output("all", list[int]))
    graph.connect(often.all, graph.output("often", list[int]))
    return graph


def undisturbed(graph: hfg.Graph) -> dict[str, list[Any]]:
    return hfg.run(graph, clock="virtual").outputs


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("moment", [0.003 * number for number in range(20)])
def test_state_and_edges_agree_at_whatever_moment_a_process_dies(killed: Any, moment: float) -> None:
    made = killed(at(moment, "far"))
    found = undisturbed(totals(count=20))
    sums = [number * (number + 1) // 2 for number in range(20)]
    assert made[0].lives["far"] == 2
    assert found == {"out": sums, "all": [sums], "often": [[3, 6, 9, 12, 15, 18]]}


@pytest.mark.slow
@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("seed", range(8))
def test_processes_with_ledgers_that_die_at_random_lose_and_double_nothing(killed: Any, seed: int) -> None:
    made = killed(at_random(seed, ["far", "sink"], 8), seed)
    found = undisturbed(totals(count=80))
    sums = [number * (number + 1) // 2 for number in range(80)]
    assert sum(made[0].lives.values()) > 2
    assert found == {"out": sums, "all": [sums], "often": [list(range(3, 81, 3))]}


def mixed(choose: random.Random) -> hfg.Graph:
    """A graph of everything that can be kept, in parts of its own or together as chance has it."""
    graph = hfg.Graph("mixed")
    names = [f"part{number}" for number in range(choose.randint(2, 4))]
    for name in names:
        graph.group(name, process=True, ledger=True)
    graph.group("plain", process=True)

    def place() -> dict[str, Any]:
        return {"group": choose.choice(names), "release": choose.choice(["auto", "sequential", "pipelined"])}

    count = choose.randint(15, 30)
    source, other = graph.add(Counting(count=count), **place()), graph.add(numbers(count=count))
    slow, between = graph.add(relay(takes_s=0.002), **place()), graph.add(relay(takes_s=0.003), group="plain")
    join, total, sink, often = (
        graph.add(Join(), **place()),
        graph.add(Total(), **place()),
        graph.add(Sink(), **place()),
        graph.add(Sink(), **place()),
    )
    graph.connect(source.out, slow.value)
    graph.connect(slow.out, join.a)
    graph.connect(other.out, between.value)
    graph.connect(between.out, join.b)
    graph.connect(slow.out, total.value, buffer=choose.choice([0, 2]))
    graph.connect(total.out, sink.value)
    graph.connect(total.often, often.value, capacity=choose.choice([1, 4, 16]))
    graph.connect(join.out, graph.output("joined", tuple[int, int, int]))
    graph.connect(sink.all, graph.output("all", list[int]))
    graph.connect(often.all, graph.output("often", list[int]))
    return graph


@pytest.mark.slow
@pytest.mark.rule("L2", "L3", "F7")
@pytest.mark.parametrize("seed", range(15))
def test_random_graphs_whose_processes_die_at_random_give_what_they_give_undisturbed(killed: Any, seed: int) -> None:
    wanted = undisturbed(mixed(random.Random(seed)))
    graph = mixed(random.Random(seed))
    assert [problem for problem in graph.check() if problem.severity == "error"] == []
    names = sorted(name for name in cut(flatten(graph)).parts if name)
    made = killed(at_random(seed, names, 5), seed)
    assert hfg.run(graph, clock="virtual").outputs == wanted
    assert sum(made[0].lives.values()) > len(names)


# --- in a file ---


def in_file(path: str, **options: Any) -> hfg.Graph:
    graph = hfg.Graph("filed")
    for name in ("source", "total"):
        graph.group(name, process=True, ledger=f"{path}.{name}")
    source, total = graph.add(Counting(count=30), group="source"), graph.add(Total(), group="total")
    graph.connect(source.out, total.value)
    graph.connect(total.out, graph.output("out", int))
    return graph


@pytest.mark.slow
@pytest.mark.rule("L2")
@pytest.mark.parametrize("until_s", [0.0205, 0.031, 0.0505, 0.09])
def test_the_next_run_goes_on_from_what_a_file_has_kept(tmp_path: Path, until_s: float) -> None:
    path = str(tmp_path / "ledger")
    first = hfg.run(in_file(path), clock="virtual", until_s=until_s)
    assert first.outcome == "until"
    found = first.outputs["out"] + undisturbed(in_file(path))["out"]
    sums = [number * (number + 1) // 2 for number in range(1, 31)]
    last = len(first.outputs["out"])
    assert found[:last] == sums[:last]
    assert found[-1] == sums[-1]
    assert sorted(set(found)) == sums  # what had come out and was not known to be taken comes again
    assert undisturbed(in_file(path))["out"] == sums  # a run that has ended well is over: the next begins anew


@pytest.mark.rule("L2")
def test_a_ledger_that_is_broken_or_of_another_graph_is_refused_with_one_sentence(tmp_path: Path) -> None:
    path = str(tmp_path / "ledger")
    (tmp_path / "ledger.source").write_bytes(b"no ledger at all, but some text that is long enough")
    with pytest.raises(RunError, match=r'ledger ".*ledger.source" of group "source" cannot be used: file is not a'):
        undisturbed(in_file(path))
    (tmp_path / "ledger.source").unlink()
    hfg.run(in_file(path), clock="virtual", until_s=0.03)
    graph = in_file(path)
    graph.add(Sink(), name="another", group="total")
    graph.connect(graph["total"].out, graph["another"].value)
    with pytest.raises(
        RunError, match='the ledger of group "total" belongs to another graph: "another" is in only one'
    ):
        undisturbed(graph)
    file = LedgerFile(str(tmp_path / "ledger.total"), "total")
    with pytest.raises(RunError, match='ledger ".*ledger.total" of group "total" cannot be used: database is locked'):
        LedgerFile(str(tmp_path / "ledger.total"), "total")
    file.close()


# --- what cannot be kept ---


class Careless(hfg.Node):
    """Has state that nobody is told of."""

    value = hfg.Input(int)

    def setup(self) -> None:
        self.seen: list[int] = []

    def process(self, value: int) -> None:
        self.seen.append(value)


class Strange(hfg.Node):
    """Has a state that is no data."""

    value = hfg.Input(int)
    thing = hfg.State(factory=object)

    def process(self, value: int) -> None:
        pass


@pytest.mark.rule("L2", "L4")
@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        (
            Careless,
            r'node "last" keeps "seen" outside of hfg.State, which changes .*: declare it as a state',
        ),
        (Strange, r'"thing" of node "last" cannot be kept: .*; declare its type, as in seen: dict\[str, int\] ='),
    ],
)
def test_state_that_cannot_be_kept_ends_the_run_with_one_sentence(kind: Any, sentence: str) -> None:
    graph = hfg.Graph()
    graph.group("far", process=True, ledger=True)
    graph.connect(graph.add(numbers(count=3)).out, graph.add(kind(), name="last", group="far").value)
    with pytest.raises(RunError, match=sentence):
        undisturbed(graph)


@pytest.mark.rule("L2")
def test_what_a_ledger_cannot_keep_is_found_before_the_run() -> None:
    graph = hfg.Graph()
    graph.group("far", process=True, ledger=True)
    source, one = graph.add(numbers(), group="far"), graph.add(relay(), group="far", on_error="restart")
    graph.connect(source.out, one.value, active=True)
    graph.connect(graph.start, one.enable)
    said = [str(problem) for problem in graph.check() if problem.check == "ledger"]
    assert len(said) == 5
    assert said[0].startswith('error at "numbers": group "far" has a ledger, but it is a generator')
    assert "write it as a class with process() and hfg.State" in said[0]
    assert 'on_error="restart"' in said[1]
    with pytest.raises(hfg.errors.GraphError, match="ledger= keeps what a process has done, and this group has none"):
        graph.group("here", ledger=True)
    with pytest.raises(hfg.errors.GraphError, match="ledger must be True .* or the path of a file"):
        graph.group("here", process=True, ledger=3)  # type: ignore[arg-type]


# --- the key of a repetition ---


class Keyed(hfg.Node):
    """Has an effect on the world outside at once, and dies before anybody knows."""

    value = hfg.Input(int)

    async def process(self, value: hfg.Token[int]) -> None:
        EFFECTS.append((value.sequence, value.value))
        await asyncio.sleep(0.004)


EFFECTS: list[tuple[int, int]] = []


@pytest.mark.rule("L2", "T5")
@pytest.mark.parametrize("moment", [0.01, 0.021, 0.031])
def test_a_token_that_comes_again_has_the_number_it_had(killed: Any, moment: float) -> None:
    EFFECTS.clear()
    killed(at(moment, "far"))
    graph = hfg.Graph()
    graph.group("far", process=True, ledger=True)
    graph.connect(graph.add(numbers(count=20)).out, graph.add(Keyed(), group="far").value)
    undisturbed(graph)
    assert len(EFFECTS) >= 20  # some happened twice, if it died between one and its record
    assert dict(EFFECTS) == {number + 1: number for number in range(20)}
    assert sorted(set(EFFECTS)) == [(number + 1, number) for number in range(20)]

"""Fused regions do what nodes do one by one: the same values, in the same order of all calls, whoever looks (R2, R7).

Regions are fused from the first firing on here. `test_soak_fused.py` compares many more graphs.
"""

from __future__ import annotations

import asyncio
import random
import threading
import traceback
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.cli.show import user_traceback
from hfg.engine.runtime import settings
from hfg.testing import Divergence, nodes, recorder, reference_run, replay
from hfg.testing.making import Allowed, random_plan
from hfg.testing.plans import GraphPlan
from hfg.testing.recording import Recorder
from hfg.testing.reference.structure import dissolve
from hfg.testing.shrinking import shrink

MOST_MOVES = 1500
BESIDE_THREADS = Allowed(plain=True, threads=True, lossy=False, gates=False)


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


class Calls(list[tuple[str, str]]):
    """Each call of a node's code on the loop, in order: the node's path, and what it was given.

    Attributes:
      aside: the same of code in threads, by node: between those there is no order.
    """

    def __init__(self) -> None:
        self.aside: dict[str, list[str]] = {}

    def note(self, node: Any, given: str) -> None:
        if threading.current_thread() is threading.main_thread():
            self.append((str(node.place.path), given))
        else:
            self.aside.setdefault(str(node.place.path), []).append(given)

    def take(self) -> tuple[list[tuple[str, str]], dict[str, list[str]]]:
        taken = list(self), self.aside
        self.clear()
        self.aside = {}
        return taken


def plain_shapes(seed: int) -> Allowed:
    """What is fused, and now and then what splits it."""
    return Allowed(plain=True, max_nodes=4 + seed % 9, sending=seed % 2 == 1)


def note_calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    """Have every call of the code of every node noted from now on."""
    calls = Calls()
    process_call, handler = hfg.Node._process_call, hfg.Node._handler

    def noted_process(self: Any) -> Callable[..., Any]:
        call = process_call(self)
        if self._type.process_kind == "generator":

            def draw(*arguments: Any) -> Iterator[Any]:
                values = iter(call(*arguments))
                while True:
                    calls.note(self, "next")
                    try:
                        value = next(values)
                    except StopIteration:
                        return
                    yield value

            return draw

        def process(*arguments: Any) -> Any:
            calls.note(self, repr(arguments))
            return call(*arguments)

        return process

    def noted_handler(self: Any, name: str) -> Callable[..., Any] | None:
        call = handler(self, name)
        if call is None:
            return None

        def handle(*arguments: Any) -> Any:
            calls.note(self, name + repr(arguments))
            return call(*arguments)

        return handle

    monkeypatch.setattr(hfg.Node, "_process_call", noted_process)
    monkeypatch.setattr(hfg.Node, "_handler", noted_handler)
    return calls


def noted_run(calls: Calls, plan: GraphPlan, *, fast: bool, trace: Recorder | None = None) -> tuple[Any, str, Any]:
    """Run it; give its report, what it failed with, and its calls."""
    calls.take()
    error = ""
    try:
        report = hfg.run(plan.build(), clock="virtual", fast=fast, trace=trace, until_s=30.0)
    except hfg.errors.RunError as problem:
        report, error = problem.report, str(problem)  # type: ignore[attr-defined]
    return report, error, calls.take()


def ends(plan: GraphPlan, seed: int) -> bool:
    """Whether it comes to an end by itself."""
    try:
        reference_run(plan.build(), seed=seed, max_moves=MOST_MOVES)
    except RuntimeError:
        return False
    return True


def are_one(plan: GraphPlan, one: tuple[Any, str, Any], other: tuple[Any, str, Any]) -> bool:
    """Whether two runs did the same in the same order; each node by itself where several may wait at a moment (R2)."""
    leaves = dissolve(plan.build()).leaves
    if one == other or sum(leaf.node._type.process_kind.startswith("async") for leaf in leaves) < 2:
        return one == other
    return (*one[:2], _each_by_itself(*one[2])) == (*other[:2], _each_by_itself(*other[2]))


def _each_by_itself(calls: list[tuple[str, str]], aside: dict[str, list[str]]) -> dict[str, list[str]]:
    found = {path: list(given) for path, given in aside.items()}
    for path, given in calls:
        found.setdefault(path, []).append(given)
    return found


def fusing_differs(calls: Calls, plan: GraphPlan) -> str | None:
    """Interpreted, fused and watched a graph does the same, and what the oracle permits."""
    interpreted = noted_run(calls, plan, fast=False)
    fused = noted_run(calls, plan, fast=True)
    if not are_one(plan, fused, interpreted):
        return f"interpreted: {interpreted}\n  fused: {fused}"
    trace = recorder()
    watched = noted_run(calls, plan, fast=True, trace=trace)
    if not are_one(plan, watched, interpreted):
        return f"not watched: {interpreted}\n  watched: {watched}"
    try:
        replay(plan, trace, until_s=30.0)
    except Divergence as divergence:
        return str(divergence)
    return None


def check(calls: Calls, seed: int, allowed: Allowed) -> None:
    plan = random_plan(seed, allowed)
    if not ends(plan, seed) or fusing_differs(calls, plan) is None:
        return
    small = shrink(plan, lambda smaller: ends(smaller, seed) and fusing_differs(calls, smaller) is not None)
    pytest.fail(f"seed {seed}\n{small}\n\n{fusing_differs(calls, small)}", pytrace=False)


@pytest.mark.rule("R2", "R7", "F3", "F4", "F5", "T5", "X1")
@pytest.mark.parametrize("block", range(8))
def test_fused_interpreted_and_watched_runs_are_one(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = note_calls(monkeypatch)
    for seed in range(15 * block, 15 * block + 15):
        check(calls, seed, plain_shapes(seed))


@pytest.mark.rule("R1", "F7")
@pytest.mark.parametrize("seed", range(30))
def test_threads_beside_a_region_change_nothing_of_it(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    check(note_calls(monkeypatch), seed, BESIDE_THREADS)


def fused_order(graph: hfg.Graph, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """In which order nodes were called, which is the same interpreted."""
    calls = note_calls(monkeypatch)
    orders = []
    for fast in (True, False):
        hfg.run(graph, clock="virtual", fast=fast)
        orders.append(calls.take()[0])
    assert orders[0] == orders[1]
    return [path for path, _ in orders[0]]


class SendsBehindAnAwait(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    async def process(self, value: int) -> None:
        await asyncio.sleep(0)
        self.out.send(value)


class Gathers(hfg.Node):
    """Takes pairs."""

    first = hfg.Input(int)
    second = hfg.Input(int, optional=True, default=-1)
    pairs: Any = None

    def setup(self) -> None:
        self.pairs = []

    def process(self, first: int, second: int) -> None:
        self.pairs.append((first, second))


@pytest.mark.rule("F3", "R2")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_what_async_code_sends_behind_an_await_leaves_with_its_firing(clock: Any) -> None:
    graph, pairs = hfg.Graph(), Gathers()
    source, sends = graph.add(nodes.script(values=tuple(range(20)))), graph.add(SendsBehindAnAwait())
    graph.add(pairs)
    graph.connect(source.out, sends.value)
    graph.connect(sends.out, pairs.second)
    graph.connect(source.out, pairs.first)
    hfg.run(graph, clock=clock)
    assert pairs.pairs == [(number, number) for number in range(20)]


class SendsForAnother(hfg.Node):
    """Amid its own firing it writes to the output of another node, whose call is not under way."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    other: Any = None

    async def process(self, value: int) -> int:
        await asyncio.sleep(0)
        try:
            self.other.out.send(-1)
        except hfg.errors.UsageError as error:
            self.refused = str(error)
        return value


@pytest.mark.rule("F3")
def test_what_is_sent_by_a_node_whose_call_is_not_under_way_is_refused_amid_a_wave_too() -> None:
    graph, meddles, pairs = hfg.Graph(), SendsForAnother(), Gathers()
    source, other = graph.add(nodes.script(values=(1, 2, 3))), graph.add(nodes.Speaks(), name="other")
    graph.add(meddles)
    graph.add(pairs)
    meddles.other = other
    graph.connect(source.out, meddles.value)
    graph.connect(meddles.out, other.value)
    graph.connect(source.out, pairs.first)
    graph.connect(other.out, pairs.second)
    hfg.run(graph, clock="virtual")
    assert pairs.pairs == [(1, 1), (2, 2), (3, 3)]
    assert 'output "other.out" was written outside a firing' in meddles.refused


@pytest.mark.rule("F9")
@pytest.mark.parametrize("by", ["event", "output"])
def test_a_slot_handler_whose_helper_sends_is_told_so_by_the_fast_path_too(by: str) -> None:
    graph = hfg.Graph()
    source, utters = graph.add(nodes.Script(every=1)), graph.add(nodes.Utters(), name="utters", on_error="skip")
    graph.connect(source.seen if by == "event" else source.out, utters.utter)
    report = hfg.run(graph, clock="virtual")
    assert report.nodes["utters"].failed == 1
    assert 'output "utters.out" was written in a slot handler' in str(report.errors[0])


@pytest.mark.rule("F4")
def test_silence_behind_a_node_that_may_be_silent_itself_stays_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = hfg.Graph()
    source = graph.add(nodes.script(values=(1, 0, None, 2)), name="s")
    some, behind, beside = graph.add(nodes.some(), name="f"), graph.add(nodes.double(), name="b"), nodes.sink()
    source.out >> some.value
    some.out >> behind.value
    graph.connect(source.out, graph.add(beside, name="o", release="pipelined").value)
    assert fused_order(graph, monkeypatch).count("b") == 2


@pytest.mark.rule("R2", "F5")
def test_a_head_with_a_buffer_before_it_goes_on_before_who_fills_that(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = hfg.Graph()
    source, head = graph.add(nodes.Script(count=8), name="s"), nodes.picky(at=2)
    graph.add(head, name="h", on_error="restart")
    behind = graph.add(nodes.double(), name="b")
    graph.connect(source.out, head.value, buffer=2)
    head.out >> behind.value
    fused_order(graph, monkeypatch)


@pytest.mark.rule("R2", "F6")
def test_a_call_that_a_wave_brings_while_another_is_under_way_goes_on_with_the_wave(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = hfg.Graph()
    source, relay = graph.add(nodes.script(values=(None, 6, 6)), name="s"), graph.add(nodes.Relay(), name="r")
    graph.connect(relay.said, relay.say)
    graph.connect(source.out, relay.say)
    assert fused_order(graph, monkeypatch).count("r") > 6


@pytest.mark.rule("R2", "F9", "T4")
def test_whose_turn_depends_on_silence_is_not_scheduled_before_it_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = hfg.Graph()
    source = graph.add(nodes.script(values=(2, 3)), name="s")
    parted, first = graph.add(nodes.parted(), name="p"), graph.add(nodes.Sieve(), name="a")
    tally = graph.add(nodes.Tally(), name="t")
    source.out >> parted.value
    parted.odd >> first.value
    parted.odd >> tally.value
    graph.connect(parted.even, tally.note)
    assert fused_order(graph, monkeypatch) == ["s", "p", "t", "s", "p", "a", "t", "s"]


@pytest.mark.rule("R5")
def test_what_a_stalled_member_waits_for_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = hfg.Graph()
    source, first, second = graph.add(nodes.script(), name="s"), nodes.double(), nodes.double()
    graph.add(first, name="a", release="pipelined")
    source.out >> first.value
    first.out >> graph.add(second, name="b").value
    second.out >> graph.add(nodes.add(), name="j").a
    with pytest.raises(hfg.errors.Stalled, match=r'"a" waits until its token is processed on "a.out -> b.value"'):
        hfg.run(graph, clock="virtual")


@pytest.mark.rule("X1")
def test_a_traceback_shows_which_node_a_line_of_a_region_calls() -> None:
    graph = hfg.Graph()
    source, fails = graph.add(nodes.script(values=(1, 2, 3)), name="s"), graph.add(nodes.picky(), name="middle")
    source.out >> graph.add(nodes.double(), name="a").value
    source.out >> fails.value
    with pytest.raises(hfg.errors.NodeError, match="firing 3") as caught:
        hfg.run(graph, clock="virtual")
    assert '# node "middle"' in "".join(traceback.format_exception(caught.value.__cause__))


def test_a_traceback_for_the_user_begins_in_the_code_of_the_user(capsys: pytest.CaptureFixture[str]) -> None:
    graph = hfg.Graph()
    source, fails = graph.add(nodes.script(values=(1, 2, 3)), name="s"), graph.add(nodes.picky(), name="middle")
    source.out >> fails.value
    with pytest.raises(hfg.errors.NodeError) as caught:
        hfg.run(graph, clock="virtual")
    user_traceback(caught.value.__cause__)
    assert "region" not in capsys.readouterr().err


@pytest.mark.rule("R4", "R7")
@pytest.mark.parametrize("seed", range(6))
def test_a_measured_run_that_is_paused_stepped_and_edited_loses_no_value(seed: int) -> None:
    choose = random.Random(seed)
    graph = hfg.Graph()
    source, first, behind, end = nodes.Script(count=60), nodes.double(), nodes.double(), nodes.Tally()
    graph.add(source, name="s", max_rate_hz=100)
    graph.add(first, name="a")
    graph.add(behind, name="b")
    source.out >> first.value
    first.out >> behind.value
    behind.out >> graph.add(end, name="t").value

    async def main() -> hfg.Report:
        async with hfg.running(graph) as run:
            for _ in range(8):
                await asyncio.sleep(choose.choice([0.0, 0.01, 0.035]))
                run.statistics()
                await run.edit(c.Copy("a", "n"), c.Connect("a.out", "n.value"))
                await asyncio.sleep(0.02)
                run.pause()
                await run.wait_paused()
                for _ in range(choose.randint(0, 5)):
                    await run.step(choose.choice([None, source, first, behind]))
                run.resume()
                await run.edit(c.Remove("n"))
            return await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        report = runner.run(main())
    assert end.count == 60
    assert {node.firings for node in report.nodes.values()} == {61}
    assert {edge.sent for edge in report.edges.values()} == {61}

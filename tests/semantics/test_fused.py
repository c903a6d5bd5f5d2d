"""Fused regions do what nodes do one by one: the same values, in the same order of all calls, whoever looks (R2, R7).

Regions are fused from the first firing on here. `test_soak_fused.py` compares many more graphs.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import random
import traceback
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.cli.show import user_traceback
from hfg.engine.fusion.region import Region
from hfg.engine.fusion.schedule import Schedule
from hfg.engine.runtime import settings
from hfg.testing import Divergence, recorder, reference_run, replay
from hfg.testing.plans import GraphPlan
from hfg.testing.recording import Recorder
from hfg.testing.reference.machine import Move
from hfg.testing.reference.structure import dissolve
from tests.semantics.calls import Calls, Ran, begun, by_node, note_calls, noted_run, passed_by_trace
from tests.support import kinds as nodes
from tests.support.making import Allowed, random_plan
from tests.support.shrinking import shrink

LEAST_SHARE = 0.25  # of all firings and calls are fused
FOUND = (  # by the soak
    790002898,
    790003574,
    790000602,
    800000506,
    830000987,
    851000626,
    851001881,
    800005253,
    861003293,
    864005430,
    870000569,
    880001756,
    880010934,
    20268269,
    20268692,
    20269223,
    30013297,
    50018949,
    81003362,
)
ORDERS = 50  # of permitted moves, where several would do
MOST_MOVES = 1500
MOST_MOVES_OF_LARGE = 5000
BESIDE_THREADS = Allowed(plain=True, threads=True, lossy=False, gates=False)


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


def plain_shapes(seed: int) -> Allowed:
    """What is fused, and now and then what splits it."""
    return Allowed(plain=True, max_nodes=4 + seed % 9, sending=seed % 2 == 1, strange=seed % 5 == 4)


def large_shapes(seed: int) -> Allowed:
    """Regions of 10 to 60 members, with forks, joins over several levels and several outputs; few things split them."""
    return Allowed(
        plain=True,
        large=True,
        sending=seed % 2 == 1,
        waiting=seed % 3 == 0,
        failures=seed % 4 == 0,
        events=seed % 5 == 4,
        activity=seed % 5 == 4,
        cycles=False,
        gates=False,
        disabling=False,
        readiness=False,
    )


def ends(plan: GraphPlan, seed: int) -> bool:
    """Whether it comes to an end by itself."""
    try:
        most = MOST_MOVES if len(plan.nodes) < 20 else MOST_MOVES_OF_LARGE
        reference_run(plan.build(), seed=seed, max_moves=most)
    except RuntimeError:
        return False
    return True


def coroutine_paths(plan: GraphPlan) -> list[str]:
    """The nodes with async code: where several may wait at a moment their order is left open (R2)."""
    return [leaf.path for leaf in dissolve(plan.build()).leaves if waits(leaf.node)]


def waits(node: hfg.Node) -> bool:
    """Whether some of its code is async."""
    handlers = map(node._handler, node._type.slots)
    return node._type.process_kind.startswith("async") or any(map(inspect.iscoroutinefunction, handlers))


def is_order_open(plan: GraphPlan) -> bool:
    """Whether R2 leaves open which of several may go first."""
    return bool(plan.groups) or len(coroutine_paths(plan)) >= 2


def may_be_late(plan: GraphPlan) -> bool:
    """Whether a coroutine may end before a call disables its node, or not: between firings the loop may turn to it."""
    return any(edge.target[1:] == ("slot", "disable") for edge in plan.edges) and bool(coroutine_paths(plan))


def are_one(plan: GraphPlan, one: Ran, other: Ran, *, any_order: bool = False) -> bool:
    """Whether two runs did the same in the same order.

    Each node by itself where R2 leaves the order open (`any_order`): where two coroutines may wait at a moment, or a
    thread works.
    """
    if one[:3] == other[:3] or not (any_order or is_order_open(plan)):
        return one[:3] == other[:3]
    return (*one[:2], by_node(*one.calls)) == (*other[:2], by_node(*other.calls))


def is_timeless(plan: GraphPlan) -> bool:
    """Whether nothing in it has to do with time, so that it does the same on every clock."""
    timed = {"ascript", "slow_double", "Waiting", "AsyncRelay", "restless", "calling"}
    return (
        not any(
            node.type in timed
            or node.parameters.get("pause") in ("wait", "mixed")
            or {"max_rate_hz", "active_for_s", "group"} & set(node.options)
            or node.options.get("on_error") == "restart"
            for node in plan.nodes
        )
        and not any("through" in edge.options for edge in plan.edges)
        and not plan.gates
    )


def fusing_differs(calls: Calls, plan: GraphPlan, look: int = 0) -> str | None:
    """Interpreted, fused, looked at and watched a graph does the same, call by call, and what the oracle does.

    Args:
      calls: where calls are noted.
      plan: what to run.
      look: who looks at one more fused run: nobody, who measures, or nobody but on the real clock.
    """
    interpreted = noted_run(calls, plan, fast=False)
    fused = noted_run(calls, plan, fast=True)
    if not are_one(plan, fused, interpreted):
        if (is_order_open(plan) or may_be_late(plan)) and oracle_may_do(calls, plan, fused):
            return None
        return f"interpreted: {interpreted}\n  fused: {fused}"
    trace = recorder()
    watched = noted_run(calls, plan, fast=True, trace=trace)
    if not are_one(plan, watched, interpreted):
        return f"not watched: {interpreted}\n  watched: {watched}"
    try:
        replay(plan, trace, until_s=30.0)
    except Divergence as divergence:
        return str(divergence)
    return oracle_differs(plan, watched, calls.take()) or looking_differs(calls, plan, interpreted, trace, look)


def oracle_may_do(calls: Calls, plan: GraphPlan, ran: Ran) -> bool:
    """Whether some order of permitted moves makes the oracle call the same code with the same.

    The order that R2 leaves open may decide what a node sees. The calls of the run say whose turn it was; where they do
    not, chance decides. Each search repeats most of the choices that led furthest.
    """
    on_loop, aside = ran.calls
    best: list[int] = []
    for seed in range(ORDERS):
        order = random.Random(seed)
        search = _Search(calls, on_loop, aside, best[: len(best) - int(order.expovariate(0.2))], order)
        calls.take()
        with contextlib.suppress(RuntimeError):
            reference_run(plan.build(), choose=search.choose, max_moves=MOST_MOVES_OF_LARGE)
        if oracle_differs(plan, ran, calls.take()) is None:
            return True
        best = max(best, search.made[: search.agreed], key=len)
    return False


class _Search:
    """Moves of the oracle that follow the calls of a run.

    Attributes:
      made: the index of each chosen move.
      agreed: how many of them were made while all calls were those of the run.
    """

    def __init__(self, calls: Calls, on_loop: Any, aside: Any, kept: list[int], order: random.Random) -> None:
        self._calls, self._on_loop, self._aside = calls, on_loop, aside
        self._kept, self._order = kept, order
        self._read = 0  # of the calls of the oracle
        self._begun = 0  # of the calls of the run
        self._agrees = True
        self.made: list[int] = []
        self.agreed = 0

    def choose(self, moves: list[Move]) -> Move:
        self._compare()
        if len(self.made) < len(self._kept):
            index = self._kept[len(self.made)]
        else:
            wanted = [(path, _kind_of(what)) for path, what, *_ in self._on_loop[self._begun : self._begun + 1]]
            fitting = [number for number, move in enumerate(moves) if (move.node, move.kind) in wanted]
            index = self._order.choice(fitting or range(len(moves)))
        self.made.append(index)
        return moves[index]

    def _compare(self) -> None:
        for path, what, *_ in self._calls[self._read :]:
            self._read += 1
            if path not in self._aside:
                self._agrees &= (path, what) in [note[:2] for note in self._on_loop[self._begun : self._begun + 1]]
                self._begun += 1
        if self._agrees:
            self.agreed = len(self.made)


def _kind_of(what: str) -> str:
    """The move of the oracle that makes a call of this name begin or end."""
    return "go on" if what.endswith(" ends") else "fire" if what in ("process", "next") else "call"


def oracle_differs(plan: GraphPlan, watched: Ran, oracle: tuple[list[Any], dict[str, list[Any]]]) -> str | None:
    """The oracle has called the same code with the same, in the same order; it begins coroutines late."""
    engine: Any = begun(watched.calls[0])
    reference: Any = begun(oracle[0])
    if watched.calls[1] or coroutine_paths(plan):
        engine, reference = by_node(engine, watched.calls[1]), by_node(reference, oracle[1])
        engine = {path: begun(notes) for path, notes in engine.items()}
        for path in coroutine_paths(plan):
            if watched.report.nodes[path].ended and not watched.error:
                continue  # else the run may have ended amid a firing, which the oracle had not begun
            if engine.get(path, [])[:-1] == reference.get(path, []):
                engine[path] = reference[path] = []
    return None if engine == reference else f"engine: {engine}\n  oracle: {reference}"


def looking_differs(calls: Calls, plan: GraphPlan, interpreted: Ran, trace: Recorder, look: int) -> str | None:
    """Fused with taps, which see what a trace sees, and now and then measured, or on the clock where waves repeat."""
    tapped = noted_run(calls, plan, fast=True, tapped=True)
    passed = {label: tokens for label, tokens in tapped.passed.items() if tokens}
    if not are_one(plan, tapped, interpreted) or passed != passed_by_trace(trace):
        return f"untapped: {interpreted}\n  {passed_by_trace(trace)}\n  tapped: {tapped}"
    match look % 3:
        case 1:
            measured = noted_run(calls, plan, fast=True, measured=True)
            if not are_one(plan, measured, interpreted):
                return f"not measured: {interpreted}\n  measured: {measured}"
        case 2 if is_timeless(plan):
            runs = [noted_run(calls, plan, fast=fast, real=True) for fast in (False, True)]
            if not are_one(plan, *runs, any_order=bool(coroutine_paths(plan))):  # who waits goes on between two slices
                return f"interpreted on the real clock: {runs[0]}\n  fused: {runs[1]}"
    return None


def check(calls: Calls, seed: int, allowed: Allowed) -> None:
    plan = random_plan(seed, allowed)
    if not ends(plan, seed) or fusing_differs(calls, plan, seed) is None:
        return
    small = shrink(plan, lambda smaller: ends(smaller, seed) and fusing_differs(calls, smaller, seed) is not None)
    pytest.fail(f"seed {seed}\n{small}\n\n{fusing_differs(calls, small, seed)}", pytrace=False)


@pytest.mark.rule("F1", "F10", "T5", "X1")
@pytest.mark.parametrize("seed", FOUND)
def test_what_the_soak_has_found_is_one_in_all_runs(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    check(note_calls(monkeypatch), seed, plain_shapes(seed))


@pytest.mark.slow
@pytest.mark.rule("R2", "R7", "F3", "F4", "F5", "T5", "X1")
@pytest.mark.parametrize("block", range(5))
def test_fused_interpreted_and_watched_runs_are_one(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = note_calls(monkeypatch)
    for seed in range(15 * block, 15 * block + 15):
        check(calls, seed, plain_shapes(seed))
    assert calls.share > LEAST_SHARE


@pytest.mark.slow
@pytest.mark.rule("R2", "R7", "F3", "F4", "F5", "T5", "X1")
@pytest.mark.parametrize("block", range(3))
def test_large_regions_and_interpreted_nodes_are_one(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = note_calls(monkeypatch)
    for seed in range(3 * block, 3 * block + 3):
        check(calls, seed, large_shapes(seed))


@pytest.mark.slow
def test_large_shapes_make_large_regions_and_are_interpreted_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []
    begin = Region.__init__

    def noted(region: Region, schedule: Schedule, *others: Any) -> None:
        sizes.append(len(schedule.order))
        begin(region, schedule, *others)

    monkeypatch.setattr(Region, "__init__", noted)
    largest = []
    for seed in range(12):
        sizes.clear()
        with contextlib.suppress(hfg.errors.RunError):
            hfg.run(random_plan(seed, large_shapes(seed)).build(), clock="virtual", until_s=30.0)
        largest.append(max(sizes, default=0))
    assert sum(size >= 10 for size in largest) >= 6, largest
    assert max(largest) >= 40, largest


@pytest.mark.slow
@pytest.mark.rule("R1", "F7")
@pytest.mark.parametrize("seed", range(15))
def test_threads_beside_a_region_change_nothing_of_it(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    check(note_calls(monkeypatch), seed, BESIDE_THREADS)


def fused_order(graph: hfg.Graph, monkeypatch: pytest.MonkeyPatch, clock: Any = "virtual") -> list[str]:
    """In which order nodes were called, which is the same interpreted."""
    calls = note_calls(monkeypatch)
    calls.timed = clock == "virtual"
    orders = []
    for fast in (True, False):
        hfg.run(graph, clock=clock, fast=fast)
        orders.append(calls.take()[0])
    assert orders[0] == orders[1]
    return [note[0] for note in orders[0]]


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


@pytest.mark.rule("R2")
def test_whom_a_buffer_has_enabled_goes_before_the_next_wave_of_a_source_on_the_real_clock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph, calls = hfg.Graph(), note_calls(monkeypatch)
    source, sends = graph.add(nodes.script(values=(1, 2, 3)), name="s"), graph.add(nodes.Sends(), name="n")
    graph.connect(source.out, sends.value, buffer=3)
    hfg.run(graph, clock="real")
    assert [note[0] for note in calls.take()[0]] == ["s", "n", "s", "n", "s", "n", "s"]


@pytest.mark.rule("R7", "F6")
def test_a_wave_that_is_left_behind_a_silent_slot_counts_no_call_for_it_and_loses_none() -> None:
    graph = hfg.Graph()
    source, sends = graph.add(nodes.Script(count=9)), graph.add(nodes.Sends())
    leaves, tally = graph.add(nodes.SpeaksTwice(way="token")), graph.add(nodes.Tally(), name="tally")
    graph.connect(source.out, sends.value)
    graph.connect(sends.rest, leaves.value)
    graph.connect(sends.out, tally.note)
    assert hfg.run(graph, clock="virtual").nodes["tally"].calls == 3


@pytest.mark.rule("F11", "F5", "R5")
def test_no_time_is_waited_for_before_a_source_whose_wave_still_holds_its_output() -> None:
    graph = hfg.Graph()
    source, later = graph.add(nodes.Talks(count=9), max_rate_hz=10), nodes.SpeaksTwiceLater(way="held", pause="turn")
    graph.connect(source.out, graph.add(later).value)
    graph.connect(later.out, graph.add(nodes.add()).a, buffer=1)
    graph.connect(source.out, graph.add(nodes.Speaks(way="seldom")).value)
    with pytest.raises(hfg.errors.Stalled) as caught:
        hfg.run(graph, clock="virtual")
    assert caught.value.report.duration_s == pytest.approx(0.1)  # type: ignore[attr-defined]


@pytest.mark.rule("A4", "A6")
def test_an_explicit_modifier_leaves_with_what_a_member_sends_by_itself() -> None:
    graph = hfg.Graph()
    source, speaks, looks = graph.add(nodes.script(values=(2, 4, 3, 6))), nodes.Speaks(way="given"), nodes.Stateful()
    graph.connect(source.out, graph.add(speaks).value)
    graph.connect(speaks.out, graph.add(looks).value, active=True)
    graph.connect(looks.out, graph.output("active", int))
    assert hfg.run(graph, clock="virtual").outputs["active"] == [0, 0, 1, 1]


@pytest.mark.rule("P6")
def test_an_input_that_a_member_leaves_silent_has_its_default() -> None:
    graph = hfg.Graph()
    source, some, sums = graph.add(nodes.script(values=(1, 2, 3, 4))), nodes.some(), nodes.with_default()
    graph.connect(source.out, graph.add(some).value)
    graph.connect(source.out, graph.add(sums).value)
    graph.connect(some.out, sums.other)
    graph.connect(sums.out, graph.output("sums", int))
    assert hfg.run(graph, clock="virtual").outputs["sums"] == [6, 4, 8, 8]


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


@pytest.mark.rule("F10")
@pytest.mark.parametrize("fast", [False, True])
def test_what_lies_before_a_member_that_a_call_disables_amid_a_wave_is_counted_as_dropped(fast: bool) -> None:
    graph = hfg.Graph("disabled")
    source, last = graph.add(nodes.Script(count=6), name="source"), graph.add(nodes.with_default(), name="last")
    graph.connect(source.out, last.value)
    graph.connect(source.seen, last.disable)
    report = hfg.run(graph, clock="virtual", fast=fast)
    edge = report.edges["source.out -> last.value"]
    assert (edge.sent, edge.dropped) == (2, 1)


@pytest.mark.rule("F1", "F10")
@pytest.mark.parametrize("fast", [False, True])
def test_a_join_behind_a_member_that_a_call_disables_amid_a_wave_goes_on_without_it(fast: bool) -> None:
    graph = hfg.Graph("disabled")
    source, one = graph.add(nodes.Script(count=6), name="source"), graph.add(nodes.add(), name="one")
    last = graph.add(nodes.with_default(), name="last")
    graph.connect(source.out, one.a)
    graph.connect(source.out, one.b)
    graph.connect(source.out, last.value)
    graph.connect(one.out, last.other)
    graph.connect(source.seen, one.disable)
    report = hfg.run(graph, clock="virtual", fast=fast)
    assert report.outcome == "done"
    assert report.nodes["last"].processed == 6


class TellsTwice(hfg.Node):
    """Tells each value twice, and passes it on."""

    value = hfg.Input(int)
    told = hfg.Event(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        self.told.trigger(value)
        self.told.trigger(value)
        return value


@pytest.mark.rule("F8")
@pytest.mark.parametrize("fast", [False, True])
def test_a_full_queue_before_a_region_that_waits_for_its_sender_grows(fast: bool) -> None:
    graph = hfg.Graph()
    tells, pair = graph.add(TellsTwice()), graph.add(nodes.add())
    last = graph.add(nodes.with_default(), name="last")
    first = graph.add(nodes.with_default(), name="first")
    graph.connect(graph.add(nodes.Script(count=6)).out, tells.value)
    graph.connect(tells.told, first.value, capacity=2)
    graph.connect(first.out, last.value)
    graph.connect(last.out, pair.a)
    graph.connect(tells.out, pair.b)
    report = hfg.run(graph, clock="virtual", fast=fast)
    assert (report.outcome, report.nodes["add"].processed) == ("done", 6)

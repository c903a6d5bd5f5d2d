"""Waves of a thread group that run as one job of its thread mean what single firings mean (rules R1, R2, F3, F5)."""

from __future__ import annotations

import asyncio
import threading
from dataclasses import replace
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.base.token import Marker
from hfg.engine.executing.groups import ThreadGroup
from hfg.engine.model import Job
from hfg.engine.runtime import settings
from hfg.testing import ReferenceReport, reference_run
from hfg.testing.plans import GraphPlan
from tests.semantics import meddling
from tests.semantics.meddling import PATIENCE_S, Gate
from tests.semantics.nodes import (
    Ear,
    Keep,
    KeepTokens,
    Total,
    add_optional,
    fail_on,
    forward,
    merge,
    numbers,
    only_odd,
    run,
    scale,
    split,
)
from tests.support.making import SYNCHRONOUS, Allowed, random_plan


@pytest.fixture(autouse=True)
def from_the_first_firing_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


@pytest.fixture
def jobs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The paths of the nodes for which threads were given jobs."""
    given: list[str] = []
    submit = ThreadGroup.submit

    def count(group: ThreadGroup, job: Job) -> None:
        given.append(job.worker.path)
        submit(group, job)

    monkeypatch.setattr(ThreadGroup, "submit", count)
    return given


def work_group() -> hfg.Graph:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    return graph


def chain(graph: hfg.Graph, port: Any, *nodes: Any) -> Any:
    """Connect nodes of the thread group one behind the other, with options if need be; gives back the last output."""
    return meddling.chain(graph, port, *nodes, group="work")


# --- a wave is one job ---


@pytest.mark.rule("R1", "R2")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_a_wave_is_one_job_of_the_thread(clock: Any, jobs: list[str]) -> None:
    graph, sink = work_group(), Keep()
    out = chain(graph, graph.add(numbers(count=50)).out, *((scale(), {"name": f"by{i}"}) for i in range(6)))
    graph.connect(out, graph.add(sink).value)
    report = hfg.run(graph, clock=clock)
    assert sink.values == [64 * value for value in range(1, 51)]
    assert [report.nodes[f"by{i}"].firings for i in range(6)] == [51] * 6  # the last one has ended it
    assert jobs.count("by0") == 50
    assert set(jobs) == {"by0"}


@pytest.mark.rule("F2")
def test_a_source_goes_on_in_its_thread_while_nobody_waits_for_it(jobs: list[str]) -> None:
    graph, total = work_group(), Total()
    source = graph.add(numbers(count=20_000), group="work")
    chain(graph, source.out, scale(factor=3), total)
    report = hfg.run(graph)
    assert total.total == 3 * sum(range(1, 20_001))
    assert report.nodes["scale"].firings == 20_001
    assert len(jobs) < 10_000


@pytest.mark.rule("F11", "R6")
@pytest.mark.parametrize("inside", [False, True])
def test_a_head_with_a_rate_keeps_to_its_grid(inside: bool, jobs: list[str]) -> None:
    def stamps(fast: bool) -> list[float]:
        graph, sink = work_group(), KeepTokens()
        source = graph.add(numbers(count=10), max_rate_hz=4.0, group="work" if inside else None)
        graph.connect(chain(graph, source.out, forward(), scale()), graph.add(sink).value)
        run(graph, fast=fast)
        return [token.stamp for token in sink.tokens]

    assert stamps(fast=True) == [number / 4 for number in range(10)]
    fused = len(jobs)
    assert stamps(fast=False) == [number / 4 for number in range(10)]
    assert fused < len(jobs) - fused


@pytest.mark.rule("T5", "R6")
def test_values_stamps_and_numbers_are_those_of_single_firings() -> None:
    def tokens(fast: bool) -> list[hfg.Token[Any]]:
        graph, sink = work_group(), KeepTokens()
        source = graph.add(numbers(count=20), max_rate_hz=10.0)
        graph.connect(chain(graph, source.out, scale(), (scale(factor=5), {"name": "again"})), graph.add(sink).value)
        run(graph, fast=fast)
        return sink.tokens

    assert tokens(fast=True) == tokens(fast=False)


@pytest.mark.rule("F4", "P6", "T2")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_silence_defaults_and_several_outputs_are_those_of_single_firings(clock: Any) -> None:
    def kept(fast: bool) -> tuple[list[Any], Any, Any]:
        graph, sink, other = work_group(), Keep(), Keep()
        source = graph.add(numbers(count=30))
        parts, odd, both = split(), only_odd(), merge()
        chain(graph, source.out, odd)
        chain(graph, source.out, parts)
        optional = graph.add(add_optional(), group="work")
        graph.add(both, group="work")
        graph.connect(parts.ports.outputs["small"], optional.a)
        graph.connect(odd.out, optional.b)
        graph.connect(optional.out, both.a)
        graph.connect(odd.out, both.b)
        graph.connect(both.out, graph.add(sink).value)
        graph.connect(parts.ports.outputs["big"], graph.add(other, name="other").value)
        report = hfg.run(graph, clock=clock, fast=fast)
        return [sink.values, other.values], report.nodes, {name: edge.sent for name, edge in report.edges.items()}

    assert kept(fast=True) == kept(fast=False)


@pytest.mark.rule("F3")
def test_what_crosses_the_border_leaves_when_its_firing_is_over() -> None:
    """The second member returns only when somebody in another group has seen what the first one has sent."""
    seen = threading.Semaphore(0)

    @hfg.node
    def see(value: int) -> None:
        seen.release()

    @hfg.node
    def wait(value: int) -> int:
        assert seen.acquire(timeout=PATIENCE_S)
        return value

    graph, sink = work_group(), Keep()
    first = forward()
    source = graph.add(numbers(count=5))
    out = chain(graph, source.out, first, wait())
    graph.connect(first.out, graph.add(see()).value)
    graph.connect(out, graph.add(sink).value)
    hfg.run(graph)
    assert sink.values == [1, 2, 3, 4, 5]


class Says(hfg.Node):
    """Signals before it sends."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    said = hfg.Event(int)

    def process(self, value: int) -> None:
        self.said.trigger(value)
        self.out.send(10 * value)


@pytest.mark.rule("F3", "T5", "F8")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_signals_of_members_keep_their_order_and_come_before_the_results(clock: Any, jobs: list[str]) -> None:
    graph, ear, sink, order = work_group(), Ear(), Keep(), list[Any]()
    says = Says()
    out = chain(graph, graph.add(numbers(count=4)).out, forward(), says, (forward(), {"name": "behind"}))
    graph.connect(says.said, graph.add(ear).hear)
    graph.connect(out, graph.add(sink).value)
    says.said.subscribe(lambda value: order.append(value))
    hfg.run(graph, clock=clock)
    assert sink.values == [10, 20, 30, 40]
    assert len(ear.heard) == 4
    assert len(order) == 4
    assert set(jobs) == {"forward"}


# --- what is not plain ---


@pytest.mark.rule("X1")
@pytest.mark.parametrize("policy", ["skip", "disable", "restart"])
@pytest.mark.parametrize("at", [0, 1, 2])
def test_a_failing_member_does_what_it_does_alone(policy: str, at: int) -> None:
    def kept(fast: bool) -> tuple[list[Any], Any, list[str]]:
        graph, sink = work_group(), Keep()
        nodes: list[Any] = [(forward(), {"name": name}) for name in "abc"]
        nodes[at] = (fail_on(bad=3), {"name": "bad", "on_error": policy, "restart_backoff_s": 0.5})
        graph.connect(chain(graph, graph.add(numbers(count=6), max_rate_hz=1.0).out, *nodes), graph.add(sink).value)
        report = run(graph, fast=fast)
        return sink.values, report.nodes, report.errors

    fused, single = kept(fast=True), kept(fast=False)
    assert fused == single
    assert fused[2]


@pytest.mark.rule("X1")
def test_the_error_that_ends_a_run_names_the_member_and_its_firing() -> None:
    graph = work_group()
    chain(graph, graph.add(numbers(count=9)).out, forward(), (fail_on(bad=7), {"name": "bad"}), Keep())
    with pytest.raises(hfg.errors.RunError, match='"bad" failed in firing 7') as failed:
        hfg.run(graph)
    report = failed.value.report  # type: ignore[attr-defined]
    assert report.nodes["forward"].firings == 7
    assert report.nodes["keep"].firings == 6


@pytest.mark.rule("A4", "T5")
def test_a_token_that_is_passed_on_leaves_with_its_own_stamp() -> None:
    @hfg.node
    def back_to_the_beginning(value: int) -> int:
        return hfg.Token(value, 0, 0.25, 0)  # type: ignore[return-value]

    graph, sink = work_group(), KeepTokens()
    source = graph.add(numbers(count=3), max_rate_hz=1.0)
    graph.connect(chain(graph, source.out, forward(), back_to_the_beginning(), scale()), graph.add(sink).value)
    run(graph)
    assert [(token.value, token.stamp) for token in sink.tokens] == [(2, 0.25), (4, 0.25), (6, 0.25)]


@pytest.mark.rule("X1")
def test_a_coroutine_that_a_member_gives_back_is_refused_with_the_remedy() -> None:
    async def later() -> int:
        return 1

    @hfg.node
    def wrong(value: int) -> int:
        return later()  # type: ignore[return-value]

    graph = work_group()
    chain(graph, graph.add(numbers(count=3)).out, forward(), wrong(), Keep())
    with pytest.raises(hfg.errors.RunError, match="async code runs on the loop"):
        run(graph)


@pytest.mark.rule("F4", "F12")
def test_members_end_behind_the_last_wave_and_write_there() -> None:
    graph, total, sink = work_group(), Total(), Keep()
    out = chain(graph, graph.add(numbers(count=4), group="work").out, forward(), scale())
    graph.connect(out, graph.add(total, group="work").value)
    graph.connect(out, graph.add(sink).value)
    report = run(graph)
    assert report.outcome == "done"
    assert sink.values == [2, 4, 6, 8]
    assert total.total == 20


@pytest.mark.rule("R7")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_statistics_measure_every_member_and_count_exactly(clock: Any) -> None:
    async def main() -> hfg.Report:
        graph = work_group()
        chain(graph, graph.add(numbers(count=300)).out, forward(), only_odd(), scale(), Keep())
        async with hfg.running(graph) as live:
            live.statistics()
            await live.wait_finished()
            found = live.statistics()
            assert [found.nodes[name].firings for name in ("forward", "only_odd", "scale", "keep")] == [301] * 4
            assert [found.nodes[name].silent for name in ("forward", "only_odd", "scale", "keep")] == [0, 0, 150, 150]
            assert all(found.nodes[name].busy.count for name in ("forward", "only_odd", "scale", "keep"))
            assert found.groups["work"].busy_s > 0
        return live.report()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop if clock == "virtual" else None) as runner:
        assert runner.run(main()).outcome == "done"


# --- who meddles with a wave under way ---


@pytest.mark.rule("R4")
def test_an_edit_waits_for_one_call_of_the_wave_and_not_for_all_of_it() -> None:
    async def main() -> None:
        gate = Gate()
        graph, sink = gate.graph()
        async with hfg.running(graph) as live:
            await gate.until_inside()
            edit = asyncio.create_task(live.edit(c.Remove("scale")))
            await asyncio.sleep(0)
            assert not edit.done()
            gate.go_on()
            await edit
            await live.wait_finished()
        assert sink.values == [10, 20]

    Gate.run(main())


@pytest.mark.rule("X3")
def test_a_member_that_does_not_come_back_is_named_and_the_others_are_torn_down() -> None:
    class Last(hfg.Node):
        value = hfg.Input(int)
        gone = hfg.State(False)

        def process(self, value: int) -> None:
            pass

        def teardown(self) -> None:
            self.gone = True

    last, gate = Last(), Gate()

    async def main() -> None:
        graph = work_group()
        chain(graph, graph.add(numbers(count=6)).out, forward(), gate.node(), last)
        async with hfg.running(graph) as live:
            live._engine.settings.teardown_limit_s = 0.05
            await gate.until_inside()
            live.stop()

    try:
        with pytest.raises(hfg.errors.RunError, match='"stops" failed in firing 3: its thread did not come back'):
            Gate.run(main())
    finally:
        gate.go_on()
    assert last.gone


class Shy(hfg.Node):
    """Says whether it is active; sends activity on."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    seen = hfg.State(factory=list)

    def process(self, value: int) -> int:
        self.seen.append(self.active)
        return value


@pytest.mark.rule("A3", "A7", "R6")
def test_a_member_that_becomes_active_takes_part_in_no_fused_wave() -> None:
    def seen(fast: bool) -> tuple[list[bool], list[int], list[bool]]:
        graph, sink, shy = work_group(), KeepTokens(), Shy()
        source = graph.add(numbers(count=8), max_rate_hz=1.0)
        ring = graph.add(numbers(count=2), name="ring", max_rate_hz=0.3)
        out = chain(graph, source.out, forward(), shy)
        graph.connect(out, graph.add(sink).value, active=True)
        graph.connect(ring.out, shy.ports.slots["activate"])
        run(graph, fast=fast)
        return shy.seen, [token.activity for token in sink.tokens], []

    assert seen(fast=True) == seen(fast=False)
    assert 1 in seen(fast=True)[1]


# --- random graphs ---


_ON_THE_LOOP = ("ascript", "slow_double", "Waiting", "AsyncRelay")


def in_threads(plan: GraphPlan, seed: int) -> GraphPlan:
    """The same graph with most nodes in one thread group, and some in another."""
    nodes = []
    for index, node in enumerate(plan.nodes):
        options = dict(node.options)
        if node.type not in _ON_THE_LOOP and (seed + index) % 4:
            options["group"] = "side" if (seed // 4 + index) % 5 else "other"
        nodes.append(replace(node, options=options))
    return replace(plan, nodes=tuple(nodes), groups=("side", "other"))


def oracle(plan: GraphPlan, seed: int) -> ReferenceReport | None:
    try:
        return reference_run(plan.build(), seed=seed, max_moves=1500)
    except RuntimeError:
        return None  # it goes round and round


class Recorder(hfg.Node):
    """Keeps what it gets, markers left out."""

    value = hfg.Input(Any)

    kept = hfg.State(factory=list)

    def process(self, value: Any) -> None:
        self.kept.append(value)


@pytest.mark.slow
@pytest.mark.rule("F7", "R2")
@pytest.mark.parametrize("clock", ["virtual", "real"])
@pytest.mark.parametrize("block", range(3))
def test_random_graphs_in_threads_send_what_the_oracle_sends(clock: Any, block: int) -> None:
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, replace(SYNCHRONOUS, rates=False, waiting=False, boxes=False))
        wanted = oracle(plan, seed)
        if wanted is None:
            continue
        graph = in_threads(plan, seed).build()
        recorders: dict[str, Recorder] = {}
        for edge in list(graph.edges):
            if edge.source.name in edge.source.node.ports.outputs:
                recorder = recorders[f"{edge.source.path} -> {edge.target.path}"] = graph.add(
                    Recorder(), name=f"recorder{len(recorders)}"
                )
                graph.connect(edge.source, recorder.value)
        try:
            hfg.run(graph, clock=clock)
        except hfg.errors.RunError:
            assert wanted.outcome != "done", plan
        for label, recorder in recorders.items():
            sequence = [token.value for token in wanted.tokens.get(label, ()) if type(token.value) is not Marker]
            kept = recorder.kept[: len(sequence)]  # a source that R5 gives up goes on here, where somebody listens
            assert kept == sequence[: len(kept)], f"{label}, schedule {seed} of\n{plan}"
            assert wanted.outcome != "done" or len(kept) == len(sequence), f"{label}, schedule {seed} of\n{plan}"


@pytest.mark.slow
@pytest.mark.rule("R6", "F7")
@pytest.mark.parametrize("block", range(3))
def test_random_graphs_in_threads_do_the_same_each_time_in_virtual_time(block: int) -> None:
    def done(plan: GraphPlan) -> hfg.Report | str:
        try:
            return hfg.run(plan.build(), clock="virtual", until_s=30.0)
        except hfg.errors.RunError as error:
            return error.report  # type: ignore[attr-defined, no-any-return]

    for seed in range(25 * block, 25 * block + 25):
        plan = in_threads(random_plan(seed, Allowed(lossy=False, gates=False)), seed)
        if oracle(plan, seed) is not None:
            assert done(plan) == done(plan), plan

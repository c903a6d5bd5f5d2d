"""What becomes of failures (rule X1)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.trace import ErrorRaised
from tests.semantics.nodes import (
    Ear,
    Keep,
    Ringing,
    fail_on,
    numbers,
    of_kind,
    run,
    traced,
)

# --- X1 ---


def failing(on_error: str, **options: Any) -> tuple[hfg.Graph, Keep, Ear]:
    graph = hfg.Graph()
    source = graph.add(numbers(count=4))
    node, sink, ear = graph.add(fail_on(bad=2), on_error=on_error, **options), graph.add(Keep()), graph.add(Ear())  # type: ignore[arg-type]
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    graph.connect(node.failed, ear.hear)
    return graph, sink, ear


@pytest.mark.rule("X1")
def test_stop_raises_an_error_that_names_path_firing_and_cause_and_delivers_no_failed(fast: bool) -> None:
    graph, sink, ear = failing("stop")
    with pytest.raises(hfg.errors.NodeError, match=r'^node "fail_on" failed in firing 2: ValueError: no 2$') as raised:
        run(graph, fast)
    error = raised.value
    assert (error.path, error.what) == ("fail_on", "firing 2")
    assert isinstance(error.__cause__, ValueError)
    assert error.report.outcome == "failed"  # type: ignore[attr-defined]
    assert (sink.values, ear.heard) == ([1], [])


@pytest.mark.rule("X1", "R7")
def test_a_failure_is_traced_with_what_is_done_about_it() -> None:
    graph, _, _ = failing("skip")
    error = of_kind(traced(graph), ErrorRaised)
    assert [(event.node, event.what, event.error, event.policy) for event in error] == [
        ("fail_on", "firing 2", "ValueError: no 2", "skip")
    ]


@pytest.mark.rule("X1", "A9")
def test_skip_answers_silence_counts_and_triggers_failed(fast: bool) -> None:
    graph, sink, ear = failing("skip")
    report = run(graph, fast)
    assert sink.values == [1, 3, 4]
    assert report.nodes["fail_on"].failed == 1
    assert report.errors == ['node "fail_on" failed in firing 2: ValueError: no 2']
    [failure] = ear.heard
    assert isinstance(failure, hfg.Failure)
    assert (failure.error.path, failure.error.what, failure.taken) == ("fail_on", "firing 2", {"value": 2})
    assert isinstance(failure.error.__cause__, ValueError)
    assert report.nodes["keep"].silent == 1


@pytest.mark.rule("X1", "F10")
def test_disable_takes_the_node_out_and_lets_the_others_go_on(fast: bool) -> None:
    graph, sink, ear = failing("disable")
    other = graph.add(Keep(), name="other")
    graph.connect(graph["numbers"].out, other.value)
    report = run(graph, fast)
    assert sink.values == [1]
    assert other.values == [1, 2, 3, 4]
    assert len(ear.heard) == 1
    assert report.outcome == "done"


class Restarts(hfg.Node):
    """Fails for some values; writes down its life."""

    bad = hfg.Parameter((2,), type=tuple[int, ...])
    value = hfg.Input(int)
    out = hfg.Output(int)
    since = hfg.State(0)
    story: list[Any] = []  # noqa: RUF012 - over setups

    def setup(self) -> None:
        self.story.append(("setup", hfg.now()))

    def teardown(self) -> None:
        self.story.append(("teardown", hfg.now()))

    def process(self, value: int) -> int:
        self.since += 1
        if value in self.bad:
            raise ValueError(f"no {value}")
        return value


@pytest.mark.rule("X1")
def test_restart_tears_down_waits_sets_up_and_does_not_repeat_the_failed_firing(fast: bool) -> None:
    Restarts.story.clear()
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=5)), graph.add(Restarts(bad=(2, 3)), on_error="restart", restart_backoff_s=1)
    sink = graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [1, 4, 5]
    assert report.nodes["restarts"].restarts == 2
    assert Restarts.story == [
        ("setup", 0),
        ("teardown", 0),
        ("setup", 1),
        ("teardown", 1),
        ("setup", 3),  # twice as long
        ("teardown", 3),
    ]


@pytest.mark.rule("X1")
def test_restarts_have_a_limit(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=5))
    node = graph.add(Restarts(bad=(1, 2, 3, 4, 5)), on_error="restart", restart_limit=2)
    graph.connect(source.out, node.value)
    with pytest.raises(hfg.errors.NodeError, match=r'node "restarts" failed in firing 3'):
        run(graph, fast)


class Fragile(hfg.Node):
    """A source whose generator fails at its third value, once."""

    failed_once: list[bool] = []  # noqa: RUF012 - over restarts

    def process(self) -> Iterator[int]:
        yield 1
        yield 2
        if not self.failed_once:
            self.failed_once.append(True)
            raise ValueError("third")
        yield 3


@pytest.mark.rule("X1")
def test_a_restarted_generator_begins_anew(fast: bool) -> None:
    Fragile.failed_once.clear()
    graph = hfg.Graph()
    source, sink = graph.add(Fragile(), on_error="restart"), graph.add(Keep())
    graph.connect(source.ports.outputs["out"], sink.value)
    run(graph, fast)
    assert sink.values == [1, 2, 1, 2, 3]


@pytest.mark.rule("X1")
def test_a_generator_that_failed_and_is_skipped_is_over_so_its_node_ends(fast: bool) -> None:
    Fragile.failed_once.clear()
    graph = hfg.Graph()
    source, sink = graph.add(Fragile(), on_error="skip"), graph.add(Keep())
    graph.connect(source.ports.outputs["out"], sink.value)
    report = run(graph, fast)
    assert sink.values == [1, 2]
    assert report.nodes["fragile"].ended


class FailingSlot(hfg.Node):
    heard = hfg.State(factory=list)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.heard.append(value)
        if value == 2:
            raise ValueError("no 2")


@pytest.mark.rule("X1")
@pytest.mark.parametrize("edge", ["signal", "output"])
def test_a_failed_slot_call_is_only_counted(edge: str, fast: bool) -> None:
    graph = hfg.Graph()
    node = graph.add(FailingSlot(), on_error="skip")
    if edge == "signal":
        graph.connect(graph.add(Ringing(count=3)).rang, node.hear)
    else:
        graph.connect(graph.add(numbers(count=3)).out, node.hear)
    report = run(graph, fast)
    assert node.heard == [1, 2, 3]
    assert report.nodes["failing_slot"].failed == 1
    assert report.errors == ['node "failing_slot" failed in slot hear, call 2: ValueError: no 2']


@pytest.mark.rule("X1")
def test_a_failed_slot_call_stops_the_run_by_default(fast: bool) -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(Ringing(count=3)).rang, graph.add(FailingSlot()).hear)
    with pytest.raises(
        hfg.errors.NodeError, match=r'node "failing_slot" failed in slot hear, call 2: ValueError: no 2'
    ):
        run(graph, fast)


@pytest.mark.rule("X1", "A8")
def test_a_failed_firing_keeps_the_activity_it_was_given(fast: bool) -> None:
    graph, _, _ = failing("skip")
    graph.start.activates(graph["fail_on"].activate)
    assert run(graph, fast).nodes["fail_on"].active


@pytest.mark.rule("X1")
def test_an_error_in_end_and_ready_follows_the_policy_too(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=1)), graph.add(FailsAtEnd(), on_error="skip"), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert report.errors == ['node "fails_at_end" failed in end(): ValueError: end']
    assert report.nodes["keep"].ended


class FailsAtEnd(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value

    def end(self) -> None:
        self.out.send(1)
        raise ValueError("end")


class Stranger(BaseException):
    """No error, and nothing that Python knows."""


class Leaves(hfg.Node):
    """Raises what is no error, in one of its hooks."""

    where = hfg.Parameter("")
    problem = hfg.Parameter[type[BaseException]](SystemExit)

    def fail(self, where: str) -> None:
        if where == self.where:
            raise self.problem

    def process(self, value: int) -> None:
        self.fail("process")

    def ready(self) -> bool:
        self.fail("ready")
        return True

    def end(self) -> None:
        self.fail("end")

    def on_activated(self) -> None:
        self.fail("on_activated")

    @hfg.slot
    def hear(self, value: object) -> None:
        self.fail("hear")


class LeavesLater(Leaves):
    """The same after a pause."""

    async def process(self, value: int) -> None:  # type: ignore[override]
        await asyncio.sleep(0)
        self.fail("process")

    async def ready(self) -> bool:  # type: ignore[override]
        await asyncio.sleep(0)
        self.fail("ready")
        return True

    async def end(self) -> None:  # type: ignore[override]
        await asyncio.sleep(0)
        self.fail("end")

    async def on_activated(self) -> None:  # type: ignore[override]
        await asyncio.sleep(0)
        self.fail("on_activated")

    @hfg.slot
    async def hear(self, value: object) -> None:
        await asyncio.sleep(0)
        self.fail("hear")


@pytest.mark.rule("X1")
@pytest.mark.parametrize("on_error", ["skip", "disable", "restart"])
@pytest.mark.parametrize("problem", [SystemExit, asyncio.CancelledError, GeneratorExit, Stranger])
@pytest.mark.parametrize("where", ["process", "ready", "end", "on_activated", "hear"])
@pytest.mark.parametrize(("kind", "group"), [(Leaves, "loop"), (Leaves, "work"), (LeavesLater, "loop")])
def test_no_policy_gets_over_what_is_no_error(
    kind: type[Leaves], group: str, where: str, problem: type[BaseException], on_error: Any
) -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    node = graph.add(kind(where=where, problem=problem), name="node", group=group, on_error=on_error)
    graph.connect(graph.add(numbers()).out, node.ports.inputs["value"])
    graph.start.activates(node.hear)
    with pytest.raises(hfg.errors.NodeError, match='^node "node" failed in ') as raised:
        run(graph)
    assert isinstance(raised.value.__cause__, problem)

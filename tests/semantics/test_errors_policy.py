"""What becomes of failures, time limits and shutting down (rules X1-X3)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg import NO_MESSAGE
from hfg.trace import ErrorRaised, FiringEnded
from tests.semantics.nodes import (
    Ear,
    Keep,
    KeepTokens,
    Ringing,
    drive,
    fail_on,
    forward,
    numbers,
    of_kind,
    run,
    sent,
    slow_numbers,
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
    assert [type(error) for error in ear.heard] == [hfg.errors.NodeError]
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
    graph.connect(source.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 2, 1, 2, 3]


@pytest.mark.rule("X1")
def test_a_generator_that_failed_and_is_skipped_is_over_so_its_node_ends(fast: bool) -> None:
    Fragile.failed_once.clear()
    graph = hfg.Graph()
    source, sink = graph.add(Fragile(), on_error="skip"), graph.add(Keep())
    graph.connect(source.out, sink.value)
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


# --- X2 ---


@hfg.node
async def slow_on(value: int, *, bad: int = 2) -> int:
    """Waits for a hundred seconds for one value."""
    await asyncio.sleep(100 if value == bad else 1)
    return value


@pytest.mark.rule("X2")
def test_an_async_firing_over_its_time_is_cancelled(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(numbers(count=3)), graph.add(Keep())
    node = graph.add(slow_on(), max_duration_s=5, on_error="skip")
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [1, 3]
    assert report.duration_s == 7
    assert report.errors == [
        'node "slow_on" failed in firing 2: it took longer than max_duration_s = 5 s and was given up'
    ]


@pytest.mark.rule("X2", "X1")
def test_a_firing_over_its_time_is_a_firing_timeout(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=3)), graph.add(slow_on(), max_duration_s=5)
    graph.connect(source.out, node.value)
    with pytest.raises(hfg.errors.FiringTimeout, match='node "slow_on" failed in firing 2'):
        run(graph, fast)


class Stubborn(hfg.Node):
    """Catches its cancellation and goes on for a while; its late result must not be heard."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    late = hfg.State(factory=list)

    async def process(self, value: int) -> int:
        if value == 2:
            try:
                await asyncio.sleep(100)
            except asyncio.CancelledError:
                await asyncio.sleep(3)
                self.late.append(hfg.now())
                return 99
        return value


@pytest.mark.rule("X2")
def test_the_late_result_of_a_firing_that_resists_is_ignored(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(slow_numbers(count=6)), graph.add(Keep())
    node = graph.add(Stubborn(), max_duration_s=2, on_error="skip")
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 3, 4, 5, 6]


class Held(hfg.Node):
    """Blocks its thread at the second value until the test lets it go."""

    value = hfg.Input(int)
    out = hfg.Output(object)
    gate = threading.Event()

    def process(self, value: int) -> tuple[int, str]:
        if value == 2:
            self.gate.wait(5)
        return value, threading.current_thread().name


@pytest.mark.rule("X2")
def test_a_threaded_firing_over_its_time_is_abandoned_and_the_group_goes_on_in_a_new_thread() -> None:
    Held.gate.clear()
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, sink = graph.add(numbers(count=3)), graph.add(Keep())
    node = graph.add(Held(), group="work", max_duration_s=0.05, on_error="skip")
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    try:
        report = hfg.run(graph)
    finally:
        Held.gate.set()
    assert [value for value, _ in sink.values] == [1, 3]
    assert report.nodes["held"].failed == 1


@pytest.mark.rule("X2", "R7")
def test_a_firing_that_was_given_up_is_traced_as_failed() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(slow_on(), max_duration_s=5, on_error="skip")
    graph.connect(source.out, node.value)
    trace = traced(graph)
    outcomes = [event.outcome for event in of_kind(trace, FiringEnded) if event.node == "slow_on"]
    assert outcomes == ["done", "failed", "ended"]


@pytest.mark.rule("X2", "X1")
def test_a_firing_that_was_given_up_answers_silence() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(slow_on(), max_duration_s=5, on_error="skip")
    sink = graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    assert sent(traced(graph), "slow_on.out -> keep.value") == [1, NO_MESSAGE, hfg.END]


# --- X3 ---


class Life(hfg.Node):
    """Writes down when it is set up and torn down."""

    mark = hfg.Parameter("")
    fails = hfg.Parameter("")
    story: list[str] = []  # noqa: RUF012 - of all

    async def setup(self) -> None:
        self.story.append(f"+{self.mark}")
        if self.fails == "setup":
            raise ValueError("setup")

    async def teardown(self) -> None:
        self.story.append(f"-{self.mark}")
        if self.fails == "teardown":
            raise ValueError(self.mark)
        if self.fails == "hang":
            await asyncio.sleep(1000)

    @hfg.slot
    def hear(self) -> None:
        pass


def lives(*fails: str) -> hfg.Graph:
    Life.story.clear()
    graph = hfg.Graph()
    for mark, kind in zip("abcd", fails, strict=False):
        graph.add(Life(mark=mark, fails=kind), name=mark)
    return graph


@pytest.mark.rule("X3")
def test_nodes_are_torn_down_in_reverse_order_of_their_setup(fast: bool) -> None:
    run(lives("", "", ""), fast)
    assert Life.story == ["+a", "+b", "+c", "-c", "-b", "-a"]


@pytest.mark.rule("X3", "X1")
def test_after_a_failing_setup_those_set_up_are_torn_down_and_no_source_has_fired(fast: bool) -> None:
    graph = lives("", "setup", "")
    source, sink = graph.add(numbers()), graph.add(Keep())
    graph.connect(source.out, sink.value)
    with pytest.raises(hfg.errors.NodeError, match=r'node "b" failed in setup\(\): ValueError: setup'):
        run(graph, fast)
    assert Life.story == ["+a", "+b", "-b", "-a"]
    assert getattr(sink, "values", []) == []


@pytest.mark.rule("X3")
def test_errors_of_teardown_are_collected(fast: bool) -> None:
    graph = lives("teardown", "", "teardown")
    with pytest.raises(hfg.errors.TeardownError) as raised:
        run(graph, fast)
    assert [error.path for error in raised.value.errors] == ["c", "a"]
    assert Life.story == ["+a", "+b", "+c", "-c", "-b", "-a"]


@pytest.mark.rule("X3")
def test_errors_of_teardown_do_not_hide_the_first_failure(fast: bool) -> None:
    graph = lives("teardown")
    source, node = graph.add(numbers(count=1)), graph.add(fail_on(bad=1))
    graph.connect(source.out, node.value)
    with pytest.raises(hfg.errors.NodeError, match="fail_on") as raised:
        run(graph, fast)
    assert any('"a" failed in teardown()' in one for one in raised.value.report.errors)  # type: ignore[attr-defined]


@pytest.mark.rule("X3")
def test_a_teardown_that_does_not_return_is_given_up(fast: bool) -> None:
    graph = lives("", "hang", "")
    with pytest.raises(hfg.errors.TeardownError, match=r'node "b" failed in teardown\(\): it took longer than 5 s'):
        run(graph, fast)
    assert Life.story == ["+a", "+b", "+c", "-c", "-b", "-a"]


class Unending(hfg.Node):
    """Waits for ever and says when it is cancelled."""

    story = hfg.State(factory=list)

    async def process(self) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            self.story.append("cancelled")


@pytest.mark.rule("X3")
def test_async_code_under_way_is_cancelled_when_the_run_is_left(fast: bool) -> None:
    async def main() -> list[str]:
        graph = hfg.Graph()
        node = graph.add(Unending())
        async with hfg.running(graph, fast=fast):
            await asyncio.sleep(1)
        return node.story

    assert drive(main) == ["cancelled"]


@pytest.mark.rule("X3", "F2")
def test_generators_are_closed(fast: bool) -> None:
    closed: list[str] = []
    Closes.closed = closed
    graph = hfg.Graph()
    source, node, sink = graph.add(Closes()), graph.add(forward()), graph.add(KeepTokens())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    other = graph.add(fail_on(bad=2))
    graph.connect(source.out, other.value)
    with pytest.raises(hfg.errors.NodeError):
        run(graph, fast)
    assert closed == ["closed"]


class Closes(hfg.Node):
    closed: list[str] = []  # noqa: RUF012 - replaced by the test

    def process(self) -> Iterator[int]:
        try:
            yield 1
            yield 2
            yield 3
        finally:
            self.closed.append("closed")

"""Activity that comes back, automatic ports, start and reset (rules A8-A10, A14)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg.trace import EventTriggered, RunStarted, TokenSent
from tests.semantics.nodes import (
    Countdown,
    Ear,
    Keep,
    KeepsModifiers,
    KeepTokens,
    Pair,
    Runner,
    drive,
    fail_on,
    forward,
    gaps,
    numbers,
    of_kind,
    run,
    traced,
)

# --- A8 ---


@pytest.mark.rule("A8")
def test_an_active_edge_that_is_not_live_transfers_nothing(fast: bool) -> None:
    graph = hfg.Graph()
    node, off = graph.add(Runner()), graph.add(Keep(), enabled=False)
    source = graph.add(numbers(count=2))
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.out, off.value, active=True)
    report = run(graph, fast)
    assert report.nodes["runner"].active
    assert node.seen == [True, True]


@pytest.mark.rule("A8", "F10")
def test_a_discarded_plus_gives_the_activity_back_to_its_sender(fast: bool) -> None:
    async def main() -> list[list[str]]:
        graph = hfg.Graph()
        node, busy = graph.add(Ear()), graph.add(Pair())
        graph.connect(node.passed, busy.a, active=True)
        graph.start.activates(node.begin)
        never = graph.add(Ear(), name="never")
        graph.connect(never.passed, busy.b)
        story = []
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            story.append(run.active())
            await run.trigger(node.hear, 1)
            await run.wait_quiet()
            story.append(run.active())
            await run.trigger(busy.disable)
            await run.wait_quiet()
            story.append(run.active())
        return story

    assert drive(main) == [["ear"], [], ["ear"]]


@pytest.mark.rule("A8")
def test_activity_that_nobody_can_have_back_is_counted_as_lost(fast: bool) -> None:
    async def main() -> int:
        graph = hfg.Graph()
        node = graph.add(Pair())
        graph.connect(graph.start, node.a, active=True)  # from the graph itself, which is no node
        graph.connect(graph.add(Ear()).passed, node.b)
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            await run.trigger(node.disable)
            await run.wait_quiet()
            return run.statistics().lost_activity

    assert drive(main) == 1


@pytest.mark.rule("A8", "X1")
def test_errors_do_not_change_activity(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = (
        graph.add(numbers(count=3)),
        graph.add(fail_on(bad=2), on_error="skip"),
        graph.add(KeepTokens()),
    )
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    graph.start.activates(node.activate)
    report = run(graph, fast)
    assert report.nodes["fail_on"].active


# --- A9 ---


@pytest.mark.rule("A9")
def test_processed_follows_the_outputs_as_a_sending_of_its_own() -> None:
    graph = hfg.Graph()
    source, node, sink, ear = graph.add(gaps(count=3)), graph.add(forward()), graph.add(Keep()), graph.add(Ear())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    graph.connect(node.processed, ear.hear)
    trace = traced(graph)
    order = [event.edge.split(" ")[0] for event in of_kind(trace, TokenSent) if event.edge.startswith("forward")]
    # not behind the silent firing and not behind the end
    assert order == [
        "forward.out",
        "forward.processed",
        "forward.out",
        "forward.out",
        "forward.processed",
        "forward.out",
    ]


@pytest.mark.rule("A9")
@pytest.mark.parametrize(("output_active", "carried"), [(True, [0, 0]), (False, [1, 0])])
def test_processed_carries_activity_only_if_the_outputs_did_not(
    output_active: bool, carried: list[int], fast: bool
) -> None:
    graph = hfg.Graph()
    source, node = graph.add(ones()), graph.add(Runner())
    sink, ear = graph.add(KeepTokens()), graph.add(KeepsModifiers())
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.out, sink.value, active=output_active)
    graph.connect(node.processed, ear.hear, active=True)
    run(graph, fast)
    assert ear.seen == carried


class ones(hfg.Node):  # noqa: N801 - reads like the other sources
    """1, twice."""

    out = hfg.Output(int)
    left = hfg.State(2)

    def process(self) -> int:
        if not self.left:
            raise hfg.EndOfStream
        self.left -= 1
        return 1


@pytest.mark.rule("A9")
def test_activated_and_deactivated_follow_each_change(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=2)), graph.add(Runner()), graph.add(Keep())
    up, down = graph.add(Ear(), name="up"), graph.add(Ear(), name="down")
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.out, sink.value, active=True)
    graph.connect(node.activated, up.hear)
    graph.connect(node.deactivated, down.hear)
    run(graph, fast)
    assert (up.heard, down.heard) == ([None], [None])


@pytest.mark.rule("A9")
def test_activity_may_leave_at_once_by_activated(fast: bool) -> None:
    graph = hfg.Graph()
    node, ear = graph.add(Runner()), graph.add(Ear())
    graph.start.activates(node.begin)
    graph.connect(node.activated, ear.hear, active=True)
    report = run(graph, fast)
    assert (report.nodes["runner"].active, report.nodes["ear"].active) == (False, True)


class HooksOfActivity(hfg.Node):
    """Writes down its hooks of activity."""

    story = hfg.State(factory=list)

    def on_activated(self) -> None:
        self.story.append("activated")

    async def on_deactivated(self) -> None:
        await asyncio.sleep(1)
        self.story.append("deactivated")


@pytest.mark.rule("A9")
def test_the_hooks_of_activity_are_called(fast: bool) -> None:
    graph = hfg.Graph()
    node, rings = graph.add(HooksOfActivity()), graph.add(Countdown(count=1))
    graph.start.activates(node.activate)
    graph.connect(rings.out, node.deactivate)
    run(graph, fast)
    assert node.story == ["activated", "deactivated"]


# --- A10, A14 ---


@pytest.mark.rule("A10")
def test_start_comes_when_all_is_set_up_and_before_any_source(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=1)), graph.add(Runner())
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    trace = traced(graph)
    kinds = [type(event).__name__ for event in trace]
    assert kinds[:3] == ["RunStarted", "EventTriggered", "TokenSent"]
    assert isinstance(trace[0], RunStarted)
    assert [event.event for event in of_kind(trace, EventTriggered)] == ["start"]
    assert node.seen == [True]


@pytest.mark.rule("A14")
def test_reset_of_activity_takes_all_away_and_starts_again(fast: bool) -> None:
    async def main() -> tuple[list[list[str]], list[object]]:
        graph = hfg.Graph()
        first, second = graph.add(Ear(), name="first"), graph.add(Ear(), name="second")
        waiting = graph.add(Pair())
        graph.start.activates(first.begin)
        graph.connect(first.passed, second.hear, active=True)
        graph.connect(second.passed, waiting.a, active=True)
        graph.connect(graph.add(Ear(), name="never").passed, waiting.b)
        story = []
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            story.append(run.active())
            await run.trigger(first.hear, 1)
            await run.wait_quiet()
            story.append(run.active())  # under way on the edge into `waiting`
            run.reset_activity()
            await run.wait_quiet()
            story.append(run.active())
        return story, [first.begun]

    assert drive(main) == ([["first"], [], ["first"]], [2])


@pytest.mark.rule("A14")
def test_reset_takes_modifiers_off_the_tokens_under_way(fast: bool) -> None:
    async def main() -> list[bool]:
        graph = hfg.Graph()
        first, pair = graph.add(Ear(), name="first"), graph.add(Pair())
        other = graph.add(Ear(), name="other")
        graph.start.activates(other.begin)
        graph.connect(first.passed, pair.a, active=True)
        graph.connect(other.passed, pair.b)
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(first.passed, 1, activity=1)
            await run.wait_quiet()
            run.reset_activity()
            await run.trigger(other.passed, 1)
            await run.wait_quiet()
            return pair.seen

    assert drive(main) == [False]

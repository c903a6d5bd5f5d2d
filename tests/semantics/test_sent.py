"""The event `sent` beside each output, where asynchronous and lossy edges begin (rules A9, T5, F8, P5, P8)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest
import reactivex.operators as ops

import hfg
from hfg.engine.model.running_node import RunningNode
from hfg.testing import recorder, reference_run, replay
from hfg.trace import EventTriggered, TokenSent
from tests.semantics.nodes import (
    Countdown,
    Ear,
    Fork,
    Halves,
    Keep,
    KeepTokens,
    Send,
    Total,
    activity,
    add_optional,
    drive,
    fail_on,
    forward,
    forward_async,
    gaps,
    modifiers,
    numbers,
    of_kind,
    run,
    scale,
    sent,
    slow_numbers,
    split,
    tokens,
    traced,
)


def heard(graph: hfg.Graph, *outputs: hfg.ports.OutputPort[Any]) -> Ear:
    ear = graph.add(Ear(), name="ear")
    for output in outputs:
        graph.connect(output.sent, ear.hear)
    return ear


def explained(graph: hfg.Graph, **options: Any) -> list[Any]:
    """Run a graph, have the oracle explain every event of it, and give the trace."""
    trace = recorder()
    run(graph, trace=trace, **options)
    replay(graph, trace)
    return list(trace)


# --- what it tells ---


@pytest.mark.rule("A9", "T2", "T3", "T4")
def test_it_tells_each_value_but_neither_silence_nor_the_end(fast: bool) -> None:
    graph = hfg.Graph()
    ear = heard(graph, graph.add(gaps()).out)
    assert run(graph, fast).outcome == "done"
    assert ear.heard == [1, 3]


@pytest.mark.rule("A9", "F4")
def test_what_end_sends_is_told_too_and_processed_is_not(fast: bool) -> None:
    graph = hfg.Graph()
    total = graph.add(Total())
    graph.connect(graph.add(numbers()).out, total.value)
    ear = heard(graph, total.out)
    graph.connect(total.processed, ear.begin)
    run(graph, fast)
    assert (ear.heard, ear.begun) == ([6], 3)


@pytest.mark.rule("A9", "X1", "F3")
def test_a_failed_firing_has_sent_nothing(fast: bool) -> None:
    graph = hfg.Graph()
    node = graph.add(fail_on(), on_error="skip")
    graph.connect(graph.add(numbers()).out, node.value)
    ear = heard(graph, node.out)
    run(graph, fast)
    assert ear.heard == [1, 3]


@pytest.mark.rule("A9", "F3")
def test_several_outputs_are_told_in_their_order_behind_all_of_them_and_before_processed() -> None:
    graph = hfg.Graph()
    fork, keep = graph.add(Fork()), graph.add(Keep())
    graph.connect(graph.add(numbers(count=1)).out, fork.value)
    graph.connect(fork.b, keep.value)
    graph.connect(fork.processed, graph.add(Ear(), name="late").poke)
    heard(graph, fork.b, fork.a)
    trace = explained(graph)
    told = [event for event in trace if isinstance(event, TokenSent | EventTriggered)]
    seen = [event.edge if isinstance(event, TokenSent) else event.event for event in told]
    asked = ("fork.b -> keep.value", "fork.a.sent", "fork.b.sent", "fork.processed")
    assert [one for one in seen[seen.index(asked[0]) :] if one in asked] == [
        "fork.b -> keep.value",
        "fork.a.sent",
        "fork.b.sent",
        "fork.processed",
        "fork.b -> keep.value",  # END
    ]


@pytest.mark.rule("A9")
def test_only_the_outputs_that_were_written_are_told(fast: bool) -> None:
    graph = hfg.Graph()
    parts = graph.add(split())
    graph.connect(graph.add(numbers(count=4)).out, parts.value)
    small, big = graph.add(Ear(), name="small"), graph.add(Ear(), name="big")
    graph.connect(parts.ports.outputs["small"].sent, small.hear)
    graph.connect(parts.ports.outputs["big"].sent, big.hear)
    assert Halves._fields == ("small", "big")
    run(graph, fast)
    assert (small.heard, big.heard) == ([1, 2], [3, 4])


@pytest.mark.rule("T5")
def test_the_signal_has_the_stamp_of_the_token_and_not_the_present() -> None:
    class Late(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)

        async def process(self, value: int) -> None:
            await asyncio.sleep(5)
            self.out.send(value, stamp=0.25 if value == 2 else None)

    graph = hfg.Graph()
    late, keep = graph.add(Late()), graph.add(KeepTokens())
    graph.connect(graph.add(numbers(count=2)).out, late.value)
    graph.connect(late.out.sent, keep.value)
    run(graph)
    assert [(token.value, token.stamp, hfg.NO_MESSAGE) for token in keep.tokens] == [
        (1, 0.0, hfg.NO_MESSAGE),
        (2, 0.25, hfg.NO_MESSAGE),
    ]


# --- activity ---


@pytest.mark.rule("A3", "A5", "A9")
def test_it_carries_activity_only_if_the_outputs_did_not() -> None:
    def build(*, active_output: bool) -> hfg.Graph:
        graph = hfg.Graph()
        node, keep, ear = graph.add(forward()), graph.add(Keep()), graph.add(Ear())
        graph.connect(graph.add(numbers(count=1)).out, node.value)
        graph.connect(node.out, keep.value, active=active_output)
        node.out.sent.activates(ear.hear)
        graph.start.activates(node.activate)
        return graph

    trace = explained(build(active_output=False))
    assert modifiers(trace, "forward.out.sent -> ear.hear") == [1]
    assert activity(trace, "ear") == [True]
    trace = explained(build(active_output=True))
    assert modifiers(trace, "forward.out.sent -> ear.hear") == [0]
    assert activity(trace, "keep") == [True]


@pytest.mark.rule("A4", "A9")
@pytest.mark.parametrize("modifier", [-1, 0, 1])
def test_an_explicit_modifier_is_the_output_s_alone(modifier: int) -> None:
    graph = hfg.Graph()
    node, ear = graph.add(Send(modifier=modifier)), graph.add(Ear())
    graph.connect(graph.add(numbers(count=1)).out, node.value)
    node.out.sent.activates(ear.hear)
    assert modifiers(explained(graph), "send.out.sent -> ear.hear") == [0]


@pytest.mark.rule("A5", "A9")
def test_deactivated_arises_before_it() -> None:
    graph = hfg.Graph()
    node, keep = graph.add(forward()), graph.add(Keep())
    graph.connect(graph.add(numbers(count=1)).out, node.value)
    graph.connect(node.out, keep.value, active=True)
    graph.connect(node.deactivated, graph.add(Ear(), name="told").poke)
    graph.start.activates(node.activate)
    heard(graph, node.out)
    events = [event.event for event in of_kind(explained(graph), EventTriggered)]
    assert events.index("forward.deactivated") < events.index("forward.out.sent")


# --- streams of different rates ---


@hfg.node
async def show(image: int) -> None:
    await asyncio.sleep(1)


class Seen(hfg.Node):
    image = hfg.Input(int)
    seen = hfg.State(factory=list[tuple[float, int]])

    async def process(self, image: int) -> None:
        self.seen.append((hfg.elapsed(), image))
        await asyncio.sleep(0.95)


@pytest.mark.rule("P5", "F8")
def test_a_slow_consumer_sees_the_latest_and_the_producer_keeps_its_pace(fast: bool) -> None:
    graph = hfg.Graph()
    camera = graph.add(numbers(count=30), name="camera", max_rate_hz=10)
    slow, all_ = graph.add(Seen(), name="slow"), graph.add(Keep())
    graph.connect(camera.out, all_.value)
    graph.connect(camera.out.sent, slow.image, overflow="latest")
    report = run(graph, fast)
    assert all_.values == list(range(1, 31))
    assert slow.seen == [(0.0, 1), (0.95, 10), (1.9, 20), (2.85, 29), (3.8, 30)]
    edge = report.edges["camera.out.sent -> slow.image"]
    assert (edge.dropped, report.duration_s) == (25, 4.75)


@pytest.mark.rule("F8")
def test_with_the_policy_wait_a_full_queue_holds_the_producer_back(fast: bool) -> None:
    graph = hfg.Graph()
    camera, slow = graph.add(numbers(count=4), name="camera"), graph.add(Seen(), name="slow")
    graph.connect(camera.out.sent, slow.image, capacity=1)
    report = run(graph, fast)
    assert [image for _, image in slow.seen] == [1, 2, 3, 4]
    assert report.edges["camera.out.sent -> slow.image"].dropped == 0


@pytest.mark.rule("P8")
def test_into_a_parameter_it_takes_no_part_in_the_join(fast: bool) -> None:
    graph = hfg.Graph()
    factors = graph.add(slow_numbers(count=2, pause_s=2.5), name="factors")
    node, keep = graph.add(scale(factor=10)), graph.add(Keep())
    graph.connect(graph.add(numbers(count=6), max_rate_hz=1).out, node.value)
    graph.connect(factors.out.sent, node.ports.parameters["factor"])
    graph.connect(node.out, keep.value)
    run(graph, fast)
    assert keep.values == [10, 20, 30, 4, 5, 12]


@pytest.mark.rule("P9")
def test_operators_sit_on_it_as_on_any_event(fast: bool) -> None:
    graph = hfg.Graph()
    camera, ear = graph.add(numbers(count=10), max_rate_hz=10), graph.add(Ear())
    graph.connect(camera.out.sent, ear.hear, through=[ops.sample(0.35)])
    run(graph, fast)
    assert ear.heard == [4, 7, 10]  # at 0.7 s the operator was first to set its timer


# --- the same wherever it is asked for ---


def test_nothing_is_made_and_nothing_is_paid_for_while_nobody_asks() -> None:
    def worker(run: hfg.Run, path: str) -> RunningNode:
        return run._engine.core.by_path[path]

    async def main() -> list[int]:
        graph, told = hfg.Graph(), []
        node = graph.add(forward())
        graph.connect(graph.input("in", int), node.value)
        graph.connect(node.out, graph.add(Keep()).value)
        async with hfg.running(graph) as run, run.feed("in") as feed:
            for number in range(300):
                await feed.send(number)
            assert worker(run, "forward").shape.announced == ()
            fused = worker(run, "forward").region
            assert fused is not None
            node.out.sent.subscribe(lambda token: told.append(token.value))
            assert worker(run, "forward").region is None
            for number in range(3):
                await feed.send(number)
        return told

    assert drive(main) == [0, 1, 2]


@pytest.mark.rule("R7")
def test_run_and_graph_know_it_by_its_path() -> None:
    async def main() -> tuple[list[int], int]:
        graph = hfg.Graph()
        node = graph.add(forward(), name="camera")
        graph.connect(graph.input("in", int), node.value)
        assert graph["camera.out.sent"] is node.out.sent
        async with hfg.running(graph) as run:
            tap = run.tap("camera.out.sent")
            waiting = asyncio.create_task(run.wait_for(node.out.sent))
            await asyncio.sleep(0)
            async with run.feed("in") as feed:
                await feed.send(7)
            looked = [(await anext(tap)).value]
            await run.wait_finished()
        return looked, (await waiting).value

    assert drive(main) == ([7], 7)


@pytest.mark.rule("R4")
def test_an_edge_from_it_can_be_edited_in_undone_and_enclosed_while_the_graph_runs() -> None:
    c = hfg.commands

    async def main() -> list[int]:
        graph = hfg.Graph()
        node, ear = graph.add(forward(), name="camera"), graph.add(Ear())
        graph.connect(graph.input("in", int), node.value)
        async with hfg.running(graph) as run, run.feed("in") as feed:
            await feed.send(1)
            await run.edit(c.Connect("camera.out.sent", "ear.hear"))
            await feed.send(2)
            await run.edit(c.Enclose(("camera",), "box"))
            await feed.send(3)
            assert [edge.label for edge in graph.edges if "hear" in edge.label] == ["box.out_sent -> ear.hear"]
            await run.edit(c.Dissolve("box"))
            await feed.send(4)
            await run.undo()
            await run.undo()
            await run.undo()
            await feed.send(5)
            assert not [edge for edge in graph.edges if "hear" in edge.label]
            await run.wait_quiet()
            return list(ear.heard)

    assert drive(main) == [2, 3, 4]


@pytest.mark.rule("R1", "R6")
@pytest.mark.parametrize("where", ["thread", "async", "generator", "function"])
def test_it_is_the_same_wherever_the_code_runs(where: str) -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    node: Any
    if where == "generator":
        node = graph.add(numbers(count=5))
    elif where == "function":
        node = graph.add(Countdown(count=5))
    else:
        node = graph.add(forward(), group="work") if where == "thread" else graph.add(forward_async())
        graph.connect(graph.add(numbers(count=5)).out, node.value)
    ear = heard(graph, node.out)
    explained(graph)
    assert sorted(ear.heard) in ([1, 2, 3, 4, 5], [0, 1, 2, 3, 4])


@pytest.mark.rule("G1", "A9")
def test_inside_a_subgraph_it_leads_out_by_an_event_of_the_subgraph(fast: bool) -> None:
    class Camera(hfg.Subgraph):
        taken = hfg.Event(int)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(graph.add(numbers()).out.sent, self.taken.inner)

    graph = hfg.Graph()
    ear = graph.add(Ear())
    graph.connect(graph.add(Camera()).taken, ear.hear)
    run(graph, fast)
    assert ear.heard == [1, 2, 3]


def test_it_is_drawn_as_an_event_and_checked_as_one() -> None:
    graph = hfg.Graph()
    camera, slow = graph.add(numbers(), name="camera"), graph.add(forward(), name="slow")
    graph.connect(camera.out.sent, slow.value, overflow="latest")
    assert "-.->" in graph.draw() or "-.-" in graph.draw()
    assert [problem for problem in graph.check() if problem.severity != "hint"] == []


@pytest.mark.slow
@pytest.mark.rule("A9")
def test_the_oracle_says_the_same_under_every_schedule() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        parts, join = graph.add(split()), graph.add(add_optional())
        graph.connect(graph.add(numbers(count=4)).out, parts.value)
        graph.connect(parts.ports.outputs["small"].sent, join.a)
        graph.connect(parts.ports.outputs["big"].sent, join.b)
        graph.connect(join.out, graph.add(Keep()).value)
        return graph

    found = {tuple(reference_run(build(), seed=seed).values("add_optional.out -> keep.value")) for seed in range(8)}
    assert found == {(4, 6, hfg.END)}
    trace = traced(build())
    assert sent(trace, "add_optional.out -> keep.value") == [4, 6, hfg.END]
    assert [token.stamp for token in tokens(trace, "split.small.sent -> add_optional.a")] == [0.0, 0.0, 0.0]


# --- failures that an edge can answer (X1) ---


class Retry(hfg.Node):
    """Asks, and asks once more whatever came back."""

    question = hfg.Event(int)

    @hfg.slot
    def ask(self, value: int) -> None:
        self.question.trigger(value)

    @hfg.slot
    def again(self, failure: hfg.Failure) -> None:
        self.question.trigger(failure.taken["value"])


class Shaky(hfg.Node):
    """Fails the first time for each value."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    tried = hfg.State(factory=set[int])

    async def process(self, value: int) -> int:
        await asyncio.sleep(0.1)
        if value not in self.tried:
            self.tried.add(value)
            raise ConnectionResetError(f"no answer to {value}")
        return value


@pytest.mark.rule("X1")
def test_failed_carries_what_was_taken_so_that_a_retry_is_an_edge(fast: bool) -> None:
    graph = hfg.Graph()
    retry, shaky, ear = graph.add(Retry()), graph.add(Shaky(), on_error="skip"), graph.add(Ear())
    graph.connect(graph.add(numbers()).out, retry.ask)
    graph.connect(retry.question, shaky.value)
    graph.connect(shaky.failed, retry.again)
    graph.connect(shaky.out.sent, ear.hear)
    report = run(graph, fast)
    assert (ear.heard, report.nodes["shaky"].failed, report.outcome) == ([1, 2, 3], 3, "done")


@pytest.mark.rule("X1", "P6")
def test_failed_leaves_out_what_was_absent_and_oracle_and_engine_agree(fast: bool) -> None:
    @hfg.node
    def strict(a: int, b: int = 0) -> int:
        raise ValueError(f"{a} {b}")

    graph = hfg.Graph()
    node, ear = graph.add(strict(), on_error="skip"), graph.add(Ear())
    graph.connect(graph.add(numbers(count=2)).out, node.a)
    graph.connect(graph.add(gaps(count=2)).out, node.b)
    graph.connect(node.failed, ear.hear)
    run(graph, fast)
    assert [failure.taken for failure in ear.heard] == [{"a": 1, "b": 1}, {"a": 2}]


@pytest.mark.rule("X1", "X2")
def test_a_firing_that_took_too_long_tells_what_it_had_taken(fast: bool) -> None:
    @hfg.node
    async def slow(value: int) -> None:
        await asyncio.sleep(60)

    graph = hfg.Graph()
    node, ear = graph.add(slow(), on_error="skip", max_duration_s=1), graph.add(Ear())
    graph.connect(graph.add(numbers(count=2)).out, node.value)
    graph.connect(node.failed, ear.hear)
    run(graph, fast)
    assert [failure.taken for failure in ear.heard] == [{"value": 1}, {"value": 2}]


@pytest.mark.rule("X1")
def test_a_source_or_hook_that_fails_has_taken_nothing(fast: bool) -> None:
    @hfg.node
    def broken() -> Iterator[int]:
        yield 1
        raise OSError("gone")

    graph = hfg.Graph()
    node, ear = graph.add(broken(), on_error="disable"), graph.add(Ear())
    graph.connect(node.failed, ear.hear)
    run(graph, fast)
    [failure] = ear.heard
    assert (failure.taken, str(failure.error)) == ({}, 'node "broken" failed in firing 2: OSError: gone')

"""The graph's own inputs and outputs (rule P10), slots and events called from outside, barriers."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from tests.limits import patience
from tests.semantics.nodes import (
    Burst,
    Ear,
    Keep,
    KeepTokens,
    drive,
    forward,
    forward_later,
    numbers,
    only_odd,
    run,
)


def passing() -> hfg.Graph:
    """In, on, and out again."""
    graph = hfg.Graph()
    node = graph.add(forward())
    graph.connect(graph.input("numbers", int), node.value)
    graph.connect(node.out, graph.output("results", int))
    return graph


@pytest.mark.rule("P10")
def test_a_send_into_the_graph_returns_when_the_token_is_processed(fast: bool) -> None:
    async def main() -> list[tuple[int, float]]:
        graph = hfg.Graph()
        slow = graph.add(forward_later())
        graph.connect(graph.input("numbers", int), slow.value)
        done = []
        async with hfg.running(graph, fast=fast) as run:
            async with run.feed("numbers") as feed:
                for number in (1, 2, 3):
                    await feed.send(number)
                    done.append((number, run.now()))
            await run.wait_finished()
        return done

    assert drive(main) == [(1, 1), (2, 2), (3, 3)]


@pytest.mark.rule("P10")
def test_what_nobody_reads_is_collected_in_the_report(fast: bool) -> None:
    graph = hfg.Graph()
    source, odd = graph.add(numbers(count=5)), graph.add(only_odd())
    graph.connect(source.out, odd.value)
    graph.connect(odd.out, graph.output("odd", int))
    assert run(graph, fast).outputs == {"odd": [1, 3, 5]}


@pytest.mark.rule("P10")
def test_feed_and_read_work_together_and_end_closes_the_reader(fast: bool) -> None:
    async def main() -> list[int]:
        graph = passing()
        async with hfg.running(graph, fast=fast) as run:

            async def feed() -> None:
                async with run.feed(graph.inputs["numbers"]) as feed:
                    for number in (1, 2, 3):
                        await feed.send(number)

            feeding = asyncio.create_task(feed())
            seen = [value async for value in run.read(graph.outputs["results"])]
            await feeding
            await run.wait_finished()
        return seen

    assert drive(main) == [1, 2, 3]


@pytest.mark.rule("P10")
def test_a_reader_that_does_not_read_holds_the_graph_back(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        source = graph.add(numbers(count=10))
        graph.connect(source.out, graph.output("out", int))
        story: list[object] = []
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            story.append(run.statistics().nodes["numbers"].firings)
            reader = run.read("out")
            story.append(await anext(reader))
            await run.wait_quiet()
            story.append(run.statistics().nodes["numbers"].firings)
            story.append([value async for value in reader])
            await run.wait_finished()
        return story

    assert drive(main) == [1, 1, 2, list(range(2, 11))]


@pytest.mark.rule("P10", "F8")
def test_an_event_may_lead_out_of_the_graph(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(Burst(count=40))
    graph.connect(source.rang, graph.output("rang", int))
    assert run(graph, fast).outputs == {"rang": list(range(1, 41))}


@pytest.mark.rule("P10", "A4")
def test_a_feed_sends_modifiers_stamps_and_silence(fast: bool) -> None:
    async def main() -> tuple[list[hfg.Token[object]], list[str]]:
        graph = hfg.Graph()
        sink = graph.add(KeepTokens())
        graph.connect(graph.input("numbers", int), sink.value, active=True)
        async with hfg.running(graph, fast=fast) as run:
            async with run.feed("numbers") as feed:
                await feed.send(1, activity=1, stamp=4.5)
                await feed.send(None)
                active = run.active()
                await feed.send(hfg.Token(2, -1, 8.5))
            await run.wait_finished()
        return sink.tokens, active

    seen, active = drive(main)
    assert [(token.value, token.activity, token.stamp) for token in seen] == [(1, 1, 4.5), (2, -1, 8.5)]
    assert active == ["keep_tokens"]


@pytest.mark.rule("P10", "R5")
def test_a_feed_left_with_end_false_may_be_followed_by_another(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        sink = graph.add(Keep())
        graph.connect(graph.input("numbers", int), sink.value)
        async with hfg.running(graph, fast=fast) as run:
            async with run.feed("numbers", end=False) as feed:
                await feed.send(1)
            assert not run.statistics().nodes["keep"].ended
            async with run.feed("numbers") as feed:
                await feed.send(2)
            await run.wait_finished()
            assert run.statistics().nodes["keep"].ended
        return sink.values

    assert drive(main) == [1, 2]


@pytest.mark.rule("P10", "R5")
def test_an_open_feed_holds_the_run_open(fast: bool) -> None:
    async def main() -> float:
        graph = hfg.Graph()
        graph.connect(graph.input("numbers", int), graph.add(Keep()).value)
        async with hfg.running(graph, fast=fast) as run:

            async def feed() -> None:
                async with run.feed("numbers") as feed:
                    await asyncio.sleep(50)
                    await feed.send(1)

            feeding = asyncio.create_task(feed())
            await asyncio.sleep(0)
            report = await run.wait_finished()
            await feeding
        return report.duration_s

    assert drive(main) == 50


@pytest.mark.rule("P10", "F13")
def test_an_input_that_nobody_feeds_ends_with_the_run(fast: bool) -> None:
    graph = hfg.Graph()
    sink = graph.add(Keep())
    graph.connect(graph.input("numbers", int), sink.value)
    report = run(graph, fast)
    assert report.outcome == "done"
    assert report.nodes["keep"].ended


@pytest.mark.rule("P10")
def test_values_come_from_other_threads_in_order(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        sink = graph.add(Keep())
        graph.connect(graph.input("numbers", int), sink.value)
        async with hfg.running(graph, fast=fast) as run:
            async with run.feed("numbers") as feed:

                def work() -> None:
                    for future in [feed.send_from_thread(number) for number in range(20)]:
                        future.result(patience(5))

                await asyncio.to_thread(work)
            await run.wait_finished()
        return sink.values

    assert drive(main) == list(range(20))


@pytest.mark.rule("P10", "A4", "F9")
def test_a_slot_is_called_from_outside_and_may_be_given_activity(fast: bool) -> None:
    async def main() -> tuple[list[object], list[list[str]]]:
        graph = hfg.Graph()
        ear = graph.add(Ear())
        active = []
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(ear.hear, 1)
            await run.wait_quiet()
            active.append(run.active())
            await run.trigger(ear.hear, 2, activity=1)
            await run.wait_quiet()
            active.append(run.active())
            await run.trigger(ear.hear, hfg.Token(3, -1))
            await run.wait_quiet()
            active.append(run.active())
        return ear.heard, active

    assert drive(main) == ([1, 2, 3], [[], ["ear"], []])


@pytest.mark.rule("P10", "F8")
def test_an_event_is_triggered_from_outside(fast: bool) -> None:
    async def main() -> tuple[list[object], list[object]]:
        graph = hfg.Graph()
        first, second = graph.add(Ear()), graph.add(Ear())
        graph.connect(first.passed, second.hear)
        async with hfg.running(graph, fast=fast) as run:
            for number in range(40):
                await run.trigger(first.passed, number)
            await run.wait_quiet()
        return first.heard, second.heard

    assert drive(main) == ([], list(range(40)))


@pytest.mark.rule("F8")
def test_code_outside_waits_while_a_slot_is_full(fast: bool) -> None:
    async def main() -> tuple[list[object], float]:
        graph = hfg.Graph()
        node = graph.add(Patient())
        async with hfg.running(graph, fast=fast) as run:
            for number in range(20):
                await run.trigger(node.hear, number)
            when = run.now()
            await run.wait_quiet()
        return node.heard, when

    heard, when = drive(main)
    assert heard == list(range(20))
    assert when == 3  # 16 places, and the first is taken at once: the last of 20 has room after three calls


class Patient(hfg.Node):
    """Takes a second for each call."""

    heard = hfg.State(factory=list)

    @hfg.slot
    async def hear(self, value: int) -> None:
        await asyncio.sleep(1)
        self.heard.append(value)


@pytest.mark.rule("F1", "F5")
def test_the_barriers_of_a_node_can_be_waited_for(fast: bool) -> None:
    async def main() -> list[tuple[str, float]]:
        graph = hfg.Graph()
        slow = graph.add(forward_later())
        source = graph.add(Late())
        graph.connect(source.ports.outputs["out"], slow.value)
        story = []
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_inputs(slow)
            story.append(("inputs", run.now()))
            await asyncio.sleep(0.1)
            await run.wait_outputs(source)
            story.append(("outputs", run.now()))
            await run.wait_finished()
        return story

    assert drive(main) == [("inputs", 5), ("outputs", 6)]


class Late(hfg.Node):
    """One value after five seconds."""

    over = hfg.State(False)

    async def process(self) -> int:
        if self.over:
            raise hfg.EndOfStream
        self.over = True
        await asyncio.sleep(5)
        return 1


@pytest.mark.rule("P10")
def test_a_tap_looks_at_tokens_without_taking_them(fast: bool) -> None:
    async def main() -> tuple[list[object], list[object]]:
        graph = hfg.Graph()
        node, sink = graph.add(forward()), graph.add(Keep())
        graph.connect(graph.input("numbers", int), node.value)
        graph.connect(node.out, sink.value)
        seen: list[object] = []
        async with hfg.running(graph, fast=fast) as run:

            async def look() -> None:
                seen.extend([token.value async for token in run.tap(node.out)])

            looking = asyncio.create_task(look())
            await asyncio.sleep(0)
            async with run.feed("numbers") as feed:
                for number in (1, 2, 3):
                    await feed.send(number)
            await run.wait_finished()
            await looking
        return seen, sink.values

    assert drive(main) == ([1, 2, 3, hfg.END], [1, 2, 3])

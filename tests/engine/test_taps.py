"""Taps look at what passes a port or an edge, never slow the graph, and count what they skip."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

import pytest

import hfg
from hfg import commands
from hfg.engine.face.run import Run
from hfg.testing.nodes import Relay, script

T = TypeVar("T")


def drive(main: Callable[[], Coroutine[Any, Any, T]]) -> T:
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main())


@hfg.node
def forward(value: int) -> int:
    """Pass on."""
    return value


class Keep(hfg.Node):
    """Keep what comes."""

    value = hfg.Input(int)
    heard = hfg.Event(int)

    def process(self, value: int) -> None:
        """Keep it and say so."""
        self.heard.trigger(value)


class Ear(hfg.Node):
    """Hear."""

    @hfg.slot
    def hear(self, value: int) -> None:
        """Do nothing with it."""


class Box(hfg.Subgraph):
    """Two forwards inside."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        """Fan out behind the border."""
        one, two = graph.add(forward(), name="one"), graph.add(forward(), name="two")
        graph.connect(self.value.inner, one.value)
        graph.connect(self.value.inner, two.value)
        graph.connect(one.out, self.out.inner)


def pipeline(count: int = 4, rate: float | None = 10.0) -> hfg.Graph:
    graph = hfg.Graph("pipeline")
    source = graph.add(script(values=tuple(range(1, count + 1))), name="source", max_rate_hz=rate)
    node, keep, ear = graph.add(forward()), graph.add(Keep()), graph.add(Ear())
    other = graph.add(Keep(), name="other")
    graph.connect(source.out, node.ports.inputs["value"])
    graph.connect(node.out, keep.value)
    graph.connect(node.out, other.value)
    graph.connect(keep.heard, ear.hear)
    return graph


def values(what: Any, graph: hfg.Graph | None = None, **options: Any) -> list[Any]:
    """What a tap of the whole run sees."""

    async def main() -> list[Any]:
        async with hfg.running(graph or pipeline(), fast=options.pop("fast", True)) as run:
            tap = run.tap(what, **options)
            await run.wait_finished()
            return [token.value async for token in tap]

    return drive(main)


ALL = [1, 2, 3, 4, hfg.END]


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize(
    "what", ["source.out", "forward.value", "forward.out", "keep.value", "forward.out -> keep.value"]
)
def test_a_tap_by_path_sees_each_token_of_a_port_or_edge_once(what: str, fast: bool) -> None:
    assert values(what, fast=fast) == ALL


def test_a_tap_takes_ports_and_edges_themselves_too() -> None:
    graph = pipeline()
    assert values(graph["forward"].out, graph) == ALL
    assert values(graph.edges[1], graph) == ALL


def test_an_event_shows_its_signals_and_a_slot_what_comes_into_it() -> None:
    assert values("keep.heard") == [1, 2, 3, 4]
    assert values("ear.hear") == [1, 2, 3, 4]
    assert values("other.heard") == [1, 2, 3, 4]  # to which nothing is connected


def test_an_automatic_event_can_be_looked_at() -> None:
    assert values("forward.processed") == [None] * 4


def test_a_slot_shows_what_comes_from_outside_too() -> None:
    async def main() -> list[Any]:
        graph = pipeline(rate=None)
        async with hfg.running(graph) as run:
            with run.tap("ear.hear") as tap:
                await run.wait_quiet()
                await run.trigger(graph["ear"].hear, 7)
                await run.wait_quiet()
            return [token.value async for token in tap]

    assert drive(main) == [1, 2, 3, 4, 7]


def test_the_border_of_a_subgraph_shows_what_passes_it() -> None:
    def boxed() -> hfg.Graph:
        graph = hfg.Graph("boxed")
        box, keep = graph.add(Box()), graph.add(Keep())
        graph.connect(graph.add(script(values=(1, 2)), name="source").out, box.value)
        graph.connect(box.out, keep.value)
        return graph

    for what in ("box.value", "box.out", "box/one.out", "box/two.value", "source.out", "keep.value"):
        assert values(what, boxed()) == [1, 2, hfg.END], what
    graph = boxed()
    assert values(graph["box"]._graph.edges[0], graph) == [1, 2, hfg.END]


def test_what_a_tap_has_no_room_for_is_skipped_oldest_first_and_counted() -> None:
    async def main() -> tuple[list[Any], int, int, Any]:
        async with hfg.running(pipeline(10, None)) as run:
            tap = run.tap("source.out", size=3)
            await run.wait_finished()
            assert tap.latest is not None
            seen = [token.value async for token in tap]
            return seen, tap.seen, tap.skipped, tap.latest.value

    assert drive(main) == ([9, 10, hfg.END], 11, 8, hfg.END)


def test_a_tap_with_a_rate_gives_the_latest_and_no_more_often() -> None:
    async def main() -> tuple[list[tuple[float, Any]], int]:
        got: list[tuple[float, Any]] = []
        async with hfg.running(pipeline(20, 10.0)) as run:
            tap = run.tap("source.out", max_rate_hz=3)

            async def look() -> int:
                async for token in tap:
                    got.append((round(run.now(), 3), token.value))  # noqa: PERF401
                return tap.skipped

            looking = asyncio.create_task(look())
            await run.wait_finished()
        return got, await looking

    got, skipped = drive(main)
    times = [time for time, _ in got]
    assert [value for _, value in got[:3]] == [1, 4, 7]
    assert times[:3] == [0.0, 0.333, 0.667]
    assert got[-1][1] is hfg.END  # the end of the run does not wait for the rate
    assert skipped == 21 - len(got)


def test_the_graph_does_not_wait_for_a_tap_that_nobody_reads() -> None:
    async def main() -> tuple[hfg.Report, int]:
        async with hfg.running(pipeline(1000, None)) as run:
            tap = run.tap("forward.out")
            report = await run.wait_finished()
            return report, tap.seen

    report, seen = drive(main)
    assert report.outcome == "done"
    assert seen == 1001


def test_a_tap_that_is_let_go_costs_nothing_any_more() -> None:
    async def main() -> None:
        graph = pipeline(100)
        async with hfg.running(graph) as run:
            core = run._engine.core
            edge = next(edge for edge in core.edges if edge.label == "source.out -> forward.value")
            step = edge.source.step
            async for _ in run.tap("source.out"):
                assert edge.tap is not None
                break
            assert edge.tap is None
            one, two = run.tap("source.out"), run.tap("source.out")
            one.close()
            assert edge.tap is not None
            two.close()
            two.close()
            assert edge.tap is None
            assert edge.source.step.__qualname__ == step.__qualname__
            assert [token async for token in two] == []

    drive(main)


def test_a_tap_changes_nothing_for_the_graph() -> None:
    """Not even when it makes an automatic event that nobody had asked for."""

    def trace(tapped: bool) -> list[Any]:
        async def main() -> list[Any]:
            events: list[Any] = []
            async with hfg.running(pipeline(), trace=events) as run:
                taps = [run.tap(what) for what in ("source.out", "keep.heard", "ear.hear")] if tapped else []
                await run.wait_finished()
                assert all(tap.seen for tap in taps)
            return events

        return drive(main)

    assert trace(True) == trace(False)


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("nowhere.out", 'there is no "nowhere.out": graph "pipeline" has no node "nowhere"; '),
        ("forward.outt", 'there is no "forward.outt": "forward" has no port "outt"; did you mean "out"?'),
        ("a.out -> b.in", 'there is no edge "a.out -> b.in" in this run; '),
        ("source", '"source" is a node, and a tap looks at a port or an edge: name one of its ports; there are "out"'),
        (3, "a tap looks at a port or an edge of this run, given itself or by path, got 3"),
    ],
)
def test_a_tap_on_what_does_not_exist_is_refused(what: Any, sentence: str) -> None:
    with pytest.raises(hfg.errors.HfgError) as error:
        values(what)
    assert sentence in str(error.value)


def test_a_tap_on_what_is_in_no_run_or_has_no_edge_is_refused() -> None:
    other = pipeline()
    with pytest.raises(hfg.errors.UsageError, match=r'"forward.out" is in no graph that runs here'):
        values(other["forward"].out)
    with pytest.raises(hfg.errors.UsageError, match="is in no graph that runs here"):
        values(forward().out)
    with pytest.raises(hfg.errors.UsageError, match='"pipeline"|has no edge in this run'):
        values(other.edges[0])
    graph = hfg.Graph("bare")
    graph.add(Relay(), name="relay")
    graph.add(script(), name="source")
    with pytest.raises(hfg.errors.UsageError, match=r'"source.out" has no edge in this run, so no token passes there'):
        values("source.out", graph)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [({"size": 0}, "size is how many tokens"), ({"size": 2.5}, "size is"), ({"max_rate_hz": 0}, "max_rate_hz is how")],
)
def test_a_size_or_rate_that_cannot_be_is_refused(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(hfg.errors.UsageError, match=sentence):
        values("source.out", **options)


def test_a_tap_of_a_run_that_is_over_is_refused() -> None:
    async def main() -> None:
        async with hfg.running(pipeline()) as run:
            await run.wait_finished()
            with pytest.raises(hfg.errors.NotRunning, match="nothing will pass there any more"):
                run.tap("source.out")

    drive(main)


def test_a_tap_inside_an_iteration_sees_the_elements() -> None:
    class Each(hfg.Subgraph):
        """One element at a time."""

        value = hfg.Input(int)
        out = hfg.Output(int)

        def build(self, graph: hfg.Graph) -> None:
            """One node."""
            one = graph.add(forward(), name="one")
            graph.connect(self.value.inner, one.value)
            graph.connect(one.out, self.out.inner)

    async def main() -> list[Any]:
        graph = hfg.Graph("iterating")
        keys, results = graph.input("keys", list[int]), graph.output("results", list[int])
        each = graph.add(Each(), name="each", iterate_over=["value"])
        graph.connect(keys, each.ports.inputs["value"])
        graph.connect(each.ports.outputs["out"], results)

        async def feed(run: Run) -> None:
            async with run.feed(keys) as into:
                await into.send([1, 2, 3])

        async with hfg.running(graph) as run:
            tap = run.tap("each/one.out")
            feeding = asyncio.create_task(feed(run))
            assert [value async for value in run.read(results)] == [[1, 2, 3]]
            await feeding
            await run.wait_finished()
            return [token.value async for token in tap]

    assert drive(main) == [1, 2, 3]


@pytest.mark.rule("R4")
def test_a_tap_follows_its_port_through_edits_of_the_graph() -> None:
    async def main() -> tuple[list[Any], list[Any]]:
        graph = pipeline(8)
        async with hfg.running(graph) as run:
            out, value = run.tap("forward.out"), run.tap("keep.value")
            await asyncio.sleep(0.15)
            await run.edit(commands.Disconnect("forward.out", "keep.value"))
            await asyncio.sleep(0.2)
            await run.edit(commands.Connect("forward.out", "keep.value"), commands.Rename("keep", "kept"))
            await run.wait_finished()
            return [[token.value async for token in tap] for tap in (out, value)]  # type: ignore[return-value]

    out, value = drive(main)
    assert out == [1, 2, 3, 4, 5, 6, 7, 8, hfg.END]
    assert value == [1, 2, 5, 6, 7, 8, hfg.END]

"""Subgraphs that iterate over collections (rule G4)."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import hfg
from tests.semantics.nodes import (
    Ear,
    Keep,
    Send,
    Timed,
    add,
    drive,
    fail_on,
    forward,
    forward_async,
    forward_later,
    numbers,
    only_odd,
    run,
)

# --- G4 ---


class Each(hfg.Subgraph):
    """Adds, element by element."""

    iterate_over = ("a", "b")
    a = hfg.Input(int)
    b = hfg.Input(int)
    sums = hfg.Output(int)
    odd = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        node, odd = graph.add(add(), name="add"), graph.add(only_odd(), name="odd")
        graph.connect(self.a.inner, node.a)
        graph.connect(self.b.inner, node.b)
        graph.connect(node.out, self.sums.inner)
        graph.connect(node.out, odd.value)
        graph.connect(odd.out, self.odd.inner)


class Lists(hfg.Node):
    """Lists of these lengths."""

    lengths = hfg.Parameter((3,), type=tuple[int, ...])
    out = hfg.Output(list[int])
    left = hfg.State(factory=list)

    def setup(self) -> None:
        self.left = list(self.lengths)

    def process(self) -> list[int]:
        if not self.left:
            raise hfg.EndOfStream
        return list(range(1, self.left.pop(0) + 1))


def iterated(
    a: tuple[int, ...], b: tuple[int, ...], fast: bool, **options: Any
) -> tuple[list[Any], list[Any], hfg.Report]:
    graph = hfg.Graph()
    one, two, box = graph.add(Lists(lengths=a)), graph.add(Lists(lengths=b)), graph.add(Each(), **options)
    sums, odd = graph.add(Keep(), name="sums"), graph.add(Keep(), name="odds")
    graph.connect(one.out, box.ports.inputs["a"])
    graph.connect(two.out, box.ports.inputs["b"])
    graph.connect(box.sums, sums.value)
    graph.connect(box.odd, odd.value)
    report = run(graph, fast)
    return sums.values, odd.values, report


def nested(depth: int, make: Any, **options: Any) -> Any:
    """A box that iterates around one that does, and so on; the innermost holds a node."""
    kind: Any = int
    box: Any = None
    for _ in range(depth):

        class Box(hfg.Subgraph):
            xs = hfg.Input(kind)
            ys = hfg.Output(kind)
            iterate_over = ("xs",)
            inside = box

            def build(self, graph: hfg.Graph) -> None:
                node = graph.add(make(), **options) if self.inside is None else graph.add(self.inside())
                graph.connect(self.xs.inner, next(iter(node.ports.inputs.values())))
                graph.connect(next(iter(node.ports.outputs.values())), self.ys.inner)

        box, kind = Box, list[kind]
    return box()


class Gives(hfg.Node):
    """Gives what it holds, once."""

    held = hfg.Parameter(None, type=object)
    out = hfg.Output(Any)
    given = hfg.State(False)

    def process(self) -> Any:
        if self.given:
            raise hfg.EndOfStream
        self.given = True
        return self.held


@pytest.mark.rule("G3", "G4")
@pytest.mark.parametrize("make", [forward, forward_async, forward_later, only_odd])
@pytest.mark.parametrize(
    "options", [{}, {"max_rate_hz": 10.0}, {"group": "side"}], ids=["", "at a rate", "in a thread"]
)
@pytest.mark.parametrize(
    ("depth", "held"),
    [(1, [1, 2, 3]), (2, [[1, 2], []]), (2, []), (2, [[], [3, 1]]), (3, [[[1], [], [3, 2]], [], [[]], [[5, 7]]])],
)
def test_what_iterates_may_be_inside_of_what_iterates(
    depth: int, held: Any, options: dict[str, Any], make: Any, fast: bool
) -> None:
    if "group" in options and make in (forward_async, forward_later):
        options = {}  # async code runs on the loop
    graph = hfg.Graph()
    graph.group("side", threads=1)
    source, box, sink = graph.add(Gives(held=held)), graph.add(nested(depth, make, **options)), graph.add(Keep())
    graph.connect(source.out, box.xs)
    graph.connect(box.ys, sink.value)

    def wanted(value: Any) -> Any:
        if not isinstance(value, list):
            return value if make is not only_odd or value % 2 else None
        return [found for found in map(wanted, value) if found is not None]

    assert run(graph, fast).outcome == "done"
    assert sink.values == [wanted(held)]


@pytest.mark.rule("G4")
def test_iteration_zips_its_inputs_and_gives_lists_without_the_silences(fast: bool) -> None:
    sums, odd, _ = iterated((3, 2), (3, 2), fast)
    assert sums == [[2, 4, 6], [2, 4]]
    assert odd == [[], []]


@pytest.mark.rule("G4", "X1")
def test_unequal_lengths_are_an_error_of_the_firing(fast: bool) -> None:
    with pytest.raises(hfg.errors.NodeError, match=r'node "each" failed in firing 1: .*"a" has 3, "b" has 2 elements'):
        iterated((3,), (2,), fast)
    sums, _, report = iterated((3, 1), (2, 1), fast, on_error="skip")
    assert sums == [[2]]
    assert report.nodes["each"].failed == 1


@pytest.mark.rule("G4")
def test_an_empty_collection_gives_empty_lists_without_running_the_inside(fast: bool) -> None:
    sums, odd, _ = iterated((0, 1), (0, 1), fast)
    assert (sums, odd) == ([[], [2]], [[], []])


class Repeats(hfg.Subgraph):
    """One input is iterated, the other repeats; feedback inside counts; asynchronous inside."""

    iterate_over = ("values",)
    values = hfg.Input(int)
    offset = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        node, total, later = graph.add(add(), name="add"), graph.add(add(), name="total"), graph.add(forward_async())
        graph.connect(self.values.inner, node.a)
        graph.connect(self.offset.inner, node.b)
        graph.connect(node.out, later.value)
        graph.connect(later.out, total.a)
        graph.connect(total.out, total.b, initial=[0])
        graph.connect(total.out, self.out.inner)


@pytest.mark.rule("G4")
def test_other_inputs_repeat_and_feedback_inside_keeps_its_tokens(fast: bool) -> None:
    graph = hfg.Graph()
    values, offsets = graph.add(Lists(lengths=(3, 2))), graph.add(Tens())
    box, sink = graph.add(Repeats()), graph.add(Keep())
    graph.connect(values.out, box.ports.inputs["values"])
    graph.connect(offsets.out, box.offset)
    graph.connect(box.out, sink.value)
    run(graph, fast)
    assert sink.values == [[11, 23, 36], [57, 79]]


class Tens(hfg.Node):
    """10, 20."""

    out = hfg.Output(int)
    count = hfg.State(0)

    def process(self) -> int:
        if self.count == 2:
            raise hfg.EndOfStream
        self.count += 1
        return 10 * self.count


class Signals(hfg.Subgraph):
    """Events inside: each element to quiet before the next."""

    iterate_over = ("values",)
    values = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        send, last = graph.add(Send(), name="send"), graph.add(forward_later_once(), name="last")
        graph.connect(self.values.inner, send.value)
        graph.connect(send.rang, last.value)
        graph.connect(last.out, self.out.inner)


@hfg.node
async def forward_later_once(value: int) -> int:
    """After a second."""
    await asyncio.sleep(1)
    return value


@pytest.mark.rule("G4")
def test_each_element_goes_to_quiet_before_the_next(fast: bool) -> None:
    graph = hfg.Graph()
    values, box, sink = graph.add(Lists(lengths=(3,))), graph.add(Signals()), graph.add(Timed())
    graph.connect(values.out, box.ports.inputs["values"])
    graph.connect(box.out, sink.value)
    run(graph, fast)
    assert sink.seen == [([1, 2, 3], 3)]


@pytest.mark.rule("G4", "X1")
def test_an_error_inside_an_iteration_names_the_inner_node(fast: bool) -> None:
    class Fails(hfg.Subgraph):
        iterate_over = ("values",)
        values = hfg.Input(int)
        out = hfg.Output(int)

        def build(self, graph: hfg.Graph) -> None:
            node = graph.add(fail_on(bad=2), name="inner")
            graph.connect(self.values.inner, node.value)
            graph.connect(node.out, self.out.inner)

    graph = hfg.Graph()
    values, box, sink = graph.add(Lists()), graph.add(Fails(), name="box"), graph.add(Keep())
    graph.connect(values.out, box.ports.inputs["values"])
    graph.connect(box.out, sink.value)
    with pytest.raises(hfg.errors.NodeError, match='node "box/inner" failed in firing 2'):
        run(graph, fast)


class RingsLists(hfg.Node):
    rang = hfg.Event(list[int])


@pytest.mark.rule("G4")
def test_active_edges_sources_and_signals_over_the_border_are_refused() -> None:
    graph = hfg.Graph()
    values, box = graph.add(Lists()), graph.add(Each())
    with pytest.raises(hfg.errors.ConnectionError, match="iterates"):
        graph.connect(values.out, box.ports.inputs["a"], active=True)
    with pytest.raises(hfg.errors.ConnectionError, match="iterates"):
        graph.connect(graph.add(RingsLists()).rang, box.ports.inputs["a"])

    class WithSource(hfg.Subgraph):
        iterate_over = ("values",)
        values = hfg.Input(int)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.values.inner, graph.add(Keep()).value)
            graph.add(numbers())

    graph = hfg.Graph()
    values, other = graph.add(Lists()), graph.add(WithSource())
    graph.connect(values.out, other.ports.inputs["values"])
    with pytest.raises(hfg.errors.CheckFailed, match=r"numbers"):
        run(graph)


class Box3(hfg.Subgraph):
    """A node that takes three seconds, and is set up in one."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        slow = graph.add(Slow3(), name="slow")
        graph.connect(self.value.inner, slow.value)
        graph.connect(slow.out, self.out.inner)


class Slow3(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)
    story: list[tuple[str, float]] = []  # noqa: RUF012 - over setups

    async def setup(self) -> None:
        self.story.append(("setup", hfg.now()))
        await asyncio.sleep(1)

    async def process(self, value: int) -> int:
        await asyncio.sleep(3)
        self.story.append((f"{value} over", hfg.now()))
        return value


@pytest.mark.rule("F10", "F9")
@pytest.mark.parametrize("slot", ["enable", "reset"])
def test_a_node_starts_afresh_only_when_the_firing_under_way_is_over(slot: str, fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        box, sink = graph.add(Box3()), graph.add(Keep())
        graph.connect(graph.input("in", int), box.value)
        graph.connect(box.out, sink.value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            sending = asyncio.create_task(feed.send(1))
            await asyncio.sleep(1)
            if slot == "enable":
                await run.trigger(box.disable)
            await run.trigger(box.ports.slots[slot])
            await asyncio.sleep(10)
            await sending
            await feed.send(2)
        return sink.values

    Slow3.story.clear()
    values = drive(main)
    assert values == ([2] if slot == "enable" else [1, 2])
    assert Slow3.story == [("setup", 0), ("1 over", 4), ("setup", 4), ("2 over", 15)]


class Many(hfg.Subgraph):
    """Thousands of nodes."""

    def build(self, graph: hfg.Graph) -> None:
        for _ in range(2_000):
            graph.add(Ear())


@pytest.mark.slow
@pytest.mark.rule("F10")
def test_a_box_of_thousands_is_disabled_enabled_and_reset_without_a_deep_stack(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        box = graph.add(Many())
        async with hfg.running(graph, fast=fast) as run:
            for port in (box.disable, box.enable, box.reset):
                await run.trigger(port)
                await run.wait_quiet()

    drive(main)

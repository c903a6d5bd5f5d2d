"""Any node ends when its code says so by EndOfStream (rules F2, F4): engine and oracle, on each way of running."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg.engine.runtime import settings
from hfg.testing import Recorder, reference_run
from tests.semantics.nodes import Clock, Keep, Send, forward, numbers, run, scale

pytestmark = pytest.mark.rule("F2", "F4")


class Take(hfg.Node):
    """Pass the first values on, and end with the last of them."""

    n = hfg.Parameter(2)
    value = hfg.Input(int)
    out = hfg.Output(int)
    left = hfg.State(0)

    def setup(self) -> None:
        self.left = self.n

    def process(self, value: int) -> None:
        self.left -= 1
        self.out.send(value)
        if not self.left:
            raise hfg.EndOfStream


class TakeLater(Take):
    """The same, where it waits meanwhile."""

    async def process(self, value: int) -> None:  # type: ignore[override]
        await asyncio.sleep(0.5)
        super().process(value)


class TakeUntil(hfg.Node):
    """Pass on what is below a limit; what is not ends the node."""

    limit = hfg.Parameter(3)

    def process(self, value: int) -> int:
        if value >= self.limit:
            raise hfg.EndOfStream
        return value


class Asks(hfg.Node):
    """Its `ready()` ends it."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    passed = hfg.State(0)

    def ready(self) -> bool:
        if self.passed == 2:
            raise hfg.EndOfStream
        return True

    def process(self, value: int) -> int:
        self.passed += 1
        return value


class Sums(Take):
    """Says in `end()` what it has seen."""

    total = hfg.Output(int)
    seen = hfg.State(0)

    def process(self, value: int) -> None:
        self.seen += value
        super().process(value)

    def end(self) -> None:
        self.total.send(self.seen)


def line(node: hfg.Node, count: int = 5, **options: Any) -> Callable[[], hfg.Graph]:
    """A source, a node that ends, and what is behind it."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.group("work", threads=1)
        graph.add(numbers(count=count), name="src")
        graph.add(type(node)(**node._parameters), name="take", **options)
        graph.add(scale(factor=1), name="behind")
        graph.add(Keep(), name="keep")
        graph.connect("src.out", "take.value")
        graph.connect("take.out", "behind.value")
        graph.connect("behind.out", "keep.value")
        return graph

    return build


@pytest.mark.parametrize("options", [{}, {"group": "work"}, {"release": "pipelined"}, {"on_error": "skip"}], ids=str)
@pytest.mark.parametrize(
    ("node", "values"),
    [
        (Take(n=2), [1, 2]),
        (Take(n=1), [1]),
        (TakeLater(n=2), [1, 2]),
        (TakeUntil(limit=3), [1, 2]),
        (Asks(), [1, 2]),
        (Sums(n=3), [1, 2, 3]),
    ],
    ids=lambda item: repr(item),
)
def test_it_ends_as_if_its_input_had_ended(
    node: hfg.Node, values: list[int], options: dict[str, Any], fast: bool
) -> None:
    if isinstance(node, TakeLater) and "group" in options:
        return  # async code runs on the loop
    build = line(node, **options)
    graph, trace = build(), Recorder()
    report = run(graph, fast, trace=trace)
    assert report.outcome == "done"
    assert graph["keep"].values == values
    assert report.nodes["take"].ended
    assert report.nodes["keep"].ended
    expected = reference_run(build())
    assert expected.outcome == "done"
    for edge in ("take.out -> behind.value", "behind.out -> keep.value"):
        assert trace.tokens(edge) == expected.tokens[edge]
    assert trace.values("take.out")[-1] is hfg.END


def test_without_anybody_looking_it_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)
    graph = line(Take(n=40), count=100)()
    assert run(graph).outcome == "done"
    assert graph["keep"].values == list(range(1, 41))


def test_what_was_written_leaves_with_what_end_writes() -> None:
    graph = line(Sums(n=3))()
    graph.connect("take.total", graph.add(Keep(), name="total").value)
    trace = Recorder()
    run(graph, trace=trace)
    assert trace.values("take.out") == [1, 2, 3, hfg.END]
    assert trace.values("take.total") == [hfg.NO_MESSAGE, hfg.NO_MESSAGE, 6, hfg.END]


def test_writing_an_output_twice_is_an_error_of_end() -> None:
    class Twice(Take):
        def end(self) -> None:
            self.out.send(9)

    with pytest.raises(hfg.errors.NodeError, match=r'"take" failed in end\(\): .*written twice in one firing'):
        run(line(Twice(n=2))())


@pytest.mark.rule("F12", "R5")
def test_a_source_that_never_ends_is_given_up_behind_it() -> None:
    graph = hfg.Graph()
    source, take, keep = graph.add(Clock(), max_rate_hz=1), graph.add(Take(n=3)), graph.add(Keep())
    graph.connect(source.out, take.value)
    graph.connect(take.out, keep.value)
    report = run(graph)
    assert (report.outcome, report.duration_s, keep.values) == ("done", 2.0, [1, 2, 3])


def test_a_source_that_has_written_before_it_ends_is_heard() -> None:
    class Last(hfg.Node):
        out = hfg.Output(int)

        def process(self) -> None:
            self.out.send(7)
            raise hfg.EndOfStream

    graph = hfg.Graph()
    keep = graph.add(Keep())
    graph.connect(graph.add(Last()).out, keep.value)
    run(graph)
    assert keep.values == [7]


@pytest.mark.rule("X1")
def test_in_a_slot_it_is_an_error_that_says_where_it_belongs() -> None:
    class Stops(hfg.Node):
        @hfg.slot
        def hear(self, value: int) -> None:
            raise hfg.EndOfStream

    graph = hfg.Graph()
    send, stops = graph.add(Send()), graph.add(Stops())
    graph.connect(graph.add(numbers(count=1)).out, send.value)
    graph.connect(send.rang, stops.hear)
    with pytest.raises(hfg.errors.NodeError, match=r"in slot hear, call 1: .* ends in process\(\) or ready\(\) alone"):
        run(graph)


def test_others_of_the_wave_are_not_touched() -> None:
    graph = hfg.Graph()
    source, take, other = graph.add(numbers(count=4)), graph.add(Take(n=2)), graph.add(forward())
    kept, all_of_them = graph.add(Keep()), graph.add(Keep())
    graph.connect(source.out, take.value)
    graph.connect(source.out, other.value)
    graph.connect(take.out, kept.value)
    graph.connect(other.out, all_of_them.value)
    run(graph)
    assert (kept.values, all_of_them.values) == ([1, 2], [1, 2, 3, 4])

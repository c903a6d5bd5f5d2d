"""How far a producer runs ahead of its consumer: pipelined edges, buffers, delays, and rates (F5, F6, F11, P4, P7)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

import hfg
from hfg import commands as c
from hfg.graph.structure.options import Release
from hfg.trace import CallEnded, CallStarted, FiringEnded, FiringStarted, TokenProcessed, TokenSent, TraceEvent
from tests.semantics.nodes import (
    Ear,
    Keep,
    KeepTokens,
    Ringing,
    add,
    forward,
    forward_later,
    gaps,
    merge,
    numbers,
    of_kind,
    run,
    scale,
    slow_numbers,
    tokens,
    traced,
)


def times(trace: list[TraceEvent], kind: type[FiringStarted] | type[FiringEnded], node: str) -> list[float]:
    """When the firings of a node began, or were over; but for the one in which it ended."""
    found = [event.time for event in of_kind(trace, kind) if event.node == node]
    return found[:-1]


def stamps(trace: list[TraceEvent], edge: str) -> list[float]:
    """When tokens were put on an edge."""
    return [event.time for event in of_kind(trace, TokenSent) if event.edge == edge]


class Slow(hfg.Node):
    """A call takes a second."""

    heard = hfg.State(factory=list)

    @hfg.slot
    async def hear(self, value: int) -> None:
        await asyncio.sleep(1)
        self.heard.append(value)


# --- F5, F6: taken is processed ---


@pytest.mark.rule("F5")
def test_pipelined_neighbours_work_at_the_same_time() -> None:
    """Two stages of a second each: four tokens take five seconds, one after the other eight."""
    graph = hfg.Graph()
    a = graph.add(forward_later(), name="a", release="pipelined")
    b = graph.add(forward_later(), name="b", release="pipelined")
    graph.add(numbers(count=4)) >> a >> b
    trace = traced(graph)
    assert times(trace, FiringStarted, "a") == [0, 1, 2, 3]
    assert times(trace, FiringStarted, "b") == [1, 2, 3, 4]
    assert trace[-1].time == 5


@pytest.mark.rule("F5")
def test_sequential_neighbours_take_turns() -> None:
    graph = hfg.Graph()
    a, b = graph.add(forward_later(), name="a"), graph.add(forward_later(), name="b")
    graph.add(numbers(count=2)) >> a >> b
    trace = traced(graph)
    assert times(trace, FiringStarted, "a") == [0, 2]
    assert times(trace, FiringStarted, "b") == [1, 3]


@pytest.mark.rule("F5", "P4")
def test_pipelined_one_token_is_under_work_and_one_waits() -> None:
    graph = hfg.Graph()
    slow = graph.add(forward_later(), release="pipelined")
    graph.add(numbers(count=4)) >> slow
    assert stamps(traced(graph), "numbers.out -> forward_later.value") == [0, 0, 1, 2, 3]


@pytest.mark.rule("F5")
def test_a_token_that_is_taken_pipelined_is_processed_before_the_function_runs() -> None:
    graph = hfg.Graph()
    graph.add(numbers(count=1)) >> graph.add(forward_later(), release="pipelined")
    trace = traced(graph)
    moments = {(type(event).__name__, getattr(event, "node", "")): event.time for event in reversed(trace)}
    assert moments["TokenProcessed", ""] == 0
    assert moments["FiringEnded", "forward_later"] == 1


@pytest.mark.rule("F5", "R1")
def test_auto_is_pipelined_where_it_crosses_groups_and_sequential_elsewhere() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    work, later = graph.add(forward(), group="work"), graph.add(forward_later())
    graph.add(numbers(count=3)) >> work >> later
    trace = traced(graph)
    assert stamps(trace, "numbers.out -> forward.value") == [0, 0, 0, 1]
    assert stamps(trace, "forward.out -> forward_later.value") == [0, 0, 1, 2]
    inside = hfg.Graph()
    inside.add(numbers(count=3)) >> inside.add(forward()) >> inside.add(forward_later())
    assert stamps(traced(inside), "numbers.out -> forward.value") == [0, 1, 2, 3]


@pytest.mark.rule("F5")
def test_one_input_may_be_pipelined_and_another_sequential() -> None:
    """`auto` looks at each edge: the thread goes on, the neighbour on the loop waits for the whole wave."""
    graph = hfg.Graph()
    graph.group("work", threads=1)
    near, far = graph.add(numbers(count=2), name="near"), graph.add(numbers(count=2), name="far", group="work")
    both = graph.add(add())
    graph.connect(near.out, both.a)
    graph.connect(far.out, both.b)
    graph.connect(both.out, graph.add(forward_later()).value)
    trace = traced(graph)
    assert stamps(trace, "near.out -> add.a") == [0, 1, 2]
    assert stamps(trace, "far.out -> add.b") == [0, 0, 1]


@pytest.mark.rule("F5", "F7")
@pytest.mark.parametrize("release", ["sequential", "pipelined"])
def test_a_fork_that_joins_again_gives_the_same(release: Release, fast: bool) -> None:
    graph = hfg.Graph()
    source, left = graph.add(gaps(count=6)), graph.add(forward(), name="left", release=release)
    right = graph.add(forward_later(), name="right", release=release)
    both, sink = graph.add(add(), release=release), graph.add(Keep(), release=release)
    graph.connect(source.out, left.value)
    graph.connect(source.out, right.value)
    graph.connect(left.out, both.a)
    graph.connect(right.out, both.b)
    graph.connect(both.out, sink.value)
    run(graph, fast)
    assert sink.values == [2, 6, 10]


@pytest.mark.rule("F6")
@pytest.mark.parametrize(("release", "expected"), [("auto", [0, 1, 2]), ("pipelined", [0, 0, 1])])
def test_an_edge_into_a_slot_is_free_when_the_call_is_over_or_pipelined_has_begun(
    release: Release, expected: list[float]
) -> None:
    graph = hfg.Graph()
    slow = graph.add(Slow(), release=release)
    graph.connect(graph.add(numbers(count=3)).out, slow.hear)
    trace = traced(graph)
    assert [event.time for event in of_kind(trace, TokenSent) if type(event.token.value) is int] == expected
    assert [event.time for event in of_kind(trace, CallStarted)] == [0, 1, 2]
    assert [event.time for event in of_kind(trace, CallEnded)] == [1, 2, 3]
    assert slow.heard == [1, 2, 3]
    assert len(of_kind(trace, TokenProcessed)) == 3


# --- P4: a buffer ---


@pytest.mark.rule("P4")
@pytest.mark.parametrize(
    ("buffer", "release", "expected"),
    [
        (0, "sequential", [0, 1, 2, 3, 4, 5]),
        (1, "sequential", [0, 0, 1, 2, 3, 4]),
        (2, "sequential", [0, 0, 0, 1, 2, 3]),
        (0, "pipelined", [0, 0, 1, 2, 3, 4]),
        (1, "pipelined", [0, 0, 0, 1, 2, 3]),
        (9, "pipelined", [0, 0, 0, 0, 0, 0]),
    ],
)
def test_a_producer_runs_ahead_by_the_tokens_of_the_buffer(
    buffer: int, release: Release, expected: list[float]
) -> None:
    graph = hfg.Graph()
    source, slow = graph.add(numbers(count=5)), graph.add(forward_later(), release=release)
    edge = graph.connect(source.out, slow.value, buffer=buffer)
    assert stamps(traced(graph), edge.label) == expected


@pytest.mark.rule("P4", "F5")
@pytest.mark.parametrize("buffer", [1, 2, 3])
@pytest.mark.parametrize("release", ["sequential", "pipelined"])
def test_a_buffer_is_as_many_pipelined_relays_in_a_row(buffer: int, release: Release) -> None:
    """The definition of the rule: nobody can tell the two apart by when the source may send, or what arrives when."""
    short, long = hfg.Graph(), hfg.Graph()
    for graph in (short, long):
        graph.add(numbers(count=7), name="source")
        graph.add(forward_later(), name="slow", release=release)
        graph.add(forward_later(), name="behind", release=release)
        graph.connect(graph["slow.out"], graph["behind.value"])
    short.connect(short["source.out"], short["slow.value"], buffer=buffer)
    before = "source"
    for number in range(buffer):
        relay = long.add(forward(), name=f"relay_{number}", release="pipelined")
        long.connect(long[f"{before}.out"], relay.value)
        before = relay.place.name
    long.connect(long[f"{before}.out"], long["slow.value"])
    for node in ("source", "slow", "behind"):
        seen = [
            [(event.time, event.kind) for event in of_kind(traced(graph), FiringStarted) if event.node == node]
            for graph in (short, long)
        ]
        assert seen[0] == seen[1]


@pytest.mark.rule("P4", "F4", "F12")
def test_silence_end_and_order_pass_through_a_buffer(fast: bool) -> None:
    graph = hfg.Graph()
    source, both, sink = graph.add(gaps(count=5)), graph.add(merge()), graph.add(Keep())
    late = graph.add(slow_numbers(count=2))
    graph.connect(source.out, both.a, buffer=2)
    graph.connect(late.out, both.b, buffer=2)
    graph.connect(both.out, sink.value, buffer=1)
    report = run(graph, fast)
    assert sink.values == [(1, 1), (None, 2), (3, None), (5, None)]
    assert report.nodes["merge"].ended
    assert report.nodes["keep"].ended


@pytest.mark.rule("P4", "A3", "A5")
def test_activity_travels_with_its_token_through_a_buffer() -> None:
    """One token carries it however many wait; the sender is inactive from the moment it has sent that."""
    graph = hfg.Graph()
    source, slow = graph.add(numbers(count=3)), graph.add(forward_later())
    edge = graph.connect(source.out, slow.value, active=True, buffer=2)
    graph.start.activates(source.ports.slots["activate"])
    trace = traced(graph)
    assert [token.activity for token in tokens(trace, edge.label)] == [1, 0, 0, 0]
    assert [(event.time, event.token.activity) for event in of_kind(trace, TokenSent)][:1] == [(0, 1)]


@pytest.mark.rule("P4", "P7")
@pytest.mark.parametrize("release", ["sequential", "pipelined"])
def test_initial_tokens_and_a_buffer_add_up(release: Release) -> None:
    """With d initial tokens and a buffer of n the producer goes on while at most d + n lie untaken."""
    graph = hfg.Graph()
    source, slow = graph.add(numbers(count=4)), graph.add(forward_later(), release=release)
    edge = graph.connect(source.out, slow.value, initial=[7], buffer=1)
    trace = traced(graph)
    assert stamps(trace, edge.label) == [0, 0, 0, 1, 2]
    assert [event.token.value for event in of_kind(trace, TokenSent) if event.edge == edge.label][:-1] == [1, 2, 3, 4]


@pytest.mark.rule("P4", "P7", "F4")
def test_a_ring_with_a_buffer_and_no_initial_token_is_refused() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers()), graph.add(add())
    graph.connect(source.out, node.a)
    graph.connect(node.out, node.b, buffer=3)
    with pytest.raises(hfg.errors.CheckFailed, match="ring of synchronous edges"):
        run(graph)


@pytest.mark.rule("P4", "P8")
def test_an_edge_into_a_parameter_may_have_a_buffer(fast: bool) -> None:
    graph = hfg.Graph()
    node, sink = graph.add(scale()), graph.add(Keep())
    graph.connect(graph.add(numbers(count=3)).out, node.value)
    graph.connect(graph.add(numbers(count=3)).out, node.ports.parameters["factor"], buffer=2)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 4, 9]


@pytest.mark.rule("P4", "F10")
def test_disabling_discards_what_lies_in_a_buffer_and_frees_the_producer() -> None:
    graph = hfg.Graph()
    source, slow = graph.add(numbers(count=9)), graph.add(Keep(), name="slow", max_rate_hz=1)
    other = graph.add(KeepTokens())
    edge = graph.connect(source.out, slow.value, buffer=2)
    graph.connect(source.out, other.value)
    graph.connect(graph.add(slow_numbers(count=1, pause_s=0.5)).out, slow.ports.slots["disable"])
    report = run(graph)
    assert [(token.value, token.stamp) for token in other.tokens] == [
        *((number, 0) for number in (1, 2, 3, 4)),
        *((number, 0.5) for number in (5, 6, 7, 8, 9)),
    ]
    found = report.edges[edge.label]
    assert (found.sent, found.dropped) == (4, 3)
    assert slow.values == [1]


@pytest.mark.rule("P4")
def test_a_buffer_is_for_data_into_inputs_and_a_whole_number() -> None:
    graph = hfg.Graph()
    source, rings, keep, ear = graph.add(numbers()), graph.add(Ringing()), graph.add(Keep()), graph.add(Ear())
    with pytest.raises(hfg.errors.ConnectionError, match=r'"keep.value": buffer=2 is for edges from outputs'):
        graph.connect(rings.rang, keep.value, buffer=2)
    with pytest.raises(hfg.errors.ConnectionError, match=r'"ear.hear": buffer=2 is for edges into inputs'):
        graph.connect(source.out, ear.hear, buffer=2)
    for wrong in (-1, 1.5, True, "2", None):
        with pytest.raises(hfg.errors.ConnectionError, match="buffer must be a whole number from 0 on"):
            graph.connect(source.out, keep.value, buffer=wrong)  # type: ignore[arg-type]
    assert graph.edges == []


@pytest.mark.rule("P4", "G1")
def test_buffers_of_edges_that_relays_join_add_up() -> None:
    class Box(hfg.Subgraph):
        value = hfg.Input(int)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.value.inner, graph.add(forward_later()).value, buffer=1)

    graph = hfg.Graph()
    graph.connect(graph.add(numbers(count=4)).out, graph.add(Box()).value, buffer=1)
    assert stamps(traced(graph), "numbers.out -> box/forward_later.value") == [0, 0, 0, 1, 2]


@pytest.mark.rule("P4", "R4")
def test_a_buffer_is_drawn_and_undrawn_by_commands_also_while_the_graph_runs() -> None:
    graph = hfg.Graph()
    graph.add(numbers(count=4), name="source")
    graph.add(forward_later(), name="slow")
    connect = c.Connect("source.out", "slow.value", buffer=2)
    assert c.decode(c.encode([connect])) == [connect]
    graph.edit(connect)
    assert graph.edges[0].options.buffer == 2
    graph.undo()
    assert graph.edges == []

    async def main() -> tuple[int, int]:
        async with hfg.running(graph, clock="virtual") as run:
            await run.edit(connect)
            await asyncio.sleep(0.5)
            found = run.statistics().edges["source.out -> slow.value"]
            return found.untaken, found.capacity or 0

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()) == (2, 3)


# --- F11: the grid ---


@hfg.node
async def at(*, moments: tuple[float, ...] = ()) -> AsyncIterator[float]:
    """The moments, each at its time."""
    for moment in moments:
        await asyncio.sleep(max(0.0, moment - hfg.now()))
        yield moment


def starts(moments: tuple[float, ...], rate_hz: float) -> list[float]:
    """When a node with a rate starts, if its tokens come at these moments."""
    graph = hfg.Graph()
    graph.connect(graph.add(at(moments=moments)).out, graph.add(KeepTokens(), max_rate_hz=rate_hz).value, buffer=9)
    return [round(start, 9) for start in times(traced(graph), FiringStarted, "keep_tokens")]


@pytest.mark.rule("F11")
@pytest.mark.parametrize(
    ("moments", "expected"),
    [
        ((0, 0, 0), [0, 1, 2]),
        ((0.25, 0.25, 0.25), [0.25, 1.25, 2.25]),  # the grid begins with the first
        ((0, 1.75, 1.75, 1.75), [0, 1.75, 2, 3]),  # a late start does not move it
        ((0, 3.5, 3.5, 3.5), [0, 3.5, 4, 5]),  # what was missed by more than a period is not made up
        ((0, 1, 1.5, 1.5), [0, 1, 2, 3]),  # at most one start in each period
    ],
)
def test_starts_are_due_on_a_grid(moments: tuple[float, ...], expected: list[float]) -> None:
    assert starts(moments, rate_hz=1) == expected


@pytest.mark.rule("F11")
def test_the_grid_does_not_drift_by_sums_of_floats() -> None:
    """A tenth added a thousand times is 99.9999999999986; the thousandth place of the grid is 100, and exactly that."""
    graph = hfg.Graph()
    sink = graph.add(KeepTokens())
    graph.connect(graph.add(numbers(count=1001), max_rate_hz=10).out, sink.value)
    run(graph)
    assert [token.stamp for token in sink.tokens] == [number / 10 for number in range(1001)]


@pytest.mark.rule("F11")
def test_silent_firings_take_no_place_on_the_grid() -> None:
    graph = hfg.Graph()
    node = graph.add(forward(), max_rate_hz=1)
    graph.connect(graph.add(gaps(count=5)).out, node.value, buffer=9)
    trace = [(event.kind, event.time) for event in of_kind(traced(graph), FiringStarted) if event.node == "forward"]
    assert trace == [("process", 0), ("silent", 1), ("process", 1), ("silent", 2), ("process", 2), ("end", 3)]


@pytest.mark.rule("F11", "F10")
def test_a_node_that_is_enabled_again_keeps_its_grid() -> None:
    graph = hfg.Graph()
    node = graph.add(KeepTokens(), max_rate_hz=1)
    graph.connect(graph.add(at(moments=(0, 1, 1.6)), name="source").out, node.value)
    graph.connect(graph.add(at(moments=(1.25,)), name="off").out, node.ports.slots["disable"])
    graph.connect(graph.add(at(moments=(1.5,)), name="on").out, node.ports.slots["enable"])
    assert times(traced(graph), FiringStarted, "keep_tokens") == [0, 1, 2]

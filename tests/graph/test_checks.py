"""What the check finds, and what it leaves alone."""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.errors import Problem
from hfg.graph import Graph, Subgraph
from hfg.graph.checks import check
from hfg.graph.flat import flatten


class Unit(hfg.Node):
    a = hfg.Input(int, optional=True)
    b = hfg.Input(int, optional=True)
    out = hfg.Output(int)
    seen = hfg.Event(int)
    gain = hfg.Parameter(1)

    def process(self, a: int | None, b: int | None) -> int: ...

    @hfg.slot
    def look(self, at: int) -> None: ...


class Need(hfg.Node):
    a = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, a: int) -> int:
        return a


class Listener(hfg.Node):
    a = hfg.Input(int)

    @hfg.slot
    def look(self, at: int) -> None: ...


class Loop(Subgraph):
    """A slot that leads straight out again."""

    begin = hfg.slot(type=int)
    done = hfg.Event(int)

    def build(self, graph: Graph) -> None:
        graph.connect(self.begin.inner, self.done.inner)


class Box(Subgraph):
    a = hfg.Input(int)
    look = hfg.slot(type=int)
    deep = hfg.slot(type=int)
    out = hfg.Output(int)
    seen = hfg.Event(int)
    gain = hfg.Parameter(2)

    def build(self, graph: Graph) -> None:
        self.unit, self.other = graph.add(Unit()), graph.add(Unit())
        graph.connect(self.a.inner, self.unit.a)
        graph.connect(self.look.inner, self.unit.look)
        graph.connect(self.deep.inner, self.unit.b)
        graph.connect(self.unit.out, self.out.inner)
        graph.connect(self.unit.seen, self.seen.inner)
        graph.connect(self.other.seen, self.seen.inner)


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    yield from range(count)


@hfg.node
def seven() -> int:
    return 7


@hfg.node
def clock() -> float:
    return time.monotonic()


@hfg.node
def twice() -> int:
    return seven.function() * 2


@pytest.fixture
def graph() -> Graph:
    return Graph("fetch")


def found(graph: Graph, severity: str = "error") -> list[Problem]:
    return [problem for problem in graph.check() if problem.severity == severity]


def one(graph: Graph, severity: str = "error") -> Problem:
    (problem,) = found(graph, severity)
    return problem


def test_sound_graph_has_no_problems(graph: Graph) -> None:
    source, box, need = graph.add(numbers()), graph.add(Box()), graph.add(Need())
    graph.connect(source.out, box.a)
    graph.connect(box.out, need.a)
    graph.connect(box.seen, graph.add(Unit()).look)
    assert graph.check() == []


def test_problem_reads_as_a_sentence(graph: Graph) -> None:
    graph.add(Unit(), group="visoin")
    graph.group("vision")
    assert str(one(graph)) == (
        'error at "unit": its group "visoin" is not declared: did you mean "vision"?; '
        'declare it with graph.group("visoin", threads=1), or correct the name'
    )


def test_errors_come_first(graph: Graph) -> None:
    graph.add(Need())
    graph.add(Unit(), group="nowhere")
    assert [problem.severity for problem in graph.check()] == ["error", "warning"]


# --- groups ---


@pytest.mark.rule("R1")
def test_undeclared_group_is_told_where_it_is_named(graph: Graph) -> None:
    graph.add(Box(), group="vision")
    assert one(graph).path == "box"
    graph.group("vision")
    assert not found(graph)


# --- rings ---


@pytest.mark.rule("P7")
def test_synchronous_ring_without_initial_tokens_is_an_error_that_names_it(graph: Graph) -> None:
    first, second, third = (graph.add(Unit()) for _ in range(3))
    graph.connect(first.out, second.a)
    graph.connect(second.out, third.a)
    graph.connect(third.out, first.a)
    assert "unit -> unit_2 -> unit_3 -> unit" in one(graph).what


@pytest.mark.rule("P7")
def test_ring_with_an_initial_token_a_slot_or_an_event_is_none(graph: Graph) -> None:
    first, second, third = (graph.add(Unit()) for _ in range(3))
    graph.connect(first.out, first.a, initial=[0])
    graph.connect(second.out, second.look)
    graph.connect(third.seen, third.look)
    assert not found(graph)


@pytest.mark.rule("P7", "P8")
def test_own_parameter_is_waited_for_too(graph: Graph) -> None:
    unit = graph.add(Unit())
    graph.connect(unit.out, unit.ports.parameters["gain"])
    assert "unit -> unit" in one(graph).what


@pytest.mark.rule("P7", "P8")
def test_signals_into_a_parameter_hold_nobody_up(graph: Graph) -> None:
    unit = graph.add(Unit())
    graph.connect(unit.seen, unit.ports.parameters["gain"])
    assert not graph.check()


@pytest.mark.rule("P7", "G1")
def test_ring_through_a_subgraph_is_found(graph: Graph) -> None:
    box, unit = graph.add(Box()), graph.add(Unit())
    graph.connect(box.out, unit.a)
    graph.connect(unit.out, box.a)
    assert "box/unit -> unit -> box/unit" in one(graph).what


@pytest.mark.rule("P7")
def test_ring_that_needs_its_own_signal_is_a_warning(graph: Graph) -> None:
    first, second = graph.add(Unit()), graph.add(Unit())
    graph.connect(first.seen, second.a)
    graph.connect(second.out, first.a)
    assert "needs its own signal: unit -> unit_2 -> unit" in one(graph, "warning").what
    assert not found(graph)


@pytest.mark.rule("P7")
@pytest.mark.parametrize("begin", ["slot", "initial", "automatic"])
def test_ring_of_signals_that_something_begins_is_none(graph: Graph, begin: str) -> None:
    first, second = graph.add(Unit()), graph.add(Unit())
    graph.connect(second.out, first.a, initial=[1] if begin == "initial" else ())
    if begin == "automatic":
        lost: hfg.Node = graph.add(Any_())
        graph.connect(first.activated, lost.ports.inputs["a"])
        graph.connect(lost.ports.outputs["out"], second.a)
    else:
        graph.connect(first.seen, second.a)
    if begin == "slot":
        graph.connect(graph.add(Unit()).seen, first.look)
    assert not graph.check()


class Any_(hfg.Node):  # noqa: N801
    a = hfg.Input(object)
    out = hfg.Output(int)

    def process(self, a: object) -> int: ...


# --- joined edges ---


@pytest.mark.rule("P2", "G1")
def test_two_edges_into_one_input_by_way_of_a_subgraph_are_an_error(graph: Graph) -> None:
    first, second, box = graph.add(Unit()), graph.add(Unit()), graph.add(Box())
    graph.connect(first.seen, box.deep)
    assert not found(graph)
    graph.connect(second.out, box.deep)
    problem = one(graph)
    assert (problem.path, "unit.seen -> box/unit.b" in problem.what) == ("unit_2.out -> box/unit.b", True)


@pytest.mark.rule("P2", "G1")
def test_signals_that_join_in_a_subgraph_do_not_reach_an_input(graph: Graph) -> None:
    box = graph.add(Box())
    graph.connect(box.seen, graph.add(Unit()).a)
    assert one(graph).path == "box/unit_2.seen -> unit.a"


@pytest.mark.rule("P2", "G1")
def test_same_edge_by_two_ways_is_an_error(graph: Graph) -> None:
    class Twice(Subgraph):
        one = hfg.slot(type=int)
        two = hfg.slot(type=int)

        def build(self, graph: Graph) -> None:
            unit = graph.add(Unit())
            graph.connect(self.one.inner, unit.look)
            graph.connect(self.two.inner, unit.look)

    twice, unit = graph.add(Twice()), graph.add(Unit())
    graph.connect(unit.seen, twice.one)
    graph.connect(unit.seen, twice.two)
    assert "connected twice" in one(graph).what


@pytest.mark.rule("P4", "G1")
def test_queue_on_what_turns_out_to_be_synchronous_is_an_error(graph: Graph) -> None:
    class Queue(Subgraph):
        a = hfg.Input(int)

        def build(self, graph: Graph) -> None:
            graph.connect(self.a.inner, graph.add(Unit()).a, capacity=3)

    unit = graph.add(Unit())
    graph.connect(unit.out, graph.add(Queue()).a)
    graph.connect(unit.seen, graph.add(Queue()).a)
    problem = one(graph)
    assert problem.path == "unit.out -> queue/unit.a"
    assert "capacity=3 is set on queue.a.inner -> queue/unit.a" in problem.what


@pytest.mark.rule("P4", "G1")
def test_a_buffer_on_what_turns_out_to_be_a_signal_or_to_lead_into_a_slot_is_an_error(graph: Graph) -> None:
    class Ahead(Subgraph):
        a = hfg.Input(int)

        def build(self, graph: Graph) -> None:
            graph.connect(self.a.inner, graph.add(Unit()).a, buffer=3)

    unit, box = graph.add(Unit()), graph.add(Box())
    graph.connect(unit.seen, graph.add(Ahead()).a)
    graph.connect(unit.out, graph.add(Ahead()).a)
    graph.connect(unit.out, box.look, buffer=2)
    found = [problem for problem in graph.check() if problem.check == "buffer-without-join"]
    assert [problem.path for problem in found] == ["unit.seen -> ahead/unit.a", "unit.out -> box/unit.look"]
    assert "buffer=3 is set on ahead.a.inner -> ahead/unit.a" in found[0].what
    assert "buffer=2 is set on unit.out -> box.look" in found[1].what


@pytest.mark.rule("P7", "G1")
def test_initial_tokens_that_turn_out_to_lie_before_a_slot_are_an_error(graph: Graph) -> None:
    box, unit = graph.add(Box()), graph.add(Unit())
    graph.connect(unit.seen, box.look, initial=[1])
    assert "initial tokens" in one(graph).what


@pytest.mark.rule("G1")
def test_ring_of_relays_without_a_node_is_an_error(graph: Graph) -> None:
    loop, unit = graph.add(Loop()), graph.add(Unit())
    graph.connect(unit.seen, loop.begin)
    graph.connect(loop.done, loop.begin)
    assert "goes round through ports of subgraphs" in one(graph).what


# --- iteration ---


class Each(Box):
    iterate_over = ("a",)


@pytest.mark.rule("G4")
def test_sources_inside_of_an_iteration_are_an_error(graph: Graph) -> None:
    each = graph.add(Each())
    each.graph.add(numbers())
    assert (one(graph).path, "a source inside" in one(graph).what) == ("each/numbers", True)


@pytest.mark.rule("G4")
def test_activity_that_arrives_at_an_iteration_through_another_subgraph_is_an_error(graph: Graph) -> None:
    class Around(Subgraph):
        a = hfg.Input(list[int])

        def build(self, graph: Graph) -> None:
            graph.connect(self.a.inner, graph.add(Each()).ports.inputs["a"])

    class Lists(hfg.Node):
        many = hfg.Event(list[int])

        @hfg.slot
        def look(self) -> None: ...

    graph.connect(graph.add(Lists()).many, graph.add(Around()).a)
    assert "an event edge into" in one(graph).what


@pytest.mark.rule("G4", "A10")
def test_start_does_not_reach_into_an_iteration(graph: Graph) -> None:
    each = graph.add(Each())
    each.graph.start.activates(each.unit.activate)
    assert "crosses the border" in one(graph).what


@pytest.mark.rule("G4", "A11")
def test_gate_does_not_reach_into_an_iteration(graph: Graph) -> None:
    each, unit = graph.add(Each()), graph.add(Unit())
    graph.gate(each.unit, by=unit)
    assert (one(graph).path, "a gate names a node" in one(graph).what) == ("each/unit", True)


@pytest.mark.rule("G4")
def test_inside_of_an_iteration_is_checked_too(graph: Graph) -> None:
    each = graph.add(Each())
    each.graph.connect(each.other.out, each.other.a)
    assert "each/unit_2 -> each/unit_2" in one(graph).what


# --- warnings ---


@pytest.mark.rule("F1")
def test_unconnected_mandatory_input_is_a_warning(graph: Graph) -> None:
    graph.add(Need())
    graph.add(Unit())
    graph.add(Listener())  # never fires anyhow, which is what it is told instead
    assert sorted(problem.path for problem in found(graph, "warning")) == ["listener", "need.a"]


@pytest.mark.rule("F1", "G1")
def test_input_behind_an_unconnected_relay_is_unconnected(graph: Graph) -> None:
    class Inside(Subgraph):
        a = hfg.Input(int)

        def build(self, graph: Graph) -> None:
            graph.connect(self.a.inner, graph.add(Need()).a)

    inside = graph.add(Inside())
    assert [p.path for p in found(graph, "warning") if "nothing leads" in p.what] == ["inside/need.a"]
    graph.connect(graph.add(numbers()).out, inside.a)
    assert not [p for p in graph.check() if "nothing leads" in p.what]


@pytest.mark.rule("G1")
def test_edge_to_a_parameter_that_stands_for_nothing_is_a_warning(graph: Graph) -> None:
    graph.connect(graph.add(Unit()).out, graph.add(Box()).gain)
    assert [problem.path for problem in found(graph, "warning") if problem.check == "idle-parameter"] == ["box.gain"]


@pytest.mark.rule("F2")
def test_source_that_certainly_runs_for_ever_is_a_warning(graph: Graph) -> None:
    graph.add(seven())
    graph.add(seven(), max_rate_hz=10)
    graph.add(numbers())
    assert [problem.path for problem in found(graph, "warning") if problem.check == "endless-source"] == ["seven"]


def test_types_that_cannot_be_found_by_name_are_told_once(graph: Graph) -> None:
    class Local(hfg.Node):
        @hfg.slot
        def look(self) -> None: ...

    for _ in range(3):
        graph.add(Local())
    (problem,) = [problem for problem in found(graph, "hint") if problem.check == "unnamed-type"]
    assert problem.path == "local"
    assert "2 more nodes" in problem.what


# --- scale ---


def chain(length: int) -> Graph:
    graph = Graph()
    last: Any = graph.add(numbers())
    for _ in range(length - 1):
        node = graph.add(Need())
        graph.connect(last.out, node.a)
        last = node
    return graph


@pytest.mark.slow
def test_chain_of_five_thousand_does_not_recurse() -> None:
    graph = chain(5_000)
    assert graph.check() == []
    assert len(flatten(graph).edges) == 4_999


@pytest.mark.slow
def test_ring_of_five_thousand_is_found() -> None:
    graph = Graph()
    nodes = [graph.add(Need()) for _ in range(5_000)]
    for node, after in zip(nodes, [*nodes[1:], nodes[0]], strict=True):
        graph.connect(node.out, after.a)
    (problem,) = check(graph)
    assert problem.severity == "error"
    assert "need -> need_2 -> need_3 -> need_4 -> need_5 -> need_6 -> 4993 more -> need_5000 -> need" in problem.what


@pytest.mark.slow
def test_node_with_its_edge_costs_less_than_three_kilobytes() -> None:
    """Node, ports, edge, and both once more in the flat graph; measured 1.1 to 1.4 kB."""
    length = 1_000
    warm = chain(2)
    flatten(warm)
    gc.collect()
    tracemalloc.start()
    try:
        graph = chain(length)
        flat = flatten(graph)
        gc.collect()
        used, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(flat.edges) == length - 1
    assert used / length < 3_000

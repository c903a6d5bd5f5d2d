"""Vectors of ports: as many of one kind as a node is made with, each a port like any other."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg.ports import InputPort, PortVector
from hfg.testing import Recorder, fire, reference_run
from tests.semantics.nodes import Keep, drive, forward, numbers, run


class Merge(hfg.Node):
    """Give the values of all inputs as a list."""

    values = hfg.Inputs(int)

    def process(self, values: list[int]) -> list[int]:
        return values


class Stars(hfg.Node):
    """The same with `*values`, between other inputs and behind a parameter."""

    first = hfg.Input(int)
    values = hfg.Inputs(int, 2)
    factor = hfg.Parameter(10)

    def process(self, first: int, *values: int) -> int:
        return first + self.factor * sum(values)


@hfg.node(inputs={"values": hfg.Inputs(int, 2)}, outputs=int, parameters={"factor": 2})
def total(*values: int, factor: int = 2) -> int:
    return factor * sum(values)


class Deal(hfg.Node):
    """Deal the values out in turn."""

    value = hfg.Input(int)
    out = hfg.Outputs(int, 3)
    dealt = hfg.Events(int, "out")
    turn = hfg.State(0)

    def process(self, value: int) -> None:
        hand = self.turn % len(self.out)
        self.turn += 1
        self.out[hand].send(value)
        self.dealt[hand].trigger(value)


@hfg.node(inputs={"value": int}, outputs={"parts": hfg.Outputs(int, 2), "rest": int})
def split(value: int) -> tuple[list[int | None], int]:
    return [value, None], -value


class Desk(hfg.Node):
    """Answers at several windows."""

    answered = hfg.Event(str)

    @hfg.Slots(int, 3)
    def ask(self, number: int, value: int) -> None:
        self.answered.trigger(f"{value} at {number}")

    @hfg.Slots(object, "ask")
    def ring(self, number: int) -> None:
        self.answered.trigger(f"ring at {number}")


class SomeOf(hfg.Node):
    """Which of the inputs hold a value."""

    values = hfg.Inputs(int, 3, optional=True, default=-1)

    def process(self, values: list[hfg.Token[int]]) -> list[Any]:
        return [getattr(value, "value", value) for value in values]


def merging(count: int) -> tuple[hfg.Graph, Keep]:
    graph = hfg.Graph("merging")
    merge = graph.add(Merge(values=count))
    for number, port in enumerate(merge.values):
        graph.connect(graph.add(numbers(count=number + 2)).out, port)
    keep = graph.add(Keep())
    graph.connect(merge.ports.outputs["out"], keep.value)
    return graph, keep


# --- what they are ---


@pytest.mark.rule("P1", "F3")
@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_vector_of_inputs_joins_as_many_as_the_node_is_made_with(count: int, fast: bool) -> None:
    graph, keep = merging(count)
    run(graph, fast)
    assert keep.values == [[1] * count, [2] * count]


def test_each_port_has_a_name_a_number_and_a_path() -> None:
    graph = hfg.Graph()
    merge = graph.add(Merge(values=3))
    vector: PortVector[InputPort[int]] = merge.values
    assert [port.path for port in vector] == ["merge.values[0]", "merge.values[1]", "merge.values[2]"]
    assert len(vector) == 3
    assert vector[-1] is vector[2] is graph["merge.values[2]"] is merge.ports.inputs["values[2]"]
    assert vector[1:] == [vector[1], vector[2]]
    assert vector.path == "merge.values"
    assert repr(vector) == "<3 inputs merge.values>"
    assert repr(merge) == '<Merge(values=3) at "merge">'


def test_nodes_of_one_size_share_a_type_and_all_are_of_the_class() -> None:
    assert type(Merge(values=3)) is type(Merge(values=3)) is not type(Merge(values=4))
    assert isinstance(Merge(values=3), Merge)
    assert Merge(values=3)._type.reference == "tests.semantics.test_vectors:Merge"


def test_arguments_may_be_a_list_or_all_further_ones(fast: bool) -> None:
    graph, keep = hfg.Graph(), Keep()
    stars = graph.add(Stars(values=2))
    for port in (stars.first, *stars.values):
        graph.connect(graph.add(numbers(count=2)).out, port)
    graph.connect(stars.ports.outputs["out"], graph.add(keep).value)
    run(graph, fast)
    assert keep.values == [21, 42]


def test_a_function_has_them_by_its_call(fast: bool) -> None:
    graph, keep = hfg.Graph(), Keep()
    sum_of_three = graph.add(total(values=3, factor=5))
    for port in sum_of_three.values:
        graph.connect(graph.add(numbers(count=1)).out, port)
    graph.connect(sum_of_three.out, graph.add(keep).value)
    run(graph, fast)
    assert keep.values == [15]
    assert len(total().values) == 2


def test_outputs_and_events_are_written_by_number(fast: bool) -> None:
    graph = hfg.Graph()
    deal = graph.add(Deal())
    graph.connect(graph.add(numbers(count=5)).out, deal.value)
    hands = [graph.add(Keep(), name=f"hand_{number}") for number in range(3)]
    heard = [graph.add(Keep(), name=f"heard_{number}") for number in range(3)]
    for number in range(3):
        graph.connect(deal.out[number], hands[number].value)
        graph.connect(deal.dealt[number], heard[number].value)
    run(graph, fast)
    assert [hand.values for hand in hands] == [one.values for one in heard] == [[1, 4], [2, 5], [3]]


def test_what_is_given_back_for_a_vector_of_outputs_is_a_list(fast: bool) -> None:
    graph = hfg.Graph()
    node = graph.add(split())
    graph.connect(graph.add(numbers(count=2)).out, node.value)
    keeps = [graph.add(Keep()) for _ in range(3)]
    for port, keep in zip([*node.parts, node.rest], keeps, strict=True):
        graph.connect(port, keep.value)
    run(graph, fast)
    assert [keep.values for keep in keeps] == [[1, 2], [], [-1, -2]]


@pytest.mark.rule("F6")
def test_slots_are_told_apart_by_their_number(fast: bool) -> None:
    async def main() -> list[object]:
        graph, keep = hfg.Graph(), Keep()
        desk = graph.add(Desk(ask=2))
        graph.connect(desk.answered, graph.add(keep).value)
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(desk.ask[1], 7)
            await run.trigger("desk.ask[0]", 8)
            await run.trigger(desk.ring[1])
            await run.wait_quiet()
        return keep.values

    assert drive(main) == ["7 at 1", "8 at 0", "ring at 1"]


@pytest.mark.rule("P6")
def test_optional_ones_hold_their_default_where_nothing_is_connected(fast: bool) -> None:
    graph, keep = hfg.Graph(), Keep()
    some = graph.add(SomeOf())
    graph.connect(graph.add(numbers(count=1)).out, some.values[1])
    graph.connect(some.ports.outputs["out"], graph.add(keep).value)
    run(graph, fast)
    assert keep.values == [[-1, 1, -1]]


@pytest.mark.rule("G1")
def test_a_subgraph_has_vectors_too(fast: bool) -> None:
    class Lanes(hfg.Subgraph):
        values = hfg.Inputs(int, 2)
        results = hfg.Outputs(int, "values")
        pokes = hfg.Slots(object, 2)

        def build(self, graph: hfg.Graph) -> None:
            for value, result in zip(self.values, self.results, strict=True):
                lane = graph.add(forward())
                graph.connect(value.inner, lane.value)
                graph.connect(lane.out, result.inner)

    graph = hfg.Graph()
    lanes = graph.add(Lanes(values=3))
    keeps = [graph.add(Keep()) for _ in range(3)]
    for value, result, keep in zip(lanes.values, lanes.results, keeps, strict=True):
        graph.connect(graph.add(numbers(count=2)).out, value)
        graph.connect(result, keep.value)
    assert graph["lanes.values[1].inner"] is lanes.values[1].inner
    run(graph, fast)
    assert [keep.values for keep in keeps] == [[1, 2]] * 3


# --- everywhere ---


@pytest.mark.rule("R4")
def test_commands_make_them_copy_them_and_replace_them() -> None:
    graph, _ = merging(2)
    reference = hfg.reference_of(Merge)
    assert reference is not None
    add = hfg.commands.Add(reference, "other", parameters={"values": 3})
    graph.edit(*hfg.commands.decode(hfg.commands.encode([add])))
    graph.edit(hfg.commands.Copy("other", "copy"), hfg.commands.Connect("numbers.out", "copy.values[2]"))
    assert [len(graph[path].values) for path in ("merge", "other", "copy")] == [2, 3, 3]
    graph.edit(hfg.commands.Replace("copy", reference, {"values": 4}))
    assert len(graph["copy"].values) == 4
    with pytest.raises(hfg.errors.GraphError, match=r'"values\[2\]"'):
        graph.edit(hfg.commands.Replace("copy", reference, {"values": 1}))
    graph.undo()
    assert len(graph["copy"].values) == 3


def test_grouping_nodes_leads_them_over_the_border() -> None:
    graph, keep = merging(2)
    graph.edit(hfg.commands.Enclose(("merge",), "box"))
    run(graph)
    assert keep.values == [[1, 1], [2, 2]]


def test_the_check_and_the_drawing_name_each() -> None:
    graph = hfg.Graph()
    merge = graph.add(Merge(values=2))
    graph.connect(graph.add(numbers()).out, merge.values[1])
    assert "merge.values[0]" in [problem.path for problem in graph.check()]
    assert "values[1]" in graph.draw()


def test_one_firing_takes_a_list_for_all() -> None:
    assert fire(Merge(values=2), values=[1, 2]).outputs == {"out": [1, 2]}
    some: dict[str, Any] = {"values[1]": 5}
    assert fire(SomeOf(), **some).outputs == {"out": [-1, 5, -1]}


@pytest.mark.rule("F3")
@pytest.mark.parametrize("build", [lambda: merging(3)[0]])
def test_the_oracle_fires_them_alike(build: Callable[[], hfg.Graph]) -> None:
    recorder = Recorder()
    hfg.run(build(), clock="virtual", trace=recorder)
    expected = reference_run(build())
    for label in ("numbers.out -> merge.values[0]", "merge.out -> keep.value"):  # a longer source is given up (R5)
        assert recorder.tokens(label) == expected.tokens[label]


# --- wrong use ---


def test_a_vector_without_a_size_is_refused() -> None:
    with pytest.raises(TypeError, match=r'merge needs to know how many inputs "values" has: write Merge\(values=3\)'):
        Merge()
    with pytest.raises(hfg.errors.GraphError, match='node "merge": merge needs to know'):
        hfg.Graph().edit(hfg.commands.Add("tests.semantics.test_vectors:Merge", "merge"))


@pytest.mark.parametrize("size", [0, -1, True, 2.0, "3"])
def test_a_size_that_is_no_number_from_1_on_is_refused(size: Any) -> None:
    with pytest.raises(
        ValueError, match=r'merge has 1 or more inputs "values", got values=.*; write Merge\(values=3\)'
    ):
        Merge(values=size)
    if not isinstance(size, str):
        with pytest.raises(hfg.errors.DeclarationError, match="hfg.Inputs needs its size, 1 or more, got"):
            hfg.Inputs(int, size)


def test_a_number_that_there_is_none_of_is_refused() -> None:
    merge = hfg.Graph().add(Merge(values=2))
    with pytest.raises(IndexError, match=r'"merge.values" has 2 inputs, numbered from 0 to 1, got 2; .* values=3'):
        merge.values[2]


def test_the_vector_itself_is_no_end_of_an_edge() -> None:
    graph = hfg.Graph()
    merge, source = graph.add(Merge(values=2)), graph.add(numbers())
    with pytest.raises(hfg.errors.ConnectionError, match=r"<2 inputs merge.values>.*name one of them.*\[0\]"):
        graph.connect(source.out, merge.values)  # type: ignore[call-overload]
    with pytest.raises(hfg.errors.GraphError, match=r'"merge.values" is a vector of 2 inputs.*"merge.values\[0\]"'):
        graph.connect("numbers.out", "merge.values")


def test_a_size_never_changes() -> None:
    merge = hfg.Graph().add(Merge(values=2))
    assert "values" not in merge.ports.parameters
    with pytest.raises(ValueError, match=r'"merge.values" is a vector of 2 ports, and the ports of a node are fixed:'):
        merge._set_parameter("values", 3)


def test_the_size_of_another_must_be_one() -> None:
    with pytest.raises(hfg.errors.DeclarationError, match='should have the size of "other", which is not a vector'):

        class Broken(hfg.Node):
            values = hfg.Inputs(int, "other")

            def process(self, values: list[int]) -> None: ...


def test_a_list_of_another_length_is_an_error_of_the_firing() -> None:
    @hfg.node(inputs={"value": int}, outputs={"parts": hfg.Outputs(int, 2)})
    def three(value: int) -> list[int]:
        return [value] * 3

    graph = hfg.Graph()
    graph.connect(graph.add(numbers(count=1)).out, graph.add(three()).value)
    with pytest.raises(hfg.errors.NodeError, match="for a vector of 2 outputs; return a list with one value for each"):
        run(graph)


def test_a_handler_of_slots_takes_the_number() -> None:
    with pytest.raises(hfg.errors.DeclarationError, match="takes the number of the slot and at most one value"):

        class Broken(hfg.Node):
            @hfg.Slots(int, 2)
            def ask(self) -> None: ...

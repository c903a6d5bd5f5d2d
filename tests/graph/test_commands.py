"""Edits as commands on a graph that does not run: data, checked, undone exactly (rule R4)."""

from __future__ import annotations

import asyncio
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import annotated_types as at
import msgspec
import pytest
import reactivex
import reactivex.operators as ops

import hfg
from hfg import commands as c
from hfg.errors import GraphError, HfgError, UsageError
from hfg.graph import GroupSpec
from hfg.graph.flat import flatten
from hfg.graph.structure.history import MOST_STEPS
from hfg.testing.nodes import (
    Counter,
    Scaled,
    Tally,
    add,
    double,
    script,
    sink,
)
from tests.semantics.nodes import named
from tests.support.edits import drawn, random_edit
from tests.support.making import WIDE, Allowed, SeededChooser, random_plan

SEQUENCES = 60  # of 20 edits each; runs are edited in tests/semantics/test_edits.py


def chain() -> hfg.Graph:
    graph = hfg.Graph("chain")
    source = graph.add(script(values=(1, 2, 3)))
    first, second = graph.add(double(), name="first"), graph.add(double(), name="second")
    source >> first >> second >> graph.add(sink())
    return graph


def sent(graph: hfg.Graph) -> list[object]:
    from hfg.testing import recorder

    trace = recorder()
    hfg.run(graph, clock="virtual", trace=trace)
    return trace.values(next(edge for edge in trace.edges() if edge.endswith("sink.value")))[:-1]  # END


def edges(graph: hfg.Graph) -> list[str]:
    return [edge.label for edge in graph.edges]


# --- each command ---


@pytest.mark.rule("R4")
def test_a_node_is_added_connected_and_taken_out_again() -> None:
    graph = chain()
    graph.edit(
        c.Disconnect("first.out", "second.value"),
        c.Add("hfg.testing.nodes:double", "third", options={"release": "pipelined"}),
        c.Connect("first.out", "third.value"),
        c.Connect("third.out", "second.value"),
    )
    assert graph["third"]._options.release == "pipelined"
    assert sent(graph) == [8, 16, 24]
    graph.edit(c.Remove("third"))
    assert edges(graph) == ["script.out -> first.value", "second.out -> sink.value"]
    graph.undo()
    assert sent(graph) == [8, 16, 24]
    graph.undo()
    assert sent(graph) == [4, 8, 12]


def test_what_is_undone_is_the_same_node_again() -> None:
    graph = chain()
    node = graph["first"]
    before = drawn(graph)
    graph.edit(c.Remove("first"))
    assert node._place is None
    graph.undo()
    assert graph["first"] is node
    assert drawn(graph) == before


def test_a_copy_has_type_parameters_and_options_but_no_edges() -> None:
    graph = hfg.Graph()
    graph.add(script(values=(7,)), name="source", max_rate_hz=5.0)
    graph.edit(c.Copy("source", "other"))
    assert graph["other"]._parameters == {"values": (7,)}
    assert graph["other"]._options is graph["source"]._options
    assert not graph.edges


def test_a_copied_subgraph_is_as_it_was_edited_not_as_it_was_built() -> None:
    graph = chain()
    graph.edit(c.Enclose(("first", "second"), "box"), c.Rename("box/first", "renamed"), c.Copy("box", "twin"))
    assert list(graph["twin"].graph.nodes) == ["renamed", "second"]
    assert graph["twin/renamed"] is not graph["box/renamed"]
    assert [edge.label for edge in graph["twin"].graph.edges] == [
        edge.label.replace("box", "twin") for edge in graph["box"].graph.edges
    ]


def test_a_renamed_subgraph_takes_all_paths_inside_along() -> None:
    graph = chain()
    graph.edit(c.Enclose(("first", "second"), "box"), c.Enclose(("box",), "outer"), c.Rename("outer", "shell"))
    assert graph["shell/box/first"].place.path == "shell/box/first"


def test_options_parameters_and_edges_change_in_place() -> None:
    graph = hfg.Graph()
    graph.group("fast", threads=0)
    counter, tally = graph.add(Counter()), graph.add(Tally())
    graph.add(script())
    graph.connect(counter.processed, tally.activate)
    graph.edit(
        c.Move("tally", "fast"),
        c.Disable("counter"),
        c.MakeActive("counter.processed", "tally.activate"),
        c.SetParameter("script.values", [1, 2]),
    )
    assert (tally._options.group, counter._options.enabled, graph.edges[0].active) == ("fast", False, True)
    assert graph["script"]._parameters["values"] == (1, 2)  # a list over the wire stands for a tuple
    graph.undo()
    assert (tally._options.group, counter._options.enabled, graph.edges[0].active) == (None, True, False)


def test_another_type_takes_the_place_of_a_node_with_its_edges_and_gates() -> None:
    graph = chain()
    graph.gate(graph["first"], by=graph["second"])
    before = drawn(graph)
    graph.edit(c.Replace("first", "hfg.testing.nodes:some"))
    assert graph["first"]._type.name == "some"
    assert graph.gates[0].target is graph["first"]
    assert list(graph.nodes) == ["script", "first", "second", "sink"]
    graph.undo()
    assert drawn(graph) == before


# --- G1 ---


class Straight(hfg.Subgraph):
    """What comes in goes out."""

    heard = hfg.slot(type=Any)
    told = hfg.Event(Any)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.heard.inner, self.told.inner)


def straight(**behind: Any) -> hfg.Graph:
    """An edge that runs straight through a subgraph; its queue is that of its first part."""
    graph = hfg.Graph()
    source, box, tally = graph.add(Counter(), name="source"), graph.add(Straight(), name="box"), graph.add(Tally())
    graph.connect(source.processed, box.heard, capacity=3)
    graph.connect(box.told, tally.activate, **behind)
    return graph


@pytest.mark.rule("G1")
def test_a_border_that_would_give_an_edge_another_queue_is_refused() -> None:
    graph = straight(overflow="latest")
    assert flatten(graph).edges[0].options.capacity == 3
    before = drawn(graph)
    message = (
        "grouping would change the queue of source.processed -> box.heard, which runs through a subgraph and on as "
        'box.told -> tally.activate: one has capacity=3, overflow="wait", the other capacity=1, overflow="latest", '
        "and the outer of the two holds (rule G1); give both the same"
    )
    with pytest.raises(GraphError, match=re.escape(message)):
        graph.edit(c.Enclose(("source", "box"), "group"))
    assert drawn(graph) == before
    for members in (("box",), ("box", "tally"), ("source", "tally"), ("source",), ("source", "box", "tally")):
        graph.edit(c.Enclose(members, "group"))
        assert flatten(graph).edges[0].options.capacity == 3
        graph.edit(c.Dissolve("group"))
        assert flatten(graph).edges[0].options.capacity == 3


@pytest.mark.rule("G1")
def test_taking_a_border_away_that_gives_an_edge_its_queue_is_refused() -> None:
    graph = straight(capacity=3)
    graph.edit(c.Enclose(("source", "box"), "group"))
    graph.edit(c.SetEdge("group.told", "tally.activate", capacity=5))
    assert flatten(graph).edges[0].options.capacity == 5
    with pytest.raises(GraphError, match=r"dissolving would change the queue of .*capacity=3.*capacity=5"):
        graph.edit(c.Dissolve("group"))
    graph.edit(c.SetEdge("group/source.processed", "group/box.heard", capacity=5), c.Dissolve("group"))
    assert flatten(graph).edges[0].options.capacity == 5


@pytest.mark.rule("G1", "R4")
@pytest.mark.parametrize("seed", range(60))
def test_grouping_and_dissolving_leave_the_flat_graph_as_it_was(seed: int) -> None:
    graph = random_plan(seed, Allowed(feeds=True, boxes=seed % 2 == 0)).build()
    choose = SeededChooser(seed)
    before, wiring = drawn(graph), ends(graph)
    for number in range(4):
        names = [name for name in graph.nodes if choose.chance(50)] or list(graph.nodes)
        graph.edit(c.Enclose(tuple(names), f"group{number}"))
        assert ends(graph) == wiring
    for number in reversed(range(4)):
        graph.edit(c.Dissolve(f"group{number}"))
        assert ends(graph) == wiring
    for _ in range(8):
        graph.undo()
    assert drawn(graph) == before


def ends(graph: hfg.Graph) -> dict[object, list[object]]:
    """By port: where its edges lead, in order, and all that is said about them."""
    found: dict[object, list[object]] = {}
    for edge in flatten(graph).edges:
        said = msgspec.structs.astuple(edge.options)
        found.setdefault(edge.source.port, []).append((edge.target.port, *said))
    return found


# --- properties ---


@pytest.mark.slow
@pytest.mark.rule("R4")
@pytest.mark.parametrize("block", range(10))
def test_any_sequence_is_undone_redone_and_replayed_exactly(block: int) -> None:
    for seed in range(block * SEQUENCES // 10, (block + 1) * SEQUENCES // 10):
        walk(seed, edits=20)


def walk(seed: int, *, edits: int) -> None:
    """Edit at random, go back and forth; a second graph gets the same as JSON."""
    plan, choose = random_plan(seed, Allowed(feeds=True)), SeededChooser(seed)
    graph, replayed = plan.build(), plan.build()
    states = [drawn(graph)]
    for number in range(edits):
        commands = random_edit(graph, choose, number)
        try:
            graph.edit(*commands)
        except GraphError:
            assert drawn(graph) == states[-1]  # all or nothing
            continue
        replayed.edit(*c.decode(c.encode(commands)))
        states.append(drawn(graph))
        if choose.chance(30):
            back = choose.number(1, len(states) - 1)
            for position in range(back):
                graph.undo()
                replayed.undo()
                assert drawn(graph) == states[-2 - position]
            forth = choose.number(0, back)
            for _ in range(forth):
                graph.redo()
                replayed.redo()
            states = states[: len(states) - back + forth]
            assert drawn(graph) == states[-1]
        assert drawn(graph, identity=False) == drawn(replayed, identity=False)


# --- a graph as commands ---


@pytest.mark.slow
@pytest.mark.rule("R4")
@pytest.mark.parametrize("block", range(10))
def test_the_commands_of_a_graph_make_it_again_and_are_those_of_what_they_made(block: int) -> None:
    """Also by way of JSON, in one edit that is undone as one; subgraphs and edits included."""
    for seed in range(block * 15, block * 15 + 15):
        graph = random_plan(seed, replace(WIDE, feeds=True, threads=seed % 3 == 0)).build()
        choose = SeededChooser(seed)
        for number in range(seed % 4):
            with suppress(GraphError):
                graph.edit(*random_edit(graph, choose, number))
        told = graph.as_commands()
        made, over_a_wire = hfg.Graph(), hfg.Graph()
        made.edit(*told)
        over_a_wire.edit(*c.decode(c.encode(told)))
        for other in (made, over_a_wire):
            assert drawn(other, identity=False) == drawn(graph, identity=False)
            assert ends_by_path(other) == ends_by_path(graph)
            assert other.as_commands() == told
        made.undo()
        assert drawn(made) == drawn(hfg.Graph())
        made.redo()
        assert drawn(made, identity=False) == drawn(graph, identity=False)


class Louder(hfg.Subgraph):
    """Has a parameter that stands for one inside, and one inside that stands for itself."""

    by = hfg.Parameter(2)
    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.group("loud")
        first, second = graph.add(Scaled(), name="first", group="loud"), graph.add(Scaled(), name="second")
        graph.promote(self.by, first.ports.parameters["factor"])
        graph.connect(self.value.inner, first.value)
        graph.connect(first.ports.outputs["out"], second.value)
        graph.connect(second.ports.outputs["out"], self.out.inner)


def louder() -> hfg.Graph:
    graph = hfg.Graph("music")
    graph.add(script()) >> graph.add(Louder(by=3), name="loud") >> graph.add(sink())
    return graph


def test_a_subgraph_with_a_type_is_told_by_that_and_what_was_set_or_switched_inside_beside_it() -> None:
    graph = louder()
    graph["loud/second"].factor = 7
    graph.edit(c.Disable("loud/first"), c.Move("loud/second", "loud"))
    other = hfg.Graph()
    other.edit(*graph.as_commands())
    assert [type(one).__name__ for one in graph.as_commands()].count("Add") == 3
    assert drawn(other, identity=False) == drawn(graph, identity=False)
    other["loud"].by = 4
    assert other["loud/first"].factor == 4  # promoted, as in the one that was built


EDITED: list[list[c.Command]] = [
    [c.Disconnect("loud/first.out", "loud/second.value")],
    [c.Rename("loud/first", "other"), c.SetParameter("loud.by", 5)],
    [c.SetParameter("loud/first.factor", 6), c.Remove("loud/second")],
    [c.Promote("loud.by", "loud/second.factor")],
    [c.Promote("loud.by", "loud/first.factor", promoted=False), c.SetParameter("loud.by", 8)],
    [c.Enclose(("loud",), "around"), c.Disconnect("around/loud/first.out", "around/loud/second.value")],
    [c.Copy("loud", "again"), c.Remove("again/first")],
    [c.Copy("loud", "loud/again"), c.Copy("loud", "loud/once more")],
    [c.Replace("loud/first", "hfg.testing.nodes:Scaled", {"factor": 2}), c.Note("loud/first", "text", "here")],
]


@pytest.mark.rule("G3", "R4")
@pytest.mark.parametrize("edits", EDITED, ids=lambda edits: type(edits[0]).__name__)
def test_an_edited_inside_with_promoted_parameters_is_told(edits: list[c.Command]) -> None:
    graph = louder()
    before = drawn(graph)
    graph.edit(*edits)
    other = hfg.Graph("music")
    other.edit(*c.decode(c.encode(graph.as_commands())))
    assert drawn(other, identity=False) == drawn(graph, identity=False)
    assert other.as_commands() == graph.as_commands()
    graph.undo()
    assert drawn(graph) == before
    graph.redo()
    assert drawn(other, identity=False) == drawn(graph, identity=False)


@pytest.mark.rule("G3")
def test_a_promotion_takes_the_value_along_and_is_undone_with_it() -> None:
    graph = louder()
    graph["loud/second"].factor = 7
    graph.edit(c.Promote("loud.by", "loud/second.factor"))
    assert graph["loud/second"].factor == 3
    graph.edit(c.SetParameter("loud.by", 4))
    assert (graph["loud/first"].factor, graph["loud/second"].factor) == (4, 4)
    graph.undo()
    graph.undo()
    assert graph["loud/second"].factor == 7
    graph.edit(c.SetParameter("loud.by", 5))
    assert (graph["loud/first"].factor, graph["loud/second"].factor) == (5, 7)


@pytest.mark.rule("R4", "P8")
def test_a_promotion_is_followed_by_a_graph_that_runs() -> None:
    async def main() -> tuple[int, int]:
        graph = louder()
        async with hfg.running(graph, clock="virtual") as run:
            await run.edit(c.Promote("loud.by", "loud/second.factor"))
            await run.edit(c.SetParameter("loud.by", 9))
            return graph["loud/first"].factor, graph["loud/second"].factor

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()) == (9, 9)


WRONG_PROMOTIONS = {
    c.Promote("loud.by", "loud/first.factor"): '"loud/first.factor" is promoted already',
    c.Promote("loud.bye", "loud/second.factor"): 'there is no "loud.bye"',
    c.Promote("loud/second.factor", "loud/first.factor"): '"loud/second.factor" is not a parameter of the subgraph',
    c.Promote("loud.by", "loud/second.factor", promoted=False): '"loud.by" does not stand for "loud/second.factor"',
    c.Promote(3, "loud/second.factor"): "3",  # type: ignore[arg-type]
}


@pytest.mark.parametrize("command", WRONG_PROMOTIONS, ids=str)
def test_a_promotion_that_cannot_be_is_refused(command: c.Promote) -> None:
    graph = louder()
    before = drawn(graph)
    with pytest.raises(GraphError, match=WRONG_PROMOTIONS[command]):
        graph.edit(command)
    assert drawn(graph) == before


WRONGLY_WRITTEN: dict[str, Callable[[], object]] = {
    "commands.Add: missing required argument 'path'; write commands.Add(type, path, parameters=..., options=...)": (
        lambda: c.Add("hfg.testing.nodes:Scaled")  # type: ignore[call-arg]
    ),
    "commands.Rename: extra positional arguments provided; write commands.Rename(path, name)": (
        lambda: c.Rename("a", "b", "c")  # type: ignore[call-arg]
    ),
    "commands.Remove: unexpected keyword argument 'pth'; write commands.Remove(path)": (
        lambda: c.Remove("a", pth="b")  # type: ignore[call-arg]
    ),
}


@pytest.mark.parametrize("sentence", WRONGLY_WRITTEN)
def test_a_command_that_is_written_wrongly_says_how_it_is_written(sentence: str) -> None:
    with pytest.raises(GraphError, match=f"^{re.escape(sentence)}$"):
        WRONGLY_WRITTEN[sentence]()


def test_a_port_of_the_whole_has_a_type_that_is_said_as_a_text() -> None:
    graph = hfg.Graph()
    hints: list[Any] = [
        int,
        int | None,
        list[tuple[str, ...]],
        dict[str, Path],
        Callable,
        Literal["a", 2],
        Iterator[float],
        Any,
    ]
    for number, hint in enumerate(hints):
        graph.input(f"in{number}", hint)
    graph.output("out", Positive)
    other = hfg.Graph()
    other.edit(*graph.as_commands())
    assert [port.type for port in other.inputs.values()] == hints
    assert other.outputs["out"].type == Positive
    assert graph.as_commands()[2] == c.AddInput("in2", "list[tuple[str, ...]]")
    other.undo()
    assert not other.inputs


Positive = Annotated[int, at.Gt(0)]


def _untold() -> dict[str, tuple[Callable[[hfg.Graph], object], str]]:
    @hfg.node
    def local(value: int) -> int:
        return value

    def observable(graph: hfg.Graph) -> None:
        graph.connect(reactivex.of(1), graph.add(sink()).value)

    return {
        "a type without a name": (
            lambda graph: graph.add(local(), name="here"),
            'node "here": its type .*local cannot be found by name; define it at the top',
        ),
        "an observable": (
            observable,
            'edge "observable -> sink.value": an observable from outside is code; .* feed the graph by graph.input',
        ),
        "an operator without a name": (
            lambda graph: graph.connect(graph.start, graph.add(sink()).activate, through=[ops.skip(1)]),
            'edge "start -> sink.activate": its operator .* cannot be found by name, .* hfg.operator',
        ),
        "an operator made inside of a function": (
            lambda graph: graph.connect(
                graph.start, graph.add(sink()).activate, through=[hfg.operator(lambda: ops.skip(1))()]
            ),
            "its operator .*lambda.* cannot be found by name",
        ),
        "a type without a text": (
            lambda graph: graph.input("in", Annotated[int, at.Gt(3)]),
            'input "in" of the graph: its type .* has no name; give it one in a module',
        ),
    }


@pytest.mark.parametrize("what", _untold())
def test_what_no_command_can_say_is_named_with_what_to_do(what: str) -> None:
    graph = hfg.Graph()
    make, sentence = _untold()[what]
    make(graph)
    with pytest.raises(GraphError, match=sentence):
        graph.as_commands()


def test_the_inside_is_told_with_the_whole_graph() -> None:
    with pytest.raises(GraphError, match='the graph inside "loud" is described with the whole graph'):
        louder()["loud"].graph.as_commands()


# --- edges and operators ---


def _first(row: list[int]) -> int:
    return row[0]


@hfg.operator
def every(count: int, *, first: int = 0) -> Any:
    """Let one of so many through."""
    return reactivex.compose(ops.skip(first), ops.buffer_with_count(count), ops.map(_first))


def heard(graph: hfg.Graph) -> list[object]:
    hfg.run(graph, clock="virtual")
    return list(graph["ear"].heard)


class Ear(hfg.Node):
    """Keeps what it heard."""

    heard = hfg.State[list[int]](factory=list)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.heard.append(value)


class Bell(hfg.Node):
    """Rings once with each number."""

    rang = hfg.Event(int)

    @hfg.slot
    def ring(self) -> None:
        for number in range(9):
            self.rang.trigger(number)


def bells() -> hfg.Graph:
    graph = hfg.Graph("bells")
    bell, ear = graph.add(Bell(), name="bell"), graph.add(Ear(), name="ear")
    graph.connect(graph.start, bell.ring)
    graph.connect(bell.rang, ear.hear)
    graph.connect(bell.rang, graph.add(Ear(), name="other").hear)
    return graph


@pytest.mark.rule("R4", "P5", "P9")
def test_an_edge_is_declared_otherwise_in_its_place_and_all_is_undone() -> None:
    graph = bells()
    states, at = [drawn(graph)], ("bell.rang", "ear.hear")
    every_third = c.Operator("tests.graph.test_commands:every", (3,), {"first": 1})
    for command, expected in (
        (c.SetEdge(*at, overflow="latest"), [8]),
        (c.SetEdge(*at, overflow="drop_newest"), list(range(9))),  # the capacity is not that of "latest" any more
        (c.SetEdge(*at, capacity=2), [0, 1]),
        (c.SetEdge(*at, overflow="wait", capacity=16), list(range(9))),
        (c.SetEdge(*at, through=(every_third,)), [1, 4, 7]),
        (c.SetEdge(*at, through=(c.Operator("reactivex.operators:take", (2,)),)), [0, 1]),
        (c.SetEdge(*at, through=(), active=True), list(range(9))),
    ):
        graph.edit(*c.decode(c.encode([command])))
        assert heard(graph) == expected, command
        states.append(drawn(graph))
        other = hfg.Graph()
        other.edit(*graph.as_commands())
        assert heard(other) == expected
        assert [edge.label for edge in graph.edges] == [edge.label for edge in bells().edges]
    for state in reversed(states[:-1]):
        graph.undo()
        assert drawn(graph) == state


@pytest.mark.rule("R4", "P4", "P7")
def test_buffer_and_initial_tokens_of_an_edge_are_set_and_what_stays_as_it_was_is_no_change() -> None:
    graph = chain()
    before = drawn(graph)
    graph.edit(c.SetEdge("first.out", "second.value", buffer=2, initial=(5,)))
    assert sent(graph) == [10, 4, 8, 12]
    graph.edit(c.SetEdge("first.out", "second.value", buffer=2))
    assert graph.edges[1].options.initial == (5,)
    graph.undo()
    graph.undo()
    assert drawn(graph) == before


def test_an_operator_says_what_it_was_made_of_and_equals_one_made_the_same() -> None:
    assert repr(every(2, first=1)) == "every(2, first=1)"
    assert every(2) == every(2)
    assert every(2) != every(3)
    assert hfg.operator(ops.debounce)(0.2) == hfg.operator(ops.debounce)(0.2)
    with pytest.raises(hfg.errors.DeclarationError, match="hfg.operator takes a function .*, got 3; write it above"):
        hfg.operator(3)  # type: ignore[arg-type]
    with pytest.raises(hfg.errors.DeclarationError, match="gave 5, which is not a reactivex operator; let it"):
        hfg.operator(lambda: 5)()  # type: ignore[arg-type, return-value]


# --- notes ---


@pytest.mark.rule("P2", "R4")
def test_a_refused_edit_leaves_the_edge_that_it_would_have_doubled() -> None:
    """What goes straight from one port to another would go there through a subgraph as well."""

    class Box(hfg.Subgraph):
        one = hfg.slot(type=int)
        told = hfg.Event(int)

        def build(self, graph: hfg.Graph) -> None:
            """Connects nothing."""

    graph = hfg.Graph()
    source, box, tally = graph.add(Counter()), graph.add(Box()), graph.add(Tally())
    graph.connect(source.told, tally.note)
    graph.connect(source.told, box.one)
    graph.connect(box.told, tally.note)
    before = drawn(graph)
    with pytest.raises(GraphError, match="connected twice"):
        graph.edit(c.Connect("box.one.inner", "box.told.inner"), c.Dissolve("box"))
    assert drawn(graph) == before


@pytest.mark.rule("R4")
def test_notes_go_with_their_node_and_are_undone_like_all_else() -> None:
    graph = chain()
    states = [drawn(graph)]
    for command in (
        c.Note("", "title", {"text": "two doublers", "at": (0, 10)}),
        c.Note("first", "position", (40, 2.5)),
        c.Note("first", "text", "the first"),
        c.Rename("first", "one"),
        c.Replace("one", "hfg.testing.nodes:some"),
        c.Copy("one", "twin"),
        c.Note("one", "text"),
        c.Enclose(("one", "second"), "box"),
        c.Note("box", "colour", "red"),
        c.Copy("box", "other"),
        c.Dissolve("box"),
        c.Remove("twin"),
    ):
        graph.edit(*c.decode(c.encode([command])))
        states.append(drawn(graph))
        made = hfg.Graph()
        made.edit(*graph.as_commands())
        assert drawn(made, identity=False)["notes"] == states[-1]["notes"]
    assert graph.notes() == {"title": {"text": "two doublers", "at": [0, 10]}}
    assert graph.notes("one") == graph.notes("other/one") == {"position": [40, 2.5]}
    assert graph.notes("other") == {"colour": "red"}
    graph.notes("one")["position"].append(3)
    assert graph.notes("one") == {"position": [40, 2.5]}  # what was given is a copy
    for state in reversed(states[:-1]):
        graph.undo()
        assert drawn(graph) == state
    for state in states[1:]:
        graph.redo()
        assert drawn(graph) == state


# --- groups and history ---


@pytest.mark.rule("R4", "R2")
def test_groups_are_declared_changed_and_removed_and_all_is_undone() -> None:
    graph = chain()
    states = [drawn(graph)]
    for commands in (
        [c.AddGroup("work"), c.Move("first", "work")],
        [c.ChangeGroup("work", threads=0, policy="random", seed=4)],
        [c.ChangeGroup("work", seed=None), c.ChangeGroup("loop", policy="priority")],
        [c.Move("first"), c.RemoveGroup("work")],
        [c.Add("tests.graph.test_commands:Louder", "box")],  # declares one in build()
    ):
        graph.edit(*c.decode(c.encode(commands)))
        states.append(drawn(graph))
    assert [state["groups"].get("work") for state in states] == [
        None,
        GroupSpec("work", threads=1),
        GroupSpec("work", threads=0, policy="random", seed=4),
        GroupSpec("work", threads=0, policy="random"),
        None,
        None,
    ]
    for state in reversed(states[:-1]):
        graph.undo()
        assert drawn(graph) == state
    for state in states[1:]:
        graph.redo()
        assert drawn(graph) == state


@pytest.mark.rule("R4")
def test_the_history_tells_what_can_be_taken_back_and_cannot_be_written() -> None:
    graph = chain()
    assert not graph.history
    graph.edit(c.Disable("first"), c.Rename("first", "one"))
    graph.edit(c.Remove("one"))
    assert graph.history == ((c.Disable("first"), c.Rename("first", "one")), (c.Remove("one"),))
    graph.undo()
    assert len(graph.history) == 1
    with pytest.raises(AttributeError):
        setattr(graph, "history", ())  # noqa: B010 - type checkers refuse the other way, too


def ends_by_path(graph: hfg.Graph) -> list[object]:
    """What a run sees of them."""
    return [(flat.label, *msgspec.structs.astuple(flat.options)) for flat in flatten(graph).edges]


# --- refusals: one clear sentence, nothing changed ---

REFUSED = [
    (c.Remove("frist"), 'there is no "frist": graph "chain" has no node "frist"; did you mean "first"?'),
    (c.Connect("first.out", "second.value"), "are connected already; an edge is drawn once"),
    (c.Connect("script.out", "second.value"), '"second.value" takes one edge and has one from "first.out"'),
    (c.Connect("first.out", "join.a"), "the edit is refused because it would break the graph"),
    (c.Connect("first", "sink.value"), '"first" is no port; name a port of a node, as in "first.name"'),
    (c.Connect("script.out", "text.word"), "port types do not fit"),
    (c.Disconnect("first.out", "sink.value"), 'there is no edge "first.out" -> "sink.value"'),
    (c.SetParameter("first.size", 1), 'there is no "first.size": "first" has no parameter "size"; there are none'),
    (c.Rename("first", "second"), 'graph "chain" already has a node "second"; choose another name'),
    (c.Rename("first", "a/b"), '"/" separates the parts of a path'),
    (c.Copy("first", "sink/x"), '"sink" is not a subgraph, so nothing is inside it'),
    (c.Add("no_such_module:x", "x"), 'node "x": node type "no_such_module:x": no module named "no_such_module"'),
    (c.Add("hfg.testing.nodes:doubel", "x"), 'module "hfg.testing.nodes" has no "doubel"'),
    (c.Add("hfg.testing.nodes:double", "x", {"size": 3}), 'node "x": double has no parameter "size"'),
    (c.Add("hfg.testing.nodes:double", "x", {}, {"rate": 3}), "options are those of graph.add"),  # type: ignore[typeddict-unknown-key]
    (c.Replace("first", "hfg.testing.nodes:sink"), 'which has no output "out", and that is in use'),
    (c.Move("first", "gpu"), "which is not declared"),
    (c.Dissolve("first"), '"first" is not a subgraph, so it cannot be dissolved'),
    (c.Enclose((), "box"), "made of at least one node"),
    (c.Enclose(("first",), "second"), "has a node of this name already"),
    ("remove first", "an edit takes commands"),
    (c.Ungate("first"), '"first" has no gate that could be removed'),
    (c.Gate("first", "secnod"), 'there is no "secnod"'),
    (c.Gate("first", "second", -1), "idle_rate_hz must be a number above 0, or None to rest, got -1"),
    (c.Add("hfg.testing.nodes:double", "x", None), "Add takes parameters as a dict by name, got None"),  # type: ignore[arg-type]
    (c.Add(5, "x"), 'Add takes type as a text such as "module:name", got 5'),  # type: ignore[arg-type]
    (c.Replace("first", None), 'Replace takes type as a text such as "module:name", got None'),  # type: ignore[arg-type]
    (c.MakeActive(["a"], "b"), "MakeActive takes source as a text such as \"camera.out\", got ['a']"),  # type: ignore[arg-type]
    (c.Enclose("first", "box"), "Enclose takes several paths"),  # type: ignore[arg-type]
    (c.Enclose(None, "box"), "Enclose takes several paths"),  # type: ignore[arg-type]
    (c.Enclose((1,), "box"), "Enclose takes several paths"),  # type: ignore[arg-type]
    (c.Remove(3), "a path is a text"),  # type: ignore[arg-type]
    (c.SetEdge("first.out", "sink.value"), 'there is no edge "first.out" -> "sink.value"; graph.edges lists'),
    (c.SetEdge("second.out", "sink.value", capacity=3), "capacity=3 is for edges from events"),
    (c.SetEdge("second.out", "sink.value", buffer=-1), "buffer must be a whole number from 0 on, got -1"),
    (c.SetEdge("second.out", "sink.value", initial=("a",)), "an initial value must be of type int, got 'a'"),
    (c.SetEdge("second.out", "sink.value", initial=3), "initial takes a list, as in initial=[0], got 3"),  # type: ignore[arg-type]
    (c.SetEdge("second.out", "sink.value", through=(ops.skip(1),)), "a command says operators by name, got"),  # type: ignore[arg-type]
    (
        c.Connect("start", "sink.activate", through=(c.Operator("skip"),)),
        '"start" -> "sink.activate": "skip" is not a reference to an operator; write "my_robot.operators:smoothed"',
    ),
    (
        c.Connect("start", "sink.activate", through=(c.Operator("os:getcwd"),)),
        'operator "os:getcwd": it is <built-in function getcwd>, no operator; write @hfg.operator above',
    ),
    (
        c.Connect("start", "sink.activate", through=(c.Operator("reactivex.operators:skpi", (1,)),)),
        'operator "reactivex.operators:skpi": module "reactivex.operators" has no "skpi"',
    ),
    (
        c.Connect("start", "sink.activate", through=(c.Operator("no_such_module:skip"),)),
        'operator "no_such_module:skip": importing "no_such_module" failed',
    ),
    (
        c.Connect("start", "sink.activate", through=(c.Operator("reactivex.operators:skip", (1, 2)),)),
        'operator "reactivex.operators:skip" cannot be made: TypeError',
    ),
    (c.Note("frist", "x", 1), 'there is no "frist"'),
    (c.Note("first", "x", object()), 'note "x" of "first": notes are plain data, got <object'),
    (c.Note("first", 3, 1), "Note takes name as a text, got 3"),  # type: ignore[arg-type]
    (c.AddGroup("busy"), 'group "busy" is already declared as GroupSpec('),
    (c.AddGroup("two", threads=-2), 'group "two": threads must be 0 (on the loop), 1 (a thread of its own) or'),
    (c.AddGroup(""), "a group needs a name, got ''"),
    (c.ChangeGroup("bsuy"), 'there is no group "bsuy"; did you mean "busy"?'),
    (c.ChangeGroup("loop", threads=1), 'group "loop": it is the event loop itself and takes no thread'),
    (c.ChangeGroup("busy", policy="quick"), 'group "busy": policy must be one of'),  # type: ignore[arg-type]
    (c.RemoveGroup("busy"), 'cannot remove group "busy": "join" runs in it; move it with Move first'),
    (c.RemoveGroup("loop"), 'group "loop" is the event loop itself and is always there'),
    (c.RemoveGroup("gone"), 'there is no group "gone"'),
    (c.RemoveGroup(["busy"]), "RemoveGroup takes name as a text, got ['busy']"),  # type: ignore[arg-type]
    (c.AddInput("in", "lost[int]"), 'input "in" of the graph: "lost[int]" is not a type (there is no lost)'),
    (c.AddInput("in", "f()"), 'input "in" of the graph: "f()" is not a type (what is f()?)'),
    (c.AddInput("in", "[int"), 'input "in" of the graph: "[int" is not a type ('),
    (c.AddInput("in", "no_such_module.Thing"), "is not a type (there is no no_such_module.Thing)"),
    (c.AddInput("in", f"Literal[{'-' * 10_000}1]"), f'"Literal[{"-" * 192}" is not a type ('),
    (c.AddInput("in", "os.sep"), 'the type of input "in" is'),
    (c.AddInput("in", int), 'AddInput takes type as a text such as "int", got'),  # type: ignore[arg-type]
    (c.AddOutput("start", "int"), 'graph "chain" has a port "start" already; choose another name'),
    (c.AddSubgraph("box", {"a b": "int"}), "subgraph \"box\": a port cannot be called 'a b'; choose another name"),
    (c.AddSubgraph("box", {"graph": "int"}), "subgraph \"box\": a port cannot be called 'graph'"),
    (c.AddSubgraph("box", {"a": "int"}, {"a": "int"}), 'subgraph "box": it has two ports "a"'),
    (c.AddSubgraph("box", {"a": "itn"}), 'subgraph "box": port "a": "itn" is not a type (there is no itn)'),
    (c.AddSubgraph("box", {"a": 3}), 'subgraph "box": port "a": a type is given as a text, got 3'),  # type: ignore[dict-item]
    (c.AddSubgraph("first"), 'graph "chain" has a node "first" already'),
    (c.AddSubgraph("box", {}, {}, {}, {}, {"rate": 3}), "options are those of graph.add"),  # type: ignore[typeddict-unknown-key]
]


@hfg.node
def text(word: str) -> None:
    """Take words."""


@pytest.mark.parametrize(("command", "sentence"), REFUSED, ids=lambda value: value if isinstance(value, str) else "")
def test_what_is_refused_says_why_and_changes_nothing(command: c.Command, sentence: str) -> None:
    graph = chain()
    graph.group("busy", threads=0)
    join, words = graph.add(add(), name="join", group="busy"), graph.add(text(), name="text")
    graph.edit(c.Disconnect("script.out", "first.value"), c.Connect("join.out", "first.value"))
    assert join in graph.nodes.values()
    assert words in graph.nodes.values()
    before = drawn(graph)
    with pytest.raises(GraphError) as refused:
        graph.edit(c.Disable("sink"), command)
    assert sentence in str(refused.value)
    assert drawn(graph) == before


def test_nothing_to_undo_and_changes_by_hand_are_said() -> None:
    graph = chain()
    with pytest.raises(UsageError, match="has nothing to undo: nothing was edited by commands yet"):
        graph.undo()
    graph.edit(c.Rename("first", "one"))
    with pytest.raises(UsageError, match="has nothing to redo: nothing was undone since the last edit"):
        graph.redo()
    graph.add(double())
    with pytest.raises(UsageError, match="has nothing to undo: the graph was changed by hand since, which is final"):
        graph.undo()


def test_the_inside_is_edited_with_the_whole_graph() -> None:
    graph = chain()
    graph.edit(c.Enclose(("first",), "box"))
    with pytest.raises(UsageError, match="is edited with the whole graph"):
        graph["box"].graph.edit(c.Remove("box/first"))


@pytest.mark.parametrize(
    "data", ["", "{}", '[{"do":"Explode"}]', '[{"do":"Remove"}]', '[{"do":"Remove","path":3}]', b"\xff"]
)
def test_what_is_no_list_of_commands_says_so(data: str) -> None:
    with pytest.raises(GraphError, match="this is not a list of commands"):
        c.decode(data)


def test_values_that_are_no_data_are_refused_when_written() -> None:
    with pytest.raises(GraphError, match="commands are plain data"):
        c.encode([c.SetParameter("a.b", object())])


# --- hot reload ---

SOURCE = """
import hfg

@hfg.node
def grow(value: int, *, by: int = {by}) -> int:
    return value {sign} by
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "growing", raising=False)
    path = tmp_path / "growing.py"
    path.write_text(SOURCE.format(by=1, sign="+"))
    return path


def growing() -> hfg.Graph:
    graph = hfg.Graph()
    graph.add(script(values=(1, 2)))
    graph.edit(c.Add("growing:grow", "grow", {"by": 10}), c.Connect("script.out", "grow.value"))
    graph["grow"] >> graph.add(sink())
    return graph


@pytest.mark.rule("R4")
def test_a_changed_module_replaces_its_nodes_and_keeps_parameters(module: Path) -> None:
    graph = growing()
    assert sent(graph) == [11, 12]
    module.write_text(SOURCE.format(by=1, sign="*"))
    graph.reload("growing")
    assert sent(graph) == [10, 20]
    graph.undo()
    assert sent(graph) == [11, 12]


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        ("def grow(:", 'module "growing" cannot be reloaded: invalid syntax in line 1 of'),
        ("import hfg\n1 / 0", "running it failed (ZeroDivisionError: division by zero)"),
        ("import hfg", 'module "growing" has no "grow"'),
        ("import hfg\n@hfg.node\ndef grow(amount: int) -> int:\n    return 1\n", 'which has no input "value"'),
    ],
)
def test_a_module_that_fails_leaves_graph_and_module_as_they_were(module: Path, source: str, sentence: str) -> None:
    graph = growing()
    before = drawn(graph)
    module.write_text(source)
    with pytest.raises(HfgError) as refused:
        graph.reload("growing")
    assert sentence in str(refused.value)
    assert drawn(graph) == before
    assert graph["grow"]._type.reference == "growing:grow"
    assert sent(graph) == [11, 12]


@pytest.mark.rule("A11", "R4")
def test_gates_come_and_go_by_commands() -> None:
    graph = chain()
    graph.edit(c.Gate("first", "second", 5.0))
    before = drawn(graph)
    assert before["gates"] == [("first", "second", 5.0)]
    with pytest.raises(GraphError, match='"first" has a gate already'):
        graph.edit(c.Gate("first", "sink"))
    graph.edit(*c.decode(c.encode([c.Ungate("first"), c.Gate("first", "sink")])))
    assert drawn(graph)["gates"] == [("first", "sink", None)]
    graph.undo()
    assert drawn(graph) == before
    graph.undo()
    assert drawn(graph)["gates"] == []


@hfg.node
def places(*, home: tuple[int, int] = (0, 0)) -> Iterator[tuple[int, int]]:
    """Give places."""
    yield home


@hfg.node
def travel(goal: tuple[int, int]) -> None:
    """Take places."""


@pytest.mark.rule("R4", "P7")
def test_initial_tokens_that_are_no_json_travel_with_the_command() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.add(places())
        graph.add(travel())
        return graph

    command = c.Connect("places.out", "travel.goal", initial=((1, 2), (3, 4)))
    graph, other = build(), build()
    graph.edit(command)
    other.edit(*c.decode(c.encode([command])))
    assert other.edges[0].options.initial == graph.edges[0].options.initial == ((1, 2), (3, 4))


class Tuned(hfg.Subgraph):
    """A parameter that stands for one inside."""

    value = hfg.Input(int)
    factor = hfg.Parameter(7, at.Le(10))

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(Scaled(), name="inner")
        graph.connect(self.value.inner, inner.value)
        graph.promote(self.factor, inner.ports.parameters["factor"])


class Limited(hfg.Node):
    """One with limits."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    factor = hfg.Parameter(1, at.Le(5))

    def process(self, value: int) -> int:
        return value * self.factor


@pytest.mark.rule("R4", "G3")
@pytest.mark.parametrize(
    ("type_", "given", "sentence"),
    [
        ("hfg.testing.nodes:double", {}, 'double, which has no parameter "factor", and that is in use'),
        (named(Limited), {}, 'with its parameters as they are: "factor" must be <= 5, got 7'),
        (named(Limited), {"factor": 2}, '"box.factor" cannot stand for "box/inner.factor": must be <= 5, got 7'),
    ],
)
def test_a_node_whose_parameter_is_promoted_is_replaced_by_one_that_can_take_it(
    type_: str, given: dict[str, int], sentence: str
) -> None:
    graph = hfg.Graph()
    graph.add(Tuned(), name="box")
    before = drawn(graph)
    with pytest.raises(GraphError) as refused:
        graph.edit(c.Replace("box/inner", type_, given))
    assert sentence in str(refused.value)
    assert drawn(graph) == before
    graph.edit(c.SetParameter("box.factor", 3), c.Replace("box/inner", named(Limited)))
    graph.edit(c.SetParameter("box.factor", 4))
    assert graph["box/inner"].factor == 4


def test_a_module_that_was_never_imported_is_named() -> None:
    with pytest.raises(GraphError, match='module "nowhere" cannot be reloaded: it is not imported'):
        chain().reload("nowhere")


@pytest.mark.rule("R4")
def test_the_last_thousand_edits_can_be_taken_back_and_no_more_are_kept() -> None:
    graph = hfg.Graph()
    graph.edit(c.Add("hfg.testing.nodes:double", "n0"))
    assert (graph.can_undo, graph.can_redo) == (True, False)
    for number in range(MOST_STEPS):
        graph.edit(c.Rename(f"n{number}", f"n{number + 1}"))
    for _ in range(MOST_STEPS):
        graph.undo()
    assert list(graph.nodes) == ["n0"]  # that it was added is final by now
    assert (graph.can_undo, graph.can_redo) == (False, True)
    graph.redo()
    assert list(graph.nodes) == ["n1"]

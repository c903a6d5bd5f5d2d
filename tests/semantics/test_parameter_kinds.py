"""A parameter of any kind goes through a node's life unchanged, or is refused with nothing half changed (P8, R4)."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import hfg
from hfg import commands as c
from hfg.base.values import Colour, Span, same
from hfg.errors import GraphError
from hfg.testing import reference_run
from hfg.trace import ParameterSet, TraceEvent
from tests.ports.test_parameter_kinds import SPECS, Everything, Mode, Sides
from tests.semantics.nodes import Keep, drive

UNIT = st.floats(0, 1)
NAMES = st.text(min_size=1, max_size=5)
BYTE = st.integers(0, 255)
ITEMS = st.floats(-1e9, 1e9)

FITTING: dict[str, st.SearchStrategy[Any]] = {
    "on": st.booleans(),
    "count": st.integers(0, 9),
    "threshold": st.integers(0, 10).map(lambda tenths: tenths / 10),
    "title": st.text(),
    "way": st.sampled_from("ab"),
    "code": st.sampled_from((8, 0)),
    "mode": st.sampled_from(Mode),
    "letter": st.sampled_from("ab"),
    "letters": st.frozensets(st.sampled_from("ab")),
    "sides": st.sampled_from([Sides(0), Sides.LEFT, Sides.RIGHT, Sides.LEFT | Sides.RIGHT]),
    "some": st.sets(st.sampled_from("ab")),
    "band": st.tuples(UNIT, UNIT).map(lambda ends: Span(min(ends), max(ends))),
    "colour": st.builds(Colour, BYTE, BYTE, BYTE),
    "file": st.sampled_from((Path("b.png"), Path("pictures/c.JPG"))),
    "text_file": st.sampled_from(("a.txt", "there/b.txt")),
    "folder": st.none() | st.sampled_from((Path("there"), Path("/a/b"))),
    "names": st.lists(NAMES),
    "gains": st.tuples(*[st.floats(-5, 5)] * 3),
    "offset": arrays.arrays(np.float64, 3, elements=st.floats()),
    "points": arrays.arrays(np.float64, st.tuples(st.integers(0, 4), st.just(3)), elements=ITEMS),
    "anything": st.recursive(
        st.none() | st.integers() | st.floats() | st.text() | st.sampled_from([*Mode, Path("x"), Colour(1, 2, 3)]),
        lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(st.text() | st.integers(), inner),
        max_leaves=5,
    ),
}
REFUSED: dict[str, st.SearchStrategy[Any]] = {
    "on": st.sampled_from(("yes", 2, None)),
    "count": st.integers(max_value=-1) | st.integers(10) | UNIT,
    "threshold": st.floats(min_value=1, exclude_min=True) | st.just(0.05),
    "title": st.integers() | st.binary(),
    "way": st.text(min_size=2),
    "code": st.integers(9),
    "mode": st.sampled_from((3, "SLOW", None)),
    "letter": st.text(min_size=2),
    "letters": st.just(frozenset("z")),
    "sides": st.sampled_from((8, "UP")),
    "some": st.just({"a", "z"}),
    "band": st.builds(Span, st.floats(0.6, 2), st.floats(0, 0.5)) | st.builds(Span, UNIT, st.floats(1.1, 9)),
    "colour": st.builds(Colour, BYTE, BYTE, st.integers(256)) | st.just("red"),
    "file": st.sampled_from((Path("b.gif"), Path(), 3)),
    "text_file": st.sampled_from(("a.png", "")),
    "folder": st.integers(),
    "names": st.lists(NAMES).map(lambda names: [*names, ""]) | st.just([1]),
    "gains": st.tuples(*[st.floats(5.5, 9)] * 3) | st.just((0.0,)),
    "offset": arrays.arrays(np.float64, st.sampled_from(((2,), (4,), (3, 1)))) | arrays.arrays(np.int64, 3),
    "points": arrays.arrays(np.float64, st.tuples(st.integers(0, 2), st.just(2))),
}


def test_every_kind_that_users_set_is_tried() -> None:
    settable = {name for name, spec in SPECS.items() if spec.is_given}
    assert set(FITTING) == settable
    assert set(REFUSED) == settable - {"anything"}
    assert {SPECS[name].kind for name in FITTING} == {spec.kind for spec in SPECS.values() if spec.is_given}


async def through_a_life(name: str, first: Any, second: Any) -> None:
    """Make a node with the first value, run it, change it by hand and by a command, undo, redo, copy."""
    graph = hfg.Graph("g")
    node = graph.add(Everything(**{name: first}), name="node")
    graph.connect(graph.input("values", float), node.ports.inputs["value"])
    port = node.ports.parameters[name]
    assert same(port.value, first)
    async with hfg.running(graph) as run:
        await run.edit(c.SetParameter(f"node.{name}", second))
        assert same(port.value, second)
        await run.undo()
        assert same(port.value, first)
        await run.redo()
        assert same(port.value, second)
        run.set(port, first)
        assert same(port.value, first)
    assert same(node._copy().ports.parameters[name].value, first)
    assert same(hfg.Graph("empty").add(node._copy()).ports.parameters[name].value, first)


@pytest.mark.rule("P8", "R4")
@pytest.mark.parametrize("name", FITTING)
@settings(max_examples=8)
@given(data=st.data())
def test_a_value_goes_through_creation_change_undo_copy_and_commands_unchanged(name: str, data: Any) -> None:
    first, second = data.draw(FITTING[name]), data.draw(FITTING[name])
    drive(lambda: through_a_life(name, first, second))


@pytest.mark.rule("R4")
@pytest.mark.parametrize("name", FITTING)
@settings(max_examples=20)
@given(data=st.data())
def test_a_value_goes_through_commands_as_json_unchanged(name: str, data: Any) -> None:
    value = data.draw(FITTING[name])
    graph = hfg.Graph("g")
    graph.add(Everything(**{name: value}), name="node")
    text = c.encode(graph.as_commands())
    assert json.loads(text)
    again = hfg.Graph("g")
    again.edit(*c.decode(text))
    assert same(again["node"].ports.parameters[name].value, value)
    assert c.encode(again.as_commands()) == text
    other = hfg.Graph("other")
    other.add(Everything(), name="node")
    data_of_it = SPECS[name].encode(value)
    other.edit(*c.decode(c.encode([c.SetParameter(f"node.{name}", data_of_it)])))
    assert same(other["node"].ports.parameters[name].value, value)


async def refused(name: str, first: Any, wrong: Any) -> None:
    graph = hfg.Graph("g")
    node = graph.add(Everything(**{name: first}), name="node")
    graph.connect(graph.input("values", float), node.ports.inputs["value"])
    port = node.ports.parameters[name]
    before = dict(node._parameters)
    async with hfg.running(graph) as run:
        with pytest.raises(ValueError, match=f'^parameter "node.{name}" '):
            run.set(port, wrong)
        with pytest.raises(ValueError, match=f'^parameter "node.{name}" '):
            port.value = wrong
        with pytest.raises(GraphError, match=f'^parameter "node.{name}" '):
            await run.edit(c.SetParameter("node.title", "other"), c.SetParameter(f"node.{name}", wrong))
        with pytest.raises(GraphError, match=f"{name}"):
            await run.edit(c.Add("tests.ports.test_parameter_kinds:Everything", "more", {name: wrong}))
        assert same(dict(node._parameters), before)
        assert list(graph.nodes) == ["node"]
    with pytest.raises(ValueError, match=f'^parameter "everything.{name}" '):
        Everything(**{name: wrong})


@pytest.mark.rule("P8", "R4")
@pytest.mark.parametrize("name", REFUSED)
@settings(max_examples=8)
@given(data=st.data())
def test_what_the_limits_forbid_is_refused_everywhere_and_nothing_is_half_changed(name: str, data: Any) -> None:
    first, wrong = data.draw(FITTING[name]), data.draw(REFUSED[name])
    drive(lambda: refused(name, first, wrong))


# --- values that can be changed ---


class Grows(hfg.Node):
    """Changes its own list at every firing, as it should not."""

    x = hfg.Input(int)
    names = hfg.Parameter(["a"], type=list[str])

    def process(self, x: int) -> None:
        self.names.append(str(x))


@hfg.node
def count(*, n: int = 3) -> Iterator[int]:
    yield from range(n)


@pytest.mark.rule("P8", "T1")
def test_what_a_parameter_has_sent_is_not_changed_by_its_node(fast: bool) -> None:
    graph = hfg.Graph()
    grows, keep = graph.add(Grows()), graph.add(Keep())
    graph.connect(graph.add(count()).out, grows.x)
    graph.connect(grows.ports.parameters["names"], keep.ports.inputs["value"])
    hfg.run(graph, clock="virtual", fast=fast)
    assert keep.values == [["a", "0"], ["a", "0", "1"], ["a", "0", "1", "2"]]


@pytest.mark.rule("R4")
def test_undo_gives_back_what_a_list_was_when_it_was_set() -> None:
    graph = hfg.Graph()
    grows = graph.add(Grows(names=["x"]), name="grows")
    graph.edit(c.SetParameter("grows.names", ["y"]))
    grows.names.append("unseen")
    graph.undo()
    assert grows.names == ["x"]
    graph.redo()
    assert grows.names == ["y"]


# --- what a node sets alone ---


class Works(hfg.Node):
    """Tells how far it is."""

    x = hfg.Input(int)
    done = hfg.Parameter(0.0, read_only=True)
    said = hfg.Parameter("", read_only=True)

    def process(self, x: int) -> None:
        self.done = self.done + 0.25
        self.said = f"at {x}"


def working(**options: Any) -> hfg.Graph:
    graph = hfg.Graph()
    if "group" in options:
        graph.group(options["group"], threads=1)
    works, keep = graph.add(Works(), name="works", **options), graph.add(Keep(), name="keep")
    graph.connect(graph.add(count()).out, works.x)
    graph.connect(works.ports.parameters["done"], keep.ports.inputs["value"])
    return graph


def told(events: list[TraceEvent]) -> list[tuple[str, Any]]:
    return [(event.parameter, event.value) for event in events if isinstance(event, ParameterSet)]


EXPECTED = [("done", 0.25), ("said", "at 0"), ("done", 0.5), ("said", "at 1"), ("done", 0.75), ("said", "at 2")]


@pytest.mark.rule("P8", "R7")
@pytest.mark.parametrize("options", [{}, {"group": "threads"}], ids=["loop", "thread"])
def test_what_a_node_sets_alone_is_sent_and_seen_and_begins_afresh_in_each_run(
    options: dict[str, Any], fast: bool
) -> None:
    graph = working(**options)
    for _ in range(2):
        events: list[TraceEvent] = []
        hfg.run(graph, clock="virtual", trace=events.append, fast=fast)
        assert graph["keep"].values == [0.25, 0.5, 0.75]
        assert told(events) == EXPECTED


@pytest.mark.rule("P8", "R7")
def test_the_reference_sees_the_same_of_what_a_node_sets_alone() -> None:
    assert told(reference_run(working()).events) == EXPECTED


@pytest.mark.rule("P8")
def test_what_a_node_sets_alone_is_refused_to_everybody_else() -> None:
    graph = working()
    port = graph["works"].ports.parameters["done"]

    async def main() -> None:
        async with hfg.running(graph) as run:
            attempts: list[Callable[[], Any]] = [
                lambda: run.set(port, 0.5),
                lambda: run.set("works.done", 0.5),
                lambda: setattr(port, "value", 0.5),
                lambda: Works(done=0.5),
            ]
            for attempt in attempts:
                with pytest.raises(ValueError, match=r'^parameter "works\.done" is read-only: only its node sets it'):
                    attempt()
            with pytest.raises(GraphError, match=r'parameter "works\.done" is read-only: only its node sets it'):
                await run.edit(c.SetParameter("works.done", 0.5))

    drive(main)
    assert not any("done" in getattr(command, "parameters", {}) for command in working().as_commands())

"""What a docstring says of a node type, and how it is found again."""

from __future__ import annotations

import doctest
import importlib
from typing import Annotated, Literal

import pytest
from annotated_types import Interval, Len, MultipleOf, Predicate, Unit

import hfg
from hfg.catalogue import TypeDescription, categories, describe_type, named, undocumented
from hfg.catalogue.documentation import read_documentation
from hfg.types import Widget


@hfg.node
def scale(
    value: float, offset: float = 1.0, *, factor: Annotated[float, Interval(ge=0, lt=9), Unit("m")] = 2.0
) -> float:
    """Multiply a number by a factor.

    Fires with each value;
    silence stays silence.

    Args:
      value: in metres,
        any range.
      offset: is added.
      factor: how much.

    Returns:
      The product.

    Raises:
      ValueError: the value is too large.

    CS::APEX: csapex::Scale, math::Multiply (in part).
    Category: arithmetic.
    """
    return value * factor + offset


class Door(hfg.Node):
    """Open and close.

    Attributes:
      push: how hard.
      steps: how far it is open.
      opened: it is open.
      speed: how fast it moves.
      legs: what it stands on.
      bell: rings it.
    """

    push = hfg.Input(bool)
    legs = hfg.Inputs(int, 2)
    steps = hfg.Output(int)
    opened = hfg.Event(int)
    speed = hfg.Parameter(3, MultipleOf(3), choices=(3, 6), unit="m/s")
    bell = hfg.Parameter(trigger=True)

    def process(self, push: bool, legs: list[int]) -> None: ...

    @hfg.slot
    def close(self) -> None:
        """Close it.

        At once.
        """

    @hfg.slot
    def move(self, far: int) -> None: ...


def test_a_docstring_is_taken_apart() -> None:
    described = describe_type(scale)
    assert described.reference == f"{__name__}:scale"
    assert described.summary == "Multiply a number by a factor."
    assert described.text == "Fires with each value;\nsilence stays silence."
    assert [(port.name, port.type, port.doc, port.optional, port.default) for port in described.inputs] == [
        ("value", "float", "in metres, any range.", False, None),
        ("offset", "float", "is added.", True, 1.0),
    ]
    assert [(port.name, port.doc) for port in described.outputs] == [("out", "The product.")]
    (factor,) = described.parameters
    assert (factor.default, factor.limits, factor.unit, factor.doc) == (2.0, {"ge": 0, "lt": 9}, "m", "how much.")
    assert factor.limits_in_words() == [">= 0", "< 9"]
    assert [(error.name, error.when) for error in described.errors] == [("ValueError", "the value is too large.")]
    assert described.apex == ("csapex::Scale", "math::Multiply")
    assert described.category == "arithmetic"
    assert undocumented(described) == []


def test_a_class_has_ports_of_all_kinds() -> None:
    described = describe_type(Door)
    assert [(kind, port.name, port.type, port.doc, port.vector) for kind, port in described.ports()] == [
        ("input", "push", "bool", "how hard.", False),
        ("input", "legs", "int", "what it stands on.", True),
        ("output", "steps", "int", "how far it is open.", False),
        ("event", "opened", "int", "it is open.", False),
        ("event", "bell", "", "rings it.", False),
        ("slot", "close", "", "Close it.", False),
        ("slot", "move", "int", "", False),
        ("slot", "bell", "", "rings it.", False),
    ]
    by_name = {one.name: one for one in described.parameters}
    assert by_name["speed"].limits_in_words() == ["a multiple of 3", "one of 3, 6"]
    assert by_name["bell"].trigger
    assert by_name["legs"].size
    assert not described.source


def test_what_is_not_documented_is_named_with_what_to_write() -> None:
    where = f"{__name__}:Door"
    assert undocumented(describe_type(Door)) == [
        f'{where}: its slot "move" is not documented; add an entry to Attributes: in its docstring'
    ]

    @hfg.node
    def bare(value: int) -> int:
        return value

    assert [line.partition(": ")[2].partition(";")[0] for line in undocumented(describe_type(bare))[1:]] == [
        'its input "value" is not documented',
        'its output "out" is not documented',
    ]
    assert "has no docstring" in undocumented(describe_type(bare))[0]


@pytest.mark.parametrize(
    "doc",
    [
        "",
        "One line",
        "Bad section.\n\nArgs:\n  no colon here\n",
        "Two.\n\nReturns:\n  left: one.\n  right: the other:\n    with more.\n",
        "Empty sections.\n\nArgs:\n\nRaises:\n",
    ],
)
def test_any_docstring_can_be_read(doc: str) -> None:
    read = read_documentation(doc)
    assert read.summary == doc.partition("\n")[0]
    assert list(read.entries) in ([], ["left", "right"])


def test_limits_of_all_kinds_have_words() -> None:
    @hfg.node
    def limited(
        *,
        name: Annotated[str, Len(1, 3), Predicate(str.isidentifier)] = "a",
        mode: Literal["a", "b"] = "a",
        most: Annotated[int, Interval(gt=0, le=3)] = 1,
    ) -> None: ...

    said = [one.limits_in_words() for one in describe_type(limited).parameters]
    assert said == [["at least 1 items", "at most 3 items", "isidentifier"], [], ["> 0", "<= 3"]]


@pytest.fixture
def types() -> list[TypeDescription]:
    return [describe_type(one) for one in (scale, Door)]


@pytest.mark.parametrize(
    "name", ["Door", "door", "DOOR", f"{__name__}:Door", f"{__name__}.Door", "test_describing.Door"]
)
def test_types_are_found_by_name(types: list[TypeDescription], name: str) -> None:
    assert [one.name for one in named(types, name)] == ["door"]


def test_categories_are_in_order(types: list[TypeDescription]) -> None:
    assert {name: [one.name for one in group] for name, group in categories(types).items()} == {
        "arithmetic": ["scale"],
        __name__.partition(".")[0]: ["door"],
    }


@pytest.mark.parametrize("module", ["describing", "documentation", "offers", "searching"])
def test_examples_in_docstrings_run(module: str) -> None:
    assert doctest.testmod(importlib.import_module(f"hfg.catalogue.{module}")).failed == 0


def test_a_hint_for_a_widget_at_a_port_arrives_in_the_catalogue() -> None:
    class Motor(hfg.Node):
        """Has a speed."""

        speed = hfg.Output(Annotated[float, Widget("gauge")])
        load = hfg.Event(Annotated[int, Widget("bar")])
        on = hfg.Input(bool)

        def process(self, on: bool) -> None:
            self.speed.send(1.0)

    described = describe_type(Motor)
    assert [port.widget for _, port in described.ports() if port.name in ("speed", "load", "on")] == [
        "",
        "gauge",
        "bar",
    ]
    assert described.outputs[0].type == "float"
    graph = hfg.Graph()
    graph.connect(graph.add(Motor()).speed, graph.output("seen", float))  # it does not affect matching

"""Kinds of parameters: what each is for an editor, what it takes, and what it refuses."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated, Any, Literal

import annotated_types as at
import numpy as np
import numpy.typing as npt
import pytest

import hfg
from hfg.errors import ConnectionError as EdgeRefused
from hfg.errors import DeclarationError, GraphError
from hfg.types import Shape


class Mode(enum.Enum):
    FAST = 1
    GOOD = 2


class Sides(enum.Flag):
    LEFT = 1
    RIGHT = 2


class Everything(hfg.Node):
    """Has one of each kind.

    Attributes:
      count: how many
        there are.
      threshold: the docstring's words, which the declaration's own precede.
    """

    on = hfg.Parameter(True)
    count = hfg.Parameter(4, at.Interval(ge=0, le=9), step=2, unit="items", group="numbers")
    threshold = hfg.Parameter(0.5, at.Interval(ge=0, le=1), at.MultipleOf(0.1), help="above it counts")
    title = hfg.Parameter("a")
    way = hfg.Parameter("a", choices=("a", "b"))
    code = hfg.Parameter(8, choices={"Otsu": 8, "Plain": 0})
    mode = hfg.Parameter(Mode.FAST)
    letter = hfg.Parameter("a", type=Literal["a", "b"])
    letters = hfg.Parameter(frozenset({"a"}), type=frozenset[Literal["a", "b"]])
    sides = hfg.Parameter(Sides.LEFT)
    some = hfg.Parameter({"a"}, choices=("a", "b"), type=set[str])
    band = hfg.Parameter(hfg.Span(0.1, 0.5), at.Interval(ge=0, le=1))
    colour = hfg.Parameter(hfg.Colour(1, 2, 3))
    file = hfg.Parameter(Path("a.png"), pattern="*.png *.jpg", shown_if={"way": "a", "count": at.Gt(2)})
    text_file = hfg.Parameter("a.txt", pattern="*.txt", save=True, shown_if="on")
    folder = hfg.Parameter(None, type=Path | None, directory=True)
    press = hfg.Parameter(trigger=True)
    names = hfg.Parameter(["a"], type=list[Annotated[str, at.MinLen(1)]])
    gains = hfg.Parameter((0.0, 1.0, 2.0), at.Interval(ge=-5, le=5))
    offset = hfg.Parameter(np.zeros(3))
    points = hfg.Parameter(np.eye(3), type=Annotated[npt.NDArray[np.float64], Shape(None, 3)])
    done = hfg.Parameter(0.0, at.Interval(ge=0, le=1), read_only=True)
    said = hfg.Parameter("", read_only=True)
    anything = hfg.Parameter(None)

    def process(self, value: float) -> None:
        self.done = value
        self.said = f"{value:.0%}"


SPECS = Everything._type.parameters

KINDS = {
    "on": "bool",
    "count": "int",
    "threshold": "float",
    "title": "text",
    "way": "choice",
    "code": "choice",
    "mode": "choice",
    "letter": "choice",
    "letters": "choices",
    "sides": "choices",
    "some": "choices",
    "band": "interval",
    "colour": "colour",
    "file": "path",
    "text_file": "path",
    "folder": "path",
    "press": "trigger",
    "names": "list",
    "gains": "vector",
    "offset": "vector",
    "points": "matrix",
    "done": "progress",
    "said": "output text",
    "anything": "any",
}


def test_every_parameter_has_the_kind_that_its_type_says() -> None:
    assert {name: spec.kind for name, spec in SPECS.items()} == KINDS


def test_what_editors_show_is_read_from_the_declaration() -> None:
    count, threshold = SPECS["count"], SPECS["threshold"]
    assert (count.minimum, count.maximum, count.step, count.unit, count.group) == (0, 9, 2, "items", "numbers")
    assert threshold.step == 0.1
    assert (SPECS["code"].choices, SPECS["code"].labels) == ((8, 0), ("Otsu", "Plain"))
    assert (SPECS["mode"].choices, SPECS["mode"].labels) == ((Mode.FAST, Mode.GOOD), ("FAST", "GOOD"))
    assert SPECS["code"].label(0) == "Plain"
    assert (SPECS["gains"].shape, SPECS["offset"].shape, SPECS["points"].shape) == ((3,), (3,), (None, 3))
    assert (SPECS["text_file"].pattern, SPECS["text_file"].save, SPECS["folder"].directory) == ("*.txt", True, True)


def test_help_comes_from_the_declaration_or_the_docstring() -> None:
    helps = {name: Everything._type.help_of(name) for name in ("count", "threshold", "title")}
    assert helps == {"count": "how many there are.", "threshold": "above it counts", "title": None}


@pytest.mark.parametrize(
    ("name", "given", "wrong"),
    [
        ("on", 1.5, "must be of type bool, got 1.5"),
        ("count", 10, "must be <= 9, got 10"),
        ("threshold", 0.25, "must be a multiple of 0.1, got 0.25"),
        ("title", 3, "must be of type str, got 3"),
        ("way", "c", "must be one of 'a', 'b', got 'c'"),
        ("code", 3, "must be one of 8 (Otsu), 0 (Plain), got 3"),
        ("mode", 1, "must be of type Mode, got 1"),
        ("letter", "z", "must be of type Literal['a', 'b'], got 'z'"),
        ("letters", frozenset("z"), "must be of type frozenset[Literal['a', 'b']], got frozenset({'z'})"),
        ("sides", 1, "must be of type Sides, got 1"),
        ("some", {"z"}, "must hold only 'a', 'b', got 'z'"),
        ("band", hfg.Span(0.5, 0.1), "must have low <= high, got Span(low=0.5, high=0.1)"),
        ("band", hfg.Span(0.5, 1.5), "must be <= 1, got Span(low=0.5, high=1.5)"),
        ("band", (0.5, 0.6), "must be hfg.Span(low, high) of float, got (0.5, 0.6)"),
        ("colour", (1, 2, 3), "must be a colour, as in hfg.Colour(255, 128, 0)"),
        ("colour", hfg.Colour(1, 2, 256), "must have red, green and blue from 0 to 255"),
        ("file", Path("pictures/a.gif"), "must be a file name like *.png or *.jpg, got 'pictures/a.gif'"),
        ("file", "a.png", "must be of type Path, got 'a.png'"),
        ("names", ["a", ""], "[1] must have at least 1 items, got ['a', '']"),
        ("gains", (0.0, 1.0), "must be of type tuple[float, float, float], got (0.0, 1.0)"),
        ("gains", (0.0, 1.0, 6.0), "must be <= 5, got (0.0, 1.0, 6.0)"),
        ("offset", np.zeros(4), "must be of type Array[float64] and shape 3, got an array of float64, 4"),
        ("offset", np.zeros(3, int), "must be of type Array[float64] and shape 3"),
        ("points", np.zeros((2, 2)), "must be of type Array[float64] and shape anyx3"),
        ("done", 0.5, "is read-only: only its node sets it; read node.done"),
    ],
)
def test_what_a_kind_does_not_take_is_refused_and_changes_nothing(name: str, given: Any, wrong: str) -> None:
    node = Everything()
    before = node.ports.parameters[name].value
    with pytest.raises(ValueError, match="parameter") as made:
        Everything(**{name: given})
    with pytest.raises(ValueError, match="parameter") as changed:
        node.ports.parameters[name].value = given
    assert wrong in str(made.value)
    assert str(changed.value) == str(made.value)
    assert str(made.value).startswith(f'parameter "everything.{name}" ')
    assert np.array_equal(node.ports.parameters[name].value, before)


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("threshold", 0.1 + 0.2),
        ("code", 0),
        ("mode", Mode.GOOD),
        ("sides", Sides.LEFT | Sides.RIGHT),
        ("sides", Sides(0)),
        ("some", set()),
        ("band", hfg.Span(0, 1)),
        ("colour", hfg.Colour.of("#f80")),
        ("file", Path("Pictures/A.PNG")),
        ("text_file", "out.txt"),
        ("folder", Path("there")),
        ("gains", (0, 1, 2)),
        ("points", np.ones((7, 3))),
    ],
)
def test_what_a_kind_takes_is_its_value(name: str, given: Any) -> None:
    node = Everything(**{name: given})
    assert np.array_equal(getattr(node, name), given)


def test_conditions_tell_whether_an_editor_shows_a_parameter() -> None:
    values = {"way": "a", "count": 4, "on": True}
    file, text_file = SPECS["file"], SPECS["text_file"]
    is_shown = Everything._type.is_shown
    assert is_shown("file", values)
    assert not is_shown("file", values | {"count": 2})
    assert not is_shown("file", values | {"way": "b"})
    assert is_shown("text_file", values)
    assert not is_shown("text_file", values | {"on": False})
    assert [one.in_words() for one in (*file.shown_if, *text_file.shown_if)] == ["way is 'a'", "count > 2", "on is on"]


def test_who_is_shown_by_a_hidden_parameter_is_hidden_with_it() -> None:
    class Blurred(hfg.Node):
        soft = hfg.Parameter(False)
        way = hfg.Parameter("fast", choices=("fast", "good"), shown_if="soft")
        passes = hfg.Parameter(1, shown_if={"way": "good"})
        rest = hfg.Parameter(0.5, shown_if={"passes": at.Gt(2)})

    def shown(**values: Any) -> list[str]:
        node = Blurred(**values)
        return [name for name in Blurred._type.parameters if Blurred._type.is_shown(name, node._parameters)]

    assert shown() == ["soft"]
    assert shown(way="good", passes=3) == ["soft"]
    assert shown(soft=True, passes=3) == ["soft", "way"]
    assert shown(soft=True, way="good") == ["soft", "way", "passes"]
    assert shown(soft=True, way="good", passes=3) == ["soft", "way", "passes", "rest"]
    assert not Blurred._type.is_shown("passes", {"way": "good"})  # `soft` is off unless it is said to be on


def test_a_function_says_the_same_in_its_annotations() -> None:
    @hfg.node
    def clip(
        value: float,
        *,
        band: Annotated[hfg.Span[float], at.Interval(ge=0, le=1), hfg.Parameter(unit="m", group="g")] = hfg.Span(
            0.2, 0.8
        ),
        soft: bool = False,
        width: Annotated[float, at.Gt(0), hfg.Parameter(step=0.5, shown_if="soft")] | None = None,
    ) -> float:
        """Clip.

        Args:
          value: what is clipped
          band: between what
          soft: with round edges
          width: how round
        """
        return value

    specs = clip._type.parameters
    assert [spec.kind for spec in specs.values()] == ["interval", "bool", "float"]
    band, width = specs["band"], specs["width"]
    assert (band.unit, band.group, band.minimum, band.maximum, band.default) == ("m", "g", 0, 1, (0.2, 0.8))
    assert (width.step, width.minimum, width.default, width.type) == (0.5, 0, None, float | None)
    assert not clip._type.is_shown("width", {"soft": False})
    assert clip._type.help_of("soft") == "with round edges"
    # Annotated types are one to Python if they are equal, so it may be that somebody else's 0.0 is said.
    with pytest.raises(ValueError, match=r'parameter "clip\.width" must be > 0(\.0)?, got -1\.0'):
        clip(width=-1.0)


def test_lists_and_arrays_belong_to_one_node_alone() -> None:
    names, offset = ["x"], np.ones(3)
    one, other = Everything(names=names, offset=offset), Everything()
    names.append("y")
    offset[0] = 7
    one.ports.parameters["names"].value.append("z")
    assert (one.names, other.names) == (["x"], ["a"])
    assert one.offset.tolist() == [1, 1, 1]
    with pytest.raises(ValueError, match="read-only"):
        one.offset[0] = 9
    copy = one._copy()
    copy.ports.parameters["names"].value = ["q"]
    assert one.names == ["x"]


@pytest.mark.rule("P8")
def test_nothing_leads_into_what_is_read_only_but_from_there() -> None:
    graph = hfg.Graph("g")
    node, other = graph.add(Everything(), name="node"), graph.add(Everything(), name="other")
    graph.connect(node.ports.parameters["done"], other.ports.inputs["value"])
    with pytest.raises(
        EdgeRefused, match=r'"other\.threshold" cannot lead into the parameter "node\.done", which is r'
    ):
        graph.connect(other.ports.parameters["threshold"], node.ports.parameters["done"])
    with pytest.raises(GraphError, match=r'parameter "node\.done" is read-only: only its node sets it'):
        graph.edit(hfg.commands.SetParameter("node.done", 0.5))
    node.done = 0.25  # as its own code does
    with pytest.raises(ValueError, match=r"must be <= 1, got 2\.0"):
        node.done = 2.0
    assert node.done == 0.25
    assert node._copy().done == 0.0  # type: ignore[attr-defined]


def declared(**body: Any) -> type:
    return type("Made", (hfg.Node,), body)


@pytest.mark.parametrize(
    ("declare", "wrong"),
    [
        (lambda: declared(a=hfg.Parameter(7, at.Le(1))), 'the default of parameter "a" must be <= 1, got 7'),
        (lambda: declared(a=hfg.Parameter(at.Le(1))), r"Le\(le=1\) is a limit, but the first argument of a parameter"),
        (lambda: declared(a=hfg.Parameter("x", step=1)), r'parameter "a" has a step, but its kind is text; omit step='),
        (
            lambda: declared(a=hfg.Parameter(1, step=0)),
            r'parameter "a" has a step of 0; a step must be a number above 0',
        ),
        (lambda: declared(a=hfg.Parameter("x", choices="xy")), r"choices are several values, got 'xy'; write choices="),
        (lambda: declared(a=hfg.Parameter(1, pattern="*.png")), r"has the kind int, but pattern=, directory= and"),
        (
            lambda: declared(a=hfg.Parameter(Path("x"), pattern=" ")),
            r"has the pattern ' '; a pattern matches file names,",
        ),
        (lambda: declared(a=hfg.Parameter(1, unit=3)), r'has unit=3; write a string, as in unit="\.\.\."'),  # type: ignore[call-overload]
        (
            lambda: declared(a=hfg.Parameter(1, shown_if="b")),
            r'"a" is shown by "b", which is not a parameter with a val',
        ),
        (
            lambda: declared(a=hfg.Parameter(1, shown_if="a")),
            r"depends on its own value to be shown, so it could be hidden forever;",
        ),
        (lambda: declared(a=hfg.Parameter(1, shown_if=3)), r"shown_if names parameters of the same node and what th"),  # type: ignore[call-overload]
        (
            lambda: declared(a=hfg.Parameter(1, shown_if={"b": at.Predicate(bool)}), b=hfg.Parameter(1)),
            r'shown_if has a condition on "b" that only code can decide, .*, and files hold no code; use the values',
        ),
        (
            lambda: declared(a=hfg.Parameter(1, shown_if={"b": "z"}), b=hfg.Parameter("x", choices=("x", "y"))),
            r"\"a\" is shown if \"b\" has a value that it can never have: it must be one of 'x', 'y', got 'z'",
        ),
        (
            lambda: declared(
                a=hfg.Parameter(1, shown_if="b"), b=hfg.Parameter(1, shown_if="c"), c=hfg.Parameter(1, shown_if="a")
            ),
            'parameters depend on each other to be shown, "a" by "b" by "c" by "a", so all of them could be '
            "hidden forever; always show one of",
        ),
        (lambda: declared(a=hfg.Parameter(trigger=True, choices=(1, 2))), "is a trigger and has no value"),  # type: ignore[call-overload]
        (lambda: declared(a=hfg.Parameter(read_only=True)), "is read-only and has no default to start with"),  # type: ignore[call-overload]
        (
            lambda: type("Box", (hfg.Subgraph,), {"a": hfg.Parameter(0.0, read_only=True)}),
            'parameter "a" is read-only, but a subgraph has no code of its own to set it',
        ),
    ],
)
def test_a_declaration_that_contradicts_itself_is_refused_with_the_remedy(declare: Any, wrong: str) -> None:
    with pytest.raises(DeclarationError, match=wrong):
        declare()


def scale_1(value: float, *, a: Annotated[float, hfg.Parameter(2.0)] = 1.0) -> float:
    return value * a


def scale_2(value: float, *, a: Annotated[float, hfg.Parameter(0.0, read_only=True)] = 1.0) -> float:
    return value * a


def scale_3(value: float, *, a: Annotated[float, hfg.Parameter(unit="m"), hfg.Parameter(unit="m")] = 1.0) -> float:
    return value * a


@pytest.mark.parametrize(
    ("function", "wrong"),
    [
        (scale_1, r'parameter "a" has its default or type in hfg\.Parameter; write Annotated\[float, hfg'),
        (scale_2, r'parameter "a" has its default or type in hfg\.Parameter'),
        (scale_3, r'parameter "a" has two hfg\.Parameter in its annotation; combine them in one'),
    ],
)
def test_an_annotation_that_contradicts_itself_is_refused(function: Any, wrong: str) -> None:
    with pytest.raises(DeclarationError, match=wrong):
        hfg.node(function)

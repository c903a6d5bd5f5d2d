"""Values as plain data and back: nothing is lost, nothing is guessed, and what is wrong is named."""

from __future__ import annotations

import contextlib
import datetime
import decimal
import fractions
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from hfg.base.values import Colour, Span, same
from hfg.encoding import decode, encode, has_tag, read_text
from hfg.errors import EncodingError
from hfg.types import Shape
from tests.encoding.kinds import Found, Mode, Plan, Pose, Sides


def named(value: float) -> float:
    return value


PLAIN: list[tuple[Any, Any, Any]] = [
    (1, float, 1),
    (math.nan, float, "nan"),
    (Mode.GOOD, Mode, "GOOD"),
    (Sides.LEFT | Sides.RIGHT, Sides, ["LEFT", "RIGHT"]),
    (Colour(255, 128, 0), Colour, "#ff8000"),
    (Span(0.25, 0.5), Span[float], [0.25, 0.5]),
    (Path("a/b.png"), Path | None, "a/b.png"),
    (b"\x00\xff", bytes, "AP8="),
    (1 + 2j, complex, "(1+2j)"),
    ((1, 2.5), tuple[int, float], [1, 2.5]),
    ({3, 1, 2}, set[int], [1, 2, 3]),
    ({1: "a"}, dict[int, str], [[1, "a"]]),
    (np.eye(2), npt.NDArray[np.float64], [[1.0, 0.0], [0.0, 1.0]]),
    (np.zeros((0, 3)), Annotated[npt.NDArray[np.float64], Shape(None, 3)], []),
    (np.float64(1.5), float, 1.5),
    (Pose(1.0, Mode.GOOD, Path("q")), Pose, {"x": 1.0, "mode": "GOOD", "file": "q"}),
    (Plan([Pose(2.0)]), Plan, {"poses": [{"x": 2.0, "mode": "FAST", "file": None}], "name": ""}),
    (Found(0.5), Found, {"score": 0.5, "label": "?"}),
    (datetime.datetime(2020, 1, 2, tzinfo=datetime.UTC), datetime.datetime, "2020-01-02T00:00:00Z"),
    (decimal.Decimal("1.50"), decimal.Decimal, "1.50"),
    (Mode.FAST, Literal[Mode.FAST], "FAST"),
    (None, int | None, None),
]
TAGGED: list[tuple[Any, Any]] = [
    (named, Callable[[float], float]),
    (Pose, type),
    (math.inf, Any),
    (math.nan, str | float),
    (Mode.FAST, Any),
    (Mode.FAST, Mode | str),
    (Sides.LEFT, Any),
    (Colour(1, 2, 3), Any),
    (Span(1, 2), Any),
    (Path("a"), str | Path),
    (b"a", Any),
    (1j, Any),
    ([1, (2, 3)], Any),
    ((1, 2), Sequence[int]),
    ({1, "a"}, Any),
    (frozenset("ab"), Any),
    ({(1, 2): Path("z")}, Any),
    ({"$type": "path", "value": "no path"}, Any),
    (np.eye(2, dtype=np.uint8), npt.NDArray[Any]),
    (np.zeros((0, 3)), Any),
    (np.array([1.5, math.nan]), Any),
    (np.array(["a", "bc"]), Any),
    (Pose(1.0), Any),
    (Plan([Pose(2.0, file=Path("f"))]), Any),
    (Found(1.0), Any),
    (datetime.timedelta(seconds=3), Any),
    (named, Any),
]


@pytest.mark.parametrize(("value", "hint", "data"), PLAIN)
def test_what_the_type_tells_is_not_written(value: Any, hint: Any, data: Any) -> None:
    assert encode(value, hint) == data
    assert same(decode(json.loads(json.dumps(data)), hint), value)


@pytest.mark.parametrize(("value", "hint"), TAGGED)
def test_where_the_type_does_not_tell_the_data_does(value: Any, hint: Any) -> None:
    data = encode(value, hint)
    assert has_tag(data)
    assert same(decode(json.loads(json.dumps(data)), hint), value)


ATOMS = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text()
    | st.binary()
    | st.complex_numbers()
    | st.sampled_from([*Mode, *Sides, Colour(1, 2, 3), Path("a/b"), named])
    | st.builds(Span, st.integers(), st.integers())
    | arrays.arrays(
        st.sampled_from([np.dtype(name) for name in ("bool", "uint8", "int32", "float32", "float64", "complex64")]),
        arrays.array_shapes(min_dims=0, min_side=0, max_dims=3, max_side=3),
    )
)
KEYS = st.text() | st.integers() | st.just("$type") | st.tuples(st.booleans(), st.text())
VALUES = st.recursive(
    ATOMS,
    lambda inner: (
        st.lists(inner)
        | st.lists(inner).map(tuple)
        | st.dictionaries(KEYS, inner)
        | st.frozensets(KEYS)
        | st.builds(Plan, st.lists(st.builds(Pose, st.floats(allow_nan=False))), st.text())
    ),
    max_leaves=8,
)


@pytest.mark.slow
@given(VALUES)
def test_any_data_comes_back_unchanged_from_json(value: Any) -> None:
    text = json.dumps(encode(value), allow_nan=False)
    assert same(decode(json.loads(text)), value)


@pytest.mark.parametrize(
    ("data", "hint", "wrong"),
    [
        ({"x": "a"}, Pose, "the value.x must be float, got 'a'"),
        ({"x": 1, "z": 2}, Pose, "the value has no 'z': Pose has x, mode, file"),
        ({}, Pose, "the value is not Pose (TypeError: Pose.__init__() missing 1 required"),
        ([1, "a"], list[int], "the value[1] must be int, got 'a'"),
        ({"poses": [{"x": 1.0}, {"x": None}]}, Plan, "the value.poses[1].x must be float, got None"),
        ("SLOW", Mode, "the value must be Mode, one of FAST, GOOD, got 'SLOW'"),
        (["LEFT", "UP"], Sides, "the value must be Sides, one of LEFT, RIGHT, got ['LEFT', 'UP']"),
        ("#12", Colour, "the value must be a colour, as in \"#ff8000\", got '#12'"),
        ([1, 2, 256], Colour, 'the value must be a colour, as in "#ff8000" or [255, 128, 0], got [1, 2, 256]'),
        ([1, 2, 3], Span[int], "the value must be Span[int], got [1, 2, 3]"),
        ([1, 2], tuple[int, int, int], "the value must be tuple[int, int, int], got [1, 2]"),
        ([[1, 2], [3]], npt.NDArray[np.float64], "the value must be Array[float64], got [[1, 2], [3]]"),
        ([300], npt.NDArray[np.uint8], "the value must be Array[uint8], got [300]"),
        ("c", Literal["a", "b"], "the value must be Literal['a', 'b'], got 'c'"),
        ("yes", bool, "the value must be bool, got 'yes'"),
        ("?", bytes, "the value must be bytes, got '?'"),
        ([[1, 2]], dict[str, int], "the value, key 1 must be str, got 1"),
        ([[[], 2]], dict[Any, int], "the value has an invalid key"),
        ([[]], set[Any], "the value has an invalid member"),
        ({"$type": "os:system", "value": "true"}, Any, 'the value is of type "os:system", which is not a type of data'),
        ({"$type": "no_such:X", "value": 1}, Any, '"no_such:X": importing "no_such" failed (ModuleNotFoundError'),
        ({"$type": 3}, Any, 'the value has "$type" but does not state the type of its "value",'),
        (
            {"$type": "array", "dtype": "O", "value": []},
            Any,
            "the value is not an array (an array of object is not data)",
        ),
        (
            {"$type": "array", "dtype": "U99999999", "value": ["a"]},
            Any,
            "the value is not an array (an array of <U9999999",
        ),
        ({"$type": "array", "shape": [3], "value": [1.0]}, Any, "the value is not an array (cannot reshape array"),
        (
            {"$type": "reference", "value": "json:nothing"},
            Callable[[], None],
            '"json:nothing": module "json" has no "nothing"',
        ),
        ({"$type": "reference", "value": "json"}, Callable, "'json' is not a reference; write \"module:name\""),
        ("os:system", Callable[[], None], "the value is 'os:system', and a text alone does not refer to code"),
        (["os:system"], list[type], "the value[0] is 'os:system', and a text alone does not refer to code"),
    ],
)
def test_data_that_is_no_value_of_the_type_is_refused_with_its_place(data: Any, hint: Any, wrong: str) -> None:
    with pytest.raises(EncodingError) as caught:
        decode(data, hint)
    assert str(caught.value).startswith(wrong)


ODD: list[Any] = [None, True, -1, 10**400, math.nan, "", "abc", "1,2", "#zz", "\ud800", "nan", [], [[1], [1, 2]], [{}]]
ODD += [
    {},
    {"x": "a"},
    {1: [2]},
    {"$type": []},
    "a:b",
    "[1, 2",
    "{a: 1}",
    "2020-13-01",
    [math.nan] * 3,
    [None, "a", {}],
]
HINTS: list[Any] = [int, float, bool, str, bytes, complex, None, Any, Path, Mode, Sides, Pose, Colour, Span[float]]
HINTS += [list[float], set[float], tuple[int, float], dict[str, float], float | None, int | str, Literal["a", 1]]
HINTS += [npt.NDArray[np.float64], Annotated[npt.NDArray[np.float64], Shape(3)], datetime.datetime, frozenset[Mode]]


@pytest.mark.parametrize("hint", HINTS, ids=str)
def test_whatever_the_data_is_it_is_a_value_or_refused(hint: Any) -> None:
    for data in ODD:
        for read in [decode, read_text] if isinstance(data, str) else [decode]:
            with contextlib.suppress(EncodingError):  # anything else fails
                read(data, hint)


@pytest.mark.parametrize(
    ("value", "wrong"),
    [
        (fractions.Fraction(1, 2), "Fraction: Fraction(1, 2) is not data that can be stored; use plain values"),
        (lambda: 1, "cannot be found by a name, so it cannot be stored; define it in a module"),
        (np.array([object()]), "an array of object, 1 cannot be stored; numbers, booleans and strings can"),
    ],
)
def test_what_is_no_data_is_refused(value: Any, wrong: str) -> None:
    with pytest.raises(EncodingError) as caught:
        encode(value)
    assert wrong in str(caught.value)


def test_what_contains_itself_is_refused() -> None:
    around: list[Any] = []
    around.append(around)
    with pytest.raises(EncodingError, match="contains itself"):
        encode(around)
    with pytest.raises(EncodingError, match="contains itself"):
        decode(around, list[Any])


def test_a_value_of_another_type_is_refused() -> None:
    with pytest.raises(EncodingError, match="int: 3 is not str, so it cannot be stored as one"):
        encode(3, str)


def test_who_reads_decides_what_may_be_imported() -> None:
    def refuse(reference: str) -> Any:
        raise EncodingError(f'"{reference}" is not allowed here')

    data = encode(Pose(1.0))
    with pytest.raises(EncodingError, match='"tests.encoding.kinds:Pose" is not allowed here'):
        decode(data, find=refuse)
    assert decode(encode(Pose(1.0), Pose), Pose, find=refuse) == Pose(1.0)


@pytest.mark.parametrize(
    ("text", "hint", "value"),
    [
        ("true", bool, True),
        ("1.5", float, 1.5),
        ("GOOD", Mode, Mode.GOOD),
        ("LEFT,RIGHT", Sides, Sides.LEFT | Sides.RIGHT),
        ("a, b", set[str], {"a", "b"}),
        ("3", str, "3"),
        ("[1, 2]", list[int], [1, 2]),
        ("1,2,3", tuple[float, float, float], (1, 2, 3)),
        ("0.1,0.2", Span[float], Span(0.1, 0.2)),
        ("#ff0000", Colour, Colour(255, 0, 0)),
        ("x.png", Path | None, Path("x.png")),
        ("none", Path | None, None),
        ("hello", Any, "hello"),
        ("3", Any, 3),
        ("", list[str], []),
        ("[[1,0],[0,1]]", npt.NDArray[np.float64], np.eye(2)),
    ],
)
def test_a_text_is_read_as_its_writer_means_it(text: str, hint: Any, value: Any) -> None:
    assert same(read_text(text, hint), value)


def test_a_text_that_means_no_value_is_refused() -> None:
    with pytest.raises(EncodingError, match="the value must be int, got 'three'"):
        read_text("three", int)

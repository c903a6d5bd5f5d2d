"""Which port types fit together, and which values fit a type."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Generic, Literal, NewType, Protocol, TypeVar, runtime_checkable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typing_extensions import TypeAliasType

import hfg.types
from hfg.types import (
    Array,
    ColorImage,
    GrayImage,
    Image,
    Pixels,
    Shape,
    accepts,
    compatible,
    describe,
    why_not,
)

Value = TypeVar("Value")
Number = TypeVar("Number", int, float)
Meters = NewType("Meters", float)
Alias = TypeAliasType("Alias", list[int])
Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]
Points = Annotated[npt.NDArray[np.float64], Shape(None, 3)]


class Animal: ...


class Dog(Animal): ...


@dataclass
class Pose:
    x: float


@runtime_checkable
class Named(Protocol):
    name: str


class Boxed(Generic[Value]): ...


FITS = [
    (int, int),
    (int, float),
    (int, complex),
    (float, complex),
    (bool, int),
    (bool, float),
    (Dog, Animal),
    (int, object),
    (Any, int),
    (int, Any),
    (None, Any),
    (None, object),
    (None, int | None),
    (int, int | str),
    (int | str, str | int | bytes),
    (int, float | str),
    (int | None, int),  # None in an output is silence
    (int | None, int | None),
    (list[int], list[int]),
    (list[int], Sequence[int]),
    (dict[str, int], Mapping[str, int]),
    (list[int], list),
    (str, Iterable[str]),
    (Literal["a"], str),
    (Literal["a"], Literal["a", "b"]),
    (Meters, float),
    (Alias, Sequence[int]),
    (list[int], Alias),
    (Annotated[int, "metres"], float),
    (int, Annotated[int, "metres"]),
    (tuple[int, str], tuple[int, str]),
    (type[Dog], type[Animal]),
    (Callable[[int], str], Callable[..., str]),
    (int, Value),
    (int, Number),
    (Boxed[int], Boxed[int]),
    (Bytes, Bytes),
    (Bytes, Array),
    (Bytes, np.ndarray),
    (Bytes, object),
    (Array, Bytes),  # an open dtype fits and is checked on the value
    (np.ndarray, Floats),
    (npt.NDArray[np.floating[Any]], Floats),
    (Floats, npt.NDArray[np.floating[Any]]),
    (Bytes, npt.NDArray[np.uint8] | None),
    (Bytes, Image),
    (Image, Bytes),
    (GrayImage, Image),
    (Image, ColorImage),
    (Bytes, npt.NDArray[np.uint8 | np.uint16]),
    (list[Bytes], list[Array]),
    (Image, Image | None),
]

DOES_NOT_FIT = [
    (float, int, "float is no int"),
    (str, int, "str is no int"),
    (Animal, Dog, "Animal is no Dog"),
    (object, int, "object is no int"),
    (int | str, int, "str is no int"),
    (str, int | None, "str is none of int | None"),
    (None, int, "None is no int"),
    (list[str], list[int], "list[str] is no list[int]"),
    (Literal["c"], Literal["a", "b"], "is no"),
    (str, Meters, "is no"),
    (int, Image, "int is no array"),
    (Image, int, "an array is no int"),
    (Bytes, Floats, "array of uint8 is no array of float32"),
    (npt.NDArray[np.floating[Any]], Bytes, "array of floating"),
    (GrayImage, ColorImage, "the layout Pixels(1) never fits Pixels(3)"),
    (Points, Annotated[npt.NDArray[np.float64], Shape(None, 2)], "the layout"),
    (Annotated[npt.NDArray[np.float64], Shape(3)], Image, "the layout"),
    (list[Bytes], list[Floats], "array of uint8"),
    (npt.NDArray[np.uint8 | np.float32], Bytes, "is no array of uint8"),
]


@pytest.mark.rule("P3")
@pytest.mark.parametrize(("source", "target"), FITS, ids=lambda hint: describe(hint))
def test_types_that_fit(source: Any, target: Any) -> None:
    assert why_not(source, target) is None
    assert compatible(source, target)


@pytest.mark.rule("P3")
@pytest.mark.parametrize(("source", "target", "reason"), DOES_NOT_FIT, ids=lambda hint: describe(hint))
def test_types_that_do_not_fit_say_why(source: Any, target: Any, reason: str) -> None:
    assert not compatible(source, target)
    assert reason in (why_not(source, target) or "")


@pytest.mark.rule("P3")
@pytest.mark.parametrize("hint", ["Pose", 3, lambda: None])
def test_what_cannot_be_judged_is_an_error_that_names_the_hint(hint: Any) -> None:
    reason = why_not(hint, int)
    assert reason is not None
    assert "cannot judge" in reason
    assert describe(hint) in reason


def test_metadata_that_cannot_be_hashed_is_judged_all_the_same() -> None:
    assert compatible(Annotated[int, []], float)
    assert why_not(Annotated[str, []], int) == "str is no int"
    assert accepts(3, Annotated[int, []])


@given(st.sampled_from([hint for pair in FITS for hint in pair]))
def test_every_type_fits_itself(hint: Any) -> None:
    assert compatible(hint, hint)


ACCEPTED = [
    (3, int),
    (3, float),
    (3.0, complex),
    (None, int | None),
    ("a", Literal["a", "b"]),
    ([1, 2], list[int]),
    ({"a": 1}, dict[str, float]),
    ((1, "a"), tuple[int, str]),
    ((1, 2, 3), tuple[int, ...]),
    ((), tuple[()]),
    ("abc", Sequence[str]),
    ({1, 2}, Collection[int]),
    ([np.zeros((2, 2))], list[Image]),
    (iter([1]), Iterable[str]),  # looking would take the items away
    (object(), Any),
    (Pose(1.0), Pose),
    (np.zeros((2, 2), np.uint8), Image),
    (np.zeros((2, 2, 3), np.uint8), Image),
    (np.zeros((2, 2, 1)), GrayImage),
    (np.zeros((2, 2)), GrayImage),
    (np.zeros((5, 3)), Points),
    (np.zeros(7), Array),
    (np.zeros(7, np.float32), npt.NDArray[np.floating[Any]]),
]

NOT_ACCEPTED = [
    (3.5, int),
    ("3", float),
    (None, int),
    ("c", Literal["a", "b"]),
    ([1, "2"], list[str]),
    (["1", 2], list[str]),
    ({"a": "b"}, dict[str, float]),
    ({1: 1.0}, Mapping[str, float]),
    ((1, 2), tuple[int, str]),
    ((1,), tuple[int, str]),
    ((1, "2"), tuple[int, ...]),
    ([1], tuple[int, ...]),
    ([np.zeros(2)], list[Image]),
    (np.zeros(7), Image),
    (np.zeros((2, 2, 5)), Image),
    (np.zeros((2, 2)), ColorImage),
    (np.zeros((5, 2)), Points),
    (np.zeros((5, 3), np.float32), Points),
    ([[1, 2]], Array),
    (np.zeros(7, np.uint8), Floats),
]


@pytest.mark.parametrize(("value", "hint"), ACCEPTED, ids=lambda item: str(item).partition(" at 0x")[0][:30])
def test_values_of_a_type_are_accepted(value: Any, hint: Any) -> None:
    assert accepts(value, hint)


@pytest.mark.parametrize(("value", "hint"), NOT_ACCEPTED, ids=lambda item: str(item).partition(" at 0x")[0][:30])
def test_values_of_another_type_are_not(value: Any, hint: Any) -> None:
    assert not accepts(value, hint)


def test_the_same_value_always_gets_the_same_answer() -> None:
    """A check of one item chosen at random finds this one half the time."""
    assert not any(accepts([1, "2"], list[int]) for _ in range(50))


@pytest.mark.parametrize(
    ("hint", "words"),
    [
        (int, "int"),
        (None, "None"),
        (int | None, "int | None"),
        (list[int], "list[int]"),
        (Image, "Image"),
        (ColorImage, "ColorImage"),
        (Array, "Array"),
        (Bytes, "Array[uint8]"),
        (Any, "Any"),
        (dict[str, Any], "dict[str, Any]"),
        (Annotated[int, "metres"], "int"),
    ],
)
def test_types_are_described_as_a_user_would_write_them(hint: Any, words: str) -> None:
    assert describe(hint) == words


def test_layouts_compare_by_value() -> None:
    assert Shape(None, 3) == Shape(None, 3) != Shape(3, None)
    assert Pixels(3) != Shape(3)
    assert len({Pixels(3), Pixels(3), Shape(3)}) == 2


def test_ten_thousand_edges_of_one_kind_are_judged_once(monkeypatch: pytest.MonkeyPatch) -> None:
    judged: list[tuple[Any, Any]] = []

    def judge(source: Any, target: Any) -> str | None:
        judged.append((source, target))
        return _judge(source, target)

    _judge = hfg.types._judge
    monkeypatch.setattr(hfg.types, "_judge", judge)
    hfg.types._why_not.cache_clear()
    for _ in range(10_000):
        assert compatible(dict[int, str], dict[int, str | None])
    assert judged.count((dict[int, str], dict[int, str | None])) == 1

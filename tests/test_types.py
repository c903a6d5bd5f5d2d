"""Which port types fit together, and which values fit a type."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import (
    Callable,
    Collection,
    Generator,
    Hashable,
    ItemsView,
    Iterable,
    Mapping,
    Sequence,
)
from dataclasses import dataclass
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Generic,
    Literal,
    NamedTuple,
    NewType,
    NoReturn,
    Protocol,
    SupportsFloat,
    TypedDict,
    TypeVar,
    runtime_checkable,
)

import numpy as np
import numpy.typing as npt
import pytest
from beartype import BeartypeConf
from beartype.door import TypeHint, is_bearable
from beartype.roar import BeartypeException
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from typing_extensions import TypeAliasType

import hfg.types
from hfg.types import (
    Array,
    Pixels,
    Shape,
    accepts,
    array_facts,
    compatible,
    describe,
    describe_value,
    why_not,
)

Image = Annotated[Array, Pixels()]
GrayImage = Annotated[Array, Pixels(1)]
ColorImage = Annotated[Array, Pixels(3), hfg.types.Named("ColorImage")]
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


class BoxOfInt(Boxed[int]): ...


class Poses(list[Pose]): ...


class Prices(dict[str, float]): ...


class Stack(list[Value]): ...


class Corner(NamedTuple):
    x: int
    name: str


class Options(TypedDict):
    width: int


class LongOptions(Options):
    height: int


class HasX(Protocol):
    @property
    def x(self) -> float: ...


class SupportsArray(Protocol):
    def __array__(self) -> Any: ...


class Late:
    def __init__(self, x: float) -> None:
        self.x = x


class Calling:
    def __call__(self, value: int) -> int:
        return value


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
    # what is sent is never changed (rule T1), so what it holds may be of a narrower type
    (list[int], Sequence[float]),
    (list[bool], list[int]),
    (dict[str, int], Mapping[str, float]),
    # containers as what they are more generally
    (tuple[int, ...], Sequence[int]),
    (tuple[int, ...], Iterable[float]),
    (tuple[int, str], Collection[int | str]),
    (tuple[()], tuple[int, ...]),
    (tuple[int, int], tuple[int, ...]),
    (list[int], Iterable[int]),
    (list[int], Collection[int]),
    (set[int], Collection[int]),
    (dict[str, int], Iterable[str]),
    (dict[str, int], Collection[str]),
    (Counter[str], Mapping[str, int]),
    (defaultdict[str, int], dict[str, int]),
    (ItemsView[str, int], Iterable[tuple[str, int]]),
    (Generator[int, None, None], Iterable[int]),
    (str, Sequence[str]),
    (str, Collection[str]),
    (bytes, Sequence[int]),
    (range, Sequence[int]),
    (Corner, tuple[int, str]),
    (Corner, Sequence[int | str]),
    (Options, Mapping[str, int]),
    (Options, Options),
    (LongOptions, Options),
    # a bare generic holds anything; that is seen on the values
    (list, list[int]),
    (list[int], list),
    (list, Sequence[int]),
    (dict, Mapping[str, int]),
    (tuple, tuple[int, int]),
    (Boxed, Boxed[int]),
    (Boxed[int], Boxed),
    # classes that say it of their bases
    (Poses, Sequence[Pose]),
    (Prices, Mapping[str, float]),
    (BoxOfInt, Boxed[int]),
    (Stack[int], Sequence[int]),
    # protocols, by what a class has, writes in `__init__` or inherits
    (Pose, HasX),
    (Late, HasX),
    (int, SupportsFloat),
    (Array, SupportsArray),
    # what can be called: it may take more and give less
    (Callable[[float], bool], Callable[[int], int]),
    (Callable[..., int], Callable[[int], int]),
    (type[Dog], Callable[..., Animal]),
    (Calling, Callable[[int], int]),
    # the rest
    (bool, Literal[True, False]),
    (Literal[1, 2], float),
    (Array, Iterable[float]),
    (list[int | None], list[int | None]),
    (list[int] | None, Sequence[float]),
    (list[Annotated[int, "metres"]], Sequence[Meters | int]),
    (NoReturn, int),
]

DOES_NOT_FIT = [
    (float, int, "float is not int"),
    (str, int, "str is not int"),
    (Animal, Dog, "Animal is not Dog"),
    (object, int, "object is not int"),
    (int | str, int, "str is not int"),
    (str, int | None, "str is not one of int | None"),
    (None, int, "None is not int"),
    (list[str], list[int], "list[str] is not list[int]"),
    (Literal["c"], Literal["a", "b"], "is not"),
    (str, Meters, "is not"),
    (int, Image, "int is not an array"),
    (Image, int, "an array is not int"),
    (Bytes, Floats, "array of uint8 is not an array of float32"),
    (npt.NDArray[np.floating[Any]], Bytes, "array of floating"),
    (GrayImage, ColorImage, "the layout Pixels(1) never matches Pixels(3)"),
    (Points, Annotated[npt.NDArray[np.float64], Shape(None, 2)], "the layout"),
    (Annotated[npt.NDArray[np.float64], Shape(3)], Image, "the layout"),
    (list[Bytes], list[Floats], "array of uint8"),
    (npt.NDArray[np.uint8 | np.float32], Bytes, "is not an array of uint8"),
    (list[float], Sequence[int], "float is not int"),
    (tuple[int, str], Iterable[int], "tuple[int, str] is not Iterable[int]: str is not int"),
    (tuple[int, ...], tuple[int, int], "its length is open"),
    (tuple[int], tuple[int, int], "it has 1 items, not 2"),
    (list[int], tuple[int, ...], "is not tuple"),
    (dict[str, int], Iterable[int], "str is not int"),
    (str, Sequence[int], "str is not Sequence[int]: str is not int"),
    (str, list[str], "str is not list[str]"),
    (Sequence[int], list[int], "is not list[int]"),
    (Mapping[str, int], dict[str, int], "is not dict"),
    (set[int], Sequence[int], "is not Sequence"),
    (list[int | None], list[int], "None is not int"),  # inside of another value it is one
    (Poses, Sequence[int], "Pose is not int"),
    (BoxOfInt, Boxed[str], "int is not str"),
    (Animal, HasX, 'Animal is not HasX: it has no "x"'),
    (str, SupportsFloat, '"__float__"'),
    (Callable[[int], int], Callable[[float], int], "does not accept the arguments of"),
    (Callable[[int], int], Callable[[int, int], int], "takes 1 arguments, not 2"),
    (Callable[[int], str], Callable[[int], int], "str is not int"),
    (Animal, Callable[..., Any], "cannot be called"),
    (bool, Literal[True], "False is not"),
    (Options, Mapping[str, str], "int is not str"),
    (Options, LongOptions, 'it has no key "height"'),
    (dict[str, int], Options, "is not Options"),
    (list, Hashable, "list is not Hashable"),
    (Array, Sequence[float], "an array is not Sequence"),
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
    assert "cannot compare" in reason
    assert describe(hint) in reason


def test_metadata_that_cannot_be_hashed_is_judged_all_the_same() -> None:
    assert compatible(Annotated[int, []], float)
    assert why_not(Annotated[str, []], int) == "str is not int"
    assert accepts(3, Annotated[int, []])


_PAGE = Path(__file__).resolve().parent.parent / "docs" / "howto" / "types.md"
_ROW = re.compile(r"^\| `(?P<source>.+)` \| `(?P<target>.+)` \| (?P<fits>yes|no) \|", re.MULTILINE)
_ROWS = [tuple(part.replace("\\|", "|") for part in row.groups()) for row in _ROW.finditer(_PAGE.read_text("utf-8"))]


@pytest.mark.rule("P3")
@pytest.mark.parametrize(("source", "target", "fits"), _ROWS)
def test_the_table_in_the_docs_is_true(source: str, target: str, fits: str) -> None:
    names = {**globals(), "NDArray": npt.NDArray}
    assert compatible(eval(source, names), eval(target, names)) is (fits == "yes")


def test_the_table_in_the_docs_was_found() -> None:
    assert len(_ROWS) > 20


# --- beartype, where it has an opinion ---

_LEAVES: list[Any] = [int, bool, float, complex, str, bytes, object, Animal, Dog, Pose, Corner, Poses, type(None)]
_HINTS: st.SearchStrategy[Any] = st.recursive(
    st.sampled_from(_LEAVES),
    lambda inner: st.one_of(
        st.builds(
            lambda generic, item: generic[item],
            st.sampled_from([list, set, frozenset, Sequence, Iterable, Collection]),
            inner,
        ),
        st.builds(lambda generic, item: generic[str, item], st.sampled_from([dict, Mapping, defaultdict]), inner),
        st.builds(lambda item: tuple.__class_getitem__((item, ...)), inner),
        st.builds(lambda first, second: tuple.__class_getitem__((first, second)), inner, inner),
        st.builds(lambda first, second: first | second, inner, inner),
        st.builds(lambda item: item | None, inner),
        st.builds(lambda item: Annotated[item, "metres"], inner),
        st.builds(lambda given: Callable[..., given], inner),  # its arguments beartype takes the wrong way round
        st.builds(lambda item: type[item], st.sampled_from([int, bool, Animal, Dog])),
    ),
    max_leaves=4,
)


@pytest.mark.slow
@pytest.mark.rule("P3")
@given(_HINTS, _HINTS)
@example(list[int], Sequence[int])
@example(tuple[int, ...], Iterable[int])
def test_what_beartype_says_is_a_subtype_fits(source: Any, target: Any) -> None:
    """We let more through than beartype, which knows nothing of int -> float or bare generics, and never less."""
    try:
        is_subtype = TypeHint(source).is_subhint(TypeHint(target))
    except (BeartypeException, TypeError, ValueError):
        return
    assert compatible(source, target) or not is_subtype


@pytest.mark.slow
@pytest.mark.rule("P3")
@given(st.data())
@settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
def test_a_value_of_a_type_that_fits_is_a_value_of_the_other_also_for_beartype(data: st.DataObject) -> None:
    source, target = data.draw(_VALUED), data.draw(_VALUED)
    if not compatible(source, target):
        return
    value = data.draw(st.from_type(source))
    if value is None:
        return  # in an output it is silence (rule T2)
    assert is_bearable(value, target, conf=BeartypeConf(is_pep484_tower=True))
    assert accepts(value, target)


_VALUED: st.SearchStrategy[Any] = st.recursive(
    st.sampled_from([int, bool, float, str, bytes, Corner, type(None)]),
    lambda inner: st.one_of(
        st.builds(lambda generic, item: generic[item], st.sampled_from([list, Sequence, Collection]), inner),
        st.builds(lambda generic, item: generic[str, item], st.sampled_from([dict, Mapping]), inner),
        st.builds(lambda item: tuple.__class_getitem__((item, ...)), inner),
        st.builds(lambda first, second: tuple.__class_getitem__((first, second)), inner, inner),
        st.builds(lambda first, second: first | second, inner, inner),
    ),
    max_leaves=3,
)


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
        (Image, "Array"),
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


def test_a_name_changes_nothing_in_what_fits() -> None:
    assert compatible(ColorImage, Annotated[Array, Pixels(3)])
    assert compatible(Annotated[Array, Pixels(3), hfg.types.Named("Photograph")], ColorImage)
    assert hfg.types.Named("a") == hfg.types.Named("a") != hfg.types.Named("b")
    assert len({hfg.types.Named("a"), hfg.types.Named("a"), hfg.types.Named("b")}) == 2


@pytest.mark.parametrize(
    ("hint", "dtypes", "shapes"),
    [
        (Bytes, {np.uint8}, ()),
        (Points, {np.float64}, ((None, 3),)),
        (
            Annotated[npt.NDArray[np.uint8 | np.int16], Pixels(1, 3)],
            {np.uint8, np.int16},
            ((None, None), (None, None, 1), (None, None, 3)),
        ),
        (npt.NDArray[np.floating[Any]], {np.float16, np.float32, np.float64}, ()),
        (Annotated[Annotated[Bytes, Pixels()], Pixels(3)], {np.uint8}, ((None, None, 3),)),
    ],
    ids=lambda item: str(item)[:30],
)
def test_dtypes_and_shapes_of_an_array_type_can_be_asked_for(hint: Any, dtypes: Any, shapes: Any) -> None:
    facts = array_facts(hint)
    assert facts is not None
    assert set(facts.dtypes) == dtypes
    assert facts.shapes == shapes


def test_an_open_dtype_holds_the_usual_numbers_and_a_number_is_no_array() -> None:
    facts = array_facts(Array)
    assert facts is not None
    assert {np.uint8, np.int32, np.float64} <= set(facts.dtypes)
    assert array_facts(int) is None


def test_an_array_is_described_by_dtype_and_shape_and_not_by_its_numbers() -> None:
    assert describe_value(np.zeros((480, 640))) == "an array of float64, 480 x 640"
    assert describe_value(np.zeros(())) == "an array of float64, without axes"
    assert describe_value("abc") == "str: 'abc'"


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

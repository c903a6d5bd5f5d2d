"""Values are generated from type hints and limits, and always fit them."""

from __future__ import annotations

import collections
import dataclasses
import doctest
import enum
import typing
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence, Sized
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, NewType, TypedDict, TypeVar

import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from annotated_types import Ge, Gt, Interval, Le, Len, MultipleOf, Predicate
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.errors import ResolutionFailed

import hfg
import hfg.testing.values
from hfg import images
from hfg.base.values import Colour, Span
from hfg.nodetypes.description import NodeType
from hfg.testing import values_of
from hfg.testing.values import Alike, values_of_parameter
from hfg.types import Shape, accepts


class Mode(enum.Enum):
    FAST = 1
    GOOD = 2


class Pose(NamedTuple):
    x: float
    modes: list[Mode]


@dataclasses.dataclass
class Box:
    """Holds itself, too."""

    pose: Pose
    inner: Box | None = None


class Name(msgspec.Struct):
    text: Annotated[str, Len(1, 4)]


class Keys(TypedDict):
    a: int


Metres = NewType("Metres", float)
T = TypeVar("T", bound=int)
Free = TypeVar("Free")

HINTS: list[Any] = [
    bool,
    int,
    float,
    complex,
    str,
    bytes,
    Any,
    object,
    Hashable,
    None,
    Literal["a", 2],
    Mode,
    int | str | None,
    Annotated[int, Interval(ge=3, lt=5)],
    Annotated[int, Ge(1), Predicate(lambda number: number % 2 == 1)],
    Annotated[int, MultipleOf(7), Ge(15)],
    Annotated[int, Le(-2_000_000)],
    Annotated[int, Gt(5_000_000)],
    Annotated[float, Interval(gt=0, lt=1)],
    Annotated[float, MultipleOf(0.5), Interval(ge=-1, le=1)],
    Annotated[float, Le(-3)],
    Annotated[str, Len(2, 3)],
    Annotated[list[int], Len(1)],
    list[int],
    list[Annotated[int, Ge(0)]],
    set[str],
    frozenset[bool],
    dict[str, list[int]],
    Mapping[Any, Any],
    Sequence[float],
    Iterable[int],
    Collection[Mode],
    collections.deque[int],
    Sized,
    tuple[int, str],
    tuple[int, ...],
    tuple,
    list,
    dict,
    Pose,
    Box,
    Name,
    Keys,
    Metres,
    T,
    Free,
    type,
    Path,
    Colour,
    Span[int],
    np.float32,
    Callable[[int], str],
    images.Image,
    images.Gray,
    images.Color,
    images.Depth,
    images.Points,
    images.Labels,
    images.AnyImage,
    list[images.Gray],
    npt.NDArray[Any],
    npt.NDArray[np.int16],
    Annotated[npt.NDArray[np.float64], Shape(None, 3)],
    Annotated[npt.NDArray[np.float64], Interval(ge=0.25, le=0.5)],
]


@pytest.mark.parametrize("hint", HINTS)
def test_values_fit_their_hint_and_its_limits(hint: Any) -> None:
    def wanted(value: Any) -> None: ...

    wanted.__annotations__ = {"value": hint}
    limits = getattr(hint, "__metadata__", ())

    @settings(max_examples=15, database=None, suppress_health_check=list(HealthCheck))
    @given(values_of(hint))
    def check(value: Any) -> None:
        assert accepts(value, hint)
        for limit in limits:
            if isinstance(limit, Interval):
                assert limit.ge is None or np.all(value >= limit.ge)
                assert limit.lt is None or np.all(value < limit.lt)
            elif isinstance(limit, Ge | Gt):
                assert value >= getattr(limit, "ge", getattr(limit, "gt", None))
            elif isinstance(limit, Len):
                assert len(value) >= limit.min_length

    check()


def test_an_iterator_gives_values_once() -> None:
    @settings(max_examples=5, database=None)
    @given(values_of(Iterator[int]))
    def check(value: Iterator[int]) -> None:
        assert all(isinstance(one, int) for one in value)
        assert list(value) == []

    check()


def found(strategy: st.SearchStrategy[Any], wanted: Callable[[Any], bool]) -> bool:
    """Whether a strategy gives such a value within some hundred draws."""
    seen: list[bool] = []

    @settings(max_examples=300, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
    @given(strategy)
    def look(value: Any) -> None:
        seen.append(wanted(value))

    look()
    return any(seen)


@pytest.mark.slow
def test_values_are_of_many_kinds() -> None:
    """A strategy that only gave zeros would fit every hint."""
    assert found(values_of(float), lambda value: value != value)
    assert found(values_of(int), lambda value: abs(value) > 1000)
    assert found(values_of(str), lambda value: "\n" in value)
    assert found(values_of(list[int]), lambda value: len(value) == 3)
    assert found(values_of(images.Gray), lambda value: value.size > 1 and value.min() < value.max())
    assert found(values_of(images.AnyImage), lambda value: value.ndim == 3 and value.dtype == np.float32)
    assert found(values_of(images.Points), lambda value: len(value) == 0)
    assert found(values_of(Box), lambda value: value.inner is not None and value.inner.inner is not None)
    assert found(values_of(Annotated[int, Gt(5_000_000)]), lambda value: value > 5_500_000)


@pytest.mark.slow
def test_most_arrays_of_a_firing_are_alike() -> None:
    alike = Alike(channels=3, dtype=np.float32)
    both = st.tuples(values_of(images.AnyImage, alike=alike), values_of(images.AnyImage, alike=alike))
    counts: list[bool] = []

    @settings(max_examples=100, database=None, derandomize=True)
    @given(both)
    def look(pair: tuple[Any, Any]) -> None:
        counts.append(pair[0].shape == pair[1].shape and pair[0].dtype == pair[1].dtype == np.float32)

    look()
    assert 40 <= sum(counts) < 100


@hfg.node
def with_parameters(
    *,
    mode: Literal["a", "b"] = "a",
    parts: Annotated[list[Literal["x", "y"]], hfg.Parameter(help="several")] = [],  # noqa: B006
    limited: Annotated[float, Interval(ge=2, le=3)] = 2,
    file: Annotated[Path, hfg.Parameter(pattern="*.png")] = Path("a.png"),
    text_path: Annotated[str, hfg.Parameter(save=True)] = "out",
    folder: Annotated[Path, hfg.Parameter(directory=True)] = Path(),
    band: Annotated[Span[float], Interval(ge=0, le=1)] = Span(0.0, 1.0),
    sides: Annotated[tuple[int, int], Ge(1)] = (1, 1),
    picked: Annotated[int, hfg.Parameter(choices=(3, 5))] = 3,
    kernel: Annotated[npt.NDArray[np.float64], Shape(3, 3), Ge(0)] | None = None,
) -> None: ...


TYPE: NodeType = with_parameters._type


@pytest.mark.parametrize("name", list(TYPE.parameters))
def test_values_of_parameters_are_allowed(name: str) -> None:
    spec = TYPE.parameters[name]

    @settings(max_examples=15, database=None)
    @given(values_of_parameter(spec))
    def check(value: Any) -> None:
        assert spec.check(value) is None

    check()


def test_what_nobody_can_make_is_named() -> None:
    class Socket:
        def __init__(self, address) -> None:  # type: ignore[no-untyped-def]
            raise AssertionError("nobody knows what an address is")

    @settings(database=None)
    @given(values_of(list[Socket]))
    def check(value: Any) -> None: ...

    with pytest.raises(ResolutionFailed, match="Socket"):
        check()


@pytest.mark.slow
def test_examples_in_docstrings_run() -> None:
    assert doctest.testmod(hfg.testing.values).failed == 0
    assert typing.get_args(Span[int]) == (int,)

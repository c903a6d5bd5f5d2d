"""Hypothesis strategies for the values of a type hint, as ports and parameters declare them.

Type hints of Python, limits of annotated-types, arrays and images of `hfg.types` and `hfg.images`, records. Numbers are
mostly small and never beyond a million, arrays have a few dozen pixels: size is rarely what breaks a node. Needs
hypothesis; knows no nodes.
"""

from __future__ import annotations

import collections
import dataclasses
import enum
import functools
import numbers
import os
import types
import typing
from collections import abc
from collections.abc import Callable, Collection
from pathlib import Path, PurePath
from typing import Any, Final, Literal

import annotated_types
import numpy as np
from hypothesis import reject
from hypothesis import strategies as st

from hfg.base.generics import callable_parts
from hfg.base.limits import limits_of
from hfg.base.values import Colour, Span
from hfg.encoding.records import names_of
from hfg.ports.specs import ParameterSpec
from hfg.testing.opening import opened
from hfg.testing.samples import PATHS
from hfg.types import ArrayFacts, array_facts, bare_type

__all__ = ["Alike", "values_of", "values_of_parameter"]

_MANY: Final = 1_000_000
_FEW: Final = 3
_SIDES: Final = ((24, 32), (24, 32), (1, 1), (17, 9), (40, 3), (64, 64))
_LENGTHS: Final = (12, 12, 1, 4, 33, 0)
_TEXTS: Final = ("1", "-2.5", "true", "a, b", '{"a": 1}', "a b\nc", "x" * 100)
_LETTERS: Final = "aB1 .,:;-+_/\\'\"{}[]()%$\n\t\0\x7f\u00e9\u00df\u6f22\U0001f642"
"""What texts have gone wrong with; all of Unicode takes Hypothesis seconds to prepare."""


@dataclasses.dataclass(frozen=True, slots=True)
class Alike:
    """The common properties of arrays that are drawn for one firing, so that functions of two images often get a pair.

    Attributes:
      rows: of images and matrices.
      columns: of them.
      count: of points and of arrays with one open axis.
      channels: of images that may have several.
      dtype: where the type allows it.
    """

    rows: int = 24
    columns: int = 32
    count: int = 12
    channels: int = 1
    dtype: Any = np.uint8

    @staticmethod
    def strategy() -> st.SearchStrategy[Alike]:
        """Draw one of a few."""
        return _ALIKE


_ALIKE: Final = st.sampled_from(
    [
        Alike(rows, columns, 12, channels, dtype)
        for rows, columns in ((24, 32), (12, 12))  # also square, so that products of matrices fit
        for channels in (1, 3)
        for dtype in (np.uint8, np.float32)
    ]
)


def values_of(
    hint: Any, limits: Collection[Any] = (), choices: Collection[Any] | None = None, *, alike: Alike | None = None
) -> st.SearchStrategy[Any]:
    """Return a strategy for the values of a type hint.

    Args:
      hint: a type hint; limits in `Annotated` count.
      limits: further constraints of annotated-types, as parameters have them.
      choices: the only values, if given.
      alike: what arrays have in common with others; without it each has its own size.

    Raises:
      hypothesis.errors.ResolutionFailed: when values are drawn: there is no way to make one. Tell Hypothesis, by
        `register_type_strategy`.

    Examples:
      >>> from typing import Annotated, Literal
      >>> from annotated_types import Interval
      >>> from hypothesis import given
      >>> @given(values_of(list[Annotated[int, Interval(ge=0, le=9)]]), values_of(Literal["fast", "slow"]))
      ... def test(digits, mode):
      ...     assert all(0 <= digit <= 9 for digit in digits)
      ...     assert mode in ("fast", "slow")
      >>> test()
    """
    if choices is not None:
        return _within(st.sampled_from(list(choices)), hint, limits_of(limits))
    return _values(hint, limits_of(limits), alike)


def values_of_parameter(spec: ParameterSpec, *, alike: Alike | None = None) -> st.SearchStrategy[Any]:
    """Return a strategy for the values that a parameter allows.

    Examples:
      >>> from annotated_types import Ge
      >>> from hypothesis import given
      >>> @given(values_of_parameter(ParameterSpec("width", int, 3, (Ge(1),))))
      ... def test(width):
      ...     assert width >= 1
      >>> test()
    """
    if spec.size:
        return st.integers(1, 4)
    if spec.kind == "choices":
        kept = typing.get_origin(bare_type(spec.type)) or list
        chosen: st.SearchStrategy[Any] = st.lists(st.sampled_from(list(spec.choices or ())), unique=True)
        strategy = chosen.map(_SETS.get(kept, _SEQUENCES.get(kept, tuple)))
    elif spec.choices is not None:
        strategy = st.sampled_from(list(spec.choices))
    elif spec.kind == "path":
        kind = Path if isinstance(spec.default, Path) or bare_type(spec.type) is not str else str
        names = ["folder", "new"] if spec.directory else list(PATHS)
        names += [pattern.replace("*", "new") for pattern in (spec.pattern or "").split()]
        strategy = st.sampled_from(names).map(kind)
    else:
        strategy = _values(spec.type, spec.limits, alike)
    return strategy.filter(lambda value: spec.check(value) is None)


def _values(hint: Any, limits: tuple[Any, ...], alike: Alike | None) -> st.SearchStrategy[Any]:
    try:
        hash((hint, limits))
    except TypeError:  # such as a limit that holds a list
        return _made(hint, limits, alike)
    return _kept(hint, limits, alike)


@functools.lru_cache(maxsize=4096, typed=True)
def _kept(hint: Any, limits: tuple[Any, ...], alike: Alike | None) -> st.SearchStrategy[Any]:
    """Make each strategy once: Hypothesis looks at a new one for longer than it draws from it."""
    return _made(hint, limits, alike)


def _made(hint: Any, limits: tuple[Any, ...], alike: Alike | None) -> st.SearchStrategy[Any]:
    facts = array_facts(hint)
    if facts is not None:
        limits += opened(hint)[1]
        low, high, _ = _bounds(limits)
        strategy = _arrays(facts, alike)
        if low is not None or high is not None:
            strategy = strategy.map(lambda array: np.clip(array, low, high).astype(array.dtype))
        return _within(strategy, hint, limits)
    hint, more = opened(hint)
    limits += more
    if limits:
        return _within(_of(hint, limits, alike), hint, limits)
    return _of(hint, (), alike)


def _within(strategy: st.SearchStrategy[Any], hint: Any, limits: tuple[Any, ...]) -> st.SearchStrategy[Any]:
    """Omit values that violate a limit that the strategy does not support."""
    if not limits:
        return strategy
    spec = ParameterSpec("value", hint, None, limits)
    return strategy.filter(lambda value: spec.check(value) is None)


def _of(hint: Any, limits: tuple[Any, ...], alike: Alike | None) -> st.SearchStrategy[Any]:
    if hint in (Any, object, abc.Hashable):
        return _anything(hashable=hint is abc.Hashable)
    if hint is None or hint is type(None):
        return st.none()
    origin, arguments = typing.get_origin(hint) or hint, typing.get_args(hint)
    if not isinstance(origin, type) or origin in (types.UnionType, abc.Callable):
        return _of_form(hint, origin, arguments, limits, alike)
    scalar = _scalar(origin, limits)
    if scalar is not None:
        return scalar
    container = _container(origin, arguments, limits, alike)
    if container is not None:
        return container
    if typing.is_typeddict(origin) or names_of(origin) is not None:
        return _record(origin, alike)
    return st.from_type(hint)


def _of_form(
    hint: Any, origin: Any, arguments: tuple[Any, ...], limits: tuple[Any, ...], alike: Alike | None
) -> st.SearchStrategy[Any]:
    """Return a strategy for a type hint that is not a class."""
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin in (typing.Union, types.UnionType):
        if str in arguments and any(map(_is_path, arguments)):
            arguments = tuple(one for one in arguments if one is not str)  # a path, not any text
        return st.one_of([_values(member, limits, alike) for member in arguments])
    if origin is abc.Callable:
        result = _values(callable_parts(hint)[1], (), alike)
        return result.map(lambda value: lambda *values, **named: value)
    return st.from_type(hint)


# --- scalars ---


def _scalar(kind: type, limits: tuple[Any, ...]) -> st.SearchStrategy[Any] | None:
    if issubclass(kind, enum.Enum):
        return st.sampled_from(list(kind))
    if kind is bool:
        return st.booleans()
    if kind is int or kind in (numbers.Integral, numbers.Rational):
        return _integers(limits)
    if kind is float or kind in (numbers.Real, numbers.Number, typing.SupportsFloat):
        return _floats(limits)
    if kind is complex:
        return st.complex_numbers(max_magnitude=_MANY)
    if kind in (str, bytes, bytearray):
        return _texts(kind, limits)
    if issubclass(kind, np.generic):
        return st.integers(0, 100).map(lambda number: np.dtype(kind).type(number))
    if kind is type:
        return st.sampled_from([int, float, str])
    if _is_path(kind):
        return st.sampled_from(PATHS).map(Path if kind is os.PathLike else kind)
    return None


def _is_path(hint: Any) -> bool:
    kind = typing.get_origin(hint) or hint
    return isinstance(kind, type) and (kind is os.PathLike or issubclass(kind, PurePath))


def _bounds(limits: tuple[Any, ...]) -> tuple[Any, Any, Any]:
    """Return least, most and step; None where there is none."""
    least: Any = None
    most: Any = None
    step: Any = None
    for limit in limits:
        match limit:
            case annotated_types.Ge(bound) | annotated_types.Gt(bound):
                least = bound if least is None else max(least, bound)
            case annotated_types.Le(bound) | annotated_types.Lt(bound):
                most = bound if most is None else min(most, bound)
            case annotated_types.MultipleOf(bound):
                step = bound
    return least, most, step


def _integers(limits: tuple[Any, ...]) -> st.SearchStrategy[int]:
    least, most, step = _bounds(limits)
    step = int(step or 1)
    low = None if least is None else -int(-least // step)  # rounded up
    high = None if most is None else int(most // step)
    first = low if low is not None else min(-10, high or 0)
    last = high if high is not None else max(10, first) + _MANY // step
    near = st.integers(first, min(last, first + 20))
    far = st.integers(first if low is not None else min(first, last - _MANY // step), last)
    return st.one_of(near, far).map(lambda number: number * step)


def _floats(limits: tuple[Any, ...]) -> st.SearchStrategy[float]:
    least, most, step = _bounds(limits)
    if step is not None:
        return _integers(
            tuple(
                limit
                for limit in (
                    None if least is None else annotated_types.Ge(least / step),
                    None if most is None else annotated_types.Le(most / step),
                )
                if limit is not None
            )
        ).map(lambda number: number * step)
    if least is None and most is None:
        # NaN occurs, too, but rarely enough to see the effects of other values.
        return st.one_of(st.floats(-10, 10), st.floats(-_MANY, _MANY), st.integers(-10, 10).map(float), st.floats())
    low = float(least if least is not None else most - _MANY)
    high = float(most if most is not None else least + _MANY)
    return st.one_of(st.floats(low, min(high, low + 10)), st.floats(low, high))


def _texts(kind: type, limits: tuple[Any, ...]) -> st.SearchStrategy[Any]:
    least, most = _lengths(limits, 12)
    if kind is not str:
        return st.binary(min_size=least, max_size=most).map(kind)
    fixed = [text for text in _TEXTS if least <= len(text) <= most or not limits]
    free = st.text(_LETTERS, min_size=least, max_size=most)
    words = st.text("abcxyz", min_size=max(least, 1), max_size=max(most, 1))
    return st.one_of(words, free, *([st.sampled_from(fixed)] if fixed else []))


def _lengths(limits: tuple[Any, ...], usual: int) -> tuple[int, int]:
    least, most = 0, None
    for limit in limits:
        match limit:
            case annotated_types.MinLen(length):
                least = max(least, length)
            case annotated_types.MaxLen(length):
                most = length if most is None else min(most, length)
    return least, max(least, usual) if most is None else max(least, min(most, least + usual))


@functools.lru_cache
def _anything(*, hashable: bool = False) -> st.SearchStrategy[Any]:
    """Values of many types, never None: in an output None is silence (rule T2)."""
    plain = st.one_of(st.integers(-10, 10), _floats(()), _texts(str, ()), st.booleans())
    if hashable:
        return st.one_of(plain, st.tuples(plain, plain))
    return st.one_of(
        plain,
        st.lists(plain, max_size=_FEW),
        st.dictionaries(_texts(str, ()), plain, max_size=_FEW),
        st.tuples(plain, plain),
        _arrays(ArrayFacts((np.uint8, np.float64), ((None, None), (None,))), None),
    )


# --- containers and records ---

_SEQUENCES: Final[dict[Any, Callable[[list[Any]], Any]]] = {
    list: list,
    collections.deque: collections.deque,
    abc.Sequence: list,
    abc.MutableSequence: list,
    abc.Collection: list,
    abc.Iterable: list,
    abc.Reversible: list,
    abc.Container: list,
    abc.Sized: list,
    abc.Iterator: iter,
}
_SETS: Final[dict[Any, Any]] = {set: set, frozenset: frozenset, abc.Set: frozenset, abc.MutableSet: set}
_OF_NUMBERS: Final = (
    annotated_types.Ge,
    annotated_types.Gt,
    annotated_types.Le,
    annotated_types.Lt,
    annotated_types.MultipleOf,
)
_MAPPINGS: Final[dict[Any, Any]] = {dict: dict, abc.Mapping: dict, abc.MutableMapping: dict}


def _container(
    origin: type, arguments: tuple[Any, ...], limits: tuple[Any, ...], alike: Alike | None
) -> st.SearchStrategy[Any] | None:
    least, most = _lengths(limits, _FEW)
    # Limits on numbers hold for every element; what a type asks of its parts stands in the type.
    limits = tuple(limit for limit in limits if isinstance(limit, _OF_NUMBERS))
    if origin is Span:
        part = _values(arguments[0] if arguments else float, limits, alike)
        return st.tuples(part, part).map(lambda ends: Span(*sorted(ends)))
    if origin is Colour:
        return st.builds(Colour, *[st.integers(0, 255)] * 3)
    if origin is tuple:
        if len(arguments) == 2 and arguments[1] is ...:
            return st.lists(_values(arguments[0], limits, alike), min_size=least, max_size=most).map(tuple)
        if not arguments:
            return st.lists(_anything(), min_size=least, max_size=most).map(tuple)
        return st.tuples(*(_values(part, limits, alike) for part in arguments))
    if origin in _SEQUENCES:
        part = _values(arguments[0], limits, alike) if arguments else _anything()
        return st.lists(part, min_size=least, max_size=most).map(_SEQUENCES[origin])
    if origin in _SETS:
        part = _hashable(arguments[0] if arguments else Any, limits, alike)
        return st.sets(part, min_size=least, max_size=most).map(_SETS[origin])
    if origin in _MAPPINGS:
        key, value = arguments or (str, Any)
        return st.dictionaries(_hashable(key, (), alike), _values(value, (), alike), min_size=least, max_size=most)
    return None


def _hashable(hint: Any, limits: tuple[Any, ...], alike: Alike | None) -> st.SearchStrategy[Any]:
    """Return values that can be keys."""
    return _anything(hashable=True) if bare_type(hint) in (Any, object) else _values(hint, limits, alike)


@functools.lru_cache(maxsize=256)
def _record(kind: Any, alike: Alike | None) -> st.SearchStrategy[Any]:
    """Return one strategy for each kind, so that those that hold themselves come to an end."""
    return st.deferred(lambda: _records(kind, alike))


def _records(kind: Any, alike: Alike | None) -> st.SearchStrategy[Any]:
    hints = typing.get_type_hints(kind, include_extras=True)
    names = names_of(kind, given=True) or list(hints)

    def made(fields: dict[str, Any]) -> Any:
        try:
            return kind(**fields)
        except ValueError:  # what the record itself refuses
            reject()

    return st.fixed_dictionaries({name: _values(hints.get(name, Any), (), alike) for name in names}).map(made)


# --- arrays ---


def _arrays(facts: ArrayFacts, alike: Alike | None) -> st.SearchStrategy[Any]:
    """Arrays of an allowed dtype and shape; most of them like the others of the firing."""

    @st.composite
    def array(draw: st.DrawFn) -> Any:
        like = alike is not None and draw(st.integers(0, 9)) < 8
        shapes = facts.shapes or ((None,), (None, None), (None, None, 3))
        if like and alike is not None:
            dtype = alike.dtype if alike.dtype in facts.dtypes else facts.dtypes[0]
            shape = _sized(_chosen(shapes, alike.channels), (alike.rows, alike.columns), alike.count)
        else:
            dtype = draw(st.sampled_from(facts.dtypes))
            sides, length = draw(st.sampled_from(_SIDES)), draw(st.sampled_from(_LENGTHS))
            shape = _sized(draw(st.sampled_from(shapes)), sides, length)
        filling = draw(st.sampled_from(_FILLINGS))
        return _filled(filling, np.dtype(dtype), shape, draw(st.integers(0, 999)))

    return array()


def _chosen(shapes: tuple[tuple[int | None, ...], ...], channels: int) -> tuple[int | None, ...]:
    """Return the shape with that number of channels, otherwise the first."""
    wanted = (None, None) if channels == 1 else (None, None, channels)
    return wanted if wanted in shapes else shapes[0]


def _sized(shape: tuple[int | None, ...], sides: tuple[int, int], length: int) -> tuple[int, ...]:
    """Return the open axes a length: rows and columns, if there are two."""
    open_axes = [index for index, axis in enumerate(shape) if axis is None]
    lengths = dict(zip(open_axes, sides if len(open_axes) > 1 else (length,), strict=False))
    return tuple(lengths.get(index, 2) if axis is None else axis for index, axis in enumerate(shape))


_FILLINGS: Final = ("noise", "blob", "ramp", "zeros", "ones", "extremes")


def _filled(filling: str, dtype: np.dtype[Any], shape: tuple[int, ...], seed: int) -> Any:
    """Fill an array: noise, a bright blob on dark ground, a ramp ...; real numbers are mostly 0 to 1, as in images."""
    rng = np.random.default_rng(seed)
    values: Any
    top = 1.0 if dtype.kind not in "iu" else float(min(np.iinfo(dtype).max, 255))
    match filling:
        case "noise":
            values = rng.uniform(0, top, shape)
        case "blob":
            values = rng.uniform(0, top / 8, shape)
            values[tuple(slice(length // 4, length // 4 + max(1, length // 2)) for length in shape[:2])] = top
        case "ramp":
            size = int(np.prod(shape))
            values = (np.arange(size) * (top / max(1, size - 1))).reshape(shape)
        case "extremes" if dtype.kind in "iu":
            info = np.iinfo(dtype)
            return rng.choice(np.array([info.min, info.max, 0, 1], dtype=dtype), shape)
        case "extremes" if dtype.kind in "fc":
            values = rng.choice(np.array([np.nan, np.inf, -np.inf, 0.0, -1.0, 6e4]), shape)
        case "ones":
            values = np.ones(shape)
        case _:
            values = np.zeros(shape)
    return values.astype(dtype)

"""Converts values of a type to data that msgspec writes, and back; compiled once per type.

The idea: each type is *carried* by a simpler one, down to types that msgspec writes itself. A dataclass is carried by
the tuple of its fields, an enum by a number, a fraction by two integers, an array by its index among the frame's
arrays. Numbers and strings are leaves, which cost only a check of their class. Msgspec reads everything back by the
declared type, so a value arrives with that type or is refused. The data names no classes: both ends have the type.

A value arrives with the class that it was sent with, or it is not sent; its class is never guessed. Where a type allows
several classes (a union, a Sequence), the number of the actual one is sent, too. Depends on `carriers`,
`standard`, `records`, `arrays` and types.
"""

from __future__ import annotations

import collections
import dataclasses
import decimal
import enum
import fractions
import functools
import json
import numbers
import operator
import os
import pathlib
import types
import typing
from collections import abc
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Final, Literal

import msgspec
import numpy as np

from hfg.encoding.arrays import array_problem, unsafe_content
from hfg.encoding.carriers import (
    Arrays,
    Codec,
    Later,
    Unfit,
    each,
    each_pair,
    generic,
    leaf,
    lift_parts,
    lower_parts,
    optional,
    tagged,
    unchanged,
)
from hfg.encoding.records import filled, giver, maker, names_of, required_keys
from hfg.encoding.standard import CARRIED, NATIVE, Carried
from hfg.errors import EncodingError
from hfg.types import accepts, array_facts, bare_type, describe, describe_value

_NONE: Final = type(None)
_LONGEST_NUMBER: Final = 2**16  # bytes of an integer beyond 64 bits: arithmetic on longer ones takes too long


class _CannotCross(Exception):
    """A type does not describe its values well enough, or allows values that are not data."""

    def __init__(self, hint: Any, why: str) -> None:
        super().__init__()
        self.hint = hint
        self.why = why
        self.where: str | None = None

    def sentence(self, whole: Any) -> str:
        """Return the message about the port's declared type."""
        part = describe(self.hint)
        where = f"{describe(whole)} cannot be sent to another process"
        if self.where is not None:
            return f"{where}: its part {self.where} is {part}, which {self.why}"
        return f"{where}: {part if part != describe(whole) else 'it'} {self.why}"


def codec_for(hint: Any, *, wide: bool = False) -> Codec:
    """Return the codec of a type.

    Args:
      hint: the declared type.
      wide: integers have any size, which costs more; both ends must use the same setting.

    Raises:
      EncodingError: values of this type cannot be sent to another process; the message names the part.
    """
    try:
        return _codec_for(hint, wide)
    except TypeError:  # a hint with an unhashable part
        return _compiled(hint, wide)


@functools.lru_cache(maxsize=1024)
def _codec_for(hint: Any, wide: bool) -> Codec:
    return _compiled(hint, wide)


def _compiled(hint: Any, wide: bool) -> Codec:
    try:
        return _Compiler(wide).compile(hint)
    except _CannotCross as problem:
        raise EncodingError(problem.sentence(hint)) from None
    except RecursionError:
        raise EncodingError(f"{describe(hint)} cannot be sent to another process: it is nested too deep") from None


def wire_problem(hint: Any) -> str | None:
    """Return which part of a type cannot be sent to another process and why, or None if all its values can.

    Examples:
      >>> print(wire_problem(dict[str, list[int | None]]))
      None
      >>> print(wire_problem(list[Any]))
      list[Any] cannot be sent to another process: Any does not describe its values; name their type
    """
    try:
        codec_for(hint)
    except EncodingError as error:
        return str(error)
    return None


_CODE: Final = "is code, and code cannot be sent; send data that describes what to do"
_NO_DATA: Final = (
    "is not data that hfg can send; use numbers, strings, arrays, enums, dataclasses, structs, named tuples, "
    "and containers of them"
)
_SAYS_NOTHING: Final = "does not describe its values; name their type"

_SEQUENCES: Final = (abc.Sequence, abc.MutableSequence, abc.Collection, abc.Iterable, abc.Reversible, abc.Container)
_SETS: Final = (abc.Set, abc.MutableSet)
_MAPPINGS: Final = (abc.Mapping, abc.MutableMapping)
_PAIRS: Final[dict[type, Callable[[Any], Any]]] = {
    dict: dict,
    collections.OrderedDict: collections.OrderedDict,
    collections.Counter: lambda pairs: collections.Counter(dict(pairs)),
}
_NUMBERS: Final[dict[Any, Any]] = {
    numbers.Integral: int,
    numbers.Rational: int | fractions.Fraction,
    numbers.Real: float | fractions.Fraction,
    numbers.Complex: complex | fractions.Fraction,
    numbers.Number: complex | fractions.Fraction | decimal.Decimal,
    typing.SupportsFloat: float | fractions.Fraction | decimal.Decimal,
    typing.SupportsInt: float | fractions.Fraction | decimal.Decimal,
}


class _Compiler:
    """Makes the codec of one type; has a method for each family of types."""

    def __init__(self, wide: bool) -> None:
        self._wide = wide
        self._under_way: dict[Any, Later] = {}

    def compile(self, hint: Any) -> Codec:
        bare = bare_type(hint)
        if hasattr(bare, "__supertype__"):
            return self.compile(bare.__supertype__)
        if array_facts(hint) is not None:
            return self._array(hint)
        origin, arguments = typing.get_origin(bare), typing.get_args(bare)
        if origin in (typing.Union, types.UnionType):
            return self._union(bare, [self.compile(member) for member in arguments])
        if origin is Literal:
            return self._literal(bare, arguments)
        if bare in (Any, object, abc.Hashable):
            raise _CannotCross(hint, _SAYS_NOTHING)
        if bare in _NUMBERS:
            return self.compile(_NUMBERS[bare])
        cls = origin or bare
        if cls is abc.Callable or cls in (type, types.FunctionType, types.BuiltinFunctionType, types.MethodType):
            raise _CannotCross(bare, _CODE)
        if not isinstance(cls, type):
            raise _CannotCross(bare, _NO_DATA)
        return self._class(bare, cls, arguments)

    def _class(self, hint: Any, cls: type, arguments: tuple[Any, ...]) -> Codec:
        scalar = self._scalar(hint, cls)
        if scalar is not None:
            return scalar
        container = self._container(hint, cls, arguments)
        if container is not None:
            return container
        fields = _fields_of(cls, arguments)
        if fields is None:
            raise _CannotCross(hint, _NO_DATA)
        later = self._under_way.get(hint)
        if later is not None:
            return later.codec
        self._under_way[hint] = later = Later(hint, cls.__name__)
        try:
            made = self._keyed(hint, fields) if typing.is_typeddict(cls) else self._record(hint, cls, fields)
        finally:
            del self._under_way[hint]
        later.made = made
        return made

    # --- scalars ---

    def _scalar(self, hint: Any, cls: type) -> Codec | None:
        if cls in (int, float):
            return self._number(cls)
        if cls is _NONE:
            return leaf(None, "None", None, _NONE)
        if cls in NATIVE:
            return leaf(cls, cls.__name__, cls, cls)
        if cls is complex:
            parts = Carried(tuple[float, float], _parts_of_complex, lambda data: complex(*data))
            return self._union(complex, [self._carried(complex, parts), self._number(float)])
        if cls in CARRIED:
            return self._carried(cls, CARRIED[cls])
        if issubclass(cls, enum.Enum):
            return self._enum(cls)
        if cls is os.PathLike or issubclass(cls, pathlib.PurePath):
            return self._path(hint, cls)
        if issubclass(cls, np.generic):
            return self._numpy_scalar(cls)
        return None

    def _number(self, cls: type) -> Codec:
        """Return the codec of integers, which any number type accepts (PEP 484); beyond 64 bits they are bytes."""
        exact = frozenset({int, bool} if cls is int else {float, int, bool})
        if not self._wide:
            return leaf(cls, cls.__name__, int | bool if cls is int else float | int | bool, *exact)

        def lower(value: Any, arrays: Arrays) -> Any:
            if isinstance(value, np.generic):
                value = value.item()
            if type(value) is int:
                return value.to_bytes(value.bit_length() // 8 + 1, "little", signed=True)
            if type(value) not in exact:
                raise Unfit(value, cls)
            return value

        def lift(data: Any, arrays: Arrays) -> Any:
            if type(data) is not bytes:
                return data
            if len(data) > _LONGEST_NUMBER:
                raise ValueError(f"an integer has {len(data)} bytes, which is too long")
            return int.from_bytes(data, "little", signed=True)

        wire: Any = bytes | bool if cls is int else bytes | bool | float
        return Codec(cls, [cls.__name__], wire, frozenset(), lower, lift)

    def _carried(self, cls: type, how: Carried, name: str | None = None) -> Codec:
        inner = self.compile(how.by)
        give, make, lower_inner, lift_inner = how.lower, how.lift, inner.lower, inner.lift

        def lower(value: Any, arrays: Arrays) -> Any:
            if type(value) is not cls:
                raise Unfit(value, cls)
            try:
                return lower_inner(give(value), arrays)
            except (ValueError, TypeError, OverflowError) as error:
                raise Unfit(value, cls, str(error)) from None

        def lift(data: Any, arrays: Arrays) -> Any:
            return make(data if lift_inner is None else lift_inner(data, arrays))

        return Codec(cls, [name or cls.__name__], inner.wire, frozenset(), lower, lift)

    def _enum(self, cls: Any) -> Codec:
        if issubclass(cls, enum.Flag):
            made = self._carried(cls, Carried(int, lambda value: value.value, cls))
            return made._replace(form=["flag", cls.__name__, [[one.name, one.value] for one in cls]])
        members = list(cls)
        return self._chosen(cls, members, ["enum", cls.__name__, [one.name for one in members]], {cls})

    def _literal(self, hint: Any, values: tuple[Any, ...]) -> Codec:
        ordered = sorted(values, key=lambda one: (type(one).__name__, repr(one)))  # two ways to write it are equal
        form = ["literal", [[type(one).__name__, repr(one)] for one in ordered]]
        return self._chosen(hint, ordered, form, {type(one) for one in values})

    def _chosen(self, hint: Any, members: list[Any], form: Any, kinds: set[Any]) -> Codec:
        """Return the codec of one of a few values, which is carried by its number."""
        if not members:
            raise _CannotCross(hint, "has no values")
        index = {(type(one), one.name if isinstance(one, enum.Enum) else one): i for i, one in enumerate(members)}

        def lower(value: Any, arrays: Arrays) -> Any:
            kind = type(value)
            if kind not in kinds:
                raise Unfit(value, hint)
            number = index.get((kind, value.name if isinstance(value, enum.Enum) else value))
            if number is None:
                raise Unfit(value, hint)
            return number

        wire = Annotated[int, msgspec.Meta(ge=0, lt=len(members))]
        return Codec(hint, form, wire, frozenset(), lower, lambda data, arrays: members[data])

    def _path(self, hint: Any, cls: Any) -> Codec:
        text = Carried(str, str, cls)
        concrete = [one for one in _PATHS if issubclass(one, cls)] if cls is not os.PathLike else list(_PATHS)
        if cls is pathlib.Path:  # a path of this system, whichever that is
            return self._carried(type(pathlib.Path()), Carried(str, str, pathlib.Path), "Path")
        if cls in (pathlib.PurePath, os.PathLike):
            return self._union(hint, [self.compile(one) for one in concrete])
        return self._carried(cls, text)

    def _numpy_scalar(self, cls: Any) -> Codec:
        try:
            dtype = np.dtype(cls).newbyteorder("<")
            problem = array_problem(dtype) or (None if dtype.type is cls and dtype.itemsize else "is of several kinds")
        except TypeError:
            problem = "is of several kinds"
        if problem is not None:
            raise _CannotCross(cls, "has no fixed size; name a type like numpy.float64")

        def lower(value: Any, arrays: Arrays) -> Any:
            if type(value) is not cls:
                raise Unfit(value, cls)
            return np.asarray(value).astype(dtype).tobytes()

        def lift(data: Any, arrays: Arrays) -> Any:
            made = np.frombuffer(data, dtype)
            if made.size != 1 or unsafe_content(made) is not None:
                raise ValueError(f"these bytes are not {cls.__name__}")
            return cls(made.astype(dtype.newbyteorder("="))[0])

        return Codec(cls, [cls.__name__], bytes, frozenset(), lower, lift)

    def _array(self, hint: Any) -> Codec:
        facts = array_facts(hint)
        assert facts is not None

        def lower(value: Any, arrays: Arrays) -> Any:
            if type(value) is not np.ndarray:
                raise Unfit(value, hint, "send numpy.asarray(...) of it" if isinstance(value, np.ndarray) else "")
            if not accepts(value, hint):
                raise Unfit(value, hint)
            why = array_problem(value.dtype) or unsafe_content(value)
            if why is not None:
                raise Unfit(value, hint, f"{why} that another process could read")
            arrays.append(value)
            return len(arrays) - 1

        def lift(data: Any, arrays: Arrays) -> Any:
            found = arrays[data]
            if not accepts(found, hint):
                raise ValueError(f"expected {describe(hint)}, found {describe_value(found)}")
            return found

        layouts = [repr(one) for one in getattr(hint, "__metadata__", ()) if hasattr(one, "shapes")]
        form = ["array", sorted({one.__name__ for one in facts.dtypes}), layouts]
        return Codec(hint, form, Annotated[int, msgspec.Meta(ge=0)], frozenset(), lower, lift)

    # --- several types in one ---

    def _union(self, hint: Any, members: list[Codec]) -> Codec:
        """Return the codec of a union. It sends the number of the member, unless msgspec can tell the members apart.

        `int | str` and `str | int` are equal and must have the same codec on both ends, so the members are sorted by
        form.
        """
        by_form = {json.dumps(member.form): member for member in members}
        members = [by_form[form] for form in sorted(by_form)]
        if len(members) == 1:
            return members[0]
        form = ["union", [member.form for member in members]]
        nothing = [member for member in members if member.wire is None]
        others = [member for member in members if member.wire is not None]
        exact = frozenset[type]().union(*(member.exact for member in members))
        if all(member.exact and member.exact <= _TOLD_APART for member in others) and not {str, bytes} <= exact:
            wire = functools.reduce(operator.or_, (member.wire for member in others), None) if nothing else None
            wire = wire or functools.reduce(operator.or_, (member.wire for member in others))
            return leaf(hint, form, wire, *exact)
        if len(others) == 1:
            return optional(hint, form, others[0])
        return tagged(hint, form, others, bool(nothing))

    def _container(self, hint: Any, cls: type, arguments: tuple[Any, ...]) -> Codec | None:
        if cls is tuple:
            return self._tuple(hint, arguments)
        if cls in (list, set, frozenset, collections.deque):
            return self._items(hint, cls, self._part(hint, arguments, 0))
        if cls in _PAIRS:
            key = self._part(hint, arguments, 0)
            item = self._number(int) if cls is collections.Counter else self._part(hint, arguments, 1)
            return self._pairs(hint, cls, key, item)
        if cls in _SEQUENCES:
            return self._sequence(hint, cls, self._part(hint, arguments, 0))
        if cls in _SETS:
            part = self._part(hint, arguments, 0)
            return self._union(hint, [self._items(generic(one, part.hint), one, part) for one in (set, frozenset)])
        if cls in _MAPPINGS:
            key, item = self._part(hint, arguments, 0), self._part(hint, arguments, 1)
            return self._pairs(hint, dict, key, item)
        return None

    def _part(self, hint: Any, arguments: tuple[Any, ...], number: int) -> Codec:
        if len(arguments) <= number:
            raise _CannotCross(hint, f"does not declare its items; write {describe(hint)}[...] with a type")
        return self.compile(arguments[number])

    def _sequence(self, hint: Any, cls: type, part: Codec) -> Codec:
        item = part.hint
        members = [
            self._items(generic(list, item), list, part),
            self._items(generic(tuple, item, ...), tuple, part),
            self._items(generic(collections.deque, item), collections.deque, part),
        ]
        if cls not in (abc.Sequence, abc.MutableSequence, abc.Reversible):
            members += [self._items(generic(one, item), one, part) for one in (set, frozenset)]
        if bare_type(item) is str:
            members.append(self.compile(str))
        if bare_type(item) is int:
            members += [self.compile(one) for one in (bytes, bytearray, range)]
        return self._union(hint, members)

    def _items(self, hint: Any, cls: Any, part: Codec) -> Codec:
        exact, lower_part, lift_part = part.exact, part.lower, part.lift

        def lower(value: Any, arrays: Arrays) -> Any:
            if type(value) is not cls:
                raise Unfit(value, hint)
            if exact and exact.issuperset(map(type, value)):
                return value
            return each(value, lower_part, arrays)

        def lower_deque(value: Any, arrays: Arrays) -> Any:
            if type(value) is not cls:
                raise Unfit(value, hint)
            return value.maxlen, each(value, lower_part, arrays)

        def lift(data: Any, arrays: Arrays) -> Any:
            return cls(data if lift_part is None else [lift_part(one, arrays) for one in data])

        def lift_deque(data: Any, arrays: Arrays) -> Any:
            longest, items = data
            if longest is not None and not len(items) <= longest <= 2**31:
                raise ValueError(f"a deque of at most {longest} items has {len(items)}")
            return cls(items if lift_part is None else [lift_part(one, arrays) for one in items], longest)

        form = [cls.__name__, part.form]
        if cls is collections.deque:
            wire = generic(tuple, int | None, generic(list, part.wire))
            return Codec(hint, form, wire, frozenset(), lower_deque, lift_deque)
        if exact:  # msgspec makes the container itself
            wire = generic(tuple, part.wire, ...) if cls is tuple else generic(cls, part.wire)
            return Codec(hint, form, wire, frozenset(), lower, None)
        return Codec(hint, form, generic(list, part.wire), frozenset(), lower, lift)

    def _tuple(self, hint: Any, arguments: tuple[Any, ...]) -> Codec:
        if len(arguments) == 2 and arguments[1] is ...:
            return self._items(hint, tuple, self.compile(arguments[0]))
        if not arguments and hint in (tuple, typing.Tuple):  # noqa: UP006
            raise _CannotCross(hint, "does not declare its items; write tuple[...] with types")
        parts = [self.compile(one) for one in arguments if one != ()]

        def lower(value: Any, arrays: Arrays) -> Any:
            if type(value) is not tuple or len(value) != len(parts):
                raise Unfit(value, hint)
            return lowered(value, arrays)

        lowered = lower_parts(parts, [f"[{number}]" for number in range(len(parts))])
        lifted = lift_parts(parts)
        wire = generic(tuple, *[part.wire for part in parts])
        lift = None if lifted is None else lambda data, arrays: tuple(lifted(data, arrays))
        return Codec(hint, ["tuple", [part.form for part in parts]], wire, frozenset(), lower, lift)

    def _pairs(self, hint: Any, cls: type, key: Codec, item: Codec) -> Codec:
        make, form = _PAIRS[cls], [cls.__name__, key.form, item.form]
        if cls is dict and key.exact and key.exact <= _KEYS and item.exact:

            def lower_plain(value: Any, arrays: Arrays) -> Any:
                if type(value) is not dict:
                    raise Unfit(value, hint)
                if key.exact.issuperset(map(type, value)) and item.exact.issuperset(map(type, value.values())):
                    return value
                return dict(each_pair(value, key.lower, item.lower, arrays))

            return Codec(hint, form, generic(dict, key.wire, item.wire), frozenset(), lower_plain, None)

        def lower(value: Any, arrays: Arrays) -> Any:
            if type(value) is not cls:
                raise Unfit(value, hint)
            return each_pair(value, key.lower, item.lower, arrays)

        lift_key, lift_item = key.lift or unchanged, item.lift or unchanged

        def lift(data: Any, arrays: Arrays) -> Any:
            return make([(lift_key(one, arrays), lift_item(other, arrays)) for one, other in data])

        wire = generic(list, generic(tuple, key.wire, item.wire))
        return Codec(hint, form, wire, frozenset(), lower, lift)

    # --- classes with fields ---

    def _field(self, cls: type, name: str, hint: Any) -> Codec:
        try:
            return self.compile(hint)
        except _CannotCross as problem:
            problem.where = problem.where or f"{cls.__name__}.{name}"
            raise

    def _record(self, hint: Any, cls: Any, fields: dict[str, Any]) -> Codec:
        parts = [self._field(cls, name, one) for name, one in fields.items()]
        give, make = giver(cls, tuple(fields)), maker(cls, tuple(fields))
        lowered = lower_parts(parts, [f".{name}" for name in fields])
        lifted = lift_parts(parts)

        def lower(value: Any, arrays: Arrays) -> Any:
            if type(value) is not cls:
                raise Unfit(value, hint)
            try:
                items = give(value)
            except AttributeError as error:
                raise Unfit(value, hint, str(error)) from None
            return lowered(items, arrays)

        def lift(data: Any, arrays: Arrays) -> Any:
            if lifted is not None:
                data = lifted(data, arrays)
            try:
                return make(data)
            except Exception as error:  # classes of users check their fields and may raise anything
                raise ValueError(f"it is not {cls.__name__} ({type(error).__name__}: {error})") from error

        form = ["class", cls.__name__, [[name, part.form] for name, part in zip(fields, parts, strict=True)]]
        wire = generic(tuple, *[part.wire for part in parts])
        return Codec(hint, form, wire, frozenset(), lower, lift)

    def _keyed(self, hint: Any, fields: dict[str, Any]) -> Codec:
        """Return the codec of a dict with known keys; each is a list of one value, empty if the key is missing."""
        parts = {name: self._field(hint, name, one) for name, one in fields.items()}
        required = required_keys(hint)

        def lower(value: Any, arrays: Arrays) -> Any:
            if type(value) is not dict or not required <= value.keys() <= parts.keys():
                raise Unfit(value, hint)
            return [
                each([value[name]], part.lower, arrays, f'["{name}"]') if name in value else ()
                for name, part in parts.items()
            ]

        def lift(data: Any, arrays: Arrays) -> Any:
            made = {}
            for (name, part), found in zip(parts.items(), data, strict=True):
                if len(found) > 1 or (not found and name in required):
                    raise ValueError(f'the key "{name}" occurs {len(found)} times')
                for one in found:
                    made[name] = one if part.lift is None else part.lift(one, arrays)
            return made

        form = ["dict", hint.__name__, [[name, part.form, name in required] for name, part in parts.items()]]
        wire = generic(tuple, *[generic(list, part.wire) for part in parts.values()])
        return Codec(hint, form, wire, frozenset(), lower, lift)


_PATHS: Final = (type(pathlib.Path()), pathlib.PurePosixPath, pathlib.PureWindowsPath)
_TOLD_APART: Final = frozenset({_NONE, bool, int, float, str, bytes})
"""Classes that msgspec can tell apart from the data; it cannot tell strings from bytes."""
_KEYS: Final = frozenset({bool, int, str})
"""Classes of keys that msgspec writes directly."""


def _parts_of_complex(value: complex) -> tuple[float, float]:
    return value.real, value.imag


def _fields_of(cls: Any, arguments: tuple[Any, ...]) -> dict[str, Any] | None:
    """Return the fields of a class with their types; None if it has no fields."""
    names: Sequence[str] | None = names_of(cls)
    if names is None and not typing.is_typeddict(cls):
        return None
    try:
        hints = typing.get_type_hints(cls, include_extras=True)
    except Exception as error:  # names that exist only for type checkers
        raise _CannotCross(
            cls, f"has fields whose types cannot be resolved ({error}); import them at module level"
        ) from None
    if dataclasses.is_dataclass(cls) and any(isinstance(one, dataclasses.InitVar) for one in hints.values()):
        raise _CannotCross(cls, "takes arguments that it does not keep (InitVar), so it cannot be rebuilt")
    known = dict(zip(getattr(cls, "__parameters__", ()), arguments, strict=False))
    return {name: filled(hints.get(name, Any), known) for name in (list(hints) if names is None else names)}

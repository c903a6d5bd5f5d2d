"""What an option is: declared once, as a field of a struct, with all that commands, files, drawings and docs say of it.

    capacity: Annotated[int, Option("How many untaken signals it holds.", least=1, only="events")] = 16

`options` holds the declarations. Knows neither nodes nor edges.
"""

from __future__ import annotations

import functools
import types
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Generic, Literal, TypeAlias, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import msgspec

from hfg.errors import HfgError
from hfg.graph.structure.naming import suggest

Border: TypeAlias = Literal["outermost", "every", "sum", "least", "along", "target"]
"""What holds of an edge that leads through subgraphs, and so is made of several (rule G1).

What the outermost says; that which every one of them says; the sum; the least that one says; all, from source to
target; or all, from target to source, given to the one at the target when a border is drawn.
"""


@dataclass(frozen=True)
class Option:
    """What is declared about an option besides its name, type and default.

    Attributes:
      says: its meaning, a whole sentence.
      least, most, above: limits of a number.
      expects: what a value must be in words, where type and limits do not tell enough.
      fits: what else a value must be.
      remedy: what an error about the value adds.
      only: who may have it: edges from "events" or of "data"; "any" node, or a "subgraph"; by default all edges, and
        nodes that fire.
      border: for an edge, see `Border`.
      badge: what a drawing shows of it, with the value in place of {}, or a function of the value; "" is nothing.
      rank: of the badge among others, the smallest first.
      usual: what its default is, where that depends on others.
      flag: for a run, its flag on the command line; "" if it has none.
      everywhere: for a run, whether each of its processes has the option, too.
    """

    says: str
    least: float | None = None
    most: float | None = None
    above: float | None = None
    expects: str = ""
    fits: Callable[[Any], bool] | None = None
    remedy: str = ""
    only: Literal["", "events", "data", "any", "subgraph"] = ""
    border: Border = "outermost"
    badge: str | Callable[[Any], str] = ""
    rank: int = 0
    usual: str = ""
    flag: str = ""
    everywhere: bool = False


@dataclass(frozen=True)
class Declared:
    """An option with its name, type and default."""

    name: str
    type: Any
    default: Any
    option: Option

    @property
    def unit(self) -> str:
        """The unit of a number, which the name ends with."""
        return next((unit for ending, unit in _UNITS.items() if self.name.endswith(ending)), "")

    def badge(self, value: object) -> str:
        """Return what a drawing shows of it."""
        badge = self.option.badge
        return badge.format(value) if isinstance(badge, str) else badge(value)

    @property
    def expects(self) -> str:
        """The values that are allowed, in words."""
        option = self.option
        if option.expects:
            return option.expects
        kinds = [kind for kind in _kinds(self.type) if kind is not type(None)]
        if get_origin(kinds[0]) is Literal:
            return "one of " + ", ".join(f'"{choice}"' for choice in get_args(kinds[0]))
        words = _WORDS.get(kinds[0], "a text")
        if option.above is not None:
            words += f" above {option.above:g}"
        elif option.least is not None:
            words = "seconds" if self.unit == "s" else words
            words += f" from {option.least:g} " + ("on" if option.most is None else f"to {option.most:g}")
        return words + (", or None for no limit" if type(None) in _kinds(self.type) and kinds[0] is not str else "")

    def fits(self, value: object) -> bool:
        """Return whether it can have a value."""
        if type(value) is type(self.default) and value == self.default:
            return True
        return any(self._is(kind, value) for kind in _kinds(self.type)) and (
            self.option.fits is None or self.option.fits(value)
        )

    def _is(self, kind: object, value: Any) -> bool:  # noqa: ANN401 - a value of a user
        if get_origin(kind) is Literal:
            return value in get_args(kind)
        if kind in (int, float):
            is_number = type(value) is int or (kind is float and isinstance(value, float))
            return is_number and value == value and self._is_within(value)  # NaN is not a number
        return kind is Any or (isinstance(kind, type) and isinstance(value, kind) and value != "")

    def _is_within(self, value: float) -> bool:
        option = self.option
        return (
            (option.least is None or value >= option.least)
            and (option.most is None or value <= option.most)
            and (option.above is None or value > option.above)
        )


_UNITS: Final = {"_s": "s", "_hz": "Hz"}
_WORDS: Final[Mapping[object, str]] = {bool: "True or False", int: "a whole number", float: "a number"}


G = TypeVar("G")


class Fields(msgspec.Struct, Generic[G]):
    """Base of structs whose fields are options; `G` is the TypedDict of what can be given in a call."""

    def said(self) -> G:
        """Return the options whose values differ from their defaults, by name."""
        found = {
            name: value
            for name, one in declared(type(self)).items()
            if (value := getattr(self, name)) is not one.default and value != one.default
        }
        return cast(G, found)

    def first_said(self, only: str) -> str | None:
        """Return the first option that has another value than its default, of those that only some may have.

        It is returned as written in a call.
        """
        said, names = cast(Mapping[str, object], self.said()), having(type(self), only)
        return next((written(name, value) for name, value in said.items() if name in names), None)


K = TypeVar("K", bound=Fields[Any])
F = TypeVar("F", bound=Callable[..., Any])


@functools.cache
def declared(kind: type[Fields[Any]]) -> Mapping[str, Declared]:
    """Return the options that a struct declares or inherits, by name, in order."""
    found: dict[str, Declared] = {}
    bases = (base for base in kind.__bases__ if issubclass(base, Fields) and base is not Fields)
    inherited = {name: one.option for base in bases for name, one in declared(base).items()}
    hints = get_type_hints(kind, include_extras=True)
    for field in msgspec.structs.fields(kind):
        hint = hints[field.name]
        own = next((one for one in getattr(hint, "__metadata__", ()) if isinstance(one, Option)), None)
        option = own or inherited.get(field.name)
        if option is not None:
            found[field.name] = Declared(field.name, hint.__origin__ if own else hint, field.default, option)
    return found


@functools.cache
def having(kind: type[Fields[Any]], only: str) -> tuple[str, ...]:
    """Return the names of the options that only some may have, see `Option.only`."""
    return tuple(name for name, one in declared(kind).items() if one.option.only == only)


def unknown(kind: type[Fields[Any]], names: Iterable[str], call: str) -> str | None:
    """Return which of some names is not that of an option of a call; None if all are."""
    known = declared(kind)
    name = next((one for one in names if one not in known), None)
    return None if name is None else f'there is no option "{name}", options are those of {call}; {suggest(name, known)}'


def refuse_values(kind: type[Fields[Any]], where: str, said: Mapping[str, Any], error: type[HfgError]) -> None:
    """Refuse values that options cannot have.

    Raises:
      HfgError: `error`, with a message that begins with `where`, if that is not empty.
    """
    for name, value in said.items():
        one = declared(kind)[name]
        if not isinstance(one.default, tuple) and not one.fits(value):
            remedy = f"; {one.option.remedy}" if one.option.remedy else ""
            at = f"{where}: " if where else ""
            raise error(f"{at}{name} must be {one.expects}, got {value!r:.80}{remedy}")


def add_unset(kind: type[Fields[Any]], body: dict[str, Any], *, none: bool = False) -> None:
    """Add the options to the body of a struct of which some may be given; with `none`, None is given as nothing too."""
    for one in declared(kind).values():
        body["__annotations__"][one.name] = Union[(one.type, msgspec.UnsetType, *([None] if none else []))]
        body[one.name] = msgspec.UNSET


def given(kind: type[Fields[G]], struct: msgspec.Struct) -> G:
    """Return the options that such a struct gives, by name."""
    return cast(G, {name: value for name in declared(kind) if (value := getattr(struct, name)) is not msgspec.UNSET})


def documented(kind: type[K]) -> type[K]:
    """Add what the options mean to the docstring of a struct."""
    lines = [f"  {one.name}: {one.option.says}" for one in declared(kind).values()]
    kind.__doc__ = "\n".join([(kind.__doc__ or "").rstrip(), "", "Attributes:", *lines])
    return kind


def explaining(kind: type[Fields[Any]]) -> Callable[[F], F]:
    """Make a decorator that replaces `**options` in the docstring of a function by what the options mean."""

    def explain(function: F) -> F:
        lines = (function.__doc__ or "").splitlines()
        number = next((number for number, line in enumerate(lines) if line.lstrip().startswith("**options:")), None)
        if number is not None:
            indent = lines[number][: -len(lines[number].lstrip())]
            end = number + 1
            while lines[end].startswith(f"{indent} "):
                end += 1
            lines[number:end] = [f"{indent}{one.name}: {one.option.says}" for one in declared(kind).values()]
            function.__doc__ = "\n".join(lines)
        return function

    return explain


def written(name: str, value: object) -> str:
    """Return how an option is written in a call."""
    return (
        f"{name}=[...]"
        if isinstance(value, tuple)
        else f'{name}="{value}"'
        if isinstance(value, str)
        else f"{name}={value!r}"
    )


def _kinds(hint: object) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)

"""Makes node types of plain descriptions: how the generated families come to their functions.

A generated type is a function like any other for `hfg.nodetypes.functions`: it has a signature, annotations and a
docstring, and a module and a name under which it is found again.
"""

from __future__ import annotations

import inspect
import keyword
import re
import textwrap
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

from annotated_types import Unit

from hfg.nodetypes.declaration import RESERVED
from hfg.nodetypes.functions import NodeFunction, make_type
from hfg.ports.specs import REQUIRED


@dataclass(frozen=True, slots=True)
class Port:
    """An input or an output; `optional` inputs get None if they are not connected."""

    name: str
    hint: Any
    about: str
    optional: bool = False


@dataclass(frozen=True, slots=True)
class Setting:
    """A parameter; limits stand in its hint."""

    name: str
    hint: Any
    default: Any
    about: str
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class Recipe:
    """All that a generated node type is made of.

    Attributes:
      about: what it does, in one line.
      more: further paragraphs.
      outputs: one called "out" is the result itself; several take the result apart.
      raises: what a firing may raise, and when.
      call: takes the inputs in order and the parameters by name.
    """

    name: str
    about: str
    more: tuple[str, ...]
    inputs: tuple[Port, ...]
    settings: tuple[Setting, ...]
    outputs: tuple[Port, ...]
    raises: Mapping[str, str]
    call: Callable[..., Any]


def make(recipe: Recipe, module: str, qualname: str, doc: str | None = None) -> NodeFunction[..., Any]:
    """Make the node type; it is found again as `module:qualname`."""

    def function(*values: Any, **parameters: Any) -> Any:
        return recipe.call(*values, **parameters)

    single = [port.name for port in recipe.outputs] == ["out"]
    hints = {port.name: port.hint | None if port.optional else port.hint for port in recipe.inputs}
    hints |= {setting.name: _with_unit(setting) for setting in recipe.settings}
    hints["return"] = recipe.outputs[0].hint if single else None if not recipe.outputs else Any
    arguments = [
        inspect.Parameter(
            port.name,
            inspect.Parameter.POSITIONAL_OR_KEYWORD,
            default=None if port.optional else inspect.Parameter.empty,
        )
        for port in recipe.inputs
    ]
    arguments += [
        inspect.Parameter(
            setting.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if setting.default is REQUIRED else setting.default,
        )
        for setting in recipe.settings
    ]
    function.__name__ = recipe.name
    function.__qualname__ = qualname
    function.__module__ = module
    function.__doc__ = docstring(recipe) if doc is None else doc
    function.__annotations__ = hints
    setattr(function, "__signature__", inspect.Signature(arguments))  # noqa: B010 - type checkers do not know it
    outputs = None if single or not recipe.outputs else {port.name: port.hint for port in recipe.outputs}
    return make_type(function, module, outputs=outputs)


def holds_reals(hint: Any) -> bool:
    """Say whether a value of this type is, or consists of, real numbers: those need a unit."""
    return hint is float or (typing.get_origin(hint) is not Literal and any(map(holds_reals, typing.get_args(hint))))


def _with_unit(setting: Setting) -> Any:
    return setting.hint if setting.unit is None else Annotated[setting.hint, Unit(setting.unit)]


def docstring(recipe: Recipe) -> str:
    """Write the docstring in the form of the library's other nodes."""
    parts = [recipe.about, *(textwrap.fill(one, 118, break_long_words=False) for one in recipe.more)]
    entries = [(one.name, one.about) for one in recipe.inputs] + [(one.name, one.about) for one in recipe.settings]
    parts += [_section("Args", entries)] if entries else []
    parts += [_section("Returns", [(one.name, one.about) for one in recipe.outputs])] if recipe.outputs else []
    parts += [_section("Raises", list(recipe.raises.items()))] if recipe.raises else []
    return "\n\n".join(parts) + "\n"


def _section(title: str, entries: list[tuple[str, str]]) -> str:
    lines = [
        textwrap.fill(f"{name}: {text}", 118, initial_indent="  ", subsequent_indent="    ", break_long_words=False)
        for name, text in entries
    ]
    return f"{title}:\n" + "\n".join(lines)


def port_name(name: str) -> str:
    """Return the name of a port for an argument's: in snake case, and none that nodes or Python keep for themselves."""
    words = _spell(name).strip("_") or "value"
    if not words[0].isalpha():
        words = f"value_{words}"
    return f"{words}_" if words in _TAKEN or keyword.iskeyword(words) else words


_TAKEN: Final = RESERVED | {"return"}


def _spell(name: str) -> str:
    """Turn camelCase into snake_case, as OpenCV and others use it: filter2D -> filter_2d, solvePnP -> solve_pnp."""
    for found, instead in (("PnP", "Pnp"), ("P3P", "P3p"), ("TVL1", "Tvl1"), ("L2", "L2_"), ("NaN", "Nan")):
        name = name.replace(found, instead)
    name = re.sub(r"([a-z])(\d)D(?![a-z])", r"\1_\2d", name)
    name = re.sub(r"([A-Z]+)([A-Z][a-z])", r"\1_\2", name)
    return re.sub(r"_+", "_", re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name)).lower()

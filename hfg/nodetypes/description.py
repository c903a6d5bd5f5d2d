"""What is known of a node type: its ports, its process function and where to find it.

Plain data, computed once at declaration. Files, the studio, checks and runners read a node type here and never look at
the class. Stands on ports; knows neither `Node` nor graphs.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, Literal

import msgspec

from hfg.base.values import own_copy
from hfg.ports.specs import REQUIRED, ParameterSpec
from hfg.ports.states import State
from hfg.ports.vectors import VectorSpec, element

__all__ = [
    "EventSpec",
    "InputSpec",
    "NodeType",
    "OutputSpec",
    "ProcessKind",
    "Result",
    "SlotSpec",
    "TypesByName",
    "look_up",
    "parameter_values",
    "read_only_refusal",
    "unknown_parameter",
]

ProcessKind = Literal["none", "function", "async", "generator", "async generator"]
Result = Literal["none", "single", "fields"]


class InputSpec(msgspec.Struct, frozen=True):
    """An input; `token`: the process function wants the token itself, not its value."""

    name: str
    type: Any
    optional: bool = False
    default: Any = None
    token: bool = False


class OutputSpec(msgspec.Struct, frozen=True):
    """An output."""

    name: str
    type: Any


class EventSpec(msgspec.Struct, frozen=True):
    """An event; type None means its signals carry no value."""

    name: str
    type: Any


class SlotSpec(msgspec.Struct, frozen=True):
    """A slot.

    Attributes:
      handler_name: the method, or "" if there is none: a trigger parameter's, which triggers the event of its name, and
        a subgraph's.
      takes_value: the handler has an argument for the value, or for the token if `token`.
      while_active: it listens only while its node is active, or about to be (rule T4).
    """

    name: str
    type: Any
    handler_name: str = ""
    takes_value: bool = False
    token: bool = False
    is_async: bool = False
    while_active: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class NodeType:
    """A node type; one object for all its nodes.

    Attributes:
      name: in snake case, the default name of its nodes.
      origin: what a user calls to make a node: the class, or the `NodeFunction`.
      module: where it was declared.
      doc: its docstring, indentation taken off.
      process_kind: how the process function runs; "none" lives by its slots.
      result: how what the function gives back maps to outputs: "none" of it, the "single" output, or "fields", one each
        in order.
      fields: attribute names to read a "fields" result by, for results that are no sequence.
      shared: names that an input side and an output side both use; the short form `node.name` is refused for them.
      declared: the declarations in the class by name; identity tells a method reached by `super()` from the node's own.
      hooks: the hooks it overrides.
      completes: type of what `do` returns (rule A15).
      caller: makes `node._process_call()`.
      vectors: vectors of ports, whose ports are among the others, "values[0]" ...
      layout: of a type with vectors of outputs, for each declared output how many ports it has, None for no vector.
    """

    name: str
    origin: Any
    module: str
    qualname: str
    doc: str
    inputs: Mapping[str, InputSpec] = field(default_factory=dict)
    outputs: Mapping[str, OutputSpec] = field(default_factory=dict)
    events: Mapping[str, EventSpec] = field(default_factory=dict)
    slots: Mapping[str, SlotSpec] = field(default_factory=dict)
    parameters: Mapping[str, ParameterSpec] = field(default_factory=dict)
    states: Mapping[str, State[Any]] = field(default_factory=dict)
    process_kind: ProcessKind = "none"
    result: Result = "none"
    fields: tuple[str, ...] = ()
    is_subgraph: bool = False
    is_function: bool = False
    shared: frozenset[str] = frozenset()
    declared: Mapping[str, Any] = field(default_factory=dict)
    hooks: frozenset[str] = frozenset()
    completes: Any = None
    caller: Callable[[Any], Callable[..., Any]] | None = None
    vectors: Mapping[str, VectorSpec] = field(default_factory=dict)
    layout: tuple[int | None, ...] = ()

    @property
    def is_source(self) -> bool:
        """Whether it fires without inputs; belongs to the type, never to how it is connected (rule F2)."""
        return self.process_kind != "none" and not self.inputs

    @property
    def given_parameters_once(self) -> bool:
        """Whether its code is given the parameters as it begins and sees no later value: a generator function."""
        return self.is_function and self.process_kind in ("generator", "async generator")

    def help_of(self, name: str) -> str | None:
        """Say what a port or parameter means: what its declaration says, else its entry in the docstring."""
        spec = self.parameters.get(name)
        if spec is not None and spec.help is not None:
            return spec.help
        return _documented(self.doc).get(name)

    def is_shown(self, name: str, values: Mapping[str, Any]) -> bool:
        """Say whether an editor shows a parameter, where they have these values.

        What is asked of one that is hidden itself does not hold: nobody could see why.

        Args:
          name: of the parameter.
          values: of the others; those that are not here have their defaults.
        """
        return all(
            one.holds(values.get(one.parameter, self.parameters[one.parameter].default))
            and self.is_shown(one.parameter, values)
            for one in self.parameters[name].shown_if
        )

    def spread(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Give values by input, where those of a vector may be a list under its name."""
        found: dict[str, Any] = {}
        for name, value in values.items():
            if name in self.vectors and isinstance(value, list | tuple):
                found.update((element(name, number), one) for number, one in enumerate(value))
            else:
                found[name] = value
        return found

    @property
    def is_there(self) -> bool:
        """Whether this is the type itself, and not what stands in for one that cannot be found."""
        return True

    @property
    def reference(self) -> str | None:
        """Where to find it, "module:qualname"; None for what has no name of its own.

        Lambdas and types made inside functions.
        """
        for module, qualname in self._places():
            if "<" not in qualname and look_up(module, qualname) is self.origin:
                return f"{module}:{qualname}"
        return None

    def _places(self) -> list[tuple[str, str]]:
        """Where it may be.

        Under its own name in a package around its module that lists it in `__all__`, so that a module which became too
        long can be parted and files still find its types; else in its module; else under the name that its module gave
        it (`smooth = hfg.node(cv2.medianBlur)`).
        """
        around = [package for package in _packages_around(self.module) if self.qualname in _listed_by(package)]
        places = [(place, self.qualname) for place in (*around, self.module)]
        names = vars(sys.modules.get(self.module, object)).items()
        return places + [(self.module, name) for name, value in list(names) if value is self.origin]


def _packages_around(module: str) -> list[str]:
    """Give the packages in which a module lies, the outermost first."""
    parts = module.split(".")
    return [".".join(parts[:count]) for count in range(1, len(parts))]


def _listed_by(package: str) -> Any:
    listed = vars(sys.modules.get(package, object)).get("__all__", ())
    return listed if isinstance(listed, list | tuple) else ()


@functools.lru_cache(maxsize=256)
def _documented(doc: str) -> Mapping[str, str]:
    """Give what a docstring says of each argument and attribute; nothing where it cannot be read."""
    from docstring_parser import ParseError  # when somebody asks, for not every run does
    from docstring_parser.google import GoogleParser

    try:
        found = GoogleParser().parse(doc).params
    except ParseError:
        return {}
    return {one.arg_name: " ".join(one.description.split()) for one in found if one.description}


class TypesByName:
    """An object whose attributes are node types, so that a reference may lead through it: "module:object.name"."""


def look_up(module: str, qualname: str) -> Any:
    """Find a name in a module that is already imported, or in classes there; None if there is no such name.

    What the module has imported itself is not in it: `my_robot:os.system` names nothing.
    """
    first, *nested = qualname.split(".")
    found: Any = getattr(sys.modules.get(module), first, None)
    for part in nested:
        found = getattr(found, part, None) if isinstance(found, type | TypesByName) else None
    return None if isinstance(found, ModuleType) else found


def parameter_values(type_: NodeType, given: dict[str, Any]) -> dict[str, Any]:
    """Give every parameter of a new node its value.

    Raises:
      TypeError: a name that the type does not have, or a parameter without default is missing.
      ValueError: a value breaks its limits.
    """
    values: dict[str, Any] = {}
    for name, spec in type_.parameters.items():
        if spec.trigger:
            continue
        if name in given and spec.read_only:
            raise ValueError(read_only_refusal(f"{type_.name}.{name}"))
        if name in given:
            wrong = spec.check(given[name])
            if wrong is not None:
                raise ValueError(f'parameter "{type_.name}.{name}" {wrong}')
            value = own_copy(given[name])
        elif spec.default is REQUIRED:
            raise TypeError(
                f'{type_.name} needs a value for its parameter "{name}": write {type_.qualname}({name}=...)'
            )
        else:
            value = own_copy(spec.default)  # a list as default must not be shared by all nodes
        values[name] = value
    unknown = [name for name in given if name not in values]
    if unknown:
        raise TypeError(unknown_parameter(type_, unknown[0]))
    return values


def read_only_refusal(path: str) -> str:
    """Say why nobody but its node sets a parameter that is read-only (rule P8)."""
    name = path.rpartition(".")[2]
    return (
        f'parameter "{path}" is read-only: its node alone sets it; read node.{name}, or connect '
        f'node.ports.parameters["{name}"] to an input'
    )


def unknown_parameter(type_: NodeType, name: str) -> str:
    """Say that a type has no such parameter, and which it has."""
    known = ", ".join(f'"{known}"' for known, spec in type_.parameters.items() if spec.is_given) or "none"
    hint = "; inputs are connected, not given here" if name in type_.inputs else ""
    return f'{type_.name} has no parameter "{name}"; its parameters are {known}{hint}'

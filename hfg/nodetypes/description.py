"""The description of a node type: its ports, its process function and where to find it.

Plain data, computed once at declaration. Files, the studio, checks and runners read a node type here and never look at
the class. Depends on ports, not on `Node` or graphs.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType, ModuleType
from typing import Any, Literal

import msgspec

from hfg.base.values import own_copy
from hfg.ports.specs import REQUIRED, ParameterSpec
from hfg.ports.states import State
from hfg.ports.vectors import VectorSpec, element

ProcessKind = Literal["none", "function", "async", "generator", "async generator"]
Result = Literal["none", "single", "fields"]


class InputSpec(msgspec.Struct, frozen=True):
    """An input; `token`: the process function takes the token itself instead of its value."""

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
      handler_name: the method; "" for the slot of a trigger parameter, which triggers the event of the same name, and
        for slots of a subgraph.
      takes_value: the handler has an argument for the value, or for the token if `token`.
      while_active: it accepts signals only while its node is active, or about to become active (rule T4).
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
      origin: the object that users call to make a node: the class, or the `NodeFunction`.
      module: where it was declared.
      doc: its docstring without indentation.
      process_kind: how the process function runs; "none": the type only has slots.
      result: how the function's result maps to outputs: "none" is sent, the "single" output gets it, or "fields" go to
        one output each, in order.
      fields: attribute names for reading a "fields" result that is not a sequence.
      shared: names that an input side and an output side both use; the short form `node.name` is refused for them.
      declared: the declarations in the class by name; their identity distinguishes a method reached by `super()` from
        the node's own.
      hooks: the hooks it overrides.
      completes: type of what `do` returns (rule A15).
      caller: makes `node._process_call()`.
      vectors: vectors of ports; their ports are listed with the others, "values[0]" ...
      layout: for a type with vectors of outputs: the number of ports of each declared output, None if it is not a
        vector.
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

    def __post_init__(self) -> None:
        for name in ("inputs", "outputs", "events", "slots", "parameters", "states", "vectors"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def is_source(self) -> bool:
        """Whether it fires without inputs; a property of the type, never of its connections (rule F2)."""
        return self.process_kind != "none" and not self.inputs

    @property
    def given_parameters_once(self) -> bool:
        """Whether its code receives the parameters once, at its start, and sees no later value (generator function)."""
        return self.is_function and self.process_kind in ("generator", "async generator")

    def help_of(self, name: str) -> str | None:
        """Return the meaning of a port or parameter: from its declaration, otherwise from the docstring."""
        spec = self.parameters.get(name)
        if spec is not None and spec.help is not None:
            return spec.help
        return _documented(self.doc).get(name)

    def is_shown(self, name: str, values: Mapping[str, Any]) -> bool:
        """Return whether an editor shows a parameter when the parameters have these values.

        A condition on a parameter that is itself hidden does not hold, because users could not see the reason.

        Args:
          name: name of the parameter.
          values: values of the other parameters; missing ones have their defaults.
        """
        return all(
            one.holds(values.get(one.parameter, self.parameters[one.parameter].default))
            and self.is_shown(one.parameter, values)
            for one in self.parameters[name].shown_if
        )

    def spread(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return values by input; the values of a vector may be given as a list under the vector's name."""
        found: dict[str, Any] = {}
        for name, value in values.items():
            if name in self.vectors and isinstance(value, list | tuple):
                found.update((element(name, number), one) for number, one in enumerate(value))
            else:
                found[name] = value
        return found

    @property
    def is_there(self) -> bool:
        """Whether this is the type itself, rather than a placeholder for one that cannot be found."""
        return True

    @property
    def reference(self) -> str | None:
        """Its reference, "module:qualname"; None for types without a name of their own.

        Such types are lambdas and types made inside functions.
        """
        for module, qualname in self._places():
            if "<" not in qualname and look_up(module, qualname) is self.origin:
                return f"{module}:{qualname}"
        return None

    def _places(self) -> list[tuple[str, str]]:
        """Return the references under which the type may be found.

        First its own name in a package around its module that lists it in `__all__`, so that a long module can be split
        and files still find its types. Then its name in its module. Then the name that its module assigned it to
        (`smooth = hfg.node(cv2.medianBlur)`).
        """
        around = [package for package in _packages_around(self.module) if self.qualname in _listed_by(package)]
        places = [(place, self.qualname) for place in (*around, self.module)]
        names = vars(sys.modules.get(self.module, object)).items()
        return places + [(self.module, name) for name, value in list(names) if value is self.origin]


def _packages_around(module: str) -> list[str]:
    """Return the packages that contain a module, the outermost first."""
    parts = module.split(".")
    return [".".join(parts[:count]) for count in range(1, len(parts))]


def _listed_by(package: str) -> Any:
    listed = vars(sys.modules.get(package, object)).get("__all__", ())
    return listed if isinstance(listed, list | tuple) else ()


@functools.lru_cache(maxsize=256)
def _documented(doc: str) -> Mapping[str, str]:
    """Return the descriptions of arguments and attributes in a docstring; empty if it cannot be parsed."""
    from docstring_parser import ParseError  # imported on demand: most runs do not need it
    from docstring_parser.google import GoogleParser

    try:
        found = GoogleParser().parse(doc).params
    except ParseError:
        return {}
    return {one.arg_name: " ".join(one.description.split()) for one in found if one.description}


class TypesByName:
    """An object whose attributes are node types, so that a reference may go through it: "module:object.name"."""


def look_up(module: str, qualname: str) -> Any:
    """Find a name in a module that is already imported, or in its classes. Return None if the name does not exist.

    Names that the module has itself imported do not count: `my_robot:os.system` names nothing.
    """
    first, *nested = qualname.split(".")
    found: Any = getattr(sys.modules.get(module), first, None)
    for part in nested:
        found = getattr(found, part, None) if isinstance(found, type | TypesByName) else None
    return None if isinstance(found, ModuleType) else found


def parameter_values(type_: NodeType, given: dict[str, Any]) -> dict[str, Any]:
    """Return the values of all parameters of a new node.

    Raises:
      TypeError: the type does not have a parameter of this name, or a parameter without a default is missing.
      ValueError: a value violates its limits.
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
            value = own_copy(spec.default)  # nodes must not share a list that is a default
        values[name] = value
    unknown = [name for name in given if name not in values]
    if unknown:
        raise TypeError(unknown_parameter(type_, unknown[0]))
    return values


def read_only_refusal(path: str) -> str:
    """Return the message for setting a read-only parameter, which only its node may set (rule P8)."""
    name = path.rpartition(".")[2]
    return (
        f'parameter "{path}" is read-only: only its node sets it; read node.{name}, or connect '
        f'node.ports.parameters["{name}"] to an input'
    )


def unknown_parameter(type_: NodeType, name: str) -> str:
    """Return the message for an unknown parameter; it lists the known ones."""
    known = ", ".join(f'"{known}"' for known, spec in type_.parameters.items() if spec.is_given) or "none"
    hint = "; inputs are connected, not given here" if name in type_.inputs else ""
    return f'{type_.name} has no parameter "{name}"; its parameters are {known}{hint}'

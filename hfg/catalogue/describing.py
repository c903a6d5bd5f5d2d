"""A node type in words and plain data, for lists, pages, editors and other programs.

Depends on node types and `documentation`.
"""

from __future__ import annotations

import dataclasses
import inspect
import sys
from collections.abc import Iterable, Iterator
from typing import Any, Final

import annotated_types
import msgspec

from hfg.base.limits import Inside
from hfg.catalogue.documentation import Documentation, read_documentation
from hfg.nodetypes.description import EventSpec, NodeType
from hfg.nodetypes.functions import NodeFunction
from hfg.nodetypes.node import Node
from hfg.ports.specs import REQUIRED, ParameterSpec
from hfg.types import Widget, describe

_LIMITS: Final = {
    "gt": "> {}",
    "ge": ">= {}",
    "lt": "< {}",
    "le": "<= {}",
    "multiple_of": "a multiple of {}",
    "min_length": "at least {} items",
    "max_length": "at most {} items",
    "predicate": "{}",
}


class PortDescription(msgspec.Struct, frozen=True):
    """A port of a node type.

    Attributes:
      type: its type hint as text; "" for an event or a slot without a value.
      doc: its meaning, with unit and range.
      optional: the node fires without it.
      default: its value in this case.
      while_active: a slot that accepts signals only while its node is active.
      vector: it represents several ports of this kind, "values[0]", "values[1]" ...; the parameter of its name has
        their number.
      widget: how editors should show its values, if its type has an `hfg.types.Widget`.
    """

    name: str
    type: str
    doc: str
    optional: bool = False
    default: Any = None
    while_active: bool = False
    vector: bool = False
    widget: str = ""


class ParameterDescription(msgspec.Struct, frozen=True):
    """A parameter of a node type.

    Attributes:
      kind: what an editor shows for it: "int", "choice", "colour" ...
      required: it has no default, so a value is required to make a node.
      limits: by name: "gt", "ge", "lt", "le", "multiple_of", "min_length", "max_length", "predicate".
      choices: the only allowed values, or members of them, or None.
      labels: labels of the choices.
      unit: "m/s"; "1" for a number without a unit, "of the value" for one with the unit of the input.
      step: how much an editor changes the value per step.
      group: the group in which it is shown.
      shown_if: when it is shown, in words, as in "mode is 'custom'".
      read_only: only its node sets it.
      pattern: the file names that it accepts.
      directory: the path must be a directory.
      save: the path is written to.
      trigger: no value, but a slot and an event.
      size: the number of ports of a vector of this name.
    """

    name: str
    kind: str
    type: str
    doc: str
    default: Any = None
    required: bool = False
    limits: dict[str, Any] = {}  # a struct copies it for each instance
    choices: tuple[Any, ...] | None = None
    labels: tuple[str, ...] = ()
    unit: str | None = None
    step: float | None = None
    group: str | None = None
    shown_if: tuple[str, ...] = ()
    read_only: bool = False
    pattern: str | None = None
    directory: bool = False
    save: bool = False
    trigger: bool = False
    size: bool = False

    def limits_in_words(self) -> list[str]:
        """Return the limits of its values in words: ">= 0", "one of 3, 5, 7"."""
        said = [_LIMITS[name].format(limit) for name, limit in self.limits.items()]
        if self.choices is not None and not self.type.startswith("Literal"):  # the type shows the choices
            said.append(f"one of {', '.join(map(repr, self.choices))}")
        return said

    def facts(self) -> list[str]:
        """Return facts besides its meaning: limits, the unit, when it is shown."""
        said = [*self.limits_in_words(), *([_unit_in_words(self.unit)] if self.unit else [])]
        return said + ([f"shown if {' and '.join(self.shown_if)}"] if self.shown_if else [])


def _unit_in_words(unit: str) -> str:
    if unit == "1":
        return "a plain number"
    return f"in the unit {unit}" if unit.startswith("of ") else f"in {unit}"


class ErrorDescription(msgspec.Struct, frozen=True):
    """An exception that a firing may raise as part of its contract."""

    name: str
    when: str


class TypeDescription(msgspec.Struct, frozen=True):
    """A node type.

    Attributes:
      reference: "module:name", as in graph files.
      name: in snake case, the default name of its nodes.
      title: its name in code.
      category: its family in the standard library; otherwise from its docstring or module, or the package.
      summary: one line.
      text: the complete description of its behaviour.
      doc: the unchanged docstring.
      source: it fires without inputs.
      subgraph: it is made of other nodes.
      errors: exceptions that a firing may raise as part of its contract.
      apex: names of the CS::APEX nodes that it replaces.
    """

    reference: str
    name: str
    title: str
    module: str
    category: str
    summary: str
    text: str
    doc: str
    source: bool = False
    subgraph: bool = False
    inputs: tuple[PortDescription, ...] = ()
    outputs: tuple[PortDescription, ...] = ()
    events: tuple[PortDescription, ...] = ()
    slots: tuple[PortDescription, ...] = ()
    parameters: tuple[ParameterDescription, ...] = ()
    errors: tuple[ErrorDescription, ...] = ()
    apex: tuple[str, ...] = ()

    def ports(self) -> Iterator[tuple[str, PortDescription]]:
        """Yield every port with its kind, in the order for reading."""
        for kind, ports in (
            ("input", self.inputs),
            ("output", self.outputs),
            ("event", self.events),
            ("slot", self.slots),
        ):
            for port in ports:
                yield kind, port


def describe_type(of: NodeType | type[Node] | NodeFunction[..., Any], *, offered_by: str = "") -> TypeDescription:
    """Describe a node type.

    Args:
      of: the type.
      offered_by: the module whose category it has, if not its own.

    Examples:
      >>> import hfg
      >>> @hfg.node
      ... def half(number: float) -> float:
      ...     '''Halve a number.
      ...
      ...     Args:
      ...       number: any.
      ...       out: half of it.
      ...     '''
      ...     return number / 2
      >>> described = describe_type(half)
      >>> described.summary, described.inputs[0].type, described.outputs[0].doc
      ('Halve a number.', 'float', 'half of it.')
    """
    kind = of if isinstance(of, NodeType) else of._type
    read = _with_inherited(kind)
    reference = kind.reference or f"{kind.module}:{kind.qualname}"
    module, _, title = reference.partition(":")
    return TypeDescription(
        reference=reference,
        name=kind.name,
        title=title,
        module=module,
        category=read.category or _category(offered_by or kind.module),
        summary=read.summary,
        text=read.text,
        doc=kind.doc,
        source=kind.is_source,
        subgraph=kind.is_subgraph,
        inputs=tuple(_ports(kind.inputs.values(), kind, read)),
        outputs=tuple(_ports(kind.outputs.values(), kind, read)),
        events=tuple(_ports(kind.events.values(), kind, read)) + _completed(kind, read),
        slots=tuple(_ports(kind.slots.values(), kind, read)),
        parameters=tuple(
            describe_parameter(spec, read.entries.get(spec.name, "")) for spec in kind.parameters.values()
        ),
        errors=tuple(ErrorDescription(name, when) for name, when in read.errors),
        apex=read.apex,
    )


def _with_inherited(kind: NodeType) -> Documentation:
    """Read the docstring of a type; for ports, parameters and errors that it inherits, those of its bases."""
    read = read_documentation(kind.doc)
    bases = [
        one._type.doc for one in getattr(kind.origin, "__mro__", ())[1:] if issubclass(one, Node) and one is not Node
    ]
    for base in map(read_documentation, bases):
        told = {name for name, _ in read.errors}
        errors = (*read.errors, *(one for one in base.errors if one[0] not in told))
        read = dataclasses.replace(read, entries={**base.entries, **read.entries}, errors=errors)
    return read


def _completed(kind: NodeType, read: Documentation) -> tuple[PortDescription, ...]:
    """Describe the automatic event that belongs to a do-activity (rule A15)."""
    if "do" not in kind.hooks:
        return ()
    (made,) = _ports([EventSpec("completed", kind.completes)], kind, read)
    words = made.doc or "The do-activity has returned; with its result."
    return (msgspec.structs.replace(made, doc=words),)


def undocumented(described: TypeDescription) -> list[str]:
    """Return what the docstring of a type lacks: its first line, a port, a parameter; empty if it is complete."""
    where = described.reference
    found = [] if described.summary else [f"{where} has no docstring: say in one line what it does"]
    if described.summary and not described.summary.endswith((".", "!", "?")):
        found.append(f'{where}: the first line of its docstring, "{described.summary}", is not a complete sentence')
    places = [(kind, port.name, port.doc) for kind, port in described.ports()]
    places += [("parameter", one.name, one.doc) for one in described.parameters]
    section = "Args" if described.title[:1].islower() else "Attributes"
    found += [
        f'{where}: its {kind} "{name}" is not documented; add an entry to {section}: in its docstring'
        for kind, name, doc in places
        if not doc
    ]
    return found


def _category(module: str) -> str:
    said = getattr(sys.modules.get(module), "__category__", None)
    if isinstance(said, str) and said:
        return said
    parts = module.split(".")
    return parts[2] if parts[:2] == ["hfg", "nodes"] and len(parts) > 2 else parts[0]


def _ports(specs: Iterable[Any], kind: NodeType, read: Documentation) -> Iterator[PortDescription]:
    seen: set[str] = set()
    for spec in specs:
        name, bracket, _ = spec.name.partition("[")
        if name in seen:
            continue
        seen.add(name)
        optional = getattr(spec, "optional", False)
        carries = spec.type is not None and (kind.is_subgraph or getattr(spec, "takes_value", True))
        yield PortDescription(
            name,
            describe(spec.type) if carries else "",
            _said_of_port(name, kind, read),
            optional,
            spec.default if optional else None,
            getattr(spec, "while_active", False),
            bool(bracket),
            Widget.of(spec.type),
        )


def _said_of_port(name: str, kind: NodeType, read: Documentation) -> str:
    """Return the docstring's text about a port.

    An only output may have the text of `Returns:`, a slot the first line of its handler.
    """
    said = read.entries.get(name)
    if not said and name in kind.outputs and len(kind.outputs) == 1:
        # the first line of a function's docstring describes its result
        said = read.result or (read.summary if kind.is_function and name == "out" else "")
    if not said and name in kind.slots:
        handler = getattr(kind.declared.get(name), "handler", None)
        said = (inspect.getdoc(handler) or "").partition("\n")[0]
    return said or ""


def describe_parameter(spec: ParameterSpec, doc: str = "") -> ParameterDescription:
    """Describe a parameter; `doc` is its meaning if its declaration has none."""
    required = spec.default is REQUIRED
    return ParameterDescription(
        name=spec.name,
        kind=spec.kind,
        type="" if spec.trigger else describe(spec.type),
        doc=spec.help or doc,
        default=None if required or spec.trigger else spec.default,
        required=required and spec.is_given,
        limits=dict(_limit(limit) for limit in spec.limits if not isinstance(limit, Inside)),
        choices=spec.choices,
        labels=spec.labels,
        unit=spec.unit,
        step=spec.step,
        group=spec.group,
        shown_if=tuple(one.in_words() for one in spec.shown_if),
        read_only=spec.read_only,
        pattern=spec.pattern,
        directory=spec.directory,
        save=spec.save,
        trigger=spec.trigger,
        size=spec.size,
    )


def _limit(limit: Any) -> tuple[str, Any]:
    """Return the name of a constraint of annotated-types, and its bound."""
    match limit:
        case annotated_types.Gt(bound):
            return "gt", bound
        case annotated_types.Ge(bound):
            return "ge", bound
        case annotated_types.Lt(bound):
            return "lt", bound
        case annotated_types.Le(bound):
            return "le", bound
        case annotated_types.MultipleOf(bound):
            return "multiple_of", bound
        case annotated_types.MinLen(bound):
            return "min_length", bound
        case annotated_types.MaxLen(bound):
            return "max_length", bound
        case annotated_types.Predicate(function):
            return "predicate", getattr(function, "__name__", str(function)).replace("_", " ").strip()
    return "predicate", str(limit)

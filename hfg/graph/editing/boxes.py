"""Makes types of subgraphs from data: their ports, and their parameters with limits, choices and conditions.

Depends on `document` and `type_texts`.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, NoReturn, TypeAlias

import annotated_types

from hfg.base.values import same
from hfg.encoding import Find, encode
from hfg.errors import EncodingError, GraphError, HfgError
from hfg.graph.editing.commands import AddSubgraph
from hfg.graph.editing.document import BoxDocument, ParameterDocument
from hfg.graph.editing.making import as_meant
from hfg.graph.editing.type_texts import type_of_text
from hfg.graph.structure.subgraph import Box
from hfg.ports import Event, Input, Output, Parameter, ParameterSpec, slot
from hfg.ports.conditions import Condition
from hfg.ports.kinds import choices_of, type_of_choices

Report: TypeAlias = Callable[[str, str, str], None]
"""Receives the kind and the name of a port that cannot be made, and why."""

LIMITS: Final[dict[str, tuple[type[Any], str]]] = {
    "gt": (annotated_types.Gt, "gt"),
    "ge": (annotated_types.Ge, "ge"),
    "lt": (annotated_types.Lt, "lt"),
    "le": (annotated_types.Le, "le"),
    "multiple_of": (annotated_types.MultipleOf, "multiple_of"),
    "min_length": (annotated_types.MinLen, "min_length"),
    "max_length": (annotated_types.MaxLen, "max_length"),
}
"""By the word for it in data: the limit, and the attribute that holds its value."""

DECLARED: Final[Mapping[str, Callable[[Any], Any]]] = {
    "inputs": Input,
    "outputs": Output,
    "events": Event,
    "slots": lambda hint: slot(type=hint),
}
"""By the kind of a port: makes its declaration in the body of a class."""


def box_with(kind: type[Box], ports: AddSubgraph, path: str) -> Box:
    """Make an empty subgraph that has no type of its own.

    Raises:
      GraphError: a port cannot have this name or type.
    """

    def refuse(what: str, name: str, sentence: str) -> NoReturn:
        raise GraphError(f'subgraph "{path}": {sentence}')

    box: Box = box_type(kind, ports, {}, refuse)()
    return box


def box_type(
    kind: type[Box],
    ports: AddSubgraph | BoxDocument,
    body: Mapping[str, Any],
    report: Report,
    find: Find | None = None,
) -> type[Box]:
    """Make a type of subgraphs.

    Args:
      kind: its base.
      ports: the ports, and perhaps the parameters, that it declares.
      body: what else belongs into the body of the class; "__name__" is that of the class.
      report: receives ports that cannot be made; the type does not have them.
      find: returns the code that values of its parameters refer to.
    """
    names = {**dict(_declarations(kind, ports, report, find)), **body}
    try:
        return types.new_class(names.pop("__name__", kind.__name__), (kind,), exec_body=lambda own: own.update(names))
    except HfgError as error:
        report("", "", str(error))
        return kind


def is_free(name: str, kind: type[Box]) -> bool:
    """Return whether a port of a subgraph may have a name."""
    return name.isidentifier() and not name.startswith("_") and not hasattr(kind, name)


def _declarations(
    kind: type[Box], ports: AddSubgraph | BoxDocument, report: Report, find: Find | None
) -> Iterator[tuple[str, Any]]:
    parameters = ports.parameters if isinstance(ports, BoxDocument) else {}
    taken: set[str] = set()
    for what in (*DECLARED, "parameters"):
        for name, said in (parameters if what == "parameters" else getattr(ports, what)).items():
            try:
                if not (isinstance(name, str) and is_free(name, kind)):
                    raise GraphError(f"a port cannot be called {name!r}; choose another name")
                if name in taken:
                    raise GraphError(f'it has two ports "{name}"; give each a name of its own')
                taken.add(name)
                if isinstance(said, ParameterDocument):
                    yield name, _parameter(name, parameters, find)
                else:
                    yield name, DECLARED[what](type_of_text(said, f'port "{name}"'))
            except HfgError as error:
                report(what, name, str(error))


def _parameter(name: str, parameters: Mapping[str, ParameterDocument], find: Find | None) -> Parameter[Any]:
    said = parameters[name]
    hint = type_of_text(said.type, f'"{name}"')
    limits = _limits(said.limits)
    choices: Any = None
    if said.choices is not None:
        choices = [as_meant(one, type_of_choices(hint), find) for one in said.choices]
    if said.labels:
        if len(said.labels) != len(choices or ()) or len(set(said.labels)) < len(said.labels):
            raise GraphError(
                f"labels are what to call the choices; there are {len(choices or ())} choices and {len(said.labels)} "
                "labels, so give each choice one of its own, or omit labels"
            )
        choices = dict(zip(said.labels, choices, strict=True))
    return Parameter(
        as_meant(said.default, hint, find),
        *limits,
        choices=choices,
        shown_if=_conditions(said.shown_if, parameters, find),
        type=hint,
        **{name: getattr(said, name) for name in _KEPT},
    )


_KEPT: Final = ("unit", "step", "group", "help", "pattern", "directory", "save")
"""What a parameter and its data say in the same way."""


def _limits(said: Mapping[str, Any]) -> list[Any]:
    unknown = [word for word in said if word not in LIMITS]
    if unknown:
        raise GraphError(f'"{unknown[0]}" is not a limit; there are {", ".join(LIMITS)}')
    return [LIMITS[word][0](value) for word, value in said.items()]


class _Together(annotated_types.GroupedMetadata):
    """Several limits where one is expected."""

    def __init__(self, limits: list[Any]) -> None:
        self.limits = limits

    def __iter__(self) -> Iterator[Any]:
        return iter(self.limits)


def _conditions(said: object, parameters: Mapping[str, ParameterDocument], find: Find | None) -> Any:  # noqa: ANN401 - see ShownIf
    """Read `shown_if`; anything that has none of its forms is left to the declaration to refuse."""
    if not isinstance(said, dict):
        return said
    wanted: dict[str, Any] = {}
    for other, one in said.items():
        if isinstance(one, dict):
            wanted[other] = _Together(_limits(one))
        elif other in parameters:
            hint = type_of_text(parameters[other].type, f'"{other}"')
            several = one if isinstance(one, list) else [one]
            wanted[other] = [as_meant(value, hint, find) for value in several]
        else:
            wanted[other] = one
    return wanted


# --- and back ---


def parameter_as_data(spec: ParameterSpec, type_: str, parameters: Mapping[str, ParameterSpec]) -> ParameterDocument:
    """Return the data for a parameter that a subgraph declares.

    Raises:
      EncodingError: a value or limit is not data.
    """
    known = choices_of(spec.type)
    choices: list[Any] | None = None
    if spec.choices is not None and (
        known is None or not same((tuple(known.values()), tuple(known)), (spec.choices, spec.labels))
    ):
        choices = [encode(one, type_of_choices(spec.type)) for one in spec.choices]
    return ParameterDocument(
        type=type_,
        default=encode(spec.default, spec.type),
        choices=choices,
        labels=[] if choices is None else list(spec.labels),
        limits=_limits_as_data(spec.limits, "its limits"),
        shown_if=_conditions_as_data(spec.shown_if, parameters),
        **{name: getattr(spec, name) for name in _KEPT},
    )


def _conditions_as_data(
    conditions: tuple[Condition, ...], parameters: Mapping[str, ParameterSpec]
) -> str | dict[str, Any] | None:
    """Return conditions in the form of the declaration: a name, or by name what others must be."""
    found: dict[str, Any] = {}
    for one in conditions:
        if one.on:
            return one.parameter
        values = [encode(value, parameters[one.parameter].type) for value in one.values]
        plain = values[0] if len(values) == 1 and not isinstance(values[0], dict | list) else values
        found[one.parameter] = plain if values else _limits_as_data(one.limits, "a condition with the limits")
    return found or None


def _limits_as_data(limits: tuple[Any, ...], what: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for limit in limits:
        word = next((word for word, (kind, _) in LIMITS.items() if type(limit) is kind), None)
        if word is None or word in found:
            raise EncodingError(f"{what} {limits!r:.80} cannot be expressed as data")
        found[word] = getattr(limit, LIMITS[word][1])
    return found

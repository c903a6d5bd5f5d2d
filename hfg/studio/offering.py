"""What node types offer: their views, and their actions as commands and signals. Depends on `panels` and commands."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any, Final, get_type_hints

import msgspec

from hfg.errors import EncodingError, shown
from hfg.graph import Graph
from hfg.graph.editing.commands import SetParameter
from hfg.graph.structure.level import level_of
from hfg.graph.structure.paths import node_at
from hfg.nodetypes.description import NodeType
from hfg.panels import Call, Change, View, actions_of, views_of
from hfg.ports.parameters import spec_of
from hfg.ports.specs import REQUIRED, ParameterSpec
from hfg.studio.refusing import Refused

__all__ = ["arguments_of", "change_of", "offered_action", "offered_view", "offers", "signal_of"]

_MOST_LETTERS: Final = 60


def offers(kind: NodeType) -> tuple[dict[str, View], dict[str, Change | Call]]:
    """Return the views and actions of a node type; actions on what the type does not have are left out."""
    known = {
        name: action
        for name, action in actions_of(kind.origin).items()
        if (action.slot in kind.slots if isinstance(action, Call) else action.values.keys() <= kind.parameters.keys())
    }
    return views_of(kind.origin), known


def arguments_of(kind: NodeType, action: Change | Call) -> list[ParameterSpec]:
    """Return what people give to an action, with what it suggests as defaults."""
    if isinstance(action, Change):
        return [msgspec.structs.replace(kind.parameters[name], default=one) for name, one in action.values.items()]
    slot = kind.slots[action.slot]
    return list(_fields(slot.type, f"slot {action.slot}")) if slot.takes_value else []


def _is_record(hint: Any) -> bool:
    return isinstance(hint, type) and (
        is_dataclass(hint) or hasattr(hint, "_fields") or issubclass(hint, msgspec.Struct)
    )


def _fields(hint: Any, where: str) -> Iterator[ParameterSpec]:
    if not _is_record(hint):
        yield spec_of("value", REQUIRED, hint, where)
        return
    hints = get_type_hints(hint, include_extras=True)
    for name, one in inspect.signature(hint).parameters.items():
        yield spec_of(name, REQUIRED if one.default is one.empty else one.default, hints.get(name, Any), where)


def offered_view(graph: Graph, path: str, name: str) -> tuple[Any, View]:
    """Return a node and its view.

    Raises:
      HfgError: there is no such node, or it offers no such view.
    """
    node = node_at(level_of(graph), path)
    found = views_of(node._type.origin)
    if name not in found:
        raise Refused("unknown", f'"{path}" offers {_listed("view", found)}, got "{name:.40}"', path)
    return node, found[name]


def offered_action(graph: Graph, path: str, name: str) -> tuple[NodeType, Change | Call]:
    """Return the type of a node, and one of its actions.

    Raises:
      HfgError: there is no such node, or it offers no such action.
    """
    kind = node_at(level_of(graph), path)._type
    _, found = offers(kind)
    if name not in found:
        raise Refused("unknown", f'"{path}" offers {_listed("action", found)}, got "{name:.40}"', path)
    return kind, found[name]


def _listed(what: str, names: Mapping[str, object]) -> str:
    return f"the {what}s {', '.join(names)}" if names else f"no {what}s"


def change_of(path: str, kind: NodeType, action: Change, given: Mapping[str, Any]) -> list[SetParameter]:
    """Return the commands of an action that sets parameters; what is not given has the suggested value.

    Raises:
      Refused: something is given that the action does not set.
    """
    _need_known(path, action.values, given)
    suggested = {name: kind.parameters[name].encode(one) for name, one in action.values.items()}
    return [SetParameter(f"{path}.{name}", given.get(name, one)) for name, one in suggested.items()]


def signal_of(path: str, kind: NodeType, action: Call, given: Mapping[str, Any]) -> tuple[Any, str]:
    """Return the value that an action sends into its slot, and the call in words.

    Raises:
      Refused: a value is missing, is not of its type or is out of its limits.
    """
    specs = {spec.name: spec for spec in arguments_of(kind, action)}
    _need_known(path, specs, given)
    values = {name: _read(path, spec, given) for name, spec in specs.items()}
    words = ", ".join(f"{name} {shown(value, _MOST_LETTERS)}" for name, value in values.items())
    said = f"{action.label}: {words}" if words else action.label
    hint = kind.slots[action.slot].type
    if not specs:
        return None, said
    return (hint(**values) if _is_record(hint) else values["value"]), said


def _need_known(path: str, known: Mapping[str, object], given: Mapping[str, Any]) -> None:
    for name in given:
        if name not in known:
            raise Refused("usage", f'this action takes {", ".join(known) or "nothing"}, got "{name:.40}"', path)


def _read(path: str, spec: ParameterSpec, given: Mapping[str, Any]) -> Any:
    if spec.name not in given:
        if spec.default is REQUIRED:
            raise Refused("usage", f'this action needs a value for "{spec.name}"; give one', path)
        return spec.default
    try:
        value = spec.decode(given[spec.name])
    except EncodingError as error:
        raise Refused("usage", str(error), path) from None
    wrong = spec.check(value)
    if wrong is not None:
        raise Refused("limits", f'"{spec.name}" {wrong}', path)
    return value

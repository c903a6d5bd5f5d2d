"""A graph as the records that a page shows. Reads the drawn graph only, which is the same at rest and in a run.

Depends on `records`, the graph and the catalogue.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from typing import Any, Final

import msgspec

from hfg.catalogue import ParameterDescription, describe_type
from hfg.catalogue.describing import describe_parameter
from hfg.encoding import encode
from hfg.errors import EncodingError, GraphError, shown
from hfg.graph import Edge, Graph
from hfg.graph.editing.data import edge_as_data
from hfg.graph.structure.edge import end_path, is_feed, is_port
from hfg.graph.structure.level import Level, inside, level_of
from hfg.graph.structure.naming import path_of
from hfg.graph.structure.paths import node_at
from hfg.graph.structure.subgraph import is_box, is_unnamed
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node
from hfg.panels import Call, Change
from hfg.ports import Port
from hfg.ports.automatic import AUTOMATIC_EVENTS, AUTOMATIC_SLOTS, SUBGRAPH_EVENTS, SUBGRAPH_SLOTS
from hfg.ports.kinds import without_none
from hfg.ports.specs import REQUIRED, ParameterSpec
from hfg.studio.annotating import annotations_of
from hfg.studio.offering import arguments_of, offers
from hfg.studio.records import (
    ActionRecord,
    EdgeRecord,
    GateRecord,
    GroupRecord,
    NodeRecord,
    OwnPortRecord,
    PortRecord,
    TypeRecord,
    ViewRecord,
)
from hfg.types import describe

__all__ = ["Records", "automatic_ports", "changed_record", "describe_graph", "type_record"]

Records = dict[str, dict[str, Any]]
"""Records by table and key."""

_MOST_LETTERS: Final = 200


def describe_graph(graph: Graph) -> Records:
    """Return the tables that depend only on the graph."""
    root = level_of(graph)
    tables: Records = {name: {} for name in ("nodes", "edges", "gates", "groups", "ports", "types")}
    for number, spec in enumerate(root.whole.groups.by_name.values()):
        tables["groups"][spec.name] = GroupRecord(spec.name, number, spec.threads, spec.policy, spec.process, spec.host)
    for port in root.ports.by_name().values():
        kind = {"output": "input", "input": "output"}.get(port.kind, port.kind)  # seen from outside
        tables["ports"][port.name] = OwnPortRecord(port.name, kind, _type_text(port.type))
    for level in root.walk():
        _describe_level(level, tables)
    tables["annotations"] = dict(annotations_of(graph))
    return tables


def _describe_level(level: Level, tables: Records) -> None:
    path = level.path
    used = _Used(level)
    for edge in level.edges:
        tables["edges"][edge.label] = _edge(edge, path)
    for gate in level.gates:
        target = path_of(gate.target)
        tables["gates"][target] = GateRecord(target, path_of(gate.by), gate.idle_rate_hz, path)
    for name, node in level.nodes.items():
        record = _node(level, name, node, used)
        tables["nodes"][record.path] = record
        if record.type not in tables["types"]:
            tables["types"][record.type] = type_record(node._type, record.type)


def changed_record(graph: Graph, before: NodeRecord) -> NodeRecord:
    """Describe a node of which only parameters and notes may be others than before."""
    node = node_at(level_of(graph), before.path)
    return msgspec.structs.replace(
        before,
        parameters=_values(node),
        shown=_shown_now(node),
        notes=dict(level_of(graph).whole.notes.get(node, {})),
    )


class _Used:
    """Which ports of the nodes of a level have edges, on either side of a border."""

    def __init__(self, level: Level) -> None:
        self.ports: dict[Any, dict[tuple[str, str], Port]] = {}
        self.states: set[Any] = set()
        self.locked: dict[Any, dict[str, str]] = {}
        for edge in level.edges:
            for end in (edge.source, edge.target):
                if is_port(end):
                    if isinstance(end, Port):
                        self.ports.setdefault(end.node, {})[end.kind, end.name] = end
                    if edge.active:
                        self.states.add(end.node)
            if isinstance(edge.target, Port) and edge.target.kind == "parameter":
                self.locked.setdefault(edge.target.node, {})[edge.target.name] = edge.label


def _node(level: Level, name: str, node: Node, used: _Used) -> NodeRecord:
    kind, options, inner = node._type, node._options, inside(node)
    said = options.said()
    said.pop("group", None)
    said.pop("enabled", None)
    unnamed = is_box(node) and is_unnamed(node) and kind.reference is None
    path = level.path_to(name)
    return NodeRecord(
        path=path,
        name=name,
        level=level.path,
        type=f"~{path}" if unnamed else kind.reference or f"{kind.module}:{kind.qualname}",
        title=kind.qualname,
        group=options.group or _group_around(level),
        own_group=options.group,
        options=said,
        parameters=_values(node),
        locked=used.locked.get(node, {}),
        shown=_shown_now(node),
        enabled=options.enabled,
        subgraph=inner is not None,
        unnamed=unnamed,
        inside=0 if inner is None else len(inner.nodes),
        ports=list(_ports(node, path, used.ports.get(node, {}))),
        missing="" if kind.is_there else kind.doc,
        activity=node in used.states,
        notes=dict(level.whole.notes.get(node, {})),
    )


def _group_around(level: Level | None) -> str:
    while level is not None and level.owner is not None:
        group = level.owner._options.group
        if group:
            return str(group)
        level = level.around
    return "loop"


def _values(node: Node) -> dict[str, Any]:
    return {
        name: _data(spec, node._parameters[name])
        for name, spec in node._type.parameters.items()
        if name in node._parameters and not spec.trigger
    }


def _data(spec: ParameterSpec, value: object) -> object:
    """Return plain data, or a text about a value that is not data."""
    try:
        return spec.encode(value)
    except EncodingError:
        return {"$shown": shown(value, _MOST_LETTERS)}


def _shown_now(node: Node) -> list[str]:
    kind = node._type
    return [name for name, spec in kind.parameters.items() if not spec.size and kind.is_shown(name, node._parameters)]


def _ports(node: Node, path: str, used: dict[tuple[str, str], Port]) -> Iterator[PortRecord]:
    kind = node._type
    declared = set()
    kinds: tuple[tuple[str, Mapping[str, Any]], ...] = (
        ("input", kind.inputs),
        ("output", kind.outputs),
        ("slot", kind.slots),
        ("event", kind.events),
        ("parameter", kind.parameters),
    )
    for what, specs in kinds:
        for name, spec in specs.items():
            if what == "parameter" and not spec.is_port:
                continue
            declared.add((what, name))
            text = _type_text(spec.type) if getattr(spec, "takes_value", True) else ""
            optional = bool(getattr(spec, "optional", False))
            yield PortRecord(name, what, f"{path}.{name}", text, optional, False, (what, name) in used)
    for (what, name), port in used.items():
        if (what, name) not in declared:
            yield PortRecord(name, what, f"{path}.{name}", _type_text(port.type), auto=True, used=True)


@functools.lru_cache(maxsize=4096)
def _described(hint: Any) -> str:
    return describe(hint)


def _type_text(hint: Any) -> str:
    if hint is None:
        return ""
    try:
        return _described(hint)
    except TypeError:  # a hint that cannot be hashed
        return describe(hint)


def _edge(edge: Edge, level: str) -> EdgeRecord:
    signal = is_feed(edge.source) or edge.source.kind in ("event", "slot")
    return EdgeRecord(
        source=end_path(edge.source),
        target=end_path(edge.target),
        level=level,
        active=edge.active,
        options=_edge_options(edge),
        signal=signal,
        back=bool(edge.options.initial),
    )


def _edge_options(edge: Edge) -> dict[str, Any]:
    try:
        said = dict(edge_as_data(edge, encode))
    except GraphError:  # operators without a name, values that are not data
        said = dict(edge.options.said())
        for name in ("initial", "through"):
            if name in said:
                said[name] = [shown(one, _MOST_LETTERS) for one in getattr(edge.options, name)]
    said.pop("active", None)
    return said


@functools.lru_cache(maxsize=2048)
def type_record(kind: NodeType, key: str) -> TypeRecord:
    """Describe a node type as nodes of a graph have it."""
    described = describe_type(kind)
    views, actions = offers(kind)
    return TypeRecord(
        reference=key,
        title=described.title,
        category=described.category,
        summary=described.summary,
        doc=described.text,
        subgraph=described.subgraph,
        source=described.source,
        parameters=[_parameter(kind.parameters[one.name], one) for one in described.parameters],
        docs={f"{what}/{port.name}": port.doc for what, port in described.ports() if port.doc},
        views=[ViewRecord(name, one.title, one.doc) for name, one in views.items()],
        actions=[_action(kind, name, one) for name, one in actions.items()],
    )


def _action(kind: NodeType, name: str, action: Change | Call) -> ActionRecord:
    arguments = [_parameter(spec, describe_parameter(spec)) for spec in arguments_of(kind, action)]
    return ActionRecord(name, action.label, action.help, isinstance(action, Change), arguments)


def _parameter(spec: ParameterSpec, described: ParameterDescription) -> dict[str, Any]:
    """Describe a parameter: its widget and the limits of its values."""
    required = spec.default is REQUIRED
    return {
        "name": spec.name,
        "kind": spec.kind,
        "type": described.type,
        "doc": described.doc,
        "default": None if required or spec.trigger else _data(spec, spec.default),
        "required": required,
        "optional": without_none(spec.type) is not spec.type,
        "limits": {name: limit for name, limit in described.limits.items() if isinstance(limit, int | float | str)},
        "low": _number(spec.minimum),
        "high": _number(spec.maximum),
        "choices": None if spec.choices is None else [_choice(spec, one) for one in spec.choices],
        "labels": list(spec.labels),
        "unit": None if spec.unit == "1" else spec.unit,  # a plain number has none that people write
        "step": spec.step,
        "group": spec.group,
        "read_only": spec.read_only,
        "pattern": spec.pattern,
        "directory": spec.directory,
        "save": spec.save,
        "trigger": spec.trigger,
        "size": spec.size,
        "shape": None if spec.shape is None else list(spec.shape),
    }


def _number(limit: object) -> float | int | None:
    return limit if isinstance(limit, int | float) else None


def _choice(spec: ParameterSpec, choice: object) -> object:
    """A choice as SetParameter takes it."""
    try:
        return spec.encode([choice])[0] if spec.kind == "choices" else spec.encode(choice)
    except (EncodingError, IndexError, TypeError):
        return shown(choice, _MOST_LETTERS)


def automatic_ports() -> dict[str, list[dict[str, str]]]:
    """Return the ports that every node and every subgraph has without declaring them (rules A9, G2)."""

    def listed(names: Any) -> list[dict[str, str]]:
        return [{"name": name, "type": _type_text(AUTOMATIC_EVENTS.get(name))} for name in names]

    return {
        "event": listed(AUTOMATIC_EVENTS),
        "slot": listed(AUTOMATIC_SLOTS),
        "subgraph_event": listed(SUBGRAPH_EVENTS),
        "subgraph_slot": listed(SUBGRAPH_SLOTS),
    }

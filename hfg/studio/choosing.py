"""What an editor of the page offers: gates, promotions, options of an edge, operators, parts for a condition.

The page shows these rows and sends the commands in them back; it knows neither rule nor default. Depends on the graph.
"""

from __future__ import annotations

import inspect
import sys
import typing
from collections.abc import Iterator
from typing import Any, Final, Literal, get_args, get_origin

import msgspec
from reactivex import operators as reactive

from hfg.encoding import encode
from hfg.errors import GraphError
from hfg.graph import Edge, Graph
from hfg.graph.editing import commands as c
from hfg.graph.editing.data import edge_as_data
from hfg.graph.structure.declaring import refuse_promotion
from hfg.graph.structure.edge import end_path, is_feed, type_of
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.operators import OperatorFunction
from hfg.graph.structure.option import Declared, declared
from hfg.graph.structure.options import EdgeOptions
from hfg.graph.structure.paths import node_at
from hfg.graph.structure.places import side_of
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort
from hfg.studio.conditions import COMPARISONS
from hfg.studio.places import place_at
from hfg.studio.refusing import Refused
from hfg.types import describe

__all__ = ["edge_options", "gates", "operators", "promotions", "stops"]


# --- gates ---


def gates(graph: Graph, path: str) -> dict[str, Any]:
    """Return which nodes can open and close the gate of a node: itself, its neighbours, then all others.

    Raises:
      GraphError: there is no such node.
    """
    root = level_of(graph)
    node = node_at(root, path)
    home = level_of(node.place.graph)
    now = next((gate for level in root.walk() for gate in level.gates if gate.target is node), None)
    idle = None if now is None else now.idle_rate_hz
    undone: list[c.Command] = [] if now is None else [c.Ungate(path)]

    def commands(by: Node, rate: float | None) -> Any:
        return msgspec.to_builtins([*undone, c.Gate(path, by.place.path, rate)])

    rows = [{"path": one.place.path, "commands": commands(one, idle)} for one in _could_gate(root, home, node)]
    return {
        "by": "" if now is None else now.by.place.path,
        "rows": rows,
        "none": msgspec.to_builtins(undone),
        "idle_rate_hz": idle,
    }


def _could_gate(root: Level, home: Level, node: Node) -> Iterator[Node]:
    yield node
    yield from (one for one in home.nodes.values() if one is not node)
    side = side_of(home)
    for level in root.walk():
        if level is not home and side_of(level) is side:
            yield from level.nodes.values()


# --- promotions ---


def promotions(graph: Graph, path: str) -> list[dict[str, Any]]:
    """Return for each parameter of a node which parameters of the subgraph around can stand for it, and which does.

    Raises:
      GraphError: there is no such node.
    """
    node = node_at(level_of(graph), path)
    around = level_of(node.place.graph)
    if around.owner is None:
        return []
    standing = {inner: name for name, inners in around.promotions.by_name.items() for inner in inners}
    found = []
    for inner in node.ports.parameters.values():
        name = standing.get(inner)
        outers = around.owner.ports.parameters
        undone: list[c.Command] = [] if name is None else [c.Promote(outers[name].path, inner.path, promoted=False)]
        rows = [_promotion(around, outer, inner, undone) for outer in outers.values()]
        found.append({"name": inner.name, "by": name or "", "none": msgspec.to_builtins(undone), "rows": rows})
    return found


def _promotion(
    around: Level, outer: ParameterPort[Any], inner: ParameterPort[Any], undone: list[c.Command]
) -> dict[str, Any]:
    message = ""
    if not undone:  # one that stands already is refused, and taken back first
        try:
            refuse_promotion(around, outer, inner)
        except GraphError as error:
            message = str(error)
    commands = [*undone, c.Promote(outer.path, inner.path)]
    return {"name": outer.name, "message": message, "commands": msgspec.to_builtins(commands)}


# --- edges ---


def edge_options(graph: Graph, key: str, *, runs: bool) -> dict[str, Any]:
    """Return the options that an edge can have, as parameters of a node are described, with their values.

    An edge of a run keeps its options, because tokens may lie on it. `anew` are commands that put another edge in its
    place; the last of them takes the option that is to be otherwise.

    Raises:
      GraphError: there is no such edge.
    """
    edge = place_at(graph, key)
    if not isinstance(edge, Edge):
        raise Refused("unknown", f'"{key}" is no edge', key)
    signal = is_feed(edge.source) or edge.source.kind in ("event", "slot")
    never = "data" if signal else "events"
    try:
        said: dict[str, Any] = msgspec.to_builtins(edge_as_data(edge, encode))
        why = ""
    except GraphError as error:  # operators without a name, values that are not data
        said, why = {}, str(error)
    known = (one for one in declared(EdgeOptions).values() if one.name != "active" and one.option.only != never)
    ends = {"source": end_path(edge.source), "target": end_path(edge.target)}
    can = runs and not why and not is_feed(edge.source)
    anew = [{"do": "Disconnect", **ends}, {"do": "Connect", **ends, **said}] if can else []
    return {"options": [_option(one, edge, said, why) for one in known], "anew": anew}


def _option(one: Declared, edge: Edge, said: dict[str, Any], why: str) -> dict[str, Any]:
    is_list = one.name in ("initial", "through")
    choices = list(get_args(one.type)) if get_origin(one.type) is Literal else None
    kind = "choice" if choices else "operators" if one.name == "through" else "int" if one.type is int else "data"
    value = said.get(one.name, [] if is_list else getattr(edge.options, one.name))
    doc = one.option.says + (f" Each is {describe(type_of(edge.target))}." if one.name == "initial" else "")
    return {
        "name": one.name,
        "kind": kind,
        "type": one.expects,
        "doc": doc,
        "default": [] if is_list else one.default,
        "required": False,
        "limits": None,
        "low": one.option.least,
        "high": one.option.most,
        "choices": choices,
        "labels": [],
        "unit": one.unit or None,
        "step": None,
        "group": None,
        "read_only": is_list and why != "",
        "value": value,
        "why": why if is_list else "",
    }


# --- operators ---


_PASS_ON: Final = ("debounce", "throttle_first", "sample", "delay", "skip", "take", "skip_with_time", "take_with_time")
"""Operators of reactivex that send the tokens that they get, and are given numbers."""

_LEFT_OUT: Final = ("scheduler",)
_WORDS: Final = {int: "int", float: "float", bool: "bool", str: "text"}


def operators(graph: Graph) -> list[dict[str, Any]]:
    """Return the operators that have a name: those of the graph's modules, and some of reactivex."""
    modules = sorted({node._type.module for level in level_of(graph).walk() for node in level.nodes.values()})
    found: list[dict[str, Any]] = []
    for module in modules:
        every = vars(sys.modules.get(module, object)).values()
        own = [one for one in every if isinstance(one, OperatorFunction) and one.module == module and one.reference]
        found += [_operator(str(one.reference), one.name, one._function, one.__doc__) for one in own]
    for name in _PASS_ON:
        function = getattr(reactive, name)
        found.append(_operator(f"reactivex.operators:{name}", name, function, function.__doc__))
    return found


def _operator(reference: str, name: str, function: Any, doc: str | None) -> dict[str, Any]:
    try:
        hints = typing.get_type_hints(function)
    except Exception:  # names in annotations of others that do not exist at run time
        hints = {}
    given = [
        _given(one, hints.get(one.name, one.annotation))
        for one in inspect.signature(function).parameters.values()
        if one.name not in _LEFT_OUT and one.kind is one.POSITIONAL_OR_KEYWORD
    ]
    summary = inspect.cleandoc(doc or "").partition("\n\n")[0].replace("\n", " ")
    return {
        "reference": reference,
        "name": name,
        "summary": summary,
        "parameters": [one for one in given if one["required"] or one["kind"] != "data"],
    }


def _given(one: inspect.Parameter, hint: Any) -> dict[str, Any]:
    kinds = get_args(hint) or (hint,)
    required = one.default is one.empty
    kind = next((word for plain, word in _WORDS.items() if plain in kinds), "data")
    return {"name": one.name, "kind": kind, "required": required, "default": None if required else one.default}


# --- breakpoints ---


def stops(graph: Graph, path: str) -> dict[str, Any]:
    """Return what a condition of a breakpoint can be made of; none can be set at a node, where nothing is sent.

    Raises:
      GraphError: there is no such place.
    """
    place = place_at(graph, path)
    if isinstance(place, Node):
        return {"comparisons": [], "parts": []}
    hint = type_of(place.source if isinstance(place, Edge) else place)
    return {"comparisons": list(COMPARISONS), "parts": _parts(hint)}


def _parts(hint: Any) -> list[str]:
    """Return the names of the fields of a record."""
    try:
        return list(typing.get_type_hints(hint)) if isinstance(hint, type) and hasattr(hint, "__annotations__") else []
    except NameError:
        return []

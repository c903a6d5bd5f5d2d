"""Connecting: every reason to refuse an edge at once (rules P1-P9, G1, G4), and declaring one that may be.

Problems that only show once ports of subgraphs are followed from end to end (two edges into one input, a queue on an
edge that turns out to be synchronous) are found by the check. Depends on levels, edges, types and options.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NoReturn

from reactivex import Observable

from hfg import errors
from hfg.base.token import Token
from hfg.graph.structure.edge import Edge, PortEnd, SourceEnd, TargetEnd, end_path, is_port, type_of
from hfg.graph.structure.given import edge_options
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.options import PLAIN, EdgeGiven, EdgeOptions
from hfg.graph.structure.paths import source_at, target_at
from hfg.graph.structure.refusals import Refusable
from hfg.graph.structure.subgraph import is_box, iterated
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, OutputPort, Port, PortVector, Source, Target
from hfg.ports.observable import RunObservable
from hfg.types import accepts, describe, why_not

_SYNCHRONOUS: Final = ("output", "parameter")


def connect(level: Level, source: SourceEnd | str, target: TargetEnd | str, said: EdgeGiven) -> Edge:
    """Declare an edge; see `Graph.connect`, whose options `said` holds by name.

    Raises:
      ConnectionError: the edge cannot be; nothing was changed.
      GraphError: a path leads nowhere.
    """
    edge: Edge | None = None
    with Refusable(source, target):
        begin = source_at(level, source) if isinstance(source, str) else source
        end = target_at(level, target) if isinstance(target, str) else target
        edge = declare_edge(_level_for(level, begin, end), begin, end, said)
    return Edge(source, target, PLAIN) if edge is None else edge  # something to go on with, where refusals are kept


def _level_for(level: Level, source: SourceEnd, target: TargetEnd) -> Level:
    """Return the level to which an edge belongs.

    `graph.start.activates(...)` inside a subgraph asks the whole graph, whose port it is: the edge belongs where its
    node is (rule A10).
    """
    if source is not level.ports.start:
        return level
    home = getattr(target, "graph", None)
    if home is None or home is level.face or level_of(home).whole is not level.whole:
        return level
    return level_of(home)


def declare_edge(level: Level, source: SourceEnd, target: TargetEnd, said: Mapping[str, Any]) -> Edge:
    """Add an edge that may be to a level.

    Raises:
      ConnectionError: it cannot be; nothing was changed.
    """
    level.need_rest("connecting")
    options = edge_options(lambda: f'"{end_path(source)}" -> "{end_path(target)}"', said)
    refuse(level, source, target, options)
    level.connections.refuse_second(source, target)
    edge = Edge(source, target, options)
    level.connections.append(edge)
    return edge


def refuse(level: Level, source: SourceEnd, target: TargetEnd, options: EdgeOptions) -> None:
    """Raise if the edge cannot be; changes nothing.

    Raises:
      ConnectionError: naming both ends, what was expected and found, and what to do.
    """
    _need_ends(source, target)
    if is_port(source):
        _need_membership(level, source, target)
    _need_membership(level, target, source)
    if target.kind == "parameter":
        _need_settable(source, target)
    if is_port(source):
        _need_types(source, target)
    if options is not PLAIN:
        _need_right_options(source, target, options)
        if options.initial:
            _need_initial(source, target, options.initial)
        _need_data(source, target, options)
    if isinstance(target, InnerTarget):
        _need_same_manner(source, target)
    if is_box(target.node) or is_box(getattr(source, "node", None)):
        _need_passable(source, target, options)


# --- ends ---


def _need_ends(source: SourceEnd, target: TargetEnd) -> None:
    if not isinstance(source, Source) and not isinstance(source, Observable):
        _wrong_end(
            source,
            "source",
            "an output, event or parameter",
            swap=isinstance(source, Target) and isinstance(target, Source),
        )
    if not isinstance(target, Target):
        _wrong_end(target, "target", "an input, slot or parameter", swap=False)


def _wrong_end(found: object, role: str, expected: str, *, swap: bool) -> NoReturn:
    if isinstance(found, Port | InnerSource | InnerTarget):
        what = (
            f'"{found.path}", which is an {found.kind}'
            if found.kind[0] in "aeiou"
            else f'"{found.path}", which is a {found.kind}'
        )
        if isinstance(found, InnerSource | InnerTarget):
            what += " seen from inside"
        other = "exchange the two" if swap else "name a port of the other direction"
        remedy = f"edges go from outputs and events to inputs and slots: {other}"
        if isinstance(found, Port) and is_box(found.node):
            remedy += f', or inside the subgraph use its inner side, "{found.path}.inner"'
    elif isinstance(found, Node):
        place = found._place
        what = f'the node "{place.path if place else found._type.name}"'
        remedy = "name one of its ports, as in node.out, or connect nodes with >>"
    elif isinstance(found, PortVector):
        what = repr(found)
        remedy = f'name one of them, as in "{found.path}[0]"'
    elif getattr(type(found), "kind", None) is not None:  # Input, Output, ... as declared in a class body
        what = f"{found!r}, the declaration in the class"
        remedy = "use the port of a node: node = graph.add(...), then node.port"
    else:
        what = repr(found)
        remedy = (
            "name a port, as in node.out; "
            'node.name of a parameter is its value, its port is node.ports.parameters["name"]'
        )
    raise errors.ConnectionError(f"the {role} of an edge must be {expected}, got {what}; {remedy}")


def _need_membership(level: Level, end: PortEnd, other: SourceEnd | TargetEnd) -> None:
    """Refuse an end that does not belong to the level; `other` is the other end."""
    home = end.graph
    if home is level.face:
        return
    if isinstance(end, InnerSource | InnerTarget):
        raise _inner_side_elsewhere(level, end)
    if home is None:
        raise errors.ConnectionError(
            f'"{end.path}" belongs to no graph: add its node to {level.title} with graph.add(...) before connecting '
            f'"{end_path(other)}"'
        )
    if not level.ports.has(end):
        raise _port_elsewhere(level, end)


def _inner_side_elsewhere(level: Level, end: InnerSource[Any] | InnerTarget[Any]) -> errors.ConnectionError:
    if end.outer.node.place.graph is level.face:
        return errors.ConnectionError(
            f'"{end.path}" is the side inside the subgraph and cannot be connected outside of it; '
            f'use "{end.outer.path}", or connect in build()'
        )
    return errors.ConnectionError(
        f'"{end.path}" belongs to {level_of(end.graph).title}, not to {level.title}; connect it there, in build()'
    )


def _port_elsewhere(level: Level, end: Port) -> errors.ConnectionError:
    if level.owner is not None and end.node is level.owner:
        return errors.ConnectionError(
            f'"{end.path}" is the side outside the subgraph and cannot be connected in its own graph; '
            + (
                f"use graph.promote(self.{end.name}, node.ports.parameters[...])"
                if end.kind == "parameter"
                else f'use "{end.path}.inner"'
            )
        )
    home = level_of(end.graph)
    if home.whole is not level.whole:
        return errors.ConnectionError(
            f'"{end.path}" belongs to {home.title}, not to {level.title}; '
            "an edge stays in one graph: add both nodes to the same, or link two runs"
        )
    return errors.ConnectionError(
        f'"{end.path}" belongs to {home.title}, not to {level.title}; '
        "connect it there, or lead it over the border with a port of the subgraph and its .inner"
    )


# --- types ---


def _need_types(source: PortEnd, target: TargetEnd) -> None:
    sent, taken = type_of(source), type_of(target)
    reason = why_not(sent, taken)
    if reason is None:
        return
    raise errors.ConnectionError(
        f'port types do not fit: "{target.path}" expects {describe(taken)}, '
        f'"{source.path}" sends {describe(sent)} ({reason}); '
        "put a node between them that converts, or change one of the types",
        path=target.path,
        expected=describe(taken),
        sent=describe(sent),
        reason=reason,
    )


def _need_settable(source: SourceEnd, target: TargetEnd) -> None:
    kind = target.node._type
    if kind.parameters[target.name].read_only:
        raise errors.ConnectionError(
            f'"{end_path(source)}" cannot lead into the parameter "{target.path}", which is read-only: only its node '
            "sets it; let an edge begin there, or declare it without read_only=True (rule P8)"
        )
    if kind.given_parameters_once:
        raise errors.ConnectionError(
            f'"{target.path}" belongs to a generator function, which is given it when it begins and sees no value '
            f'that comes later, from "{end_path(source)}"; make it a class whose process() yields, or counts in an '
            f"hfg.State, and reads self.{target.name} (rule P8)"
        )


# --- options ---


def _need_right_options(source: SourceEnd, target: TargetEnd, options: EdgeOptions) -> None:
    between = f'"{end_path(source)}" -> "{target.path}"'
    if options.active:
        if options.overflow != "wait":
            raise errors.ConnectionError(
                f'{between}: an active edge loses nothing, got overflow="{options.overflow}"; '
                'use overflow="wait", or an edge that is not active (rule P5)'
            )
        if options.through or (isinstance(source, RunObservable) and not isinstance(source, Port)):
            raise errors.ConnectionError(
                f"{between}: operators may hold or drop signals, so the edge cannot be active; "
                "leave out active=True, or the operators (rule P9)"
            )
    said = options.first_said("events")
    if said is not None and isinstance(source, Port) and source.kind in _SYNCHRONOUS:
        event = "send by an event"
        if isinstance(source, OutputPort) and not is_box(source.node):
            event = f'let the edge begin at the event beside it, "{source.path}.sent"'
        raise errors.ConnectionError(
            f"{between}: {said} is for edges from events, "
            f'"{source.path}" is {"an output" if source.kind == "output" else "a parameter"}, '
            f"whose edges hold one token and no queue; leave it out, or {event} (rule P4)"
        )


def _need_initial(source: SourceEnd, target: TargetEnd, initial: tuple[Any, ...]) -> None:
    between = f'"{end_path(source)}" -> "{target.path}"'
    # Where a relay leads is for the check to see.
    is_relay = is_box(target.node) and target.name in target.node._type.slots
    if target.kind == "slot" and not is_relay:
        raise errors.ConnectionError(
            f"{between}: initial tokens are for edges into inputs; "
            "leave out initial=[...], or connect to an input (rule P7)"
        )
    if target.kind == "parameter" and getattr(source, "kind", None) not in _SYNCHRONOUS:
        raise errors.ConnectionError(
            f"{between}: an event edge into a parameter holds no initial tokens; "
            f"give the node the value, as in {type(target.node).__name__}({target.name}=...)"
        )
    expected = type_of(target)
    for value in initial:
        if isinstance(value, Token):
            raise errors.ConnectionError(
                f"{between}: initial takes values, got {value!r}; "
                "initial tokens have no modifier and the stamp of the start (rule P7)"
            )
        if not accepts(value, expected):
            raise errors.ConnectionError(
                f"{between}: an initial value must be of type {describe(expected)}, got {value!r}"
            )


def _need_data(source: SourceEnd, target: TargetEnd, options: EdgeOptions) -> None:
    """Refuse what only edges from outputs into inputs can have; where a relay leads is for the check to see."""
    said = options.first_said("data")
    if said is None:
        return
    between = f'"{end_path(source)}" -> "{target.path}"'
    if not is_port(source) or source.kind == "event":
        raise errors.ConnectionError(
            f"{between}: {said} is for edges from outputs, and signals wait in a queue anyway; "
            "say how long it is by capacity=... (rules P4, P5)"
        )
    is_relay = is_box(target.node) and target.name in target.node._type.slots
    if target.kind == "slot" and not is_relay:
        raise errors.ConnectionError(
            f"{between}: {said} is for edges into inputs; "
            "leave it out, or send by an event, whose edge has a queue (rules P4, F6)"
        )


# --- subgraphs ---


def _need_same_manner(source: SourceEnd, target: TargetEnd) -> None:
    """Refuse to change between synchronous and asynchronous at the border.

    Else the queue that an event has outside would belong to a synchronous edge.
    """
    asynchronous = getattr(source, "kind", "event") in ("event", "slot")
    if asynchronous == (target.kind == "event"):
        return
    found, fit = ("an event", "hfg.Event") if asynchronous else ("synchronous", "hfg.Output")
    raise errors.ConnectionError(
        f'"{target.path}" is the subgraph\'s {target.kind}, but "{end_path(source)}" is {found}; '
        f"declare {target.name} as {fit} (rule G1)"
    )


def _need_passable(source: SourceEnd, target: TargetEnd, options: EdgeOptions) -> None:
    """Rule G4: what iterates takes collections in and gives lists out, and nothing else crosses its border."""
    between = f'"{end_path(source)}" -> "{target.path}"'
    for end in (source, target):
        # Inside nothing is refused: a relay without an edge on the other side is no edge at all (rule G1).
        if not isinstance(end, Port) or not iterated(end.node):
            continue
        kind = end.node._type
        names = {"slot": kind.slots, "event": kind.events}.get(end.kind, ())
        if end.name in names:
            raise errors.ConnectionError(
                f'{between}: "{end.node.place.path}" iterates, so signals cannot cross its border; '
                "use inputs and outputs, or take iterate_over out (rule G4)"
            )
    if not iterated(target.node) or isinstance(target, InnerTarget) or target.kind == "slot":
        return
    if options.active:
        raise errors.ConnectionError(
            f'{between}: "{target.node.place.path}" iterates, so no activity can go into it; '
            "leave out active=True, or take iterate_over out (rule G4)"
        )
    if getattr(source, "kind", "event") == "event":
        raise errors.ConnectionError(
            f'{between}: "{target.node.place.path}" iterates and takes no signals; '
            "let a node take them and give the collection by an output (rule G4)"
        )

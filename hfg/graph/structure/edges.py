"""Edges as they were drawn, and every reason to refuse one at once (rules P1-P9, G1, G4).

What only shows once relays are followed from end to end (two edges into one input, a queue on what turns out to be
synchronous) is found by the check. Stands on ports, types and options; looks at graphs and never changes them.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final, NoReturn

import msgspec
from reactivex import Observable

from hfg import errors
from hfg.graph.structure.boxes import is_box, iterated
from hfg.graph.structure.options import EdgeOptions, Overflow
from hfg.nodetype import Node
from hfg.ports import InnerSource, InnerTarget, Port, Source, Target
from hfg.ports.observable import RunObservable
from hfg.token import Token
from hfg.types import accepts, describe, why_not

__all__ = ["Edge", "end_path", "is_feed", "is_single", "refuse", "type_of"]

_SYNCHRONOUS: Final = ("output", "parameter")


class Edge(msgspec.Struct, frozen=True, eq=False):
    """One edge of one graph, before subgraphs are dissolved.

    Attributes:
      source: an output, event, parameter or inner side; or a plain reactivex observable, a feed from outside.
      target: an input, slot, parameter or inner side.
      options: shared with all edges that have the same.
    """

    source: Any
    target: Any
    options: EdgeOptions

    @property
    def active(self) -> bool:
        """A(e) of the paper: whether it also transports activity."""
        return self.options.active

    @property
    def capacity(self) -> int:
        """How many untaken signals its queue holds; for event edges."""
        return self.options.capacity

    @property
    def overflow(self) -> Overflow:
        """What happens to more of them."""
        return self.options.overflow

    @property
    def label(self) -> str:
        """Its ends, "a.out -> b.in"."""
        return f"{end_path(self.source)} -> {end_path(self.target)}"

    def __repr__(self) -> str:
        return f"<{'active edge' if self.active else 'edge'} {self.label}>"


def end_path(end: Any) -> str:
    """Give the path of a port; an observable from outside has none."""
    path = getattr(end, "path", None) if isinstance(end, Source | Target) else None
    return path if isinstance(path, str) else "observable"


def is_feed(end: object) -> bool:
    """Whether it is a plain observable, which feeds from outside; an event is one too, but a port."""
    return not isinstance(end, Source | Target)


def is_single(target: Any) -> bool:
    """Whether at most one edge may lead into it (rule P2): inputs and parameters.

    A subgraph's output seen from inside is a relay, at which streams may converge on their way into a slot (rule G1);
    that no input gets two edges so is seen by the check. What iterates makes one list of each output (rule G4).
    """
    return target.kind in ("input", "parameter") or (target.kind == "output" and bool(iterated(target.node)))


def refuse(graph: Any, source: Any, target: Any, options: EdgeOptions) -> None:
    """Raise if the edge cannot be; changes nothing.

    Raises:
      ConnectionError: naming both ends, what was expected and found, and what to do.
    """
    _need_ends(source, target)
    if not is_feed(source):
        _need_membership(graph, source, target)
    _need_membership(graph, target, source)
    if not is_feed(source):
        _need_types(source, target)
    if options.active or options.for_events:
        _need_right_options(source, target, options)
    if options.initial:
        _need_initial(source, target, options.initial)
    if isinstance(target, InnerTarget):
        _need_same_manner(source, target)
    if is_box(target.node) or is_box(getattr(source, "node", None)):
        _need_passable(source, target, options)


# --- ends ---


def _need_ends(source: Any, target: Any) -> None:
    if not isinstance(source, Source) and not isinstance(source, Observable):
        _wrong_end(
            source,
            "source",
            "an output, event or parameter",
            swap=isinstance(source, Target) and isinstance(target, Source),
        )
    if not isinstance(target, Target):
        _wrong_end(target, "target", "an input, slot or parameter", swap=False)


def _wrong_end(found: Any, role: str, expected: str, *, swap: bool) -> NoReturn:
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


def _need_membership(graph: Any, end: Any, other: Any) -> None:
    home: Any = end.graph
    path: str = end.path
    if isinstance(end, InnerSource | InnerTarget):
        if home is graph:
            return
        if end.outer.node.place.graph is graph:
            raise errors.ConnectionError(
                f'"{path}" is the side inside the subgraph and cannot be connected outside of it; '
                f'use "{end.outer.path}", or connect in build()'
            )
        raise errors.ConnectionError(
            f'"{path}" belongs to {home._title}, not to {graph._title}; connect it there, in build()'
        )
    if home is graph:
        return
    if home is None:
        raise errors.ConnectionError(
            f'"{path}" belongs to no graph: add its node to {graph._title} with graph.add(...) before connecting '
            f'"{end_path(other)}"'
        )
    if any(end is port for port in (graph.start, graph.stop, graph.abort)):
        return  # the whole graph's, wherever it is named (rule A10)
    if graph._owner is not None and end.node is graph._owner:
        raise errors.ConnectionError(
            f'"{path}" is the side outside the subgraph and cannot be connected in its own graph; '
            + (
                f"use graph.promote(self.{end.name}, node.ports.parameters[...])"
                if end.kind == "parameter"
                else f'use "{path}.inner"'
            )
        )
    if home._root is not graph._root:
        raise errors.ConnectionError(
            f'"{path}" belongs to {home._title}, not to {graph._title}; '
            "an edge stays in one graph: add both nodes to the same, or link two runs"
        )
    raise errors.ConnectionError(
        f'"{path}" belongs to {home._title}, not to {graph._title}; '
        "connect it there, or lead it over the border with a port of the subgraph and its .inner"
    )


# --- types ---


def type_of(end: Any) -> Any:
    """Give the type that an edge meets; outside what iterates, collections of what is declared (rule G4)."""
    names = iterated(end.node)
    if not names or isinstance(end, InnerSource | InnerTarget):
        return end.type
    if end.kind == "input":
        return Collection[end.type] if end.name in names else end.type
    return list[end.type] if end.kind == "output" else end.type


def _need_types(source: Any, target: Any) -> None:
    sent, taken = type_of(source), type_of(target)
    reason = why_not(sent, taken)
    if reason is None:
        return
    raise errors.ConnectionError(
        f'port types do not fit: "{target.path}" expects {describe(taken)}, '
        f'"{source.path}" sends {describe(sent)} ({reason}); '
        "put a node between them that converts, or change one of the types"
    )


# --- options ---


def _need_right_options(source: Any, target: Any, options: EdgeOptions) -> None:
    said = options.for_events
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
    if said is not None and getattr(source, "kind", None) in _SYNCHRONOUS and not isinstance(source, InnerSource):
        raise errors.ConnectionError(
            f"{between}: {said} is for edges from events, "
            f'"{source.path}" is {"an output" if source.kind == "output" else "a parameter"}, '
            "whose edges hold one token and no queue; leave it out, or send by an event (rule P4)"
        )


def _need_initial(source: Any, target: Any, initial: tuple[Any, ...]) -> None:
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


# --- subgraphs ---


def _need_same_manner(source: Any, target: Any) -> None:
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


def _need_passable(source: Any, target: Any, options: EdgeOptions) -> None:
    """Rule G4: what iterates takes collections in and gives lists out, and nothing else crosses its border."""
    between = f'"{end_path(source)}" -> "{target.path}"'
    for end in (source, target):
        owner = getattr(end, "node", None)
        # Inside nothing is refused: a relay without an edge on the other side is no edge at all (rule G1).
        if not is_box(owner) or not iterated(owner) or isinstance(end, InnerSource | InnerTarget):
            continue
        names = {"slot": owner._type.slots, "event": owner._type.events}.get(end.kind, ())
        if end.name in names:
            raise errors.ConnectionError(
                f'{between}: "{owner._place.path}" iterates, so signals cannot cross its border; '
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

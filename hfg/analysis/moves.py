"""What each node may do: the moves of the token game, from its code and its automatic ports (rules A3-A5, A9, A15).

Code is read by `reading.read`. Or it is not read at all, by `unread`: then each node may send anything, which takes no
time, and leaves nothing out. Depends on the flat graph, `bags` and `words`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from hfg.analysis.bags import MANY, NOTHING, Bag, Code, Handler, Sent, parts_of
from hfg.analysis.rules import Kind
from hfg.analysis.surroundings import ending
from hfg.analysis.words import sets_modifiers
from hfg.graph.checks.flow import never_fires, never_triggered
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, FlatNode
from hfg.nodetypes.node import NodeType
from hfg.ports.automatic import sent_of

__all__ = ["Doing", "Move", "Moves", "unread"]

Reader: TypeAlias = Callable[[NodeType, frozenset[str]], Code]
"""What returns the sendings of a node type over certain ports."""


@dataclass(frozen=True, slots=True)
class Move:
    """One thing that a node may do.

    Attributes:
      kind: what happens.
      text: the same in words, to be completed by path and ports.
      bags: what leaves in one step: one of these.
      right: more may leave later in the same firing or call, by the right of A3.
      gated: it happens only while the node's gates are open (rule A11).
      slot: the slot that is called; "" for others, and if the call is not over in one step.
    """

    kind: Kind
    text: str
    bags: tuple[Bag, ...]
    right: bool = False
    gated: bool = False
    slot: str = ""


@dataclass(frozen=True, slots=True)
class Doing:
    """All that a node may do.

    Attributes:
      moves: one by one.
      unknown: the handlers that could not be read, and why.
      carries: the ports over which its activity may leave.
      makes: those over which it may send +1 without being active (rule A4).
      says: it may send modifiers of its own.
    """

    moves: tuple[Move, ...]
    unknown: tuple[tuple[str, str], ...]
    carries: frozenset[str]
    makes: frozenset[str]
    says: bool


class _Situation(NamedTuple):
    """All that the moves of a node depend on besides its type."""

    ports: frozenset[str]
    is_still: bool
    ends: bool
    in_threads: bool
    stops: bool
    iterates: bool


def unread(kind: NodeType, ports: frozenset[str]) -> Code:
    """Return the code of a type as if nothing were known of it but its ports."""
    modifiers = (None, 1, -1) if sets_modifiers(kind) else (None,)
    outputs = frozenset(
        frozenset({((name, one), MANY)}) for name in ports.intersection(kind.outputs) for one in modifiers
    )
    events = frozenset((name, one) for name in ports.difference(kind.outputs) for one in modifiers)
    fires = kind.process_kind != "none"
    return Code(firing=Handler(outputs | {NOTHING}, False) if fires else None, outside=events)


class Moves:
    """The moves of each node over active edges.

    Args:
      flat: the graph.
      read: reads the code of node types.
    """

    def __init__(self, flat: FlatGraph, read: Reader) -> None:
        self.still = never_fires(flat)
        self._flat = flat
        self._read = read
        self._ports: dict[int, frozenset[str]] = {}
        for edge in flat.edges:
            if edge.active and _may_send(flat, edge):
                end = edge.source.node
                self._ports[end] = _with(self._ports.get(end, frozenset()), edge.source.name)
        self._known: dict[tuple[NodeType, _Situation], Doing] = {}
        self._of: dict[int, Doing] = {}

    @functools.cached_property
    def _ending(self) -> set[int]:
        return ending(self._flat)

    def ports_of(self, end: int) -> frozenset[str]:
        """Return the ports of a node or subgraph from which something may be sent over active edges."""
        return self._ports.get(end, frozenset())

    def of(self, node: FlatNode) -> Doing:
        """Return what a node may do. Nodes of one type in the same situation may do the same."""
        found = self._of.get(node.index)
        if found is None:
            key = (node.node._type, self._situation(node))
            found = self._known.get(key)
            if found is None:
                found = self._known[key] = _doing(*key, self._read)
            self._of[node.index] = found
        return found

    def _situation(self, node: FlatNode) -> _Situation:
        group = self._flat.groups.get(node.options.group or "loop")
        ports = self.ports_of(node.index)
        return _Situation(
            ports,
            is_still=node.index in self.still,
            ends=not ports.isdisjoint(node.node._type.outputs) and node.index in self._ending,
            in_threads=group is not None and bool(group.threads),
            stops=node.options.on_error == "stop",
            iterates=node.iteration is not None,
        )


@functools.lru_cache(maxsize=4096)
def _with(names: frozenset[str], name: str) -> frozenset[str]:
    """The same set of names for many nodes takes less memory, and time to compare."""
    return names | {name}


def _may_send(flat: FlatGraph, edge: FlatEdge) -> bool:
    """Whether anything may leave over an edge, that is not only told of activity that has left."""
    source = edge.source
    if source.kind == "event" and source.node != ROOT:
        is_own = source.name in source.port.node._type.events
        return is_own or (source.name != "deactivated" and never_triggered(flat, edge) is None)
    return True


def _doing(kind: NodeType, situation: _Situation, read: Reader) -> Doing:
    ports = situation.ports
    own = frozenset(port for port in ports if port in kind.outputs or port in kind.events)
    parameters = frozenset(port for port in ports if port in kind.parameters and port not in own)
    code = read(kind, own)
    moves = (
        *_of_firings(code, parameters, situation),
        *_of_calls(code, situation),
        *(_alone('"{path}" sends {ports}', "sends", sent) for sent in sorted(code.outside, key=repr)),
        *_automatic(ports.difference(own, parameters), situation),
        *_of_the_end(own.intersection(kind.outputs), situation),
    )
    unknown = tuple(code.unknown())
    if situation.iterates:
        unknown += (("its inside", "it iterates, and the analysis does not go inside"),)
    sent = {one for move in moves for bag in move.bags for one, _ in bag}
    return Doing(
        moves,
        unknown,
        carries=frozenset(port for port, modifier in sent if modifier != -1),
        makes=own if situation.iterates else frozenset(port for port, modifier in sent if modifier == 1),
        says=situation.iterates or any(modifier for _, modifier in sent),
    )


def _of_firings(code: Code, parameters: frozenset[str], situation: _Situation) -> Iterator[Move]:
    firing = code.firing
    if firing is not None and parameters:
        firing = Handler(firing.bags | {frozenset({((port, None), MANY)}) for port in parameters}, False)
    if firing is not None and not situation.is_still:
        yield from _handled(firing, "fires", '"{path}" fires and sends {ports}', situation, gated=True)
    if code.ending is not None:
        yield from _handled(code.ending, "fires", '"{path}" fires and sends {ports}', situation)


def _of_calls(code: Code, situation: _Situation) -> Iterator[Move]:
    for name, handler in code.slots.items():
        text = f'"{{path}}.{name}" is called and sends {{ports}}'
        yield from _handled(handler, "is called", text, situation, slot=name)


def _handled(
    handler: Handler, kind: Kind, text: str, situation: _Situation, *, gated: bool = False, slot: str = ""
) -> Iterator[Move]:
    """The moves of a handler: each bag leaves in one step, or each sending does, and other nodes work in between."""
    if handler.whole and not situation.in_threads:
        yield Move(kind, text, tuple(_cases(handler.bags, situation)), gated=gated, slot=slot)
        return
    for sent in sorted(handler.sent, key=repr):
        right = handler.sends_several
        yield Move("sends", '"{path}" sends {ports}', (frozenset({(sent, 1)}),), right=right, gated=gated)


def _cases(bags: frozenset[Bag], situation: _Situation) -> Iterable[Bag]:
    """The bags. If the run survives errors, also their parts."""
    if situation.stops:
        return bags
    return {part for bag in bags for part in parts_of(bag)}


def _alone(text: str, kind: Kind, sent: Sent, *, gated: bool = False) -> Move:
    """A sending of its own."""
    return Move(kind, text, (frozenset({(sent, 1)}),), gated=gated)


def _automatic(ports: frozenset[str], situation: _Situation) -> Iterator[Move]:
    """Automatic events that carry activity on; each is a sending of its own (rule A9)."""
    for port in sorted(ports):
        by_firings = port == "processed" or sent_of(port) is not None
        if port == "timeout":
            yield _alone('"{path}" times out', "times out", (port, None))
        elif not (by_firings and situation.is_still):
            yield _alone(f'"{{path}}" sends {port}', "sends", (port, None), gated=by_firings or port == "failed")


def _of_the_end(outputs: frozenset[str], situation: _Situation) -> Iterator[Move]:
    """END leaves on all outputs at once, and carries activity (rule F4)."""
    if outputs and situation.ends and not situation.is_still:
        yield Move("fires", '"{path}" ends', (frozenset(((port, None), 1) for port in outputs),))

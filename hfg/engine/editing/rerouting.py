"""Finds what a change of a few drawn edges means to the plan, without looking at the rest (rules R4, G1).

All edges of the flat graph that begin with one drawn edge stand side by side; only those blocks are followed anew that
a change can have touched. Where more than that may have changed the answer is None. Decides only. Stands on `graph`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import msgspec

from hfg.engine.model.core import Core
from hfg.graph import Graph
from hfg.graph.editing.changes import Change, EdgeChange, EdgeSwap, OptionsChange, ParameterChange
from hfg.graph.flat import EdgeFollower, FlatEdge, FlatGraph
from hfg.graph.structure.edge import Edge, is_feed, type_of
from hfg.graph.structure.level import level_of
from hfg.ports import InnerSource
from hfg.types import why_not

__all__ = ["Rerouting", "reroute"]


class Rerouting(msgspec.Struct, eq=False):
    """What changes.

    Attributes:
      edges: running edges that stay, with what is said about them from now on.
      lost: running edges that go.
      new: edges that come, in order.
      spots: before which edge of the flat graph as it is each of them comes.
    """

    edges: list[tuple[Any, FlatEdge]] = []
    lost: list[Any] = []
    new: list[FlatEdge] = []
    spots: list[int] = []


def reroute(core: Core, flat: FlatGraph, changes: Sequence[Change]) -> Rerouting | None:
    """Find what changes mean that only touch edges, parameters and what is enabled; None for all others."""
    drawn: dict[Edge, bool] = {}  # whether it is there now
    before: dict[Edge, Edge] = {}  # which edge it stands for
    rubbed_out: set[Edge] = set()
    for change in changes:
        if isinstance(change, EdgeChange) and change.for_good and not is_feed(change.edge.source):
            drawn[change.edge] = change.added
            if not change.added:
                rubbed_out.add(change.edge)
        elif isinstance(change, EdgeSwap) and _same_ends(change.old, change.new):
            drawn[change.old], drawn[change.new] = False, True
            before[change.new] = before.pop(change.old, change.old)
        elif isinstance(change, OptionsChange) and change.before.group == change.after.group:
            continue
        elif not isinstance(change, ParameterChange):
            return None
    if not drawn:
        return Rerouting()
    return _Blocks(core, flat, drawn, before, rubbed_out).compare()


def _same_ends(old: Edge, new: Edge) -> bool:
    return (old.source, old.target) == (new.source, new.target)


class _Blocks:
    """The edges of the flat graph by the drawn edge they begin with."""

    def __init__(
        self, core: Core, flat: FlatGraph, drawn: dict[Edge, bool], before: dict[Edge, Edge], rubbed_out: set[Edge]
    ) -> None:
        self.core = core
        self.flat = flat
        self.drawn = drawn
        self.before = before
        self.rubbed_out = rubbed_out
        self.follower = _Follower(flat)
        self.present: dict[Edge, list[FlatEdge]] = {}
        for edge in flat.edges:
            self.present.setdefault(edge.segments[0], []).append(edge)

    def compare(self) -> Rerouting | None:
        """Follow anew what may have changed and compare it with what is there."""
        begins: dict[Edge, None] = {}
        for edge, is_there in self.drawn.items():
            if is_there or edge not in self.before.values():
                begins |= dict.fromkeys(self.follower.begins(edge))
        found = Rerouting()
        placed: list[tuple[int, int, int, FlatEdge]] = []
        affected: list[FlatEdge] = []
        for begin in begins:
            old = self.present.get(self.before.get(begin, begin), [])
            new = self.follower.block(begin) if self.drawn.get(begin, True) else []
            spot = self._spot(begin, old)
            if spot is None or not self._compare(old, new, spot, found, placed):
                return None
            affected += old
        placed.sort(key=lambda one: one[:3])
        found.new = [edge for *_, edge in placed]
        found.spots = [spot for spot, *_ in placed]
        if self.follower.flat.findings or not self._is_unambiguous(found, affected) or not self._fits(found):
            return None
        return found

    def _compare(
        self,
        old: list[FlatEdge],
        new: list[FlatEdge],
        spot: tuple[int, int],
        found: Rerouting,
        placed: list[tuple[int, int, int, FlatEdge]],
    ) -> bool:
        """Compare one block; whether what stays has kept its order."""
        left = list(old)
        at, drawn = spot
        for number, edge in enumerate(new):
            same = next((one for one in left if _is_same(one, edge) and self.rubbed_out.isdisjoint(one.segments)), None)
            if same is None:
                placed.append((at, drawn, number, edge))
                continue
            if same.index < at:
                return False
            at = same.index + 1
            edge.index = same.index
            left.remove(same)
            found.edges.append((self.core.edges[same.index], edge))
        found.lost += [self.core.edges[one.index] for one in left]
        return True

    def _spot(self, begin: Edge, old: list[FlatEdge]) -> tuple[int, int] | None:
        """Where in the flat graph the block begins, and where in its own graph the edge is drawn."""
        home: Graph = begin.target.graph
        if begin not in home.edges:
            home = self.flat.graph
        if begin not in home.edges:
            return (old[0].index if old else 0), 0  # it is gone
        drawn = home.edges.index(begin)
        if old:
            return old[0].index, drawn
        for other in reversed(home.edges[:drawn]):
            block = self.present.get(self.before.get(other, other))
            if block:
                return block[-1].index + 1, drawn
        return (0, drawn) if home is self.flat.graph else None

    # --- what only a look at the whole can tell

    def _is_unambiguous(self, found: Rerouting, affected: list[FlatEdge]) -> bool:
        """Whether no label is one of several that are numbered."""
        if not self.core.scopes:
            return True
        mine = set(map(id, affected))
        others = {edge.label.partition(" #")[0] for edge in self.flat.edges if id(edge) not in mine}
        labels = [edge.label for edge in (*found.new, *(said for _, said in found.edges), *affected)]
        after = [edge.label for edge in found.new] + [said.label for _, said in found.edges]
        return not any(" #" in label or label in others for label in labels) and len(set(after)) == len(after)

    def _fits(self, found: Rerouting) -> bool:
        """Whether edges through subgraphs are beyond doubt; else the check of the whole is to say what is wrong."""
        through = [edge for edge in found.new if len(edge.segments) > 1]
        if not through:
            return True
        lost = {edge.index for edge in found.lost}
        staying = [edge for edge in self.flat.edges if edge.index not in lost]
        for edge in through:
            source, target = edge.source.port, edge.target.port
            if edge.through or is_feed(source) or why_not(type_of(source), type_of(target)) is not None:
                return False
            if edge.initial or edge.buffer or any(part.options.for_events for part in edge.segments):
                return False
            for other in (*staying, *found.new):
                alone = edge.target.kind in ("input", "parameter") or other.source.port is source
                if other is not edge and alone and other.target.port is target:
                    return False
        return True


def _is_same(one: FlatEdge, other: FlatEdge) -> bool:
    ends = one.source.port is other.source.port and one.target.port is other.target.port
    roomy = bool(one.initial or one.buffer) == bool(other.initial or other.buffer)
    return ends and one.target.kind == other.target.kind and roomy


class _Follower(EdgeFollower):
    """Follows single edges; looks only at the graphs on their way."""

    def __init__(self, flat: FlatGraph) -> None:
        aside = FlatGraph(flat.nodes, flat.scopes, [], flat.groups, [], flat.graph, [])
        super().__init__(aside, [])

    def begins(self, edge: Edge) -> Iterator[Edge]:
        """Give the drawn edges with which the ways over one begin."""
        waiting, seen = [edge], [edge]
        while waiting:
            one = waiting.pop()
            relay = self.relay(one.source)
            if relay is None:
                yield one
                continue
            around: Graph = relay.graph if isinstance(one.source, InnerSource) else relay.node._graph
            for back in around.edges:
                if self.relay(back.target) is relay and back not in seen:
                    seen.append(back)
                    waiting.append(back)

    def block(self, begin: Edge) -> list[FlatEdge]:
        """Give the edges of the flat graph that begin with a drawn one, in order."""
        self.flat.edges = []
        self._look_ahead(begin)
        self.begin(begin)
        return self.flat.edges

    def _look_ahead(self, begin: Edge) -> None:
        """Find the relays on the way, and what goes on behind them."""
        waiting = [begin]
        self.depth_of[begin] = self._depth(begin)
        while waiting:
            relay = self.relay(waiting.pop().target)
            if relay is None or relay in self.behind:
                continue
            inside = relay.kind in ("input", "slot")
            onward: Graph = relay.node._graph if inside else relay.graph
            self.behind[relay] = [edge for edge in onward.edges if self.relay(edge.source) is relay]
            for edge in self.behind[relay]:
                self.depth_of[edge] = self._depth(edge)
            waiting += self.behind[relay]

    def _depth(self, edge: Edge) -> int:
        """How many subgraphs lie around a drawn edge; the ports of the whole graph may be named anywhere."""
        home = (edge.target if edge.target.node is not self.flat.graph else edge.source).graph
        return 0 if home is None else level_of(home).depth

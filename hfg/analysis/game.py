"""The token game of activity: a finite abstraction of a graph, whose states are whole numbers (see `places`).

Values, stamps, capacities and time are forgotten: any node may fire or be called at any moment. So everything that a
run does is also possible in the game, and what never happens in the game never happens in a run; the other way round it
is only a hint. The game has rules for the nodes that activity may reach at all, which `spread` finds. Depends on
`moves`, `places` and `spread`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from typing import Final

from hfg.analysis.bags import Bag
from hfg.analysis.moves import Doing, Move, Moves
from hfg.analysis.places import Places
from hfg.analysis.reading import read
from hfg.analysis.rules import Kind, Rule, Unread, named
from hfg.analysis.spread import Spread
from hfg.analysis.surroundings import first_calls, fragile, gates_by_node
from hfg.errors import GraphError
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, FlatNode, scope_end

__all__ = ["Game"]

_MOST_GIVEN: Final = 2_000_000  # in all rules together
_FRAGILE_TOGETHER: Final = 4  # up to this number of edges that may not be live, each combination is a case


class Game:
    """The game of one flat graph.

    Attributes:
      edges: the active edges; the game numbers them from 0.
      nodes: the nodes that they touch.
      into: for each node the active edges that lead to it.
      start: the edges that get +1 when the run starts.
      rules: all that may happen.
      places: where activity can be.
      unread: the code that could not be read.
    """

    def __init__(self, flat: FlatGraph) -> None:
        self.flat = flat
        self.edges = [edge for edge in flat.edges if edge.active]
        self._set_edges: dict[int, list[FlatEdge]] = {}  # into the automatic slots of activity
        for edge in flat.edges:
            if edge.target.kind == "slot" and edge.target.name in ("activate", "deactivate"):
                self._set_edges.setdefault(edge.target.node, []).append(edge)
        self.nodes = sorted(self._touched())
        self.into: dict[int, list[int]] = {}
        self._out: dict[tuple[int, str], list[int]] = {}
        for number, edge in enumerate(self.edges):
            self.into.setdefault(edge.target.node, []).append(number)
            self._out.setdefault((edge.source.node, edge.source.name), []).append(number)
        self.start = list(self._out.get((ROOT, "start"), ()))
        self._moves = Moves(flat, read)
        self._spread = Spread(flat, self._moves, self.edges, self.start)
        self._gates = gates_by_node(flat)
        self._fragile = fragile(flat, self.edges)
        self._first = first_calls(flat, self.edges, self.start)
        self._given = 0
        self.unread: list[Unread] = []
        self.rules: list[Rule] = []
        for index in self.nodes:
            self._add_node(flat.nodes[index])
        away = {edge for rule in self.rules for edge in rule.takes_away}
        rights = {rule.actor for rule in self.rules if rule.right}
        self.places = Places(flat, self.nodes, self.edges, rights, away)
        for number in sorted(away):
            self._add_minus(number)
        for scope in flat.scopes:
            self._add_scope(scope.index)

    def _touched(self) -> set[int]:
        ends = {end for edge in self.edges for end in (edge.source.node, edge.target.node)}
        ends |= {end for end, edges in self._set_edges.items() if any(one.target.name == "activate" for one in edges)}
        return {end for end in ends if end > ROOT}

    def may_stay(self, end: int, port: str) -> bool:
        """Return whether activity may stay when a node or subgraph sends over a port (rule A8)."""
        return not set(self._out.get((end, port), ())) - self._fragile

    # --- what a node does

    def _add_node(self, node: FlatNode) -> None:
        index = node.index
        doing = self._moves.of(node)
        arriving = [number for number in self.into.get(index, ()) if number in self._spread.reached]
        if not (doing.says or arriving or self._spread.active[index]):
            return  # activity never comes near
        self.unread += (Unread(node.path, name, why) for name, why in doing.unknown)
        is_shut = any(not self._spread.may_be_active(by) for by in self._gates.get(index, ()))
        for move in doing.moves:
            for bag in () if is_shut and move.gated else move.bags:
                if bag:
                    text = move.text.format(path=node.path, ports=named(bag))
                    self.rules += self._sending(text, move.kind, index, bag, right=move.right, gated=move.gated)
        for number in arriving:
            self._add_taking(node, number, doing)
        for edge in self._set_edges.get(index, ()):
            self._add_setting(node, edge)

    def _sending(
        self, text: str, kind: Kind, index: int, bag: Bag, *, take: int = -1, right: bool = False, gated: bool = False
    ) -> Iterator[Rule]:
        """The rules of one bag that leaves in one step: one for each combination of edges that are live."""
        gives = self._edges_of(index, bag, (None, 1))
        makes = self._edges_of(index, bag, (1,))
        away = tuple(self._edges_of(index, bag, (-1,)))
        sent = tuple((port, modifier, count) for (port, modifier), count in sorted(bag, key=repr))
        for gone in _subsets([number for number in gives if number in self._fragile]):
            self._given += len(gives)
            if self._given > _MOST_GIVEN:
                raise GraphError(
                    f'"{self.flat.path(index)}" sends activity in too many ways to analyse: let fewer of its active '
                    "edges lead to nodes that can be disabled"
                )
            yield Rule(
                text,
                kind,
                index,
                take,
                gives=_without(gives, gone),
                makes=_without(makes, gone),
                takes_away=away,
                sent=sent,
                keeps="active" if take >= 0 else "",
                right=right,
                gates=self._gates.get(index, ()) if gated else (),
                after=self._after(index, kind, take),
            )

    def _edges_of(self, index: int, bag: Bag, modifiers: tuple[int | None, ...]) -> dict[int, int]:
        found: dict[int, int] = {}
        for (port, modifier), count in bag:
            if modifier in modifiers:
                for number in self._out.get((index, port), ()):
                    found[number] = found.get(number, 0) + count
        return found

    def _after(self, index: int, kind: Kind, take: int = -1) -> tuple[int, ...]:
        """The edges from `start` that a step of a node comes after, if it is a call."""
        is_call = self.edges[take].target.kind == "slot" if take >= 0 else kind in ("is called", "is set")
        return () if not is_call or take in self.start else self._first.get(index, ())

    # --- what comes to a node

    def _add_taking(self, node: FlatNode, number: int, doing: Doing) -> None:
        """Activity that lies on an edge is taken, perhaps by a call that passes it on at once; or it is discarded."""
        edge = self.edges[number]
        if edge.target.kind == "slot" and edge.target.name == "deactivate":
            after = self._after(node.index, "takes", number)
            text = f'"{edge.label}" ends in deactivate'
            self.rules.append(Rule(text, "loses", node.index, number, keeps="inactive", after=after))
        elif edge.target.kind == "slot" or node.index not in self._moves.still:
            self._add_receipt(node, number, doing)
        if number in self._fragile:
            back = f'the activity on "{edge.label}" is discarded'
            if edge.source.node > ROOT:
                text = f"{back} and goes back"
                self.rules.append(Rule(text, "gets back", edge.source.node, number, keeps="active"))
            else:
                self.rules.append(Rule(back, "loses", node.index, number))

    def _add_receipt(self, node: FlatNode, number: int, doing: Doing) -> None:
        edge = self.edges[number]
        text = f'"{node.path}" takes the activity from "{edge.label}"'
        called: Move | None = None
        if edge.target.kind == "slot":
            called = next((move for move in doing.moves if move.slot == edge.target.name), None)
        if called is None:
            after = self._after(node.index, "takes", number)
            self.rules.append(Rule(text, "takes", node.index, number, keeps="active", after=after))
            return
        for bag in called.bags:
            kind: Kind = "is called" if bag else "takes"
            more = f" and sends {named(bag)}" if bag else ""
            self.rules += self._sending(text + more, kind, node.index, bag, take=number)

    def _add_setting(self, node: FlatNode, edge: FlatEdge) -> None:
        """Whatever comes to `activate` or `deactivate` acts (rule A7)."""
        if edge.active and edge.source.node == ROOT and edge.source.name == "start":
            return  # it happens once, and brings activity
        after = self._after(node.index, "is set")
        if edge.target.name == "activate":
            text = f'"{edge.label}" activates "{node.path}"'
            self.rules.append(Rule(text, "is set", node.index, keeps="active", after=after))
        else:
            text = f'"{edge.label}" deactivates "{node.path}"'
            self.rules.append(Rule(text, "is set", node.index, keeps="inactive", after=after))

    def _add_minus(self, number: int) -> None:
        target = self.edges[number].target.node
        if target > ROOT:
            text = f'"{self.flat.path(target)}" takes -1'
            self.rules.append(Rule(text, "takes -1", target, number, minus=True, keeps="inactive"))

    # --- what a subgraph does

    def _add_scope(self, index: int) -> None:
        """Activity that leaves by a subgraph's own events is taken from everything inside (rule G2)."""
        scope = self.flat.scopes[index]
        end, inside = scope_end(index), set(scope.members)
        mask = self.places.mask_of(end)
        rights = sum(1 << bit for node, bit in self.places.right.items() if node in inside)
        for port in sorted(self._moves.ports_of(end)):
            times_out = port == "timeout"
            text = f'"{scope.path}" {"times out" if times_out else f"sends {port}"}'
            gives = dict.fromkeys(self._out[end, port], 1)
            for gone in _subsets([number for number in gives if number in self._fragile]):
                left = _without(gives, gone)
                if left:
                    kind: Kind = "times out" if times_out else "sends"
                    sent = ((port, None, 1),)
                    self.rules.append(Rule(text, kind, end, gives=left, sent=sent, clears=mask | rights, needs=mask))
        for edge in self._set_edges.get(end, ()):
            if edge.target.name == "deactivate":
                text = f'"{edge.label}" deactivates "{scope.path}"'
                self.rules.append(Rule(text, "is set", end, clears=mask | rights, needs=mask))
        for number in self.into.get(end, ()):  # a subgraph's own slots keep no activity
            self.rules.append(Rule(f'"{scope.path}" keeps no activity', "loses", end, number))


def _subsets(numbers: list[int]) -> Iterator[frozenset[int]]:
    """Which edges are not live: none, or each combination; of very many, also all."""
    most = len(numbers) if len(numbers) <= _FRAGILE_TOGETHER else 1
    for size in range(most + 1):
        yield from map(frozenset, itertools.combinations(numbers, size))
    if most < len(numbers):
        yield frozenset(numbers)


def _without(edges: dict[int, int], gone: Iterable[int]) -> tuple[tuple[int, int], ...]:
    return tuple(sorted((number, min(count, 2)) for number, count in edges.items() if number not in gone))

"""The analysis of activity before a run: `analyse_activity` and its report.

Depends on `game`, `proving` and `searching`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from hfg.analysis.game import Game, Play, Unread
from hfg.analysis.proving import Claim, Step, Verdict, regions_of, steps_to, verdict
from hfg.analysis.searching import Searched, pairs_together, search
from hfg.base.bounds import ACTIVE_EDGES
from hfg.errors import GraphError, Problem, UsageError
from hfg.graph.flat import ROOT, FlatGraph, flatten, scope_end
from hfg.graph.graph import Graph
from hfg.nodetypes.node import Node, NodeType

__all__ = ["ActivityReport", "Region", "analyse_activity"]

MAX_STATES = 20_000
"""How many states of a region are looked at, unless another limit is given: about a second."""

_BYTES_PER_STATE: Final = 13_000
"""For each state of the limit, what the states of all regions together may take: 250 MiB with the usual limit."""

_STATE_BYTES: Final = 300
"""About what a state takes besides its bits."""


@dataclass(frozen=True)
class Region:
    """Nodes between which activity moves.

    Attributes:
      nodes: their paths.
      begins: how many of them the start of the run activates.
      at_most_one: whether it is proved that at most one is active.
      exactly_one: the same for exactly one.
      states: how many states were reached.
      is_complete: these are all.
      unproved: what is not known because there are more, in words; "" if they are all.
    """

    nodes: tuple[str, ...]
    begins: int
    at_most_one: Verdict
    exactly_one: Verdict
    states: int
    is_complete: bool
    unproved: str


class ActivityReport:
    """The possible behaviour of activity in a graph, in any run.

    The analysis plays a token game (docs/howto/activity.md) in which any node may fire at any moment. So "never" and
    "at most one" are proofs; "may" is a possibility that values and time may exclude.

    Attributes:
      regions: parts of the graph between which no activity moves, and what holds in each.
      problems: what is probably a mistake, as `graph.check()` gives them.
      unread: the code that could not be read; anything is assumed of it.
      without_limit: nodes that may keep their activity forever, since no time-out takes it from them.
    """

    def __init__(self, flat: FlatGraph, max_states: int) -> None:
        self._game = game = Game(flat)
        self._limit = max_states
        self._bytes = max_states * _BYTES_PER_STATE
        self._plays = [Play(game, nodes) for nodes in regions_of(game)]
        self._found = [self._searched(play) for play in self._plays]
        self._pairs: dict[int, dict[int, int]] = {}
        self.unread: list[Unread] = list(dict.fromkeys(game.unread))
        self.regions = [self._region(number) for number in range(len(self._plays))]
        self._index_of = {node.path: node.index for node in flat.nodes}
        self._index_of |= {scope.path: scope_end(scope.index) for scope in flat.scopes}
        self.without_limit = self._without_limit()
        self.problems: list[Problem] = [
            *(problem for number in range(len(self._plays)) for problem in self._problems_of(number)),
            *self._kept_by_time_out(),
            *self._half_active_slots(),
            *self._unlike_their_kind(),
            *self._ungated(),
        ]

    def _searched(self, play: Play) -> Searched:
        """Search a region, within its share of the memory that is left."""
        size = _STATE_BYTES + play.mask.bit_length() // 8
        found = search(play, max(1, min(self._limit, self._bytes // size)))
        self._bytes -= size * len(found.reached)
        return found

    # --- questions

    def at_most_one(self, *nodes: Node | str) -> Verdict:
        """Return whether at most one of some nodes is active at any moment: a proof, or steps to a counter-example.

        Activity in transit to one of them counts, too.

        Args:
          *nodes: nodes, or paths; a subgraph stands for all nodes inside.

        Raises:
          GraphError: a path does not exist, or no active edge touches one of the nodes.
        """
        return self._verdict(nodes, "at most one")

    def exactly_one(self, *nodes: Node | str) -> Verdict:
        """Return the same for exactly one."""
        return self._verdict(nodes, "exactly one")

    def may_be_active(self, node: Node | str) -> bool:
        """Return whether a node or subgraph may ever be active, if only for a moment; False is a proof."""
        return any(self._may_be_active(index) for index in self._indices(node))

    def may_be_active_together(self, first: Node | str, second: Node | str) -> bool:
        """Return whether two nodes or subgraphs may be active at the same moment; False is a proof.

        As in `at_most_one`, activity in transit to a node counts.
        """
        return any(
            self._may_be_together(one, other)
            for one in self._indices(first)
            for other in self._indices(second)
            if one != other
        )

    def states(self) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
        """Return the states reached, region by region: the active nodes, and the edges on which activity lies."""
        return [
            (tuple(self._game.active_in(state)), tuple(self._game.under_way_in(state)))
            for found in self._found
            for state in found.reached
        ]

    def as_data(self) -> dict[str, Any]:
        """Return the report as plain data, for JSON."""
        return {
            "regions": [
                {
                    "nodes": list(region.nodes),
                    "begins": region.begins,
                    "at_most_one": _data_of(region.at_most_one),
                    "exactly_one": _data_of(region.exactly_one),
                    "states": region.states,
                    "is_complete": region.is_complete,
                    "unproved": region.unproved,
                }
                for region in self.regions
            ],
            "unread": [{"path": one.path, "handler": one.handler, "why": one.why} for one in self.unread],
            "without_limit": self.without_limit,
        }

    def lines(self) -> list[str]:
        """Return the report as text, line by line."""
        found = []
        for region in self.regions:
            found += _lines_of(region)
        for one in self.unread:
            found.append(f"unknown: {one.path}: {one.handler} is not read, so it may send anything: {one.why}")
        if self.without_limit:
            found.append(f"no time-out takes activity from {_names(self.without_limit)}")
        return found or ["no edge of the graph is active, so no node ever is"]

    def __str__(self) -> str:
        return "\n".join(self.lines())

    # --- how they are answered

    def _indices(self, node: Node | str) -> list[int]:
        path = node if isinstance(node, str) else node.place.path
        index = self._index_of.get(path)
        if index is None:
            raise GraphError(f'there is no node or subgraph "{path}" in the graph: name one by its path')
        return self._game.flat.members(index)

    def _verdict(self, nodes: Iterable[Node | str], claim: Claim) -> Verdict:
        chosen: set[int] = set()
        for node in nodes:
            touched = [index for index in self._indices(node) if index in self._game.bits.node]
            if not touched:
                path = node if isinstance(node, str) else node.place.path
                raise GraphError(f'no active edge touches "{path}", so it is never active: leave it out')
            chosen.update(touched)
        if not chosen:
            raise UsageError(f"name the nodes of which {claim} is active, as in {claim.replace(' ', '_')}(wait, work)")
        numbers = [number for number, play in enumerate(self._plays) if not play.nodes.isdisjoint(chosen)]
        if len(numbers) == 1:
            return verdict(self._plays[numbers[0]], self._found[numbers[0]], chosen, claim)
        play = Play(self._game, frozenset().union(*(self._plays[number].nodes for number in numbers)))
        return verdict(play, search(play, self._limit), chosen, claim)

    def _region(self, number: int) -> Region:
        play, found = self._plays[number], self._found[number]
        at_most, exactly = (verdict(play, found, play.nodes, claim) for claim in ("at most one", "exactly one"))
        unproved = ""
        if not found.is_complete:
            unproved = (
                f"{len(found.reached)} states were looked at, and there are more: which can be left, and whether "
                "activity can be lost, is not known; a larger limit looks further (max_states=, --states)"
            )
        return Region(
            nodes=tuple(self._game.flat.path(index) for index in sorted(play.nodes)),
            begins=sum(1 for one in self._game.start if self._game.bits.one[one] & play.mask),
            at_most_one=at_most,
            exactly_one=exactly,
            states=len(found.reached),
            is_complete=found.is_complete,
            unproved=unproved,
        )

    def _play_of(self, index: int) -> int | None:
        return next((number for number, play in enumerate(self._plays) if index in play.nodes), None)

    def _pairs_of(self, number: int) -> dict[int, int]:
        if number not in self._pairs:
            self._pairs[number] = pairs_together(self._plays[number])
        return self._pairs[number]

    def _may_be_active(self, index: int) -> bool:
        number = self._play_of(index)
        return number is not None and self._is_marked(number, self._game.places_of([index]))

    def _is_marked(self, number: int, mask: int) -> bool:
        """Return whether one of some places may ever hold activity."""
        found = self._found[number]
        if any(state & mask for state in found.reached):
            return True
        return not found.is_complete and any(place & mask for place in self._pairs_of(number))

    def _may_be_together(self, first: int, second: int) -> bool:
        one, other = self._play_of(first), self._play_of(second)
        if one is None or other is None:
            return False
        if one != other:
            return self._may_be_active(first) and self._may_be_active(second)
        masks = self._game.places_of([first]), self._game.places_of([second])
        found = self._found[one]
        if any(state & masks[0] and state & masks[1] for state in found.reached):
            return True
        pairs = {} if found.is_complete else self._pairs_of(one)
        return any(place & masks[0] and others & masks[1] for place, others in pairs.items())

    # --- findings

    def _problems_of(self, number: int) -> list[Problem]:
        """The problems that the states of a region show."""
        game, play, found, region = self._game, self._plays[number], self._found[number], self.regions[number]
        problems = []
        if found.is_complete:
            never = [index for index in sorted(play.nodes) if not self._may_be_active(index)]
            never = [index for index in never if self._game.into.get(index)]
            if never and len(never) < len(play.nodes):
                more = f", nor do {len(never) - 1} more behind it" if len(never) > 1 else ""
                problems.append(
                    Problem(
                        path=game.flat.path(never[0]),
                        severity="warning",
                        what=f"it is never active{more}",
                        why="activity never comes by any of the active edges that lead to it",
                        remedy="look which edge before it is not active, or does not begin where activity is",
                        check="activity-never-comes",
                    )
                )
            problems += self._stuck(play, found)
        if not region.begins:
            return problems
        lost = next((state for state in found.reached if not state & play.mask), None)
        if lost is not None:
            steps = list(steps_to(game, found, lost))
            problems.append(
                Problem(
                    path=steps[-1].path,
                    severity="warning",
                    what="the activity of its part of the graph may be lost",
                    why=f"none of {len(region.nodes)} nodes is active any more after {_in_words(steps)}",
                    remedy="lead the activity on by an active edge, if this is not the end of the work",
                    check="activity-lost",
                )
            )
        return problems

    def _stuck(self, play: Play, found: Searched) -> list[Problem]:
        """States that have activity and can never be left."""
        game = self._game
        kept: list[str] = []
        for state in found.reached:
            if state & play.mask and next(play.steps_from(state), None) is None:
                kept += [path for path in game.active_in(state) if path not in kept]
        return [
            Problem(
                path=path,
                severity="hint",
                what="its activity may stay permanently",
                why="there is a state in which nothing can happen to it any more",
                remedy="lead it on by an active edge, unless the work is over there",
                check="activity-stays",
            )
            for path in kept
        ]

    def _without_limit(self) -> list[str]:
        """Nodes that may be active, and that neither a time-out of their own nor one around them makes inactive."""
        game = self._game
        limited: set[int] = set()
        for rule in game.rules:
            if rule.kind == "times out" and rule.gives:
                limited.update(game.flat.members(rule.actor))
        return [game.flat.path(index) for index in game.nodes if index not in limited and self._may_be_active(index)]

    def _kept_by_time_out(self) -> list[Problem]:
        """Time limits whose end is heard, but takes no activity along, where other events do."""
        flat, problems = self._game.flat, []
        for end, options in flat.options():
            edges = [edge for edge in flat.edges if edge.source.node == end and edge.source.name == "timeout"]
            inside = set(self._game.flat.members(end))
            leads_on = any(
                edge.source.node in inside and edge.target.node not in inside and edge.source.node != end
                for edge in self._game.edges
            ) or any(edge.source.node == end for edge in self._game.edges)
            if options.active_for_s is not None and edges and leads_on and not any(edge.active for edge in edges):
                problems.append(
                    Problem(
                        path=edges[0].label,
                        severity="hint",
                        what="the activity stays when the time is over",
                        why="its other events lead the activity on, and this edge is not active (rules A5, A12)",
                        remedy="make it active, or look whether the node is to stay active",
                        check="timeout-keeps-activity",
                    )
                )
        return problems

    def _half_active_slots(self) -> list[Problem]:
        """Edges without activity into a slot that others enter with activity, from a node that has it."""
        flat, game = self._game.flat, self._game
        problems = []
        active = Counter((edge.target.node, edge.target.name) for edge in game.edges if edge.target.kind == "slot")
        for edge in flat.edges:
            if edge.active or not active[edge.target.node, edge.target.name] or edge.target.node <= ROOT:
                continue
            members = game.flat.members(edge.source.node) if edge.source.node != ROOT else []
            if edge.source.name != "deactivated" and any(index in game.bits.node for index in members):
                problems.append(
                    Problem(
                        path=edge.label,
                        severity="hint",
                        what="this edge is not active, and others into the same slot are",
                        why="the node that sends keeps its activity when the slot is called by this edge (rule A7)",
                        remedy="make it active, or look whether both nodes are to be active then",
                        check="half-active-slot",
                    )
                )
        return problems

    def _unlike_their_kind(self) -> list[Problem]:
        """Events that lead no activity on, though those of all other nodes of the same type do."""
        game, problems = self._game, []
        leads: dict[tuple[NodeType, str], set[int]] = {}
        of_type: dict[NodeType, list[int]] = {}
        for index in game.nodes:
            of_type.setdefault(game.flat.nodes[index].node._type, []).append(index)
        for edge in game.edges:
            if edge.source.node > ROOT and edge.source.kind == "event":
                kind = game.flat.nodes[edge.source.node].node._type
                if edge.source.name in kind.events:
                    leads.setdefault((kind, edge.source.name), set()).add(edge.source.node)
        for (kind, event), leading in leads.items():
            others = [index for index in of_type[kind] if index not in leading]
            if len(others) == 1:
                problems.append(
                    Problem(
                        path=f"{game.flat.path(others[0])}.{event}",
                        severity="hint",
                        what="no active edge begins here, although one does at all other nodes of this type",
                        why=f"{kind.name} keeps its activity when it sends {event} (rule A5)",
                        remedy="lead the activity on by an active edge, or look whether it is to stay",
                        check="unlike-its-kind",
                    )
                )
        return problems

    def _ungated(self) -> list[Problem]:
        """Nodes without a gate whose outputs go where only gated ones send as well."""
        flat, game = self._game.flat, self._game
        gated = {member for gate in flat.gates for member in game.flat.members(gate.target)}
        into: dict[tuple[int, str], list[int]] = {}
        for edge in flat.edges:
            if edge.source.kind == "output" and edge.source.node > ROOT:
                into.setdefault((edge.target.node, edge.target.name), []).append(edge.source.node)
        found: dict[int, int] = {}
        for sources in into.values():
            without = [index for index in sources if index not in gated and index in game.bits.node]
            held_back = [index for index in sources if index in gated]
            if len(without) == 1 and len(held_back) == len(sources) - 1 > 1:
                found[without[0]] = len(sources) - 1
        return [
            Problem(
                path=game.flat.path(index),
                severity="hint",
                what="it also sends when it is inactive",
                why=f"the {others} other nodes that send to the same port work only while a gate is open (rule A11)",
                remedy="add a gate, as in graph.gate(node, by=node)",
                check="gate-missing",
            )
            for index, others in found.items()
        ]


def _lines_of(region: Region) -> list[str]:
    """Say which claims hold in a region."""
    where = _names(region.nodes)
    if not region.begins:
        return [
            f"{where}: nothing in the graph makes any of them active; what your program may activate is not looked at"
        ]
    states = f"{region.states} states{'' if region.is_complete else ' and more'}"
    best = region.exactly_one if region.exactly_one.holds else region.at_most_one
    found = [f"{where}: {states}", f"  {_result(best)}"]
    if best is region.at_most_one and region.exactly_one.holds is not None and region.at_most_one.holds:
        found.append(f"  {_result(region.exactly_one)}")
        best = region.exactly_one
    found += [f"    {number}. {step.text}" for number, step in enumerate(best.steps, 1)]
    if best.steps:
        last = best.steps[-1]
        after = [
            *(f'"{path}" is active' for path in last.active),
            *(f'activity lies on "{one}"' for one in last.under_way),
        ]
        found.append(f"    then {' and '.join(after) or 'no node is active'}")
    if region.unproved:
        found.append(f"  {region.unproved}")
    return found


def _result(one: Verdict) -> str:
    if one.holds:
        return f"{one.claim} is active: proved by {one.method}"
    if one.holds is None:
        return f"{one.claim} is active: not proved: {one.why}"
    return f"{one.claim} is active: not so, as these steps may show:" if one.steps else f"{one.claim} is active: not so"


def _names(paths: Sequence[str]) -> str:
    shown = ", ".join(f'"{path}"' for path in paths[:3])
    return shown if len(paths) <= 3 else f"{shown} and {len(paths) - 3} more"


def _data_of(verdict_: Verdict) -> dict[str, Any]:
    steps = [
        {"text": step.text, "path": step.path, "active": list(step.active), "under_way": list(step.under_way)}
        for step in verdict_.steps
    ]
    return {
        "holds": verdict_.holds,
        "method": verdict_.method,
        "states": verdict_.states,
        "steps": steps,
        "why": verdict_.why,
    }


def _in_words(steps: list[Step]) -> str:
    shown = [step.text for step in steps[-2:]]
    more = f"{len(steps) - 2} steps, then " if len(steps) > 2 else ""
    return more + ", then ".join(shown) if shown else "the start"


def analyse_activity(graph: Graph, *, max_states: int = MAX_STATES) -> ActivityReport:
    """Find out before running what may happen to the activity of a graph.

    Args:
      graph: the graph.
      max_states: how many states of each region are looked at. A claim that needs more is reported as not proved.

    Returns:
      The report: what is proved, what may happen, and what is not known.

    Raises:
      UsageError: `max_states` is not a whole number of 1 or more.
      GraphError: the graph has too many active edges, or too many ways to send activity over them.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import double
      >>> report = hfg.analyse_activity(hfg.Graph("empty"))
      >>> report.regions
      []
    """
    if type(max_states) is not int or max_states < 1:
        raise UsageError(f"max_states= is how many states to look at, 1 at least, got {max_states!r}")
    if not isinstance(graph, Graph):
        raise UsageError(f"analyse_activity takes a graph, got {graph!r:.80}: pass the hfg.Graph itself")
    flat = flatten(graph)
    active = sum(1 for edge in flat.edges if edge.active or edge.target.name == "activate")
    if active > ACTIVE_EDGES.most:
        raise GraphError(
            f'graph "{graph.name}" has {active:,} edges that activate, too many to analyse its activity: '
            f"{ACTIVE_EDGES.remedy}"
        )
    return ActivityReport(flat, max_states)

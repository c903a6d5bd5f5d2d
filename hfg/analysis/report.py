"""The analysis of activity before a run: `analyse_activity` and its report.

Depends on `reach`, `proving`, `findings`, `diagram` and `wording`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from hfg.analysis.diagram import StateDiagram, diagram_of
from hfg.analysis.findings import leaves_within, problems_of, without_limit
from hfg.analysis.proving import Region, StatedFact, Verdict
from hfg.analysis.reach import Reach
from hfg.analysis.rules import Unread
from hfg.analysis.wording import data_of_fact, data_of_region, lines_of_fact, lines_of_region, names
from hfg.base.bounds import ACTIVE_EDGES
from hfg.errors import GraphError, Problem, UsageError
from hfg.graph.flat import FlatGraph, flatten
from hfg.graph.graph import Graph
from hfg.graph.structure.facts import CLAIMS, Claim, Fact
from hfg.nodetypes.node import Node

__all__ = ["MAX_STATES", "ActivityReport", "analyse_activity"]

MAX_STATES = 20_000
"""How many states of a region are looked at, unless another limit is given: about a second."""


class ActivityReport:
    """The possible behaviour of activity in a graph, in any run.

    The analysis plays a token game (docs/howto/activity.md) in which any node may fire at any moment. So "never" and
    "at most one" are proofs; "may" is a possibility that values and time may exclude. Facts that the graph states are
    taken for granted.

    Attributes:
      regions: parts of the graph between which no activity moves, and what holds in each.
      facts: what the graph states, and whether it follows without being stated.
      problems: what is probably a mistake, as `graph.check()` gives them.
      unread: the code that could not be read; anything is assumed of it.
      leaves_within_s: nodes that a time-out makes inactive, by path, and after how many seconds at the latest.
      without_limit: nodes that may keep their activity forever, since no time-out takes it from them.
    """

    def __init__(self, flat: FlatGraph, facts: Sequence[Fact], max_states: int) -> None:
        self._reach = reach = Reach(flat, facts, max_states)
        self._game = reach.game
        self.unread: list[Unread] = list(dict.fromkeys(reach.game.unread))
        self.regions = [self._region(number) for number in range(len(reach.plays))]
        self.facts = [self._fact(fact) for fact in facts]
        self.leaves_within_s = leaves_within(reach)
        self.without_limit = without_limit(reach, self.leaves_within_s)
        self.problems: list[Problem] = list(problems_of(reach, self.facts))

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
        return any(self._reach.may_be_active(index) for index in self._indices(node))

    def may_be_active_together(self, first: Node | str, second: Node | str) -> bool:
        """Return whether two nodes or subgraphs may be active at the same moment; False is a proof.

        As in `at_most_one`, activity in transit to a node counts.
        """
        return any(
            self._reach.may_be_together(one, other)
            for one in self._indices(first)
            for other in self._indices(second)
            if one != other
        )

    def states(self) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
        """Return the states reached, region by region: the active nodes, and the edges on which activity lies."""
        return [
            (tuple(self._game.places.active_in(state)), tuple(self._game.places.under_way_in(state)))
            for found in self._reach.found
            for state in found.reached
        ]

    def diagram(self) -> StateDiagram:
        """Return the states between which activity moves, and which event leads from which to which."""
        return diagram_of(self._reach)

    def as_data(self) -> dict[str, Any]:
        """Return the report as plain data, for JSON."""
        return {
            "regions": [data_of_region(region) for region in self.regions],
            "facts": [data_of_fact(fact) for fact in self.facts],
            "states": self.diagram().as_data(),
            "unread": [{"path": one.path, "handler": one.handler, "why": one.why} for one in self.unread],
            "leaves_within_s": self.leaves_within_s,
            "without_limit": self.without_limit,
        }

    def lines(self) -> list[str]:
        """Return the report as text, line by line."""
        found = []
        for region in self.regions:
            found += lines_of_region(region)
        for fact in self.facts:
            found += lines_of_fact(fact)
        for one in self.unread:
            found.append(f"unknown: {one.path}: {one.handler} is not read, so it may send anything: {one.why}")
        if self.without_limit:
            found.append(f"no time-out takes activity from {names(self.without_limit)}")
        return found or ["no edge of the graph is active, so no node ever is"]

    def __str__(self) -> str:
        return "\n".join(self.lines())

    # --- how they are answered

    def _indices(self, node: Node | str) -> list[int]:
        path = node if isinstance(node, str) else node.place.path
        index = self._reach.index_of.get(path)
        if index is None:
            raise GraphError(f'there is no node or subgraph "{path}" in the graph: name one by its path')
        return self._game.flat.members(index)

    def _verdict(self, nodes: Iterable[Node | str], claim: Claim) -> Verdict:
        chosen: set[int] = set()
        for node in nodes:
            touched = [index for index in self._indices(node) if index in self._game.places.node]
            if not touched:
                path = node if isinstance(node, str) else node.place.path
                raise GraphError(f'no active edge touches "{path}", so it is never active: leave it out')
            chosen.update(touched)
        if not chosen:
            raise UsageError(f"name the nodes of which {claim} is active, as in {claim.replace(' ', '_')}(wait, work)")
        return self._reach.decide(chosen, claim)

    def _fact(self, fact: Fact) -> StatedFact:
        chosen = next((chosen for one, chosen in self._reach.facts if one is fact), None)
        verdict = None if chosen is None else self._reach.decide(chosen, fact.claim, use_facts=False)
        unread = {one.path for one in self.unread}
        is_read = verdict is not None and not any(step.path in unread for step in verdict.steps)
        return StatedFact(str(fact), fact.nodes[0].place.path, verdict, is_read)

    def _region(self, number: int) -> Region:
        play, found = self._reach.plays[number], self._reach.found[number]
        at_most, exactly = (self._reach.decide(play.nodes, claim) for claim in CLAIMS)
        unproved = ""
        if not found.is_complete:
            unproved = (
                f"{len(found.reached)} states were looked at, and there are more: which can be left, and whether "
                "activity can be lost, is not known; a larger limit looks further (max_states=, --states)"
            )
        return Region(
            nodes=tuple(self._game.flat.path(index) for index in sorted(play.nodes)),
            begins=sum(1 for one in self._game.start if self._game.places.one[one] & play.mask),
            at_most_one=at_most,
            exactly_one=exactly,
            states=len(found.reached),
            is_complete=found.is_complete,
            unproved=unproved,
        )


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
    return ActivityReport(flat, graph.facts, max_states)

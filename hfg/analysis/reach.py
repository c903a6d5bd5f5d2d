"""What activity reaches in a graph: its regions, their states, and what may be active together.

Facts that users state are taken for granted: what would violate one is left out, and noted. Depends on `game`,
`proving` and `searching`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from functools import reduce
from itertools import chain
from operator import or_
from typing import Final

from hfg.analysis.game import Game
from hfg.analysis.playing import Play
from hfg.analysis.proving import Verdict, regions_of, verdict
from hfg.analysis.searching import Premise, Searched, pairs_together, search
from hfg.graph.flat import FlatGraph, scope_end
from hfg.graph.structure.facts import Claim, Fact

__all__ = ["Reach"]

_BYTES_PER_STATE: Final = 13_000
"""For each state of the limit, what the states of all regions together may take: 250 MiB with the usual limit."""

_STATE_BYTES: Final = 300
"""About what a state takes besides its bits."""


class Reach:
    """The states that activity reaches, region by region.

    Attributes:
      game: the token game.
      plays: the regions.
      found: their states, or the first ones.
      facts: those that are stated and can be used, each with the nodes that count.
    """

    def __init__(self, flat: FlatGraph, facts: Iterable[Fact], max_states: int) -> None:
        self.game = Game(flat)
        self._limit = max_states
        self._bytes = max_states * _BYTES_PER_STATE
        self.index_of = {node.path: node.index for node in flat.nodes}
        self.index_of |= {scope.path: scope_end(scope.index) for scope in flat.scopes}
        self.facts = [(fact, chosen) for fact in facts if (chosen := self._nodes_of(fact))]
        self.plays = [Play(self.game, nodes) for nodes in regions_of(self.game)]
        self.found = [self._searched(play, self._premises(play)) for play in self.plays]
        self._pairs: dict[int, dict[int, int]] = {}
        self._marked: dict[int, int] = {}

    def _nodes_of(self, fact: Fact) -> frozenset[int]:
        """The nodes that a fact counts; none if one of them lies where the analysis does not go."""
        ends = [self.index_of.get(node.place.path) for node in fact.nodes]
        if None in ends:
            return frozenset()
        inside = {index for end in ends if end is not None for index in self.game.flat.members(end)}
        return frozenset(inside.intersection(self.game.places.node))

    def _premises(self, play: Play) -> list[Premise]:
        """The facts as far as they are about nodes of a play."""
        found = []
        for number, (fact, chosen) in enumerate(self.facts):
            mask = self.game.places.counting(chosen & play.nodes)
            if mask:
                found.append(Premise(number, mask, fact.claim == "exactly one" and chosen <= play.nodes))
        return found

    def _searched(self, play: Play, premises: Collection[Premise] = ()) -> Searched:
        """Search a region, within its share of the memory that is left."""
        size = _STATE_BYTES + play.mask.bit_length() // 8
        found = search(play, max(1, min(self._limit, self._bytes // size)), premises)
        self._bytes -= size * len(found.reached)
        return found

    def decide(self, chosen: Collection[int], claim: Claim, *, use_facts: bool = True) -> Verdict:
        """Decide a claim about nodes, which may lie in several regions."""
        together = [number for number, play in enumerate(self.plays) if not play.nodes.isdisjoint(chosen)]
        if len(together) == 1 and (use_facts or not self.found[together[0]].left_out):
            play, found = self.plays[together[0]], self.found[together[0]]
        else:
            play = Play(self.game, frozenset().union(*(self.plays[number].nodes for number in together)))
            found = search(play, self._limit, self._premises(play) if use_facts else ())
        return verdict(play, found, chosen, claim, [str(fact) for fact, _ in self.facts])

    # --- what may be active

    def _play_of(self, index: int) -> int | None:
        return next((number for number, play in enumerate(self.plays) if index in play.nodes), None)

    def _pairs_of(self, number: int) -> dict[int, int]:
        if number not in self._pairs:
            self._pairs[number] = pairs_together(self.plays[number])
        return self._pairs[number]

    def may_be_active(self, index: int) -> bool:
        """Return whether a node may ever hold activity, or activity be in transit to it."""
        number = self._play_of(index)
        return number is not None and self.is_marked(number, self.game.places.counting([index]))

    def is_marked(self, number: int, mask: int) -> bool:
        """Return whether one of some places of a region may ever hold activity."""
        if number not in self._marked:
            found = self.found[number]
            more = () if found.is_complete else self._pairs_of(number)
            self._marked[number] = reduce(or_, chain(found.reached, more), 0)
        return bool(self._marked[number] & mask)

    def holds(self, places: int) -> bool:
        """Return whether one of some places of any region may ever hold activity."""
        return any(self.is_marked(number, places & play.mask) for number, play in enumerate(self.plays))

    def may_be_together(self, first: int, second: int) -> bool:
        """Return whether two nodes may hold activity at the same moment."""
        one, other = self._play_of(first), self._play_of(second)
        if one is None or other is None:
            return False
        if one != other:
            return self.may_be_active(first) and self.may_be_active(second)
        masks = self.game.places.counting([first]), self.game.places.counting([second])
        found = self.found[one]
        if any(state & masks[0] and state & masks[1] for state in found.reached):
            return True
        pairs = {} if found.is_complete else self._pairs_of(one)
        return any(place & masks[0] and others & masks[1] for place, others in pairs.items())

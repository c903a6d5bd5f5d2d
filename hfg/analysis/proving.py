"""Proofs that at most one, or exactly one, of some nodes is active, and counter-examples as steps.

Four methods in order, each only if those before did not decide: *regions*, parts between which no activity moves;
*counting*, whether any single step makes two out of one; the *concurrency relation*; and a *search* through all states.
Depends on `game` and `searching`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from hfg.analysis.game import Game
from hfg.analysis.playing import Play
from hfg.analysis.rules import Kind
from hfg.analysis.searching import Searched, pairs_together
from hfg.graph.flat import ROOT
from hfg.graph.structure.facts import Claim

__all__ = ["Region", "StatedFact", "Step", "Verdict", "regions_of", "steps_to", "verdict"]


@dataclass(frozen=True)
class Step:
    """One step of a counter-example.

    Attributes:
      text: what happens.
      path: the node or subgraph that does it.
      takes: the edge from which it takes activity, or "".
      sends: what it sends: port, explicit modifier, how often.
      kind: what happens: "fires", "is called", "sends", "takes", "times out" and so on.
      active: the nodes that are active after it.
      under_way: the edges on which activity lies after it.
    """

    text: str
    path: str
    takes: str
    sends: tuple[tuple[str, int | None, int], ...]
    kind: Kind
    active: tuple[str, ...]
    under_way: tuple[str, ...]


@dataclass(frozen=True)
class Verdict:
    """Whether a claim about some nodes holds in every run.

    Attributes:
      claim: "at most one" or "exactly one".
      nodes: their paths.
      holds: True: proved. False: the game reaches a state that breaks it, by `steps`. None: not decided.
      method: what decided: "counting", "concurrency relation" or "search".
      states: how many states were looked at.
      steps: the counter-example, from the start of the run. Without steps, the start itself breaks the claim.
      why: why it is not decided, and what to do.
      given: the stated facts on which a proof depends, in words.
    """

    claim: Claim
    nodes: tuple[str, ...]
    holds: bool | None
    method: str
    states: int = 0
    steps: tuple[Step, ...] = ()
    why: str = ""
    given: tuple[str, ...] = ()

    def __str__(self) -> str:
        nodes = f"{len(self.nodes)} nodes" if len(self.nodes) > 3 else ", ".join(f'"{path}"' for path in self.nodes)
        result = {True: f"proved by {self.method}", False: f"broken in {len(self.steps)} steps", None: "not proved"}
        why = f": {self.why}" if self.why else ""
        return f"{self.claim} of {nodes} is active: {result[self.holds]}{self.given_that()}{why}"

    def given_that(self) -> str:
        """Name the facts on which the proof depends, as the end of a sentence; "" if there are none."""
        return f", given that {' and that '.join(self.given)}" if self.given else ""


@dataclass(frozen=True)
class StatedFact:
    """A fact that the graph states, and what the analysis knows of it.

    Attributes:
      fact: in words.
      path: the first of its nodes.
      verdict: whether it follows from edges and code without being stated; None where the analysis does not go.
      is_read: a counter-example takes no step of code that could not be read.
    """

    fact: str
    path: str
    verdict: Verdict | None
    is_read: bool


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


def regions_of(game: Game) -> list[list[int]]:
    """Return the parts of a game between which no activity moves, in the order of their first nodes."""
    leader = {index: index for index in game.nodes}

    def find(index: int) -> int:
        while leader[index] != index:
            leader[index] = leader[leader[index]]
            index = leader[index]
        return index

    for edge in game.edges:
        ends = [edge.target.node] if edge.target.node > ROOT else []
        if edge.source.node != ROOT:
            ends += [one for one in game.flat.members(edge.source.node) if one in leader]
        for one in ends[1:]:
            leader[find(one)] = find(ends[0])
    found: dict[int, list[int]] = {}
    for index in game.nodes:
        found.setdefault(find(index), []).append(index)
    return list(found.values())


def verdict(play: Play, found: Searched, nodes: Iterable[int], claim: Claim, facts: Sequence[str] = ()) -> Verdict:
    """Decide a claim about nodes that take part in a play.

    A node counts if it is active, and so does each activity in transit to one of them.

    Args:
      play: the game among these nodes, and perhaps others.
      found: its states, or the first ones.
      nodes: whose activity is counted.
      claim: how many of them there are.
      facts: the premises of the search, in words, by number.
    """
    game = play.game
    nodes = sorted(nodes)
    paths = tuple(game.flat.path(index) for index in nodes)
    whole = play.nodes.issubset(nodes)
    mask = play.mask if whole else game.places.counting(nodes)
    kept = claim == "at most one" or (whole and not any(rule.may_lose for rule in play.rules) and play.first != 0)
    if kept and _counts(play):
        return Verdict(claim, paths, True, "counting")
    if kept and play.first.bit_count() < 2 and not _any_pair(play, mask):
        return Verdict(claim, paths, True, "concurrency relation")

    least = 1 if claim == "exactly one" else 0
    states = len(found.reached)
    for number, state in enumerate(found.reached, 1):
        if not least <= (state & mask).bit_count() <= 1:
            return Verdict(claim, paths, False, "search", number, tuple(steps_to(game, found, state)))
    if found.is_complete:
        given = tuple(facts[number] for number in sorted(found.left_out))
        return Verdict(claim, paths, True, "search", states, given=given)
    why = (
        f"the search ended at its limit of {states} states, and none of them breaks it; a larger limit looks further "
        "(max_states=, --states)"
    )
    return Verdict(claim, paths, None, "search", states, why=why)


def _counts(play: Play) -> bool:
    """Whether no step makes two out of one, so that "at most one" stays true forever."""
    return play.first.bit_count() < 2 and all(rule.most_made < 2 for rule in play.rules)


def _any_pair(play: Play, mask: int) -> bool:
    return any(place & mask and others & mask for place, others in pairs_together(play).items())


def steps_to(game: Game, found: Searched, state: int) -> Iterator[Step]:
    """Yield the steps that lead to a state."""
    for rule, after in found.way_to(state):
        yield Step(
            text=rule.text,
            path=game.flat.path(rule.actor),
            takes=game.edges[rule.take].label if rule.take >= 0 else "",
            sends=rule.sent,
            kind=rule.kind,
            active=tuple(game.places.active_in(after)),
            under_way=tuple(game.places.under_way_in(after)),
        )

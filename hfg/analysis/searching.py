"""Two ways to decide what the game reaches: every state, breadth first; or which two places go together.

The search is exact in the game and finds the shortest way to a state, but the number of states may explode. The
concurrency relation (Kovalyov 1992) is polynomial, and finds at least every pair that occurs. Depends on `places`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Final

from hfg.analysis.places import singles
from hfg.analysis.playing import Play
from hfg.analysis.rules import Rule

__all__ = ["Premise", "Searched", "pairs_together", "search"]

_MOST_WORK: Final = 3_000_000  # pairs of places that are looked at: some seconds


@dataclass(frozen=True)
class Premise:
    """A fact that is taken for granted.

    Attributes:
      number: which one.
      mask: the places that count.
      exactly: never none of them, once there is one.
    """

    number: int
    mask: int
    exactly: bool

    def excludes(self, before: int, after: int) -> bool:
        """Whether a step cannot be, because it would violate the fact."""
        count = (after & self.mask).bit_count()
        return count > 1 or (count == 0 and self.exactly and bool(before & self.mask))


@dataclass
class Searched:
    """The states that a search has reached, each with the state and rule that led to it.

    Attributes:
      reached: in the order in which they were found.
      is_complete: all were found.
      left_out: the numbers of the premises without which there would be more.
    """

    reached: dict[int, tuple[int, Rule] | None]
    is_complete: bool
    left_out: set[int] = field(default_factory=set)

    def way_to(self, state: int) -> list[tuple[Rule, int]]:
        """Return the steps from the start to a state, and the state after each."""
        way = []
        before = self.reached[state]
        while before is not None:
            way.append((before[1], state))
            state = before[0]
            before = self.reached[state]
        return way[::-1]


def search(play: Play, limit: int, premises: Collection[Premise] = ()) -> Searched:
    """Search breadth first, until nothing is left, or there are more states than the limit.

    Args:
      play: the game.
      limit: how many states are looked at.
      premises: steps that would violate one of them are left out.
    """
    reached: dict[int, tuple[int, Rule] | None] = {play.first: None}
    left_out: set[int] = set()
    waiting = [play.first]
    for state in waiting:
        for rule, after in play.steps_from(state):
            if after not in reached:
                excluding = [one.number for one in premises if one.excludes(state, after)] if premises else None
                if excluding:
                    left_out.update(excluding)
                    continue
                if len(reached) >= limit:
                    return Searched(reached, False, left_out)
                reached[after] = (state, rule)
                waiting.append(after)
    return Searched(reached, True, left_out)


def pairs_together(play: Play) -> dict[int, int]:
    """Return for each place that may be marked the places that may be marked with it, as bits of their first bit.

    Where that is too much work, all places may be marked with all: then little is proved, but nothing wrong (rule L4).

    A place that is in its own set may hold two tokens. Places of the right of A3 take part, those of -1 do not: they
    take activity away, and what is left out then only makes the relation larger.
    """
    bits = play.game.places
    steps: list[tuple[int, list[int]]] = []  # from a place, to places
    free: list[list[int]] = []  # what appears by itself
    for rule in play.rules:
        given = [bits.one[number] for number, count in rule.gives for _ in range(count)]
        made = [bits.one[number] for number, count in rule.makes for _ in range(count)]
        me = 1 << bits.node[rule.actor] if rule.actor in bits.node else 0
        right = [1 << bits.right[rule.actor]] if rule.right else []
        if rule.minus:
            continue
        if rule.kind == "is set":
            free += [[me]] if rule.keeps == "active" else []
        elif rule.clears:
            steps += [(low, given) for low in singles(rule.needs & play.mask & _first_bits(play))]
        elif rule.take >= 0:
            steps.append((bits.one[rule.take], given or ([me] if rule.keeps == "active" else [])))
        else:
            if made:
                free.append(made)
            if given:
                steps += [(place, given + right) for place in (me, *right)]
    return _closed(play, steps, free)


def _first_bits(play: Play) -> int:
    """The bits that stand for a place: not those that say that there are several."""
    return ~sum(play.game.places.two)


def _closed(play: Play, steps: list[tuple[int, list[int]]], free: list[list[int]]) -> dict[int, int]:
    together: dict[int, int] = {}
    changed, work = True, 0

    def mark(places: list[int], others: int) -> None:
        nonlocal changed, work
        work += len(places)
        for number, place in enumerate(places):
            if place not in together:
                together[place] = 0
                changed = True
            new = others
            for other in (*places[:number], *places[number + 1 :]):
                new |= other
            if new & ~together[place]:
                together[place] |= new
                changed = True
                work += new.bit_count()
                for low in singles(new):
                    together[low] = together.get(low, 0) | place

    bits = play.game.places
    first = [bits.one[number] for number in play.game.start if bits.one[number] & play.mask]
    mark(first, 0)
    while changed:
        changed = False
        everything = sum(together)
        for places in free:
            mark(places, everything & ~places[0] if len(places) == 1 else everything)
        for before, places in steps:
            if work > _MOST_WORK:
                everything = play.mask & _first_bits(play)
                return dict.fromkeys(singles(everything), everything)
            if before in together:
                mark(places, together[before])
    return together

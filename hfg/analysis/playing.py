"""Plays the token game among some nodes: what may happen next in a state. Depends on `game`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Literal, TypeAlias

from hfg.analysis.game import Game
from hfg.analysis.places import singles
from hfg.analysis.rules import Rule
from hfg.graph.flat import ROOT

__all__ = ["Play"]

By: TypeAlias = Literal["nobody", "right", "active"]
"""In whose name a rule is applied: of a sender that is not active, that has the right of A3, or that is active."""


class Play:
    """The game among some of the nodes; the others are left out, so gates that depend on them count as open.

    Attributes:
      nodes: those that take part.
      mask: the bits of all places among them.
      rules: what may happen among them.
      first: the state in which the run starts: its activity is in transit.
    """

    def __init__(self, game: Game, nodes: Iterable[int]) -> None:
        self.game = game
        self.nodes = frozenset(nodes)
        self._places = places = game.places
        self.mask = places.around(self.nodes)
        self.first = 0
        for number in game.start:
            if places.one[number] & self.mask:
                self.first = places.added(self.first, number)
        self._open = {by: places.mask_of(by) for rule in game.rules for by in rule.gates}
        self.rules = list(self._chosen())
        self._waits = {rule: sum(places.one[number] for number in rule.after) for rule in self.rules if rule.after}
        self._by_bit: dict[int, list[tuple[Rule, By]]] = {}
        self._always: list[Rule] = []
        for rule in self.rules:
            self._index(rule)
        self._over = {
            index: Rule(f'what "{game.flat.path(index)}" was doing is over', "takes", index) for index in places.right
        }

    # --- which rules there are, by what each needs

    def _chosen(self) -> Iterator[Rule]:
        """Yield the rules that take part; of two with the same effect one is enough."""
        seen: set[object] = set()
        for rule in self.game.rules:
            if not self._takes_part(rule):
                continue
            known = all(self._open[by] and not self._open[by] & ~self.mask for by in rule.gates)
            gates = rule.gates if known else ()
            effect = (rule.gives, rule.makes, rule.takes_away, rule.keeps, rule.right, rule.clears)
            key = (rule.actor, rule.take, rule.minus, rule.kind == "is set", rule.after, effect)
            if (key, gates) not in seen and (key, ()) not in seen:
                seen.add((key, gates))
                yield rule if gates == rule.gates else replace(rule, gates=gates)

    def _takes_part(self, rule: Rule) -> bool:
        if rule.actor > ROOT:
            return rule.actor in self.nodes
        if rule.take >= 0:
            return bool(self._places.one[rule.take] & self.mask)
        return bool(rule.needs & self.mask)

    def _index(self, rule: Rule) -> None:
        """Note a rule under each bit that lets it be applied."""
        for bit, by in self._needs(rule):
            if bit is None:
                self._always.append(rule)
            else:
                self._by_bit.setdefault(bit, []).append((rule, by))

    def _needs(self, rule: Rule) -> Iterator[tuple[int | None, By]]:
        places = self._places
        if rule.clears:
            for low in singles(rule.needs & self.mask):
                yield low.bit_length() - 1, "active"
        elif rule.take >= 0:
            yield places.minus[rule.take] if rule.minus else places.one[rule.take].bit_length() - 1, "active"
        elif rule.kind == "is set":
            yield (places.node[rule.actor] if rule.keeps == "inactive" else None), "active"
        else:
            if rule.makes or rule.takes_away:
                yield None, "nobody"
            if rule.gives:
                yield places.node[rule.actor], "active"
                if rule.right:
                    yield places.right[rule.actor], "right"

    # --- what follows a state

    def steps_from(self, state: int) -> Iterator[tuple[Rule, int]]:
        """Yield each rule that may be applied and changes something, with the state after it."""
        for rule in self._always:
            yield from self._apply(rule, state, "nobody")
        cleared: set[int] = set()
        for low in singles(state):
            for rule, by in self._by_bit.get(low.bit_length() - 1, ()):
                if rule.clears:
                    if id(rule) in cleared:
                        continue
                    cleared.add(id(rule))
                yield from self._apply(rule, state, by)
        for index, bit in self._places.right.items():
            if state >> bit & 1:
                yield self._over[index], state & ~(1 << bit)

    def _apply(self, rule: Rule, state: int, by: By) -> Iterator[tuple[Rule, int]]:
        """Yield the states after a rule: activity is taken, then the gates are looked at, then something leaves."""
        if rule.after and state & self._waits[rule]:
            return
        me = self._places.own(rule.actor)
        for before in self._before(rule, state):
            if by == "nobody" and rule.makes and before & me:
                continue  # an active sender makes none out of nothing (rule A4)
            taken = self._received(rule, before & ~rule.clears, me)
            if rule.gates and not all((state | taken) & self._open[gate] for gate in rule.gates):
                continue
            after = self._sent(rule, taken, me, by)
            if after != state:
                yield rule, after

    def _before(self, rule: Rule, state: int) -> tuple[int, ...]:
        """The possible states once the token that a rule takes is gone from its edge."""
        if rule.take < 0:
            return (state,)
        if rule.minus:
            return (state & ~(1 << self._places.minus[rule.take]), state)
        return self._places.taken(state, rule.take)

    def _received(self, rule: Rule, state: int, me: int) -> int:
        """The state once what is taken has acted on A(v) (rules A6, A7); -1 leaves the right of A3."""
        if rule.keeps == "active":
            return state | me
        if rule.keeps == "inactive":
            state &= ~me
            if rule.actor in self._places.right and not rule.minus:
                state &= ~(1 << self._places.right[rule.actor])
        return state

    def _sent(self, rule: Rule, state: int, me: int, by: By) -> int:
        """The state once everything has left (rules A3-A5)."""
        gives = bool(rule.gives) and by != "nobody"
        for number, count in rule.gives if gives else rule.makes:
            for _ in range(count):
                state = self._places.added(state, number)
        if gives and not rule.clears:
            state &= ~me
            if rule.right:
                state |= 1 << self._places.right[rule.actor]
        for number in rule.takes_away:
            state |= 1 << self._places.minus[number]
        return state

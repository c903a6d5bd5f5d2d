"""The rules of the token game: one thing each that may happen to activity. Depends on `bags`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from hfg.analysis.bags import NOTHING, Bag

__all__ = ["Kind", "Rule", "Unread", "named"]

Kind: TypeAlias = Literal[
    "fires", "is called", "sends", "takes", "takes -1", "loses", "gets back", "is set", "times out"
]


@dataclass(frozen=True, slots=True)
class Unread:
    """Code that could not be read, so anything is assumed of it."""

    path: str
    handler: str
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Rule:
    """One thing that may happen.

    Attributes:
      text: in words.
      actor: the node, or the subgraph as in `End.node`.
      take: the edge from which a token is taken; -1 for none.
      minus: the token taken has -1.
      gives: the active edges that get +1 if the actor is active, and how often.
      makes: those that get +1 even if it is not (rule A4).
      takes_away: the edges that get -1.
      sent: the ports it is sent over, for a replay: name, modifier and how often.
      keeps: A(v) after it, where nothing leaves: "active", "inactive", or "" for no change.
      right: the actor keeps the right of A3 after it.
      gates: the nodes or subgraphs that have to be active.
      clears: a subgraph's bits, all of which go (rule G2).
      needs: the subgraph's bits of which one must be set.
      after: edges from `start` whose tokens have to be taken first (rules A10, F9).
    """

    text: str
    kind: Kind
    actor: int
    take: int = -1
    minus: bool = False
    gives: tuple[tuple[int, int], ...] = ()
    makes: tuple[tuple[int, int], ...] = ()
    takes_away: tuple[int, ...] = ()
    sent: tuple[tuple[str, int | None, int], ...] = ()
    keeps: Literal["active", "inactive", ""] = ""
    right: bool = False
    gates: tuple[int, ...] = ()
    clears: int = 0
    needs: int = 0
    after: tuple[int, ...] = ()

    @property
    def may_lose(self) -> bool:
        """Whether activity may vanish by it."""
        return self.kind == "loses" or self.keeps == "inactive" or (bool(self.clears) and not self.gives)

    @property
    def most_made(self) -> int:
        """How many tokens with +1 it puts where one activity was; 2 if it makes activity out of nothing."""
        if self.makes or self.right or (self.kind == "is set" and self.keeps == "active"):
            return 2
        return sum(count for _, count in self.gives)


def named(bag: Bag) -> str:
    """Name what is sent: "done", "done twice and failed with -1"."""
    if bag == NOTHING:
        return "nothing"
    parts = []
    for (port, modifier), count in sorted(bag, key=repr):
        parts.append(port + (" twice" if count > 1 else "") + (f" with {modifier:+d}" if modifier is not None else ""))
    return " and ".join(parts)

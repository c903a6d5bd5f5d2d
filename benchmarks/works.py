"""The work that everybody is given: the columns of the tables.

Values are small integers; a node of a chain passes them on. A chain of K nodes has a source, K nodes and a sink, and
so K + 1 hops. Every participant gets the same number of tokens. One that has no method for a work cannot do it.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import NamedTuple

from benchmarks.measure import Case

__all__ = ["WORKS", "Participant", "Work", "cases"]


class Work(NamedTuple):
    """A column: what it is called, which method of a participant does it, and with how many tokens."""

    title: str
    method: str
    arguments: tuple[int, ...]
    parts: int
    """What the number of hops in a measurement is divided by to get the number of tokens."""


WORKS = {
    "A1": Work("A, K = 1", "chain", (1,), 2),
    "A10": Work("A, K = 10", "chain", (10,), 11),
    "A50": Work("A, K = 50", "chain", (50,), 51),
    "B1": Work("B, K = 1", "flight", (1,), 2),
    "B10": Work("B, K = 10", "flight", (10,), 11),
    "B50": Work("B, K = 50", "flight", (50,), 51),
    "C": Work("C", "join", (), 6),
    "E": Work("E", "transfer", (), 11),
    "E0": Work("E without", "transfer_baseline", (), 11),
    "S": Work("E", "step", (), 1),
}


class Participant:
    """Somebody who does some of the works.

    Methods, each with the number of tokens last: `chain(length, tokens)` and `flight(length, tokens)` give
    microseconds a hop, `join(tokens)` a token, `transfer(tokens)` a hop, `step(tokens)` a step of state.
    """

    name: str


def cases(participants: Iterable[Participant], works: Iterable[str], hops: int) -> dict[str, Case]:
    """Every participant with every work it can do."""
    found = {}
    for participant in participants:
        for name in works:
            work = WORKS[name]
            method = getattr(participant, work.method, None)
            if method is not None:
                found[f"{participant.name} | {name}"] = Case(
                    partial(method, *work.arguments), max(2, hops // work.parts)
                )
    return found

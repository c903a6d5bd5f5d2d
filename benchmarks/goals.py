"""What is to be reached, and whether it is: the ratio of ours to the peer's in each round, and its median.

Knows nothing of what is measured. A ratio is made of two figures of the same round, so that what else the machine does
meets both; the table shows its median over the rounds, and the lowest and highest.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from benchmarks.figures import caption, figure
from benchmarks.measure import Record

__all__ = ["Goal", "Side", "Verdict", "cases_of", "judge", "verdicts"]

CPU = "cpu"


class Side(NamedTuple):
    """A figure of a case."""

    case: str
    figure: str = CPU


class Goal(NamedTuple):
    """One line of the table."""

    name: str
    ours: Side
    peer: Side | float
    """A figure of a case, or what is known beforehand, in the unit of ours."""
    at_most: float
    """What the ratio may be."""
    alone: bool = False
    """The goal is for our own figure, in percent, and the peer's only stands beside it."""

    @property
    def sides(self) -> list[Side]:
        """The figures that have to be measured."""
        return [side for side in (self.ours, self.peer) if isinstance(side, Side)]


class Verdict(NamedTuple):
    """The result of the rounds for a goal."""

    ours: float
    peer: float
    judged: list[float]
    """For each round the ratio, or our own figure where the goal is for that."""
    reached: bool

    @property
    def median(self) -> float:
        """What is compared with the goal."""
        return statistics.median(self.judged)


def cases_of(goals: Iterable[Goal]) -> list[str]:
    """The cases that are needed to judge these."""
    return list(dict.fromkeys(side.case for goal in goals for side in goal.sides))


def judge(goal: Goal, records: Mapping[str, Record]) -> Verdict:
    """Compare, round by round."""
    ours = records[goal.ours.case].figures[goal.ours.figure]
    if isinstance(goal.peer, Side):
        peer = records[goal.peer.case].figures[goal.peer.figure]
    else:
        peer = [goal.peer] * len(ours)
    judged = ours if goal.alone else [one / other for one, other in zip(ours, peer, strict=True)]
    return Verdict(statistics.median(ours), statistics.median(peer), judged, statistics.median(judged) <= goal.at_most)


def verdicts(goals: Iterable[Goal], records: Iterable[Record], missing: Mapping[str, str]) -> str:
    """The table as text: what, ours, peer, the judged figure with its range, the goal, and whether it is reached.

    Args:
      goals: the lines.
      records: what was measured.
      missing: why a case is missing: the package is not installed, or a failure, of which the last line is shown.
    """
    found = {record.case: record for record in records}
    goals = list(goals)
    width = max((len(goal.name) for goal in goals), default=0)
    lines = [f"  {'':{width}} {'ours':>9} {'peer':>9}     {'ratio':>8} {'lowest to highest':>19} {'goal':>6}  reached?"]
    reached = judged = 0
    for goal in goals:
        absent = next((side.case for side in goal.sides if side.case not in found), None)
        if absent is not None:
            reason = missing.get(absent, "was not measured").strip().splitlines()[-1]
            lines.append(f"  {goal.name:{width}} not measured: {absent}: {reason}")
            continue
        verdict, unit = judge(goal, found), found[goal.ours.case].unit
        ends = f"{figure(min(verdict.judged))} to {figure(max(verdict.judged))}"
        sign = "%" if goal.alone else ""
        lines.append(
            f"  {goal.name:{width}} {figure(verdict.ours):>9} {figure(verdict.peer):>9} {unit:3} "
            f"{figure(verdict.median) + sign:>8} {ends:>19} {goal.at_most:>6.3g}  {'yes' if verdict.reached else 'no'}"
        )
        judged += 1
        reached += verdict.reached
    lines.append(f"  {reached} of {judged} goals reached; {len(goals) - judged} not measured")
    if found:
        lines.append(f"  {caption(found).replace('*', '')}")
    return "\n".join(lines)

"""Parts of which nothing is lost when they die, and where a new life of a part goes on (rule L2, docs/links.md).

A component (see `components`) in which each token gives exactly one on each edge that leaves it needs no ledger: what
it sends inherits the positions of what it was sent, and a token counts as done when all that came of it is done. A new
life of it is sent what was not done, sends what comes of that once more, and whoever has it already knows it by its
number. Any other component goes on behind the last number that anybody outside knows of. Decides, never waits. Stands
on graphs that are cut.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeAlias

from hfg.graph.flat import LINK, MAIN, Cutting, End, FlatGraph
from hfg.graph.flat.order import strongly_connected
from hfg.parts.model.components import Component, components

__all__ = [
    "UNKNOWN",
    "Alignment",
    "Arrived",
    "Inheritance",
    "Where",
    "inherited",
    "inheriting",
    "keeping",
    "remembered",
]

Where: TypeAlias = tuple[int, int]
"""The position of a token: stream and number. Over an edge from an output numbers grow by one through all lives."""

UNKNOWN: Final[Where] = (-1, 0)
"""Said of a position by a life of a part that was not told yet where it goes on."""

Arrived: TypeAlias = tuple[tuple[Any, int, float], Where]
"""A token that has come (value, modifier and stamp), and its position."""


def inheriting(cutting: Cutting) -> frozenset[str]:
    """Give the parts with components whose tokens inherit positions; all parts of a run come to the same answer.

    A delay holds tokens back for good, so it would hold up who waits until they are done: with one in the graph none
    does; nor does one beside a ledger (see `keeping`).
    """
    if keeping(cutting):
        return frozenset()
    return frozenset(name for name, found in _answering(cutting).items() if found)


def inherited(cutting: Cutting) -> frozenset[str]:
    """Give the edges between parts, by label, whose tokens inherit their positions."""
    return frozenset(
        label
        for name, found in _answering(cutting).items()
        if name in inheriting(cutting)
        for component in found
        for label in component.leaving
    )


def remembered(cutting: Cutting) -> frozenset[str]:
    """Give the edges between parts, by label, whose producer remembers what it has sent, in another life too."""
    keeps = keeping(cutting)
    return inherited(cutting) | {edge.label for edge in cutting.edges if edge.source in keeps}


def keeping(cutting: Cutting) -> dict[str, bool | str]:
    """Give the parts that have a ledger, and where: as in `GroupSpec`; all parts of a run come to the same answer.

    Beside one that was asked for, those that would inherit positions have one too: a neighbour that goes on from what
    it has kept has not got all that it was sent, and what is inherited alone would not tell. So they do where two of
    them feed each other: a token would be done when it is done at the other, and there when it is done here.
    """
    asked_for, answering = _asked_for(cutting), _answering(cutting)
    if not asked_for and not _feed_each_other(cutting, answering):
        return {}
    whole = components(cutting)
    also: dict[str, bool | str] = {name: True for name, found in answering.items() if found and found == whole[name]}
    return also | asked_for


def _answering(cutting: Cutting) -> dict[str, tuple[Component, ...]]:
    """The components that would inherit positions, by part."""
    return {name: tuple(one for one in found if one.answers) for name, found in components(cutting).items()}


def _feed_each_other(cutting: Cutting, answering: Mapping[str, tuple[Component, ...]]) -> bool:
    """Whether what leaves one of these components comes back to it, by way of whatever nodes."""
    home = {
        path: (name, number)
        for name, found in answering.items()
        for number, component in enumerate(found)
        for path in component.nodes
    }
    numbers: dict[object, int] = {("component", *one): number for number, one in enumerate(sorted(set(home.values())))}
    count = len(numbers)
    fed: list[list[int]] = [[] for _ in numbers]

    def number_of(end: End, flat: FlatGraph) -> int:
        path = "" if end.node == LINK else flat.nodes[end.node].path
        name: object = ("edge", end.name) if end.node == LINK else ("node", path)
        if path in home:
            name = ("component", *home[path])
        if name not in numbers:
            numbers[name] = len(numbers)
            fed.append([])
        return numbers[name]

    for flat in cutting.parts.values():
        for edge in flat.edges:
            if all(end.node >= 0 or end.node == LINK for end in (edge.source, edge.target)):
                fed[number_of(edge.source, flat)].append(number_of(edge.target, flat))
    return any(len(together) > 1 and together[0] < count for together in strongly_connected(fed))


def _asked_for(cutting: Cutting) -> dict[str, bool | str]:
    return {
        name: flat.groups[name].ledger
        for name, flat in cutting.parts.items()
        if name != MAIN and flat.groups[name].ledger
    }


class Inheritance:
    """The positions of what a part will send: the n-th of them is that of the n-th token that came.

    That is the same on all edges, unless a source has begun anew; so the first edge says it, and when that has brought
    END the next one, which may go on longer.
    """

    def __init__(self, labels: Iterable[str]) -> None:
        """Nothing has come yet.

        Args:
          labels: of the edges that come in.
        """
        self._leading = deque(labels)
        self._ahead: dict[str, deque[tuple[int, Where]]] = {label: deque() for label in self._leading}
        self._came = dict.fromkeys(self._leading, 0)
        self._ended: set[str] = set()
        self._given = 0

    def arrive(self, label: str, came: list[Where], *, ended: bool) -> list[Where]:
        """Take the positions of tokens that came on an edge, perhaps END behind them; gives what is known by that."""
        ahead = self._ahead[label]
        ahead.extend(enumerate(came, self._came[label]))
        self._came[label] += len(came)
        if ended:
            self._ended.add(label)
        given: list[Where] = []
        while self._leading:
            ahead = self._ahead[self._leading[0]]
            given += [where for index, where in ahead if index >= self._given + len(given)]
            ahead.clear()
            if self._leading[0] not in self._ended:
                break
            self._leading.popleft()
        self._given += len(given)
        for ahead in self._ahead.values():
            while ahead and ahead[0][0] < self._given:
                ahead.popleft()
        return given


class Alignment:
    """Where a component goes on in a new life of its part: behind the last number of which anybody outside knows.

    What belongs together has the same number on all its edges. What was done may be known to one producer and not yet
    to another, and consumers may have got what no producer knows to be done; whatever is older came of former lives, or
    is lost with them.

    Attributes:
      start: the number with which it goes on on all edges; None: not all have told yet.
    """

    def __init__(self, coming: Mapping[str, int], leaving: Iterable[str] = (), *, start: int | None = None) -> None:
        """Begin knowing nothing.

        Args:
          coming: the edges that come in, by label, and how many initial values each has.
          leaving: those that leave and of which consumers tell what has come.
          start: where it goes on, if that is known.
        """
        self.start = start
        self._delays = dict(coming)
        self._done: dict[str, int | None] = dict.fromkeys(coming)
        self._came: dict[str, int | None] = dict.fromkeys(leaving)
        self._held: dict[str, list[Arrived]] = {label: [] for label in coming}
        self._look()

    def done(self, label: str, number: int) -> None:
        """The producer of an edge knows that all up to that number is done."""
        if self._done.get(label, 0) is None:
            self._done[label] = number
            self._look()

    def came(self, label: str, number: int) -> None:
        """The consumer of an edge has got all up to that number, as far as it knows."""
        if self._came.get(label, 0) is None:
            self._came[label] = number
            self._look()

    def hold(self, label: str, tokens: list[Arrived]) -> None:
        """These have come before all have told."""
        self._held[label] += tokens
        if tokens:
            self.done(label, tokens[0][1][1] - 1)

    def let_go(self) -> dict[str, list[Arrived]]:
        """Give what was held, now that it is known where it goes on."""
        held, self._held = self._held, {label: [] for label in self._held}
        return held

    def passed_over(self, label: str) -> int:
        """How many tokens of an edge that comes in are behind the start, and were not known to be done."""
        return 0 if self.start is None else max(self.start - 1 - (self._done[label] or 0), 0)

    def _look(self) -> None:
        if self.start is not None:
            return
        known = [number for number in self._came.values() if number is not None]
        for label, done in self._done.items():
            if done is not None:
                known.append(done and done + self._delays[label])
        if len(known) == len(self._came) + len(self._done):
            self.start = 1 + max(known, default=0)

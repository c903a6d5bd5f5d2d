"""Parts that lose nothing when they die, and where a new incarnation of a part resumes (rule L2, docs/links.md).

A component (see `components`) in which each token yields exactly one on each leaving edge needs no ledger: its tokens
inherit the positions of the incoming ones, and a token counts as processed when all its consequences are. A new
incarnation is sent the tokens that were not processed and sends their consequences once more; consumers that already
have them recognise them by their numbers. Any other component resumes after the last number that is known outside.
Decides, never waits. Depends on graphs that are cut.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, Final, TypeAlias

from hfg.graph.flat import LINK, MAIN, Cutting, End, FlatGraph
from hfg.graph.flat.order import strongly_connected
from hfg.parts.model.components import Component, components

Where: TypeAlias = tuple[int, int]
"""The position of a token: stream and number. On an edge from an output, numbers grow by one in all incarnations."""

UNKNOWN: Final[Where] = (-1, 0)
"""Position reported by an incarnation of a part that does not know yet where it resumes."""

Arrived: TypeAlias = tuple[tuple[Any, int, float], Where]
"""A token that has come (value, modifier and stamp), and its position."""


def inheriting(cutting: Cutting) -> frozenset[str]:
    """Return the parts with components whose tokens inherit positions. All parts of a run compute the same result.

    A delay keeps tokens back permanently, so it would block anything that waits until they are processed. With a delay
    in the graph, no part inherits positions; nor does a part with a neighbour that has a ledger (see `keeping`).
    """
    if keeping(cutting):
        return frozenset()
    return frozenset(name for name, found in _answering(cutting).items() if found)


def inherited(cutting: Cutting) -> frozenset[str]:
    """Return the labels of the edges between parts whose tokens inherit their positions."""
    return frozenset(
        label
        for name, found in _answering(cutting).items()
        if name in inheriting(cutting)
        for component in found
        for label in component.leaving
    )


def remembered(cutting: Cutting) -> frozenset[str]:
    """Return the labels of the edges between parts whose producer remembers the tokens of its previous incarnations."""
    keeps = keeping(cutting)
    return inherited(cutting) | {edge.label for edge in cutting.edges if edge.source in keeps}


def keeping(cutting: Cutting) -> dict[str, bool | str]:
    """Return the parts that have a ledger, and where: as in `GroupSpec`; all parts of a run come to the same answer.

    Next to a part with a requested ledger, parts that would inherit positions get a ledger, too: a neighbour that
    resumes from its ledger lacks some tokens that it was sent, and inherited positions alone would not show this. The
    same holds if two such parts feed each other: a token would be processed here when it is processed there, and there
    when it is processed here.
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
    """Return whether tokens that leave one of these components come back to it, through any nodes."""
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
    """The positions of the tokens that a part will send: the n-th is that of the n-th incoming token.

    They are the same on all edges unless a source has started over. So the first edge determines them, and after its
    END the next one, which may continue longer.
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
        """Record the positions of tokens that arrived on an edge, perhaps followed by END.

        Return the positions known by now.
        """
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
    """Where a component resumes in a new incarnation of its part: after the last number that is known outside.

    Tokens that belong together have the same number on all edges. One producer may know that a token was processed and
    another one not yet, and consumers may have tokens that no producer knows to be processed. All older tokens are from
    previous incarnations, or lost with them.

    Attributes:
      start: the number with which it resumes on all edges; None: some reports are missing.
    """

    def __init__(self, coming: Mapping[str, int], leaving: Iterable[str] = (), *, start: int | None = None) -> None:
        """Start without information.

        Args:
          coming: the edges that come in, by label, and how many initial values each has.
          leaving: the leaving edges whose consumers report what has arrived.
          start: where it resumes, if known.
        """
        self.start = start
        self._delays = dict(coming)
        self._done: dict[str, int | None] = dict.fromkeys(coming)
        self._came: dict[str, int | None] = dict.fromkeys(leaving)
        self._held: dict[str, list[Arrived]] = {label: [] for label in coming}
        self._look()

    def done(self, label: str, number: int) -> None:
        """The producer of an edge knows that everything up to `number` is processed."""
        if self._done.get(label, 0) is None:
            self._done[label] = number
            self._look()

    def came(self, label: str, number: int) -> None:
        """The consumer of an edge has received everything up to `number`, as far as it knows."""
        if self._came.get(label, 0) is None:
            self._came[label] = number
            self._look()

    def hold(self, label: str, tokens: list[Arrived]) -> None:
        """Keep tokens that arrive before all reports."""
        self._held[label] += tokens
        if tokens:
            self.done(label, tokens[0][1][1] - 1)

    def let_go(self) -> dict[str, list[Arrived]]:
        """Return the kept tokens, now that the start is known."""
        held, self._held = self._held, {label: [] for label in self._held}
        return held

    def passed_over(self, label: str) -> int:
        """Return how many tokens of an incoming edge are before the start and were not known to be processed."""
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

"""Parts of which nothing is lost when they die, and where a new life of a part goes on (rule L2, docs/links.md).

A part in which each token gives exactly one on each edge that leaves it needs no ledger: what it sends inherits the
positions of what it was sent, and a token counts as done when all that came of it is done. A new life of it is sent
what was not done, sends what comes of that once more, and whoever has it already knows it by its position. Decides,
never waits. Stands on graphs that are cut.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any, Final, TypeAlias

from hfg.graph.flat import LINK, MAIN, Cutting, End, FlatEdge, FlatGraph, FlatNode
from hfg.graph.flat.order import strongly_connected

__all__ = ["UNKNOWN", "Alignment", "Arrived", "Inheritance", "Where", "inheriting", "keeping", "remembering"]

Where: TypeAlias = tuple[int, int]
"""The position of a token: stream and number; (0, 0) is before all of them."""

UNKNOWN: Final[Where] = (-1, 0)
"""Said of a position by a life of a part that was not told yet where it goes on."""

Arrived: TypeAlias = tuple[tuple[Any, int, float], Where]
"""A token that has come (value, modifier and stamp), and its position."""


def inheriting(cutting: Cutting) -> frozenset[str]:
    """Give the parts whose tokens inherit positions; all parts of a run come to the same answer.

    A delay holds tokens back for good, so it would hold up who waits until they are done: with one in the graph none
    does; nor does one beside a ledger (see `keeping`).
    """
    return frozenset() if keeping(cutting) else _one_to_one(cutting)


def keeping(cutting: Cutting) -> dict[str, bool | str]:
    """Give the parts that have a ledger, and where: as in `GroupSpec`; all parts of a run come to the same answer.

    Beside one that was asked for, those that would inherit positions have one too: a neighbour that goes on from what
    it has kept has not got all that it was sent, and what is inherited alone would not tell. So they do where two of
    them feed each other: a token would be done when it is done at the other, and there when it is done here.
    """
    asked_for, one_to_one = _asked_for(cutting), _one_to_one(cutting)
    if not asked_for and not _feed_each_other(cutting, one_to_one):
        return {}
    also: dict[str, bool | str] = dict.fromkeys(one_to_one, True)
    return also | asked_for


def _feed_each_other(cutting: Cutting, parts: frozenset[str]) -> bool:
    """Whether what leaves one of these parts comes back to it, by way of whatever nodes."""
    numbers = {("part", name): number for number, name in enumerate(sorted(parts))}
    fed: list[list[int]] = [[] for _ in numbers]

    def number_of(end: End, flat: FlatGraph, part: str) -> int:
        name = ("edge", end.name) if end.node == LINK else ("part", part)
        if end.node >= 0 and part not in parts:
            name = ("node", flat.nodes[end.node].path)
        if name not in numbers:
            numbers[name] = len(numbers)
            fed.append([])
        return numbers[name]

    for part, flat in cutting.parts.items():
        for edge in flat.edges:
            if all(end.node >= 0 or end.node == LINK for end in (edge.source, edge.target)):
                fed[number_of(edge.source, flat, part)].append(number_of(edge.target, flat, part))
    return any(len(together) > 1 and together[0] < len(parts) for together in strongly_connected(fed))


def _asked_for(cutting: Cutting) -> dict[str, bool | str]:
    return {
        name: flat.groups[name].ledger
        for name, flat in cutting.parts.items()
        if name != MAIN and flat.groups[name].ledger
    }


def remembering(cutting: Cutting) -> frozenset[str]:
    """Give the parts that remember what they have sent, in another life too."""
    return inheriting(cutting) | keeping(cutting).keys()


def _one_to_one(cutting: Cutting) -> frozenset[str]:
    if any(edge.initial for flat in cutting.parts.values() for edge in flat.edges):
        return frozenset()
    return frozenset(name for name, flat in cutting.parts.items() if name != MAIN and _is_one_to_one(flat))


def _is_one_to_one(flat: FlatGraph) -> bool:
    """Whether each token that comes in is answered by one on each edge that leaves.

    For that all of it hangs together: of two chains that have nothing in common one may be far ahead of the other.
    """
    fed = {edge.target.node for edge in flat.edges}
    sending = {edge.source.node for edge in flat.edges}
    return (
        not flat.gates
        and any(edge.source.node == LINK for edge in flat.edges)
        and all(map(_carries_data, flat.edges))
        and all(node.index in fed and _answers_each(node, node.index in sending) for node in flat.nodes)
        and _hangs_together(flat)
    )


def _carries_data(edge: FlatEdge) -> bool:
    is_of_data = edge.source.kind == "output" and edge.target.kind == "input"
    return is_of_data and not edge.active and (edge.source.node >= 0 or edge.source.node == LINK)


def _hangs_together(flat: FlatGraph) -> bool:
    beside: list[list[int]] = [[] for _ in flat.nodes]
    for edge in flat.edges:
        if edge.source.node >= 0 and edge.target.node >= 0:
            beside[edge.source.node].append(edge.target.node)
            beside[edge.target.node].append(edge.source.node)
    return len(strongly_connected(beside)) == 1


def _answers_each(node: FlatNode, sends: bool) -> bool:
    if sends and node.node._hook("end") is not None:
        return False  # it may have a last word, which answers nothing
    options = node.options
    return options.enabled and options.concurrency == 1 and options.on_error == "stop" and not options.active_for_s


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
    """Where the edges into a new life of a part go on together.

    What belongs together has the same number on all of them. What was done may be known to one producer and not yet to
    another; so all go on behind the one that knows most, and what comes of less was done by a former life.
    """

    def __init__(self, labels: Iterable[str]) -> None:
        """Begin knowing nothing.

        Args:
          labels: of the edges of data that come in and lose nothing.
        """
        self._next: dict[str, Where | None] = dict.fromkeys(labels)
        self._held: dict[str, list[Arrived]] = {}
        self._start: Where | None = (0, 0) if len(self._next) < 2 else None

    def goes_on(self, label: str, last: Where) -> None:
        """The producer says which token was the last that it knows to be done, or that it does not know yet."""
        if last != UNKNOWN and label in self._next and self._next[label] is None:
            self._next[label] = (last[0], last[1] + 1)

    @property
    def behind(self) -> Where:
        """The position of the last token that was done by former lives, on any of the edges; or `UNKNOWN`."""
        start = self._start if len(self._next) > 1 else next(iter(self._next.values()), None)
        return UNKNOWN if start is None else (start[0], max(start[1] - 1, 0))

    def held(self, label: str) -> int:
        """How many tokens of an edge wait here."""
        return len(self._held.get(label, ())) if self._start is None else 0

    def arrive(self, label: str, tokens: list[Arrived]) -> dict[str, tuple[int, list[Arrived]]]:
        """Take what has come, perhaps nothing; gives what is to be laid now: how many to skip, and the others."""
        if label not in self._next:
            return {label: (0, tokens)}
        if self._start is not None:
            return {label: self._without_done(tokens, self._start)}
        if tokens and self._next[label] is None:
            self._next[label] = tokens[0][1]
        self._held.setdefault(label, []).extend(tokens)
        known = [where for where in self._next.values() if where is not None]
        if len(known) < len(self._next):
            return {}
        # Numbers of different streams have nothing in common: a source has begun anew, and what it had sent is lost.
        start = self._start = max(known) if len({stream for stream, _ in known if stream}) < 2 else (0, 0)
        return {one: self._without_done(held, start) for one, held in self._held.items() if held}

    @staticmethod
    def _without_done(tokens: list[Arrived], start: Where) -> tuple[int, list[Arrived]]:
        if not tokens or tokens[0][1] >= start:
            return 0, tokens
        later = [token for token in tokens if token[1] >= start]
        return len(tokens) - len(later), later

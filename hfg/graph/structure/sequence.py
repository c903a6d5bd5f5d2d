"""A sequence in which places are found without counting: order maintenance by labels.

Each item has a number that grows along the sequence; one that comes between two others gets a number between theirs, so
that no other item is renumbered. Only when two numbers have nothing between them any more, all are numbered again; that
takes some fifty insertions at one spot, so that its cost is shared by them. Depends on nothing.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from typing import Generic, TypeVar

T = TypeVar("T")


def between(before: float | None, behind: float | None) -> float | None:
    """Return a number between two neighbours, either of which may be missing; None if there is no room."""
    if before is None:
        return 0.0 if behind is None else behind - 1.0
    if behind is None:
        return before + 1.0
    middle = (before + behind) / 2
    return middle if before < middle < behind else None


class Sequence(Generic[T]):
    """Items in an order, each once.

    Attributes:
      items: in order; for others to read.
      numbering: how often all were numbered again.
    """

    def __init__(self, items: Iterable[T] = ()) -> None:
        self.items: list[T] = list(items)
        self._labels: dict[T, float] = {}
        self.numbering = 0
        self._renumber()

    def __contains__(self, item: T) -> bool:
        return item in self._labels

    def label(self, item: T) -> float:
        """Return the number by which it is compared with others of this sequence, until the next insertion."""
        return self._labels[item]

    def position(self, item: T) -> int:
        """Return its place, counted from 0."""
        return bisect_left(self.items, self._labels[item], key=self._labels.__getitem__)

    def insert(self, position: int, item: T) -> None:
        """Put it in front of what has this place."""
        items, labels = self.items, self._labels
        before = labels[items[position - 1]] if position > 0 and items else None
        behind = labels[items[position]] if position < len(items) else None
        label = between(before, behind)
        items.insert(position, item)
        if label is None:
            self._renumber()
        else:
            labels[item] = label

    def remove(self, item: T) -> int:
        """Take it out; gives the place that it had."""
        position = self.position(item)
        del self.items[position], self._labels[item]
        return position

    def replace(self, item: T, other: T) -> int:
        """Put another item in its place, which is given."""
        position = self.position(item)
        self.items[position] = other
        self._labels[other] = self._labels.pop(item)
        return position

    def _renumber(self) -> None:
        self._labels = {item: float(number) for number, item in enumerate(self.items)}
        self.numbering += 1

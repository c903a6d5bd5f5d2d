"""Bags of ports that one firing or call may send, and how ways through code combine them. Depends on nothing."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final, TypeAlias

Sent: TypeAlias = tuple[str, int | None]
"""A port and the explicit modifier, None for none (rule A4). An explicit 0 sends no activity, so it is left out."""
Bag: TypeAlias = frozenset[tuple[Sent, int]]
"""What one firing or call sends, and how often: 1, or 2 for twice or more."""
NOTHING: Final[Bag] = frozenset()
MANY: Final = 2
MOST_BAGS: Final = 64


class Unknown(Exception):
    """Code that cannot be followed; the text says why."""


@dataclass(frozen=True)
class Handler:
    """The code of one kind of firing or call.

    Attributes:
      bags: what it may send.
      whole: one bag leaves in one step. Otherwise each sending is a step of its own, and others work in between.
      unknown: why the code could not be read; "" if it was.
    """

    bags: frozenset[Bag]
    whole: bool = True
    unknown: str = ""

    @property
    def sent(self) -> frozenset[Sent]:
        """All that it may send."""
        return frozenset(sent for bag in self.bags for sent, _ in bag)

    @property
    def sends_several(self) -> bool:
        """Whether there may be more than one sending in a firing or call."""
        return any(sum(count for _, count in bag) > 1 for bag in self.bags)


@dataclass(frozen=True)
class Code:
    """All sendings of a node type over certain ports.

    Attributes:
      firing: the process function; None if there is none.
      ending: the hook `end`; None if there is none.
      slots: by name.
      outside: what may be sent outside firings and calls: by timers, tasks and hooks.
    """

    firing: Handler | None = None
    ending: Handler | None = None
    slots: dict[str, Handler] = field(default_factory=dict)
    outside: frozenset[Sent] = frozenset()

    def unknown(self) -> Iterator[tuple[str, str]]:
        """Yield each handler that could not be read, and why."""
        for name, handler in (("process", self.firing), ("end", self.ending), *self.slots.items()):
            if handler is not None and handler.unknown:
                yield name, handler.unknown


def free(port: str) -> list[Sent]:
    """The sendings over a port by code that may have modifiers of its own."""
    return [(port, None), (port, 1), (port, -1)]


def some_of(sendings: Iterable[Collection[Sent]]) -> frozenset[Bag]:
    """Of each port one of its sendings or none: which values are None is not known."""
    found = {NOTHING}
    for choices in sendings:
        found |= {added(bag, {(sent, 1)}) for bag in found for sent in choices}
        if len(found) > MOST_BAGS:
            raise Unknown("it has too many outputs with active edges")
    return frozenset(found)


def added(bag: Bag, more: Iterable[tuple[Sent, int]]) -> Bag:
    """Return a bag with more in it."""
    counts = dict(bag)
    for sent, count in more:
        counts[sent] = min(MANY, counts.get(sent, 0) + count)
    return frozenset(counts.items())


def product(first: Iterable[Bag], second: Iterable[Bag]) -> set[Bag]:
    """Return what is sent by one of the first and then one of the second."""
    second = list(second)
    found = {added(a, b) for a in first for b in second}
    if len(found) > MOST_BAGS:
        raise Unknown("there are too many ways through it")
    return found


Ways: TypeAlias = dict[str, set[Bag]]
"""What was sent on the way to each exit: "next", "return", "break", "continue", "raise"."""


def either(*ways: Ways) -> Ways:
    """Return the ways of code that takes one of several."""
    found: Ways = {}
    for one in ways:
        for exit_, bags in one.items():
            found.setdefault(exit_, set()).update(bags)
    return found


def after(before: Iterable[Bag], ways: Ways) -> Ways:
    """Return the ways of code that has sent something before."""
    before = list(before)
    return {exit_: product(before, bags) for exit_, bags in ways.items()}


def loosened(handler: Handler, more: set[Sent]) -> Handler:
    """The same, in which these may be sent as well, whenever and however often."""
    return Handler(handler.bags | {frozenset({(sent, MANY)}) for sent in more}, False, handler.unknown)


def parts(ways: Ways) -> set[Bag]:
    """All that may have been sent when something fails before the end."""
    found = {NOTHING}
    for bags in ways.values():
        for bag in bags:
            found |= set(parts_of(bag))
    return found


def parts_of(bag: Bag) -> Iterator[Bag]:
    """Yield each part of a bag: the code may fail before it has sent all of it."""
    found: list[dict[Sent, int]] = [{}]
    for sent, count in bag:
        found += [{**one, sent: number} for one in found for number in range(1, count + 1)]
        if len(found) > MOST_BAGS:
            raise Unknown("there are too many ways through it")
    yield from (frozenset(one.items()) for one in found)

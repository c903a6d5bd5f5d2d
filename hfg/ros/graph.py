"""The graph of ROS: nodes, publishers, subscriptions and services, from their liveliness tokens. Bounded; pure.

Depends on wire.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import Final

from hfg.ros.wire import Entity, Kind, read_token

MOST: Final = 20_000
"""Entities that are taken note of."""


class RosGraph:
    """The entities of one domain.

    Attributes:
      refused: tokens that cannot be read, or were too many.
    """

    def __init__(self) -> None:
        self.refused = 0
        self._entities: dict[str, Entity] = {}

    def told(self, news: Iterable[tuple[bool, str]]) -> None:
        """Note which tokens are there, and which are not any more."""
        for is_there, token in news:
            if not is_there:
                self._entities.pop(token, None)
            elif token not in self._entities:
                entity = read_token(token) if len(self._entities) < MOST else None
                if entity is None:
                    self.refused += 1
                else:
                    self._entities[token] = entity

    def __iter__(self) -> Iterator[Entity]:
        return iter(list(self._entities.values()))

    def named(self, name: str, *kinds: Kind) -> list[Entity]:
        """Return those of a topic or service."""
        return [one for one in self._entities.values() if one.name == name and one.kind in kinds]

    def types(self, *kinds: Kind) -> dict[str, set[str]]:
        """Return the types by the names of topics or services, sorted by name."""
        found: defaultdict[str, set[str]] = defaultdict(set)
        for one in self._entities.values():
            if one.kind in kinds:
                found[one.name].add(one.type)
        return dict(sorted(found.items()))

    def unfit(self, mine: Entity, kind: Kind) -> list[Entity]:
        """Return those at the other end whose type differs from one's own, by name or by hash; no message passes."""
        return [one for one in self.named(mine.name, kind) if (one.type, one.hash) != (mine.type, mine.hash)]

    def fit(self, mine: Entity, kind: Kind) -> list[Entity]:
        """Return those at the other end that messages pass to or from."""
        return [one for one in self.named(mine.name, kind) if (one.type, one.hash) == (mine.type, mine.hash)]


def sentence_of(mine: Entity, other: Entity) -> str:
    """Say why two ends of one name do not match, and what to do."""
    what = {"MP": "published", "MS": "subscribed to", "SS": "served", "SC": "asked"}[other.kind]
    at = f'"{mine.name}" is {what} by node "{other.namespace.rstrip("/")}/{other.node}"'
    if other.type != mine.type:
        return f"{at} with type {other.type}, and here with {mine.type}: nothing passes; use one type, or another name"
    return (
        f"{at} with another definition of {mine.type} ({other.hash[:15]}..., here {mine.hash[:15]}...): nothing "
        "passes; use the same .msg file, or the same release of ROS 2, at both ends"
    )

"""Where node types may be: the standard library, installed distributions, and the project's own folder.

A distribution offers node types by an entry point in the group `hfg.nodes`, whose value names a module, a package (with
all its modules) or one node type, "package.module:Name". Depends on importlib; imports none of those places.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from typing import Final

import msgspec

LIBRARY: Final = "hfg.nodes"
"""The package of the standard library, and the group name of the entry points."""


class Offer(msgspec.Struct, frozen=True):
    """A module or package with node types.

    Attributes:
      module: its name, or the name in the entry point.
      name: name of one node type in it, or "" for all of them.
      origin: where it is declared, for messages: "" for the standard library, otherwise the entry point and its
        distribution.
    """

    module: str
    name: str = ""
    origin: str = ""


def offers() -> tuple[Offer, ...]:
    """Return the standard library first, then installed distributions, by the names of their entry points."""
    return (Offer(LIBRARY), *_installed())


def _installed() -> Iterator[Offer]:
    found = sorted(entry_points(group=LIBRARY), key=lambda entry: (entry.name, entry.value))
    seen: set[tuple[str, str]] = set()
    for entry in found:
        module, _, name = (part.strip() for part in entry.value.partition("[")[0].partition(":"))
        if (module, name) not in seen:  # an editable installation next to another one yields each twice
            seen.add((module, name))
            yield Offer(module, name, _origin(entry))


def _origin(entry: EntryPoint) -> str:
    distribution = entry.dist.name if entry.dist is not None else "a distribution without a name"
    return f'the entry point "{entry.name}" of {distribution}'

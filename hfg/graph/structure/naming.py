"""Names: which a node may have, how messages call it, and what was probably meant (rule G3). Depends on nodes."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from time import monotonic
from typing import Final

from hfg.base.controls import name_problem
from hfg.errors import GraphError
from hfg.nodetypes.node import Node

_LONGEST: Final = 100  # letters of a name for which others are looked at
_FEW: Final = 100  # names, which cost some milliseconds
_MOST_COMPARED: Final = 300_000  # names in a minute, where there are more; some ten seconds


def need_name(what: str, name: object) -> str:
    """Refuse what cannot be part of a path; `what` begins the message.

    Raises:
      GraphError: it is not a string, is empty, or contains control characters or one of the two separators of paths.
    """
    if not isinstance(name, str) or not name:
        raise GraphError(f"{what} needs a name that is a text and not empty, got {name!r}")
    problem = name_problem(name)
    if problem is not None:
        raise GraphError(f"{what} {problem}")
    for character in "/.":
        if character in name:
            better = name.replace("/", "_").replace(".", "_")
            raise GraphError(
                f'{what} cannot be named "{name}": "{character}" separates the parts of a path; use "{better}"'
            )
    return name


def nearest(name: str, names: Sequence[str]) -> str | None:
    """Return the name that was probably meant; None if none is near, or looking for it would take too long.

    A file may have thousands of wrong names, and for each of them thousands to compare it with.
    """
    if len(name) > _LONGEST:
        return None
    if len(names) > _FEW and not _comparing.may(len(names)):
        return None
    near = difflib.get_close_matches(name, [one for one in names if len(one) <= _LONGEST], n=1, cutoff=0.6)
    return near[0] if near else None


class _Comparing:
    """How many names this process has compared in the present minute."""

    def __init__(self) -> None:
        self._began = 0.0
        self._compared = 0

    def may(self, count: int) -> bool:
        """Return whether `count` more can be compared, and count them."""
        now = monotonic()
        if now - self._began > 60:
            self._began, self._compared = now, 0
        if self._compared + count > _MOST_COMPARED:
            return False
        self._compared += count
        return True


_comparing = _Comparing()


def suggest(name: str, known: Iterable[str]) -> str:
    """End a message about an unknown name: what was probably meant, else what there is."""
    names = list(known)
    near = nearest(name, names)
    if near is not None:
        return f'did you mean "{near}"?'
    if not names:
        return "there are none"
    shown = ", ".join(f'"{one}"' for one in names[:8])
    return f"there are {shown}" + (f" and {len(names) - 8} more" if len(names) > 8 else "")


def path_of(node: Node) -> str:
    """Return the path of a node, for messages; before it is added, its type's name stands for it."""
    return node._type.name if node._place is None else node._place.path

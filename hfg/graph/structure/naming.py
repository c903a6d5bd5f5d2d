"""Names: which a node may have, how messages call it, and what was probably meant (rule G3). Depends on nodes."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from hfg.base.controls import name_problem
from hfg.errors import GraphError
from hfg.nodetypes.node import Node


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


def suggest(name: str, known: Iterable[str]) -> str:
    """End a message about an unknown name: what was probably meant, else what there is."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if near:
        return f'did you mean "{near[0]}"?'
    if not names:
        return "there are none"
    shown = ", ".join(f'"{one}"' for one in names[:8])
    return f"there are {shown}" + (f" and {len(names) - 8} more" if len(names) > 8 else "")


def path_of(node: Node) -> str:
    """Return the path of a node, for messages; before it is added, its type's name stands for it."""
    return node._type.name if node._place is None else node._place.path

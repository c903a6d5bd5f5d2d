"""OpenCV as nodes: one type for each function that works on arrays, made of what the installed wheel says of itself.

    from hfg.nodes import cv

    graph.add(cv.gaussian_blur(ksize=(7, 7)))

Names are OpenCV's in snake case; its own are understood too, `cv.GaussianBlur`. Arrays are inputs, numbers are
parameters, constants are words: `border_type="REFLECT"`. An image of a type that a function does not accept is refused
before OpenCV sees it, because some functions would end the process. A type is made when it is first named.
`categories()` groups the names, `not_nodes()` says which functions are not nodes and why.

    _stub        functions, their arguments and constants, from the type stub
    _docs        what the docstrings say of them
    _overrides   kinds of arrays, defaults, limits, choices: what neither of them says
    _words       categories, names of outputs, which functions are left out: `words.toml`
    _recipes     makes recipes for node types of all that, and calls
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hfg.nodes._extras import require

require("cv2", "vision")  # before the modules that import it

# isort: split
from hfg.nodes._making import make  # noqa: E402
from hfg.nodes.cv import _recipes  # noqa: E402
from hfg.nodes.cv._stub import overloads  # noqa: E402
from hfg.nodes.cv._words import CATEGORIES  # noqa: E402

__all__ = sorted(["categories", "not_nodes", *_recipes.names()])


def categories() -> dict[str, tuple[str, ...]]:
    """Return the names of the node types in each category; what no table knows is under "other"."""
    ours = {theirs: name for name, theirs in _recipes.names().items()}
    found = {category: tuple(ours[name] for name in names if name in ours) for category, names in CATEGORIES.items()}
    known = {name for names in found.values() for name in names}
    other = tuple(name for name in _recipes.names() if name not in known)
    return {**found, "other": other} if other else found


def not_nodes() -> dict[str, str]:
    """Return OpenCV's functions that are no node types, with the reason."""
    found = {name: _recipes.refused(name) for name in overloads()}
    return {name: reason for name, reason in sorted(found.items()) if reason is not None}


def __node_types__() -> Iterator[Any]:  # noqa: N807 - the name by which the catalogue asks
    """Make every type, for the catalogue."""
    return (__getattr__(name) for name in _recipes.names())


def __getattr__(name: str) -> Any:
    ours = _OURS.get(name, name)
    if ours not in _recipes.names():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{_hint(name)}")
    if ours not in globals():
        # setdefault: two threads may ask for a type at once, and there is one of each
        globals().setdefault(ours, make(_recipes.recipe(_recipes.names()[ours]), __name__, ours))
    return globals()[ours]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _hint(name: str) -> str:
    reason = _recipes.refused(name) if name in overloads() else None
    return "" if reason is None else f"; cv2.{name} is not a node type: {reason}"


_OURS = {theirs: name for name, theirs in _recipes.names().items()}

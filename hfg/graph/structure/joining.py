"""The options of an edge that leads through subgraphs: of its parts together, and of each part (rule G1)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any, Final

import msgspec

from hfg.graph.structure.option import declared
from hfg.graph.structure.options import EdgeOptions

_OTHER_BORDERS: Final = tuple(
    (name, one.option.border) for name, one in declared(EdgeOptions).items() if one.option.border != "outermost"
)


def joined(parts: Sequence[EdgeOptions], outermost: EdgeOptions) -> EdgeOptions:
    """Return the options of the one edge that several in a row are, from source to target."""
    said: dict[str, Any] = {}
    for name, border in _OTHER_BORDERS:
        values = [getattr(one, name) for one in parts]
        if border == "every":
            said[name] = all(values)
        elif border == "sum":
            said[name] = sum(values)
        elif border == "least":
            said[name] = min((value for value in values if value is not None), default=None)
        else:
            said[name] = tuple(chain.from_iterable(values if border == "along" else reversed(values)))
    return msgspec.structs.replace(outermost, **said)


def outer_part(options: EdgeOptions) -> EdgeOptions:
    """Return what the part of an edge outside a subgraph says, if the target is inside."""
    return msgspec.structs.replace(options, **{name: () for name, border in _OTHER_BORDERS if border == "target"})


def inner_part(options: EdgeOptions, *, has_target: bool) -> EdgeOptions:
    """Return what the part of an edge inside a subgraph says; initial values go to the part at the target."""
    borders = ("every", "target") if has_target else ("every",)
    return EdgeOptions(**{name: getattr(options, name) for name, border in _OTHER_BORDERS if border in borders})


def outermost(options: EdgeOptions) -> dict[str, Any]:
    """Return what only the outermost part of an edge says, by name."""
    others = dict(_OTHER_BORDERS)
    return {name: getattr(options, name) for name in declared(EdgeOptions) if name not in others}

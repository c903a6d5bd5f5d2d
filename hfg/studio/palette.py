"""The palette: node types that words describe and that a wire fits; those that refuse it come last, with the reason.

Importing everything that is installed takes seconds, so it is done once, off the graph's loop.
Depends on the catalogue.
"""

from __future__ import annotations

import asyncio
import functools
import sys
import threading
from collections.abc import Iterable, Iterator
from typing import Any, Final

import msgspec

from hfg import registry
from hfg.base.hooks import hooks
from hfg.catalogue import Index, TypeDescription, describe_type, index_of, installed, near_words, ranked, types_of
from hfg.errors import HfgError
from hfg.graph import Graph
from hfg.graph.structure.edge import type_of
from hfg.graph.structure.level import level_of
from hfg.nodetypes.description import NodeType
from hfg.studio.describing import type_record
from hfg.studio.records import TypeRecord
from hfg.studio.refusing import Refused
from hfg.studio.targets import end_of, fit_of
from hfg.types import array_facts, describe, why_not

__all__ = ["Row", "search_types", "type_of_reference", "warm_up"]

_LOCK: Final = threading.Lock()
_BASES: Final = ("hfg.testing", "hfg.studio")


class Row(msgspec.Struct, frozen=True):
    """A row of the palette.

    Attributes:
      fit: how a wire fits: "expects", "takes" or "refused"; "" without a wire.
      port: the port that the wire would lead to.
      message: why it is refused.
    """

    reference: str
    title: str
    name: str
    category: str
    summary: str
    fit: str = ""
    port: str = ""
    message: str = ""


class _Known(msgspec.Struct, frozen=True):
    """Types and the index of their words."""

    types: tuple[TypeDescription, ...]
    index: Index


@functools.lru_cache(maxsize=8)
def _known(own: tuple[str, ...]) -> _Known:
    """All installed types, and those of modules that the graph uses."""
    found = {one.reference: one for one in _installed()}
    for module in own:
        if module in sys.modules and not module.startswith(_BASES):
            found |= {one.reference: one for one in types_of(sys.modules[module]).types}
    types = tuple(found.values())
    return _Known(types, index_of(types))


@functools.cache
def _installed() -> tuple[TypeDescription, ...]:
    return installed().types


def _all(own: tuple[str, ...]) -> _Known:
    with _LOCK:  # two threads would import everything twice
        return _known(own)


def warm_up() -> None:
    """Import everything that is installed now, so that the first search is quick. Call it off the graph's loop."""
    _all(())


async def search_types(graph: Graph, words: str, port: str, category: str, most: int) -> dict[str, Any]:
    """Find types by words, and say which of them a wire from or to a port fits.

    Raises:
      GraphError: there is no such port.
    """
    wire = None if not port else end_of(graph, port)[:2]
    hint = None if wire is None else type_of(wire[0])
    modules = {node._type.module for level in level_of(graph).walk() for node in level.nodes.values()}
    own = tuple(sorted(module for module in modules if not module.startswith("hfg.nodes")))
    begins = None if wire is None else wire[1]
    return await asyncio.to_thread(_search, own, words, hint, begins, category, most, is_first=not modules)


def _search(
    own: tuple[str, ...],
    words: str,
    hint: Any,
    begins: bool | None,
    category: str,
    most: int,
    *,
    is_first: bool = False,
) -> dict[str, Any]:
    """Find types; for the first node of a graph, sources come first, because nothing else would ever fire."""
    known = _all(own)
    numbers = ranked(known.index, words, typing=True) if words.strip() else range(len(known.types))
    types = [known.types[number] for number in numbers]
    chosen = [one for one in types if not category or one.category == category]
    if is_first:
        chosen.sort(key=lambda one: not one.source)
    fitted = [(_row(one), 0) if begins is None else _fitted(one, hint, begins) for one in chosen]
    order = {"expects": 0, "": 0, "takes": 1, "refused": 2}
    named = bool(words.strip())  # the words say best what is meant
    fitted.sort(key=lambda one: (order[one[0].fit], 0 if named else one[1]))
    rows = [row for row, _ in fitted]
    return {
        "rows": rows[:most],
        "total": len(rows),
        "refused": sum(row.fit == "refused" for row in rows),
        "near": [] if rows else near_words(known.index, words),
        "categories": sorted({one.category for one in known.types}),
    }


def _row(one: TypeDescription, fit: str = "", port: str = "", message: str = "") -> Row:
    return Row(one.reference, one.title, one.name, one.category, one.summary, fit, port, message)


def _fitted(one: TypeDescription, hint: Any, begins: bool) -> tuple[Row, int]:
    """Find the port of a type to which a wire fits best, and how far its type is from that of the wire."""
    kind = _kind(one.reference)
    if kind is None:
        return _row(one, "refused", "", f"{one.title} cannot be found"), _FAR
    nearest: tuple[int, str] | None = None
    takes, reason = "", ""
    for name, other in _ports(kind, begins):
        why = why_not(hint, other) if begins else why_not(other, hint)
        if why is not None:
            verb = "expects" if begins else "sends"
            reason = reason or f"{one.title}.{name} {verb} {describe(other)}: {why}"
        elif fit_of(other if begins else hint) == "takes":
            takes = takes or name
        elif nearest is None or _distance(hint, other) < nearest[0]:
            nearest = _distance(hint, other), name
    if nearest is not None:
        return _row(one, "expects", nearest[1]), nearest[0]
    if takes:
        return _row(one, "takes", takes), _FAR
    what = "takes nothing" if begins else "sends nothing"
    return _row(one, "refused", "", reason or f"{one.title} {what}"), _FAR


_FAR: Final = 2


def _distance(one: Any, other: Any) -> int:
    """Return 0 for the same type, 1 for another array, `_FAR` for a type that merely takes such values, too."""
    if describe(one) == describe(other):
        return 0
    return 1 if array_facts(one) is not None and array_facts(other) is not None else _FAR


def _ports(kind: NodeType, begins: bool) -> Iterator[tuple[str, Any]]:
    """Yield the ports at which an edge from elsewhere can end, or the other way round."""
    kinds: tuple[Any, ...] = (kind.inputs, kind.slots) if begins else (kind.outputs, kind.events)
    for specs in kinds:
        for spec in specs.values():
            yield spec.name, spec.type


@functools.lru_cache(maxsize=4096)
def _kind(reference: str) -> NodeType | None:
    try:
        return registry.find(reference)._type
    except HfgError:
        return None


def type_of_reference(reference: str, allow: Iterable[str]) -> TypeRecord:
    """Describe a type with its ports, before there is a node of it.

    Raises:
      Refused: nothing may be imported from there.
      TargetError: there is no such type.
    """
    why = hooks.refusal([reference], [], [], allow)
    if why is not None:
        raise Refused("refused", f"this type is refused: {why}")
    kind = registry.find(reference)._type
    described = describe_type(kind)
    record = type_record(kind, reference)
    ports = [
        {"kind": what, "name": one.name, "type": one.type, "doc": one.doc, "optional": str(one.optional)}
        for what, one in described.ports()
    ]
    return msgspec.structs.replace(record, ports=ports, example=_example(described))


def _example(one: TypeDescription) -> str:
    """Return code that adds a node of a type and leads its ports to others."""
    needed = ", ".join(f"{each.name}=..." for each in one.parameters if each.required)
    name = one.name if one.name != one.title else f"{one.name}_1"
    lines = [
        f"from {one.module} import {one.title.partition('.')[0]}",
        "",
        f"{name} = graph.add({one.title}({needed}))",
    ]
    lines += [f'graph.connect("before.out", {name}.{each.name})' for each in one.inputs[:1]]
    lines += [f'graph.connect({name}.{each.name}, "after.value")' for each in (*one.outputs, *one.events)[:1]]
    return "\n".join(lines)

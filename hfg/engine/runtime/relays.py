"""Ports of subgraphs, seen from outside a run (rule G1): boxes are dissolved, so their ports represent others.

This uses the graph as it was drawn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from hfg.graph.structure.subgraph import is_box, iterated
from hfg.ports import InnerSource, InnerTarget

__all__ = ["events_behind", "is_at", "is_relay", "slots_behind"]


def is_relay(port: Any) -> bool:
    """Return whether it is a declared port of a subgraph that is dissolved."""
    node = getattr(port, "node", None)
    return is_box(node) and not iterated(node) and port.name in getattr(node._type, f"{port.kind}s", ())


def slots_behind(port: Any) -> list[tuple[Any, bool]]:
    """Return where signals into a subgraph's slot arrive, and whether all edges on the way are active."""
    found: list[tuple[Any, bool]] = []
    waiting, seen = [(port, True)], [port]
    while waiting:
        relay, active = waiting.pop(0)
        for edge in _onward(relay):
            target = edge.target.outer if isinstance(edge.target, InnerTarget) else edge.target
            both = active and edge.active
            if not is_relay(target):
                found.append((target, both))
            elif target not in seen:
                seen.append(target)
                waiting.append((target, both))
    return found


def events_behind(port: Any) -> list[Any]:
    """Return the events of nodes whose signals leave by a subgraph's event."""
    found: list[Any] = []
    waiting, seen = [port], [port]
    while waiting:
        for edge in _back(waiting.pop(0)):
            source = edge.source.outer if isinstance(edge.source, InnerSource) else edge.source
            if not is_relay(source):
                found.append(source)
            elif source not in seen:
                seen.append(source)
                waiting.append(source)
    return found


def _onward(relay: Any) -> Iterator[Any]:
    """Return the edges after a relay: inside after a slot, outside after an event."""
    if relay.kind == "event":
        return (edge for edge in relay.graph.edges if edge.source is relay)
    return (edge for edge in relay.node._graph.edges if getattr(edge.source, "outer", None) is relay)


def _back(relay: Any) -> Iterator[Any]:
    """Return the edges before a relay: from inside to an event, from outside to a slot."""
    if relay.kind == "event":
        return (edge for edge in relay.node._graph.edges if getattr(edge.target, "outer", None) is relay)
    return (edge for edge in relay.graph.edges if edge.target is relay)


def is_at(segments: Sequence[Any], what: Any) -> bool:
    """Return whether an edge of a run contains a drawn edge, or starts at, ends at or passes a port."""
    return any(
        what is segment or what in (segment.source, segment.target, *_outer(segment.source), *_outer(segment.target))
        for segment in segments
    )


def _outer(end: Any) -> tuple[Any, ...]:
    return (end.outer,) if isinstance(end, InnerSource | InnerTarget) else ()

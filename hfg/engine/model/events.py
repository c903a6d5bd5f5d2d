"""The events of running nodes that have an edge or a subscriber."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic

from hfg.engine.model.contracts import NodeT
from hfg.ports.edges import Edge, EventEdge
from hfg.ports.events import EventPort

__all__ = ["RunningEvent", "slots_first"]


def slots_first(edge: Edge) -> tuple[bool, float]:
    """Return the sort key by which the signals of an event leave (F9)."""
    return (edge.target_kind == "input", edge.index)


@dataclass(slots=True, eq=False)
class RunningEvent(Generic[NodeT]):
    """An event of a running node and the edges that it feeds, slots first (F9)."""

    worker: NodeT
    name: str
    port: Any  # an EventPort, or None: triggers it, and has its subscribers
    edges: tuple[EventEdge, ...] = ()
    tap: tuple[Any, ...] | None = None  # who observes its signals; () if they observe only one of its edges

    @property
    def label(self) -> str:
        """Its path, as in traces."""
        return f"{self.worker.path}.{self.name}" if self.worker.path else self.name

    def bind(self, port: EventPort[Any]) -> None:
        """Use this port from now on."""
        self.port = port

    def feed(self, edges: Iterator[EventEdge] | tuple[EventEdge, ...]) -> None:
        """Feed these edges from now on."""
        self.edges = tuple(sorted(edges, key=slots_first))

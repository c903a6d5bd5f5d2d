"""The events of running nodes that somebody asks for. Stands on the ports."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Generic

from hfg.engine.model.contracts import NodeT
from hfg.ports.edges import Edge
from hfg.ports.events import EventPort

__all__ = ["RunningEvent", "slots_first"]


def slots_first(edge: Edge) -> tuple[bool, float]:
    """The order in which the signals of an event leave (F9)."""
    return (edge.target_kind == "input", edge.index)


class RunningEvent(Generic[NodeT]):
    """An event of a running node and the edges it feeds, slots first (F9)."""

    __slots__ = ("edges", "name", "pipelines", "port", "tap", "worker")

    def __init__(self, worker: NodeT, name: str, port: EventPort[Any] | None) -> None:
        self.worker = worker
        self.name = name
        self.port: Any = port
        self.edges: tuple[Any, ...] = ()
        self.tap: tuple[Any, ...] | None = None  # who looks at its signals; () if at one of its edges only

    @property
    def label(self) -> str:
        """Its path, as traces name it."""
        return f"{self.worker.path}.{self.name}" if self.worker.path else self.name

    def bind(self, port: EventPort[Any]) -> None:
        """By this port it is triggered, and heard."""
        self.port = port

    def feed(self, edges: Iterator[Any] | tuple[Any, ...]) -> None:
        """It feeds these edges from now on."""
        self.edges = tuple(sorted(edges, key=slots_first))

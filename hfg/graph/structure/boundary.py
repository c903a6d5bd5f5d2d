"""The graph's own ports: `start`, `stop`, `abort` (rule A10), and those fed and read from outside (rule P10).

Inside the graph an input of the graph is a source and an output a target, so they are bound as such. Stands on ports.
"""

from __future__ import annotations

from typing import Any, TypeVar

from hfg.ports import EventPort, InputPort, OutputPort, SlotPort

__all__ = ["GraphInput", "GraphOutput", "lifecycle_ports"]

T = TypeVar("T")


class GraphInput(OutputPort[T]):
    """An input of the whole graph; nodes see it as an output, `run.feed` writes to it."""

    __slots__ = ()


class GraphOutput(InputPort[T]):
    """An output of the whole graph; nodes see it as an input, `run.read` reads it."""

    __slots__ = ()


def lifecycle_ports(graph: Any) -> tuple[EventPort[None], SlotPort[object], SlotPort[object]]:
    """Make `start`, `stop` and `abort`; the slots take any signal."""
    return EventPort(graph, "start"), SlotPort(graph, "stop", object), SlotPort(graph, "abort", object)

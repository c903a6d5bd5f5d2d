"""The graph's own ports: `start`, `stop`, `abort` (rule A10), and those fed and read from outside (rule P10).

Inside the graph an input of the graph is a source and an output a target, so they are bound as such. Depends on ports.
"""

from __future__ import annotations

import copy
from typing import Any, TypeVar

from hfg.ports import EventPort, InputPort, OutputPort, Port, SlotPort
from hfg.ports.base import Owner

T = TypeVar("T")


class GraphInput(OutputPort[T]):
    """An input of the whole graph; nodes see it as an output, `run.feed` writes to it."""

    __slots__ = ()


class GraphOutput(InputPort[T]):
    """An output of the whole graph; nodes see it as an input, `run.read` reads it."""

    __slots__ = ()


class Boundary:
    """The ports of the whole graph.

    Attributes:
      start: the event that begins every run.
      stop: the slot that ends the run well.
      abort: the slot that ends it in failure.
      inputs: by name, in order of declaration.
      outputs: by name, in order of declaration.
    """

    __slots__ = ("abort", "inputs", "outputs", "start", "stop")

    def __init__(self, graph: Owner) -> None:
        self.start: EventPort[None] = EventPort(graph, "start")
        self.stop: SlotPort[object] = SlotPort(graph, "stop", object)  # these two take any signal
        self.abort: SlotPort[object] = SlotPort(graph, "abort", object)
        self.inputs: dict[str, GraphInput[Any]] = {}
        self.outputs: dict[str, GraphOutput[Any]] = {}

    def for_inside(self) -> Boundary:
        """Return what the inside of a subgraph sees of it: how the whole begins and ends (rule A10), no other port."""
        seen = copy.copy(self)
        seen.inputs, seen.outputs = {}, {}
        return seen

    def by_name(self) -> dict[str, Port]:
        """Return all ports; inputs and outputs share their names."""
        return {"start": self.start, "stop": self.stop, "abort": self.abort, **self.inputs, **self.outputs}

    def is_taken(self, name: str) -> bool:
        """Return whether a port has this name."""
        return name in self.inputs or name in self.outputs or name in ("start", "stop", "abort")

    def has(self, port: object) -> bool:
        """Return whether it is one of the three that are the whole graph's, wherever they are named (rule A10)."""
        return port is self.start or port is self.stop or port is self.abort

    def add(self, port: GraphInput[Any] | GraphOutput[Any]) -> None:
        """Add a port by which the graph is fed or read, after the others."""
        if isinstance(port, GraphInput):
            self.inputs[port.name] = port
        else:
            self.outputs[port.name] = port

    def remove(self, port: GraphInput[Any] | GraphOutput[Any]) -> None:
        """Take such a port away."""
        del (self.inputs if isinstance(port, GraphInput) else self.outputs)[port.name]

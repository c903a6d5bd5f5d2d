"""`node.ports`: the ports of one node as mappings from name to bound port, in order of declaration.

Depends on `base`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Generic, TypeVar

from hfg.errors import UsageError
from hfg.ports.automatic import AUTOMATIC_EVENTS, AUTOMATIC_SLOTS, SUBGRAPH_EVENTS, SUBGRAPH_SLOTS, sent_name
from hfg.ports.base import Kind
from hfg.ports.events import EventPort
from hfg.ports.inputs import InputPort
from hfg.ports.outputs import OutputPort
from hfg.ports.parameters import ParameterPort
from hfg.ports.slots import SlotPort

__all__ = [
    "NoSuchPort",
    "PortView",
    "Ports",
]

P_co = TypeVar("P_co", covariant=True)


class NoSuchPort(UsageError, KeyError):
    """A node has no port of this name. It is a KeyError because ports are looked up like keys of a mapping."""

    def __str__(self) -> str:
        return str(self.args[0])  # KeyError would quote the message


class PortView(Mapping[str, P_co], Generic[P_co]):
    """The ports of one kind; ports are made when they are first used.

    Iteration yields the declared ports; `[]` also finds the automatic ports of rule A9.
    """

    __slots__ = ("_kind", "_node", "_specs")

    def __init__(self, node: Any, kind: Kind, specs: Mapping[str, Any]) -> None:
        self._node = node
        self._kind = kind
        self._specs = specs

    def __getitem__(self, name: str) -> P_co:
        if name in self._specs or name in self._automatic():
            port: P_co = self._node._port(self._kind, name)
            return port
        known = ", ".join(f'"{known}"' for known in self._specs) or "none"
        raise NoSuchPort(
            f'node type {self._node._type.name} has no {self._kind} "{name}"; its {self._kind}s are {known}'
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self._specs)

    def __len__(self) -> int:
        return len(self._specs)

    def __repr__(self) -> str:
        return f"<{self._kind}s {list(self._specs)}>"

    def _of_the_runner(self) -> list[str]:
        has_do = "do" in self._node._type.hooks
        return [name for name in AUTOMATIC_EVENTS if has_do or name != "completed"]

    def _automatic(self) -> tuple[str, ...]:
        box = self._node._type.is_subgraph
        if self._kind == "event":
            return SUBGRAPH_EVENTS if box else (*self._of_the_runner(), *map(sent_name, self._node._type.outputs))
        if self._kind == "slot":
            return SUBGRAPH_SLOTS if box else AUTOMATIC_SLOTS
        return ()


class Ports:
    """All ports of one node, by kind."""

    __slots__ = ("_node",)

    def __init__(self, node: Any) -> None:
        self._node = node

    @property
    def inputs(self) -> PortView[InputPort[Any]]:
        """Inputs by name."""
        return PortView(self._node, "input", self._node._type.inputs)

    @property
    def outputs(self) -> PortView[OutputPort[Any]]:
        """Outputs by name."""
        return PortView(self._node, "output", self._node._type.outputs)

    @property
    def events(self) -> PortView[EventPort[Any]]:
        """Events by name."""
        return PortView(self._node, "event", self._node._type.events)

    @property
    def slots(self) -> PortView[SlotPort[Any]]:
        """Slots by name."""
        return PortView(self._node, "slot", self._node._type.slots)

    @property
    def parameters(self) -> PortView[ParameterPort[Any]]:
        """Parameters by name, except triggers, which are a slot and an event instead, and the sizes of vectors."""
        specs = {name: spec for name, spec in self._node._type.parameters.items() if spec.is_port}
        return PortView(self._node, "parameter", specs)

    def __repr__(self) -> str:
        kinds = (self.inputs, self.outputs, self.events, self.slots, self.parameters)
        return f"<ports {' '.join(map(repr, kinds))}>"

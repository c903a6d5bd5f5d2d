"""Stands in for a node whose type is not there: it keeps its place, its edges and all that the file says about it.

So a graph can be looked at, edited and saved without its package, and nothing is lost; the check reports an error, so
it does not run. Depends on nodes and on what can be added to the checks.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Final

from typing_extensions import override

from hfg.errors import Problem
from hfg.graph.checks.checking import also
from hfg.graph.editing.document import EdgeDocument, NodeDocument
from hfg.graph.flat import FlatGraph
from hfg.graph.structure.option import having
from hfg.graph.structure.options import EdgeFields
from hfg.nodetypes.description import EventSpec, InputSpec, NodeType, OutputSpec, SlotSpec
from hfg.nodetypes.node import Node
from hfg.ports.automatic import AUTOMATIC_EVENTS, AUTOMATIC_SLOTS, sent_of

_FOR_EVENTS: Final = frozenset(having(EdgeFields, "events"))


@dataclass(frozen=True, slots=True, eq=False)
class _MissingType(NodeType):
    """The facts known about a type that is not installed.

    Attributes:
      named: its reference.
      why: it is not there.
      where: the file and line that name it.
    """

    named: str = ""
    why: str = ""
    where: str = ""

    @property
    @override
    def is_there(self) -> bool:
        return False

    @property
    @override
    def reference(self) -> str | None:
        return self.named


class MissingNode(Node):
    """A node whose type is not there."""

    _said: ClassVar[NodeDocument]
    """What the file says about it."""


def missing_node(said: NodeDocument, name: str, edges: Iterable[EdgeDocument], why: str, where: str) -> MissingNode:
    """Make what stands in for a node, with the ports that edges use."""
    ports = _Ports(name, edges)
    module, _, qualname = said.type.partition(":")

    def described(cls: type[Node]) -> NodeType:
        return _MissingType(
            name=name,
            origin=cls,
            module=module,
            qualname=qualname or said.type,
            doc=f"Not there: {why}.",
            inputs={port: InputSpec(port, Any, optional=True) for port in ports.inputs},
            outputs={port: OutputSpec(port, Any) for port in ports.outputs},
            events={port: EventSpec(port, Any) for port in ports.events},
            slots={port: SlotSpec(port, Any) for port in ports.slots},
            result="fields" if ports.outputs else "none",
            named=said.type,
            why=why,
            where=where,
        )

    body = {"_said": said}
    return types.new_class("MissingNode", (MissingNode,), {"_made": described}, lambda names: names.update(body))()  # type: ignore[no-any-return]


class _Ports:
    """What the edges at a node tell about its ports: the kind of each is guessed so that every edge is allowed."""

    def __init__(self, name: str, edges: Iterable[EdgeDocument]) -> None:
        self.inputs: dict[str, None] = {}
        self.outputs: dict[str, None] = {}
        self.events: dict[str, None] = {}
        self.slots: dict[str, None] = {}
        for edge in edges:
            node, dot, port = edge.source.partition(".")
            if node == name and dot:
                self._sends(port, not _FOR_EVENTS.isdisjoint(edge.said()))
            node, dot, port = edge.target.partition(".")
            if node == name and dot and port not in AUTOMATIC_SLOTS:
                self._takes(port)

    def _sends(self, port: str, is_event: bool) -> None:
        if port in AUTOMATIC_EVENTS:
            return
        output = sent_of(port)
        if output is not None:
            self.outputs[output] = None
        elif is_event or port in self.events:
            self.outputs.pop(port, None)
            self.events[port] = None
        else:
            self.outputs[port] = None

    def _takes(self, port: str) -> None:
        if port in self.inputs or port in self.slots:  # an input takes one edge, a slot any number
            self.inputs.pop(port, None)
            self.slots[port] = None
        else:
            self.inputs[port] = None


@also
def missing_types(flat: FlatGraph) -> Iterator[Problem]:
    """Nodes whose types are not there."""
    for item in flat.nodes:
        kind = item.node._type
        if isinstance(kind, _MissingType):
            yield Problem(
                path=item.path,
                severity="error",
                what=f'its type "{kind.named}" is not there',
                why=kind.why,
                remedy=f"install what has it, or correct {kind.where}; until then the node keeps its place",
                check="missing-type",
            )

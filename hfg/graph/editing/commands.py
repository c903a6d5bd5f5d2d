"""Edits of a graph as data: what is to change, expressed only by paths and references (rule R4).

A command can be logged, sent over a wire and carried out again: `encode` and `decode`. It says what, never how:
`performing` carries it out on a graph, `transactions` undoes it, and a run follows. Depends on errors.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeAlias, Unpack

import msgspec
from typing_extensions import override

from hfg.graph.editing.command import Command, decode, encode, read
from hfg.graph.structure.facts import Claim
from hfg.graph.structure.option import add_unset
from hfg.graph.structure.options import (
    EdgeFields,
    EdgeGiven,
    GroupFields,
    GroupGiven,
    MonitorFields,
    MonitorGiven,
    NodeGiven,
)

__all__ = [
    "Add",
    "AddGroup",
    "AddInput",
    "AddOutput",
    "AddSubgraph",
    "ChangeGroup",
    "Command",
    "Connect",
    "Copy",
    "Disable",
    "Disconnect",
    "Dissolve",
    "EdgeSaid",
    "Enable",
    "Enclose",
    "Fact",
    "Gate",
    "MakeActive",
    "Move",
    "Note",
    "Operator",
    "Promote",
    "Remove",
    "RemoveGroup",
    "RemoveMonitor",
    "Rename",
    "Replace",
    "SetEdge",
    "SetMonitor",
    "SetParameter",
    "Ungate",
    "decode",
    "encode",
    "read",
]


if TYPE_CHECKING:
    NodeData: TypeAlias = NodeGiven
else:
    NodeData: TypeAlias = dict[str, Any]  # they are checked when the node is added, with a message that names it


class Add(Command, frozen=True):
    """Add a node.

    Attributes:
      type: its reference, "my_robot.nodes:MapLookup".
      path: where, and how it is called there.
      parameters: by name.
      options: as those of `graph.add`.
    """

    type: str
    path: str
    parameters: dict[str, Any] = msgspec.field(default_factory=dict)
    options: NodeData = msgspec.field(default_factory=dict)  # type: ignore[assignment]  # an empty one

    @override
    def references(self) -> Iterable[str]:
        return (self.type,)


class AddSubgraph(Command, frozen=True):
    """Add an empty subgraph without a type of its own, such as `Enclose` makes; later commands add its content.

    Attributes:
      path: where, and how it is called there.
      inputs: the types of its inputs by name, as texts: "int", "list[my_robot.types.Pose]"; so the next three.
      options: as those of `graph.add`.
    """

    path: str
    inputs: dict[str, str] = msgspec.field(default_factory=dict)
    outputs: dict[str, str] = msgspec.field(default_factory=dict)
    events: dict[str, str] = msgspec.field(default_factory=dict)
    slots: dict[str, str] = msgspec.field(default_factory=dict)
    options: NodeData = msgspec.field(default_factory=dict)  # type: ignore[assignment]  # an empty one

    @override
    def types(self) -> Iterable[str]:
        return [text for ports in (self.inputs, self.outputs, self.events, self.slots) for text in ports.values()]


class AddInput(Command, frozen=True):
    """Declare a port by which the whole graph is fed (rule P10); its type as a text, "list[my_robot.types.Pose]"."""

    name: str
    type: str

    @override
    def types(self) -> Iterable[str]:
        return (self.type,)


class AddOutput(Command, frozen=True):
    """Declare a port at which the whole graph is read (rule P10); its type as a text."""

    name: str
    type: str

    @override
    def types(self) -> Iterable[str]:
        return (self.type,)


class AddGroup(Command, frozen=True):
    """Declare where nodes run, as `graph.group` does."""

    name: str
    if TYPE_CHECKING:

        def __init__(self, name: str, **options: Unpack[GroupGiven]) -> None: ...

    else:
        add_unset(GroupFields, locals(), none=True)


class ChangeGroup(Command, frozen=True):
    """Declare a group otherwise; what is not given stays as it was."""

    name: str
    if TYPE_CHECKING:

        def __init__(self, name: str, **options: Unpack[GroupGiven]) -> None: ...

    else:
        add_unset(GroupFields, locals())


class RemoveGroup(Command, frozen=True):
    """Take a group away in which no node runs."""

    name: str


class SetMonitor(Command, MonitorFields, frozen=True):  # type: ignore[misc]  # nobody changes it
    """Declare what must hold of each run, as `graph.monitor` does, or declare it otherwise.

    Attributes:
      name: for people.
      property: as text, "never(active(driving))".
    """

    name: str
    property: str
    if TYPE_CHECKING:

        def __init__(self, name: str, property: str, **options: Unpack[MonitorGiven]) -> None: ...  # noqa: A002


class RemoveMonitor(Command, frozen=True):
    """Take a monitor away."""

    name: str


class Remove(Command, frozen=True):
    """Remove a node or subgraph, with its edges, gates and promotions."""

    path: str


class Copy(Command, frozen=True):
    """Add a node with the type, parameters and options of another, or a subgraph with all that is inside; no edges."""

    path: str
    to: str


class Rename(Command, frozen=True):
    """Rename a node; the paths of all nodes inside follow."""

    path: str
    name: str


class Move(Command, frozen=True):
    """Let a node run in another group; None is that of the subgraph around it."""

    path: str
    group: str | None = None


class Operator(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """An operator on an edge, made by a function that `hfg.operator` knows.

    Attributes:
      type: the reference of the function, "my_robot.operators:smoothed" or "reactivex.operators:debounce".
      arguments: what it is given by position.
      parameters: what it is given by name.
    """

    type: str
    arguments: tuple[Any, ...] = ()
    parameters: dict[str, Any] = {}


class EdgeSaid(EdgeFields, kw_only=True):
    """The options of an edge as data; operators by their names."""

    through: tuple[Operator, ...] = ()


class Connect(Command, EdgeSaid, frozen=True):  # type: ignore[misc]  # nobody changes it
    """Declare an edge, as `graph.connect` does; operators by their names."""

    source: str
    target: str
    if TYPE_CHECKING:

        def __init__(self, source: str, target: str, **options: Unpack[EdgeGiven[Any, Operator]]) -> None: ...

    @override
    def references(self) -> Iterable[str]:
        return [one.type for one in self.through]


class Disconnect(Command, frozen=True):
    """Remove an edge."""

    source: str
    target: str


class MakeActive(Command, frozen=True):
    """Let an edge transport activity, or no more."""

    source: str
    target: str
    active: bool = True


class SetEdge(Command, frozen=True):
    """Declare an edge otherwise, in its place in the order; what is not given stays as it was."""

    source: str
    target: str
    if TYPE_CHECKING:
        through: tuple[Operator, ...] | msgspec.UnsetType

        def __init__(self, source: str, target: str, **options: Unpack[EdgeGiven[Any, Operator]]) -> None: ...

    else:
        add_unset(EdgeSaid, locals())

    @override
    def references(self) -> Iterable[str]:
        return [one.type for one in self.through] if isinstance(self.through, tuple) else ()


class Enable(Command, frozen=True):
    """Enable a node or subgraph."""

    path: str


class Disable(Command, frozen=True):
    """Disable a node or subgraph."""

    path: str


class Gate(Command, frozen=True):
    """Couple the work of a node or subgraph to the activity of another, as `graph.gate` does (rule A11)."""

    path: str
    by: str
    idle_rate_hz: float | None = None


class Ungate(Command, frozen=True):
    """Take the gate of a node or subgraph away."""

    path: str


class Fact(Command, frozen=True):
    """State how many of some nodes are active, as `graph.at_most_one` and `graph.exactly_one` do, or no more."""

    claim: Claim
    nodes: tuple[str, ...]
    stated: bool = True


class Promote(Command, frozen=True):
    """Let a parameter of a subgraph stand for one inside, as `graph.promote` does in `build()` (rule G3), or no more.

    Attributes:
      path: of the parameter of the subgraph, "follow.speed".
      inner: of the one inside, "follow/plan.limit", which takes the value of the first.
      promoted: False takes it back; the value stays.
    """

    path: str
    inner: str
    promoted: bool = True


class SetParameter(Command, frozen=True):
    """Set a parameter, "lookup.tolerance"."""

    path: str
    value: Any


class Note(Command, frozen=True):
    """Note something for editors, which nothing else reads: a position, a colour, a comment.

    Attributes:
      path: the node or subgraph; "" for a free note about the whole graph.
      name: of the note, "position".
      value: plain data; None takes the note away.
    """

    path: str
    name: str
    value: Any = None


class Enclose(Command, frozen=True):
    """Group nodes of one graph into a new subgraph of this graph, which is named `name` (rule G1)."""

    paths: tuple[str, ...]
    name: str


class Dissolve(Command, frozen=True):
    """Put what is inside a subgraph in its place (rule G1)."""

    path: str


class Replace(Command, frozen=True):
    """Put a node of another type in a node's place: name, options, edges, gates stay.

    Parameters that both have stay too, unless given.
    """

    path: str
    type: str
    parameters: dict[str, Any] = msgspec.field(default_factory=dict)

    @override
    def references(self) -> Iterable[str]:
        return (self.type,)

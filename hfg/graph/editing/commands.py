"""Edits of a graph as data: what is to change, by paths and references alone (rule R4).

A command can be logged, sent over a wire and carried out again: `encode` and `decode`. It says what, never how:
`performing` carries it out on a graph, `transactions` undoes it, and a run follows. Stands on errors.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias, Unpack, cast

import msgspec

from hfg.base.hooks import hooks
from hfg.encoding import TAG
from hfg.errors import GraphError
from hfg.graph.structure.option import add_unset
from hfg.graph.structure.options import EdgeFields, EdgeGiven, GroupFields, GroupGiven, NodeGiven

__all__ = [
    "Add",
    "AddGroup",
    "AddInput",
    "AddOutput",
    "AddSubgraph",
    "AnyCommand",
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
    "Gate",
    "MakeActive",
    "Move",
    "Note",
    "Operator",
    "Promote",
    "Remove",
    "RemoveGroup",
    "Rename",
    "Replace",
    "SetEdge",
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


class _Sentence(msgspec.StructMeta):
    """Commands that are written wrongly say so as all of hfg does: which one, what it takes and what was found."""

    if not TYPE_CHECKING:  # type checkers know it of the fields

        def __call__(self, *values: object, **named: object) -> object:
            try:
                return super().__call__(*values, **named)
            except TypeError as error:
                words = str(error)
                fields = [
                    one.name if one.required else f"{one.name}=..." for one in msgspec.structs.fields(cast(Any, self))
                ]
                name = f"commands.{self.__name__}"
                raise GraphError(f"{name}: {words[:1].lower()}{words[1:]}; write {name}({', '.join(fields)})") from None


class Command(
    msgspec.Struct,
    metaclass=_Sentence,
    frozen=True,
    tag=True,
    tag_field="do",
    forbid_unknown_fields=True,
    omit_defaults=True,
):
    """One edit. Paths are those of the whole graph: "fetch/go_to", "fetch/go_to.goal", "fetch.person.inner"."""


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
    parameters: dict[str, Any] = {}
    options: NodeData = {}


class AddSubgraph(Command, frozen=True):
    """Add an empty subgraph that has no type of its own, such as `Enclose` makes; what is inside is added behind it.

    Attributes:
      path: where, and how it is called there.
      inputs: the types of its inputs by name, as texts: "int", "list[my_robot.types.Pose]"; so the next three.
      options: as those of `graph.add`.
    """

    path: str
    inputs: dict[str, str] = {}
    outputs: dict[str, str] = {}
    events: dict[str, str] = {}
    slots: dict[str, str] = {}
    options: NodeData = {}


class AddInput(Command, frozen=True):
    """Declare a port by which the whole graph is fed (rule P10); its type as a text, "list[my_robot.types.Pose]"."""

    name: str
    type: str


class AddOutput(Command, frozen=True):
    """Declare a port at which the whole graph is read (rule P10); its type as a text."""

    name: str
    type: str


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


class Remove(Command, frozen=True):
    """Remove a node or subgraph, with its edges, gates and promotions."""

    path: str


class Copy(Command, frozen=True):
    """Add a node with the type, parameters and options of another, or a subgraph with all that is inside; no edges."""

    path: str
    to: str


class Rename(Command, frozen=True):
    """Give a node another name; the paths of all inside follow."""

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
    """What is said of an edge as data; operators by their names."""

    through: tuple[Operator, ...] = ()


class Connect(Command, EdgeSaid, frozen=True):  # type: ignore[misc]  # nobody changes it
    """Declare an edge, as `graph.connect` does; operators by their names."""

    source: str
    target: str
    if TYPE_CHECKING:

        def __init__(self, source: str, target: str, **options: Unpack[EdgeGiven[Any, Operator]]) -> None: ...


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
    """Group nodes of one graph into a new subgraph beside them, which is called `name` (rule G1)."""

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
    parameters: dict[str, Any] = {}


AnyCommand: TypeAlias = (
    Add
    | AddSubgraph
    | AddInput
    | AddOutput
    | AddGroup
    | ChangeGroup
    | RemoveGroup
    | Remove
    | Copy
    | Rename
    | Move
    | Connect
    | Disconnect
    | MakeActive
    | SetEdge
    | Enable
    | Disable
    | Gate
    | Ungate
    | Promote
    | SetParameter
    | Note
    | Enclose
    | Dissolve
    | Replace
)

_DECODER: msgspec.json.Decoder[list[AnyCommand]] = msgspec.json.Decoder(list[AnyCommand])


def encode(commands: Iterable[Command]) -> str:
    """Give commands as one line of JSON.

    Raises:
      GraphError: a value is no data.

    Examples:
      >>> encode([Connect("camera.out", "show.value", active=True)])
      '[{"do":"Connect","source":"camera.out","target":"show.value","active":true}]'
    """
    listed = list(commands)
    try:
        return msgspec.json.encode(listed).decode()
    except (TypeError, ValueError) as error:
        raise GraphError(f"commands are plain data, and these hold something else: {error}") from error


def decode(data: str | bytes, *, allow: Iterable[str] = ()) -> Sequence[AnyCommand]:
    """Read commands that `encode` wrote, or somebody else.

    They import what they name when they are applied. So they name only what a graph file may: modules of hfg, of
    packages with node types, what is imported already, and what is allowed here.

    Args:
      data: one line of JSON.
      allow: further packages whose code they may run.

    Raises:
      GraphError: it is no JSON, or no command, which the message says where; or they name another module.
    """
    commands = read(data)
    references = [one for command in commands for one in _references(command)]
    values = [one for command in commands for one in _in_values(command)]
    types = [text for command in commands for text in _types(command)]
    why = hooks.refusal(references, values, types, allow)
    if why is not None:
        raise GraphError(f"these commands are refused: {why}")
    return commands


def _references(command: AnyCommand) -> list[str]:
    if isinstance(command, Add | Replace):
        return [command.type]
    if isinstance(command, Connect | SetEdge) and isinstance(command.through, tuple):
        return [one.type for one in command.through]
    return []


def _in_values(command: AnyCommand) -> Iterator[str]:
    """What values name that say their type: `{"$type": "my_robot.types:Pose", "value": ...}`."""
    left = [msgspec.to_builtins(command)]
    while left:
        one = left.pop()
        if isinstance(one, dict):
            if TAG in one:
                named = one.get("value") if one[TAG] == "reference" else one[TAG]
                if isinstance(named, str) and ":" in named:
                    yield named
            left += one.values()
        elif isinstance(one, list | tuple):
            left += one


def _types(command: AnyCommand) -> list[str]:
    if isinstance(command, AddInput | AddOutput):
        return [command.type]
    if isinstance(command, AddSubgraph):
        return [
            text
            for ports in (command.inputs, command.outputs, command.events, command.slots)
            for text in ports.values()
        ]
    return []


def read(data: str | bytes) -> Sequence[AnyCommand]:
    """Read commands of somebody who may run any code here anyway.

    Raises:
      GraphError: it is no JSON, or no command; the message says where.
    """
    try:
        return _DECODER.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise GraphError(f"this is no list of commands: {error}") from error

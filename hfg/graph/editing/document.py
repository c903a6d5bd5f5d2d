"""A graph as plain data: structs of strings, numbers, lists and dicts, without nodes.

    Document            a whole graph, or a subgraph that other files include
    ├── groups          GroupDocument by name
    ├── monitors        MonitorDocument by name
    ├── nodes           NodeDocument by name; may contain a BoxDocument, its inner graph, and a GateDocument, or
    │                   InsideDocuments about the inner graph that its type has built
    └── edges           EdgeDocument in order, with OperatorDocuments

`to_document` makes a document of a graph, `from_document` makes a graph of a document, and `to_commands` turns a
document into commands. Graph files, commands, and graphs that are sent to other processes all go this way. Whatever
reads another format makes a document and continues from there. The defaults here are those of `graph.add` and
`graph.connect`. Depends on the options of `hfg.graph.structure`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Unpack

import msgspec

from hfg.graph.editing.commands import EdgeSaid, Operator
from hfg.graph.structure.facts import Claim
from hfg.graph.structure.option import declared
from hfg.graph.structure.options import EdgeGiven, GroupFields, MonitorFields, NodeFields

VERSION: Final = 1
PORT_KINDS: Final = ("inputs", "outputs", "events", "slots")


OperatorDocument = Operator
"""An operator on an edge (rule P9); in a file only its reference if it has no arguments."""


class EdgeDocument(EdgeSaid, omit_defaults=True):
    """An edge; in a file "camera.out -> blur.image", with its options on the lines below.

    Attributes:
      source: a port as seen from the graph that contains the edge: "camera.out", "fetch/go_to.goal", or a port of the
        graph itself by name.
      target: likewise.
    """

    source: str
    target: str
    if TYPE_CHECKING:

        def __init__(self, source: str, target: str, **options: Unpack[EdgeGiven[Any, Operator]]) -> None: ...


class GateDocument(msgspec.Struct, omit_defaults=True):
    """While `by` is inactive the gated node rests (rule A11).

    Attributes:
      by: the path of the state node or subgraph, from the graph that contains the gated node, or after a "/" from the
        outermost graph of the file.
      idle_rate_hz: firings per second that are still allowed meanwhile.
    """

    by: str
    idle_rate_hz: float | None = None


class FactDocument(msgspec.Struct):
    """How many of some nodes are active at any moment.

    Attributes:
      claim: "at most one" or "exactly one".
      nodes: the paths of nodes and subgraphs.
    """

    claim: Claim
    nodes: list[str]


class GroupDocument(GroupFields, omit_defaults=True, kw_only=True):
    """Where nodes run (rules R1, R2)."""

    threads: int = 1


class MonitorDocument(MonitorFields, omit_defaults=True, kw_only=True):
    """A property that must hold of each run; in a file only its text if it has no options.

    Attributes:
      property: as text, such as never(active(driving) & sent(drive.lamp, value == true)).
    """

    property: str


class ParameterDocument(msgspec.Struct, omit_defaults=True):
    """A parameter that a subgraph declares.

    Attributes:
      type: as a string, "float".
      default: its value unless the subgraph is made with another.
      unit: for people.
      choices: the only allowed values.
      limits: by their names in annotated_types: gt, ge, lt, le, multiple_of, min_length, max_length.
      labels: what to call the choices, one each.
      step: by how much an editor moves the value.
      group: what editors show it with.
      help: what it means.
      shown_if: the name of a parameter that must be on; or by name what others must be: a value, a list of them, or
        limits.
      pattern: which names of files fit.
      directory: the path is that of a directory.
      save: the path is one to write to.
    """

    type: str
    default: Any = None
    unit: str | None = None
    choices: list[Any] | None = None
    limits: dict[str, Any] = {}
    labels: list[str] = []
    step: float | None = None
    group: str | None = None
    help: str | None = None
    shown_if: Any = None
    pattern: str | None = None
    directory: bool = False
    save: bool = False


class InsideDocument(msgspec.Struct, omit_defaults=True):
    """How a node inside a subgraph differs from the one that the type, or the file, of the subgraph makes.

    Attributes:
      parameters: by name, those that were set.
      enabled: whether it is enabled at the start of a run.
      group: where it runs; "" is the group of the subgraph around it.
      gate: couples its work to the activity of another, whose path is relative like that of this one.
      position: in a drawing, x and y.
      notes: of editors, by name.
    """

    parameters: dict[str, Any] = {}
    enabled: bool | None = None
    group: str | None = None
    gate: GateDocument | None = None
    position: list[Any] | None = None
    notes: dict[str, Any] = {}


class BoxDocument(msgspec.Struct, omit_defaults=True):
    """The contents of a graph, or of a subgraph, and its ports.

    Attributes:
      inputs: the types of its ports by name, as strings: "int", "list[my_robot.types.Pose]"; so the next three.
      events: of subgraphs only, as are slots and parameters.
      parameters: that it is made with.
      nodes: by name, in order of adding.
      edges: in order of connecting.
      promotes: by the name of a parameter, the inner parameters that it sets (rule G3).
    """

    inputs: dict[str, str] = {}
    outputs: dict[str, str] = {}
    events: dict[str, str] = {}
    slots: dict[str, str] = {}
    parameters: dict[str, ParameterDocument] = {}
    nodes: dict[str, NodeDocument] = {}
    edges: list[EdgeDocument] = []
    promotes: dict[str, list[str]] = {}


class NodeDocument(NodeFields, omit_defaults=True):
    """A node: what it is, how it runs, and its parameters.

    It has a type, or a file, or only a graph, which is a subgraph without a type of its own. A type with a graph is a
    subgraph whose inner graph was edited: the graph replaces the one that the type builds.

    Attributes:
      type: its reference, "my_robot.nodes:MapLookup".
      file: of a subgraph that another file describes, relative to the folder of this one.
      gate: couples its work to the activity of another.
      parameters: by name.
      inside: of a subgraph: how its inner nodes differ, by path from there.
      position: in a drawing, x and y.
      notes: of editors, by name.
      graph: of a subgraph: its inner graph.
    """

    type: str = ""
    file: str = ""
    gate: GateDocument | None = None
    parameters: dict[str, Any] = msgspec.field(default_factory=dict)
    inside: dict[str, InsideDocument] = msgspec.field(default_factory=dict)
    position: list[Any] | None = None
    notes: dict[str, Any] = msgspec.field(default_factory=dict)
    graph: BoxDocument | None = None


class Document(BoxDocument, omit_defaults=True):
    """A graph file.

    Attributes:
      hfg: the version of the format.
      name: of the graph, for people.
      notes: about the whole, by name.
      groups: where nodes run, by name.
      facts: what is stated about activity.
      monitors: what must hold of each run, by name.
    """

    hfg: int = VERSION
    name: str = "graph"
    notes: dict[str, Any] = {}
    groups: dict[str, GroupDocument] = {}
    facts: list[FactDocument] = []
    monitors: dict[str, MonitorDocument] = {}


NODE_OPTIONS: Final = tuple(declared(NodeFields))
"""The fields of a node that `graph.add` takes."""

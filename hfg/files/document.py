"""What a graph file says, as plain data: structs of texts, numbers, lists and dicts; no node is made of it here.

    Document            a whole graph, or a subgraph that other files include
    ├── groups          GroupDocument by name
    ├── nodes           NodeDocument by name; one may hold a BoxDocument of its own, its inside
    │                   and a GateDocument, or InsideDocuments about what its type has built
    └── edges           EdgeDocument in order, each perhaps with OperatorDocuments

`reading` makes a document of a text and `writing` a text of a document; `building` makes a graph of a document and
`describing` a document of a graph. Whoever reads another format makes a document and goes on from there. What is
omitted in a file is what stands here as default, which is what `graph.add` and `graph.connect` take when it is not
said. Stands on the options of the graph floor.
"""

from __future__ import annotations

from typing import Any, Final

import msgspec

from hfg.graph.editing.commands import EdgeSaid, Operator
from hfg.graph.structure.option import declared
from hfg.graph.structure.options import GroupFields, NodeFields

__all__ = [
    "NODE_OPTIONS",
    "SUFFIX",
    "VERSION",
    "BoxDocument",
    "Document",
    "EdgeDocument",
    "GateDocument",
    "GroupDocument",
    "InsideDocument",
    "NodeDocument",
    "OperatorDocument",
    "ParameterDocument",
]

VERSION: Final = 1
SUFFIX: Final = ".hfg.yaml"


OperatorDocument = Operator
"""An operator on an edge (rule P9); in a file its reference alone if it is given nothing."""


class EdgeDocument(EdgeSaid, omit_defaults=True):
    """An edge; in a file "camera.out -> blur.image", what else is said about it below that.

    Attributes:
      source: a port as seen from where the edge stands: "camera.out", "fetch/go_to.goal", or a port of its own by name.
      target: likewise.
    """

    source: str
    target: str


class GateDocument(msgspec.Struct, omit_defaults=True):
    """While `by` is inactive the gated node rests (rule A11).

    Attributes:
      by: the path of the state node or subgraph, from the graph in which the gated node stands, or behind a "/" from
        the outermost graph of the file.
      idle_rate_hz: so many firings a second go on meanwhile.
    """

    by: str
    idle_rate_hz: float | None = None


class GroupDocument(GroupFields, omit_defaults=True, kw_only=True):
    """Where nodes run (rules R1, R2)."""

    threads: int = 1


class ParameterDocument(msgspec.Struct, omit_defaults=True):
    """A parameter that a subgraph declares.

    Attributes:
      type: as a text, "float".
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
    """What is otherwise with a node inside a subgraph than its type, or its file, makes it.

    Attributes:
      parameters: by name, those that were set.
      enabled: whether it is at the start of a run.
      group: where it runs; "" is the group of the subgraph around it.
      gate: couples its work to the activity of another, whose path is as that of this one.
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
    """What lies in a graph, or inside a subgraph, and which ports that has.

    Attributes:
      inputs: the types of its ports by name, as texts: "int", "list[my_robot.types.Pose]"; so the next three.
      events: of subgraphs only, as are slots and parameters.
      parameters: that it is made with.
      nodes: by name, in order of adding.
      edges: in order of connecting.
      promotes: by the name of a parameter, the parameters inside that it stands for (rule G3).
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
    """A node: what it is, how it runs, what it is given.

    It is one of three: of a type, of a file, or a graph alone, which is a subgraph without a type of its own. A type
    with a graph is a subgraph whose inside was edited and is told instead of built.

    Attributes:
      type: its reference, "my_robot.nodes:MapLookup".
      file: of a subgraph that another file describes, from the folder of this one.
      gate: couples its work to the activity of another.
      parameters: by name.
      inside: of a subgraph: what is otherwise with the nodes in it, by path from there.
      position: in a drawing, x and y.
      notes: of editors, by name.
      graph: of a subgraph: its inside.
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
    """

    hfg: int = VERSION
    name: str = "graph"
    notes: dict[str, Any] = {}
    groups: dict[str, GroupDocument] = {}


NODE_OPTIONS: Final = tuple(declared(NodeFields))
"""The fields of a node that `graph.add` takes."""

"""What a file of CS::APEX says, as plain data. Depends on nothing."""

from __future__ import annotations

from typing import Any

import msgspec


class ApexParameter(msgspec.Struct):
    """A parameter of a node.

    Attributes:
      kind: "value", "range", "interval", "set", "bitset", "color", "path", "angle", "string_list", "trigger" ...
      value: as plain data; None if none is set, or the kind has none. A set's is its number or text, a bitset's the
        list of its names if they are known, else the mask, a colour's "#rrggbb".
      text: of a set, the name of what is selected; it says what is meant, and the number does not.
    """

    kind: str
    value: Any = None
    text: str = ""


class ApexConnection(msgspec.Struct):
    """A connection; ports are named as in the file."""

    source: str
    target: str
    active: bool = False
    line: int = 0


class ApexNode(msgspec.Struct):
    """A node; what is not said is None.

    Attributes:
      raw: all of its entry but its subgraph, as it stands in the file.
    """

    kind: str
    uuid: str
    line: int
    label: str = ""
    position: list[Any] | None = None
    colour: str | None = None
    max_frequency: float | None = None
    exec_mode: int | None = None
    enabled: bool = True
    muted: bool = False
    parameters: dict[str, ApexParameter] = {}
    raw: dict[str, Any] = {}
    graph: ApexGraph | None = None


class ApexGraph(msgspec.Struct):
    """What is in a graph.

    Attributes:
      fulcrums: how many connections have bend points.
    """

    nodes: dict[str, ApexNode] = {}
    connections: list[ApexConnection] = []
    fulcrums: int = 0


class ApexThread(msgspec.Struct):
    """A thread group."""

    name: str
    affinity: list[Any] = []


class ApexFile(msgspec.Struct):
    """A whole file.

    Attributes:
      is_new: whether something in it is only written since automatic ports have numbers.
      assignments: of nodes to thread groups: by path, the group's number.
      rest: what else it says, by key: "settings", "adapters" ...
    """

    graph: ApexGraph
    name: str = ""
    description: str = ""
    is_new: bool = False
    threads: dict[int, ApexThread] = {}
    assignments: dict[str, int] = {}
    rest: dict[str, Any] = {}

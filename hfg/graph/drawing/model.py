"""What comes of a layout, as plain data: rectangles, places of ports, corners of lines, tags and badges.

`hfg draw`, reports and the studio's page show the same. Lengths are pixels at full size, y goes down, and the upper
left corner of the picture is (0, 0). Colours are not in here: who draws takes them from groups and states.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import msgspec

Point: TypeAlias = tuple[float, float]


class PortSpot(msgspec.Struct, frozen=True):
    """A port on the border of a node.

    Attributes:
      kind: "input", "output", "slot", "event" or "parameter"; "timeout" is the event of a time limit, drawn as a clock.
      x: of its middle.
      y: of its middle.
      says: the name to write next to it, "" where it is not needed; of a time-out its limit, "10.1 s".
    """

    kind: str
    name: str
    x: float
    y: float
    says: str = ""


class Badge(msgspec.Struct, frozen=True):
    """A fact of one node, drawn on it.

    Attributes:
      says: of a gate the node that opens it, "" if it is the node itself; of a time-out its limit.
      by: the path of the node that opens a gate.
    """

    kind: Literal["gate", "timeout"]
    says: str
    by: str = ""


class NodeBox(msgspec.Struct, frozen=True):
    """A node, or a subgraph.

    Attributes:
      id: its path.
      kind: "wire" is the end of an edge straight through a subgraph, which has no node.
      x: of its outline, as y, width and height; its tags lie outside.
      row: of a state: which from the top; None for others.
      lane: 0 is that of the states, lower ones are left of it.
      is_open: what is inside of the subgraph is in the drawing.
      inner: how many nodes are inside and not in the drawing.
      details: what was declared about it, in words: "2 Hz".
    """

    id: str
    name: str
    kind: Literal["node", "subgraph", "wire"]
    type_name: str
    group: str
    x: float
    y: float
    width: float
    height: float
    row: int | None = None
    lane: int = 0
    is_state: bool = False
    is_active: bool = False
    is_enabled: bool = True
    is_open: bool = False
    inner: int = 0
    details: tuple[str, ...] = ()
    badges: tuple[Badge, ...] = ()
    ports: tuple[PortSpot, ...] = ()


class EdgeEnds(msgspec.Struct, frozen=True):
    """An edge, by the paths of its ports, and what it is called."""

    source: str
    target: str
    label: str


class Tag(msgspec.Struct, frozen=True):
    """What is at the other end of an edge, written where it begins or ends: no line leads across the picture.

    Attributes:
      text: what is written.
      ports: the paths of the ports that it stands for.
      x: of its rectangle, as y, width and height.
    """

    text: str
    ports: tuple[str, ...]
    kind: str
    x: float
    y: float
    width: float
    height: float


class Line(msgspec.Struct, frozen=True):
    """One line, for one edge or a bundle of them.

    Attributes:
      edges: what it stands for.
      kind: "signal": it begins at an event.
      is_active: it carries activity: a double line.
      is_back: it leads back up, to an earlier state.
      points: its corners, from tail to head.
      combs: thin strokes from an end of the line to the ports of a bundle.
      dots: where it joins or leaves others, which have the same points from there on.
      count_at: the middle of the pill with the number of edges.
      says: the options of the edge, "buffer 4".
      says_at: where that is written, from the left, on the base line; None if there is no room.
      tag: what is at its other end, if no line leads there: a port of the level itself (kind "input", "output", "slot",
        "event"), or another node (kind "to" or "from", `ports` has the path of its port).
      net: lines with the same number may run on top of each other.
    """

    edges: tuple[EdgeEnds, ...]
    kind: Literal["data", "signal"]
    is_active: bool = False
    is_back: bool = False
    points: tuple[Point, ...] = ()
    combs: tuple[tuple[Point, ...], ...] = ()
    dots: tuple[Point, ...] = ()
    count_at: Point | None = None
    says: str = ""
    says_at: Point | None = None
    tag: Tag | None = None
    net: int = -1


class Layout(msgspec.Struct, frozen=True):
    """All that is drawn; open subgraphs are before what lies in them.

    Attributes:
      view: "activity", "mission" or "all".
      groups: all groups of the whole graph, in their order.
      hidden: how many edges this view does not show.
    """

    title: str
    view: str
    width: float
    height: float
    nodes: tuple[NodeBox, ...] = ()
    lines: tuple[Line, ...] = ()
    groups: tuple[str, ...] = ()
    hidden: int = 0

"""A graph as it is drawn, before a format is chosen: views, shapes, ports and arrows. Plain data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal, TypeAlias

import msgspec

from hfg.nodetypes.node import Node

Kind: TypeAlias = Literal["activity", "mission", "all"]
Look: TypeAlias = Literal["node", "box", "port", "start", "stop", "feed"]


class View(msgspec.Struct, frozen=True):
    """Which parts of a graph to show.

    Attributes:
      kind: "activity" shows states and what feeds them, "mission" all with data in bundles, "all" every edge by itself.
        None: "mission" if activity moves between nodes of the level, else "all".
      depth: number of levels of subgraphs that are open; all others are folded. None opens all.
      folded: these subgraphs are, whatever the depth.
      opened: the subgraphs with these paths are open, whatever the depth.
      active: these nodes and subgraphs are shown as active; None: those that are, in a run.
      all_ports: ports are shown that nothing is connected to, too.
      measured: nodes have room for bars and figures.
      places: upper left corners of nodes that the user has chosen, by path; they are kept.
      only: place only these paths, around all others, which stay at their places.
    """

    kind: Kind | None = None
    depth: int | None = None
    folded: frozenset[Node] = frozenset()
    opened: frozenset[str] = frozenset()
    active: frozenset[Node] | None = None
    all_ports: bool = False
    measured: bool = False
    places: Mapping[str, tuple[float, float]] = {}
    only: frozenset[str] | None = None


EVERYTHING: Final = View()


class Pin(msgspec.Struct, frozen=True):
    """Where an arrow meets a node: one of its ports.

    Attributes:
      kind: "input", "output", "slot", "event" or "parameter"; "gate" and "active" are the two ends of a gate.
      order: where it is among the ports that the node's type declares of this kind.
      is_plain: it is the only port that it could be, so its name is not needed.
    """

    kind: str
    name: str
    order: int = 0
    is_plain: bool = False


class Shape(msgspec.Struct):
    """A node, an open subgraph (look "box"), or a port that is drawn by itself; what is in a box follows it, deeper.

    Attributes:
      id: "n0", "n1", ... in order of appearance; "g0", ... of boxes.
      name: as users wrote it.
      details: its options, one per line.
      path: of the node; "" for ports.
      type_name: of the node, or what kind of port it is.
      group: where the node runs.
      pins: the ports of the node that are shown even if no arrow meets them.
      is_state: an active edge begins or ends here.
      is_active: it is active now, in a run.
      is_enabled: it is at the start of a run.
      limit: how long it may be active, "10 s"; "" without a limit.
      inner: how many nodes are inside that are not shown.
    """

    id: str
    name: str
    look: Look
    details: list[str] = []
    path: str = ""
    type_name: str = ""
    group: str = "loop"
    pins: list[Pin] = []
    is_state: bool = False
    is_active: bool = False
    is_enabled: bool = True
    limit: str = ""
    inner: int = 0

    def be_state(self) -> None:
        """An active edge meets it."""
        self.is_state = True

    @property
    def label(self) -> str:
        """Name and details as lines of text."""
        return "\n".join([self.name, *self.details])


class Arrow(msgspec.Struct):
    """An edge or a gate.

    Attributes:
      tail: the shape where it begins.
      head: the shape where it ends.
      label: its ports, as far as they need a name, and its options.
      out_of: the port of the node at which it begins; None if the shape is the port.
      into: the same for its end.
      said: only its options.
      is_signal: it begins at an event.
      is_active: it transports activity: the double line of the paper.
      is_gate: it is no edge; the tail is the state, the head what rests meanwhile.
      is_back: initial tokens lie on it, with which a circle of data begins.
      ends: the paths of both ports; of a gate, the paths of its state node and of the gated node.
    """

    tail: str
    head: str
    label: str
    out_of: Pin | None = None
    into: Pin | None = None
    said: str = ""
    is_signal: bool = False
    is_active: bool = False
    is_gate: bool = False
    is_back: bool = False
    ends: tuple[str, str] = ("", "")


class Picture(msgspec.Struct):
    """Everything to draw.

    Attributes:
      items: all shapes, each with its depth; the content of a box follows the box.
      groups: all groups of the graph in their order.
    """

    title: str
    items: list[tuple[int, Shape]]
    arrows: list[Arrow]
    groups: list[str]

"""The things to place at one level: things with spots on their borders, and links between them.

All of it changes on the way from a picture to a layout: sizes first, then rows and lanes, then places.
"""

from __future__ import annotations

from typing import Final, Literal, TypeAlias

import msgspec

from hfg.graph.drawing.model import Badge
from hfg.graph.drawing.seen import Arrow, Shape

Side: TypeAlias = Literal["left", "right", "top", "bottom"]

GAP: Final = 28.0  # between two rows: three tracks
SIDES: Final[dict[str, Side]] = {"input": "left", "output": "right", "slot": "top", "event": "bottom"}


class Spot(msgspec.Struct, eq=False):
    """A port of a thing.

    Attributes:
      order: where it is among the ports that the type declares.
      is_plain: its name is not needed.
      says: what is written next to it.
      at: how far from the left or upper corner of the thing.
      comb: which bundle it belongs to, by the number of a net; -1: none. Spots of one comb are neighbours.
      pull: which way its lines go from here: negative to the left.
      tagged: names of ports of the level that it leads to or comes from.
      to_tag: how long the line to its tag is; that of activity has a head.
      is_linked: a line leads to another thing, too.
      outside: what is written below it, next to its line.
    """

    kind: str
    name: str
    side: Side
    order: int = 0
    is_plain: bool = False
    says: str = ""
    at: float = 0.0
    comb: int = -1
    pull: float = 0.0
    tagged: list[str] = []
    to_tag: float = 6.0
    is_linked: bool = False
    outside: str = ""


class Thing(msgspec.Struct, eq=False):
    """A node or subgraph.

    Attributes:
      spots: its ports, by kind, name and whether lines begin there.
      left: how much room tags need next to it; also right, top and bottom.
      lane: its column, row: its uppermost row, span: how many rows.
      spine: how far from its left that line runs which leads straight down through the states.
      least: how wide it is at least.
    """

    number: int
    shape: Shape
    spots: dict[tuple[str, str, bool], Spot] = {}
    badges: list[Badge] = []
    width: float = 0.0
    height: float = 0.0
    left: float = 0.0
    right: float = 0.0
    top: float = 0.0
    bottom: float = 0.0
    lane: int = 0
    row: int = 0
    span: int = 1
    spine: float = 0.0
    x: float = 0.0
    y: float = 0.0
    least: float = 96.0

    def on(self, side: Side) -> list[Spot]:
        """Return the spots of a side, in order."""
        return sorted((one for one in self.spots.values() if one.side == side), key=lambda one: one.at)

    def where(self, spot: Spot) -> tuple[float, float]:
        """Return where a spot is in the drawing."""
        match spot.side:
            case "left":
                return self.x, self.y + spot.at
            case "right":
                return self.x + self.width, self.y + spot.at
            case "top":
                return self.x + spot.at, self.y
            case "bottom":
                return self.x + spot.at, self.y + self.height


class Link(msgspec.Struct, eq=False):
    """One line: an edge, or several between the same two things.

    Attributes:
      tail: the thing where it begins; None: a port of the level, written as a tag. So, too, `head`.
      tail_spots: the ports where its edges begin; of a bundle more than one.
      net: lines of the same net may run on top of each other: they come from one port, or lead to one.
      is_back: it leads to a state further up.
      is_jump: it is one half of an edge that is not drawn, with a tag that says where the other is.
      said: what is written next to it.
      via: on which side of the states it goes back: -1 left, 1 right, 0 wherever it is short.
    """

    arrows: list[Arrow]
    tail: Thing | None
    head: Thing | None
    tail_spots: list[Spot]
    head_spots: list[Spot]
    net: int = -1
    is_back: bool = False
    is_jump: bool = False
    via: int = 0
    said: str = ""
    points: list[tuple[float, float]] = []
    combs: list[list[tuple[float, float]]] = []

    @property
    def is_active(self) -> bool:
        """Whether it carries activity."""
        return self.arrows[0].is_active

    @property
    def is_signal(self) -> bool:
        """Whether it begins at an event."""
        return self.arrows[0].is_signal


class Work(msgspec.Struct, eq=False):
    """A level during its layout."""

    things: list[Thing]
    links: list[Link]
    has_rows: bool = False
    box: str = ""
    width: float = 0.0
    height: float = 0.0

    def move(self, x: float, y: float) -> None:
        """Put everything that far further right and down."""
        for thing in self.things:
            thing.x, thing.y = thing.x + x, thing.y + y
        for link in self.links:
            link.points = [(at_x + x, at_y + y) for at_x, at_y in link.points]

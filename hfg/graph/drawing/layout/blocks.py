"""What is laid out, blocks and the lines between them, and what comes of it. All lengths are pixels, y goes down."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias

import msgspec
from msgspec import structs

__all__ = ["Block", "Dock", "Label", "Line", "Plan", "Point", "Side"]

Side: TypeAlias = Literal["left", "right", "top", "bottom"]
Point: TypeAlias = tuple[float, float]


class Dock(msgspec.Struct):
    """A place on the border of a block where lines begin or end.

    Attributes:
      side: lines reach it from there.
      at: how far from the left or upper corner; the layout chooses it for top and bottom, unless `is_fixed`.
      room: along the border, for its name; where the layout chooses.
    """

    side: Side
    at: float = 0.0
    room: float = 12.0
    is_fixed: bool = False


class Block(msgspec.Struct):
    """A rectangle.

    Attributes:
      rank: "first" or "last": in a column before or behind all others.
      tier: of those blocks, who is above whom in any case.
    """

    width: float
    height: float
    docks: list[Dock]
    rank: Literal["", "first", "last"] = ""
    tier: int = 0

    def add(self, dock: Dock) -> int:
        """Give it one more dock, and say which one it is."""
        self.docks.append(dock)
        return len(self.docks) - 1

    def settle(self, places: Sequence[float]) -> None:
        """Take the places of the docks from the layout."""
        self.docks = [structs.replace(dock, at=at) for dock, at in zip(self.docks, places, strict=True)]


class Label(msgspec.Struct, frozen=True):
    """Room for a text above a line."""

    width: float
    height: float


class Line(msgspec.Struct):
    """A connection of two blocks.

    Attributes:
      tail: which block it begins at, by its position in the list.
      tail_dock: at which of its docks.
      head: where it ends, likewise.
      head_dock: likewise.
      kind: lines of one kind from one dock run together as long as they can.
      is_data: it should lead to the right, more than others should.
      is_back: it is the one that may lead to the left.
    """

    tail: int
    tail_dock: int
    head: int
    head_dock: int
    kind: str = ""
    is_data: bool = True
    is_back: bool = False
    label: Label | None = None


class Plan(msgspec.Struct):
    """Where everything is.

    Attributes:
      blocks: the left upper corner of each.
      lines: the corners of each, from tail to head.
      dots: for each line, where it parts from others that came along with it; each is told once.
      labels: for each line the left lower corner of its label, if it has one.
    """

    width: float
    height: float
    blocks: list[Point]
    lines: list[list[Point]]
    dots: list[list[Point]]
    labels: list[Point | None]

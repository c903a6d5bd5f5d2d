"""One level of a drawing, the whole or the inside of one subgraph, and the block that it is for the level around it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from hfg.graph.drawing.layout import Block, Dock, Line, Plan, arrange
from hfg.graph.drawing.layout.blocks import Point, Side
from hfg.graph.drawing.parts import (
    DETAIL,
    LONGEST_NAME,
    LONGEST_PORT,
    NAME,
    PAD,
    PORT,
    SIDES,
    Key,
    Part,
    Text,
)
from hfg.graph.drawing.picture import Arrow, Box, Pin, Shape
from hfg.graph.drawing.text import shortened, width_of

__all__ = ["Level", "key_on_box", "lets_in"]

_BESIDE: Final = 13.0  # one line of a subgraph's ports beside the other


class Level:
    """The graph, or the inside of one subgraph.

    Attributes:
      box: the subgraph; None for the whole.
      around: the level in which that lies.
      shapes: what lies here.
      ports: of the subgraph itself.
      arrows: and the shape or box here where each begins and ends.
      parts: the blocks of all that lies here.
      part_of: the number of each, by the id of what it stands for.
      plan: where they are.
      at: where the inside is in the drawing.
    """

    def __init__(self, box: Box | None, around: Level | None) -> None:
        self.box = box
        self.around = around
        self.shapes: list[Shape | Box] = []
        self.ports: list[Shape] = []
        self.arrows: list[tuple[Arrow, str, str]] = []
        self.parts: list[Part] = []
        self.part_of: dict[str, int] = {}
        self.plan = Plan(0.0, 0.0, [], [], [], [])
        self.at: Point = (0.0, 0.0)
        self._outer: list[Shape] = []  # ports of the subgraph that nothing inside leads to or from
        self._left = self._top = 0.0  # of the inside within its box

    # --- before it is laid out

    def used(self) -> set[str]:
        """Give what lines begin and end at."""
        return {end for _, *ends in self.arrows for end in ends}

    def pins(self) -> dict[str, dict[Key, Pin]]:
        """Give the ports of nodes that are shown."""
        found: dict[str, dict[Key, Pin]] = {}
        for of in self.shapes:
            for pin in of.pins if isinstance(of, Shape) else ():
                found.setdefault(of.id, {})[pin.kind, pin.name, pin.kind in ("output", "event")] = pin
        for arrow, tail, head in self.arrows:
            for end, met, is_tail in ((tail, arrow.out_of, True), (head, arrow.into, False)):
                if met is not None:
                    found.setdefault(end, {})[met.kind, met.name, is_tail] = met
        return found

    def add(self, part: Part) -> None:
        """Let a block lie here."""
        self.part_of[part.of.id] = len(self.parts)
        self.parts.append(part)

    def add_ports(self) -> None:
        """Let ports of the subgraph itself be blocks in the first or last column, as wide as their names."""
        used = self.used()
        self._outer = [port for port in self.ports if port.id not in used and _side(port) in ("top", "bottom")]
        for port in self.ports:
            if port in self._outer:
                continue
            inwards = lets_in(port)
            width = width_of(shortened(port.name, LONGEST_PORT), PORT) + 10
            dock = Dock("right" if inwards else "left", 15.0)
            tier = _side(port) != "top" if inwards else _side(port) == "bottom"
            self.add(Part(port, Block(width, 17.0, [dock], "first" if inwards else "last", tier)))

    def arrange(self, lines: Sequence[Line]) -> None:
        """Lay it out."""
        self.plan = arrange([part.block for part in self.parts], lines)

    # --- when it is laid out

    def as_part(self, box: Box) -> Part:
        """Make a block of it, with docks where the ports of the subgraph are on its border."""
        upper, lower = self._in_order("top"), self._in_order("bottom")
        over, under = self._on_border("top"), self._on_border("bottom")
        self._left, right = (PAD + 6.0 + _BESIDE * len(ports) if ports else PAD + 2.0 for ports in (upper, lower))
        self._top = 26.0 + 12.0 * len(box.details)
        name = shortened(box.name, LONGEST_NAME)
        title = width_of(name, NAME, bold=True) + sum(room for _, room in over)
        details = [width_of(detail, DETAIL) for detail in box.details]
        width = self._left + max(self.plan.width, title, sum(room for _, room in under), *details) + right
        height = self._top + max(self.plan.height, 6.0) + (26.0 if under else 16.0)
        texts = [Text(self._left, 17.0, name, NAME, bold=True)]
        texts += (Text(self._left, 30.0 + 12.0 * number, detail, DETAIL) for number, detail in enumerate(box.details))
        part = Part(box, Block(round(width), round(height), []), *texts)
        _add_docks(part, over, width - right - sum(room for _, room in over))
        _add_docks(part, under, self._left)
        docks = {
            port.id: Dock("top", self._left - 8.0 - _BESIDE * number, is_fixed=True)
            for number, port in enumerate(upper)
        }
        first = part.block.width - right + 8.0
        docks |= {
            port.id: Dock("bottom", first + 10.0 * number, is_fixed=True) for number, port in enumerate(reversed(lower))
        }
        for port in self.ports:
            if port not in self._outer:
                dock = docks.get(port.id) or self._dock_beside(port)
                part.add_dock(key_on_box(port), dock, is_port=port.type_name != "active")
        return part

    def _dock_beside(self, port: Shape) -> Dock:
        """Let a port be on the left or right border, where its line comes to inside."""
        at = self._top + self.plan.blocks[self.part_of[port.id]][1] + 15.0
        return Dock("left" if lets_in(port) else "right", at)

    def _on_border(self, side: Side) -> list[tuple[Shape, float]]:
        """Give the ports of a side that have no line inside, and how much of the border each takes."""
        return [
            (
                port,
                14.0
                if port.type_name in ("gate", "active")
                else width_of(shortened(port.name, LONGEST_PORT), PORT) + 12.0,
            )
            for port in self._outer
            if _side(port) == side
        ]

    def _in_order(self, side: Side) -> list[Shape]:
        """Give the ports on one side of the subgraph as the layout has ordered them, from the top."""
        found = [port for port in self.ports if port not in self._outer and _side(port) == side]
        return sorted(found, key=lambda port: self.plan.blocks[self.part_of[port.id]][1])

    def place(self, x: float, y: float) -> None:
        """Let the subgraph be there in the drawing."""
        self.at = (x + self._left, y + self._top)

    def from_border(self, port: Shape, way: Sequence[Point]) -> list[Point]:
        """Lead a line that begins at a port of the subgraph from there to where the layout has begun it."""
        if self.box is None or self.around is None:
            return []
        part = self.around.parts[self.around.part_of[self.box.id]]
        dock = part.block.docks[part.docks[key_on_box(port)]]
        x, y = self.at[0] - self._left, self.at[1] - self._top
        match dock.side:
            case "left":
                return [(x, y + dock.at)]
            case "right":
                return [(x + part.block.width, y + dock.at)]
            case "top":
                return [(x + dock.at, y), (x + dock.at, way[0][1])]
            case "bottom":
                return [(x + dock.at, y + part.block.height), (x + dock.at, way[0][1])]


def _add_docks(part: Part, ports: Iterable[tuple[Shape, float]], x: float) -> None:
    """Put ports side by side on the border of a subgraph."""
    for port, room in ports:
        is_port = port.type_name != "active"
        named = None if port.type_name in ("gate", "active") else port.name
        dock = Dock(_side(port), x + room / 2, is_fixed=True)
        part.add_dock(key_on_box(port), dock, is_port=is_port, named=named)
        x += room


def lets_in(port: Shape) -> bool:
    """Whether a port of a subgraph leads inwards."""
    return port.type_name in ("input", "slot", "gate", "parameter")


def key_on_box(port: Shape) -> Key:
    """Give what a port is called among the docks of its subgraph."""
    return port.type_name, port.id, not lets_in(port)


def _side(port: Shape) -> Side:
    return SIDES.get(port.type_name, "left")

"""One block of a drawing: what is written on it, and where its ports are on its border. Stands on `layout`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple, TypeAlias

import msgspec

from hfg.graph.drawing.layout.blocks import Block, Dock, Side
from hfg.graph.drawing.picture import Box, Pin, Shape
from hfg.graph.drawing.text import shortened, width_of

__all__ = [
    "DETAIL",
    "LONGEST_NAME",
    "LONGEST_PORT",
    "LONGEST_SAID",
    "NAME",
    "PAD",
    "PORT",
    "SIDES",
    "Card",
    "Key",
    "Mark",
    "Part",
    "Text",
    "node",
    "pill",
]

NAME: Final = 12.0  # sizes of letters: names of nodes, what else is said, names of ports
DETAIL: Final = 10.0
PORT: Final = 9.5
LONGEST_NAME: Final = 34  # letters
LONGEST_PORT: Final = 26
LONGEST_SAID: Final = 48

PAD: Final = 12.0
_ROW: Final = 14.0  # one port below the other
_PORT_ROOM: Final = 10.0  # between the names of two ports side by side
SIDES: Final[dict[str, Side]] = {
    "input": "left",
    "output": "right",
    "slot": "top",
    "event": "bottom",
    "gate": "top",
    "active": "bottom",
}

Key: TypeAlias = tuple[str, str, bool]
"""A port of a node: its kind, its name, and whether lines begin at it."""


class Text(msgspec.Struct, frozen=True):
    """A line of text; its place is where it begins, ends or has its middle, and its base line."""

    x: float
    y: float
    text: str
    size: float
    anchor: str = "start"
    bold: bool = False

    def moved(self, x: float, y: float) -> Text:
        """Give it at another place, so far away."""
        return msgspec.structs.replace(self, x=self.x + x, y=self.y + y)


class Mark(msgspec.Struct, frozen=True):
    """A port on the border of a node or subgraph."""

    x: float
    y: float
    kind: str
    name: str


class Card(msgspec.Struct):
    """A node, a port drawn by itself, or a subgraph, from the left upper corner of the drawing."""

    of: Shape | Box
    x: float
    y: float
    width: float
    height: float
    texts: list[Text]
    marks: list[Mark]


class Part:
    """A block of a level with what is written on it, from its own corner.

    Attributes:
      of: what it stands for.
      block: what is laid out.
      texts: what is written on it, besides names of ports on top and bottom.
      docks: which dock of the block each port is.
    """

    def __init__(self, of: Shape | Box, block: Block, *texts: Text) -> None:
        self.of = of
        self.block = block
        self.texts = texts
        self.docks: dict[Key, int] = {}
        self._named: list[tuple[int, str]] = []  # docks on top and bottom whose names are written where they come to be
        self._unmarked: set[int] = set()  # docks that are no port

    def add_dock(self, key: Key, dock: Dock, *, is_port: bool = True, named: str | None = None) -> int:
        """Let lines begin or end there; `named` is written beside it, once the layout has placed it."""
        number = self.block.add(dock)
        self.docks[key] = number
        if not is_port:
            self._unmarked.add(number)
        if named is not None:
            self._named.append((number, named))
        return number

    def card(self, x: float, y: float) -> Card:
        """Give what is drawn of it at a place, when it is laid out."""
        texts = [text.moved(x, y) for text in (*self.texts, *self._names_of_docks())]
        return Card(self.of, x, y, self.block.width, self.block.height, texts, list(self._marks(x, y)))

    def _marks(self, x: float, y: float) -> Iterator[Mark]:
        block = self.block
        for (kind, name, _), index in self.docks.items():
            if index in self._unmarked:
                continue
            dock = block.docks[index]
            right, down = {
                "left": (0.0, dock.at),
                "right": (block.width, dock.at),
                "top": (dock.at, 0.0),
                "bottom": (dock.at, block.height),
            }[dock.side]
            yield Mark(right + x, down + y, kind, name)

    def _names_of_docks(self) -> Iterator[Text]:
        """Write the names of ports on top and bottom, below or above them."""
        for index, name in self._named:
            dock = self.block.docks[index]
            y = 14.0 if dock.side == "top" else self.block.height - 7.0
            yield Text(dock.at, y, shortened(name, LONGEST_PORT), PORT, "middle")


def pill(of: Shape) -> Part:
    """Make a block of a port that is drawn by itself."""
    is_end = of.look in ("start", "stop")
    name = shortened(of.name, LONGEST_PORT)
    width = round(width_of(name, DETAIL)) + (34.0 if is_end else 22.0)
    block = Block(width, 22.0, [Dock("right", 11.0), Dock("left", 11.0)])
    return Part(of, block, Text(24.0 if is_end else 11.0, 14.5, name, DETAIL))


def node(of: Shape, pins: dict[Key, Pin]) -> Part:
    """Make a block of a node: its name, what is said about it, and its ports."""
    left, right, top, bottom = (_side(side, pins) for side in ("left", "right", "top", "bottom"))
    width = _width(of, left, right, top, bottom)
    y = 7.0 + (12.0 if top.is_named else 0.0)
    middle = y + 8.0
    name = shortened(of.name, LONGEST_NAME)
    texts = [Text(width / 2 - (7.0 if of.is_folded else 0.0), y + 12.0, name, NAME, "middle", bold=True)]
    y += 16.0
    for detail in of.details:
        y += 12.0
        texts.append(Text(width / 2, y - 2.0, shortened(detail, LONGEST_SAID), DETAIL, "middle"))
    first_row = y + 8.0
    y += _ROW * max(left.rows, right.rows) + (12.0 if bottom.is_named else 0.0) + 7.0
    most = max(0 if side.is_named else len(side.ports) for side in (left, right))
    height = max(y, 30.0, 12.0 * most + 8.0)
    centre = middle if most == 1 else height / 2
    for side, x, anchor in ((left, 8.0, "start"), (right, width - 8.0, "end")):
        if side.is_named:
            ports = zip(side.places(first_row, centre), side.ports, strict=True)
            texts += (Text(x, at + 3.5, _port_name(pin), PORT, anchor) for at, (_, pin) in ports)
    part = Part(of, Block(width, height, []), *texts)
    for side in (left, right, top, bottom):
        for at, (key, pin) in zip(side.places(first_row, centre), side.ports, strict=True):
            named = None if pin.is_plain or side.is_upright else pin.name
            dock = Dock(side.side, at, room=_room(pin))
            part.add_dock(key, dock, is_port=pin.kind != "active", named=named)
    return part


class _Side(NamedTuple):
    """The ports on one side of a node, in order."""

    side: Side
    ports: list[tuple[Key, Pin]]

    @property
    def is_upright(self) -> bool:
        """Whether ports are one below the other."""
        return self.side in ("left", "right")

    @property
    def is_named(self) -> bool:
        """Whether names stand beside the ports: no, if each is the only one that it could be."""
        return any(not pin.is_plain for _, pin in self.ports)

    @property
    def rows(self) -> int:
        """How many names stand one below the other."""
        return len(self.ports) if self.is_named else 0

    @property
    def widest(self) -> float:
        return max((_port_width(pin) for _, pin in self.ports), default=0.0)

    @property
    def room(self) -> float:
        """What the ports need side by side."""
        return sum(_room(pin) for _, pin in self.ports)

    def places(self, first_row: float, centre: float) -> list[float]:
        """Give where each port is: named ones in rows, others around a place; on top and bottom the layout says."""
        count = len(self.ports)
        if not self.is_upright:
            return [0.0] * count
        if self.is_named:
            return [first_row + _ROW * index for index in range(count)]
        return [centre + 12.0 * (index - (count - 1) / 2) for index in range(count)]


def _side(side: Side, pins: dict[Key, Pin]) -> _Side:
    found = [(key, pin) for key, pin in pins.items() if _side_of(key) == side]
    found.sort(key=lambda port: (port[1].kind == "parameter", port[1].order, port[1].name))
    return _Side(side, found)


def _side_of(key: Key) -> Side:
    kind, _, is_tail = key
    if kind == "parameter":
        return "right" if is_tail else "left"
    return SIDES[kind]


def _width(of: Shape, left: _Side, right: _Side, top: _Side, bottom: _Side) -> int:
    name = shortened(of.name, LONGEST_NAME)
    wide = [width_of(name, NAME, bold=True) + (18.0 if of.is_folded else 0.0), top.room, bottom.room]
    wide += [width_of(shortened(detail, LONGEST_SAID), DETAIL) for detail in of.details]
    if left.rows or right.rows:
        wide.append(left.widest + right.widest + _PORT_ROOM)
    return round(max(wide) + 2 * PAD)


def _port_name(pin: Pin) -> str:
    return "" if pin.is_plain else shortened(pin.name, LONGEST_PORT)


def _port_width(pin: Pin) -> float:
    return width_of(_port_name(pin), PORT)


def _room(pin: Pin) -> float:
    return max(_port_width(pin) + 8.0, 14.0)

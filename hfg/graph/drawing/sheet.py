"""The parts of a drawing with their sizes and places: a picture that has been laid out.

Each subgraph is laid out by itself, the innermost first; outside it is a block with docks where its ports are on its
border. Stands on `picture` and `layout`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, TypeAlias

import msgspec

from hfg.graph.drawing.layout import Block, Dock, Label, Line, Plan, arrange
from hfg.graph.drawing.layout.blocks import Point, Side
from hfg.graph.drawing.picture import Arrow, Box, Picture, Pin, Shape
from hfg.graph.drawing.text import shortened, width_of

__all__ = ["DETAIL", "NAME", "PORT", "Card", "Lead", "Mark", "Sheet", "Text", "sheet"]

NAME: Final = 12.0  # sizes of letters: names of nodes, what else is said, names of ports
DETAIL: Final = 10.0
PORT: Final = 9.5
LONGEST_NAME: Final = 34  # letters
LONGEST_PORT: Final = 26
LONGEST_SAID: Final = 48

_PAD: Final = 12.0
_BESIDE: Final = 13.0  # one line of a subgraph's ports beside the other
_ROW: Final = 14.0  # one port below the other
_PORT_ROOM: Final = 10.0  # between the names of two ports side by side
_SIDES: Final[dict[str, Side]] = {
    "input": "left",
    "output": "right",
    "slot": "top",
    "event": "bottom",
    "gate": "top",
    "active": "bottom",
}

Key: TypeAlias = tuple[str, str, bool]
"""A port of a node: its kind, its name, and whether lines begin at it."""


class Text(msgspec.Struct):
    """A line of text; its place is where it begins, ends or has its middle, and its base line."""

    x: float
    y: float
    text: str
    size: float
    anchor: str = "start"
    bold: bool = False


class Mark(msgspec.Struct):
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


class Lead(msgspec.Struct):
    """A line, or several that come out of one port together.

    Attributes:
      arrows: what each stands for.
      ways: the corners of each.
    """

    arrows: list[Arrow]
    ways: list[list[Point]]
    dots: list[Point]
    texts: list[Text]


class Sheet(msgspec.Struct):
    """All that is drawn; subgraphs are before what lies in them."""

    width: float
    height: float
    cards: list[Card]
    leads: list[Lead]
    texts: list[Text]


def sheet(picture: Picture) -> Sheet:
    """Lay a picture out."""
    return _Sheet(picture).sheet


class _Part:
    """A block of a level with what is written on it, from its own corner."""

    def __init__(self, of: Shape | Box, block: Block) -> None:
        self.of = of
        self.block = block
        self.texts: list[Text] = []
        self.docks: dict[Key, int] = {}
        self.named: list[tuple[int, str]] = []  # docks on top and bottom whose names are written where they come to be
        self.unmarked: set[int] = set()  # docks that are no port
        self.inside: _Level | None = None

    def marks(self) -> Iterator[Mark]:
        """Give the ports on its border."""
        block = self.block
        for (kind, name, _), index in self.docks.items():
            if index in self.unmarked:
                continue
            dock = block.docks[index]
            x, y = {
                "left": (0.0, dock.at),
                "right": (block.width, dock.at),
                "top": (dock.at, 0.0),
                "bottom": (dock.at, block.height),
            }[dock.side]
            yield Mark(x, y, kind, name)

    def names_of_docks(self) -> Iterator[Text]:
        """Write the names of ports on top and bottom, below or above them."""
        for index, name in self.named:
            dock = self.block.docks[index]
            y = 14.0 if dock.side == "top" else self.block.height - 7.0
            yield Text(dock.at, y, shortened(name, LONGEST_PORT), PORT, "middle")


class _Level:
    """The graph, or the inside of one subgraph."""

    def __init__(self, box: Box | None, around: _Level | None) -> None:
        self.box = box
        self.around = around
        self.shapes: list[Shape | Box] = []
        self.ports: list[Shape] = []  # of the subgraph itself
        self.outer: list[Shape] = []  # those that nothing inside leads to or from
        self.arrows: list[tuple[Arrow, str, str]] = []  # and the shape or box here where each begins and ends
        self.parts: list[_Part] = []
        self.part_of: dict[str, int] = {}
        self.plan = Plan(0.0, 0.0, [], [], [], [])
        self.left = self.top = 0.0  # of the inside within its box
        self.at: Point = (0.0, 0.0)  # of the inside within the drawing


class _Sheet:
    """One walk from a picture to a sheet."""

    def __init__(self, picture: Picture) -> None:
        self.picture = picture
        self.root = _Level(None, None)
        self.levels = [self.root]
        self.home: dict[str, _Level] = {}  # by shape or box: where it lies
        self.inside: dict[str, _Level] = {}  # by box, and by port on a box: what it looks into
        self.by_id: dict[str, Shape | Box] = {}
        self._find_levels()
        for arrow in picture.arrows:
            self._give_to_level(arrow)
        for level in reversed(self.levels):  # the inner ones before those around them
            self._arrange(level)
        self.cards: list[Card] = []
        self.leads: list[Lead] = []
        self.texts: list[Text] = []
        for level in self.levels:
            self._draw(level)
        plan = self.root.plan
        self.sheet = Sheet(plan.width, plan.height, self.cards, self.leads, self.texts)

    # --- what lies where

    def _find_levels(self) -> None:
        stack = [self.root]
        for depth, item in self.picture.items:
            del stack[depth + 1 :]
            level = stack[-1]
            self.by_id[item.id] = item
            self.home[item.id] = level
            if isinstance(item, Box):
                level.shapes.append(item)
                inside = _Level(item, level)
                self.inside[item.id] = inside
                self.levels.append(inside)
                stack.append(inside)
            elif level.box is not None and item.look == "port":
                level.ports.append(item)
                self.inside[item.id] = level
            else:
                level.shapes.append(item)

    def _give_to_level(self, arrow: Arrow) -> None:
        """Find the level at which a line runs; ends that lie deeper are those of the box around them."""
        tail, head = self.by_id[arrow.tail], self.by_id[arrow.head]
        tails, heads = self._seen_from(tail.id), self._seen_from(head.id)
        if tail.id in self.inside and self.inside[tail.id] is self.inside.get(head.id):
            # Two ports of one subgraph: inside, a line leads from one that lets in to one that lets out.
            assert isinstance(tail, Shape)
            inside = self.inside[tail.id]
            inner = tail.type_name in ("input", "slot")
            level = inside if inner or inside.around is None else inside.around
        elif isinstance(head, Shape) and head.look == "stop":
            level = self._side(tail.id, lets_in=True)  # the end of the run is drawn where it is meant
        elif isinstance(tail, Shape) and tail.look == "start":
            level = self._side(head.id, lets_in=False)
        else:
            level = next(level for level in tails if level in heads)
        level.arrows.append((arrow, tails.get(level, tail.id), heads.get(level, head.id)))

    def _side(self, shape: str, *, lets_in: bool) -> _Level:
        """Give the level of a shape; of a port on a subgraph its inside, if it is one that lets in, or out."""
        level = self.inside.get(shape, self.home[shape])
        of = self.by_id[shape]
        assert isinstance(of, Shape)
        if shape in self.inside and level.around is not None and _lets_in(of) != lets_in:
            return level.around
        return level

    def _seen_from(self, shape: str) -> dict[_Level, str]:
        """Give the levels that see a shape, the innermost first, and as what: itself, or a box around it."""
        found: dict[_Level, str] = {}
        level: _Level | None = self.inside.get(shape, self.home[shape])
        while level is not None:
            found[level] = shape
            shape = shape if level.box is None else level.box.id
            level = level.around
        return found

    # --- one level

    def _arrange(self, level: _Level) -> None:
        pins = self._pins(level)
        used = {end for _, *ends in level.arrows for end in ends}
        for of in level.shapes:
            if of.id in used or not isinstance(of, Shape) or of.look not in ("start", "stop"):
                self._add(level, of, pins.get(of.id, {}))
        for end in sorted(end for end in used if self._is_from_afar(level, end)):
            self._add(level, self.by_id[end], {})
        level.outer = [port for port in level.ports if port.id not in used and _side_on_box(port) in ("top", "bottom")]
        for port in level.ports:
            if port not in level.outer:
                self._add_port(level, port)
        lines = []
        for arrow, tail, head in level.arrows:
            ends = *self._dock(level, tail, arrow, is_tail=True), *self._dock(level, head, arrow, is_tail=False)
            label = None
            if arrow.said:
                label = Label(width_of(shortened(arrow.said, LONGEST_SAID), PORT) + 8, PORT + 4)
            is_data = not (arrow.is_signal or arrow.is_gate)
            lines.append(Line(*ends, kind=_kind(arrow), is_data=is_data, is_back=arrow.is_back, label=label))
        level.plan = arrange([part.block for part in level.parts], lines)

    def _is_from_afar(self, level: _Level, shape: str) -> bool:
        """Whether it is `start`, `stop` or `abort`, of which each level that uses it has its own."""
        of = self.by_id[shape]
        return isinstance(of, Shape) and of.look in ("start", "stop") and self.home[shape] is not level

    def _pins(self, level: _Level) -> dict[str, dict[Key, Pin]]:
        found: dict[str, dict[Key, Pin]] = {}
        for of in level.shapes:
            for pin in of.pins if isinstance(of, Shape) else ():
                found.setdefault(of.id, {})[pin.kind, pin.name, pin.kind in ("output", "event")] = pin
        for arrow, tail, head in level.arrows:
            for end, met, is_tail in ((tail, arrow.out_of, True), (head, arrow.into, False)):
                if met is not None:
                    found.setdefault(end, {})[met.kind, met.name, is_tail] = met
        return found

    def _add(self, level: _Level, of: Shape | Box, pins: dict[Key, Pin]) -> None:
        if isinstance(of, Box):
            part = self._box(of)
        elif of.look == "node":
            part = _node(of, pins)
        else:
            part = _pill(of)
        level.part_of[of.id] = len(level.parts)
        level.parts.append(part)

    def _add_port(self, level: _Level, port: Shape) -> None:
        """Let a port of the subgraph itself be a block in the first or last column, as wide as its name."""
        lets_in = _lets_in(port)
        width = width_of(shortened(port.name, LONGEST_PORT), PORT) + 10
        block = Block(width, 17.0, [Dock("right" if lets_in else "left", 15.0)], "first" if lets_in else "last")
        block.tier = _side_on_box(port) != "top" if lets_in else _side_on_box(port) == "bottom"
        level.part_of[port.id] = len(level.parts)
        level.parts.append(_Part(port, block))

    def _dock(self, level: _Level, shape: str, arrow: Arrow, *, is_tail: bool) -> tuple[int, int]:
        """Give the block and the dock where a line begins or ends."""
        pin = arrow.out_of if is_tail else arrow.into
        end = arrow.tail if is_tail else arrow.head
        number = level.part_of[shape]
        part = level.parts[number]
        if shape != end:
            return number, self._dock_of_box(part, end, is_tail=is_tail)
        if pin is not None:
            return number, part.docks[pin.kind, pin.name, is_tail]
        return number, 0 if is_tail or part.block.rank else 1

    def _dock_of_box(self, part: _Part, end: str, *, is_tail: bool) -> int:
        """Give the dock of a port of a subgraph, or of a gate that leads to what lies in it or comes from there."""
        of = self.by_id[end]
        assert isinstance(of, Shape)
        key = _key_on_box(of)
        if self.inside.get(end) is not part.inside:
            key = ("active" if is_tail else "gate", end, is_tail)
        if key not in part.docks:
            part.docks[key] = len(part.block.docks)
            if is_tail:
                part.unmarked.add(len(part.block.docks))
            part.block.docks.append(Dock("bottom" if is_tail else "top", round(part.block.width / 2), is_fixed=True))
        return part.docks[key]

    def _box(self, box: Box) -> _Part:
        """Make a block of a subgraph whose inside is laid out."""
        level = self.inside[box.id]
        plan = level.plan
        upper, lower = _in_order(level, "top"), _in_order(level, "bottom")
        level.left = _PAD + 6.0 + _BESIDE * len(upper) if upper else _PAD + 2.0
        right = _PAD + 6.0 + _BESIDE * len(lower) if lower else _PAD + 2.0
        over = [port for port in level.outer if _side_on_box(port) == "top"]
        under = [port for port in level.outer if _side_on_box(port) == "bottom"]
        rooms = {port.id: _room_on_border(port) for port in level.outer}
        level.top = 26.0 + 12.0 * len(box.details)
        title = width_of(shortened(box.name, LONGEST_NAME), NAME, bold=True)
        details = [width_of(detail, DETAIL) for detail in box.details]
        title += sum(rooms[port.id] for port in over)
        inner = max(plan.width, title, sum(rooms[port.id] for port in under), *details)
        width = level.left + inner + right
        height = level.top + max(plan.height, 6.0) + (26.0 if under else 16.0)
        part = _Part(box, Block(round(width), round(height), []))
        part.inside = level
        part.texts.append(Text(level.left, 17.0, shortened(box.name, LONGEST_NAME), NAME, bold=True))
        for number, detail in enumerate(box.details):
            part.texts.append(Text(level.left, 30.0 + 12.0 * number, detail, DETAIL))
        for ports, x in ((over, width - right - sum(rooms[port.id] for port in over)), (under, level.left)):
            for port in ports:
                self._set_dock(part, port, Dock(_side_on_box(port), x + rooms[port.id] / 2, is_fixed=True))
                x += rooms[port.id]
                if port.type_name not in ("gate", "active"):
                    part.named.append((len(part.block.docks) - 1, port.name))
        for port in level.ports:
            if port in level.outer:
                continue
            number = level.part_of[port.id]
            at = level.top + plan.blocks[number][1] + 15.0
            if port in upper:
                dock = Dock("top", level.left - 8.0 - _BESIDE * upper.index(port), is_fixed=True)
            elif port in lower:
                x = part.block.width - right + 8.0 + 10.0 * (len(lower) - 1 - lower.index(port))
                dock = Dock("bottom", x, is_fixed=True)
            else:
                dock = Dock("left" if _lets_in(port) else "right", at)
            self._set_dock(part, port, dock)
        return part

    def _set_dock(self, part: _Part, port: Shape, dock: Dock) -> None:
        if port.type_name == "active":
            part.unmarked.add(len(part.block.docks))
        part.docks[_key_on_box(port)] = len(part.block.docks)
        part.block.docks.append(dock)

    # --- what comes of it

    def _draw(self, level: _Level) -> None:
        left, top = level.at
        for part, (x, y) in zip(level.parts, level.plan.blocks, strict=True):
            x, y = left + x, top + y
            if part.inside is not None:
                part.inside.at = (x + part.inside.left, y + part.inside.top)
            if part.block.rank:
                self._draw_name_of_port(part, x, y)
                continue
            texts = [*part.texts, *part.names_of_docks()]
            for text in texts:
                text.x, text.y = text.x + x, text.y + y
            marks = list(part.marks())
            for mark in marks:
                mark.x, mark.y = mark.x + x, mark.y + y
            self.cards.append(Card(part.of, x, y, part.block.width, part.block.height, texts, marks))
        wires: dict[tuple[str, str, str], Lead] = {}
        for number, (arrow, tail, head) in enumerate(level.arrows):
            way = [(left + x, top + y) for x, y in level.plan.lines[number]]
            way = [*self._from_border(level, tail, way), *way, *reversed(self._from_border(level, head, way[::-1]))]
            port = arrow.out_of.name if arrow.out_of is not None else ""
            lead = wires.setdefault((arrow.tail, port, _kind(arrow)), Lead([], [], [], []))
            lead.arrows.append(arrow)
            lead.ways.append(way)
            lead.dots += [(left + x, top + y) for x, y in level.plan.dots[number]]
            label = level.plan.labels[number]
            if label is not None:
                said = shortened(arrow.said, LONGEST_SAID)
                lead.texts.append(Text(left + label[0] + 4, top + label[1] - 4, said, PORT))
        self.leads += wires.values()

    def _draw_name_of_port(self, part: _Part, x: float, y: float) -> None:
        """Write the name of a port of the subgraph beside its line inside."""
        name = shortened(part.of.name, LONGEST_PORT)
        if part.block.rank == "first":
            self.texts.append(Text(x, y + 11.5, name, PORT))
        else:
            self.texts.append(Text(x + part.block.width, y + 11.5, name, PORT, "end"))

    def _from_border(self, level: _Level, end: str, way: Sequence[Point]) -> list[Point]:
        """Lead a line that begins at a port of the subgraph from there to where the layout has begun it."""
        if level.box is None or self.inside.get(end) is not level or level.around is None:
            return []
        of = self.by_id[end]
        assert isinstance(of, Shape)
        number = level.around.part_of[level.box.id]
        part = level.around.parts[number]
        dock = part.block.docks[part.docks[_key_on_box(of)]]
        x, y = level.at[0] - level.left, level.at[1] - level.top
        match dock.side:
            case "left":
                return [(x, y + dock.at)]
            case "right":
                return [(x + part.block.width, y + dock.at)]
            case "top":
                return [(x + dock.at, y), (x + dock.at, way[0][1])]
            case "bottom":
                return [(x + dock.at, y + part.block.height), (x + dock.at, way[0][1])]


def _kind(arrow: Arrow) -> str:
    if arrow.is_gate:
        return "gate"
    return ("signal" if arrow.is_signal else "data") + (" active" if arrow.is_active else "")


def _lets_in(port: Shape) -> bool:
    return port.type_name in ("input", "slot", "gate", "parameter")


def _key_on_box(port: Shape) -> Key:
    return port.type_name, port.id, not _lets_in(port)


def _side_on_box(port: Shape) -> Side:
    return _SIDES.get(port.type_name, "left")


def _room_on_border(port: Shape) -> float:
    """How much of the border of a subgraph a port takes that has no line inside."""
    return 14.0 if port.type_name in ("gate", "active") else width_of(shortened(port.name, LONGEST_PORT), PORT) + 12.0


def _in_order(level: _Level, side: Side) -> list[Shape]:
    """Give the ports on one side of a subgraph as the layout has ordered them, from the top."""
    found = [port for port in level.ports if port not in level.outer and _side_on_box(port) == side]
    return sorted(found, key=lambda port: level.plan.blocks[level.part_of[port.id]][1])


def _pill(of: Shape) -> _Part:
    """Make a block of a port that is drawn by itself."""
    width = round(width_of(shortened(of.name, LONGEST_PORT), DETAIL)) + (34.0 if of.look in ("start", "stop") else 22.0)
    part = _Part(of, Block(width, 22.0, [Dock("right", 11.0), Dock("left", 11.0)]))
    is_end = of.look in ("start", "stop")
    part.texts.append(Text(24.0 if is_end else 11.0, 14.5, shortened(of.name, LONGEST_PORT), DETAIL))
    return part


def _node(of: Shape, pins: dict[Key, Pin]) -> _Part:
    """Make a block of a node: its name, what is said about it, and its ports."""
    sides: dict[Side, list[tuple[Key, Pin]]] = {"left": [], "right": [], "top": [], "bottom": []}
    for key, pin in pins.items():
        sides[_side(key)].append((key, pin))
    for ports in sides.values():
        ports.sort(key=lambda port: (port[1].kind == "parameter", port[1].order, port[1].name))
    name = shortened(of.name, LONGEST_NAME)
    wide = [width_of(name, NAME, bold=True) + (18.0 if of.is_folded else 0.0)]
    wide += [width_of(shortened(detail, LONGEST_SAID), DETAIL) for detail in of.details]
    rows = max((len(sides[side]) for side in ("left", "right") if _any_named(sides[side])), default=0)
    if rows:
        names = [max((_port_width(pin) for _, pin in sides[side]), default=0.0) for side in ("left", "right")]
        wide.append(sum(names) + _PORT_ROOM)
    for side in ("top", "bottom"):
        wide.append(sum(max(_port_width(pin) + 8.0, 14.0) for _, pin in sides[side]))
    width = round(max(wide) + 2 * _PAD)
    y = 7.0 + (12.0 if _any_named(sides["top"]) else 0.0)
    middle = y + 8.0
    texts = [Text(width / 2 - (7.0 if of.is_folded else 0.0), y + 12.0, name, NAME, "middle", bold=True)]
    y += 16.0
    for detail in of.details:
        y += 12.0
        texts.append(Text(width / 2, y - 2.0, shortened(detail, LONGEST_SAID), DETAIL, "middle"))
    first_row = y + 8.0
    y += _ROW * rows + (12.0 if _any_named(sides["bottom"]) else 0.0) + 7.0
    most = max((len(sides[side]) for side in ("left", "right") if not _any_named(sides[side])), default=0)
    height = max(y, 30.0, 12.0 * most + 8.0)
    part = _Part(of, Block(width, height, []))
    part.texts = texts
    for side, ports in sides.items():
        for index, (key, pin) in enumerate(ports):
            dock = Dock(side, room=max(_port_width(pin) + 8.0, 14.0))
            if side in ("left", "right") and _any_named(ports):
                dock.at = first_row + _ROW * index
                x, anchor = (8.0, "start") if side == "left" else (width - 8.0, "end")
                texts.append(Text(x, dock.at + 3.5, _port_name(pin), PORT, anchor))
            elif side in ("left", "right"):
                dock.at = (middle if most == 1 else height / 2) + 12.0 * (index - (len(ports) - 1) / 2)
            elif not pin.is_plain:
                part.named.append((len(part.block.docks), pin.name))
            if pin.kind == "active":
                part.unmarked.add(len(part.block.docks))
            part.docks[key] = len(part.block.docks)
            part.block.docks.append(dock)
    return part


def _side(key: Key) -> Side:
    kind, _, is_tail = key
    if kind == "parameter":
        return "right" if is_tail else "left"
    return _SIDES[kind]


def _any_named(ports: Sequence[tuple[Key, Pin]]) -> bool:
    return any(not pin.is_plain for _, pin in ports)


def _port_name(pin: Pin) -> str:
    return "" if pin.is_plain else shortened(pin.name, LONGEST_PORT)


def _port_width(pin: Pin) -> float:
    return width_of(_port_name(pin), PORT)

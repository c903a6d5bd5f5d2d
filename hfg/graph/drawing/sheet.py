"""The parts of a drawing with their sizes and places: a picture that has been laid out.

Each subgraph is laid out by itself, the innermost first; outside it is a block with docks where its ports are on its
border. Stands on `picture`, `levels` and `parts`.
"""

from __future__ import annotations

import msgspec

from hfg.graph.drawing.layout import Dock, Label, Line
from hfg.graph.drawing.layout.blocks import Point
from hfg.graph.drawing.levels import Level, key_on_box, lets_in
from hfg.graph.drawing.parts import LONGEST_PORT, LONGEST_SAID, PORT, Card, Key, Part, Text, node, pill
from hfg.graph.drawing.picture import Arrow, Box, Picture, Pin, Shape
from hfg.graph.drawing.text import shortened, width_of

__all__ = ["Lead", "Sheet", "sheet"]


class Lead(msgspec.Struct):
    """A line, or several that come out of one port together.

    Attributes:
      arrows: what each stands for.
      ways: the corners of each.
      dots: where one parts from the others.
      texts: what is said about them.
    """

    arrows: list[Arrow] = []
    ways: list[list[Point]] = []
    dots: list[Point] = []
    texts: list[Text] = []

    def add(self, arrow: Arrow, way: list[Point], dots: list[Point], texts: list[Text]) -> None:
        """Let one more line run with them."""
        self.arrows.append(arrow)
        self.ways.append(way)
        self.dots += dots
        self.texts += texts


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


class _Sheet:
    """One walk from a picture to a sheet."""

    def __init__(self, picture: Picture) -> None:
        self.picture = picture
        self.root = Level(None, None)
        self.levels = [self.root]
        self.home: dict[str, Level] = {}  # by shape or box: where it lies
        self.inside: dict[str, Level] = {}  # by box, and by port on a box: what it looks into
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
                inside = Level(item, level)
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
            level = self._side(tail.id, inwards=True)  # the end of the run is drawn where it is meant
        elif isinstance(tail, Shape) and tail.look == "start":
            level = self._side(head.id, inwards=False)
        else:
            level = next(level for level in tails if level in heads)
        level.arrows.append((arrow, tails.get(level, tail.id), heads.get(level, head.id)))

    def _side(self, shape: str, *, inwards: bool) -> Level:
        """Give the level of a shape; of a port on a subgraph its inside, if it is one that lets in, or out."""
        level = self.inside.get(shape, self.home[shape])
        of = self.by_id[shape]
        assert isinstance(of, Shape)
        if shape in self.inside and level.around is not None and lets_in(of) != inwards:
            return level.around
        return level

    def _seen_from(self, shape: str) -> dict[Level, str]:
        """Give the levels that see a shape, the innermost first, and as what: itself, or a box around it."""
        found: dict[Level, str] = {}
        level: Level | None = self.inside.get(shape, self.home[shape])
        while level is not None:
            found[level] = shape
            shape = shape if level.box is None else level.box.id
            level = level.around
        return found

    # --- one level

    def _arrange(self, level: Level) -> None:
        pins, used = level.pins(), level.used()
        for of in level.shapes:
            if of.id in used or not isinstance(of, Shape) or of.look not in ("start", "stop"):
                level.add(self._part(of, pins.get(of.id, {})))
        for end in sorted(end for end in used if self._is_from_afar(level, end)):
            level.add(self._part(self.by_id[end], {}))
        level.add_ports()
        level.arrange([self._line(level, *one) for one in level.arrows])

    def _is_from_afar(self, level: Level, shape: str) -> bool:
        """Whether it is `start`, `stop` or `abort`, of which each level that uses it has its own."""
        of = self.by_id[shape]
        return isinstance(of, Shape) and of.look in ("start", "stop") and self.home[shape] is not level

    def _part(self, of: Shape | Box, pins: dict[Key, Pin]) -> Part:
        if isinstance(of, Box):
            return self.inside[of.id].as_part(of)
        return node(of, pins) if of.look == "node" else pill(of)

    def _line(self, level: Level, arrow: Arrow, tail: str, head: str) -> Line:
        ends = *self._dock(level, tail, arrow, is_tail=True), *self._dock(level, head, arrow, is_tail=False)
        room = width_of(shortened(arrow.said, LONGEST_SAID), PORT) + 8
        label = Label(room, PORT + 4) if arrow.said else None
        is_data = not (arrow.is_signal or arrow.is_gate)
        return Line(*ends, kind=_kind(arrow), is_data=is_data, is_back=arrow.is_back, label=label)

    def _dock(self, level: Level, shape: str, arrow: Arrow, *, is_tail: bool) -> tuple[int, int]:
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

    def _dock_of_box(self, part: Part, end: str, *, is_tail: bool) -> int:
        """Give the dock of a port of a subgraph, or of a gate that leads to what lies in it or comes from there."""
        of = self.by_id[end]
        assert isinstance(of, Shape)
        key = key_on_box(of)
        if self.inside.get(end) is not self.inside[part.of.id]:
            key = ("active" if is_tail else "gate", end, is_tail)
        if key not in part.docks:
            dock = Dock("bottom" if is_tail else "top", round(part.block.width / 2), is_fixed=True)
            return part.add_dock(key, dock, is_port=not is_tail)
        return part.docks[key]

    # --- what comes of it

    def _draw(self, level: Level) -> None:
        left, top = level.at
        for part, (x, y) in zip(level.parts, level.plan.blocks, strict=True):
            if isinstance(part.of, Box):
                self.inside[part.of.id].place(left + x, top + y)
            if part.block.rank:
                self._draw_name_of_port(part, left + x, top + y)
            else:
                self.cards.append(part.card(left + x, top + y))
        wires: dict[tuple[str, str, str], Lead] = {}
        for number, (arrow, tail, head) in enumerate(level.arrows):
            way = [(left + x, top + y) for x, y in level.plan.lines[number]]
            way = [*self._from_border(level, tail, way), *way, *reversed(self._from_border(level, head, way[::-1]))]
            dots = [(left + x, top + y) for x, y in level.plan.dots[number]]
            label = level.plan.labels[number]
            texts = []
            if label is not None:
                said = shortened(arrow.said, LONGEST_SAID)
                texts = [Text(left + label[0] + 4, top + label[1] - 4, said, PORT)]
            port = arrow.out_of.name if arrow.out_of is not None else ""
            wires.setdefault((arrow.tail, port, _kind(arrow)), Lead()).add(arrow, way, dots, texts)
        self.leads += wires.values()

    def _draw_name_of_port(self, part: Part, x: float, y: float) -> None:
        """Write the name of a port of the subgraph beside its line inside."""
        name = shortened(part.of.name, LONGEST_PORT)
        if part.block.rank == "first":
            self.texts.append(Text(x, y + 11.5, name, PORT))
        else:
            self.texts.append(Text(x + part.block.width, y + 11.5, name, PORT, "end"))

    def _from_border(self, level: Level, end: str, way: list[Point]) -> list[Point]:
        of = self.by_id[end]
        if self.inside.get(end) is not level or not isinstance(of, Shape):
            return []
        return level.from_border(of, way)


def _kind(arrow: Arrow) -> str:
    if arrow.is_gate:
        return "gate"
    return ("signal" if arrow.is_signal else "data") + (" active" if arrow.is_active else "")

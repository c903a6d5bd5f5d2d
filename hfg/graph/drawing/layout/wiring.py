"""From a picture to the things to place at each level: which lines there are, and which edges need none.

A port of the level itself, `start` and `stop` are tags wherever they are used; gates and time limits are marks on their
node; edges between the same two nodes are one line. So only edges from node to node remain as lines.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from hfg.graph.drawing.layout.overview import to_overview
from hfg.graph.drawing.layout.parts import SIDES, Link, Spot, Thing, Work
from hfg.graph.drawing.model import Badge
from hfg.graph.drawing.seen import Arrow, Kind, Picture, Pin, Shape, View

_INWARDS: Final = ("input", "slot", "parameter")
_LIMIT: Final = "active for"
HUB: Final = 6  # from more ports that carry data than that, all of them are named


class Level:
    """The graph, or the inside of one open subgraph."""

    def __init__(self, box: Shape | None, around: Level | None) -> None:
        self.box = box
        self.around = around
        self.shapes: list[Shape] = []
        self.arrows: list[Arrow] = []
        self.gates: list[Arrow] = []


class Levels:
    """Finds the level of every shape and arrow."""

    def __init__(self, picture: Picture) -> None:
        self.all = [Level(None, None)]
        self.by_id: dict[str, Shape] = {}
        self.home: dict[str, Level] = {}  # of nodes and boxes
        self.inside: dict[str, Level] = {}  # of ports of open subgraphs: the level inside
        stack = [self.all[0]]
        for depth, shape in picture.items:
            del stack[depth + 1 :]
            self.by_id[shape.id] = shape
            if shape.look in ("node", "box"):
                self.home[shape.id] = stack[-1]
                stack[-1].shapes.append(shape)
            elif shape.look == "port" and stack[-1].box is not None:
                self.inside[shape.id] = stack[-1]
            if shape.look == "box":
                stack.append(Level(shape, stack[-1]))
                self.all.append(stack[-1])
        for arrow in picture.arrows:
            if not arrow.is_gate:
                self._of(arrow).arrows.append(arrow)
            elif arrow.head in self.home:
                self.home[arrow.head].gates.append(arrow)
            else:  # a subgraph that is open: its bar is a port of it
                box = self.inside[arrow.head].box
                assert box is not None
                self.home[box.id].gates.append(arrow)

    def _of(self, arrow: Arrow) -> Level:
        tails, heads = self._seen(arrow.tail), self._seen(arrow.head)
        common = [level for level in tails if not heads or level in heads] if tails else heads
        if len(common) == 2:  # it may be on either side of a border: a port lets in, or out
            is_tail = arrow.tail in self.inside
            relay = self.by_id[arrow.tail if is_tail else arrow.head]
            return common[0] if (relay.type_name in _INWARDS) == is_tail else common[1]
        return common[0] if common else self.all[0]

    def _seen(self, end: str) -> list[Level]:
        """Return the levels that may see an end, the inner one first; none: all of them do."""
        if end in self.home:
            return [self.home[end]]
        level = self.inside.get(end)
        if level is None:
            return []
        assert level.around is not None
        return [level, level.around]

    def seen_as(self, end: str, level: Level) -> str:
        """Say as which node or box of a level an end is seen there; "" if it is a port of the level itself."""
        if end in self.home:
            return end
        inside = self.inside.get(end)
        return "" if inside is None or inside is level or inside.box is None else inside.box.id


def wired(level: Level, known: Levels, view: View, kind: Kind) -> Work:
    """Say what lies at a level and what leads from where to where."""
    return _Wiring(level, known, view, kind).work


class _Wiring:
    def __init__(self, level: Level, known: Levels, view: View, kind: Kind) -> None:
        self.level, self.known, self.kind = level, known, kind
        self.by_id: dict[str, Thing] = {}
        self.work = Work([], [])
        for shape in level.shapes:
            self._thing(shape)
        for thing in self.work.things:
            for pin in thing.shape.pins:
                self._spot(thing, pin, is_tail=pin.kind in ("output", "event"))
        for arrow in level.arrows:
            self._link(arrow)
        for thing in self.work.things:
            self._limit(thing)
        if kind == "mission":
            self.work.links = list(_bundled(self.work.links))
        elif kind == "activity":
            to_overview(self.work)
        else:
            for link in self.work.links:
                link.said = link.arrows[0].said
        _number_nets(self.work.links)
        for gate in level.gates if kind != "activity" else ():
            self._gate(gate)
        for thing in self.work.things:
            if kind != "activity":
                _name(thing, view, kind)

    def _thing(self, shape: Shape) -> Thing:
        thing = self.by_id[shape.id] = Thing(len(self.work.things), shape)
        self.work.things.append(thing)
        return thing

    def _spot(self, thing: Thing, pin: Pin, *, is_tail: bool) -> Spot:
        key = (pin.kind, pin.name, is_tail)
        if key not in thing.spots:
            side = SIDES.get(pin.kind, "right" if is_tail else "left")
            is_limit = pin.name == "timeout" and pin.kind == "event" and thing.shape.limit
            kind = "timeout" if is_limit else pin.kind
            thing.spots[key] = Spot(kind, pin.name, side, pin.order, pin.is_plain)
        return thing.spots[key]

    def _link(self, arrow: Arrow) -> None:
        tail, tail_pin = self._end(arrow.tail, arrow.out_of)
        head, head_pin = self._end(arrow.head, arrow.into)
        if tail is None and head is None:  # straight through the subgraph: its one end is put down as a thing
            tail = self._thing(self.known.by_id[arrow.tail])
            tail_pin = Pin("output", "out", is_plain=True)
        tails = [] if tail is None or tail_pin is None else [self._spot(tail, tail_pin, is_tail=True)]
        heads = [] if head is None or head_pin is None else [self._spot(head, head_pin, is_tail=False)]
        for spots, other in ((tails, arrow.head), (heads, arrow.tail)):
            for spot in spots:
                if tail is None or head is None:
                    spot.tagged.append(self.known.by_id[other].name)
                    spot.to_tag = 14.0 if arrow.is_active else spot.to_tag
                else:
                    spot.is_linked = True
        self.work.links.append(Link([arrow], tail, head, tails, heads))
        for thing in (tail, head):
            if thing is not None and arrow.is_active:
                thing.shape.be_state()

    def _end(self, end: str, pin: Pin | None) -> tuple[Thing | None, Pin | None]:
        seen = self.known.seen_as(end, self.level)
        if not seen:
            return None, None
        port = self.known.by_id[end]
        return self.by_id[seen], pin if seen == end else Pin(port.type_name, port.name)

    def _gate(self, gate: Arrow) -> None:
        box = self.known.inside.get(gate.head)
        thing = self.by_id[gate.head if box is None or box.box is None else box.box.id]
        by, target = gate.ends
        name = "" if by == target else by.removeprefix(thing.shape.path.rpartition("/")[0] + "/")
        thing.badges.append(Badge("gate", ", ".join(part for part in (name, gate.said) if part), by))

    def _limit(self, thing: Thing) -> None:
        """A limit stands at its event if an edge leaves that, else by itself."""
        limit = thing.shape.limit
        if limit and not any(spot.kind == "timeout" for spot in thing.spots.values()):
            thing.badges.append(Badge("timeout", limit))
        thing.shape.details = [one for one in thing.shape.details if not one.startswith(_LIMIT)]


def _bundled(links: Iterable[Link]) -> Iterator[Link]:
    """Join edges of one kind that lead from one side of a thing to one side of another."""
    found: dict[object, Link] = {}
    for link in links:
        key: object = id(link)
        if link.tail is not None and link.head is not None and not link.is_active:
            sides = link.tail_spots[0].side, link.head_spots[0].side
            key = link.tail.number, link.head.number, sides, link.is_signal
        if key in found:
            found[key].arrows += link.arrows
            found[key].tail_spots += link.tail_spots
            found[key].head_spots += link.head_spots
        else:
            found[key] = link
    yield from found.values()


def _number_nets(links: Sequence[Link]) -> None:
    """Say which lines may share their way, and which ports belong together.

    Lines to one port come together: activity always, all else unless the line is one of several that leave a port.
    """
    leaving: Counter[object] = Counter(map(_tail, links))
    reaching: Counter[object] = Counter(map(_head, links))
    nets: dict[object, int] = {}
    for link in links:
        joins = reaching[_head(link)] > 1 and (link.is_active or leaving[_tail(link)] == 1)
        key = (_head(link) if joins else _tail(link)), link.is_active
        link.net = nets.setdefault(key, len(nets))
        if len(link.tail_spots) > 1:
            for number, spots in enumerate((link.tail_spots, link.head_spots)):
                for spot in spots if len(set(map(id, spots))) > 1 else ():
                    spot.comb = link.net if number == 0 else link.net + 10_000


def _tail(link: Link) -> object:
    """Return what stands for where a line begins: its port; of a bundle the side of its thing."""
    if link.tail is None:
        return id(link)
    is_comb = len(set(map(id, link.tail_spots))) > 1
    return (link.tail.number, link.tail_spots[0].side) if is_comb else id(link.tail_spots[0])


def _head(link: Link) -> object:
    if link.head is None or len(link.head_spots) > 1:
        return id(link)
    return id(link.head_spots[0])


def _name(thing: Thing, view: View, kind: Kind) -> None:
    """Write names next to ports where they are needed."""
    is_box = thing.shape.look == "box"
    spots = list(thing.spots.values())
    is_hub = sum(one.side in ("left", "right") for one in spots) > HUB and not thing.shape.is_state
    for spot in spots:
        count = sum(other.side == spot.side for other in spots)
        if spot.kind == "timeout":
            spot.says = thing.shape.limit
        elif spot.side in ("top", "bottom"):
            if count > 1 or is_box or (kind == "all" and not spot.is_plain):
                spot.says = spot.name
        elif (
            spot.kind == "parameter"
            or (view.all_ports and not view.measured)
            or is_box
            or is_hub
            or (kind == "all" and not spot.is_plain)
        ):
            spot.says = spot.name

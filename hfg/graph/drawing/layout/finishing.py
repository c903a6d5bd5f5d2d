"""From a level that is placed to plain data: tags, combs, dots, and texts where there is room for them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, Final, Literal, TypeAlias

from hfg.graph.drawing.layout.blocks import LONGEST_SAID, PORT, TAG_HEIGHT, tag_text, tag_width
from hfg.graph.drawing.layout.parts import Link, Spot, Thing, Work
from hfg.graph.drawing.model import EdgeEnds, Line, NodeBox, Point, PortSpot, Tag
from hfg.graph.drawing.seen import Arrow
from hfg.graph.drawing.text import shortened, width_of

_PILL: Final = (18.0, 16.0)
_CLEAR: Final = 2.0

Box: TypeAlias = tuple[float, float, float, float]
"""Left, top, right and bottom."""


def node_of(thing: Thing, *, has_rows: bool, has_ports: bool) -> NodeBox:
    """Return a thing as it is drawn."""
    shape = thing.shape
    spots = thing.spots.values() if has_ports else ()
    is_box = shape.look == "box"
    return NodeBox(
        id=shape.path or shape.id,
        name=shape.name,
        kind="subgraph" if is_box or shape.inner else "node" if shape.look == "node" else "wire",
        type_name=shape.type_name,
        group=shape.group,
        **{name: getattr(thing, name) for name in ("x", "y", "width", "height", "lane")},
        row=thing.row if has_rows and shape.is_state else None,
        **{name: getattr(shape, name) for name in ("is_state", "is_active", "is_enabled", "inner")},
        is_open=is_box,
        details=tuple(shape.details),
        badges=tuple(thing.badges),
        ports=tuple(PortSpot(one.kind, one.name, *thing.where(one), one.says) for one in spots),
    )


def lines_of(work: Work) -> Iterator[Line]:
    """Yield all lines of a level as they are drawn."""
    tagged = list(_tagged(work.things, work.links))
    inner = [link for link in work.links if link.tail is not None and link.head is not None]
    for link in inner:
        _comb(link)
    dots = _dots(inner)
    taken = _Taken(work.things, [tag for _, _, tag in tagged], inner)
    for link in inner:
        yield _line(
            link.arrows,
            link.points,
            is_back=link.is_back,
            combs=tuple(map(tuple, link.combs)),
            dots=tuple(dots.get(id(link), ())),
            count_at=taken.pill(link, inner) if len(link.tail_spots) > 1 else None,
            says=link.said or ", ".join(dict.fromkeys(arrow.said for arrow in link.arrows if arrow.said)),
            says_at=taken.text(link, link.said) if link.said else None,
            net=link.net,
        )
    for arrows, points, tag in tagged:
        yield _line(arrows, points, tag=tag)


def _line(arrows: Sequence[Arrow], points: Sequence[Point], **more: Any) -> Line:  # noqa: ANN401 - fields of a line
    edges = tuple(EdgeEnds(*arrow.ends, " -> ".join(arrow.ends)) for arrow in arrows)
    kind: Literal["data", "signal"] = "signal" if arrows[0].is_signal else "data"
    return Line(edges, kind, arrows[0].is_active, points=tuple(points), **more)


# --- tags


def _tagged(things: Sequence[Thing], links: Sequence[Link]) -> Iterator[tuple[list[Arrow], list[Point], Tag]]:
    """Yield the lines between ports and tags; where ports have no names those of one side share a tag."""
    groups: dict[tuple[object, ...], list[Link]] = {}
    for link in links:
        thing, spot, is_in = _tag_end(link)
        if thing is not None and spot is not None:
            side = [one for one in thing.spots.values() if one.side == spot.side]
            key: tuple[object, ...] = (id(spot), is_in)
            if spot.side in ("left", "right") and not any(one.says for one in side):  # they share one
                look = () if spot.is_linked else (link.is_signal, link.is_active, link.is_jump)
                key = (thing.number, spot.side, is_in, *look)
            groups.setdefault(key, []).append(link)
    for members in groups.values():
        members.sort(key=lambda one: not one.is_active)
        thing, spot, is_in = _tag_end(members[0])
        assert thing is not None
        assert spot is not None
        spots = list({id(one): one for link in members if (one := _tag_end(link)[1]) is not None}.values())
        names = list(dict.fromkeys(name for one in spots for name in one.tagged))
        if spot.is_linked:  # it stands below the last of them
            at = max((thing.where(one) for one in spots), key=lambda place: place[1])
        else:
            at = thing.where(spot)[0], sum(thing.where(one)[1] for one in spots) / len(spots)
        paths = tuple(dict.fromkeys(arrow.ends[not is_in] for link in members for arrow in link.arrows))
        points, tag = _tag(spot, at, names, paths, _kind_of_tag(members[0], is_in=is_in))
        for number, one in enumerate(spots):
            own = [arrow for link in members if _tag_end(link)[1] is one for arrow in link.arrows]
            way = points if len(spots) == 1 else _to_bar(thing.where(one), points)
            yield (
                own,
                (way[::-1] if is_in else way),
                (tag if number == 0 else Tag("", tag.ports, tag.kind, tag.x, tag.y, 0.0, 0.0)),
            )


def _tag_end(link: Link) -> tuple[Thing | None, Spot | None, bool]:
    """Return the port of a thing that a tag stands at, and whether the line leads from the tag to it."""
    if link.tail is None and link.head is not None:
        return link.head, link.head_spots[0], True
    if link.head is None and link.tail is not None:
        return link.tail, link.tail_spots[0], False
    return None, None, False


def _kind_of_tag(link: Link, *, is_in: bool) -> str:
    if link.is_jump:
        return "from" if is_in else "to"
    if is_in:
        return "slot" if link.is_signal else "input"
    return "event" if link.is_signal else "output"


def _tag(spot: Spot, at: Point, names: Sequence[str], paths: tuple[str, ...], kind: str) -> tuple[list[Point], Tag]:
    """Put a tag in front of a port; next to its line if one leads on from there."""
    x, y = at
    text = tag_text(names, is_in=kind in ("input", "slot", "from"))
    width, half = tag_width(text), TAG_HEIGHT / 2
    sign = -1 if spot.side in ("left", "top") else 1
    if spot.side in ("left", "right"):
        if spot.is_linked:
            points = [(x, y), (x + 4 * sign, y), (x + 4 * sign, y + 14), (x + spot.to_tag * sign, y + 14)]
            y += 14.0
        else:
            points = [(x, y), (x + spot.to_tag * sign, y)]
        left = x + spot.to_tag if sign > 0 else x - spot.to_tag - width
        return points, Tag(text, paths, kind, left, y - half, width, TAG_HEIGHT)
    if spot.is_linked:
        points = [(x, y), (x, y + 12 * sign), (x + 10, y + 12 * sign)]
        return points, Tag(text, paths, kind, x + 10, y + 12 * sign - half, width, TAG_HEIGHT)
    top = y + spot.to_tag if sign > 0 else y - spot.to_tag - TAG_HEIGHT
    return [(x, y), (x, y + spot.to_tag * sign)], Tag(text, paths, kind, round(x - width / 2), top, width, TAG_HEIGHT)


def _to_bar(port: Point, points: Sequence[Point]) -> list[Point]:
    """Lead from one of several ports to the tag that they share."""
    (x, _), (end, y) = points[0], points[-1]
    bar = x + (end - x) * 0.6
    return [port, (bar, port[1]), (bar, y), (end, y)] if port[1] != y else [port, (end, y)]


# --- lines


def _comb(link: Link) -> None:
    """Lead from the ends of a bundle to its ports."""
    link.combs = []
    if len(link.tail_spots) < 2:
        return
    for thing, spots, end in (
        (link.tail, link.tail_spots, link.points[0]),
        (link.head, link.head_spots, link.points[-1]),
    ):
        assert thing is not None
        used = {id(one): one for one in spots}.values()
        for spot in used if len(used) > 1 else ():
            x, y = thing.where(spot)
            bar = (end[0], y) if spot.side in ("left", "right") else (x, end[1])
            link.combs.append([end, bar, (x, y)] if bar != end else [end, (x, y)])


def _dots(links: Sequence[Link]) -> dict[int, list[Point]]:
    """Say where lines of one net part or join: three ways lead on from there. Each dot belongs to one line."""
    nets: dict[int, list[Link]] = {}
    for link in links:
        nets.setdefault(link.net, []).append(link)
    found: dict[int, list[Point]] = {}
    for members in nets.values():
        if len(members) < 2:
            continue
        strokes = [pair for link in members for pair in pairwise(link.points)]
        ends = {link.points[end] for link in members for end in (0, -1)}
        seen: set[Point] = set()
        for link in members:
            for point in link.points[1:-1]:
                if point not in seen and point not in ends and len(_directions(point, strokes)) > 2:
                    found.setdefault(id(link), []).append(point)
                seen.add(point)
    return found


def _directions(point: Point, strokes: Iterable[tuple[Point, Point]]) -> set[tuple[int, int]]:
    """Say in which directions strokes lead away from a point."""
    x, y = point
    found = set()
    for (x1, y1), (x2, y2) in strokes:
        if min(x1, x2) <= x <= max(x1, x2) and min(y1, y2) <= y <= max(y1, y2):
            for end_x, end_y in ((x1, y1), (x2, y2)):
                if (end_x, end_y) != point:
                    found.add(((end_x > x) - (end_x < x), (end_y > y) - (end_y < y)))
    return found


# --- texts


class _Taken:
    """Where something is already, so that no text is written over it."""

    def __init__(self, things: Iterable[Thing], tags: Iterable[Tag], links: Sequence[Link]) -> None:
        self.boxes: list[Box] = [(one.x, one.y, one.x + one.width, one.y + one.height) for one in things]
        self.boxes += [(tag.x, tag.y, tag.x + tag.width, tag.y + tag.height) for tag in tags]
        self.links = links
        self.said: set[tuple[int, str]] = set()

    def _is_free(self, box: Box, link: Link) -> bool:
        left, top, right, bottom = box
        for x1, y1, x2, y2 in self.boxes:
            if left < x2 + _CLEAR and x1 < right + _CLEAR and top < y2 + _CLEAR and y1 < bottom + _CLEAR:
                return False
        for other in self.links:
            if other.net != link.net or other is not link:
                for (x1, y1), (x2, y2) in pairwise(other.points):
                    if min(x1, x2) < right and left < max(x1, x2) and min(y1, y2) < bottom and top < max(y1, y2) + 0.1:
                        return False
                    if x1 == x2 and left < x1 < right and min(y1, y2) < bottom and top < max(y1, y2):
                        return False
        return True

    def pill(self, link: Link, links: Sequence[Link]) -> Point | None:
        """Find a place for the number of a bundle, best where the line runs by itself."""
        width, height = _PILL
        shared = {
            pair for other in links if other.net == link.net and other is not link for pair in pairwise(other.points)
        }
        strokes = sorted(pairwise(link.points), key=lambda pair: (pair in shared, -_length(pair)))
        for (x1, y1), (x2, y2) in strokes:
            for part in (0.5, 0.35, 0.65, 0.2, 0.8):
                x, y = x1 + (x2 - x1) * part, y1 + (y2 - y1) * part
                box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
                if self._is_free(box, link):
                    self.boxes.append(box)
                    return x, y
        return None

    def text(self, link: Link, says: str) -> Point | None:
        """Find a place for a text next to its line, unless another line from the same node says it already."""
        if (id(link.tail), says) in self.said:
            return None
        found = self._beside(link, width_of(shortened(says, LONGEST_SAID), PORT))
        if found is not None and link.tail is not None:
            self.said.add((id(link.tail), says))
        return found

    def _beside(self, link: Link, width: float) -> Point | None:
        """Find a place for a text above or next to a part of a line."""
        if link.tail is not None and link.tail_spots[0].outside:  # there is room for it below its port
            x, y = link.points[0]
            if (x + 6, y + 4, x + 6 + width, y + 15) in self.boxes:
                return None  # another line from there says it
            self.boxes.append((x + 6, y + 4, x + 6 + width, y + 15))
            return x + 6, y + 14
        for (x1, y1), (x2, y2) in sorted(
            pairwise(link.points), key=lambda pair: (pair[0][0] == pair[1][0], -_length(pair))
        ):
            left, top = min(x1, x2), min(y1, y2)
            if y1 == y2:
                spare = abs(x2 - x1) - width
                places = [(left + max(spare, 0) * part, y1 + off) for off in (-4.0, 13.0) for part in (0.5, 0.1, 0.9)]
            else:
                places = [
                    (x1 + off, top + abs(y2 - y1) * part + 4)
                    for off in (6.0, -6.0 - width)
                    for part in (0.5, 0.25, 0.75)
                ]
            for x, y in places:
                box = (x, y - 9.0, x + width, y + 2.0)
                if self._is_free(box, link):
                    self.boxes.append(box)
                    return x, y
        return None


def _length(pair: tuple[Point, Point]) -> float:
    return abs(pair[0][0] - pair[1][0]) + abs(pair[0][1] - pair[1][1])

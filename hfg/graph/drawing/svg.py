"""Draws a layout as SVG: one file that needs nothing besides itself, for light and dark screens.

It is the notation of the paper: inputs left, outputs right, slots on top, events at the bottom; what is synchronous is
dark and square, what is asynchronous light and round; active edges are double. Orange is activity and nothing else.
Colours are only in the style sheet. Depends on `layout` and `tokens`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final

from hfg.graph.drawing.layout import lay_out
from hfg.graph.drawing.layout.blocks import (
    BADGE,
    DETAIL,
    LONGEST_NAME,
    LONGEST_PORT,
    LONGEST_SAID,
    NAME,
    PORT,
    TAG,
    badge_width,
)
from hfg.graph.drawing.model import Badge, Layout, Line, NodeBox, Point, PortSpot, Tag
from hfg.graph.drawing.seen import EVERYTHING, View
from hfg.graph.drawing.text import FONTS, escaped, is_measured, shortened, width_of
from hfg.graph.drawing.tokens import STYLE, stripe
from hfg.graph.structure.level import HasLevel

_MARGIN: Final = 20.0
_ROUND: Final = 6.0  # of corners
_PORT_SIZE: Final = 4.5
_HEAD: Final = 7.0  # length of an arrow's head
_CLEAR: Final = 16.0  # without a halo, from both ends of a line
_LEGEND_ROW: Final = 20.0


def svg(graph: HasLevel, view: View = EVERYTHING) -> str:
    """Draw a graph as the text of an SVG file."""
    return "".join(_document(lay_out(graph, view)))


def _document(laid: Layout) -> Iterator[str]:
    title = shortened(laid.title, 80)
    entries = list(_legend(laid))
    left, above, right, below = _outline(laid)
    wide = max(right - left, 220.0, width_of(title, NAME, bold=True), max((room for room, _ in entries), default=0.0))
    rows = _rows(entries, wide)
    top = _MARGIN + 24.0
    height = top + below - above + (16.0 + _LEGEND_ROW * len(rows) if rows else 0.0) + _MARGIN
    width = wide + 2 * _MARGIN
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="hfg" width="{_n(width)}" height="{_n(height)}" '
        f'viewBox="0 0 {_n(width)} {_n(height)}" role="img" aria-label="{escaped(laid.title)}" '
        f'font-family="{escaped(FONTS)}">\n<style>\n{STYLE}</style>\n'
        f'<rect class="hfg-paper" width="100%" height="100%"/>\n'
    )
    yield _text(_MARGIN, _MARGIN + 8.0, title, NAME, bold=True)
    yield f'<g transform="translate({_n(_MARGIN - left)} {_n(top - above)})">\n'
    yield from (part for node in laid.nodes if node.is_open for part in _node(node, laid))
    yield from (part for net in _nets(laid.lines) for part in _net(net, laid.view))
    yield from (part for node in laid.nodes if not node.is_open for part in _node(node, laid))
    yield from (_port(port) for node in laid.nodes if node.is_open for port in node.ports)
    yield from (part for line in laid.lines for part in _on_line(line))
    yield "</g>\n"
    y = top + below - above + 16.0 + _LEGEND_ROW / 2
    for row in rows:
        x = _MARGIN
        for room, drawn in row:
            yield f'<g transform="translate({_n(x)} {_n(y)})">{drawn}</g>\n'
            x += room
        y += _LEGEND_ROW
    yield "</svg>\n"


def _outline(laid: Layout) -> tuple[float, float, float, float]:
    """Return what all that is drawn takes: left, top, right and bottom."""
    points = [point for line in laid.lines for point in line.points]
    tags = [line.tag for line in laid.lines if line.tag is not None and line.tag.text]
    boxes: list[NodeBox | Tag] = [*laid.nodes, *tags]
    for box in boxes:
        points += [(box.x, box.y), (box.x + box.width, box.y + box.height)]
    for line in laid.lines:
        if line.says_at is not None:
            x, y = line.says_at
            points += [(x, y - PORT), (x + width_of(shortened(line.says, LONGEST_SAID), PORT), y)]
    xs, ys = [x for x, _ in points] or [0.0], [y for _, y in points] or [0.0]
    return min(xs) - 4.0, min(ys) - 4.0, max(xs) + 4.0, max(ys) + 4.0


def _n(number: float) -> str:
    return f"{number:.1f}".removesuffix(".0")


# --- nodes, subgraphs and ports


def _node(node: NodeBox, laid: Layout) -> Iterator[str]:
    x, y, width, height = node.x, node.y, node.width, node.height
    look = {"wire": "port", "subgraph": "subgraph", "node": "node"}[node.kind]
    yield f'<g class="hfg-{look}" data-path="{escaped(node.id)}"><title>{escaped(_told(node))}</title>'
    classes = "hfg-box" if node.is_open else "hfg-body"
    classes += (" hfg-on" if node.is_active else "") + ("" if node.is_enabled else " hfg-off")
    place = f'x="{_n(x)}" y="{_n(y)}" width="{_n(width)}" height="{_n(height)}"'
    if node.inner:  # there is more inside: one on top of another
        yield f'<path class="hfg-behind" d="M{_n(x + 6)} {_n(y + height + 3)}H{_n(x + width + 3)}V{_n(y + 6)}"/>'
    yield f'<rect class="{classes}" {place} rx="{8 if node.is_open else 6}"/>'
    if node.group != "loop":
        yield stripe(laid.groups, node.group, x, y, width, height)
    named_slots = any(port.kind == "slot" and port.says for port in node.ports)
    base = y + (18.0 if named_slots else 8.0) + 14.0
    right = x + width - (8.0 if node.inner or node.badges else 0.0)
    if node.inner:
        text = str(node.inner)
        right -= 24.0 + width_of(text, BADGE)
        yield _badge(right, base - 12.0, _ENTER, text)
        right -= 6.0
    for badge in node.badges:
        right -= badge_width(badge.says)
        yield _badge(right, base - 12.0, _GATE if badge.kind == "gate" else _CLOCK, badge.says)
        right -= 6.0
    is_left = laid.view == "mission" or node.is_open
    at, anchor = (x + 12, "start") if is_left else ((x + right) / 2, "middle")
    yield _text(at, base, shortened(node.name, LONGEST_NAME), NAME, anchor, bold=True)
    if node.details:
        yield _text(at, base + 16, shortened("  ".join(node.details), LONGEST_NAME), DETAIL, anchor, soft=True)
    if not node.is_open:  # those of an open one lie over the lines inside
        yield from map(_port, node.ports)
    yield from (_name_of(port) for port in node.ports if port.says)
    yield "</g>\n"


def _told(node: NodeBox) -> str:
    """Return the tooltip: the whole name, and whatever the drawing shows by a sign or a colour."""
    lines = [node.id if node.kind != "wire" else node.name, node.type_name, *node.details]
    lines += [_says(badge) for badge in node.badges]
    if node.kind != "wire":
        lines.append(f"group {node.group}")
    return "\n".join([*lines, "active"] if node.is_active else lines)


def _says(badge: Badge) -> str:
    if badge.kind == "timeout":
        return f"active for {badge.says}"
    return f"rests unless {badge.says or 'active'}" + (" is active" if badge.says else "")


_ENTER: Final = "M1 6h7m-3-3 3 3-3 3M5 1h6v10h-6"
_GATE: Final = "M1 11V2h10v9M1 5h10M3.5 5v-3M8.5 5v-3"
_CLOCK: Final = "M6 1.2a4.8 4.8 0 1 0 .01 0zM6 3.4v2.8l2 1.4"


def _badge(x: float, y: float, icon: str, says: str) -> str:
    width = badge_width(says)
    text = _text(x + 17, y + 12, shortened(says, LONGEST_PORT), BADGE, soft=True) if says else ""
    return (
        f'<rect class="hfg-badge" x="{_n(x)}" y="{_n(y)}" width="{_n(width)}" height="16" rx="3"/>'
        f'<path class="hfg-icon" transform="translate({_n(x + 3)} {_n(y + 2)})" d="{icon}"/>{text}'
    )


def _port(port: PortSpot) -> str:
    x, y, size = port.x, port.y, _PORT_SIZE
    told = f"<title>{escaped(f'{port.kind} {port.name}')}</title>"
    match port.kind:
        case "input" | "output":
            rect = f'x="{_n(x - size)}" y="{_n(y - size)}" width="{_n(2 * size)}" height="{_n(2 * size)}"'
            return f'<rect class="hfg-sync" {rect}>{told}</rect>'
        case "parameter":
            size += 1
            corners = f"M{_n(x - size)} {_n(y)}l{_n(size)} {_n(-size)}l{_n(size)} {_n(size)}l{_n(-size)} {_n(size)}z"
            return f'<path class="hfg-sync" d="{corners}">{told}</path>'
        case "timeout":
            hands = f'<path class="hfg-hands" d="M{_n(x)} {_n(y - 4)}v4l3 2"/>'
            return f'<circle class="hfg-async" cx="{_n(x)}" cy="{_n(y)}" r="7">{told}</circle>{hands}'
    return f'<circle class="hfg-async" cx="{_n(x)}" cy="{_n(y)}" r="5">{told}</circle>'


def _name_of(port: PortSpot) -> str:
    says = shortened(port.says, LONGEST_PORT)
    match port.kind:
        case "slot":
            return _text(port.x, port.y + 15, says, PORT, "middle", soft=True)
        case "event":
            return _text(port.x, port.y - 8, says, PORT, "middle", soft=True)
        case "timeout":
            return _text(port.x + 10, port.y - 6, says, PORT, soft=True)
        case "output":
            return _text(port.x - 9, port.y + 4, says, PORT, "end", soft=True)
    return _text(port.x + 9, port.y + 4, says, PORT, soft=True)


# --- lines


def _net(lines: Sequence[Line], view: str) -> Iterator[str]:
    """Draw lines that may run on top of each other; their halo shows that what they cross lies below."""
    active = lines[0].is_active
    told = "\n".join(
        f"{'active edge' if line.is_active else 'edge'} {edge.label}  {line.says}".rstrip()
        for line in lines
        for edge in line.edges
    )
    yield f'<g class="hfg-edge"><title>{escaped(told)}</title>' if told else '<g class="hfg-sign">'
    halo = "".join(_curve(way, way[-1]) for line in lines if len(way := _within(line.points)) > 1)
    if halo:
        yield f'<path class="hfg-halo{" hfg-wide" if active else ""}" d="{halo}"/>'
    classes = f"hfg-line hfg-{lines[0].kind}" + (" hfg-active" if active else "")
    classes += " hfg-back" if view == "mission" and not active else ""
    ends = [
        _head(line.points, _PORT_SIZE + 1 if view != "activity" else 1.5, is_active=active)
        if _has_tip(line, view)
        else ("", line.points[-1])
        for line in lines
    ]
    strokes = dict.fromkeys((False, True), "")
    for line, (_, end) in zip(lines, ends, strict=True):
        strokes[bool(line.combs)] += _curve(line.points, end)
        strokes[False] += "".join(_curve(comb, comb[-1]) for comb in line.combs)
    for is_bundle, d in strokes.items():
        if d:
            yield f'<path class="{classes}{" hfg-bundle" if is_bundle else ""}" d="{d}"/>'
    if active:  # two lines, because there is canvas between them
        yield f'<path class="hfg-gap" d="{strokes[False]}"/>'
    shade = classes.replace("hfg-line", "hfg-tip")
    for x, y in (dot for line in lines for dot in line.dots):
        yield f'<circle class="{shade}" cx="{_n(x)}" cy="{_n(y)}" r="{4 if active else 3}"/>'
    tips = "".join(tip for tip, _ in ends)
    if tips:
        yield f'<path class="{shade}" d="{tips}"/>'
    yield "</g>\n"


def _nets(lines: Iterable[Line]) -> Iterator[list[Line]]:
    """Yield lines that may run on top of each other together, in the order in which they are drawn."""
    found: dict[object, list[Line]] = {}
    for line in lines:
        found.setdefault(id(line) if line.net < 0 else (line.net, line.is_active, line.kind), []).append(line)
    yield from found.values()


def _has_tip(line: Line, view: str) -> bool:
    """Whether a line has a tip: activity, and what comes from above into a slot; at an input it is not needed."""
    if line.combs or (line.tag is not None and line.tag.kind in ("output", "event", "to")):
        return False
    return line.is_active or view == "activity" or line.points[-2][0] == line.points[-1][0]


def _head(way: Sequence[Point], room: float, *, is_active: bool) -> tuple[str, Point]:
    """Draw the head of an arrow in front of its port; give where the line ends under it, too."""
    (x0, y0), (x, y) = way[-2], way[-1]
    dx, dy = (x > x0) - (x < x0), (y > y0) - (y < y0)
    wide = 5.0 if is_active else 3.6
    x, y = x - dx * room, y - dy * room
    back_x, back_y = x - dx * _HEAD, y - dy * _HEAD
    tip = (
        f"M{_n(x)} {_n(y)}L{_n(back_x - dy * wide)} {_n(back_y - dx * wide)}"
        f"L{_n(back_x + dy * wide)} {_n(back_y + dx * wide)}z"
    )
    return tip, (back_x + dx, back_y + dy)


def _curve(way: Sequence[Point], end: Point) -> str:
    """Draw a way with round corners."""
    points = [*way[:-1], end]
    parts = [f"M{_n(points[0][0])} {_n(points[0][1])}"]
    for ((ax, ay), (bx, by)), (_, (cx, cy)) in pairwise(pairwise(points)):
        radius = min(_ROUND, (abs(bx - ax) + abs(by - ay)) / 2, (abs(cx - bx) + abs(cy - by)) / 2)
        from_x, from_y = bx - radius * ((bx > ax) - (bx < ax)), by - radius * ((by > ay) - (by < ay))
        to_x, to_y = bx + radius * ((cx > bx) - (cx < bx)), by + radius * ((cy > by) - (cy < by))
        parts.append(f"L{_n(from_x)} {_n(from_y)}Q{_n(bx)} {_n(by)} {_n(to_x)} {_n(to_y)}")
    parts.append(f"L{_n(points[-1][0])} {_n(points[-1][1])}")
    return "".join(parts)


def _within(way: Sequence[Point]) -> list[Point]:
    """Leave out both ends of a way, where it may meet others that begin or end at the same port."""
    inner = list(way)
    for _ in range(2):
        inner.reverse()
        if len(inner) < 2:
            return []
        (x, y), (x2, y2) = inner[0], inner[1]
        length = abs(x2 - x) + abs(y2 - y)
        if length <= _CLEAR:
            del inner[0]
        else:
            inner[0] = (x + (x2 - x) * _CLEAR / length, y + (y2 - y) * _CLEAR / length)
    return inner


def _on_line(line: Line) -> Iterator[str]:
    """Draw labels on a line or at its end: the number of a bundle, the options, a tag."""
    if line.count_at is not None:
        x, y = line.count_at
        yield f'<rect class="hfg-pill" x="{_n(x - 9)}" y="{_n(y - 8)}" width="18" height="16" rx="8"/>'
        yield _text(x, y + 3.6, str(len(line.edges) or line.says), TAG, "middle", soft=True)
    if line.says_at is not None:
        yield _text(*line.says_at, shortened(line.says, LONGEST_SAID), PORT, soft=True)
    if line.tag is not None and line.tag.text:
        yield _tag(line.tag)


def _tag(tag: Tag) -> str:
    dashed = "" if tag.kind in ("input", "output") else " hfg-dashed"
    place = f'x="{_n(tag.x)}" y="{_n(tag.y)}" width="{_n(tag.width)}" height="{_n(tag.height)}"'
    text = _text(tag.x + tag.width / 2, tag.y + tag.height / 2 + 3.6, tag.text, TAG, "middle", soft=True)
    told = f"<title>{escaped(', '.join(port.removesuffix('.inner') for port in tag.ports))}</title>"
    return f'<g class="hfg-tag">{told}<rect class="hfg-pill{dashed}" {place} rx="7"/>{text}</g>\n'


def _text(
    x: float, y: float, text: str, size: float, anchor: str = "start", *, bold: bool = False, soft: bool = False
) -> str:
    weight = ' font-weight="600"' if bold else ""
    anchored = f' text-anchor="{anchor}"' if anchor != "start" else ""
    fitted = ""
    if not is_measured(text):  # whatever these letters look like, they keep to their place
        fitted = f' textLength="{_n(max(width_of(text, size, bold=bold), 1.0))}" lengthAdjust="spacingAndGlyphs"'
    look = f'font-size="{_n(size)}"{anchored}{weight}{fitted}' + (' class="hfg-soft"' if soft else "")
    return f'<text x="{_n(x)}" y="{_n(y)}" {look}>{escaped(text)}</text>\n'


# --- what the signs mean


def _legend(laid: Layout) -> Iterator[tuple[float, str]]:
    """Yield each entry with the room it takes; only what is drawn is explained."""
    used: set[str] = {port.kind for node in laid.nodes for port in node.ports}
    used |= {"active edge" if line.is_active else line.kind for line in laid.lines}
    used |= {"bundle" for line in laid.lines if line.count_at is not None}
    used |= {badge.kind for node in laid.nodes for badge in node.badges}
    used |= {"active node" for node in laid.nodes if node.is_active} | {"tag" for line in laid.lines if line.tag}
    across = ((0.0, 0.0), (34.0, 0.0))
    icon = '<path class="hfg-icon" transform="translate(2 -6)" d="{}"/>'
    for meant, drawn, room, says in (
        ({"input", "output"}, _port(PortSpot("input", "", 8.0, 0.0)), 16, "synchronous"),
        ({"slot", "event"}, _port(PortSpot("slot", "", 8.0, 0.0)), 16, "asynchronous"),
        ({"parameter"}, _port(PortSpot("parameter", "", 8.0, 0.0)), 16, "parameter"),
        ({"data"}, _sample(Line((), "data", points=across)), 34, "data"),
        ({"signal"}, _sample(Line((), "signal", points=across)), 34, "signals"),
        ({"active edge"}, _sample(Line((), "signal", is_active=True, points=across)), 34, "activity"),
        ({"bundle"}, "".join(_on_line(Line((), "data", count_at=(12.0, 0.0), says="3"))), 24, "so many edges"),
        ({"tag"}, '<rect class="hfg-pill" x="2" y="-7" width="24" height="14" rx="7"/>', 28, "port of this graph"),
        ({"gate"}, icon.format(_GATE), 16, "rests unless active"),
        ({"timeout"}, icon.format(_CLOCK), 16, "time limit"),
        ({"active node"}, '<rect class="hfg-body hfg-on" x="2" y="-6" width="20" height="12" rx="3"/>', 26, "active"),
    ):
        if used & meant:
            yield _entry(drawn, room, says)
    groups = {node.group for node in laid.nodes}
    if not groups <= {"loop"}:
        for group in laid.groups:
            if group in groups:
                body = '<rect class="hfg-body" x="2" y="-7" width="20" height="14" rx="3"/>'
                ground = "" if group == "loop" else stripe(laid.groups, group, 2.0, -7.0, 20.0, 14.0)
                yield _entry(body + ground, 26, "on the loop" if group == "loop" else f"group {group}")


def _entry(drawn: str, room: float, says: str) -> tuple[float, str]:
    says = shortened(says, LONGEST_NAME)
    return room + 6 + width_of(says, DETAIL) + 22, drawn + _text(room + 4, 3.8, says, DETAIL, soft=True)


def _sample(line: Line) -> str:
    return "".join(_net([line], "activity"))


def _rows(entries: Iterable[tuple[float, str]], width: float) -> list[list[tuple[float, str]]]:
    rows: list[list[tuple[float, str]]] = []
    used = 0.0
    for room, drawn in entries:
        if not rows or used + room > width:
            rows.append([])
            used = 0.0
        rows[-1].append((room, drawn))
        used += room
    return rows

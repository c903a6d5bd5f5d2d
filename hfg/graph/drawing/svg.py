"""Writes a graph as SVG, in the notation of the paper: inputs left, outputs right, slots on top, events at the bottom.

Dark squares are ports in step, light circles those that are not. The file needs nothing besides itself: no script, no
font, no network; colours are attributes, which any renderer knows, and a style sheet changes them on dark screens.
Stands on `sheet`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from itertools import pairwise
from typing import Final, NamedTuple

from hfg.graph.drawing.layout.blocks import Point
from hfg.graph.drawing.parts import DETAIL, LONGEST_NAME, Card, Mark, Text
from hfg.graph.drawing.picture import EVERYTHING, Arrow, Box, Picture, Shape, View, picture
from hfg.graph.drawing.sheet import Lead, Sheet, sheet
from hfg.graph.drawing.text import FONTS, escaped, is_measured, shortened, width_of
from hfg.graph.structure.level import HasLevel

__all__ = ["svg"]

_MARGIN: Final = 20.0
_ROUND: Final = 5.0  # of corners
_PORT_SIZE: Final = 4.0
_HEAD: Final = 7.0  # length of an arrow's head
_CLEAR: Final = 22.0  # without a rim of paper, from both ends of a line
_LEGEND_ROW: Final = 20.0

_PAPER: Final = "#ffffff"
_INK: Final = "#1f2933"
_LIGHT_INK: Final = "#5f7186"
_ACTIVE: Final = "#d9480f"
# What runs on the loop is white; the others differ in lightness as well as in hue, and black text is read on each.
_GROUPS: Final = ("#cfe5fb", "#d6efc9", "#fde2b8", "#f5d3e4", "#e3daf8", "#c9ecea", "#f4efb3", "#e5dccb")

_STYLE: Final = """\
.hfg text{white-space:pre;stroke:none}
@media (prefers-color-scheme:dark){
.hfg-paper,.hfg-gap{fill:#14181d}.hfg-halo,.hfg-gap{stroke:#14181d}
.hfg-line{stroke:#d5dde6}.hfg-line.hfg-light{stroke:#93a7bd}
.hfg-tip{fill:#d5dde6}.hfg-tip.hfg-light{fill:#93a7bd}
.hfg-box{stroke:#7b8ea3}.hfg-free{fill:#d5dde6}
rect.hfg-node{stroke:#93a7bd}rect.hfg-on{stroke:#ff7a3d}
rect.hfg-port,path.hfg-port{stroke:#eef3f8}
}
"""


def svg(graph: HasLevel, view: View = EVERYTHING) -> str:
    """Draw a graph as the text of an SVG file."""
    seen = picture(graph, view)
    return "".join(_document(seen, sheet(seen)))


def _document(seen: Picture, laid: Sheet) -> Iterator[str]:
    title = shortened(seen.title, 80)
    top = _MARGIN + 24.0
    entries = list(_legend(seen, laid))
    width = max(laid.width, 220.0, width_of(title, 14, bold=True), max((room for room, _ in entries), default=0.0))
    rows = _rows(entries, width)
    height = top + laid.height + (16.0 + _LEGEND_ROW * len(rows) if rows else 0.0) + _MARGIN
    width += 2 * _MARGIN
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="hfg" width="{_n(width)}" height="{_n(height)}" '
        f'viewBox="0 0 {_n(width)} {_n(height)}" role="img" aria-label="{escaped(seen.title)}" '
        f'font-family="{escaped(FONTS)}" fill="{_INK}">\n'
    )
    yield f"<style>\n{_STYLE}</style>\n"
    yield f'<rect class="hfg-paper" width="100%" height="100%" fill="{_PAPER}"/>\n'
    yield _text(Text(_MARGIN, _MARGIN + 8.0, title, 14, bold=True), " hfg-free")
    yield f'<g transform="translate({_n(_MARGIN)} {_n(top)})">\n'
    boxes = [card for card in laid.cards if isinstance(card.of, Box)]
    colours = _colours(seen)
    for card in boxes:
        yield from _box(card, colours)
    for lead in laid.leads:
        yield from _lead(lead)
    for card in laid.cards:
        if isinstance(card.of, Shape):
            yield from _card(card, card.of, colours)
    for card in boxes:
        yield from map(_port, card.marks)
    for text in laid.texts:
        yield _text(text, " hfg-free")
    y = laid.height + 16.0 + _LEGEND_ROW / 2
    for row in rows:
        x = 0.0
        for room, drawn in row:
            yield f'<g transform="translate({_n(x)} {_n(y)})">{drawn}</g>\n'
            x += room
        y += _LEGEND_ROW
    yield "</g>\n</svg>\n"


def _n(number: float) -> str:
    return f"{number:.1f}".removesuffix(".0")


# --- nodes, subgraphs and ports


def _colours(seen: Picture) -> dict[str, str]:
    """Give the colour of each group; of more groups than there are colours some share one."""
    named = [group for group in seen.groups if group != "loop"]
    return {"loop": "#ffffff"} | {group: _GROUPS[index % len(_GROUPS)] for index, group in enumerate(named)}


def _box(card: Card, colours: dict[str, str]) -> Iterator[str]:
    of = card.of
    on = " hfg-on" if of.is_active else ""
    dashed = "" if of.is_enabled else ' stroke-dasharray="6 4"'
    stroke, thick = (_ACTIVE, 3) if of.is_active else (_LIGHT_INK, 1.2)
    yield f'<g class="hfg-subgraph" data-path="{escaped(of.path)}"><title>{escaped(_told(of))}</title>'
    yield (
        f'<rect class="hfg-box{on}" x="{_n(card.x)}" y="{_n(card.y)}" width="{_n(card.width)}" '
        f'height="{_n(card.height)}" rx="8" fill="none" stroke="{stroke}" stroke-width="{thick}"{dashed}/>'
    )
    if of.group != "loop":
        x, y, right = card.x + 1, card.y + 1, card.x + card.width - 1
        yield (
            f'<path d="M{_n(x)} {_n(y + 22)}V{_n(y + 7)}a7 7 0 0 1 7 -7H{_n(right - 7)}a7 7 0 0 1 7 7V{_n(y + 22)}z" '
            f'fill="{colours[of.group]}" opacity="0.55"/>'
        )
    for text in card.texts:
        yield _text(text, " hfg-free")
    yield "</g>\n"


def _card(card: Card, of: Shape, colours: dict[str, str]) -> Iterator[str]:
    x, y, width, height = card.x, card.y, card.width, card.height
    path = f' data-path="{escaped(of.path)}"' if of.path else ""
    yield f'<g class="hfg-{of.look}"{path}><title>{escaped(_told(of))}</title>'
    on = " hfg-on" if of.is_active else ""
    stroke, thick = (_ACTIVE, 3.5) if of.is_active else (_INK, 1.2)
    dashed = "" if of.is_enabled else ' stroke-dasharray="5 4"'
    place = f'x="{_n(x)}" y="{_n(y)}" width="{_n(width)}" height="{_n(height)}"'
    look = f'stroke="{stroke}" stroke-width="{thick}"{dashed}'
    if of.look == "node":
        yield f'<rect class="hfg-node{on}" {place} rx="4" fill="{colours.get(of.group, "#ffffff")}" {look}/>'
        if of.is_folded:
            yield _folded(x + width - 19, y + _line_of_name(card) - 10)
    else:
        yield f'<rect class="hfg-node" {place} rx="11" fill="#eef2f6" {look}/>'
        if of.look in ("start", "stop"):
            yield f'<circle cx="{_n(x + 13)}" cy="{_n(y + 11)}" r="4" fill="{_INK}"/>'
        if of.look == "stop":
            yield f'<circle cx="{_n(x + 13)}" cy="{_n(y + 11)}" r="6.5" fill="none" stroke="{_INK}"/>'
    for text in card.texts:
        yield _text(text)
    yield from map(_port, card.marks)
    yield "</g>\n"


def _line_of_name(card: Card) -> float:
    return next((text.y for text in card.texts if text.bold), card.y + 15) - card.y


def _folded(x: float, y: float) -> str:
    """A small box with a plus: there is more inside."""
    return (
        f'<path d="M{_n(x)} {_n(y)}h11v11h-11zM{_n(x + 5.5)} {_n(y + 2.5)}v6M{_n(x + 2.5)} {_n(y + 5.5)}h6" '
        f'fill="none" stroke="{_INK}"/>'
    )


def _told(of: Shape | Box) -> str:
    """What is said when one points at it: the whole name, and whatever the drawing shows by a colour."""
    lines = [of.path or of.name, of.type_name, *of.details]
    if of.path:
        lines.append(f"group {of.group}")
    return "\n".join([*lines, "active"] if of.is_active else lines)


def _port(mark: Mark) -> str:
    x, y, size = mark.x, mark.y, _PORT_SIZE
    match mark.kind:
        case "input" | "output":
            shape = f'<rect x="{_n(x - size)}" y="{_n(y - size)}" width="{_n(2 * size)}" height="{_n(2 * size)}"'
            return f'{shape} class="hfg-port" fill="{_INK}" stroke="{_INK}"/>'
        case "parameter":
            size += 1
            corners = f"M{_n(x - size)} {_n(y)}l{_n(size)} {_n(-size)}l{_n(size)} {_n(size)}l{_n(-size)} {_n(size)}z"
            return f'<path d="{corners}" class="hfg-port" fill="{_INK}" stroke="{_INK}"/>'
        case "gate":
            shape = f'<rect x="{_n(x - 8)}" y="{_n(y - 3)}" width="16" height="6" rx="1"'
            return f'{shape} fill="{_PAPER}" stroke="{_INK}" stroke-width="1.4"/>'
    return (
        f'<circle cx="{_n(x)}" cy="{_n(y)}" r="{_n(size + 0.4)}" fill="{_PAPER}" stroke="{_INK}" stroke-width="1.4"/>'
    )


# --- lines


class _Pen(NamedTuple):
    """How a line of some kind is drawn."""

    shade: str
    ink: str
    halo: float
    dot: float
    look: str


def _pen(arrow: Arrow) -> _Pen:
    if arrow.is_gate:
        return _Pen(
            " hfg-light", _LIGHT_INK, 6, 2.6, 'stroke-width="1.8" stroke-dasharray="1.5 4" stroke-linecap="round"'
        )
    shade, ink = (" hfg-light", _LIGHT_INK) if arrow.is_signal else ("", _INK)
    if arrow.is_active:
        return _Pen(shade, ink, 9, 3.4, 'stroke-width="5"')
    dash = ' stroke-dasharray="6 3.5"' if arrow.is_signal else ""
    return _Pen(shade, ink, 6, 2.6, f'stroke-width="1.3"{dash}')


def _lead(lead: Lead) -> Iterator[str]:
    """Draw lines that run together; a rim of paper around them shows that those they cross lie below."""
    first = lead.arrows[0]
    pen = _pen(first)
    heads = [_head(way, arrow) for way, arrow in zip(lead.ways, lead.arrows, strict=True)]
    d = "".join(_curve(way, end) for way, (_, end) in zip(lead.ways, heads, strict=True))
    told = "\n".join(_said(arrow) for arrow in lead.arrows)
    yield f'<g class="hfg-edge" fill="none"><title>{escaped(told)}</title>'
    halo = "".join(_curve(*_within(way)) for way in lead.ways if len(way) > 1)
    yield f'<path class="hfg-halo" d="{halo}" stroke="{_PAPER}" stroke-width="{pen.halo}"/>'
    yield f'<path class="hfg-line{pen.shade}" d="{d}" stroke="{pen.ink}" {pen.look}/>'
    if first.is_active:  # two lines, for there is paper between them
        yield f'<path class="hfg-gap" d="{d}" stroke="{_PAPER}" stroke-width="2.2" style="fill:none"/>'
    for x, y in lead.dots:
        yield f'<circle class="hfg-tip{pen.shade}" cx="{_n(x)}" cy="{_n(y)}" r="{pen.dot}" fill="{pen.ink}"/>'
    for (tip, _), arrow in zip(heads, lead.arrows, strict=True):
        if not arrow.is_gate:
            yield f'<path class="hfg-tip{pen.shade}" d="{tip}" fill="{pen.ink}"/>'
    yield "</g>\n"
    for text in lead.texts:
        yield _text(text, " hfg-free")


def _said(arrow: Arrow) -> str:
    return f"{'gate' if arrow.is_gate else 'active edge' if arrow.is_active else 'edge'} {arrow.label}".rstrip()


def _head(way: Sequence[Point], arrow: Arrow) -> tuple[str, Point]:
    """Draw the head of an arrow in front of its port; give where the line ends under it, too."""
    (x0, y0), (x, y) = way[-2] if len(way) > 1 else way[-1], way[-1]
    dx, dy = (x > x0) - (x < x0), (y > y0) - (y < y0)
    room = 0.0 if arrow.is_gate else _PORT_SIZE + 0.6
    wide = 5.0 if arrow.is_active else 3.6
    x, y = x - dx * room, y - dy * room
    back_x, back_y = x - dx * _HEAD, y - dy * _HEAD
    tip = (
        f"M{_n(x)} {_n(y)}L{_n(back_x - dy * wide)} {_n(back_y - dx * wide)}"
        f"L{_n(back_x + dy * wide)} {_n(back_y + dx * wide)}z"
    )
    return tip, (x, y) if arrow.is_gate else (x - dx * (_HEAD - 1), y - dy * (_HEAD - 1))


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


def _within(way: Sequence[Point]) -> tuple[list[Point], Point]:
    """Leave out both ends of a way, where it may meet others that begin or end at the same port."""
    inner = list(way)
    for _ in range(2):
        inner.reverse()
        if len(inner) > 2 and abs(inner[0][0] - inner[1][0]) + abs(inner[0][1] - inner[1][1]) < _CLEAR:
            del inner[0]
        (x, y), (x2, y2) = inner[0], inner[1]
        length = abs(x2 - x) + abs(y2 - y)
        part = min(1.0, _CLEAR / length) if length else 0.0
        inner[0] = (x + (x2 - x) * part, y + (y2 - y) * part)
    return inner, inner[-1]


def _text(text: Text, more: str = "") -> str:
    weight = ' font-weight="bold"' if text.bold else ""
    anchor = f' text-anchor="{text.anchor}"' if text.anchor != "start" else ""
    fitted = ""
    if not is_measured(text.text):  # whatever these letters look like, they keep to their place
        width = width_of(text.text, text.size, bold=text.bold)
        fitted = f' textLength="{_n(max(width, 1.0))}" lengthAdjust="spacingAndGlyphs"'
    return (
        f'<text class="hfg-text{more}" x="{_n(text.x)}" y="{_n(text.y)}" font-size="{_n(text.size)}"'
        f"{anchor}{weight}{fitted}>{escaped(text.text)}</text>\n"
    )


# --- what the signs mean


def _legend(seen: Picture, laid: Sheet) -> Iterator[tuple[float, str]]:
    """Give each entry with the room it takes; only what is drawn is explained."""
    used = {mark.kind for card in laid.cards for mark in card.marks}
    used |= {_meaning(arrow) for lead in laid.leads for arrow in lead.arrows}
    used |= {"active node" for card in laid.cards if card.of.is_active}
    bar = f'<rect x="26" y="-6" width="5" height="12" fill="{_PAPER}" stroke="{_INK}"/>'
    lit = f'rx="3" fill="#ffffff" stroke="{_ACTIVE}" stroke-width="3"'
    for meant, drawn, room, says in (
        ({"input", "output"}, _port(Mark(8.0, 0.0, "input", "")), 16, "synchronous"),
        ({"slot", "event"}, _port(Mark(8.0, 0.0, "slot", "")), 16, "asynchronous"),
        ({"parameter"}, _port(Mark(8.0, 0.0, "parameter", "")), 16, "parameter"),
        ({"data"}, _sample(Arrow("", "", "")), 34, "data"),
        ({"signals"}, _sample(Arrow("", "", "", is_signal=True)), 34, "signals"),
        ({"active edge"}, _sample(Arrow("", "", "", is_active=True)), 34, "active edge"),
        ({"gate line"}, _sample(Arrow("", "", "", is_gate=True)) + bar, 36, "gate: rests unless active"),
        ({"active node"}, f'<rect class="hfg-on" x="2" y="-6" width="20" height="12" {lit}/>', 26, "active"),
    ):
        if used & meant:
            yield _entry(drawn, room, says)
    yield from _legend_of_groups(seen, {card.of.group for card in laid.cards if card.of.path})


def _meaning(arrow: Arrow) -> str:
    if arrow.is_gate:
        return "gate line"
    return "active edge" if arrow.is_active else "signals" if arrow.is_signal else "data"


def _legend_of_groups(seen: Picture, used: Set[str]) -> Iterator[tuple[float, str]]:
    colours = _colours(seen)
    if used <= {"loop"}:
        return
    for group in seen.groups:
        if group in used:
            look = f'rx="2" fill="{colours[group]}" stroke="{_INK}"'
            rect = f'<rect class="hfg-node" x="2" y="-6" width="16" height="12" {look}/>'
            yield _entry(rect, 22, "on the loop" if group == "loop" else f"group {group}")


def _entry(drawn: str, room: float, says: str) -> tuple[float, str]:
    says = shortened(says, LONGEST_NAME)
    return room + 6 + width_of(says, DETAIL) + 22, drawn + _text(Text(room + 4, 3.6, says, DETAIL), " hfg-free")


def _sample(arrow: Arrow) -> str:
    return "".join(_lead(Lead([arrow], [[(0.0, 0.0), (34.0, 0.0)]], [], [])))


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

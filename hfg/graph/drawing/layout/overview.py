"""The view "activity": states and what feeds them, one line for each pair, as in Figure 19 of the paper.

Ports are left out. A line has the names of the events that lead along it, because a reader of the mission wants to know
which events move it, not which slots they reach. Of a subgraph that feeds states only the nodes inside that do so are
shown: "perception" feeds everything, but its node "cube" says what for.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from msgspec.structs import replace

from hfg.graph.drawing.layout.parts import Link, Spot, Thing, Work
from hfg.graph.drawing.seen import Arrow, Picture


def feeders(seen: Picture) -> frozenset[str]:
    """Return the paths of subgraphs that are folded and feed states, but are not states themselves."""
    by_id = {shape.id: shape for _, shape in seen.items}
    pairs = [(by_id[arrow.tail], by_id[arrow.head]) for arrow in seen.arrows if not (arrow.is_active or arrow.is_gate)]
    return frozenset(tail.path for tail, head in pairs if tail.inner and head.is_state and not tail.is_state)


def take_out(seen: Picture, opened: frozenset[str]) -> None:
    """Put the nodes in these subgraphs that feed states next to the subgraph, and leave the rest of it out."""
    inside: set[str] = set()
    boxes: list[int] = []
    for depth, shape in seen.items:
        boxes = [at for at in boxes if at < depth]
        if boxes:
            inside.add(shape.id)
        if shape.path in opened:
            boxes.append(depth)
            inside.add(shape.id)
    into: dict[str, list[Arrow]] = {}
    for arrow in seen.arrows:
        if arrow.head in inside and not arrow.is_gate:
            into.setdefault(arrow.head, []).append(arrow)
    states = {shape.id for _, shape in seen.items if shape.is_state} - inside
    arrows = [arrow for arrow in seen.arrows if not {arrow.tail, arrow.head} & inside]
    for arrow in seen.arrows:
        inner_ones = into.get(arrow.tail, ()) if arrow.head in states else ()
        arrows += (replace(arrow, tail=one.tail, out_of=one.out_of, is_signal=one.is_signal) for one in inner_ones)
    kept = {arrow.tail for arrow in arrows} | {shape.id for _, shape in seen.items} - inside
    seen.items = [(0 if shape.id in inside else depth, shape) for depth, shape in seen.items if shape.id in kept]
    seen.arrows = [arrow for arrow in arrows if {arrow.tail, arrow.head} <= kept]


def to_overview(work: Work) -> None:
    """Keep states, what sends them data, and one line for each pair of them."""
    pairs: dict[tuple[object, ...], Link] = {}
    for thing in work.things:
        thing.spots.clear()
        thing.least = _LEAST
    for link in work.links:
        if not link.is_active and not _feeds(link):
            continue
        side = "right" if not link.is_signal or not link.is_active else "bottom"
        alone = id(link) if link.tail is None or link.head is None else 0
        key = id(link.tail), id(link.head), link.is_active, side, alone
        if key in pairs:
            pairs[key].arrows += link.arrows
            pairs[key].tail_spots += link.tail_spots
            pairs[key].head_spots += link.head_spots
        else:
            pairs[key] = link
    kept: list[Link] = list(pairs.values())
    for link in kept:
        _simplify(link)
    used = {id(one) for link in kept for one in (link.tail, link.head)}
    work.links = kept
    work.things = [one for one in work.things if id(one) in used or one.shape.is_state]
    for number, thing in enumerate(work.things):
        thing.number = number


_LEAST: Final = 136.0  # so that a page can say where inside activity is


def _feeds(link: Link) -> bool:
    """Whether data leads from something that is not a state to a state."""
    tail, head = link.tail, link.head
    return tail is not None and head is not None and head.shape.is_state and not tail.shape.is_state


def _simplify(link: Link) -> None:
    """Let a line begin and end at the middle of a side, and say what leads along it."""
    names = dict.fromkeys(_said(link.tail, spot) for spot in link.tail_spots)
    if link.is_active:
        link.said = " or ".join(names)
    else:
        link.said = ", ".join(dict.fromkeys(spot.name for spot in link.head_spots))
    is_below = link.is_active and link.is_signal
    tail_side, head_side = ("bottom" if is_below else "right"), ("top" if link.is_active else "left")
    if link.tail is not None:
        kind = "event" if is_below else "output"
        spot = _spot(link.tail, kind, link.said if link.is_active else "", link.tail_spots, True)
        spot.side = "bottom" if tail_side == "bottom" else "right"
        spot.outside = link.said if is_below else ""
        link.tail_spots = [spot]
    if link.head is not None:
        spot = _spot(link.head, "slot" if link.is_active else "input", "", link.head_spots, False)
        spot.side = "top" if head_side == "top" else "left"
        link.head_spots = [spot]


def _said(thing: Thing | None, spot: Spot) -> str:
    return thing.shape.limit if spot.kind == "timeout" and thing is not None else spot.name


def _spot(thing: Thing, kind: str, name: str, of: Iterable[Spot], is_tail: bool) -> Spot:
    found = thing.spots.setdefault((kind, name, is_tail), Spot(kind, name, "top", is_plain=True))
    found.tagged += [tag for spot in of for tag in spot.tagged if tag not in found.tagged]
    found.to_tag = max(found.to_tag, *(spot.to_tag for spot in of))
    found.is_linked = found.is_linked or any(spot.is_linked for spot in of)
    return found

"""How large things are, and where on their borders the ports are.

What stands in a node, from the top: names of slots, its own name with badges, options or measures, names of inputs
and outputs in rows where they are needed, names of events. Heights and widths are whole multiples of 8.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from hfg.graph.drawing.layout.parts import Side, Spot, Thing
from hfg.graph.drawing.text import shortened, width_of

NAME: Final = 13.0  # sizes of letters: names of nodes, of ports, options, tags
PORT: Final = 11.0
DETAIL: Final = 11.0
BADGE: Final = 11.0
TAG: Final = 10.0
LONGEST_NAME: Final = 34  # letters
LONGEST_PORT: Final = 26
LONGEST_TAG: Final = 15
LONGEST_SAID: Final = 48

GRID: Final = 8.0
_PAD: Final = 12.0
_ROW: Final = 16.0  # named ports one below the other
_COMB: Final = 10.0  # others
_LEAST: Final = 22.0  # between ports side by side
_MEASURED: Final = (72.0, 176.0)  # a node with bars
_WIDER: Final = 1.05  # the letters of the page than those of drawings
_SIGN: Final = 32.0  # of a node that waits, between its name and its badges
_BARS: Final = 40.0  # where they end in a node that has nothing else
_BELOW_BARS: Final = 54.0  # there rows of ports begin
TAG_HEIGHT: Final = 14.0


def up(number: float, grid: float = GRID) -> float:
    """Round up to a whole multiple."""
    return math.ceil(number / grid - 1e-9) * grid


def badge_width(says: str) -> float:
    """Return how wide a badge is: its sign, and what it says."""
    return 18.0 + (width_of(shortened(says, LONGEST_PORT), BADGE) + 5.0 if says else 0.0)


def tag_text(names: Sequence[str], *, is_in: bool) -> str:
    """Write names into one tag; of many their number."""
    names = list(dict.fromkeys(names))
    text = ", ".join(shortened(name, LONGEST_PORT) for name in names)
    return text if len(text) <= LONGEST_TAG or len(names) == 1 else f"{len(names)} {'in' if is_in else 'out'}"


def tag_width(text: str) -> float:
    """Return how wide a tag is."""
    return math.ceil(width_of(text, TAG) + 10.0)


def size(thing: Thing, *, measured: bool, inner: tuple[float, float] | None = None) -> None:
    """Say how high and at least how wide a thing is, and how much room its tags need; `inner` is what it contains."""
    sides = {
        side: [one for one in thing.spots.values() if one.side == side] for side in ("left", "right", "top", "bottom")
    }
    names = [
        max(0.0, *(width_of(shortened(one.says, LONGEST_PORT), PORT) for one in sides[side]), 0.0)
        for side in ("left", "right")
    ]
    is_measured = measured and thing.shape.look == "node"
    has_rows = any(one.says for side in sides.values() for one in side) or bool(sides["top"] + sides["bottom"])
    header = (_BELOW_BARS if has_rows else _BARS) if is_measured else _header(thing, sides)
    wide = [_title_width(thing), *(sum(map(room, sides[side])) + _PAD for side in ("top", "bottom"))]
    named = [sides[side] for side in ("left", "right") if _is_named(sides[side])]
    rows = max((len(spots) + sum(bool(one.tagged) and one.is_linked for one in spots) for spots in named), default=0)
    if rows:
        wide.append(names[0] + names[1] + 32.0)
    details = "  ".join(thing.shape.details)
    wide.append(width_of(shortened(details, LONGEST_NAME), DETAIL) + 2 * _PAD)
    height = header + _ROW * rows + (6.0 if rows else 0.0) + (14.0 if _is_named(sides["bottom"]) else 4.0)
    height = max(height, *(_comb_height(sides[side]) for side in ("left", "right")), 40.0)
    if inner is not None:
        wide.append(inner[0] + 2 * 20.0)
        height = max(height, header + inner[1] + 32.0)
    elif is_measured:
        height, least = max(height, _MEASURED[0] if len(sides["top"] + sides["bottom"]) else 48.0), _MEASURED[1]
        wide += [least, _WIDER * _title_width(thing) + _SIGN]
    thing.width, thing.height = up(max(*wide, thing.least)), up(height)
    _place_upright(thing, sides, header)
    thing.left, thing.right = (_beside(sides[side]) for side in ("left", "right"))
    thing.top = max((TAG_HEIGHT + one.to_tag for one in sides["top"] if one.tagged), default=0.0)
    thing.bottom = max((TAG_HEIGHT + one.to_tag for one in sides["bottom"] if one.tagged), default=0.0)
    thing.bottom = max(thing.bottom, 16.0 if any(one.outside for one in sides["bottom"]) else 0.0)


def _header(thing: Thing, sides: dict[str, list[Spot]]) -> float:
    """Return how far down the rows of ports begin."""
    header = (18.0 if _is_named(sides["top"]) else 8.0) + 20.0
    return header + (16.0 if thing.shape.details else 0.0)


def _title_width(thing: Thing) -> float:
    name = width_of(shortened(thing.shape.name, LONGEST_NAME), NAME, bold=True)
    badges = sum(badge_width(one.says) + 6.0 for one in thing.badges)
    return name + badges + (26.0 + 7.0 * len(str(thing.shape.inner)) if thing.shape.inner else 0.0) + 2 * _PAD


def _is_named(spots: Sequence[Spot]) -> bool:
    return any(one.says for one in spots)


def _comb_height(spots: Sequence[Spot]) -> float:
    return 0.0 if _is_named(spots) else _COMB * len(spots) + 6.0


def halves(spot: Spot) -> tuple[float, float]:
    """Return how much room a port on top or bottom needs left and right of it."""
    own = max(width_of(shortened(spot.says, LONGEST_PORT), PORT) / 2 + 4.0 if spot.says else 0.0, _LEAST / 2)
    left = right = own
    if spot.kind == "timeout":
        left, right = _LEAST / 2, 2 * own + 8.0  # its limit is written on its right
    if spot.outside:
        right = max(right, width_of(shortened(spot.outside, LONGEST_SAID), PORT) + 14.0)
    if spot.tagged:
        tag = tag_width(tag_text(spot.tagged, is_in=spot.side == "top"))
        left, right = (
            (left, max(right, tag + 12.0)) if spot.is_linked else (max(left, tag / 2 + 4), max(right, tag / 2 + 4))
        )
    return left, right


def room(spot: Spot) -> float:
    """Return how much room a port on top or bottom needs next to others."""
    return sum(halves(spot))


def _beside(spots: Sequence[Spot]) -> float:
    """Return how much room tags need on the left or right."""
    tags = [one.tagged for one in spots if one.tagged]
    if not _is_named(spots):  # they share one
        tags = [[name for names in tags for name in names]] if tags else []
    texts = [tag_text(names, is_in=spots[0].side == "left") for names in tags]
    return max((tag_width(text) + max(one.to_tag for one in spots) + 6.0 for text in texts), default=0.0)


def _order_upright(spot: Spot) -> tuple[object, ...]:
    """Return the order of ports on the left and right: bundles first, then single lines, then tags, then parameters."""
    only_tag = bool(spot.tagged) and not spot.is_linked
    has_both = bool(spot.tagged) and spot.is_linked  # its tag is below it
    return spot.kind == "parameter", has_both, only_tag, spot.comb < 0, spot.comb, spot.order, spot.name


def _place_upright(thing: Thing, sides: dict[str, list[Spot]], header: float) -> None:
    for side in ("left", "right"):
        spots = sorted(sides[side], key=_order_upright)
        pitch = _ROW if _is_named(spots) else _COMB
        at = header + 9.0 if _is_named(spots) else thing.height / 2 - pitch * (len(spots) - 1) / 2
        for spot in spots:
            spot.at = at
            at += pitch * (2 if pitch == _ROW and spot.tagged and spot.is_linked else 1)


def place_level(thing: Thing, spine: Mapping[Side, Spot | None]) -> None:
    """Put the ports on top and bottom side by side, in the order of where their lines go.

    One of each side may be on the spine; what goes left is left of it. The others stand around the middle.
    """
    for side in ("top", "bottom"):
        spots = sorted((one for one in thing.spots.values() if one.side == side), key=lambda one: (one.pull, one.order))
        straight = spine.get(side)
        if straight is None:
            at = (thing.width - sum(map(room, spots))) / 2
        else:
            spots.remove(straight)
            before = [one for one in spots if one.pull < 0]
            at = thing.spine - halves(straight)[0] - sum(map(room, before))
            spots = [*before, straight, *(one for one in spots if one.pull >= 0)]
        for spot in spots:
            spot.at = round(at + halves(spot)[0])
            at += room(spot)


def rooms_beside(thing: Thing, spine: Mapping[Side, Spot | None]) -> tuple[float, float]:
    """Return how much room a thing needs left and right of its spine."""
    left = right = 48.0
    for side in ("top", "bottom"):
        spots = [one for one in thing.spots.values() if one.side == side]
        straight = spine.get(side)
        if straight is not None:
            before, behind = halves(straight)
            left = max(left, before + 8.0 + sum(room(one) for one in spots if one is not straight and one.pull < 0))
            right = max(right, behind + 8.0 + sum(room(one) for one in spots if one is not straight and one.pull >= 0))
    return left, right

"""The row and lane of each node. Only activity decides about states; everything else is placed next to them.

The mission asks perception and perception feeds the mission: with data in it the graph is one knot, and any order cuts
it at the wrong place. So states are ordered only by active edges, on a walk in depth from where activity begins. Other
nodes go left of them if they feed them, right if they take from them. A graph without states is one of data, whose
layers run from left to right.
"""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

from hfg.graph.drawing.layout.layers import as_layers, layers, walk
from hfg.graph.drawing.layout.parts import GAP, Link, Side, Spot, Thing, Work

_BELOW: Final = 3.0  # as bad as N rows: a row below all states


def place(work: Work) -> None:
    """Return every thing its row and lane."""
    ways = [
        link for link in work.links if link.tail is not None and link.head is not None and link.tail is not link.head
    ]
    active = [link for link in ways if link.is_active]
    work.has_rows = bool(active)
    if work.has_rows:
        states = [one for one in work.things if one.shape.is_state]
        _rows_of_states(states, active, work.links)
        _beside_states(work, states, ways)
    else:
        as_layers(work.things, ways, 0)
    _mark_back(work, ways)
    first_row = min((one.row for one in work.things), default=0)
    lanes = {lane: index for index, lane in enumerate(sorted({0} | {one.lane for one in work.things}))}
    rows = sorted({row for one in work.things for row in range(one.row, one.row + one.span)} | {first_row})
    at = {row: index for index, row in enumerate(rows)}
    for thing in work.things:
        thing.row, thing.lane = at[thing.row], lanes[thing.lane] - lanes[0]


# --- states


def _rows_of_states(states: Sequence[Thing], active: Sequence[Link], links: Iterable[Link]) -> None:
    """Put states into rows along the active edges that do not lead back, and side by side where activity parts."""
    leaving: dict[int, list[Link]] = {one.number: [] for one in states}
    entered = {link.head.number for link in active if link.head is not None}
    begun = {link.head.number for link in links if link.is_active and link.tail is None and link.head is not None}
    for link in active:
        assert link.tail is not None
        leaving[link.tail.number].append(link)
    for links_ in leaving.values():
        links_.sort(key=_straightest)
    # Where activity begins is first; then what nothing leads to; then, for circles that nothing enters, any state.
    roots = sorted(states, key=lambda one: (one.number not in begun, one.number in entered))
    order, met = walk(roots, leaving)
    rank = {thing.number: index for index, thing in enumerate(order)}
    first = {number: index for index, number in enumerate(met)}
    taken: set[tuple[int, int]] = set()
    for thing in order:
        thing.row = 0
    for thing in order:  # each before all that it leads to
        for link in leaving[thing.number]:
            head = link.head
            assert head is not None
            if rank[head.number] > rank[thing.number]:
                head.row = max(head.row, thing.row + 1)
    for thing in sorted(order, key=lambda one: (one.row, first[one.number])):
        lane = met[thing.number].lane
        while (lane, thing.row) in taken:
            lane += 1
        thing.lane = lane
        taken.add((lane, thing.row))


def _straightest(link: Link) -> tuple[bool, bool]:
    """Order active edges by which one goes straight on: events are below, a time-out is not what one hopes for."""
    return not link.is_signal, link.tail_spots[0].name == "timeout"


# --- next to them


def _beside_states(work: Work, states: Sequence[Thing], ways: Sequence[Link]) -> None:
    others = [one for one in work.things if not one.shape.is_state]
    is_state = {one.number for one in states}
    score: Counter[int] = Counter()
    rows: dict[int, list[int]] = {one.number: [] for one in others}
    for link in ways:
        assert link.tail is not None
        assert link.head is not None
        for thing, state, feeds in ((link.tail, link.head, 1), (link.head, link.tail, -1)):
            if state.number in is_state and thing.number not in is_state:
                score[thing.number] += feeds * len(link.arrows)
                rows[thing.number] += [state.row] * len(link.arrows)
    by_path = {one.shape.path: one for one in work.things}
    for thing in others:
        for badge in thing.badges:
            gate = by_path.get(badge.by)
            if gate is not None and gate.number in is_state and not rows[thing.number]:
                rows[thing.number].append(gate.row)
    fed = {one.number for link in ways for one in (link.tail, link.head) if one is not None}
    side = _sides(others, ways, score, rows)
    near = [one for one in others if one.number in side]
    depth = _depths(near, ways, side)
    straight = [link for link in ways if link.is_active and link.tail_spots[0].side == "right"]
    _take_rows(near, states, side, depth, rows, fed, straight)
    far = [one for one in others if one.number not in side]
    if far:
        below = max(one.row + one.span for one in [*states, *near])
        as_layers(far, [link for link in ways if link.tail in far and link.head in far], below)


def _sides(
    others: Sequence[Thing], ways: Sequence[Link], score: Counter[int], rows: dict[int, list[int]]
) -> dict[int, int]:
    """Say who goes left (-1) and who right (1); who is connected to no state goes where those go it is connected to."""
    side = {one.number: -1 if score[one.number] > 0 else 1 for one in others if score[one.number]}
    neighbours: dict[int, list[tuple[int, bool]]] = {one.number: [] for one in others}
    for link in ways:
        assert link.tail is not None
        assert link.head is not None
        if link.tail.number in neighbours and link.head.number in neighbours:
            neighbours[link.tail.number].append((link.head.number, False))
            neighbours[link.head.number].append((link.tail.number, True))
    waiting = list(side)
    for one in waiting:  # grows
        for other, _ in neighbours[one]:
            if other not in side:
                side[other] = side[one]
                rows[other] += rows[one]
                waiting.append(other)
    for thing in others:
        if thing.number not in side and rows[thing.number]:  # a helper that a state opens, no more
            side[thing.number] = 1
    return side


def _depths(near: Sequence[Thing], ways: Sequence[Link], side: dict[int, int]) -> dict[int, int]:
    """Say how many lanes from the states each is: data leads to the right on both sides."""
    found: dict[int, int] = {}
    for sign in (-1, 1):
        own = {one.number: one for one in near if side[one.number] == sign}
        inner = [link for link in ways if link.tail is not None and link.tail.number in own]
        # Signals into a slot come from above, so the node may be placed below their sender.
        inner = [
            link
            for link in inner
            if link.head is not None and link.head.number in own and link.head_spots[0].side != "top"
        ]
        columns = layers(list(own.values()), inner)
        last = max(columns.values(), default=0)
        for number, layer in columns.items():
            found[number] = layer - last - 1 if sign < 0 else layer + 1
    return found


def _take_rows(
    near: Sequence[Thing],
    states: Sequence[Thing],
    side: dict[int, int],
    depth: dict[int, int],
    rows: dict[int, list[int]],
    fed: set[int],
    straight: Sequence[Link],
) -> None:
    """Return each a free place next to the states that it is connected to, those with most lines first."""
    taken = {(one.lane, one.row) for one in states}
    taken |= {(link.head.lane, link.tail.row) for link in straight if link.tail is not None and link.head is not None}
    widths: dict[int, float] = {}
    for thing in states:
        widths[thing.lane] = max(widths.get(thing.lane, 0.0), _wide(thing))
    count = max(one.row for one in states) + 1
    heights = [
        max((one.top + one.height + one.bottom for one in states if one.row == row), default=40.0)
        for row in range(count)
    ]
    for thing in sorted(near, key=lambda one: -len(rows[one.number])):
        wish = statistics.median_low(rows[thing.number]) if rows[thing.number] else 0
        need = thing.top + thing.height + thing.bottom
        lanes = [depth[thing.number] + side[thing.number] * out for out in range(3 if side[thing.number] > 0 else 1)]
        if thing.number not in fed:  # a helper that a state opens, no more: it may be on either side
            lanes = sorted({1, 2, -1, *widths} - {0})
        places = _places(
            wish, lanes, {lane: _wide(thing) - widths.get(lane, 0.0) for lane in lanes}, count, count + len(near)
        )
        for lane, row in places:
            span = _span(heights, row, need)
            # A large thing is next to the middle of its states, not below them.
            row = max(0, row - (span - 1) // 2)
            cells = {(lane, row + down) for down in range(span)}
            if not cells & taken:
                break
        thing.lane, thing.row, thing.span = lane, row, span
        widths[lane] = max(widths.get(lane, 0.0), _wide(thing))
        taken |= cells


def _wide(thing: Thing) -> float:
    return thing.left + thing.width + thing.right


def _places(wish: int, lanes: Sequence[int], wider: dict[int, float], last: int, rows: int) -> list[tuple[int, int]]:
    """Return lanes and rows for a thing, the best first: rather some rows off than in a lane that becomes wider."""

    def cost(place: tuple[int, int]) -> tuple[float, int, int]:
        lane, row = place
        return abs(row - wish) + max(0.0, wider[lane]) / 16.0 + (_BELOW if row >= last else 0.0), row, -lane

    return sorted(((lane, row) for lane in lanes for row in range(rows)), key=cost)


def _span(heights: Sequence[float], row: int, need: float) -> int:
    """Say how many rows from one on are as high as a thing."""
    span, high = 1, heights[row] if row < len(heights) else 48.0
    while high + 16.0 < need:
        high += GAP + (heights[row + span] if row + span < len(heights) else 48.0)
        span += 1
    return span


# --- what follows from it


def _mark_back(work: Work, ways: Sequence[Link]) -> None:
    """Say which active edges lead back, and on which side: those to one slot together, the longest on the left."""
    backs: dict[int, list[Link]] = {}
    for link in ways:
        tail, head = link.tail, link.head
        assert tail is not None
        assert head is not None
        link.is_back = link.is_active and tail.row >= head.row
        if link.is_back:
            backs.setdefault(link.net, []).append(link)
    busy: list[tuple[int, int, int]] = []
    for links in sorted(backs.values(), key=lambda links: -max(_reach(one) for one in links)):
        rows = [one.row for link in links for one in (link.tail, link.head) if one is not None]
        low, high = min(rows), max(rows)
        load = {side: sum(at == side and first < high and low < last for at, first, last in busy) for side in (-1, 1)}
        is_right = all(link.tail is not None and link.tail.lane > 0 for link in links)
        side = 1 if is_right or load[1] <= load[-1] > 0 else -1
        busy.append((side, low, high))
        for link in links:
            link.via = side


def _reach(link: Link) -> int:
    return 0 if link.tail is None or link.head is None else link.tail.row - link.head.row


def spine_of(work: Work) -> dict[tuple[int, Side], Spot]:
    """Say which port of a state leads straight down to the next one in its lane, and which comes from above."""
    found: dict[tuple[int, Side], Spot] = {}
    for link in work.links:
        if not link.is_active or link.is_back:
            continue
        tail, head = link.tail, link.head
        if tail is None and head is not None and link.head_spots[0].side == "top":
            found.setdefault((head.number, "top"), link.head_spots[0])
        elif tail is not None and head is not None and tail.lane == head.lane and head.row == tail.row + 1:
            if link.tail_spots[0].side == "bottom" and link.tail_spots[0].kind != "timeout":
                found.setdefault((tail.number, "bottom"), link.tail_spots[0])
            if link.head_spots[0].side == "top":
                found[head.number, "top"] = link.head_spots[0]
    return found

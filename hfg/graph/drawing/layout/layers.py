"""Columns and rows of nodes without activity: data runs from left to right, in layers (Sugiyama, Tagawa and Toda).

A walk in depth cuts the circles; each node is then as far right as the longest way to it. The rows follow from the
neighbours, in sweeps forth and back through the columns.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from typing import Final

from hfg.graph.drawing.layout.parts import GAP, Link, Thing

_SWEEPS: Final = 6
_BROAD: Final = 1.6  # of what is not connected: how broad against its height


def walk(roots: Iterable[Thing], leaving: dict[int, list[Link]]) -> tuple[list[Thing], dict[int, Thing]]:
    """Walk in depth; give the things so that only edges back lead from a later to an earlier one, and who led where.

    The second has the things in the order in which they were met.
    """
    done: list[Thing] = []
    met: dict[int, Thing] = {}
    for root in roots:
        if root.number in met:
            continue
        met[root.number] = root
        stack = [(root, iter(leaving[root.number]))]
        while stack:
            thing, ways = stack[-1]
            for link in ways:
                head = link.head
                if head is not None and head.number not in met:
                    met[head.number] = thing
                    stack.append((head, iter(leaving[head.number])))
                    break
            else:
                done.append(stack.pop()[0])
    return done[::-1], met


def as_layers(things: Sequence[Thing], ways: Sequence[Link], first_row: int) -> None:
    """Put things into columns along the edges, each part of the graph that is connected below the one before."""
    row = first_row
    alone: list[Thing] = []
    for part in _parts(things, ways):
        if len(part) == 1:
            alone += part
            continue
        own = {one.number for one in part}
        inner = [link for link in ways if link.tail is not None and link.tail.number in own]
        columns = _abreast(part, layers(part, inner))
        for thing in part:
            thing.lane = columns[thing.number]
        _order_rows(part, inner)
        top = min(one.row for one in part)
        for thing in part:
            thing.row += row - top
        row = max(one.row + one.span for one in part)
    wide = max(1, round((len(alone) * _BROAD * 56.0 / 150.0) ** 0.5), max((one.lane + 1 for one in things), default=1))
    for number, thing in enumerate(alone):
        thing.lane, thing.row = number % wide, row + number // wide


def _abreast(things: Sequence[Thing], columns: dict[int, int]) -> dict[int, int]:
    """Let open subgraphs of one column stand side by side where one below the other would be too high."""
    found: dict[int, int] = {}
    shift = 0
    for column in sorted(set(columns.values())):
        boxes = [one for one in things if columns[one.number] == column and one.shape.look == "box"]
        wide, high = (max((getattr(one, of) for one in boxes), default=0.0) for of in ("width", "height"))
        counts = range(1, len(boxes) + 1)
        count = min(counts, key=lambda n: max(n * wide / _BROAD, -(-len(boxes) // n) * high), default=1)
        found |= {number: at + shift for number, at in columns.items() if at == column}
        found |= {one.number: column + shift + index % count for index, one in enumerate(boxes)}
        shift += count - 1
    return found


def _parts(things: Sequence[Thing], ways: Sequence[Link]) -> list[list[Thing]]:
    """Return what is connected, in the order of the first of each."""
    leader = {one.number: one.number for one in things}

    def find(one: int) -> int:
        while leader[one] != one:
            leader[one] = leader[leader[one]]
            one = leader[one]
        return one

    for link in ways:
        assert link.tail is not None
        assert link.head is not None
        first, second = sorted((find(link.tail.number), find(link.head.number)))
        leader[second] = first
    found: dict[int, list[Thing]] = {}
    for thing in things:
        found.setdefault(find(thing.number), []).append(thing)
    return list(found.values())


def layers(things: Sequence[Thing], ways: Sequence[Link]) -> dict[int, int]:
    """Return each its column: as far right as the longest way to it, sources next to what they feed.

    Where a circle is cut: first at edges with initial tokens, which begin it; then at signals rather than at data.
    """
    leaving: dict[int, list[Link]] = {one.number: [] for one in things}
    for link in sorted(ways, key=lambda one: one.is_signal):
        assert link.tail is not None
        if not link.arrows[0].is_back:
            leaving[link.tail.number].append(link)
    entered = {link.head.number for links in leaving.values() for link in links if link.head is not None}
    order, _ = walk(sorted(things, key=lambda one: one.number in entered), leaving)
    rank = {thing.number: index for index, thing in enumerate(order)}
    layer = dict.fromkeys(rank, 0)
    forth = {
        number: [link.head.number for link in links if link.head is not None and rank[link.head.number] > rank[number]]
        for number, links in leaving.items()
    }
    for thing in order:
        for head in forth[thing.number]:
            layer[head] = max(layer[head], layer[thing.number] + 1)
    entered = {head for heads in forth.values() for head in heads}
    for thing in reversed(order):
        if thing.number not in entered and forth[thing.number]:
            layer[thing.number] = min(layer[head] for head in forth[thing.number]) - 1
    return layer


def _order_rows(things: Sequence[Thing], ways: Sequence[Link]) -> None:
    """Return each its row, near the rows of what it is connected to: forth and back through the columns."""
    columns: dict[int, list[Thing]] = {}
    for thing in things:
        columns.setdefault(thing.lane, []).append(thing)
    before: dict[int, list[tuple[Thing, float]]] = {one.number: [] for one in things}
    behind: dict[int, list[tuple[Thing, float]]] = {one.number: [] for one in things}
    for link in ways:
        tail, head = link.tail, link.head
        assert tail is not None
        assert head is not None
        # Where on the border a line leaves orders those that it leads to, though all of them are in one row.
        down, up = (
            (link.tail_spots[0].at / (tail.height or 1) - 0.5) / 2,
            (link.head_spots[0].at / (head.height or 1) - 0.5) / 2,
        )
        if tail.lane < head.lane:
            before[head.number].append((tail, down - up))
            behind[tail.number].append((head, up - down))
    for column in columns.values():
        for row, thing in enumerate(column):
            thing.span = max(1, round((thing.height + thing.top + thing.bottom + GAP) / (64.0 + GAP)))
            thing.row = row
    for sweep in range(_SWEEPS):
        forth = sweep % 2 == 0
        for lane in sorted(columns, reverse=not forth):
            _settle(columns[lane], before if forth else behind)


def _settle(column: list[Thing], partners: dict[int, list[tuple[Thing, float]]]) -> None:
    """Return the things of one column the rows next to those they want, in the order of their wishes."""

    def wish(thing: Thing) -> float:
        rows = [other.row + (other.span - 1) / 2 + off for other, off in partners[thing.number]]
        return (statistics.median(rows) if rows else thing.row + (thing.span - 1) / 2) - (thing.span - 1) / 2

    wishes = {one.number: wish(one) for one in column}
    column.sort(key=lambda one: wishes[one.number])
    blocks: list[tuple[list[Thing], float]] = []  # neighbours that push each other, and where the first wants to be
    for thing in column:
        blocks.append(([thing], wishes[thing.number]))
        while len(blocks) > 1 and blocks[-1][1] < blocks[-2][1] + _high(blocks[-2][0]) - 1e-9:
            (lower, below), (upper, above) = blocks.pop(), blocks.pop()
            shifted = below - _high(upper)
            mean = (above * len(upper) + shifted * len(lower)) / (len(upper) + len(lower))
            blocks.append((upper + lower, mean))
    row = -10_000
    for members, first in blocks:
        row = max(row, round(first))
        for thing in members:
            thing.row = row
            row += thing.span


def _high(things: Iterable[Thing]) -> int:
    return sum(one.span for one in things)

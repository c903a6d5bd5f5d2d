"""Which block is in which column, so that most lines lead to the right, and none is longer than it must be."""

from __future__ import annotations

from collections.abc import Sequence

from hfg.graph.drawing.layout.blocks import Block, Line

__all__ = ["columns"]

_ROUNDS = 12  # of pulling blocks towards their neighbours; more change nothing in practice


def columns(blocks: Sequence[Block], lines: Sequence[Line]) -> list[int]:
    """Give the column of each block, from 0; a line with a label spans two."""
    steps = _steps(blocks, lines)
    found = _longest_ways(len(blocks), steps)
    _pull(found, steps)
    _pin(blocks, found)
    least = min(found, default=0)
    return [column - least for column in found]


def _steps(blocks: Sequence[Block], lines: Sequence[Line]) -> list[tuple[int, int, int]]:
    """Give pairs of blocks, the left one first, with the least distance of their columns; without circles.

    Data leads to the right; of the other lines, in the order in which one meets them on a walk through the graph, those
    lead to the left that would close a circle: so the way back is the one that goes back for who reads along.
    """
    count = len(blocks)
    region = _regions(count, [(line.tail, line.head) for line in lines])
    after: list[list[int]] = [[] for _ in range(count)]
    met = _walk(count, lines)
    order = sorted(range(len(lines)), key=lambda one: (lines[one].is_back, not lines[one].is_data, met[one]))
    steps = []
    for one in order:
        line = lines[one]
        if line.tail == line.head:
            continue
        tail, head = line.tail, line.head
        if region[tail] == region[head] and _leads(after, head, tail, region):
            tail, head = head, tail
        after[tail].append(head)
        steps.append((tail, head, 1 if line.label is None else 2))
    return steps


def _walk(count: int, lines: Sequence[Line]) -> list[int]:
    """Number the lines as they are met on a walk in depth, from where nothing leads to first."""
    leaving: list[list[int]] = [[] for _ in range(count)]
    entered = [0] * count
    for number, line in enumerate(lines):
        leaving[line.tail].append(number)
        entered[line.head] += line.head != line.tail
    met = [0] * len(lines)
    seen = [False] * count
    clock = 0
    for root in sorted(range(count), key=lambda block: entered[block] > 0):
        if seen[root]:
            continue
        seen[root] = True
        stack = [iter(leaving[root])]
        while stack:
            for number in stack[-1]:
                met[number] = clock
                clock += 1
                head = lines[number].head
                if not seen[head]:
                    seen[head] = True
                    stack.append(iter(leaving[head]))
                    break
            else:
                stack.pop()
    return met


def _regions(count: int, pairs: Sequence[tuple[int, int]]) -> list[int]:
    """Number the strongly connected parts (Kosaraju): two blocks are in one if ways lead there and back."""
    forth: list[list[int]] = [[] for _ in range(count)]
    back: list[list[int]] = [[] for _ in range(count)]
    for tail, head in pairs:
        forth[tail].append(head)
        back[head].append(tail)
    left: list[int] = []
    seen = [False] * count
    for root in range(count):
        if seen[root]:
            continue
        seen[root] = True
        stack = [(root, iter(forth[root]))]
        while stack:
            block, heads = stack[-1]
            for head in heads:
                if not seen[head]:
                    seen[head] = True
                    stack.append((head, iter(forth[head])))
                    break
            else:
                left.append(block)
                stack.pop()
    region = [-1] * count
    for root in reversed(left):
        waiting = [root] if region[root] < 0 else []
        while waiting:
            block = waiting.pop()
            if region[block] < 0:
                region[block] = root
                waiting += [tail for tail in back[block] if region[tail] < 0]
    return region


def _leads(after: Sequence[Sequence[int]], start: int, goal: int, region: Sequence[int]) -> bool:
    """Say whether a way leads from one block to another; it cannot leave their region, or it would not come back."""
    seen = {start}
    waiting = [start]
    while waiting:
        block = waiting.pop()
        if block == goal:
            return True
        for head in after[block]:
            if head not in seen and region[head] == region[goal]:
                seen.add(head)
                waiting.append(head)
    return False


def _longest_ways(count: int, steps: Sequence[tuple[int, int, int]]) -> list[int]:
    leaving: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    missing = [0] * count
    for tail, head, least in steps:
        leaving[tail].append((head, least))
        missing[head] += 1
    found = [0] * count
    ready = [block for block in range(count) if not missing[block]]
    for block in ready:  # grows while it is walked through
        for head, least in leaving[block]:
            found[head] = max(found[head], found[block] + least)
            missing[head] -= 1
            if not missing[head]:
                ready.append(head)
    return found


def _pull(found: list[int], steps: Sequence[tuple[int, int, int]]) -> None:
    """Move blocks, as far as their lines allow, to where these are shortest."""
    before: list[list[tuple[int, int]]] = [[] for _ in found]
    behind: list[list[tuple[int, int]]] = [[] for _ in found]
    for tail, head, least in steps:
        behind[tail].append((head, least))
        before[head].append((tail, least))
    for round_ in range(_ROUNDS):
        changed = False
        order = sorted(range(len(found)), key=lambda block: found[block], reverse=round_ % 2 == 0)
        for block in order:
            lower = max((found[tail] + least for tail, least in before[block]), default=None)
            upper = min((found[head] - least for head, least in behind[block]), default=None)
            pull = len(behind[block]) - len(before[block])
            goal = upper if pull > 0 else lower if pull < 0 else found[block]
            if goal is not None and goal != found[block]:
                found[block] = goal
                changed = True
        if not changed:
            return


def _pin(blocks: Sequence[Block], found: list[int]) -> None:
    inner = [column for block, column in zip(blocks, found, strict=True) if not block.rank]
    first, last = min(inner, default=0) - 1, max(inner, default=0) + 1
    for number, block in enumerate(blocks):
        if block.rank:
            found[number] = first if block.rank == "first" else last

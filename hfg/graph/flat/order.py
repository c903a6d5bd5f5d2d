"""Rings in a directed graph: strongly connected parts and a short cycle of each, without recursion at any depth.

Nodes are the numbers from 0; `successors[n]` lists where the edges of `n` lead. Depends on nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence


def strongly_connected(successors: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the strongly connected parts, each sorted; a part comes after those it leads to.

    Tarjan's algorithm (1972) with the recursion turned into a stack of (node, next successor).
    """
    unseen = -1
    index = [unseen] * len(successors)
    low = [0] * len(successors)
    waiting: list[int] = []  # visited, part not yet known
    is_waiting = [False] * len(successors)
    parts: list[list[int]] = []
    visited = 0
    for root in range(len(successors)):
        if index[root] != unseen:
            continue
        path = [(root, 0)]
        while path:
            node, position = path.pop()
            if position == 0:
                index[node] = low[node] = visited
                visited += 1
                waiting.append(node)
                is_waiting[node] = True
            following = successors[node]
            while position < len(following):
                successor = following[position]
                position += 1
                if index[successor] == unseen:
                    path.append((node, position))
                    path.append((successor, 0))
                    break
                if is_waiting[successor]:
                    low[node] = min(low[node], index[successor])
            else:
                if low[node] == index[node]:
                    part: list[int] = []
                    while not part or part[-1] != node:
                        part.append(waiting.pop())
                        is_waiting[part[-1]] = False
                    parts.append(sorted(part))
                if path:
                    parent = path[-1][0]
                    low[parent] = min(low[parent], low[node])
    return parts


def rings(successors: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the parts in which something can go round, in order of their first node."""
    if _is_acyclic(successors):  # as most graphs are, and this test costs a third
        return []
    found = [part for part in strongly_connected(successors) if len(part) > 1 or part[0] in successors[part[0]]]
    return sorted(found)


def _is_acyclic(successors: Sequence[Sequence[int]]) -> bool:
    """Return whether taking away what nothing leads to, again and again, takes all (Kahn, 1962)."""
    leading = [0] * len(successors)
    for following in successors:
        for successor in following:
            leading[successor] += 1
    free = [node for node, number in enumerate(leading) if not number]
    for node in free:  # it grows on the way
        for successor in successors[node]:
            leading[successor] -= 1
            if not leading[successor]:
                free.append(successor)
    return len(free) == len(successors)


def shortest_ring(part: Sequence[int], successors: Sequence[Sequence[int]]) -> list[int]:
    """Return the nodes of a shortest cycle through the first node of a strongly connected part, beginning with it."""
    start, inside = part[0], set(part)
    came_from: dict[int, int] = {}
    queue = deque([start])
    while queue:
        node = queue.popleft()
        for successor in successors[node]:
            if successor == start:
                ring = [node]
                while ring[-1] != start:
                    ring.append(came_from[ring[-1]])
                return ring[::-1]
            if successor in inside and successor not in came_from:
                came_from[successor] = node
                queue.append(successor)
    raise ValueError("no cycle: the part is not strongly connected")

"""Rings in directed graphs."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.graph.flat.order import rings, shortest_ring, strongly_connected


def test_parts_of_a_small_graph() -> None:
    successors = [[1], [2], [0, 3], [4], [4], []]
    assert sorted(strongly_connected(successors)) == [[0, 1, 2], [3], [4], [5]]
    assert rings(successors) == [[0, 1, 2], [4]]


def test_long_chains_and_rings_do_not_recurse() -> None:
    chain = [[index + 1] for index in range(20_000)] + [[]]
    assert rings(chain) == []
    ring = [*chain[:-1], [0]]
    assert rings(ring) == [list(range(20_001))]
    assert shortest_ring(rings(ring)[0], ring) == list(range(20_001))


def test_shortest_ring_of_several() -> None:
    assert shortest_ring([0, 1, 2], [[1, 2], [2], [0]]) == [0, 2]
    assert shortest_ring([0], [[0]]) == [0]


@st.composite
def graphs(draw: st.DrawFn) -> list[list[int]]:
    size = draw(st.integers(1, 12))
    return [draw(st.lists(st.integers(0, size - 1), max_size=4)) for _ in range(size)]


def reachable(successors: list[list[int]], start: int) -> set[int]:
    """What lies behind `start`, itself only if a ring leads back."""
    found: set[int] = set()
    waiting = list(successors[start])
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting += successors[node]
    return found


@pytest.mark.slow
@given(graphs())
def test_nodes_of_one_part_reach_each_other_and_nobody_else_back(successors: list[list[int]]) -> None:
    behind = [reachable(successors, node) for node in range(len(successors))]
    parts = strongly_connected(successors)
    assert sorted(node for part in parts for node in part) == list(range(len(successors)))
    part_of = {node: number for number, part in enumerate(parts) for node in part}
    for first in range(len(successors)):
        for second in range(len(successors)):
            mutual = first == second or (second in behind[first] and first in behind[second])
            assert (part_of[first] == part_of[second]) == mutual
    assert sorted(node for part in rings(successors) for node in part) == [
        node for node in range(len(successors)) if node in behind[node]
    ]


@pytest.mark.slow
@given(graphs())
def test_shortest_ring_is_a_ring(successors: list[list[int]]) -> None:
    for part in rings(successors):
        ring = shortest_ring(part, successors)
        assert len(set(ring)) == len(ring)
        assert all(after in successors[node] for node, after in zip(ring, [*ring[1:], ring[0]], strict=True))

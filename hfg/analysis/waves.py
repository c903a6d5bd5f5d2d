"""What one source causes: which nodes do something, how often, and which of it is one piece of work of a group.

A *wave* is what follows from one firing without leaving the processor. Where an edge leads to another processor, or
where several waves meet, another wave begins, at the latest when all before it are over. Depends on the flat graph.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from hfg.graph.flat import FlatEdge, FlatGraph, FlatNode
from hfg.graph.flat.order import strongly_connected
from hfg.ports.automatic import AUTOMATIC_SLOTS

__all__ = ["Reach", "Wave", "reach_of"]

_MOST_TIMES: Final = 10**12  # that a node does something because of one firing; more is as good as without end


@dataclass(eq=False)
class Wave:
    """A piece of work.

    Attributes:
      source: where it comes from.
      processor: where it is done.
      nodes: what is done in it, in order, each with how often.
      before: the waves that start it.
      in_order: it is one piece of work: nothing in it comes from an event, and so might have to wait for others.
      response_s: a bound for its end, counted from when the source is due.
    """

    source: FlatNode
    processor: str
    nodes: list[tuple[FlatNode, int]] = field(default_factory=list)
    before: list[Wave] = field(default_factory=list)
    in_order: bool = True
    response_s: float = 0.0

    @property
    def begins_s(self) -> float:
        """How much later than the source is due it can begin."""
        return max((wave.response_s for wave in self.before), default=0.0)


@dataclass(eq=False)
class Reach:
    """What a source causes.

    Attributes:
      into: by index of each node that is reached, the edges by which something comes.
      has_rings: whether something can go round, of which one round is counted.
    """

    waves: list[Wave]
    into: dict[int, list[FlatEdge]]
    has_rings: bool


def reach_of(
    flat: FlatGraph,
    source: FlatNode,
    edges_from: Sequence[Sequence[FlatEdge]],
    processor_of: Callable[[FlatNode], str],
) -> Reach:
    """Follow what one firing of a source causes.

    Args:
      flat: the graph.
      source: a source.
      edges_from: the edges between nodes, by index of the node where they begin.
      processor_of: returns with what a node shares its time.
    """
    order = _order(source.index, edges_from)
    place = {index: number for number, index in enumerate(order)}
    into: dict[int, list[FlatEdge]] = {index: [] for index in order}
    has_rings = False
    for index in order:
        for edge in edges_from[index]:
            is_onward = place[edge.target.node] > place[index]
            has_rings |= not is_onward
            if is_onward:
                into[edge.target.node].append(edge)
    times = _times(source.index, order, into)
    waves = _waves([flat.nodes[index] for index in order], into, times, processor_of)
    return Reach(waves, into, has_rings)


def _order(begin: int, edges_from: Sequence[Sequence[FlatEdge]]) -> list[int]:
    """Return what is reached: nodes after those that lead to them, inside a ring by how soon they are reached."""
    soon = {begin: 0}
    waiting = deque([begin])
    while waiting:
        for edge in edges_from[waiting.popleft()]:
            if edge.target.node not in soon:
                soon[edge.target.node] = len(soon)
                waiting.append(edge.target.node)
    reached = list(soon)  # there may be as many sources as nodes, so nothing else is looked at
    parts = strongly_connected([[soon[edge.target.node] for edge in edges_from[index]] for index in reached])
    return [reached[number] for part in reversed(parts) for number in sorted(part)]


def _times(begin: int, order: Sequence[int], into: dict[int, list[FlatEdge]]) -> dict[int, tuple[int, int]]:
    """Return how often each node fires and is called at most.

    A firing takes a token from every input, so there are no more than the input with the fewest has; each signal on a
    slot is a call.
    """
    found = {begin: (1, 0)}
    for index in order:
        if index == begin:
            continue
        fires, calls = math.inf, 0
        for edge in into[index]:
            sent = sum(found[edge.source.node]) if edge.is_event_edge else found[edge.source.node][0]
            if edge.target.kind == "input":
                fires = min(fires, sent)
            elif edge.target.kind == "slot" and edge.target.name not in AUTOMATIC_SLOTS:
                calls += sent
        found[index] = (0 if fires == math.inf else int(min(fires, _MOST_TIMES)), min(calls, _MOST_TIMES))
    return found


def _waves(
    nodes: Sequence[FlatNode],
    into: dict[int, list[FlatEdge]],
    times: dict[int, tuple[int, int]],
    processor_of: Callable[[FlatNode], str],
) -> list[Wave]:
    home: dict[int, Wave] = {}
    waves: list[Wave] = []
    for node in nodes:
        before = list(dict.fromkeys(home[edge.source.node] for edge in into[node.index]))
        processor = processor_of(node)
        if len(before) == 1 and before[0].processor == processor:
            wave = before[0]
            wave.in_order &= not any(edge.is_event_edge or edge.options.initial for edge in into[node.index])
        else:
            wave = Wave(nodes[0], processor, before=before)
            waves.append(wave)
        home[node.index] = wave
        wave.nodes.append((node, sum(times[node.index])))
    return waves

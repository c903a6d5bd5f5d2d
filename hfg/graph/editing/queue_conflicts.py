"""Refuses to move a boundary if that would change the queue of an edge (rule G1).

An edge through subgraphs consists of several declared edges, and the outermost one decides how its queue is; among
several, the one nearest to the source. As long as no edge enters a subgraph and leaves it again, exactly one is
outermost, wherever boundaries are. An edge that does so has two outermost ones, and a boundary around the first of
them would let the second decide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from hfg.errors import GraphError
from hfg.graph.structure.edge import Edge
from hfg.graph.structure.joining import outermost
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.option import written
from hfg.graph.structure.options import EdgeOptions
from hfg.ports import InnerSource, InnerTarget, Port


def refuse_other_queues(
    level: Level,
    outwards: Iterable[tuple[Edge, EdgeOptions]],
    is_at_border: Callable[[Edge], bool],
    what: str,
) -> None:
    """Refuse a boundary that would change a queue when it is made or removed.

    Args:
      level: the level of the edges.
      outwards: the edges that cross the boundary outwards, with the options that apply outside.
      is_at_border: returns whether an edge of this level crosses the boundary.
      what: "grouping" or "dissolving".

    Raises:
      GraphError: an edge that leads directly into one of them has another queue.
    """
    for edge, options in outwards:
        for first in _origins(level, edge, is_at_border):
            if outermost(first.options) == outermost(options):
                continue
            raise GraphError(
                f"{what} would change the queue of {first.label}, which runs through a subgraph and on as "
                f"{edge.label}: one has {_said(first.options)}, the other {_said(options)}, and the outer of the two "
                "holds (rule G1); give both the same"
            )


def _origins(level: Level, edge: Edge, is_at_border: Callable[[Edge], bool]) -> Iterator[Edge]:
    """Yield the edges of this level that lead directly into an edge through subgraphs, not the edge itself."""
    stack, met = [edge], {edge}
    while stack:
        one = stack.pop()
        before = list(_before(level, one))
        if not before and one is not edge:
            yield one
        for other in before:
            if other not in met and not is_at_border(other):
                met.add(other)
                stack.append(other)


def _before(level: Level, edge: Edge) -> Iterator[Edge]:
    """Yield the edges of a level that continue as this one, after a subgraph that they run directly through."""
    port = edge.source
    within = inside(port.node) if isinstance(port, Port) and port.kind == "event" else None
    if within is not None:
        entries = _entries(within, port)
        yield from (one for one in level.connections.at(port.node) if one.target in entries)


def _entries(within: Level, port: Port) -> list[Port]:
    """Return the ports of a subgraph from which edges run directly to one of its events."""
    own = within.connections.at(port.node)
    stack = [one for one in own if isinstance(one.target, InnerTarget) and one.target.outer is port]
    found: list[Port] = []
    while stack:
        one = stack.pop()
        if isinstance(one.source, InnerSource):
            found.append(one.source.outer)
        else:
            stack += _before(within, one)
    return found


def _said(options: EdgeOptions) -> str:
    return ", ".join(written(name, value) for name, value in outermost(options).items() if value is not None)

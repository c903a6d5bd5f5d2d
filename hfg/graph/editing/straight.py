"""Edges that run straight through subgraphs, in at one port and out at another, and whose queue they have (rule G1).

Of the edges that one consists of the outermost says how its queue is, among several the one nearest to the source. As
long as no edge runs straight through a subgraph there is one that is outermost, wherever borders are drawn. One that
does has two, and a border around the first of them alone would let the other one have its say. Stands on levels.
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

__all__ = ["refuse_other_queues"]


def refuse_other_queues(
    level: Level,
    outwards: Iterable[tuple[Edge, EdgeOptions]],
    is_at_border: Callable[[Edge], bool],
    what: str,
) -> None:
    """Refuse a border that would change whose queue it is, being drawn or taken away.

    Args:
      level: where the edges lie.
      outwards: those that cross the border outwards, and the options that hold outside.
      is_at_border: whether an edge of this level crosses the border.
      what: "grouping" or "dissolving".

    Raises:
      GraphError: an edge that leads straight into one of them has another queue.
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
    """Give the edges of this level at which begins what leads straight into one; not that itself."""
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
    """Give the edges of a level that go on as this one, behind a subgraph that they run straight through."""
    port = edge.source
    within = inside(port.node) if isinstance(port, Port) and port.kind == "event" else None
    if within is not None:
        entries = _entries(within, port)
        yield from (one for one in level.connections.at(port.node) if one.target in entries)


def _entries(within: Level, port: Port) -> list[Port]:
    """Give the ports of a subgraph from which edges run straight to one of its events."""
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

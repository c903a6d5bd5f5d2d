"""Where everything of a drawing goes: states in rows by their active edges, data in lanes next to them.

wiring     what lies at a level, and what leads where     parts      that, while it is placed
blocks     sizes of nodes, places of ports                placing    rows and lanes
grid       the plane in strips                            routing    through which of them each line runs
tracks     where in them                                  laying     all of it for one level
finishing  the result as plain data (`model`)

It is written here because no library of pure Python has ports on all four sides, boxes inside of boxes and an order by
some of the edges: grandalf and networkx place points. ELK's layered layout was tried with all edges in both directions:
it cuts the circles of mission and data at the wrong places, whatever the priorities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec.structs import replace

from hfg.graph.drawing.layout.finishing import lines_of, node_of
from hfg.graph.drawing.layout.laying import lay
from hfg.graph.drawing.layout.overview import feeders, take_out
from hfg.graph.drawing.layout.parts import Work
from hfg.graph.drawing.layout.wiring import Level, Levels, wired
from hfg.graph.drawing.model import Layout, Line, NodeBox
from hfg.graph.drawing.picture import picture
from hfg.graph.drawing.seen import EVERYTHING, Kind, Picture, View
from hfg.graph.structure.level import HasLevel

__all__ = ["lay_out"]

_PAD = 20.0  # between the border of an open subgraph and what is in it


def lay_out(graph: HasLevel, view: View = EVERYTHING) -> Layout:
    """Say where everything of a graph goes.

    Args:
      graph: the graph, or the inside of a subgraph.
      view: what is to be seen of it, and what the user has put in its place.

    Returns:
      All nodes and lines with their places. Equal graphs give equal layouts.
    """
    seen = picture(graph, view)
    if view.kind == "activity" and (opened := feeders(seen)):
        seen = picture(graph, replace(view, opened=opened))
        take_out(seen, opened)
    known = Levels(seen)
    found = known.all
    works: dict[int, tuple[Work, Kind]] = {}
    inner: dict[str, tuple[float, float]] = {}
    nets = 0  # each level counts its own
    for level in reversed(found):  # the inside of a subgraph says how large that is
        kind = view.kind or _usual(level, known)
        work = wired(level, known, view, kind)
        lay(work, view if level.box is None else View(measured=view.measured), kind, inner)
        for link in work.links:
            link.net += nets
        nets += 2 * len(work.links)
        works[id(level)] = work, kind
        if level.box is not None:
            work.box = level.box.id
            inner[level.box.id] = work.width, work.height
    return _drawn(seen, [works[id(level)] for level in found], inner)


def _drawn(seen: Picture, works: Sequence[tuple[Work, Kind]], inner: Mapping[str, tuple[float, float]]) -> Layout:
    """Put each level into its subgraph, and return all of it as data."""
    nodes: list[NodeBox] = []
    lines: list[Line] = []
    places: dict[str, tuple[float, float]] = {}
    for work, kind in works:
        work.move(*places.get(work.box, (0.0, 0.0)))
        for thing in work.things:
            nodes.append(node_of(thing, has_rows=work.has_rows, has_ports=kind != "activity"))
            if thing.shape.look == "box":
                places[thing.shape.id] = thing.x + _PAD, thing.y + thing.height - inner[thing.shape.id][1] - _PAD
        lines += lines_of(work)
    lines.sort(key=lambda line: (line.is_active, line.kind == "signal"))
    shown = {edge.label for line in lines for edge in line.edges}
    hidden = sum(not arrow.is_gate and " -> ".join(arrow.ends) not in shown for arrow in seen.arrows)
    root, kind = works[0]
    return Layout(seen.title, kind, root.width, root.height, tuple(nodes), tuple(lines), tuple(seen.groups), hidden)


def _usual(level: Level, known: Levels) -> Kind:
    """Choose the view in which a level is clearest."""
    inner = {shape.id for shape in level.shapes}
    for arrow in level.arrows:
        ends = [known.seen_as(end, level) for end in (arrow.tail, arrow.head)]
        if arrow.is_active and inner.issuperset(ends):
            return "mission"
    return "all"

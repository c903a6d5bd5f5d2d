"""The drawings of a page: the graph, and the states of its activity. Depends on the drawing and the analysis."""

from __future__ import annotations

from typing import Final

from hfg.analysis import ActivityReport, analyse_activity
from hfg.errors import HfgError
from hfg.graph import Graph
from hfg.graph.drawing.picture import picture

_MOST_DRAWN: Final = 600  # nodes; in a larger graph, subgraphs are collapsed
_MOST_STATES: Final = 2_000  # of a region: what a page says must not hold a run up


class Drawn:
    """A graph as it is now, drawn with no node active.

    Attributes:
      graph: the drawing, "" if the graph is too large.
      states: the state diagram, "" if no activity moves.
      said: what is proved of the states.
      left_out: what the drawings leave out.
    """

    def __init__(self, graph: Graph) -> None:
        self.left_out: list[str] = []
        self.graph = self._drawing(graph)
        self.said: list[str] = []
        self.states = self._states(graph)

    def _drawing(self, graph: Graph) -> str:
        nodes = [one for _, one in picture(graph).items if one.look == "node"]
        if len(nodes) <= _MOST_DRAWN:
            return graph.draw(format="svg", active=())
        top = sum(1 for _ in graph.nodes)
        if top > _MOST_DRAWN:
            self.left_out.append(f"the drawing, because the graph has {top:,} nodes; graph.draw makes it")
            return ""
        self.left_out.append(f"the insides of subgraphs, because there are {len(nodes):,} nodes in all")
        return graph.draw(format="svg", depth=0, active=())

    def _states(self, graph: Graph) -> str:
        try:
            report = analyse_activity(graph, max_states=_MOST_STATES)
        except HfgError as error:
            self.left_out.append(f"the states: {error}")
            return ""
        diagram = report.diagram()
        if not diagram.states:
            return ""
        if len(diagram.states) > _MOST_DRAWN:
            self.left_out.append(f"the states, because there are {len(diagram.states):,}")
            return ""
        self.said += _proved(report)
        return diagram.graph().draw(format="svg", view="activity", active=())


def _proved(report: ActivityReport) -> list[str]:
    """Say of each part of the graph how many of its nodes are active."""
    found = []
    for region in report.regions:
        best = region.exactly_one if region.exactly_one.holds else region.at_most_one
        found.append(str(best))
    return found

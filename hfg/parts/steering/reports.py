"""The report of a whole run, made of the reports of its parts. Pure functions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar

import msgspec
from msgspec.structs import replace

from hfg.engine import Glance, Statistics
from hfg.engine.observing.report import EdgeReport, NodeReport, Report
from hfg.graph.flat import MAIN, CutEdge, Cutting, FlatGraph
from hfg.parts.model.messages import Closed

Reported = TypeVar("Reported")


class Counts(msgspec.Struct, frozen=True):
    """The last report of a part about itself.

    Attributes:
      nodes, edges, errors, lost_activity: as in `Report`.
      glance, statistics: if they were requested.
      clock_within_s: maximum difference of its clock from the run's.
      at: time of the report, on the clock of the main part.
    """

    nodes: dict[str, NodeReport]
    edges: dict[str, EdgeReport]
    errors: list[str]
    lost_activity: int
    glance: Glance | None = None
    statistics: Statistics | None = None
    clock_within_s: float = 0.0
    at: float = 0.0


def whole_report(
    report: Report, cutting: Cutting, found: Mapping[str, Counts | Closed], errors: Sequence[str]
) -> Report:
    """Return the report of the whole run.

    Args:
      report: of the main part.
      cutting: how the graph is cut.
      found: counts of the other parts, as far as they are known.
      errors: errors of and about the other parts.
    """
    nodes, edges = dict(report.nodes), dict(report.edges)
    halves: dict[str, Mapping[str, EdgeReport]] = {MAIN: report.edges}
    homes = {place: name for name, flat in cutting.parts.items() for place in _places(flat)}
    for name, counts in found.items():
        nodes |= _own(counts.nodes, homes, name)
        edges |= _own(counts.edges, homes, name)
        halves[name] = counts.edges
    for edge in cutting.edges:
        edges[edge.label] = _joined(edge, halves)
    order = [node.path for flat in cutting.parts.values() for node in flat.nodes]
    return replace(
        report,
        firings=sum(node.firings for node in nodes.values()),
        nodes={path: nodes[path] for path in order if path in nodes} | nodes,
        edges=edges,
        errors=[*report.errors, *errors],
        lost_activity=report.lost_activity + sum(counts.lost_activity for counts in found.values()),
        clocks={name: counts.clock_within_s for name, counts in found.items() if counts.clock_within_s},
    )


def _own(found: Mapping[str, Reported], homes: Mapping[str, str], part: str) -> dict[str, Reported]:
    """Return a part's report without items of other parts, but including items that belong to no part."""
    return {place: one for place, one in found.items() if homes.get(place, part) == part}


def _places(flat: FlatGraph) -> Iterator[str]:
    """Yield the places that a part may report: its nodes, by path, and its edges, by label."""
    for one in flat.walk():
        yield from (node.path for node in one.nodes)
        yield from (edge.label for edge in one.edges)


def _joined(edge: CutEdge, halves: Mapping[str, Mapping[str, EdgeReport]]) -> EdgeReport:
    """Return the counts of an edge, of which each side has one half."""
    nothing = EdgeReport(sent=0, dropped=0, drained=0, untaken=0, grown=0)
    source = halves.get(edge.source, {}).get(edge.label, nothing)
    target = halves.get(edge.target, {}).get(edge.label, nothing)
    return EdgeReport(
        sent=source.sent,
        dropped=source.dropped + target.dropped,
        drained=source.drained + target.drained,
        untaken=source.untaken if edge.guarantee == "exact" else target.untaken,
        grown=source.grown,
        lost=source.lost + target.lost,
    )

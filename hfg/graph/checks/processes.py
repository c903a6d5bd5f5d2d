"""What cannot be cut for processes: who is in several at once, and values that cannot cross (rules L1, L4, A11, G2)."""

from __future__ import annotations

from collections.abc import Iterator

from hfg.encoding import wire_problem
from hfg.errors import Failure
from hfg.graph.flat.cutting import MAIN, cut
from hfg.graph.flat.flat_graph import FlatGraph
from hfg.problem import Problem

__all__ = ["process_borders"]


def process_borders(flat: FlatGraph) -> Iterator[Problem]:
    """Find what two processes would have to share, and edges between them that are not for data."""
    if not any(group.process for group in flat.groups.values()):
        return
    cutting = cut(flat)
    yield from cutting.findings
    for edge in cutting.edges:
        if edge.hint is Failure:
            continue  # which is told as sentences, with what can cross of the values
        reason = wire_problem(edge.hint)
        if reason is not None:
            where = f'group "{edge.target}"' if edge.target != MAIN else "the main process"
            yield Problem(
                path=edge.edge.source.port.path,
                severity="error",
                what=f'its values cannot cross to {where} over "{edge.label}": {reason}',
                why="between processes values are data of a declared type (rule L4)",
                remedy="declare the type of the port, or let both nodes run in one group",
                check="process-border",
            )

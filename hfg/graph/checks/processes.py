"""What cannot be cut for processes: who is in several at once, and values that cannot cross (rules L1, L4, A11, G2)."""

from __future__ import annotations

from collections.abc import Iterator

from hfg.encoding import wire_problem
from hfg.errors import Failure, Problem
from hfg.graph.flat.cutting import MAIN, cut
from hfg.graph.flat.flat_graph import FlatGraph
from hfg.graph.flat.order import rings


def process_borders(flat: FlatGraph) -> Iterator[Problem]:
    """Find what two processes would have to share, and edges between them that are not for data."""
    if not any(group.process for group in flat.groups.values()):
        return
    cutting = cut(flat)
    yield from cutting.findings
    yield from _rings_across(flat, {edge.edge.index for edge in cutting.edges})
    for edge in cutting.edges:
        if edge.hint is Failure:
            continue  # it crosses as text, with those of its values that can cross
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


def _rings_across(flat: FlatGraph, crossing: set[int]) -> Iterator[Problem]:
    """Yield an error for each cycle of `wait` edges that crosses a link: no process sees all of it (rule F8)."""
    waiting = [
        edge
        for edge in flat.edges
        if edge.source.kind == "event"
        and edge.options.overflow == "wait"
        and min(edge.source.node, edge.target.node) >= 0
    ]
    successors: list[list[int]] = [[] for _ in flat.nodes]
    for edge in waiting:
        successors[edge.source.node].append(edge.target.node)
    for part in rings(successors):
        members = set(part)
        inside = (edge for edge in waiting if edge.source.node in members and edge.target.node in members)
        across = next((edge for edge in inside if edge.index in crossing), None)
        if across is not None:
            yield Problem(
                path=across.label,
                severity="error",
                what="a ring of edges whose queues wait leads through another process",
                why="if they all wait for each other, no process can see that its queues must grow (rule F8)",
                remedy='run all nodes of the ring in one group, or give an edge of it overflow="latest", '
                '"drop_oldest", "drop_newest" or "error"',
                check="process-border",
            )

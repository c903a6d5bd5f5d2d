"""Random plans whose nodes `start` makes active: where data overtook it, modifiers and what nodes see would differ."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

from hfg.testing.plans import EdgePlan, GraphPlan, NodePlan

__all__ = ["lit", "side_by_side"]

_LEFT_ALONE = ("listed", "EachOfEach", "Hums", "LastWord", "Clings")


def lit(plan: GraphPlan, seed: int) -> GraphPlan:
    """The same with `start` activating some of its nodes, and activity leaving them over some of its edges."""
    choose = random.Random(seed)
    begun = [node.name for node in plan.nodes if node.type not in _LEFT_ALONE and choose.random() < 0.7]
    edges = [
        replace(edge, options={**edge.options, "active": True})
        if edge.source[1] == "output" and edge.target[1] == "input" and choose.random() < 0.7
        else edge
        for edge in plan.edges
    ]
    start = [EdgePlan(("", "event", "start"), (name, "slot", "activate")) for name in begun]
    return replace(plan, edges=(*edges, *start))


def side_by_side(plans: Sequence[GraphPlan]) -> GraphPlan:
    """All of them as one graph without edges between them, so that one run in processes is one of each."""
    nodes: list[NodePlan] = []
    edges: list[EdgePlan] = []
    for number, plan in enumerate(plans):
        assert plan == GraphPlan(plan.nodes, plan.edges, library=plan.library), "only nodes and edges can be moved"

        def moved(end: tuple[str, str, str], number: int = number) -> tuple[str, str, str]:
            return (f"g{number}_{end[0]}" if end[0] else "", *end[1:])

        nodes += [replace(node, name=f"g{number}_{node.name}") for node in plan.nodes]
        edges += [replace(edge, source=moved(edge.source), target=moved(edge.target)) for edge in plan.edges]
    return GraphPlan(tuple(nodes), tuple(edges), library=plans[0].library)

"""Making a failing plan smaller: nodes, edges, boxes, gates and options are left out as long as it still fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from hfg.testing.plans import GraphPlan

__all__ = ["shrink"]


def shrink(plan: GraphPlan, fails: Callable[[GraphPlan], bool], *, attempts: int = 400) -> GraphPlan:
    """Give a smaller plan that fails too, after at most so many attempts.

    Args:
      plan: fails.
      fails: builds and runs a plan; an exception counts as not failing, for a smaller plan may not be buildable.
      attempts: how often `fails` is asked.
    """
    left = attempts

    def still_fails(smaller: GraphPlan) -> bool:
        nonlocal left
        left -= 1
        try:
            return fails(smaller)
        except Exception:
            return False

    again = True
    while again:
        again = False
        for smaller in _smaller(plan):
            if left <= 0:
                return plan
            if still_fails(smaller):
                plan, again = smaller, True
                break
    return plan


def _smaller(plan: GraphPlan) -> Iterator[GraphPlan]:
    if plan.boxes:
        yield plan.flat()
    for node in plan.nodes:
        yield plan.without(nodes=frozenset({node.name}))
    for index in range(len(plan.edges)):
        yield plan.without(edges=frozenset({index}))
    for gate in plan.gates:
        yield replace(plan, gates=tuple(one for one in plan.gates if one is not gate))
    for index, node in enumerate(plan.nodes):
        for name in node.options:
            options = {other: value for other, value in node.options.items() if other != name}
            yield _with_node(plan, index, options)
    for index, edge in enumerate(plan.edges):
        for name in edge.options:
            if name != "initial":
                options = {other: value for other, value in edge.options.items() if other != name}
                edges = list(plan.edges)
                edges[index] = replace(edge, options=options)
                yield replace(plan, edges=tuple(edges))
    for index, node in enumerate(plan.nodes):
        values = node.parameters.get("values")
        if values:
            nodes = list(plan.nodes)
            nodes[index] = replace(node, parameters={**node.parameters, "values": values[:-1]})
            yield replace(plan, nodes=tuple(nodes))


def _with_node(plan: GraphPlan, index: int, options: dict[str, object]) -> GraphPlan:
    nodes = list(plan.nodes)
    nodes[index] = replace(nodes[index], options=options)
    return replace(plan, nodes=tuple(nodes))

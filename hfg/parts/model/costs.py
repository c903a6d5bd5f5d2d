"""What the death of each process of a graph costs, for whoever checks it before it runs (rule L2).

Stands on `components`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hfg.graph import Graph
from hfg.graph.flat import cut, flatten
from hfg.parts.model.components import components
from hfg.parts.model.inheriting import keeping
from hfg.problem import Problem

__all__ = ["costs_of_deaths"]


def costs_of_deaths(graph: Graph) -> Iterator[Problem]:
    """Say for each connected part of each group with a process what a death costs, and what would avoid that."""
    cutting = cut(flatten(graph))
    kept = keeping(cutting)
    for part, found in components(cutting, kept).items():
        for component in found:
            what, why, remedy = component.in_words()
            if part in kept:
                what, why, remedy = "a death costs nothing", "the group has a ledger", ""
            nodes = ", ".join(component.nodes[:3]) + (
                f" and {len(component.nodes) - 3} more" * (len(component.nodes) > 3)
            )
            yield Problem(
                path=f'group "{part}": {nodes}',
                severity="hint",
                what=what,
                why=why,
                remedy=remedy,
                check="cost-of-death",
            )

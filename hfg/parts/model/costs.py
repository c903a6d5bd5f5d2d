"""The cost of the death of each process of a graph, for checks before it runs (rule L2).

Depends on `components`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from hfg.errors import Problem
from hfg.graph import Graph
from hfg.graph.flat import LINK, ROOT, Cutting, FlatGraph, FlatNode, cut, flatten
from hfg.parts.model.components import components
from hfg.parts.model.inheriting import keeping


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


def uncounted(cutting: Cutting, part: str, kept: Collection[str]) -> tuple[str, ...]:
    """Say what each death of a part may lose or repeat that no edge to another part counts, and how much at most.

    Args:
      cutting: of the graph.
      part: which one.
      kept: the parts with ledgers.
    """
    if part in kept:
        return ()
    flat = cutting.parts[part]
    costly = [one for one in components(cutting, kept)[part] if one.cost != "nothing"]
    paths = {path for one in costly for path in one.nodes}
    nodes = {node.index: node for node in flat.nodes if node.path in paths}
    sources = [one.source for one in costly if one.source]
    again = [f'source "{source}" started over, so its values are sent once more' for source in sources]
    return (*_lost_work(nodes), *_lost_tokens(flat, nodes), *_repeated_starts(flat), *again)


def _lost_work(nodes: Mapping[int, FlatNode]) -> Iterator[str]:
    if work := sum(node.options.concurrency for node in nodes.values()):
        yield f"up to {_many(work, 'firing or slot call', 'firings and slot calls')} in progress were lost with it"


def _lost_tokens(flat: FlatGraph, nodes: Collection[int]) -> Iterator[str]:
    own = (edge for edge in flat.edges if edge.source.node in nodes)
    inside = [edge for edge in own if edge.is_event_edge or edge.target.node != LINK]  # each of the others is counted
    if tokens := sum(edge.options.capacity if edge.is_event_edge else 1 + edge.options.buffer for edge in inside):
        of_what = "on its own edges, signals not sent yet among them, were lost with it; more if queues had grown"
        yield f"up to {_many(tokens, 'token', 'tokens')} {of_what}"


def _repeated_starts(flat: FlatGraph) -> Iterator[str]:
    if begun := sum(edge.source.node == ROOT and edge.source.name == "start" for edge in flat.edges):
        leaves = any(edge.active and edge.target.node == LINK for edge in flat.edges)
        again = ": activity that had left it may exist once more for each" if leaves else ""
        yield f"start was triggered in it again, with {_many(begun, 'signal', 'signals')}{again}"


def _many(count: int, one: str, more: str) -> str:
    return f"{count} {one if count == 1 else more}"

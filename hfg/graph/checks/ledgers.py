"""Groups with a ledger: what of their nodes and edges cannot be kept, so that another process could go on (rule L2)."""

from __future__ import annotations

from collections.abc import Iterator

from hfg.errors import Problem
from hfg.graph.flat.cutting import MAIN, cut
from hfg.graph.flat.flat_graph import LINK, ROOT, FlatEdge, FlatGraph, FlatNode, scope_end
from hfg.ports.automatic import AUTOMATIC_SLOTS


def kept_groups(flat: FlatGraph) -> Iterator[Problem]:
    """Find what a ledger cannot keep of the groups that have one."""
    if not any(group.ledger for group in flat.groups.values()):
        return
    for name, part in cut(flat).parts.items():
        if name != MAIN and part.groups[name].ledger:
            for node in part.nodes:
                yield from _of_node(name, node)
            for edge in part.edges:
                yield from _of_edge(name, edge)
            for gate in part.gates:
                path = part.nodes[gate.target].path if gate.target >= 0 else part.scopes[scope_end(gate.target)].path
                yield _wrong(name, path, "it is gated, and activity is not kept", "take the gate away")


def _of_node(group: str, node: FlatNode) -> Iterator[Problem]:
    options = node.options
    if node.node._type.process_kind in ("generator", "async generator"):
        yield _wrong(
            group,
            node.path,
            "it is a generator, and how far that has got cannot be kept",
            "write it as a class with process() and hfg.State, which raises hfg.EndOfStream at its end",
        )
    if node.iteration is not None:
        yield _wrong(group, node.path, "it iterates, and what is inside is not kept", "let it run in another group")
    if options.concurrency > 1:
        yield _wrong(
            group, node.path, f"concurrency={options.concurrency}, and there may be no moment between its firings"
        )
    if options.on_error in ("disable", "restart"):
        yield _wrong(
            group,
            node.path,
            f'on_error="{options.on_error}", and whether it is disabled is not kept',
            'use on_error="skip" or "stop"',
        )
    if not options.enabled:
        yield _wrong(group, node.path, "enabled=False, and whether it is disabled is not kept")
    if options.active_for_s is not None:
        yield _wrong(group, node.path, "active_for_s is said, and activity is not kept")
    if "do" in node.node._type.hooks:
        yield _wrong(group, node.path, "it has a do-activity, and activity is not kept")


def _of_edge(group: str, edge: FlatEdge) -> Iterator[Problem]:
    path = edge.label
    if edge.active:
        yield _wrong(group, path, "the edge is active, and activity is not kept", "leave active= out")
    if edge.options.through and edge.source.node != LINK:
        yield _wrong(
            group,
            path,
            "it has operators, and what they hold is not kept",
            "let the node before them run in another group",
        )
    if edge.target.kind == "parameter":
        yield _wrong(
            group, path, "it leads into a parameter, and the values of parameters are not kept", "use an input"
        )
    if edge.target.kind == "slot" and edge.target.node not in (ROOT, LINK) and edge.target.name in AUTOMATIC_SLOTS:
        yield _wrong(group, path, f'it leads into "{edge.target.name}", and what that does is not kept')
    if edge.source.node == ROOT and edge.source.kind == "event":
        yield _wrong(
            group, path, "it leads away from start, which is triggered in each life of a process", "begin in setup()"
        )
    if edge.source.kind == "observable":
        yield _wrong(group, path, "an observable feeds it, which nobody can ask where it goes on")
    if edge.options.initial and edge.source.node == LINK:
        yield _wrong(
            group, path, "it comes from another process with initial values", "give them to an edge within the group"
        )


def _wrong(group: str, path: str, what: str, remedy: str = "leave that out") -> Problem:
    return Problem(
        path=path,
        severity="error",
        what=f'group "{group}" has a ledger, but {what}',
        why="what a process has done is kept as the state of its nodes and its places on edges (rule L2)",
        remedy=f'{remedy}, or take ledger= from group "{group}"',
        check="ledger",
    )

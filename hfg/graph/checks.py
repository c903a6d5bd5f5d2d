"""What only the whole shows: one pure function for each check, all over the flat graph.

An error keeps the graph from running as its structure says; a warning is told and the graph runs. Stands on `flat` and
`order`.
"""

from __future__ import annotations

import builtins
import inspect
import types
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final

from hfg.graph.boxes import is_box
from hfg.graph.edges import Edge
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, flatten
from hfg.graph.naming import suggest
from hfg.graph.options import NodeOptions
from hfg.graph.order import rings, shortest_ring
from hfg.graph.structure import Graph
from hfg.nodetype import Node
from hfg.ports import ParameterPort
from hfg.problem import Problem

__all__ = [
    "borders",
    "check",
    "check_flat",
    "endless_sources",
    "joined_edges",
    "runs_for_ever",
    "signal_rings",
    "synchronous_rings",
    "unconnected_inputs",
    "unknown_groups",
]


def check(graph: Graph) -> list[Problem]:
    """Check a whole graph; errors first."""
    return check_flat(flatten(graph))


def check_flat(flat: FlatGraph) -> list[Problem]:
    """Check a graph that is flattened already; errors first."""
    problems = list(flat.findings)
    for one in flat.walk():
        for look in _CHECKS:
            problems += look(one)
    problems += _names(flat)
    problems += _promotions(flat)
    return sorted(problems, key=lambda problem: problem.severity != "error")


# --- errors ---


def unknown_groups(flat: FlatGraph) -> Iterator[Problem]:
    """Nodes in groups that nobody declared."""
    for path, node, options in _members(flat):
        group = options.group
        # Told where the group is named, not again for all that inherit it.
        if group is not None and group not in flat.groups and node._options.group is not None:
            yield Problem(
                path=path,
                severity="error",
                what=f'its group "{group}" is not declared',
                why=suggest(group, flat.groups),
                remedy=f'declare it with graph.group("{group}", threads=1), or correct the name',
            )


def _members(flat: FlatGraph) -> Iterator[tuple[str, Node, NodeOptions]]:
    """Give path, node and options of nodes and dissolved subgraphs."""
    for item in flat.nodes:
        yield item.path, item.node, item.options
    for scope in flat.scopes:
        yield scope.path, scope.subgraph, scope.options


def joined_edges(flat: FlatGraph) -> Iterator[Problem]:
    """What the parts of an edge through subgraphs say must fit the whole edge (rules P2, P4, P7)."""
    into: dict[Any, FlatEdge] = {}
    pairs: dict[Any, FlatEdge] = {}
    for edge in flat.edges:
        kind = edge.target.kind
        if kind == "slot":
            first = pairs.setdefault((edge.source, edge.target), edge)
        else:
            first = into.setdefault(edge.target, edge)
        if first is not edge:
            yield _doubled(first, edge)
        if len(edge.segments) == 1:
            continue
        said = next((part for part in edge.segments if part.options.for_events), None)
        if said is not None and not edge.is_event_edge:
            yield Problem(
                path=edge.label,
                severity="error",
                what=f"{said.options.for_events} is said on {said.label}, a part of it",
                why="it comes from an output, and such an edge holds one token and no queue (rule P4)",
                remedy="leave it out, or send by an event",
            )
        if edge.initial and (kind == "slot" or (kind == "parameter" and edge.is_event_edge)):
            yield Problem(
                path=edge.label,
                severity="error",
                what="initial tokens lie on a part of it",
                why="initial tokens are for edges into inputs (rule P7)",
                remedy="leave out initial=[...], or connect to an input",
            )


def _doubled(first: FlatEdge, second: FlatEdge) -> Problem:
    if first.source is second.source:
        return Problem(
            path=second.label,
            severity="error",
            what="the same two ports are connected twice",
            why="through ports of subgraphs this is the same edge as another (rule P2)",
            remedy=f"remove one of {_parts(first)} and {_parts(second)}",
        )
    return Problem(
        path=second.label,
        severity="error",
        what=f"the target has an edge already, {first.label}",
        why="an input takes one edge, also through ports of subgraphs (rule P2)",
        remedy="connect to a slot, or to a node that joins the two",
    )


def _parts(edge: FlatEdge) -> str:
    return ", ".join(f'"{part.label}"' for part in edge.segments)


def synchronous_rings(flat: FlatGraph) -> Iterator[Problem]:
    """Cycles of synchronous edges without an initial token: each node waits for the one before it (rule P7)."""
    successors = _successors(flat, (edge for edge in flat.edges if not edge.is_event_edge))
    for part in rings(successors):
        ring = shortest_ring(part, successors)
        yield Problem(
            path=flat.nodes[ring[0]].path,
            severity="error",
            what=f"a ring of synchronous edges without initial tokens: {_circle(flat, ring)}",
            why="each of these nodes waits for the one before it, so none ever fires (rule P7)",
            remedy="put initial=[value] on one of the edges, or let one of them begin at an event",
        )


def borders(flat: FlatGraph) -> Iterator[Problem]:
    """What iterates has no sources inside and takes neither signals nor activity (rule G4)."""
    if flat.graph._owner is not None:
        path = flat.graph.path
        for node in flat.nodes:
            if node.node._type.is_source:
                yield _refused(
                    node.path,
                    f'a source inside of "{path}", which iterates',
                    "it would bring values of its own",
                    "move it outside",
                )
    for edge in flat.edges:
        target = flat.nodes[edge.target.node] if edge.target.node > ROOT else None
        iteration = None if target is None else target.iteration
        if iteration is None or edge.target.kind == "slot":
            continue
        path = iteration.graph.path
        if edge.active:
            yield _refused(
                edge.label,
                f'an active edge into "{path}", which iterates',
                "its inside is many rounds",
                "leave out active=True",
            )
        if edge.is_event_edge:
            yield _refused(
                edge.label,
                f'an event edge into "{path}", which iterates',
                "it takes collections",
                "let a node take the signals",
            )


def _refused(path: str, what: str, why: str, remedy: str) -> Problem:
    return Problem(
        path=path, severity="error", what=what, why=f"{why} (rule G4)", remedy=f"{remedy}, or take iterate_over out"
    )


# --- warnings ---


def unconnected_inputs(flat: FlatGraph) -> Iterator[Problem]:
    """Mandatory inputs that nothing leads to (rule F1)."""
    fed = {(edge.target.node, edge.target.name) for edge in flat.edges if edge.target.kind == "input"}
    for node in flat.nodes:
        if node.node._type.process_kind == "none" and node.iteration is None:
            continue
        for name, spec in node.node._type.inputs.items():
            if not spec.optional and (node.index, name) not in fed:
                yield Problem(
                    path=f"{node.path}.{name}",
                    severity="warning",
                    what="nothing leads to this input",
                    why="a node waits for every input that is not optional, so this one never fires (rule F1)",
                    remedy=f"connect it, or declare {name} as optional",
                )


def signal_rings(flat: FlatGraph) -> Iterator[Problem]:
    """Nodes that need a signal of which they are themselves the cause (rule P7)."""
    own = [edge for edge in flat.edges if not edge.is_event_edge or _needs_firing(edge)]
    successors = _successors(flat, own)
    begun_by_slot = {edge.target.node for edge in flat.edges if edge.target.kind == "slot"}
    synchronous = {
        node for part in rings(_successors(flat, (edge for edge in own if not edge.is_event_edge))) for node in part
    }
    for part in rings(successors):
        if begun_by_slot.isdisjoint(part) and synchronous.isdisjoint(part):
            ring = shortest_ring(part, successors)
            yield Problem(
                path=flat.nodes[ring[0]].path,
                severity="warning",
                what=f"a ring of edges that needs its own signal: {_circle(flat, ring)}",
                why="each of these nodes waits for the one before it, and nothing begins (rule P7)",
                remedy="put initial=[value] on one of the edges, or connect a slot that triggers the first signal",
            )


def _needs_firing(edge: FlatEdge) -> bool:
    """Whether the event is triggered by firings alone; activity, errors and time bring automatic events without one."""
    if edge.source.node < 0 or edge.source.kind != "event":
        return False
    return edge.source.name in edge.source.port.node._type.events or edge.source.name == "processed"


def endless_sources(flat: FlatGraph) -> Iterator[Problem]:
    """Sources that keep the loop busy for ever; only those of which it is certain (rule F2)."""
    held = {edge.target.node for edge in flat.edges if edge.target.kind == "parameter"}
    for node in flat.nodes:
        if node.options.max_rate_hz is None and node.index not in held and runs_for_ever(node.node):
            yield Problem(
                path=node.path,
                severity="warning",
                what="a source without a rate that never ends and waits for nothing",
                why="it fires as often as the machine can (rule F2)",
                remedy="add it with max_rate_hz=, raise hfg.EndOfStream, or write a generator",
            )


def runs_for_ever(node: Node) -> bool:
    """Say whether a source certainly never ends and never waits: a plain function that calls nothing which could.

    Only what its code shows counts; when in doubt the answer is no.
    """
    kind = node._type
    if not kind.is_source or kind.process_kind != "function" or "ready" in kind.hooks:
        return False
    function = getattr(kind.origin, "function", None)
    if not isinstance(function, types.FunctionType):
        return False
    names = inspect.getclosurevars(function)
    used = {**names.globals, **names.nonlocals}
    if names.unbound - set(dir(builtins)) and any(isinstance(one, types.ModuleType) for one in used.values()):
        return False  # a call of something in a module may wait or raise
    return not any(
        callable(one) or isinstance(one, types.ModuleType) or hasattr(type(one), "__dict__") for one in used.values()
    )


# --- over the whole ---


def _names(whole: FlatGraph) -> list[Problem]:
    """Types that no file or worker can find again; each told once."""
    found: dict[Any, tuple[str, int]] = {}
    for flat in whole.walk():
        for path, node, _ in _members(flat):
            first, count = found.get(node._type, (path, 0))
            found[node._type] = (first, count + 1)
    return [
        Problem(
            path=path,
            severity="warning",
            what=f'its type "{kind.name}" cannot be found by name'
            + (f", as for {count - 1} more nodes" if count > 1 else ""),
            why="files, workers and reload make nodes again from module and name",
            remedy="define it at the top of a module, not in a function or as a lambda",
        )
        for kind, (path, count) in found.items()
        if kind.reference is None
    ]


def _promotions(whole: FlatGraph) -> list[Problem]:
    """Edges to or from parameters of subgraphs that stand for nothing inside, and so are no edges (rule G1)."""
    problems = []
    for edge in _all_edges(whole):
        for port in (edge.source, edge.target):
            if not isinstance(port, ParameterPort) or not is_box(port.node):
                continue
            if port.name not in port.node._graph._promoted:
                problems.append(
                    Problem(
                        path=port.path,
                        severity="warning",
                        what="an edge leads to or from this parameter, which stands for none inside",
                        why="a port of a subgraph only passes on, so the edge has no effect (rule G1)",
                        remedy=f"call graph.promote(self.{port.name}, ...) in build(), or remove the edge",
                    )
                )
    return problems


def _all_edges(whole: FlatGraph) -> Iterator[Edge]:
    for flat in whole.walk():
        yield from flat.graph.edges
        for scope in flat.scopes:
            yield from scope.subgraph._graph.edges


def _successors(flat: FlatGraph, edges: Iterable[FlatEdge]) -> list[list[int]]:
    """Give the nodes that wait for each node; what holds an initial token, or leads into a slot, holds nobody up."""
    successors: list[list[int]] = [[] for _ in flat.nodes]
    for edge in edges:
        source, target = edge.source.node, edge.target.node
        joins = edge.target.kind == "input" or (edge.target.kind == "parameter" and not edge.is_event_edge)
        if source > ROOT and target > ROOT and joins and not edge.initial:
            successors[source].append(target)
    return successors


def _circle(flat: FlatGraph, ring: list[int]) -> str:
    paths = [flat.nodes[index].path for index in ring]
    shown = paths if len(paths) <= 8 else [*paths[:6], f"{len(paths) - 7} more", paths[-1]]
    return " -> ".join([*shown, paths[0]])


_CHECKS: Final[tuple[Callable[[FlatGraph], Iterator[Problem]], ...]] = (
    unknown_groups,
    joined_edges,
    synchronous_rings,
    borders,
    unconnected_inputs,
    signal_rings,
    endless_sources,
)

"""Checks of what the parts of an edge through subgraphs make together, and of the borders of what iterates (P2-P7, G).

Depends on `flat`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hfg.errors import Problem
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph
from hfg.graph.structure.edge import Edge, is_feed, type_of
from hfg.graph.structure.level import inside
from hfg.ports import ParameterPort
from hfg.types import describe, why_not


def joined_edges(flat: FlatGraph) -> Iterator[Problem]:
    """The options of each part of an edge through subgraphs must fit the whole edge (rules P2, P3, P4, P7)."""
    into: dict[object, FlatEdge] = {}
    pairs: dict[object, FlatEdge] = {}
    for edge in flat.edges:
        kind = edge.target.kind
        if kind == "slot":
            first = pairs.setdefault((edge.source, edge.target), edge)
        else:
            first = into.setdefault(edge.target, edge)
        if first is not edge:
            yield _doubled(first, edge)
        if len(edge.segments) > 1:
            yield from _mismatch(edge)
            yield from _options_of_parts(edge)


def _options_of_parts(edge: FlatEdge) -> Iterator[Problem]:
    """Options of a part that the whole edge cannot have."""
    kind = edge.target.kind
    said = next((part for part in edge.segments if part.options.first_said("events")), None)
    if said is not None and not edge.is_event_edge:
        yield Problem(
            path=edge.label,
            severity="error",
            what=f"{said.options.first_said('events')} is set on {said.label}, a part of it",
            why="it comes from an output, and such an edge holds one token and no queue (rule P4)",
            remedy="leave it out, or send by an event",
            check="queue-on-data",
        )
    buffered = next((part for part in edge.segments if part.options.buffer), None)
    if buffered is not None and (edge.is_event_edge or kind == "slot"):
        yield Problem(
            path=edge.label,
            severity="error",
            what=f"buffer={buffered.options.buffer} is set on {buffered.label}, a part of it",
            why="it leads into a slot or comes from an event, and a buffer is for data into an input (rule P4)",
            remedy="leave it out, or send by an event and say capacity=",
            check="buffer-without-join",
        )
    if edge.options.initial and (kind == "slot" or (kind == "parameter" and edge.is_event_edge)):
        yield Problem(
            path=edge.label,
            severity="error",
            what="initial tokens lie on a part of it",
            why="initial tokens are for edges into inputs (rule P7)",
            remedy="leave out initial=[...], or connect to an input",
            check="initial-before-slot",
        )


def _mismatch(edge: FlatEdge) -> Iterator[Problem]:
    """Each part fits its neighbours, as a relay of type Any does, and yet the ends do not fit each other."""
    source, target = edge.source.port, edge.target.port
    if edge.options.through or is_feed(source):
        return
    sent, taken = type_of(source), type_of(target)
    reason = why_not(sent, taken)
    if reason is not None:
        yield Problem(
            path=edge.label,
            severity="error",
            what=f"port types do not fit: {describe(sent)} is sent, {describe(taken)} is expected",
            why=f"through ports of subgraphs this is one edge (rules P3, G1): {reason}",
            remedy=f"put a node between them that converts; its parts are {_parts(edge)}",
            check="type-mismatch",
        )


def _doubled(first: FlatEdge, second: FlatEdge) -> Problem:
    if first.source is second.source:
        return Problem(
            path=second.label,
            severity="error",
            what="the same two ports are connected twice",
            why="through ports of subgraphs this is the same edge as another (rule P2)",
            remedy=f"remove one of {_parts(first)} and {_parts(second)}",
            check="doubled-edge",
        )
    return Problem(
        path=second.label,
        severity="error",
        what=f"the target has an edge already, {first.label}",
        why="an input takes one edge, also through ports of subgraphs (rule P2)",
        remedy="connect to a slot, or to a node that joins the two",
        check="doubled-edge",
    )


def _parts(edge: FlatEdge) -> str:
    return ", ".join(f'"{part.label}"' for part in edge.segments)


def borders(flat: FlatGraph) -> Iterator[Problem]:
    """An iterating subgraph has no sources inside and takes neither signals nor activity (rule G4)."""
    if flat.level.owner is not None:
        path = flat.level.path
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
        path = iteration.level.path
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
        path=path,
        severity="error",
        what=what,
        why=f"{why} (rule G4)",
        remedy=f"{remedy}, or take iterate_over out",
        check="iteration-border",
    )


def promotions(whole: FlatGraph) -> list[Problem]:
    """Edges to or from parameters of subgraphs that stand for nothing inside, so nothing is connected (rule G1)."""
    problems = []
    for edge in _all_edges(whole):
        for port in (edge.source, edge.target):
            inner = inside(port.node) if isinstance(port, ParameterPort) else None
            if inner is not None and not inner.promotions.of(port.name):
                problems.append(
                    Problem(
                        path=port.path,
                        severity="warning",
                        what="an edge leads to or from this parameter, which stands for none inside",
                        why="a port of a subgraph only passes on, so the edge has no effect (rule G1)",
                        remedy=f"call graph.promote(self.{port.name}, ...) in build(), or remove the edge",
                        check="idle-parameter",
                    )
                )
    return problems


def unseen_parameters(flat: FlatGraph) -> Iterator[Problem]:
    """Edges that lead through a subgraph into a parameter whose new values no code would see (rule P8)."""
    for edge in flat.edges:
        target = edge.target
        if target.kind == "parameter" and target.port.node._type.given_parameters_once:
            yield Problem(
                path=edge.label,
                severity="error",
                what="what this edge brings has no effect",
                why=f'"{target.port.path}" belongs to a generator function, which is given it once, when it begins '
                "(rule P8)",
                remedy=f"make it a class whose process() yields and reads self.{target.name}, or remove the edge",
                check="parameter-without-effect",
            )


def _all_edges(whole: FlatGraph) -> Iterator[Edge]:
    for flat in whole.walk():
        yield from flat.level.edges
        for scope in flat.scopes:
            inner = inside(scope.subgraph)
            yield from () if inner is None else inner.edges

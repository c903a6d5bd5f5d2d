"""Which parts of a cut graph an edit concerns, and which edits a run in several processes cannot follow (rules L1, R4).

Each edit takes effect in one part, at one moment, as in a graph in one process. Edges between parts stay unchanged:
both ends of a link would have to change at the same moment. Decides, never waits. Depends on graphs that are cut.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec

from hfg.errors import UsageError
from hfg.graph.editing.changes import Change, ParameterChange
from hfg.graph.flat import MAIN, CutEdge, Cutting, FlatEdge, FlatGraph, FlatNode
from hfg.parts.model.inheriting import inheriting, keeping


class Concern(NamedTuple):
    """The part that an edit concerns.

    Attributes:
      part: the part in which it takes effect; the main part for changes that only the drawing shows.
      reshapes: whether it changes more than values of parameters.
    """

    part: str
    reshapes: bool


def concerned(before: Cutting, after: Cutting, changes: Sequence[Change]) -> Concern:
    """Return the part that an edit concerns.

    Args:
      before: the running graph.
      after: the same with the changes.
      changes: of the edit.

    Raises:
      UsageError: it concerns several parts, or an edge between parts.
    """
    if after.findings:
        raise UsageError(f"the edit is refused because the graph could no longer be cut: {after.findings[0]}")
    _need_same_parts(before, after)
    _need_same_subgraphs(before, after)
    _need_same_names(before, after)
    _need_same_links(before, after)
    reshaped = {name for name in before.parts if _shape(before.parts[name]) != _shape(after.parts[name])}
    homes = {id(node.node): name for name, flat in after.parts.items() for node in _all_nodes(flat)}
    valued = {homes.get(id(change.node), MAIN) for change in changes if isinstance(change, ParameterChange)}
    parts = reshaped | valued
    if len(parts) > 1:
        raise UsageError(
            f"the edit concerns {_listed(parts)} at once, and several processes have no common moment: make "
            "one edit for each"
        )
    part = parts.pop() if parts else MAIN
    if part in reshaped and part in keeping(before):
        raise UsageError(
            f'group "{part}" has a ledger, in which nodes and edges have their places: its structure stays as it is '
            "while the graph runs; end the run and change the graph before the next one"
        )
    _need_same_promises(before, after)
    return Concern(part, part in reshaped)


def _need_same_parts(before: Cutting, after: Cutting) -> None:
    for name in before.parts.keys() - after.parts.keys():
        raise UsageError(
            f'group "{name}" would have no node left, and its process runs as long as the run: leave a node '
            "there, or end the run"
        )
    for name in after.parts.keys() - before.parts.keys():
        raise UsageError(
            f'group "{name}" has no process in this run because it had no node when the run started: put the '
            "node into another group, or end the run and change the graph before the next one"
        )


def _need_same_subgraphs(before: Cutting, after: Cutting) -> None:
    """Check that subgraphs are unchanged, because all parts derive the state of their own nodes from them (G2)."""
    was, will_be = (
        {one.path: (id(one.subgraph), one.options) for one in cutting.parts[MAIN].scopes} for cutting in (before, after)
    )
    for path in _others(was, will_be):
        raise UsageError(
            f'subgraph "{path}" is known to all processes, so it can neither come, go nor be another while the '
            "graph runs: edit what is inside of it, or end the run and change the graph before the next one"
        )


def _need_same_names(before: Cutting, after: Cutting) -> None:
    """Check that names are unchanged: code that observes or has set a node of another process knows it by its path."""
    for part, flat in before.parts.items():
        if part == MAIN:
            continue
        paths = {id(node.node): node.path for node in _all_nodes(flat)}
        for node in _all_nodes(after.parts[part]):
            path = paths.get(id(node.node), node.path)
            if path != node.path:
                raise UsageError(
                    f'"{path}" is known to other processes by its path, which stays as it is while the graph runs, so '
                    f'it cannot become "{node.path}": end the run and change the graph before the next one'
                )


def _need_same_links(before: Cutting, after: Cutting) -> None:
    was, will_be = ({edge.label: _link(edge) for edge in one.edges} for one in (before, after))
    for label in _others(was, will_be):
        raise UsageError(
            f'"{label}" leads from one process to another, and such edges cannot change while the graph runs: '
            "edit something within one process, or end the run and change the graph before the next one"
        )


def _need_same_promises(before: Cutting, after: Cutting) -> None:
    """Check that the handling of deaths is unchanged (rule L2).

    It was agreed on at the start of the run, and depends on the graph's shape.
    """
    for part in sorted(inheriting(before) ^ inheriting(after)):
        raise UsageError(
            f'the process of group "{part}" loses nothing when it dies as long as each incoming token yields '
            "exactly one on each leaving edge, and this edit would change that: preserve it, or end the run "
            "and change the graph before the next one"
        )


def _others(was: Mapping[str, Any], will_be: Mapping[str, Any]) -> list[str]:
    """Return what is added, removed, or changed."""
    return [name for name in {**was, **will_be} if was.get(name) != will_be.get(name)]


def _listed(parts: set[str]) -> str:
    named = [f'group "{name}"' for name in sorted(parts) if name != MAIN]
    return " and ".join([*named, *(["the main part"] if MAIN in parts else [])])


def _shape(flat: FlatGraph) -> tuple[Any, ...]:
    """Return the parts of a graph that matter to an engine that runs it."""
    names = [node.path for node in flat.nodes]
    scopes = [(one.path, one.options, [names[member] for member in one.members]) for one in flat.scopes if one.members]
    gates = [(_name(flat, gate.target), _name(flat, gate.by), gate.idle_rate_hz) for gate in flat.gates]
    nodes = [(id(node.node), node.path, node.options) for node in flat.nodes]
    inner = [_shape(node.iteration) for node in flat.nodes if node.iteration is not None]
    return nodes, [_edge(edge) for edge in flat.edges], scopes, sorted(gates, key=repr), inner


def _name(flat: FlatGraph, end: int) -> str:
    return flat.nodes[end].path if end >= 0 else f"subgraph {end}"


def _edge(edge: FlatEdge) -> tuple[Any, ...]:
    segments = tuple(map(id, edge.segments))
    held = msgspec.structs.replace(edge.options, through=(), initial=())
    return edge.label, segments, held, tuple(map(id, edge.options.through)), tuple(map(id, edge.options.initial))


def _link(edge: CutEdge) -> tuple[Any, ...]:
    return edge.source, edge.target, edge.guarantee, edge.window, _edge(edge.edge)


def _all_nodes(flat: FlatGraph) -> Iterator[FlatNode]:
    """Also those inside of nodes that iterate."""
    for node in flat.nodes:
        yield node
        for inner in node.iteration.walk() if node.iteration is not None else ():
            yield from inner.nodes

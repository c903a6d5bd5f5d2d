"""Checks of what flows: who waits forever, what goes round, what never comes (rules F1, F2, F8, P7, A9).

Depends on `flat` and `order`.
"""

from __future__ import annotations

import dis
from collections import deque
from collections.abc import Iterable, Iterator
from itertools import pairwise
from types import CodeType

from hfg.errors import Problem
from hfg.graph.checks.endless import endless
from hfg.graph.checks.nodes import codes_in, functions_of
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, scope_end
from hfg.graph.flat.order import rings, shortest_ring
from hfg.nodetypes.node import Node
from hfg.ports.automatic import sent_of


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
            check="data-ring",
        )


def unconnected_inputs(flat: FlatGraph) -> Iterator[Problem]:
    """Mandatory inputs that nothing leads to, and who stands still because of them (rules F1, F5)."""
    lonely = _lonely_inputs(flat)
    if not lonely:
        return
    waits, feeds = _data_neighbours(flat)
    for index, names in lonely.items():
        node = flat.nodes[index]
        behind = _reach(index, waits)
        before = [one for one in feeds[index] if one not in behind and one not in lonely]
        why = "a node waits for every input that is not optional, so this one never fires (rule F1)"
        if behind:
            why += f", nor does what waits for its tokens: {_some(flat, behind)}"
        if before:
            why += f"; its tokens are never taken, so this stands still: {_some(flat, before)}"
        for name in names:
            yield Problem(
                path=f"{node.path}.{name}",
                severity="warning",
                what="nothing leads to this input",
                why=why,
                remedy=f"connect it, or declare {name} as optional",
                check="unconnected-input",
            )


def unconnected_graph(flat: FlatGraph) -> Iterator[Problem]:
    """Several nodes, and no edge at all: the user has forgotten to connect them."""
    if len(flat.nodes) > 1 and not flat.edges and not flat.gates and flat.level.owner is None:
        if _lonely_inputs(flat) or all(node.node._type.process_kind == "none" for node in flat.nodes):
            return  # told of already: what they wait for, or that nothing leads to their slots
        yield Problem(
            path=flat.level.name,
            severity="warning",
            what=f"it has {len(flat.nodes)} nodes and no edge",
            why="so nothing goes from one to another (rule P1)",
            remedy="connect them, as in graph.connect(source.out, target.value)",
            check="unconnected-graph",
        )


def never_fires(flat: FlatGraph) -> set[int]:
    """Return the nodes that certainly never fire: without process function, or downstream of an unconnected input."""
    silent = {node.index for node in flat.nodes if node.node._type.process_kind == "none" and node.iteration is None}
    lonely = _lonely_inputs(flat)
    if lonely:
        waits, _ = _data_neighbours(flat)
        for index in lonely:
            silent.add(index)
            silent.update(_reach(index, waits))
    return silent


def _lonely_inputs(flat: FlatGraph) -> dict[int, list[str]]:
    """The mandatory inputs without an edge, by node."""
    fed = {(edge.target.node, edge.target.name) for edge in flat.edges if edge.target.kind == "input"}
    found: dict[int, list[str]] = {}
    for node in flat.nodes:
        if node.node._type.process_kind == "none" and node.iteration is None:
            continue
        for name, spec in node.node._type.inputs.items():
            if not spec.optional and (node.index, name) not in fed:
                found.setdefault(node.index, []).append(name)
    return found


def _data_neighbours(flat: FlatGraph) -> tuple[list[list[int]], list[list[int]]]:
    """Return the consumers of each node's outputs, and the producers of its inputs; of nodes that start enabled."""
    waits: list[list[int]] = [[] for _ in flat.nodes]
    feeds: list[list[int]] = [[] for _ in flat.nodes]
    for edge in flat.edges:
        source, target = edge.source.node, edge.target.node
        if edge.is_event_edge or source <= ROOT or target <= ROOT or edge.target.kind == "slot":
            continue
        if not (_begins_enabled(flat, source) and _begins_enabled(flat, target)):
            continue  # such an edge is not live, so its target does not wait for it
        feeds[target].append(source)
        if not edge.options.initial:
            waits[source].append(target)
    return waits, feeds


def _begins_enabled(flat: FlatGraph, index: int) -> bool:
    node = flat.nodes[index]
    return node.options.enabled and all(flat.scopes[scope].options.enabled for scope in node.scopes)


def _reach(start: int, successors: list[list[int]]) -> list[int]:
    """Return the nodes downstream of a node, the nearest first, without itself."""
    found = {start: None}
    waiting = deque([start])
    while waiting:
        for node in successors[waiting.popleft()]:
            if node not in found:
                found[node] = None
                waiting.append(node)
    return list(found)[1:]


def _some(flat: FlatGraph, nodes: list[int]) -> str:
    paths = [f'"{flat.nodes[index].path}"' for index in dict.fromkeys(nodes)]
    return ", ".join(paths if len(paths) <= 4 else [*paths[:3], f"{len(paths) - 3} more"])


def signal_rings(flat: FlatGraph) -> Iterator[Problem]:
    """Nodes that need a signal of which they are themselves the cause (rule P7)."""
    if not any(edge.is_event_edge for edge in flat.edges):
        return
    own = [edge for edge in flat.edges if not edge.is_event_edge or _needs_firing(flat, edge)]
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
                check="signal-ring",
            )


def _needs_firing(flat: FlatGraph, edge: FlatEdge) -> bool:
    """Whether only firings trigger the event.

    Activity, errors and time bring automatic events without a firing, and a do-activity triggers the node's own.
    """
    if edge.source.node < 0 or edge.source.kind != "event" or "do" in flat.nodes[edge.source.node].node._type.hooks:
        return False
    return edge.source.name not in ("activated", "deactivated", "failed", "timeout")


def filling_rings(flat: FlatGraph) -> Iterator[Problem]:
    """Rings of signals in which each signal comes back more than once, so that queues may grow forever (rule F8)."""
    bounded = ("drop_oldest", "drop_newest", "latest", "error")
    lossless = [
        edge
        for edge in flat.edges
        if edge.source.kind == "event"
        and edge.target.kind in ("slot", "input")
        and edge.source.node > ROOT
        and edge.target.node > ROOT
        and edge.options.overflow not in bounded
        and edge.options.capacity_limit is None
        and not edge.options.through
    ]
    successors: list[list[int]] = [[] for _ in flat.nodes]
    for edge in lossless:
        successors[edge.source.node].append(edge.target.node)
    for part in rings(successors):
        members = set(part)
        inside = [edge for edge in lossless if edge.source.node in members and edge.target.node in members]
        joined = [edge.target.node for edge in inside if edge.target.kind == "input"]
        if len(joined) != len(set(joined)):
            continue  # a node that waits for several signals makes one of them again
        by_event: dict[tuple[int, str], list[FlatEdge]] = {}
        for edge in inside:
            by_event.setdefault((edge.source.node, edge.source.name), []).append(edge)
        for (source, event), edges in by_event.items():
            if len(edges) > 1 and not all(edge.active for edge in edges):
                yield Problem(
                    path=f"{flat.nodes[source].path}.{event}",
                    severity="warning",
                    what=f"its signals come back {len(edges)} times, by {_listed(edges)}",
                    why=f"if each is answered by another, the queues of the ring grow forever (rule F8): "
                    f"{_circle(flat, shortest_ring(part, successors))}",
                    remedy='let one way suffice, or bound one of these edges by overflow="latest" or capacity_limit=',
                    check="filling-ring",
                )


def waiting_rings(flat: FlatGraph) -> Iterator[Problem]:
    """Rings whose nodes may wait for each other because queues are full, and where more capacity would prevent that.

    A ring in which each signal makes at most one more is harmless: its queues fill only with what comes from outside.
    """
    if not any(edge.is_event_edge for edge in flat.edges):
        return
    edges = [edge for edge in flat.edges if edge.source.node > ROOT and edge.target.node > ROOT]
    successors: list[list[int]] = [[] for _ in flat.nodes]
    for edge in edges:
        successors[edge.source.node].append(edge.target.node)
    for part in rings(successors):
        members = set(part)
        inside = [edge for edge in edges if edge.source.node in members and edge.target.node in members]
        queues = [edge for edge in inside if edge.source.kind == "event" and edge.options.overflow == "wait"]
        circle = _circle(flat, shortest_ring(part, successors))
        yield from _short_queues(part, inside, queues, circle)
        often = [edge for edge in queues if not edge.active and _may_trigger_often(flat, edge)]
        if often:
            yield Problem(
                path=often[0].label,
                severity="hint",
                what=f"signals go round, and one firing or call may trigger many of them: {circle}",
                why=f"when {often[0].options.capacity} lie there its node waits, and where the others wait for it the "
                "queue grows (rule F8); how many there may be cannot be seen from outside",
                remedy="set capacity= to one more than may be in transit at once, and it need not grow; or "
                "bound it by capacity_limit=",
                check="waiting-ring",
            )


def _short_queues(part: list[int], inside: list[FlatEdge], queues: list[FlatEdge], circle: str) -> Iterator[Problem]:
    """Where each firing makes one signal of one, as many go round as there were at first: the bound is known."""
    told_once = all(
        edge.source.kind == "output" or edge.source.name == "processed" or sent_of(edge.source.name) is not None
        for edge in inside
    )
    if not told_once or len(inside) != len(part) or any(edge.target.kind != "input" for edge in inside):
        return
    count = sum(len(edge.options.initial) for edge in inside)
    for edge in queues:
        if edge.options.capacity <= count:
            yield Problem(
                path=edge.label,
                severity="hint",
                what=f"{count} signals go round, and capacity={edge.options.capacity} holds its node back: {circle}",
                why="where all nodes of the ring wait for each other the queue grows (rule F8)",
                remedy=f"say capacity={count + 1}, and it need not grow",
                check="waiting-ring",
            )


def _may_trigger_often(flat: FlatGraph, edge: FlatEdge) -> bool:
    """Whether code of the node triggers the event in a loop, or waits for room between; automatic events come once."""
    node = flat.nodes[edge.source.node].node
    if edge.source.name not in node._type.events:
        return False
    codes = [code for function in functions_of(type(node), until=Node) for code in codes_in(function.__code__)]
    return any(edge.source.name in code.co_names and _has_loop(code) for code in codes)


def _has_loop(code: CodeType) -> bool:
    """Return whether it jumps back, other than for an await, which jumps too, in Python 3.12 after its clean-up."""
    names = ["", *(instruction.opname for instruction in dis.get_instructions(code))]
    return any(
        "JUMP_BACKWARD" in name and not name.endswith("NO_INTERRUPT") and before != "CLEANUP_THROW"
        for before, name in pairwise(names)
    )


def _listed(edges: list[FlatEdge]) -> str:
    labels = [f'"{edge.label}"' for edge in edges]
    return " and ".join(labels if len(labels) <= 3 else [*labels[:2], f"{len(labels) - 2} more"])


def silent_events(flat: FlatGraph) -> Iterator[Problem]:
    """Edges from automatic events that are never triggered (rules A9, A12, X1)."""
    for edge in flat.edges:
        reason = None
        if edge.source.kind == "event" and edge.source.node != ROOT:
            reason = never_triggered(flat, edge)
        if reason is not None:
            what, remedy = reason
            yield Problem(
                path=edge.label,
                severity="warning",
                what="nothing ever comes over this edge",
                why=what,
                remedy=f"{remedy}, or remove the edge",
                check="silent-event",
            )


def never_triggered(flat: FlatGraph, edge: FlatEdge) -> tuple[str, str] | None:
    """Return why nothing ever triggers the automatic event of an edge, and what helps; None if something may."""
    if edge.source.node < ROOT:
        scope = flat.scopes[scope_end(edge.source.node)]
        if edge.source.name == "timeout" and scope.options.active_for_s is None:
            return "a subgraph has time-outs only with active_for_s (rule A12)", "add it with active_for_s="
        return None
    node = flat.nodes[edge.source.node]
    kind, options = node.node._type, node.options
    if edge.source.name in kind.events:
        return None
    if edge.source.name == "timeout" and options.active_for_s is None:
        return "a node has time-outs only with active_for_s (rule A12)", "add it with active_for_s="
    if edge.source.name == "failed" and options.on_error == "stop":
        return (
            'with on_error="stop" the run ends before anybody hears of the failure (rule X1)',
            'add it with on_error="skip", "disable" or "restart"',
        )
    by_firings = edge.source.name == "processed" or sent_of(edge.source.name) is not None
    if by_firings and kind.process_kind == "none" and node.iteration is None:
        return "a node without process function never fires (rule A9)", "trigger an event in its slots"
    return None


def unfed_slots(flat: FlatGraph) -> Iterator[Problem]:
    """Nodes that work only when their slots are called, if no edge leads to any of these slots."""
    fed = {edge.target.node for edge in flat.edges if edge.target.kind == "slot"}
    for node in flat.nodes:
        kind = node.node._type
        slots = [name for name, slot in kind.slots.items() if slot.handler_name]
        if slots and node.index not in fed and kind.process_kind == "none" and node.iteration is None:
            yield Problem(
                path=node.path,
                severity="hint",
                what=f"nothing leads to its {_slots(slots)}",
                why="it has no process function, so only your program can make it act, by run.trigger (rule F2)",
                remedy="connect one of them, if the graph should",
                check="unfed-slots",
            )


def _slots(names: list[str]) -> str:
    return f"slot {names[0]}" if len(names) == 1 else f"slots {', '.join(names)}"


def endless_sources(flat: FlatGraph) -> Iterator[Problem]:
    """Sources that keep the loop busy forever; only those of which it is certain (rule F2)."""
    for node in endless(flat):
        yield Problem(
            path=node.path,
            severity="warning",
            what="a source without a rate that never ends and waits for nothing",
            why="it fires as often as the machine can (rule F2)",
            remedy="add it with max_rate_hz=, or raise hfg.EndOfStream",
            check="endless-source",
        )


def _successors(flat: FlatGraph, edges: Iterable[FlatEdge]) -> list[list[int]]:
    """Return the nodes that wait for each node. Edges with initial tokens or into slots make no node wait."""
    successors: list[list[int]] = [[] for _ in flat.nodes]
    for edge in edges:
        source, target = edge.source.node, edge.target.node
        joins = edge.target.kind == "input" or (edge.target.kind == "parameter" and not edge.is_event_edge)
        if source > ROOT and target > ROOT and joins and not edge.options.initial:
            successors[source].append(target)
    return successors


def _circle(flat: FlatGraph, ring: list[int]) -> str:
    paths = [flat.nodes[index].path for index in ring]
    shown = paths if len(paths) <= 8 else [*paths[:6], f"{len(paths) - 7} more", paths[-1]]
    return " -> ".join([*shown, paths[0]])

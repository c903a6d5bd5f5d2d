"""What the first stage of the token game shows of activity, as problems: they add to the checks of graphs.

No code is read, and every graph is checked before it runs. A program outside the graph can activate any node, by
`run.trigger(slot, activity=+1)`; so each result is only a warning, or a hint if all activity may come from outside.
Depends on `spread`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hfg.analysis.moves import Moves, unread
from hfg.analysis.spread import Spread
from hfg.errors import Problem
from hfg.graph.checks import also
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, FlatNode, scope_end
from hfg.graph.flat.order import strongly_connected

__all__ = ["Found", "activity_problems"]


class Found:
    """Where activity may come in a graph, and what depends on it.

    Nodes and subgraphs are named as in `End.node`.

    Attributes:
      flat: the graph.
      edges: the active edges.
      moves: what each node may do.
      spread: where activity may come.
      asks: per node or subgraph, the things in the graph that depend on its activity, in words.
    """

    def __init__(self, flat: FlatGraph) -> None:
        self.flat = flat
        self.edges = [edge for edge in flat.edges if edge.active]
        self.moves = Moves(flat, unread)
        outside = (number for number, edge in enumerate(self.edges) if edge.source.node == ROOT)
        self.spread = Spread(flat, self.moves, self.edges, outside)
        self.asks = self._find_asking()

    def _find_asking(self) -> dict[int, list[str]]:
        asks: dict[int, list[str]] = {}
        begins: dict[int, list[FlatEdge]] = {}
        for edge in self.edges:
            begins.setdefault(edge.source.node, []).append(edge)
        for end, edges in begins.items():
            if end != ROOT:
                more = f" and {len(edges) - 1} more are" if len(edges) > 1 else " is"
                asks.setdefault(end, []).append(f'"{edges[0].label}"{more} active')
        for gate in self.flat.gates:
            target = self.flat.path(gate.target)
            asks.setdefault(gate.by, []).append(f'a gate lets "{target}" work only while it is active')
        for index, options in self.flat.options():
            if options.active_for_s is not None:
                asks.setdefault(index, []).append("it has active_for_s")
        for node in self.flat.nodes:
            if _does(node):
                asks.setdefault(node.index, []).append("it has a do-activity, which runs only while it is active")
        return asks


@also
def activity_problems(flat: FlatGraph) -> Iterator[Problem]:
    """Yield problems: activity that never arrives, edges that never carry any, and states that become two."""
    asked = flat.gates or _has_time_limits(flat) or any(map(_does, flat.nodes))
    if not asked and not any(edge.active for edge in flat.edges):
        return
    found = Found(flat)
    yield from _never_active(found)
    yield from _idle_edges(found)
    yield from _losing_edges(found)
    yield from _forks(found)
    yield from _unheard_limits(found)
    yield from _captives(found)


def _does(node: FlatNode) -> bool:
    """Whether it has a do-activity (A15)."""
    return "do" in node.node._type.hooks


def _has_time_limits(flat: FlatGraph) -> bool:
    return any(options.active_for_s is not None for _, options in flat.options())


def _never_active(found: Found) -> Iterator[Problem]:
    lost = [end for end in found.asks if not found.spread.may_be_active(end)]
    begins = any(found.spread.active)
    for first, *others in _clusters(found, lost):
        more = f", nor {_named(found, others)} behind it" if others else ""
        yield Problem(
            path=found.flat.path(first),
            severity="warning" if begins else "hint",
            what=f"nothing in the graph makes it active{more}",
            why=f"though {' and '.join(found.asks[first])}",
            remedy="lead an active edge to it that begins at graph.start, or let your program activate it by "
            "run.trigger(slot, activity=+1)",
            check="never-active",
        )


def _clusters(found: Found, lost: list[int]) -> Iterator[list[int]]:
    """Those that active edges connect are one finding; each begins with one that none of the others leads to."""
    neighbours: dict[int, list[int]] = {}
    led_to: set[int] = set()

    def connect(source: int, target: int) -> None:
        neighbours.setdefault(source, []).append(target)
        neighbours.setdefault(target, []).append(source)

    for edge in found.edges:
        source, target = edge.source.node, edge.target.node
        if ROOT not in (source, target) and source != target and not found.spread.may_be_active(source):
            connect(source, target)
            led_to.add(target)
    for end in lost:
        for member in found.flat.members(end):
            connect(end, member)
    asking = set(lost)
    seen: set[int] = set()
    for end in sorted(lost, key=lambda one: (one in led_to, one < ROOT, one)):
        if end in seen:
            continue
        cluster = [end]
        seen.add(end)
        for member in cluster:
            fresh = [other for other in neighbours.get(member, ()) if other not in seen]
            fresh = [other for other in dict.fromkeys(fresh) if not found.spread.may_be_active(other)]
            seen.update(fresh)
            cluster += fresh
        yield [member for member in cluster if member in asking]


def _idle_edges(found: Found) -> Iterator[Problem]:
    """Active edges over which nothing active ever comes, though their node may be."""
    for number, edge in enumerate(found.edges):
        source = edge.source
        if number in found.spread.reached or not found.spread.may_be_active(source.node):
            continue
        if source.kind == "event" and source.name != "deactivated":
            continue  # nothing at all ever comes over it, which another check says
        if source.kind == "event":
            why = "who has just lost its activity has none to give (rules A3, A9)"
            remedy = "draw it from the event by which the activity leaves, or leave out active=True"
        else:
            why = "this node never fires"
            remedy = "see what is said about its inputs, or draw the edge from an event"
        yield Problem(
            path=edge.label,
            severity="warning",
            what="this active edge can never carry activity",
            why=why,
            remedy=remedy,
            check="idle-active-edge",
        )


def _losing_edges(found: Found) -> Iterator[Problem]:
    """Active edges into slots of a subgraph itself, which can keep no activity (G2)."""
    for number, edge in enumerate(found.edges):
        if edge.target.node < ROOT and number in found.spread.reached:
            yield Problem(
                path=edge.label,
                severity="warning",
                what="activity that comes over this active edge is lost",
                why="the slot belongs to the subgraph itself, which is active only by what is inside (rules A8, G2)",
                remedy="leave out active=True, or lead it into a slot that the subgraph declares",
                check="lost-activity",
            )


def _forks(found: Found) -> Iterator[Problem]:
    """One state becomes two where a machine was meant.

    A part of the graph is taken for a machine if all its nodes can hand the activity on to each other. Two ways at once
    are meant there if a node of the part takes activity by two inputs: it waits until both have come.
    """
    flat = found.flat
    edges = [edge for edge in found.edges if edge.target.node > ROOT and edge.target.name != "deactivate"]
    part_of = _machines(flat, edges)
    sendings: dict[tuple[int, str, str], dict[int, FlatEdge]] = {}
    for edge in edges:
        part = part_of[edge.target.node]
        from_inside = edge.source.node == ROOT or (edge.source.node > ROOT and part_of[edge.source.node] == part)
        if part is not None and from_inside:
            key = (edge.source.node, edge.source.kind, edge.source.name)
            sendings.setdefault(key, {}).setdefault(edge.target.node, edge)
    for (source, _, name), targets in sendings.items():
        parts: dict[int | None, list[int]] = {}
        for target in targets:
            parts.setdefault(part_of[target], []).append(target)
        for members in parts.values():
            if len(members) < 2:
                continue
            yield Problem(
                path=f"{flat.nodes[source].path}.{name}" if source > ROOT else name,
                severity="warning",
                what=f"one sending makes {_named(found, members)} active at once",
                why="these nodes hand the activity on to each other like the states of a machine, and a machine is in "
                "one state at a time (rules A3, A13)",
                remedy="give each state an event of its own, leave active=True out of all but one edge, or let a node "
                "take both by two inputs if they are to work side by side",
                check="activity-fork",
            )


def _machines(flat: FlatGraph, edges: list[FlatEdge]) -> list[int | None]:
    """Return for each node the number of the part that is taken for a machine, None if it is in none."""
    successors: list[list[int]] = [[] for _ in flat.nodes]
    joins: dict[int, int] = {}
    for edge in edges:
        if edge.source.node > ROOT:
            successors[edge.source.node].append(edge.target.node)
        if edge.target.kind == "input":
            joins[edge.target.node] = joins.get(edge.target.node, 0) + 1
    part_of: list[int | None] = [None] * len(flat.nodes)
    for number, part in enumerate(strongly_connected(successors)):
        if len(part) > 1 and all(joins.get(index, 0) < 2 for index in part):
            for index in part:
                part_of[index] = number
    return part_of


def _unheard_limits(found: Found) -> Iterator[Problem]:
    """Time limits of activity at whose end nothing happens (A12)."""
    flat = found.flat
    heard = {edge.source.node for edge in flat.edges if edge.source.kind == "event" and edge.source.name == "timeout"}
    for end, node, options in (
        *((node.index, node.node, node.options) for node in flat.nodes),
        *((scope_end(scope.index), scope.subgraph, scope.options) for scope in flat.scopes),
    ):
        if options.active_for_s is None or end in heard or node.timeout._observers:
            continue
        yield Problem(
            path=found.flat.path(end),
            severity="warning",
            what=f"active_for_s={options.active_for_s:g} has no effect, for nothing is connected to its timeout",
            why="when the time is over the event timeout is triggered, and nothing else happens (rule A12)",
            remedy="connect its timeout, by an active edge if the activity is to leave, or leave active_for_s out",
            check="unheard-timeout",
        )


def _captives(found: Found) -> Iterator[Problem]:
    """Nodes that keep their activity permanently, although another node waits until it leaves (A5, A9)."""
    flat = found.flat
    freed = {edge.target.node for edge in flat.edges if edge.target.kind == "slot" and edge.target.name == "deactivate"}
    for number, edge in enumerate(found.edges):
        source = edge.source.node
        if source > ROOT and found.moves.of(flat.nodes[source]).says:
            freed.add(edge.target.node)  # which may take it away, by a modifier of its own (A4)
        if number in found.spread.reached:
            freed.add(source)
    for node in flat.nodes:
        around = (node.index, *(scope_end(scope) for scope in node.scopes))
        if not found.spread.active[node.index] or not freed.isdisjoint(around) or node.iteration is not None:
            continue
        waiting = [edge for edge in flat.edges if edge.source.node == node.index and _waits_for_leaving(found, edge)]
        if waiting:
            yield Problem(
                path=node.path,
                severity="warning",
                what=f'its activity can never leave it, but "{waiting[0].label}" waits until it does',
                why="no active edge leads out over which activity could go, and nothing deactivates it (rules A5, A7)",
                remedy="make the edge active by which the activity is to leave, or connect its slot deactivate",
                check="captive-activity",
            )


def _waits_for_leaving(found: Found, edge: FlatEdge) -> bool:
    """Whether an edge reports that activity has left, or leads to a node that asks for it and never gets any."""
    if edge.source.kind == "event" and edge.source.name == "deactivated":
        return edge.source.name not in edge.source.port.node._type.events
    target = edge.target.node
    return target != ROOT and not edge.active and target in found.asks and not found.spread.may_be_active(target)


def _named(found: Found, ends: list[int]) -> str:
    paths = [f'"{found.flat.path(end)}"' for end in ends]
    if len(paths) > 4:
        paths = [*paths[:3], f"{len(paths) - 3} more"]
    return paths[0] if len(paths) == 1 else f"{', '.join(paths[:-1])} and {paths[-1]}"

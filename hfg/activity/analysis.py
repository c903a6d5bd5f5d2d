"""The nodes that can ever become active, found without running: a fixed point over active edges (rules A3-A12, G2).

Activity comes from `start`, from edges into a slot `activate`, from feeds, from code that may send its own modifiers
(A4), and from active nodes over their active edges. Anything uncertain counts as possible. A program outside the
graph can activate any node, by `run.trigger(slot, activity=+1)`; so each result is only a warning, or a hint if all
activity may come from outside. Depends on the flat graph and `explicit`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from hfg.activity.explicit import may_give_activity
from hfg.errors import Problem
from hfg.graph.checks import also
from hfg.graph.checks.flow import never_fires
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, FlatNode, scope_end
from hfg.graph.flat.order import strongly_connected

__all__ = ["ActivityAnalysis", "activity_problems"]


class ActivityAnalysis:
    """The possible effects of activity in one flat graph.

    Nodes and subgraphs are named as in `End.node`.

    Attributes:
      active: per node, whether it may ever become active.
      asks: per node or subgraph, the things in the graph that depend on its activity, in words.
    """

    def __init__(self, flat: FlatGraph) -> None:
        self.flat = flat
        self._still = never_fires(flat)
        self._from: dict[int, list[FlatEdge]] = {}  # active edges by their source
        for edge in flat.edges:
            if edge.active:
                self._from.setdefault(edge.source.node, []).append(edge)
        # Only what leaves over an active edge carries activity. An iteration is many rounds of its inside: who knows.
        self._gives = [
            node.iteration is not None or (node.index in self._from and may_give_activity(node.node._type))
            for node in flat.nodes
        ]
        self.active = [False] * len(flat.nodes)
        self._spread()
        self.asks = self._find_asking()

    def may_be_active(self, end: int) -> bool:
        """Return whether a node or subgraph may become active. A subgraph is active while a node inside is (G2)."""
        return any(self.active[member] for member in self.flat.members(end))

    def may_carry(self, edge: FlatEdge) -> bool:
        """Return whether a token with +1 may ever leave over an active edge (A3, A4)."""
        source = edge.source
        if source.node == ROOT:
            return True  # `start`, or a feed: the program outside decides
        if source.kind == "event" and source.name == "deactivated":
            own = source.port.node._type.events
            return source.name in own  # whoever has just become inactive has nothing to give (A9)
        if source.node < ROOT:
            return self.may_be_active(source.node)
        if source.kind != "event" and source.node in self._still:
            return False
        return self._gives[source.node] or self.active[source.node]

    def _spread(self) -> None:
        """Spread activity wherever it may go, until nothing changes."""
        waiting: deque[int] = deque()

        def activate(index: int) -> None:
            if not self.active[index]:
                self.active[index] = True
                waiting.append(index)

        def arrive(edge: FlatEdge) -> None:
            target = edge.target
            if target.node <= ROOT or (target.kind == "slot" and target.name == "deactivate"):
                return
            if target.kind == "slot" or target.node not in self._still:
                activate(target.node)

        for node in self.flat.nodes:
            if self._gives[node.index]:
                activate(node.index)  # what it gave comes back to it where it is discarded (A8)
        for edge in self.flat.edges:
            if edge.target.kind == "slot" and edge.target.name == "activate" and edge.target.node > ROOT:
                activate(edge.target.node)
        for edge in self._from.get(ROOT, ()):
            arrive(edge)
        while waiting:
            index = waiting.popleft()
            for end in (index, *(scope_end(scope) for scope in self.flat.nodes[index].scopes)):
                for edge in self._from.get(end, ()):
                    if self.may_carry(edge):
                        arrive(edge)

    def _find_asking(self) -> dict[int, list[str]]:
        asks: dict[int, list[str]] = {}
        for end, edges in self._from.items():
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
    found = ActivityAnalysis(flat)
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


def _never_active(found: ActivityAnalysis) -> Iterator[Problem]:
    lost = [end for end in found.asks if not found.may_be_active(end)]
    begins = any(found.active)
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


def _clusters(found: ActivityAnalysis, lost: list[int]) -> Iterator[list[int]]:
    """Those that active edges connect are one finding; each begins with one that none of the others leads to."""
    neighbours: dict[int, list[int]] = {}
    led_to: set[int] = set()

    def connect(source: int, target: int) -> None:
        neighbours.setdefault(source, []).append(target)
        neighbours.setdefault(target, []).append(source)

    for edges in found._from.values():
        for edge in edges:
            source, target = edge.source.node, edge.target.node
            if ROOT not in (source, target) and source != target and not found.may_be_active(source):
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
            fresh = [other for other in dict.fromkeys(fresh) if not found.may_be_active(other)]
            seen.update(fresh)
            cluster += fresh
        yield [member for member in cluster if member in asking]


def _idle_edges(found: ActivityAnalysis) -> Iterator[Problem]:
    """Active edges over which nothing active ever comes, though their node may be."""
    for edge in found.flat.edges:
        source = edge.source
        if not edge.active or found.may_carry(edge) or source.node == ROOT or not found.may_be_active(source.node):
            continue
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


def _losing_edges(found: ActivityAnalysis) -> Iterator[Problem]:
    """Active edges into slots of a subgraph itself, which can keep no activity (G2)."""
    for edge in found.flat.edges:
        if edge.active and edge.target.node < ROOT and found.may_carry(edge):
            yield Problem(
                path=edge.label,
                severity="warning",
                what="activity that comes over this active edge is lost",
                why="the slot belongs to the subgraph itself, which is active only by what is inside (rules A8, G2)",
                remedy="leave out active=True, or lead it into a slot that the subgraph declares",
                check="lost-activity",
            )


def _forks(found: ActivityAnalysis) -> Iterator[Problem]:
    """One state becomes two where a machine was meant.

    A part of the graph is taken for a machine if all its nodes can hand the activity on to each other. Two ways at once
    are meant there if a node of the part takes activity by two inputs: it waits until both have come.
    """
    flat = found.flat
    edges = [
        edge for edge in flat.edges if edge.active and edge.target.node > ROOT and edge.target.name != "deactivate"
    ]
    successors: list[list[int]] = [[] for _ in flat.nodes]
    joins: dict[int, int] = {}
    for edge in edges:
        if edge.source.node > ROOT:
            successors[edge.source.node].append(edge.target.node)
        if edge.target.kind == "input":
            joins[edge.target.node] = joins.get(edge.target.node, 0) + 1
    part_of = [0] * len(flat.nodes)
    joined: set[int] = set()
    for number, part in enumerate(strongly_connected(successors)):
        for index in part:
            part_of[index] = number if len(part) > 1 else -1
        if any(joins.get(index, 0) > 1 for index in part):
            joined.add(number)
    sendings: dict[tuple[int, str, str], dict[int, FlatEdge]] = {}
    for edge in edges:
        key = (edge.source.node, edge.source.kind, edge.source.name)
        part_number = part_of[edge.target.node]
        from_inside = edge.source.node == ROOT or (edge.source.node > ROOT and part_of[edge.source.node] == part_number)
        if part_number >= 0 and part_number not in joined and from_inside:
            sendings.setdefault(key, {}).setdefault(edge.target.node, edge)
    for (source, _, name), targets in sendings.items():
        parts: dict[int, list[int]] = {}
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


def _unheard_limits(found: ActivityAnalysis) -> Iterator[Problem]:
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


def _captives(found: ActivityAnalysis) -> Iterator[Problem]:
    """Nodes that keep their activity for good, though somebody waits until it leaves (A5, A9)."""
    flat = found.flat
    freed = {edge.target.node for edge in flat.edges if edge.target.kind == "slot" and edge.target.name == "deactivate"}
    for edges in found._from.values():
        for edge in edges:
            if edge.source.node > ROOT and may_give_activity(flat.nodes[edge.source.node].node._type):
                freed.add(edge.target.node)  # which may take it away, by a modifier of its own (A4)
    for node in flat.nodes:
        around = (node.index, *(scope_end(scope) for scope in node.scopes))
        leaves = any(found.may_carry(edge) for end in around for edge in found._from.get(end, ()))
        if not found.active[node.index] or leaves or not freed.isdisjoint(around) or node.iteration is not None:
            continue
        waiting = [edge for edge in flat.edges if edge.source.node == node.index and _waits_for_leaving(found, edge)]
        if waiting:
            yield Problem(
                path=node.path,
                severity="warning",
                what=f'its activity can never leave it, but "{waiting[0].label}" waits for that',
                why="no active edge leads out over which activity could go, and nothing deactivates it (rules A5, A7)",
                remedy="make the edge active by which the activity is to leave, or connect its slot deactivate",
                check="captive-activity",
            )


def _waits_for_leaving(found: ActivityAnalysis, edge: FlatEdge) -> bool:
    """Whether an edge tells that activity has left, or leads to somebody who asks for it and never gets any."""
    if edge.source.kind == "event" and edge.source.name == "deactivated":
        return edge.source.name not in edge.source.port.node._type.events
    target = edge.target.node
    return target != ROOT and not edge.active and target in found.asks and not found.may_be_active(target)


def _named(found: ActivityAnalysis, ends: list[int]) -> str:
    paths = [f'"{found.flat.path(end)}"' for end in ends]
    if len(paths) > 4:
        paths = [*paths[:3], f"{len(paths) - 3} more"]
    return paths[0] if len(paths) == 1 else f"{', '.join(paths[:-1])} and {paths[-1]}"

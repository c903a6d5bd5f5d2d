"""What is probably a mistake in how activity moves, as problems. Depends on `reach` and `proving`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Iterator

from hfg.analysis.checks import Found
from hfg.analysis.playing import Play
from hfg.analysis.proving import StatedFact, Step, steps_to
from hfg.analysis.reach import Reach
from hfg.analysis.searching import Searched
from hfg.errors import Problem
from hfg.graph.flat import ROOT
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import NodeType
from hfg.ports import InnerSource, InnerTarget, Port

__all__ = ["leaves_within", "problems_of", "without_limit"]


def problems_of(reach: Reach, facts: Iterable[StatedFact]) -> Iterator[Problem]:
    """Yield what is probably a mistake, region by region, then what the graph as a whole shows."""
    for number in range(len(reach.plays)):
        yield from _problems_of(reach, number)
    yield from _kept_by_time_out(reach)
    yield from _half_active_slots(reach)
    yield from _unlike_their_kind(reach)
    yield from _ungated(reach)
    yield from _half_ways(reach)
    yield from _doubtful(facts)


def _problems_of(reach: Reach, number: int) -> list[Problem]:
    """The problems that the states of a region show."""
    game, play, found = reach.game, reach.plays[number], reach.found[number]
    problems = []
    if found.is_complete:
        never = [index for index in sorted(play.nodes) if not reach.may_be_active(index)]
        never = [index for index in never if reach.game.into.get(index)]
        if never and len(never) < len(play.nodes):
            spread = Found(game.flat).spread  # the check `never-active` names where no activity comes from any code
            never = [index for index in never if spread.may_be_active(index)]
        if never and len(never) < len(play.nodes):
            more = f", nor do {len(never) - 1} more behind it" if len(never) > 1 else ""
            problems.append(
                Problem(
                    path=game.flat.path(never[0]),
                    severity="warning",
                    what=f"it is never active{more}",
                    why="activity never comes by any of the active edges that lead to it",
                    remedy="look which edge before it is not active, or does not begin where activity is",
                    check="activity-never-comes",
                )
            )
        problems += _stuck(reach, play, found)
    if not play.first:
        return problems
    lost = next((state for state in found.reached if not state & play.mask), None)
    if lost is not None:
        steps = list(steps_to(game, found, lost))
        problems.append(
            Problem(
                path=steps[-1].path,
                severity="warning",
                what="the activity of its part of the graph may be lost",
                why=f"none of {len(play.nodes)} nodes is active any more after {_in_words(steps)}",
                remedy="lead the activity on by an active edge, if this is not the end of the work",
                check="activity-lost",
            )
        )
    return problems


def _stuck(reach: Reach, play: Play, found: Searched) -> list[Problem]:
    """States that have activity and can never be left."""
    game = reach.game
    kept: list[str] = []
    for state in found.reached:
        if state & play.mask and next(play.steps_from(state), None) is None:
            kept += [path for path in game.places.active_in(state) if path not in kept]
    return [
        Problem(
            path=path,
            severity="hint",
            what="its activity may stay permanently",
            why="there is a state in which nothing can happen to it any more",
            remedy="lead it on by an active edge, unless the work is over there",
            check="activity-stays",
        )
        for path in kept
    ]


def leaves_within(reach: Reach) -> dict[str, float]:
    """Return for each node that may be active the seconds after which a time-out takes its activity at the latest.

    The time-out may be its own, or that of a subgraph around it (rules A12, G2). One whose only active edges lead to
    nodes that can be disabled does not count, because the activity then stays (rule A8).
    """
    game, found = reach.game, dict[str, float]()
    for end, options in game.flat.options():
        if options.active_for_s is None or game.may_stay(end, "timeout"):
            continue
        for index in game.flat.members(end):
            path = game.flat.path(index)
            if index in game.places.node and reach.may_be_active(index):
                found[path] = min(options.active_for_s, found.get(path, options.active_for_s))
    return found


def without_limit(reach: Reach, limits: Container[str]) -> list[str]:
    """Nodes that may be active, and that neither a time-out of their own nor one around them makes inactive."""
    paths = [reach.game.flat.path(index) for index in reach.game.nodes if reach.may_be_active(index)]
    return [path for path in paths if path not in limits]


def _kept_by_time_out(reach: Reach) -> list[Problem]:
    """Time limits whose end is heard, but takes no activity along, where other events do."""
    flat, problems = reach.game.flat, []
    for end, options in flat.options():
        edges = [edge for edge in flat.edges if edge.source.node == end and edge.source.name == "timeout"]
        inside = set(reach.game.flat.members(end))
        leads_on = any(
            edge.source.node in inside and edge.target.node not in inside and edge.source.node != end
            for edge in reach.game.edges
        ) or any(edge.source.node == end for edge in reach.game.edges)
        if options.active_for_s is not None and edges and leads_on and not any(edge.active for edge in edges):
            problems.append(
                Problem(
                    path=edges[0].label,
                    severity="hint",
                    what="the activity stays when the time is over",
                    why="its other events lead the activity on, and this edge is not active (rules A5, A12)",
                    remedy="make it active, or look whether the node is to stay active",
                    check="timeout-keeps-activity",
                )
            )
    return problems


def _half_active_slots(reach: Reach) -> list[Problem]:
    """Edges without activity into a slot that others enter with activity, from a node that has it."""
    flat, game = reach.game.flat, reach.game
    problems = []
    active = Counter((edge.target.node, edge.target.name) for edge in game.edges if edge.target.kind == "slot")
    for edge in flat.edges:
        if edge.active or not active[edge.target.node, edge.target.name] or edge.target.node <= ROOT:
            continue
        members = game.flat.members(edge.source.node) if edge.source.node != ROOT else []
        if edge.source.name != "deactivated" and any(index in game.places.node for index in members):
            problems.append(
                Problem(
                    path=edge.label,
                    severity="hint",
                    what="this edge is not active, and others into the same slot are",
                    why="the node that sends keeps its activity when the slot is called by this edge (rule A7)",
                    remedy="make it active, or look whether both nodes are to be active then",
                    check="half-active-slot",
                )
            )
    return problems


def _unlike_their_kind(reach: Reach) -> list[Problem]:
    """Events and outputs that lead no activity on, though those of all other nodes of the same type do."""
    game, problems = reach.game, []
    leads: dict[tuple[NodeType, str], set[int]] = {}
    of_type: dict[NodeType, list[int]] = {}
    for index in game.nodes:
        of_type.setdefault(game.flat.nodes[index].node._type, []).append(index)
    for edge in game.edges:
        if edge.source.node > ROOT:
            kind = game.flat.nodes[edge.source.node].node._type
            if edge.source.name in kind.events or edge.source.name in kind.outputs:
                leads.setdefault((kind, edge.source.name), set()).add(edge.source.node)
    for (kind, port), leading in leads.items():
        others = [index for index in of_type[kind] if index not in leading]
        if len(others) == 1:
            problems.append(
                Problem(
                    path=f"{game.flat.path(others[0])}.{port}",
                    severity="hint",
                    what="no active edge begins here, although one does at all other nodes of this type",
                    why=f"{kind.name} keeps its activity when it sends {port} (rule A5)",
                    remedy="lead the activity on by an active edge, or look whether it is to stay",
                    check="unlike-its-kind",
                )
            )
    return problems


def _ungated(reach: Reach) -> list[Problem]:
    """Nodes without a gate whose outputs go where only gated ones send as well."""
    flat, game = reach.game.flat, reach.game
    gated = {member for gate in flat.gates for member in game.flat.members(gate.target)}
    into: dict[tuple[int, str], list[int]] = {}
    for edge in flat.edges:
        if edge.source.kind == "output" and edge.source.node > ROOT:
            into.setdefault((edge.target.node, edge.target.name), []).append(edge.source.node)
    found: dict[int, int] = {}
    for sources in into.values():
        without = [index for index in sources if index not in gated and index in game.places.node]
        held_back = [index for index in sources if index in gated]
        if len(without) == 1 and len(held_back) == len(sources) - 1 > 1:
            found[without[0]] = len(sources) - 1
    return [
        Problem(
            path=game.flat.path(index),
            severity="hint",
            what="it also sends when it is inactive",
            why=f"the {others} other nodes that send to the same port work only while a gate is open (rule A11)",
            remedy="add a gate, as in graph.gate(node, by=node)",
            check="gate-missing",
        )
        for index, others in found.items()
    ]


def _half_ways(reach: Reach) -> Iterator[Problem]:
    """Active edges to or from a port of a subgraph that has no active edge on its other side (rule G1)."""
    levels = reach.game.flat.level.whole.root.walk()
    edges = [edge for level in levels for edge in level.edges if edge.active]
    sides: dict[Port, set[bool]] = {}  # of each port, the sides that have active edges: True inside a subgraph
    for edge in edges:
        for end in (edge.source, edge.target):
            if isinstance(end, InnerSource | InnerTarget):
                sides.setdefault(end.outer, set()).add(True)
            elif isinstance(end, Port):
                sides.setdefault(end, set()).add(False)
    for edge in edges:
        for end in (edge.source, edge.target):
            port = end.outer if isinstance(end, InnerSource | InnerTarget) else end
            if not isinstance(port, Port) or not _is_border(port) or len(sides[port]) == 2:
                continue
            way, side = ("to" if end is edge.target else "from"), ("outside" if port is not end else "inside")
            yield Problem(
                path=edge.label,
                severity="hint",
                what=f"it is active, and moves no activity {way} a port of a subgraph",
                why=f'no active edge meets "{port.path}" {side} of the subgraph (rule G1)',
                remedy=f"connect it {side} by an active edge, or make this edge inactive",
                check="half-way",
            )


def _is_border(port: Port) -> bool:
    """Whether it is a port that a subgraph declares, and that hands on what comes."""
    if not is_box(port.node):
        return False
    kind = port.node._type
    declared = {"input": kind.inputs, "output": kind.outputs, "slot": kind.slots, "event": kind.events}
    return port.name in declared.get(port.kind, {})


def _doubtful(facts: Iterable[StatedFact]) -> Iterator[Problem]:
    """Facts that code which was read seems to violate."""
    for one in facts:
        if one.verdict is not None and one.verdict.holds is False and one.is_read:
            yield Problem(
                path=one.path,
                severity="hint",
                what=f"the graph states that {one.fact}, and the code seems to allow otherwise",
                why=f"it may be violated by {_in_words(list(one.verdict.steps))}",
                remedy="see that conditions in the code exclude these steps; debug runs check the fact",
                check="fact-in-doubt",
            )


def _in_words(steps: list[Step]) -> str:
    shown = [step.text for step in steps[-2:]]
    more = f"{len(steps) - 2} steps, then " if len(steps) > 2 else ""
    return more + ", then ".join(shown) if shown else "the start"

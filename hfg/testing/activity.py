"""Play a counter-example of the analysis of activity in the engine.

The graph is rebuilt from *puppets*: nodes with the same ports and active edges, which send what a step says. So a
replay shows that the rules allow a counter-example, not that the code of the nodes does. Gates only forbid, and are
left out. A puppet takes activity as soon as it arrives, so a counter-example in which it waits may not happen.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import msgspec

import hfg
from hfg import commands, trace
from hfg.analysis import Step, Verdict
from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, flatten, scope_end
from hfg.graph.structure.membership import set_options

__all__ = ["ActivityReplay", "replay_activity"]

_LIMIT_S = 1.0


@dataclass(frozen=True)
class ActivityReplay:
    """The course of a counter-example in the engine.

    Attributes:
      most: how many of its nodes were active at once at most; activity in transit to one of them counts.
      least: how many at least, after the start of the run.
      active: the nodes that are active at the end, by their paths in the graph.
      unknown: why the claim was not broken in this replay, and so may or may not be in a run; "" if it was broken.
    """

    most: int
    least: int
    active: tuple[str, ...]
    unknown: str = ""


def replay_activity(graph: Graph, verdict: Verdict) -> ActivityReplay:
    """Play the steps of a counter-example in the engine, in virtual time, with puppets in place of the nodes.

    Args:
      graph: the graph that was analysed.
      verdict: what `report.at_most_one` or `report.exactly_one` returned.

    Returns:
      The greatest and the smallest number of nodes that were active.

    Raises:
      UsageError: the verdict has no counter-example, or one with a step that no puppet can play.

    Examples:
      >>> import hfg
      >>> from hfg.activity import StateNode
      >>> graph = hfg.Graph()
      >>> one, other = graph.add(StateNode(), name="one"), graph.add(StateNode(), name="other")
      >>> for node in (one, other):
      ...     _ = graph.start.activates(node.enter)
      ...     _ = node.missing.activates(node.enter)
      ...     _ = one.missing.activates(other.enter) if node is one else None
      >>> broken = hfg.analyse_activity(graph).at_most_one("one", "other")
      >>> replay_activity(graph, broken).most
      2
    """
    if verdict.holds is not False:
        raise UsageError(f"there is nothing to replay, since no counter-example was found: {verdict}")
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(_Puppets(flatten(graph), verdict).play())


def _identifier(prefix: str, name: str) -> str:
    return prefix + "".join(one if one.isalnum() else f"_{ord(one):x}_" for one in name)


class _Puppets:
    def __init__(self, flat: FlatGraph, verdict: Verdict) -> None:
        self.flat = flat
        self.verdict = verdict
        self.acting = {step.path for step in verdict.steps}
        self.graph = Graph("puppets")
        self.edges = [edge for edge in flat.edges if edge.active]
        self.puppets: dict[str, Any] = {}
        self.boxes: dict[str, Any] = {}
        self.waiting: dict[int, list[tuple[str, Any]]] = {}  # per subgraph its events, each with a stand-in
        ends = {end for edge in self.edges for end in (edge.source.node, edge.target.node) if end > ROOT}
        for index in sorted(ends):
            self._add(index)
        for edge in self.edges:
            self._connect(edge)
        self._enclose()

    def _add(self, index: int) -> None:
        """Make a puppet with an event for each port that sends over an active edge, and a slot for each that takes."""
        body: dict[str, Any] = {"__module__": __name__}
        for edge in self.edges:
            if edge.source.node == index:
                body[_identifier("e_", edge.source.name)] = hfg.Event(Any)
            if edge.target.node == index and edge.target.name not in ("activate", "deactivate"):
                body[_identifier("s_", edge.target.name)] = hfg.slot(_takes(_identifier("s_", edge.target.name)))

        def command(self: Any, sent: list[tuple[str, int | None, int]]) -> None:
            for port, modifier, count in sent:
                for _ in range(count):
                    getattr(self, _identifier("e_", port)).trigger(activity=modifier)

        command.__annotations__ = {"sent": list, "return": None}
        body["command"] = hfg.slot(command)
        path = self.flat.nodes[index].path
        self.puppets[path] = self.graph.add(type("Puppet", (hfg.Node,), body)(), name=_identifier("n_", path))

    def _connect(self, edge: FlatEdge) -> None:
        if edge.target.node <= ROOT:
            return  # activity that goes there is seen where it is sent
        target = self.puppets[self.flat.nodes[edge.target.node].path]
        name = edge.target.name
        slot = target.ports.slots[name if name in ("activate", "deactivate") else _identifier("s_", name)]
        if edge.source.node == ROOT:
            if edge.source.name == "start":
                self.graph.start.activates(slot)
        elif edge.source.node > ROOT:
            source = self.puppets[self.flat.nodes[edge.source.node].path]
            source.ports.events[_identifier("e_", edge.source.name)].activates(slot)
        elif self.flat.scopes[scope_end(edge.source.node)].path in self.acting:
            stand_in = self.graph.add(type("StandIn", (hfg.Node,), {"out": hfg.Event(Any), "__module__": __name__})())
            stand_in.out.activates(slot)
            self.waiting.setdefault(edge.source.node, []).append((edge.source.name, stand_in))

    def _enclose(self) -> None:
        """Put those subgraphs around the puppets that take part themselves, the inner ones first (rules G1, G2)."""
        scopes = [scope for scope in self.flat.scopes if scope_end(scope.index) in self.waiting]
        inside: dict[str, str] = {}  # what lies where now: a node or box, by the name at the top
        for scope in sorted(scopes, key=lambda one: -one.path.count("/")):
            members = {self.flat.nodes[index].path for index in scope.members} & set(self.puppets)
            tops = {inside.get(path, self.puppets[path].place.name) for path in members}
            name = _identifier("b_", scope.path)
            self.graph.edit(commands.Enclose(tuple(sorted(tops)), name))
            inside |= dict.fromkeys(members, name)
            box = self.boxes[scope.path] = self.graph[name]
            set_options(box, msgspec.structs.replace(box._options, active_for_s=_LIMIT_S))
            for event, stand_in in self.waiting[scope_end(scope.index)]:
                for edge in [one for one in self.graph.edges if one.source is stand_in.out]:
                    self.graph.connect(box.ports.events[event], edge.target, active=True)
                self.graph.edit(commands.Remove(stand_in.place.name))

    async def play(self) -> ActivityReplay:
        counted = _Counted({puppet.place.path: path for path, puppet in self.puppets.items()}, self.verdict.nodes)
        async with hfg.running(self.graph, trace=counted.see) as run:
            await run.wait_quiet()
            counted.rest()
            for step in self.verdict.steps:
                await self._take(run, step)
                await run.wait_quiet()
                counted.rest()
            paths = {puppet.place.path: path for path, puppet in self.puppets.items()}
            active = tuple(sorted(paths[path] for path in run.active() if path in paths))
            is_broken = counted.most > 1 or (self.verdict.claim == "exactly one" and counted.least == 0)
            return ActivityReplay(counted.most, counted.least, active, "" if is_broken else self._unknown())

    def _unknown(self) -> str:
        """Name the activity that lies on an edge during a step, which puppets do not let happen."""
        before: tuple[str, ...] = ()
        for step in self.verdict.steps:
            waiting = [edge for edge in before if edge in step.under_way]
            if waiting:
                return (
                    f'activity lies on "{waiting[0]}" while {step.text}: a puppet takes it earlier, so whether a run '
                    "can be that slow is unknown"
                )
            before = step.under_way
        return "the steps did not add up with puppets, so whether a run can take them is unknown"

    async def _take(self, run: hfg.Run, step: Step) -> None:
        puppet = self.puppets.get(step.path)
        if step.kind in ("gets back", "loses"):
            raise UsageError(f'no puppet can play the step "{step.text}": it needs a node that is disabled')
        if puppet is None:
            if step.kind == "times out":
                await asyncio.sleep(_LIMIT_S)
                return
            raise UsageError(f'no puppet can play the step "{step.text}": the subgraph itself does it')
        if step.kind == "is set":
            await run.trigger(puppet.activate if step.path in step.active else puppet.deactivate)
        elif step.sends:
            await run.trigger(puppet.command, [one for one in step.sends if self._has(step.path, one[0])])

    def _has(self, path: str, port: str) -> bool:
        return _identifier("e_", port) in self.puppets[path]._type.events


def _takes(name: str) -> Callable[[Any], None]:
    def take(self: Any) -> None:
        """Receive activity."""

    take.__name__ = take.__qualname__ = name
    return take


class _Counted:
    """Counts the activity of some nodes in a trace."""

    def __init__(self, paths: dict[str, str], nodes: Iterable[str]) -> None:
        wanted = set(nodes)
        self.places = {place for place, path in paths.items() if path in wanted}
        self.active: set[str] = set()
        self.lying = 0
        self.most, self.least = 0, len(self.places)

    def see(self, event: trace.TraceEvent) -> None:
        if isinstance(event, trace.ActivityChanged) and event.node in self.places:
            (self.active.add if event.active else self.active.discard)(event.node)
        elif isinstance(event, trace.TokenSent | trace.TokenTaken | trace.TokenDrained):
            target = event.edge.rpartition(" -> ")[2].rpartition(".")[0]
            if target not in self.places or event.token.activity != 1:
                return
            self.lying += 1 if isinstance(event, trace.TokenSent) else -1
        elif not isinstance(event, trace.FiringEnded | trace.CallEnded):
            return
        if not isinstance(event, trace.TokenSent):  # until it is sent as a whole, the sender is still active (A5)
            self.most = max(self.most, len(self.active) + self.lying)

    def rest(self) -> None:
        """Note how many there are while nothing moves."""
        self.most = max(self.most, len(self.active) + self.lying)
        self.least = min(self.least, len(self.active))

"""Play a counter-example of the analysis of activity in the engine.

The graph is rebuilt from *puppets*: nodes with the same ports and active edges, which send what the counter-example
says. So a replay shows that the rules allow it, not that the code of the nodes does. The run is paused, and each step
of the counter-example is one step of it: activity waits on an edge as long as it has to. Gates only forbid, and are
left out. Calls of a node come in the order in which their tokens have arrived (rule F9), which the analysis forgets. So
a counter-example may be impossible, and the replay says why.
"""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import msgspec

import hfg
from hfg import commands, trace
from hfg.analysis import Step, Verdict
from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, flatten, scope_end
from hfg.graph.structure.membership import set_options

__all__ = ["ActivityReplay", "replay_activity"]

_GO: Final = "go"
_LIMIT_S: Final = 1.0
_MOST_AHEAD: Final = 8  # commands that wait at a puppet; its queue has place for more
_AUTOMATIC: Final = ("activate", "deactivate")
_MISSED: Final = "the steps did not add up with puppets, so whether a run can take them is unknown"


@dataclass(frozen=True)
class ActivityReplay:
    """The course of a counter-example in the engine.

    Attributes:
      most: how many of its nodes were active at once at most; activity in transit to one of them counts.
      least: how many at least, after the start of the run.
      active: the nodes that are active at the end, once what lay on edges has been taken.
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
        return runner.run(_Replay(_Puppets(flatten(graph), verdict.steps), verdict).play())


class _Replay:
    """One replay of a counter-example."""

    def __init__(self, puppets: _Puppets, verdict: Verdict) -> None:
        self.puppets = puppets
        self.verdict = verdict
        paths = {part.puppet.place.path: path for path, part in puppets.parts.items()}
        self.paths = paths
        self.counted = _Counted({place for place, path in paths.items() if path in verdict.nodes})
        self.arrived = Counter[str]()  # by slot of a puppet: tokens with +1 or -1
        self.taken: list[tuple[str, int]] = []  # slot and modifier of each token

    def see(self, event: trace.TraceEvent) -> None:
        """Follow the trace."""
        self.counted.see(event)
        if isinstance(event, trace.TokenSent | trace.TokenTaken):
            slot = event.edge.rpartition(" -> ")[2]
            if isinstance(event, trace.TokenTaken):
                self.taken.append((slot, event.token.activity))
            elif event.token.activity:
                self.arrived[slot] += 1

    async def play(self) -> ActivityReplay:
        """Play all steps, as far as the rules let them."""
        first = self.puppets.first
        async with hfg.running(self.puppets.graph, trace=self.see) as run:
            run.pause()
            await run.wait_paused()
            for part in self.puppets.parts.values():
                await self._bring(run, part)
            await run.trigger(first.command, _GO)
            await run.step(first)
            why = await self._play(run)
            run.resume()
            await run.wait_quiet()
            active = tuple(sorted(self.paths[path] for path in run.active() if path in self.paths))
        most, least = self.counted.most, self.counted.least
        is_broken = most > 1 or (self.verdict.claim == "exactly one" and least == 0)
        return ActivityReplay(most, least, active, "" if is_broken else why or _MISSED)

    async def _play(self, run: hfg.Run) -> str:
        """Play the steps one by one; return why one of them cannot be, by the rules."""
        self.counted.rest()
        for step in self.verdict.steps:
            for part in self.puppets.parts.values():
                await self._bring(run, part)
            why = await self._step(run, step)
            if why:
                return why
            self.counted.rest()
        return ""

    async def _step(self, run: hfg.Run, step: Step) -> str:
        part = self.puppets.parts.get(step.path)
        if part is None:
            await self._step_of_box(run, step)
            return ""
        if part.is_over(step):
            return ""
        wanted = part.slot_of(step)
        part.done += 1
        while True:
            before = len(self.taken)
            moved = await run.step(part.puppet)
            if not moved.moved:
                return f"{step.text}: the rules do not allow this then, since {moved.why_not}"
            slot, modifier = self.taken[before]
            if slot == wanted:
                return ""
            if modifier:
                return f'{step.text}: by rule F9 "{step.path}" first takes what had arrived before'

    async def _step_of_box(self, run: hfg.Run, step: Step) -> None:
        if step.kind == "times out":
            await asyncio.sleep(_LIMIT_S)
        elif step.kind == "is set":
            await run.trigger(self.puppets.boxes[step.path].deactivate)
        elif step.kind == "loses":
            await run.step(self.puppets.sink)

    async def _bring(self, run: hfg.Run, part: _Part) -> None:
        """Send a puppet the commands that come before the next token with activity, which has not arrived."""
        while part.queued < len(part.steps) and part.queued - part.done < _MOST_AHEAD:
            step = part.steps[part.queued]
            slot = part.slot_of(step)
            if step.takes:
                if self.arrived[slot] <= part.expected[slot]:
                    return
                part.expected[slot] += 1
            elif step.kind == "is set":
                await run.trigger(slot)
            else:
                await run.trigger(slot, _GO)
            part.queued += 1


# --- puppets


@dataclass
class _Part:
    """What one puppet has to do.

    Attributes:
      puppet: the node.
      slots: by the label of an edge, the slot of the puppet that it leads to.
      steps: its steps, in order.
      queued: for how many of them the token is there.
      done: how many are over.
      expected: by slot, how many of the tokens that have arrived belong to steps that count as queued.
    """

    puppet: Any
    slots: dict[str, str] = field(default_factory=dict)
    steps: list[Step] = field(default_factory=list)
    queued: int = 0
    done: int = 0
    expected: Counter[str] = field(default_factory=Counter)

    def add(self, step: Step) -> None:
        """Let it take part in a step."""
        if self.is_over(step):
            return
        self.steps.append(step)
        if step.kind not in ("is set", "takes -1") and self.slots.get(step.takes) not in _AUTOMATIC:
            self.puppet.script.append(step.sends)

    def is_over(self, step: Step) -> bool:
        """Return whether a step only says that a firing or call is over; those of a puppet are over at once."""
        return step.kind == "takes" and not step.takes

    def slot_of(self, step: Step) -> str:
        """Return the path of the slot that is called in a step."""
        name = "command"
        if step.takes:
            name = self.slots[step.takes]
        elif step.kind == "is set":
            name = "activate" if step.path in step.active else "deactivate"
        return f"{self.puppet.place.path}.{name}"


class _Puppets:
    """A graph of puppets.

    Attributes:
      graph: the graph.
      parts: what each puppet has to do, by the path of its node.
      boxes: the subgraphs that take part themselves, by path.
      first: sends what `start` sends.
      sink: takes activity that is lost, or that leaves the graph.
    """

    def __init__(self, flat: FlatGraph, steps: Sequence[Step]) -> None:
        for step in steps:
            if step.kind == "gets back" or (step.kind == "loses" and "discarded" in step.text):
                raise UsageError(f'no puppet can play the step "{step.text}": it needs a node that is disabled')
        self.flat = flat
        self.graph = Graph("puppets")
        self.edges = [edge for edge in flat.edges if edge.active]
        self.parts: dict[str, _Part] = {}
        self.boxes: dict[str, Any] = {}
        self.first = self._made("first", {"e_start": hfg.Event(Any), "command": hfg.slot(_starts)})
        self.sink = self._made("sink", {"s_lost": hfg.slot(_receives)})
        self._acting = {step.path for step in steps}
        self._timed = {step.path for step in steps if step.kind == "times out"}
        self._waiting: dict[int, list[tuple[str, Any]]] = {}  # per subgraph its events, each with a stand-in
        ends = {end for edge in self.edges for end in (edge.source.node, edge.target.node) if end > ROOT}
        ends |= {index for index, node in enumerate(flat.nodes) if node.path in self._acting}
        for index in sorted(ends):
            self._add(index)
        for step in steps:
            if step.path in self.parts:
                self.parts[step.path].add(step)
        for edge in self.edges:
            self._connect(edge)
        self._enclose()

    def _made(self, name: str, body: dict[str, Any]) -> Any:
        return self.graph.add(type("Puppet", (hfg.Node,), {"__module__": __name__, **body})(), name=name)

    def _add(self, index: int) -> None:
        """Make a puppet with an event for each port that sends over an active edge, and a slot for each that takes."""
        body: dict[str, Any] = {"command": hfg.slot(_acts)}
        slots: dict[str, str] = {}
        for edge in self.edges:
            if edge.source.node == index:
                body[_identifier("e_", edge.source.name)] = hfg.Event(Any)
            if edge.target.node == index:
                name = edge.target.name
                slots[edge.label] = name if name in _AUTOMATIC else _identifier("s_", name)
        body |= {name: hfg.slot(_acts) for name in slots.values() if name not in _AUTOMATIC}
        path = self.flat.nodes[index].path
        puppet = self._made(_identifier("n_", path), body)
        puppet.script = deque[tuple[tuple[str, int | None, int], ...]]()
        self.parts[path] = _Part(puppet, slots)

    def _connect(self, edge: FlatEdge) -> None:
        target = self.sink.s_lost
        if edge.target.node > ROOT:
            part = self.parts[self.flat.nodes[edge.target.node].path]
            target = part.puppet.ports.slots[part.slots[edge.label]]
        if edge.source.node > ROOT:
            source = self.parts[self.flat.nodes[edge.source.node].path].puppet
            source.ports.events[_identifier("e_", edge.source.name)].activates(target)
        elif edge.source.node == ROOT:
            if edge.source.name == "start":
                self.first.e_start.activates(target)
        elif self.flat.scopes[scope_end(edge.source.node)].path in self._acting:
            stand_in = self._made(f"stand_in_{edge.index}", {"out": hfg.Event(Any)})
            stand_in.out.activates(target)
            self._waiting.setdefault(edge.source.node, []).append((edge.source.name, stand_in))

    def _enclose(self) -> None:
        """Put those subgraphs around the puppets that take part themselves, the inner ones first (rules G1, G2)."""
        scopes = [scope for scope in self.flat.scopes if scope.path in self._acting]
        inside: dict[str, str] = {}  # what lies where now: a node or box, by the name at the top
        for scope in sorted(scopes, key=lambda one: -one.path.count("/")):
            members = {self.flat.nodes[index].path for index in scope.members} & set(self.parts)
            if not members:
                continue
            tops = {inside.get(path, self.parts[path].puppet.place.name) for path in members}
            name = _identifier("b_", scope.path)
            self.graph.edit(commands.Enclose(tuple(sorted(tops)), name))
            inside |= dict.fromkeys(members, name)
            box = self.boxes[scope.path] = self.graph[name]
            limit = _LIMIT_S if scope.path in self._timed else None
            set_options(box, msgspec.structs.replace(box._options, active_for_s=limit))
            for event, stand_in in self._waiting.get(scope_end(scope.index), ()):
                for edge in [one for one in self.graph.edges if one.source is stand_in.out]:
                    self.graph.connect(box.ports.events[event], edge.target, active=True)
                self.graph.edit(commands.Remove(stand_in.place.name))


def _identifier(prefix: str, name: str) -> str:
    return prefix + "".join(one if one.isalnum() else f"_{ord(one):x}_" for one in name)


def _acts(self: Any, token: hfg.Token[Any]) -> None:
    """Send what the next step says, if this is one: a command, or activity that comes."""
    if (token.value == _GO or token.activity == 1) and self.script:
        for port, modifier, count in self.script.popleft():
            event = self.ports.events.get(_identifier("e_", port))
            for _ in range(count if event is not None else 0):
                event.trigger(activity=modifier)


def _starts(self: Any) -> None:
    self.e_start.trigger(activity=1)


def _receives(self: Any) -> None:
    """Take activity that is lost."""


class _Counted:
    """Counts the activity of some puppets in a trace."""

    def __init__(self, places: set[str]) -> None:
        self.places = places
        self.active: set[str] = set()
        self.lying = 0
        self.most, self.least = 0, len(self.places)

    def see(self, event: trace.TraceEvent) -> None:
        """Follow the trace."""
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
        """Note how many there are between two steps."""
        self.most = max(self.most, len(self.active) + self.lying)
        self.least = min(self.least, len(self.active) + self.lying)

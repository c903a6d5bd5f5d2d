"""Changes the plan of a run as `replanning` says, between firings of the nodes that are touched (rule R4).

Afterwards the plan is what it would be if it were made afresh; what lay on edges that are gone is given back or
counted. Nothing here waits. Stands on `replanning`, `ports`, `wiring` and `modifiers`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hfg.engine.editing.replanning import Replan
from hfg.engine.fusion.specialise import specialise
from hfg.engine.model.core import Core
from hfg.engine.model.scopes import Scope
from hfg.engine.model.worker import DISABLED, ENDED, RATE, REMOVED, RESTING, STARTING, TORN_DOWN, Worker
from hfg.engine.rules import lifecycle, wiring
from hfg.engine.rules.activity import rest
from hfg.engine.rules.agenda import block, note_full
from hfg.engine.rules.ending import drain_left
from hfg.engine.rules.modifiers import discard, touch
from hfg.engine.rules.releasing import release
from hfg.engine.rules.sending import flush_automatic, telling_behind
from hfg.engine.rules.sources import judge_sources
from hfg.engine.runtime import plan, ports
from hfg.engine.runtime.groups import Group
from hfg.graph.flat import FlatEdge, FlatGraph
from hfg.ports.automatic import AUTOMATIC_EVENTS
from hfg.ports.edges import BufferEdge, EventEdge
from hfg.token import Token
from hfg.trace import ActivityLost

__all__ = ["reform"]


def reform(core: Core, how: Replan, come: list[Worker], groups: Mapping[str, Group]) -> list[tuple[Any, FlatEdge]]:
    """Do it; gives back the new edges.

    Args:
      core: the run.
      how: what is to be done.
      come: the workers of the nodes that come, set up already.
      groups: by name.
    """
    reforming = _Reforming(core, how, come, groups)
    reforming.leave()
    new = reforming.exchange() if how.whole else reforming.exchange_a_few()
    reforming.go_on(new)
    return new


class _Reforming:
    def __init__(self, core: Core, how: Replan, come: list[Worker], groups: Mapping[str, Group]) -> None:
        self.core = core
        self.how = how
        self.come = come
        self.groups = groups
        self.touched: dict[Worker, None] = {}  # whose wiring is to be derived anew

    # --- what goes

    def leave(self) -> None:
        """Take what is lost out of the plan; what lies on it stays there for the moment."""
        for edge in self.how.lost:
            edge.live = False
            plan.unwire(edge)
            self.touched |= {edge.source: None, edge.target: None}
        for worker in self.how.gone:
            worker.blocked |= TORN_DOWN | REMOVED
            worker.pending_end = False
            block(worker, REMOVED)
            if worker.queued:
                worker.group.policy.remove(worker)
                worker.queued = False
            worker.step = _no_step

    # --- the plan

    def exchange_a_few(self) -> list[tuple[Any, FlatEdge]]:
        """Put single edges in their places."""
        core, how, flat = self.core, self.how, self.how.flat
        least = len(flat.edges)
        for edge, said in how.edges:
            flat.edges[edge.index] = said
            said.index = edge.index
            edge.via = tuple(core.scopes[scope] for scope in said.via)
            self._say(edge, said)
        for edge in sorted(how.lost, key=lambda one: -one.index):
            del core.edges[edge.index], flat.edges[edge.index]
            least = min(least, edge.index)
        gone = sorted(edge.index for edge in how.lost)
        new: list[tuple[Any, FlatEdge]] = []
        ends = plan.Ends(core, core.workers, self._boundary(), self.groups["loop"])
        for flat_edge, spot in zip(how.new, how.spots, strict=True):
            place = (
                spot
                - sum(1 for index in gone if index < spot)
                + sum(1 for other in how.spots[: len(new)] if other <= spot)
            )
            flat.edges.insert(place, flat_edge)
            edge = plan.make_edge(core, flat_edge, ends)
            core.edges.insert(place, edge)
            new.append((edge, flat_edge))
            least = min(least, place)
        for index in range(least, len(flat.edges)):
            flat.edges[index].index = core.edges[index].index = index
        for edge, flat_edge in new:
            plan.wire(edge, flat_edge)
            self.touched |= {edge.source: None, edge.target: None}
        for scope in core.scopes:
            if scope.watched:
                scope.find_inner_edges()
        return new

    def _boundary(self) -> Worker:
        assert self.core.boundary is not None
        return self.core.boundary

    def exchange(self) -> list[tuple[Any, FlatEdge]]:
        """Make everything as a plan made afresh would have it, of the workers and edges that there are."""
        core, how, flat = self.core, self.how, self.how.flat
        refitted = {worker for worker, _ in how.swapped}
        for edge in core.edges:
            if refitted and (edge.source in refitted or edge.target in refitted) and edge not in how.lost:
                plan.unwire(edge)
        for worker, node in how.swapped:
            names = [()] * len(type(node)._type.outputs)
            plan.fit(worker, node)
            worker.wired_out = tuple(names)
            worker.handlers, worker.plain_handlers = {}, {}
            known = (*worker.type.events, *AUTOMATIC_EVENTS)
            worker.events = {name: event for name, event in worker.events.items() if name in known}
        workers = self._workers(flat)
        self._scopes(flat, workers)
        new = self._edges(flat, workers, refitted)
        self._gates(flat, workers)
        return new

    def _workers(self, flat: FlatGraph) -> list[Worker]:
        """Those that stay and those that come, in order, where they are now."""
        core, how = self.core, self.how
        of_node = {worker.node: worker for worker in (*(worker for worker, _ in how.nodes), *self.come)}
        workers = []
        for node in flat.nodes:
            worker = of_node[node.node]
            workers.append(worker)
            worker.path = node.path
            if worker.options is not node.options:
                self._regroup(worker, node.options)
            if worker.iteration is not None and node.iteration is not None:
                _rename_inside(worker.iteration.core, node.iteration)
        outside = [worker for worker in core.workers if worker.node is None]
        core.workers = [*workers, *outside]
        core.sources = [worker for worker in workers if worker.is_source]
        return workers

    def _regroup(self, worker: Worker, options: Any) -> None:
        """It runs elsewhere from now on."""
        worker.options = options
        group = self.groups[options.group or "loop"]
        if group is worker.group:
            return
        if worker.queued:
            worker.group.policy.remove(worker)
            worker.queued = False
        worker.group, worker.push, worker.push_next = group, group.push, group.push_next
        self.touched[worker] = None
        for edge in (*worker.edges_in(), *worker.all_out_edges()):
            self.touched |= {edge.source: None, edge.target: None}

    def _scopes(self, flat: FlatGraph, workers: list[Worker]) -> None:
        core = self.core
        present = {scope.worker.node: scope for scope in core.scopes if scope.worker is not None}
        owners = []
        scopes: list[Scope] = []
        stay = {flat_scope.subgraph for flat_scope in flat.scopes}
        for node, gone in present.items():
            if node not in stay and not gone.enabled:  # without it they stay as disabled as they were (G1)
                for member in gone.members:
                    member.own_enabled = False
        for worker in workers:
            worker.around = worker.scopes = ()
        core.by_path = {worker.path: worker for worker in workers}
        for flat_scope in flat.scopes:
            scope = present.get(flat_scope.subgraph)
            parent = None if flat_scope.parent is None else scopes[flat_scope.parent]
            if scope is None:
                scope = Scope(flat_scope.index, flat_scope.path, parent)
                owners.append(plan.add_scope(core, flat_scope, scope, self.groups["loop"]))
            else:
                assert scope.worker is not None
                scope.index, scope.path, scope.parent = flat_scope.index, flat_scope.path, parent
                scope.worker.path = flat_scope.path
                core.by_path[flat_scope.path] = scope.worker
                owners.append(scope.worker)
            scopes.append(scope)
            owners[-1].around, owners[-1].scopes = scope.and_around(), ()
            scope.members = [workers[index] for index in flat_scope.members]
            for member in scope.members:
                member.around += (scope,)
        core.scopes = scopes
        core.workers = [*workers, *owners, *core.workers[len(workers) :]]
        for worker in self.come:
            if not worker.own_enabled or any(not scope.enabled for scope in worker.around):
                worker.blocked |= DISABLED

    def _edges(self, flat: FlatGraph, workers: list[Worker], refitted: set[Worker]) -> list[tuple[Any, FlatEdge]]:
        core, how = self.core, self.how
        running = {said: edge for edge, said in how.edges}
        ends = plan.Ends(core, workers, self._boundary(), self.groups["loop"])
        listed, new = [], []
        for said in flat.edges:
            edge = running.get(said)
            if edge is None:
                edge = plan.make_edge(core, said, ends)
                new.append((edge, said))
                plan.wire(edge, said)
            else:
                edge.index, edge.label = said.index, said.label
                edge.via = tuple(core.scopes[scope] for scope in said.via)
                if edge.source in refitted or edge.target in refitted:
                    plan.wire(edge, said)
                self._say(edge, said)
            listed.append(edge)
        core.edges = [*listed, *self._from_outside(refitted)]
        for worker in core.workers:
            worker.wired_out = tuple(tuple(sorted(edges, key=lambda one: one.index)) for edges in worker.wired_out)
            for event in worker.events.values():
                event.edges = tuple(sorted(event.edges, key=lambda one: (one.target_kind == "input", one.index)))
            self.touched[worker] = None
        return new

    def _from_outside(self, refitted: set[Worker]) -> list[Any]:
        """The edges by which signals come into slots from outside the graph."""
        core = self.core
        for key, edge in list(core.outside.items()):
            target: Worker = edge.target
            if target.blocked & REMOVED:
                del core.outside[key]
                self.how.lost.append(edge)
            elif target in refitted:
                plan.lead_in(edge)
            if target.path:
                edge.label = f"outside -> {target.path}.{edge.port_name}"
        return list(core.outside.values())

    def _say(self, edge: Any, said: FlatEdge) -> None:
        """What is said about an edge that stays."""
        if edge.active != said.active:
            edge.active = said.active
            self.touched[edge.source] = None
        if type(edge) is EventEdge:
            return
        before, edge.sequential = edge.sequential, plan.is_sequential(edge)
        edge.follows = plan.follows(edge)
        target: Worker = edge.target
        if not before or edge.sequential:
            return
        # what it has taken is processed by that (F5)
        if edge in target.taken and (target.held or target.busy in ("firing", "ending")):
            target.taken = tuple(one for one in target.taken if one is not edge)
            release((edge,))
        elif edge is target.call_edge and edge.token is None:
            release((edge,))

    def _gates(self, flat: FlatGraph, workers: list[Worker]) -> None:
        core = self.core
        gated = {worker for worker in core.workers if worker.gates_over}
        for worker in core.workers:
            if worker.node is None:
                continue
            worker.gates_over = ()
            worker.gates = []
            worker.paced = bool(worker.options is not None and worker.options.max_rate_hz)
        for scope in core.scopes:
            scope.gates = []
        plan.set_gates(core, flat, workers)
        for worker in core.workers:
            if worker.gates_over and worker not in gated:
                worker.gate_next = float("-inf")  # an idle rate counts from the first firing behind the gate (A11)
        for scope in core.scopes:
            if scope.watched:
                scope.find_inner_edges()
                for member in scope.inside():
                    member.scopes += (scope,)
        plan.mark_scopes(core)

    # --- going on

    def go_on(self, new: list[tuple[Any, FlatEdge]]) -> None:
        """Derive what follows, then let go what lay on edges that are gone."""
        core, how = self.core, self.how
        for worker in self.come:
            worker.blocked &= ~STARTING
            ports.bind_automatic(worker)
        for edge, _ in new:
            edge.live = wiring.is_live(edge)
            if isinstance(edge, BufferEdge | EventEdge) and edge.initial:
                _lay(edge)
                if edge.target.blocked & ENDED:
                    drain_left((edge,))
        touched = [worker for worker in self.touched if not worker.blocked & REMOVED]
        for worker in touched:
            self._bind(worker)
            plan.watch(worker)
            if worker.active_timer is not None:
                worker.active_timer.recount(worker.timeout_leads_somewhere())
        if how.whole:
            for edge in core.edges:
                edge.live = wiring.is_live(edge)
        for worker in touched:
            wiring.rewire(worker)
            if worker.is_source and (worker.gates_over or worker.blocked & (RESTING | RATE)):
                rest(worker)
        with telling_behind(core):
            for edge in how.lost:
                discard(edge, "removed")
                if not isinstance(edge, EventEdge):
                    release((edge,))
            for worker in how.gone:
                if worker.active and worker.scope is None:
                    core.lost_activity += 1
                    if core.trace is not None:
                        core.trace(ActivityLost(core.now(), worker.path))
            touch(core, [scope for scope in core.scopes if scope.watched])
        for worker in touched:
            if not worker.busy:
                flush_automatic(worker)
        lifecycle.disable_around(worker for worker in touched if any(not scope.enabled for scope in worker.around))
        judge_sources(core)

    def _bind(self, worker: Worker) -> None:
        """Let the events of a worker know where they lead now; one that leads nowhere and is automatic is none."""
        for name, event in list(worker.events.items()):
            watched = event.port is not None and event.port._observers
            if not event.edges and name in AUTOMATIC_EVENTS and not watched and worker.node is not None:
                del worker.events[name]
            elif worker.node is not None:
                ports.bind_event(worker, name)
        if worker.node is not None and worker.scope is None:
            self.core.upstairs.bind_ports(worker)
        specialise(worker)


def _lay(edge: Any) -> None:
    """Initial tokens of an edge that begins now (P7)."""
    now = edge.target.core.now()
    edge.queue.extend(Token(value, 0, now, 0) for value in edge.initial)
    if isinstance(edge, EventEdge):
        note_full(edge)


def _rename_inside(core: Core, flat: FlatGraph) -> None:
    """A subgraph that iterates has another path, and so has all inside it."""
    for worker, node in zip(core.workers, flat.nodes, strict=False):
        worker.path = node.path
        if worker.iteration is not None and node.iteration is not None:
            _rename_inside(worker.iteration.core, node.iteration)
    for edge, said in zip(core.edges, flat.edges, strict=False):
        edge.label = said.label
    core.by_path = {worker.path: worker for worker in core.workers if worker.path}


def _no_step(worker: Worker) -> None:
    """It is gone."""
    worker.queued = False

"""From a flattened graph to running nodes and edges (rule G1): everything a token needs is found here, once.

Stands on `graph.flat`, `worker` and `wiring`.
"""

from __future__ import annotations

import inspect
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any

from hfg.engine.model.core import Core
from hfg.engine.model.groups import Group
from hfg.engine.model.scopes import Gate, Scope
from hfg.engine.model.worker import DISABLED, STARTING, UNWIRED, RunningEvent, Worker
from hfg.engine.rules.wiring import is_live, rewire
from hfg.errors import GraphError, UsageError
from hfg.graph.flat import End, FlatEdge, FlatGraph, FlatNode, scope_end
from hfg.graph.flat import Scope as FlatScope
from hfg.ports.edges import BufferEdge, Edge, EventEdge, SyncEdge

__all__ = [
    "Ends",
    "add_scope",
    "build",
    "describe",
    "fit",
    "follows",
    "is_sequential",
    "lead_in",
    "make_edge",
    "make_worker",
    "mark_scope",
    "mark_scopes",
    "prepare_slot",
    "set_gate",
    "set_gates",
    "slots_first",
    "unwire",
    "watch",
    "watch_scope",
    "wire",
]


def build(core: Core, flat: FlatGraph, groups: Mapping[str, Group], *, loop: Group) -> None:
    """Make the workers and edges of a run; nothing is set up and nothing lies on the edges yet."""
    for flat_scope in flat.scopes:
        parent = core.scopes[flat_scope.parent] if flat_scope.parent is not None else None
        core.scopes.append(Scope(flat_scope.index, flat_scope.path, parent))
    workers: list[Worker] = []
    for flat_node in flat.nodes:
        worker = make_worker(core, flat_node, groups)
        workers.append(worker)
        core.by_path[worker.path] = worker
    core.workers = list(workers)
    for flat_scope, scope in zip(flat.scopes, core.scopes, strict=True):
        owner = add_scope(core, flat_scope, scope, loop)
        owner.around = scope.and_around()
        core.workers.append(owner)
        scope.members = [workers[index] for index in flat_scope.members]
        for member in scope.members:
            member.around += (scope,)
    boundary = core.boundary = Worker(core, core.number_workers(), "", None, None, loop)
    core.workers.append(boundary)
    ends = Ends(core, workers, boundary, loop)
    for flat_edge in flat.edges:
        edge = make_edge(core, flat_edge, ends)
        core.edges.append(edge)
        wire(edge, flat_edge)
        if flat_edge.source.kind == "observable":
            core.observables.append((flat_edge.source.port, edge, flat_edge.through))
        elif flat_edge.through:
            core.piped.append((edge, flat_edge.through))
            edge.pipeline = _not_piped_yet
    for worker in core.workers:
        if not worker.own_enabled or any(not scope.enabled for scope in worker.around):
            worker.blocked |= DISABLED
    set_gates(core, flat, workers)
    mark_scopes(core)
    for edge in core.edges:
        edge.live = is_live(edge)
    core.sources = [worker for worker in workers if worker.is_source]


def add_scope(core: Core, flat_scope: FlatScope, scope: Scope, loop: Group) -> Worker:
    """Make the worker on which a subgraph's automatic ports live."""
    owner = Worker(core, core.number_workers(), flat_scope.path, flat_scope.subgraph, None, loop)
    owner.scope = scope
    owner.silent_code = True
    owner.active_for_s = flat_scope.options.active_for_s
    scope.enabled = flat_scope.options.enabled
    scope.worker = owner
    core.by_path[owner.path] = owner
    return owner


def set_gates(core: Core, flat: FlatGraph, workers: list[Worker]) -> None:
    """Couple the work of gated nodes to the activity of others (A11)."""
    for flat_gate in flat.gates:
        by, target = flat_gate.by, flat_gate.target
        state = core.scopes[scope_end(by)] if by < 0 else workers[by]
        gated = core.scopes[scope_end(target)].members if target < 0 else [workers[target]]
        set_gate(core, state, gated, flat_gate.idle_rate_hz)


def set_gate(core: Core, state: Worker | Scope, gated: Iterable[Worker], idle_rate_hz: float | None) -> None:
    """Let some nodes work only while a state is active."""
    gate = Gate(state, idle_rate_hz)
    gate.workers = list(gated)
    for worker in gate.workers:
        worker.gates_over += (gate,)
        worker.paced = worker.paced or worker.is_source
    state.gates.append(gate)
    core.gates.append(gate)


class Ends:
    """Finds the worker at the end of an edge; the graph's own inputs and outputs each have one."""

    def __init__(self, core: Core, workers: list[Worker], boundary: Worker, loop: Group) -> None:
        self.core = core
        self.workers = workers
        self.boundary = boundary
        self.loop = loop
        self.feeds: dict[str, Worker] = {worker.port_name: worker for worker in core.feeds}
        self.readers: dict[str, Worker] = {worker.port_name: worker for worker in core.readers}

    def of(self, end: End) -> Worker:
        """Give the worker."""
        if end.node >= 0:
            return self.workers[end.node]
        if end.node < -1:
            owner = self.core.scopes[-2 - end.node].worker
            assert owner is not None
            return owner
        return self._at_border(end)

    def scopes_of(self, flat: FlatEdge) -> tuple[Scope, ...]:
        """Give the scopes through whose ports an edge passes."""
        return tuple(self.core.scopes[scope] for scope in flat.via)

    def _at_border(self, end: End) -> Worker:
        if end.kind == "output":
            return self._outside(self.feeds, end.name, self.core.feeds)
        if end.kind == "input":
            return self._outside(self.readers, end.name, self.core.readers)
        if end.kind == "observable":
            return self._outside({}, end.name, [])
        return self.boundary

    def _outside(self, known: dict[str, Worker], name: str, listed: list[Worker]) -> Worker:
        worker = known.get(name)
        if worker is None:
            worker = known[name] = Worker(self.core, self.core.number_workers(), "", None, None, self.loop)
            worker.port_name = name
            self.core.workers.append(worker)
            listed.append(worker)
            if known is self.feeds:
                worker.wired_out = ((),)
                worker.out_names = (name,)
            else:
                worker.is_boundary_output = known is self.readers
        return worker


# What all nodes of a type share.
_shared: dict[Any, tuple[tuple[Any, ...], tuple[bool, ...], tuple[str, ...], tuple[str, ...]]] = {}


def make_worker(core: Core, flat_node: FlatNode, groups: Mapping[str, Group]) -> Worker:
    """Make the worker of a node; it has no edges yet."""
    options = flat_node.options
    group = groups[options.group or "loop"]
    worker = Worker(core, core.number_workers(), flat_node.path, flat_node.node, options, group)
    fit(worker, flat_node.node)
    worker.wired_out = ((),) * len(worker.out_names)
    worker.active_for_s = options.active_for_s
    worker.paced = bool(options.max_rate_hz)
    worker.own_enabled = options.enabled
    if worker.is_source:
        worker.blocked |= STARTING
    if flat_node.iteration is not None:
        worker.iteration = core.upstairs.iteration(worker, flat_node.iteration, groups, groups["loop"])
        worker.process = worker.iteration.begin
        worker.is_source = False
        worker.blocked &= ~STARTING
    if group.threaded and _waits(worker):
        raise GraphError(
            f'node "{worker.path}" is async, but its group "{group.name}" is a thread: async code runs on '
            f"the loop; leave out group=, or make the "
            f"function a plain one"
        )
    return worker


def fit(worker: Worker, node: Any) -> None:
    """Find what a worker needs of its node."""
    worker.node = node
    node_type = worker.type = type(node)._type
    shared = _shared.get(node_type)
    if shared is None:
        inputs = node_type.inputs.values()
        shared = _shared[node_type] = (
            tuple(spec.default for spec in inputs),
            tuple(spec.token for spec in inputs),
            tuple(spec.name for spec in inputs if not spec.optional),
            tuple(node_type.outputs),
        )
    worker.unset, worker.wants_token, worker.mandatory_ports, worker.out_names = shared
    worker.is_source = node_type.is_source
    worker.is_async = node_type.process_kind.startswith("async")
    worker.silent_code = node_type.is_function
    worker.process = node._process_call() if node_type.process_kind != "none" else None
    worker.ready_hook = None if worker.silent_code else node._hook("ready")
    worker.has_hooks = not worker.silent_code and (
        node._hook("on_activated") is not None or node._hook("on_deactivated") is not None
    )


def _waits(worker: Worker) -> bool:
    return worker.is_async or any(spec.is_async for spec in worker.type.slots.values())


def make_edge(core: Core, flat: FlatEdge, ends: Ends) -> Any:
    """Make a running edge; it is not wired yet."""
    source = ends.of(flat.source)
    target = ends.of(flat.target)
    edge: Any
    if flat.is_event_edge:
        edge = EventEdge(
            flat.index, flat.label, flat.active, flat.capacity, flat.overflow, flat.capacity_limit, flat.initial
        )
    elif flat.initial or flat.buffer:
        edge = BufferEdge(flat.index, flat.label, flat.active, flat.initial, flat.buffer)
    else:
        edge = SyncEdge(flat.index, flat.label, flat.active)
    edge.source, edge.target, edge.waits = source, target, source
    if type(edge) is not EventEdge:
        edge.sequential = is_sequential(edge)
        edge.follows = follows(edge)
    edge.via = ends.scopes_of(flat)
    edge.port_name = flat.target.name
    describe(edge, flat)
    return edge


def describe(edge: Any, flat: FlatEdge) -> None:
    """Note what a running edge stands for in the drawn graph."""
    edge.segments = flat.segments
    edge.source_port, edge.target_port = flat.source.port, flat.target.port


def wire(edge: Any, flat: FlatEdge) -> None:
    """Lead an edge from its source to its target, in its place in the order."""
    source = edge.source
    _into(edge, edge.target, flat)
    if flat.source.kind == "observable":
        source.out_edges = ()
    elif flat.is_event_edge:
        event = source.events.get(flat.source.name)
        if event is None:
            port = flat.source.port if source.node is not None or flat.source.name == "start" else None
            event = source.events[flat.source.name] = RunningEvent(source, flat.source.name, port)
        event.edges = tuple(sorted((*event.edges, edge), key=slots_first))
    else:
        _out_of(edge, source, flat)


def unwire(edge: Any) -> None:
    """Take an edge away from its source and target; what lies on it stays."""
    source, target = edge.source, edge.target
    target.in_edges = tuple(one for one in target.in_edges if one is not edge)
    target.slot_edges = tuple(one for one in target.slot_edges if one is not edge)
    for event in source.events.values():
        if edge in event.edges:
            event.edges = tuple(one for one in event.edges if one is not edge)
    wired = [tuple(one for one in edges if one is not edge) for edges in source.wired_out]
    names = list(source.out_names)
    declared = len(source.type.outputs) if source.type is not None else len(names)
    for position in reversed(range(declared, len(names))):
        if not wired[position]:  # a parameter's output that nobody is connected to any more (P8)
            del wired[position], names[position]
    source.wired_out, source.out_names = tuple(wired), tuple(names)


def slots_first(edge: Edge) -> tuple[bool, float]:
    """The order in which the signals of an event leave (F9)."""
    return (edge.target_kind == "input", edge.index)


def _by_index(edge: Edge) -> float:
    return edge.index


def _not_piped_yet(token: Any) -> None:
    """Stands for the operators of an edge until all nodes are set up."""
    raise UsageError("an event with operators on its edge was triggered in setup(): trigger it in a firing or a slot")


def is_sequential(edge: Any) -> bool:
    """F5: the consumer's mode; `auto` is sequential within a group. A delay ends the wave whatever the mode (P7)."""
    source: Worker = edge.source
    target: Worker = edge.target
    release = target.options.release if target.options is not None else "pipelined"
    if type(edge) is BufferEdge and edge.initial:
        return False
    if release == "auto":
        return source.group is target.group
    return bool(release == "sequential")


def follows(edge: Any) -> bool:
    """R2: what a firing enables by an edge goes next; what comes from outside is a wave of its own."""
    source: Worker = edge.source
    target: Worker = edge.target
    return edge.sequential and source.options is not None and source.group is target.group and source.group.depth_first


def _into(edge: Edge, target: Worker, flat: FlatEdge) -> None:
    kind = flat.target.kind
    if kind == "slot":
        edge.target_kind = "slot"
        _handler(target, flat.target.name)
        edge.while_active = _listens_while_active(target, flat.target.name)
    elif kind == "parameter":
        edge.target_kind = "parameter"
    if kind == "slot":
        target.slot_edges += (edge,)
        if target.calls is None:
            target.calls = deque()
        edge.handler = target.plain_handlers.get(flat.target.name)
        return
    if kind == "input" and target.type is not None:
        edge.position = list(target.type.inputs).index(flat.target.name)
        edge.mandatory = not target.type.inputs[flat.target.name].optional
    elif kind == "input":
        edge.mandatory = True
    else:
        edge.position = len(target.type.inputs) + list(target.type.parameters).index(flat.target.name)
    target.in_edges = tuple(sorted((*target.in_edges, edge), key=lambda one: one.position))


def _listens_while_active(target: Worker, name: str) -> bool:
    spec = target.type.slots.get(name) if target.type is not None and target.scope is None else None
    return spec is not None and spec.while_active


def _handler(target: Worker, name: str) -> None:
    """Look the slot's code up once."""
    if target.node is None or target.scope is not None or name in target.handlers or name not in target.type.slots:
        return
    if not target.handlers:
        target.handlers, target.plain_handlers = {}, {}
    target.handlers[name] = target.node._slot_call(name)
    spec = target.type.slots[name]
    handler = target.node._handler(name)
    if handler is not None and not spec.token and not inspect.iscoroutinefunction(handler):
        target.plain_handlers[name] = handler if spec.takes_value else lambda _value: handler()


def lead_in(edge: Any) -> None:
    """Lead an edge from outside the graph into its slot."""
    worker: Worker = edge.target
    worker.slot_edges += (edge,)
    if worker.calls is None:
        worker.calls = deque()
    _handler(worker, edge.port_name)
    edge.while_active = _listens_while_active(worker, edge.port_name)
    edge.handler = worker.plain_handlers.get(edge.port_name)


def prepare_slot(worker: Worker, name: str) -> EventEdge:
    """Make the edge by which signals come into a slot from outside the graph; it counts as active (P10, A4)."""
    core = worker.core
    index = core.edges[-1].index + 1 if core.edges else 0
    edge = EventEdge(index, f"outside -> {worker.path}.{name}" if worker.path else f"outside -> {name}", True)
    edge.source = Worker(core, core.number_workers(), "", None, None, worker.group)
    edge.source.blocked |= UNWIRED  # it never fires; only its queue may be full
    edge.target = worker
    edge.target_kind = "slot"
    edge.port_name = name
    worker.slot_edges += (edge,)
    if worker.calls is None:
        worker.calls = deque()
    _handler(worker, name)
    edge.while_active = _listens_while_active(worker, name)
    edge.handler = worker.plain_handlers.get(name)
    if worker.meter is not None:
        worker.meter.measure_slots()
    core.edges.append(edge)
    core.outside[worker.index, name] = edge
    edge.live = is_live(edge)
    if core.started:
        rewire(worker)
    return edge


def _out_of(edge: Edge, source: Worker, flat: FlatEdge) -> None:
    name = flat.source.name
    if name not in source.out_names or (
        flat.source.kind == "parameter" and name not in source.out_names[len(source.type.outputs) :]
    ):
        source.out_names = (*source.out_names, name)  # a parameter's output is made when it is first connected (P8)
        source.wired_out = (*source.wired_out, ())
    names = source.out_names
    position = names.index(name) if flat.source.kind != "parameter" else len(names) - 1 - names[::-1].index(name)
    wired = list(source.wired_out)
    wired[position] = tuple(sorted((*wired[position], edge), key=_by_index))
    source.wired_out = tuple(wired)


def mark_scopes(core: Core) -> None:
    """Find out whose activity somebody cares about; the others cost nothing."""
    for scope in core.scopes:
        mark_scope(scope)
    for worker in core.workers:
        watch(worker)


def mark_scope(scope: Scope) -> None:
    """Find out whether somebody cares about the activity of a subgraph."""
    owner = scope.worker
    assert owner is not None
    interesting = (
        bool(scope.gates)
        or owner.active_for_s is not None
        or any(name in owner.events for name in ("activated", "deactivated", "timeout"))
    )
    if interesting:
        watch_scope(scope)


def watch_scope(scope: Scope) -> None:
    """Somebody cares about A(subgraph): derive it from now on (G2)."""
    if scope.watched:
        return
    scope.watched = True
    scope.find_inner_edges()
    scope.active = scope.told = scope.derive()
    for member in scope.inside():
        member.scopes += (scope,)
        watch(member)
        if member.core.started:
            rewire(member)  # no fast paths


def watch(worker: Worker) -> None:
    """Derive whether changes of its activity have consequences beyond the flag."""
    worker.watched = bool(
        worker.has_hooks
        or worker.scopes
        or worker.gates
        or worker.active_for_s is not None
        or "activated" in worker.events
        or "deactivated" in worker.events
    )

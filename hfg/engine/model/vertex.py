"""What a plan says about one node: its code, and the edges into it and out of it (V of eq. 6, rule G1).

This is structure only. It changes when the plan is made, when something is enabled or disabled, and by an edit, but
never by a firing; the state of a run is in `running_node`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, Final, Generic, Literal

from hfg.engine.model.contracts import NodeT
from hfg.engine.model.core import Core
from hfg.engine.model.events import RunningEvent
from hfg.engine.model.groups import Group
from hfg.engine.model.iteration import Iteration
from hfg.engine.model.scopes import Gate, Scope
from hfg.graph.structure.options import NodeOptions
from hfg.nodetypes.node import Node, NodeType
from hfg.ports.automatic import AUTOMATIC_EVENTS, sent_name, sent_of
from hfg.ports.edges import Edge, EventEdge, SyncEdge

__all__ = ["Shape", "Vertex"]

NOTHING: Final[dict[str, Any]] = {}  # shared by the many that have no handlers; never written

_OF_ACTIVITY: Final = ("on_activated", "on_deactivated", "do")

# What all nodes of a type share: defaults of inputs, which want the token, the mandatory ones, the outputs.
_Shared = tuple[tuple[Any, ...], tuple[bool, ...], tuple[str, ...], tuple[str, ...]]
_shared: dict[NodeType, _Shared] = {}


class Shape:
    """Facts about a vertex that follow from its live edges; computed once, not for each token.

    Attributes:
      sequential: inputs whose tokens are processed when its outputs are (F5).
      pipelined: inputs whose tokens are processed when it has taken them.
      announced: events after the outputs that are used: `sent`, with the position of its output, then `processed` (A9).
      remembers: `failed` carries what it has taken (X1).
      plain: a firing without markers is just a call of its function with the tokens on its inputs.
      direct: the arguments of that call are the values, in the order of its inputs.
      single: the result of the call is the value of its one output.
      outgoing: the edges of that output, slots first (F9).
      gives: activity may leave by one of those edges (A3).
    """

    __slots__ = ("announced", "direct", "gives", "outgoing", "pipelined", "plain", "remembers", "sequential", "single")

    def __init__(self, vertex: Vertex[Any]) -> None:
        kind, debug = vertex.type, vertex.core.debug
        synchronous = [edge for edge in vertex.live_inputs if type(edge) is not EventEdge]
        self.sequential = tuple(edge for edge in synchronous if edge.sequential)
        self.pipelined = tuple(edge for edge in synchronous if not edge.sequential)
        self.announced = _announced(vertex) if vertex.events else ()
        self.remembers = "failed" in vertex.events
        self.plain = not self.remembers and _is_plain(vertex)
        self.direct = (
            self.plain
            and vertex.iteration is None
            and kind.process_kind in ("function", "async")
            and [edge.position for edge in vertex.live_inputs] == list(range(len(vertex.unset)))
            and not any(vertex.wants_token)
        )
        self.single = kind is not None and kind.result == "single" and len(vertex.out_edges) == 1 and not debug
        outgoing: tuple[Any, ...] = vertex.out_edges[0] if self.single else ()
        self.outgoing = tuple(sorted(outgoing, key=lambda edge: edge.target_kind != "slot"))
        self.gives = any(edge.active for edge in outgoing)


def _announced(vertex: Vertex[Any]) -> tuple[tuple[str, int | None], ...]:
    outputs = () if vertex.type is None else enumerate(vertex.type.outputs)
    sent = [(sent_name(output), position) for position, output in outputs if sent_name(output) in vertex.events]
    return (*sent, ("processed", None)) if "processed" in vertex.events else tuple(sent)


def _is_plain(vertex: Vertex[Any]) -> bool:
    options = vertex.options
    return not (
        vertex.process is None
        or vertex.type is None
        or vertex.gates_over
        or vertex.paced
        or vertex.core.debug
        or (options is not None and (options.concurrency > 1 or options.retries))
        or any(edge.ended for edge in vertex.in_edges)
    ) and all(type(edge) is SyncEdge and edge.target_kind == "input" for edge in vertex.live_inputs)


@dataclass(slots=True, eq=False)
class Vertex(Generic[NodeT]):
    """A node, subgraph or graph port in the plan of a run."""

    core: Core[NodeT]
    path: str
    node: Any  # its Node; None for a port of the graph
    options: Any  # its NodeOptions, likewise
    group: Group[NodeT]
    index: int = field(init=False)  # unique in the run; without other meaning
    type: Any = None  # its NodeType
    port_name: str = ""  # of a graph input or output
    is_boundary_output: bool = False

    # its code
    process: Callable[..., Any] | None = None
    is_source: bool = False
    is_async: bool = False
    silent_code: bool = False  # a function: it can neither send nor trigger by itself
    ready_hook: Callable[[], Any] | None = None
    has_hooks: bool = False
    unset: tuple[Any, ...] = ()  # per declared input: its value when absent (P6)
    wants_token: tuple[bool, ...] = ()
    mandatory_ports: tuple[str, ...] = ()
    handlers: dict[str, Any] = field(init=False)  # slot -> callable(token)
    plain_handlers: dict[str, Any] = field(init=False)  # slot -> callable(value or token), unless async
    iteration: Iteration[NodeT] | None = None  # its border, if it iterates (G4)

    # where it runs, and whether
    push: Callable[[NodeT], None] = field(init=False)
    push_next: Callable[[NodeT], None] = field(init=False)
    priority: int = 0
    due_s: float | None = None  # by when after its source it should be done; known where a policy asks for it
    own_enabled: bool = True  # regardless of the subgraphs around it
    active_for_s: float | None = None
    paced: bool = False  # a rate or a throttling gate may delay its firings

    # its edges
    in_edges: tuple[Any, ...] = ()  # into inputs and parameters, in the order of the ports
    live_inputs: tuple[Any, ...] = ()  # those of them that are waited for
    slot_edges: tuple[Any, ...] = ()  # into slots, and signals from outside
    wired_out: tuple[tuple[Any, ...], ...] = ()  # per output, then per connected parameter
    out_edges: tuple[tuple[Any, ...], ...] = ()  # those of them that are live
    out_names: tuple[str, ...] = ()  # of these outputs and parameters
    listeners: tuple[Any, ...] = ()  # per output: its slots that listen only while active
    events: dict[str, RunningEvent[NodeT]] = field(default_factory=dict)  # with an edge or a subscriber
    shape: Shape = field(init=False)  # what follows from all this for each firing

    # whose activity depends on whose
    scope: Scope[NodeT] | None = None  # of a subgraph, whose automatic ports it has
    within: Iteration[NodeT] | None = None  # the innermost one around it (G4)
    around: tuple[Scope[NodeT], ...] = ()  # the subgraphs around it, outermost first
    scopes: tuple[Scope[NodeT], ...] = ()  # those of them that are watched
    gates_over: tuple[Gate[NodeT], ...] = ()  # it works only while their states are active
    gates: list[Gate[NodeT]] = field(default_factory=list)  # those that depend on its activity
    watched: bool = False  # changes of its activity have consequences beyond the flag

    def __post_init__(self) -> None:
        self.index = self.core.number_node()
        self.handlers = self.plain_handlers = NOTHING
        if self.node is not None:
            self.type = type(self.node)._type
        self.join(self.group)
        options: NodeOptions | None = self.options
        if options is not None:
            self.priority = options.priority
            self.active_for_s = options.active_for_s
            self.own_enabled = options.enabled
            self.paced = bool(options.max_rate_hz)
        self.shape = Shape(self)

    # --- its code -----------------------------------------------------------------------------------------------------

    def fit(self, node: Node) -> None:
        """Take from a node what its firings need. Its edges are connected afterwards; events that it lacks are gone."""
        self.take_node(node)
        kind = self.type
        self.unset, self.wants_token, self.mandatory_ports, self.out_names = _shared.get(kind) or _share(kind)
        self.wired_out = ((),) * len(self.out_names)
        self.handlers = self.plain_handlers = NOTHING
        self.events = {
            name: event
            for name, event in self.events.items()
            if name in kind.events or name in AUTOMATIC_EVENTS or sent_of(name) in kind.outputs
        }
        self.is_source = kind.is_source
        self.process = node._process_call() if kind.process_kind != "none" else None
        hooks = {name: None if self.silent_code else node._hook(name) for name in ("ready", *_OF_ACTIVITY)}
        self.ready_hook = hooks["ready"]
        self.has_hooks = any([hooks[name] is not None for name in _OF_ACTIVITY])  # noqa: C419 - few

    def take_node(self, node: Node) -> None:
        """Represent another node, whose hooks are about to be called; `fit` does the rest."""
        self.node = node
        self.type = type(node)._type
        self.silent_code = self.type.is_function
        self.is_async = self.type.process_kind.startswith("async")

    def may_wait(self) -> bool:
        """Return whether there is async code in its node."""
        if self.type is None:
            return False
        return self.is_async or "do" in self.type.hooks or any(slot.is_async for slot in self.type.slots.values())

    def iterate(self, iteration: Iteration[NodeT]) -> None:
        """Its process function is the inside of a subgraph, which sees the elements one by one (G4)."""
        self.iteration = iteration
        self.process = self.core.rules.iterate  # `firing` calls it directly; a vertex without one never fires
        self.is_source = False

    def run_by(self, process: Callable[..., Any]) -> None:
        """Run this instead of its node's own process function, to measure that or to take what comes out."""
        self.process = process

    def be_port(self, name: str, kind: Literal["input", "output", "outside"]) -> None:
        """Represent an input or output of the graph (P10), or something outside that only sends signals."""
        self.port_name = name
        self.is_boundary_output = kind == "output"
        if kind == "input":
            self.wired_out = ((),)
            self.out_names = (name,)

    # --- where it is --------------------------------------------------------------------------------------------------

    def join(self, group: Group[NodeT]) -> None:
        """Be one of the nodes of a group."""
        self.group = group
        self.push, self.push_next = group.push, group.push_next

    def rename(self, path: str) -> None:
        """Change its path."""
        self.path = path

    def enable_itself(self, enabled: bool) -> bool:
        """Set whether it is enabled, regardless of the subgraphs around it. Return whether that is new."""
        before, self.own_enabled = self.own_enabled, enabled
        return before != enabled

    def set_options(self, options: NodeOptions) -> None:
        """Use these options from now on; `regroup` handles the group that they name."""
        self.options = options

    def enclose(self, around: tuple[Scope[NodeT], ...]) -> None:
        """Place it in these subgraphs, outermost first."""
        self.around = around
        self.scopes = tuple(scope for scope in around if scope.watched and scope is not self.scope)

    def be_within(self, iteration: Iteration[NodeT]) -> None:
        """Place it in a subgraph that iterates (G4)."""
        self.within = iteration

    # --- whose activity depends on whose (A11, G2) --------------------------------------------------------------------

    def be_gated(self, gate: Gate[NodeT] | None) -> None:
        """Work only while the state of this gate is active too; None: no gate is over it any more."""
        self.gates_over = () if gate is None else (*self.gates_over, gate)
        rate = self.options is not None and bool(self.options.max_rate_hz)
        self.paced = rate or (self.is_source and bool(self.gates_over))

    def forget_gates(self) -> None:
        """No gate depends on its activity."""
        self.gates = []

    def watch(self, scope: Scope[NodeT] | None = None) -> None:
        """Derive whether changes of its activity have consequences; `scope`: one around it that is watched from now."""
        if scope is not None:
            self.scopes += (scope,)
        self.watched = bool(
            self.has_hooks
            or self.scopes
            or self.gates
            or self.active_for_s is not None
            or "activated" in self.events
            or "deactivated" in self.events
        )

    # --- its edges ----------------------------------------------------------------------------------------------------

    def lead_in(self, edge: Edge, kind: str, name: str) -> None:
        """Connect an edge to one of its ports, in the order of the ports."""
        if kind == "slot":
            self._find_handler(name)
            spec = self.type.slots.get(name) if self.type is not None and self.scope is None else None
            edge.enter_slot(name, self.plain_handlers.get(name), spec)
            self.slot_edges += (edge,)
            return
        if kind == "parameter":
            edge.enter(kind, name, len(self.type.inputs) + list(self.type.parameters).index(name), False)
        elif self.type is not None:
            edge.enter(kind, name, list(self.type.inputs).index(name), not self.type.inputs[name].optional)
        else:
            edge.enter(kind, name, 0, True)
        self.in_edges = tuple(sorted((*self.in_edges, edge), key=attrgetter("position")))

    def _find_handler(self, name: str) -> None:
        """Find the slot's code, once."""
        if self.node is None or self.scope is not None or name in self.handlers or name not in self.type.slots:
            return
        if not self.handlers:
            self.handlers, self.plain_handlers = {}, {}
        self.handlers[name] = self.node._slot_call(name)
        spec = self.type.slots[name]
        handler = self.node._handler(name)
        if handler is not None and not inspect.iscoroutinefunction(handler):
            self.plain_handlers[name] = handler if spec.takes_value or spec.token else lambda _value: handler()

    def lead_out(self, edge: Edge, kind: str, name: str) -> None:
        """Connect an edge to an output, or to a parameter, whose output is made when it is first connected (P8)."""
        declared = 0 if kind != "parameter" else len(self.type.outputs)
        if name not in self.out_names[declared:]:
            self.out_names = (*self.out_names, name)
            self.wired_out = (*self.wired_out, ())
        position = self.out_names.index(name, declared)
        wired = list(self.wired_out)
        wired[position] = tuple(sorted((*wired[position], edge), key=attrgetter("index")))
        self.wired_out = tuple(wired)

    def lose_incoming(self, edge: Edge) -> None:
        """Disconnect an edge that leads into it."""
        self.in_edges = tuple(one for one in self.in_edges if one is not edge)
        self.slot_edges = tuple(one for one in self.slot_edges if one is not edge)

    def lose_outgoing(self, edge: Edge) -> None:
        """Disconnect an edge that leads out of it; a parameter without edges has no output any more (P8)."""
        for event in self.events.values():
            if edge in event.edges:
                event.feed(tuple(one for one in event.edges if one is not edge))
        wired = [tuple(one for one in edges if one is not edge) for edges in self.wired_out]
        declared = self._declared_outputs()
        left = [number for number, edges in enumerate(wired) if number < declared or edges]
        self.wired_out = tuple(wired[number] for number in left)
        self.out_names = tuple(self.out_names[number] for number in left)

    def sort_outgoing(self) -> None:
        """Sort the edges of each output and event, and the outputs of its parameters (P8)."""
        for event in self.events.values():
            event.feed(event.edges)
        declared = self._declared_outputs()
        wired = [tuple(sorted(edges, key=attrgetter("index"))) for edges in self.wired_out]
        made = sorted(zip(self.out_names[declared:], wired[declared:], strict=True), key=lambda one: one[1][0].index)
        self.out_names = (*self.out_names[:declared], *(name for name, _ in made))
        self.wired_out = (*wired[:declared], *(edges for _, edges in made))

    def _declared_outputs(self) -> int:
        return len(self.type.outputs) if self.type is not None else len(self.out_names)

    def wait_for(self, live_inputs: tuple[Any, ...]) -> None:
        """Wait for these inputs, and send on the edges that are live now."""
        self.live_inputs = live_inputs
        self.out_edges = tuple(tuple(edge for edge in edges if edge.live) for edges in self.wired_out)
        self.shape = Shape(self)

    def add_event(self, event: RunningEvent[NodeT]) -> None:
        """One of its events has an edge or a subscriber from now on."""
        self.events[event.name] = event
        self.shape = Shape(self)

    def remove_event(self, event: RunningEvent[NodeT]) -> None:
        """This event has neither any more."""
        del self.events[event.name]
        self.shape = Shape(self)

    def edges_in(self) -> tuple[Any, ...]:
        """Return all edges into it, including those into slots."""
        return self.in_edges + self.slot_edges

    def all_out_edges(self) -> Iterator[Any]:
        """Yield all edges out of it, live or not."""
        for edges in self.wired_out:
            yield from edges
        yield from self.event_edges()

    def event_edges(self) -> Iterator[EventEdge]:
        """Yield the edges of its events."""
        for event in self.events.values():
            yield from event.edges

    def timeout_leads_somewhere(self) -> bool:
        """Return whether its event `timeout` has an edge or a subscriber (docs/semantics.md, "quiet")."""
        event = self.events.get("timeout")
        return event is not None and bool(event.edges or (event.port is not None and event.port._observers))


def _share(kind: NodeType) -> _Shared:
    inputs = kind.inputs.values()
    found = _shared[kind] = (
        tuple(spec.default for spec in inputs),
        tuple(spec.token for spec in inputs),
        tuple(spec.name for spec in inputs if not spec.optional),
        tuple(kind.outputs),
    )
    return found

"""What a plan says of one node: whose code it is, and which edges lead into it and out of it (V of eq. 6, rule G1).

Structure alone. It is written when the plan is made, when something is enabled or disabled, and by an edit, never by a
firing; what happens there while the graph runs is in `worker`. Stands on `core`, `groups`, `scopes` and `iteration`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any, Final, Generic

from hfg.engine.model.contracts import NodeT
from hfg.engine.model.core import Core
from hfg.engine.model.events import RunningEvent
from hfg.engine.model.groups import Group
from hfg.engine.model.iteration import Iteration
from hfg.engine.model.scopes import Gate, Scope
from hfg.engine.model.shape import Shape
from hfg.graph.structure.options import NodeOptions
from hfg.nodetypes.node import Node, NodeType
from hfg.ports.automatic import AUTOMATIC_EVENTS, sent_of
from hfg.ports.edges import Edge

__all__ = ["Vertex"]

NOTHING: Final[dict[str, Any]] = {}  # shared by the many that have none; never written

_OF_ACTIVITY: Final = ("on_activated", "on_deactivated", "do")

# What all nodes of a type share: what absent inputs give, who wants the token, what must be connected, the outputs.
_Shared = tuple[tuple[Any, ...], tuple[bool, ...], tuple[str, ...], tuple[str, ...]]
_shared: dict[NodeType, _Shared] = {}


class Vertex(Generic[NodeT]):
    """A node, subgraph or graph port in the plan of a run.

    Attributes:
      index: no other vertex of the run has it; of no other meaning.
      node: None for what stands for the outside.
      type: its NodeType, likewise.
      in_edges: into inputs and parameters, in order of the ports.
      live_inputs: those of them that are waited for.
      slot_edges: into slots, and signals from outside.
      wired_out: per output, then per parameter that is connected: its edges.
      out_edges: those of them that are live.
      out_names: of what these come from.
      listeners: per output its slots that listen only while they are active; or ().
      unset: per declared input what an absent one gives (P6).
      handlers: slot -> callable(token).
      plain_handlers: slot -> callable(value), where that is the same.
      silent_code: a function: it can neither send nor trigger by itself.
      port_name: of a graph input or output.
      events: those that somebody asks for, by name.
      iteration: its border, if it is a subgraph that iterates; `within`: that of the innermost one around it (G4).
      scope: it stands for this subgraph's automatic ports.
      around: the subgraphs around it; `scopes`: those of them that are watched.
      paced: a rate or a throttling gate may hold its firings.
      gates_over: it works only while their states are active; `gates`: those that look at its activity.
      watched: changes of its activity have consequences beyond the flag.
      shape: what follows from all that for each of its firings.
    """

    __slots__ = (
        "active_for_s",
        "around",
        "core",
        "events",
        "gates",
        "gates_over",
        "group",
        "handlers",
        "has_hooks",
        "in_edges",
        "index",
        "is_async",
        "is_boundary_output",
        "is_source",
        "iteration",
        "listeners",
        "live_inputs",
        "mandatory_ports",
        "node",
        "options",
        "out_edges",
        "out_names",
        "own_enabled",
        "paced",
        "path",
        "plain_handlers",
        "port_name",
        "priority",
        "process",
        "push",
        "push_next",
        "ready_hook",
        "scope",
        "scopes",
        "shape",
        "silent_code",
        "slot_edges",
        "type",
        "unset",
        "wants_token",
        "watched",
        "wired_out",
        "within",
    )

    def __init__(
        self, core: Core[NodeT], path: str, node: Node | None, options: NodeOptions | None, group: Group[NodeT]
    ) -> None:
        self.core = core
        self.index = core.number_workers()
        self.path = path
        self.node: Any = node
        self.type: Any = type(node)._type if node is not None else None
        self.options: Any = options
        self.join(group)
        self.priority: int = options.priority if options is not None else 0
        self.active_for_s: float | None = options.active_for_s if options is not None else None
        self.paced = options is not None and bool(options.max_rate_hz)
        self.own_enabled = options is None or options.enabled
        self._has_no_code()
        self._has_no_edges()
        self.port_name = ""
        self.is_boundary_output = False
        self.scope: Scope[NodeT] | None = None
        self.within: Iteration[NodeT] | None = None
        self.around: tuple[Scope[NodeT], ...] = ()
        self.scopes: tuple[Scope[NodeT], ...] = ()
        self.gates_over: tuple[Gate[NodeT], ...] = ()
        self.gates: list[Any] = []
        self.watched = False
        self.shape = Shape(self)

    def _has_no_code(self) -> None:
        self.unset: tuple[Any, ...] = ()
        self.wants_token: tuple[bool, ...] = ()
        self.mandatory_ports: tuple[str, ...] = ()
        self.out_names: tuple[str, ...] = ()
        self.silent_code = False
        self.is_source = False
        self.is_async = False
        self.process: Callable[..., Any] | None = None
        self.ready_hook: Callable[[], Any] | None = None
        self.has_hooks = False
        self.iteration: Iteration[NodeT] | None = None

    def _has_no_edges(self) -> None:
        self.in_edges: tuple[Any, ...] = ()
        self.live_inputs: tuple[Any, ...] = ()
        self.slot_edges: tuple[Any, ...] = ()
        self.handlers: dict[str, Any] = NOTHING
        self.plain_handlers: dict[str, Any] = NOTHING
        self.wired_out: tuple[tuple[Any, ...], ...] = ()
        self.out_edges: tuple[tuple[Any, ...], ...] = ()
        self.events: dict[str, RunningEvent[NodeT]] = {}
        self.listeners: tuple[Any, ...] = ()

    # --- whose code it is -------------------------------------------------------------------------------------------

    def fit(self, node: Node) -> None:
        """Take from a node what its firings need. Edges are yet to be led to it; events that it lacks are gone."""
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
        hook = _no_hook if self.silent_code else node._hook
        self.ready_hook = hook("ready")
        self.has_hooks = any([hook(name) is not None for name in _OF_ACTIVITY])  # noqa: C419 - few

    def take_node(self, node: Node) -> None:
        """Stand for another node, whose hooks are about to be called; the rest of it follows by `fit`."""
        self.node = node
        self.type = type(node)._type
        self.silent_code = self.type.is_function
        self.is_async = self.type.process_kind.startswith("async")

    def may_wait(self) -> bool:
        """Whether there is async code in its node."""
        if self.type is None:
            return False
        return self.is_async or "do" in self.type.hooks or any(slot.is_async for slot in self.type.slots.values())

    def iterate(self, iteration: Iteration[NodeT]) -> None:
        """G4: its process function is the inside of a subgraph, which sees the elements one by one."""
        self.iteration = iteration
        self.process = self.core.rules.iterate  # to which `firing` comes by itself; without one it would be no node
        self.is_source = False

    def lie_within(self, iteration: Iteration[NodeT]) -> None:
        """G4: the innermost subgraph around it that iterates is this one's."""
        self.within = iteration

    def run_by(self, process: Callable[..., Any]) -> None:
        """This runs in place of its node's own process function: it measures that, or takes what came out."""
        self.process = process

    def stand_outside(self, name: str) -> None:
        """Stand for what is outside of the graph, under this name."""
        self.port_name = name

    def be_graph_input(self, name: str) -> None:
        """P10: what is fed into this port comes out of it."""
        self.port_name = name
        self.wired_out = ((),)
        self.out_names = (name,)

    def be_graph_output(self, name: str) -> None:
        """P10: what leaves by this port goes into it."""
        self.port_name = name
        self.is_boundary_output = True

    # --- where it is ------------------------------------------------------------------------------------------------

    def join(self, group: Group[NodeT]) -> None:
        """Be one of those that never run at the same time."""
        self.group = group
        self.push: Callable[[NodeT], None] = group.push
        self.push_next: Callable[[NodeT], None] = group.push_next

    def queue_by(self, push: Callable[[NodeT], None], push_next: Callable[[NodeT], None]) -> None:
        """By these it gets into the queue of its group, in place of the group's own."""
        self.push, self.push_next = push, push_next

    def rename(self, path: str) -> None:
        """It is called otherwise from now on."""
        self.path = path

    def enable_itself(self, enabled: bool) -> bool:
        """Whether it is enabled itself, whatever is around it; gives back whether that is new."""
        before, self.own_enabled = self.own_enabled, enabled
        return before != enabled

    def set_options(self, options: NodeOptions) -> None:
        """These are its options from now on; the group that they name is for `regroup`."""
        self.options = options

    def lie_in(self, around: tuple[Scope[NodeT], ...]) -> None:
        """These subgraphs are around it, outermost first."""
        self.around = around
        self.scopes = tuple(scope for scope in around if scope.watched and scope is not self.scope)

    def tell(self, scope: Scope[NodeT]) -> None:
        """G2: a subgraph around it is watched from now on."""
        self.scopes += (scope,)

    # --- who asks for its activity, or has it asked (A11) -------------------------------------------------------------

    def be_gated(self, gate: Gate[NodeT]) -> None:
        """It works only while the state of the gate is active."""
        self.gates_over += (gate,)
        self.paced = self.paced or self.is_source

    def be_ungated(self) -> None:
        """No gate is over it."""
        self.gates_over = ()
        self.paced = self.options is not None and bool(self.options.max_rate_hz)

    def forget_gates(self) -> None:
        """No gate looks at its activity."""
        self.gates = []

    def watch(self) -> None:
        """Derive whether changes of its activity have consequences beyond the flag."""
        self.watched = bool(
            self.has_hooks
            or self.scopes
            or self.gates
            or self.active_for_s is not None
            or "activated" in self.events
            or "deactivated" in self.events
        )

    # --- its edges --------------------------------------------------------------------------------------------------

    def lead_in(self, edge: Edge, kind: str, name: str) -> None:
        """An edge leads into one of its ports from now on, in the order of those."""
        if kind == "slot":
            self._find_handler(name)
            edge.enter_slot(name, self.plain_handlers.get(name), self._listens_while_active(name))
            self.slot_edges += (edge,)
            return
        if kind == "parameter":
            edge.enter(kind, name, len(self.type.inputs) + list(self.type.parameters).index(name), False)
        elif self.type is not None:
            edge.enter(kind, name, list(self.type.inputs).index(name), not self.type.inputs[name].optional)
        else:
            edge.enter(kind, name, 0, True)
        self.in_edges = tuple(sorted((*self.in_edges, edge), key=_by_position))

    def _listens_while_active(self, name: str) -> bool:
        spec = self.type.slots.get(name) if self.type is not None and self.scope is None else None
        return spec is not None and spec.while_active

    def _find_handler(self, name: str) -> None:
        """Look the slot's code up once."""
        if self.node is None or self.scope is not None or name in self.handlers or name not in self.type.slots:
            return
        if not self.handlers:
            self.handlers, self.plain_handlers = {}, {}
        self.handlers[name] = self.node._slot_call(name)
        spec = self.type.slots[name]
        handler = self.node._handler(name)
        if handler is not None and not spec.token and not inspect.iscoroutinefunction(handler):
            self.plain_handlers[name] = handler if spec.takes_value else lambda _value: handler()

    def lead_out(self, edge: Edge, kind: str, name: str) -> None:
        """An edge leads out of an output or parameter; a parameter's is made when it is first connected (P8)."""
        declared = 0 if kind != "parameter" else len(self.type.outputs)
        if name not in self.out_names[declared:]:
            self.out_names = (*self.out_names, name)
            self.wired_out = (*self.wired_out, ())
        position = self.out_names.index(name, declared)
        wired = list(self.wired_out)
        wired[position] = tuple(sorted((*wired[position], edge), key=_by_index))
        self.wired_out = tuple(wired)

    def ask_for(self, event: RunningEvent[NodeT]) -> None:
        """Somebody asks for one of its events: it has an edge, or somebody listens."""
        self.events[event.name] = event
        self.shape = Shape(self)

    def ask_no_more(self, event: RunningEvent[NodeT]) -> None:
        """Nobody asks for this event any more."""
        del self.events[event.name]
        self.shape = Shape(self)

    def lose_incoming(self, edge: Edge) -> None:
        """An edge leads into it no more."""
        self.in_edges = tuple(one for one in self.in_edges if one is not edge)
        self.slot_edges = tuple(one for one in self.slot_edges if one is not edge)

    def lose_outgoing(self, edge: Edge) -> None:
        """An edge leads out of it no more; nor has a parameter an output to which nobody is connected (P8)."""
        for event in self.events.values():
            if edge in event.edges:
                event.feed(tuple(one for one in event.edges if one is not edge))
        declared = self._declared_outputs()
        wired = [tuple(one for one in edges if one is not edge) for edges in self.wired_out]
        left = [number for number, edges in enumerate(wired) if number < declared or edges]
        self.wired_out = tuple(wired[number] for number in left)
        self.out_names = tuple(self.out_names[number] for number in left)

    def sort_outgoing(self) -> None:
        """Let the edges of each output and event be in order, and the outputs that its parameters have got (P8)."""
        for event in self.events.values():
            event.feed(event.edges)
        declared = self._declared_outputs()
        wired = [tuple(sorted(edges, key=_by_index)) for edges in self.wired_out]
        made = sorted(zip(self.out_names[declared:], wired[declared:], strict=True), key=lambda one: one[1][0].index)
        self.out_names = (*self.out_names[:declared], *(name for name, _ in made))
        self.wired_out = (*wired[:declared], *(edges for _, edges in made))

    def _declared_outputs(self) -> int:
        return len(self.type.outputs) if self.type is not None else len(self.out_names)

    def wait_for(self, live_inputs: tuple[Any, ...]) -> None:
        """These inputs are waited for; what it sends on is derived anew from the liveness of its edges."""
        self.live_inputs = live_inputs
        self.out_edges = tuple(tuple(edge for edge in edges if edge.live) for edges in self.wired_out)
        self.shape = Shape(self)

    def edges_in(self) -> tuple[Any, ...]:
        """All edges into it, slots too."""
        return self.in_edges + self.slot_edges

    def all_out_edges(self) -> Iterator[Any]:
        """The same, live or not."""
        for edges in self.wired_out:
            yield from edges
        for event in self.events.values():
            yield from event.edges

    def event_edges(self) -> Iterator[Any]:
        """The edges of its events."""
        for event in self.events.values():
            yield from event.edges

    def timeout_leads_somewhere(self) -> bool:
        """Whether its event `timeout` has an edge or a subscriber (docs/semantics.md, "quiet")."""
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


def _no_hook(_name: str) -> Callable[[], Any] | None:
    """The hooks of a function."""
    return None


def _by_index(edge: Edge) -> float:
    return edge.index


def _by_position(edge: Edge) -> int:
    return edge.position

"""One running node: its two barriers, its agenda, and why it may not move (rules F1, F9).

Plain state, decided over by `firing`, `sending` and `quiet`. A worker has at most one firing or call under way.
Stands on floors 0-4.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Final

from hfg.errors import EngineInternalError
from hfg.ports.barrier import Barrier
from hfg.ports.edges import Edge, EventEdge

if TYPE_CHECKING:
    from hfg.engine.model.core import Core, Region
    from hfg.engine.model.groups import Group
    from hfg.engine.model.scopes import Gate, Scope

__all__ = [
    "AMID_NOTHING",
    "BACKOFF",
    "CALLS_BLOCKED",
    "DISABLED",
    "ENDED",
    "FULL",
    "FUTILE",
    "RATE",
    "REMOVED",
    "RESTING",
    "STARTING",
    "TORN_DOWN",
    "UNREADY",
    "UNWIRED",
    "RunningEvent",
    "Worker",
]

# Why a worker may not fire: bits of Worker.blocked. Zero means that only the barriers count.
DISABLED: Final = 1  # F10
ENDED: Final = 2  # F12; from the moment its end() is called
UNWIRED: Final = 4  # a mandatory input without a live edge, or neither source nor live input (F1)
FULL: Final = 8  # a `wait` edge of its events is full (F8)
RATE: Final = 16  # F11
RESTING: Final = 32  # a source whose gate is closed (A11)
BACKOFF: Final = 64  # between teardown and setup after an error (X1)
UNREADY: Final = 128  # its ready() said no; asked again after each firing, call or wake (F1)
STARTING: Final = 256  # sources, until `start` has been triggered (A10)
FUTILE: Final = 512  # a source that works for ended nodes alone, as all do that are left (R5)
TORN_DOWN: Final = 1024  # the run is ending (R5, X3)
REMOVED: Final = 2048  # an edit took it out of the graph (R4)

CALLS_BLOCKED: Final = FULL | BACKOFF | TORN_DOWN

AMID_NOTHING: Final = ("", "edit", "over")  # values of Worker.busy: automatic events leave at once (A9)

NOTHING: Final[dict[str, Any]] = {}  # shared by the many that have none; never written


class RunningEvent:
    """An event of a running node and the edges it feeds, slots first (D10 of docs/semantics.md, F9)."""

    __slots__ = ("edges", "name", "pipelines", "port", "tap", "worker")

    def __init__(self, worker: Worker, name: str, port: Any) -> None:
        self.worker = worker
        self.name = name
        self.port = port
        self.edges: tuple[Any, ...] = ()
        self.tap: tuple[Any, ...] | None = None  # who looks at its signals; () if at one of its edges only

    @property
    def label(self) -> str:
        """Its path, as traces name it."""
        return f"{self.worker.path}.{self.name}" if self.worker.path else self.name


class Worker:
    """What a node is while its graph runs.

    Attributes:
      inputs: the input barrier; `missing` counts live, not ended input edges without an untaken token.
      outputs: the output barrier; `missing` counts this node's tokens that are not processed.
      blocked: bits from above.
      placed, ahead: a firing is enabled and has its place in the agenda, behind `ahead` slot calls (F9).
      calls: edges whose oldest token waits for a slot call, in order of arrival; None until there is one.
      queued: it stands in its group's run queue.
      follows: what a sequential edge has enabled goes next when the call is over for which it stands there (R2).
      busy: "" or what is under way: "firing", "call", "asking", "ending", "setup"; "edit": an edit holds it;
        "over": what was under way is over, but for what it releases.
      special: something about the next firing is not ordinary (a marker lies on an input ...): the fast step steps
        aside.
      step: runs its next piece of work; chosen for its shape by `specialise`.
      taken: edges whose tokens were taken by the firing under way, or the last one, and are processed when its
        outputs are (F5 sequential).
      right: A3's right to carry activity that A5 took earlier in this firing or call.
      stamp: of what it sends now (T5); None outside a firing or call: the present.
      written: per output what was written in this firing; None until the first.
      events_due: automatic events that follow the firing or call (A9).
    """

    __slots__ = (
        "active",
        "active_for_s",
        "active_timer",
        "ahead",
        "around",
        "backoff_timer",
        "blocked",
        "busy",
        "call_edge",
        "call_number",
        "calls",
        "calls_failed",
        "carrier",
        "core",
        "deferred",
        "end_firings",
        "end_stamp",
        "events",
        "events_due",
        "failed",
        "firings",
        "follows",
        "full_edges",
        "gate_next",
        "gates",
        "gates_over",
        "generator",
        "given_up",
        "grid_start",
        "group",
        "halt",
        "handlers",
        "has_hooks",
        "held",
        "in_edges",
        "in_flight",
        "index",
        "inputs",
        "is_async",
        "is_boundary_output",
        "is_source",
        "is_up",
        "iteration",
        "job",
        "limit_timer",
        "listened",
        "listeners",
        "live_inputs",
        "mandatory_ports",
        "meter",
        "next_period",
        "next_start",
        "node",
        "observed",
        "on_idle",
        "options",
        "out_edges",
        "out_names",
        "outputs",
        "own_enabled",
        "paced",
        "path",
        "pending_end",
        "placed",
        "plain_handlers",
        "port_name",
        "priority",
        "process",
        "push",
        "push_next",
        "queued",
        "rate_timer",
        "ready_hook",
        "region",
        "restarts",
        "right",
        "room_waiters",
        "scope",
        "scopes",
        "silent",
        "silent_code",
        "slot_edges",
        "speaks",
        "special",
        "stamp",
        "step",
        "taken",
        "ticket",
        "tokens",
        "type",
        "unfit",
        "unset",
        "waiting_room",
        "wants_token",
        "watched",
        "wired_out",
        "written",
    )

    def __init__(self, core: Core, index: int, path: str, node: Any, options: Any, group: Group) -> None:
        self.core = core
        self.index = index
        self.path = path
        self.node = node
        self.type: Any = (
            type(node)._type if node is not None else None
        )  # a NodeType; None for what stands for the outside
        self.options = options
        self.group = group
        self.push: Callable[[Worker], None] = group.push
        self.push_next: Callable[[Worker], None] = group.push_next
        self.priority: int = options.priority if options is not None else 0

        self.inputs = Barrier()
        self.outputs = Barrier()
        self.blocked = 0
        self.placed = False
        self.ahead = 0
        self.calls: deque[Any] | None = None
        self.queued = False
        self.follows = False
        self.busy = ""
        self.special = False
        self.step: Callable[[Worker], None] = _not_planned

        # structure, set by the plan and by `wiring.rewire`
        self.in_edges: tuple[Any, ...] = ()  # into inputs and parameters, in order of the ports
        self.live_inputs: tuple[Any, ...] = ()  # those that are waited for
        self.slot_edges: tuple[Any, ...] = ()
        self.out_edges: tuple[tuple[Any, ...], ...] = ()  # per output, then per parameter
        self.out_names: tuple[str, ...] = ()
        self.events: dict[str, RunningEvent] = {}
        self.mandatory_ports: tuple[str, ...] = ()
        self.wired_out: tuple[tuple[Any, ...], ...] = ()  # the same, live or not
        self.listeners: tuple[Any, ...] = ()  # per output: its slots that listen only while they are active; or ()
        self.listened: list[Any] | None = None  # what tells those who send to such slots of its own that it may listen
        self.unset: tuple[Any, ...] = ()  # per declared input what an absent one gives (P6)
        self.wants_token: tuple[bool, ...] = ()
        self.handlers: dict[str, Any] = NOTHING  # slot -> callable(token)
        self.plain_handlers: dict[str, Any] = NOTHING  # slot -> callable(value), where that is the same
        self.silent_code = False  # a function: it can neither send nor trigger by itself
        self.port_name = ""  # of a graph input or output
        self.is_boundary_output = False
        self.scope: Scope | None = None  # it stands for this subgraph's automatic ports
        self.around: tuple[Scope, ...] = ()  # subgraphs around it
        self.scopes: tuple[Scope, ...] = ()  # those of them that are watched
        self.own_enabled = True
        self.paced = False  # a rate or a throttling gate may hold its firings
        self.gates_over: tuple[Gate, ...] = ()  # it works only while their states are active
        self.gates: list[Any] = []  # that look at its activity
        self.active_for_s: float | None = None
        self.halt: Callable[[Callable[[Worker], None]], Callable[[Worker], None]] | None = None  # R3: its breakpoint
        self.region: Region | None = None  # in which its firings are fused
        self.speaks = False  # its code sends by itself: the region says so before each call
        self.unfit = False  # its firings turned out not to be plain calls
        self.observed = False  # somebody waits at its barriers: no short ways
        self.watched = False  # activity changes have consequences beyond the flag
        self.is_source = False
        self.is_async = False
        self.process: Callable[..., Any] | None = None
        self.ready_hook: Callable[[], Any] | None = None
        self.has_hooks = False
        self.iteration: Any = None
        self.meter: Any = None  # a Meter, while somebody wants statistics

        # state of the run
        self.active = False
        self.right = False
        self.stamp: float | None = None
        self.tokens: list[Any] = []
        self.taken: tuple[Any, ...] = ()
        self.held = False  # its inputs are released when its outputs are processed (F5 sequential)
        self.written: list[Any] | None = None
        self.events_due: list[tuple[str, Any]] | None = None
        self.end_stamp: float | None = None  # of the firing that ended it, and so of END (T5)
        self.given_up = False  # a source that counts as ended, though it has not said END (R5)
        self.pending_end = False  # END leaves as soon as the outputs are free (F4)
        self.deferred: list[int] | None = None  # modifiers drained before END was sent (F12)
        self.is_up = False  # its setup has begun, its teardown has not
        self.generator: Any = None
        self.carrier: Any = None
        self.call_edge: Any = None
        self.in_flight = False  # its code waits or runs in a thread
        self.job: Any = None  # what its thread is doing for it
        self.waiting_room = 0  # its code awaits trigger_wait
        self.room_waiters: list[Callable[[], None]] | None = None
        self.on_idle: list[Callable[[], None]] | None = None  # what waits until it is not busy
        self.ticket = 0  # which firing or call a late result belongs to (X2)
        self.full_edges = 0
        self.grid_start: float | None = None  # when its first firing with a rate began, and so its grid (F11)
        self.next_period = 0  # of that grid: the first in which it may start again
        self.next_start = 0.0  # when that begins
        self.rate_timer: Any = None
        self.limit_timer: Any = None
        self.backoff_timer: Any = None
        self.active_timer: Any = None
        self.gate_next = float("-inf")  # when its last firing began, for a throttling gate

        # counts
        self.firings = 0
        self.silent = 0
        self.end_firings = 0
        self.call_number = 0
        self.failed = 0
        self.calls_failed = 0
        self.restarts = 0

    def disturb(self) -> None:
        """Something about it is not as it is at rest: if its firings are fused, they are not from here on."""
        if self.region is not None:
            self.region.disturb(self)

    def is_on_fast_path(self) -> bool:
        """Whether a call of its code is under way that `busy` does not tell, by a fast path."""
        return self.stamp is not None or (self.region is not None and self.region.is_calling(self))

    def edges_in(self) -> tuple[Edge, ...]:
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

    def check_invariants(self) -> None:
        """Between two steps of the run certain things hold of every worker, whatever its region has fused.

        Raises:
          EngineInternalError: one of them does not.
        """
        for holds, relation in self._relations():
            if not holds:
                raise EngineInternalError(f'node "{self.path}": {relation}')
        if not self.blocked & (ENDED | TORN_DOWN):  # who has ended waits for nothing any more (F12)
            missing = sum(1 for edge in self.live_inputs if not edge.untaken)
            self.inputs.check_invariants(missing, f'inputs of "{self.path}"')

    def _relations(self) -> Iterator[tuple[bool, str]]:
        """What holds of it between two steps."""
        may_fire = not (self.blocked or self.inputs.missing or self.outputs.missing)
        may_call = bool(self.calls) and not self.blocked & CALLS_BLOCKED
        rests = self.busy == ""
        yield may_fire or not self.placed, "its firing has a place, but F1 does not hold"
        if rests and self.core.started and not self.is_boundary_output:
            yield self.placed or not may_fire, "F1 holds, but its firing has no place"
            yield self.queued or not (self.placed or may_call), "it may move, but does not stand in its run queue"
        yield not self.calls or self.ahead <= len(self.calls) or not self.placed, "more calls stand before its firing"
        if rests:
            yield self.stamp is None and not self.right, "it rests, but has the stamp or the right of a firing (T5, A3)"
            yield self.written is None, "it rests, but what a firing wrote has not left (F3)"
            yield self.call_edge is None, "it rests, but is amid a slot call"
            yield not self.follows or self.queued, "it is to go next, but for nothing (R2)"
        yield self.outputs.missing > 0 or not self.held, "it holds its inputs for outputs that are free (F5)"
        yield bool(self.blocked & ENDED) or not self.pending_end, "END is to follow, but it has not ended (F4)"
        yield bool(self.blocked & ENDED) or self.deferred is None, "modifiers wait for its END, but it has not ended"
        yield bool(self.full_edges) == bool(self.blocked & FULL), "held back by a full queue that is none (F8)"
        yield self.rate_timer is None or bool(self.blocked & RATE), "a rate's timer runs, but no rate holds it (F11)"
        waiting = sum(edge.untaken for edge in self.called_by())
        yield (
            waiting == len(self.calls or ()),
            f"{waiting} tokens lie before its slots, for {len(self.calls or ())} calls",
        )

    def called_by(self) -> Iterator[Any]:
        """Each edge whose tokens wait for a call: into a slot, or a signal into a parameter (P8)."""
        yield from self.slot_edges
        for edge in self.in_edges:
            if edge.target_kind == "parameter" and type(edge) is EventEdge:
                yield edge

    def inputs_ready(self) -> bool:
        """Whether all its inputs hold a token that nobody has taken."""
        return bool(self.live_inputs) and not self.inputs.missing

    def __repr__(self) -> str:
        return f"<worker {self.path}>"


def _not_planned(worker: Worker) -> None:
    raise AssertionError(f"{worker} has no plan")

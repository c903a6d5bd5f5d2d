"""One running node: its two barriers, its agenda, and why it may not move (rules F1, F9).

Plain state, decided over by `firing`, `sending` and `quiet`. A worker has at most one firing or call under way; where
its node allows several firings, those that go on are in its `concurrent` (F14).
Stands on `vertex`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Final

from hfg.engine.model.calls import Calls, CallsOfOne
from hfg.engine.model.concurrent import Attempts, ConcurrentFirings, Entry
from hfg.engine.model.contracts import Timer
from hfg.engine.model.core import Core, FusedRegion
from hfg.engine.model.counts import Counts
from hfg.engine.model.ending import Ending
from hfg.engine.model.events import RunningEvent
from hfg.engine.model.execution import Execution
from hfg.engine.model.groups import Group
from hfg.engine.model.lifecycle import Lifecycle
from hfg.engine.model.rate import Rate
from hfg.engine.model.room import Room
from hfg.engine.model.scopes import Scope
from hfg.engine.model.vertex import Vertex
from hfg.errors import EngineInternalError
from hfg.graph.structure.options import NodeOptions
from hfg.nodetypes.node import Node
from hfg.ports.barrier import Barrier
from hfg.ports.edges import AnyEdge, Edge, EventEdge
from hfg.ports.events import EventPort

__all__ = [
    "AT_CONCURRENCY",
    "BACKOFF",
    "BETWEEN_FIRINGS",
    "DEAD_SOURCE",
    "DISABLED",
    "ENDED",
    "FIRES_NO_MORE",
    "FULL",
    "NO_CALLS",
    "RATE",
    "RECORDED",
    "REMOVED",
    "RESTING",
    "STARTING",
    "TORN_DOWN",
    "UNREADY",
    "UNWIRED",
    "Entry",
    "RunningNode",
]

# Why a worker may not fire: bits of RunningNode.blocked. Zero means that only the barriers count.
DISABLED: Final = 1  # F10
ENDED: Final = 2  # F12; from the moment its end() is called
UNWIRED: Final = 4  # a mandatory input without a live edge, or neither source nor live input (F1)
RATE: Final = 8  # F11
RESTING: Final = 16  # a source whose gate is closed (A11)
UNREADY: Final = 32  # its ready() said no; asked again after each firing, call or wake (F1)
STARTING: Final = 64  # sources, until `start` has been triggered (A10)
DEAD_SOURCE: Final = 128  # a source that works for ended nodes alone and rests, for it holds nobody up (R5)
REMOVED: Final = 256  # an edit took it out of the graph (R4)
AT_CONCURRENCY: Final = 512  # as many firings are under way as may be, or somebody waits until none is (F14)
# The highest ones keep its slots from being called, too: whether one is set is a comparison.
FULL: Final = 1024  # a `wait` edge of its events is full (F8)
BACKOFF: Final = 2048  # between teardown and setup after an error (X1)
TORN_DOWN: Final = 4096  # the run is ending (R5, X3)
RECORDED: Final = 8192  # what it sends is recorded without loss, and the disk is behind
NO_CALLS: Final = FULL  # the least of them
FIRES_NO_MORE: Final = ENDED | DISABLED | REMOVED | TORN_DOWN | UNWIRED | DEAD_SOURCE  # whatever comes to it

BETWEEN_FIRINGS: Final = ("", "edit", "releasing")  # values of RunningNode.busy: automatic events leave at once (A9)


class RunningNode(Vertex["RunningNode"]):
    """What a node is while its graph runs.

    Attributes:
      inputs: the input barrier; `missing` counts live, not ended input edges without an untaken token.
      outputs: the output barrier; `missing` counts this node's tokens that are not processed.
      blocked: bits from above.
      fireable, calls_before: F1 holds, and the firing has its place in the agenda behind so many slot calls (F9).
      calls: edges whose oldest token waits for a slot call, in order of arrival; None until there is an edge.
      caller: the one event edge that all its calls are of, if it is one.
      queued: it stands in its group's run queue.
      is_next: what a sequential edge has enabled goes next when the call is over for which it stands there (R2).
      busy: "" or what is under way: "firing", "call", "asking", "ending", "setup"; "edit": an edit holds it;
        "wave": its region's wave has given way to others; "releasing": what was under way is
        over, but for what it releases.
      special: something about the next firing is not ordinary (a marker lies on an input ...): the fast step steps
        aside.
      step: runs its next piece of work; chosen for its shape by `specialise`.
      taken: edges whose tokens were taken by the firing under way, or the last one, and are processed when its
        outputs are (F5 sequential).
      may_carry: A3's right to carry activity that A5 took earlier in this firing or call.
      stamp: of what it sends now (T5); None outside a firing or call: the present.
      written: per output what was written in this firing; None until the first.
      events_due: automatic events that follow the firing or call (A9).
      tasks: that its code has started; None until the first.
    """

    __slots__ = (
        "active",
        "active_timer",
        "attempts",
        "blocked",
        "busy",
        "call_edge",
        "caller",
        "calls",
        "calls_before",
        "concurrent",
        "counts",
        "ending",
        "events_due",
        "execution",
        "fireable",
        "halt",
        "holds_inputs",
        "idle_callbacks",
        "inputs",
        "is_next",
        "lifecycle",
        "listened",
        "may_carry",
        "meter",
        "observed",
        "outputs",
        "queued",
        "rate",
        "region",
        "room",
        "sends_itself",
        "special",
        "stamp",
        "step",
        "taken",
        "tasks",
        "ticket",
        "unfit",
        "written",
    )

    # --- made -------------------------------------------------------------------------------------------------------

    def __init__(
        self,
        core: Core[RunningNode],
        path: str,
        node: Node | None,
        options: NodeOptions | None,
        group: Group[RunningNode],
    ) -> None:
        super().__init__(core, path, node, options, group)
        self.inputs = Barrier()
        self.outputs = Barrier()
        self.blocked = 0
        self.busy = ""
        self.step: Callable[[RunningNode], None] = _not_planned
        self._has_no_place()
        self._is_looked_at_by_nobody()
        self._has_not_fired()
        self.counts = Counts()
        self.rate = Rate()
        self.room: Room[RunningNode] = Room(self)
        self.lifecycle = Lifecycle()
        self.execution = Execution()
        self.concurrent: ConcurrentFirings[RunningNode] | None = (
            None  # of a node that allows several firings under way (F14)
        )
        self.tasks: Any = None
        self.attempts: Attempts | None = None  # at its firing, where one that fails is tried again (X1)
        if options is not None and options.concurrency > 1:
            self.concurrent = ConcurrentFirings(options.concurrency, options.ordered)
        elif options is not None and options.retries:
            self.attempts = Attempts()

    def _has_no_place(self) -> None:
        self.fireable = False
        self.calls_before = 0
        self.calls: Calls | None = None
        self.caller: EventEdge | None = None
        self.queued = False
        self.is_next = False
        self.idle_callbacks: list[Callable[[], None]] | None = None  # what waits until it is not busy

    def _is_looked_at_by_nobody(self) -> None:
        self.halt: Callable[[Callable[[RunningNode], None]], Callable[[RunningNode], None]] | None = (
            None  # R3: its breakpoint
        )
        self.observed = False  # somebody waits at its barriers: no fast paths
        self.meter: Any = None  # a Meter, while somebody wants statistics
        self.listened: list[Any] | None = None  # what tells those who send to slots of its own that it may listen
        self.region: FusedRegion[RunningNode] | None = None  # in which its firings are fused
        self.sends_itself = False  # its code sends by itself: the region says so before each call
        self.unfit = False  # its firings turned out not to be plain calls

    def _has_not_fired(self) -> None:
        self.special = False
        self.active = False
        self.may_carry = False
        self.stamp: float | None = None
        self.taken: tuple[Any, ...] = ()
        self.holds_inputs = False  # its inputs are released when its outputs are processed (F5 sequential)
        self.written: list[Entry | None] | None = None
        self.events_due: list[tuple[str, Any]] | None = None
        self.ending: Ending | None = None  # from its last firing on
        self.call_edge: Any = None
        self.ticket = 0  # which firing or call a late result belongs to (X2)
        self.active_timer: Timer | None = None  # A12

    # --- its place in the plan (R4) ---------------------------------------------------------------------------------

    def stand_for(self, scope: Scope[RunningNode], active_for_s: float | None) -> None:
        """Have the automatic ports of a subgraph that is dissolved; never fire."""
        self.scope = scope
        self.silent_code = True
        self.active_for_s = active_for_s
        scope.be_told_by(self)

    def lead_in(self, edge: Edge, kind: str, name: str) -> None:
        """An edge leads into one of its ports from now on, in the order of those."""
        super().lead_in(edge, kind, name)
        if kind != "input":
            self._order_calls()

    def lose_incoming(self, edge: Edge) -> None:
        """An edge leads into it no more; its tokens have gone before."""
        super().lose_incoming(edge)
        if edge.target_kind != "input":
            self._order_calls()

    def _order_calls(self) -> None:
        """Where it is one event edge that calls, its queue is their order; else they have a queue of their own."""
        edges, waiting = tuple(self.called_by()), tuple(self.calls or ())
        if not edges and self.calls is None:
            return
        alone = len(edges) == 1 and type(edges[0]) is EventEdge and all(edge is edges[0] for edge in waiting)
        if alone or type(self.calls) is not deque:  # which others may hold
            self.calls = CallsOfOne(edges[0]) if alone else deque(waiting)
            self.caller = edges[0] if alone else None
            if self.core.running_node is self and self.idle_callbacks is None:
                self.idle_callbacks = []  # a fast call of it is under way, which is to look behind it what waits now

    def lead_out_of_event(self, edge: Edge, name: str, port: EventPort[Any] | None) -> None:
        """An edge leads out of one of its events from now on."""
        event = self.make_event(name, port if self.node is not None or name == "start" else None)
        event.feed((*event.edges, edge))

    def make_event(self, name: str, port: EventPort[Any] | None) -> RunningEvent[RunningNode]:
        """Give the running event of this name; one that has neither edge nor subscriber yet is made now."""
        event = self.events.get(name)
        if event is None:
            event = RunningEvent(self, name, port)
            self.ask_for(event)
        return event

    def regroup(self, group: Group[RunningNode]) -> None:
        """It runs elsewhere from now on; where it stood in a queue it does no more."""
        self.leave_queue()
        self.join(group)

    def leave_plan(self) -> None:
        """An edit took it out of the graph: it moves no more, whatever still comes to it."""
        if self.ending is not None:
            self.ending.call_off()
        self.block(TORN_DOWN | REMOVED)
        self.leave_queue()
        self.step = RunningNode.dequeued

    def on_run_ended(self) -> None:
        """The run is over: what is queued already does nothing, and nobody waits for room any more."""
        self.blocked |= TORN_DOWN
        self.fireable = False
        self.room.tell_waiters()

    def cancel_timers(self) -> None:
        """Nothing is to come of it any more."""
        self.rate.end_wait()
        self.execution.end_limit()
        self.lifecycle.end_rest()
        self.time_activity(None)
        if self.attempts is not None:
            self.attempts.cancel()
        for firing in self.concurrent or ():
            firing.in_time()
            firing.attempts.cancel()

    # --- its place in the agenda and in the run queue (F1, F9, R2) ---------------------------------------------------

    def enqueue(self) -> None:
        """Stand in the run queue, once; who is busy looks for itself when that is over."""
        if not self.queued and not self.busy:
            self.queued = True
            self.push(self)

    def enqueue_next(self) -> None:
        """Stand in front of all others in the run queue; if it has a firing and a call, both go next."""
        self.queued = True
        self.is_next = bool(self.calls and self.fireable)
        self.push_next(self)
        self.core.ran_next += 1

    def run_next(self) -> None:
        """Go next when the sending is over; behind an earlier call if it stands in the queue for one (F9).

        What is busy is not enabled by what it gets now, but by the end of what it does (F1).
        """
        if self.queued:
            self.is_next = True
        elif not self.busy:
            self.queued = True
            self.core.next_in_wave.append(self)

    def clear_next(self) -> None:
        """What stood in front of it is over: whether it goes next is decided now."""
        self.is_next = False

    def dequeued(self) -> None:
        """Its group has given it out: it is its turn."""
        self.queued = False

    def leave_queue(self) -> None:
        """Do not stand in the run queue, whoever is in front."""
        if self.queued:
            self.group.policy.remove(self)
            self.queued = False

    def make_fireable(self) -> None:
        """The next firing is enabled: it comes behind the calls that wait already (F9)."""
        self.fireable = True
        self.calls_before = len(self.calls) if self.calls else 0

    def make_unfireable(self) -> None:
        """What F1 asks for holds no more; a rate goes on holding what it holds."""
        self.fireable = False

    def drop_firing(self) -> None:
        """The same, and no timer that would give a place."""
        self.fireable = False
        if self.blocked & RATE:
            self.rate_over()

    def use_turn(self) -> None:
        """It has had its turn, and all that it was enabled for is done by that."""
        self.queued = self.fireable = False

    # --- what keeps it from moving (F1) ------------------------------------------------------------------------------

    def block(self, reason: int) -> None:
        """Let no firing start; its place in the agenda is lost (F9), and it does not rest: no wave may take that so."""
        self.blocked |= reason
        if self.region is not None:
            self.region.disturb(self)
        if reason == FULL:
            self.fireable = False  # a rate goes on holding it, and is to be over before a queue grows (F8)
            return
        self.drop_firing()
        if reason & FIRES_NO_MORE:
            self.core.waits_changed()

    def allow(self, reasons: int) -> bool:
        """Take reasons away; whether one of them held. Who calls this sees to it that the worker goes on."""
        held = self.blocked & reasons
        self.blocked &= ~reasons
        if held & FIRES_NO_MORE:
            self.core.waits_changed()
        return bool(held)

    def wait_for_rate(self, when: float, over: Callable[[], None]) -> None:
        """F11: nothing starts before `when`."""
        self.blocked |= RATE
        self.rate.wait(self.core.runtime.call_at(when, over))

    def rate_over(self) -> None:
        """The time has come for which a rate held it, or what it would have let start is gone."""
        self.rate.end_wait()
        self.blocked &= ~RATE
        self.room.tell_watchers()

    # --- what is under way (F3, F9, X2) -----------------------------------------------------------------------------

    def be_busy(self, doing: str) -> None:
        """Something is under way; if its firings are fused, they are not from here on."""
        self.busy = doing
        if self.region is not None:
            self.region.disturb(self)

    def rest(self) -> None:
        """Nothing is under way any more."""
        self.busy = ""

    def begin_firing(self) -> None:
        """A firing begins: what it takes, and when that was made, is still to be seen."""
        self.fireable = False
        self.busy = "firing"
        self.counts.firings += 1
        self.ticket += 1
        self.special = False

    def took(self, edges: tuple[Any, ...], stamp: float) -> None:
        """The firing has taken its tokens.

        Args:
          edges: those whose tokens are processed when its outputs are (F5 sequential).
          stamp: of what it sends (T5).
        """
        self.taken = edges
        self.stamp = stamp

    def write(self, position: int, entry: Entry) -> None:
        """The firing has written to one output; it leaves when the firing is over."""
        if self.written is None:
            self.written = [None] * len(self.out_edges)
        self.written[position] = entry

    def begin_releasing(self) -> None:
        """The firing or call is over, but for what it releases."""
        self.busy = "releasing"

    def begin_restart(self) -> None:
        """X1: it is torn down, and set up after a pause."""
        self.counts.add_restart()
        self.block(BACKOFF)

    def take_written(self) -> list[Entry | None] | None:
        """What the firing has written leaves now, or never."""
        written, self.written = self.written, None
        return written

    def begin_call(self, edge: Edge, stamp: float) -> None:
        """A slot call begins, for the oldest token of the edge."""
        self.busy = "call"
        self.counts.calls += 1
        self.ticket += 1
        self.call_edge = edge
        self.stamp = stamp

    def take_call(self) -> AnyEdge:
        """Whose token waits longest for a slot call: its turn has come."""
        assert self.calls is not None
        if self.fireable and self.calls_before:
            self.calls_before -= 1
        edge: AnyEdge = self.calls.popleft()
        return edge

    def expect_call(self, edge: Edge) -> None:
        """The newest token of the edge waits for a slot call (F9)."""
        assert self.calls is not None
        self.calls.append(edge)

    def forget_call(self, edge: Edge) -> None:
        """The call of the edge's oldest token will not come: the token was dropped."""
        assert self.calls is not None
        position = self.calls.index(edge)
        del self.calls[position]
        if position < self.calls_before:
            self.calls_before -= 1

    def end_call(self) -> AnyEdge:
        """The call is over, but for what it releases; gives back the edge that it took from."""
        edge: AnyEdge = self.call_edge
        self.call_edge = None
        self.busy = "releasing"
        return edge

    def end_firing(self) -> tuple[Any, ...]:
        """The firing is over, but for what it releases; gives back the edges to be released now, if any.

        While its outputs are not free it holds them, and `outputs_free` gives them back (F5).
        """
        self.busy = "releasing"
        self.written = None
        if self.outputs.missing:
            self.holds_inputs = True
            return ()
        return self.taken

    def outputs_free(self) -> tuple[Any, ...]:
        """All that it has sent is processed: gives back the edges that are released by that."""
        if not self.holds_inputs:
            return ()
        self.holds_inputs = False
        return self.taken

    def release_early(self, edges: tuple[Any, ...] | None = None) -> tuple[Any, ...]:
        """What it has taken is processed before its outputs are: from these edges, or from all; gives them back."""
        released = self.taken if edges is None else edges
        self.taken = tuple(edge for edge in self.taken if edge not in released)
        return released

    def leave(self) -> None:
        """The firing or call is behind it: no right of A3, and the present is the stamp of what it sends."""
        self.may_carry = False
        self.stamp = None

    def give_up_firing(self) -> None:
        """X2: what its code still brings is too late, and has no limit any more."""
        self.execution.end_limit()
        self.ticket += 1

    def mark_special(self) -> None:
        """Its next firing is not an ordinary one: a marker lies before it."""
        self.special = True

    def begin_async(self) -> None:
        """Its code waits, or runs in a thread, and its outcome comes later."""
        self.execution.in_flight = True
        self.core.begin_async()

    def end_async(self) -> None:
        """Its code is over, or given up; a node that a thread has worked with sees its activity again."""
        execution = self.execution
        execution.in_flight = False
        self.core.end_async()
        self.room.tell_watchers()
        if execution.job is not None:
            self.leave_job()

    def leave_job(self) -> None:
        """What the thread did for it is over."""
        self.execution.take_job(None)
        self.show_activity()

    # --- by a fast path (see the wing `fusion`) ----------------------------------------------------------------------

    def use_step(self, step: Callable[[RunningNode], None]) -> None:
        """This is what it does from now on when it has its turn."""
        self.step = step

    def be_fused(self, region: FusedRegion[RunningNode] | None) -> None:
        """A region fuses its firings with those of others; None: none does any more."""
        self.region = region

    def fit_no_more(self) -> None:
        """What it does is hardly ever plain: no region takes it any more."""
        self.unfit = True

    def mark_sends_itself(self) -> None:
        """Its code sends amid its calls, so a region says before each of them that it runs."""
        self.sends_itself = True

    def be_in_wave(self, doing: str = "wave") -> None:
        """It is busy for as long as the wave of its region is under way; that disturbs no region.

        Only the member whose call is under way fires, and what it may do, others may not.
        """
        self.busy = doing

    def hold(self, edges: tuple[Any, ...]) -> None:
        """F5: what it has sent is not processed by all; from these edges it took, and they are released by that."""
        self.holds_inputs = True
        self.taken = edges

    def wait_for_taking(self, missing: int, edges: tuple[Any, ...]) -> None:
        """F5: so many edges hold what it has sent, perhaps none; see `hold`."""
        self.outputs.missing = missing
        self.holds_inputs = missing > 0
        if missing:
            self.taken = edges

    def resume_as_firing(self, edges: tuple[Any, ...], stamp: float) -> None:
        """A firing that a region had begun is one like any other from here on; what has come in meanwhile stays."""
        self.ticket += 1
        self.counts.firings += 1
        self.busy = "firing"
        self.took(edges, stamp)

    def resume_as_call(self, edge: Edge) -> None:
        """A call that was begun and counted already is one like any other from here on."""
        self.queued = False
        self.busy = "call"
        self.call_edge = edge
        self.ticket += 1

    def fire_plainly(self, edges: tuple[Any, ...], stamp: float) -> None:
        """It has had its turn, and fires with plain values: see `begin_firing` and `took`."""
        self.queued = self.fireable = False
        self.counts.firings += 1
        self.ticket += 1
        self.busy = "firing"
        self.stamp = stamp
        self.taken = edges

    def run_after_wave(self) -> None:
        """It has its turn when the wave that leaves is out of the way (R2)."""
        self.queued = True
        self.core.next_in_wave.append(self)

    def give_away_activity(self) -> None:
        """A5: what it sends has taken its activity, to which it has a right until its call is over (A3)."""
        self.active = self.node._active = False
        self.may_carry = self.stamp is not None

    def take_activity(self, active: bool) -> None:
        """A6: a call by a fast path, so on the loop, has taken activity or lost it; no region fuses such a node."""
        self.active = self.node._active = active

    # --- activity (A3, A5, A9) ----------------------------------------------------------------------------------------

    def become(self, active: bool) -> None:
        """A(v) := active; who fuses its firings looks whether activity would move now."""
        self.active = active
        self.show_activity()
        if self.region is not None:
            self.region.disturb(self)

    def show_activity(self) -> None:
        """Let the node's own code see its activity, the only place where that is written.

        Under the virtual clock code in a thread goes on seeing what was when it began, or chance would decide (R6).
        """
        job = self.execution.job
        if self.node is not None and (job is None or job.time_hold is None):
            self.node._active = self.active

    def hide_activity(self) -> None:
        """The run is over, and the node belongs to none."""
        if self.node is not None:
            self.node._active = False

    def let_carry(self, may_carry: bool) -> None:
        """A3: whether it may still carry activity that A5 took earlier in the firing or call under way."""
        self.may_carry = may_carry

    def expect_event(self, name: str, value: object) -> None:
        """An automatic event has arisen; it leaves with the others, in their order (A9)."""
        if self.events_due is None:
            self.events_due = []
        self.events_due.append((name, value))

    def take_events(self) -> list[tuple[str, Any]]:
        """The automatic events that have arisen, to be sent now."""
        due, self.events_due = self.events_due, None
        return due or []

    def time_activity(self, timer: Timer | None) -> None:
        """A12: how long it has been active is measured by this timer from now on, or not at all; the last is over."""
        if self.active_timer is not None:
            self.active_timer.cancel()
        self.active_timer = timer

    # --- its end, and beginning afresh (F4, F10, F12, X1) -------------------------------------------------------------

    def end(self, *, is_dead_source: bool = False) -> None:
        """From here on it fires no more, and what comes is drained (F12); `is_dead_source`: and sends no END (R5)."""
        self.block(ENDED)
        self.ending = Ending(is_dead_source=is_dead_source or (self.ending is not None and self.ending.is_dead_source))
        for edge in self.in_edges:
            edge.source.changed()  # whose fast paths do not look whether what they send is drained

    def promise_end(self, stamp: float | None) -> None:
        """END follows as soon as the outputs are free; with this stamp (T5)."""
        assert self.ending is not None
        self.ending.promise(stamp)
        for edges in self.out_edges:
            for edge in edges:
                if edge.target.region is not None:
                    edge.target.region.expect_end()

    def start_over(self) -> None:
        """It has not ended, nor have the inputs that it must have, nor have its events."""
        self.ending = None
        if self.concurrent is not None:
            self.concurrent.begin_afresh()
            self.limit_concurrency()
        for edge in self.in_edges:
            edge.begin_afresh()
        for edge in self.event_edges():
            if edge.renew is not None and edge.complete is None:
                edge.renew()

    def when_idle(self, callback: Callable[[], None]) -> None:
        """Call back when nothing is under way, before the next firing or call."""
        if self.idle_callbacks is None:
            self.idle_callbacks = []
            self.changed()
        self.idle_callbacks.append(callback)
        self.limit_concurrency()

    # --- several firings under way (F14) ----------------------------------------------------------------------------

    def limit_concurrency(self) -> None:
        """Let no other firing begin if enough are under way, or somebody waits until none is; else let it."""
        if self.concurrent is None:
            return
        if not (self.concurrent.full or self.idle_callbacks):
            self.allow(AT_CONCURRENCY)
        elif not self.blocked & AT_CONCURRENCY:
            self.block(AT_CONCURRENCY)

    def has_concurrent_code(self) -> bool:
        """Whether code of a firing that goes on beside others is not over."""
        return self.concurrent is not None and self.concurrent.unfinished

    @property
    def pending_end(self) -> bool:
        """Whether END follows as soon as the outputs are free (F4)."""
        return self.ending is not None and self.ending.pending

    def send_as(self, stamp: float | None) -> float | None:
        """What it sends has this stamp from now on (T5); gives back the one before, of a call that is under way."""
        before, self.stamp = self.stamp, stamp
        return before

    def firings_under_way(self) -> int:
        """How many of its firings are under way, those included that are over and wait for their turn (F14)."""
        if self.concurrent is not None:
            return len(self.concurrent)
        in_wave = self.busy == "wave" and self.region is not None and self.region.is_calling(self)
        return int(in_wave or self.busy in ("firing", "ending"))

    def most_under_way(self) -> int:
        """How many there ever were at once."""
        return min(1, self.counts.firings) if self.concurrent is None else self.concurrent.most

    def codes_at_work(self) -> int:
        """How much of its code waits or runs in a thread: one firing or call, or several firings, and tasks."""
        firings = self.execution.in_flight + (0 if self.concurrent is None else self.concurrent.working)
        return firings + (0 if self.tasks is None else len(self.tasks))

    def codes_waiting_for_room(self) -> int:
        """How much of that waits until a queue has room (F8)."""
        tasks = 0 if self.tasks is None else self.tasks.waiting_room
        waiting = self.room.waiting
        if not waiting:
            return int(tasks)
        return tasks + (
            int(self.execution.in_flight) if self.concurrent is None else min(waiting, self.concurrent.working)
        )

    def start_tasks(self, tasks: object) -> None:
        """Its code starts a task for the first time."""
        self.tasks = tasks

    def run_idle_callbacks(self) -> None:
        """What waits until it is not busy has its turn, as long as that does not make it busy."""
        while self.idle_callbacks and not self.busy and not self.has_concurrent_code():
            self.idle_callbacks.pop(0)()
        if not self.idle_callbacks and self.idle_callbacks is not None:
            self.idle_callbacks = None
            self.limit_concurrency()
            self.changed()

    def rewire(self, live_inputs: tuple[Any, ...]) -> None:
        """What it waits for, and what it sends on, is derived anew from the liveness of its edges."""
        self.wait_for(live_inputs)
        self.inputs.count(sum(1 for edge in live_inputs if not edge.untaken))
        if self.inputs.missing:
            self.drop_firing()

    def halt_at(self, halt: Callable[[Callable[[RunningNode], None]], Callable[[RunningNode], None]] | None) -> None:
        """R3: a breakpoint stands before its step from now on, or none."""
        self.halt = halt
        self.changed()

    def be_observed(self) -> None:
        """Somebody waits at its barriers: each firing is to be seen there."""
        self.observed = True
        self.changed()

    def be_measured(self, meter: object) -> None:
        """This meter measures its code from now on; its step is to be chosen anew."""
        self.meter = meter

    def changed(self) -> None:
        """Its wiring, or somebody's interest in it, is another: how it does its next piece of work is chosen anew."""
        self.core.rules.specialise(self)

    def moves_by_itself(self) -> bool:
        """Whether something of it is under way or will be, without anybody else; not who only waits for room (F8)."""
        return (
            self.queued
            or (self.busy != "" and not self.room.waiting)
            or (self.concurrent is not None and self.concurrent.unfinished and not self.room.waiting)
            or bool(self.blocked & RATE)
            or self.lifecycle.backoff_timer is not None
            or (self.active_timer is not None and self.timeout_leads_somewhere())
            or (self.tasks is not None and self.tasks.move)
        )

    def is_on_fast_path(self) -> bool:
        """Whether a call of its code is under way that `busy` does not tell, by a fast path."""
        return self.stamp is not None or (self.region is not None and self.region.is_calling(self))

    def check_invariants(self) -> None:
        """Between two steps of the run certain things hold of every worker, whatever its region has fused.

        Raises:
          EngineInternalError: one of them does not.
        """
        for holds, relation in self._relations():
            if not holds:
                raise EngineInternalError(f'node "{self.path}": {relation}')
        records = (self.counts, self.lifecycle, self.execution, self.ending, self.concurrent)
        for record in records:
            if record is not None:
                record.check_invariants(self.path)
        if not self.blocked & (ENDED | TORN_DOWN):  # who has ended waits for nothing any more (F12)
            missing = sum(1 for edge in self.live_inputs if not edge.untaken)
            self.inputs.check_invariants(missing, f'inputs of "{self.path}"')

    def _relations(self) -> Iterator[tuple[bool, str]]:
        """What holds of it between two steps."""
        yield from self._relations_of_its_place()
        if not self.busy:
            yield (
                self.stamp is None and not self.may_carry,
                "it rests, but has the stamp or the right of a firing (T5, A3)",
            )
            yield self.written is None, "it rests, but what a firing wrote has not left (F3)"
            yield self.call_edge is None, "it rests, but is amid a slot call"
            yield not self.is_next or self.queued, "it is to go next, but for nothing (R2)"
        yield self.outputs.missing > 0 or not self.holds_inputs, "it holds its inputs for outputs that are free (F5)"
        yield bool(self.blocked & ENDED) or self.ending is None, "END is to follow, but it has not ended (F4)"
        yield bool(self.room.full_edges) == bool(self.blocked & FULL), "held back by a full queue that is none (F8)"
        yield (
            (self.rate.timer is not None) == bool(self.blocked & RATE),
            "a rate holds it without a timer, or not (F11)",
        )

    def _relations_of_its_place(self) -> Iterator[tuple[bool, str]]:
        """What holds of its place in the agenda and in the run queue (F1, F9)."""
        may_fire = not (self.blocked or self.inputs.missing or self.outputs.missing)
        may_call = bool(self.calls) and self.blocked < NO_CALLS
        yield may_fire or not self.fireable, "its firing has a place, but F1 does not hold"
        if not self.busy and self.core.started and not self.is_boundary_output:
            yield self.fireable or not may_fire, "F1 holds, but its firing has no place"
            yield self.queued or not (self.fireable or may_call), "it may move, but does not stand in its run queue"
        calls, waiting = len(self.calls or ()), sum(edge.untaken for edge in self.called_by())
        yield not calls or self.calls_before <= calls or not self.fireable, "more calls stand before its firing"
        yield waiting == calls, f"{waiting} tokens lie before its slots, for {calls} calls"

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


def _not_planned(worker: RunningNode) -> None:
    raise AssertionError(f"{worker} has no plan")

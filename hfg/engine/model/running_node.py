"""One running node: its place in plan and ready queue, why it may not fire, its end, and who observes it (F1, F4, R4).

This is plain state; `rules` decides. A node has at most one firing or call in progress (`node_state`); if it allows
several firings, those that continue are in `concurrent` (F14).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

from hfg.engine.model.calls import CallsOfOne
from hfg.engine.model.concurrent import Attempts, ConcurrentFirings, Entry
from hfg.engine.model.core import FusedRegion
from hfg.engine.model.events import RunningEvent
from hfg.engine.model.groups import Group
from hfg.engine.model.node_state import NodeState
from hfg.engine.model.records import Ending, Record, Room
from hfg.engine.model.scopes import Scope
from hfg.engine.model.tasks import Tasks
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

# Why a node may not fire: bits of RunningNode.blocked. Zero means that only the barriers count.
DISABLED: Final = 1  # F10
ENDED: Final = 2  # F12; from the moment its end() is called
UNWIRED: Final = 4  # a mandatory input without a live edge, or neither source nor live input (F1)
RATE: Final = 8  # F11
RESTING: Final = 16  # a source whose gate is closed (A11)
UNREADY: Final = 32  # its ready() said no; asked again after each firing, call or wake (F1)
STARTING: Final = 64  # sources, until `start` has been triggered (A10)
DEAD_SOURCE: Final = 128  # a source that feeds only ended nodes; it rests, because nothing waits for it (R5)
REMOVED: Final = 256  # an edit took it out of the graph (R4)
AT_CONCURRENCY: Final = 512  # as many firings are in progress as may be, or something waits until none is (F14)
# The highest ones also block calls of its slots, so one comparison tests for any of them.
FULL: Final = 1024  # a `wait` edge of its events is full (F8)
BACKOFF: Final = 2048  # between teardown and setup after an error (X1)
TORN_DOWN: Final = 4096  # the run is ending (R5, X3)
RECORDED: Final = 8192  # its tokens are recorded without loss, and the disk is too slow
NO_CALLS: Final = FULL  # the least of them
FIRES_NO_MORE: Final = ENDED | DISABLED | REMOVED | TORN_DOWN | UNWIRED | DEAD_SOURCE  # whatever arrives

BETWEEN_FIRINGS: Final = ("", "edit", "releasing")  # values of RunningNode.busy: automatic events leave at once (A9)

Step: TypeAlias = "Callable[[RunningNode], None]"


def _not_planned(node: RunningNode) -> None:
    raise AssertionError(f"{node} has no plan")


@dataclass(slots=True, eq=False, repr=False)
class RunningNode(NodeState["RunningNode"]):
    """The state of a node while its graph runs."""

    step: Step = _not_planned  # does its next piece of work; `specialise` chooses it

    # who observes it, and what fuses it
    halt: Callable[[Step], Step] | None = None  # its breakpoint (R3)
    observed: bool = False  # something waits at its barriers: no fast paths
    meter: Any = None  # a Meter, while statistics are kept
    region: FusedRegion[RunningNode] | None = None
    fused_with: tuple[str, ...] = ()  # paths of the members of its last region
    sends_itself: bool = False  # its code sends, so the region announces it before each call
    unfit: bool = False  # its firings turned out not to be plain calls

    # records of their own
    room: Room[RunningNode] = field(init=False)
    attempts: Attempts | None = None  # of a node that retries failed firings (X1)
    concurrent: ConcurrentFirings[RunningNode] | None = None  # if it allows several (F14)
    tasks: Tasks[RunningNode] | None = field(init=False, default=None)  # that its code has started

    def __post_init__(self) -> None:
        NodeState.__post_init__(self)  # with slots, `super()` would look at the class before it got them
        self.room = Room(self)
        options = self.options
        if options is not None and options.concurrency > 1:
            self.concurrent = ConcurrentFirings(options.concurrency, options.ordered)
        elif options is not None and options.retries:
            self.attempts = Attempts()

    # --- its place in the plan (R4) ---------------------------------------------------------------------------------

    def stand_for(self, scope: Scope[RunningNode], active_for_s: float | None) -> None:
        """Have the automatic ports of a subgraph that is dissolved; never fire."""
        self.scope = scope
        self.silent_code = True
        self.active_for_s = active_for_s
        scope.owned_by(self)

    def lead_in(self, edge: Edge, kind: str, name: str) -> None:
        """Connect an edge to one of its ports, in the order of the ports."""
        NodeState.lead_in(self, edge, kind, name)
        if kind != "input":
            self._order_calls()

    def lose_incoming(self, edge: Edge) -> None:
        """Disconnect an edge that leads into it, after its tokens are gone."""
        NodeState.lose_incoming(self, edge)
        if edge.target_kind != "input":
            self._order_calls()

    def _order_calls(self) -> None:
        """If all calls come from one event edge, its queue is their order; otherwise they have a queue of their own."""
        edges, waiting = tuple(self.called_by()), tuple(self.calls or ())
        if not edges and self.calls is None:
            return
        alone = len(edges) == 1 and type(edges[0]) is EventEdge and all(edge is edges[0] for edge in waiting)
        if alone or type(self.calls) is not deque:  # a deque may be in use elsewhere, so it is kept
            self.calls = CallsOfOne(edges[0]) if alone else deque(waiting)
            self.caller = edges[0] if alone else None
            if self.core.running_node is self and self.idle_callbacks is None:
                self.idle_callbacks = []  # lets a fast call in progress look at the new queue when it is over

    def make_event(self, name: str, port: EventPort[Any] | None) -> RunningEvent[RunningNode]:
        """Return the running event of this name. It is made when it gets its first edge or subscriber."""
        event = self.events.get(name)
        if event is None:
            event = RunningEvent(self, name, port)
            self.add_event(event)
        return event

    def regroup(self, group: Group[RunningNode]) -> None:
        """Run in another group from now on."""
        self._leave_queue()
        self.join(group)

    def leave_plan(self) -> None:
        """An edit took it out of the graph: it moves no more, whatever still arrives."""
        if self.ending is not None:
            self.ending.stop_pending()
        self.block(TORN_DOWN | REMOVED)
        self._leave_queue()
        self.step = RunningNode.dequeued

    def on_run_ended(self) -> None:
        """The run is over: do nothing even if queued, and let code continue that waits for room."""
        self.blocked |= TORN_DOWN
        self.fireable = False
        self.room.notify_waiters()

    def cancel_timers(self) -> None:
        """Nothing follows it any more."""
        self.rate.end_wait()
        self.execution.end_limit()
        self.lifecycle.end_rest()
        self.time_activity(None)
        if self.attempts is not None:
            self.attempts.cancel()
        for firing in self.concurrent or ():
            firing.end_attempt()
            firing.attempts.cancel()

    # --- its place in the agenda and in the ready queue (F1, F9, R2) ------------------------------------------------

    def enqueue(self) -> None:
        """Be in the ready queue, once; a busy node looks itself what is next when it is idle again."""
        if not self.queued and not self.busy:
            self.queued = True
            self.push(self)

    def enqueue_next(self) -> None:
        """Be first in the ready queue; if it has a firing and a call, both go next."""
        self.queued = True
        self.is_next = bool(self.calls and self.fireable)
        self.push_next(self)
        self.core.ran_next += 1

    def enqueue_in_front(self) -> None:
        """It stands in the run queue already, as far as others see it: so it does, in front."""
        self.push_next(self)
        self.core.ran_next += 1

    def run_next(self) -> None:
        """Go next when the current sending is over; after an earlier call if it is queued for one (F9).

        Tokens do not enable a busy node; the end of what it does enables it (F1).
        """
        if self.queued:
            self.is_next = True
        elif not self.busy:
            self.run_after_wave()

    def run_after_wave(self) -> None:
        """Have its turn when the current sending, or the wave that ends early, is over (R2)."""
        self.queued = True
        self.core.next_in_wave.append(self)

    def _leave_queue(self) -> None:
        if self.queued:
            self.group.policy.remove(self)
            self.queued = False

    def drop_firing(self) -> None:
        """F1 does not hold any more, and a rate is not waited for."""
        self.fireable = False
        if self.blocked & RATE:
            self.rate_over()

    # --- what blocks it (F1) ----------------------------------------------------------------------------------------

    def block(self, reason: int) -> None:
        """Let no firing start. Its place in the agenda is lost (F9), and its region takes it as busy."""
        self.blocked |= reason
        if self.region is not None:
            self.region.disturb(self)
        if reason == FULL:
            self.fireable = False  # but a rate continues: a queue may grow only after it (F8)
            return
        self.drop_firing()
        if reason & FIRES_NO_MORE:
            self.core.waits_changed()

    def allow(self, reasons: int) -> bool:
        """Remove reasons. Return whether one of them applied; the caller then makes the node continue."""
        held = self.blocked & reasons
        self.blocked &= ~reasons
        if held & FIRES_NO_MORE:
            self.core.waits_changed()
        return bool(held)

    def wait_for_rate(self, when: float, over: Callable[[], None]) -> None:
        """Nothing starts before `when` (F11)."""
        self.blocked |= RATE
        self.rate.wait(self.core.runtime.call_at(when, over))

    def rate_over(self) -> None:
        """The rate allows the next firing, or there is none to wait for any more."""
        self.rate.end_wait()
        self.blocked &= ~RATE
        self.room.notify_watchers()

    # --- what is in progress (F3, F9, X2) ---------------------------------------------------------------------------

    def be_busy(self, doing: str) -> None:
        """Something is in progress; if its firings are fused, they are not from here on."""
        self.busy = doing
        if self.region is not None:
            self.region.disturb(self)

    def begin_async(self) -> None:
        """Its code waits, or runs in a thread; the result comes later."""
        self.execution.in_flight = True
        self.core.begin_async()

    def end_async(self) -> None:
        """Its code has ended, or is given up."""
        self.execution.in_flight = False
        self.core.end_async()
        self.room.notify_watchers()
        if self.execution.job is not None:
            self.leave_job()

    def leave_job(self) -> None:
        """The thread has ended its part; the node's code sees its activity again."""
        self.execution.take_job(None)
        self.show_activity()

    # --- by a fast path (see `fusion`) --------------------------------------------------------------------------------

    def use_step(self, step: Step) -> None:
        """Do this from now on when it is its turn."""
        self.step = step

    def be_fused(self, region: FusedRegion[RunningNode] | None) -> None:
        """A region fuses its firings with those of others; None: none does any more."""
        self.region = region
        if region is not None:
            self.fused_with = region.paths

    def fit_no_more(self) -> None:
        """Its firings are hardly ever plain: no region takes it any more."""
        self.unfit = True

    def mark_sends_itself(self) -> None:
        """Its code sends during its calls, so a region announces it before each of them."""
        self.sends_itself = True

    # --- activity (A3, A5, A9) ----------------------------------------------------------------------------------------

    def become(self, active: bool) -> None:
        """A(v) := active. Its region may have to check whether activity would move now."""
        self.active = active
        self.show_activity()
        if self.region is not None:
            self.region.activity_changed(self)

    # --- its end, and starting over (F4, F10, F12, X1) ----------------------------------------------------------------

    def end(self, *, is_dead_source: bool = False) -> None:
        """It fires no more, and drains what arrives (F12); `is_dead_source`: it sends no END either (R5)."""
        self.block(ENDED)
        self.ending = Ending(is_dead_source or (self.ending is not None and self.ending.is_dead_source))
        for edge in self.in_edges:
            edge.source.changed()  # whose fast paths do not check whether what they send is drained

    def promise_end(self, stamp: float | None) -> None:
        """END follows as soon as the outputs are free; with this stamp (T5)."""
        assert self.ending is not None
        self.ending.promise(stamp)
        for edges in self.out_edges:
            for edge in edges:
                if edge.target.region is not None:
                    edge.target.region.expect_end()

    def start_over(self) -> None:
        """It has not ended, nor have its mandatory inputs or its events."""
        self.ending = None
        if self.concurrent is not None:
            self.concurrent.start_over()
            self.limit_concurrency()
        for edge in self.in_edges:
            edge.begin_afresh()
        for edge in self.event_edges():
            if edge.renew is not None and edge.complete is None:
                edge.renew()

    def when_idle(self, callback: Callable[[], None]) -> None:
        """Call back when nothing is in progress, before the next firing or call."""
        if self.idle_callbacks is None:
            self.idle_callbacks = []
            self.changed()
        self.idle_callbacks.append(callback)
        self.limit_concurrency()

    def run_idle_callbacks(self) -> None:
        """Run what waits until it is not busy, as long as that does not make it busy."""
        while self.idle_callbacks and not self.busy and not self.has_concurrent_code():
            self.idle_callbacks.pop(0)()
        if not self.idle_callbacks and self.idle_callbacks is not None:
            self.idle_callbacks = None
            self.limit_concurrency()
            self.changed()

    # --- several firings, and tasks (F14, X1) -------------------------------------------------------------------------

    def limit_concurrency(self) -> None:
        """Let another firing start unless enough are in progress, or something waits until none is."""
        if self.concurrent is None:
            return
        if not (self.concurrent.full or self.idle_callbacks):
            self.allow(AT_CONCURRENCY)
        elif not self.blocked & AT_CONCURRENCY:
            self.block(AT_CONCURRENCY)

    def has_concurrent_code(self) -> bool:
        """Return whether code of a concurrent firing has not ended."""
        return self.concurrent is not None and self.concurrent.unfinished

    @property
    def pending_end(self) -> bool:
        """Whether END follows as soon as the outputs are free (F4)."""
        return self.ending is not None and self.ending.pending

    def need_tasks(self) -> Tasks[RunningNode]:
        """Return its tasks. The first time, bind its ports again, so that what tasks send is recognised."""
        if self.tasks is None:
            self.tasks = Tasks(self)
            self.core.rules.bind_ports(self)
        return self.tasks

    def firings_under_way(self) -> int:
        """Return how many of its firings are in progress, including those that wait for their turn (F14)."""
        if self.concurrent is not None:
            return len(self.concurrent)
        in_wave = self.busy == "wave" and self.region is not None and self.region.is_calling(self)
        return int(in_wave or self.busy in ("firing", "ending"))

    def codes_at_work(self) -> int:
        """Return how much of its code waits or runs in a thread: a firing or call, or several firings, and tasks."""
        firings = self.execution.in_flight + (0 if self.concurrent is None else self.concurrent.working)
        return firings + (0 if self.tasks is None else len(self.tasks))

    def codes_waiting_for_room(self) -> int:
        """Return how much of that waits until a queue has room (F8)."""
        tasks = 0 if self.tasks is None else self.tasks.waiting_room
        working = self.execution.in_flight if self.concurrent is None else self.concurrent.working
        return tasks + min(self.room.waiting, working)

    # --- who observes it ----------------------------------------------------------------------------------------------

    def rewire(self, live_inputs: tuple[AnyEdge, ...]) -> None:
        """Derive from the liveness of its edges what it waits for, and what it sends on."""
        self.wait_for(live_inputs)
        self.inputs.count(sum(1 for edge in live_inputs if not edge.untaken))
        if self.inputs.missing:
            self.drop_firing()

    def halt_at(self, halt: Callable[[Step], Step] | None) -> None:
        """Put a breakpoint before its step, or none (R3)."""
        self.halt = halt
        self.changed()

    def be_observed(self) -> None:
        """Let each firing be seen at its barriers, because something waits there."""
        self.observed = True
        self.changed()

    def be_measured(self, meter: object) -> None:
        """Let this meter measure its code; the caller has its step chosen again."""
        self.meter = meter

    def changed(self) -> None:
        """Its wiring or its observers have changed: choose again how it does its next piece of work."""
        self.core.rules.specialise(self)

    def moves_by_itself(self) -> bool:
        """Return whether something of it is in progress or will be, without others; waiting for room is not (F8)."""
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
        """Return whether a fast path calls its code, which `busy` does not show."""
        return self.stamp is not None or (self.region is not None and self.region.is_calling(self))

    def called_by(self) -> Iterator[Any]:
        """Yield each edge whose tokens wait for a call: into a slot, or a signal into a parameter (P8)."""
        yield from self.slot_edges
        for edge in self.in_edges:
            if edge.target_kind == "parameter" and type(edge) is EventEdge:
                yield edge

    def inputs_ready(self) -> bool:
        """Return whether all its inputs hold an untaken token."""
        return bool(self.live_inputs) and not self.inputs.missing

    def check_invariants(self, path: str = "") -> None:
        """Check what holds of it between two steps of the run, whatever its region has fused.

        Raises:
          EngineInternalError: a relation does not hold.
        """
        path = path or self.path
        Record.check_invariants(self, path)
        for record in (self.counts, self.lifecycle, self.execution, self.ending, self.concurrent):
            if record is not None:
                record.check_invariants(path)
        if not self.blocked & (ENDED | TORN_DOWN):  # an ended node waits for nothing any more (F12)
            missing = sum(1 for edge in self.live_inputs if not edge.untaken)
            self.inputs.check_invariants(missing, f'inputs of "{path}"')

    def relations(self) -> Iterator[tuple[bool, str]]:
        """See `Record`."""
        yield from self._relations_of_its_place()
        if not self.busy:
            yield (
                self.stamp is None and not self.may_carry,
                "it rests, but has the stamp or the right of a firing (T5, A3)",
            )
            yield self.written is None, "it rests, but what a firing wrote has not left (F3)"
            yield self.call_edge is None, "it rests, but a slot call is in progress"
            yield not self.is_next or self.queued, "it is to go next, but for nothing (R2)"
        yield self.outputs.missing > 0 or not self.holds_inputs, "it holds its inputs for outputs that are free (F5)"
        yield bool(self.blocked & ENDED) or self.ending is None, "END is to follow, but it has not ended (F4)"
        yield bool(self.room.full_edges) == bool(self.blocked & FULL), "blocked by a full queue that is none (F8)"
        yield (self.rate.timer is not None) == bool(self.blocked & RATE), "blocked by a rate without a timer (F11)"

    def _relations_of_its_place(self) -> Iterator[tuple[bool, str]]:
        """Yield what holds of its place in the agenda and in the ready queue (F1, F9)."""
        may_fire = not (self.blocked or self.inputs.missing or self.outputs.missing)
        may_call = bool(self.calls) and self.blocked < NO_CALLS
        yield may_fire or not self.fireable, "its firing has a place, but F1 does not hold"
        if not self.busy and self.core.started and not self.is_boundary_output:
            yield self.fireable or not may_fire, "F1 holds, but its firing has no place"
            yield self.queued or not (self.fireable or may_call), "it may move, but is not in its ready queue"
        calls, waiting = len(self.calls or ()), sum(edge.untaken for edge in self.called_by())
        yield not calls or self.calls_before <= calls or not self.fireable, "more calls come before its firing"
        yield waiting == calls, f"{waiting} tokens are before its slots, for {calls} calls"

    def __repr__(self) -> str:
        return f"<node {self.path}>"

"""One running node: its two barriers, its agenda, and why it may not move (rules F1, F9).

Plain state, decided over by `firing`, `sending` and `quiet`. A worker has at most one firing or call under way; where
its node allows several firings, those that go on are in its `flights` (F14).
Stands on `vertex`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Final

from hfg.engine.model.calls import Calls, CallsOfOne
from hfg.engine.model.contracts import Timer
from hfg.engine.model.core import Core, Region
from hfg.engine.model.events import RunningEvent
from hfg.engine.model.flights import Attempts, Entry, Flights
from hfg.engine.model.groups import Group
from hfg.engine.model.scopes import Scope
from hfg.engine.model.vertex import Vertex
from hfg.errors import EngineInternalError
from hfg.graph.structure.options import NodeOptions
from hfg.nodetypes.node import Node
from hfg.ports.barrier import Barrier
from hfg.ports.edges import AnyEdge, Edge, EventEdge
from hfg.ports.events import EventPort

__all__ = [
    "AMID_NOTHING",
    "BACKOFF",
    "CROWDED",
    "DISABLED",
    "ENDED",
    "FIRES_NO_MORE",
    "FULL",
    "FUTILE",
    "NO_CALLS",
    "RATE",
    "RECORDED",
    "REMOVED",
    "RESTING",
    "SAME_MOMENT_S",
    "STARTING",
    "TORN_DOWN",
    "UNREADY",
    "UNWIRED",
    "Entry",
    "Worker",
]

# Why a worker may not fire: bits of Worker.blocked. Zero means that only the barriers count.
DISABLED: Final = 1  # F10
ENDED: Final = 2  # F12; from the moment its end() is called
UNWIRED: Final = 4  # a mandatory input without a live edge, or neither source nor live input (F1)
RATE: Final = 8  # F11
RESTING: Final = 16  # a source whose gate is closed (A11)
UNREADY: Final = 32  # its ready() said no; asked again after each firing, call or wake (F1)
STARTING: Final = 64  # sources, until `start` has been triggered (A10)
FUTILE: Final = 128  # a source that works for ended nodes alone and rests, for it holds nobody up (R5)
REMOVED: Final = 256  # an edit took it out of the graph (R4)
CROWDED: Final = 512  # as many firings are under way as may be, or somebody waits until none is (F14)
# The highest ones keep its slots from being called, too: whether one is set is a comparison.
FULL: Final = 1024  # a `wait` edge of its events is full (F8)
BACKOFF: Final = 2048  # between teardown and setup after an error (X1)
TORN_DOWN: Final = 4096  # the run is ending (R5, X3)
RECORDED: Final = 8192  # what it sends is recorded without loss, and the disk is behind
NO_CALLS: Final = FULL  # the least of them
FIRES_NO_MORE: Final = ENDED | DISABLED | REMOVED | TORN_DOWN | UNWIRED | FUTILE  # whatever comes to it

AMID_NOTHING: Final = ("", "edit", "over")  # values of Worker.busy: automatic events leave at once (A9)

SAME_MOMENT_S: Final = 1e-9  # times that differ by less are one: sums of floats do


class Worker(Vertex["Worker"]):
    """What a node is while its graph runs.

    Attributes:
      inputs: the input barrier; `missing` counts live, not ended input edges without an untaken token.
      outputs: the output barrier; `missing` counts this node's tokens that are not processed.
      blocked: bits from above.
      placed, ahead: a firing is enabled and has its place in the agenda, behind `ahead` slot calls (F9).
      calls: edges whose oldest token waits for a slot call, in order of arrival; None until there is an edge.
      caller: the one event edge that all its calls are of, if it is one.
      queued: it stands in its group's run queue.
      follows: what a sequential edge has enabled goes next when the call is over for which it stands there (R2).
      busy: "" or what is under way: "firing", "call", "asking", "ending", "setup"; "edit": an edit holds it;
        "wave": its region's wave has given way to others; "over": what was under way is over, but for what it releases.
      special: something about the next firing is not ordinary (a marker lies on an input ...): the fast step steps
        aside.
      step: runs its next piece of work; chosen for its shape by `specialise`.
      taken: edges whose tokens were taken by the firing under way, or the last one, and are processed when its
        outputs are (F5 sequential).
      right: A3's right to carry activity that A5 took earlier in this firing or call.
      stamp: of what it sends now (T5); None outside a firing or call: the present.
      written: per output what was written in this firing; None until the first.
      events_due: automatic events that follow the firing or call (A9).
      tasks: that its code has started; None until the first.
    """

    __slots__ = (
        "active",
        "active_timer",
        "ahead",
        "attempts",
        "backoff_timer",
        "blocked",
        "busy",
        "call_edge",
        "call_number",
        "caller",
        "calls",
        "calls_failed",
        "carrier",
        "deferred",
        "end_firings",
        "end_stamp",
        "events_due",
        "failed",
        "firings",
        "flights",
        "follows",
        "full_edges",
        "gate_next",
        "generator",
        "given_up",
        "grid_start",
        "halt",
        "held",
        "in_flight",
        "inputs",
        "is_up",
        "job",
        "limit_timer",
        "listened",
        "meter",
        "next_period",
        "next_start",
        "observed",
        "on_idle",
        "opening",
        "outputs",
        "pending_end",
        "placed",
        "queued",
        "rate_timer",
        "region",
        "remembered",
        "restarts",
        "retries",
        "right",
        "room_waiters",
        "silent",
        "speaks",
        "special",
        "stamp",
        "step",
        "taken",
        "tasks",
        "ticket",
        "unfit",
        "waiting_room",
        "watchers",
        "written",
    )

    # --- made -------------------------------------------------------------------------------------------------------

    def __init__(
        self, core: Core[Worker], path: str, node: Node | None, options: NodeOptions | None, group: Group[Worker]
    ) -> None:
        super().__init__(core, path, node, options, group)
        self.inputs = Barrier()
        self.outputs = Barrier()
        self.blocked = 0
        self.busy = ""
        self.step: Callable[[Worker], None] = _not_planned
        self._has_no_place()
        self._is_looked_at_by_nobody()
        self._has_not_fired()
        self._has_no_timers()
        self.flights: Flights[Worker] | None = None  # of a node that allows several firings under way (F14)
        self.tasks: Any = None
        self.attempts: Attempts | None = None  # at its firing, where one that fails is tried again (X1)
        if options is not None and options.concurrency > 1:
            self.flights = Flights(options.concurrency, options.ordered)
        elif options is not None and options.retries:
            self.attempts = Attempts()

    def _has_no_place(self) -> None:
        self.placed = False
        self.ahead = 0
        self.calls: Calls | None = None
        self.caller: EventEdge | None = None
        self.queued = False
        self.follows = False
        self.full_edges = 0
        self.waiting_room = 0  # its code awaits trigger_wait
        self.room_waiters: list[Callable[[], None]] | None = None
        self.watchers: dict[Worker, None] | None = None  # held back by full queues, and in no ring while this works
        self.on_idle: list[Callable[[], None]] | None = None  # what waits until it is not busy

    def _is_looked_at_by_nobody(self) -> None:
        self.halt: Callable[[Callable[[Worker], None]], Callable[[Worker], None]] | None = None  # R3: its breakpoint
        self.observed = False  # somebody waits at its barriers: no fast paths
        self.meter: Any = None  # a Meter, while somebody wants statistics
        self.listened: list[Any] | None = None  # what tells those who send to slots of its own that it may listen
        self.region: Region[Worker] | None = None  # in which its firings are fused
        self.speaks = False  # its code sends by itself: the region says so before each call
        self.unfit = False  # its firings turned out not to be plain calls

    def _has_not_fired(self) -> None:
        self.special = False
        self.active = False
        self.right = False
        self.stamp: float | None = None
        self.taken: tuple[Any, ...] = ()
        self.held = False  # its inputs are released when its outputs are processed (F5 sequential)
        self.written: list[Entry | None] | None = None
        self.events_due: list[tuple[str, Any]] | None = None
        self.remembered: dict[str, Any] | None = None  # what the firing under way has taken, if `failed` is to tell
        self.end_stamp: float | None = None  # of the firing that ended it, and so of END (T5)
        self.given_up = False  # a source that counts as ended, though it has not said END (R5)
        self.pending_end = False  # END leaves as soon as the outputs are free (F4)
        self.deferred: list[int] | None = None  # modifiers drained before END was sent (F12)
        self.is_up = False  # its setup has begun, its teardown has not
        self.opening = False  # its setup is under way
        self.generator: Any = None
        self.carrier: Any = None
        self.call_edge: Any = None
        self.in_flight = False  # its code waits or runs in a thread
        self.job: Any = None  # what its thread is doing for it
        self.ticket = 0  # which firing or call a late result belongs to (X2)
        self.firings = self.silent = self.end_firings = self.call_number = 0
        self.failed = self.calls_failed = self.retries = self.restarts = 0

    def _has_no_timers(self) -> None:
        self.grid_start: float | None = None  # when its first firing with a rate began, and so its grid (F11)
        self.next_period = 0  # of that grid: the first in which it may start again
        self.next_start = 0.0  # when that begins
        self.gate_next = float("-inf")  # when its last firing began, for a throttling gate
        self.rate_timer: Any = None
        self.limit_timer: Any = None
        self.backoff_timer: Any = None
        self.active_timer: Any = None

    # --- its place in the plan (R4) ---------------------------------------------------------------------------------

    def stand_for(self, scope: Scope[Worker], active_for_s: float | None) -> None:
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
            if self.core.speaker is self and self.on_idle is None:
                self.on_idle = []  # a fast call of it is under way, which is to look behind it what waits now

    def lead_out_of_event(self, edge: Edge, name: str, port: EventPort[Any] | None) -> None:
        """An edge leads out of one of its events from now on."""
        event = self.make_event(name, port if self.node is not None or name == "start" else None)
        event.feed((*event.edges, edge))

    def make_event(self, name: str, port: EventPort[Any] | None) -> RunningEvent[Worker]:
        """Give the running event of this name; one that has neither edge nor subscriber yet is made now."""
        event = self.events.get(name)
        if event is None:
            event = RunningEvent(self, name, port)
            self.ask_for(event)
        return event

    def regroup(self, group: Group[Worker]) -> None:
        """It runs elsewhere from now on; where it stood in a queue it does no more."""
        self.leave_queue()
        self.join(group)

    def leave_plan(self) -> None:
        """An edit took it out of the graph: it moves no more, whatever still comes to it."""
        self.pending_end = False
        self.block(TORN_DOWN | REMOVED)
        self.leave_queue()
        self.step = Worker.dequeued

    def run_over(self) -> None:
        """The run is over: what is queued already does nothing, and nobody waits for room any more."""
        self.blocked |= TORN_DOWN
        self.placed = False
        for waiter in self.room_waiters or ():
            waiter()

    def cancel_timers(self) -> None:
        """Nothing is to come of it any more."""
        for timer in (self.rate_timer, self.limit_timer, self.backoff_timer, self.active_timer):
            if timer is not None:
                timer.cancel()
        self.rate_timer = self.limit_timer = self.backoff_timer = self.active_timer = None
        if self.attempts is not None:
            self.attempts.cancel()
        for flight in self.flights or ():
            flight.in_time()
            flight.attempts.cancel()

    # --- its place in the agenda and in the run queue (F1, F9, R2) ---------------------------------------------------

    def enqueue(self) -> None:
        """Stand in the run queue, once; who is busy looks for itself when that is over."""
        if not self.queued and not self.busy:
            self.queued = True
            self.push(self)

    def enqueue_next(self) -> None:
        """Stand in front of all others in the run queue; if it has a firing and a call, both go next."""
        self.queued = True
        self.follows = bool(self.calls and self.placed)
        self.push_next(self)
        self.core.followed += 1

    def follow(self) -> None:
        """Go next when the sending is over; behind an earlier call if it stands in the queue for one (F9).

        What is busy is not enabled by what it gets now, but by the end of what it does (F1).
        """
        if self.queued:
            self.follows = True
        elif not self.busy:
            self.queued = True
            self.core.followers.append(self)

    def follow_no_more(self) -> None:
        """What stood in front of it is over: whether it goes next is decided now."""
        self.follows = False

    def dequeued(self) -> None:
        """Its group has given it out: it is its turn."""
        self.queued = False

    def leave_queue(self) -> None:
        """Do not stand in the run queue, whoever is in front."""
        if self.queued:
            self.group.policy.remove(self)
            self.queued = False

    def take_place(self) -> None:
        """The next firing is enabled: it comes behind the calls that wait already (F9)."""
        self.placed = True
        self.ahead = len(self.calls) if self.calls else 0

    def lose_place(self) -> None:
        """What F1 asks for holds no more; a rate goes on holding what it holds."""
        self.placed = False

    def unplace(self) -> None:
        """The same, and no timer that would give a place."""
        self.placed = False
        if self.rate_timer is not None:
            self.forget_rate()

    def no_turn(self) -> None:
        """It has had its turn, and all that it was enabled for is done by that."""
        self.queued = self.placed = False

    # --- what keeps it from moving (F1) ------------------------------------------------------------------------------

    def block(self, reason: int) -> None:
        """Let no firing start; its place in the agenda is lost (F9), and it does not rest: no wave may take that so."""
        self.blocked |= reason
        if self.region is not None:
            self.region.disturb(self)
        if reason == FULL:
            self.placed = False  # a rate goes on holding it, and is to be over before a queue grows (F8)
            return
        self.unplace()
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
        self.rate_timer = self.core.host.call_at(when, over)

    def rate_over(self) -> None:
        """The time has come for which a rate held it."""
        self.rate_timer = None
        self.blocked &= ~RATE
        if self.watchers is not None:
            self.tell_watchers()

    def forget_rate(self) -> None:
        """What the rate would have let start is gone."""
        self.rate_timer.cancel()
        self.rate_over()

    def note_start(self, rate_hz: float) -> None:
        """F11: a firing starts now; the next one may in the next period of the grid that the first one began.

        Each place of the grid is found from its beginning, so that errors of floats never add up.
        """
        now = self.core.now()
        if self.grid_start is None:
            self.grid_start = now
        period = int((now - self.grid_start + SAME_MOMENT_S) * rate_hz)
        self.next_period = max(self.next_period, period) + 1  # (a clock as large as the date has fewer digits)
        self.next_start = self.grid_start + self.next_period / rate_hz

    def note_gated_start(self, when: float) -> None:
        """A11: an idle rate counts from here; minus infinity: from the next firing."""
        self.gate_next = when

    def queue_full(self) -> None:
        """F8: one more queue of its events is full."""
        self.full_edges += 1
        self.core.full_edges += 1
        self.core.suspects[self] = None
        self.block(FULL)

    def queue_free(self) -> bool:
        """F8: one less; whether none is left. Code that waits for room is told."""
        self.full_edges -= 1
        self.core.full_edges -= 1
        if self.full_edges:
            return False
        if self.watchers is not None:
            self.tell_watchers()
        self.room_for_all()
        return True

    def room_for_all(self) -> None:
        """Tell code that waits for room behind the worker's events."""
        waiters, self.room_waiters = self.room_waiters, None
        for waiter in waiters or ():
            waiter()

    def when_room(self, waiter: Callable[[], None]) -> None:
        """Tell this waiter when no queue behind the worker's events is full."""
        if self.room_waiters is None:
            self.room_waiters = []
        self.room_waiters.append(waiter)

    def code_waits_for_room(self, how_many: int) -> None:
        """F8: so much more of its own code awaits `trigger_wait`."""
        self.waiting_room += how_many
        self.core.waiting_room += how_many
        self.core.suspects[self] = None
        self.tell_watchers()

    def be_watched_by(self, held: Worker) -> None:
        """F8: what is held back by a full queue is in no ring as long as code of this one goes on, or its timer."""
        if self.watchers is None:
            self.watchers = {}
        self.watchers[held] = None

    def tell_watchers(self) -> None:
        """F8: that is over, so they are looked at again."""
        if self.watchers is not None:
            self.core.suspects.update(self.watchers)
            self.watchers = None

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
        self.placed = False
        self.busy = "firing"
        self.firings += 1
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

    def fire_silently(self) -> None:
        """F4(2): the firing under way is silent."""
        self.silent += 1

    def write(self, position: int, entry: Entry) -> None:
        """The firing has written to one output; it leaves when the firing is over."""
        if self.written is None:
            self.written = [None] * len(self.out_edges)
        self.written[position] = entry

    def be_over(self) -> None:
        """The firing or call is over, but for what it releases."""
        self.busy = "over"

    def keep_generator(self, generator: object) -> None:
        """What a source draws its next values from; None: it has ended, or begins at its next firing."""
        self.generator = generator

    def count_end_firing(self) -> None:
        """The firing under way is the one with which it ends."""
        self.end_firings += 1

    def count_failure(self, *, of_call: bool = False) -> None:
        """Its code has failed, in a slot call or elsewhere (X1)."""
        if of_call:
            self.calls_failed += 1
        else:
            self.failed += 1

    def count_retry(self) -> None:
        """A firing that has failed is tried again (X1)."""
        self.retries += 1

    def begin_restart(self) -> None:
        """X1: it is torn down, and set up after a pause."""
        self.restarts += 1
        self.block(BACKOFF)

    def time_backoff(self, timer: Timer | None) -> None:
        """X1: when this timer is over it is set up again; None: it is over."""
        self.backoff_timer = timer

    def be_up(self, up: bool) -> None:
        """Whether its setup has begun and its teardown has not."""
        self.is_up = up

    def be_opening(self, opening: bool) -> None:
        """Whether its setup is under way."""
        self.opening = opening

    def take_written(self) -> list[Entry | None] | None:
        """What the firing has written leaves now, or never."""
        written, self.written = self.written, None
        return written

    def begin_call(self, edge: Edge, stamp: float) -> None:
        """A slot call begins, for the oldest token of the edge."""
        self.busy = "call"
        self.call_number += 1
        self.ticket += 1
        self.call_edge = edge
        self.stamp = stamp

    def take_call(self) -> AnyEdge:
        """Whose token waits longest for a slot call: its turn has come."""
        assert self.calls is not None
        if self.placed and self.ahead:
            self.ahead -= 1
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
        if position < self.ahead:
            self.ahead -= 1

    def end_call(self) -> AnyEdge:
        """The call is over, but for what it releases; gives back the edge that it took from."""
        edge: AnyEdge = self.call_edge
        self.call_edge = None
        self.busy = "over"
        return edge

    def end_firing(self) -> tuple[Any, ...]:
        """The firing is over, but for what it releases; gives back the edges to be released now, if any.

        While its outputs are not free it holds them, and `outputs_free` gives them back (F5).
        """
        self.busy = "over"
        self.written = None
        if self.outputs.missing:
            self.held = True
            return ()
        return self.taken

    def outputs_free(self) -> tuple[Any, ...]:
        """All that it has sent is processed: gives back the edges that are released by that."""
        if not self.held:
            return ()
        self.held = False
        return self.taken

    def release_early(self, edges: tuple[Any, ...] | None = None) -> tuple[Any, ...]:
        """What it has taken is processed before its outputs are: from these edges, or from all; gives them back."""
        released = self.taken if edges is None else edges
        self.taken = tuple(edge for edge in self.taken if edge not in released)
        return released

    def leave(self) -> None:
        """The firing or call is behind it: no right of A3, and the present is the stamp of what it sends."""
        self.right = False
        self.stamp = None

    def give_up_firing(self) -> None:
        """X2: what its code still brings is too late."""
        self.ticket += 1

    def mark_special(self) -> None:
        """Its next firing is not an ordinary one: a marker lies before it."""
        self.special = True

    def set_out(self) -> None:
        """Its code waits, or runs in a thread, and its outcome comes later."""
        self.in_flight = True
        self.core.set_out()

    def take_job(self, job: object) -> None:
        """A thread works for it: by this job, perhaps with others of its region."""
        self.job = job

    def come_back(self) -> None:
        """Its code is over, or given up; a node that a thread has worked with sees its activity again."""
        self.in_flight = False
        self.core.come_back()
        if self.watchers is not None:
            self.tell_watchers()
        if self.job is not None:
            self.leave_job()

    def leave_job(self) -> None:
        """What the thread did for it is over."""
        self.job = None
        self.node._active = self.active

    def be_carried(self, carrier: object) -> None:
        """Its coroutines run in this dormant task from now on; None: the next one makes another."""
        self.carrier = carrier

    # --- by a fast path (see the wing `fusion`) ----------------------------------------------------------------------

    def go_by(self, step: Callable[[Worker], None]) -> None:
        """This is what it does from now on when it has its turn."""
        self.step = step

    def be_fused(self, region: Region[Worker] | None) -> None:
        """A region fuses its firings with those of others; None: none does any more."""
        self.region = region

    def fit_no_more(self) -> None:
        """What it does is hardly ever plain: no region takes it any more."""
        self.unfit = True

    def speak_by_itself(self) -> None:
        """Its code sends amid its calls, so a region says before each of them that it runs."""
        self.speaks = True

    def be_in_wave(self, doing: str = "wave") -> None:
        """It is busy for as long as the wave of its region is under way; that disturbs no region.

        Only the member whose call is under way fires, and what it may do, others may not.
        """
        self.busy = doing

    def stamp_with(self, stamp: float) -> None:
        """What its code sends by itself in a wave is of this time."""
        self.stamp = stamp

    def has_fired(self, times: int, silently: int = 0) -> None:
        """Count firings that a region has seen to."""
        self.firings += times
        self.silent += silently

    def was_called(self, times: int) -> None:
        """Count slot calls that a region has seen to."""
        self.call_number += times

    def hold(self, edges: tuple[Any, ...]) -> None:
        """F5: what it has sent is not processed by all; from these edges it took, and they are released by that."""
        self.held = True
        self.taken = edges

    def wait_for_taking(self, missing: int, edges: tuple[Any, ...]) -> None:
        """F5: so many edges hold what it has sent, perhaps none; see `hold`."""
        self.outputs.missing = missing
        self.held = missing > 0
        if missing:
            self.taken = edges

    def be_amid_firing(self, edges: tuple[Any, ...], stamp: float) -> None:
        """A firing that a region had begun is one like any other from here on; what has come in meanwhile stays."""
        self.ticket += 1
        self.firings += 1
        self.busy = "firing"
        self.took(edges, stamp)

    def be_amid_call(self, edge: Edge) -> None:
        """A call that was begun and counted already is one like any other from here on."""
        self.queued = False
        self.busy = "call"
        self.call_edge = edge
        self.ticket += 1

    def fire_plainly(self, edges: tuple[Any, ...], stamp: float) -> None:
        """It has had its turn, and fires with plain values: see `begin_firing` and `took`."""
        self.queued = self.placed = False
        self.firings += 1
        self.ticket += 1
        self.busy = "firing"
        self.stamp = stamp
        self.taken = edges

    def go_behind_wave(self) -> None:
        """It has its turn when the wave that leaves is out of the way (R2)."""
        self.queued = True
        self.core.followers.append(self)

    def give_away_activity(self) -> None:
        """A5: what it sends has taken its activity, to which it has a right until its call is over (A3)."""
        self.active = self.node._active = False
        self.right = self.stamp is not None

    # --- activity (A3, A5, A9) ----------------------------------------------------------------------------------------

    def become(self, active: bool) -> None:
        """A(v) := active; who fuses its firings looks whether activity would move now."""
        self.active = active
        if self.region is not None:
            self.region.disturb(self)

    def keep_right(self, right: bool) -> None:
        """A3: whether it may still carry activity that A5 took earlier in the firing or call under way."""
        self.right = right

    def expect_event(self, name: str, value: object) -> None:
        """An automatic event has arisen; it leaves with the others, in their order (A9)."""
        if self.events_due is None:
            self.events_due = []
        self.events_due.append((name, value))

    def remember(self, taken: dict[str, Any]) -> None:
        """The firing has taken these values; should it fail, that is told (X1)."""
        self.remembered = taken

    def recall(self) -> dict[str, Any]:
        """What the firing had taken; it is over, and holds that no longer."""
        taken, self.remembered = self.remembered, None
        return taken or {}

    def take_events(self) -> list[tuple[str, Any]]:
        """The automatic events that have arisen, to be sent now."""
        due, self.events_due = self.events_due, None
        return due or []

    def defer(self, modifier: int) -> None:
        """F12: a modifier that was drained acts behind the worker's own END."""
        assert self.deferred is not None
        self.deferred.append(modifier)

    def defer_none(self) -> None:
        """A14: what was drained brings no activity any more."""
        if self.deferred:
            self.deferred = [0] * len(self.deferred)

    def take_deferred(self) -> list[int]:
        """Its END has been sent, or never will be: what was drained acts now."""
        deferred, self.deferred = self.deferred, None
        return deferred or []

    def time_activity(self, timer: Timer | None) -> None:
        """A12: how long it has been active is measured by this timer from now on, or not at all; the last is over."""
        if self.active_timer is not None:
            self.active_timer.cancel()
        self.active_timer = timer

    def active_long_enough(self) -> None:
        """A12: the timer has come to its end."""
        self.active_timer = None

    # --- its end, and beginning afresh (F4, F10, F12, X1) -------------------------------------------------------------

    def end(self, *, given_up: bool = False) -> None:
        """From here on it fires no more, and what comes is drained (F12); `given_up`: it will not say END (R5)."""
        self.block(ENDED)
        self.deferred = []
        self.given_up = self.given_up or given_up
        for edge in self.in_edges:
            edge.source.changed()  # whose fast paths do not look whether what they send is drained

    def promise_end(self, stamp: float | None) -> None:
        """END follows as soon as the outputs are free; with this stamp (T5)."""
        self.end_stamp = stamp
        self.pending_end = True
        for edges in self.out_edges:
            for edge in edges:
                if edge.target.region is not None:
                    edge.target.region.expect_end()

    def send_end_now(self) -> None:
        """END is sent, as a sending of its own."""
        self.pending_end = False
        self.stamp = self.end_stamp

    def not_ended(self) -> None:
        """It starts afresh: it has not ended, nor have the inputs that it must have, nor have its events."""
        self.pending_end = self.given_up = False
        self.deferred = None
        if self.flights is not None:
            self.flights.begin_afresh()
            self.crowd()
        for edge in self.in_edges:
            edge.begin_afresh()
        for edge in self.event_edges():
            if edge.renew is not None and edge.complete is None:
                edge.renew()

    def limit(self, timer: Timer | None) -> None:
        """X2: the firing may take as long as this timer."""
        self.limit_timer = timer

    def in_time(self) -> None:
        """What had a time limit is over in time."""
        timer, self.limit_timer = self.limit_timer, None
        if timer is not None:
            timer.cancel()

    def out_of_time(self) -> None:
        """X2: what had a time limit has taken longer."""
        self.limit_timer = None
        self.ticket += 1

    def when_idle(self, callback: Callable[[], None]) -> None:
        """Call back when nothing is under way, before the next firing or call."""
        if self.on_idle is None:
            self.on_idle = []
            self.changed()
        self.on_idle.append(callback)
        self.crowd()

    # --- several firings under way (F14) ----------------------------------------------------------------------------

    def crowd(self) -> None:
        """Let no other firing begin if enough are under way, or somebody waits until none is; else let it."""
        if self.flights is None:
            return
        if not (self.flights.full or self.on_idle):
            self.allow(CROWDED)
        elif not self.blocked & CROWDED:
            self.block(CROWDED)

    def is_flying(self) -> bool:
        """Whether code of a firing that goes on beside others is not over."""
        return self.flights is not None and self.flights.unfinished

    def send_as(self, stamp: float | None) -> float | None:
        """What it sends has this stamp from now on (T5); gives back the one before, of a call that is under way."""
        before, self.stamp = self.stamp, stamp
        return before

    def firings_under_way(self) -> int:
        """How many of its firings are under way, those included that are over and wait for their turn (F14)."""
        if self.flights is not None:
            return len(self.flights)
        in_wave = self.busy == "wave" and self.region is not None and self.region.is_calling(self)
        return int(in_wave or self.busy in ("firing", "ending"))

    def most_under_way(self) -> int:
        """How many there ever were at once."""
        return min(1, self.firings) if self.flights is None else self.flights.most

    def codes_at_work(self) -> int:
        """How much of its code waits or runs in a thread: one firing or call, or several firings, and tasks."""
        firings = self.in_flight + (0 if self.flights is None else self.flights.working)
        return firings + (0 if self.tasks is None else len(self.tasks))

    def codes_waiting_for_room(self) -> int:
        """How much of that waits until a queue has room (F8)."""
        tasks = 0 if self.tasks is None else self.tasks.waiting_room
        if not self.waiting_room:
            return int(tasks)
        return tasks + (int(self.in_flight) if self.flights is None else min(self.waiting_room, self.flights.working))

    def start_tasks(self, tasks: object) -> None:
        """Its code starts a task for the first time."""
        self.tasks = tasks

    def let_others(self) -> None:
        """What waits until it is not busy has its turn, as long as that does not make it busy."""
        while self.on_idle and not self.busy and not self.is_flying():
            self.on_idle.pop(0)()
        if not self.on_idle and self.on_idle is not None:
            self.on_idle = None
            self.crowd()
            self.changed()

    def rewire(self, live_inputs: tuple[Any, ...]) -> None:
        """What it waits for, and what it sends on, is derived anew from the liveness of its edges."""
        self.wait_for(live_inputs)
        self.inputs.count(sum(1 for edge in live_inputs if not edge.untaken))
        if self.inputs.missing:
            self.unplace()

    def halt_at(self, halt: Callable[[Callable[[Worker], None]], Callable[[Worker], None]] | None) -> None:
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
        self.core.upstairs.choose_step(self)

    def moves_by_itself(self) -> bool:
        """Whether something of it is under way or will be, without anybody else; not who only waits for room (F8)."""
        return (
            self.queued
            or (self.busy != "" and not self.waiting_room)
            or (self.flights is not None and self.flights.unfinished and not self.waiting_room)
            or self.rate_timer is not None
            or self.backoff_timer is not None
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
        if self.flights is not None:
            self.flights.check_invariants(self.path)
        if not self.blocked & (ENDED | TORN_DOWN):  # who has ended waits for nothing any more (F12)
            missing = sum(1 for edge in self.live_inputs if not edge.untaken)
            self.inputs.check_invariants(missing, f'inputs of "{self.path}"')

    def _relations(self) -> Iterator[tuple[bool, str]]:
        """What holds of it between two steps."""
        yield from self._relations_of_its_place()
        if not self.busy:
            yield self.stamp is None and not self.right, "it rests, but has the stamp or the right of a firing (T5, A3)"
            yield self.written is None, "it rests, but what a firing wrote has not left (F3)"
            yield self.call_edge is None, "it rests, but is amid a slot call"
            yield not self.follows or self.queued, "it is to go next, but for nothing (R2)"
        yield self.outputs.missing > 0 or not self.held, "it holds its inputs for outputs that are free (F5)"
        yield bool(self.blocked & ENDED) or not self.pending_end, "END is to follow, but it has not ended (F4)"
        yield bool(self.blocked & ENDED) or self.deferred is None, "modifiers wait for its END, but it has not ended"
        yield bool(self.full_edges) == bool(self.blocked & FULL), "held back by a full queue that is none (F8)"
        yield self.rate_timer is None or bool(self.blocked & RATE), "a rate's timer runs, but no rate holds it (F11)"

    def _relations_of_its_place(self) -> Iterator[tuple[bool, str]]:
        """What holds of its place in the agenda and in the run queue (F1, F9)."""
        may_fire = not (self.blocked or self.inputs.missing or self.outputs.missing)
        may_call = bool(self.calls) and self.blocked < NO_CALLS
        yield may_fire or not self.placed, "its firing has a place, but F1 does not hold"
        if not self.busy and self.core.started and not self.is_boundary_output:
            yield self.placed or not may_fire, "F1 holds, but its firing has no place"
            yield self.queued or not (self.placed or may_call), "it may move, but does not stand in its run queue"
        calls, waiting = len(self.calls or ()), sum(edge.untaken for edge in self.called_by())
        yield not calls or self.ahead <= calls or not self.placed, "more calls stand before its firing"
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


def _not_planned(worker: Worker) -> None:
    raise AssertionError(f"{worker} has no plan")

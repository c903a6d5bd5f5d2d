"""What firings and calls change in a node: its barriers, its agenda, the current firing, its activity (F1, F3, F9, A3).

This is plain state with its transitions; `rules` decides. The fields that each hop reads are here, and not in records
of their own, because one more attribute per access is what a hop notices most.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from hfg.engine.model.calls import Calls
from hfg.engine.model.concurrent import Entry
from hfg.engine.model.contracts import NodeT, Timer
from hfg.engine.model.records import Counts, Ending, Execution, Lifecycle, Rate, Record
from hfg.engine.model.vertex import Vertex
from hfg.ports.barrier import Barrier
from hfg.ports.edges import AnyEdge, Edge, EventEdge

__all__ = ["NodeState"]


@dataclass(slots=True, eq=False)
class NodeState(Vertex[NodeT], Record):
    """A node of the plan with the state that its firings and calls change."""

    # why it may not fire, and what it does
    inputs: Barrier = field(default_factory=Barrier)  # `missing`: its live, not ended, empty inputs
    outputs: Barrier = field(default_factory=Barrier)  # `missing`: its tokens that are not processed
    blocked: int = 0  # bits from above
    # "", or what is in progress: "firing", "call", "asking", "ending", "setup"; "edit": an edit holds it; "wave": the
    # wave of its region lets others go first; "releasing": it is over, but for what it releases
    busy: str = ""

    # its agenda, and its place in the ready queue
    fireable: bool = False  # F1 holds, and the firing has its place in the agenda,
    calls_before: int = 0  # after this many slot calls (F9)
    calls: Calls | None = None  # edges whose oldest token waits for a call, as they arrived
    caller: EventEdge | None = None  # the edge, if all its calls are of one event edge
    queued: bool = False  # it is in its group's ready queue
    is_next: bool = False  # after the call for which it is queued, it goes next again (R2)
    idle_callbacks: list[Callable[[], None]] | None = None  # called when it is not busy

    # the current firing or call
    special: bool = False  # a marker is on an input, or the like: fast paths step aside
    stamp: float | None = None  # of what it sends (T5); None: the present
    # edges whose tokens the firing took, and which are processed when its outputs are (F5 sequential)
    taken: tuple[Any, ...] = ()
    holds_inputs: bool = False  # the firing is over, its outputs are not processed yet
    written: list[Entry | None] | None = None  # per output; None until the first
    call_edge: Any = None
    ticket: int = 0  # of the firing or call; the late result of another is ignored (X2)
    events_due: list[tuple[str, Any]] | None = None  # automatic events that follow it (A9)

    # its activity
    active: bool = False  # A(v)
    may_carry: bool = False  # A3: A5 took its activity earlier in this firing or call
    active_timer: Timer | None = None  # A12
    # outputs whose senders have to know whether its slots listen, which is while it is active
    listened: list[Any] | None = None

    # records of their own
    counts: Counts = field(default_factory=Counts)
    rate: Rate = field(default_factory=Rate)
    lifecycle: Lifecycle = field(default_factory=Lifecycle)
    execution: Execution = field(default_factory=Execution)
    ending: Ending | None = None  # from its last firing on

    # --- its agenda and its place in the ready queue (F1, F9, R2) -----------------------------------------------------

    def clear_next(self) -> None:
        """What it was queued for is over: whether it goes next is decided again."""
        self.is_next = False

    def dequeued(self) -> None:
        """Its group has taken it from the ready queue: it is its turn."""
        self.queued = False

    def make_fireable(self) -> None:
        """Enable the next firing, which comes after the calls that wait already (F9)."""
        self.fireable = True
        self.calls_before = len(self.calls) if self.calls else 0

    def make_unfireable(self) -> None:
        """F1 does not hold any more; a rate continues."""
        self.fireable = False

    def take_place(self) -> None:
        """A wave keeps it a place at the front of the ready queue; slot calls wait after it."""
        self.queued = True

    def go_before_calls(self) -> None:
        """The next firing was enabled before the slot calls that wait now (F9)."""
        self.calls_before = 0

    def use_turn(self) -> None:
        """It has had its turn, and with it all that it was enabled for."""
        self.queued = self.fireable = False

    # --- the current firing or call (F3, F9, X2) ----------------------------------------------------------------------

    def be_in_wave(self, doing: str = "wave") -> None:
        """It is busy as long as the wave of its region runs, which disturbs no region.

        Only the member whose call is in progress fires, and only that one may do what firings may.
        """
        self.busy = doing

    def rest(self) -> None:
        """Nothing is in progress any more."""
        self.busy = ""

    def begin_firing(self) -> None:
        """A firing starts; `took` follows when its tokens are taken."""
        self.fireable = False
        self.busy = "firing"
        self.counts.firings += 1
        self.ticket += 1
        self.special = False

    def took(self, edges: tuple[AnyEdge, ...], stamp: float) -> None:
        """The firing has taken its tokens.

        Args:
          edges: those whose tokens are processed when its outputs are (F5 sequential).
          stamp: of what it sends (T5).
        """
        self.taken = edges
        self.stamp = stamp

    def write(self, position: int, entry: Entry) -> None:
        """The firing has written to one output; that leaves when the firing is over."""
        if self.written is None:
            self.written = [None] * len(self.out_edges)
        self.written[position] = entry

    def take_written(self) -> list[Entry | None] | None:
        """Return what the firing has written, which leaves now or never."""
        written, self.written = self.written, None
        return written

    def begin_call(self, edge: Edge, stamp: float) -> None:
        """A slot call starts, for the oldest token of the edge."""
        self.busy = "call"
        self.counts.calls += 1
        self.ticket += 1
        self.call_edge = edge
        self.stamp = stamp

    def take_call(self) -> AnyEdge:
        """Return the edge whose token has waited longest for a slot call: its turn has come."""
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
        """The oldest token of the edge was dropped, and with it its call."""
        assert self.calls is not None
        position = self.calls.index(edge)
        del self.calls[position]
        if position < self.calls_before:
            self.calls_before -= 1

    def end_call(self) -> AnyEdge:
        """The call is over, but for what it releases. Return the edge that it took from."""
        assert self.call_edge is not None, "no call is in progress"
        edge: AnyEdge = self.call_edge
        self.call_edge = None
        self.busy = "releasing"
        return edge

    def end_firing(self) -> tuple[Any, ...]:
        """The firing is over, but for what it releases. Return the edges to release now.

        If its outputs are not free, it holds the edges, and `outputs_free` returns them (F5).
        """
        self.busy = "releasing"
        self.written = None
        if self.outputs.missing:
            self.holds_inputs = True
            return ()
        return self.taken

    def outputs_free(self) -> tuple[Any, ...]:
        """All that it has sent is processed. Return the edges to release now."""
        if not self.holds_inputs:
            return ()
        self.holds_inputs = False
        return self.taken

    def release_early(self, edges: tuple[AnyEdge, ...] | None = None) -> tuple[Any, ...]:
        """Tokens that it took from these edges, by default all, are processed before its outputs are. Return them."""
        released = self.taken if edges is None else edges
        self.taken = tuple(edge for edge in self.taken if edge not in released)
        return released

    def begin_releasing(self) -> tuple[Any, ...]:
        """The last firing is over. Return the edges to release, whether its outputs are free or not."""
        self.busy = "releasing"
        return self.release_early()

    def leave(self) -> None:
        """The firing or call is over: no right of A3, and what it sends has the present as its stamp."""
        self.may_carry = False
        self.stamp = None

    def send_as(self, stamp: float | None) -> float | None:
        """Stamp its sendings with this (T5). Return the previous stamp, of a call that is in progress."""
        before, self.stamp = self.stamp, stamp
        return before

    def give_up_firing(self) -> None:
        """Ignore the late result of its code, and stop its time limit (X2)."""
        self.execution.end_limit()
        self.ticket += 1

    def mark_special(self, special: bool = True) -> None:
        """Set whether its next firing is not a plain one, because a marker is on an input."""
        self.special = special

    # --- by a fast path (see `fusion`) --------------------------------------------------------------------------------

    def mark_ordinary(self) -> None:
        """Only values are missing in its next firing, and a wave sees to that."""
        self.special = False

    def hold(self, edges: tuple[AnyEdge, ...]) -> None:
        """Some of what it has sent is not processed; these edges are released after that (F5)."""
        self.holds_inputs = True
        self.taken = edges

    def wait_for_taking(self, missing: int, edges: tuple[AnyEdge, ...]) -> None:
        """This many edges, perhaps none, hold what it has sent (F5); see `hold`."""
        self.outputs.missing = missing
        self.holds_inputs = missing > 0
        if missing:
            self.taken = edges

    def resume_as_firing(self, edges: tuple[AnyEdge, ...], stamp: float) -> None:
        """Turn a firing that a region has started into an ordinary one; what has arrived meanwhile stays."""
        self.ticket += 1
        self.counts.firings += 1
        self.busy = "firing"
        self.took(edges, stamp)

    def resume_as_call(self, edge: Edge) -> None:
        """Turn a call that was started and counted already into an ordinary one."""
        self.queued = False
        self.busy = "call"
        self.call_edge = edge
        self.ticket += 1

    def fire_plainly(self, edges: tuple[AnyEdge, ...], stamp: float) -> None:
        """It has had its turn, and fires with plain values: `use_turn`, `begin_firing` and `took` in one call."""
        self.queued = self.fireable = False
        self.counts.firings += 1
        self.ticket += 1
        self.busy = "firing"
        self.stamp = stamp
        self.taken = edges

    # --- its activity (A3, A5, A9, A12) -------------------------------------------------------------------------------

    def show_activity(self) -> None:
        """Let the node's own code see its activity.

        Under the virtual clock, code in a thread continues to see what held when it started, or the result would depend
        on chance (R6).
        """
        job = self.execution.job
        if self.node is not None and (job is None or job.time_hold is None):
            self.node._active = self.active

    def hide_activity(self) -> None:
        """The run is over, and the node belongs to none."""
        if self.node is not None:
            self.node._active = False

    def give_away_activity(self) -> None:
        """Its tokens have taken its activity (A5); more may carry it until the call is over (A3)."""
        self.active = self.node._active = False
        self.may_carry = self.stamp is not None

    def let_carry(self, may_carry: bool) -> None:
        """Set whether it may still carry activity that A5 took earlier in the firing or call (A3)."""
        self.may_carry = may_carry

    def brings_activity(self) -> bool:
        """Return whether it has drained a +1 that has yet to act (G2)."""
        return self.ending is not None and self.ending.brings_activity

    def expect_event(self, name: str, value: object) -> None:
        """Add an automatic event, which leaves with the others, in their order (A9)."""
        if self.events_due is None:
            self.events_due = []
        self.events_due.append((name, value))

    def take_events(self) -> list[tuple[str, Any]]:
        """Return the automatic events to send now."""
        due, self.events_due = self.events_due, None
        return due or []

    def time_activity(self, timer: Timer | None) -> None:
        """Let this timer, or none, measure how long it has been active (A12); cancel the previous one."""
        if self.active_timer is not None:
            self.active_timer.cancel()
        self.active_timer = timer

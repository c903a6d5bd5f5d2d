"""The state of one run, which its decisions share.

Decisions never wait: `Runtime` and `Code` stand for time, threads and coroutines, which asyncio implements in higher
layers. This module is below the class of nodes, and so is generic in it.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Coroutine, Iterator, Sequence
from dataclasses import dataclass, field
from types import FrameType
from typing import Any, Generic, Literal, Protocol

from hfg.base.token import Token
from hfg.engine.model.concurrent import ConcurrentFiring
from hfg.engine.model.contracts import NodeT, Timer
from hfg.engine.model.flags import Flags
from hfg.engine.model.iteration import Iteration
from hfg.engine.model.jobs import Done
from hfg.engine.model.scopes import Gate, Scope
from hfg.engine.model.tasks import Doing, Task
from hfg.errors import HfgError
from hfg.ports.edges import BufferEdge, EventEdge, SyncEdge
from hfg.ports.events import EventPort
from hfg.trace import TraceEvent

__all__ = ["PENDING", "Code", "Core", "FusedRegion", "RuleCallbacks", "Runtime"]


class _Pending:
    def __repr__(self) -> str:
        return "PENDING"


PENDING = _Pending()
"""The result of code that waits: the real one comes later."""


class FusedRegion(Protocol[NodeT]):
    """Nodes whose firings are fused (see `fusion`), as lower layers see them."""

    head: NodeT
    running: bool
    waves: int
    paths: tuple[str, ...]  # of its members, in the order in which they fire

    def at_work(self, frame: FrameType | None) -> NodeT | None:
        """Return the member whose call a running wave is in, by the line at which it is."""

    def is_calling(self, worker: NodeT) -> bool:
        """Return whether a running wave is in the call of this member."""

    def activity_changed(self, worker: NodeT) -> None:
        """A member is active now, or no longer."""

    def is_sending(self, worker: NodeT) -> bool:
        """A member's code sends: return whether a fused call of it is in progress."""

    def disturb(self, worker: NodeT) -> None:
        """A member does not rest any more: it continues unfused."""

    def interrupt(self) -> None:
        """End the wave in progress after its current call."""

    def abandon(self) -> NodeT:
        """The wave in progress does not come back. Return the member whose call it is in."""

    def dissolve(self) -> None:
        """Its members are ordinary nodes from here on."""

    def measure_on(self) -> None:
        """Measurements have been read: measure the next waves."""

    def settle_counts(self) -> None:
        """Add the waves so far to the members' counts."""

    def disarm(self) -> None:
        """Let each member's barriers show what it waits for."""

    def check_invariants(self) -> None:
        """Check that everything inside rests while it is armed."""


class Runtime(Protocol[NodeT]):
    """The waiting part of the engine, as decisions need it."""

    def now(self) -> float:
        """Return seconds on the run's clock."""

    def call_at(self, when: float, callback: Callable[[], None], *, counts: bool = True) -> Timer:
        """Call back at `when` on the run's clock; `counts`: that could start something, so quiet waits for it."""

    def kick(self) -> None:
        """Something was queued from outside the pump: make the pump run."""

    def finish(self, outcome: str, error: HfgError | None) -> None:
        """End the run; only the first call counts."""

    def soon(self, callback: Callable[[], None]) -> None:
        """Call back in the loop's next pass."""

    def start_task(self, worker: NodeT, coroutine: Coroutine[Any, Any, Any], doing: Doing[NodeT] | None = None) -> None:
        """Start a child task of the node, for its code or as its do-activity (A15)."""

    @property
    def teardown_limit_s(self) -> float:
        """How long code may take to end once it is cancelled, and each teardown (X3)."""

    def limit_task(self, task: Task[NodeT]) -> None:
        """A task was cancelled: if it does not end in time while the run continues, it is left behind (X3)."""

    def on_loop(self) -> bool:
        """Return whether the caller is on the run's own thread."""

    def from_any_thread(self, call: Callable[[], None]) -> None:
        """Make this call on the loop; calls of one thread keep their order."""

    def bring_in(self, call: Callable[[], None]) -> None:
        """From a thread outside the run: make this call on the loop, in order, unless the run is over by then."""

    def adopt_event(self, port: EventPort[Any]) -> None:
        """Attach the run's scheduler and thread to an event."""


class Code(Protocol[NodeT]):
    """Runs the code of nodes where it belongs, then calls `done(result, error)`, immediately or later on the loop."""

    def execute(self, worker: NodeT, call: Callable[..., Any], arguments: tuple[Any, ...], done: Done) -> None:
        """Run a node's code."""

    def execute_concurrent(
        self, firing: ConcurrentFiring[NodeT], call: Callable[..., Any], arguments: tuple[Any, ...], done: Done
    ) -> None:
        """Run the code of one of several firings of a node (F14)."""

    def execute_wave(
        self, workers: Sequence[NodeT], call: Callable[..., Any], arguments: tuple[Any, ...], done: Done
    ) -> None:
        """Run code of several nodes of a thread group, one after the other; `done` follows even if the run is over."""

    def execute_hook(self, worker: NodeT, call: Callable[..., Any], done: Done) -> None:
        """Run a hook of activity, concurrently with whatever the node does."""

    def drive(
        self,
        worker: NodeT,
        coroutine: Coroutine[Any, Any, object],
        done: Done,
        firing: ConcurrentFiring[NodeT] | None = None,
    ) -> None:
        """Run a coroutine of the node's code, or of one of its firings (F14), to its end."""

    def late(self, worker: NodeT, done: Done) -> Done:
        """Return what to call when code that waited has ended."""

    def interrupt(self, worker: NodeT, *, firing: ConcurrentFiring[NodeT] | None = None) -> None:
        """Cancel or abandon code of the node that is in progress, or that of one of its firings (X2, F14)."""


class RuleCallbacks(Protocol[NodeT]):
    """Functions of higher modules that lower ones call, so that imports only go down."""

    def idle_again(self, worker: NodeT) -> None:
        """A node is no longer busy."""

    def fail(
        self, worker: NodeT, what: str, error: BaseException, *, answer: bool, then: Callable[[], None] | None = None
    ) -> None:
        """Something of a node has failed (X1).

        Args:
          worker: the node.
          what: failed.
          error: was raised.
          answer: it is a firing, which still owes its outputs.
          then: otherwise called before the node is disabled or restarted.
        """

    def fail_call(self, worker: NodeT, slot: str, error: BaseException) -> None:
        """A slot call has failed (X1)."""

    def operator_failed(self, edge: EventEdge, error: BaseException) -> None:
        """An operator on an edge has raised."""

    def begin_concurrent(
        self, worker: NodeT, kind: str, edges: Sequence[Any], tokens: Sequence[Token[Any]], refused: Exception | None
    ) -> None:
        """A firing that has taken its tokens continues alongside others (F14); `refused`: it fails (P8)."""

    def complete_firings(self, worker: NodeT) -> None:
        """The outputs are free: firings that have ended may leave (F14)."""

    def send_end(self, worker: NodeT) -> None:
        """END is to follow, and the outputs are free (F4)."""

    def node_ended(self, worker: NodeT) -> None:
        """A node has sent END (P9, R5)."""

    def activity_changed(self, worker: NodeT, active: bool) -> None:
        """A(v) of a watched node has changed (A9, A11, A12, G2)."""

    def scopes_changed(self, core: Core[NodeT]) -> None:
        """The activity of subgraphs may have changed (G2)."""

    def deactivate_inside(self, scope: Scope[NodeT], cause: Literal["sent", "slot"]) -> None:
        """Activity leaves everything inside a subgraph (G2)."""

    def rewire(self, worker: NodeT) -> None:
        """A node waits for other inputs than before."""

    def specialise(self, worker: NodeT) -> None:
        """Wiring or observers of a node have changed: choose its shortest path again."""

    def bind_ports(self, worker: NodeT) -> None:
        """A node is about to be set up: connect its ports to the run."""

    def iterate(self, worker: NodeT, arguments: Sequence[Any]) -> None:
        """A subgraph that iterates fires (G4)."""


@dataclass(slots=True, eq=False)
class Core(Generic[NodeT]):
    """One run: what its decisions share."""

    runtime: Runtime[NodeT]  # the waiting part of the engine
    rules: RuleCallbacks[NodeT]
    code: Code[NodeT] = field(init=False)  # runs the nodes' code
    now: Callable[[], float] = field(init=False)

    # how it is done
    debug: bool = False
    sharing: Any = None  # in debug mode: who uses which values (T1)
    fast: bool = True
    seed: int = 0  # what is drawn by chance is the same each time
    fuse_after: int = 250  # firings of a head before its region is formed: forming costs as much as they save
    # Receives every event of the run (R7); None: nothing listens, so no event is built.
    trace: Callable[[TraceEvent], None] | None = None
    # Receives events that concern no single token or firing, such as changes of activity, parameters and structure. Who
    # needs no others keeps no node from its fast paths.
    trace_changes: Callable[[TraceEvent], None] | None = None
    recall: Callable[[NodeT], None] | None = None  # restores the state that was kept of a node
    started: bool = False
    paused: bool = False  # nodes move one by one (R3)
    over: bool = False

    # what it consists of
    workers: list[NodeT] = field(default_factory=list)
    by_path: dict[str, NodeT] = field(default_factory=dict)
    boundary: NodeT | None = None
    edges: list[SyncEdge | BufferEdge | EventEdge] = field(default_factory=list)
    scopes: list[Scope[NodeT]] = field(default_factory=list)
    gates: list[Gate[NodeT]] = field(default_factory=list)
    sources: list[NodeT] = field(default_factory=list)
    feeds: list[NodeT] = field(default_factory=list)  # the graph's own inputs (P10)
    readers: list[NodeT] = field(default_factory=list)  # the graph's own outputs
    outlets: list[NodeT] = field(default_factory=list)  # edges leave here for another part of a graph that is cut (L1)
    inlets: list[NodeT] = field(default_factory=list)  # edges arrive here from another part
    piped: list[tuple[Any, tuple[Any, ...]]] = field(default_factory=list)  # edges with operators (P9)
    outside: dict[tuple[int, str], Any] = field(default_factory=dict)  # edges for signals from outside the graph
    observables: list[tuple[Any, Any, tuple[Any, ...]]] = field(default_factory=list)  # outside sources of edges
    listeners: dict[Any, None] = field(default_factory=dict)  # outputs to slots, perhaps ahead of the edges' counts
    regions: set[FusedRegion[NodeT]] = field(default_factory=set)  # perhaps ahead of the counts of their members
    _numbers: Iterator[int] = field(default_factory=itertools.count)

    # what is in progress
    in_flight: int = 0  # firings, calls and hooks that wait or run in a thread
    tasks: int = 0  # that nodes have started besides; quiet waits for them, a pause does not
    timers: int = 0  # pending calls that could start something
    iterating: list[Iteration[NodeT]] = field(default_factory=list)  # subgraphs with a firing, inner ones last (G4)
    full_edges: int = 0  # queues that block their sources (F8)
    suspects: dict[NodeT, None] = field(default_factory=dict)  # blocked so, and perhaps in a ring that has closed
    all_suspect: bool = False
    waiting_room: int = 0  # how much of `in_flight` and `tasks` awaits trigger_wait (F8)
    dead_sources: set[NodeT] = field(default_factory=set)  # sources that feed only ended nodes (R5)
    quiescing: Any = None  # what holds nodes for an edit (R4)
    errors: list[HfgError] = field(default_factory=list)
    lost_activity: int = 0
    overgrown: list[EventEdge] = field(default_factory=list)  # queues that F8 enlarged so often that they are reported

    # the pump
    pumping: bool = False  # it runs: what is queued now is reached without a kick
    slices: int = 0  # for the watchdog
    until: float = 0.0  # its slice ends, on the run's clock
    ready_groups: deque[Any] = field(default_factory=deque)  # other than the loop's own, with nodes that can move
    flags: Flags = field(default_factory=Flags)  # why the pump, and waves on the loop, end after the current call
    current: NodeT | None = None  # its code runs on the loop, for the watchdog
    running_node: NodeT | None = None  # a fast path runs its code: what it triggers may take one too
    ran_next: int = 0  # nodes that went next; in virtual time the pump counts waves, not hops

    # the sending in progress, and what follows it
    next_in_wave: list[NodeT] = field(default_factory=list)  # it has enabled them, and they go next (R2)
    dirty_scopes: list[Scope[NodeT]] = field(default_factory=list)
    deferred_events: list[NodeT] | None = None  # their automatic events follow the change in progress
    returned: list[EventEdge] = field(default_factory=list)  # their +1 goes back to the sender (F13, A8)
    to_notify: deque[tuple[Any, Token[Any]]] = field(default_factory=deque)  # signals for subscribers (F3)
    notifying: bool = False  # subscribers are called
    drained: list[tuple[NodeT, int]] = field(default_factory=list)  # modifiers that act after it (T4, F12)

    def __post_init__(self) -> None:
        self.now = self.runtime.now

    def configure(
        self, *, debug: bool, sharing: object, fast: bool, seed: int, fuse_after: int, code: Code[NodeT]
    ) -> None:
        """Set how the run is done, before it has nodes."""
        self.debug, self.sharing, self.fast, self.seed = debug, sharing, fast, seed
        self.fuse_after = fuse_after
        self.code = code

    def recall_with(self, recall: Callable[[NodeT], None] | None) -> None:
        """Restore with this the state that was kept of nodes, before they are set up; None: no more."""
        self.recall = recall

    def ends_slice(self) -> bool:
        """Return whether the pump must look at other things: a flag is up that was not only for the wave it ended."""
        return self.flags.lower_those_of_waves()

    def settle_counts(self) -> None:
        """Bring the counts of nodes up to date before they are read: fused regions count by waves."""
        for region in self.regions:
            region.settle_counts()
        for listeners in self.listeners:
            listeners.settle_counts()

    def settle_barriers(self) -> None:
        """Bring barriers up to date before they are read: in fused regions the head's barrier represents all."""
        for region in self.regions:
            if not region.running:
                region.disarm()

    def waits_changed(self) -> None:
        """Other nodes may wait for each other now, so any node that a full queue blocks may be in a ring (F8)."""
        self.all_suspect = True

    def pause(self, paused: bool) -> None:
        """Set whether the run is paused (R3). A wave in progress ends after its current call."""
        self.paused = paused
        for region in self.regions if paused else ():
            region.interrupt()

    def begin_async(self) -> None:
        """Code waits, or runs in a thread: the run is not quiet before it is back."""
        self.in_flight += 1

    def end_async(self) -> None:
        """It is over, or given up."""
        self.in_flight -= 1

    def number_node(self) -> int:
        """Return a number that no node of this run has yet."""
        return next(self._numbers)

    def limit_task(self, task: Task[NodeT]) -> None:
        """See `Host`."""
        self.runtime.limit_task(task)

    def after(self, delay_s: float, callback: Callable[[], None]) -> Timer:
        """Call back `delay_s` seconds from now."""
        return self.runtime.call_at(self.now() + delay_s, callback)

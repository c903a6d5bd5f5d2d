"""The state of one run, shared by the modules that decide over it.

The rules decide over it and never wait: time, threads and coroutines are behind `Runtime` and `Code`, which are
implemented where asyncio begins. It stands below the class of nodes, and so is generic in it.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from types import FrameType
from typing import Any, Final, Generic, Literal, Protocol

from typing_extensions import override

from hfg.base.token import Token
from hfg.engine.model.concurrent import ConcurrentFiring
from hfg.engine.model.contracts import NodeT, Timer
from hfg.engine.model.events import RunningEvent
from hfg.engine.model.iteration import Iteration
from hfg.engine.model.scopes import Gate, Scope
from hfg.engine.model.tasks import Doing, Task
from hfg.errors import HfgError
from hfg.ports.edges import BufferEdge, EventEdge, SyncEdge
from hfg.ports.events import EventPort
from hfg.trace import TraceEvent

__all__ = ["PENDING", "Code", "Core", "Flags", "FusedRegion", "RuleCallbacks", "Runtime"]


class _Pending:
    def __repr__(self) -> str:
        return "PENDING"


_FOR_A_WAVE: Final = frozenset({"disturbed", "dissolved", "sends"})
"""Flags that end the wave under way and nothing else."""


class Flags(list[str]):
    """Why who runs is to look round; the pump asks between two steps, a wave behind each of its calls.

    A wave does not even ask: behind a call it looks whether the type of the result is that of the last one, which it
    must do anyway, and whoever raises a flag lets it forget those types.

    Attributes:
      forget: lets the wave that was entered last forget the types of its results; from any thread.
    """

    __slots__ = ("forget",)

    def __init__(self) -> None:
        super().__init__()
        self.forget: Callable[[], None] = _nothing

    @override
    def append(self, why: str) -> None:
        """Raise a flag; from any thread. First the flag, so that who finds types forgotten finds why."""
        super().append(why)
        self.forget()

    def lower_those_of_waves(self) -> bool:
        """A wave has ended: whether a flag is up that is not for that wave alone."""
        self[:] = [flag for flag in self if flag not in _FOR_A_WAVE]
        return bool(self)


def _nothing() -> None:
    pass


PENDING = _Pending()
"""What an executor returns for code that waits: its result comes later."""


class FusedRegion(Protocol[NodeT]):
    """Nodes whose firings are fused (see the wing `fusion`), as those below know it."""

    head: NodeT
    running: bool
    waves: int
    paths: tuple[str, ...]  # of its members, in the order in which they fire

    def at_work(self, frame: FrameType | None) -> NodeT | None:
        """Whose call a running wave is in, by the line it is at."""

    def is_calling(self, worker: NodeT) -> bool:
        """Whether the call of this member is the one under way in a running wave."""

    def disturb(self, worker: NodeT) -> None:
        """A member does not rest any more: the interpreted way goes on from here."""

    def activity_changed(self, worker: NodeT) -> None:
        """A member is active now, or no longer."""

    def is_sending(self, worker: NodeT) -> bool:
        """A member's code sends by itself: whether a fused call of it is under way."""

    def interrupt(self) -> None:
        """Let the wave under way end behind its present call."""

    def abandon(self) -> NodeT:
        """The wave under way does not come back: whose call it is in."""

    def dissolve(self) -> None:
        """Its members are nodes like any others from here on."""

    def measure_on(self) -> None:
        """What was measured has been read: measure the next waves."""

    def check_invariants(self) -> None:
        """While it is armed everything inside rests."""

    def settle_counts(self) -> None:
        """Let the members' counts say what the waves so far have done."""

    def disarm(self) -> None:
        """Let each member's barriers say what it waits for."""


class Runtime(Protocol[NodeT]):
    """What the deciding part of the engine needs from the waiting part."""

    def now(self) -> float:
        """Seconds on the run's clock."""

    def call_at(self, when: float, callback: Callable[[], None], *, counts: bool = True) -> Timer:
        """Call back at `when` on the run's clock.

        If it counts it is one that could start something: quiet waits for it.
        """

    def kick(self) -> None:
        """Something was queued from outside the pump: see to it that it goes on."""

    def finish(self, outcome: str, error: HfgError | None) -> None:
        """End the run; only the first call counts."""

    def soon(self, callback: Callable[[], None]) -> None:
        """Call back at the loop's next pass."""

    def start_task(self, worker: NodeT, coroutine: Coroutine[Any, Any, Any], doing: Doing[NodeT] | None = None) -> None:
        """Start a task, a child of the node: its code has asked for it, or it is the node's do-activity (A15)."""

    @property
    def teardown_limit_s(self) -> float:
        """How long code may take to end once it is cancelled, and each teardown (X3)."""

    def limit_task(self, task: Task[NodeT]) -> None:
        """A task was cancelled: if it does not end in time while the run continues, it is left behind (X3)."""

    def on_loop(self) -> bool:
        """Whether the caller is on the run's own thread."""

    def from_any_thread(self, call: Callable[[], None]) -> None:
        """Do this on the loop; calls of one thread keep their order."""

    def bring_in(self, call: Callable[[], None]) -> None:
        """From a thread that is none of the run's: do this on the loop, in order, unless the run is over by then."""

    def adopt_event(self, port: EventPort[Any]) -> None:
        """Give an event the run's scheduler and thread."""


class Code(Protocol[NodeT]):
    """What runs the code of nodes where it belongs."""

    def execute(
        self,
        worker: NodeT,
        call: Callable[..., Any],
        arguments: tuple[Any, ...],
        done: Callable[[Any, BaseException | None], None],
    ) -> None:
        """Run a node's code where it belongs; `done(result, error)` follows, at once or later on the loop."""

    def execute_wave(
        self,
        workers: Sequence[NodeT],
        call: Callable[..., Any],
        arguments: tuple[Any, ...],
        done: Callable[[Any, BaseException | None], None],
    ) -> None:
        """Run code of several nodes of a thread group, one after the other; `done` follows even if the run is over."""

    def execute_hook(
        self, worker: NodeT, call: Callable[..., Any], done: Callable[[Any, BaseException | None], None]
    ) -> None:
        """Run a hook of activity beside whatever the worker is doing."""

    def drive(
        self,
        worker: NodeT,
        coroutine: Coroutine[Any, Any, object],
        done: Callable[[Any, BaseException | None], None],
        firing: ConcurrentFiring[NodeT] | None = None,
    ) -> None:
        """Run a coroutine of the node's code, or of one of its firings (F14), to its end."""

    def late(
        self, worker: NodeT, done: Callable[[Any, BaseException | None], None]
    ) -> Callable[[Any, BaseException | None], None]:
        """What to call when code that waited is over."""

    def execute_concurrent(
        self,
        firing: ConcurrentFiring[NodeT],
        call: Callable[..., Any],
        arguments: tuple[Any, ...],
        done: Callable[[Any, BaseException | None], None],
    ) -> None:
        """Run the code of one of several firings of a node (F14); `done` follows, at once or later on the loop."""

    def interrupt(self, worker: NodeT, *, firing: ConcurrentFiring[NodeT] | None = None) -> None:
        """Cancel or abandon code of the node that is in progress, or that of one of its firings (X2, F14)."""

    async def trigger_wait(
        self, event: RunningEvent[NodeT], value: object, activity: int | None, stamp: float | None
    ) -> None:
        """Trigger an event, then wait until no `wait` queue behind the events of its node is full (F8)."""


class RuleCallbacks(Protocol[NodeT]):
    """What modules further up do when those below come to it, so that imports go down only."""

    def idle_again(self, worker: NodeT) -> None:
        """What kept a worker busy is over."""

    def fail(
        self,
        worker: NodeT,
        what: str,
        error: BaseException,
        *,
        answer: bool,
        then: Callable[[], None] | None = None,
    ) -> None:
        """X1: a firing (`answer`: it still owes its outputs) or something beside one has failed.

        Where no answer is owed, `then` comes before the node is disabled or restarted.
        """

    def fail_call(self, worker: NodeT, slot: str, error: BaseException) -> None:
        """X1: a slot call has failed."""

    def operator_failed(self, edge: EventEdge, error: BaseException) -> None:
        """An operator on an edge raised."""

    def begin_concurrent(
        self, worker: NodeT, kind: str, edges: Sequence[Any], tokens: Sequence[Token[Any]], refused: Exception | None
    ) -> None:
        """F14: a firing that has taken its tokens goes on beside others; `refused`: it fails (P8)."""

    def complete_firings(self, worker: NodeT) -> None:
        """F14: the outputs are free: firings that are over may leave."""

    def send_end(self, worker: NodeT) -> None:
        """END is to follow, and the outputs are free (F4)."""

    def node_ended(self, worker: NodeT) -> None:
        """A node has sent END (P9, R5)."""

    def activity_changed(self, worker: NodeT, active: bool) -> None:
        """A(v) of a watched node has changed (A9, A11, A12, G2)."""

    def scopes_changed(self, core: Core[NodeT]) -> None:
        """What subgraphs derive their activity from has changed (G2)."""

    def deactivate_inside(self, scope: Scope[NodeT], cause: Literal["sent", "slot"]) -> None:
        """Activity leaves everything inside a subgraph (G2)."""

    def rewire(self, worker: NodeT) -> None:
        """What a worker waits for has changed."""

    def specialise(self, worker: NodeT) -> None:
        """The wiring of a worker has changed: its shortest way may be another."""

    def bind_ports(self, worker: NodeT) -> None:
        """A node is about to be set up: its ports lead into the run."""

    def iterate(self, worker: NodeT, arguments: Sequence[Any]) -> None:
        """A subgraph that iterates fires (G4)."""


class Core(Generic[NodeT]):
    """One run.

    Attributes:
      runtime: the waiting part of the engine.
      code: what runs the nodes' code; given by the runtime.
      trace: receives every event of the run, or None: nobody listens and nothing is built (R7).
      trace_changes: receives what has to do with no single token or firing: changes of activity, parameters, structure;
        also for those who want no more than that, and so keep nobody from the fast paths.
      in_flight: firings, calls and hooks that wait or run in a thread.
      tasks: that nodes have started beside these; a pause does not wait for them, quiet does.
      timers: pending calls that could start something.
      pumping: the loop group is being drained; what is queued now is reached without a kick.
      current: the worker whose code runs on the loop, for the watchdog.
    """

    def __init__(self, runtime: Runtime[NodeT], rules: RuleCallbacks[NodeT]) -> None:
        self.runtime = runtime
        self.code: Code[NodeT]
        self.rules = rules
        self.now = runtime.now
        self.trace: Callable[[TraceEvent], None] | None = None
        self.trace_changes: Callable[[TraceEvent], None] | None = None
        self.debug = False
        self.sharing: Any = None  # in debug mode: who uses which values (T1)
        self.fast = True
        self.seed = 0  # of the run: what is drawn by chance is the same each time
        self.fuse_after = 250  # firings of a head before its region is formed: forming costs as much as they save
        self.started = False
        self.over = False
        self.recall: Callable[[NodeT], None] | None = None  # gives a node back the state that was kept of it
        self.paused = False  # the run is paused: nodes move one by one
        self.errors: list[HfgError] = []
        self.overgrown: list[EventEdge] = []  # queues that F8 has enlarged so often that their ring is reported
        self.lost_activity = 0
        self._has_no_plan()
        self._has_nothing_under_way()

    def recall_with(self, recall: Callable[[NodeT], None] | None) -> None:
        """Let nodes get back, before they are set up, the state that was kept of them; None: no more."""
        self.recall = recall

    def _has_no_plan(self) -> None:
        self.workers: list[NodeT] = []
        self._numbers = itertools.count()
        self.edges: list[SyncEdge | BufferEdge | EventEdge] = []
        self.scopes: list[Scope[NodeT]] = []
        self.gates: list[Gate[NodeT]] = []
        self.by_path: dict[str, NodeT] = {}
        self.boundary: NodeT | None = None
        self.sources: list[NodeT] = []
        self.feeds: list[NodeT] = []  # the graph's own inputs (P10)
        self.readers: list[NodeT] = []  # the graph's own outputs
        self.outlets: list[NodeT] = []  # where edges leave for another part of a graph that is cut (L1)
        self.inlets: list[NodeT] = []  # where they come in
        self.piped: list[tuple[Any, tuple[Any, ...]]] = []  # edges with operators (P9)
        self.outside: dict[tuple[int, str], Any] = {}  # edges by which signals come from outside the graph
        self.observables: list[tuple[Any, Any, tuple[Any, ...]]] = []  # outside sources of edges
        self.listeners: dict[Any, None] = {}  # outputs to slots, perhaps ahead of the edges' counts
        self.regions: set[FusedRegion[NodeT]] = set()  # fused, and perhaps ahead of the counts of their members

    def _has_nothing_under_way(self) -> None:
        self.in_flight = 0
        self.tasks = 0
        self.iterating: list[Iteration[NodeT]] = []  # subgraphs amid such a firing, inner ones behind (G4)
        self.full_edges = 0  # queues that hold their sources back (F8)
        self.suspects: dict[NodeT, None] = {}  # held back so, and perhaps in a ring that has closed
        self.all_suspect = False
        self.waiting_room = 0  # of those, how much code awaits trigger_wait (F8)
        self.timers = 0
        self.pumping = False
        self.slices = 0  # of the pump, for the watchdog
        self.until = 0.0  # on the run's clock: the pump's slice is over
        self.ready_groups: deque[Any] = deque()  # those beside the loop's own in which something can move
        self.flags = Flags()  # of the pump and of the waves on the loop; not empty: these end behind the call under way
        self.dead_sources: set[NodeT] = set()  # sources that feed only ended nodes (R5)
        self.current: NodeT | None = None
        self.running_node: NodeT | None = None  # whose code a fast path runs: what it triggers may take one too
        self.quiescing: Any = None  # what holds nodes for an edit (R4)
        self.next_in_wave: list[NodeT] = []  # enabled by the sending under way, and to go next (R2)
        self.ran_next = 0  # how many have gone so; the pump counts waves, not hops, where time is virtual
        self.dirty_scopes: list[Scope[NodeT]] = []
        self.deferred_events: list[NodeT] | None = (
            None  # those whose automatic events are told behind the change under way
        )
        self.returned: list[EventEdge] = []  # whose +1 of the sending under way goes back to the sender (F13, A8)
        self.to_notify: deque[tuple[Any, Token[Any]]] = deque()  # signals of which subscribers are to hear (F3)
        self.notifying = False  # they are hearing
        self.drained: list[tuple[NodeT, int]] = []  # modifiers of the sending under way that act behind it (T4, F12)

    def ends_slice(self) -> bool:
        """Whether a flag is up that is not for the wave alone that has ended by it: the pump is to look round."""
        return self.flags.lower_those_of_waves()

    def settle_counts(self) -> None:
        """Somebody is about to read how often nodes have fired: fused regions count by waves."""
        for region in self.regions:
            region.settle_counts()
        for listeners in self.listeners:
            listeners.settle_counts()

    def settle_barriers(self) -> None:
        """Somebody is about to read what nodes wait for: in fused regions the head's barrier stands for all."""
        for region in self.regions:
            if not region.running:
                region.disarm()

    def waits_changed(self) -> None:
        """F8: who may wait for whom is not as it was, so any node that a full queue holds back may be in a ring now."""
        self.all_suspect = True

    def pause(self, paused: bool) -> None:
        """R3: whether the run is paused, and nodes move one by one; a wave under way ends behind its present call."""
        self.paused = paused
        for region in self.regions if paused else ():
            region.interrupt()

    def begin_async(self) -> None:
        """Code waits, or runs in a thread: the run is not quiet before it has come back."""
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

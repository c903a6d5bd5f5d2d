"""The part of a run that waits: the pump, timers, coroutines and threads (rules R1, R5, R6, X2, X3).

What is to happen is decided in `firing`, `sending` and `quiet`; here it is made to happen on one event loop, without
a task per hop. Stands on all of them.
"""

from __future__ import annotations

import asyncio
import contextvars
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

from hfg.base.clock import current_clock, current_elapsed
from hfg.base.logs import Log, current_log
from hfg.engine.executing.asking import log_of_running_code
from hfg.engine.executing.code import CodeRunner, answer
from hfg.engine.executing.groups import CheckedTurn, Dispatching, LoopGroup, SideGroup, ThreadGroup
from hfg.engine.executing.tasks import TaskRunner
from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.model import Core, Doing, Group, RunningNode, Task
from hfg.engine.model.invariants import check_invariants
from hfg.engine.model.policies import make_policy
from hfg.engine.model.sharing import Sharing
from hfg.engine.rules import iterating, quiescence, rings
from hfg.engine.runtime import plan, rx
from hfg.engine.runtime.callbacks import Callbacks
from hfg.engine.runtime.rule_functions import RuleFunctions
from hfg.engine.runtime.settings import Settings
from hfg.errors import EngineInternalError, HfgError, NodeError, RunError, UsageError
from hfg.graph import Graph
from hfg.graph.flat import FlatGraph
from hfg.graph.graph import graph_of
from hfg.nodetypes.node import Node
from hfg.ports import EventPort

__all__ = ["Engine"]

_SLICE_S = 0.005  # how long the pump may keep the loop to itself on the real clock
_SHORT_SLICE_S = 0.001  # the same where what waits at the border of a part is replaced meanwhile
_SLICE_STEPS = 64  # how many steps it makes between two looks at the clock
_MOST_CHECKED = 200  # nodes, of which all invariants are asked for after every step
_VIRTUAL_SLICE_WAVES = 2048  # in virtual time a slice must not depend on how fast the machine is
_VIRTUAL_LOOK_WAVES = 8  # it ends sooner only where code has spent virtual time
_VIRTUAL_LOOKS_BESIDE_WORK = 256  # how long it goes on beside work in a thread before it waits for that

_MOST_AT_ONE_INSTANT = 3_000_000  # firings, before a run with `until_s` is taken to stand still

_LOGGER = Log("hfg.engine")


class _Timer:
    """A pending call that keeps the run from being quiet."""

    __slots__ = ("_callback", "_counts", "_engine", "_handle")

    def __init__(self, engine: Engine, when: float, callback: Callable[[], None], counts: bool) -> None:
        self._engine = engine
        self._callback = callback
        self._counts = counts
        self._handle: asyncio.TimerHandle | None = engine.loop.call_at(when, self._run, context=engine.context)
        engine.core.timers += counts

    def _run(self) -> None:
        self._handle = None
        engine = self._engine
        engine.core.timers -= self._counts
        if not engine.core.over:
            engine.guard(self._callback)
            engine.go_on()

    def recount(self, counts: bool) -> None:
        if self._handle is not None:
            self._engine.core.timers += counts - self._counts
            self._counts = counts

    def cancel(self) -> None:
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None
            self._engine.core.timers -= self._counts
            self._engine.kick()


class Engine:
    """Runs one flattened graph on the running event loop, once.

    Attributes:
      core: the state the deciding modules work on.
      epoch: what the run's clock is ahead of the machine's monotonic one; None: it follows another.
      callbacks: what those who stand on the engine want to be told.
      code: runs the nodes' code.
      tasks: runs what that has started beside itself.
      moving_since: when all nodes were set up and the graph began to move, on the run's clock; None before.
      ending: set from the moment the run is over.
      ended_how: its outcome, and what it failed with; None before.
      holds: people outside who may still bring something (R5).
      readers: the graph outputs that somebody outside reads now; what lies before them will be taken.
      read_out: those whose END somebody has read.
      clock_within_s: tells by how much the clock here may differ from that of the run of which this is a part.
    """

    def __init__(self, flat: FlatGraph, settings: Settings) -> None:
        self.loop = asyncio.get_running_loop()
        self.settings = settings
        self.virtual = isinstance(self.loop, VirtualTimeLoop)
        self._epoch = 0.0 if self.virtual else time.time() - self.loop.time()
        standard = type(self.loop).time is asyncio.BaseEventLoop.time
        self.epoch = self._epoch if standard else None
        self.context = contextvars.copy_context()
        self.context.run(current_clock.set, self.now)
        self.context.run(current_elapsed.set, self.elapsed)
        self.context.run(current_log.set, lambda: log_of_running_code(self.core))
        self.core: Core = Core(self, RuleFunctions())
        self.callbacks = Callbacks()
        self.graph: Graph = graph_of(flat.graph)
        self._slice_s = _SLICE_S
        self.holds = 0
        self.readers: list[RunningNode] = []
        self.read_out: set[RunningNode] = set()
        self.senders: list[RunningNode] = []  # feeds for which somebody outside has a token, once for each
        self._told_unread: set[str] = set()
        self._quiet_waiters: list[asyncio.Future[None]] = []
        self._agreement: Callable[[], None] | None = None
        self.ended_how: tuple[str, HfgError | None] | None = None
        self.moving_since: float | None = None
        self.ending: asyncio.Event = asyncio.Event()
        self._scheduled = False
        self._resumed: deque[Callable[[], None]] = deque()  # code that goes on when all is done that is ready now
        self._thread = threading.get_ident()
        self._ready_groups: deque[Dispatching] = self.core.ready_groups
        self.scheduler = rx.RunScheduler(self)
        self.code = CodeRunner(self, self.core, self.loop, self.context)
        sharing = Sharing() if settings.debug else None
        if sharing is not None:
            self.callbacks.finished.append(sharing.end)
        self.core.configure(
            debug=settings.debug,
            sharing=sharing,
            fast=settings.fast,
            seed=settings.seed or 0,
            fuse_after=settings.fuse_after,
            code=self.code,
        )
        self.tasks = TaskRunner(self, self.core, self.code)
        self.groups = self._make_groups()
        self._loop_group = self.groups["loop"]
        self.clock_within_s: Callable[[], float] = float  # 0.0: it is the run's own
        self._began_before: float | None = None  # on the loop's clock: when the run began of which this is a part
        self._started: float | None = None  # on the loop's clock, whose digits are not taken up by the date
        self._ended: float | None = None
        self._instant = -1.0
        self._instant_steps = 0
        self.beside_work = 0  # looks of the pump since work in a thread was begun or came in; counted in virtual time
        plan.build(self.core, flat, self.groups, loop=self._loop_group)

    # --- time -------------------------------------------------------------------------------------------------------

    def now(self) -> float:
        """Seconds on the run's clock."""
        return self.loop.time() + self._epoch

    def elapsed(self) -> float:
        """Seconds since the run began, up to its end; 0 before. To the nanosecond, for more digits are noise."""
        if self._started is None:
            return 0.0
        return round((self.loop.time() if self._ended is None else self._ended) - self._started, 9)

    @property
    def ended_at(self) -> float | None:
        """When the run was over, on its clock; None before."""
        return None if self._ended is None else self._ended + self._epoch

    def follow(self, ahead_s: float, began_s: float, within_s: Callable[[], float]) -> None:
        """Go by the clock of the run of which this is a part; before it begins.

        Args:
          ahead_s: how far that is ahead of this machine's monotonic clock.
          began_s: when the run began, on its clock.
          within_s: tells by how much the two may differ.
        """
        self.clock_within_s = within_s
        if not self.virtual:
            self._epoch = ahead_s
            if self.epoch is not None:
                self.epoch = ahead_s
        self._began_before = began_s - self._epoch

    @property
    def ahead_s(self) -> float:
        """How far the run's clock is ahead of the loop's."""
        return self._epoch

    @property
    def began_at(self) -> float:
        """When the run began, on its clock.

        Raises:
          EngineInternalError: it has not.
        """
        if self._started is None:
            raise EngineInternalError("the run has not begun")
        return self._started + self._epoch

    def begin(self) -> None:
        """The run begins now, or did when it began elsewhere."""
        self._started = self.loop.time() if self._began_before is None else self._began_before

    def call_at(self, when: float, callback: Callable[[], None], *, counts: bool = True) -> _Timer:
        """See `Host`."""
        return _Timer(self, when - self._epoch, callback, counts)

    def soon(self, callback: Callable[[], None]) -> None:
        """See `Host`."""
        self.loop.call_soon(callback, context=self.context)

    def start_task(self, worker: RunningNode, coroutine: Coroutine[Any, Any, Any], doing: Doing | None = None) -> None:
        """See `Host`."""
        self.tasks.start(worker, coroutine, doing)

    @property
    def teardown_limit_s(self) -> float:
        """See `Host`."""
        return self.settings.teardown_limit_s

    def limit_task(self, task: Task) -> None:
        """See `Host`."""
        self.tasks.limit(task, self.teardown_limit_s)

    # --- groups -----------------------------------------------------------------------------------------------------

    def worker_of(self, node: Node | Graph) -> RunningNode:
        """Find who runs a node, or what stands for the graph itself.

        Raises:
          UsageError: it is no node of this run.
        """
        if node is self.graph:
            assert self.core.boundary is not None
            return self.core.boundary
        place = getattr(node, "_place", None)
        worker = None if place is None else self.core.by_path.get(place.path)
        if worker is None or worker.node is not node:
            raise UsageError(f"{node!r} is no node of this run: its graph is another one, or it was never added")
        return worker

    def _make_groups(self) -> dict[str, Group]:
        groups: dict[str, Group] = {}
        settings = self.settings
        clock = self.now if self.virtual else time.perf_counter  # a run in virtual time is the same each time (R6)
        for name, spec in self.graph.groups.items():
            seed = settings.seed if spec.seed is None else spec.seed
            policy = make_policy(settings.policy or spec.policy, seed)
            if spec.threads:
                groups[name] = ThreadGroup(
                    name, policy, clock, self._ready_groups, self.code.deliver, self.context, spec.threads
                )
            elif name == "loop":
                groups[name] = LoopGroup(name, policy, clock)
            else:
                groups[name] = SideGroup(name, policy, clock, self._ready_groups, self.core.flags)
            if settings.check_all or settings.debug:
                groups[name].look_at_each_turn(
                    CheckedTurn(groups[name], self.check_invariants if settings.check_all else None).take
                )
        return groups

    def check_invariants(self) -> None:
        """Ask for the invariants of everything in the run; where that is much, after every step would be for ever.

        Raises:
          EngineInternalError: one of them does not hold.
        """
        if len(self.core.workers) <= _MOST_CHECKED:
            check_invariants(self.core)

    def on_loop(self) -> bool:
        """Whether the caller is on the run's own thread."""
        return threading.get_ident() == self._thread

    def from_any_thread(self, call: Callable[[], None]) -> None:
        """Do this on the loop; calls of one thread keep their order."""
        if self.on_loop():
            call()
        else:
            self.loop.call_soon_threadsafe(call, context=self.context)

    def bring_in(self, call: Callable[[], None]) -> None:
        """From a thread that is none of ours: do this on the loop, in order, unless the run is over by then."""

        def arrive() -> None:
            if not self.core.over:
                self.guard(call)
                self.go_on()

        self.loop.call_soon_threadsafe(arrive, context=self.context)

    # --- the pump ---------------------------------------------------------------------------------------------------

    def kick(self) -> None:
        """Something may be queued: see to it that the pump runs."""
        if not self._scheduled and not self.core.pumping:
            self._scheduled = True
            self.loop.call_soon(self._pump, context=self.context)

    def look_round_often(self) -> None:
        """Have short slices from now on."""
        self._slice_s = _SHORT_SLICE_S

    def at_once(self, call: Callable[[], None]) -> None:
        """In a callback of the loop that is not the engine's: do this and pump then, which saves a pass of the loop.

        In virtual time that pass is taken: everything else that is due at this instant has its turn before.
        """
        if self.virtual or self._scheduled or self.core.pumping:
            call()
            return
        self._scheduled = True  # whoever kicks meanwhile means the pump below
        try:
            call()
        finally:
            self._scheduled = False
        self.context.run(self._pump)

    def go_on(self) -> None:
        """At the end of a callback of the loop: pump at once, which saves a pass of the loop.

        In virtual time not before everything else that is due at this instant has had its turn.
        """
        if not self._scheduled and not self.core.pumping:
            if self.virtual and self._others_are_ready():
                self.kick()
            else:
                self._pump()

    def _pump(self) -> None:
        """Drain the loop group within a slice; a hop is a few function calls."""
        self._scheduled = False
        core = self.core
        if core.over or not core.started or self._rests():
            return
        policy: Any = self._loop_group.policy
        if self.virtual and (policy or self._ready_groups) and self._waits_for_work():
            return
        self._work(policy)
        while self._resumed:
            self.loop.call_soon(self._resumed.popleft(), context=self.context)
        for call in self.callbacks.pumped:
            call()
        if self.ended_how is not None or self._rests():
            return
        if core.suspects or core.all_suspect:
            rings.resolve(core)
        went_on = bool(self.core.iterating) and iterating.settle(self.core)
        if policy or self._ready_groups or went_on:
            self.kick()
        else:
            self._settle()

    def _work(self, policy: Any) -> None:
        """One slice of the pump; whatever is raised in it ends the run."""
        core = self.core
        core.pumping = True
        core.slices += 1
        core.flags.clear()
        drain = self._drain_virtual if self.virtual else self._drain
        try:
            drain(policy, self._loop_group, self._ready_groups)
        except Exception as error:
            self.internal_fault(error)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            self.misused(core.current or core.running_node, error)
        finally:
            core.pumping = False
            core.current = core.running_node = None
            self._loop_group.set_budget(1)

    def _waits_for_work(self) -> bool:
        """R5, R1: a loop that is always busy must not keep out what comes back from threads.

        Under the virtual clock that comes in when nothing else is ready. So after so much work beside it, a number that
        is the same each time, the pump rests until some of it is in, which makes the pump go on.
        """
        self.beside_work += 1
        return self.code.holds > 0 and self.beside_work > _VIRTUAL_LOOKS_BESIDE_WORK

    def _rests(self) -> bool:
        """R3: paused, so nothing new starts: it is quiet when nothing is under way, but does not end by that."""
        if self.core.paused:
            if not self.core.in_flight and not self.core.tasks:
                self._answer_quiet()
            for call in self.callbacks.rested:
                call()
        return self.core.paused

    def internal_fault(self, error: BaseException) -> None:
        """A fault of ours must end the run, not hang it."""
        problem = (
            error
            if isinstance(error, HfgError)
            else EngineInternalError(f"{type(error).__name__}: {error}; please report this")
        )
        if problem is not error:
            problem.__cause__ = error
        self.finish("failed", problem)

    def misused(self, worker: RunningNode | None, error: BaseException, what: str = "its code") -> None:
        """A node's code raised what is no error but Python's way to end a task or the program: without us a hang."""
        problem = NodeError(worker.path if worker is not None else "", what, error)
        problem.__cause__ = error
        self.finish("failed", problem)

    def guard(self, call: Callable[[], None]) -> None:
        """Call something of ours in a callback of the loop; what it raises ends the run."""
        try:
            call()
        except KeyboardInterrupt:
            raise
        except Exception as error:
            self.internal_fault(error)
        except BaseException as error:
            self.misused(self.core.current or self.core.running_node, error)

    def _drain(self, policy: Any, group: Group, ready_groups: deque[Dispatching]) -> None:
        """Step what is queued until nothing is, or the slice is over; short drains do not look at the clock.

        A flag ends the slice at once: a pause, the end of the run, or the watchdog, which raises it when nodes take so
        long that the slice is over before the next look.
        """
        core, flags, take = self.core, self.core.flags, group.take
        until = core.until = self.now() + self._slice_s
        group.set_budget(_SLICE_STEPS)
        while True:
            if ready_groups:
                group.set_budget(max(group.budget - ready_groups.popleft().dispatch(), 1))
            if policy:
                worker = take()
                step = worker.step  # what is called as a field is looked up the slow way
                step(worker)
            elif self._resumed and not self._others_are_ready():
                self._resumed.popleft()()
            elif not ready_groups:
                return
            if flags and core.ends_slice():
                return
            group.budget -= 1
            if not group.budget:
                if self.now() >= until:
                    return
                group.set_budget(_SLICE_STEPS)

    def give_way(self, call: Callable[[], None]) -> None:
        """Code has given way to others for a moment (`sleep(0)`): let it go on behind all that is ready now.

        Where nothing else is, a pass of the event loop would be for nothing: the pump goes on by itself.
        """
        if self.core.pumping and not self.virtual:
            self._resumed.append(call)
        else:
            self.loop.call_soon(call, context=self.context)

    def _others_are_ready(self) -> bool:
        """Whether the event loop has something to do; taken for granted where it does not tell."""
        return bool(getattr(self.loop, "_ready", True))

    def _drain_virtual(self, policy: Any, group: Group, ready_groups: deque[Dispatching]) -> None:
        """The same where time stands still: a slice is a number of waves, however fast the machine is (R6).

        What has gone in front of the queue belongs to its wave, so that fused regions and single steps count alike.
        """
        core, flags, take = self.core, self.core.flags, group.take
        instant = self.loop.time()
        core.ran_next = 0
        for _ in range(_VIRTUAL_SLICE_WAVES // _VIRTUAL_LOOK_WAVES):
            group.set_budget(_VIRTUAL_LOOK_WAVES)
            while group.budget > 0:
                if ready_groups:
                    ready_groups.popleft().dispatch()
                if policy:
                    worker = take()
                    step = worker.step
                    step(worker)
                elif not ready_groups:
                    return
                if flags and core.ends_slice():
                    return
                group.budget -= 1
                if group.budget <= 0:
                    group.set_budget(group.budget + core.ran_next)
                    core.ran_next = 0
            self.beside_work += 1
            if self.loop.time() != instant:  # code has spent time: what is due by now has its turn
                return
        self._same_instant()

    def _same_instant(self) -> None:
        """R6: with `until_s`, something that goes on and on without letting time pass is refused in the end."""
        now = self.loop.time()
        if now != self._instant:
            self._instant, self._instant_steps = now, 0
        self._instant_steps += _VIRTUAL_SLICE_WAVES
        if self._instant_steps > _MOST_AT_ONE_INSTANT and self.settings.until_s is not None:
            self.core.settle_counts()
            busiest = max(self.core.workers, key=lambda worker: worker.counts.done)
            self.finish(
                "failed",
                RunError(
                    f"virtual time has stood still at {now:g} s for {self._instant_steps:,} firings, so until_s would "
                    f'never come; "{busiest.path}" fired most: give '
                    f"{'it' if busiest.is_source else 'the source in front of it'} max_rate_hz=, or let "
                    f"{'it' if busiest.is_source else 'that'} end"
                ),
            )

    def _settle(self) -> None:
        """The run queues are empty: is the graph quiet, and if so, what follows?"""
        core = self.core
        if core.timers:
            return
        if (core.in_flight or core.tasks) and not (
            (core.dead_sources and self._only_dead_sources_work())
            or (core.waiting_room and quiescence.only_waiting_for_room(core))
        ):
            return
        self.quiet()

    def _only_dead_sources_work(self) -> bool:
        """R5: only sources that feed ended nodes are under way, and nobody stands behind them in their group."""
        if any(isinstance(group, ThreadGroup) and len(group.policy) for group in self.groups.values()):
            return False
        return quiescence.only_dead_sources_in_flight(self.core, threads_too=not self.virtual)

    def quiet(self) -> None:
        """Nothing runs, nothing can start, no timer is pending (P9, F13, R5)."""
        core = self.core
        if any(not feed.outputs.missing for feed in self.senders):
            return  # a token is about to come
        if self._agreement is not None:
            self._agreement()
            return
        rings.look_at_all(core)
        if rings.resolve(core) or core.timers or self.is_held_open():
            return
        if self.give_up() or self.complete_operators() or core.timers > 0 or self.end_events():
            return
        stalled = quiescence.stall(core)
        self.finish("done" if stalled is None else "stalled", stalled)

    def leave_quiet_to(self, agreement: Callable[[], None]) -> None:
        """Here runs a part of a graph that is cut: when nothing moves in it any more, only tell that.

        What follows is for the whole to say, by the methods that `quiet` calls otherwise.
        """
        self._agreement = agreement

    def is_held_open(self) -> bool:
        """Tell those who wait for quiet, and say whether somebody outside may still bring or take something (R5)."""
        self._answer_quiet()
        if self.holds and self.core.readers:
            self._tell_unread()
        return bool(self.holds) or any(reader.inputs_ready() for reader in self.readers)

    def give_up(self) -> bool:
        """R5: sources that work for nobody count as ended; whether there were any."""
        return self._kicked(quiescence.give_up(self.core))

    def complete_operators(self) -> bool:
        """P9: whether operators on edges had something left to give out."""
        return self._kicked(quiescence.complete_operators(self.core))

    def end_events(self) -> bool:
        """F13: whether END was sent to inputs that nothing comes to any more."""
        return self._kicked(quiescence.end_events(self.core))

    def _kicked(self, moves: bool) -> bool:
        if moves:
            self.kick()
        return moves

    def _tell_unread(self) -> None:
        """P10: a graph that stands still for want of a reader looks like any quiet one, so that is told, once."""
        for worker in quiescence.unread(self.core, self.readers):
            name = worker.port_name
            if name not in self._told_unread:
                self._told_unread.add(name)
                _LOGGER.warning(
                    'graph output "%s" is not read, and the graph stands still until it is: read it beside the rest, '
                    '`async for value in run.read("%s")`, or leave the output out',
                    name,
                    name,
                )

    def _answer_quiet(self) -> None:
        waiters, self._quiet_waiters = self._quiet_waiters, []
        for waiter in waiters:
            answer(waiter, None)

    async def wait_quiet(self) -> None:
        """Wait until only something outside can change anything; returns at once if the run is over."""
        if self.core.over:
            return
        waiter: asyncio.Future[None] = self.loop.create_future()
        self._quiet_waiters.append(waiter)
        self.kick()
        await waiter

    def hold(self) -> None:
        """Somebody outside may still bring something: the run stays open (R5)."""
        self.holds += 1

    def unhold(self) -> None:
        """One fewer."""
        self.holds -= 1
        self.kick()

    def adopt_event(self, port: EventPort[Any]) -> None:
        """Give an event the run's scheduler and thread (P9)."""
        port._scheduler = self.scheduler
        port._thread = self._thread

    # --- the end ----------------------------------------------------------------------------------------------------

    def finish(self, outcome: str, error: HfgError | None) -> None:
        """See `Host`."""
        if self.ended_how is not None:
            return
        self.ended_how = (outcome, error)
        self.core.over = True
        self.core.flags.append("over")
        for region in self.core.regions:
            region.interrupt()
        self._ended = self.loop.time()
        for worker in self.core.workers:
            worker.on_run_ended()
        for call in self.callbacks.finished:
            call()
        self._answer_quiet()
        self.ending.set()

    @property
    def outcome(self) -> str:
        """How the run ended; "running" while it does."""
        return "running" if self.ended_how is None else self.ended_how[0]

    @property
    def error(self) -> HfgError | None:
        """What the run failed with, if it did."""
        return None if self.ended_how is None else self.ended_how[1]

"""The pump of a run: it lets nodes move on one event loop, in slices, without a task per hop (rules R1, R3, R5, R6).

`rules` decides what happens. This module decides when: how long a slice is, and when others have their turn.
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
from hfg.engine.executing.code import CodeRunner
from hfg.engine.executing.groups import CheckedTurn, Dispatching, LoopGroup, SideGroup, ThreadGroup
from hfg.engine.executing.tasks import TaskRunner
from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.model import Core, Doing, Group, RunningNode, Task
from hfg.engine.model.invariants import check_invariants
from hfg.engine.model.policies import make_policy
from hfg.engine.model.sharing import Sharing
from hfg.engine.rules import iterating, rings
from hfg.engine.runtime import plan, rx
from hfg.engine.runtime.callbacks import Callbacks
from hfg.engine.runtime.quiet import Quiet
from hfg.engine.runtime.rule_functions import RuleFunctions
from hfg.engine.runtime.run_time import RunTime
from hfg.engine.runtime.settings import Settings
from hfg.errors import EngineInternalError, HfgError, NodeError, RunError, UsageError
from hfg.graph import Graph
from hfg.graph.flat import FlatGraph, flatten
from hfg.graph.graph import graph_of
from hfg.nodetypes.node import Node
from hfg.ports import EventPort

__all__ = ["Engine"]

_SLICE_S = 0.005  # the longest time that the pump keeps the loop to itself, on the real clock
_SHORT_SLICE_S = 0.001  # the same if tokens at the border of a part replace each other
_SLICE_STEPS = 64  # how many steps it makes between two looks at the clock
_MOST_CHECKED = 200  # nodes, in runs that check all invariants after every step
_VIRTUAL_SLICE_WAVES = 2048  # in virtual time a slice must not depend on how fast the machine is
_VIRTUAL_LOOK_WAVES = 8  # it ends sooner only if code has spent virtual time
_VIRTUAL_LOOKS_BESIDE_WORK = 256  # how long it continues during work in a thread before it waits for that

_MOST_AT_ONE_INSTANT = 3_000_000  # firings, after which a run with `until_s` is considered stuck

_LOGGER = Log("hfg.engine")


class _Timer:
    """A pending call, which prevents quiet if it counts."""

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
    """Runs one flattened graph on the running event loop, once. It is the `Runtime` of the run's decisions.

    Attributes:
      core: the state that decisions share.
      time: the clock of the run.
      quiet: what follows when the graph is quiet, and what keeps the run open.
      callbacks: notifications for higher layers.
      code: runs the nodes' code; tasks: runs the tasks that this starts.
      moving_since: when all nodes were set up and the graph started to move, on the run's clock; None before.
      ending: set when the run is over.
      ended_how: its outcome, and what it failed with; None before.
      beside_work: looks of the pump since work in a thread was started or arrived; counted in virtual time.
    """

    def __init__(self, flat: FlatGraph, settings: Settings) -> None:
        self.loop = asyncio.get_running_loop()
        self.settings = settings
        self.virtual = isinstance(self.loop, VirtualTimeLoop)
        self.time = RunTime(self.loop, virtual=self.virtual)
        self.now = self.time.now
        self.elapsed = self.time.elapsed
        self.context = contextvars.copy_context()
        self.context.run(current_clock.set, self.now)
        self.context.run(current_elapsed.set, self.elapsed)
        self.context.run(current_log.set, lambda: log_of_running_code(self.core))
        self.core: Core = Core(self, RuleFunctions())
        self.quiet = Quiet(self.core, virtual=self.virtual)
        self.callbacks = Callbacks()
        self.graph: Graph = graph_of(flat.graph)
        self._slice_s = _SLICE_S
        self.ended_how: tuple[str, HfgError | None] | None = None
        self.moving_since: float | None = None
        self.ending: asyncio.Event = asyncio.Event()
        self._scheduled = False
        self._resumed: deque[Callable[[], None]] = deque()  # code that continues after all that is ready
        self._thread = threading.get_ident()
        self._ready_groups: deque[Dispatching] = self.core.ready_groups
        self.scheduler = rx.RunScheduler(self)
        self.code = CodeRunner(self, self.core, self.loop, self.context)
        self._configure()
        self.tasks = TaskRunner(self, self.core, self.code)
        self.groups = self._make_groups()
        self._loop_group = self.groups["loop"]
        self._instant = -1.0
        self._instant_steps = 0
        self.beside_work = 0
        plan.build(self.core, flat, self.groups, loop=self._loop_group)
        if "deadline" in (settings.policy, *(spec.policy for spec in flat.groups.values())):
            plan.set_due_times(self.core, flat)
            self.callbacks.edited.append(lambda _: plan.set_due_times(self.core, flatten(self.graph)))

    def _configure(self) -> None:
        """Pass the settings that decisions need to the core."""
        settings = self.settings
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

    # --- time -------------------------------------------------------------------------------------------------------

    def call_at(self, when: float, callback: Callable[[], None], *, counts: bool = True) -> _Timer:
        """See `Runtime`."""
        return _Timer(self, when - self.time.ahead_s, callback, counts)

    def soon(self, callback: Callable[[], None]) -> None:
        """See `Runtime`."""
        self.loop.call_soon(callback, context=self.context)

    def start_task(self, worker: RunningNode, coroutine: Coroutine[Any, Any, Any], doing: Doing | None = None) -> None:
        """See `Runtime`."""
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
        """Return the running node of a node, or of the graph itself.

        Raises:
          UsageError: it is not a node of this run.
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
        settings, groups = self.settings, dict[str, Group]()
        clock = self.now if self.virtual else time.perf_counter  # a run in virtual time is the same each time (R6)
        for name, spec in self.graph.groups.items():
            policy = make_policy(settings.policy or spec.policy, settings.seed if spec.seed is None else spec.seed)
            if spec.threads:
                group: Group = ThreadGroup(
                    name, policy, clock, self._ready_groups, self.code.deliver, self.context, spec.threads
                )
            elif name == "loop":
                group = LoopGroup(name, policy, clock)
            else:
                group = SideGroup(name, policy, clock, self._ready_groups, self.core.flags)
            if settings.check_all or settings.debug:
                check = self.check_invariants if settings.check_all else None
                group.look_at_each_turn(CheckedTurn(group, check).take)
            groups[name] = group
        return groups

    def check_invariants(self) -> None:
        """Check the invariants of the whole run, unless it is so large that this would take forever.

        Raises:
          EngineInternalError: one of them does not hold.
        """
        if len(self.core.workers) <= _MOST_CHECKED:
            check_invariants(self.core)

    def on_loop(self) -> bool:
        """Return whether the caller is on the run's own thread."""
        return threading.get_ident() == self._thread

    def from_any_thread(self, call: Callable[[], None]) -> None:
        """Make this call on the loop; calls of one thread keep their order."""
        if self.on_loop():
            call()
        else:
            self.loop.call_soon_threadsafe(call, context=self.context)

    def bring_in(self, call: Callable[[], None]) -> None:
        """From another thread: make this call on the loop, in order, unless the run is over by then."""

        def arrive() -> None:
            if not self.core.over:
                self.guard(call)
                self.go_on()

        self.loop.call_soon_threadsafe(arrive, context=self.context)

    # --- the pump ---------------------------------------------------------------------------------------------------

    def kick(self) -> None:
        """Something may be queued: make the pump run."""
        if not self._scheduled and not self.core.pumping:
            self._scheduled = True
            self.loop.call_soon(self._pump, context=self.context)

    def look_round_often(self) -> None:
        """Use short slices from now on."""
        self._slice_s = _SHORT_SLICE_S

    def at_once(self, call: Callable[[], None]) -> None:
        """In a callback of others: make this call, then pump, which saves a pass of the loop.

        In virtual time that pass is needed: everything else that is due at this instant comes first.
        """
        if self.virtual or self._scheduled or self.core.pumping:
            call()
            return
        self._scheduled = True  # the pump below serves kicks meanwhile
        try:
            call()
        finally:
            self._scheduled = False
        self.context.run(self._pump)

    def go_on(self) -> None:
        """At the end of a callback of the loop: pump at once, which saves a pass of the loop.

        In virtual time everything else that is due at this instant comes first.
        """
        if not self._scheduled and not self.core.pumping:
            if self.virtual and self._others_are_ready():
                self.kick()
            else:
                self._pump()

    def _pump(self) -> None:
        """Drain the loop group for one slice, then see what follows."""
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
            self.quiet.settle()

    def _work(self, policy: Any) -> None:
        """Run one slice; an error in it ends the run."""
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
        """Return whether the pump must rest until work in threads is back (R5, R1).

        In virtual time that work arrives when nothing else is ready, which a busy loop would prevent. So the pump rests
        after a fixed amount of other work, the same each time. The arrival makes it continue.
        """
        self.beside_work += 1
        return self.code.holds > 0 and self.beside_work > _VIRTUAL_LOOKS_BESIDE_WORK

    def _rests(self) -> bool:
        """Return whether the run is paused (R3). It is quiet then when nothing is in progress, but does not end."""
        if self.core.paused:
            if not self.core.in_flight and not self.core.tasks:
                self.quiet.answer()
            for call in self.callbacks.rested:
                call()
        return self.core.paused

    def internal_fault(self, error: BaseException) -> None:
        """End the run because of a fault in the engine, which must not hang it."""
        problem = (
            error
            if isinstance(error, HfgError)
            else EngineInternalError(f"{type(error).__name__}: {error}; please report this")
        )
        if problem is not error:
            problem.__cause__ = error
        self.finish("failed", problem)

    def misused(self, worker: RunningNode | None, error: BaseException, what: str = "its code") -> None:
        """End the run because a node's code raised what ends a task or the program in Python; it would hang."""
        problem = NodeError(worker.path if worker is not None else "", what, error)
        problem.__cause__ = error
        self.finish("failed", problem)

    def guard(self, call: Callable[[], None]) -> None:
        """Make a call of the engine's own in a callback of the loop; an error ends the run."""
        try:
            call()
        except KeyboardInterrupt:
            raise
        except Exception as error:
            self.internal_fault(error)
        except BaseException as error:
            self.misused(self.core.current or self.core.running_node, error)

    def _drain(self, policy: Any, group: Group, ready_groups: deque[Dispatching]) -> None:
        """Step queued nodes until none is left or the slice is over. Short drains do not look at the clock.

        A flag ends the slice at once: a pause, the end of the run, or the watchdog if nodes are so slow that the slice
        is over before the next look at the clock.
        """
        core, flags, take = self.core, self.core.flags, group.take
        until = core.until = self.now() + self._slice_s
        group.set_budget(_SLICE_STEPS)
        while True:
            if ready_groups:
                group.set_budget(max(group.budget - ready_groups.popleft().dispatch(), 1))
            if policy:
                worker = take()
                step = worker.step  # calling it as a field would look it up the slow way
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
        """Continue code that has given way (`sleep(0)`) after all that is ready now.

        If nothing else is ready, the pump does it itself, because a pass of the event loop would do nothing.
        """
        if self.core.pumping and not self.virtual:
            self._resumed.append(call)
        else:
            self.loop.call_soon(call, context=self.context)

    def _others_are_ready(self) -> bool:
        """Return whether the event loop has something to do; assumed of a loop that does not show it."""
        return bool(getattr(self.loop, "_ready", True))

    def _drain_virtual(self, policy: Any, group: Group, ready_groups: deque[Dispatching]) -> None:
        """The same in virtual time: a slice is a number of waves, however fast the machine is (R6).

        Nodes that went next belong to the wave before them, so that fused regions and single steps count alike.
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
        """Fail a run with `until_s` that fires on and on without letting time pass (R6)."""
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

    def adopt_event(self, port: EventPort[Any]) -> None:
        """Attach the run's scheduler and thread to an event (P9)."""
        port._belong_to(self.scheduler, self._thread)

    # --- the end ----------------------------------------------------------------------------------------------------

    def finish(self, outcome: str, error: HfgError | None) -> None:
        """See `Runtime`."""
        if self.ended_how is not None:
            return
        self.ended_how = (outcome, error)
        self.core.over = True
        self.core.flags.append("over")
        for region in self.core.regions:
            region.interrupt()
        self.time.end()
        for worker in self.core.workers:
            worker.on_run_ended()
        for call in self.callbacks.finished:
            call()
        self.quiet.answer()
        self.ending.set()

    async def or_end(self, waiter: asyncio.Future[Any]) -> None:
        """Wait for a future, or for the end of the run."""
        ending = asyncio.ensure_future(self.ending.wait())
        try:
            await asyncio.wait((waiter, ending), return_when=asyncio.FIRST_COMPLETED)
        finally:
            ending.cancel()

    @property
    def outcome(self) -> str:
        """How the run ended, or "running"."""
        return "running" if self.ended_how is None else self.ended_how[0]

    @property
    def error(self) -> HfgError | None:
        """The error that the run failed with, or None."""
        return None if self.ended_how is None else self.ended_how[1]

"""The part of a run that waits: the pump, timers, coroutines and threads (rules R1, R5, R6, X2, X3).

What is to happen is decided in `firing`, `sending` and `quiet`; here it is made to happen on one event loop, without
a task per hop. Stands on all of them.
"""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
import inspect
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from types import CoroutineType
from typing import Any

from hfg.clock import current_clock
from hfg.engine import errors, lifecycle, plan, quiet, rx, steps, wiring
from hfg.engine import ports as engine_ports
from hfg.engine.activity import gate_changed
from hfg.engine.carrier import Carrier
from hfg.engine.core import PENDING, Core
from hfg.engine.groups import Fifo, Group, Job, LoopGroup, ThreadGroup, make_policy
from hfg.engine.sending import consider, discard, trigger
from hfg.engine.virtual import VirtualTimeLoop
from hfg.engine.watchdog import Watch, watchdog
from hfg.engine.worker import STARTING, TORN_DOWN, RunningEvent, Worker
from hfg.errors import EngineInternalError, HfgError, NodeError, RunError, TeardownError
from hfg.graph.flat import FlatGraph
from hfg.ports.edges import DelayEdge, EventEdge
from hfg.token import Token
from hfg.trace import RunEnded, RunStarted, TraceEvent

__all__ = ["Engine", "Settings", "answer"]

_LOGGER = logging.getLogger("hfg.engine")
_SLICE_S = 0.005  # how long the pump may keep the loop to itself on the real clock
_SLICE_STEPS = 64  # how many steps it makes between two looks at the clock
_VIRTUAL_SLICE_STEPS = 2048  # in virtual time a slice must not depend on how fast the machine is

_MOST_AT_ONE_INSTANT = 20_000_000  # firings, before a run with `until_s` is taken to stand still

_code_of: contextvars.ContextVar[Worker | None] = contextvars.ContextVar("hfg.code_of", default=None)

Done = Callable[[Any, BaseException | None], None]


class Settings:
    """How a run is to be done; the arguments of `hfg.run`."""

    def __init__(
        self,
        *,
        debug: bool = False,
        policy: str | None = None,
        seed: int | None = None,
        trace: Callable[[TraceEvent], None] | None = None,
        fast: bool = True,
        until_s: float | None = None,
        allow_idle: bool = False,
        block_warning_s: float = 0.1,
        teardown_limit_s: float = 5.0,
    ) -> None:
        self.debug = debug
        self.policy = policy
        self.seed = seed
        self.trace = trace
        self.fast = fast
        self.until_s = until_s
        self.allow_idle = allow_idle
        self.block_warning_s = block_warning_s
        self.teardown_limit_s = teardown_limit_s


def answer(waiter: asyncio.Future[Any], value: Any) -> None:
    """Give a waiting future its result, unless whoever waited has gone."""
    if not waiter.done():
        waiter.set_result(value)


class _Timer:
    """A pending call that keeps the run from being quiet."""

    __slots__ = ("_callback", "_engine", "_handle")

    def __init__(self, engine: Engine, when: float, callback: Callable[[], None]) -> None:
        self._engine = engine
        self._callback = callback
        self._handle: asyncio.TimerHandle | None = engine.loop.call_at(when, self._run, context=engine.context)
        engine.core.timers += 1

    def _run(self) -> None:
        self._handle = None
        engine = self._engine
        engine.core.timers -= 1
        if not engine.core.over:
            engine._guard(self._callback)
            engine.go_on()

    def cancel(self) -> None:
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None
            self._engine.core.timers -= 1
            self._engine.kick()


class Engine:
    """Runs one flattened graph on the running event loop, once.

    Attributes:
      core: the state the deciding modules work on.
      finished: done when the run is over and torn down; its result is the outcome, its exception what went wrong.
      holds: people outside who may still bring something (R5).
    """

    def __init__(self, flat: FlatGraph, settings: Settings) -> None:
        self.loop = asyncio.get_running_loop()
        self.settings = settings
        self.virtual = isinstance(self.loop, VirtualTimeLoop)
        self._epoch = 0.0 if self.virtual else time.time() - self.loop.time()
        self.context = contextvars.copy_context()
        self.context.run(current_clock.set, self.now)
        self.core = Core(self)
        self._consumers: list[Callable[[TraceEvent], None]] = []
        self.core.debug = settings.debug
        self.core.fast = settings.fast
        self.flat = flat
        self.holds = 0
        self.seen_ports: list[Any] = []
        self._quiet_waiters: list[asyncio.Future[None]] = []
        self._outcome: tuple[str, HfgError | None] | None = None
        self.ending: asyncio.Event = asyncio.Event()
        self._early_signals: dict[int, list[Callable[[], None]]] = {}
        self._came_back = asyncio.Event()  # code that was cancelled at the end is over
        self._scheduled = False
        self._set_up: list[Worker] = []
        self._aside: set[asyncio.Task[None]] = set()
        self._disposables: list[Callable[[], None]] = []
        self._thread = threading.get_ident()
        self._ready_groups: deque[ThreadGroup] = deque()
        self._inbox_lock = threading.Lock()
        self.scheduler = rx.RunScheduler(self)
        self.groups = self._make_groups()
        self._loop_group = self.groups["loop"]
        self._watch: Watch | None = None
        self._main_task: asyncio.Task[Any] | None = None
        self.started_at = 0.0
        self.leftover_threads: list[str] = []
        self._zombies: set[Any] = set()  # carriers of given-up firings
        self.ended_at: float | None = None
        self._instant = -1.0
        self._instant_steps = 0
        plan.build(self.core, flat, self.groups, loop=self._loop_group)
        if settings.trace is not None:
            self.add_consumer(settings.trace)

    # --- time -------------------------------------------------------------------------------------------------------

    def now(self) -> float:
        """Seconds on the run's clock."""
        return self.loop.time() + self._epoch

    def call_at(self, when: float, callback: Callable[[], None]) -> _Timer:
        """See `Host`."""
        return _Timer(self, when - self._epoch, callback)

    # --- groups -----------------------------------------------------------------------------------------------------

    def all_workers(self) -> Iterator[Worker]:
        """Those inside iterations too."""
        stack = [self.core]
        while stack:
            for worker in stack.pop().workers:
                yield worker
                if worker.iteration is not None:
                    stack.append(worker.iteration.core)

    def _make_groups(self) -> dict[str, Group]:
        groups: dict[str, Group] = {}
        settings = self.settings
        for name, spec in self.flat.groups.items():
            seed = settings.seed if spec.seed is None else spec.seed
            policy = make_policy(settings.policy or spec.policy, seed)
            if spec.threads:
                groups[name] = ThreadGroup(name, policy, self._ready_groups, self._deliver, self.context)
            else:
                groups[name] = LoopGroup(name, policy)
        if "loop" not in groups:
            groups["loop"] = LoopGroup("loop", make_policy(settings.policy or "fifo", settings.seed))
        return groups

    def _deliver(self, box: deque[Any]) -> None:
        """From a thread: one wake-up for all that it has put into its box by then."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: the run is over, nobody waits for this
            self.loop.call_soon_threadsafe(self._collect, box, context=self.context)

    def _collect(self, box: deque[Any]) -> None:
        while box:
            item = box.popleft()
            if isinstance(self.loop, VirtualTimeLoop):
                self._hold_back(self.loop, box, item)
            elif isinstance(item, Job):
                self._guard(partial(item.owner, item))
            elif not self.core.over:
                self._guard(item)
        self.go_on()

    def _hold_back(self, loop: VirtualTimeLoop, box: deque[Any], item: Any) -> None:
        """In virtual time what a thread brings comes in when the clock says so.

        A job with the signals before it (R6).
        """
        if not isinstance(item, Job):
            self._early_signals.setdefault(id(box), []).append(item)
            return
        signals = self._early_signals.pop(id(box), [])

        def arrive() -> None:
            for signal in signals:
                if not self.core.over:
                    self._guard(signal)
            self._guard(partial(item.owner, item))
            self.go_on()

        if item.held is None:
            arrive()
        else:
            item.held.deliver = arrive

    def on_loop(self) -> bool:
        """Whether the caller is on the run's own thread."""
        return threading.get_ident() == self._thread

    def from_any_thread(self, call: Callable[[], None]) -> None:
        """Do this on the loop; calls of one thread keep their order."""
        if self.on_loop():
            call()
        else:
            self.loop.call_soon_threadsafe(call, context=self.context)

    # --- the pump ---------------------------------------------------------------------------------------------------

    def kick(self) -> None:
        """Something may be queued: see to it that the pump runs."""
        if not self._scheduled and not self.core.pumping:
            self._scheduled = True
            self.loop.call_soon(self._pump, context=self.context)

    def go_on(self) -> None:
        """At the end of a callback of the loop: pump at once, which saves a pass of the loop."""
        if not self._scheduled and not self.core.pumping:
            self._pump()

    def _pump(self) -> None:
        """Drain the loop group within a slice; a hop is a few function calls."""
        self._scheduled = False
        core = self.core
        if core.over or not core.started:
            return
        policy: Any = self._loop_group.policy
        core.pumping = True
        core.plain = core.trace is None
        try:
            self._drain(policy, policy.popleft if isinstance(policy, Fifo) else policy.pop, self._ready_groups)
        except Exception as error:
            self._internal(error)
        finally:
            core.pumping = core.plain = False
            core.current = None
        if self._outcome is not None:
            return
        if policy or self._ready_groups:
            self.kick()
        else:
            self._settle()

    def _internal(self, error: BaseException) -> None:
        """A fault of ours must end the run, not hang it."""
        problem = (
            error
            if isinstance(error, HfgError)
            else EngineInternalError(f"{type(error).__name__}: {error}; please report this")
        )
        if problem is not error:
            problem.__cause__ = error
        self.finish("failed", problem)

    def _guard(self, call: Callable[[], None]) -> None:
        try:
            call()
        except Exception as error:
            self._internal(error)

    def _drain(self, policy: Any, pop: Callable[[], Worker], ready_groups: deque[ThreadGroup]) -> None:
        """Step what is queued until nothing is, or the slice is over; short drains do not look at the clock."""
        core = self.core
        left = _VIRTUAL_SLICE_STEPS if self.virtual else _SLICE_STEPS
        until = 0.0
        while True:
            if ready_groups:
                ready_groups.popleft().dispatch()
            if not policy:
                if ready_groups:
                    continue
                return
            worker = pop()
            worker.step(worker)
            left -= 1
            if not left:
                if core.over:
                    return
                if self.virtual:
                    self._same_instant()
                    return
                now = time.monotonic()
                if not until:
                    until = now + _SLICE_S
                elif now >= until:
                    return
                left = _SLICE_STEPS

    def _same_instant(self) -> None:
        """R6: with `until_s`, something that goes on and on without letting time pass is refused in the end."""
        now = self.loop.time()
        if now != self._instant:
            self._instant, self._instant_steps = now, 0
        self._instant_steps += _VIRTUAL_SLICE_STEPS
        if self._instant_steps > _MOST_AT_ONE_INSTANT and self.settings.until_s is not None:
            busiest = max(self.core.workers, key=lambda worker: worker.firings + worker.call_number)
            self.finish(
                "failed",
                RunError(
                    f"virtual time has stood still at {now:g} s for {self._instant_steps:,} firings, so until_s would "
                    f'never come; "{busiest.path}" fired most: give the source in front of it max_rate_hz='
                ),
            )

    def _settle(self) -> None:
        """The run queues are empty: is the graph quiet, and if so, what follows?"""
        core = self.core
        if core.timers:
            return
        if core.in_flight and not (
            (core.futile and quiet.only_futile_in_flight(core))
            or (core.waiting_room and quiet.only_waiting_for_room(core))
        ):
            return
        self.quiet()

    def quiet(self) -> None:
        """Nothing runs, nothing can start, no timer is pending (F8, P9, F13, R5)."""
        core = self.core
        if quiet.grow(core):
            return
        for waiter in self._quiet_waiters:
            if not waiter.done():
                waiter.set_result(None)
        self._quiet_waiters.clear()
        if self.holds:
            return
        if quiet.complete_operators(core):
            self.kick()
            return
        if core.timers:
            return
        if quiet.end_events(core):
            self.kick()
            return
        stalled = quiet.stall(core)
        self.finish("done" if stalled is None else "stalled", stalled)

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

    # --- a node's code ----------------------------------------------------------------------------------------------

    def execute(self, worker: Worker, call: Callable[..., Any], arguments: tuple[Any, ...], done: Done) -> None:
        """See `Host`."""
        if worker.group.threaded and not inspect.iscoroutinefunction(call):
            self._in_thread(worker, call, arguments, done)
            return
        core = self.core
        core.current = worker
        try:
            result = call(*arguments)
        except Exception as error:
            core.current = None
            done(None, error)
            return
        core.current = None
        if type(result) is CoroutineType or (worker.is_async and hasattr(result, "__await__")):
            self.drive(worker, result, done)
        else:
            done(result, None)

    def drive(self, worker: Worker, coroutine: Any, done: Done) -> None:
        """See `Host`."""
        carrier = worker.carrier
        if carrier is None:
            carrier = worker.carrier = self._carrier(worker)
        self.core.current = worker
        try:
            result = carrier.start(coroutine, self.late(worker, done))
        except Exception as error:
            self.core.current = None
            done(None, error)
            return
        self.core.current = None
        if result is not PENDING:
            done(result, None)
            return
        self.begin(worker)
        self._limit(worker)

    def _carrier(self, worker: Worker) -> Carrier:
        """Make the dormant task of an async node, in a context that tells whose code runs."""
        context = self.context.copy()
        context.run(_code_of.set, worker)
        return Carrier(self.loop, f"hfg {worker.path}", self.context, context)

    def _limit(self, worker: Worker) -> None:
        """X2: the firing may not take longer than its limit."""
        options = worker.options
        if options is not None and options.max_duration_s is not None and worker.busy == "firing":
            worker.limit_timer = self.core.after(options.max_duration_s, lambda: errors.time_out(worker))

    def begin(self, worker: Worker) -> None:
        """See `Host`."""
        worker.in_flight = True
        worker.core.in_flight += 1

    def late(self, worker: Worker, done: Done) -> Done:
        """See `Host`."""
        closing = self.core.over  # a hook of the teardown; what began before the end is not listened to after it

        def over(result: Any, error: BaseException | None) -> None:
            if worker.in_flight and (worker.carrier is carrier or carrier is None):
                worker.in_flight = False
                worker.core.in_flight -= 1
            elif self._zombies:
                self._zombies.discard(carrier)
            if outer.over:
                self._came_back.set()
                if not closing:
                    return
            try:
                done(result, error)
            except Exception as fault:
                self._internal(fault)
            if inside is not None:
                inside.look_later()
            if not self._scheduled and not outer.pumping:
                self._pump()

        inside = worker.core.inside
        outer = self.core
        carrier = worker.carrier
        return over

    def _in_thread(self, worker: Worker, call: Callable[..., Any], arguments: tuple[Any, ...], done: Done) -> None:
        group: Any = worker.group
        closing = self.core.over
        self.begin(worker)

        def back(job: Job) -> None:
            if job is not worker_job:
                return
            group.returned()
            worker.in_flight = False
            worker.core.in_flight -= 1
            if not self.core.over or closing:
                done(job.result, job.error)
            if worker.core.inside is not None:
                worker.core.inside.look_later()

        worker_job = Job(back, call, arguments, done)
        worker.job = worker_job
        if isinstance(self.loop, VirtualTimeLoop):
            limit = worker.options.max_duration_s if worker.busy == "firing" else None
            worker_job.held = self.loop.hold(limit, lambda: self._guard(partial(errors.time_out, worker)))
        else:
            self._limit(worker)
        group.submit(worker_job)

    def execute_aside(self, worker: Worker, call: Callable[..., Any], done: Done) -> None:
        """See `Host`."""
        try:
            result = call()
        except Exception as error:
            done(None, error)
            return
        if type(result) is not CoroutineType:
            done(result, None)
            return
        self.core.in_flight += 1

        async def aside() -> None:
            error: BaseException | None = None
            try:
                await result
            except Exception as problem:
                error = problem
            finally:
                self.core.in_flight -= 1
            if not self.core.over:
                done(None, error)
                self.kick()

        task = self.loop.create_task(aside(), context=self.context)
        self._aside.add(task)
        task.add_done_callback(self._aside.discard)

    def interrupt(self, worker: Worker) -> None:
        """See `Host`."""
        if not worker.in_flight:
            return
        worker.in_flight = False
        worker.core.in_flight -= 1
        group: Any = worker.group
        if group.threaded:
            job = worker.job
            job.owner = lambda _job: None
            if isinstance(self.loop, VirtualTimeLoop):
                self.loop.drop(job.held)
                job.held = None
            group.abandon(f'"{worker.path}", firing {worker.firings}')
        else:
            carrier, worker.carrier = worker.carrier, None
            self._zombies.add(carrier)
            carrier.cancel()

    async def trigger_wait(self, event: RunningEvent, value: Any, activity: int | None, stamp: float | None) -> None:
        """Trigger, then wait until no `wait` queue behind the node's events is full (F8)."""
        trigger(event, value, activity, stamp)
        worker = event.worker
        core = worker.core
        own = _code_of.get() is worker  # its own code waits for us, not we for it
        while worker.full_edges and core.started and not core.over:
            waiter: asyncio.Future[None] = self.loop.create_future()
            if worker.room_waiters is None:
                worker.room_waiters = []
            worker.room_waiters.append(partial(answer, waiter, None))
            worker.waiting_room += own
            core.waiting_room += own
            core.host.kick()
            try:
                await waiter
            finally:
                worker.waiting_room -= own
                core.waiting_room -= own

    def adopt_event(self, port: Any) -> None:
        """Give an event the run's scheduler and thread (ARCHITECTURE §3)."""
        port._scheduler = self.scheduler
        port._thread = self._thread
        self.seen_ports.append(port)

    # --- beginning and ending ---------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Set up all nodes, trigger `start`, then let the sources go (A10)."""
        core = self.core
        self.started_at = self.now()
        self._watch = watchdog.watch(core, self.settings.block_warning_s)
        if not await self._set_up_all(core):
            return
        if self.settings.until_s is not None:
            self.loop.call_at(self.loop.time() + self.settings.until_s, self._until)
        if core.trace is not None:
            core.trace(RunStarted(self.now()))
        core.started = True
        assert core.boundary is not None
        start = core.boundary.events.get("start")
        if start is not None:
            trigger(start, explicit=1)
        self._open_sources(core)
        for source, edge, operators in core.observables:
            self._feed(source, edge, operators)
        self.kick()

    async def _set_up_all(self, core: Core) -> bool:
        """Set up every node in order of adding, those inside an iteration right behind it; whether all went well."""
        for worker in core.workers:
            if worker.type is not None and (
                worker.is_async or any(spec.is_async for spec in worker.type.slots.values())
            ):
                worker.carrier = self._carrier(worker)
        for edge in core.edges:
            if isinstance(edge, DelayEdge | EventEdge):
                edge.queue.extend(Token(value, 0, self.now(), 0) for value in edge.initial)
        for worker in core.workers:
            if worker.scope is None:
                await self._set_up_one(worker)
            if self._outcome is not None:
                return False
            if worker.iteration is not None:
                if not await self._set_up_all(worker.iteration.core):
                    return False
                worker.iteration.core.started = True
        for worker in core.workers:
            engine_ports.bind_automatic(worker)
            plan.watch(worker)
            if worker.watched:
                engine_ports.bind(worker)
            wiring.rewire(worker)
        for edge, operators in core.piped:
            self._disposables.append(rx.pipe_edge(edge, operators, self.scheduler))
        return True

    def _open_sources(self, core: Core) -> None:
        """Sources may fire from now on, as far as their gates allow."""
        for worker in core.workers:
            if worker.gates_over and worker.is_source:
                gate_changed(worker.gates_over)
            worker.blocked &= ~STARTING
            consider(worker)
            if worker.iteration is not None:
                self._open_sources(worker.iteration.core)

    async def _set_up_one(self, worker: Worker) -> None:
        waiter: asyncio.Future[HfgError | None] = self.loop.create_future()
        self._set_up.append(worker)
        lifecycle.set_up(worker, partial(answer, waiter))
        error = waiter.result() if waiter.done() else await waiter
        if error is not None:
            self.finish("failed", error)

    def _feed(self, source: Any, edge: Any, operators: tuple[Any, ...]) -> None:
        """An outside observable holds the run open until it completes (R5)."""
        self.hold()
        open_ = [True]

        def over(error: BaseException | None) -> None:
            if open_[0]:
                open_[0] = False
                if error is not None:
                    problem = NodeError(edge.target.path, f'the observable that feeds "{edge.label}"', error)
                    problem.__cause__ = error
                    self.finish("failed", problem)
                self.unhold()

        self._disposables.append(
            rx.feed_from_observable(source, edge, operators, self.scheduler, self.from_any_thread, over)
        )

    @property
    def teardown_limit_s(self) -> float:
        """X3: how long one node may take; short when somebody wants to leave."""
        limit = self.settings.teardown_limit_s
        return min(limit, 1.0) if self._outcome is not None and self._outcome[0] == "cancelled" else limit

    def _until(self) -> None:
        self.finish("until", None)

    def finish(self, outcome: str, error: HfgError | None) -> None:
        """See `Host`."""
        if self._outcome is not None:
            return
        self._outcome = (outcome, error)
        self.core.over = True
        self.ended_at = self.now()
        for worker in self.all_workers():
            worker.core.over = True
            worker.blocked |= TORN_DOWN
            if worker.room_waiters is not None:
                for waiter in worker.room_waiters:
                    waiter()
        for waiter in self._quiet_waiters:
            if not waiter.done():
                waiter.set_result(None)
        self._quiet_waiters.clear()
        self.ending.set()

    async def close(self) -> tuple[str, HfgError | None]:
        """Tear everything down, in reverse order of setup, each within its time limit (X3).

        Gives back how the run ended.
        """
        if self._outcome is None:
            self.finish("cancelled", None)
        assert self._outcome is not None
        core = self.core
        outcome, error = self._outcome
        for dispose in self._disposables:
            dispose()
        await self._cancel_code()
        problems: list[NodeError] = []
        for worker in reversed(self._set_up):
            problem = await self._tear_down_one(worker)
            if problem is not None:
                problems.append(problem)
        for worker in self.all_workers():
            engine_ports.release_ports(worker)
            for timer in (worker.rate_timer, worker.limit_timer, worker.active_timer):
                if timer is not None:
                    timer.cancel()
        for edge in core.edges:
            if edge.untaken and error is None and outcome in ("stopped", "until", "cancelled"):
                discard(edge, "stopped")
        await self._end_threads()
        carriers = [worker.carrier for worker in self.all_workers() if worker.carrier is not None] + list(self._zombies)
        for carrier in carriers:
            carrier.cancel()
        if carriers:
            await asyncio.wait([carrier.task for carrier in carriers], timeout=self.teardown_limit_s)
        if self._watch is not None:
            watchdog.forget(self._watch)
        core.errors.extend(problems)
        if problems and error is None:
            error, outcome = TeardownError(problems), "failed"
        self._outcome = (outcome, error)
        if core.trace is not None:
            core.trace(RunEnded(self.now(), outcome))
        return outcome, error

    async def _cancel_code(self) -> None:
        """Cancel what still waits; threads get their time to come back."""
        carriers = []
        for worker in self.all_workers():
            if worker.in_flight and worker.carrier is not None:
                worker.ticket += 1
                worker.carrier.cancel()
                carriers.append(worker)
        for task in self._aside:
            task.cancel()
        limit = self.teardown_limit_s
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(limit):
                while any(worker.in_flight for worker in carriers):
                    self._came_back.clear()
                    await self._came_back.wait()
        for worker in carriers:
            if worker.in_flight:
                problem = NodeError(
                    worker.path, f"firing {worker.firings}", f"it was cancelled and did not end within {limit:g} s"
                )
                self.core.errors.append(problem)
                worker.carrier = None

    async def _tear_down_one(self, worker: Worker) -> NodeError | None:
        if worker.node is None or worker.in_flight:
            return None
        if worker.generator is None and worker.node._hook("teardown") is None:
            return None
        waiter: asyncio.Future[NodeError | None] = self.loop.create_future()
        lifecycle.tear_down(worker, partial(answer, waiter))
        if waiter.done():
            return waiter.result()
        limit = self.teardown_limit_s
        try:
            return await asyncio.wait_for(waiter, limit)
        except TimeoutError:
            return NodeError(worker.path, "teardown()", f"it took longer than {limit:g} s and was given up")

    async def _end_threads(self) -> None:
        groups = [group for group in self.groups.values() if isinstance(group, ThreadGroup)]
        threads = [(group.name, thread) for group in groups if (thread := group.stop()) is not None]
        until = time.monotonic() + self.teardown_limit_s
        for name, thread in threads:
            while thread.is_alive() and time.monotonic() < until:
                await asyncio.sleep(0)
                thread.join(0.001)
            if thread.is_alive():
                self.leftover_threads.append(f'thread of group "{name}"')
        for group in groups:
            self.leftover_threads.extend(what for what, thread in group.abandoned if thread.is_alive())

    @property
    def outcome(self) -> str:
        """How the run ended; "running" while it does."""
        return "running" if self._outcome is None else self._outcome[0]

    @property
    def error(self) -> HfgError | None:
        """What the run failed with, if it did."""
        return None if self._outcome is None else self._outcome[1]

    def watch_task(self, task: asyncio.Task[Any] | None) -> None:
        """Whose cancellation means that somebody wants to leave, even while a node blocks the loop."""
        self._main_task = task

    # --- the trace --------------------------------------------------------------------------------------------------

    def add_consumer(self, consumer: Callable[[TraceEvent], None]) -> Callable[[], None]:
        """Let a consumer see every event from now on.

        Gives back what removes it. One that raises is logged and removed (R7).
        """

        def guarded(event: TraceEvent) -> None:
            try:
                consumer(event)
            except Exception:
                _LOGGER.exception("a consumer of the trace failed and was removed")
                remove()

        def remove() -> None:
            if guarded in self._consumers:
                self._consumers.remove(guarded)
                self._listen()

        self._consumers.append(guarded)
        self._listen()
        return remove

    def _listen(self) -> None:
        """Nobody listens: nothing is built (R7). One: it is called. Several: one after the other."""
        consumers = tuple(self._consumers)
        core = self.core
        before = core.trace
        if not consumers:
            core.trace = None
        elif len(consumers) == 1:
            core.trace = consumers[0]
        else:

            def tell(event: TraceEvent) -> None:
                for consumer in consumers:
                    consumer(event)

            core.trace = tell
        core.plain = core.pumping and core.trace is None
        if core.started and (before is None) != (core.trace is None):
            for worker in core.workers:
                steps.choose(worker)

"""Runs the code of nodes where it belongs: on the loop, as a coroutine, or in the thread of a group (rules R1, R6, X2).

What a node's code gives back is handed to whoever asked, at once or later, always on the loop. Stands on `eager_task`,
`groups` and `virtual`.
"""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
import inspect
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from types import CoroutineType
from typing import Any, Protocol

from hfg.engine.executing.eager_task import EagerTask
from hfg.engine.executing.groups import Job
from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.model import ConcurrentFiring, Core, RunningEvent, RunningNode
from hfg.engine.model.core import PENDING
from hfg.engine.model.current import current_firing, current_task
from hfg.engine.rules import concurrency, errors
from hfg.engine.rules.sending import trigger, trigger_from_task

__all__ = ["CodeRunner", "answer", "run_as", "whose_code"]

_code_of: contextvars.ContextVar[RunningNode | None] = contextvars.ContextVar("hfg.code_of", default=None)

Done = Callable[[Any, BaseException | None], None]
_Outcome = tuple[Any, Exception | None]


def whose_code() -> RunningNode | None:
    """Give the async node in whose code, or in a task it has firing, this is called."""
    return _code_of.get()


def run_as(worker: RunningNode) -> None:
    """From here on, in this context, it is the code of this async node that runs."""
    _code_of.set(worker)


def answer(waiter: asyncio.Future[Any], value: Any) -> None:
    """Give a waiting future its result, unless whoever waited has gone."""
    if not waiter.done():
        waiter.set_result(value)


def _nobody_waits(_how_many: int) -> None:
    """Who waits for room is no code of the node."""


class _Pump(Protocol):
    """What is told that code has come back: the engine."""

    beside_work: int

    def guard(self, call: Callable[[], None]) -> None:
        """Call something of ours; what it raises ends the run."""

    def go_on(self) -> None:
        """A callback of the loop is over: pump."""

    def give_way(self, call: Callable[[], None]) -> None:
        """Call it behind all that is ready now."""

    def internal_fault(self, error: BaseException) -> None:
        """A fault of ours ends the run."""

    def kick(self) -> None:
        """Something may be queued."""


class CodeRunner:
    """Runs the code of the nodes of one engine; see `core.Code`.

    Attributes:
      given_up: eager_tasks of firings that took too long, until their code has ended.
      aside: hooks of activity that wait.
      came_back: set when code that was under way at the end of the run is over.
      holds: work in threads for which virtual time stands still.
    """

    def __init__(
        self, engine: _Pump, core: Core, loop: asyncio.AbstractEventLoop, context: contextvars.Context
    ) -> None:
        self._engine = engine
        self.core = core
        self.loop = loop
        self.context = context
        self.given_up: set[Any] = set()
        self.aside: set[asyncio.Task[None]] = set()
        self.came_back = asyncio.Event()
        self.holds = 0
        self._early_signals: dict[int, list[Callable[[], None]]] = {}

    def execute(self, worker: RunningNode, call: Callable[..., Any], arguments: tuple[Any, ...], done: Done) -> None:
        """See `core.Code`."""
        if worker.group.threaded and not inspect.iscoroutinefunction(call):
            self._in_thread(worker, call, arguments, done)
            return
        result, error = self._call(worker, call, arguments)
        if type(result) is CoroutineType or (worker.is_async and hasattr(result, "__await__")):
            self.drive(worker, result, done)
        else:
            done(result, error)

    def _call(self, worker: RunningNode, call: Callable[..., Any], arguments: tuple[Any, ...]) -> _Outcome:
        """Call what is a node's code, or begins with it; gives what that gave back, and what it raised."""
        self.core.current = worker  # which stays so if what is raised is no error of the node
        try:
            result = call(*arguments)
        except Exception as error:
            self.core.current = None
            return None, error
        self.core.current = None
        return result, None

    def drive(self, worker: RunningNode, coroutine: Any, done: Done) -> None:
        """See `core.Code`."""
        eager_task = worker.execution.eager_task
        if eager_task is None:
            eager_task = self.eager_task(worker)
            worker.execution.run_in(eager_task)
        result, error = self._call(worker, eager_task.start, (coroutine, self.late(worker, done)))
        if result is not PENDING:
            done(result, error)
            return
        worker.begin_async()
        self._limit(worker)

    def eager_task(self, worker: RunningNode) -> EagerTask:
        """Make the dormant task of an async node, in a context that tells whose code runs."""
        context = self.context.copy()
        context.run(run_as, worker)
        return EagerTask(self.loop, f"hfg {worker.path}", self.context, context, self._engine.give_way)

    def _limit(self, worker: RunningNode) -> None:
        """X2: the firing may not take longer than its limit."""
        options = worker.options
        if options is not None and options.max_duration_s is not None and worker.busy == "firing":
            worker.execution.limit(self.core.after(options.max_duration_s, lambda: errors.time_out(worker)))

    # --- several firings of a node at once (F14) --------------------------------------------------------------------

    def execute_concurrent(
        self, firing: ConcurrentFiring, call: Callable[..., Any], arguments: tuple[Any, ...], done: Done
    ) -> None:
        """See `core.Code`."""
        worker = firing.worker
        if worker.group.threaded and not inspect.iscoroutinefunction(call):
            self._concurrent_in_thread(firing, call, arguments, done)
            return
        outside = current_firing.set(firing)
        result, error = self._call(worker, call, arguments)
        current_firing.reset(outside)
        if type(result) is CoroutineType or hasattr(result, "__await__"):
            self.drive_concurrent(firing, result, done)
        else:
            done(result, error)

    def drive_concurrent(self, firing: ConcurrentFiring, coroutine: Any, done: Done) -> None:
        """See `core.Code`."""
        worker = firing.worker
        concurrent: Any = worker.concurrent
        eager_task = concurrent.lend() or self.eager_task(worker)
        eager_task.enter(current_firing.set, firing)  # what its code sends is its own
        late = self._late_concurrent(firing, eager_task, done)
        result, error = self._call(worker, eager_task.start, (coroutine, late))
        if result is not PENDING:
            concurrent.give_back(eager_task)
            done(result, error)
            return
        firing.work(eager_task=eager_task)
        limit = firing.limit_s
        if limit is not None:
            firing.limit(worker.core.after(limit, partial(concurrency.time_out, firing)))

    def _late_concurrent(self, firing: ConcurrentFiring, eager_task: EagerTask, done: Done) -> Done:
        """What to call when the code of the firing, which waited, is over."""

        def over(result: Any, error: BaseException | None) -> None:
            if firing.eager_task is eager_task:
                firing.rest()
                concurrent: Any = firing.worker.concurrent
                concurrent.give_back(eager_task)
            else:
                self._drop(eager_task)
            self._tell(done, result, error)
            self._engine.go_on()

        return over

    def _concurrent_in_thread(
        self, firing: ConcurrentFiring, call: Callable[..., Any], arguments: tuple[Any, ...], done: Done
    ) -> None:
        worker = firing.worker
        group: Any = worker.group

        def in_thread(*arguments: Any) -> Any:
            current_firing.set(firing)
            return call(*arguments)

        def back(job: Job) -> None:
            group.returned(job)
            if firing.job is job:
                firing.rest()
            self._tell(done, job.result, job.error)

        job = Job(worker, back, in_thread, arguments, done)
        firing.work(job=job)
        limit = firing.limit_s
        time_out = partial(concurrency.time_out, firing)
        if isinstance(self.loop, VirtualTimeLoop):
            self._hold(job, limit, time_out)
        elif limit is not None:
            firing.limit(worker.core.after(limit, time_out))
        group.submit(job)

    def interrupt_concurrent(self, firing: ConcurrentFiring) -> None:
        """See `core.Code`."""
        eager_task, job = firing.rest()
        if job is not None:
            self._abandon(job, firing.worker, firing.number)
        elif eager_task is not None:
            self._give_up(eager_task)

    def late(self, worker: RunningNode, done: Done) -> Done:
        """See `core.Code`."""
        closing = self.core.over  # a hook of the teardown; what began before the end is not listened to after it

        def over(result: Any, error: BaseException | None) -> None:
            if worker.execution.in_flight and (worker.execution.eager_task is eager_task or eager_task is None):
                worker.end_async()
            else:
                self._drop(eager_task)
            self._tell(done, result, error, closing=closing)
            self._engine.go_on()

        eager_task = worker.execution.eager_task
        return over

    def _tell(self, done: Done, result: Any, error: BaseException | None, *, closing: bool = False) -> None:
        """Code that waited is over; behind the end of the run nobody listens but the teardown (`closing`)."""
        if self.core.over:
            self.came_back.set()
            if not closing:
                return
        try:
            done(result, error)
        except Exception as fault:
            self._engine.internal_fault(fault)

    def _give_up(self, eager_task: EagerTask) -> None:
        """X2: nobody listens to this code any more; it is cancelled, and its task let go when it has ended."""
        self.given_up.add(eager_task)
        eager_task.cancel()

    def _drop(self, eager_task: EagerTask) -> None:
        """The code that was given up has ended, so its task has nothing to do any more."""
        if eager_task in self.given_up:
            self.given_up.discard(eager_task)
            eager_task.drop()

    def _abandon(self, job: Job, amid: RunningNode, firing: int) -> None:
        """X2: nobody listens to this job any more, and its group goes on in another thread."""
        job.disown()
        self._hold_no_more(job)
        group: Any = amid.group
        group.abandon(f'"{amid.path}", firing {firing}', job)

    def execute_wave(
        self, workers: Sequence[RunningNode], call: Callable[..., Any], arguments: tuple[Any, ...], done: Done
    ) -> None:
        """See `core.Code`."""
        job = self._in_thread(workers[0], call, arguments, done, always=True)
        for worker in workers:
            worker.execution.take_job(job)

    def _in_thread(
        self,
        worker: RunningNode,
        call: Callable[..., Any],
        arguments: tuple[Any, ...],
        done: Done,
        *,
        always: bool = False,
    ) -> Job:
        group: Any = worker.group
        closing = self.core.over
        worker.begin_async()

        def back(job: Job) -> None:
            if job is not worker_job:
                return
            group.returned(job)
            worker.end_async()
            if self.core.over:
                self.came_back.set()
            if not self.core.over or closing or always:
                done(job.result, job.error)

        worker_job = Job(worker, back, call, arguments, done)
        worker.execution.take_job(worker_job)
        if isinstance(self.loop, VirtualTimeLoop):
            limit = worker.options.max_duration_s if worker.busy == "firing" else None
            self._hold(worker_job, limit, partial(errors.time_out, worker))
        else:
            self._limit(worker)
        group.submit(worker_job)
        return worker_job

    def _hold(self, job: Job, limit_s: float | None, time_out: Callable[[], None]) -> None:
        """R6: virtual time stands still until the job is back; it has so many real seconds (X2)."""
        if not self.holds:
            self._engine.beside_work = 0
        self.holds += 1
        held = self.loop.hold()  # type: ignore[attr-defined]  # a loop in virtual time
        job.keep_time(held)
        if limit_s is not None:
            held.limit(limit_s, partial(self.context.run, self._given_up, time_out))

    def hold_no_longer_than(self, seconds: float) -> None:
        """X3: after so many real seconds virtual time goes on without the work that is in threads now."""
        loop = self.loop
        if isinstance(loop, VirtualTimeLoop):
            for worker in self.core.workers:
                for job in (worker.execution.job, *[firing.job for firing in worker.concurrent or ()]):
                    if job is not None and job.time_hold is not None:
                        job.time_hold.limit(seconds, partial(self._hold_no_more, job))

    def _hold_no_more(self, job: Job) -> None:
        if job.time_hold is not None:
            self.loop.drop(job.time_hold)  # type: ignore[attr-defined]
            self._came_in(job)

    def _came_in(self, job: Job) -> None:
        """Time does not stand still for it any more, and the pump need not wait for it."""
        job.keep_time(None)
        self.holds -= 1
        self._engine.beside_work = 0

    def _given_up(self, time_out: Callable[[], None]) -> None:
        self._engine.guard(time_out)
        self._engine.go_on()

    def execute_hook(self, worker: RunningNode, call: Callable[..., Any], done: Done) -> None:
        """See `core.Code`."""
        try:
            result = call()
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            done(None, error)
            return
        if type(result) is not CoroutineType:
            done(result, None)
            return
        self.core.begin_async()

        async def aside() -> None:
            error: BaseException | None = None
            try:
                await result
            except KeyboardInterrupt:
                raise
            except BaseException as problem:
                error = problem
            finally:
                self.core.end_async()
            if not self.core.over:
                done(None, error)
                self._engine.kick()

        task = self.loop.create_task(aside(), context=self.context)
        self.aside.add(task)
        task.add_done_callback(self.aside.discard)

    def interrupt(self, worker: RunningNode, *, amid: RunningNode | None = None) -> None:
        """See `core.Code`; `amid`: whose call it is, if that is another node's of its region."""
        if not worker.execution.in_flight:
            return
        job, eager_task = worker.execution.job, worker.execution.eager_task
        worker.end_async()
        if worker.group.threaded:
            amid = amid or worker
            self._abandon(job, amid, amid.counts.firings)
        else:
            worker.execution.run_in(None)
            self._give_up(eager_task)

    async def trigger_wait(self, event: RunningEvent, value: Any, activity: int | None, stamp: float | None) -> None:
        """Trigger, then wait until no `wait` queue behind the node's events is full (F8)."""
        worker = event.worker
        core = worker.core
        task = current_task.get()
        own: Any = worker.room.wait if whose_code() is worker else _nobody_waits  # its own waits for us
        if task is not None and task.worker is worker:
            trigger_from_task(event, value, activity, stamp)
            own = worker.tasks.wait_for_room
        else:
            trigger(event, value, activity, stamp)
        while worker.room.full_edges and core.started and not core.over:
            await self._room(worker, own)

    async def _room(self, worker: RunningNode, own: Callable[[int], None]) -> None:
        """Wait until there is room behind all events of a worker; `own` counts who of it waits."""
        waiter: asyncio.Future[None] = self.loop.create_future()
        waits = True

        def over() -> None:
            """From here on it is not quiet, though the code goes on only at the loop's next pass (F13)."""
            nonlocal waits
            if waits:
                waits = False
                own(-1)
            answer(waiter, None)

        worker.room.when_free(over)
        own(1)
        self._look_for_room()
        worker.core.runtime.kick()
        try:
            await waiter
        finally:
            over()
            self._look_for_room()

    def _look_for_room(self) -> None:
        """An edit that waits for this code must not hold those who could make room."""
        if self.core.quiescing is not None:
            self.core.quiescing.look_for_room()

    # --- from threads -----------------------------------------------------------------------------------------------

    def deliver(self, box: deque[Any]) -> None:
        """From a thread: one wake-up for all that it has put into its box by then."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: the run is over, nobody waits for this
            self.loop.call_soon_threadsafe(self._collect, box, context=self.context)

    def _collect(self, box: deque[Any]) -> None:
        if isinstance(self.loop, VirtualTimeLoop):
            while box:
                self._hold_back(box, box.popleft())
            return  # nothing has come in: the pump must not run because of it, or its turns were a matter of luck
        while box:
            item = box.popleft()
            if isinstance(item, Job):
                self._engine.guard(partial(item.owner, item))
            elif not self.core.over:
                self._engine.guard(item)
        self._engine.go_on()

    def _hold_back(self, box: deque[Any], item: Any) -> None:
        """In virtual time what a thread brings comes in when the clock says so.

        A job with the signals before it (R6).
        """
        if not isinstance(item, Job):
            self._early_signals.setdefault(id(box), []).append(item)
            return
        signals = self._early_signals.pop(id(box), [])

        def arrive() -> None:
            if item.time_hold is not None:
                self._came_in(item)
            for signal in signals:
                if not self.core.over:
                    self._engine.guard(signal)
            self._engine.guard(partial(item.owner, item))
            self._engine.go_on()

        if item.time_hold is None:
            arrive()
        else:
            item.time_hold.deliver = partial(self.context.run, arrive)

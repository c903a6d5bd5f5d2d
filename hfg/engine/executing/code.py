"""Runs the code of nodes where it belongs: on the loop, as a coroutine, or in a thread of the group (rules R1, R6, X2).

The result of a node's code is passed to the caller's `done`, at once or later, but always on the loop. A node, and each
firing of one that allows several (F14), has at most one piece of code in progress. Both take the same path here; they
differ only in where that is recorded, and in which eager task runs it.
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
from typing import Any

from hfg.engine.executing.eager_task import EagerTask
from hfg.engine.executing.pump import Pump
from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.model import ConcurrentFiring, Core, Job, RunningNode, jobs
from hfg.engine.model.contracts import EagerTask as AnyEagerTask
from hfg.engine.model.core import PENDING
from hfg.engine.model.current import current_firing, run_as
from hfg.engine.model.jobs import Done
from hfg.engine.rules import concurrency, errors

__all__ = ["CodeRunner", "answer"]

_Outcome = tuple[Any, Exception | None]


def answer(waiter: asyncio.Future[Any], value: Any) -> None:
    """Set the result of a waiting future, unless the waiter is gone."""
    if not waiter.done():
        waiter.set_result(value)


def _limit_of(worker: RunningNode, firing: ConcurrentFiring | None) -> tuple[float | None, Callable[[], None]]:
    """Return the time limit of a firing, if it has one, and what happens after it (X2)."""
    if firing is not None:
        return firing.limit_s, partial(concurrency.time_out, firing)
    limited = worker.options is not None and worker.busy == "firing"
    return worker.options.max_duration_s if limited else None, partial(errors.time_out, worker)


class CodeRunner:
    """Runs the code of the nodes of one engine; see `core.Code`.

    Attributes:
      given_up: eager tasks of firings that took too long, until their code has ended.
      aside: hooks of activity that wait.
      came_back: set when code that was in progress at the end of the run has ended.
      holds: work in threads for which virtual time stands still.
    """

    def __init__(self, engine: Pump, core: Core, loop: asyncio.AbstractEventLoop, context: contextvars.Context) -> None:
        self._engine = engine
        self.core = core
        self.loop = loop
        self.context = context
        self.given_up: set[AnyEagerTask] = set()
        self.aside: dict[EagerTask, tuple[RunningNode, str]] = {}  # hooks that wait
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
        """Call a node's code, or the engine's code that starts it. Return its result and what it raised."""
        self.core.current = worker  # which stays so if what is raised is not an `Exception`
        try:
            result = call(*arguments)
        except Exception as error:
            self.core.current = None
            return None, error
        self.core.current = None
        return result, None

    def drive(self, worker: RunningNode, coroutine: Any, done: Done, firing: ConcurrentFiring | None = None) -> None:
        """See `core.Code`."""
        concurrent: Any = worker.concurrent
        if firing is None:
            eager_task = worker.execution.eager_task
            if eager_task is None:
                eager_task = self.eager_task(worker)
                worker.execution.run_in(eager_task)
            late = self.late(worker, done)
        else:
            eager_task = concurrent.idle.pop() if concurrent.idle else self.eager_task(worker)
            eager_task.enter(current_firing.set, firing)  # what its code sends is its own
            late = self._late(worker, done, eager_task, firing)
        result, error = self._call(worker, eager_task.start, (coroutine, late))
        if result is not PENDING:
            if firing is not None:
                concurrent.idle.append(eager_task)
            done(result, error)
            return
        if firing is None:
            worker.begin_async()
            if worker.busy == "call" and worker.region is not None:
                worker.region.disturb(worker)  # which takes for granted that calls of its members are over at once
        else:
            firing.work(eager_task=eager_task)
        self._limit(worker, firing)

    def eager_task(self, worker: RunningNode) -> EagerTask:
        """Make the dormant task of an async node, in a context from which the running node can be found."""
        context = self.context.copy()
        context.run(run_as, worker)
        return EagerTask(self.loop, f"hfg {worker.path}", self.context, context, self._engine.give_way)

    def _limit(self, worker: RunningNode, firing: ConcurrentFiring | None) -> None:
        """Start the time limit of a firing (X2)."""
        limit_s, time_out = _limit_of(worker, firing)
        if limit_s is not None:
            (worker.execution if firing is None else firing).limit(self.core.after(limit_s, time_out))

    def execute_concurrent(
        self, firing: ConcurrentFiring, call: Callable[..., Any], arguments: tuple[Any, ...], done: Done
    ) -> None:
        """See `core.Code`."""
        worker = firing.worker
        if worker.group.threaded and not inspect.iscoroutinefunction(call):
            self._in_thread(worker, call, arguments, done, firing=firing)
            return
        outside = current_firing.set(firing)
        result, error = self._call(worker, call, arguments)
        current_firing.reset(outside)
        if type(result) is CoroutineType or hasattr(result, "__await__"):
            self.drive(worker, result, done, firing)
        else:
            done(result, error)

    def late(self, worker: RunningNode, done: Done) -> Done:
        """See `core.Code`."""
        return self._late(worker, done, worker.execution.eager_task, None)

    def _late(
        self, worker: RunningNode, done: Done, eager_task: AnyEagerTask | None, firing: ConcurrentFiring | None
    ) -> Done:
        """Return what to call when code of the node, or of one of its firings, has ended after waiting."""
        closing = self.core.over  # a hook of the teardown; code that began before the end is ignored after it
        execution = worker.execution

        def over(result: Any, error: BaseException | None) -> None:
            if firing is not None and firing.eager_task is eager_task:
                firing.rest()
                concurrent: Any = worker.concurrent
                concurrent.idle.append(eager_task)
            elif firing is None and execution.in_flight and eager_task in (execution.eager_task, None):
                worker.end_async()
            elif eager_task is not None:
                self._drop(eager_task)
            self._report(done, result, error, closing=closing)
            self._engine.go_on()

        return over

    def _report(self, done: Done, result: Any, error: BaseException | None, *, closing: bool) -> None:
        """Code that was in progress has ended; after the end of the run only the teardown needs it (`closing`)."""
        if self.core.over:
            self.came_back.set()
            if not closing:
                return
        try:
            done(result, error)
        except Exception as fault:
            self._engine.internal_fault(fault)

    def interrupt(
        self, worker: RunningNode, *, firing: ConcurrentFiring | None = None, amid: RunningNode | None = None
    ) -> None:
        """See `core.Code`; `amid`: the node whose call it is, if that is another one of its region."""
        if firing is not None:
            eager_task, job = firing.rest()
        elif not worker.execution.in_flight:
            return
        else:
            eager_task, job = worker.execution.eager_task, worker.execution.job
            worker.end_async()
        if job is not None:
            amid = amid or worker
            self._abandon(job, amid, amid.counts.firings if firing is None else firing.number)
        elif eager_task is not None:
            if firing is None:
                worker.execution.run_in(None)
            self._give_up(eager_task)

    def _give_up(self, eager_task: AnyEagerTask) -> None:
        """Ignore the result of this code (X2). It is cancelled, and its task is dropped when it has ended."""
        self.given_up.add(eager_task)
        eager_task.cancel()

    def _drop(self, eager_task: AnyEagerTask) -> None:
        """Code that was given up has ended, so its task has nothing to do any more."""
        if eager_task in self.given_up:
            self.given_up.discard(eager_task)
            eager_task.drop()

    def _abandon(self, job: Job, amid: RunningNode, firing: int) -> None:
        """Ignore the result of this job (X2). Its group continues in another thread."""
        job.disown()
        self._hold_no_more(job)
        group: Any = amid.group
        group.abandon(f'"{amid.path}", firing {firing}', job)

    # --- in threads -------------------------------------------------------------------------------------------------

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
        firing: ConcurrentFiring | None = None,
        always: bool = False,
    ) -> Job:
        group: Any = worker.group
        closing = always or self.core.over

        def of_firing(*arguments: Any) -> Any:
            current_firing.set(firing)
            return call(*arguments)

        def back(job: Job) -> None:
            group.returned(job)
            if firing is None:
                worker.end_async()
            elif firing.job is job:
                firing.rest()
            self._report(done, job.result, job.error, closing=closing)

        job: Job = jobs.Job(worker, back, call if firing is None else of_firing, arguments, done)
        if firing is None:
            worker.begin_async()
            worker.execution.take_job(job)
        else:
            firing.work(job=job)
        if isinstance(self.loop, VirtualTimeLoop):
            self._hold(job, *_limit_of(worker, firing))
        else:
            self._limit(worker, firing)
        group.submit(job)
        return job

    def _hold(self, job: Job, limit_s: float | None, time_out: Callable[[], None]) -> None:
        """Stop virtual time until the job is back (R6); its limit is in real seconds (X2)."""
        if not self.holds:
            self._engine.beside_work = 0
        self.holds += 1
        held = self.loop.hold()  # type: ignore[attr-defined]  # a loop in virtual time
        job.keep_time(held)
        if limit_s is not None:
            held.limit(limit_s, partial(self.context.run, self._given_up, time_out))

    def hold_no_longer_than(self, seconds: float) -> None:
        """After this many real seconds, virtual time continues without the work that is in threads now (X3)."""
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
        """Time does not stop for it any more, and the pump need not wait for it."""
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

        eager_task = EagerTask(
            self.loop, f"hfg {worker.path}", self.context, self.context.copy(), self._engine.give_way
        )
        self.aside[eager_task] = (worker, getattr(call, "__name__", "its hook"))

        def over(_result: object, error: BaseException | None) -> None:
            del self.aside[eager_task]
            eager_task.drop()
            self.core.end_async()
            if self.core.over:
                self.came_back.set()
            else:
                done(None, error)
                self._engine.kick()

        self.loop.call_soon(partial(self._begin_aside, eager_task, result, over), context=self.context)

    def _begin_aside(self, eager_task: EagerTask, coroutine: Any, over: Done) -> None:
        """Take the first step of a hook that may wait; after the end of the run none begins."""
        if self.core.over:
            coroutine.close()
            if eager_task in self.aside:  # else it was left behind
                over(None, None)
            return
        try:
            result = eager_task.start(coroutine, over)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            over(None, error)
        else:
            if result is not PENDING:
                over(result, None)

    def leave_aside(self) -> list[tuple[RunningNode, str]]:
        """Wait no longer for hooks that do not end; return their nodes and names."""
        left = list(self.aside.values())
        for eager_task in self.aside:
            eager_task.drop()
            self.core.end_async()
        self.aside.clear()
        return left

    # --- from threads -----------------------------------------------------------------------------------------------

    def deliver(self, box: deque[Any]) -> None:
        """From a thread: wake the loop up once for all that is in the box by then."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: the run is over, and nothing waits for this
            self.loop.call_soon_threadsafe(self._collect, box, context=self.context)

    def _collect(self, box: deque[Any]) -> None:
        if isinstance(self.loop, VirtualTimeLoop):
            while box:
                self._hold_back(box, box.popleft())
            return  # nothing has come in: the pump must not run because of it, or its turns were a matter of luck
        while box:
            item = box.popleft()
            if isinstance(item, jobs.Job):
                self._engine.guard(partial(item.owner, item))
            elif not self.core.over:
                self._engine.guard(item)
        self._engine.go_on()

    def _hold_back(self, box: deque[Any], item: Any) -> None:
        """In virtual time the clock decides when a job arrives, with the signals before it (R6)."""
        if not isinstance(item, jobs.Job):
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

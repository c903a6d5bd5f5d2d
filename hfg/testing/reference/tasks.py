"""Tasks that the code of a node starts by `start_soon`, and its do-activity (X1, X3, R5, F10, T5, A15).

A task is a child of its node: quiet waits for it, its errors are the node's, and it has ended before the node is torn
down. Its steps are moves of their own, one task after another in the order in which they could go on.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Coroutine
from typing import Any

from hfg.errors import Failure, NodeError, NotRunning, QueueOverflow, UsageError
from hfg.testing.reference.firing import Firing
from hfg.testing.reference.state import Station, Task
from hfg.testing.reference.waiting import TEARDOWN_LIMIT_S
from hfg.trace import DoEnded, DoStarted, ErrorRaised


class Tending(Firing):
    """A machine whose nodes may have tasks."""

    def start_task(self, station: Station, coroutine: Coroutine[Any, Any, Any]) -> None:
        """Make a task of it; nothing of it runs yet.

        Raises:
          UsageError: the node is in a thread.
          NotRunning: it is not set up, or the run is over.
        """
        flight = self.flight_of(station)
        if self.structure.threads.get(station.leaf.options.group, 0) > 0:
            coroutine.close()
            raise UsageError(f'"{station.path}" is in a thread, and async code runs on the loop')
        if self.outcome is not None or not station.set_up:
            coroutine.close()
            raise NotRunning(f'"{station.path}" is not set up')
        if flight is not None:
            flight.triggered = True  # such a firing cannot be taken back (X1)
        if not self.is_enabled(station.leaf.index) and not station.opening:
            coroutine.close()  # the firing was switched off meanwhile: what it does goes nowhere (F10)
            return
        station.tasks_begun += 1
        task = Task(station, getattr(coroutine, "__name__", type(coroutine).__name__), station.tasks_begun)
        station.tasks.append(task)
        task.code = self.loop.start(task, coroutine)

    def tasks_in_turn(self, station: Station) -> list[Task]:
        """Those that can go on now, in the order in which they could."""
        turn = self.loop.owners_in_turn() if station.tasks else []
        able = [task for task in station.tasks if self.loop.can_step(task) and not self.is_waiting(task)]
        return sorted(able, key=turn.index)

    def is_waiting(self, task: Task) -> bool:
        """Return whether it waits until a queue has room, and is not to end (F8)."""
        return bool(task.waiting_for) and not task.cancelled and self.has_no_room(task.station)

    def go_on_with(self, task: Task) -> None:
        """Take its next step; it may be its last."""
        if task.is_activity and not task.stepped and not task.cancelled:
            self.observe(DoStarted(self.now, task.station.path))
            task.stepped = True
        with self.amid_code():
            self.in_task = task
            try:
                self.loop.step(task)
            finally:
                self.in_task = None
        if task.code.done() and task in task.station.tasks:
            self.end_task(task)

    def end_task(self, task: Task) -> None:
        """Remove a task that is over; after the last one, code that waits for the tasks continues."""
        station = task.station
        station.tasks.remove(task)
        self.loop.forget(task)
        cancelled = task.code.cancelled()
        error: BaseException | None = None if cancelled or not task.code.done() else task.code.exception()
        if task.is_activity:
            error = self.end_activity(task, asyncio.CancelledError() if cancelled and not task.cancelled else error)
        if error is not None:
            self.fail_task(task, error)
        if self.outcome is None:
            self.let_others(station)
            self.begin_to_do(station)

    def fail_task(self, task: Task, error: BaseException) -> None:
        """X1: its node's policy decides, with nothing taken; a firing in progress continues."""
        station = task.station
        index = station.leaf.index
        if task.cancelled and self.is_enabled(index) and self.is_closing(station):
            raise NotImplementedError(f'task "{task.name}" of "{station.path}" fails as it is to end')
        what = "do()" if task.is_activity else f'task "{task.name}"'
        failure = NodeError(station.path, what, error)
        policy = self.policy_of(station) if isinstance(error, Exception) else "stop"
        self.observe(ErrorRaised(self.now, station.path, what, str(failure), policy))
        if policy == "stop":
            self.fail_run(failure)
            return
        station.changes.append((self.next_tick(), "failed", Failure(failure, {}), None))
        if policy == "restart" and not station.is_restarting:
            station.restarts += 1
            station.afterwards = "rest"
        if not (station.is_calling if station.is_concurrent else station.flights):
            self.flush_changes(station)
        if policy == "disable":
            self.disable(index)

    # --- A15

    def follow_activity(self, station: Station) -> None:
        """The do-activity is due when A(v) has become 1, and to end when it has become 0."""
        station.is_to_do = station.active
        doing = self.activity_of(station)
        if not station.active and doing is not None and not doing.cancelled:
            self.cancel_task(doing)
        if not station.active and doing is not None:
            station.node._outdated = lambda: self.in_task is doing
        self.begin_to_do(station)

    def activity_of(self, station: Station) -> Task | None:
        """The running do-activity; there is at most one."""
        return next((task for task in station.tasks if task.is_activity), None)

    def is_closing(self, station: Station) -> bool:
        """Return whether its tasks are to end because it is about to be torn down."""
        return (bool(station.afterwards) and not station.is_amid) or any(
            flight.when_rested is not None for flight in station.flights
        )

    def begin_to_do(self, station: Station) -> None:
        """Begin the do-activity if it is due, the last one is over, and the node is enabled and set up."""
        if not station.is_to_do or station.leaf.inside is not None or station.node._hook("do") is None:
            return
        if self.activity_of(station) is not None or self.is_closing(station) or self.outcome is not None:
            return
        if not station.set_up or station.opening or station.is_restarting or not self.is_enabled(station.leaf.index):
            return
        station.is_to_do = False
        station.tasks_begun += 1
        task = Task(station, "do", station.tasks_begun, is_activity=True)
        station.tasks.append(task)
        with self.amid_code():
            task.code = self.loop.start(task, station.node.do())

    def end_activity(self, task: Task, error: BaseException | None) -> BaseException | None:
        """Tell how it has ended; if it has returned by itself that is an event. Gives how it has failed."""
        station = task.station
        station.node._outdated = None
        if error is not None:
            self.observe(DoEnded(self.now, station.path, "failed"))
            return error
        if task.cancelled:
            if task.stepped:
                self.observe(DoEnded(self.now, station.path, "cancelled"))
            return None
        self.observe(DoEnded(self.now, station.path, "completed"))
        try:
            self.trigger(station.leaf.index, "completed", task.code.result())
        except QueueOverflow as overflow:
            return overflow
        return None

    def cancel_tasks(self, station: Station) -> None:
        """Let all of them end, each by its next step."""
        for task in station.tasks:
            if not task.cancelled:
                self.cancel_task(task)

    def cancel_task(self, task: Task) -> None:
        """Let it end, at its next step or within its time limit (X3)."""
        task.cancelled = True
        task.limit = self.now + TEARDOWN_LIMIT_S
        with self.amid_code():
            task.code.cancel()

    def leave_behind(self, task: Task) -> None:
        """X3: it has resisted for too long, so its code runs no further."""
        with self.amid_code(), contextlib.suppress(RuntimeError):
            task.code.get_coro().close()
        self.end_task(task)

    def abandon_tasks(self, station: Station) -> bool:
        """Let them end now; whether each has done so, and without an error."""
        well = True
        for task in station.tasks:
            with self.amid_code():
                task.code.cancel()
                while self.loop.step(task):
                    pass
                if not task.code.done():
                    task.code.get_coro().close()
            well &= task.code.done() and (task.code.cancelled() or task.code.exception() is None)
            self.loop.forget(task)
        station.tasks = []
        return well

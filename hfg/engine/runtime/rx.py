"""reactivex in a run: a scheduler on the run's clock, operators on edges, and observables that feed slots (rule P9).

`AsyncIOScheduler.now` is wall time, so `delay` would never emit in virtual time. Without a scheduler `debounce`
runs on a thread. So the run has its own. What operators on an edge schedule for now happens at once: a chain
that is connected a pass of the loop later would lose what was triggered until then.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from datetime import datetime
from typing import Any, Final

import reactivex
from reactivex import abc, typing
from reactivex.disposable import CompositeDisposable, Disposable, SerialDisposable, SingleAssignmentDisposable
from reactivex.observer import Observer
from reactivex.scheduler.periodicscheduler import PeriodicScheduler
from reactivex.subject import Subject
from typing_extensions import override

from hfg.base.token import Token
from hfg.engine.model import Iteration, Runtime
from hfg.engine.rules.errors import operator_failed
from hfg.engine.rules.modifiers import drop
from hfg.engine.rules.sending import enqueue
from hfg.engine.rules.wiring import reaches
from hfg.ports.edges import EventEdge

_MOST_AT_ONCE: Final = 1000  # actions of operators before the loop has its turn

__all__ = ["RunScheduler", "feed_from_observable", "kick", "pipe_edge"]


class RunScheduler(PeriodicScheduler):
    """Schedules on the run's clock, real or virtual; pending actions prevent quiet."""

    def __init__(self, host: Runtime) -> None:
        super().__init__()
        self._host = host

    @property
    def now(self) -> datetime:
        """The run's clock as reactivex wants it."""
        return self.to_datetime(self._host.now())

    def schedule(self, action: abc.ScheduledAction[Any], state: Any = None) -> abc.DisposableBase:
        """Run the action in the loop's next pass."""
        return self._at(self._host.now(), action, state)

    def schedule_relative(
        self, duetime: typing.RelativeTime, action: abc.ScheduledAction[Any], state: Any = None
    ) -> abc.DisposableBase:
        """Run the action `duetime` from now."""
        return self._at(self._host.now() + max(0.0, self.to_seconds(duetime)), action, state)

    def schedule_absolute(
        self, duetime: typing.AbsoluteTime, action: abc.ScheduledAction[Any], state: Any = None
    ) -> abc.DisposableBase:
        """Run the action at `duetime`."""
        return self._at(max(self._host.now(), self.to_seconds(duetime)), action, state)

    def _at(self, when: float, action: abc.ScheduledAction[Any], state: Any) -> abc.DisposableBase:
        inner = SingleAssignmentDisposable()

        def run() -> None:
            inner.disposable = self.invoke_action(action, state=state)

        timer = self._host.call_at(when, run)

        def forget() -> None:
            timer.cancel()
            inner.dispose()

        return Disposable(forget)


class _EdgeScheduler(RunScheduler):
    """For operators on one edge: what is due now runs at once, one after the other (P9).

    This is what reactivex does without a scheduler. Endless actions let the loop have its turn. While something is
    pending, whoever waits for the edge waits for a timer (F8), and so does the next element of an iteration (G4).
    """

    def __init__(self, host: Runtime, edge: EventEdge) -> None:
        super().__init__(host)
        self._edge = edge
        self._within: Iteration | None = edge.target.within
        self._due: deque[Callable[[], None]] = deque()
        self._at_work = False

    @override
    def schedule(self, action: abc.ScheduledAction[Any], state: Any = None) -> abc.DisposableBase:
        """Run the action before this returns, or after the one that is running."""
        inner = SingleAssignmentDisposable()

        def run() -> None:
            if not inner.is_disposed:
                inner.disposable = self.invoke_action(action, state=state)

        self._due.append(run)
        if not self._at_work:
            self._work()
        return inner

    @override
    def _at(self, when: float, action: abc.ScheduledAction[Any], state: Any) -> abc.DisposableBase:
        pending = SingleAssignmentDisposable()
        pending.disposable = Disposable(self._over)  # once, whether it fires or is cancelled
        self._edge.ripen(1)
        if self._within is not None:
            self._within.count_timer(1)

        def ring(scheduler: abc.SchedulerBase, state: Any) -> abc.DisposableBase | None:
            pending.dispose()
            return action(scheduler, state)

        timer = super()._at(when, ring, state)
        return CompositeDisposable(timer, pending)

    def _over(self) -> None:
        self._edge.ripen(-1)
        if self._within is not None:
            self._within.count_timer(-1)

    def _work(self) -> None:
        self._at_work = True
        try:
            for _ in range(_MOST_AT_ONCE):
                if not self._due:
                    return
                self._due.popleft()()
            self._host.call_at(self._host.now(), self._work)
        finally:
            self._at_work = False


def pipe_edge(edge: EventEdge, operators: tuple[Any, ...], host: Runtime) -> Callable[[], None]:
    """Put operators on an event edge, ahead of its queue. Return what removes them."""
    newest: float | None = None
    subscription = SerialDisposable()
    scheduler = _EdgeScheduler(host, edge)

    def connect() -> None:
        nonlocal newest
        subject: Subject[Any] = Subject()
        newest = None

        def into(token: Token[Any]) -> None:
            nonlocal newest
            if edge.complete is None:  # the event has completed, like an input that has received END (F13)
                drop(edge, token, "ended")
                return
            newest = token.stamp if newest is None else max(newest, token.stamp)
            subject.on_next(token)

        edge.pipe(into, subject.on_completed)
        subscription.disposable = subject.pipe(*operators).subscribe(
            Observer(out, failed, lambda: None), scheduler=scheduler
        )

    def out(item: Any) -> None:
        if not reaches(edge):  # nothing is sent to a disabled node (F10)
            return
        if type(item) is Token:
            enqueue(edge, item.value, 0, item.stamp)
        else:  # before the first token it is a signal of a timer (T5)
            enqueue(edge, item, 0, host.now() if newest is None else newest)
        kick(edge)

    def failed(error: Exception) -> None:
        edge.take_complete()  # nothing passes them any more
        operator_failed(edge, error)

    edge.pipe_afresh_by(connect)
    connect()
    return subscription.dispose


def kick(edge: EventEdge) -> None:
    """Something is on the edge that came from outside a firing."""
    core = edge.target.core
    if not core.pumping:
        core.runtime.kick()


def feed_from_observable(
    source: reactivex.Observable[Any],
    edge: EventEdge,
    operators: tuple[Any, ...],
    scheduler: RunScheduler,
    hand_over: Callable[[Callable[[], None]], None],
    over: Callable[[BaseException | None], None],
) -> Callable[[], None]:
    """Let an observable feed a slot or input. Each edge has its own observer, because a completed one is dead.

    Args:
      source: the observable; it may emit on any thread.
      edge: receives its items as tokens.
      operators: as with `through=`.
      scheduler: the run's.
      hand_over: makes a call on the loop, in order.
      over: called once when the observable completes or fails.
    """
    loop_thread = threading.get_ident()

    def deliver(item: Any) -> None:
        if not edge.live:
            return  # nothing is sent to a node that is disabled (F10)
        if type(item) is Token:
            enqueue(edge, item.value, item.activity if edge.active else 0, item.stamp)
        else:
            enqueue(edge, item, 0, edge.target.core.now())
        kick(edge)

    def on_loop(call: Callable[[], None]) -> None:
        if threading.get_ident() == loop_thread:
            call()
        else:
            hand_over(call)

    observer: Observer[Any] = Observer(
        lambda item: on_loop(lambda: deliver(item)),
        lambda error: on_loop(lambda: over(error)),
        lambda: on_loop(lambda: over(None)),
    )
    subscription: abc.DisposableBase = source.pipe(*operators).subscribe(observer, scheduler=scheduler)
    return subscription.dispose

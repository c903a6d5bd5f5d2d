"""Observables that belong to a run: those derived from an event keep the run's scheduler and its guards.

Without a scheduler, a reactivex operator such as `debounce` waits on a thread of its own, and in virtual time forever.
So `pipe`, and every operator method (all of them call `pipe`), return an observable that passes the run's scheduler on
when it is subscribed to. Depends on reactivex, not on ports.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Generator
from typing import Any, NoReturn, TypeVar

from reactivex import Observable, abc

from hfg.errors import UsageError

__all__ = ["RunObservable"]

T_co = TypeVar("T_co", covariant=True)


class RunObservable(Observable[T_co]):
    """An observable whose subscribers get the scheduler of the run that its origin belongs to."""

    # `super().__init__()` is not called on purpose: its lock costs 105 bytes per event, and few operators need it.

    @functools.cached_property
    def lock(self) -> threading.RLock:  # type: ignore[override]
        """The lock that operators use; made on first use."""
        return threading.RLock()

    @property
    def _origin(self) -> RunObservable[Any]:
        return self

    # Both are None outside a run. `_thread` is the identity of the thread that makes the run's decisions.
    _scheduler: abc.SchedulerBase | None = None
    _thread: int | None = None
    path: Any

    def _belong_to(self, scheduler: abc.SchedulerBase | None, thread: int | None) -> None:
        """Be part of a run, or of none; for the runner."""
        self._scheduler, self._thread = scheduler, thread

    def subscribe(
        self,
        on_next: Any = None,
        on_error: abc.OnError | None = None,
        on_completed: abc.OnCompleted | None = None,
        *,
        scheduler: abc.SchedulerBase | None = None,
    ) -> abc.DisposableBase:
        """Subscribe an observer or callbacks; each gets the event's tokens from now on.

        If a subscriber raises, its error is logged with the event's path and the subscriber is dropped. The node is not
        affected.

        Raises:
          UsageError: called from a thread that is not the run's.
        """
        origin = self._origin
        if origin._thread is not None and origin._thread != threading.get_ident():
            raise UsageError(
                f'"{origin.path}" was subscribed to from a thread that is not its run\'s: subscribe before '
                "the run, or schedule the call with loop.call_soon_threadsafe"
            )
        return super().subscribe(on_next, on_error, on_completed, scheduler=scheduler or origin._scheduler)

    def pipe(self, *operators: Any) -> Any:
        """Chain reactivex operators. Return an observable that belongs to the same run."""
        return _keep(super().pipe(*operators), self._origin) if operators else self

    def __await__(self) -> Generator[Any, None, NoReturn]:
        raise TypeError(
            f'"{self._origin.path}" cannot be awaited: write `await run.wait_for(event)` inside `async with '
            "hfg.running(graph) as run`"
        )


def _keep(result: Any, origin: RunObservable[Any]) -> Any:
    """Bind the result of an operator to the run of `origin`. Connectable observables keep their own class."""
    if type(result) is Observable:
        return _Derived(result, origin)
    if isinstance(result, list | tuple) and any(type(item) is Observable for item in result):  # for partition
        return type(result)(_keep(item, origin) for item in result)
    return result


class _Derived(RunObservable[T_co]):
    def __init__(self, observable: Observable[T_co], origin: RunObservable[Any]) -> None:
        self._observable = observable
        self._source = origin

    @property
    def _origin(self) -> RunObservable[Any]:
        return self._source

    def _subscribe_core(
        self, observer: abc.ObserverBase[T_co], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        return self._observable.subscribe(observer, scheduler=scheduler)

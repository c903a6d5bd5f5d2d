"""Observables that belong to a run: what is derived from an event keeps the run's scheduler and its guards.

Without a scheduler an operator such as `debounce` of reactivex waits on a thread of its own, and in virtual time for
ever. So `pipe`, and every operator method, which all go through `pipe`, give an observable that passes the scheduler of
the run on when somebody subscribes. Stands on reactivex; knows no port.
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
    """An observable whose subscribers get the scheduler of the run that its origin takes part in."""

    # `super().__init__()` is left out on purpose: its lock costs 105 bytes for each event and is needed by few
    # operators.

    @functools.cached_property
    def lock(self) -> threading.RLock:  # type: ignore[override]
        """Made when an operator asks for it."""
        return threading.RLock()

    @property
    def _origin(self) -> RunObservable[Any]:
        return self

    # Both are set by the runner on the event; None outside a run. `_thread` is the identity of the thread on which the
    # run decides.
    _scheduler: abc.SchedulerBase | None = None
    _thread: int | None = None
    path: Any

    def subscribe(
        self,
        on_next: Any = None,
        on_error: abc.OnError | None = None,
        on_completed: abc.OnCompleted | None = None,
        *,
        scheduler: abc.SchedulerBase | None = None,
    ) -> abc.DisposableBase:
        """Subscribe an observer or callbacks; each gets the tokens of the event from now on.

        A subscriber that raises is logged with the event's path and dropped; it never disturbs the node.

        Raises:
          UsageError: called from another thread than the run's.
        """
        origin = self._origin
        if origin._thread is not None and origin._thread != threading.get_ident():
            raise UsageError(
                f'"{origin.path}" was subscribed to from another thread than its run\'s: '
                f"subscribe before the run, or hand the call over with loop.call_soon_threadsafe"
            )
        return super().subscribe(on_next, on_error, on_completed, scheduler=scheduler or origin._scheduler)

    def pipe(self, *operators: Any) -> Any:
        """Chain reactivex operators; what comes out belongs to the same run."""
        return _keep(super().pipe(*operators), self._origin) if operators else self

    def __await__(self) -> Generator[Any, None, NoReturn]:
        raise TypeError(
            f'"{self._origin.path}" cannot be awaited: write `await run.wait_for(event)` inside `async with '
            "hfg.running(graph) as run`"
        )


def _keep(result: Any, origin: RunObservable[Any]) -> Any:
    """Bind what an operator gave to the run of `origin`; connectable observables keep their own class."""
    if type(result) is Observable:
        return _Derived(result, origin)
    if isinstance(result, list | tuple) and any(type(item) is Observable for item in result):  # partition
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

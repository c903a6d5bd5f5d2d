"""Events: asynchronous sending, at any moment of a firing or call (rules F3, F8).

Each event is a reactivex Observable of its tokens. A plain edge does not pass through reactivex: the runner puts
signals into queues itself and calls subscribers only if there are any. Depends on `base` and `observable`.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, ClassVar, Final, Generic, Self, TypeVar, overload

from reactivex import abc
from reactivex.disposable import Disposable
from typing_extensions import TypeForm

from hfg.base.logs import Log
from hfg.base.token import Token
from hfg.ports.base import Kind, Owner, Port, Source, need_sendable
from hfg.ports.observable import RunObservable
from hfg.ports.relays import InnerTarget, inner_target

__all__ = ["Event", "EventPort"]

T = TypeVar("T")

_LOGGER: Final = Log("hfg.events")


class EventPort(Port, Source[T], RunObservable[Token[T]]):
    """The event of one node."""

    kind: ClassVar[Kind] = "event"

    # Subscribers in order of subscription. None if nothing has ever subscribed; a fast path checks only that.
    _observers: list[abc.ObserverBase[Token[T]]] | None = None
    _look: Callable[[], None] | None = None  # tells the fast path that the event has an observer now
    _inner: InnerTarget[T] | None = None

    def __init__(self, node: Owner, name: str, type: Any = None) -> None:  # noqa: A002
        Port.__init__(self, node, name, type)
        self._emit: Callable[[Any, int | None, float | None], None] = self._refuse
        self._emit_wait: Callable[[Any, int | None, float | None], Awaitable[None]] = self._refuse_wait

    def trigger(
        self, value: T | Token[T] | None = None, *, activity: int | None = None, stamp: float | None = None
    ) -> None:
        """Send a signal to everything connected, at once and without waiting (rule F8).

        Args:
          value: an event may be triggered without a value (rule T2); a received token that is passed on keeps its
            modifier and its stamp.
          activity: an explicit modifier (-1, 0, +1) for active edges (rule A4): 0 holds the activity back, +1 takes
            that of an active sender; by default, rule A3 decides.
          stamp: in seconds; by default, rule T5 decides.

        Raises:
          NotRunning: the node is not part of a run.
          QueueOverflow: an edge with policy "error" is full; nothing was sent (rule P5).
          UsageError: the modifier or the stamp is invalid.
        """
        if activity is not None or stamp is not None or type(value) is Token:
            need_sendable(value, activity, stamp)
        self._emit(value, activity, stamp)

    async def trigger_wait(
        self, value: T | Token[T] | None = None, *, activity: int | None = None, stamp: float | None = None
    ) -> None:
        """Send a signal, then wait until every queue fed by this node's events has room again.

        Use it in async code that triggers in an endless loop (rule F8).
        """
        if activity is not None or stamp is not None or type(value) is Token:
            need_sendable(value, activity, stamp)
        await self._emit_wait(value, activity, stamp)

    @property
    def inner(self) -> InnerTarget[T]:
        """Its side inside a subgraph."""
        if self._inner is None:
            self._inner = inner_target(self)
        return self._inner

    def _connect(
        self,
        emit: Callable[[Any, int | None, float | None], None],
        emit_wait: Callable[[Any, int | None, float | None], Awaitable[None]],
        trigger: Callable[..., None] | None = None,
    ) -> None:
        """Send signals with these functions from now on; for the runner.

        Args:
          emit: sends a signal.
          emit_wait: sends a signal and waits for room.
          trigger: replaces the method `trigger`, which would only call `emit`.
        """
        self._emit, self._emit_wait = emit, emit_wait
        self.__dict__.pop("trigger", None)
        if trigger is not None:
            self.__dict__["trigger"] = trigger

    def _notify_on_subscription(self, look: Callable[[], None]) -> None:
        """Call this whenever the event gets an observer; for a fast path, which sends nothing to observers."""
        self._look = look

    def _disconnect(self) -> None:
        """Refuse signals again, and complete the stream of every subscriber; for the runner."""
        self._connect(self._refuse, self._refuse_wait)
        self._look = None
        self._belong_to(None, None)
        self._complete()

    def _refuse(self, value: Any, activity: int | None, stamp: float | None) -> None:
        raise self._not_running("trigger")

    async def _refuse_wait(self, value: Any, activity: int | None, stamp: float | None) -> None:
        raise self._not_running("trigger")

    def _subscribe_core(
        self, observer: abc.ObserverBase[Token[T]], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        self._observe([*(self._observers or ()), observer])
        if self._thread is None and self.graph is not None and self.graph._run is not None:
            self.graph._run._adopt(self)  # an automatic event that had no subscribers until now
        return Disposable(lambda: self._drop(observer))

    def _observe(self, observers: list[abc.ObserverBase[Token[T]]]) -> None:
        self._observers = observers
        if self._look is not None:
            self._look()

    def _drop(self, observer: abc.ObserverBase[Token[T]]) -> None:
        self._observers = [one for one in self._observers or () if one is not observer]

    def _notify(self, token: Token[T]) -> None:
        """Call every subscriber with a signal; for the runner."""
        for observer in self._observers or ():
            try:
                observer.on_next(token)
            except Exception:
                _LOGGER.exception('a subscriber of "%s" failed and was dropped', self.path, extra={"path": self.path})
                self._drop(observer)

    def _complete(self) -> None:
        """Complete the stream of every subscriber."""
        observers, self._observers = self._observers, None
        for observer in observers or ():
            try:
                observer.on_completed()
            except Exception:
                _LOGGER.exception(
                    'a subscriber of "%s" failed when the event completed', self.path, extra={"path": self.path}
                )


class Event(Generic[T]):
    """Declare an event in a class body. Without a type, its signals carry no value."""

    kind: ClassVar[Kind] = "event"

    @overload
    def __init__(self: Event[None]) -> None: ...
    @overload
    def __init__(self, type: TypeForm[T]) -> None: ...
    def __init__(self, type: Any = None) -> None:  # noqa: A002
        self.type: Any = type
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = self.name or name

    @overload
    def __get__(self, node: None, owner: Any) -> Self: ...
    @overload
    def __get__(self, node: Owner, owner: Any) -> EventPort[T]: ...
    def __get__(self, node: Any, owner: Any) -> Any:
        return self if node is None else node._port("event", self.name)

    def __repr__(self) -> str:
        return f"<Event {self.name}>"

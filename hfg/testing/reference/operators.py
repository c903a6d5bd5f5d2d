"""Reactivex operators on an edge (rule P9), in the time of the machine's owner.

Tokens are pushed in, what comes out is given on as tokens; timers of operators wait until `advance`. Depends on
reactivex and tokens.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Any

from reactivex.disposable import Disposable, SingleAssignmentDisposable
from reactivex.scheduler.scheduler import Scheduler
from reactivex.subject import Subject

from hfg.base.token import Token
from hfg.testing.reference.waiting import MOMENT_S


class _Clock(Scheduler):
    """A scheduler whose time is told to it; what is scheduled waits in a list."""

    def __init__(self) -> None:
        super().__init__()
        self.seconds = 0.0
        self._waiting: list[tuple[float, int, Any, Any, SingleAssignmentDisposable]] = []
        self._count = 0
        self._at_once: list[tuple[Any, Any, SingleAssignmentDisposable]] = []

    @property
    def now(self) -> datetime:
        """The machine's time, as reactivex wants it."""
        return self.to_datetime(self.seconds)

    def schedule(self, action: Any, state: Any = None) -> Any:
        """Do it as soon as the current work is over."""
        disposable = SingleAssignmentDisposable()
        self._at_once.append((action, state, disposable))
        return disposable

    def catch_up(self) -> None:
        """Do what is to be done at once: what comes until then would be lost on who subscribes in it (P9)."""
        while self._at_once:
            action, state, disposable = self._at_once.pop(0)
            if not disposable.is_disposed:
                disposable.disposable = action(self, state) or Disposable()

    def schedule_relative(self, duetime: Any, action: Any, state: Any = None) -> Any:
        """Do it later."""
        return self._at(self.seconds + max(0.0, self.to_seconds(duetime)), action, state)

    def schedule_absolute(self, duetime: Any, action: Any, state: Any = None) -> Any:
        """Do it at a moment."""
        return self._at(max(self.seconds, self.to_seconds(duetime)), action, state)

    def _at(self, seconds: float, action: Any, state: Any) -> Any:
        disposable = SingleAssignmentDisposable()
        self._count += 1
        self._waiting.append((seconds, self._count, action, state, disposable))
        return disposable

    def due(self) -> float | None:
        """Seconds of the next action that was not disposed of."""
        self._waiting = [entry for entry in self._waiting if not entry[4].is_disposed]
        return min((entry[0] for entry in self._waiting), default=None)

    def advance(self, seconds: float) -> None:
        """Do everything that is due until then, in order of time."""
        while (due := self.due()) is not None and due <= seconds + MOMENT_S:
            entry = min(self._waiting, key=lambda one: one[:2])
            self._waiting.remove(entry)
            self.seconds = max(self.seconds, entry[0])
            entry[4].disposable = entry[2](self, entry[3]) or Disposable()
            self.catch_up()
        self.seconds = max(self.seconds, seconds)


class Operators:
    """One edge's chain of operators; `give` gets every token that comes out."""

    def __init__(self, operators: tuple[Any, ...], give: Callable[[Token[Any]], None]) -> None:
        self._clock = _Clock()
        self._subject: Subject[Token[Any]] = Subject()
        self._give = give
        self._newest: float | None = None
        self.error: Exception | None = None
        self._operators = operators

    def connect(self) -> None:
        """Subscribe; some operators speak at once."""
        self._subject.pipe(*self._operators).subscribe(self._out, on_error=self._failed, scheduler=self._clock)
        self._clock.catch_up()

    def push(self, token: Token[Any]) -> None:
        """Put a signal in."""
        self._newest = token.stamp if self._newest is None else max(self._newest, token.stamp)
        self._subject.on_next(token)
        self._clock.catch_up()

    def complete(self) -> None:
        """Let them emit what they hold."""
        self._subject.on_completed()
        self._clock.catch_up()

    def due(self) -> float | None:
        """When something will happen by itself."""
        return self._clock.due()

    def tell_time(self, now: float) -> None:
        """Let the time be `now`, without anything happening yet."""
        self._clock.seconds = max(self._clock.seconds, now)

    def advance(self, now: float) -> None:
        """Do what is due until `now`."""
        self._clock.advance(now)

    def _out(self, value: Any) -> None:
        if type(value) is Token:
            self._give(Token(value.value, 0, value.stamp))
        else:
            self._give(Token(value, 0, self._clock.seconds if self._newest is None else self._newest))

    def _failed(self, error: Exception) -> None:
        self.error = error

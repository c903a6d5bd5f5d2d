"""Values that come later, or less often. Stands on nodetype and ports."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any, Final

from annotated_types import Ge, Gt

from hfg.base.clock import elapsed
from hfg.base.token import Token
from hfg.nodes._alarm import Alarm
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot

__all__ = ["Debounce", "Delay", "Throttle"]

_ROUNDING: Final = 1e-6
"""Of a period: a moment this close before a period is in it, for sums of floats fall short of it now and then."""


class Delay(Node):
    """Let values come later.

    By the input one value is under way at a time, and whoever sends waits; made with `concurrency=`, so many are
    (rule F14). By the slot nobody waits, every value comes later by the same time, and the order is kept; there is no
    limit to how many are under way. Stamps stay those of the values. The end waits for what is under way by the input.
    A value that has come by the slot before the node became active carries no activity.

    Attributes:
      value: anything.
      out: the same value, later.
      forward: anything, by the slot.
      forwarded: the same value, later.
      seconds: how much later; looked at when the value comes.

    CS::APEX: csapex::Delay.
    """

    value = Input(Any, optional=True)
    out = Output(Any)
    forwarded = Event(Any)
    seconds = Parameter(1.0, Ge(0), unit="s")
    under_way = State(factory=deque[tuple[float, Token[Any], bool]])
    """What has come by the slot: when it is due, and whether the node was active."""

    def setup(self) -> None:
        """Make the timer."""
        self.alarm = Alarm(self, self._ring)

    async def process(self, value: Any) -> Any:
        """Wait."""
        await asyncio.sleep(self.seconds)
        return value

    @slot
    def forward(self, value: Token[Any]) -> None:
        """Let it come later."""
        due = elapsed() + self.seconds
        if self.under_way:
            due = max(due, self.under_way[-1][0])  # the time was longer when that came
        self.under_way.append((due, value, self.active))
        if len(self.under_way) == 1:
            self.alarm.set_at(due)

    def _ring(self) -> None:
        _, token, was_active = self.under_way.popleft()
        if self.under_way:
            self.alarm.set_at(self.under_way[0][0])
        self.forwarded.trigger(token.value, activity=None if was_active else 0, stamp=token.stamp)


class Debounce(Node):
    """Tell the newest value once no other has come for some time.

    What comes sooner behind one another is dropped but for the last. A stream that never rests is never told of, but
    when it ends. The stamp is that of the value.

    Attributes:
      value: anything.
      seconds: how long it must be quiet; looked at with each value.
      settled: the last value before that.
    """

    settled = Event(Any)
    seconds = Parameter(0.1, Ge(0), unit="s")
    newest = State(factory=list[Token[Any]])

    def setup(self) -> None:
        """Make the timer."""
        self.alarm = Alarm(self, self._ring)

    @slot
    def value(self, value: Token[Any]) -> None:
        """Keep it, and wait anew."""
        self.newest = [value]
        self.alarm.set(self.seconds)

    def _ring(self) -> None:
        token = self.newest[0]
        self.settled.trigger(token.value, stamp=token.stamp)


class Throttle(Node):
    """Tell the newest value, not more often than at a rate.

    The first value is told at once and begins a grid of that rate; in each period of it the newest value is told once,
    as soon as it can be, and what comes between is dropped but for the last (rule F11). Nothing is told twice. Nobody
    waits for anybody, so a fast stream meets a slow one here; the stamp is that of the value.

    Attributes:
      value: anything.
      rate_hz: how many values a second are told at most.
      throttled: the newest value.

    CS::APEX: csapex::Throttle.
    """

    throttled = Event(Any)
    rate_hz = Parameter(10.0, Gt(0), unit="Hz")
    newest = State(factory=list[Token[Any]])
    """What was not told yet: one, or none."""
    origin = State[float | None](None)
    """When the grid began."""
    next = State(0)
    """The number of its next free period."""
    period = State(0.0)
    """Of the grid."""

    def setup(self) -> None:
        """Make the timer."""
        self.alarm = Alarm(self, self._tell)

    @slot
    def value(self, value: Token[Any]) -> None:
        """Keep it, and tell it as soon as it can be."""
        self.newest = [value]
        if self.alarm.due is not None:
            return
        now = elapsed()
        if self.origin is None or self.period != 1 / self.rate_hz:
            free = now if self.origin is None else max(now, self._due(self.next))
            self.origin, self.next, self.period = free, 0, 1 / self.rate_hz
        due = self._due(self.next)
        if due > now:
            self.alarm.set_at(due)
        else:
            self.next = max(self.next, int((now - self.origin) / self.period + _ROUNDING))
            self._tell()

    def _due(self, number: int) -> float:
        assert self.origin is not None
        return self.origin + number * self.period

    def _tell(self) -> None:
        self.next += 1
        token = self.newest.pop()
        self.throttled.trigger(token.value, stamp=token.stamp)

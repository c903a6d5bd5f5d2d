"""Values that come later, or less often. Depends on nodetype and ports."""

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

_ROUNDING: Final = 1e-6
"""Of a period: a moment this close before a period is in it, for sums of floats fall short of it now and then."""


class Delay(Node):
    """Let values come later.

    At the input, one value is in progress at a time and the sender waits, unless the node is made with `concurrency=`
    (rule F14). At the slot, the sender does not wait, every value is delayed by the same time, and the order is kept;
    the number of values in progress is unlimited. Stamps stay those of the values. The end waits for values in progress
    at the input. A value that has come by the slot before the node became active carries no activity.

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
    """Send the newest value once no other has arrived for some time.

    Of values that arrive in quicker succession, only the last is kept. A stream that never pauses is sent only when it
    ends. The stamp is that of the value.

    Attributes:
      value: anything.
      seconds: how long it must be quiet; looked at with each value.
      settled: the last value before the pause.
    """

    settled = Event(Any)
    seconds = Parameter(0.1, Ge(0), unit="s")
    newest = State(factory=list[Token[Any]])

    def setup(self) -> None:
        """Make the timer."""
        self.alarm = Alarm(self, self._ring)

    @slot
    def value(self, value: Token[Any]) -> None:
        """Keep it, and restart the wait."""
        self.newest = [value]
        self.alarm.set(self.seconds)

    def _ring(self) -> None:
        token = self.newest[0]
        self.settled.trigger(token.value, stamp=token.stamp)


class Throttle(Node):
    """Send the newest value, but not more often than at a given rate.

    The first value is sent at once and starts a grid of that rate; in each period the newest value is sent once, as
    soon as possible, and all but the last of the others are dropped (rule F11). Nothing is sent twice. The sender does
    not wait, so a fast stream can feed a slow one; the stamp is that of the value.

    Attributes:
      value: anything.
      rate_hz: maximum number of values sent per second.
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

"""Several values as one: counters, the last ones, windows. Depends on nodetype and ports."""

from __future__ import annotations

from collections import deque
from collections.abc import Sized
from typing import Any

from annotated_types import Ge, Gt

from hfg.base.token import Token
from hfg.nodes._rounding import slack_s
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State


class Count(Node):
    """Count the values of a stream.

    Silence and the end are not counted. The automatic slot `reset` begins at 0 again.

    Attributes:
      value: anything.
      count: how many there were so far, this one included.

    CS::APEX: csapex::CountMessages.
    """

    value = Input(Any)
    count = Output(int)
    total = State(0)

    def process(self, value: Any) -> int:
        """Count."""
        self.total += 1
        return self.total


class CountItems(Node):
    """Count what is in the collections of a stream.

    The automatic slot `reset` begins at 0 again.

    Attributes:
      value: a list, a dictionary or anything else that has a length.
      count: how many items there were so far in all, those of this value included.

    CS::APEX: csapex::CountMessagesInVectors.
    """

    value = Input(Sized)
    count = Output(int)
    total = State(0)

    def process(self, value: Sized) -> int:
        """Count."""
        self.total += len(value)
        return self.total


class Accumulate(Node):
    """Send the last values as a list, with each value.

    The list grows until it holds `size` values and slides then; it is a new one each time. Silence is not counted. For
    lists that are given only when they are full use `Window`.

    Attributes:
      value: anything.
      size: how many values are kept at most.
      values: the last ones, the oldest first, this one included.

    CS::APEX: csapex::AccumulateMessages.
    """

    value = Input(Any)
    values = Output(list[Any])
    size = Parameter(10, Ge(1))
    kept = State(factory=deque[Any])

    def process(self, value: Any) -> list[Any]:
        """Keep it."""
        self.kept.append(value)
        while len(self.kept) > self.size:
            self.kept.popleft()
        return list(self.kept)


class Recent(Node):
    """Send the values of the last seconds as a list, with each value.

    Seconds by the stamps of the values: what is older than this one by `seconds` or more is left out, and so it may be
    late. How many are kept depends on their rate, but not on how stamps are rounded: at 10 Hz, 0.3 s are always three
    values. Silence changes nothing.

    Attributes:
      value: anything.
      seconds: how far the list reaches back.
      values: the values of that time, in the order in which they came, this one included.
    """

    value = Input(Any)
    values = Output(list[Any])
    seconds = Parameter(1.0, Gt(0), unit="s")
    kept = State(factory=list[Token[Any]])

    def process(self, value: Token[Any]) -> list[Any]:
        """Keep it."""
        begin = value.stamp - self.seconds + slack_s(self.seconds, value.stamp)
        self.kept = [token for token in self.kept if token.stamp > begin] + [value]
        return [token.value for token in self.kept]


class Window(Node):
    """Send each window of a number of values as a list.

    Windows begin every `step` values: side by side if that is `size`, over one another if it is less; if it is more,
    what lies between them is left out. While a window fills there is silence, so that a join after it stays in step.

    Attributes:
      value: anything.
      size: how many values a window holds.
      step: number of values from the start of a window to the start of the next; 0 is `size`.
      partial: whether a window that the end cuts off is given, if it has a value that no other had.
      values: the window, the oldest first.
    """

    value = Input(Any)
    values = Output(list[Any])
    size = Parameter(10, Ge(1))
    step = Parameter(0, Ge(0))
    partial = Parameter(True)
    kept = State(factory=list[Any])
    fresh = State(0)
    """How many of those kept were in no window yet."""
    skip = State(0)
    """How many values lie before the next window."""

    def process(self, value: Any) -> list[Any] | None:
        """Keep it."""
        if self.skip:
            self.skip -= 1
            return None
        self.kept = [*self.kept, value]
        self.fresh += 1
        if len(self.kept) < self.size:
            return None
        window, step = self.kept, self.step or self.size
        self.kept, self.fresh = window[step:], 0
        self.skip = max(0, step - len(window))
        return window

    def end(self) -> None:
        """Send what is left."""
        if self.partial and self.fresh:
            self.values.send(self.kept)


class TimeWindow(Node):
    """Send each window of time as a list, as soon as it is over.

    Time is that of the stamps, so the same values make the same windows, however late or fast they come. The windows
    begin at the first stamp and then every `step_s`; one holds the stamps from its begin to before its end. It is over
    when a stamp at or after its end arrives, or the stream has ended. Windows without a value are not sent. A value
    that arrives when its windows are over is ignored. A stamp that misses a begin or an end by rounding only is at it:
    at 10 Hz, a window of 0.3 s always holds three values.

    Attributes:
      value: anything.
      seconds: how long a window is.
      step_s: seconds from the start of a window to the start of the next; 0 is `seconds`.
      window: the values of one, in the order in which they came; its stamp is that of the last one.
    """

    value = Input(Any)
    window = Event(list[Any])
    seconds = Parameter(1.0, Gt(0), unit="s")
    step_s = Parameter(0.0, Ge(0), unit="s")
    kept = State(factory=list[Token[Any]])
    first = State[float | None](None)
    """The stamp at which the first window began."""
    number = State(0)
    """Of the next window to be told."""

    def process(self, value: Token[Any]) -> None:
        """Keep it, and tell what is over."""
        if self.first is None:
            self.first = value.stamp
        self._tell(value.stamp)
        if value.stamp >= self._begin(self.number):
            self.kept = [*self.kept, value]

    def end(self) -> None:
        """Tell what is left."""
        self._tell(float("inf"))

    def _begin(self, number: int) -> float:
        return self._at(number, 0.0)

    def _end(self, number: int) -> float:
        return self._at(number, self.seconds)

    def _at(self, number: int, further_s: float) -> float:
        """Return a moment of a window; a little earlier, so that stamps which are rounded down are not before it."""
        assert self.first is not None
        step_s = self.step_s or self.seconds
        moment = self.first + (number * step_s + further_s)
        return moment - slack_s(min(step_s, self.seconds), moment)

    def _tell(self, until: float) -> None:
        while self.kept and self._end(self.number) <= until:
            begin, end = self._begin(self.number), self._end(self.number)
            inside = [token for token in self.kept if begin <= token.stamp < end]
            if inside:
                self.window.trigger([token.value for token in inside], stamp=max(token.stamp for token in inside))
            self.number += 1
            self.kept = [token for token in self.kept if token.stamp >= self._begin(self.number)]
        if not self.kept and until < float("inf"):
            self._go_to(until)

    def _go_to(self, stamp: float) -> None:
        """Skip the windows without a value that are over."""
        assert self.first is not None
        over = int((stamp - self.first - self.seconds) // (self.step_s or self.seconds))
        self.number = max(self.number, over)
        while self._end(self.number) <= stamp:
            self.number += 1

"""Values that are kept and given again. Stands on nodetype and ports."""

from __future__ import annotations

from collections import deque
from typing import Any

from annotated_types import Ge, Interval

from hfg.errors import EndOfStream
from hfg.nodetype import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot

__all__ = ["HoldableBuffer", "Latch", "TriggeredLatch"]


class Latch(Node):
    """Keep the newest value and give it again and again: a source of what came last.

    From the first value on it fires as fast as its consumers allow, or at the rate of its `max_rate_hz`, which the
    check asks for; the stamp is that of the firing. It never ends by itself: send to `close` when the values do, or
    stop the run. To give the newest value in step with another stream use `SampleAndHold`.

    Attributes:
      value: what is given from now on.
      out: the newest value.
      forget: nothing is given until the next value.
      close: ends the node.

    CS::APEX: csapex::Latch.
    """

    out = Output(Any)
    kept = State(factory=list[Any])
    is_closed = State(False)

    def ready(self) -> bool:
        """Say whether there is something to give."""
        if self.is_closed:
            raise EndOfStream
        return bool(self.kept)

    def process(self) -> Any:
        """Give it."""
        return self.kept[0]

    @slot
    def value(self, value: Any) -> None:
        """Keep it."""
        self.kept = [value]

    @slot
    def forget(self) -> None:
        """Keep nothing."""
        self.kept = []

    @slot
    def close(self) -> None:
        """End."""
        self.is_closed = True


class TriggeredLatch(Node):
    """Keep the newest value and tell it when asked to.

    Asked before the first value, it tells nothing. The signal has the stamp of the one that asked.

    Attributes:
      value: what is told from now on.
      publish: asks for it.
      published: the newest value.
      forget: nothing is told until the next value.

    CS::APEX: csapex::TriggeredLatch.
    """

    published = Event(Any)
    kept = State(factory=list[Any])

    @slot
    def value(self, value: Any) -> None:
        """Keep it."""
        self.kept = [value]

    @slot
    def publish(self) -> None:
        """Tell it."""
        if self.kept:
            self.published.trigger(self.kept[0])

    @slot
    def forget(self) -> None:
        """Keep nothing."""
        self.kept = []


class HoldableBuffer(Node):
    """Keep the last values and pass one of them on; on hold the buffer stays as it is.

    Each value is one firing, on hold too: what arrives then is dropped, and asks for the chosen value again. While
    fewer values were kept than `index` asks for there is silence.

    Attributes:
      value: anything.
      size: how many values are kept.
      hold: whether the buffer stays as it is.
      index: which value is passed on: 0 is the newest, 1 the one before it.
      out: the chosen value.

    CS::APEX: csapex::HoldableBuffer.
    """

    value = Input(Any)
    out = Output(Any)
    size = Parameter(10, Interval(ge=1, le=10_000))
    hold = Parameter(False)
    index = Parameter(0, Ge(0))
    kept = State(factory=deque[Any])

    def process(self, value: Any) -> Any:
        """Keep it, or not; choose."""
        if not self.hold:
            self.kept.append(value)
            while len(self.kept) > self.size:
                self.kept.popleft()
        return self.kept[-1 - self.index] if self.index < len(self.kept) else None

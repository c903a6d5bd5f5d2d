"""What belongs together: by step, by stamp, or the newest of each. Depends on nodetype and ports."""

from __future__ import annotations

from bisect import insort
from typing import Any

from annotated_types import Ge

from hfg.base.token import NO_MESSAGE, Token
from hfg.nodes._rounding import slack_s
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Inputs, Output, Outputs, Parameter, Slots, State, slot


class Join(Node):
    """Let several streams continue together: a barrier.

    Fires when each input holds a token, and passes each value on by the output of the same number. Where one is silent
    all are, and all end with the first that does.

    Attributes:
      values: the streams.
      joined: each stream again, in step with the others.

    CS::APEX: csapex::Join.
    """

    values = Inputs(Any, 2)
    joined = Outputs(Any, "values")

    def process(self, values: list[Any]) -> list[Any]:
        """Pass all on."""
        return values


class Synchronizer(Node):
    """Hold several streams in step by joining them, and do nothing else.

    A producer cannot run ahead of the others by more than what the edges hold. Silence is taken like a value; a stream
    that has ended is no longer waited for.

    Attributes:
      values: the streams; all optional, and waited for if connected.

    CS::APEX: csapex::Synchronizer.
    """

    values = Inputs(Any, 2, optional=True, default=NO_MESSAGE)

    def process(self, values: list[Any]) -> None:
        """Take them."""


class SampleAndHold(Node):
    """Keep the newest value of one stream and repeat it in step with another, to combine streams of different rates.

    `value` is a slot, so neither stream waits for the other; `tick` decides when the value is sent. Connect
    `fast.out.sent` with overflow="latest" where the fast stream must not wait even for its turn on the loop. There is
    silence before the first value and, with `fresh`, at each tick without a new value. The node ends with `tick`; when
    the stream of `value` has ended, its last value stays.

    Attributes:
      tick: each value here asks for one; the value itself is not looked at.
      value: what is kept, the newest.
      fresh: whether a value is given once only.
      held: the newest value, at each tick.
      age: how old it is, in seconds: the time from its stamp to that of the tick.
      forget: nothing is kept any more, as before the first value.
    """

    tick = Input(Any)
    held = Output(Any)
    age = Output(float)
    fresh = Parameter(False)
    kept = State(factory=list[Token[Any]])

    def process(self, tick: Token[Any]) -> None:
        """Send what is kept."""
        if self.kept:
            newest = self.kept[0]
            self.held.send(newest.value)
            self.age.send(tick.stamp - newest.stamp)
            if self.fresh:
                self.kept = []

    @slot
    def value(self, value: Token[Any]) -> None:
        """Keep it."""
        self.kept = [value]

    @slot
    def forget(self) -> None:
        """Keep nothing."""
        self.kept = []


class CombineLatest(Node):
    """Send the newest value of several streams whenever one of them has a new one.

    The streams need not be in step nor of one rate. Nothing is sent before each has had a value. Silence and ends are
    ignored: the last value of an ended stream stays.

    Attributes:
      values: one slot for each stream.
      combined: a list with the newest value of each, in order.
    """

    combined = Event(list[Any])
    newest = State(factory=dict[int, Any])

    @Slots(Any, 2)
    def values(self, number: int, value: Any) -> None:
        """Keep it, and tell all."""
        self.newest[number] = value
        if len(self.newest) == len(self.values):
            self.combined.trigger([self.newest[one] for one in range(len(self.newest))])


class JoinByStamp(Node):
    """Join what was measured at about the same moment, whatever its rate and however late it comes.

    Each stream waits in order of its stamps. As soon as every stream has one, values that are older than the newest of
    the first ones by more than the tolerance are dropped, because that one's stream has no partner for them. The values
    that are then first lie within the tolerance and are joined. Which of several partners within the tolerance is
    taken: the oldest. The result depends only on values and stamps, not on the order in which the streams arrive, as
    long as each by itself is in order and none is longer than `size`.

    Attributes:
      values: one slot for each stream.
      tolerance_s: maximum difference between the stamps of joined values, in seconds.
      size: how many values of a stream wait at most; then the oldest is dropped.
      joined: a list with one value of each stream, in order; its stamp is the newest of theirs.
      unmatched: each value that was dropped without a partner, with its own stamp.
    """

    tolerance_s = Parameter(0.02, Ge(0), unit="s")
    size = Parameter(100, Ge(1))
    joined = Event(list[Any])
    unmatched = Event(Any)
    waiting = State(factory=dict[int, list[Token[Any]]])

    @Slots(Any, 2)
    def values(self, number: int, value: Token[Any]) -> None:
        """Let it wait, and join what can be."""
        own = self.waiting.setdefault(number, [])
        insort(own, value, key=lambda token: token.stamp)
        while len(self.waiting) == len(self.values) and all(self.waiting.values()):
            self._join_or_drop()
        while len(own) > self.size:
            self._drop(own)

    def _join_or_drop(self) -> None:
        streams = [self.waiting[number] for number in range(len(self.waiting))]
        newest = max(stream[0].stamp for stream in streams)
        most = self.tolerance_s + slack_s(self.tolerance_s, newest)  # so much at most, whatever is rounded
        late = [stream for stream in streams if newest - stream[0].stamp > most]
        for stream in late:
            self._drop(stream)
        if not late:
            parts = [stream.pop(0) for stream in streams]
            self.joined.trigger([part.value for part in parts], stamp=newest)

    def _drop(self, stream: list[Token[Any]]) -> None:
        token = stream.pop(0)
        self.unmatched.trigger(token.value, stamp=token.stamp)

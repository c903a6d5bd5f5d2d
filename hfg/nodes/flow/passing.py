"""One stream in, one out: all of it, a part of it, or as events. Depends on nodetype, functions and ports."""

from __future__ import annotations

import signal
from typing import Any, Literal, TypeVar

from annotated_types import Ge

from hfg.base.token import NO_MESSAGE
from hfg.errors import EndOfStream
from hfg.nodes._equality import same
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot

T = TypeVar("T")


@node
def relay(value: T) -> T:
    """Pass every value on as it is.

    Silence stays silence, and the end of the input is the end. The value is passed on, not its token: activity that
    arrives makes the relay active, and leaves it with this value if an active edge leads on.

    Args:
      value: anything.

    CS::APEX: csapex::Relay.
    """
    return value


class Take(Node):
    """Pass the first values on, then end, although the input continues.

    Silence is not counted. With the last value the node ends as if its input had ended, and a source that works only
    for it is stopped.

    Attributes:
      value: anything.
      count: how many values are passed on; with 0 the node ends at the first value and passes none on.
      out: the first values.
    """

    value = Input(Any)
    out = Output(Any)
    count = Parameter(1, Ge(0))
    taken = State(0)

    def process(self, value: Any) -> None:
        """Count."""
        if self.taken < self.count:
            self.out.send(value)
            self.taken += 1
        if self.taken >= self.count:
            raise EndOfStream


class Skip(Node):
    """Leave the first values out, then pass all others on.

    Each value that is left out is replaced by silence, so that a join after it stays in step. Silence is not counted.

    Attributes:
      value: anything.
      count: how many values are left out.
      out: all values but the first ones.
    """

    value = Input(Any)
    out = Output(Any)
    count = Parameter(1, Ge(0))
    skipped = State(0)

    def process(self, value: Any) -> Any:
        """Count."""
        if self.skipped < self.count:
            self.skipped += 1
            return None
        return value


class TakeWhile(Node):
    """Pass values on as long as a condition holds, then end.

    The first value whose condition is false is not passed on: with it the node ends as if its inputs had ended. Where
    one of the two is silent so is the output, and nothing is decided.

    Attributes:
      value: anything.
      condition: whether this value is passed on; a comparison of the same value, for example.
      out: the values before the condition became false.
    """

    value = Input(Any)
    condition = Input(bool)
    out = Output(Any)

    def process(self, value: Any, condition: bool) -> Any:
        """Look at the condition."""
        if not condition:
            raise EndOfStream
        return value


class EveryNth(Node):
    """Pass every nth value on.

    The others are replaced by silence, so that a join after it stays in step. Silence is not counted.

    Attributes:
      value: anything.
      n: one of n values is passed on.
      offset: how many values are left out before the first one that is passed on.
      out: one value of n.
    """

    value = Input(Any)
    out = Output(Any)
    n = Parameter(2, Ge(1))
    offset = Parameter(0, Ge(0))
    seen = State(0)

    def process(self, value: Any) -> Any:
        """Count."""
        place = self.seen - self.offset
        self.seen += 1
        return value if place >= 0 and place % self.n == 0 else None


class Different(Node):
    """Pass a value on if it differs from the one before.

    The first value is passed on. Values that are the same are replaced by silence, so that a join after it stays in
    step. Arrays are the same if their shapes and all elements are; what cannot be compared is different.
    `logic.Changed` tells of changes by an event.

    Attributes:
      value: anything.
      out: values that differ from those before them.
    """

    value = Input(Any)
    out = Output(Any)
    last = State(factory=list[Any])

    def process(self, value: Any) -> Any:
        """Compare with the value before."""
        if self.last and same(self.last[0], value):
            return None
        self.last = [value]
        return value


class Distinct(Node):
    """Pass a value on if it was not seen before.

    Values that were seen are replaced by silence, so that a join after it stays in step. Up to a number of values are
    remembered; then those seen longest ago are forgotten.

    Attributes:
      value: anything that can be a key of a dictionary.
      remember: how many different values are kept.
      out: the values that are new.

    Raises:
      TypeError: the value cannot be hashed, as a list or an array.
    """

    value = Input(Any)
    out = Output(Any)
    remember = Parameter(10_000, Ge(1))
    seen = State(factory=dict[Any, None])

    def process(self, value: Any) -> Any:
        """Look it up."""
        try:
            known = value in self.seen
        except TypeError:
            raise TypeError(
                f"Distinct keeps what it has seen as keys of a dictionary, which a {type(value).__name__} cannot be: "
                "send something that identifies the value, or use Different"
            ) from None
        self.seen.pop(value, None)
        self.seen[value] = None  # the youngest key is the last
        while len(self.seen) > self.remember:
            del self.seen[next(iter(self.seen))]
        return None if known else value


class MessageEvent(Node):
    """Signal each value that arrives: data becomes an event.

    An edge from an output to a slot, or from an output's event `sent`, does the same without a node. It is the buffer
    v_b of the paper's figure 13: while it is active its next signal takes the activity along; `activity.WaitForMessage`
    is that with a slot for the activity to arrive at. Silence and the end signal nothing.

    Attributes:
      value: anything.
      received: the same value as a signal.

    CS::APEX: csapex::MessageEvent.
    """

    value = Input(Any)
    received = Event(Any)

    def process(self, value: Any) -> None:
        """Signal it."""
        self.received.trigger(value)


class AtEnd(Node):
    """Signal that a stream has ended.

    Connected to `graph.stop` it ends the run with the stream, whatever else is still running. Values are passed on, so
    that it can stand in a chain; an end that never comes, of a source without one, signals nothing.

    Attributes:
      value: anything.
      out: the same values.
      ended: the end has come; how many values there were.

    CS::APEX: csapex::Shutdown.
    """

    value = Input(Any)
    out = Output(Any)
    ended = Event(int)
    seen = State(0)

    def process(self, value: Any) -> Any:
        """Count."""
        self.seen += 1
        return value

    def end(self) -> None:
        """Tell it."""
        self.ended.trigger(self.seen)


class MarkerDetector(Node):
    """Signal the silence of one stream relative to another, and its end.

    Silence reaches no code by itself (rule F4): `reference` is what shows it, a stream in step with the other one, such
    as the values before a filter whose result is looked at. Each of its values for which the other stream is silent, or
    has ended, is signalled. Where `reference` is silent nothing is decided.

    Attributes:
      reference: a stream in step with `value`, from which the fork began.
      value: what is looked at.
      silent: the value of `reference` for which there was none.
      ended: both streams have ended, or `reference` has.

    CS::APEX: csapex::MarkerMessageDetector.
    """

    reference = Input(Any)
    value = Input(Any, optional=True, default=NO_MESSAGE)
    silent = Event(Any)
    ended = Event()

    def process(self, reference: Any, value: Any) -> None:
        """Look whether there is a value."""
        if value is NO_MESSAGE:
            self.silent.trigger(reference)

    def end(self) -> None:
        """Tell it."""
        self.ended.trigger()


class ProcessSignal(Node):
    """Raise a signal of the operating system in this process, for tests of what follows.

    SIGINT and SIGTERM end a run as Ctrl-C does; the others do what the program or the system does with them. Each value
    and each call of the slot raises one.

    Attributes:
      value: anything; raises the signal.
      signal: its name.
      emit: raises the signal.

    Raises:
      ValueError: the operating system does not have this signal.

    CS::APEX: csapex::UnixSignalEmitter.
    """

    value = Input(Any, optional=True)
    signal = Parameter[Literal["SIGWINCH", "SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2"]](
        "SIGWINCH", choices=("SIGWINCH", "SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2")
    )

    def process(self, value: Any) -> None:
        """Raise it."""
        self._emit_signal()

    @slot
    def emit(self) -> None:
        """Raise it."""
        self._emit_signal()

    def _emit_signal(self) -> None:
        number = getattr(signal, self.signal, None)
        if number is None:
            raise ValueError(f"this operating system has no signal {self.signal}")
        signal.raise_signal(number)

"""Truth values: operations on them, comparisons that give them, and events that they turn into and come from.

Depends on nodetype, functions and ports.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Final, Literal, TypeVar

from annotated_types import Interval, Unit

from hfg.nodes._equality import same
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Inputs, Output, Parameter, Slots, State, slot

__all__ = [
    "BooleanTrigger",
    "Changed",
    "Edges",
    "EventAnd",
    "FlipFlop",
    "Hysteresis",
    "Stable",
    "Toggle",
    "TriggerIfEqual",
    "at_least",
    "boolean",
    "choose",
    "compare",
    "equal",
    "in_range",
    "logical_and",
    "logical_nand",
    "logical_nor",
    "logical_not",
    "logical_or",
    "logical_xor",
    "threshold",
]

T = TypeVar("T")


# --- operations ---


@node(inputs={"values": Inputs(bool, 2)}, outputs=bool)
def logical_and(*values: bool) -> bool:
    """Return true if all values are true.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of truth values.

    CS::APEX: csapex::boolean::AND.
    """
    return all(values)


@node(inputs={"values": Inputs(bool, 2)}, outputs=bool)
def logical_or(*values: bool) -> bool:
    """Return true if at least one value is true.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of truth values.
    """
    return any(values)


@node(inputs={"values": Inputs(bool, 2)}, outputs=bool)
def logical_xor(*values: bool) -> bool:
    """Return true if an odd number of values is true; of two, if they differ.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of truth values.
    """
    return sum(values) % 2 == 1


@node(inputs={"values": Inputs(bool, 2)}, outputs=bool)
def logical_nand(*values: bool) -> bool:
    """Return true unless all values are true.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of truth values.

    CS::APEX: csapex::boolean::NAND.
    """
    return not all(values)


@node(inputs={"values": Inputs(bool, 2)}, outputs=bool)
def logical_nor(*values: bool) -> bool:
    """Return true if no value is true.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of truth values.
    """
    return not any(values)


@node
def logical_not(value: bool) -> bool:
    """Return the opposite.

    Args:
      value: a truth value.
    """
    return not value


_BOOLEAN: Final[dict[str, Callable[[bool, bool], bool]]] = {
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "xor": lambda a, b: a != b,
    "nand": lambda a, b: not (a and b),
    "nor": lambda a, b: not (a or b),
    "xnor": lambda a, b: a == b,
    "implies": lambda a, b: not a or b,
}


@node
def boolean(
    a: bool, b: bool, *, operation: Literal["and", "or", "xor", "nand", "nor", "xnor", "implies"] = "and"
) -> bool:
    """Combine two truth values by an operation that may be changed while the graph runs.

    Args:
      a: the first truth value.
      b: the second one.
      operation: "and", "or", "xor" (they differ), "nand", "nor", "xnor" (they are the same), or "implies" (b is true
        wherever a is).

    CS::APEX: csapex::BinaryBoolean.
    """
    return _BOOLEAN[operation](a, b)


@node(inputs={"values": Inputs(bool, 3)}, outputs=bool, parameters={"count": Parameter(2, Interval(ge=0))})
def at_least(*values: bool, count: int) -> bool:
    """Return true if at least `count` values are true, as when sensors vote.

    Fires once all inputs hold a token; silence at one of them is silence, and the end of one is the end.

    Args:
      values: any number of truth values.
      count: how many must be true; more than there are inputs is never reached.
    """
    return sum(values) >= count


@node
def choose(condition: bool, if_true: T, if_false: T) -> T:
    """Return one of two values.

    Both values are taken in each firing, the other one is dropped; `hfg.nodes.flow` has a multiplexer that does not
    wait for what is not chosen.

    Args:
      condition: which value is given.
      if_true: what is given if the condition is true.
      if_false: what is given if it is not.
    """
    return if_true if condition else if_false


# --- comparisons ---


def _compare(a: float, b: float, operation: str, tolerance: float) -> bool:
    """Compare so that "<" is never true together with "==", and "<=" is "<" or "==", whatever the tolerance."""
    same = a == b or (tolerance > 0 and abs(a - b) <= tolerance)
    match operation:
        case "==":
            return same
        case "!=":
            return not same
        case "<":
            return a < b and not same
        case "<=":
            return a < b or same
        case ">":
            return a > b and not same
        case _:
            return a > b or same


@node
def compare(
    a: float,
    b: float,
    *,
    operation: Literal["==", "!=", "<", "<=", ">", ">="] = "==",
    tolerance: Annotated[float, Interval(ge=0), Unit("of the value")] = 0.0,
) -> bool:
    """Compare two numbers.

    With a tolerance, numbers that differ by no more count as equal: "==", "<=" and ">=" are then true of them, "!=",
    "<" and ">" are not. A NaN is equal to nothing, and neither smaller nor larger.

    Args:
      a: the first number.
      b: the second one, of the same unit.
      operation: what must hold between a and b.
      tolerance: by how much equal numbers may differ, in the unit of the numbers.

    Raises:
      OverflowError: with a tolerance, one is a whole number too large for a float and the other a float.

    CS::APEX: csapex::CompareInteger.
    """
    return _compare(a, b, operation, tolerance)


@node
def equal(a: object, b: object) -> bool:
    """Say whether two values of any type are equal, as Python's `==` does.

    Arrays are equal if they have the same shape and elements. Values that cannot be compared are not equal.

    Args:
      a: the first value.
      b: the second one.
    """
    return same(a, b)


@node
def threshold(value: float, *, threshold: Annotated[float, Unit("of the value")] = 0.5) -> bool:
    """Say whether a number is larger than a threshold.

    The threshold itself is not larger, and a NaN never is. A value that trembles around it makes a result that
    trembles too: then use Hysteresis.

    Args:
      value: a number.
      threshold: in the unit of the value.

    CS::APEX: csapex::Threshold.
    """
    return value > threshold


@node
def in_range(
    value: float,
    *,
    lower: Annotated[float, Unit("of the value")] = 0.0,
    upper: Annotated[float, Unit("of the value")] = 1.0,
    closed: Literal["both", "lower", "upper", "neither"] = "both",
) -> bool:
    """Say whether a number lies between two limits.

    If the lower limit is above the upper one nothing does; a NaN never does.

    Args:
      value: a number.
      lower: the lower limit, in the unit of the value.
      upper: the upper limit.
      closed: which of the limits belong to the range.
    """
    above = value >= lower if closed in ("both", "lower") else value > lower
    below = value <= upper if closed in ("both", "upper") else value < upper
    return above and below


class Hysteresis(Node):
    """Say whether a number is high, without trembling: it becomes high at one limit and low again at a lower one.

    Between the limits the answer stays what it was; before the first value that is at or beyond a limit it is
    `initially`. The signals come with the value that changed the answer.

    Attributes:
      value: a number; a NaN changes nothing.
      low: at or below this the answer becomes false, in the unit of the value.
      high: at or above this it becomes true.
      initially: the answer before any limit was reached.
      is_high: the answer, with each value.
      rose: the value with which the answer became true.
      fell: the value with which it became false.

    Raises:
      ValueError: the low limit is above the high one.
    """

    value = Input(float)
    is_high = Output(bool)
    rose = Event(float)
    fell = Event(float)
    low = Parameter(0.4, unit="of the value")
    high = Parameter(0.6, unit="of the value")
    initially = Parameter(False)
    answer = State[bool | None](None)

    def process(self, value: float) -> bool:
        """Return the answer."""
        if self.low > self.high:
            raise ValueError(f"the low limit {self.low} is above the high one {self.high}: exchange them")
        before = self.initially if self.answer is None else self.answer
        # With both limits the same a value on them is high, as it is for a threshold that is reached.
        now = True if value >= self.high else False if value <= self.low else before
        self.answer = now
        if now != before:
            (self.rose if now else self.fell).trigger(value)
        return now


# --- truth values become events ---


class BooleanTrigger(Node):
    """Turn truth values into signals: one event for true, another for false.

    Each value triggers exactly one of the two, even if it is the same as before; see Edges for changes.

    Attributes:
      value: a truth value.
      true: triggered by each true value.
      false: triggered by each false value.

    CS::APEX: csapex::BooleanTrigger, csapex::RosMessageBool2Event.
    """

    value = Input(bool)
    true = Event(None)
    false = Event(None)

    def process(self, value: bool) -> None:
        """Trigger one of the events."""
        (self.true if value else self.false).trigger()


class TriggerIfEqual(Node):
    """Compare each value with a fixed one, and signal which it is.

    Attributes:
      value: a value of any type that can be compared.
      wanted: what it is compared with, as Python's `==` does.
      equal: the value, if it is equal.
      unequal: the value, if it is not.

    CS::APEX: csapex::TiggerIfIntEqual.
    """

    value = Input(object)
    equal = Event(object)
    unequal = Event(object)
    wanted = Parameter(0, type=Any)

    def process(self, value: object) -> None:
        """Trigger one of the events."""
        (self.equal if same(value, self.wanted) else self.unequal).trigger(value)


class Edges(Node):
    """Signal the changes of a truth value.

    The first value changes nothing unless `initially` says the previous value it. Silence is not a change.

    Attributes:
      value: a truth value.
      initially: the previous value the first value: "true", "false", or "unknown", which no value differs from.
      rising: a false value was followed by a true one.
      falling: a true value was followed by a false one.
      changed: the new value, with both.

    CS::APEX: csapex::RosMessageBool2Event.
    """

    value = Input(bool)
    rising = Event(None)
    falling = Event(None)
    changed = Event(bool)
    initially = Parameter[Literal["unknown", "false", "true"]]("unknown", choices=("unknown", "false", "true"))
    last = State[bool | None](None)

    def process(self, value: bool) -> None:
        """Compare with the value before."""
        before = {"unknown": value, "false": False, "true": True}[self.initially] if self.last is None else self.last
        self.last = value
        if value != before:
            (self.rising if value else self.falling).trigger()
            self.changed.trigger(value)


class Changed(Node):
    """Signal each value that differs from the one before.

    Attributes:
      value: a value of any type that can be compared.
      first: whether the first value counts as a change.
      changed: the new value.

    CS::APEX: csapex::RosMessageInt2Event.
    """

    value = Input(object)
    changed = Event(object)
    first = Parameter(True)
    last = State(factory=list[object])

    def process(self, value: object) -> None:
        """Compare with the value before."""
        differs = not same(self.last[0], value) if self.last else self.first
        self.last = [value]
        if differs:
            self.changed.trigger(value)


class Stable(Node):
    """Pass on a truth value once it was the same several times in a row.

    Until then the last stable value is given, and nothing before the first one.

    Attributes:
      value: a truth value.
      count: how many equal values in a row are believed.
      stable: the last value that was stable.
    """

    value = Input(bool)
    stable = Output(bool)
    count = Parameter(3, Interval(ge=1))
    believed = State[bool | None](None)
    last = State[bool | None](None)
    times = State(0)

    def process(self, value: bool) -> bool | None:
        """Count how often it came."""
        self.times = self.times + 1 if value == self.last else 1
        self.last = value
        if self.times >= self.count:
            self.believed = value
        return self.believed


# --- events become truth values ---


class Toggle(Node):
    """Generate a truth value that is switched while the graph runs; a source.

    It gives its value as often as its consumers and `max_rate_hz` allow, and does not end. A switch takes effect with
    the next value; `changed` tells of it at once. See FlipFlop for a switch that is not a source.

    Attributes:
      signal: the value.
      value: what is given now; setting it is a switch too, told of with the next value.
      toggle: gives the opposite from now on.
      turn_on: gives true from now on.
      turn_off: gives false from now on.
      changed: the new value.

    CS::APEX: csapex::boolean::Toggle.
    """

    signal = Output(bool)
    changed = Event(bool)
    value = Parameter(False)
    told = State[bool | None](None)

    def process(self) -> bool:
        """Return the value."""
        self._tell(self.value)
        return self.value

    @slot
    def toggle(self) -> None:
        """Switch over."""
        self._switch(not self.value)

    @slot
    def turn_on(self) -> None:
        """Switch on."""
        self._switch(True)

    @slot
    def turn_off(self) -> None:
        """Switch off."""
        self._switch(False)

    def _switch(self, value: bool) -> None:
        if self.told is None:
            self.told = self.value
        self.value = value
        self._tell(value)

    def _tell(self, value: bool) -> None:
        before, self.told = self.told, value
        if before is not None and before != value:
            self.changed.trigger(value)


class FlipFlop(Node):
    """Remember a truth value that events set, and say it when asked.

    It lives by its slots; with an edge into `ask` each token there is answered by the value of that moment.

    Attributes:
      ask: a token of any type is answered; may be left unconnected.
      initially: the value before anything was set.
      set: makes it true.
      clear: makes it false.
      toggle: makes it the opposite.
      answer: the value, for each token at `ask`.
      changed: the new value, when a slot changed it.
    """

    ask = Input(object, optional=True)
    answer = Output(bool)
    changed = Event(bool)
    initially = Parameter(False)
    value = State[bool | None](None)

    def process(self, ask: object) -> bool:
        """Return the value."""
        return self._now()

    @slot
    def set(self) -> None:
        """Make it true."""
        self._become(True)

    @slot
    def clear(self) -> None:
        """Make it false."""
        self._become(False)

    @slot
    def toggle(self) -> None:
        """Make it the opposite."""
        self._become(not self._now())

    def _now(self) -> bool:
        return self.initially if self.value is None else self.value

    def _become(self, value: bool) -> None:
        before, self.value = self._now(), value
        if value != before:
            self.changed.trigger(value)


class EventAnd(Node):
    """Signal when each of several events has happened at least once, in any order; then wait for all of them again.

    Attributes:
      event: what must happen, one slot for each; several of one count once.
      all: all of them have happened.
      forget: starts over.

    CS::APEX: csapex::EventAND.
    """

    all = Event(None)
    happened = State(factory=set[int])

    @Slots(object, 2)
    def event(self, number: int) -> None:
        """Note that it happened."""
        self.happened.add(number)
        if len(self.happened) == len(self.event):
            self.happened = set()
            self.all.trigger()

    @slot
    def forget(self) -> None:
        """Start over."""
        self.happened = set()

"""Several ways: many streams into one, one into many, and doors. Depends on nodetype, functions and ports."""

from __future__ import annotations

from typing import Any, TypeVar

from hfg.base.token import NO_MESSAGE
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Inputs, Output, Outputs, Parameter, Slots, slot

T = TypeVar("T")


class Merge(Node):
    """Bring several streams into one, each value as it comes.

    The streams need not be in step nor of one rate: no stream waits for another, and nothing is lost. The order of
    values that arrive at the same moment depends on the run. Silence and ends are ignored; a consumer that is fed by
    the event ends when the whole graph has nothing left to do (rule F13). For branches that are in step, such as those
    of `switch`, use `Rejoin`.

    Attributes:
      values: one slot for each stream; each may take several edges.
      merged: every value of every stream.
    """

    merged = Event(Any)

    @Slots(Any, 2)
    def values(self, number: int, value: Any) -> None:
        """Signal it."""
        self.merged.trigger(value)


class Mux(Node):
    """Pass on the value of one of several inputs, the selected one.

    Each firing takes a token from every connected input; the values that are not selected are dropped. Silence at the
    selected input, or at `select`, is silence. An input that has ended is silent from then on; the node ends with
    `select`. Where nothing is selected because only one input has a value at a time, use `Rejoin`.

    Attributes:
      values: the inputs; all optional, and waited for if connected.
      select: the number of the input, from 0.
      out: the selected value.

    Raises:
      IndexError: there is no input of the selected number.

    CS::APEX: csapex::Mux.
    """

    values = Inputs(Any, 2, optional=True, default=NO_MESSAGE)
    select = Input(int)
    out = Output(Any)

    def process(self, values: list[Any], select: int) -> Any:
        """Choose."""
        _need_number(select, len(values), "Mux", "values")
        return None if values[select] is NO_MESSAGE else values[select]


class Rejoin(Node):
    """Make one stream of branches that are in step and of which one at a time has a value.

    Such as the two ways of `switch`, or those of `Demux`: the order is kept. Where all are silent so is the output. A
    branch that has ended is silent from then on; the node ends when all have. For streams that are not in step use
    `Merge`.

    Attributes:
      values: the branches; all optional, and waited for if connected.
      out: the only value.

    Raises:
      ValueError: several branches have a value at once.

    CS::APEX: csapex::Mux.
    """

    values = Inputs(Any, 2, optional=True, default=NO_MESSAGE)
    out = Output(Any)

    def process(self, values: list[Any]) -> Any:
        """Find it."""
        found = [number for number, value in enumerate(values) if value is not NO_MESSAGE]
        if len(found) > 1:
            raise ValueError(
                f"Rejoin has a value at the inputs {', '.join(map(str, found))} at once, and nothing says which one "
                "goes on: select one with Mux, or keep all with Merge"
            )
        return values[found[0]]


class Demux(Node):
    """Pass a value on by one of several outputs.

    At the other outputs there is silence, so that what is after them stays in step.

    Attributes:
      value: anything.
      select: the number of the output, from 0.
      outputs: one of them gives the value.

    Raises:
      IndexError: there is no output of the selected number.

    CS::APEX: csapex::Demux.
    """

    value = Input(Any)
    select = Input(int)
    outputs = Outputs(Any, 2)

    def process(self, value: Any, select: int) -> None:
        """Choose."""
        _need_number(select, len(self.outputs), "Demux", "outputs")
        self.outputs[select].send(value)


def _need_number(number: int, count: int, who: str, vector: str) -> None:
    if number < 0:
        raise IndexError(f"{who} counts its {vector} from 0, got select={number}")
    if number >= count:
        raise IndexError(
            f"{who} has {vector} from 0 to {count - 1}, got select={number}; make it with more, as in "
            f"{who}({vector}={number + 1})"
        )


@node(outputs={"true": Any, "false": Any})
def switch(value: T, *, predicate: bool = True) -> tuple[T | None, T | None]:
    """Pass a value on by one of two outputs.

    `predicate` is a parameter, so it can be set by hand or by an edge: an edge from an output takes part in the join
    and decides for each value, one from an event sets it between firings (rule P8). At the other output there is
    silence, so that both ways stay in step; `Rejoin` makes one stream of them again.

    Args:
      value: anything.
      predicate: whether the value goes by `true`.
      true: the value, if the predicate is true.
      false: the value, if it is not.

    CS::APEX: csapex::Switch.
    """
    return (value, None) if predicate else (None, value)


class Gate(Node):
    """Pass values on while the gate is open.

    While it is closed there is silence, so that a join after it stays in step. Values that arrive while it is closed
    are dropped. `activity.ActivityGate` is open while it is active.

    Attributes:
      value: anything.
      is_open: whether values pass; also set by the slots.
      out: the values that pass.
      open: opens it.
      close: closes it.
    """

    value = Input(Any)
    out = Output(Any)
    is_open = Parameter(True)

    def process(self, value: Any) -> Any:
        """Look at the gate."""
        return value if self.is_open else None

    @slot
    def open(self) -> None:
        """Let values pass."""
        self.is_open = True

    @slot
    def close(self) -> None:
        """Let none pass."""
        self.is_open = False

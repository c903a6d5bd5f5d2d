"""Values for people to read: on the terminal, in the log, as tables and lights.

Depends on nodetype, functions and ports.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Final, Literal, TypeAlias

from annotated_types import Interval, MaxLen, Predicate

from hfg.base.clock import now
from hfg.base.logs import log
from hfg.nodes._printing import print_line
from hfg.nodes.values.text import format_safely, is_a_format
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Parameter, State, slot

Level: TypeAlias = Literal["debug", "info", "warning", "error"]

_LEVELS: Final[dict[str, int]] = {
    "debug": logging.DEBUG,
    "info": logging.INFO,
    "warning": logging.WARNING,
    "error": logging.ERROR,
}


class TextDisplay(Node):
    """Show values as text, on the terminal or in the log, not more often than a person can read.

    Values come in step with a stream by the input, or at any time by the slot. With a limit of the rate, the newest
    value is shown when its turn comes, and the last one when the input ends; the text is followed by the number of
    values that were not shown.

    Attributes:
      value: anything.
      show: shows a value that comes by itself.
      format: the text, with {} for the value, {path} for the node's path and {time} for the seconds of the run's clock.
      to: "output" and "error" are the streams of the program, "log" is the node's log.
      level: of the log.
      most_per_s: maximum number of values shown per second; 0 shows all.
      longest: how many characters of a text are shown.
      shown: the text, when it is shown.

    Raises:
      ValueError: the value cannot be written in that format, or the format wants another one.
      OSError: whoever read the program's output has gone.

    CS::APEX: csapex::TextDisplay.
    """

    value = Input(object, optional=True)
    format = Parameter("{path}: {}", Predicate(is_a_format), MaxLen(10_000))
    to = Parameter("output", choices=("output", "error", "log"))
    level = Parameter("info", choices=tuple(_LEVELS))
    most_per_s = Parameter(0.0, Interval(ge=0), unit="1/s")
    longest = Parameter(1000, Interval(ge=1))
    shown = Event(str)
    due = State(-math.inf)
    waiting = State(factory=list[object])
    left_out = State(0)

    def process(self, value: object) -> None:
        """Show it, or keep it."""
        self._offer(value)

    @slot
    def show(self, value: object) -> None:
        """Show it, or keep it."""
        self._offer(value)

    def end(self) -> None:
        """Show the last one."""
        if self.waiting:
            self.left_out -= 1
            self._show(self.waiting[0])

    def _offer(self, value: object) -> None:
        if self.most_per_s and now() < self.due:
            self.waiting = [value]
            self.left_out += 1
            return
        self.due = now() + 1 / self.most_per_s if self.most_per_s else -math.inf
        self._show(value)

    def _show(self, value: object) -> None:
        path = self.place.path
        text = format_safely(self.format, (value,), {"path": path, "time": now()})
        if len(text) > self.longest:
            text = f"{text[: self.longest]} ... ({len(text) - self.longest} characters more)"
        if self.left_out:
            text += f" ({self.left_out} not shown)"
        self.waiting, self.left_out = [], 0
        if self.to == "log":
            self.log.log(_LEVELS[self.level], "%s", text)
        else:
            print_line(text, error=self.to == "error")
        self.shown.trigger(text)


@node
def log_value(
    value: Any,
    *,
    format: Annotated[str, Predicate(is_a_format), MaxLen(10_000)] = "{}",  # noqa: A002 - the word of the trade
    level: Level = "info",
) -> Any:
    """Pass a value on and write it to the node's log.

    Args:
      value: anything.
      format: what is written, with {} for the value.
      level: of the record.

    Raises:
      ValueError: the value cannot be written in that format, or the format wants another one.
    """
    log().log(_LEVELS[level], "%s", format_safely(format, (value,), {}))
    return value


class Indicator(Node):
    """Show a truth value as a lamp that is on or off: in the log, and as an output for those who draw the node.

    Attributes:
      signal: the truth value.
      on: whether the lamp is on; set by the node.
      level: of the record in the log that is written when the lamp changes.
      changed: the new value.

    CS::APEX: csapex::boolean::Indicator.
    """

    signal = Input(bool)
    on = Parameter(False, read_only=True)
    level = Parameter("info", choices=tuple(_LEVELS))
    changed = Event(bool)
    before = State[bool | None](None)

    def process(self, signal: bool) -> None:
        """Show it."""
        if signal != self.before:
            self.before = self.on = signal
            self.log.log(_LEVELS[self.level], "%s", "on" if signal else "off")
            self.changed.trigger(signal)


class SignalLight(Node):
    """Show one of three states as a traffic light: in the log, and as an output for those who draw the node.

    Attributes:
      red: makes it red.
      yellow: makes it yellow.
      green: makes it green.
      state: the light that is on, "" before the first; set by the node.
      level: of the record in the log that is written when the light changes.
      changed: the new light.

    CS::APEX: csapex::SignalLight.
    """

    state = Parameter("", read_only=True)
    level = Parameter("info", choices=tuple(_LEVELS))
    changed = Event(str)

    @slot
    def red(self) -> None:
        """Make it red."""
        self._become("red")

    @slot
    def yellow(self) -> None:
        """Make it yellow."""
        self._become("yellow")

    @slot
    def green(self) -> None:
        """Make it green."""
        self._become("green")

    def _become(self, light: str) -> None:
        if light != self.state:
            self.state = light
            self.log.log(_LEVELS[self.level], "%s", light)
            self.changed.trigger(light)


@node
def format_table(
    rows: Sequence[Mapping[str, object]],
    *,
    columns: Sequence[str] = (),
    widest: Annotated[int, Interval(ge=1, le=10_000)] = 40,
) -> str:
    """Write dicts as a table of columns that stand below each other; numbers are on the right.

    Args:
      rows: values by the names of the columns.
      columns: which are shown, in order; none are all, as they come.
      widest: how many characters of a value are shown.
    """
    names = list(columns) or list(dict.fromkeys(name for row in rows for name in row))
    table = [[_cell(row.get(name), widest) for name in names] for row in rows]
    widths = [max([len(name), *(len(row[place]) for row in table)]) for place, name in enumerate(names)]
    right = [bool(rows) and all(isinstance(row.get(name), int | float | type(None)) for row in rows) for name in names]
    lines = [names, ["-" * width for width in widths], *table]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if is_right else cell.ljust(width)
            for cell, width, is_right in zip(line, widths, right, strict=True)
        ).rstrip()
        for line in lines
    )


def _cell(value: object, widest: int) -> str:
    text = "" if value is None else f"{value:.6g}" if type(value) is float else str(value)
    text = " ".join(text.split())
    return text if len(text) <= widest else text[: max(widest - 3, 0)] + "..."[:widest]

"""Token diagrams: what arrives at a port and what leaves it, as one line of characters for each port.

    -        a tick in which nothing happens (`tick_s` long, 0.01 s)
    3 a      a value: digits are numbers, letters are strings; `values` can give them another meaning
    .        silence (NO_MESSAGE), at outputs only: what arrives is driven by a source, which says nothing instead
    |        the end
    !        a signal without a value
    + ~      a signal without a value that carries +1 or -1
    (3+4)    several in one tick; after + or ~ the next value carries +1 or -1, and +! is a signal that does

Spaces are left out, so lines can be put below each other. `run` drives a node with such lines in virtual time and
returns such lines:

    >>> import hfg
    >>> @hfg.node
    ... def double(value: int) -> int | None:
    ...     return 2 * value if value < 4 else None
    >>> run(double(), value="1-2-5-|")
    {'out': '2-4-.-|'}

The line "activity" shows when A(v) of the node changes: + and ~.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import hfg
from hfg.base.token import END, NO_MESSAGE, Token
from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.nodetypes.node import Node
from hfg.testing.recording import Recorder
from hfg.trace import ActivityChanged, TokenSent

__all__ = ["Step", "check", "draw", "parse", "run"]

TICK_S: Final = 0.01


@dataclass(frozen=True)
class Step:
    """What happens in one tick: a value or marker, or None for a signal without a value."""

    tick: int
    value: Any
    activity: int = 0


def parse(line: str, values: Mapping[str, Any] | None = None) -> list[Step]:
    """Read a line.

    Raises:
      ValueError: at a character that means nothing.

    Examples:
      >>> parse("1-(+a)|")
      [Step(tick=0, value=1, activity=0), Step(tick=2, value='a', activity=1), Step(tick=3, value=END, activity=0)]
    """
    return list(_steps(line.replace(" ", ""), values or {}))


def _steps(line: str, values: Mapping[str, Any]) -> Iterator[Step]:
    tick, inside, sign = 0, False, 0
    for place, letter in enumerate(line):
        if letter == "(":
            inside = True
        elif letter == ")":
            if sign:
                yield Step(tick, None, sign)
            inside, sign = False, 0
            tick += 1
        elif letter in "+~" and inside:
            if sign:
                yield Step(tick, None, sign)
            sign = 1 if letter == "+" else -1
        else:
            if letter != "-":
                yield (
                    Step(tick, *_meaning(letter, values, line, place))
                    if not sign
                    else Step(tick, _meaning(letter, values, line, place)[0], sign)
                )
                sign = 0
            if not inside:
                tick += 1


def _meaning(letter: str, values: Mapping[str, Any], line: str, place: int) -> tuple[Any, int]:
    if letter in values:
        return values[letter], 0
    if letter in "+~":
        return None, 1 if letter == "+" else -1
    if letter in "!.|":
        return {"!": None, ".": NO_MESSAGE, "|": END}[letter], 0
    if letter.isdigit():
        return int(letter), 0
    if letter.isalpha():
        return letter, 0
    raise ValueError(f'"{letter}" at {place} of the diagram "{line}" means nothing; see hfg.testing.diagrams')


def draw(steps: list[Step], values: Mapping[str, Any] | None = None) -> str:
    """Write a line; what has no character of its own becomes "?".

    Examples:
      >>> draw(parse("1-(+a)|"))
      '1-(+a)|'
    """
    letters = [(value, letter) for letter, value in (values or {}).items()]
    ticks: dict[int, list[str]] = {}
    for step in steps:
        ticks.setdefault(step.tick, []).append(_letters(step, letters))
    line = ""
    for tick in range(max(ticks, default=-1) + 1):
        found = ticks.get(tick, ["-"])
        text = "".join(
            one + "!" if one in "+~" and later[0] not in "+~" else one for one, later in pairwise([*found, "+"])
        )
        line += text if len(text) == 1 else f"({text})"
    return line


def _letters(step: Step, letters: list[tuple[Any, str]]) -> str:
    sign = {1: "+", -1: "~"}.get(step.activity, "")
    for value, letter in letters:
        if value is step.value or (type(value) is type(step.value) and value == step.value):
            return sign + letter
    if step.value is None:
        return sign or "!"
    if step.value is NO_MESSAGE:
        return "."
    if step.value is END:
        return sign + "|"
    text = str(step.value)
    if isinstance(step.value, bool):
        text = str(int(step.value))
    return sign + (text if len(text) == 1 and text.isalnum() else "?")


class _Driver(hfg.Node):
    """Sends the tokens of a diagram at their ticks; waits forever after a line without an end."""

    out = hfg.Output(Any)
    signal = hfg.Event(Any)
    steps = hfg.Parameter((), type=tuple[Step, ...])
    tick_s = hfg.Parameter(TICK_S)
    by_signals = hfg.Parameter(False)

    async def process(self) -> AsyncIterator[Any]:
        began = asyncio.get_running_loop().time()
        for step in self.steps:
            await asyncio.sleep(began + step.tick * self.tick_s - asyncio.get_running_loop().time())
            if step.value is END:
                return
            if self.by_signals:
                self.signal.trigger(step.value, activity=step.activity)
                yield None
            else:
                yield Token(step.value, step.activity, hfg.now())
        await asyncio.get_running_loop().create_future()


class _Ear(hfg.Node):
    """Takes whatever comes."""

    value = hfg.Input(Any, optional=True)

    def process(self, value: Any) -> None:
        """Take it."""

    @hfg.slot
    def hear(self) -> None:
        """Take it."""


def run(
    node: Node,
    *,
    values: Mapping[str, Any] | None = None,
    tick_s: float = TICK_S,
    options: Mapping[str, Any] | None = None,
    active: bool = True,
    **lines: str,
) -> dict[str, str]:
    """Drive a node with one line for each input and slot, and give what leaves, by output and event, and its activity.

    Ports at which nothing happens are left out. The run ends where all lines do, or by itself.

    Args:
      node: is in no graph yet.
      values: what letters mean.
      tick_s: how long a character lasts.
      options: for `graph.add`, such as `on_error="skip"`.
      active: whether all edges transport activity.
      lines: by input or slot.

    Raises:
      ValueError: a name is neither an input nor a slot.
    """
    if not isinstance(node, Node):
        raise UsageError(f'a diagram drives a node, got {node!r:.80}: write run(double(), value="1-2")')
    for name, line in lines.items():
        if not isinstance(line, str):
            raise UsageError(f'a diagram is a text, as in {name}="1-2|", got {line!r:.80}')
    graph, seen = Graph(), Recorder()
    graph.add(node, name="node", **(options or {}))
    for name, line in lines.items():
        _drive(graph, node, name, tuple(parse(line, values)), tick_s, active)
    for name, output in node.ports.outputs.items():
        ear = graph.add(_Ear(), name=f"from_{name}")
        graph.connect(output, ear.ports.inputs["value"], active=active)
    for name, event in node.ports.events.items():
        ear = graph.add(_Ear(), name=f"at_{name}")
        graph.connect(event, ear.ports.slots["hear"], active=active)
    longest = max((len(parse(line.replace("-", "."), values)) for line in lines.values()), default=0)
    hfg.run(graph, clock="virtual", until_s=(longest + 1) * tick_s, trace=seen)
    return {name: draw(steps, values) for name, steps in _seen(node, seen, tick_s).items()}


def _drive(graph: Graph, node: Node, name: str, steps: tuple[Step, ...], tick_s: float, active: bool) -> None:
    automatic = ("enable", "disable", "activate", "deactivate", "reset")
    if name in node.ports.inputs:
        driver = graph.add(_Driver(steps=steps, tick_s=tick_s), name=f"to_{name}")
        graph.connect(driver.ports.outputs["out"], node.ports.inputs[name], active=active)
    elif name in node.ports.slots or name in automatic:
        driver = graph.add(_Driver(steps=steps, tick_s=tick_s, by_signals=True), name=f"to_{name}")
        graph.connect(driver.ports.events["signal"], node.ports.slots[name], active=active)
    else:
        known = ", ".join([*node.ports.inputs, *node.ports.slots])
        raise ValueError(f'"{name}" is not an input or a slot; there are {known or "none"}')


def _seen(node: Node, seen: Recorder, tick_s: float) -> dict[str, list[Step]]:
    found: dict[str, list[Step]] = {}
    ears = {f"from_{name}.value": name for name in node.ports.outputs}
    ears |= {f"at_{name}.hear": name for name in node.ports.events}  # of a subgraph an edge begins at a node inside
    for event in seen:
        tick = round(event.time / tick_s)
        port = ears.get(event.edge.partition(" -> ")[2]) if isinstance(event, TokenSent) else None
        if isinstance(event, TokenSent) and port is not None:
            found.setdefault(port, []).append(Step(tick, event.token.value, event.token.activity))
        elif isinstance(event, ActivityChanged) and event.node == "node":
            found.setdefault("activity", []).append(Step(tick, None, 1 if event.active else -1))
    order = [*node.ports.outputs, *node.ports.events, "activity"]
    return {name: found[name] for name in order if name in found}


def check(node: Node, expected: Mapping[str, str], **how: Any) -> None:
    """Run a node as `run` does and compare every line that is expected.

    Raises:
      AssertionError: showing both lines, one below the other.

    Examples:
      >>> import hfg
      >>> class Relay(hfg.Node):
      ...     heard = hfg.Event(int)
      ...     @hfg.slot
      ...     def say(self, value: int) -> None:
      ...         self.heard.trigger(value)
      >>> check(
      ...     Relay(),
      ...     say="1-2(+3)4|",
      ...     expected={"heard": "1-2(+3)4", "activity": "---(+~)"},
      ... )
    """
    found = run(node, **how)
    wrong = []
    for name, line in expected.items():
        wanted = draw(parse(line, how.get("values")), how.get("values"))
        if found.get(name, "") != wanted:
            wrong.append(f"{name}:\n  expected  {wanted}\n  found     {found.get(name, '')}")
    if wrong:
        raise AssertionError("\n".join(wrong))

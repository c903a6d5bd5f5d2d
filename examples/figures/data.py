"""Figures 2 to 4 of the paper: nodes, data and events, each kind by itself (§3).

Every function builds the graph of one figure; `docs/model/data.md` walks through them.
Look at one with `hfg draw examples/figures/data.py:figure_2`, run it with `hfg run examples/figures/data.py:figure_2`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import hfg


@hfg.node
def widths() -> Iterator[float]:
    yield from (2.0, 4.0, 6.0)


@hfg.node
def heights() -> Iterator[float]:
    yield from (3.0, 1.0, 5.0)


class Box(NamedTuple):
    area: float | None
    too_long: float | None  # None: nothing on this output, this time


@hfg.node(outputs=Box)
def measure(width: float, height: float, depth: float = 1.0, *, limit: float = 3.0) -> Box:
    """Read a message from each input and write one to some of the outputs."""
    longest = max(width, height, depth)
    return Box(width * height * depth, longest if longest > limit else None)


@hfg.node
def note(value: float) -> None:
    print(f"{value:g}")


def figure_2() -> hfg.Graph:
    """A node reads data from inputs and writes data to outputs."""
    graph = hfg.Graph("figure 2")
    wide, high = graph.add(widths()), graph.add(heights())
    box = graph.add(measure(), name="v_k")
    area, long = graph.add(note(), name="area"), graph.add(note(), name="too_long")
    graph.connect(wide.out, box.width)
    graph.connect(high.out, box.height)
    graph.connect(box.ports.outputs["area"], area.value)
    graph.connect(box.ports.outputs["too_long"], long.value)
    return graph


def figure_3() -> hfg.Graph:
    """Outputs can send messages to many inputs; an input is connected to one output."""
    graph = hfg.Graph("figure 3")
    source = graph.add(widths(), name="v_k")
    for number in range(3):
        graph.connect(source.out, graph.add(note(), name=f"v_{number}").value)
    return graph


class Button(hfg.Node):
    """Tells when it is pressed, and when for long."""

    pressed = hfg.Event(str)
    held = hfg.Event(str)

    @hfg.slot
    def press(self) -> None:
        place = self.place.name
        self.pressed.trigger(place)
        self.held.trigger(f"{place} held")


class Lamp(hfg.Node):
    """Counts what it receives, by whichever port."""

    count = hfg.State(0)

    @hfg.slot
    def blink(self, why: str) -> None:
        self.count += 1
        print(f"{self.place.name}: {why}")


def figure_4() -> hfg.Graph:
    """Events send signals to slots, many to many; nothing waits."""
    graph = hfg.Graph("figure 4")
    left, right = graph.add(Button(), name="left"), graph.add(Button(), name="right")
    red, green = graph.add(Lamp(), name="red"), graph.add(Lamp(), name="green")
    for button in (left, right):
        graph.connect(graph.start, button.press)
        graph.connect(button.pressed, red.blink)
    graph.connect(left.pressed, green.blink)
    graph.connect(right.held, green.blink)
    return graph

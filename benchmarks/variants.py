"""What hfg does when one thing is different from the plain chain: measured, half silent, an active edge, signals.

Each comes beside the same graph without that one thing, so that its price is what is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import hfg
from benchmarks.meters import Arrivals
from benchmarks.nodes import Relay, numbers, sink, through
from benchmarks.ours import Kind, end, entry, leaving, run

__all__ = ["Pulses", "Values", "active_edge", "fan", "measured", "signals", "silent"]

FUNCTION = Kind("function", through)
LENGTH = 10
HOPS = LENGTH + 1


def measured(length: int, tokens: int) -> dict[str, float]:
    """Run a chain of functions whose statistics were asked for once, at the start: from then on times are measured."""
    meter = Arrivals(tokens)
    hfg.run(FUNCTION.chain_graph(length, tokens, meter), begin=lambda run: run.statistics())
    return meter.figures(length + 1)


@hfg.node
def counted(*, count: int = 10, step: int = 1) -> Iterator[int]:
    """Count from 1."""
    yield from range(1, 1 + step * count, step)


@hfg.node
def odd(value: int) -> int | None:
    """Pass on what is odd, and be silent about the rest."""
    return value if value % 2 else None


def silent(half: bool, tokens: int) -> dict[str, float]:
    """Run ten functions of which the fifth asks whether the value is odd; microseconds a hop, silent ones counted.

    Code and number of values are the same both times. Only the values differ: all are odd, or every other one is.
    """
    meter = Arrivals((tokens + 1) // 2 if half else tokens)
    graph = hfg.Graph("silent")
    port = FUNCTION.line(graph, graph.add(counted(count=tokens, step=1 if half else 2)).out, 4)
    port = Kind("odd", odd).line(graph, port, 1)
    port = FUNCTION.line(graph, port, LENGTH - 5)
    graph.connect(port, entry(graph.add(sink(meter))))
    run(graph)
    figures = meter.figures(HOPS)
    return {name: figure * meter.tokens / tokens for name, figure in figures.items()}


def active_edge(tokens: int) -> dict[str, float]:
    """Run ten functions with an active edge in their middle, none of which is ever active; microseconds per hop."""
    meter = Arrivals(tokens)
    graph = hfg.Graph("active edge")
    port = FUNCTION.line(graph, graph.add(numbers(count=tokens)).out, 4)
    port = FUNCTION.line(graph, port, 1, active=True)
    port = FUNCTION.line(graph, port, LENGTH - 5)
    graph.connect(port, entry(graph.add(sink(meter))))
    run(graph)
    return meter.figures(HOPS)


class Pulses(hfg.Node):
    """Send each number by an event."""

    signal = hfg.Event(int)
    count = hfg.Parameter(10)
    sent = hfg.State(0)

    def process(self) -> None:
        """Trigger, until all are sent."""
        number = self.sent
        if number == self.count:
            raise hfg.EndOfStream
        self.sent = number + 1
        self.signal.trigger(number)


class Values(hfg.Node):
    """Send each number by an output: otherwise as `Pulses`."""

    out = hfg.Output(int)
    count = hfg.Parameter(10)
    sent = hfg.State(0)

    def process(self) -> None:
        """Send, until all are sent."""
        number = self.sent
        if number == self.count:
            raise hfg.EndOfStream
        self.sent = number + 1
        self.out.send(number)


def signals(tokens: int) -> dict[str, float]:
    """Run ten slots, each of which triggers the event of the next: from source to sink only event edges."""
    meter = Arrivals(tokens)
    graph = hfg.Graph("signals")
    port = Kind("event → slot", Relay).line(graph, graph.add(Pulses(count=tokens)).signal, LENGTH)
    graph.connect(port, entry(graph.add(end(meter))))
    run(graph)
    return meter.figures(HOPS)


def fan(source: Callable[..., hfg.Node], slots: int, tokens: int) -> dict[str, float]:
    """Run a source whose output or event goes to so many slots; microseconds an edge.

    Output → slot cannot be a chain, for a slot writes to no output (F9): so the sources stand side by side, and
    differ in nothing but what they send by.
    """
    meter = Arrivals(tokens)
    graph = hfg.Graph("fan")
    port = leaving(graph.add(source(count=tokens)))
    for position in range(slots):
        graph.connect(port, entry(graph.add(end(meter if position == slots - 1 else None))))
    run(graph)
    return meter.figures(slots)

"""A graph of which one group runs on another host: numbers go there, are squared, and come back in order.

`two_hosts.py` beside it makes the two hosts on one computer. On real ones: `hfg agent --settings arm.toml` on the one
that is called "arm", and `hfg run robot.py --settings base.toml` on the other; see docs/howto/agents.md.
"""

from __future__ import annotations

from collections.abc import Iterator

import hfg


@hfg.node
def numbers(*, count: int = 200) -> Iterator[int]:
    """Count."""
    yield from range(count)


@hfg.node
def square(value: int) -> int:
    """Multiply a number by itself."""
    return value * value


@hfg.node
def show(value: int) -> None:
    """Print what has come back."""
    print(value, flush=True)


def build(count: int = 200, rate_hz: float = 50.0) -> hfg.Graph:
    """Make the graph; `rate_hz` numbers are sent per second."""
    graph = hfg.Graph("robot")
    graph.group("grasping", host="arm")
    source = graph.add(numbers(count=count), max_rate_hz=rate_hz)
    squared = graph.add(square(), group="grasping")
    graph.connect(source.out, squared.value)
    graph.connect(squared.out, graph.add(show()).value)
    return graph

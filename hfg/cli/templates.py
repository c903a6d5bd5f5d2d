"""What `hfg new` writes: the text of a node type or a graph, and of its test. Stands on nothing."""

from __future__ import annotations

from typing import Final

__all__ = ["GRAPH", "GRAPH_TEST", "NODE", "NODE_TEST"]

NODE: Final = '''\
"""A node type; `hfg nodes {module}.py` tells what goes in and out."""

from __future__ import annotations

import hfg
from annotated_types import Ge

__all__ = ["{Name}"]


class {Name}(hfg.Node):
    """Let values through from a limit on, and tell of the first."""

    value = hfg.Input(float)
    passed = hfg.Output(float)
    first = hfg.Event(float)
    limit = hfg.Parameter(0.5, Ge(0))
    count = hfg.State(0)

    def process(self, value: float) -> None:
        if value < self.limit:
            return  # nothing this time
        self.count += 1
        if self.count == 1:
            self.first.trigger(value)
        self.passed.send(value)

    @hfg.slot
    def forget(self) -> None:
        """Take the next value for the first again."""
        self.count = 0
'''

NODE_TEST: Final = '''\
"""What {Name} does, firing by firing, without a graph: `pytest`."""

from __future__ import annotations

from hfg.testing import fire

from {module} import {Name}


def test_lets_values_through_from_the_limit_on() -> None:
    node = {Name}(limit=0.7)
    assert fire(node, value=0.6).outputs == {{}}
    assert fire(node, value=0.7).outputs == {{"passed": 0.7}}


def test_tells_of_the_first_until_it_forgets() -> None:
    node = {Name}()
    assert fire(node, value=0.8).events == [("first", 0.8)]
    assert fire(node, value=0.9).events == []
    fire(node, slot="forget")
    assert fire(node, value=0.9).events == [("first", 0.9)]
'''

GRAPH: Final = '''\
"""A graph: `hfg run {module}.py` runs it, `hfg check {module}.py` checks it."""

from __future__ import annotations

from collections.abc import Iterator

import hfg

__all__ = ["build"]


@hfg.node
def samples(*, count: int = 10) -> Iterator[float]:
    """Give a slow wave."""
    for number in range(count):
        yield abs(number % 8 - 4) / 4


@hfg.node
def high(sample: float, *, limit: float = 0.5) -> float | None:
    """Let through what is above the limit; None is silence."""
    return sample if sample > limit else None


class Watch(hfg.Node):
    """Once it is active, say what comes."""

    sample = hfg.Input(float)
    seen = hfg.Output(float)

    def process(self, sample: float) -> float | None:
        if not self.active:
            return None
        self.log.info("saw %s", sample)
        return sample

    @hfg.slot
    def begin(self) -> None:
        """Become active, by the edge that leads here."""


def build() -> hfg.Graph:
    """Build the graph; nothing happens before it runs."""
    graph = hfg.Graph("{module}")
    source = graph.add(samples(), max_rate_hz=5)
    chosen = graph.add(high())
    watch = graph.add(Watch())
    graph.connect(source.out, chosen.ports.inputs["sample"])
    graph.connect(chosen.out, watch.sample)
    graph.start.activates(watch.begin)
    graph.connect(watch.seen, graph.output("seen", float))
    return graph
'''

GRAPH_TEST: Final = '''\
"""The graph in virtual time, the same each time and at once: `pytest`."""

from __future__ import annotations

import hfg

from {module} import build


def test_high_samples_are_seen() -> None:
    report = hfg.run(build(), clock="virtual")
    assert report.outcome == "done"
    assert report.outputs["seen"] == [1.0, 0.75, 0.75, 1.0, 0.75]


def test_there_is_nothing_to_complain_about() -> None:
    assert build().check() == []
'''

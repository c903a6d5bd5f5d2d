"""Graphs in which something is active: a chain of ten nodes, in every way in which a mission keeps one alive."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from time import process_time
from typing import Any

import hfg
from benchmarks.nodes import through

__all__ = ["GRAPHS", "Stopwatch", "flat", "states"]

LENGTH = 10
AMID = 5
FLIP_EVERY = 100
LATE_EVERY = 1_000


@hfg.node
def take(value: int) -> None:
    """Take what arrives."""


class Stopwatch:
    """Measures a source from the end of its first tenth until its end: processor time, in microseconds a wave."""

    def __init__(self, waves: int) -> None:
        self.waves = waves
        self.warm = waves // 10
        self.took = 0.0

    def source(self, *, silent: bool = False) -> Any:
        """Count, or have nothing to say as often."""

        def counts() -> Iterator[int | None]:
            yield from [None] * self.warm if silent else range(self.warm)
            began = process_time()
            yield from [None] * (self.waves - self.warm) if silent else range(self.warm, self.waves)
            self.took = (process_time() - began) * 1e6 / (self.waves - self.warm)

        return hfg.node(counts)()


class Looks(hfg.Node):
    """Passes on, may be active, and has a slot by which it becomes so."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value

    @hfg.slot
    def begin(self) -> None:
        pass


class Steps(hfg.Node):
    """Passes on, and tells when it is active: by an active edge its activity goes with that."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    go = hfg.Event()

    def process(self, value: int) -> int:
        if self.active:
            self.go.trigger()
        return value

    @hfg.slot
    def begin(self) -> None:
        pass


class Holds(hfg.Node):
    """A state, no more."""

    @hfg.slot
    def begin(self) -> None:
        pass


class Flips(hfg.Node):
    """Takes values, and turns something on and off every so many."""

    value = hfg.Input(int)
    on = hfg.Event()
    off = hfg.Event()

    def process(self, value: int) -> None:
        if value % FLIP_EVERY == 0:
            (self.off if value % (2 * FLIP_EVERY) else self.on).trigger()


class Slow(hfg.Node):
    """Passes on; every so many values the time is up that an active node has."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    late = hfg.Event()

    def process(self, value: int) -> int:
        if value % LATE_EVERY == 0:
            self.late.trigger()
        return value

    @hfg.slot
    def begin(self) -> None:
        pass


def chain(
    graph: hfg.Graph, out: Any, make: Callable[[int], Any] = lambda _: through(), *, active: bool = False
) -> list[Any]:
    """Ten nodes behind each other, and a sink; gives the ten."""
    nodes: list[Any] = []
    for number in range(LENGTH):
        node = graph.add(make(number), name=f"n{number}")
        graph.connect(out, node.value, active=active and bool(nodes))
        nodes.append(node)
        out = node.out
    graph.connect(out, graph.add(take(), name="sink").value)
    return nodes


def flat(watch: Stopwatch) -> hfg.Graph:
    """Nothing is active."""
    graph = hfg.Graph("flat")
    chain(graph, graph.add(watch.source()).out)
    return graph


class Ten(hfg.Subgraph):
    """The ten in a box; one of them may be active."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    begin = hfg.slot(type=object)
    makes: Callable[[int], Any] = staticmethod(lambda _: through())

    def build(self, graph: hfg.Graph) -> None:
        out: Any = self.value.inner
        for number in range(LENGTH):
            node = graph.add(self.makes(number), name=f"n{number}")
            graph.connect(out, node.value)
            if isinstance(node, Looks):
                self.begin.inner.activates(node.begin)
            out = node.out
        graph.connect(out, self.out.inner)


class AliveTen(Ten):
    """One of the ten is active."""

    makes = staticmethod(lambda number: Looks() if number == AMID else through())


def _boxed(watch: Stopwatch, box: Ten) -> hfg.Graph:
    graph = hfg.Graph("box")
    source = graph.add(watch.source())
    graph.add(box, name="box")
    graph.connect(source.out, box.value)
    graph.connect(box.out, graph.add(take()).value)
    if isinstance(box, AliveTen):
        graph.start.activates(box.begin)
    return graph


def watched_box(watch: Stopwatch) -> hfg.Graph:
    """Somebody hears when the subgraph becomes active."""
    graph = _boxed(watch, AliveTen())
    graph.connect(graph["box"].activated, graph.add(Holds()).begin)
    return graph


def active(watch: Stopwatch, every: int) -> hfg.Graph:
    """Some of the ten are active for good."""
    graph = hfg.Graph("active")
    out = graph.add(watch.source()).out
    for node in chain(graph, out, lambda number: Looks() if number % every == AMID % every else through()):
        if isinstance(node, Looks):
            graph.start.activates(node.begin)
    return graph


def limited(watch: Stopwatch) -> hfg.Graph:
    """A time limit for a plain function."""
    graph = hfg.Graph("limited")
    out = graph.add(watch.source()).out
    for number in range(LENGTH):
        node = graph.add(through(), name=f"n{number}", max_duration_s=5 if number == AMID else None)
        graph.connect(out, node.value)
        out = node.out
    graph.connect(out, graph.add(take()).value)
    return graph


def gated(watch: Stopwatch, opened: bool, inside: bool, at: int = AMID) -> hfg.Graph:
    """A gate on one of the ten; `inside`: its state takes part in the wave, else it is beside."""
    graph = hfg.Graph("gated")
    out = graph.add(watch.source()).out
    state: Any = graph.add(Looks() if inside else Holds(), name="state")
    if inside:
        graph.connect(out, state.value)
    if opened:
        graph.start.activates(state.begin)
    graph.gate(chain(graph, out)[at], by=state)
    return graph


def flips(watch: Stopwatch) -> hfg.Graph:
    """A gate that opens and closes."""
    graph = hfg.Graph("flips")
    out = graph.add(watch.source()).out
    flip, state = graph.add(Flips()), graph.add(Holds(), name="state")
    graph.connect(out, flip.value)
    graph.connect(flip.on, state.activate)
    graph.connect(flip.off, state.deactivate)
    graph.gate(chain(graph, out)[AMID], by=state)
    return graph


def timed_out(watch: Stopwatch) -> hfg.Graph:
    """Activity leaves every so often, and comes back by a time-out."""
    graph = hfg.Graph("timed out")
    rest = graph.add(Holds(), name="rest", active_for_s=1e-4)
    out = graph.add(watch.source()).out
    slow = chain(graph, out, lambda number: Slow() if number == AMID else through())[AMID]
    graph.start.activates(slow.begin)
    slow.late.activates(rest.begin)
    rest.timeout.activates(slow.begin)
    return graph


def silent(watch: Stopwatch) -> hfg.Graph:
    """The source has nothing to say."""
    graph = hfg.Graph("silent")
    chain(graph, graph.add(watch.source(silent=True)).out)
    return graph


def silent_head(watch: Stopwatch) -> hfg.Graph:
    """Nothing but silence comes into the region, behind a pipelined edge."""
    graph = hfg.Graph("silent head")
    first = graph.add(through(), name="first", release="pipelined")
    graph.connect(graph.add(watch.source(silent=True)).out, first.value)
    chain(graph, first.out)
    return graph


def hops(watch: Stopwatch) -> hfg.Graph:
    """Activity goes along the ten by what they send, and from the last by an event to the first."""
    graph = hfg.Graph("hops")
    out = graph.add(watch.source()).out
    nodes = chain(graph, out, lambda number: Steps() if number == LENGTH - 1 else Looks(), active=True)
    nodes[-1].go.activates(nodes[0].begin)
    graph.start.activates(nodes[0].begin)
    return graph


def ring(watch: Stopwatch, *, against: bool = False) -> hfg.Graph:
    """Activity goes round the ten by events: along the wave, ten of them each; or against it, one a wave."""
    graph = hfg.Graph("ring")
    nodes = chain(graph, graph.add(watch.source()).out, lambda _: Steps())
    for before, behind in pairwise([nodes[0], *reversed(nodes)] if against else [*nodes, nodes[0]]):
        before.go.activates(behind.begin)
    graph.start.activates(nodes[0].begin)
    return graph


class Stays(hfg.Node):
    """A state of a ring: a letter lets the active one give its activity to the next."""

    letter = hfg.Event()
    left = hfg.Event()

    @hfg.slot(while_active=True)
    def hear(self) -> None:
        self.left.trigger()

    @hfg.slot
    def enter(self) -> None:
        pass


def states(count: int, watch: Stopwatch) -> hfg.Graph:
    """A ring of states, and one letter again and again: each step is one firing and two calls."""
    graph = hfg.Graph("states")
    out = graph.add(watch.source()).out
    nodes = [graph.add(Stays(), name=f"s{number}") for number in range(count)]
    for before, behind in pairwise([*nodes, nodes[0]]):
        graph.connect(out, before.hear)
        before.left.activates(behind.enter)
    graph.start.activates(nodes[0].enter)
    return graph


GRAPHS: dict[str, tuple[Callable[[Stopwatch], hfg.Graph], float]] = {
    "in a subgraph": (lambda watch: _boxed(watch, Ten()), 1.3),
    "one is active": (lambda watch: active(watch, LENGTH), 1.3),
    "one is active, in a subgraph": (lambda watch: _boxed(watch, AliveTen()), 1.3),
    "one is active, in a watched subgraph": (watched_box, 1.3),
    "half are active": (lambda watch: active(watch, 2), 1.5),
    "a time limit": (limited, 1.3),
    "gate open, state inside": (lambda watch: gated(watch, True, True), 1.3),
    "gate open": (lambda watch: gated(watch, True, False), 1.3),
    "gate closed, state inside": (lambda watch: gated(watch, False, True), 0.6),
    "gate closed amid": (lambda watch: gated(watch, False, False), 0.6),
    "gate closed": (lambda watch: gated(watch, False, False, 0), 0.6),
    "gate flips every 100": (flips, 1.5),
    "a time-out every 1,000": (timed_out, 1.5),
    "silent source": (silent, 0.6),
    "silent region": (silent_head, 1.5),
    "activity goes over ten edges": (hops, 3.0),
    "activity goes by ten events": (ring, 3.0),
    "activity goes by an event": (lambda watch: ring(watch, against=True), 3.0),
}
"""By name: what it is made by, and at most how much of the flat chain's time it may take."""

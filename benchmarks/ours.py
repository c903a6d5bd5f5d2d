"""What hfg does: the works, for each kind of node and edge."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from typing import Any

import hfg
from benchmarks.meters import Arrivals, Laps
from benchmarks.nodes import (
    Activator,
    End,
    Lapper,
    Place,
    Relay,
    Starter,
    Through,
    join,
    laps,
    numbers,
    sink,
    through,
    through_async,
    through_waiting,
)
from benchmarks.works import Participant

__all__ = ["KINDS", "Fan", "Kind", "Machine", "Outside", "States"]

STATES = 10


def entry(node: hfg.Node) -> Any:
    """The input or slot of a node that has one of them."""
    return next(iter([*node.ports.inputs.values(), *node.ports.slots.values()]))


def leaving(node: hfg.Node) -> Any:
    """The output or event of a node that has one of them."""
    return next(iter([*node.ports.outputs.values(), *node.ports.events.values()]))


def end(meter: Arrivals | None = None) -> End:
    """A sink with a slot."""
    node = End()
    node.meter = meter
    return node


def run(graph: hfg.Graph) -> hfg.Report:
    """Run it to its end, without observers."""
    return hfg.run(graph)


class Kind(Participant):
    """Chains of one kind of node, or of several in turn."""

    def __init__(self, name: str, *makes: Callable[[], hfg.Node], ends: Callable[[Any], hfg.Node] = sink) -> None:
        self.name = name
        self.makes = makes
        self.ends = ends
        self.events = makes[0] is Relay or makes[0] is Starter

    def line(self, graph: hfg.Graph, port: Any, length: int, *, active: bool = False) -> Any:
        """Add `length` nodes after the port; return the last one's port."""
        for position in range(length):
            node = graph.add(self.makes[position % len(self.makes)]())
            graph.connect(port, entry(node), active=active)
            port = leaving(node)
        return port

    def chain_graph(self, length: int, tokens: int, meter: Arrivals) -> hfg.Graph:
        """A source, `length` nodes and a sink."""
        graph = hfg.Graph("chain")
        port = self.line(graph, graph.add(numbers(count=tokens)).out, length)
        graph.connect(port, entry(graph.add(self.ends(meter))))
        return graph

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A: microseconds a hop."""
        meter = Arrivals(tokens)
        run(self.chain_graph(length, tokens, meter))
        return meter.figures(length + 1)

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: microseconds a hop, one token in flight.

        Data waits by itself: the source fires again when everything after it is over (F5). Of signals one goes round.
        """
        meter = Laps(tokens)
        graph = hfg.Graph("flight")
        if self.events:
            lapper = graph.add(Lapper())
            lapper.meter = meter
            graph.connect(graph.start, lapper.begin)
            graph.connect(self.line(graph, lapper.go, length), lapper.back)
        else:
            port = self.line(graph, leaving(graph.add(laps(meter))), length)
            graph.connect(port, entry(graph.add(self.ends(Arrivals(tokens)))))
        run(graph)
        return meter.figures(length + 1)

    def join(self, tokens: int) -> dict[str, float]:
        """C: microseconds a token through two branches of one node, a join and a sink."""
        meter = Arrivals(tokens)
        graph = hfg.Graph("join")
        source = graph.add(numbers(count=tokens))
        both = graph.add(join())
        for name in ("left", "right"):
            graph.connect(self.line(graph, source.out, 1), both.ports.inputs[name])
        graph.connect(both.out, entry(graph.add(sink(meter))))
        run(graph)
        return meter.figures()

    def transfer(self, tokens: int, *, active: bool = True) -> dict[str, float]:
        """E: a chain of ten in which every token brings the activity and takes it along; microseconds a hop."""
        meter = Arrivals(tokens)
        graph = hfg.Graph("transfer")
        first = graph.add(Activator())
        graph.connect(graph.add(numbers(count=tokens)).out, first.value)
        port = self.line(graph, first.out, 10, active=active)
        graph.connect(port, entry(graph.add(self.ends(meter))), active=active)
        run(graph)
        return meter.figures(12)

    def transfer_baseline(self, tokens: int) -> dict[str, float]:
        """The same nodes and tokens over edges that are not active."""
        return self.transfer(tokens, active=False)


class Fan(Participant):
    """One output and many slots: what goes from output to slot cannot be a chain, for slots write to no output."""

    name = "output → slot, a fan of K"

    def graph(self, source: hfg.Node, length: int, meter: Arrivals | None) -> hfg.Graph:
        """A source whose output goes to `length` slots, the last of which counts."""
        graph = hfg.Graph("fan")
        port = leaving(graph.add(source))
        for position in range(length):
            graph.connect(port, entry(graph.add(end(meter if position == length - 1 else None))))
        return graph

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A, wide instead of long: microseconds an edge."""
        meter = Arrivals(tokens)
        run(self.graph(numbers(count=tokens), length, meter))
        return meter.figures(length)

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: the source waits until all slots have been called."""
        meter = Laps(tokens)
        run(self.graph(laps(meter), length, None))
        return meter.figures(length)


class Outside(Participant):
    """A graph that code outside feeds: each token crosses the border by an await."""

    name = "function, fed from outside"

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: `send` returns when the token has been processed (P10)."""
        meter = Laps(tokens)
        graph = hfg.Graph("outside")
        numbers = graph.input("numbers", int)
        port = Kind("function", through).line(graph, numbers, length)
        graph.connect(port, entry(graph.add(sink(Arrivals(tokens)))))

        async def main() -> None:
            async with hfg.running(graph) as run, run.feed(numbers) as feed:
                for value in range(tokens):
                    meter.lap()
                    await feed.send(value)
                meter.lap()

        asyncio.run(main())
        return meter.figures(length + 1)


class States(Participant):
    """Ten nodes that pass the activity round: a state machine that runs by itself."""

    name = "hfg, activity round ten nodes"

    def step(self, tokens: int) -> dict[str, float]:
        """E: microseconds a step, from one active node to the next."""
        meter = Arrivals(tokens)
        graph = hfg.Graph("states")
        nodes = [graph.add(Place()) for _ in range(STATES)]
        for node, after in zip(nodes, [*nodes[1:], nodes[0]], strict=True):
            node.meter = meter
            node.done.activates(after.begin)
        graph.start.activates(nodes[0].begin)
        run(graph)
        return meter.figures()


class Machine(Participant):
    """The same ring as a machine's translation (A13): letters come from a source, and every state hears each."""

    name = "hfg, a StateMachine of ten states"

    def __init__(self, states: int = STATES) -> None:
        self.states = states

    def step(self, tokens: int) -> dict[str, float]:
        """E: microseconds a letter: each state hears it, one of them hands the activity on."""
        meter = Arrivals(tokens)
        names = [f"s{number}" for number in range(self.states)]
        ring = zip(names, [*names[1:], names[0]], strict=True)
        machine = hfg.StateMachine(names, [("step", state, after) for state, after in ring], initial=names[0])

        def letters() -> Iterator[str]:
            for number in range(tokens):
                yield "step"
                meter.take(number)  # asked for the next one: this one has been read by all

        graph = hfg.Graph("machine")
        machine.build(graph, letters=graph.add(hfg.node(letters)()).out)
        report = run(graph)
        active = [path for path, node in report.nodes.items() if node.active]
        if active != [names[tokens % self.states]]:
            raise RuntimeError(f"after {tokens} letters {active} are active")
        return meter.figures()


FUNCTION = Kind("function", through)
ASYNC = Kind("async that does not suspend", through_async)
SUSPENDING = Kind("async that suspends once", through_waiting)
KINDS: list[Kind | Fan | Outside] = [
    FUNCTION,
    Kind("class", Through),
    ASYNC,
    SUSPENDING,
    Kind("event → slot", Relay, ends=end),
    Kind("event → input", Starter),
    Kind("output → slot and event → input in turn", Relay, through, ends=end),
    Fan(),
    Outside(),
]

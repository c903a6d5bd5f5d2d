"""Random small graphs of puppets, and every state of their activity that the reference machine can reach.

The machine has no way back, so each state is laid into it anew: which nodes are active, and which tokens lie where, in
their order. Puppets keep nothing else. Tokens without activity are not kept, for a command does at any moment what they
would do; those to `activate` and `deactivate` are.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import hfg
from hfg.errors import HfgError
from hfg.testing.reference import Move, ReferenceMachine
from hfg.testing.reference.state import Line, Lying, Station

Key: TypeAlias = tuple[tuple[bool, ...], tuple[tuple[int, int], ...]]
"""The active flag of each station; line and modifier of each token, the oldest first."""

MOST_TOKENS = 4
MOST_STATES = 40


class Chooses(hfg.Node):
    """Leaves by one event."""

    commands: tuple[int, ...] = (1, 2)
    a, b = hfg.Event(), hfg.Event()

    @hfg.slot
    def take(self) -> None:
        """Receive activity."""

    @hfg.slot
    def send(self, which: int) -> None:
        if which == 1:
            self.a.trigger()
        elif which == 2:
            self.b.trigger()


class Forks(Chooses):
    """May leave by both."""

    commands = (0, 1)

    @hfg.slot
    def send(self, which: int) -> None:
        self.a.trigger()
        if which == 1:
            self.b.trigger()


class Passes(Chooses):
    """Passes the activity on at once."""

    commands = (0,)

    @hfg.slot
    def take(self) -> None:
        self.a.trigger()

    @hfg.slot
    def send(self, which: int) -> None:
        self.a.trigger()


class Repeats(Chooses):
    """Sends the same event twice."""

    commands = (0,)

    @hfg.slot
    def send(self, which: int) -> None:
        self.a.trigger()
        self.a.trigger()


class Says(Chooses):
    """Has modifiers of its own (rule A4)."""

    commands = (0, 1, 2)

    @hfg.slot
    def send(self, which: int) -> None:
        if which == 0:
            self.a.trigger(activity=1)
        elif which == 1:
            self.b.trigger(activity=-1)
        else:
            self.a.trigger(activity=0)


class Fires(hfg.Node):
    """Takes activity by an input."""

    commands = (0, 1, 2)

    take, mode = hfg.Input(Any), hfg.Input(int)
    a, b = hfg.Event(), hfg.Event()

    def process(self, take: Any, mode: int) -> None:
        if mode == 1:
            self.a.trigger()
        elif mode == 2:
            self.b.trigger()


class Box(hfg.Subgraph):
    """Two puppets, which activity enters and leaves."""

    take, send = hfg.slot(type=object), hfg.slot(type=int)
    a, b = hfg.Event(), hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        first, second = graph.add(Forks(), name="first"), graph.add(Chooses(), name="second")
        self.take.inner.activates(first.take)
        first.a.activates(second.take)
        first.b.activates(self.a.inner)
        second.a.activates(self.a.inner)
        second.b.activates(self.b.inner)
        graph.connect(self.send.inner, first.send)
        graph.connect(self.send.inner, second.send)


@dataclass
class Drawn:
    """A random graph.

    Attributes:
      is_plain: the game says neither more nor less about it than the rules do, as long as no edge holds two tokens.
    """

    graph: hfg.Graph
    is_plain: bool


def draw(seed: int) -> Drawn:
    """Make a random graph."""
    dice = random.Random(seed)
    graph = hfg.Graph(f"graph {seed}")
    is_plain = dice.random() < 0.6
    kinds: list[type[Any]] = [Chooses, Chooses, Chooses, Passes, Forks, Box]
    if not is_plain:
        kinds += [Repeats, Says, Fires, Fires]
    nodes: list[Any] = []
    for number in range(dice.choice([2, 2, 3, 3, 4])):
        kind = dice.choice(kinds if number else kinds[:5])
        options: dict[str, Any] = {"active_for_s": 1.0} if dice.random() < 0.3 else {}
        node = graph.add(kind(), name=f"n{number}", **options)
        commands = graph.input(f"command_{number}", int)
        graph.connect(commands, node.mode if isinstance(node, Fires) else node.send)
        nodes.append(node)
    taken: set[Any] = set()

    def link(source: Any, *, active: bool) -> None:
        node = dice.choice(nodes)
        target = node.take
        if isinstance(node, Fires):
            if node in taken or isinstance(source.node, Box):
                return  # an input takes one edge, and two lead out of a box
            taken.add(node)
        elif not is_plain and not isinstance(node, Box) and dice.random() < 0.15:
            target = dice.choice([node.activate, node.deactivate])
        try:
            graph.connect(source, target, active=active)
        except HfgError:
            return  # the same edge again

    for _ in range(dice.choice([1, 1, 1, 2])):
        link(graph.start, active=True)
    for node in nodes:
        for source in (node.a, node.b):
            for _ in range(dice.choice([0, 1, 1, 1, 1, 2])):
                link(source, active=is_plain or dice.random() < 0.85)
        if node._options.active_for_s is not None:
            link(node.timeout, active=True)
        if not is_plain and dice.random() < 0.2:
            link(node.activated, active=True)  # leaves at once, in the game at any moment
    for node in nodes:
        if isinstance(node, Fires):
            if node not in taken:
                graph.connect(graph.input(f"filled_{node.place.name}", Any), node.take)
            if dice.random() < 0.5:
                graph.gate(node, by=dice.choice(nodes))
    return Drawn(graph, is_plain and not any(isinstance(node, Fires) for node in nodes))


class Explored:
    """All states of a graph's activity that the reference machine reaches.

    Attributes:
      states: the active flags, and how many tokens with +1 lie on each active edge, 2 for more.
      is_complete: nothing was left out.
    """

    def __init__(self, graph: hfg.Graph) -> None:
        self.machine = ReferenceMachine(graph, held_open=True)
        self.machine.start()
        self.kept = [self._is_kept(line) for line in self.machine.lines]
        first = self._key()
        self.reached = {first: None}
        self.is_complete = True
        waiting = [first]
        for key in waiting:
            for after in self._after(key):
                if after in self.reached:
                    continue
                if len(after[1]) > MOST_TOKENS or len(self.reached) >= MOST_STATES:
                    self.is_complete = False
                    continue
                self.reached[after] = None
                waiting.append(after)

    def states(self) -> set[tuple[frozenset[str], frozenset[tuple[str, int]]]]:
        """Return the states by paths and labels."""
        return {(self.active(key), self._lying(key)) for key in self.reached}

    def active(self, key: Key) -> frozenset[str]:
        """Return the active nodes of a state."""
        return frozenset(one.path for one, active in zip(self.machine.stations, key[0], strict=True) if active)

    def _lying(self, key: Key) -> frozenset[tuple[str, int]]:
        counts: dict[str, int] = {}
        for number, modifier in key[1]:
            if modifier == 1:
                label = self.machine.lines[number].edge.label
                counts[label] = min(2, counts.get(label, 0) + 1)
        return frozenset(counts.items())

    def _matters(self, station: Station) -> bool:
        """Return whether a command to a node that is not active may change anything."""
        if isinstance(station.node, Says | Fires):
            return True
        index = station.leaf.index
        return any(
            self.kept[number] for number, line in enumerate(self.machine.lines) if line.edge.source.owner == index
        )

    def _is_kept(self, line: Line) -> bool:
        return line.edge.target.name in ("activate", "deactivate")

    def _key(self) -> Key:
        lying = [
            (token.place, number, token.token.activity)
            for number, line in enumerate(self.machine.lines)
            for token in line.queue
            if token.token.activity or self.kept[number]
        ]
        flags = tuple(station.active for station in self.machine.stations)
        return flags, tuple((number, modifier) for _, number, modifier in sorted(lying))

    def _lay(self, key: Key) -> None:
        """Put the machine into a state."""
        machine = self.machine
        for line in machine.lines:
            line.queue, line.unprocessed = [], 0
        for station, active in zip(machine.stations, key[0], strict=True):
            station.active = station.node._active = active
            station.active_since = machine.now - 2 if active else None
            station.flights, station.changes, station.owed, station.place = [], [], [], None
        for number, modifier in key[1]:
            line = machine.lines[number]
            sender = line.edge.source.owner
            line.queue.append(Lying(hfg.Token(None, modifier), machine.next_tick(), sender))
        for box in machine.structure.boxes:
            active = machine.is_active(-2 - box.index)
            machine.box_active[box.index] = active
            machine.box_since[box.index] = machine.now - 2 if active else None
        machine.observed.clear()

    def _after(self, key: Key) -> Iterator[Key]:
        """Yield each state that may follow."""
        machine = self.machine
        for station in machine.stations:
            yield from self._after_commands(key, station)
        heads: dict[int, int] = {}
        for number, _ in key[1]:
            heads.setdefault(machine.lines[number].edge.target.owner, number)
        for owner, number in heads.items():
            line = machine.lines[number]
            if line.edge.target.kind == "slot":
                self._lay(key)
                machine.apply(Move("call", machine.path_of(owner), line.edge.label))
                yield self._key()
        timed = [station.path for station in machine.stations] + [box.path for box in machine.structure.boxes]
        for path in timed:
            self._lay(key)
            if machine.times_out(machine.paths[path]):
                machine.apply(Move("timer", path))
                yield self._key()

    def _after_commands(self, key: Key, station: Station) -> Iterator[Key]:
        """A command may have come before all that lies there."""
        machine = self.machine
        if not key[0][station.leaf.index] and not self._matters(station):
            return
        lying = [machine.lines[number].edge for number, _ in key[1]]
        if any(
            edge.target.owner == station.leaf.index and edge.target.kind == "slot" and edge.source.name == "start"
            for edge in lying
        ):
            return  # nothing is called before what `start` sends to it (rules A10, F9)
        fires = isinstance(station.node, Fires)
        into = {line.edge.target.name: line for line in machine.lines if line.edge.target.owner == station.leaf.index}
        line = into["mode" if fires else "send"]
        for value in station.node.commands:
            self._lay(key)
            line.queue.append(Lying(hfg.Token(value, 0), -1, line.edge.source.owner))
            if not fires:
                machine.apply(Move("call", station.path, line.edge.label))
            else:
                if not into["take"].queue:
                    into["take"].queue.append(Lying(hfg.Token(0, 0), -1, into["take"].edge.source.owner))
                machine.apply(Move("fire", station.path))
            yield self._key()

"""The state diagram of a graph: between which states activity moves, and by which events.

It is data, and it can be a graph of its own, which is drawn like any other. Depends on `reach`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import msgspec

from hfg.analysis.reach import Reach
from hfg.errors import UsageError
from hfg.graph.editing import commands
from hfg.graph.flat import ROOT, FlatGraph
from hfg.graph.graph import Graph
from hfg.graph.structure.membership import set_options
from hfg.nodetypes.node import Node
from hfg.ports import Event, slot
from hfg.ports.automatic import AUTOMATIC_EVENTS

__all__ = ["Arrow", "State", "StateDiagram", "diagram_of"]


@dataclass(frozen=True)
class State:
    """A node that may be active.

    Attributes:
      path: of the node.
      passes_on: it passes activity on in the same call that takes it, so nothing rests in it.
    """

    path: str
    passes_on: bool


@dataclass(frozen=True)
class Arrow:
    """A way for activity from one state to another.

    Attributes:
      source: the node or subgraph that sends; "" for the start of the run.
      event: the event or output by which activity leaves.
      target: the node that takes it; "" if it leaves the graph.
    """

    source: str
    event: str
    target: str


@dataclass(frozen=True)
class StateDiagram:
    """The states of a graph, and what leads from one to another.

    Where at most one node of a region is active, this is its state machine. A node with several arrows for the same
    event sends activity over all of them.

    Attributes:
      states: the nodes that may be active, in the order of the graph.
      arrows: over each of them activity may move; others are not listed.
      limits: the time limits of nodes and subgraphs, in seconds (rule A12).
      name: of the graph.
    """

    states: tuple[State, ...]
    arrows: tuple[Arrow, ...]
    limits: tuple[tuple[str, float], ...] = ()
    name: str = "states"

    def as_data(self) -> dict[str, Any]:
        """Return the diagram as plain data, for JSON."""
        return {
            "states": [asdict(one) for one in self.states],
            "arrows": [asdict(one) for one in self.arrows],
            "limits": dict(self.limits),
        }

    def graph(self) -> Graph:
        """Return a graph that has only the states, nested as they are, to be drawn and not to run.

        Raises:
          UsageError: there are no states.
        """
        if not self.states:
            raise UsageError(f'graph "{self.name}" has no states to draw, since no active edge carries activity')
        return _Drawn(self).graph


def diagram_of(reach: Reach) -> StateDiagram:
    """Return the state diagram of what was reached."""
    game, places = reach.game, reach.game.places
    marked = {number for number, one in enumerate(places.one) if reach.holds(one)}
    entered = {game.edges[number].target.node for number in marked}
    states = [
        State(game.flat.path(index), not rests)
        for index, bit in places.node.items()
        if (rests := reach.holds(1 << bit)) or index in entered
    ]
    arrows = [
        Arrow(_path(game.flat, edge.source.node), edge.source.name, _path(game.flat, edge.target.node))
        for number, edge in enumerate(game.edges)
        if number in marked
    ]
    limits = [
        (game.flat.path(end), options.active_for_s)
        for end, options in game.flat.options()
        if options.active_for_s is not None
    ]
    return StateDiagram(tuple(states), tuple(dict.fromkeys(arrows)), tuple(limits), game.flat.level.name)


def _path(flat: FlatGraph, end: int) -> str:
    return "" if end == ROOT else flat.path(end)


class _Drawn:
    """Makes the graph that is drawn: first all states side by side, then the boxes around them, then their names."""

    def __init__(self, diagram: StateDiagram) -> None:
        self.graph = Graph(f"states of {diagram.name}")
        self.diagram = diagram
        self.limits = dict(diagram.limits)
        self.names = {one.path: f"n{number}" for number, one in enumerate(diagram.states)}
        self.now = dict(self.names)  # where each path lies now
        self.boxes = self._find_boxes()
        self.stand_ins: dict[tuple[str, str], Any] = {}  # for the events of boxes, which are not there yet
        for path in self.names:
            self._add(path)
        for arrow in diagram.arrows:
            self._connect(arrow)
        self._enclose()
        for path in sorted(self.now, key=lambda one: -one.count("/")):
            self.graph.edit(commands.Rename(self._place(path), path.rpartition("/")[2]))

    def _find_boxes(self) -> list[str]:
        """The paths of all subgraphs around states, inner ones first."""
        found = {path[:at] for path in self.names for at, letter in enumerate(path) if letter == "/"}
        return sorted(found, key=lambda one: (-one.count("/"), one))

    def _add(self, path: str) -> None:
        events = {one.event for one in self.diagram.arrows if one.source == path} - set(AUTOMATIC_EVENTS)
        body: dict[str, Any] = {"__module__": __name__, "enter": slot(_enter), "do": _do}
        body |= {_identifier(event): Event(Any) for event in sorted(events)}
        kind = type("State", (Node,), body)
        self.graph.add(kind(), name=self.names[path], active_for_s=self.limits.get(path))

    def _connect(self, arrow: Arrow) -> None:
        target = self.graph[self.names[arrow.target]].ports.slots["enter"] if arrow.target else self.graph.stop
        if not arrow.source:
            source: Any = self.graph.start
        elif arrow.source in self.names:
            source = self.graph[self.names[arrow.source]].ports.events[_identifier(arrow.event)]
        else:
            key = (arrow.source, arrow.event)
            if key not in self.stand_ins:
                self.stand_ins[key] = self.graph.add(_StandIn())
            source = self.stand_ins[key].out
        self.graph.connect(source, target, active=True)

    def _enclose(self) -> None:
        for number, path in enumerate(self.boxes):
            inside = [one for one in self.now if one.rpartition("/")[0] == path]
            self.graph.edit(commands.Enclose(tuple(self.now[one] for one in inside), f"b{number}"))
            self.now[path] = f"b{number}"
            box = self.graph.nodes[f"b{number}"]
            set_options(box, msgspec.structs.replace(box._options, active_for_s=self.limits.get(path)))
            for (_, event), stand_in in [one for one in self.stand_ins.items() if one[0][0] == path]:
                for edge in [one for one in self.graph.edges if one.source is stand_in.out]:
                    self.graph.connect(box.ports.events[event], edge.target, active=True)
                self.graph.edit(commands.Remove(stand_in.place.name))

    def _place(self, path: str) -> str:
        """Where a state or box lies now."""
        around = [path[:at] for at, letter in enumerate(path) if letter == "/" and path[:at] in self.now]
        return "/".join(self.now[one] for one in (*around, path))


class _StandIn(Node):
    out = Event(Any)


def _enter(self: Any) -> None:
    """Receive activity."""


async def _do(self: Any) -> None:
    """Every state may have the event `completed`."""


def _identifier(name: str) -> str:
    return "".join(one if one.isalnum() or one == "_" else "_" for one in name)

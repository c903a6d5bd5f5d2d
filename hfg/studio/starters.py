"""Small graphs that a page offers to a user who has none yet. Depends on the library's nodes and `ball`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from hfg.graph import Graph
from hfg.graph.structure.level import level_of
from hfg.nodes import activity, time, values
from hfg.studio import ball
from hfg.studio.refusing import Refused

__all__ = ["STARTERS", "Starter", "starter_graph", "starters"]


class Starter(NamedTuple):
    """A graph to start from.

    Attributes:
      title: its name, for people.
      about: what it shows.
      build: returns a new one.
    """

    title: str
    about: str
    build: Callable[[], Graph]


def _two_nodes() -> Graph:
    graph = Graph("two_nodes")
    clock = graph.add(time.Clock(), name="clock", max_rate_hz=20)
    wave = graph.add(values.waveform(frequency_hz=0.5), name="wave")
    graph.connect(clock.time, wave.ports.inputs["time_s"])
    return graph


def _start_signal() -> Graph:
    graph = Graph("start_signal")
    radio = graph.add(values.RandomChoice(choices=["hello", "stop", "start"]), name="radio", max_rate_hz=1)
    wait, drive = graph.add(activity.WaitForText(), name="wait"), graph.add(activity.Wait(seconds=2), name="drive")
    graph.connect(radio.out, wait.message)
    graph.start.activates(wait.begin)
    wait.received.activates(drive.begin)
    drive.done.activates(wait.begin)
    return graph


STARTERS: Final[Mapping[str, Starter]] = {
    "ball": Starter(
        "A camera follows a ball",
        "A ball rolls over a table and disappears behind a curtain. Watch how the mission searches for it, follows it "
        "and rests; change a parameter while it runs; push the ball.",
        ball.build,
    ),
    "two_nodes": Starter("Two nodes, one edge", "What a node is, and when it fires.", _two_nodes),
    "start_signal": Starter("Wait for a start signal", "Activity: the state is the node that has it.", _start_signal),
}
"""By name, the one to begin with first."""


def starter_graph(name: str) -> Graph:
    """Build one of them.

    Raises:
      Refused: there is none of this name.
    """
    if name not in STARTERS:
        raise Refused("unknown", f'there is no starting graph "{name:.40}"; there are {", ".join(STARTERS)}')
    return STARTERS[name].build()


def starters() -> list[dict[str, Any]]:
    """Return what a page says about each of them."""
    return [
        {"name": name, "title": one.title, "about": one.about, **_counted(one.build())}
        for name, one in STARTERS.items()
    ]


def _counted(graph: Graph) -> dict[str, int]:
    levels = list(level_of(graph).walk())
    return {"nodes": sum(len(one.nodes) for one in levels), "edges": sum(len(one.edges) for one in levels)}

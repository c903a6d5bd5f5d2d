r"""What missions are judged by: scores for `hfg tune`, `hfg sweep` and `hfg compare`, and graphs for them.

    hfg sweep examples.fetch_delivery.judging:robot --seeds 1..8 --until 180 \
        --score examples.fetch_delivery.judging:delivered --fault world.push_robot@30

Depends on both sorts of mission.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from annotated_types import Ge

import hfg
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.world import Score
from hfg.tuning import Finished

LATE_S = 10.0
"""What a second of contact costs a robot that is to be fast."""


def robot() -> hfg.Graph:
    """Build one robot whose mission is activity."""
    return build()


def machine() -> hfg.Graph:
    """Build one robot in which a state machine decides; needs the package transitions."""
    from examples.fetch_delivery.machine import Robot

    return build(kind=Robot)


class Enough(hfg.Node):
    """Count deliveries, and tell when there are enough.

    Attributes:
      wanted: how many are enough.
      delivered: a cube was delivered.
      reached: there are enough.
    """

    wanted = hfg.Parameter(2, Ge(1))
    reached = hfg.Event()
    count = hfg.State(0)

    @hfg.slot
    def delivered(self, cube: int) -> None:
        """Count it."""
        self.count += 1
        if self.count == self.wanted:
            self.reached.trigger()


def deliveries(count: int = 2, speed: float = 1.2) -> hfg.Graph:
    """Build one robot whose run ends after `count` delivered cubes; its motors reach `speed`."""
    graph = build(speed=speed)
    enough = graph.add(Enough(wanted=count), name="enough")
    graph.connect(graph["world.delivered[0]"], enough.delivered)
    graph.connect(enough.reached, graph.stop)
    return graph


def _scores(finished: Finished) -> Sequence[Score]:
    world: Any = finished.graph["world"]
    scores: Sequence[Score] = world.simulation.scores
    return scores


def _a_minute(finished: Finished, amount: float) -> float:
    return 60 * amount / finished.report.duration_s


def delivered(finished: Finished) -> float:
    """Return how many cubes all robots have delivered."""
    return sum(len(score.delivered) for score in _scores(finished))


def wrong(finished: Finished) -> float:
    """Return how many cubes were delivered at a wrong station."""
    return sum(len(score.wrong) for score in _scores(finished))


def contact_s(finished: Finished) -> float:
    """Return how long robots have touched something."""
    return sum(score.contact_s for score in _scores(finished))


def lamp_while_driving_s(finished: Finished) -> float:
    """Return how long lamps were on while their robots drove."""
    return sum(score.lamp_while_driving_s for score in _scores(finished))


def late_s(finished: Finished) -> float:
    """Return how long the run has lasted, and more for each second of contact."""
    return finished.report.duration_s + LATE_S * contact_s(finished)


def pictures_a_minute(finished: Finished) -> float:
    """Return how many pictures were taken in each minute."""
    world: Any = finished.graph["world"]
    return _a_minute(finished, world.pictures)


def firings_a_minute(finished: Finished) -> float:
    """Return how many firings each minute had, without perception."""
    nodes = finished.report.nodes.items()
    return _a_minute(finished, sum(one.firings for path, one in nodes if "/perception/" not in path))


def processor_s_a_minute(finished: Finished) -> float:
    """Return the processor time of each minute: a search gives each run a process of its own."""
    return _a_minute(finished, time.process_time())

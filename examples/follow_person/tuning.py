r"""The follower of the robot, tuned as in the paper's reference [18]: a graph and a score for `hfg tune`.

A run is a walk of 30 m through a dense course, without other people:

    hfg tune examples.follow_person.tuning:walk --minimize examples.follow_person.tuning:off_m \
        -p robot/follow_fast.look_ahead=0.3..3 -p robot/follow_fast/follow.sideways=0.5..6 \
        -p robot/follow_fast.preempt_after=0.3..2 -p robot/follow_fast.margin=0..0.4 \
        --seeds 1..3 --evaluations 25 --confirm 101..112
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

import hfg
from examples.follow_person.mission import build
from examples.follow_person.world import Conditions
from hfg.tuning import Finished

KEEPS_M: Final = 3.2
"""The distance that the robot should keep; see `PlanPath`."""

CONTACT_M: Final = 5.0
"""What a second of contact costs."""


def walk(metres: float = 30.0) -> hfg.Graph:
    """Build the robot on a dense course, without other people."""
    return build(metres=metres, conditions=Conditions(course="dense", others=0))


def off_m(finished: Finished) -> float:
    """Return by how much the robot missed the distance that it should keep, on average, with what contacts cost."""
    world: Any = finished.graph["world"]
    score = world.simulation.score
    far = np.array(score.distances or [50.0])
    return float(np.abs(far - KEEPS_M).mean()) + CONTACT_M * float(score.contact_s)

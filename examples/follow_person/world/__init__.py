"""The simulated outdoor world. It does not depend on graphs; `Simulation` moves it on.

simulation ──── vehicle       the robot: limited acceleration and steering, wheels that slip, an inertial unit
│          ├─── people        the person who is followed, and others who walk, stop and cross
│          ├─── scanning      a laser with 16 rings
│          ├─── rendering     a camera
│          └─── scoring       what happened
└────────────── course        slopes, trees, bushes, and the way between them
"""

from examples.follow_person.world.course import Course, Ground
from examples.follow_person.world.scoring import Score
from examples.follow_person.world.simulation import Conditions, Simulation

__all__ = ["Conditions", "Course", "Ground", "Score", "Simulation"]

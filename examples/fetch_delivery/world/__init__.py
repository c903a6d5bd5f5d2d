"""The arena of the delivery example, simulated: walls, signs, robots, people. It knows nothing of graphs.

simulation ── robots ── arena
│           └────── (limits, collisions, odometry)
├──── rendering ─── what the cameras see; mujoco_cameras: the same by OpenGL
├──── scanning ──── what the lasers see
├──── operators ─── people who put cubes in and take them out
├──── faults ────── what can be made to go wrong, by name
├──── surroundings ─ how large everything is, and how badly is measured
└──── scoring ───── what counts
"""

from examples.fetch_delivery.world.arena import Arena, Station
from examples.fetch_delivery.world.faults import FAULTS, Fault, fault
from examples.fetch_delivery.world.scoring import Score
from examples.fetch_delivery.world.simulation import Cameras, Simulation
from examples.fetch_delivery.world.surroundings import LIMITS, USUAL, Surroundings

__all__ = [
    "FAULTS",
    "LIMITS",
    "USUAL",
    "Arena",
    "Cameras",
    "Fault",
    "Score",
    "Simulation",
    "Station",
    "Surroundings",
    "fault",
]

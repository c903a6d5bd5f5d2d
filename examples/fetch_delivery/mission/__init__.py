"""The robot's mission as an activity flow graph: figures 17 to 19 of the paper.

robot ─── errands ─── visiting ─── driving
│      (fetch, deliver, explore)
└────── world       (the arena as a node)
"""

from examples.fetch_delivery.mission.robot import Robot, build
from examples.fetch_delivery.mission.world import World

__all__ = ["Robot", "World", "build"]

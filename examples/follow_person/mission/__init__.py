"""The robot's mission as an activity flow graph: figures 22 to 24 of the paper.

robot ─── perceiving     clouds, tracks, clothes: data flow
│     ├── finding        PersonDetection, ObjectTracking
│     └── following      FollowPerson: PlanPath, PathFollower, Delay
└──────── world          (the world as a node)
"""

from examples.follow_person.mission.robot import Robot, build
from examples.follow_person.mission.world import World

__all__ = ["Robot", "World", "build"]

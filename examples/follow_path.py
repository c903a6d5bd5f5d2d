r"""A follower of paths is tuned: a robot whose wheels are slow and slip drives around corners.

    robot ══ path, pose ══> follow ── twist ──> limit ──┐
      ^──────────────────── command ────────────────────┘

Shown: a simulated plant, a score that is a state of a node, and a search that takes three seeds for each candidate.
`hfg run examples/follow_path.py --clock virtual` drives the path once. This searches for a better follower:

    hfg tune examples/follow_path.py --minimize robot.cost --seeds 1..3 --confirm 11..30 \
        -p follow.look_ahead=0.1..2 -p follow.speed=0.2..1.5 -p follow.slow=0.3..5 -p follow.turn_limit=0.5..4
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import hfg
from hfg.nodes.driving import LimitTwist, pure_pursuit
from hfg.nodes.estimation import Twist
from hfg.nodes.robotics import Pose, Positions

RATE_HZ = 10.0
CORNERS = np.array([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (1.0, 2.5), (0.0, 4.0), (2.0, 4.5), (4.0, 4.0)])


@dataclass
class Body:
    """Where the robot is and how it moves; its wheels need a third of a second to reach a velocity."""

    random: np.random.Generator
    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0
    speed: float = 0.0
    turning: float = 0.0
    deviations: list[float] = field(default_factory=list)

    def move(self, wanted: Twist, dt: float) -> None:
        self.speed += (wanted.vx - self.speed) * min(3 * dt, 1)
        self.turning += (wanted.omega - self.turning) * min(3 * dt, 1)
        slip, drift = self.random.normal(1, 0.1), self.random.normal(0, 0.1)
        self.theta += (self.turning * slip + self.speed * drift) * dt
        self.x += math.cos(self.theta) * self.speed * slip * dt
        self.y += math.sin(self.theta) * self.speed * slip * dt


class Robot(hfg.Node):
    """Drives with the last velocity that it received, and measures where it is, give or take a centimetre.

    The cost is the time to the end of the path in seconds, and one more second for each 2 cm of mean deviation.
    """

    seed = hfg.Parameter(1)
    path = hfg.Output(Positions)
    pose = hfg.Output(Pose)
    cost = hfg.State(0.0)
    body: hfg.State[Any] = hfg.State(None)
    wanted = hfg.State(Twist(0.0, 0.0, 0.0))

    def setup(self) -> None:
        self.body = Body(np.random.default_rng(self.seed))

    def process(self) -> None:
        body: Body = self.body
        body.move(self.wanted, 1 / RATE_HZ)
        body.deviations.append(deviation(body.x, body.y))
        self.cost = hfg.elapsed() + float(np.mean(body.deviations)) / 0.02
        if hfg.elapsed() > 60 or math.dist((body.x, body.y), CORNERS[-1]) < 0.15:
            raise hfg.EndOfStream
        noise = body.random.normal(0, 0.01, 3)
        self.path.send(CORNERS)
        self.pose.send(np.array([body.x, body.y, body.theta]) + noise)

    @hfg.slot
    def command(self, twist: Twist) -> None:
        self.wanted = twist


def deviation(x: float, y: float) -> float:
    """Return how far a place is from the path."""
    place, along = np.array([x, y]), np.diff(CORNERS, axis=0)
    share = np.clip(((place - CORNERS[:-1]) * along).sum(1) / (along * along).sum(1), 0, 1)
    return float(np.linalg.norm(CORNERS[:-1] + share[:, None] * along - place, axis=1).min())


def build() -> hfg.Graph:
    graph = hfg.Graph("follow_path")
    robot = graph.add(Robot(), name="robot", max_rate_hz=RATE_HZ)
    follow, limit = graph.add(pure_pursuit(), name="follow"), graph.add(LimitTwist(speed=1.5, turn=2.5), name="limit")
    graph.connect(robot.path, follow.path)
    graph.connect(robot.pose, follow.pose)
    graph.connect(follow.out, limit.twist)
    graph.connect(limit.limited, robot.command)
    return graph

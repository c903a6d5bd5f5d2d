"""Where the digits hang: sightings in the map frame, gathered in a mixture of Gaussians for each digit."""

from __future__ import annotations

import math
from typing import Any

import hfg
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, Station, wrapped
from hfg.nodes.robotics import Landmark, LandmarkMixture

BESIDE = 0.11  # the angle by which a digit hangs to the left of its bull's-eye, seen from the middle of the arena


def landmark(seen: Sighting, localised: Localised) -> Landmark:
    """Return a sighting in the map frame, with how sure it is: the pose is not, and far signs are small."""
    x, y = localised.place(seen.x, seen.y)
    arm = seen.distance**2 * float(localised.covariance[2, 2])
    pose = float(localised.covariance[0, 0] + localised.covariance[1, 1]) / 2
    sigma = math.sqrt((0.01 + 0.015 * seen.distance) ** 2 + pose + arm)
    heading = float(wrapped(seen.facing + localised.pose[2]))
    return Landmark(seen.label, x, y, heading, sigma)


def delivery_station(sign: Sign) -> Station:
    """Return the station that a digit belongs to: its bull's-eye hangs on the wall, to the right of the digit."""
    at, far = math.atan2(sign.y, sign.x) - BESIDE, math.hypot(sign.x, sign.y)
    x, y = far * math.cos(at), far * math.sin(at)
    return Station(x, y, float(wrapped(at + math.pi)), int(sign.sightings))


class SignMap(hfg.Node):
    """Learn where the digits are.

    Fires once for each list of sightings with the pose of its time. While the pose is in doubt nothing is learned: a
    robot that has lost itself would move all signs.

    Attributes:
      least: number of sightings that make a digit known.
      sightings: digits in the robot's frame.
      localised: where the robot was then.
      signs: the digits that are known, by their number.
      forget: the number of a digit that was not where it should be; 0 forgets all.
    """

    least = hfg.Parameter(2.0)
    sightings = hfg.Input(list[Sighting])
    localised = hfg.Input(Localised)
    signs = hfg.Output(dict[int, Sign])

    mixture: hfg.State[Any] = hfg.State(None)

    def setup(self) -> None:
        """Begin with no signs."""
        self.mixture = LandmarkMixture()

    def process(self, sightings: list[Sighting], localised: Localised) -> dict[int, Sign]:
        """Learn, and tell what is known."""
        if localised.sure:
            for one in sightings:
                seen = landmark(one, localised)
                if one.label.isdecimal() and abs(math.hypot(seen.x, seen.y) - localised.shape.apothem) < 0.6:
                    self.mixture.learn(seen)
        signs = {}
        for label, one in self.mixture.known(self.least).items():
            x, y, _ = localised.shape.on_wall(math.atan2(one.y, one.x))  # it hangs there, however far a camera says
            signs[int(label)] = Sign(x, y, one.heading, one.sigma, one.sightings)
        return signs

    @hfg.slot
    def forget(self, digit: int) -> None:
        """Forget a digit, or all."""
        self.mixture.forget(str(digit) if digit else None)

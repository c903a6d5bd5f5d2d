"""Where labelled things are: a mixture of Gaussians for each label, learned sighting by sighting.

Some sightings are of something else, or were made where the robot believed to be somewhere else. So each label has
several places where it may be, and a share of sightings that belong to none; the weight of a place is the number of its
sightings, and old ones fade.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from annotated_types import Interval

from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State, slot


class Landmark(NamedTuple):
    """Something with a label, in the map.

    Attributes:
      label: what it is; there is one of each.
      x: where it is, in metres.
      y: where it is.
      heading: into which direction it looks, in radians; NaN if that is unknown.
      sigma: how sure the place is, in metres; in each direction.
      sightings: on how many it stands; 1 for one.
    """

    label: str
    x: float
    y: float
    heading: float = math.nan
    sigma: float = 0.1
    sightings: float = 1.0


class _Place:
    """One Gaussian of a mixture, with the sum of the directions that were seen."""

    __slots__ = ("count", "look", "mean", "variance")

    def __init__(self, at: Any, variance: float, look: Any) -> None:
        self.mean, self.variance, self.count, self.look = at, variance, 1.0, look

    def learn(self, share: float, at: Any, variance: float, look: Any, *, least: float) -> None:
        """Take in a sighting that belongs to it by a share; it never becomes surer than `least`."""
        gain = share * self.variance / (self.variance + variance)
        self.mean = self.mean + gain * (at - self.mean)
        self.variance = max(self.variance * (1 - gain), least)
        self.look = self.look + share * look
        self.count += share

    def fade(self, by: float) -> None:
        """Another place of its label was seen."""
        if self.count > 0.1:
            self.count *= by


class LandmarkMixture:
    """The places of all labels; the plain part of `LandmarkMap`.

    Args:
      fading: what a place keeps of its count when another place of its label is seen.
      most: places for one label.
    """

    def __init__(self, *, fading: float = 0.95, most: int = 6) -> None:
        self.fading, self.most = fading, most
        self._places: dict[str, list[_Place]] = {}

    def learn(self, seen: Landmark, spread: float = 0.08, outliers: float = 0.1, area: float = 100.0) -> None:
        """Take in one sighting.

        Args:
          seen: with a sigma of its own.
          spread: how far sightings of one thing lie apart although they were thought exact, in metres.
          outliers: how many of the sightings belong to no place.
          area: over which those are spread, in square metres.
        """
        at, sigma = np.array([seen.x, seen.y]), max(seen.sigma, 1e-3)
        variance = sigma * sigma + spread * spread  # ** would raise where this is infinite
        if not (np.isfinite(at).all() and math.isfinite(variance)):
            return
        known = math.isfinite(seen.heading)
        look = np.array([math.cos(seen.heading), math.sin(seen.heading)]) if known else np.zeros(2)
        places = self._places.setdefault(seen.label, [])
        total = sum(one.count for one in places)
        likely = [
            (1 - outliers) * one.count / total * _density(at - one.mean, variance + one.variance) for one in places
        ]
        none = outliers / area
        shares = [one / (sum(likely) + none) for one in likely]
        if not places or none / (sum(likely) + none) > 0.5:
            places.append(_Place(at, variance, look))
            places.sort(key=lambda one: -one.count)
            del places[self.most :]
            shares = [0.0] * len(places)
        for one, share in zip(places, shares, strict=True):
            if share > 1e-3:
                # What is seen from one place errs in one direction: no number of sightings makes it quite sure.
                one.learn(share, at, variance, look, least=(spread / 5) ** 2)
            if share < 0.5:
                one.fade(self.fading)

    def known(self, least: float = 2.0, ahead: float = 0.6) -> dict[str, Landmark]:
        """Return the place of each label that is known.

        Args:
          least: number of sightings needed.
          ahead: which share of all sightings of its label the place must have.
        """
        found = {}
        for label in sorted(self._places):
            places = self._places[label]
            best = max(places, key=lambda one: one.count)
            if best.count >= least and best.count >= ahead * sum(one.count for one in places):
                heading = math.atan2(best.look[1], best.look[0]) if best.look.any() else math.nan
                x, y = map(float, best.mean)
                found[label] = Landmark(label, x, y, heading, math.sqrt(best.variance), best.count)
        return found

    def forget(self, label: str | None = None) -> None:
        """Forget where one thing is, or all."""
        if label is None:
            self._places.clear()
        else:
            self._places.pop(label, None)


def _density(off: Any, variance: float) -> float:
    return math.exp(-float(off @ off) / (2 * variance)) / (2 * math.pi * variance)


class LandmarkMap(Node):
    """Learn where labelled things are, from sightings of which some are wrong.

    Fires once per list of sightings. For each label there is a mixture of Gaussians, learned step by step, and a share
    of sightings that belong to none; a label is known when one place has enough sightings, and most of them.

    Attributes:
      least: number of sightings needed.
      ahead: which share of the sightings of its label a place must have.
      spread: how far sightings of one thing lie apart although they were thought exact, in metres.
      seen: things in the map frame, each with a sigma; one whose place is not a number is left out.
      known: the place of each label that is known.
      forget: the label of what is to be forgotten; "" forgets all.
    """

    least = Parameter(2.0, Interval(ge=1), unit="1")
    ahead = Parameter(0.6, Interval(gt=0, le=1), unit="1")
    spread = Parameter(0.08, Interval(gt=0), unit="m")
    seen = Input(list[Landmark])
    known = Output(dict[str, Landmark])

    mixture: State[LandmarkMixture] = State(factory=LandmarkMixture)

    def process(self, seen: list[Landmark]) -> dict[str, Landmark]:
        """Learn."""
        for one in seen:
            self.mixture.learn(one, self.spread)
        return self.mixture.known(self.least, self.ahead)

    @slot
    def forget(self, label: str) -> None:
        """Forget one thing, or all."""
        self.mixture.forget(label or None)

"""Where the robot is: odometry, corrected by laying each scan onto the map, which the robot makes meanwhile.

The arena looks the same after every turn by 45 degrees, and its wall, without the octagon, after every turn by 11.25.
So a robot that starts chooses one of the eight and keeps it. One that has lost itself keeps all of them in mind. Its
odometry, the octagon and the digits that it has learned say which one it is.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

import hfg
from examples.fetch_delivery.messages import Odometry, Scan
from examples.fetch_delivery.perception.mapping import Survey, circle_of, first_map
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, wrapped
from examples.fetch_delivery.perception.shape import FLAT, STEP, TURN, WALL_SIDES, Shape
from hfg.nodes.robotics import match_scan, scan_points

_FIRST: Final = np.diag([0.05**2, 0.05**2, 0.03**2])
_BAD: Final = 5  # scans in a row
_UNLIKELY: Final = -12.0
_FAR: Final = 8.0  # beyond that it does not matter how far: somebody has carried the robot
_MARGIN: Final = 3.0  # by how much the logarithm of one likelihood must be above that of the next
_WORST: Final = 4.0  # what one sighting can say against a place; a wrong one must not say all


class Localiser:
    """Follows the pose from scan to scan, and finds it again; the plain part of `Localise`.

    Attributes:
      pose: in the map; None before the robot has found itself.
      covariance: of the pose.
      quality: how much of the last scan the map explains.
      sure: whether it is the right one of the places that look the same.
      lost: whether the scans do not fit any more.
      survey: the map; None before there is one.
    """

    def __init__(self) -> None:
        self.pose: Any = None
        self.covariance: Any = _FIRST
        self.quality = 0.0
        self.sure = False
        self.lost = False
        self.survey: Survey | None = None
        self._odometry: Any = None
        self._bad = 0
        # How likely it is that the true pose is ours turned by so many steps around the middle of the arena.
        self._turned = np.full(WALL_SIDES, _UNLIKELY)
        self._turned[0] = 0.0

    def update(self, scan: Scan, odometry: Odometry) -> Localised | None:
        """Take a scan and the odometry of its time; give where the robot is, or None before it has found itself."""
        points = scan_points.function(scan.ranges, scan.angles, max_range=scan.max_range)
        self._predict(odometry.pose)
        if self.pose is None:
            self._begin(points)
        elif self.lost:
            self._search(points)
        else:
            self._follow(points)
        if self.pose is None or self.survey is None:
            return None
        if not self.sure and not self.lost:
            self._compare(points)
        elif not self._bad and not self.lost:
            self.survey.learn(points, self.pose)
        sure = self.sure and not self._bad  # from the first scan that does not fit, not only when it has given up
        return Localised(self.pose.copy(), self.covariance.copy(), self.quality, sure, scan.stamp, self.survey.shape)

    def seen(self, sightings: list[Sighting], signs: dict[int, Sign]) -> None:
        """Let digits whose places are known say which of the places that look the same is the right one."""
        if self.pose is None or self.lost:
            return
        told = False
        for one in sightings:
            sign = signs.get(int(one.label)) if one.label.isdecimal() else None
            if sign is None:
                continue
            told = True
            heading = self.pose[2]
            x = self.pose[0] + math.cos(heading) * one.x - math.sin(heading) * one.y
            y = self.pose[1] + math.sin(heading) * one.x + math.cos(heading) * one.y
            turns = np.arange(WALL_SIDES) * STEP
            across = np.cos(turns) * x - np.sin(turns) * y - sign.x
            up = np.sin(turns) * x + np.cos(turns) * y - sign.y
            deviation = 0.25**2 + sign.sigma**2 + (0.04 * one.distance) ** 2
            self._turned -= np.minimum((across**2 + up**2) / (2 * deviation), _WORST)
        if told:
            self._decide()

    def _predict(self, pose: Any) -> None:
        """Move as the wheels say; they slip, so each way makes the pose less sure."""
        before, self._odometry = self._odometry, np.array(pose, np.float64)
        if before is None or self.pose is None:
            return
        cos, sin = math.cos(before[2]), math.sin(before[2])
        dx, dy, turn = self._odometry - before
        ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
        cos, sin = math.cos(self.pose[2]), math.sin(self.pose[2])
        step = np.array([cos * ahead - sin * left, sin * ahead + cos * left, turn])
        change = np.array([[1, 0, -step[1]], [0, 1, step[0]], [0, 0, 1]])
        way = math.hypot(ahead, left)
        slip = (0.002 + 0.05 * way) ** 2, (0.002 + 0.05 * abs(turn) + 0.01 * way) ** 2
        self.covariance = change @ self.covariance @ change.T + np.diag([slip[0], slip[0], slip[1]])
        self.pose = self.pose + step
        self.pose[2] = wrapped(self.pose[2])

    def _begin(self, points: Any) -> None:
        """Measure the arena, and find the first pose: of those that look the same the one that looks nearest to 0."""
        shape = first_map(points)
        found = _alike(_places(points, shape)) if shape is not None else []
        if shape is None or not found:
            return
        self.survey = Survey(shape)
        pose = min((one for one, _ in found), key=lambda one: abs(one[2]))
        best = max(fit for _, fit in found)
        self.pose, self.covariance = pose, _FIRST
        # Which of the eight it is, the robot chooses; how the octagon lies to the wall it does not. So of
        # each kind one is kept in mind, until more of the octagon has been seen.
        kinds = {_apart(other, pose) % 4: (other, fit - best) for other, fit in found}
        self._weigh([kind for number, kind in kinds.items() if number])
        self._follow(points)

    @property
    def _shape(self) -> Shape:
        assert self.survey is not None  # as soon as there is a pose
        return self.survey.shape

    def _follow(self, points: Any) -> None:
        reach = min(0.4, 0.12 + 3 * math.sqrt(float(np.linalg.eigvalsh(self.covariance[:2, :2])[1])))
        match = match_scan.function(points, self.pose, self._shape.segments, self.covariance, reach=reach, rounds=8)
        quality = _quality(points, match.pose, self._shape)
        if quality > 0.6 and match.share > 0.25:
            self.pose, self.covariance, self.quality = match.pose, match.covariance, quality
            self._bad = 0
            return
        self.quality = quality
        self._bad += 1
        if self._bad >= _BAD:
            self.lost, self.sure = True, False

    def _search(self, points: Any) -> None:
        """Look everywhere, and prefer what is near to where odometry believes to be, as long as anything is.

        That has jumped, or somebody has pushed the robot: by half a metre more likely than by three.
        """
        found = _alike(_places(points, self._shape))
        if not found:
            return
        spread = self.covariance + np.diag([0.5**2, 0.5**2, 0.4**2])
        inverse = np.linalg.inv(spread)
        likely = []
        for pose, fit in found:
            off = pose - self.pose
            off[2] = wrapped(off[2])
            likely.append(fit - min(float(off @ inverse @ off) / 2, _FAR))
        best = int(np.argmax(likely))
        self.pose = found[best][0]
        self.covariance, self._bad, self.lost = _FIRST, 0, False
        self.quality = _quality(points, self.pose, self._shape)
        self._weigh([(pose, one - likely[best]) for (pose, _), one in zip(found, likely, strict=True)])

    def _weigh(self, others: list[tuple[Any, float]]) -> None:
        """Begin anew with how likely other places are that look the same, as logarithms against the present one."""
        self._turned = np.full(WALL_SIDES, _UNLIKELY)
        for pose, likely in others:
            turn = _apart(pose, self.pose)
            self._turned[turn] = max(self._turned[turn], likely)
        self._turned[0] = 0.0
        self._decide()

    def _compare(self, points: Any) -> None:
        """While in doubt, let the octagon speak: in a place where it would not fit, the robot is not."""
        fits = [_fit(points, _turned(self.pose, turn), self._shape) for turn in range(4)]
        self._turned += np.tile(np.array(fits) - fits[0], 8)  # the arena looks the same after each fourth turn
        self._decide()

    def _decide(self) -> None:
        """Go over to the likeliest of the places that look the same; be sure if it is so by far."""
        best = int(np.argmax(self._turned))
        if best and self._turned[best] > self._turned[0] + _MARGIN:
            self.pose = _turned(self.pose, best)
            turn = best * STEP
            change = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
            self.covariance = change @ self.covariance @ change.T
            self._turned = np.roll(self._turned, -best)
        self._turned = np.maximum(self._turned - self._turned.max(), _UNLIKELY)
        others = self._turned[1:].max()
        self.sure = bool(self._turned[0] - others >= _MARGIN)

    def accept(self) -> None:
        """Take the present place for the right one: where nothing has been learned yet, all are as good."""
        self._turned[:] = _UNLIKELY
        self._turned[0] = 0.0
        self.sure = self.pose is not None and not self.lost


def _alike(found: list[tuple[Any, float]]) -> list[tuple[Any, float]]:
    """Return those that fit about as well as the best."""
    best = max((fit for _, fit in found), default=0.0)
    return [one for one in found if one[1] > best - 2 * _MARGIN]


def _apart(pose: Any, other: Any) -> int:
    """Return by how many steps a pose is turned around the middle of the arena, against another that looks the same."""
    return round(float(wrapped(pose[2] - other[2])) / STEP) % WALL_SIDES


def _turned(pose: Any, steps: int) -> Any:
    """Return a pose after a turn around the middle of the arena."""
    turn = steps * STEP
    cos, sin = math.cos(turn), math.sin(turn)
    return np.array([cos * pose[0] - sin * pose[1], sin * pose[0] + cos * pose[1], wrapped(pose[2] + turn)])


def _quality(points: Any, pose: Any, shape: Shape) -> float:
    """Return how many of the points lie on the shape, of those that nothing else can explain.

    Something in free space may be another robot. What lies beyond the wall or within the octagon, or on neither
    although the octagon would have been in the way, speaks against the pose.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    places = points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]
    inside, outside = shape.distances(places)
    on = (np.abs(inside) < 0.08) | (np.abs(outside) < 0.08)
    wrong = (inside < -0.15) | (outside < -0.15)
    through = _crosses_octagon(places, pose, shape.octagon) & ~wrong & ~(np.abs(outside) < 0.15)
    told = int(on.sum()) + int(wrong.sum()) + int(through.sum())
    return float((on & ~through).sum() / told) if told else 0.0


def _fit(points: Any, pose: Any, shape: Shape) -> float:
    """Return the logarithm of how likely the points are from a pose; what lies far off says no more than what is off.

    Neighbouring beams err alike, so they count as a fifth of what they would count for by themselves.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    inside, outside = shape.distances(points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2])
    near = np.minimum(np.abs(inside), np.abs(outside)) / 0.025
    return -0.2 * float(np.minimum(near * near / 2, 4.5).sum())


def _crosses_octagon(places: Any, pose: Any, octagon: float) -> Any:
    """Say which beams would have had to go through the middle of the octagon."""
    rays = places - pose[:2]
    length = np.maximum((rays**2).sum(1), 1e-9)
    share = np.clip(-(rays @ pose[:2]) / length, 0, 1)
    nearest = pose[:2] + share[:, None] * rays
    return np.hypot(nearest[:, 0], nearest[:, 1]) < octagon - 0.15


def _places(points: Any, shape: Shape) -> list[tuple[Any, float]]:
    """Find all poses from which the arena would look like this, with how well it does."""
    middle = circle_of(points, shape.radius * (1 + FLAT) / 2)
    if middle is None:
        return []
    some = points[:: max(1, len(points) // 120)]
    headings = np.arange(0, TURN, math.radians(0.75))
    cos, sin = np.cos(headings)[:, None], np.sin(headings)[:, None]
    across, up = some[:, 0] - middle[0], some[:, 1] - middle[1]
    inside, outside = shape.distances(np.stack([cos * across - sin * up, sin * across + cos * up], 2))
    near = np.minimum(np.abs(inside), np.abs(outside))
    fits = np.exp(-((near / 0.03) ** 2) / 2).mean(1)
    peaks = np.flatnonzero((fits >= np.roll(fits, 1)) & (fits >= np.roll(fits, -1)) & (fits > fits.max() * 0.7))
    found: list[tuple[Any, float]] = []
    for peak in peaks[np.argsort(-fits[peaks], kind="stable")][:6].tolist():
        heading = float(headings[peak])
        turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
        guess = np.append(-turn @ middle, heading)
        match = match_scan.function(points, guess, shape.segments, np.diag([0.01, 0.01, 0.003]), reach=0.15)
        quality = _quality(points, match.pose, shape)
        if quality < 0.75 or match.share < 0.3:
            continue
        if any(np.abs(wrapped(match.pose[2] - other[2])) < 0.05 for other, _ in found):
            continue
        found.append((match.pose, _fit(points, match.pose, shape)))
    return [(_turned(pose, 4 * turn), fit) for pose, fit in found for turn in range(8)]


class Localise(hfg.Node):
    """Find out where the robot is, from scans and odometry.

    Fires once for each scan with its odometry; it is silent before it has found the robot for the first time.

    Attributes:
      scan: of the laser.
      odometry: of the same time.
      localised: the pose in the map frame, and how sure it is.
      signs: where digits are, as `SignMap` has learned it; they tell places apart that look the same.
      sightings: digits that are seen now.
      lost: the scans do not fit any more; it looks for itself.
      found: it is sure again.
    """

    scan = hfg.Input(Scan)
    odometry = hfg.Input(Odometry)
    localised = hfg.Output(Localised)
    lost = hfg.Event()
    found = hfg.Event()

    localiser: hfg.State[Any] = hfg.State(None)
    known: hfg.State[dict[int, Sign]] = hfg.State({})
    was_sure = hfg.State(False)

    def setup(self) -> None:
        """Begin without a pose."""
        self.localiser = Localiser()

    def process(self, scan: Scan, odometry: Odometry) -> Localised | None:
        """Follow the robot."""
        localised: Localised | None = self.localiser.update(scan, odometry)
        if localised is not None and not localised.sure and not self.known:
            self.localiser.accept()
        self._tell()
        return localised

    @hfg.slot
    def signs(self, signs: dict[int, Sign]) -> None:
        """Keep where digits are."""
        self.known = signs

    @hfg.slot
    def sightings(self, sightings: list[Sighting]) -> None:
        """Compare what is seen with where it should be."""
        self.localiser.seen(sightings, self.known)
        self._tell()

    def _tell(self) -> None:
        sure = self.localiser.sure
        if sure != self.was_sure:
            self.was_sure = sure
            (self.found if sure else self.lost).trigger()

"""The person who is followed: PersonDetection chooses, ObjectTracking keeps (figures 22 and 24)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from annotated_types import Interval

import hfg
from examples.follow_person.perception.clothes import is_in
from examples.follow_person.perception.records import Look, Person, Scene
from hfg.nodes.estimation import Track

_STEP_M, _STEPS = 0.3, 60  # of a trail
_CROWDED_M = 1.2  # so near to another person the clothes of the person are not learned


class PersonDetection(hfg.Node):
    """Find a person to follow: whoever is ahead, or the one who was lost.

    Attributes:
      alike: clothes that differ by less are the same.
      nearest: how far away a person who is chosen at the start may be.
      patience: after this time without success, it is worth going where the person was seen last.
      scene: who is around.
      looks: what they wear.
      people: boxes of people in a picture, and the picture with the scene of that moment.
      begin: choose whoever is ahead.
      find: a person who was lost.
      person: found.
      gone: not found for a while; the person as seen last.
    """

    alike = hfg.Parameter(0.07, Interval(gt=0, le=2), unit="1")
    nearest = hfg.Parameter(6.0, Interval(gt=0, le=20), unit="m")
    patience = hfg.Parameter(0.6, Interval(gt=0, le=60), unit="s")
    scene = hfg.Input(Scene)
    person = hfg.Event(Person)
    gone = hfg.Event(Person)

    wanted: hfg.State[Person | None] = hfg.State(None)
    since: hfg.State[float | None] = hfg.State(None)
    wears: hfg.State[dict[int, Look]] = hfg.State(factory=dict[int, Look])

    def process(self, scene: Scene) -> None:
        """Look for the one who was lost; by the clothes."""
        if self.wanted is None:
            return
        if self.since is None:
            self.since = scene.stamp
        best = min(
            (one for one in scene.tracks if one.missed == 0 and self._off(one) < self.alike),
            key=self._off,
            default=None,
        )
        if best is not None:
            look = self.wanted.look
            self.person.trigger(Person(best.number, best.x, best.y, best.vx, best.vy, scene.stamp, look))
        elif scene.stamp - self.since > self.patience:
            self.since = None
            self.gone.trigger(self.wanted)

    def _off(self, track: Track) -> float:
        look = self.wears.get(track.number)
        if look is None or self.wanted is None or self.wanted.look is None:
            return math.inf
        return look.differs(self.wanted.look)

    @hfg.slot
    def looks(self, looks: dict[int, Look]) -> None:
        """Keep them."""
        self.wears = looks

    @hfg.slot(while_active=True)
    def people(self, people: list[Any]) -> None:
        """Choose the one whom the detector is surest of, among those whom the camera and the laser both see."""
        boxes, (photo, scene) = people
        if self.wanted is not None:
            return
        ahead = []
        for one in scene.tracks:
            top = scene.tops.get(one.number)
            far = math.dist(scene.pose[:2], (one.x, one.y))
            if top is None or far > self.nearest:
                continue
            for order, box in enumerate(boxes):
                if is_in(box, photo.camera, scene, one.x, one.y, top):
                    ahead.append((order, far, one))
        if ahead:
            _, _, one = min(ahead)
            look = self.wears.get(one.number)
            self.person.trigger(Person(one.number, one.x, one.y, one.vx, one.vy, scene.stamp, look))

    @hfg.slot
    def begin(self) -> None:
        """Choose again."""
        self.wanted = None

    @hfg.slot(while_active=True)
    def find(self, person: Person) -> None:
        """Look for this one."""
        if person is not self.wanted:
            self.wanted, self.since = person, None


def _longer(trail: tuple[tuple[float, float], ...], x: float, y: float) -> tuple[tuple[float, float], ...]:
    """Return a trail with one more place, if that is a step away from the last one."""
    if trail and math.dist(trail[-1], (x, y)) < _STEP_M:
        return trail
    return (*trail[-_STEPS:], (x, y))


class ObjectTracking(hfg.Node):
    """Keep to one person among the tracks, through crossings and short gaps.

    Attributes:
      alike: clothes that differ by less are the same.
      unlike: clothes that differ by more are another person's.
      coasts: how long the person is assumed to walk on when out of sight.
      gives_up: after this time out of sight the person is lost.
      scene: who is around.
      looks: what they wear.
      begin: where activity comes back.
      found: whom to follow.
      person: where the person is, with every scene.
      lost: the person, as seen last, as long as lost.
    """

    alike = hfg.Parameter(0.07, Interval(gt=0, le=2), unit="1")
    unlike = hfg.Parameter(0.12, Interval(gt=0, le=2), unit="1")
    coasts = hfg.Parameter(2.0, Interval(ge=0, le=60), unit="s")
    gives_up = hfg.Parameter(2.0, Interval(gt=0, le=60), unit="s")
    scene = hfg.Input(Scene)
    person = hfg.Event(Person)
    lost = hfg.Event(Person)

    followed: hfg.State[Person | None] = hfg.State(None)
    newest: hfg.State[Scene | None] = hfg.State(None)
    wears: hfg.State[dict[int, Look]] = hfg.State(factory=dict[int, Look])

    def process(self, scene: Scene) -> None:
        """Follow the track; take another one if it has ended, or if another person has got into it."""
        known, self.newest = self.followed, scene
        if known is None:
            return
        gap = scene.stamp - known.stamp
        if gap > self.gives_up:
            self.lost.trigger(known)
            return
        own = next((one for one in scene.tracks if one.number == known.track and one.missed == 0), None)
        if own is None or self._is_unlike(own):
            other = self._other(scene, known, gap)
            own = other if other is not None or own is None or self._is_unlike(own) else own
        if own is None:
            if gap <= self.coasts:
                x, y = known.at(scene.stamp)
                self.person.trigger(replace(known, x=x, y=y, stamp=scene.stamp, is_seen=False))
            return
        look = self._learned(own, known, scene)
        trail = _longer(known.trail, own.x, own.y)
        self.followed = Person(own.number, own.x, own.y, own.vx, own.vy, scene.stamp, look, trail=trail)
        self.person.trigger(self.followed)

    def _other(self, scene: Scene, known: Person, gap: float) -> Track | None:
        """Return the track that is most likely the person, near where the person should be."""
        x, y = known.at(scene.stamp)
        reach = min(0.7 + 1.2 * gap, 3.0)
        best, least = None, math.inf
        for one in scene.tracks:
            if one.missed or self._is_unlike(one):
                continue
            far = math.dist((x, y), (one.x, one.y))
            off = self._off(one)
            is_alike = off < self.alike
            if far > reach or not (is_alike or (one.moves and math.isinf(off))):
                continue
            cost = far + (0.0 if is_alike else 1.0)
            if cost < least:
                best, least = one, cost
        return best

    def _off(self, track: Track) -> float:
        look = self.wears.get(track.number)
        if look is None or self.followed is None or self.followed.look is None:
            return math.inf
        return look.differs(self.followed.look)

    def _is_unlike(self, track: Track) -> bool:
        look = self.wears.get(track.number)
        off = self._off(track)
        return look is not None and look.seen >= 2 and not math.isinf(off) and off > self.unlike

    def _learned(self, own: Track, known: Person, scene: Scene) -> Look | None:
        """Return what the person wears: learned when no one else is near."""
        now = self.wears.get(own.number)
        if now is None or now.seen < 2:
            return known.look
        if known.look is None:
            return now
        others = (one for one in scene.tracks if one.number != own.number)
        if any(math.dist((one.x, one.y), (own.x, own.y)) < _CROWDED_M for one in others):
            return known.look
        return known.look.mixed(now, 0.01) if now.differs(known.look) < self.alike else known.look

    @hfg.slot
    def looks(self, looks: dict[int, Look]) -> None:
        """Keep them."""
        self.wears = looks

    @hfg.slot
    def found(self, person: Person) -> None:
        """Follow this one."""
        trail = () if self.followed is None else self.followed.trail
        self.followed = replace(person, trail=_longer(trail, person.x, person.y))

    @hfg.slot
    def begin(self) -> None:
        """Take the activity."""

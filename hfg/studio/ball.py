"""The first graph of a new user: a camera sees a ball that rolls over a table, and a mission follows it.

Everything is simulated, so it runs on any computer. Depends on the graph, `hfg.panels` and the library's nodes.
"""

from __future__ import annotations

import asyncio
import math
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from annotated_types import Interval

from hfg.base import clock
from hfg.graph import Graph, Subgraph
from hfg.images import Gray
from hfg.nodes import activity
from hfg.nodetypes.node import Node
from hfg.panels import Call, Change, Look, Scene, view
from hfg.ports import Event, Input, Output, Parameter, State, slot

__all__ = ["Aim", "Camera", "Find", "Follow", "Keep", "Push", "Search", "Spot", "build"]

_WIDTH: Final = 320
_HEIGHT: Final = 200
_RADIUS: Final = 14
_CURTAIN: Final = 232
_RATE_HZ: Final = 15.0
_GONE_S: Final = 0.4
_SMALLEST: Final = 60
"""Pixels that are bright enough, so that a glint is not a ball."""


class Spot(NamedTuple):
    """Where a ball was seen, in pixels from the upper left corner."""

    x: float
    y: float
    radius: float


class Push(NamedTuple):
    """A push; 1 doubles the speed at first."""

    strength: Annotated[float, Interval(ge=0, le=3)] = 1.0


class Camera(Node):
    """Send pictures of a table, on which a ball rolls and now and then disappears under a curtain.

    Attributes:
      speed: how fast the ball rolls; 0 stops it.
      curtain: hide the right side of the table.
      picture: what the camera sees.
    """

    speed = Parameter(1.0, Interval(ge=0, le=3))
    curtain = Parameter(True)
    picture = Output(Gray)

    ball_at = State((60.0, 70.0))
    way = State((5.2, 3.1))
    pushed = State(0.0)

    without_curtain = Change(
        "Take the curtain away", {"curtain": False}, "The ball is never hidden, so it is not lost."
    )
    push_it = Call("Push the ball", "push", "It rolls faster for a moment.")

    def process(self) -> None:
        """Let the ball roll on, and take a picture."""
        by = self.speed * (1 + self.pushed)
        self.pushed *= 0.95
        x, across = _bounced(self.ball_at[0] + by * self.way[0], self.way[0], _WIDTH)
        y, down = _bounced(self.ball_at[1] + by * self.way[1], self.way[1], _HEIGHT)
        self.ball_at, self.way = (x, y), (across, down)
        self.picture.send(_painted(x, y, curtain=self.curtain))

    @slot
    def push(self, push: Push) -> None:
        """Push the ball."""
        self.pushed += push.strength


def _bounced(at: float, way: float, size: int) -> tuple[float, float]:
    """Turn back at an edge of the table."""
    least, most = float(_RADIUS), float(size - _RADIUS)
    if at < least:
        return min(2 * least - at, most), abs(way)
    if at > most:
        return max(2 * most - at, least), -abs(way)
    return at, way


_Y, _X = np.mgrid[0:_HEIGHT, 0:_WIDTH].astype(np.float32)
_TABLE: Final = (52 + 10 * np.sin(_X / 23) * np.cos(_Y / 31) - 0.02 * (_X - 160) ** 2 / 16).astype(np.float32)
_FOLDS: Final = (104 + 14 * np.sin(_X / 5)).astype(np.uint8)


def _painted(x: float, y: float, *, curtain: bool) -> npt.NDArray[np.uint8]:
    distance = np.hypot(_X - x, _Y - y)
    shaded = 245 - 70 * np.hypot(_X - x + 5, _Y - y + 5) / _RADIUS
    shadow = np.where(np.hypot(_X - x - 6, _Y - y - 8) < _RADIUS, 0.6, 1.0)
    image: npt.NDArray[np.uint8] = np.where(distance < _RADIUS, shaded, _TABLE * shadow).clip(0, 255).astype(np.uint8)
    if curtain:
        image[:, _CURTAIN:] = _FOLDS[:, _CURTAIN:]
    image.flags.writeable = False
    return image


class Find(Node):
    """Find the ball: what is brighter than everything else.

    Attributes:
      brightness: pixels of the ball are at least so bright.
      seen: where the ball is, if it is in the picture.
      across: how far it is from the left, in pixels.
    """

    picture = Input(Gray)
    brightness = Parameter(150, Interval(ge=0, le=255))
    seen = Event(Spot)
    across = Output(float)

    def process(self, picture: npt.NDArray[np.uint8]) -> None:
        """Look for it."""
        rows, columns = np.nonzero(picture >= self.brightness)
        if len(rows) < _SMALLEST:
            return
        x, y = float(columns.mean()), float(rows.mean())
        self.across.send(x)
        self.seen.trigger(Spot(x, y, math.sqrt(len(rows) / math.pi)))

    @view("What the camera sees")
    def found(self, look: Look) -> Scene | None:
        """The picture, with a ring around the ball that was found."""
        picture, spot = look.latest("picture"), look.latest("seen")
        if picture is None:
            return None
        scene = Scene(0, _HEIGHT, _WIDTH, 0, caption=_words(spot))
        scene.image(picture, 0, _HEIGHT, _WIDTH, 0)
        if spot is not None:
            scene.disc((spot.x, spot.y), spot.radius + 5, line="good", width=2)
        return scene


def _words(spot: Any) -> str:
    return "nothing was found yet" if spot is None else f"the ball was seen at {spot.x:.0f}, {spot.y:.0f}"


class Search(Node):
    """Wait until the ball is seen.

    Attributes:
      found: it is there.
    """

    found = Event(Spot)

    @slot
    def begin(self) -> None:
        """Receive the activity."""

    @slot
    def see(self, spot: Spot) -> None:
        """Hand the activity on, with the place of the ball."""
        if self.active:
            self.found.trigger(spot)


class _Watching(Node):
    """Notice when the ball was not seen for a while."""

    lost = Event()
    news = State(factory=asyncio.Event)

    @slot
    def see(self, spot: Spot) -> None:
        """Note that the ball is still there."""
        self.news.set()

    async def watch(self, seconds: float = math.inf) -> bool:
        """Return whether the ball was seen for so long; as soon as it is gone, return False."""
        end = clock.elapsed() + seconds
        while (left := end - clock.elapsed()) > 0:
            self.news.clear()
            try:
                async with asyncio.timeout(min(left, _GONE_S)):
                    await self.news.wait()
            except TimeoutError:
                return left <= _GONE_S
        return True


class Aim(_Watching):
    """Look at the ball for a moment, to be sure.

    Attributes:
      patience: how long to look.
      sure: sent if it was there all the time.
      lost: sent if it is gone.
    """

    patience = Parameter(1.0, Interval(gt=0, le=10), unit="s")
    sure = Event()

    @slot
    def begin(self, spot: Spot) -> None:
        """Receive the activity."""

    async def do(self) -> None:
        """Look."""
        if await self.watch(self.patience):
            self.sure.trigger()
        else:
            self.lost.trigger()


class Keep(_Watching):
    """Follow the ball until it is gone.

    Attributes:
      lost: sent when it is gone.
    """

    @slot
    def begin(self) -> None:
        """Receive the activity."""

    async def do(self) -> None:
        """Look."""
        await self.watch()
        self.lost.trigger()


class Follow(Subgraph):
    """Follow the ball: aim first, then keep it in sight.

    Attributes:
      patience: how long it aims.
      lost: the ball is gone.
      tired: it was followed long enough.
    """

    patience = Parameter(1.0, Interval(gt=0, le=10), unit="s")
    begin = slot(type=Spot)
    see = slot(type=Spot)
    lost = Event()
    tired = Event()

    def build(self, graph: Graph) -> None:
        """Put one after the other."""
        aim = graph.add(Aim(), name="aim")
        keep = graph.add(Keep(), name="keep", active_for_s=4)
        graph.promote(self.patience, aim.ports.parameters["patience"])
        self.begin.inner.activates(aim.begin)
        aim.sure.activates(keep.begin)
        for node in (aim, keep):
            graph.connect(self.see.inner, node.see)
            node.lost.activates(self.lost.inner)
        keep.timeout.activates(self.tired.inner)


def build() -> Graph:
    """Put the camera next to the mission."""
    graph = Graph("ball")
    camera = graph.add(Camera(), name="camera", max_rate_hz=_RATE_HZ)
    find = graph.add(Find(), name="find")
    graph.connect(camera.picture, find.picture)
    search, rest = graph.add(Search(), name="search"), graph.add(activity.Wait(seconds=1.5), name="rest")
    follow = graph.add(Follow(), name="follow")
    for node in (search, follow):
        graph.connect(find.seen, node.see)
    graph.start.activates(search.begin)
    search.found.activates(follow.begin)
    follow.lost.activates(search.begin)
    follow.tired.activates(rest.begin)
    rest.done.activates(search.begin)
    return graph

"""One report about a run: begun with the run, and whole however that ends."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

import hfg
from examples.follow_person.judging import Judge
from examples.follow_person.messages import Photo, Picture
from examples.follow_person.perception.clothes import box_of
from examples.follow_person.running import Result
from examples.follow_person.showing import drawing
from examples.follow_person.world import Simulation
from hfg.trace import TokenSent, TraceEvent

_EVERY_S: Final = 0.2
_MOST_MOMENTS: Final = 6
LIMITS_M: Final = (2.0, 8.0)
"""Between these the distance from the person should be."""


class Showing:
    """Looks at a run and reports it in a folder: `report.html`, `map.svg`.

    Attributes:
      page: the report.
    """

    def __init__(self, folder: Path, graph: hfg.Graph) -> None:
        """Open the files.

        Args:
          folder: where; it is made.
          graph: with the world as its node `world` and the robot as `robot`.

        Raises:
          OSError: nothing can be written there.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.page = folder / "report.html"
        self._folder, self._graph = folder, graph
        self._robot: list[tuple[float, float]] = []
        self._person: list[tuple[float, float]] = []
        self._believed: list[tuple[float, float]] = []
        self._rows: list[tuple[float, float, float, float]] = []
        self._moments: list[tuple[float, str, Picture]] = []
        self._gap_s = 5.0
        self._obstacles: Any = None
        self._photo: Photo | None = None
        self._began: tuple[float, float, float] | None = None
        self._judge: Judge | None = None
        self._report: Any = None
        self._timer: asyncio.TimerHandle | None = None

    def begin(self, run: hfg.Run, judge: Judge) -> None:
        """Look at a run from its beginning."""
        self._judge = judge
        self._report = run.report_page(self.page, pictures=0)
        run.trace(self._take)
        self._timer = asyncio.get_running_loop().call_later(_EVERY_S, self._look)

    def end(self, result: Result) -> None:
        """Finish all files, with whatever there is by now."""
        if self._timer is not None:
            self._timer.cancel()
        if self._report is None or not self._rows:
            return
        self._fill(result)
        self._report.write()

    # --- while it runs

    @property
    def _simulation(self) -> Simulation:
        world: Any = self._graph["world"]
        simulation: Simulation = world.simulation
        return simulation

    def _take(self, event: TraceEvent) -> None:
        if not isinstance(event, TokenSent):
            return
        if event.edge.startswith("world.photo"):
            self._photo = event.token.value
        elif event.edge.startswith("robot/perception/ground.obstacles"):
            value: Any = event.token.value
            self._obstacles = getattr(value, "points", self._obstacles)

    def _look(self) -> None:
        simulation = self._simulation
        robot, person = simulation.robot, simulation.people.person
        self._began = self._began or (robot.x, robot.y, robot.theta)
        self._robot.append((robot.x, robot.y))
        self._person.append((person.x, person.y))
        self._rows.append((simulation.now_s, simulation.distance(), robot.speed, person.speed))
        tracking: Any = self._graph["robot/object_tracking"]
        scene = tracking.newest
        if scene is not None:
            x, y, theta = self._began
            cos, sin = math.cos(theta), math.sin(theta)
            dx, dy = scene.pose[:2]
            self._believed.append((x + cos * dx - sin * dy, y + sin * dx + cos * dy))
            self._show_moment(scene, tracking.followed)
        world: Any = self._graph["world"]
        if not world.is_over:
            self._timer = asyncio.get_running_loop().call_later(_EVERY_S, self._look)

    def _show_moment(self, scene: Any, followed: Any) -> None:
        now = self._simulation.now_s
        late = self._moments and now - self._moments[-1][0] < self._gap_s
        if late or self._photo is None or self._obstacles is None or abs(self._photo.stamp - scene.stamp) > 1e-6:
            return
        path = None
        for name in ("follow_fast", "follow_slow"):
            follow: Any = self._graph[f"robot/{name}/follow"]
            path = follow.way if follow.active else path
        drawn = drawing.moment(scene, self._obstacles[:, :2], followed, path)
        self._moments.append((now, drawn, _marked(self._photo, scene, followed)))
        while len(self._moments) > _MOST_MOMENTS:
            del self._moments[1::2]
            self._gap_s *= 2

    # --- when it is over

    def _fill(self, result: Result) -> None:
        page = self._report
        page.add_text(
            "How it went", "\n\n".join([*str(result).splitlines(), *([result.error] if result.error else [])])
        )
        self._put_figures(result)
        lost = self._judge.lost_at if self._judge is not None else []
        places = [self._robot[min(int(at_s / _EVERY_S), len(self._robot) - 1)] for at_s, _ in lost]
        drawn = drawing.course_map(
            self._simulation.course,
            drawing.points_of(self._robot),
            drawing.points_of(self._person),
            drawing.points_of(self._believed),
            drawing.points_of(places),
        )
        (self._folder / "map.svg").write_text(drawn, encoding="utf-8")
        page.add_picture("The way (figure 25)", drawn, caption="map.svg. The robot has no map; it drifts.")
        times, distances, robot, person = np.array(self._rows).T
        page.add_picture(
            "Distance and speed",
            drawing.curves(times, distances, robot, person, LIMITS_M),
            caption="Dashed: between these the distance should be.",
        )
        section = "What the sensors saw, and what was found in it (figure 21)"
        for at_s, above, photo in self._moments:
            caption = f"{at_s:.1f} s. Red: obstacles. Circles: tracks. Orange: the person and a second of walking."
            page.add_picture(section, above, caption=caption, at_s=at_s)
            page.add_picture(section, photo, caption=f"{at_s:.1f} s, the camera", at_s=at_s)
        robot_node: Any = self._graph["robot"]
        page.add_drawing("The mission (figure 24)", robot_node.graph, depth=0, caption="Outlined is what is active.")
        page.add_drawing("FollowPerson (figure 23)", self._inside("follow_fast"), caption="The same for follow_slow.")

    def _inside(self, name: str) -> hfg.Graph:
        node: Any = self._graph[f"robot/{name}"]
        graph: hfg.Graph = node.graph
        return graph

    def _put_figures(self, result: Result) -> None:
        score, verdict = result.score, result.verdict
        if score is None or not score.distances:
            return
        far, fast = np.array(score.distances), np.array(score.speeds)
        inside = float(np.mean((far >= LIMITS_M[0]) & (far <= LIMITS_M[1])))
        rows = [
            ("followed, m", "1700", round(score.walked_m)),
            ("greatest speed, m/s", "2.5", round(float(fast.max()), 2)),
            ("mean speed, m/s", "", round(float(fast.mean()), 2)),
            ("distance, m", "", f"{far.min():.1f} to {far.max():.1f}, mean {far.mean():.1f}"),
            ("share of the time between 2 and 8 m, %", "", round(100 * inside, 1)),
            ("contacts", "", score.contacts),
            ("follow_slow, % of the time", "rarely", round(100 * verdict.slow_share, 1)),
            ("lost", "", verdict.lost),
            ("found again after, s, at most", "", round(verdict.longest_lost_s, 1)),
            ("crossings, person kept", "", f"{verdict.kept} of {verdict.crossings}"),
        ]
        self._report.add_table("How it went", ("", "the paper", "this run"), rows)


def _marked(photo: Photo, scene: Any, followed: Any) -> Picture:
    """Draw a box around the person."""
    picture = photo.picture.copy()
    if followed is not None:
        top = scene.tops.get(followed.track, 1.7)
        box = box_of(photo.camera, scene, followed.x, followed.y, (top - 1.72, top), 0.3)
        if box is not None:
            left, upper, right, lower = (round(one) for one in box)
            cv2.rectangle(picture, (left, upper), (right, lower), (40, 84, 217), 2, cv2.LINE_AA)
    return picture

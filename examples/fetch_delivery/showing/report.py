"""One report about a mission, and the files that it is made of: begun with the run, and whole however that ends."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any, Final

import numpy as np

import hfg
from examples.fetch_delivery.messages import Picture
from examples.fetch_delivery.running import Result
from examples.fetch_delivery.showing import cameras
from examples.fetch_delivery.showing.observing import Observer
from examples.fetch_delivery.showing.top_view import SIZE, TopView
from examples.fetch_delivery.showing.video import VideoFile
from examples.fetch_delivery.showing.ways import ways
from examples.fetch_delivery.world import Simulation

RATE_HZ: Final = 10.0  # of the video
_EVERY_S: Final = 0.2  # of the arena's time, so the video runs at twice its speed
_MOST_PICTURES: Final = 1000  # of the video; a longer mission has fewer a second
_MOST_LOOKS: Final = 12  # pictures of cameras in the report


class _Looks:
    """Some of the pictures that were taken, evenly spread."""

    def __init__(self, most: int) -> None:
        self.kept: list[tuple[float, str, Picture]] = []
        self._most, self._gap_s = most, 1.0

    def add(self, at_s: float, says: str, picture: Picture) -> None:
        self.kept.append((at_s, says, picture))
        while len(self.kept) > self._most:
            del self.kept[1::2]
            self._gap_s *= 2

    def wants(self, at_s: float) -> bool:
        return not self.kept or at_s - self.kept[-1][0] >= self._gap_s


class Showing:
    """Looks at a mission and reports it in a folder: `report.html`, `video.webm`, `ways.svg`.

    Attributes:
      page: the report.
      notes: what could not be shown, in sentences.
      is_whole: nothing is missing because a file could not be written.
    """

    def __init__(self, folder: Path, graph: hfg.Graph, seed: int, robots: int, seconds: float) -> None:
        """Open the files.

        Args:
          folder: where; it is made.
          graph: of the mission, with the arena as its node `world`.
          seed: of the arena.
          robots: how many there are.
          seconds: how long the mission will be at most.

        Raises:
          OSError: nothing can be written there.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.page = folder / "report.html"
        self.notes: list[str] = []
        self.is_whole = True
        self._folder, self._graph, self._seed, self._robots = folder, graph, seed, robots
        self._every_s = max(_EVERY_S, round(seconds / _MOST_PICTURES, 1))
        self._video = VideoFile(folder, "video", SIZE, RATE_HZ)
        self._observer = Observer(lambda: self._simulation, robots)
        self._observer.looked, self._observer.read = self._looked, self._read
        self._ahead = [_Looks(max(_MOST_LOOKS // robots, 3)) for _ in range(robots)]
        self._baskets = _Looks(_MOST_LOOKS // 2)
        self._view: TopView | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._report: Any = None

    def begin(self, run: hfg.Run) -> None:
        """Look at a run from its beginning."""
        self._report = run.report_page(self.page, pictures=0)
        run.trace(self._observer)
        self._timer = asyncio.get_running_loop().call_later(self._every_s, self._look)

    def end(self, result: Result) -> None:
        """Finish all files, with whatever there is by now."""
        if self._timer is not None:
            self._timer.cancel()
        self._video.close()
        if self._video.note:
            self.notes.append(self._video.note)
            self.is_whole = self._video.path.exists()
        if self._report is None or self._view is None:  # it failed before it began
            return
        self._fill(result)
        self._report.write()
        self._need_written(self.page, self._report.error)

    # --- while it runs ---

    @property
    def _simulation(self) -> Simulation:
        world: Any = self._graph["world"]
        simulation: Simulation = world.simulation
        return simulation

    def _look(self) -> None:
        if self._view is None:
            self._view = TopView(self._simulation, self._seed)
        self._observer.note_places()
        self._video.add(self._view.draw(self._observer.robots))
        self._timer = asyncio.get_running_loop().call_later(self._every_s, self._look)

    def _looked(self, robot: int) -> None:
        now, seen, looks = self._simulation.now_s, self._observer.robots[robot], self._ahead[robot]
        if (seen.targets or seen.digits) and seen.front is not None and looks.wants(now):
            drawn = cameras.ahead(seen.front, seen.targets or [], seen.digits or [])
            looks.add(now, self._name(robot, seen.step), drawn)

    def _read(self, robot: int) -> None:
        now, seen = self._simulation.now_s, self._observer.robots[robot]
        if seen.basket is not None and self._baskets.wants(now):
            self._baskets.add(now, self._name(robot, f"cube {seen.cube}"), cameras.basket(seen.basket, seen.cube))

    def _name(self, robot: int, says: str) -> str:
        return says if self._robots == 1 else f"robot {robot}: {says}"

    # --- when it is over ---

    def _fill(self, result: Result) -> None:
        page, simulation = self._report, self._simulation
        self._put_score(result)
        speed = self._every_s * RATE_HZ
        if self._video.path.exists():
            caption = f"{self._video.path.name}, {speed:g} times as fast as the arena. {self._video.note}".strip()
            section = "From above, and what the cameras see"
            if self._video.path.suffix == ".webm":
                page.add_video(section, self._video.path, caption=caption, starts_s=self._every_s, speed=speed)
            else:
                page.add_picture(section, self._video.path, caption=caption)
        elif self._video.note:
            page.add_text("From above, and what the cameras see", self._video.note)
        for number in range(self._robots):
            node = self._graph[f"robot_{number}"]
            if isinstance(node, hfg.Subgraph):
                caption = "Subgraphs are folded; outlined is who is active."
                page.add_drawing(self._name(number, "the mission").capitalize(), node.graph, depth=0, caption=caption)
        drawn = ways(simulation, self._observer.robots)
        try:
            (self._folder / "ways.svg").write_text(drawn, encoding="utf-8")
        except OSError as error:
            self._need_written(self._folder / "ways.svg", error)
        page.add_picture("The ways", drawn, caption="ways.svg")
        section = "What the cameras saw, and what was found in it"
        taken = sorted(
            (look for looks in (*self._ahead, self._baskets) for look in looks.kept), key=lambda look: look[0]
        )
        for at_s, says, picture in taken:
            page.add_picture(section, picture, caption=f"{at_s:.1f} s, {says}", at_s=at_s)

    def _need_written(self, file: Path, error: OSError | None) -> None:
        if error is not None:
            self.notes.append(f'"{file}" cannot be written: {error.strerror}.')
            self.is_whole = False

    def _put_score(self, result: Result) -> None:
        self._report.add_text(
            "The score", str(result).splitlines()[-1] + (f"\n\n{result.error}" if result.error else "")
        )
        rows = []
        for number, (score, seen) in enumerate(zip(result.scores, self._observer.robots, strict=True)):
            off = np.hypot(*(np.array(seen.way) - np.array(seen.believed)).T) if seen.way else np.array([])
            off = off[~np.isnan(off)]
            rows.append(
                (
                    f"robot {number}",
                    len(score.delivered),
                    len(score.wrong),
                    len(score.returned),
                    round(score.driven_m, 1),
                    round(score.contact_s, 2),
                    round(float(np.mean(off)), 3) if len(off) else "",
                    round(float(np.max(off)), 3) if len(off) else "",
                )
            )
        heads = ("", "delivered", "wrong", "returned", "driven, m", "contact, s", "off on average, m", "off at most, m")
        self._report.add_table("The score", heads, rows)

"""What is shown of a mission: the files are whole however it ends, and they show what was there."""

from __future__ import annotations

import asyncio
import math
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

import hfg
from examples.fetch_delivery.__main__ import app
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.perception.records import Localised, Sign
from examples.fetch_delivery.perception.shape import Shape
from examples.fetch_delivery.perception.sighting import find_targets, read_digits
from examples.fetch_delivery.running import Result, carry_out
from examples.fetch_delivery.showing import Showing, cameras, video
from examples.fetch_delivery.showing.figures import figure_16
from examples.fetch_delivery.showing.observing import Observer
from examples.fetch_delivery.showing.top_view import SIZE, TopView
from examples.fetch_delivery.showing.ways import ways
from examples.fetch_delivery.world import Simulation
from hfg.base.token import Token
from hfg.trace import ActivityChanged, TokenSent

SHAPE = Shape(6.0, 1.25)
ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def _folded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The drawing of the whole graph takes longer than all the rest, and has tests of its own."""
    monkeypatch.setattr("hfg.reporting.drawn._MOST_DRAWN", 10)


def shown(folder: Path, seconds: float = 3.0, robots: int = 1, **options: Any) -> tuple[Showing, Result]:
    graph = build(1, robots)
    showing = Showing(folder, graph, 1, robots, seconds)

    def begin(run: hfg.Run) -> None:
        showing.begin(run)
        if "begin" in options:
            options["begin"](run)

    result = carry_out(graph, seconds, begin=begin)
    showing.end(result)
    return showing, result


def pictures_in(file: Path) -> int:
    film, count = cv2.VideoCapture(str(file)), 0
    while film.grab():
        count += 1
    return count


def noise(size: tuple[int, int], seed: int) -> Any:
    return np.random.default_rng(seed).integers(0, 256, (size[1], size[0], 3), np.uint8)


# --- the report


@pytest.mark.slow
def test_a_report_has_video_ways_pictures_and_the_mission_in_one_file(tmp_path: Path) -> None:
    showing, _ = shown(tmp_path / "deep" / "down", 2.0, robots=2)
    assert (showing.notes, showing.is_whole) == ([], True)
    folder = showing.page.parent
    assert pictures_in(folder / "video.webm") in (9, 10)
    page = showing.page.read_text(encoding="utf-8")
    assert 'data-starts="0.200000" data-speed="2.000000"' in page
    assert page.count('data-path="robot_1/fetch"') == 1
    for kind in ("data:video/webm", "data:image/svg+xml", "data:image/png"):
        assert kind in page
    assert re.findall("<td>(robot .)</td>", page)[:2] == ["robot 0", "robot 1"]
    assert not re.search(r'(src|href)="(?!data:)', page)


@pytest.mark.slow
def test_ctrl_c_leaves_a_whole_report_of_what_there_was(tmp_path: Path) -> None:
    def press(_run: hfg.Run) -> None:
        asyncio.get_running_loop().call_later(1.5, signal.raise_signal, signal.SIGINT)

    showing, result = shown(tmp_path, 60, begin=press)
    assert result.outcome == "interrupted"
    assert 6 <= pictures_in(tmp_path / "video.webm") <= 9
    assert "data:video/webm" in showing.page.read_text(encoding="utf-8")
    assert showing.notes == []


def test_a_mission_that_never_began_leaves_no_video_and_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_arena(*_given: Any, **_options: Any) -> None:
        raise OSError("no arena today")

    monkeypatch.setattr("examples.fetch_delivery.mission.world.Simulation", no_arena)
    result = CliRunner().invoke(app, ["--minutes", "0.1", "--report", str(tmp_path)])
    assert result.exit_code == 1
    assert "no arena today" in result.stderr
    assert not list(tmp_path.glob("video.*"))


def test_a_folder_that_cannot_be_written_is_refused_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    result = CliRunner().invoke(app, ["--report", str(tmp_path / "file")])
    assert result.exit_code == 2
    said = re.sub(r"[\s│]+", " ", result.output)
    assert "File exists; name a folder that you can write to" in said


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full is needed")
def test_a_disk_that_is_full_is_told_and_the_score_is_said(tmp_path: Path) -> None:
    for name in ("report.html", "video.webm", "ways.svg"):
        (tmp_path / name).symlink_to("/dev/full")
    result = CliRunner().invoke(app, ["--minutes", "0.02", "--report", str(tmp_path)])
    assert result.exit_code == 1
    assert "robot 0: 0 delivered" in result.output
    for name in ("report.html", "ways.svg"):
        assert f'{name}" cannot be written: No space left on device' in result.stderr
    assert 'video.webm" could not be written as a whole: look whether the disk is full' in result.stderr


# --- the video


def test_without_the_codec_the_video_is_an_animated_picture_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video, "CODEC", "none")
    monkeypatch.setattr(video, "_MOST_KEPT", 8)
    film = video.VideoFile(tmp_path, "film", (64, 48), 10)
    for number in range(20):
        film.add(noise((64, 48), number))
    film.close()
    read, animation = cv2.imreadanimation(str(tmp_path / "film.webp"))
    assert read
    assert len(animation.frames) == 5
    assert animation.frames[0].shape[:2] == (24, 32)
    assert set(animation.durations) == {400}
    assert film.note.startswith("OpenCV has no codec none here")
    assert [file.name for file in tmp_path.iterdir()] == ["film.webp"]


def test_with_neither_of_them_that_is_said_and_no_file_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_given: Any) -> bool:
        raise cv2.error("no WebP")

    monkeypatch.setattr(video, "CODEC", "none")
    monkeypatch.setattr(cv2, "imwriteanimation", fails)
    film = video.VideoFile(tmp_path, "film", (64, 48), 10)
    film.add(noise((64, 48), 0))
    film.close()
    assert "could not be written" in film.note
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits of processes are needed")
def test_a_video_that_breaks_off_is_kept_as_far_as_it_goes_and_told(tmp_path: Path) -> None:
    program = """
import resource, signal, sys
from pathlib import Path
from examples.fetch_delivery.showing.video import VideoFile
from tests.examples.fetch_delivery.test_showing import noise
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (40000, 40000))
film = VideoFile(Path(sys.argv[1]), "film", (200, 120), 10)
for number in range(30):
    film.add(noise((200, 120), number))
film.close()
print(film.note)
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "transports")])}
    command = [sys.executable, "-c", program, str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert "could not be written as a whole" in done.stdout
    assert 0 < pictures_in(tmp_path / "film.webm") < 30


# --- what is in the pictures


def test_what_a_camera_saw_is_marked_where_it_is_in_the_picture() -> None:
    simulation = Simulation(3)
    body, station = simulation.robots[0], simulation.arena.station("delivery", 2)
    at = math.atan2(station.y, station.x)
    body.x, body.y, body.theta = 3.5 * math.cos(at), 3.5 * math.sin(at), at + 0.1
    picture = simulation.front_picture(0)
    targets, digits = find_targets.function(picture), read_digits.function(picture)
    assert [one.label for one in digits] == ["2"]
    assert len(targets) == 1
    drawn = cameras.ahead(picture, targets, digits, width=640)
    plain = cameras.ahead(picture, [], [], width=640)
    for colour, below in ((cameras.TARGET, 300), (cameras.DIGIT, 240)):
        marked = np.all(drawn == colour, axis=2) & np.any(drawn != plain, axis=2)
        rows, columns = np.nonzero(marked[:below])
        inside = picture[rows.min() : rows.max(), columns.min() : columns.max()]
        assert inside.min() < 60  # what is printed is within its frame
        assert inside.max() > 200


def test_what_the_robot_believes_is_laid_into_the_arena_by_the_eighth_that_it_has_chosen() -> None:
    simulation = Simulation(1)
    body = simulation.robots[0]
    observer = Observer(lambda: simulation, 1)
    turned = body.theta - math.pi / 2
    at = math.hypot(body.x, body.y), math.atan2(body.y, body.x) - math.pi / 2
    pose = np.array([at[0] * math.cos(at[1]), at[0] * math.sin(at[1]), turned])
    for number, sure in enumerate((False, True)):
        localised = Localised(pose, np.eye(3), 1.0, sure, 0.0, SHAPE)
        observer(TokenSent(0.0, "robot_0/perception/localise.localised -> robot_0/x.y", Token(localised, 0, 0.0)))
        observer.note_places()
        assert math.isnan(observer.robots[0].believed[number][0]) != sure
    assert observer.robots[0].believed[1] == pytest.approx((body.x, body.y))


def test_the_view_from_above_shows_robots_lamps_and_the_map() -> None:
    simulation = Simulation(1, robots=4)
    observer = Observer(lambda: simulation, 4)
    simulation.set_lamp(2, True)
    seen = observer.robots[3]
    seen.localised, seen.turn = Localised(np.zeros(3), np.eye(3), 1.0, True, 0.0, SHAPE), 0.0
    seen.signs = {4: Sign(0.0, 5.9, 0.0, 0.05, 3.0)}
    observer(ActivityChanged(0.0, "robot_3/fetch/visit/go_to/follow", True, "token"))
    view = TopView(simulation, 1)
    without = view.draw([type(seen)() for _ in range(4)])
    picture = view.draw(observer.robots)
    assert picture.shape == (SIZE[1], SIZE[0], 3)
    body = simulation.robots[2]
    x, y = round(300 + body.x * 600 / 12.7), round(300 - body.y * 600 / 12.7)
    blue, green, red = (int(one) for one in picture[y, x + 16])
    assert green > 150 > max(blue, red)  # the lamp is on
    assert np.any(picture[:40, 280:320] != without[:40, 280:320])  # its map has a sign at the upper end


def test_the_drawing_of_the_ways_has_a_way_for_each_robot_with_gaps_where_nothing_is_known() -> None:
    simulation = Simulation(1, robots=2)
    observer = Observer(lambda: simulation, 2)
    for step in range(3):
        simulation.robots[0].x = step / 10
        observer.note_places()
    observer.robots[0].believed = [(0.0, 0.0), (0.1, 0.0), (math.nan, math.nan), (0.3, 0.0), (0.4, 0.0)]
    drawn = ways(simulation, observer.robots)
    believed = re.findall(r'<path d="([^"]*)" fill="none" stroke="#262c32"', drawn)
    assert believed[0] == "M0.000 0.000L0.100 0.000M0.300 0.000L0.400 0.000"
    assert drawn.count("opacity") == 2


def test_the_picture_of_a_station_in_the_documentation_is_what_the_camera_sees() -> None:
    kept = cv2.imread(str(ROOT / "docs" / "pictures" / "figure_16.jpg"))
    assert kept is not None
    assert np.abs(kept.astype(int) - figure_16().astype(int)).mean() < 4

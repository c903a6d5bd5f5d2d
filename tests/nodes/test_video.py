"""The family `video`: files, cameras, and what changes from picture to picture."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import hfg
from hfg.images import Image
from hfg.nodes import video
from hfg.testing import fire


def frame(number: int, width: int = 64, height: int = 48) -> Any:
    """A gray wall with a white box that moves to the right."""
    image = np.full((height, width, 3), 60, np.uint8)
    image[16:32, 4 + 2 * number : 20 + 2 * number] = 255
    return image


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """Ten pictures, five a second."""
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 5.0, (64, 48))
    for number in range(10):
        writer.write(frame(number))
    writer.release()
    return path


def played(node: hfg.Node, until: float | None = None) -> tuple[list[int], list[float], hfg.Report]:
    """Numbers of the pictures, and when each came."""
    times: list[float] = []

    @hfg.node
    def look(number: int) -> None:
        times.append(hfg.now())

    graph = hfg.Graph("film")
    source = graph.add(node)
    graph.connect(source.ports.outputs["number"], graph.add(look()).ports.inputs["number"])
    graph.connect(source.ports.outputs["number"], graph.output("numbers", int))
    report = hfg.run(graph, clock="virtual", until_s=until)
    return report.outputs["numbers"], [round(time - times[0], 3) for time in times], report


def test_a_video_leaves_at_its_own_rate_and_then_ends(film: Path) -> None:
    numbers, times, report = played(video.VideoFile(path=str(film)))
    assert numbers == list(range(10))
    assert times == [round(number * 0.2, 3) for number in range(10)]
    assert report.outcome == "done"


def test_as_fast_as_it_is_taken(film: Path) -> None:
    numbers, times, _ = played(video.VideoFile(path=str(film), rate="fast"))
    assert (numbers, set(times)) == (list(range(10)), {0.0})


def test_the_first_and_last_picture_can_be_said(film: Path) -> None:
    assert played(video.VideoFile(path=str(film), start=3, end_before=6))[0] == [3, 4, 5]


def test_a_loop_begins_again(film: Path) -> None:
    numbers, times, _ = played(video.VideoFile(path=str(film), loop=True, start=8), until=1.0)
    assert numbers[:5] == [8, 9, 8, 9, 8]
    assert times[:5] == [0.0, 0.2, 0.4, 0.6, 0.8]


def test_pictures_and_stamps_are_those_of_the_file(film: Path) -> None:
    found: list[tuple[float, Any]] = []

    @hfg.node
    def look(image: hfg.Token[Image]) -> None:
        found.append((image.stamp, image.value))

    graph = hfg.Graph("film")
    graph.connect(
        graph.add(video.VideoFile(path=str(film), rate="fast")).image, graph.add(look()).ports.inputs["image"]
    )
    hfg.run(graph, clock="virtual", debug=True)
    assert [round(stamp, 3) for stamp, _ in found] == [round(number * 0.2, 3) for number in range(10)]
    for number, (_, image) in enumerate(found):
        assert np.abs(image.astype(int) - frame(number)).mean() < 6  # it was compressed


def test_a_pattern_reads_pictures(tmp_path: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number:02d}.png"), frame(number))
    assert played(video.VideoFile(path=str(tmp_path / "%02d.png"), rate="fast"))[0] == [0, 1, 2]


@pytest.mark.parametrize(
    ("path", "start", "sentence"),
    [
        ("", 0, 'no video is named: set path, as in VideoFile(path="people.avi")'),
        ("nowhere.avi", 0, 'there is no video "nowhere.avi": correct path, or put the file there'),
        ("text.avi", 0, "cannot be read as a video: it is damaged, or of a kind that this OpenCV does not know"),
        ("film.avi", 12, "has 10 pictures, so none has the number 12"),
    ],
)
def test_a_video_that_cannot_be_read_is_one_sentence(
    film: Path, monkeypatch: pytest.MonkeyPatch, path: str, start: int, sentence: str
) -> None:
    monkeypatch.chdir(film.parent)
    Path("text.avi").write_text("this is no video")
    with pytest.raises(Exception, match=re.escape(sentence)):
        played(video.VideoFile(path=path, start=start))


def test_a_camera_that_is_not_there_is_one_sentence() -> None:
    with pytest.raises(Exception, match="there is no camera 99, or another program uses it: correct device"):
        fire(video.Camera(device=99))
    with pytest.raises(OSError, match="there is no camera -1: cameras are counted from 0"):
        fire(video.Camera(device=-1))


def test_a_camera_gives_pictures_until_it_is_gone(film: Path) -> None:
    camera = video.Camera(device=str(film))  # OpenCV opens a file as it opens a device
    assert [fire(camera).outputs["image"].shape for _ in range(10)] == [(48, 64, 3)] * 10
    with pytest.raises(OSError, match="gives no more pictures: is it still connected"):
        fire(camera)


# --- writing ---


def recorded(node: hfg.Node, images: list[Any]) -> hfg.Report:
    @hfg.node
    def pictures() -> Iterator[Image]:
        yield from images

    graph = hfg.Graph("recording")
    graph.connect(graph.add(pictures()).out, graph.add(node, name="writer").ports.inputs["image"])
    return hfg.run(graph, clock="virtual")


def read(path: Path) -> tuple[int, float, tuple[int, int]]:
    capture = cv2.VideoCapture(str(path))
    count = 0
    shape = (0, 0)
    while (one := capture.read())[0]:
        count, shape = count + 1, one[1].shape[:2]
    rate = capture.get(cv2.CAP_PROP_FPS)
    capture.release()
    return count, rate, shape


def test_what_was_written_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "out.avi"
    recorded(video.WriteVideo(path=str(path), fps=10.0), [frame(number) for number in range(6)])
    assert read(path) == (6, 10.0, (48, 64))
    assert list(tmp_path.iterdir()) == [path]  # nothing is left beside it


def test_gray_pictures_and_a_size_are_taken(tmp_path: Path) -> None:
    path = tmp_path / "out.avi"
    images = [frame(0)[:, :, 0], frame(1, 32, 32)]
    recorded(video.WriteVideo(path=str(path), width=80, height=60), images)
    assert read(path)[::2] == (2, (60, 80))


def test_an_old_video_stays_whole_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "out.avi"
    path.write_text("old")
    node = video.WriteVideo(path=str(path))
    fire(node, image=frame(0))
    assert path.read_text() == "old"
    assert fire(node, slot="finish").events == [("written", str(path))]
    assert read(path)[0] == 1
    fire(node, hook="teardown")


def test_what_was_written_can_be_thrown_away(tmp_path: Path) -> None:
    node = video.WriteVideo(path=str(tmp_path / "out.avi"))
    fire(node, image=frame(0))
    fire(node, slot="clear")
    fire(node, hook="teardown")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_fails_keeps_the_pictures_before(tmp_path: Path) -> None:
    path = tmp_path / "out.avi"
    with pytest.raises(hfg.errors.NodeError) as error:
        recorded(video.WriteVideo(path=str(path)), [frame(0), frame(1), frame(0, 32, 32)])
    assert "has pictures of 64 x 48 pixels, got one of 32 x 32: scale it, or set width and height" in str(error.value)
    assert read(path)[0] == 2


@pytest.mark.parametrize(
    ("path", "codec", "sentence"),
    [
        ("", "MJPG", "no video is named"),
        ("/dev/null/out.avi", "MJPG", 'cannot write "/dev/null/out.avi": a part of the path is a file, no directory'),
        ("out.txt", "MJPG", 'OpenCV does not write "out.txt" with the codec MJPG'),
    ],
)
def test_a_video_that_cannot_be_written_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str, codec: Any, sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(Exception, match=sentence):
        recorded(video.WriteVideo(path=path, codec=codec), [frame(0)])
    assert list(tmp_path.iterdir()) == []


def test_folders_that_are_missing_are_made(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "out.avi"
    recorded(video.WriteVideo(path=str(path)), [frame(0)])
    assert read(path)[0] == 1


# --- pictures ---


def test_a_collage_lays_one_picture_over_the_other() -> None:
    main, small = np.zeros((20, 30, 3), np.uint8), np.full((10, 10), 9, np.uint8)
    out = fire(video.collage(x=25, y=-4), main=main, secondary=small).outputs["out"]
    assert out[:6, 25:].min() == 9
    assert out.sum() == 9 * 3 * 6 * 5
    assert fire(video.collage(x=99), main=main, secondary=small).outputs["out"].sum() == 0


def test_without_a_screen_there_is_no_screenshot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(OSError, match="there is no screen to take a picture of"):
        fire(video.Screenshot(path=str(tmp_path)), slot="take")


# --- motion ---


def test_what_moves_in_front_of_the_background_is_found() -> None:
    for method in ("MOG2", "KNN"):
        node = video.BackgroundSubtractor(method=method)
        wall = np.full((48, 64, 3), 60, np.uint8)
        for _ in range(20):
            fire(node, image=wall)
        outputs = fire(node, image=frame(5)).outputs
        assert outputs["mask"][24, 20] == 255
        assert outputs["mask"][40, 60] == 0
        assert abs(int(outputs["background"][24, 20, 0]) - 60) < 3


def test_a_background_that_is_forgotten_is_learned_anew() -> None:
    node = video.BackgroundSubtractor()
    for _ in range(20):
        fire(node, image=np.full((48, 64), 60, np.uint8))
    fire(node, slot="forget")
    bright = np.full((48, 64), 200, np.uint8)
    fire(node, image=bright)
    assert fire(node, image=bright).outputs["background"][0, 0] == 200


def test_the_difference_begins_with_the_second_picture() -> None:
    node = video.FrameDifference()
    assert fire(node, image=frame(0)).outputs == {}
    outputs = fire(node, image=frame(3)).outputs
    assert outputs["mask"][24, 24] == 255
    assert outputs["share"] == pytest.approx(2 * 6 * 16 / (48 * 64))
    assert fire(node, image=frame(0, 32, 32)).outputs == {}


def test_the_mean_moves_towards_new_pictures() -> None:
    node = video.RunningMean(weight=0.5)
    means = [int(fire(node, image=np.full((2, 2), value, np.uint8)).outputs["mean"][0, 0]) for value in (100, 200, 200)]
    assert means == [100, 150, 175]


def test_flow_tells_how_far_things_moved() -> None:
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 255, (80, 120), np.uint8), (5, 5), 0)
    node = video.OpticalFlow(quality="medium")
    assert fire(node, image=wall).outputs == {}
    flow = fire(node, image=np.roll(wall, 3, axis=1)).outputs["flow"]
    assert np.median(flow[20:60, 30:90, 0]) == pytest.approx(3, abs=0.3)


def test_points_are_followed() -> None:
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.integers(0, 255, (80, 120), np.uint8), (5, 5), 0)
    node = video.PointTracker()
    first = fire(node, image=wall).outputs
    assert np.array_equal(first["points"], first["before"])
    second = fire(node, image=np.roll(wall, 2, axis=1)).outputs
    assert np.median(second["points"] - second["before"], axis=0)[0] == pytest.approx([2, 0], abs=0.2)


@pytest.mark.slow
def test_an_object_is_followed_from_where_it_was_said_to_be() -> None:
    rng = np.random.default_rng(1)
    wall = np.repeat(rng.integers(0, 80, (120, 160, 1), np.uint8), 3, axis=2)
    thing = cv2.resize(rng.integers(120, 255, (6, 6, 3), np.uint8), (32, 32))

    def picture(number: int) -> Any:
        image = wall.copy()
        image[40:72, 30 + 2 * number : 62 + 2 * number] = thing
        return image

    node = video.ObjectTracker()
    assert fire(node, image=picture(0)).outputs == {}
    fire(node, slot="start", value=(30, 40, 32, 32))
    assert fire(node, image=picture(0)).outputs["box"] == (30, 40, 32, 32)
    x, y, *_ = [fire(node, image=picture(number)).outputs["box"] for number in range(1, 8)][-1]
    assert abs(x - 44) <= 8
    assert abs(y - 40) <= 8
    fire(node, slot="stop")
    assert fire(node, image=picture(8)).outputs == {}
    fire(node, slot="start", value=(3, 8, 8, 2))  # OpenCV would look for features in it for ever
    with pytest.raises(ValueError, match=r"the object \(3, 8, 8, 2\) has 16 pixels; it needs 32"):
        fire(node, image=picture(0))
    fire(node, slot="start", value=(150, 40, 32, 32))
    with pytest.raises(ValueError, match=r"the object \(150, 40, 32, 32\) does not lie in a picture of"):
        fire(node, image=picture(0))


@pytest.mark.parametrize(
    "kind", ["BackgroundSubtractor", "FrameDifference", "RunningMean", "OpticalFlow", "PointTracker"]
)
def test_pictures_of_another_kind_are_refused(kind: str) -> None:
    node = getattr(video, kind)()
    with pytest.raises(TypeError, match="expected (Image|Picture) .*, found an array of float32, 48 x 64"):
        fire(node, debug=False, image=np.zeros((48, 64), np.float32))
    with pytest.raises(ValueError, match="is empty"):
        fire(node, debug=False, image=np.zeros((0, 64), np.uint8))

"""The graphs on real pictures: as code and as files they are the same, find what is there, and draw it."""

from __future__ import annotations

import contextlib
import functools
import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import skimage.data

import hfg
from hfg.cli.target import load_graph
from hfg.files import text_of
from hfg.files.describing import describe
from hfg.nodes import vision
from hfg.testing import fire
from tests.limits import patience

FOLDER = Path(__file__).parents[2] / "examples" / "vision"
NAMES = ("codes", "coins", "pedestrians", "stereo")
VIDEOS = [Path("/usr/share/doc/opencv-doc/examples/data/vtest.avi")]

COINS = "24 coins, 36.8 to 61.4 px across, 44.2 on average"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where the results go


def code(name: str, *given: str) -> hfg.Graph:
    return load_graph(f"{FOLDER / name}.py", given)


def file(name: str) -> hfg.Graph:
    return load_graph(f"{FOLDER / name}.hfg.yaml", allow=[name])


def results(graph: hfg.Graph) -> tuple[str, dict[str, bytes]]:
    """What a run has said, and the files that it has written."""
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert hfg.run(graph, clock="virtual").outcome == "done"
    written = {one.name: one.read_bytes() for one in sorted(Path("out").iterdir())}
    for one in written:
        Path("out", one).unlink()
    return said.getvalue(), written


@functools.cache
def of_code(name: str) -> tuple[str, dict[str, bytes]]:
    """The results of an example, which takes seconds."""
    return results(code(name))


def picture(data: bytes) -> Any:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.parametrize("name", NAMES)
def test_the_file_is_the_graph_that_the_code_builds(name: str) -> None:
    assert (FOLDER / f"{name}.hfg.yaml").read_text(encoding="utf-8") == text_of(describe(code(name)))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_code_and_file_say_the_same_and_write_the_same(name: str) -> None:
    said, written = of_code(name)
    assert said
    assert f"{name}.png" in written
    assert results(file(name)) == (said, written)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", [["coins.py"], ["-m", "hfg", "run", "--allow", "coins", "coins.hfg.yaml"]], ids=["python", "hfg run"]
)
def test_both_run_as_a_reader_would_run_them(command: list[str]) -> None:
    *before, last = command
    ran = subprocess.run(
        [sys.executable, *before, str(FOLDER / last)], capture_output=True, text=True, check=False, timeout=patience(50)
    )
    assert (ran.returncode, ran.stdout.strip()) == (0, COINS), ran.stderr
    assert Path("out/coins.png").is_file()


# --- coins ---


def test_every_coin_is_found_once_and_outlined() -> None:
    said, written = of_code("coins")
    assert said.strip() == COINS
    drawn = picture(written["coins.png"])
    photograph = skimage.data.coins()  # type: ignore[no-untyped-call]
    assert drawn.shape == (*photograph.shape, 3)
    assert (
        np.all(drawn == (0, 255, 0), axis=2).sum() > 24 * 60
    )  # each is some 140 pixels around, and half of them under its box


def test_discs_of_known_sizes_are_measured_to_a_pixel() -> None:
    graph = code("coins")
    assert graph["measure.smallest"]
    table = np.full((200, 400), 40, np.uint8)
    for x, radius in ((60, 15), (160, 25), (300, 40)):
        cv2.circle(table, (x, 100), radius, 200, -1)
    contours, _ = cv2.findContours((table > 100).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    measure = type(graph["measure"])
    found = fire(measure(smallest=32.0), contours=list(contours)).outputs
    assert found["labels"] == ["80", "50"]
    assert found["boxes"] == [(260, 60, 81, 81), (135, 75, 51, 51)]


# --- stereo ---


def test_the_disparities_of_the_motorcycle_are_those_of_the_benchmark() -> None:
    said, written = of_code("stereo")
    found, right = (float(part.split()[-1]) for part in said.split("%")[:2])
    assert found > 80
    assert right > 90
    assert "2.2 to 4.5 m away" in said
    heat = picture(written["stereo.png"])[:, 745:]
    near, far = heat[420, 640], heat[60, 200]  # the front wheel, and the wall
    assert near[2] > near[0]
    assert far[0] > far[2]


@pytest.mark.parametrize("shift", [8, 21, 40])
@pytest.mark.parametrize("method", ["SGBM", "BM"])
def test_a_rendered_plane_has_the_disparity_that_it_was_drawn_with(method: str, shift: int) -> None:
    texture = np.random.default_rng(0).integers(0, 256, (120, 400)).astype(np.uint8)
    left, right = texture[:, :300].copy(), texture[:, shift : 300 + shift].copy()
    disparity = fire(vision.StereoDepth(method=method), left=left, right=right).outputs["disparity"]
    inner = disparity[20:-20, 120:-20]
    assert np.median(inner) == 16 * shift
    assert (np.abs(inner / 16 - shift) < 1).mean() > 0.9


# --- codes ---


@pytest.mark.slow
def test_both_codes_are_read_at_every_angle_and_nothing_else() -> None:
    said, written = of_code("codes")
    assert said.splitlines() == [f"{5 * number:3} degrees: bar code and QR code" for number in range(19)]
    assert np.all(picture(written["codes.png"]) == (0, 255, 0), axis=2).any()


def test_a_number_that_is_no_articles_is_refused() -> None:
    bar_code = type(code("codes")["bar_code"])
    assert fire(bar_code(), digits="4006381333931").outputs["out"].shape == (120, 3 * (95 + 22))
    for wrong in ("4006381333930", "400638133393", "400638133393x"):
        with pytest.raises(ValueError, match="13 digits"):
            fire(bar_code(), digits=wrong)


# --- pedestrians ---


@pytest.mark.slow
def test_without_the_video_a_photograph_is_searched_and_it_is_said_how_to_get_it(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = code("pedestrians")
    monkeypatch.setattr(sys.modules["pedestrians"], "VIDEO", "/nowhere/vtest.avi")
    said, written = results(graph)
    assert said.startswith("4 pictures searched, 1.0 people in each, none in 0; ")
    assert "there is no /nowhere/vtest.avi, so a photograph is searched: install Debian's package" in caplog.text
    drawn = picture(written["pedestrians.png"])
    left, top, right, bottom = 57, 66, 153, 162  # around the face of the last picture
    green = np.argwhere(np.all(drawn == (0, 255, 0), axis=2))
    assert green.min(axis=0) == pytest.approx((top, left), abs=8)
    assert green.max(axis=0) == pytest.approx((bottom, right), abs=8)


def test_a_video_that_is_named_and_not_there_is_refused() -> None:
    with pytest.raises(hfg.errors.RunError, match=r'"street".*there is no video "lost.avi"'):
        results(code("pedestrians", "video=lost.avi"))


def test_what_does_not_move_is_no_person() -> None:
    moving = type(code("pedestrians")["moving"])
    mask = np.zeros((100, 100), np.uint8)
    mask[40:60, 40:60] = 255
    boxes = [(30, 30, 40, 40), (0, 0, 30, 30), (35, -10, 30, 60), (95, 95, 50, 50), (200, 200, 9, 9)]
    assert fire(moving(), boxes=boxes, mask=mask).outputs["out"] == [(30, 30, 40, 40), (35, -10, 30, 60)]


@pytest.mark.skipif(not any(one.is_file() for one in VIDEOS), reason="vtest.avi of Debian's opencv-doc is not here")
def test_people_are_found_in_the_real_video_and_the_van_is_none() -> None:
    video = next(one for one in VIDEOS if one.is_file())
    graph = code("pedestrians", f"video={video}")
    graph.edit(hfg.commands.SetParameter("street.end_before", 42))
    said, written = results(graph)
    assert said.startswith("4 pictures searched, ")
    assert 3 <= float(said.split(" people")[0].split()[-1]) <= 7  # three to seven walk there
    assert "none in 0" in said
    assert picture(written["pedestrians.png"]).shape == (576, 768, 3)

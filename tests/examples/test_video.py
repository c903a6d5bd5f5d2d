"""The camera and the detector of another rate: nothing lost where nothing may be, and not longer than by hand."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

import hfg
from examples import video
from tests.examples import plain_video
from tests.examples.lengths import lines_of_code


@pytest.mark.rule("P5", "P8", "A9", "F11")
def test_each_stream_keeps_its_rate_and_only_the_detector_loses_pictures() -> None:
    graph = video.build(pictures=60)
    report = hfg.run(graph, clock="virtual")
    assert report.nodes["film"].firings == 61
    assert report.edges["camera.out -> draw.picture"].sent == 61  # END is one of them
    assert 10 <= report.nodes["draw"].calls <= 11
    assert report.edges["camera.out.sent -> find.picture"].dropped == 60 - report.nodes["draw"].calls


def test_the_film_shows_what_was_found(tmp_path: Path) -> None:
    file = tmp_path / "film.png"
    hfg.run(video.build(pictures=31, file=str(file)), clock="virtual")
    film = cv2.imread(str(file))
    assert film is not None
    assert film.shape == (video.WIDTH, 3 * video.WIDTH, 3)
    red = (film[:, :, 2] > 250) & (film[:, :, 0] < 5)
    assert red.any()


def test_a_film_that_cannot_be_written_is_an_error_of_its_node(tmp_path: Path) -> None:
    with pytest.raises(hfg.errors.RunError, match=r'"film".*cannot be written'):
        hfg.run(video.build(pictures=3, file=str(tmp_path / "no" / "film.png")), clock="virtual")


def test_it_is_no_longer_than_by_hand() -> None:
    by_hand = lines_of_code(plain_video, "VideoError", "Latest", "Video")
    assert lines_of_code(video, "Film", "build") <= by_hand

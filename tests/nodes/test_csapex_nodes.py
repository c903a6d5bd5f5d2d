"""The family `csapex`: what graphs of CS::APEX use and no other family has."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hfg
from hfg.images import Color
from hfg.nodes.csapex import ExampleImage, UserSwitch, combine_images
from hfg.testing import fire


def image(*numbers: int, kind: Any = np.uint8) -> Any:
    return np.array([numbers], dtype=kind)


def combined(script: str, *images: Any) -> Any:
    return fire(
        combine_images(images=len(images), script=script), **{f"images[{i}]": one for i, one in enumerate(images)}
    )


def test_the_example_leaves_at_the_rate_that_it_is_given() -> None:
    graph = hfg.Graph("example")
    source = graph.add(ExampleImage(width=40, height=30), max_rate_hz=60)
    graph.connect(source.image, graph.output("images", Color))
    pictures = hfg.run(graph, clock="virtual", until_s=0.99).outputs["images"]
    assert len(pictures) == 60
    assert {one.shape for one in pictures} == {(30, 40, 3)}


@pytest.mark.parametrize("picture", ["disc", "chessboard", "stripes"])
@pytest.mark.parametrize(("width", "height"), [(1, 1), (320, 240), (7, 1)])
def test_every_example_is_a_picture_in_colours_of_its_size(picture: Any, width: int, height: int) -> None:
    found = fire(ExampleImage(picture=picture, width=width, height=height)).outputs["image"]
    assert (found.shape, found.dtype) == ((height, width, 3), np.uint8)


def test_the_switch_passes_one_image_and_tells_which() -> None:
    switch = UserSwitch(selector="second")
    found = fire(switch, first=image(1), second=image(2)).outputs
    assert (found["image"].tolist(), found["is_first"]) == ([[2]], False)
    found = fire(UserSwitch(), first=image(1), second=image(2)).outputs
    assert (found["image"].tolist(), found["is_first"]) == ([[1]], True)


@pytest.mark.parametrize(
    ("script", "expected"),
    [
        ("255-$1", [255, 155, 0]),
        ("$1 + $2", [1, 110, 255]),  # 300 is no pixel
        ("-$1", [0, 0, 0]),
        ("($1 > 50) * $2", [0, 10, 45]),
        ("max($1, $2) / 2", [0, 50, 128]),
        ("sqrt($2 ^ 2)", [1, 10, 45]),
        ("1 / $1 - abs(0)", [255, 0, 0]),  # 1/0 is beyond the range
    ],
)
def test_images_are_combined_pixel_by_pixel(script: str, expected: list[int]) -> None:
    assert combined(script, image(0, 100, 255), image(1, 10, 45)).outputs["out"].tolist() == [expected]


def test_an_image_of_one_channel_goes_with_colours() -> None:
    found = combined("$1 * $2", np.full((2, 2, 3), 5, np.uint8), np.eye(2, dtype=np.uint8)).outputs["out"]
    assert found[..., 0].tolist() == [[5, 0], [0, 5]]


@pytest.mark.parametrize(
    "script", ["", "$0", "import os", "$1.shape", "__import__('os')", "x", "$1 +", "min($1)", "1j", "$1 if $1 else 2"]
)
def test_what_is_no_expression_is_refused_and_never_run(script: str) -> None:
    with pytest.raises(ValueError, match="script"):
        combine_images(images=1, script=script)


def test_an_image_without_an_input_and_other_sizes_are_errors() -> None:
    with pytest.raises(ValueError, match=r"\$3 is not an image: there are 2"):
        combined("$3", image(1), image(2))
    with pytest.raises(ValueError, match="images of 1x1, 1x2x3 cannot be combined|cannot be combined"):
        combined("$1 + $2", image(1, 2), np.zeros((2, 3), np.uint8))

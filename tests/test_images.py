"""Types of images: what fits where an edge is drawn, and what is said of a value that does not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hfg
from hfg import images
from hfg.images import (
    AnyImage,
    Color,
    ColorAlpha,
    Depth,
    DepthMillimetres,
    FloatImage,
    FlowField,
    Gray,
    Image,
    Labels,
    Mask,
    Matrix,
    Points,
    Rows,
    describe_arrays,
    wrong_image,
)
from hfg.types import accepts, compatible, describe, why_not


@pytest.mark.rule("P3")
@pytest.mark.parametrize(
    ("source", "target"),
    [
        (Gray, Image),
        (Image, Gray),  # an image may have one channel: that is seen on the value
        (Color, Image),
        (Color, AnyImage),
        (AnyImage, Color),
        (Mask, Gray),
        (Gray, Mask),
        (Depth, FloatImage),
        (FlowField, FloatImage),
        (Labels, AnyImage),
    ],
    ids=describe,
)
def test_images_fit_where_some_of_them_are_meant(source: Any, target: Any) -> None:
    assert compatible(source, target)


@pytest.mark.rule("P3")
@pytest.mark.parametrize(
    ("source", "target", "reason"),
    [
        (Gray, Color, "the layout Pixels(1) never matches Pixels(3)"),
        (Color, ColorAlpha, "the layout Pixels(3) never matches Pixels(4)"),
        (Depth, Gray, "an array of float32 is not an array of uint8"),
        (DepthMillimetres, Depth, "an array of uint16 is not an array of float32"),
        (Labels, Mask, "an array of int32 is not an array of uint8"),
        (FlowField, Depth, "the layout Pixels(2) never matches Pixels(1)"),
    ],
    ids=str,
)
def test_images_of_another_kind_are_refused_with_the_reason(source: Any, target: Any, reason: str) -> None:
    assert why_not(source, target) == reason


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        (np.zeros((4, 5), np.uint8), Gray),
        (np.zeros((4, 5, 1), np.uint8), Gray),
        (np.zeros((4, 5, 3), np.uint8), Color),
        (np.zeros((4, 5, 2), np.uint8), Image),
        (np.zeros((4, 5), np.float32), Depth),
        (np.zeros((9, 2), np.int32), Points),
        (np.zeros((9, 1, 2), np.float32), Points),
        (np.zeros((3, 3)), Matrix),
    ],
)
def test_what_is_of_a_type_is_not_wrong(value: Any, hint: Any) -> None:
    assert wrong_image(value, hint) is None


@pytest.mark.parametrize(
    ("value", "hint", "sentence"),
    [
        (
            np.zeros((4, 5)),
            Gray,
            "expected Gray (an array of uint8, height x width), found an array of float64, 4 x 5",
        ),
        (
            np.zeros((4, 5, 3), np.uint8),
            Gray,
            "expected Gray (an array of uint8, height x width), found an array of uint8, 4 x 5 x 3; "
            'read it with mode "gray", or put cvt_color in between',
        ),
        (
            np.zeros((4, 5), np.uint8),
            Color,
            "expected Color (an array of uint8, height x width x 3), found an array of uint8, 4 x 5",
        ),
        (
            np.zeros((4, 5, 5), np.uint8),
            Image,
            "expected Image (an array of uint8, height x width, or height x width x 1 to 4), found an array of uint8, "
            "4 x 5 x 5",
        ),
        (
            [1, 2],
            Points,
            "expected Points (an array of int32 or float32, any x 2, any x 1 x 2), found list: [1, 2]",
        ),
        (
            np.zeros(3),
            AnyImage,
            "expected AnyImage (an array of numbers, height x width, or height x width x 1 to 4), "
            "found an array of float64, 3",
        ),
    ],
)
def test_what_is_wrong_says_what_is_expected_and_what_is_found(value: Any, hint: Any, sentence: str) -> None:
    assert wrong_image(value, hint) == sentence


def test_each_type_is_called_by_its_name() -> None:
    for name in images.__all__:
        hint = getattr(images, name)
        if hasattr(hint, "__metadata__"):
            assert describe(hint) == name
            assert describe_arrays(hint).startswith("an array of ")


def test_points_come_as_rows_or_as_opencv_gives_them() -> None:
    assert Rows(2) == Rows(2) != Rows(3)
    assert compatible(Points, Points)
    assert accepts(np.zeros((0, 2), np.int32), Points)


@pytest.mark.rule("P3")
def test_an_edge_between_images_of_different_kinds_is_refused_where_it_is_drawn() -> None:
    @hfg.node(outputs=Depth)
    def scene() -> Any: ...

    @hfg.node
    def find(image: Gray) -> None: ...

    graph = hfg.Graph("pictures")
    with pytest.raises(hfg.errors.ConnectionError) as error:
        graph.connect(graph.add(scene()).out, graph.add(find()).ports.inputs["image"])
    assert '"find.image" expects Gray, "scene.out" sends Depth (an array of float32 is not an array of uint8)' in str(
        error.value
    )


@pytest.mark.rule("P3")
def test_a_value_of_the_wrong_kind_is_told_by_dtype_and_shape() -> None:
    @hfg.node
    def camera() -> Image:
        return np.zeros((4, 5))

    @hfg.node
    def show(image: Image) -> None: ...

    graph = hfg.Graph("pictures")
    graph.connect(graph.add(camera()).out, graph.add(show()).ports.inputs["image"])
    with pytest.raises(hfg.errors.NodeError, match="camera.out. is declared Image, got an array of float64, 4 x 5"):
        hfg.run(graph, clock="virtual", debug=True)

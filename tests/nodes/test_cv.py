"""The family `cv`: OpenCV's functions as nodes."""

from __future__ import annotations

import ctypes
import functools
import json
import mmap
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import hfg
from hfg import images, registry
from hfg.base.values import Colour
from hfg.catalogue import describe_type, undocumented
from hfg.nodes import cv
from hfg.nodes.cv import _docs, _overrides, _recipes, _stub
from hfg.nodes.cv._room import copy_with_room, with_room
from hfg.ports.specs import REQUIRED
from hfg.testing import fire
from hfg.types import accepts, compatible, describe
from tests.nodes.cv_samples import PARAMETERS, picture, sample

TABLE = Path(cv.__file__).with_name("_measured.json")
ALL = tuple(_recipes.names())
BELOW = (0, 0, 255)


def test_there_are_more_than_two_hundred_types_and_none_is_without_a_category() -> None:
    assert len(ALL) > 220
    grouped = cv.categories()
    assert sorted(name for names in grouped.values() for name in names) == sorted(ALL)
    assert "other" not in grouped
    assert {
        "filter",
        "geometry",
        "colour",
        "features",
        "drawing",
        "morphology",
        "histogram",
        "calibration",
        "motion",
    } <= set(grouped)


@pytest.mark.parametrize("name", ALL)
def test_every_type_says_what_it_does_and_what_each_port_and_parameter_means(name: str) -> None:
    described = describe_type(getattr(cv, name))
    assert undocumented(described) == []
    assert described.reference == f"hfg.nodes.cv:{name}"
    assert described.category.startswith("cv ")
    assert {error.name for error in described.errors} == {"TypeError", "ValueError"}


def test_what_is_no_node_says_why() -> None:
    reasons = cv.not_nodes()
    assert not set(reasons) & set(_recipes.names().values())
    assert reasons["imshow"] == "it needs a window: hfg.nodes.display shows pictures"
    assert reasons["getTickCount"] == "it takes no array, so it would be a source without end"
    with pytest.raises(AttributeError, match="cv2.imshow is not a node type: it needs a window"):
        _ = cv.imshow
    with pytest.raises(AttributeError, match="has no attribute 'gausian_blur'$"):
        _ = cv.gausian_blur


def test_no_override_speaks_of_what_is_not_there() -> None:
    """A word that OpenCV does not know would be silently without effect."""
    for name, said in _overrides.FUNCTIONS.items():
        arguments = {one.name for overload in _stub.overloads()[name] for one in overload.arguments}
        unknown = set(said) - arguments
        assert not unknown or name in ("dilate", "erode", "fastNlMeansDenoisingMulti"), f"{name}: {unknown}"


# --- names and references ---


def test_the_name_in_opencv_is_understood_too() -> None:
    assert cv.GaussianBlur is cv.gaussian_blur
    assert "gaussian_blur" in dir(cv)


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        ("GaussianBlur", "gaussian_blur"),
        ("filter2D", "filter_2d"),
        ("solvePnP", "solve_pnp"),
        ("HoughLinesP", "hough_lines_p"),
        ("getAffineTransform", "get_affine_transform"),
        ("reprojectImageTo3D", "reproject_image_to_3d"),
        ("LUT", "lut"),
    ],
)
def test_names_are_in_snake_case(theirs: str, ours: str) -> None:
    assert _recipes.names()[ours] == theirs


@pytest.mark.slow
def test_a_type_is_found_by_its_reference_in_another_process() -> None:
    program = (
        "from hfg import registry; kind = registry.find('hfg.nodes.cv:gaussian_blur'); "
        "print(registry.reference_of(kind), kind(ksize=(7, 7)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split(" ", 1)[0] == registry.reference_of(cv.gaussian_blur) == "hfg.nodes.cv:gaussian_blur"
    assert "ksize=(7, 7)" in done.stdout


def test_a_copied_graph_has_the_same_types_and_parameters() -> None:
    graph = hfg.Graph("pictures")
    graph.add(cv.gaussian_blur(ksize=(7, 7), border_type="REFLECT"), name="blur")
    again = hfg.Graph("again")
    again.edit(*graph.as_commands())
    assert repr(again.nodes["blur"]) == repr(graph.nodes["blur"])
    assert "border_type='REFLECT'" in repr(again.nodes["blur"])


# --- values ---


def test_a_picture_comes_out_as_opencv_makes_it() -> None:
    image = picture("uint8", 3)
    out = fire(cv.gaussian_blur(ksize=(5, 5), sigma_x=1.5), src=image).outputs["out"]
    assert np.array_equal(out, cv2.GaussianBlur(image, (5, 5), 1.5))


def test_constants_are_words() -> None:
    image = picture("uint8", 3)
    assert np.array_equal(
        fire(cv.cvt_color(code="BGR2HSV"), src=image).outputs["out"], cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    )
    with pytest.raises(ValueError, match='"cvt_color.code" must be of type'):
        cv.cvt_color(code="BGR2PINK")


def test_constants_that_add_up_are_a_set_of_words() -> None:
    plane = picture("float32", 1)
    both = fire(cv.dft(flags=frozenset({"COMPLEX_OUTPUT", "SCALE"})), src=plane).outputs["out"]
    assert np.array_equal(both, cv2.dft(plane, flags=cv2.DFT_COMPLEX_OUTPUT | cv2.DFT_SCALE))


def test_several_results_are_several_outputs_with_names() -> None:
    outputs = fire(cv.threshold(type="BINARY_OTSU"), src=picture("uint8", 1)).outputs
    used, expected = cv2.threshold(picture("uint8", 1), 127, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    assert outputs["used"] == used
    assert np.array_equal(outputs["dst"], expected)


def test_drawing_changes_a_copy() -> None:
    image = np.zeros((32, 32, 3), np.uint8)
    image.flags.writeable = False
    out = fire(cv.circle(center=(16, 16), radius=5, color=Colour(255, 0, 0), thickness=-1), img=image).outputs["out"]
    assert tuple(out[16, 16]) == BELOW
    assert not image.any()


def test_a_colour_on_a_gray_picture_is_its_lightness() -> None:
    image = np.zeros((32, 32), np.uint8)
    out = fire(cv.circle(radius=5, color=Colour(255, 255, 255), thickness=-1), img=image).outputs["out"]
    assert out[16, 16] == 255


def test_an_optional_array_may_be_left_out() -> None:
    image = picture("uint8", 1)
    mask = np.zeros_like(image)
    mask[:10] = 255
    assert fire(cv.mean(), src=image).outputs["out"][0] == pytest.approx(image.mean())
    assert fire(cv.mean(), src=image, mask=mask).outputs["out"][0] == pytest.approx(image[:10].mean())


def test_a_list_of_arrays_comes_out_as_a_list_that_can_be_drawn() -> None:
    image = np.zeros((48, 48), np.uint8)
    image[10:20, 10:20] = 255
    contours = fire(cv.find_contours(), image=image).outputs["contours"]
    assert isinstance(contours, list)
    drawn = fire(
        cv.draw_contours(thickness=-1, color=Colour(255, 255, 255)), image=np.zeros_like(image), contours=contours
    )
    assert np.array_equal(drawn.outputs["out"], image)


@pytest.mark.rule("T2")
def test_nothing_found_is_silence() -> None:
    assert fire(cv.hough_circles(), image=np.zeros((64, 64), np.uint8)).outputs == {}


def test_a_size_that_is_not_given_is_that_of_the_picture() -> None:
    image, shift = picture("uint8", 3), np.array([[1, 0, 3], [0, 1, 0]], np.float64)
    out = fire(cv.warp_affine(), src=image, m=shift).outputs["out"]
    assert out.shape == image.shape
    assert np.array_equal(out[:, 3:], image[:, :-3])


def test_bounds_hold_for_each_channel() -> None:
    image = np.dstack([np.full((4, 4), value, np.uint8) for value in (10, 20, 30)])
    assert fire(cv.in_range(lowerb=(5.0,), upperb=(35.0,)), src=image).outputs["out"].all()
    assert not fire(cv.in_range(lowerb=(15.0,), upperb=(35.0,)), src=image).outputs["out"].any()
    assert fire(cv.in_range(lowerb=(5.0, 15.0, 25.0), upperb=(15.0, 25.0, 35.0)), src=image).outputs["out"].all()


def test_what_another_node_computes_can_move_what_is_drawn() -> None:
    """Parameters are ports (P8)."""

    @hfg.node
    def pictures() -> Iterator[images.Image]:
        yield np.zeros((32, 32, 3), np.uint8)

    @hfg.node
    def radii() -> Iterator[int]:
        yield 3

    graph = hfg.Graph("drawing")
    circle = graph.add(cv.circle(thickness=-1))
    graph.connect(graph.add(pictures()).out, circle.ports.inputs["img"])
    graph.connect(graph.add(radii()).out, circle.ports.parameters["radius"])
    graph.connect(circle.out, graph.output("drawn", images.AnyImage))
    drawn = hfg.run(graph, clock="virtual").outputs["drawn"][0]
    assert drawn[16, 16 + 3].any()
    assert not drawn[16, 16 + 5].any()


# --- what is refused ---


@pytest.mark.parametrize(
    ("node", "values", "sentence"),
    [
        (
            cv.equalize_hist(),
            {"src": picture("float32", 1)},
            'input "src" of equalize_hist: expected Gray (an array of uint8, height x width), found an array of '
            "float32, 48 x 64",
        ),
        (
            cv.canny(),
            {"image": picture("uint8", 3).astype(np.int64)},
            "found an array of int64, 48 x 64 x 3",
        ),
        (cv.sqrt(), {"src": picture("uint8", 1)}, 'input "src" of sqrt: expected Array[float32 | float64]'),
        (cv.gaussian_blur(), {"src": [1, 2]}, "found list: [1, 2]"),
        (cv.gaussian_blur(), {"src": np.zeros((0, 4), np.uint8)}, 'input "src" of gaussian_blur is empty'),
        (
            cv.bounding_rect(),
            {"array": np.array([[0, 0], [1 << 20, 3]], np.int32)},
            'input "array" of bounding_rect has a point that is not within 32767 pixels',
        ),
        (
            cv.cvt_color(code="BGR2GRAY"),
            {"src": picture("uint8", 1)},
            "cv2.cvtColor refuses src an array of uint8, 48 x 64: ",
        ),
        (
            cv.add(),
            {"src1": picture("uint8", 1), "src2": np.zeros((3, 3), np.uint8)},
            "cv2.add refuses src1 an array of uint8, 48 x 64, src2 an array of uint8, 3 x 3: The operation is neither",
        ),
        (
            cv.draw_matches_knn(),
            {
                "img1": picture("uint8", 3),
                "img2": picture("uint8", 3),
                "keypoints1": [cv2.KeyPoint(1.0, 1.0, 1.0)],
                "keypoints2": [cv2.KeyPoint(1.0, 1.0, 1.0)],
                "matches1to2": [[cv2.DMatch(5, 0, 1.0)]],
            },
            "draw_matches_knn: a match names the keypoints 5 and 0, and there are 1 and 1",
        ),
        (
            cv.kmeans(),
            {"data": np.array([[np.nan, 1.0], [2.0, 3.0]], np.float32)},
            "kmeans: data has a number that is not within 1e15",
        ),
        (
            cv.pow(power=0.5),
            {"src": picture("uint8", 3)},
            "pow: the power 0.5 needs an array of float32 or float64; uint8 takes whole powers only",
        ),
        (
            cv.box_filter(ksize=(3, 3), anchor=(3, 0)),
            {"src": picture("uint8", 3)},
            "box_filter: the anchor 3, 0 is outside of the kernel of 3 x 3; -1, -1 is its middle",
        ),
        (
            cv.erode(anchor=(0, 2)),
            {"src": picture("uint8", 3), "kernel": np.ones((2, 5), np.uint8)},
            "erode: the anchor 0, 2 is outside of the kernel of 5 x 2",
        ),
        (
            cv.erode(iterations=1000),
            {"src": np.zeros((400, 500), np.float32), "kernel": np.tri(400, 500, dtype=np.uint8)},
            "erode: an element of 80,200 points in 1,000 iterations needs 16,040,000,000,000 steps",
        ),
        (
            cv.convert_maps(),
            {"map1": picture("float32", 1), "map2": np.zeros((4, 5), np.float32)},
            "convert_maps: map1 is 48 x 64 and map2 4 x 5; they have one size",
        ),
        (
            cv.draw_chessboard_corners(),
            {"image": picture("uint8", 3), "corners": np.zeros((12, 2), np.float32)},
            "draw_chessboard_corners: a board of 9 x 6 that was found has 54 corners, and there are 12",
        ),
        (
            cv.triangulate_points(),
            {
                "proj_matr1": np.eye(3, 4),
                "proj_matr2": np.eye(3, 4),
                "proj_points1": np.zeros((1, 2), np.float32),
                "proj_points2": np.zeros((2, 2), np.float32),
            },
            "triangulate_points: there are 1 points of the first camera and 2 of the second",
        ),
        (
            cv.hough_lines_p(rho=85.0),
            {"image": np.full((1, 1), 255, np.uint8)},
            "hough_lines_p: rho is 85, more than 5, the most that lines in a picture of 1 x 1 are apart",
        ),
        (
            cv.min_max_loc(),
            {"src": picture("uint8", 1), "mask": np.ones((2, 3), np.uint8)},
            "min_max_loc: src is 48 x 64 and mask 2 x 3; they have one size",
        ),
        (
            cv.spatial_gradient(),
            {"src": np.zeros((5, 1), np.uint8)},
            "spatial_gradient: src is one pixel wide, and needs two",
        ),
        (
            cv.min_enclosing_triangle(),
            {"points": np.linspace(0, 1, 24, dtype=np.float32).reshape(12, 2)},
            "min_enclosing_triangle: the points lie almost on a line",
        ),
        (
            cv.validate_disparity(min_disparity=0, number_of_disparities=16),
            {"disparity": np.full((2, 3), 256, np.int16), "cost": np.zeros((2, 3), np.int16)},
            "validate_disparity: disparity has numbers that are not within 0 and 255",
        ),
        (
            cv.validate_disparity(),
            {"disparity": np.zeros((2, 3), np.int16), "cost": np.zeros((2, 4), np.int16)},
            "validate_disparity: disparity is 2 x 3 and cost 2 x 4; they have one size",
        ),
        (
            cv.eigen_non_symmetric(),
            {"src": np.array([[1, np.nan], [0, 1]])},
            "eigen_non_symmetric: src has NaN or infinity",
        ),
        (
            cv.find_non_zero(),
            {"src": np.zeros((2, 3), np.float16)},
            'input "src" of find_non_zero: expected Plane',
        ),
    ],
    ids=[
        "kind of picture",
        "kind of numbers",
        "whole numbers",
        "a list",
        "an empty picture",
        "a point far away",
        "channels",
        "two sizes",
        "a match without keypoint",
        "no number",
        "a power of integers",
        "an anchor outside",
        "an anchor outside of an element",
        "work that does not end",
        "maps of two sizes",
        "corners of another board",
        "points that are no pairs",
        "steps over the picture",
        "a mask of another size",
        "a picture of one column",
        "almost a line",
        "disparities beyond",
        "costs of another size",
        "not finite",
        "half precision",
    ],
)
def test_what_does_not_fit_is_told_by_node_port_expected_and_found(node: Any, values: Any, sentence: str) -> None:
    with pytest.raises((TypeError, ValueError)) as error:
        fire(node, debug=False, **values)
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)
    assert "/io/" not in str(error.value)


def test_a_wrong_picture_in_a_graph_names_the_path() -> None:
    @hfg.node
    def camera() -> Any:
        return np.zeros((4, 5))

    graph = hfg.Graph("pictures")
    graph.connect(graph.add(camera()).out, graph.add(cv.equalize_hist(), name="even").ports.inputs["src"])
    with pytest.raises(hfg.errors.NodeError) as error:
        hfg.run(graph, clock="virtual", debug=False)
    assert 'node "even" failed in firing 1: TypeError: input "src" of equalize_hist: expected Gray' in str(error.value)


@pytest.mark.slow
def test_a_picture_that_would_end_the_process_is_refused() -> None:
    """OpenCV writes beyond its memory when it takes the root of whole numbers; hfg never lets it."""
    program = (
        "import numpy as np; from hfg.nodes import cv; from hfg.testing import fire\n"
        "for kind in (np.uint8, np.int16, np.int32):\n"
        "    try: fire(cv.sqrt(), debug=False, src=np.ones((40, 40), kind))\n"
        "    except TypeError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.count("expected Array[float32 | float64]") == 3


def test_what_opencv_needs_is_not_refused_where_it_is_met() -> None:
    whole = np.array([[1, 2], [3, 4]], np.int16)
    assert fire(cv.pow(power=2.0), debug=False, src=whole).outputs["out"].tolist() == [[1, 4], [9, 16]]
    assert fire(cv.pow(power=0.5), debug=False, src=np.array([[4, 9]], np.float32)).outputs["out"].tolist() == [[2, 3]]
    assert fire(cv.box_filter(anchor=(2, 0)), debug=False, src=picture("uint8", 1)).outputs["out"].shape == (48, 64)
    corners = np.array([[0, 0], [4, 0], [0, 3], [1, 1]], np.float32)
    assert fire(cv.min_enclosing_triangle(), debug=False, points=corners).outputs["area"] == pytest.approx(6.0)
    line = np.array([[0, 0], [1, 1], [2, 2], [3, 3]], np.int32)
    assert fire(cv.min_enclosing_triangle(), debug=False, points=line).outputs["area"] == 0
    some = picture("uint8", 1) > 12
    lengths = [
        fire(cv.norm(), debug=False, src1=picture(kind, 1), mask=some.astype(np.uint8) * 255).outputs["out"]
        for kind in ("uint8", "int16")
    ]
    assert lengths == [pytest.approx(np.linalg.norm(picture(kind, 1)[some])) for kind in ("uint8", "int16")]
    disparity = np.full((2, 40), 35, np.int16)
    disparity[0, 30] = -16  # there was none
    cost = np.zeros((2, 40), np.int16)
    out = fire(cv.validate_disparity(), debug=False, disparity=disparity, cost=cost).outputs["out"]
    assert out[1].tolist() == disparity[1].tolist()


def test_what_opencv_needs_is_documented() -> None:
    for name, need in [(name, need) for name, needs in _overrides.NEEDS.items() for need in needs]:
        ours = next(ours for ours, theirs in _recipes.names().items() if theirs == name)
        errors = {error.name: error.when for error in describe_type(getattr(cv, ours)).errors}
        assert need.says in errors["ValueError"]


@pytest.mark.rule("P3")
def test_edges_between_kinds_that_never_fit_are_refused() -> None:
    assert compatible(cv.cvt_color._type.outputs["out"].type, cv.canny._type.inputs["image"].type)
    graph = hfg.Graph("pictures")
    edges, root = graph.add(cv.canny()), graph.add(cv.sqrt())
    with pytest.raises(hfg.errors.ConnectionError, match="an array of uint8 is not an array of"):
        graph.connect(edges.out, root.ports.inputs["src"])


# --- the tables ---

OWN_DEFAULTS = {
    ("batchDistance", "K"), ("resize", "fx"), ("resize", "fy"), ("reduce", "dtype"), ("drawKeypoints", "color"),
    ("drawMatches", "matchColor"), ("drawMatches", "singlePointColor"), ("drawMatchesKnn", "matchColor"),
    ("drawMatchesKnn", "singlePointColor"),
}  # fmt: skip
"""Where we take another default than OpenCV on purpose."""


def defaults_of(name: str) -> list[str]:
    found = []
    for argument in _recipes.chosen(name).arguments:
        own = _overrides.FUNCTIONS.get(name, {}).get(argument.name) or _overrides.COMMON.get(argument.name)
        said = own is not None and not own.drop and own.default is not REQUIRED and own.default is not None
        if said and argument.optional and (name, argument.name) not in OWN_DEFAULTS:
            found.append(argument.name)
    return found


def tries(name: str, recipe: Any) -> Iterator[list[Any]]:
    """Ordinary inputs, with one kind of picture after the other."""
    pictures = _recipes._image_hint(_recipes.measured()[name])
    for dtype, channels in (("uint8", 3), ("uint8", 1), ("float32", 1), ("float32", 3), ("int16", 1)):
        values = []
        for number, one in enumerate(recipe.inputs):
            value: Any = None if one.optional else sample(one.hint, number)
            value = picture(dtype, channels, number) if one.hint == pictures and value is not None else value
            values.append(value[4:20, 8:24].copy() if one.name == "templ" else value)
        yield values


def copied(arguments: dict[str, Any]) -> dict[str, Any]:
    return {key: np.copy(value) if isinstance(value, np.ndarray) else value for key, value in arguments.items()}


@pytest.mark.parametrize("name", [name for name in _recipes.names().values() if defaults_of(name)])
def test_defaults_are_those_of_opencv(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stub does not say them: what OpenCV does without an argument it does with our default, too."""
    function = getattr(cv2, name)
    given: dict[str, Any] = {}

    @functools.wraps(function)
    def spy(*by_position: Any, **arguments: Any) -> Any:
        if by_position:  # it is the samples' own
            return function(*by_position, **arguments)
        given.clear()
        given.update(copied(arguments))  # some are written into
        return function(**arguments)

    monkeypatch.setattr(cv2, name, spy)
    recipe = _recipes.recipe(name)
    parameters = {one.name: one.default for one in recipe.settings} | PARAMETERS.get(name, {})
    for values in tries(name, recipe):
        try:
            recipe.call(*values, **parameters)
            break
        except (TypeError, ValueError):
            continue
    else:
        pytest.fail("OpenCV refuses every sample")
    ours = flat(function(**copied(given)))
    if ours != flat(function(**copied(given))):
        pytest.skip("its results are never twice the same")
    for argument in defaults_of(name):
        without = copied(given)
        del without[argument]
        assert flat(function(**without)) == ours, f"{argument} is something else in OpenCV"


def flat(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [str(value.dtype), value.shape, value.tobytes().hex()]
    return [flat(one) for one in value] if isinstance(value, list | tuple) else repr(value)


def test_the_table_of_kinds_is_that_of_the_installed_version() -> None:
    """Otherwise measure again: python -m tests.nodes.measure_cv."""
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    if table["version"] == cv2.__version__:
        assert sorted(table["functions"]) == sorted(_recipes.names().values())


def test_what_is_not_in_the_table_takes_pictures_of_8_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    """A newer OpenCV has functions that nobody has measured."""
    monkeypatch.setattr(_recipes, "measured", dict)
    recipe = _recipes.recipe("blur")
    assert describe(recipe.inputs[0].hint) == "Array[uint8]"
    with pytest.raises(TypeError, match="expected Array"):
        recipe.call(picture("float32", 1), ksize=(3, 3), anchor=(-1, -1), border_type="DEFAULT")


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_sample_of_the_measurement_gives_the_same_again() -> None:
    names = ["sqrt", "blur", "Canny", "equalizeHist"]
    done = subprocess.run(
        [sys.executable, "-m", "tests.nodes.measure_cv", "--json", *names], capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout)
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    assert found == {name: table["functions"][name] for name in names}
    assert ["uint8", 1] in found["sqrt"]["deadly"]


def test_documentation_is_read_without_markup() -> None:
    told = _docs.read(cv2.warpAffine, ("src", "M", "dsize", "dst", "flags", "borderMode", "borderValue"))
    assert told.outputs == ("dst",)
    assert told.about == "Applies an affine transformation to an image."
    assert told.arguments["M"] == "2x 3 transformation matrix." or told.arguments["M"].startswith("2")
    assert not any(mark in text for text in told.arguments.values() for mark in ("\\f$", "@ref", "#"))


@pytest.mark.slow
def test_importing_the_family_makes_no_type() -> None:
    program = "from hfg.nodes import cv; print(sum(type(one).__name__ == 'NodeFunction' for one in vars(cv).values()))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "0"


# --- what the texts promise ---

_DEPTHS = {
    "8U": "uint8",
    "8S": "int8",
    "16U": "uint16",
    "16S": "int16",
    "32S": "int32",
    "32F": "float32",
    "64F": "float64",
}


def promises(text: str) -> set[tuple[str, int]]:
    """Read which pixels, and how many channels of them, the description of an input speaks of."""
    found = set()
    for depth, channels in re.findall(r"CV_(8U|8S|16U|16S|32S|32F|64F)(?:C(\d))?", text):
        found.add((_DEPTHS[depth], int(channels) if channels else 1))
    if re.search(r"gr[ae]y-?scale image", text):
        found.add(("uint8", 1))
    bits = re.search(r"\b8-bit", text)
    if bits and not re.search(r"float", text):
        counts = re.findall(r"(\d)(?: or (\d))?(?:, or (\d))?-channel", text)
        wanted = {int(one) for each in counts for one in each if one} or {1}
        found |= {("uint8", count) for count in wanted}
    return found


@pytest.mark.parametrize("name", ALL)
def test_an_input_takes_what_its_text_promises(name: str) -> None:
    for one in describe_type(getattr(cv, name)).inputs:
        hint = getattr(cv, name)._type.inputs[one.name].type
        for dtype, channels in promises(one.doc):
            shapes: list[tuple[int, ...]] = [(6, channels), (6, 1, channels), (1, 6, channels), (6, 6, channels)]
            shapes += [(6, 6), (6, 2)] if channels == 1 else []
            shapes += [(3, 1, channels), (4, 1, channels), (256,), (1, 256)]
            values = [np.ones(shape, dtype) for shape in shapes]
            assert any(accepts(value, hint) or accepts([value], hint) for value in values), (
                f"{name}.{one.name} promises {dtype} of {channels} channels ({one.doc}), and is {describe(hint)}"
            )


def test_a_mask_is_a_shape_as_well_as_a_contour() -> None:
    mask = np.zeros((24, 32), np.uint8)
    mask[5:9, 6:12] = 255
    assert fire(cv.bounding_rect(), array=mask).outputs["out"] == cv2.boundingRect(mask) == (6, 5, 6, 4)
    assert fire(cv.moments(), array=mask).outputs["out"] == cv2.moments(mask)
    assert fire(cv.moments(binary_image=True), array=mask).outputs["out"]["m00"] == 24
    assert fire(cv.match_shapes(), contour1=mask, contour2=mask).outputs["out"] == 0
    corners = np.array([[1, 2], [5, 9]], np.int32)
    assert fire(cv.bounding_rect(), array=corners).outputs["out"] == (1, 2, 5, 8)


def test_points_may_be_rows_or_pairs() -> None:
    points = np.array([[4, 4], [40, 5], [6, 38]], np.float32)
    left, right = np.eye(3, 4), np.eye(3, 4)
    right[0, 3] = -1
    rows, pairs = (
        fire(
            cv.triangulate_points(),
            proj_matr1=left,
            proj_matr2=right,
            proj_points1=one,
            proj_points2=one + np.float32(1),
        )
        for one in (points, points.reshape(-1, 1, 2))
    )
    assert rows.outputs["out"].shape == (4, 3)
    assert np.array_equal(rows.outputs["out"], pairs.outputs["out"])


# --- what would end the process ---

FEW = np.ones((6, 5), np.float32)
WITH_NAN = np.where(np.eye(6, 5) > 0, np.nan, FEW).astype(np.float32)


@pytest.mark.parametrize(
    ("node", "given", "sentence"),
    [
        (cv.filter_2d(), {"src": FEW, "kernel": np.full((3, 3), np.nan)}, "filter_2d: kernel has NaN or infinity"),
        (
            cv.sep_filter_2d(),
            {"src": FEW, "kernel_x": np.array([1, np.inf, 1]), "kernel_y": np.ones(3)},
            "sep_filter_2d: kernel_x has NaN or infinity",
        ),
        (cv.bilateral_filter(), {"src": WITH_NAN}, "bilateral_filter: src has a number that is not within 1e15"),
        (cv.bilateral_filter(), {"src": FEW * 1e30}, "clip it, or replace NaN and infinity, first"),
        (
            cv.find_contours(mode="CCOMP"),
            {"image": np.array([[0, 2**31 - 1], [-(2**31), 0]], np.int32)},
            "find_contours: image has a number that is not within 0 and 2 ** 29",
        ),
        (
            cv.norm(),
            {"src1": FEW, "mask": np.ones((2, 2), np.uint8)},
            "norm: src1 is 6 x 5 and mask 2 x 2; they have one size",
        ),
        (
            cv.normalize(),
            {"src": FEW, "mask": np.ones((2, 2), np.uint8)},
            "normalize: src is 6 x 5 and mask 2 x 2; they have one size",
        ),
        (cv.invert(flags="SVD"), {"src": np.array([[1, 2], [3, np.inf]])}, "invert: src has NaN or infinity"),
        (cv.sv_decomp(), {"src": np.array([[1, 2], [-np.inf, 4]])}, "sv_decomp: src has NaN or infinity"),
        (
            cv.pow(power=-1.0),
            {"src": np.full((2, 2), -(2**31), np.int32)},
            "pow: src has -2,147,483,648, which int32 cannot negate; clip it, or convert src to float64",
        ),
        (cv.check_range(), {"a": np.ones((4, 4), np.float16)}, 'input "a" of check_range: expected Array['),
    ],
)
def test_values_that_end_the_process_or_hold_it_forever_are_refused(node: Any, given: Any, sentence: str) -> None:
    with pytest.raises((ValueError, TypeError), match=re.escape(sentence)):
        fire(node, debug=False, **given)


@pytest.mark.parametrize(
    ("node", "parameters"),
    [
        (cv.put_text, {"text": "\ud800"}),
        (cv.good_features_to_track, {"min_distance": 1e30}),
        (cv.kmeans, {"criteria": (3, 1e300)}),
        (cv.laplacian, {"scale": float("nan")}),
        (cv.laplacian, {"scale": float("inf")}),
        (cv.hough_circles, {"param2": 1e-9}),
        (cv.fast_nl_means_denoising_multi, {"img_to_denoise_index": 2**31 - 1}),
    ],
)
def test_parameters_that_end_the_process_are_refused(node: Any, parameters: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="must (be|satisfy)"):
        node(**parameters)


# --- room around arrays ---


def placed(memory: Any, place: int) -> Any:
    """Give a picture of one page that begins there."""
    found = np.frombuffer(memory, np.uint8, mmap.PAGESIZE, place).reshape(64, -1)
    found[...] = np.arange(64)[:, None]
    return found


@pytest.mark.parametrize(("place", "is_copied"), [("first", True), ("second", False), ("last", True)])
def test_an_array_at_the_end_of_a_mapping_is_copied(place: str, is_copied: bool) -> None:
    memory = mmap.mmap(-1, 3 * mmap.PAGESIZE)
    given = placed(memory, ["first", "second", "last"].index(place) * mmap.PAGESIZE)
    for array in (given, given[:, ::-1], given.T):
        found = with_room(array)
        assert np.array_equal(found, array)
        assert np.shares_memory(found, given) is not is_copied
        assert with_room(found) is found or is_copied


def test_an_array_that_others_have_mapped_is_copied_at_the_end_of_a_page() -> None:
    memory = np.zeros(4 * mmap.PAGESIZE, np.uint8)
    start = -memory.ctypes.data % mmap.PAGESIZE
    foreign = (ctypes.c_char * (2 * mmap.PAGESIZE)).from_address(memory.ctypes.data + start)
    assert not np.shares_memory(with_room(placed(foreign, 0)), memory)
    within = placed(foreign, 0)[1:-1]
    assert with_room(within) is within


@pytest.mark.parametrize("rows", [0, 4])
def test_a_copy_with_room_has_bytes_that_can_be_read_around_it(rows: int) -> None:
    for shape in ((), (3,), (5, 4), (5, 4, 3)):
        array = np.ones(shape, np.float32)
        copied = copy_with_room(array, rows if shape else 0)
        room = copied.base
        before = copied.ctypes.data - room.ctypes.data
        behind = room.nbytes - before - copied.nbytes
        assert np.array_equal(copied, array)
        assert min(before, behind) >= 64 + (rows * array[0].nbytes if shape else 0)


def test_lists_and_arrays_that_opencv_writes_to_have_room_too() -> None:
    memory = mmap.mmap(-1, mmap.PAGESIZE)
    given = placed(memory, 0)
    assert np.array_equal(fire(cv.merge(), mv=[given, given]).outputs["out"], np.dstack([given, given]))
    before = given.copy()
    drawn = fire(cv.circle(), img=given).outputs["out"]
    assert np.array_equal(given, before)
    assert not np.array_equal(drawn, before)

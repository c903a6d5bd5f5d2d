"""The family `vision`: what is found in pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import skimage.data

import hfg
from hfg.images import Gray
from hfg.nodes import cv as cv_nodes
from hfg.nodes import video, vision
from hfg.testing import fire


def board(columns: int = 7, rows: int = 5, square: int = 24) -> Any:
    """A chessboard with so many inner corners, and a white rim."""
    y, x = np.mgrid[0 : (rows + 1) * square, 0 : (columns + 1) * square] // square
    return cv2.copyMakeBorder(((x + y) % 2 * 255).astype(np.uint8), 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)


def ean13(digits: str, module: int = 3) -> Any:
    """Draw a bar code."""
    left = "0001101 0011001 0010011 0111101 0100011 0110001 0101111 0111011 0110111 0001011".split()  # noqa: SIM905
    right = ["".join("10"[int(bit)] for bit in code) for code in left]
    turned = [code[::-1] for code in right]
    parities = "LLLLLL LLGLGG LLGGLG LLGGGL LGLLGG LGGLLG LGGGLL LGLGLG LGLGGL LGGLGL".split()  # noqa: SIM905
    parity = parities[int(digits[0])]
    first = "".join((left if kind == "L" else turned)[int(one)] for kind, one in zip(parity, digits[1:7], strict=True))
    bits = "101" + first + "01010" + "".join(right[int(one)] for one in digits[7:]) + "101"
    row = np.repeat(np.array([0 if bit == "1" else 255 for bit in bits], np.uint8), module)
    code = np.repeat(row[np.newaxis], 120, axis=0)
    framed = cv2.copyMakeBorder(code, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=255)
    return cv2.GaussianBlur(framed, (5, 5), 1)  # as a camera sees it


def test_a_qr_code_that_was_drawn_is_read() -> None:
    image = fire(vision.qr_code(scale=6), text="hello, robot").outputs["out"]
    reader = vision.BarcodeReader(kinds="qr")
    first = fire(reader, image=image)
    assert first.outputs["texts"] == ["hello, robot"]
    assert first.events == [("read", "hello, robot")]
    x, y, width, height = first.outputs["boxes"][0]
    assert 0 <= x < width
    assert 0 <= y < height
    assert first.outputs["corners"][0].shape == (4, 2)


def test_a_code_is_told_again_when_it_was_gone_or_if_asked() -> None:
    image = fire(vision.qr_code(scale=6), text="hello").outputs["out"]
    empty = np.full_like(image, 255)
    reader = vision.BarcodeReader(kinds="qr")
    assert [len(fire(reader, image=one).events) for one in (image, image, empty, image)] == [1, 0, 0, 1]
    reader = vision.BarcodeReader(kinds="qr", republish=True)
    assert [len(fire(reader, image=one).events) for one in (image, image)] == [1, 1]


def test_a_bar_code_is_read() -> None:
    outputs = fire(vision.BarcodeReader(), image=ean13("4006381333931")).outputs
    assert outputs["texts"] == ["4006381333931"]


def test_markers_are_found_by_number() -> None:
    known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    image = np.full((160, 160), 255, np.uint8)
    image[40:120, 40:120] = cv2.aruco.generateImageMarker(known, 7, 80)
    outputs = fire(vision.MarkerDetector(), image=image).outputs
    assert outputs["numbers"] == [7]
    assert np.allclose(outputs["corners"][0][0], [40, 40], atol=2)
    assert fire(vision.MarkerDetector(), image=np.full((99, 99), 255, np.uint8)).outputs["numbers"] == []


def test_the_corners_of_a_chessboard_are_found_and_without_one_there_is_silence() -> None:
    corners = fire(vision.ChessboardFinder(columns=7, rows=5), image=board()).outputs["corners"]
    assert corners.shape == (35, 1, 2)
    assert np.allclose(np.sort(corners[:, 0, 0])[0], 40 + 24, atol=1)
    assert fire(vision.ChessboardFinder(columns=7, rows=5), image=np.zeros((99, 99), np.uint8)).outputs == {}


def test_a_camera_is_calibrated_by_pictures_of_a_board() -> None:
    node = vision.CameraCalibration(columns=7, rows=5)
    flat = board()
    height, width = flat.shape
    with pytest.raises(ValueError, match="three pictures at least, got 0"):
        fire(node, slot="calibrate")
    frame = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    for number in range(5):
        lean = np.array([[3 * number, 9], [4, 2 * number], [-5, 3], [6, -3 * number]], np.float32)
        view = cv2.getPerspectiveTransform(frame, frame * 0.9 + 10 + lean)
        picture = cv2.warpPerspective(flat, view, (width, height), borderValue=255)
        outputs = fire(node, image=picture).outputs
    assert (outputs["accepted"], outputs["rejected"]) == (5, 0)
    name, calibration = fire(node, slot="calibrate").events[0]
    assert name == "calibrated"
    assert calibration.error < 1
    assert calibration.size == (width, height)
    assert fire(node, image=np.zeros_like(flat)).outputs["rejected"] == 1
    fire(node, slot="forget")
    assert fire(node, image=flat).outputs["accepted"] == 1


@pytest.mark.slow
def test_a_face_is_found_in_a_photograph() -> None:
    photograph = np.ascontiguousarray(skimage.data.astronaut()[:, :, ::-1])  # type: ignore[no-untyped-call]
    boxes = fire(vision.CascadeDetector(neighbors=6), image=photograph).outputs["boxes"]
    x, y, width, height = max(boxes, key=lambda box: box[2])
    assert x < 224 < x + width
    assert y < 110 < y + height


@pytest.mark.slow
def test_a_cascade_that_is_not_there_names_those_that_are(tmp_path: Any) -> None:
    with pytest.raises(FileNotFoundError, match='no cascade "nose": name a file, or one of eye, .*frontalface_default'):
        fire(vision.CascadeDetector(cascade="nose"), image=np.zeros((9, 9), np.uint8))
    wrong = tmp_path / "wrong.xml"
    wrong.write_text("<no cascade>")
    with pytest.raises(ValueError, match="is not a cascade"):
        fire(vision.CascadeDetector(cascade=str(wrong)), image=np.zeros((9, 9), np.uint8))


def test_a_person_is_found_in_a_photograph_and_a_small_picture_has_none() -> None:
    photograph = np.ascontiguousarray(skimage.data.astronaut()[:, :, ::-1])  # type: ignore[no-untyped-call]
    node = vision.PeopleDetector(threshold=0.0)
    outputs = fire(node, image=photograph).outputs
    assert len(outputs["boxes"]) == len(outputs["weights"])
    assert outputs["weights"] == sorted(outputs["weights"], reverse=True)
    assert fire(node, image=photograph[:100, :50]).outputs == {"boxes": [], "weights": []}


@pytest.mark.parametrize("method", ["ORB", "SIFT", "AKAZE", "BRISK", "KAZE"])
def test_keypoints_of_a_turned_picture_match(method: Any) -> None:
    image = skimage.data.camera()[::2, ::2].copy()  # type: ignore[no-untyped-call]
    node = vision.KeypointDetector(method=method, most=200)
    first, second = (fire(node, image=one).outputs for one in (image, np.rot90(image).copy()))
    assert len(first["keypoints"]) == len(first["points"]) == len(first["descriptors"]) <= 200
    matches = fire(vision.match_descriptors(), first=first["descriptors"], second=second["descriptors"]).outputs["out"]
    assert len(matches) > 20
    right = 0
    for match in matches:
        x, y = first["points"][match.queryIdx]
        expected = (y, image.shape[1] - 1 - x)
        right += bool(np.allclose(second["points"][match.trainIdx], expected, atol=3))
    assert right > 0.7 * len(matches)


def test_a_picture_without_keypoints_gives_empty_ones() -> None:
    outputs = fire(vision.KeypointDetector(), image=np.zeros((64, 64), np.uint8)).outputs
    assert (outputs["keypoints"], outputs["points"].shape, len(outputs["descriptors"])) == ([], (0, 2), 0)
    assert (
        fire(vision.match_descriptors(), first=outputs["descriptors"], second=outputs["descriptors"]).outputs["out"]
        == []
    )


def test_descriptors_of_different_kinds_are_refused() -> None:
    with pytest.raises(ValueError, match="both descriptors are of one kind, got uint8 x 32 and float32 x 128"):
        fire(vision.match_descriptors(), first=np.zeros((3, 32), np.uint8), second=np.zeros((3, 128), np.float32))


@pytest.mark.parametrize("method", ["SGBM", "BM"])
def test_near_things_move_farther(method: Any) -> None:
    wall = np.random.default_rng(0).integers(0, 255, (96, 256), np.uint8)
    right = np.roll(wall, -8, axis=1)
    right[30:60, 100:160] = wall[30:60, 124:184]  # the middle is nearer
    disparity = fire(vision.StereoDepth(method=method, range=32), left=wall, right=right).outputs["disparity"] / 16
    assert np.median(disparity[70:90, 100:200]) == pytest.approx(8, abs=0.5)
    assert np.median(disparity[36:54, 136:170]) == pytest.approx(24, abs=0.5)


def test_pictures_that_are_no_pair_are_refused() -> None:
    node = vision.StereoDepth()
    with pytest.raises(ValueError, match="both pictures are of one size"):
        fire(node, left=np.zeros((99, 200), np.uint8), right=np.zeros((98, 200), np.uint8))
    small = np.zeros((99, 60), np.uint8)
    assert (fire(node, left=small, right=small).outputs["disparity"] == -16).all()  # nothing can be found in it


def test_brightness_is_spread_and_gray_stays_gray() -> None:
    dark = (skimage.data.camera()[::4, ::4] // 4).astype(np.uint8)  # type: ignore[no-untyped-call]
    gray = fire(vision.EqualizeLocally(limit=10.0), image=dark).outputs["out"]
    assert gray.ndim == 2
    assert gray.std() > 1.5 * dark.std()
    assert fire(vision.EqualizeLocally(), image=cv2.cvtColor(dark, cv2.COLOR_GRAY2BGR)).outputs["out"].shape[2] == 3


@pytest.mark.parametrize(
    "kind", ["PeopleDetector", "BarcodeReader", "MarkerDetector", "KeypointDetector", "EqualizeLocally"]
)
def test_pictures_of_another_kind_are_refused(kind: str) -> None:
    node = getattr(vision, kind)()
    values: dict[str, Any] = {"image": np.zeros((99, 99), np.float64)}
    with pytest.raises(TypeError, match="expected Picture .*, found an array of float64, 99 x 99"):
        fire(node, debug=False, **values)
    with pytest.raises(TypeError, match="height x width x 1 or 3 or 4.*, found an array of uint8, 150 x 99 x 2"):
        fire(node, debug=False, image=np.zeros((150, 99, 2), np.uint8))


def test_the_event_of_a_code_goes_its_own_way_in_a_graph() -> None:
    code = fire(vision.qr_code(scale=6), text="door 4").outputs["out"]
    told: list[str] = []

    @hfg.node
    def camera() -> Iterator[Gray]:
        yield from (code, code)

    @hfg.node
    def act(text: str) -> None:
        told.append(text)

    graph = hfg.Graph("door")
    reader = graph.add(vision.BarcodeReader())
    graph.connect(graph.add(camera()).out, reader.image)
    graph.connect(reader.read, graph.add(act()).ports.inputs["text"])
    hfg.run(graph, clock="virtual", debug=True)
    assert told == ["door 4"]


def test_boxes_are_drawn_with_their_words_and_the_picture_stays_as_it_is() -> None:
    image = np.full((60, 80), 100, np.uint8)
    drawn = fire(vision.draw_boxes(thickness=1), image=image, boxes=[(10, 20, 30, 25)], labels=["ä 1"]).outputs["out"]
    green = np.all(drawn == (0, 255, 0), axis=2)
    assert green[20, 10:40].all()
    assert green[44, 10:40].all()
    assert green[20:45, 10].all()
    assert green[20:45, 39].all()
    assert not green[21:44, 11:39].any()
    assert (drawn[:19] != 100).any()  # the words
    assert (image == 100).all()


def test_words_stay_within_the_picture_and_boxes_without_words_have_none() -> None:
    image = np.zeros((60, 80, 3), np.uint8)
    boxes = [(70, 0, 30, 25), (-5, 50, 30, 25)]
    plain = fire(vision.draw_boxes(), image=image, boxes=boxes).outputs["out"]
    named = fire(vision.draw_boxes(color=hfg.Colour(255, 0, 0)), image=image, boxes=boxes, labels=["door"]).outputs[
        "out"
    ]
    assert plain[10, 71].tolist() == [0, 255, 0]
    columns = np.argwhere(named[:12, :68, 2])[:, 1]
    assert 20 < columns.min() < 50  # moved to the left, so that it can be read
    assert fire(vision.draw_boxes(), image=image, boxes=[]).outputs["out"].any() is np.False_


def test_circles_are_drawn_and_counted_as_hough_finds_them() -> None:
    image = np.zeros((100, 120), np.uint8)
    for place in ((30, 40), (80, 60)):
        cv2.circle(image, place, 15, 255, -1)
    hough = cv_nodes.hough_circles(param2=12, min_radius=10, max_radius=20)
    found = fire(hough, image=cv2.blur(image, (3, 3))).outputs["out"]
    drawn = fire(vision.draw_circles(thickness=1), image=image, circles=found).outputs
    assert drawn["found"] == 2
    green = (drawn["out"][:, :, 1] > 150) & (drawn["out"][:, :, 0] < 100)
    assert green[23:28, 28:33].any()  # the upper edge of the first one
    assert not green[38:43, 28:33].any()
    assert fire(vision.draw_circles(), image=image, circles=np.zeros((0, 3))).outputs["found"] == 0


def test_circles_that_cannot_be_drawn_are_left_out_and_other_arrays_refused() -> None:
    circles = np.array([[np.nan, 1, 1], [1e9, 1, 1], [5, 5, -1], [5, 5, 2]])
    assert fire(vision.draw_circles(), image=np.zeros((9, 9), np.uint8), circles=circles).outputs["out"].any()
    with pytest.raises(ValueError, match="rows of x, y and radius, got an array of 2 x 2"):
        fire(vision.draw_circles(), image=np.zeros((9, 9), np.uint8), circles=np.zeros((2, 2)))


def test_a_box_that_is_too_far_away_is_refused() -> None:
    with pytest.raises(ValueError, match=r"within 32767 pixels, got \(40000, 0, 1, 1\)"):
        fire(vision.draw_boxes(), image=np.zeros((9, 9), np.uint8), boxes=[(40000, 0, 1, 1)])


def test_a_qr_code_is_read_however_it_is_turned() -> None:
    code = fire(vision.qr_code(scale=6), text="https://example.org/article/4006381333931").outputs["out"]
    side = 2 * code.shape[0]
    for angle in range(0, 90, 10):
        turn = cv2.getRotationMatrix2D((code.shape[1] / 2, code.shape[0] / 2), angle, 1)
        turn[:, 2] += code.shape[0] / 2
        seen = cv2.GaussianBlur(cv2.warpAffine(code, turn, (side, side), borderValue=255), (3, 3), 0)
        assert len(fire(vision.BarcodeReader(kinds="qr"), image=seen).outputs["texts"]) == 1, angle


def test_a_text_with_half_of_a_character_is_refused_and_does_not_end_the_process() -> None:
    with pytest.raises(ValueError, match="the text '\\\\ud800' has half of a character"):
        fire(vision.qr_code(), text="\ud800")
    with pytest.raises(ValueError, match="the path"):
        fire(video.VideoFile(path="a%d\udcff.png"))
    with pytest.raises(ValueError, match="the path"):
        fire(video.WriteVideo(path="a\udcff.avi"), image=np.zeros((8, 8), np.uint8))


@pytest.mark.parametrize("method", ["AKAZE", "KAZE"])
def test_pictures_that_are_too_small_for_native_code_are_refused(method: str) -> None:
    with pytest.raises(ValueError, match=f"{method} needs a picture of at least two rows"):
        fire(vision.KeypointDetector(method=method), image=np.zeros((1, 40), np.uint8))


def test_a_video_that_is_too_narrow_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="MJPG needs pictures that are at least 8 pixels wide, got 5 x 9"):
        fire(video.WriteVideo(path=str(tmp_path / "a.avi")), image=np.zeros((9, 5), np.uint8))

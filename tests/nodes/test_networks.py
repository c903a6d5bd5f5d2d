"""Networks, regions and marker poses of the family `vision`, compared with numpy, OpenCV and a pinhole camera."""

from __future__ import annotations

import math
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from hfg.geometry import Transform
from hfg.nodes import vision
from hfg.nodes.vision._networks import Placement, suppressed
from hfg.testing import fire
from tests.nodes.onnx_files import block_detector

SIDE, ROWS, COLUMNS = 16, 3, 4
RUNTIMES = [
    "opencv",
    pytest.param("onnxruntime", marks=pytest.mark.skipif(find_spec("onnxruntime") is None, reason="not installed")),
]


def out(node: Any, **values: Any) -> Any:
    return fire(node, **values).outputs["out"]


# --- networks ---


def detector() -> tuple[np.ndarray, np.ndarray]:
    """Of each block: its middle, 20 x 12 pixels, and how red and how blue it is."""
    weights, offsets = np.zeros((6, 3, SIDE, SIDE)), np.zeros((1, 6, ROWS, COLUMNS))
    weights[4, 0] = weights[5, 2] = 1 / SIDE**2
    for row in range(ROWS):
        for column in range(COLUMNS):
            offsets[0, :4, row, column] = (column + 0.5) * SIDE, (row + 0.5) * SIDE, 20, 12
    return weights, offsets


@pytest.fixture
def model(tmp_path: Path) -> str:
    path = tmp_path / "blocks.onnx"
    path.write_bytes(block_detector(*detector()))
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize("runtime", RUNTIMES)
def test_a_network_gives_what_numpy_computes(tmp_path: Path, runtime: Any) -> None:
    rng = np.random.default_rng(1)
    weights, offsets = rng.normal(0, 1, (6, 3, SIDE, SIDE)), rng.normal(0, 1, (1, 6, ROWS, COLUMNS))
    (tmp_path / "random.onnx").write_bytes(block_detector(weights, offsets))
    tensor = rng.normal(0, 1, (1, 3, ROWS * SIDE, COLUMNS * SIDE)).astype(np.float32)
    node = vision.RunNetwork(path=str(tmp_path / "random.onnx"), runtime=runtime)
    (found,) = fire(node, tensor=tensor).outputs["results"]
    blocks = tensor.reshape(3, ROWS, SIDE, COLUMNS, SIDE)
    expected = np.einsum("ocij,crisj->ors", weights, blocks) + offsets[0]
    assert found.shape == (1, 6, ROWS * COLUMNS)
    assert np.allclose(found[0], expected.reshape(6, -1), atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("runtime", RUNTIMES)
def test_objects_are_found_where_they_are_in_the_picture(model: str, runtime: Any) -> None:
    """The picture is twice as wide and four times as high as the input, which leaves a rim on both sides."""
    picture = np.zeros((4 * ROWS * SIDE, 2 * COLUMNS * SIDE, 3), np.uint8)
    node = vision.DetectObjects(
        path=model, runtime=runtime, width=COLUMNS * SIDE, height=ROWS * SIDE, threshold=0.6, names=["red"]
    )
    assert fire(node, image=picture).outputs["boxes"] == []
    picture[:, 64:] = (255, 0, 0)  # blue, right of the middle
    picture[:64, :64] = (0, 0, 255)
    done = fire(node, image=picture).outputs
    # The picture is shrunk by 4 to 32 x 48, and begins 16 pixels from the left: at the second column of blocks.
    found = sorted(zip(done["labels"], done["boxes"], strict=True))
    assert found == [
        ("1", (56, 8, 72, 48)), ("1", (56, 72, 72, 48)), ("1", (56, 136, 72, 48)), ("red", (0, 8, 72, 48)),
    ]  # fmt: skip
    assert done["scores"] == pytest.approx([1.0] * 4, abs=0.02)
    assert sorted(done["classes"]) == [0, 1, 1, 1]


@pytest.mark.slow
@pytest.mark.parametrize("runtime", RUNTIMES)
def test_a_file_that_is_no_network_or_takes_other_pictures_is_one_sentence(
    tmp_path: Path, model: str, runtime: Any
) -> None:
    wrong = tmp_path / "wrong.onnx"
    tensor = np.zeros((1, 3, ROWS * SIDE, COLUMNS * SIDE), np.float32)
    for data in (b"", b"this is not a network", block_detector(*detector())[:-2000]):
        wrong.write_bytes(data)
        with pytest.raises(
            ValueError, match=r'wrong.onnx" is not a network in ONNX format that \w+ can run on an input'
        ):
            fire(vision.RunNetwork(path=str(wrong), runtime=runtime), tensor=tensor)
    with pytest.raises(ValueError, match="that .* can run on an input of 1 x 3 x 7 x 5"):
        fire(vision.RunNetwork(path=model, runtime=runtime), tensor=np.zeros((1, 3, 7, 5), np.float32))


def test_a_network_that_is_nowhere_is_told(model: str) -> None:
    with pytest.raises(FileNotFoundError, match=r'cannot read "nowhere.onnx"'):
        fire(vision.RunNetwork(path="nowhere.onnx"), tensor=np.zeros((1, 3, 8, 8), np.float32))
    if find_spec("onnxruntime") is None:
        with pytest.raises(ModuleNotFoundError, match=r'needs onnxruntime: pip install "hfg\[onnx\]"'):
            fire(vision.RunNetwork(path=model, runtime="onnxruntime"), tensor=np.zeros((1, 3, 8, 8), np.float32))


# --- before and after ---


def test_a_picture_becomes_a_tensor_and_keeps_its_proportions() -> None:
    picture = np.random.default_rng(2).integers(0, 255, (20, 40, 3), np.uint8)
    done = fire(vision.image_tensor(width=40, height=60, mean=[1.0, 2.0, 3.0], scale=[0.5, 0.1, 2.0]), image=picture)
    tensor, placement = done.outputs["tensor"], done.outputs["placement"]
    assert tensor.shape == (1, 3, 60, 40)
    assert placement == Placement(1.0, 1.0, 0, 20, 40, 20)
    for channel, (mean, scale) in enumerate([(1, 0.5), (2, 0.1), (3, 2.0)]):
        assert np.allclose(tensor[0, channel, 20:40], (picture[..., 2 - channel] - float(mean)) * scale, atol=1e-4)
        assert np.allclose(tensor[0, channel, :20], (114 - mean) * scale, atol=1e-4)
    stretched = fire(vision.image_tensor(width=10, height=40, fit="stretch"), image=picture).outputs["placement"]
    assert stretched == Placement(0.25, 2.0, 0, 0, 40, 20)
    with pytest.raises(ValueError, match="mean and scale have three finite numbers each"):
        fire(vision.image_tensor(mean=[1.0]), image=picture)


def boxes_by_hand(rows: Any, threshold: float, overlap: float) -> list[tuple[float, int, tuple[float, ...]]]:
    """Candidates of score, class and corners: keep the best, and what does not overlap it too much, and so on."""
    left = sorted((one for one in rows if one[0] >= threshold), key=lambda one: -one[0])
    kept = []
    while left:
        best = left.pop(0)
        kept.append(best)

        def share(other: Any, best: Any = best) -> float:
            a, b = best[2], other[2]
            wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
            common = max(0.0, wide) * max(0.0, high)
            return float(common / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - common))

        left = [one for one in left if one[1] != best[1] or share(one) <= overlap]
    return kept


PLACED = Placement(0.5, 0.5, 20, 0, 400, 480)


def in_picture(corners: Any) -> tuple[int, int, int, int]:
    x0, y0, x1, y1 = ((v - off) / 0.5 for v, off in zip(corners, (20, 0, 20, 0), strict=True))
    return round(x0), round(y0), round(x1) - round(x0), round(y1) - round(y0)


@pytest.mark.parametrize("layout", ["v8", "v5"])
def test_boxes_of_yolo_are_those_that_one_finds_by_hand(layout: Any) -> None:
    rng = np.random.default_rng(3)
    count = 120
    middles, sizes = rng.uniform([60, 60], [180, 180], (count, 2)), rng.uniform(10, 70, (count, 2))
    scores, sure = rng.uniform(0, 1, (count, 3)), rng.uniform(0.5, 1, (count, 1))
    rows, whole = [], scores * sure if layout == "v5" else scores
    for (x, y), (w, h), one in zip(middles, sizes, whole, strict=True):
        rows.append((float(one.max()), int(one.argmax()), (x - w / 2, y - h / 2, x + w / 2, y + h / 2)))
    table = np.concatenate([middles, sizes, *([sure] if layout == "v5" else []), scores], 1).astype(np.float32)
    result = table[None] if layout == "v5" else table.T[None]
    done = fire(
        vision.yolo_boxes(layout=layout, threshold=0.4, overlap=0.3), results=[result], placement=PLACED
    ).outputs
    expected = boxes_by_hand(rows, 0.4, 0.3)
    assert done["scores"] == pytest.approx([score for score, _, _ in expected])
    assert done["classes"] == [number for _, number, _ in expected]
    assert np.abs(np.array(done["boxes"]) - [in_picture(corners) for _, _, corners in expected]).max() <= 1
    assert 10 < len(expected) < count


def test_boxes_of_ssd_are_those_that_one_finds_by_hand() -> None:
    rng = np.random.default_rng(4)
    low = rng.uniform(0.2, 0.5, (60, 2))
    high = low + rng.uniform(0.05, 0.3, (60, 2))
    scores, classes = rng.uniform(0, 1, 60), rng.integers(0, 3, 60)
    result = np.concatenate([np.zeros((60, 1)), classes[:, None], scores[:, None], low, high], 1)[None, None]
    rows = [(s, int(c), tuple(np.array(box) * [240, 240, 240, 240]))
            for s, c, *box in zip(scores, classes, *low.T, *high.T, strict=True)]  # fmt: skip
    node = vision.ssd_boxes(width=240, height=240, threshold=0.3, overlap=0.5)
    done = fire(node, results=[result.astype(np.float32)], placement=PLACED).outputs
    expected = boxes_by_hand(rows, 0.3, 0.5)
    assert done["scores"] == pytest.approx([score for score, _, _ in expected])
    assert done["classes"] == [number for _, number, _ in expected]


def test_suppression_is_that_of_opencv() -> None:
    rng = np.random.default_rng(5)
    low = rng.integers(0, 100, (200, 2))
    size = rng.integers(5, 60, (200, 2))
    scores = np.sort(rng.uniform(0.1, 1, 200))[::-1]
    expected = cv2.dnn.NMSBoxes(np.concatenate([low, size], 1).tolist(), scores.tolist(), 0.0, 0.4)
    found = suppressed(np.concatenate([low, low + size], 1).astype(float), np.zeros(200, int), 0.4)
    assert found.tolist() == np.ravel(expected).tolist()


def test_boxes_beyond_the_picture_are_cut_and_what_is_no_number_is_left_out() -> None:
    rows = np.array([[120, 120, 1000, 1000, 0.9], [np.nan, 0, 1, 1, 0.9], [100, 100, 9, 9, np.nan], [5, 5, 2, 2, 0.9]])
    done = fire(vision.yolo_boxes(), results=[rows.T[None].astype(np.float32)], placement=PLACED).outputs
    assert done["boxes"] == [(0, 0, 400, 480)]  # the last one lies on the rim
    with pytest.raises(ValueError, match=r'of layout "v8" is 1 x \(4 \+ classes\) x candidates, got 3 x 3'):
        fire(vision.yolo_boxes(), results=[np.zeros((3, 3), np.float32)], placement=PLACED)
    with pytest.raises(ValueError, match="of an SSD detector is 1 x 1 x candidates x 7, got no result"):
        fire(vision.ssd_boxes(), results=[], placement=PLACED)


# --- regions ---


def test_regions_are_cut_out_and_what_lies_outside_is_left_out() -> None:
    picture = np.arange(20 * 30 * 3).reshape(20, 30, 3).astype(np.uint8)
    cut = out(vision.crop_image(left=5, upper=2, width=4, height=3), image=picture)
    assert cut.tolist() == [[picture[y, x].tolist() for x in range(5, 9)] for y in range(2, 5)]
    assert out(vision.crop_image(left=-2, upper=15, width=5, height=50), image=picture).shape == (5, 3, 3)
    assert "out" not in fire(vision.crop_image(left=30, upper=0, width=5, height=5), image=picture).outputs
    parts = out(vision.crop_boxes(margin=1), image=picture, boxes=[(5, 2, 4, 3), (99, 0, 3, 3), (0, 0, 2, 2)])
    assert [part.shape for part in parts] == [(5, 6, 3), (3, 3, 3)]
    assert (parts[0][1:-1, 1:-1] == cut).all()


# --- poses of markers ---

CAMERA = [[700.0, 0.0, 330.0], [0.0, 690.0, 250.0], [0.0, 0.0, 1.0]]


def projected(points: np.ndarray) -> np.ndarray:
    """Of points in the optical frame, by a pinhole."""
    return np.stack([700 * points[:, 0] / points[:, 2] + 330, 690 * points[:, 1] / points[:, 2] + 250], 1)


def test_the_pose_of_a_marker_is_the_one_that_was_projected() -> None:
    rng = np.random.default_rng(6)
    square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * 0.08
    for _ in range(20):
        facing = Transform.of(roll=math.pi)  # the marker's z points to the camera
        pose = Transform.of(*rng.uniform([-0.4, -0.3, 0.8], [0.4, 0.3, 3.0]))
        pose = pose @ Transform.of(roll=rng.uniform(-0.9, 0.9), pitch=rng.uniform(-0.9, 0.9), yaw=rng.uniform(-3, 3))
        pose = pose @ facing
        corners = projected(pose.apply(square)).astype(np.float32)
        (found,) = out(vision.marker_poses(side=0.16, matrix=CAMERA), numbers=[7], corners=[corners])
        assert found.number == 7
        assert np.allclose(found.pose.matrix, pose.matrix, atol=5e-3)
        assert found.error < 0.01


def test_a_marker_in_a_picture_is_where_it_was_drawn_and_a_mounted_camera_sees_it_ahead() -> None:
    marker = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 5, 200)
    tile = cv2.copyMakeBorder(marker, 50, 50, 50, 50, cv2.BORDER_CONSTANT, value=255)
    pose = Transform.of(0.1, -0.05, 1.2) @ Transform.of(roll=math.pi + 0.3, pitch=0.2)
    half = 0.1 * 300 / 200  # with the rim; a corner of the picture is half a pixel outside of its middle
    rim = pose.apply(np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]]))
    source = np.array([[-0.5, -0.5], [299.5, -0.5], [299.5, 299.5], [-0.5, 299.5]], np.float32)
    warp = cv2.getPerspectiveTransform(source, projected(rim).astype(np.float32))
    picture = cv2.warpPerspective(tile, warp, (640, 480), flags=cv2.INTER_AREA, borderValue=255)
    seen = fire(vision.MarkerDetector(dictionary="4X4_50"), image=picture).outputs
    (found,) = out(vision.marker_poses(side=0.2, matrix=CAMERA), numbers=seen["numbers"], corners=seen["corners"])
    assert found.number == 5
    assert found.pose.translation.tolist() == pytest.approx(pose.translation.tolist(), abs=0.03)
    mounted = Transform.of(roll=-math.pi / 2, yaw=-math.pi / 2)
    ahead = (mounted @ found.pose).translation
    assert ahead.tolist() == pytest.approx([1.2, -0.1, 0.05], abs=0.03)


def test_what_is_no_marker_or_no_camera_is_refused() -> None:
    bent = np.array([[0, 0], [10, 10], [10, 0], [0, 10]], np.float32)
    assert out(vision.marker_poses(), numbers=[1, 2], corners=[bent, np.full((4, 2), np.nan, np.float32)]) == []
    with pytest.raises(ValueError, match="each marker has a number and corners, got 1 and 0"):
        fire(vision.marker_poses(), numbers=[1], corners=[])
    with pytest.raises(ValueError, match="a camera matrix is"):
        fire(vision.marker_poses(matrix=[[0.0] * 3] * 3), numbers=[], corners=[])
    with pytest.raises(ValueError, match="0, 4, 5, 8, 12 or 14 finite coefficients of distortion, got"):
        fire(vision.marker_poses(distortion=[1.0]), numbers=[], corners=[])

"""Neural networks in ONNX files: run by OpenCV or by ONNX Runtime, and what detectors among them say."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Predicate, Unit

from hfg.images import Picture
from hfg.nodes._extras import require
from hfg.nodes._pictures import colour, need_picture
from hfg.nodes._structured import need_harmless, tried_with
from hfg.nodes.files.access import is_a_path, named, read_whole
from hfg.nodes.vision._detecting import Box
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State
from hfg.types import Named, Shape

Tensor: TypeAlias = Annotated[npt.NDArray[np.float32], Shape(None, None, None, None), Named("Tensor")]
"""Pictures for a network: their number, channels, height, width."""

Result: TypeAlias = npt.NDArray[np.float32]
"""What a network says, of any shape."""

Runtime: TypeAlias = Literal["opencv", "onnxruntime"]
Threshold = Annotated[float, Interval(ge=0, le=1), Unit("1")]
_MOST_BOXES = 2000  # that are compared with each other


class Placement(NamedTuple):
    """Where a picture is in the input of a network, so that what it finds can be brought back.

    Attributes:
      across: how many pixels of the input are one of the picture, along x.
      down: the same along y.
      left: where the picture begins in the input.
      upper: the same along y.
      width: of the picture, in pixels.
      height: of the picture.
    """

    across: float
    down: float
    left: int
    upper: int
    width: int
    height: int


class Network:
    """A network that has been read from a file; the plain part of the nodes.

    Args:
      path: path of the file.
      runtime: what runs it.

    Raises:
      OSError: the file cannot be read.
      ModuleNotFoundError: ONNX Runtime is not installed.
    """

    def __init__(self, path: Path, runtime: Runtime) -> None:
        self.path, self.runtime = path, runtime
        self.data = read_whole(path)
        self.session: Any = None
        self.shapes: set[tuple[int, ...]] = set()
        if runtime == "onnxruntime":
            require("onnxruntime", "onnx")

    def run(self, tensor: Any) -> list[Any]:
        """Return the outputs for an input.

        Raises:
          ValueError: the file is not a network, or not one for such an input.
        """
        kind = "opencv" if self.runtime == "opencv" else "session"
        if tensor.shape not in self.shapes:
            try:
                # It runs in a process of its own first, because files may be anyone's.
                need_harmless(kind, tried_with(tensor.shape, self.data))
                self.session = self.session or _SESSIONS[self.runtime](self.data)
            except (ValueError, cv2.error) as error:
                raise ValueError(
                    f'"{self.path}" is not a network in ONNX format that {self.runtime} can run on an input of '
                    f"{' x '.join(map(str, tensor.shape))} ({' '.join(str(error).split())})"
                ) from None
            self.shapes.add(tensor.shape)
        if self.runtime == "onnxruntime":
            (first, *_) = self.session.get_inputs()
            found = self.session.run(None, {first.name: tensor})
        else:
            self.session.setInput(tensor)
            found = self.session.forward(self.session.getUnconnectedOutLayersNames())
        return [np.asarray(one, np.float32) for one in found]


def _opencv(data: bytes) -> Any:
    return cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8))


def _onnxruntime(data: bytes) -> Any:
    return require("onnxruntime", "onnx").InferenceSession(data, providers=["CPUExecutionProvider"])


_SESSIONS: dict[str, Any] = {"opencv": _opencv, "onnxruntime": _onnxruntime}


@node(outputs={"tensor": Tensor, "placement": Placement})
def image_tensor(
    image: Picture,
    *,
    width: Annotated[int, Interval(ge=1, le=4096), Unit("px")] = 640,
    height: Annotated[int, Interval(ge=1, le=4096), Unit("px")] = 640,
    fit: Literal["letterbox", "stretch"] = "letterbox",
    order: Literal["rgb", "bgr"] = "rgb",
    mean: Annotated[list[float], Unit("1")] = [0.0, 0.0, 0.0],  # noqa: B006 - it is only read
    scale: Annotated[list[float], Unit("1")] = [1 / 255, 1 / 255, 1 / 255],  # noqa: B006
) -> tuple[Any, Placement]:
    """Turn a picture into the input of a neural network: letterbox it and normalize its levels (blob).

    Fires once per picture.

    Args:
      image: the picture: gray, or blue, green, red.
      width: of the input.
      height: of the input.
      fit: "letterbox" keeps the proportions and fills the rest with gray (114), "stretch" does not.
      order: of the channels of the input.
      mean: what is taken off each channel, in its order.
      scale: what each channel is then multiplied by.

    Returns:
      tensor: 1 x 3 x height x width.
      placement: where the picture is in it.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty or has two channels, or there are not three finite numbers in mean and scale.
    """
    return prepared(image, (width, height), fit, order, (mean, scale))


def prepared(image: Any, size: tuple[int, int], fit: str, order: str, levels: Any) -> tuple[Any, Placement]:
    """Return the input of a network; see `image_tensor`."""
    mean, scale = (np.array(one, np.float32) for one in levels)
    if not (mean.shape == scale.shape == (3,) and np.isfinite(mean).all() and np.isfinite(scale).all()):
        raise ValueError(f"mean and scale have three finite numbers each, got {list(levels[0])} and {list(levels[1])}")
    picture = colour(image)
    high, wide = picture.shape[:2]
    across, down = size[0] / wide, size[1] / high
    if fit == "letterbox":
        across = down = min(across, down)
    inner = max(1, min(size[0], round(wide * across))), max(1, min(size[1], round(high * down)))
    left, upper = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    whole = np.full((size[1], size[0], 3), 114, np.uint8)
    whole[upper : upper + inner[1], left : left + inner[0]] = cv2.resize(picture, inner, interpolation=cv2.INTER_LINEAR)
    if order == "rgb":
        whole = whole[..., ::-1]
    with np.errstate(over="ignore"):
        tensor = ((whole.astype(np.float32) - mean) * scale).transpose(2, 0, 1)[None]
    return np.ascontiguousarray(tensor), Placement(inner[0] / wide, inner[1] / high, left, upper, wide, high)


class RunNetwork(Node):
    """Run a neural network from an ONNX file on a tensor (inference).

    Fires once per tensor. The network is read at the start, and tried in a process of its own at the first tensor of
    each shape, which takes a second or more. Running it blocks the loop; put the node into a thread group.

    Attributes:
      path: path of the .onnx file.
      runtime: "opencv" needs nothing further; "onnxruntime" knows more kinds of layers and is often faster, and needs
        the extra `onnx`.
      tensor: the first input of the network.
      results: its outputs, in their order.

    Raises:
      OSError: the file cannot be read; the message says why.
      ValueError: the file is not a network, or not one for tensors of this shape; or the path is not valid.
      ModuleNotFoundError: ONNX Runtime is not installed.
    """

    path = Parameter("model.onnx", Predicate(is_a_path), pattern="*.onnx")
    runtime: Parameter[Runtime] = Parameter("opencv", type=Runtime)
    tensor = Input(Tensor)
    results = Output(list[Result])

    network: State[Network | None] = State(None)

    def setup(self) -> None:
        """Read the network."""
        self.network = Network(named(self.path), self.runtime)

    def process(self, tensor: Tensor) -> list[Result]:
        """Run it."""
        self.network = reread(self.network, self.path, self.runtime)
        return self.network.run(tensor)


def reread(network: Network | None, path: str, runtime: Runtime) -> Network:
    """Return a network, read again if it is to be another one now."""
    if network is None or (network.path, network.runtime) != (named(path), runtime):
        return Network(named(path), runtime)
    return network


class Found(NamedTuple):
    """Objects that a detector has found, the surest first: one of each for each object.

    Attributes:
      boxes: left, upper edge, width, height in pixels of the picture.
      scores: how sure each is, 0 to 1.
      classes: number of its class, from 0.
    """

    boxes: list[Box]
    scores: list[float]
    classes: list[int]


@node(outputs=Found)
def yolo_boxes(
    results: Sequence[Result],
    placement: Placement,
    *,
    layout: Literal["v8", "v5"] = "v8",
    threshold: Threshold = 0.25,
    overlap: Threshold = 0.45,
) -> Found:
    """Decode the output of a YOLO detector, and keep of overlapping boxes the best (non-maximum suppression, NMS).

    Fires once per set of results.

    Args:
      results: of `RunNetwork`; the first one counts. In "v8" (also 9, 11 and 12) it is 1 x (4 + classes) x candidates,
        in "v5" (also 7) 1 x candidates x (5 + classes); each candidate has the middle, width and height of a box in
        pixels of the input, in "v5" how sure it is that there is something, and a score for each class.
      placement: of `image_tensor`.
      layout: of the output.
      threshold: least score.
      overlap: greatest share of intersection by union (IoU) of two boxes of a class.

    Returns:
      boxes: left, upper edge, width, height in pixels of the picture; the surest first.
      scores: how sure each is, 0 to 1.
      classes: number of its class, from 0.

    Raises:
      ValueError: the first result has another shape.
    """
    rows, shape = _first_of(results)
    rows = rows[0] if rows.ndim == 3 and len(rows) == 1 else rows
    first = 4 if layout == "v8" else 5
    if layout == "v8" and rows.ndim == 2:
        rows = rows.T
    if rows.ndim != 2 or rows.shape[1] <= first:
        wanted = "1 x (4 + classes) x candidates" if layout == "v8" else "1 x candidates x (5 + classes)"
        raise ValueError(f'the output of a YOLO detector of layout "{layout}" is {wanted}, got {shape}')
    with np.errstate(all="ignore"):
        scores = rows[:, first:] * (rows[:, 4:5] if layout == "v5" else 1.0)
        sides = rows[:, :4].astype(np.float64)
        corners = np.concatenate([sides[:, :2] - sides[:, 2:] / 2, sides[:, :2] + sides[:, 2:] / 2], 1)
    classes = np.where(np.isnan(scores), -np.inf, scores).argmax(1)
    return _kept(corners, scores[np.arange(len(rows)), classes], classes, placement, threshold, overlap)


@node(outputs=Found)
def ssd_boxes(
    results: Sequence[Result],
    placement: Placement,
    *,
    width: Annotated[int, Interval(ge=1, le=4096), Unit("px")] = 300,
    height: Annotated[int, Interval(ge=1, le=4096), Unit("px")] = 300,
    threshold: Threshold = 0.5,
    overlap: Threshold = 0.45,
) -> Found:
    """Decode the output of an SSD detector, and keep of overlapping boxes the best (non-maximum suppression, NMS).

    Fires once per set of results.

    Args:
      results: of `RunNetwork`; the first one counts: 1 x 1 x candidates x 7, each a number of a picture, a class, a
        score, and left, upper, right and lower edge as shares of the input.
      placement: of `image_tensor`.
      width: of the input of the network.
      height: of the input of the network.
      threshold: least score.
      overlap: greatest share of intersection by union (IoU) of two boxes of a class.

    Returns:
      boxes: left, upper edge, width, height in pixels of the picture; the surest first.
      scores: how sure each is, 0 to 1.
      classes: number of its class, from 0.

    Raises:
      ValueError: the first result has another shape.
    """
    rows, shape = _first_of(results)
    if rows.ndim < 2 or rows.shape[-1] != 7:
        raise ValueError(f"the output of an SSD detector is 1 x 1 x candidates x 7, got {shape}")
    rows = rows.reshape(-1, 7).astype(np.float64)
    with np.errstate(all="ignore"):
        corners = rows[:, 3:] * np.array([width, height, width, height])
        classes = np.where(np.isfinite(rows[:, 1]), np.clip(rows[:, 1], 0, 1e6), 0).astype(np.int64)
    return _kept(corners, rows[:, 2], classes, placement, threshold, overlap)


def _first_of(results: Sequence[Result]) -> tuple[Any, str]:
    """Return the result that counts, and its shape in words."""
    if not len(results):
        return np.zeros(0, np.float32), "no result"
    return results[0], " x ".join(map(str, results[0].shape))


def _kept(corners: Any, scores: Any, classes: Any, placement: Placement, threshold: float, overlap: float) -> Found:
    """Keep what is sure enough and not the same as something surer; `corners` are in pixels of the input."""
    at = [placement.left, placement.upper, placement.left, placement.upper]
    by = np.array([placement.across, placement.down, placement.across, placement.down], np.float64)
    with np.errstate(all="ignore"):
        corners = (corners - at) / by
        limits = np.array([placement.width, placement.height, placement.width, placement.height])
        corners = np.clip(corners, 0, np.maximum(limits, 0))
        sound = np.isfinite(corners).all(1) & (scores >= threshold) & (corners[:, 2:] > corners[:, :2]).all(1)
    order = np.flatnonzero(sound)
    order = order[np.argsort(-scores[order], kind="stable")][:_MOST_BOXES]
    corners, scores, classes = corners[order], scores[order], classes[order]
    chosen = suppressed(corners, classes, overlap)
    boxes = [
        (round(left), round(upper), max(1, round(right) - round(left)), max(1, round(lower) - round(upper)))
        for left, upper, right, lower in corners[chosen].tolist()
    ]
    return Found(boxes, [min(1.0, float(one)) for one in scores[chosen]], [int(one) for one in classes[chosen]])


def suppressed(corners: Any, classes: Any, overlap: float) -> Any:
    """Return which boxes are left if each takes away those after it that overlap too much and are of its class.

    Args:
      corners: left, upper, right and lower edge; the best box first.
      classes: of the boxes.
      overlap: greatest share of intersection by union.
    """
    areas = (corners[:, 2:] - corners[:, :2]).prod(1)
    left, kept = np.arange(len(corners)), []
    while len(left):
        best, left = left[0], left[1:]
        kept.append(best)
        low, high = np.maximum(corners[best, :2], corners[left, :2]), np.minimum(corners[best, 2:], corners[left, 2:])
        common = np.maximum(high - low, 0).prod(1)
        share = common / np.maximum(areas[best] + areas[left] - common, 1e-300)
        left = left[(share <= overlap) | (classes[left] != classes[best])]
    return np.array(kept, np.int64)


class DetectObjects(Node):
    """Detect objects in pictures by a neural network from an ONNX file: such as YOLO or SSD.

    Fires once per picture. It is `image_tensor`, `RunNetwork` and `yolo_boxes` or `ssd_boxes` in one. The network is
    read at the start, and tried in a process of its own at the first picture, which takes a second or more. Running it
    blocks the loop; put the node into a thread group.

    Attributes:
      path: path of the .onnx file.
      runtime: "opencv" needs nothing further; "onnxruntime" needs the extra `onnx`.
      layout: of the output: see `yolo_boxes` and `ssd_boxes`.
      width: of the input of the network.
      height: of the input of the network.
      fit: "letterbox" keeps the proportions of the picture, "stretch" does not.
      order: of the channels of the input.
      mean: what is taken off each channel, in its order.
      scale: what each channel is then multiplied by.
      threshold: least score.
      overlap: greatest share of intersection by union (IoU) of two boxes of a class.
      names: of the classes, in the order of their numbers; others are called by their number.
      image: the picture: gray, or blue, green, red.
      boxes: left, upper edge, width, height in pixels; the surest first.
      scores: how sure each is, 0 to 1.
      classes: number of its class, from 0.
      labels: name of its class.

    Raises:
      OSError: the file cannot be read; the message says why.
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty or has two channels, the file is not a network for such an input, its output has
        another layout, or mean and scale are not three numbers; or the path is not valid.
      ModuleNotFoundError: ONNX Runtime is not installed.
    """

    path = Parameter("model.onnx", Predicate(is_a_path), pattern="*.onnx")
    runtime: Parameter[Runtime] = Parameter("opencv", type=Runtime)
    layout = Parameter("yolo-v8", type=Literal["yolo-v8", "yolo-v5", "ssd"])
    width = Parameter(640, Interval(ge=1, le=4096), unit="px")
    height = Parameter(640, Interval(ge=1, le=4096), unit="px")
    fit = Parameter("letterbox", type=Literal["letterbox", "stretch"])
    order = Parameter("rgb", type=Literal["rgb", "bgr"])
    mean = Parameter([0.0, 0.0, 0.0], type=list[float], unit="1")
    scale = Parameter([1 / 255, 1 / 255, 1 / 255], type=list[float], unit="1")
    threshold = Parameter(0.25, Interval(ge=0, le=1), unit="1")
    overlap = Parameter(0.45, Interval(ge=0, le=1), unit="1")
    names = Parameter([], type=list[str])
    image = Input(Picture)
    boxes = Output(list[Box])
    scores = Output(list[float])
    classes = Output(list[int])
    labels = Output(list[str])

    network: State[Network | None] = State(None)

    def setup(self) -> None:
        """Read the network."""
        self.network = Network(named(self.path), self.runtime)

    def process(self, image: Picture) -> None:
        """Look for objects."""
        need_picture(self, image)
        self.network = reread(self.network, self.path, self.runtime)
        size = (self.width, self.height)
        tensor, placement = prepared(image, size, self.fit, self.order, (self.mean, self.scale))
        results = self.network.run(tensor)
        limits = {"threshold": self.threshold, "overlap": self.overlap}
        if self.layout == "ssd":
            found = ssd_boxes.function(results, placement, width=self.width, height=self.height, **limits)
        else:
            layout: Any = self.layout.removeprefix("yolo-")
            found = yolo_boxes.function(results, placement, layout=layout, **limits)
        self.boxes.send(found.boxes)
        self.scores.send(found.scores)
        self.classes.send(found.classes)
        self.labels.send([self.names[one] if one < len(self.names) else str(one) for one in found.classes])

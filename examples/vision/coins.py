"""Coins on a table are counted and measured: nodes of the library, and one function of its own.

    photograph ─┬─ smooth ── bright ── tidy ── contours ── measure ── tell
                │                                             │
                └─ colour ──────────────────────────────── outline ── label ── write

Shown: a whole graph of OpenCV's functions from `hfg.nodes.cv`. The photograph comes with scikit-image: Greek coins from
Pompeii, in uneven light, so that a single threshold would not do. `python examples/vision/coins.py` says what was found
and writes out/coins.png; the graph file coins.hfg.yaml is the same graph, made by
`hfg convert examples/vision/coins.py examples/vision/coins.hfg.yaml`, and does the same by
`hfg run examples/vision/coins.hfg.yaml --allow coins`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import cv2
import skimage.data
from annotated_types import Ge

import hfg
from hfg.images import Gray, Points
from hfg.nodes import cv, display, files, vision

Box = tuple[int, int, int, int]


@hfg.node
def photograph() -> Iterator[Gray]:
    """Yield the photograph of scikit-image."""
    yield skimage.data.coins()  # type: ignore[no-untyped-call]


class Coins(NamedTuple):
    """The coins, from the largest to the smallest.

    Attributes:
      outlines: of each, in pixels.
      boxes: around each: left, upper edge, width, height in pixels.
      labels: the diameter of each in pixels, as a text.
      summary: all of it in a sentence.
    """

    outlines: list[Points]
    boxes: list[Box]
    labels: list[str]
    summary: str


@hfg.node(outputs=Coins)
def measure(contours: list[Points], *, smallest: Annotated[float, Ge(0)] = 20.0) -> Coins:
    """Measure coins: each is as wide as a circle of the same area, dents in its outline (shadows on it) filled.

    Args:
      contours: outlines, in pixels.
      smallest: diameter of the smallest coin, in pixels; what is smaller is dirt.
    """
    hulls = [cv2.convexHull(contour) for contour in contours]
    sizes = [(2 * math.sqrt(cv2.contourArea(hull) / math.pi), hull) for hull in hulls]
    coins = sorted((coin for coin in sizes if coin[0] >= smallest), key=lambda coin: -coin[0])
    across = [size for size, _ in coins]
    summary = f"{len(coins)} coins"
    if coins:
        summary += f", {across[-1]:.1f} to {across[0]:.1f} px across, {sum(across) / len(across):.1f} on average"
    outlines = [contour for _, contour in coins]
    boxes = [(x, y, width, height) for x, y, width, height in map(cv2.boundingRect, outlines)]
    return Coins(outlines, boxes, [f"{one:.0f}" for one in across], summary)


def build(image: str = "out/coins.png") -> hfg.Graph:
    """Build the graph.

    Args:
      image: the file that shows the coins.
    """
    graph = hfg.Graph("coins")
    graph.group("pictures", threads=1)  # reading one holds nobody up
    source = graph.add(photograph(), group="pictures")
    smooth = graph.add(cv.gaussian_blur(ksize=(5, 5)), name="smooth")
    bright = graph.add(cv.adaptive_threshold(block_size=101, c=-20.0), name="bright")  # brighter than what is around
    tidy = graph.add(cv.morphology_ex(op="OPEN", iterations=2), name="tidy")
    contours = graph.add(cv.find_contours(mode="EXTERNAL"), name="contours")
    coins = graph.add(measure())
    tell = graph.add(display.TextDisplay(format="{}"), name="tell")
    colour = graph.add(cv.cvt_color(code="GRAY2BGR"), name="colour")
    outline = graph.add(cv.draw_contours(), name="outline")
    label = graph.add(vision.draw_boxes(color=hfg.Colour(255, 160, 60), thickness=1, size=0.35), name="label")
    write = graph.add(files.WriteImage(path=image), name="write", group="pictures")

    source >> smooth >> bright
    graph.connect(bright.out, tidy.ports.inputs["src"])
    graph.connect(tidy.out, contours.ports.inputs["image"])
    graph.connect(contours.ports.outputs["contours"], coins.contours)
    graph.connect(coins.summary, tell.value)
    source >> colour
    graph.connect(colour.out, outline.ports.inputs["image"])
    graph.connect(coins.outlines, outline.ports.inputs["contours"])
    graph.connect(outline.out, label.image)
    graph.connect(coins.boxes, label.boxes)
    graph.connect(coins.labels, label.labels)
    graph.connect(label.out, write.image)
    return graph


if __name__ == "__main__":
    hfg.run(build())

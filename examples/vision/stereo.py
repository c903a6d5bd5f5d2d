"""How far things are, from a pair of pictures: stereo depth, held against the truth.

    pair ─┬─ left, right ── depth ─┬─ shade ── heat ─┐
          ├─ left ─────────────────┼──────────────── side by side ── write
          └─ truth ─────────────── compare ── tell

Shown: two streams in step, a measured error, and a heat map. The pair comes with scikit-image: a motorcycle of the
Middlebury benchmark of 2014, whose cameras are calibrated, with its true disparities. `python
examples/vision/stereo.py` says how near the result is to them and writes out/stereo.png. The graph file stereo.hfg.yaml
is the same graph; `hfg convert` has made it of this one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import cv2
import numpy as np
import skimage.data
from annotated_types import Gt

import hfg
from hfg.images import Color, Depth, Disparity, Gray
from hfg.nodes import cv, display, files, vision

FOCAL_PX, BASELINE_M, SHIFT_PX = 994.978, 0.193001, 31.086
"""Of the benchmark's cameras: focal length, distance, and by how much the axis of the right one is shifted."""


class Pair(NamedTuple):
    """Two pictures of the same moment, rectified, and the true disparities in pixels: NaN where unknown."""

    left: Color
    right: Color
    truth: Depth


@hfg.node(outputs=Pair)
def motorcycle() -> Iterator[Pair]:
    """Yield the pair of scikit-image."""
    left, right, truth = skimage.data.stereo_motorcycle()  # type: ignore[no-untyped-call]
    truth[~np.isfinite(truth)] = np.nan
    yield Pair(cv2.cvtColor(left, cv2.COLOR_RGB2BGR), cv2.cvtColor(right, cv2.COLOR_RGB2BGR), truth)


@hfg.node
def compare(disparity: Disparity, truth: Depth, *, within: Annotated[float, Gt(0)] = 2.0) -> str:
    """Say how many pixels were found, and how near they are to the truth.

    Args:
      disparity: what was found, in sixteenths of a pixel.
      truth: in pixels.
      within: what counts as right, in pixels.
    """
    known = np.isfinite(truth)
    found = known & (disparity >= 0)
    error = np.abs(disparity / 16 - truth)[found]
    metres = FOCAL_PX * BASELINE_M / (disparity[found] / 16 + SHIFT_PX)
    near, far = np.percentile(metres, (5, 95))
    return (
        f"{found.sum() / known.sum():.1%} of the pixels found, {np.mean(error < within):.1%} of them within "
        f"{within:g} px of the truth, half of them within {np.median(error):.2f} px; "
        f"most lie {near:.1f} to {far:.1f} m away"
    )


@hfg.node
def shade(disparity: Disparity) -> Gray:
    """Make what is near bright, and what was not found black."""
    return np.clip(disparity / 16 * 4, 0, 255).astype(np.uint8)


def build(image: str = "out/stereo.png", method: str = "SGBM") -> hfg.Graph:
    """Build the graph.

    Args:
      image: the file that shows the left picture and the disparities.
      method: "SGBM" or "BM", which is faster and finds less.
    """
    graph = hfg.Graph("stereo")
    graph.group("pictures", threads=1)
    graph.group("depth", threads=1)
    pair = graph.add(motorcycle(), group="pictures")
    depth = graph.add(vision.StereoDepth(method=method, range=64, block=5), group="depth")
    comparing, shading = graph.add(compare()), graph.add(shade())
    tell = graph.add(display.TextDisplay(format="{}"), name="tell")
    heat = graph.add(cv.apply_color_map(colormap="TURBO"), name="heat")
    beside = graph.add(display.image_grid(images=2, columns=2), name="beside")
    write = graph.add(files.WriteImage(path=image), name="write", group="pictures")

    graph.connect(pair.left, depth.left)
    graph.connect(pair.right, depth.right)
    graph.connect(depth.disparity, comparing.disparity)
    graph.connect(pair.truth, comparing.truth)
    graph.connect(comparing.out, tell.value)
    graph.connect(depth.disparity, shading.disparity)
    shading >> heat
    graph.connect(pair.left, beside.images[0])
    graph.connect(heat.out, beside.images[1])
    beside >> write
    return graph


if __name__ == "__main__":
    hfg.run(build())

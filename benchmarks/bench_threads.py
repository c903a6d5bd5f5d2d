"""Two thread groups with OpenCV work against one.

Measured: wall seconds for 40 pictures of 1280 x 960 through a fork into two branches of blurs, once with both
  branches in one thread group and once in two;
`cv2.setNumThreads(1)` in both, so that the groups alone give the parallelism.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import cv2
import numpy as np

import hfg
from benchmarks.measure import Case

DISTRIBUTIONS = ("hfg", "opencv-python-headless")
PICTURES = 40


@hfg.node
def pictures(*, count: int = 10) -> Iterator[Any]:
    """Make noise pictures, always the same."""
    random = np.random.default_rng(1)
    picture = random.integers(0, 255, (960, 1280, 3), dtype=np.uint8)
    for _ in range(count):
        yield picture


@hfg.node
def work(picture: Any) -> int:
    """Keep a core busy for some milliseconds, without the interpreter's lock."""
    for _ in range(4):
        picture = cv2.GaussianBlur(picture, (15, 15), 3.0)
    return int(picture[0, 0, 0])


@hfg.node
def join(left: int, right: int) -> None:
    """Wait for both."""


def seconds(groups: int, count: int) -> float:
    """Run it once."""
    cv2.setNumThreads(1)
    graph = hfg.Graph("threads")
    graph.group("left", threads=1)
    graph.group("right", threads=1)
    source = graph.add(pictures(count=count))
    left = graph.add(work(), name="left", group="left")
    right = graph.add(work(), name="right", group="right" if groups == 2 else "left")
    both = graph.add(join())
    for branch, name in ((left, "left"), (right, "right")):
        graph.connect(source.out, branch.ports.inputs["picture"])
        graph.connect(branch.out, both.ports.inputs[name])
    began = time.perf_counter()
    hfg.run(graph)
    return time.perf_counter() - began


CASES = {
    "one thread group": Case(partial(seconds, 1), PICTURES, "s"),
    "two thread groups": Case(partial(seconds, 2), PICTURES, "s"),
}

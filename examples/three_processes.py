"""One graph, three processes: heavy picture work on as many cores as there are.

    pictures ─ denoise ─ edges ─ parts ─ tell
      here    "first"   "second"   here

Shown: `graph.group(..., process=True)`. The nodes are the same wherever they run, and so are the results, to the bit;
edges between processes keep their order and their back-pressure, and lose nothing. `python examples/three_processes.py`
runs it twice, cut and in one piece, and says how long each took and that both gave the same; a number behind it is
how many pictures. It pays where the work in each process is more than what it costs to hand a picture over.
"""

from __future__ import annotations

import sys
import time
import zlib
from collections.abc import Iterator

import cv2
import numpy as np

import hfg
from hfg.images import Gray

cv2.setNumThreads(1)  # one core for each node, so that processes and not OpenCV's threads share the work


@hfg.node
def pictures(*, count: int = 8, width: int = 960, height: int = 720) -> Iterator[Gray]:
    """Yield pictures of spots that move, with noise that is the same each time."""
    rows, columns = np.mgrid[0:height, 0:width]
    noise = np.random.default_rng(1).integers(0, 90, (height, width)).astype(np.float32)
    for number in range(count):
        spots = np.sin(columns / 37 + number / 5) * np.cos(rows / 53 - number / 7) > 0.4
        yield np.clip(40 + 120 * spots + np.roll(noise, 7 * number, axis=1), 0, 255).astype(np.uint8)


@hfg.node
def denoise(picture: Gray, *, rounds: int = 3) -> Gray:
    """Smooth areas and keep edges."""
    for _ in range(rounds):
        picture = cv2.bilateralFilter(picture, 9, 40, 5)
    return picture


@hfg.node
def edges(picture: Gray, *, rounds: int = 12) -> Gray:
    """Find edges at several sizes."""
    found = np.zeros_like(picture)
    for number in range(rounds):
        smooth = cv2.GaussianBlur(picture, (0, 0), 1 + number / 4)
        found = cv2.max(found, cv2.Canny(smooth, 60, 120))
    return found


@hfg.node
def parts(picture: Gray) -> tuple[int, int]:
    """Count the areas between edges; the second number tells pictures apart that differ in one pixel."""
    count, labels = cv2.connectedComponents(255 - picture)
    return count, zlib.crc32(labels.tobytes())


def build(*, apart: bool = True, count: int = 8) -> hfg.Graph:
    """Make the graph, cut for processes or in one piece.

    Args:
      apart: whether there are processes.
      count: of pictures.
    """
    graph = hfg.Graph("three_processes")
    if apart:
        graph.group("first", process=True)
        graph.group("second", process=True)
    source = graph.add(pictures(count=count))
    clean = graph.add(denoise(), group="first" if apart else None)
    found = graph.add(edges(), group="second" if apart else None)
    counted = graph.add(parts())
    graph.connect(source.out, clean.picture)
    graph.connect(clean.out, found.picture)
    graph.connect(found.out, counted.picture)
    graph.connect(counted.out, graph.output("areas", tuple[int, int]))
    return graph


def main() -> None:
    """Run it both ways and compare; of so many pictures as is said, by default 80."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 80
    results = []
    for apart in (True, False):
        began = time.perf_counter()
        report = hfg.run(build(apart=apart, count=count))
        results.append(report.outputs["areas"])
        how = "in three processes" if apart else "in one process"
        print(f"{how}: {len(results[-1])} pictures in {time.perf_counter() - began:.1f} s")
    if results[0] != results[1]:
        sys.exit("the two runs differ")
    print(f"the same to the bit; {results[0][0][0]} areas in the first picture, {results[0][-1][0]} in the last")


if __name__ == "__main__":
    main()

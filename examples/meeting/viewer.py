"""A camera and a viewer are two programs that meet by a name, started in any order; this is the viewer.

    camera ── publish ┄┄┄┄ camera/front ┄┄┄┄ subscribe ── locate ── show
    camera.py                                viewer.py

Shown: `hfg.subscribe` brings what another program publishes into a port, whose type both have to have. This one wants
every picture; with `overflow="latest"` it would not hold the camera up. It ends with the camera, and waits for the next
one if that dies. Run it with `hfg run examples/meeting/viewer.py`, before or after `camera.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import hfg
from hfg.images import Image


class Place(NamedTuple):
    row: float
    column: float


@hfg.node
def locate(picture: Image) -> Place | None:
    rows, columns = np.nonzero(picture > 128)
    return Place(float(rows.mean()), float(columns.mean())) if len(rows) else None


@hfg.node
def show(disc: Place) -> None:
    print(f"the disc is at row {disc.row:.0f}, column {disc.column:.0f}", flush=True)


graph = hfg.Graph("viewer")
locator = graph.add(locate())
graph.connect(locator.out, graph.add(show()).disc)
hfg.subscribe("camera/front", locator.picture)

if __name__ == "__main__":
    print(hfg.run(graph))

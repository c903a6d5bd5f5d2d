"""A camera and a viewer are two programs that meet by a name, started in any order; this is the camera.

    camera ── publish ┄┄┄┄ camera/front ┄┄┄┄ subscribe ── locate ── show
    camera.py                                viewer.py

Shown: `hfg.publish` gives what leaves a port to whoever has subscribed. Without a viewer it does not wait, so the
camera also runs by itself; a viewer that wants every picture holds it up as if both were in one graph. The camera makes
its pictures itself: a bright disc on its way around. Run it with `hfg run examples/meeting/camera.py`, and in another
terminal `hfg run examples/meeting/viewer.py`; this needs `pip install 'hfg[zenoh]'`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import hfg
from hfg.images import Image

SIZE, RADIUS = 96, 6


@hfg.node
def camera(*, pictures: int = 300) -> Iterator[Image]:
    rows, columns = np.mgrid[:SIZE, :SIZE]
    for number in range(pictures):
        angle = number / 25
        row, column = SIZE / 2 + 30 * np.sin(angle), SIZE / 2 + 30 * np.cos(angle)
        yield np.where(np.hypot(rows - row, columns - column) < RADIUS, 220, 20).astype(np.uint8)


graph = hfg.Graph("camera")
front = graph.add(camera(), max_rate_hz=30)
hfg.publish("camera/front", front.out)

if __name__ == "__main__":
    print(hfg.run(graph))

"""A camera at 30 Hz and a detector at 5 Hz: streams of different rates, none of which slows the other down.

    camera ── draw ── film                       every picture, in order, nothing lost          (30 Hz)
       └─ sent ┄┄ find ┄┄ sent ┄┄ draw.corners   the latest picture, what was found last        (5 Hz)

Shown: where a stream may lose values it is an event (`sent`, with `overflow="latest"`); what comes at its own pace is a
parameter, which the join does not wait for; OpenCV works in a thread group. The pictures are a window that moves over a
photograph of scikit-image. Run it with `python examples/video.py [FILE.png]`, which also writes some of the pictures
side by side; tests/examples/plain_video.py does the same without hfg.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import skimage.data

import hfg
from hfg.images import Image

HZ, FIND_HZ = 30, 5
WIDTH = 256
SHOWN_EVERY = 15
PHOTOGRAPH: Image = skimage.data.brick()  # type: ignore[no-untyped-call]

Corners = tuple[tuple[int, int], ...]
"""Places in the picture that can be found again, in pixels."""


@hfg.node
def camera(*, pictures: int = 90) -> Iterator[Image]:
    for number in range(pictures):
        left = abs((4 * number) % (2 * (PHOTOGRAPH.shape[1] - WIDTH)) - (PHOTOGRAPH.shape[1] - WIDTH))
        yield PHOTOGRAPH[:WIDTH, left : left + WIDTH]


@hfg.node
def find(picture: Image, *, most: int = 20) -> Corners:
    found: Any = cv2.goodFeaturesToTrack(cv2.medianBlur(picture, 3), most, 0.05, 10)  # None if there is nothing
    return tuple((int(x), int(y)) for [[x, y]] in (() if found is None else found))


@hfg.node
def draw(picture: Image, *, corners: Corners = ()) -> Image:
    drawn = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    for corner in corners:
        cv2.circle(drawn, corner, 4, (0, 0, 255), 1)
    return drawn


class Film(hfg.Node):
    """Counts the pictures, and keeps some of them."""

    picture = hfg.Input(Image)
    file = hfg.Parameter("")
    count = hfg.State(0)
    shown = hfg.State(factory=list[Image])

    def process(self, picture: Image) -> None:
        if self.count % SHOWN_EVERY == 0:
            self.shown.append(picture)
        self.count += 1

    def end(self) -> None:
        if self.file and not cv2.imwrite(self.file, np.hstack(self.shown)):
            raise OSError(f'"{self.file}" cannot be written')


def build(pictures: int = 90, file: str = "") -> hfg.Graph:
    graph = hfg.Graph("video")
    graph.group("detector", threads=1)
    source = graph.add(camera(pictures=pictures), max_rate_hz=HZ)
    finder = graph.add(find(), group="detector", max_rate_hz=FIND_HZ)
    drawer, film = graph.add(draw()), graph.add(Film(file=file), name="film")
    graph.connect(source.out, drawer.picture)
    graph.connect(drawer.out, film.picture)
    graph.connect(source.out.sent, finder.picture, overflow="latest")
    graph.connect(finder.out.sent, drawer.ports.parameters["corners"])
    return graph


if __name__ == "__main__":
    report = hfg.run(build(file=sys.argv[1] if len(sys.argv) > 1 else ""))
    print(report)

"""People in a real video: a detector and a background model look at the same pictures, and both must agree.

    street ─┬─ background ─────────────────────────────────┐
            ├─ every 10th ─ far or near? ─┬─ people ─┬─ moving ─┬─ count ─ tell
            │                             └─ faces ──┘          │
            └────────────────────────────────────────────────── draw ─┬─ film
                                                                      └─ write

Shown: a slow detector in a thread group of its own that sees one picture of ten, a join that stays in step by silence,
branches of which one at a time has a value, and how a cheap second opinion takes wrong findings out: what the detector
takes for a person, but does not move, is none. The video is vtest.avi of OpenCV, a street with people who walk:

    apt-get install opencv-doc                                  # then it is found by itself
    python examples/vision/pedestrians.py [VIDEO]
    hfg run examples/vision/pedestrians.hfg.yaml --allow pedestrians --param street.path=VIDEO

Without it a camera pans over a photograph of scikit-image, whose only person is so near that her face is looked for.
Results are reported; out/pedestrians.avi shows all pictures, out/pedestrians.png the newest one. The graph file
pedestrians.hfg.yaml is the same graph; `hfg convert` has made it of this one.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final

import cv2
import skimage.data
from annotated_types import Interval

import hfg
from hfg.images import Color, Mask
from hfg.nodes import display, flow, vision
from hfg.nodes.video import BackgroundSubtractor, VideoFile, WriteVideo

Box = tuple[int, int, int, int]

VIDEO: Final = "/usr/share/doc/opencv-doc/examples/data/vtest.avi"


class Street(VideoFile):
    """Read the video of the street, or pan over a photograph if it is not there.

    Attributes:
      path: the video; "" looks where Debian's opencv-doc has it.
      rate: "file" as the video says, "fast" as fast as pictures are taken.
      start: the number of the first picture, from 0.
      end_before: the number of the picture before which it stops; None for the whole video.
      loop: start over after the last picture, endlessly.
      image: the picture: blue, green, red.
      number: the number of the picture, from 0.
      near: whether people fill the picture.
    """

    near = hfg.Output(bool)
    photographs: hfg.State[Iterator[Color] | None] = hfg.State(None)

    def setup(self) -> None:
        """Look for the video."""
        if self.path or Path(VIDEO).is_file():
            self.path = self.path or VIDEO
            super().setup()
            return
        self.log.warning(
            "there is no %s, so a photograph is searched: install Debian's package opencv-doc (apt-get install "
            "opencv-doc), or set path to a video of your own",
            VIDEO,
        )
        self.photographs = pan()

    async def process(self) -> None:
        """Send the next picture."""
        if self.photographs is None:
            await super().process()
        else:
            image = await asyncio.to_thread(next, self.photographs, None)
            if image is None:
                raise hfg.EndOfStream
            self.image.send(image)
            self.number.send(self.sent)
            self.sent += 1
        self.near.send(self.photographs is not None)


def pan(pictures: int = 41, step: int = 3) -> Iterator[Color]:
    """Move a window over the photograph of an astronaut."""
    photograph = cv2.cvtColor(skimage.data.astronaut(), cv2.COLOR_RGB2BGR)  # type: ignore[no-untyped-call]
    for number in range(pictures):
        yield photograph[:400, step * number : step * number + 384].copy()


@hfg.node
def moving(boxes: list[Box], mask: Mask, *, part: Annotated[float, Interval(ge=0, le=1)] = 0.05) -> list[Box]:
    """Keep the boxes in which something moves.

    Args:
      boxes: left, upper edge, width, height in pixels.
      mask: what moves is not 0.
      part: how much of a box must move.
    """
    kept = []
    for x, y, width, height in boxes:
        inside = mask[max(0, y) : y + height, max(0, x) : x + width]
        if inside.size and cv2.countNonZero(inside) >= part * inside.size:
            kept.append((x, y, width, height))
    return kept


class Count(hfg.Node):
    """Count what was found, and say it at the end.

    Attributes:
      found: before those who do not move were taken out.
      kept: after that.
      summary: a sentence, when there is no more.
    """

    found = hfg.Input(list[Box])
    kept = hfg.Input(list[Box])
    summary = hfg.Output(str)
    pictures = hfg.State(0)
    without = hfg.State(0)
    people = hfg.State(0)
    still = hfg.State(0)

    def process(self, found: list[Box], kept: list[Box]) -> None:
        """Count."""
        self.pictures += 1
        self.without += not kept
        self.people += len(kept)
        self.still += len(found) - len(kept)

    def end(self) -> None:
        """Say it."""
        mean = self.people / max(1, self.pictures)
        self.summary.send(
            f"{self.pictures} pictures searched, {mean:.1f} people in each, none in {self.without}; "
            f"{self.still} findings did not move and are none"
        )


def build(video: str = "", folder: str = "out") -> hfg.Graph:
    """Build the graph.

    Args:
      video: the file; "" looks where Debian's opencv-doc has it.
      folder: where the results go.
    """
    graph = hfg.Graph("pedestrians")
    graph.group("detector", threads=1)
    graph.group("background", threads=1)
    graph.group("files", threads=1)
    street = graph.add(Street(path=video, rate="fast"))
    background = graph.add(BackgroundSubtractor(), name="background", group="background")
    some = graph.add(flow.EveryNth(n=10, offset=10), name="some")  # the background is not known before
    sort = graph.add(flow.Demux(outputs=2), name="sort")
    people = graph.add(vision.PeopleDetector(scale_up=1.5), name="people", group="detector")
    faces = graph.add(vision.CascadeDetector(neighbors=6, smallest=60), name="faces", group="detector")
    either, walking = graph.add(flow.Rejoin(values=2), name="either"), graph.add(moving())
    count, tell = graph.add(Count()), graph.add(display.TextDisplay(format="{}"), name="tell")
    draw = graph.add(vision.draw_boxes(), name="draw")
    film = graph.add(WriteVideo(path=f"{folder}/pedestrians.avi", fps=2.0), name="film", group="files")
    show = graph.add(display.ImageDisplay(path=f"{folder}/pedestrians.png"), name="show", group="files")

    graph.connect(street.image, background.image)
    graph.connect(street.image, some.value)
    graph.connect(some.out, sort.value)
    graph.connect(street.near, sort.select)
    graph.connect(sort.outputs[0], people.image)
    graph.connect(sort.outputs[1], faces.image)
    graph.connect(people.boxes, either.values[0])
    graph.connect(faces.boxes, either.values[1])
    graph.connect(either.out, walking.boxes)
    graph.connect(background.mask, walking.mask)
    graph.connect(either.out, count.found)
    graph.connect(walking.out, count.kept)
    graph.connect(count.summary, tell.value)
    graph.connect(street.image, draw.image)
    graph.connect(walking.out, draw.boxes)
    graph.connect(draw.out, film.image)
    graph.connect(draw.out, show.image)
    return graph


if __name__ == "__main__":
    hfg.run(build(*sys.argv[1:2]))

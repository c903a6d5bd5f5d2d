"""Images for people to look at: the newest one in a file, and several in one.

Depends on files, nodetype, functions and ports.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from annotated_types import Interval, Predicate

from hfg.base.clock import now
from hfg.images import AnyImage, Image
from hfg.nodes.files.access import is_a_path, named, write_whole
from hfg.nodes.files.sinks import PICTURES, encoded
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Inputs, Parameter, State


class ImageDisplay(Node):
    """Show the newest image in a file, which a viewer that looks after it, or a browser, shows to people.

    The file is replaced only as a whole. With a limit of the rate the images between are left out, but the last one is
    written when the stream ends. Writing blocks the loop for about ten milliseconds per million pixels; put the node
    into a thread group if that is too long. Needs OpenCV. To keep every image use `files.WriteImage`.

    Attributes:
      image: with 1 channel, 3 (blue, green and red) or 4. Anything but 8 bits is shown from its smallest to its largest
        number, as from black to white.
      path: path of the file, such as PNG or JPEG; relative paths start in the working directory.
      quality: of JPEG and WebP, 1 to 100.
      most_per_s: maximum number of images written per second; 0 writes all.
      shown: the path, after the file was written.

    Raises:
      OSError: the file cannot be written; the message says why, and the old file is unchanged.
      ValueError: the format does not take such an image.
      ModuleNotFoundError: OpenCV is not installed.

    CS::APEX: csapex::OutputDisplay.
    """

    image = Input(AnyImage)
    path = Parameter("display.png", Predicate(is_a_path), save=True, pattern=PICTURES)
    quality = Parameter(90, Interval(ge=1, le=100))
    most_per_s = Parameter(5.0, Interval(ge=0), unit="1/s")
    shown = Event(str)
    due = State(-math.inf)
    waiting = State(factory=list[Any])

    def process(self, image: AnyImage) -> None:
        """Show it, or keep it."""
        if self.most_per_s and now() < self.due:
            self.waiting = [image]
            return
        self.due = now() + 1 / self.most_per_s if self.most_per_s else -math.inf
        self._show(image)

    def end(self) -> None:
        """Show the last one."""
        if self.waiting:
            self._show(self.waiting[0])

    def _show(self, image: AnyImage) -> None:
        self.waiting = []
        data = encoded(visible(image), self.path, self.quality)
        write_whole(named(self.path), lambda file: file.write(data))
        self.shown.trigger(self.path)


def visible(image: AnyImage) -> Image:
    """Return an image of 8 bits of any image: other numbers from the smallest, black, to the largest, white."""
    if image.dtype == np.uint8:
        return image
    if image.dtype == bool:
        return np.where(image, np.uint8(255), np.uint8(0))
    if image.dtype.kind not in "iuf":
        raise ValueError(f"an image of {image.dtype} cannot be shown; convert it to real numbers before")
    numbers = image.astype(np.float64)
    numbers[~np.isfinite(numbers)] = np.nan
    if not numbers.size or np.isnan(numbers).all():
        return np.zeros(image.shape, np.uint8)
    # Halves, for the difference of two very large numbers is no number.
    low, high = np.nanmin(numbers) / 2, np.nanmax(numbers) / 2
    part = (numbers / 2 - low) / (high - low) if high > low else np.zeros_like(numbers)
    return np.nan_to_num(part * 255).round().astype(np.uint8)


@node(
    inputs={"images": Inputs(AnyImage, 2)},
    outputs=Image,
    parameters={"columns": Parameter(0, Interval(ge=0)), "gap": Parameter(4, Interval(ge=0, le=1000))},
)
def image_grid(*images: AnyImage, columns: int, gap: int) -> Image:
    """Put the images at all inputs into a grid.

    Each has a field as large as the largest one, and stands in its middle. Anything but 8 bits is shown from its
    smallest to its largest number. The grid has colours if any image has; how opaque an image is is left out.

    Args:
      images: any number of images.
      columns: number of columns; 0 makes about as many rows as columns.
      gap: pixels of grey between two of them.

    Raises:
      ValueError: an image is neither of numbers nor of truth values, or has 2 channels.
    """
    shown = [_channels(visible(image)) for image in images]
    colour = any(image.shape[2] == 3 for image in shown)
    across = columns or math.ceil(math.sqrt(len(shown)))
    down = -(-len(shown) // across)
    across = min(across, len(shown))
    height, width = max(image.shape[0] for image in shown), max(image.shape[1] for image in shown)
    grid = np.full((down * (height + gap) - gap, across * (width + gap) - gap, 3), 128, np.uint8)
    for number, image in enumerate(shown):
        top = number // across * (height + gap) + (height - image.shape[0]) // 2
        left = number % across * (width + gap) + (width - image.shape[1]) // 2
        grid[top : top + image.shape[0], left : left + image.shape[1]] = image  # one channel spreads over three
    return grid if colour else np.ascontiguousarray(grid[..., 0])


def _channels(image: Image) -> Image:
    """Return an image with an axis of channels: 1 or 3 of them."""
    if image.ndim == 2:
        return image[..., np.newaxis]
    if image.shape[2] == 2:
        raise ValueError("an image of 2 channels cannot be shown; choose one of them")
    return image[..., :3]

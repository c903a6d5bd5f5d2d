"""Two pictures in one, and a picture of the screen."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval

from hfg.images import Color, Picture
from hfg.nodes._extras import require
from hfg.nodes._pictures import colour
from hfg.nodes.files.access import write_whole
from hfg.nodes.files.sinks import encoded
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Parameter, slot

_FARTHEST = 32767


@node
def collage(
    main: Picture,
    secondary: Picture,
    *,
    x: Annotated[int, Interval(ge=-_FARTHEST, le=_FARTHEST)] = 0,
    y: Annotated[int, Interval(ge=-_FARTHEST, le=_FARTHEST)] = 0,
) -> Color:
    """Lay a picture over another one.

    Fires once per pair. Parts of the secondary picture outside the main one are cut off.

    Args:
      main: the picture below; gray, blue, green, red, or with opacity, which is left out.
      secondary: the picture above; of the same kinds.
      x: where the left edge of the secondary picture lies, in pixels from that of the main one.
      y: where its upper edge lies, in pixels from that of the main one.

    Returns:
      out: as large as the main picture: blue, green, red.

    Raises:
      ValueError: a picture is empty, or has two channels.

    CS::APEX: csapex::ImageCollage.
    """
    if main.size == 0 or secondary.size == 0:
        raise ValueError("a collage is made of two pictures, and one of them is empty")
    result = colour(main).copy()
    above = colour(secondary)
    height, width = result.shape[:2]
    left, top = max(0, x), max(0, y)
    right, bottom = min(width, x + above.shape[1]), min(height, y + above.shape[0])
    if right > left and bottom > top:
        result[top:bottom, left:right] = above[top - y : bottom - y, left - x : right - x]
    return result  # type: ignore[no-any-return]


class Screenshot(Node):
    """Take a picture of the whole screen and write it into a file.

    It never fires; `take` does the work and `done` tells when the file is complete. The file is there as a whole or not
    at all.

    Attributes:
      path: the folder; it is there.
      name: the file without its ending; a number follows, from 0.
      format: the ending.
      quality: of a .jpg, 0 to 100.
      take: take a picture now.
      done: the path of the picture.

    Raises:
      OSError: there is no screen, or no such folder.

    CS::APEX: csapex::MakeScreenshot.
    """

    path = Parameter(".", directory=True)
    name = Parameter("screenshot")
    format = Parameter("png", type=Literal["png", "jpg"])
    quality = Parameter(90, Interval(ge=0, le=100))
    done = Event(str)

    @slot
    def take(self) -> None:
        """Take a picture now."""
        image = _screen()
        folder = Path(self.path).absolute()
        if not folder.is_dir():
            raise FileNotFoundError(f'there is no folder "{folder}" for the screenshot: make it, or correct path')
        number = 0
        while (target := folder / f"{self.name}{number}.{self.format}").exists():
            number += 1
        data = encoded(image, target, self.quality)
        write_whole(target, lambda file: file.write(data))
        self.done.trigger(str(target))


def _screen() -> Any:
    grab = require("PIL.ImageGrab", "plot").grab
    try:
        return np.ascontiguousarray(np.asarray(grab().convert("RGB"))[:, :, ::-1])
    except Exception as error:  # what Pillow raises depends on the system
        raise OSError(f"there is no screen to take a picture of ({type(error).__name__}: {error})") from None

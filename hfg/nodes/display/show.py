"""Values for people to look at in the studio: the end of a stream that nothing else takes. Depends on `hfg.panels`."""

from __future__ import annotations

import textwrap
from typing import Any, Final

import numpy as np

from hfg.errors import shown
from hfg.images import AnyImage
from hfg.nodes.display.images import visible
from hfg.nodetypes.node import Node
from hfg.panels import Look, Scene, view
from hfg.ports import Input
from hfg.types import accepts

_LETTERS: Final = 44
_LINES: Final = 10
_SIZE: Final = 1.4  # of letters, of which the page makes none too small to read
_LINE: Final = 1.8
_FEW: Final = 12  # elements of an array that are shown


class Show(Node):
    """Take values so that people can look at them: pictures, numbers and texts.

    The studio shows the newest value next to the graph. Nothing happens without a studio.

    Attributes:
      value: to look at.
    """

    value = Input(object)

    def process(self, value: object) -> None:
        """Take it."""

    @view("What arrives")
    def newest(self, look: Look) -> Scene | None:
        """The newest value."""
        value = look.latest("value")
        if value is None:
            return None
        if accepts(value, AnyImage) and value.size:
            return _picture(value)
        lines = textwrap.wrap(_words(value), _LETTERS)[:_LINES] or [""]
        scene = Scene(0, 0, _LETTERS, _LINE * len(lines) + 1)
        for number, line in enumerate(lines):
            scene.text(line, (1, _LINE * (len(lines) - number - 0.5) + 0.5), _SIZE, anchor="start")
        return scene


def _words(value: object) -> str:
    if isinstance(value, np.ndarray) and value.size > _FEW:
        return f"array of {value.dtype}, {' x '.join(map(str, value.shape))}"
    return value if isinstance(value, str) else shown(value, _LETTERS * _LINES)


def _picture(image: Any) -> Scene:
    height, width = image.shape[:2]
    scene = Scene(0, height, width, 0, caption=f"{width} x {height}")
    scene.image(np.ascontiguousarray(visible(image)), 0, height, width, 0)
    return scene

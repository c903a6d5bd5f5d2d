"""Common code of the families that work on pictures with OpenCV's objects."""

from __future__ import annotations

from typing import Any

import cv2

from hfg.images import Picture, wrong_image
from hfg.nodetypes.node import Node


def need_picture(node: Node, image: Any, hint: Any = Picture, port: str = "image") -> None:
    """Refuse what would end the process: OpenCV's objects look at nothing before they begin.

    Raises:
      TypeError: the picture is of another kind.
      ValueError: it is empty.
    """
    wrong = wrong_image(image, hint)
    if wrong is not None:
        raise TypeError(f'input "{port}" of {node._type.name}: {wrong}')
    if image.size == 0:
        raise ValueError(f'input "{port}" of {node._type.name} is empty')


def gray(image: Any) -> Any:
    """Return a picture of 1, 3 or 4 channels in one.

    Raises:
      ValueError: it has two.
    """
    channels = _channels(image)
    if channels == 1:
        return image.reshape(image.shape[:2])
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY if channels == 3 else cv2.COLOR_BGRA2GRAY)


def colour(image: Any) -> Any:
    """Return a picture of 1, 3 or 4 channels in three: blue, green, red.

    Raises:
      ValueError: it has two.
    """
    channels = _channels(image)
    if channels == 3:
        return image
    return cv2.cvtColor(image, cv2.COLOR_GRAY2BGR if channels == 1 else cv2.COLOR_BGRA2BGR)


def _channels(image: Any) -> int:
    channels: int = image.shape[2] if image.ndim == 3 else 1
    if channels == 2:
        raise ValueError(f"a picture has 1, 3 or 4 channels here, got one of {' x '.join(map(str, image.shape))}")
    return channels


def refusal(what: str, error: cv2.error) -> ValueError:
    """Make the error that tells what OpenCV has refused."""
    text = " ".join(str(getattr(error, "err", "") or error).replace("> ", " ").split()).rstrip(" .")
    return ValueError(f"{what} refuses that: {text}")

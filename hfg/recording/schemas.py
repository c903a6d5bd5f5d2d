"""JSON schemas of what is recorded, so that other programs can show it; images in those that Foxglove knows.

`foxglove.RawImage` and `foxglove.CompressedImage` are Foxglove's published schemas; what else a token has stands
beside their fields, where readers that do not know it pass over it. Stands on `values` and `images`.
"""

from __future__ import annotations

import enum
import typing
from collections import abc
from typing import Any, Final, Literal

import msgspec
import numpy as np

from hfg.recording.values import bare, fields_of
from hfg.types import Pixels, describe

__all__ = ["COMPRESSED_IMAGE", "RAW_IMAGE", "encoding_of", "is_image", "message_schema"]

_TIME: Final = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999},
    },
}
_TOKEN: Final[dict[str, Any]] = {
    "activity": {"type": "integer", "enum": [-1, 0, 1], "description": "The token's activity modifier"},
    "stamp": {"type": "number", "description": "Seconds on the run's clock"},
    "sequence": {"type": "integer", "description": "Number of the token on its edge, from 1"},
    "time": {"type": "number", "description": "When it passed, if that was not at its stamp; in virtual time"},
    "began": {"type": "number", "description": "When the firing began that has sent it, if not at its stamp"},
    "call": {"type": "integer", "description": "Number of the slot call in which it was triggered"},
    "beside": {"type": "boolean", "description": "It was triggered in no firing and no slot call"},
    "silent": {"type": "boolean", "description": "The function was not run in this firing"},
    "last": {"type": "boolean", "description": "The node's end() has written it"},
    "waited": {"type": "boolean", "description": "The firing waited, though no time passed"},
}
_BYTES: Final = {"type": "string", "contentEncoding": "base64"}

RAW_IMAGE: Final[dict[str, Any]] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "foxglove.RawImage",
    "description": "A raw image",
    "type": "object",
    "properties": {
        "timestamp": {**_TIME, "description": "Timestamp of image"},
        "frame_id": {"type": "string", "description": "Frame of reference for the image"},
        "width": {"type": "integer", "minimum": 0, "description": "Image width"},
        "height": {"type": "integer", "minimum": 0, "description": "Image height"},
        "encoding": {"type": "string", "description": "Encoding of the raw image data"},
        "step": {"type": "integer", "minimum": 0, "description": "Byte length of a single row"},
        "data": {**_BYTES, "description": "Raw image data"},
        "dtype": {"type": "string", "description": "Of numpy"},
        "shape": {"type": "array", "items": {"type": "integer"}, "description": "Of numpy"},
        **_TOKEN,
    },
}
COMPRESSED_IMAGE: Final[dict[str, Any]] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "foxglove.CompressedImage",
    "description": "A compressed image",
    "type": "object",
    "properties": {
        "timestamp": {**_TIME, "description": "Timestamp of image"},
        "frame_id": {"type": "string", "description": "Frame of reference for the image"},
        "data": {**_BYTES, "description": "Compressed image data"},
        "format": {"type": "string", "description": "Image format"},
        "shape": {"type": "array", "items": {"type": "integer"}, "description": "Of numpy"},
        **_TOKEN,
    },
}

_NAMES: Final = {
    ("|u1", 1): "mono8",
    ("|u1", 3): "bgr8",
    ("|u1", 4): "bgra8",
    ("<u2", 1): "mono16",
    ("<f4", 1): "32FC1",
}
_LETTERS: Final = {"u": "U", "i": "S", "f": "F"}
_PLAIN: Final = {bool: "boolean", int: "integer", float: "number", str: "string", type(None): "null"}
_DEEPEST: Final = 8


def is_image(hint: Any) -> bool:
    """Whether a type is one of images."""
    return any(isinstance(one, Pixels) for one in getattr(hint, "__metadata__", ()))


def encoding_of(value: np.ndarray[Any, Any]) -> str | None:
    """Give an image's encoding in Foxglove's words, or in OpenCV's where Foxglove has none; None of what is none."""
    channels = 1 if value.ndim == 2 else value.shape[2] if value.ndim == 3 else 0
    dtype = value.dtype.newbyteorder("<") if value.dtype.byteorder == ">" else value.dtype
    if not 1 <= channels <= 4 or dtype.kind not in _LETTERS:
        return None
    return _NAMES.get((dtype.str, channels), f"{8 * dtype.itemsize}{_LETTERS[dtype.kind]}C{channels}")


def message_schema(hint: Any) -> bytes:
    """Give the schema of the messages of a port of this type."""
    return msgspec.json.encode(
        {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": f"hfg token of {describe(hint)}",
            "type": "object",
            "properties": {"value": _schema(hint, 0), **_TOKEN},
            "required": ["value", "stamp"],
        }
    )


def _schema(hint: Any, depth: int) -> dict[str, Any]:
    """What is exactly of the type; a value that is not stands as an object with "$type"."""
    hint = bare(hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if depth > _DEEPEST:
        return {}
    if hint in (int, float, str, bool):
        # a whole number where the type says float is written as it is, what is not finite as an object
        return (
            {"type": "integer"}
            if hint is int
            else {"type": [_PLAIN[hint], "object"]}
            if hint in (float, str)
            else {"type": "boolean"}
        )
    if origin is Literal:
        return {}
    fields = fields_of(hint)
    if fields is not None:
        return {
            "type": "object",
            "title": hint.__name__,
            "properties": {name: _schema(one, depth + 1) for name, one in fields.items()},
        }
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return {"enum": [one.name for one in hint]}
    if hint is bytes:
        return dict(_BYTES)
    if hint is np.ndarray or origin is np.ndarray:
        return {
            "type": "object",
            "title": "array",
            "properties": {
                "dtype": {"description": 'As numpy writes it, "<f8"'},
                "shape": {"type": "array", "items": {"type": "integer"}},
                "data": {**_BYTES, "description": "In C order"},
            },
        }
    if hint in (list, tuple) or origin in (list, tuple, abc.Sequence):
        items = {one for one in arguments if one is not Ellipsis} if _all_hashable(arguments) else set()
        return {"type": ["array", "object"], **({"items": _schema(items.pop(), depth + 1)} if len(items) == 1 else {})}
    if origin is dict and arguments and bare(arguments[0]) is str:
        return {"type": "object"}
    return {}


def _all_hashable(parts: tuple[Any, ...]) -> bool:
    try:
        set(parts)
    except TypeError:
        return False
    return True

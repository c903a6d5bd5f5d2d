"""JSON schemas of recorded values, so that other programs can show them; images use Foxglove's schemas.

`foxglove.RawImage` and `foxglove.CompressedImage` are Foxglove's published schemas. The other parts of a token are
additional fields, which other readers ignore. Depends on `forms`.
"""

from __future__ import annotations

import typing
from typing import Any, Final

import msgspec
import numpy as np

from hfg.recording.forms import bare, form_of
from hfg.types import Pixels, describe

_TIME: Final = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999},
    },
}
TOKEN: Final[dict[str, Any]] = {
    "activity": {"type": "integer", "enum": [-1, 0, 1], "description": "The token's activity modifier"},
    "stamp": {"type": "number", "description": "Seconds on the run's clock"},
    "sequence": {"type": "integer", "description": "Number of the token on its edge, from 1"},
    "time": {"type": "number", "description": "When it was sent, if not at its stamp; in virtual time"},
    "began": {"type": "number", "description": "When the firing that sent it started, if not at its stamp"},
    "call": {"type": "integer", "description": "Number of the slot call in which it was triggered"},
    "beside": {"type": "boolean", "description": "It was triggered outside firings and slot calls"},
    "silent": {"type": "boolean", "description": "The function was not run in this firing"},
    "last": {"type": "boolean", "description": "It was written by the node's end()"},
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
        **TOKEN,
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
        **TOKEN,
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
_DEEPEST: Final = 8


def is_image(hint: Any) -> bool:
    """Return whether a type is one of images."""
    return any(isinstance(one, Pixels) for one in getattr(hint, "__metadata__", ()))


def encoding_of(value: np.ndarray[Any, Any]) -> str | None:
    """Return an image's encoding in Foxglove's terms, otherwise in OpenCV's; None if it is not an image."""
    channels = 1 if value.ndim == 2 else value.shape[2] if value.ndim == 3 else 0
    dtype = value.dtype.newbyteorder("<") if value.dtype.byteorder == ">" else value.dtype
    if not 1 <= channels <= 4 or dtype.kind not in _LETTERS:
        return None
    return _NAMES.get((dtype.str, channels), f"{8 * dtype.itemsize}{_LETTERS[dtype.kind]}C{channels}")


def message_schema(hint: Any) -> bytes:
    """Return the schema of the messages of a port of this type."""
    return msgspec.json.encode(
        {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": f"hfg token of {describe(hint)}",
            "type": "object",
            "properties": {"value": value_schema(hint), **TOKEN},
            "required": ["value", "stamp"],
        }
    )


_ARRAY: Final[dict[str, Any]] = {
    "type": "object",
    "title": "array",
    "properties": {
        "dtype": {"description": 'As numpy writes it, "<f8"'},
        "shape": {"type": "array", "items": {"type": "integer"}},
        "data": {**_BYTES, "description": "In C order"},
    },
}
# an integer where the type is float is written unchanged, a non-finite number as an object
_SIMPLE: Final[dict[Any, dict[str, Any]]] = {
    int: {"type": "integer"},
    float: {"type": ["number", "object"]},
    str: {"type": ["string", "object"]},
    bool: {"type": "boolean"},
}


def value_schema(hint: Any, depth: int = 0) -> dict[str, Any]:
    """Return the schema of values that are exactly of the type; other values are objects with "$type"."""
    hint = bare(hint)
    if depth > _DEEPEST:
        return {}
    if hint in (int, float, str, bool):
        return dict(_SIMPLE[hint])
    form = form_of(hint)
    match form.kind:
        case "fields":
            properties = {name: value_schema(one, depth + 1) for name, one in form.of.items()}
            return {"type": "object", "title": hint.__name__, "properties": properties}
        case "enum":
            return {"enum": [one.name for one in hint]}
        case "bytes":
            return dict(_BYTES)
        case "array":
            return dict(_ARRAY)
        case "list" | "tuple":
            arguments = typing.get_args(hint)
            items = {one for one in arguments if one is not Ellipsis} if _all_hashable(arguments) else set()
            of_items = {"items": value_schema(items.pop(), depth + 1)} if len(items) == 1 else {}
            return {"type": ["array", "object"], **of_items}
        case "dict":
            return {"type": "object"}
    return {}


def _all_hashable(parts: tuple[Any, ...]) -> bool:
    try:
        set(parts)
    except TypeError:
        return False
    return True

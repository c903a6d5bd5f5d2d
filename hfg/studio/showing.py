"""A value for people: one line, its shape, what is small enough as JSON; an image as PNG or JPEG.

Made off the graph's loop, of values that do not change (rule T1). Nothing of what users send can make it fail.
Depends on the reporting floor's pictures.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any, Final

import msgspec
import numpy as np

from hfg.base.token import Token
from hfg.engine.observing.encoding import encode, text
from hfg.reporting.pictures import is_picture, png, smaller

__all__ = ["fields_of", "image_frame", "kind_of", "number_in", "shown_value", "summary_of"]

_MOST_BYTES: Final = 16_384
_MOST_ELEMENTS: Final = 400
_DEEPEST: Final = 2
_MOST_FIELDS: Final = 4
_SIZE: Final = struct.Struct("<HH")


def shown_value(token: Token[Any]) -> dict[str, Any]:
    """Return what a page shows of a token."""
    value = token.value
    found: dict[str, Any] = {
        "stamp": token.stamp,
        "number": token.sequence,
        "activity": token.activity,
        "kind": kind_of(token),
        "summary": summary_of(token),
        "data": None,
        "shape": None,
        "dtype": None,
        "message": "",
    }
    if isinstance(value, np.ndarray):
        found["shape"], found["dtype"] = list(value.shape), str(value.dtype)
        if found["kind"] == "image":
            return found
        if value.size > _MOST_ELEMENTS:
            found["message"] = _too_much(value)
            return found
        value = value.tolist()
    written = encode(value)
    if len(written) <= _MOST_BYTES:
        found["data"] = msgspec.Raw(written)
    else:
        found["message"] = f"it has {len(written):,} bytes as text, more than is shown at once"
    return found


def _too_much(value: np.ndarray[Any, Any]) -> str:
    shape = " x ".join(map(str, value.shape))
    if value.ndim == 3 and value.shape[2] not in (1, 3, 4):
        return f"This picture cannot be shown: it has {value.shape[2]} channels. Its shape is {shape}."
    return f"it has {value.size:,} elements, {shape}; a plot of its size or a node that chooses shows more"


def kind_of(token: Token[Any]) -> str:
    """Say in which way a page shows the value of a token."""
    value = token.value
    if token.is_marker:
        return "marker"
    if value is None:
        return "none"
    if isinstance(value, bool | int | float | np.number | np.bool_):
        return "number"
    if isinstance(value, str):
        return "text"
    if isinstance(value, np.ndarray):
        return "image" if is_picture(value) else "array"
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        return "table" if value and all(isinstance(one, Mapping | tuple | msgspec.Struct) for one in value) else "list"
    return "record" if isinstance(value, Mapping) or fields_of(value) is not None else "other"


def summary_of(token: Token[Any]) -> str:
    """Return the value of a token on one line, with numbers as short as people read them."""
    try:
        return _summary(token.value)
    except Exception:  # of a value that cannot be looked into
        return text(token.value)


def _summary(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > _MOST_FIELDS:
        size = " x ".join(map(str, value.shape[1::-1] + value.shape[2:])) if value.ndim > 1 else f"{value.size} numbers"
        return f"image, {size}" if is_picture(value) else f"{value.dtype}, {size}"
    return _short(value, 0)


def _short(value: Any, depth: int) -> str:
    if isinstance(value, bool | np.bool_) or value is None:
        return str(value)
    digits = 4 if depth == 0 else 3
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        return _short_array(value, digits)
    if isinstance(value, float | np.floating):
        return f"{value:.{digits}g}"
    if isinstance(value, str) and depth == 0:
        return " ".join(value.split())
    fields = fields_of(value) if depth < _DEEPEST else None
    if fields:
        return _short_record(fields, depth)
    if isinstance(value, list | tuple) and value and fields_of(value[0]):
        return f"{len(value)} x {type(value[0]).__name__}"
    return text(value)


def _short_array(value: np.ndarray[Any, Any], digits: int) -> str:
    if value.size > _MOST_FIELDS:
        return f"{value.size} numbers"
    return f"({', '.join(f'{one:.{digits}g}' for one in value.flat)})"


def _short_record(fields: Mapping[str, Any], depth: int) -> str:
    parts = [f"{name} {_short(one, depth + 1)}" for name, one in list(fields.items())[:_MOST_FIELDS]]
    return ", ".join(parts) + (", …" if len(fields) > _MOST_FIELDS else "")


def fields_of(value: Any) -> dict[str, Any] | None:
    """Return the fields of a record by name; None of anything else."""
    for names in ("_fields", "__struct_fields__", "__dataclass_fields__"):
        if (found := getattr(value, names, None)) is not None:
            return {str(name): getattr(value, name) for name in found}
    return None


def number_in(value: object) -> float | None:
    """Return a value as a number for a plot; a list or array is its length."""
    if isinstance(value, bool | int | float | np.number | np.bool_):
        return float(value)
    try:
        return float(len(value))  # type: ignore[arg-type]  # that is what is tried
    except TypeError:
        return None


def image_frame(value: np.ndarray[Any, Any], size: int, quality: int) -> bytes:
    """Return an image as a page gets it: width and height of the original, then JPEG, or PNG without OpenCV."""
    height, width = value.shape[:2]
    small = smaller(value, size)
    head = _SIZE.pack(min(width, 0xFFFF), min(height, 0xFFFF))
    try:
        import cv2
    except ImportError:
        return head + png(small)
    if small.dtype == np.uint8 and small.ndim in (2, 3) and (small.ndim == 2 or small.shape[2] in (1, 3)):
        done, data = cv2.imencode(".jpg", np.ascontiguousarray(small), [cv2.IMWRITE_JPEG_QUALITY, quality])
        if done:
            return head + bytes(data)
    return head + png(small)

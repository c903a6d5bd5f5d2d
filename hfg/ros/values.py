"""What hfg has for messages of ROS 2: text and numbers, images, scans. Depends on geometry and NumPy.

Coordinates are the same in both: metres, radians, x ahead, y to the left. Angles and ranges are float32 in ROS.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from hfg.geometry import LaserScan
from hfg.images import Image


class Conversion(NamedTuple):
    """How a value becomes a record with a message's fields, and the other way.

    Attributes:
      type: of the value.
      to_ros, from_ros: the two ways.
    """

    type: Any
    to_ros: Callable[[Any], Any]
    from_ros: Callable[[Any], Any]


def _header(frame: str, stamp_s: float) -> dict[str, Any]:
    second = int(stamp_s // 1)
    return {"frame_id": frame, "stamp": {"sec": second, "nanosec": min(999_999_999, round((stamp_s - second) * 1e9))}}


def stamp_of(header: Any) -> float:
    """Return the seconds of a header."""
    return float(header.stamp.sec + header.stamp.nanosec / 1e9)


# --- images: arrays as OpenCV has them, colours in the order blue, green, red ---

_LAYOUTS: Final[dict[str, tuple[str, int]]] = {
    "bgr8": ("u1", 3), "rgb8": ("u1", 3), "bgra8": ("u1", 4), "rgba8": ("u1", 4), "mono8": ("u1", 1),
    "8UC1": ("u1", 1), "8UC3": ("u1", 3), "mono16": ("u2", 1), "16UC1": ("u2", 1), "32FC1": ("f4", 1),
}  # fmt: skip
_ENCODINGS: Final = {("u1", 1): "mono8", ("u1", 3): "bgr8", ("u1", 4): "bgra8", ("u2", 1): "16UC1", ("f4", 1): "32FC1"}


def _image_to_ros(image: Any) -> dict[str, Any]:
    channels = image.shape[2] if image.ndim == 3 else 1
    encoding = _ENCODINGS.get((image.dtype.str.lstrip("<|="), channels))
    if image.ndim not in (2, 3) or encoding is None:
        raise ValueError(f"an array of {image.dtype}, {' x '.join(map(str, image.shape))} is not an image of ROS")
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image)
    step = width * channels * image.dtype.itemsize
    data = rows.reshape(-1).view(np.uint8)
    return {"header": {}, "height": height, "width": width, "encoding": encoding, "step": step, "data": data}


def _image_from_ros(message: Any) -> Any:
    if message.encoding not in _LAYOUTS:
        known = ", ".join(_LAYOUTS)
        raise ValueError(f"an image is encoded as {message.encoding!r:.40}, and these are known: {known}")
    kind, channels = _LAYOUTS[message.encoding]
    order = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * channels * order.itemsize
    if message.step < row or message.step * message.height != len(message.data):
        raise ValueError(f"{len(message.data)} bytes are not {message.height} rows of {message.step} bytes")
    pixels = message.data.reshape(message.height, message.step)[:, :row]
    image = np.ascontiguousarray(pixels).view(order).astype(kind, copy=False)
    image = image.reshape(message.height, message.width, channels)
    if message.encoding.startswith("rgb"):
        image = np.ascontiguousarray(image[:, :, [2, 1, 0, 3][:channels]])
    return image[:, :, 0] if channels == 1 else image


# --- scans ---


def _scan_to_ros(scan: LaserScan) -> dict[str, Any]:
    last = scan.start_angle + scan.step * max(0, len(scan.ranges) - 1)
    return {
        "header": _header(scan.frame_id, scan.stamp),
        "angle_min": scan.start_angle,
        "angle_max": last,
        "angle_increment": scan.step,
        "range_min": scan.min_range,
        "range_max": scan.max_range,
        "ranges": scan.ranges,
    }


def _scan_from_ros(message: Any) -> LaserScan:
    return LaserScan(
        message.header.frame_id or "laser",
        stamp_of(message.header),
        message.ranges.astype(np.float64),
        message.angle_min,
        message.angle_increment,
        max(0.0, message.range_min),
        message.range_max,
    )


def _plain(kind: Callable[[Any], Any]) -> Conversion:
    return Conversion(kind, lambda value: {"data": kind(value)}, lambda message: kind(message.data))


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"expected text, got {type(value).__name__}")
    return value


_NUMBERS: Final = ("Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64")

KNOWN: Final[dict[str, Conversion]] = {
    "std_msgs/msg/String": Conversion(str, lambda value: {"data": _text(value)}, lambda message: message.data),
    "std_msgs/msg/Bool": _plain(bool),
    **{f"std_msgs/msg/{name}": _plain(int) for name in _NUMBERS},
    **{f"std_msgs/msg/{name}": _plain(float) for name in ("Float32", "Float64")},
    "sensor_msgs/msg/Image": Conversion(Image, _image_to_ros, _image_from_ros),
    "sensor_msgs/msg/LaserScan": Conversion(LaserScan, _scan_to_ros, _scan_from_ros),
}
"""What hfg has, by the name of the message."""

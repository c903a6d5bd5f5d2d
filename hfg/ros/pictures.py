"""Images of ROS 2 and of hfg: raw, or compressed, which needs OpenCV.

Source: sensor_msgs/image_encodings.hpp of https://github.com/ros2/common_interfaces. Depends on encoding.
"""

from __future__ import annotations

import re
from typing import Any, Final

import numpy as np

from hfg.encoding.pictures import need_fair_size, pixels_problem
from hfg.errors import EncodingError, UsageError

_NAMED: Final = {
    "mono8": ("uint8", 1),
    "bgr8": ("uint8", 3),
    "rgb8": ("uint8", 3),
    "bgra8": ("uint8", 4),
    "rgba8": ("uint8", 4),
    "mono16": ("uint16", 1),
    "bgr16": ("uint16", 3),
    "rgb16": ("uint16", 3),
    "bgra16": ("uint16", 4),
    "rgba16": ("uint16", 4),
}
_KINDS: Final = {
    "8U": "uint8", "8S": "int8", "16U": "uint16", "16S": "int16", "32S": "int32", "32F": "float32", "64F": "float64"
}  # fmt: skip
_NUMBERED: Final = re.compile(r"(8U|8S|16U|16S|32S|32F|64F)C([1-4]?)")
_SWAPPED: Final = ("rgb8", "rgba8", "rgb16", "rgba16")
_OWN: Final = {("uint8", 1): "mono8", ("uint8", 3): "bgr8", ("uint8", 4): "bgra8", ("uint16", 1): "mono16"}


def to_image(record: Any) -> Any:
    """Return the image of a `sensor_msgs/msg/Image`, colours in the order of hfg: blue, green, red.

    Raises:
      ValueError: it has another number of bytes, another encoding, or is too large.
    """
    dtype, channels = _layout(record.encoding)
    height, width, step = record.height, record.width, record.step
    number = np.dtype(dtype).newbyteorder(">" if record.is_bigendian else "<")
    row = width * channels * number.itemsize
    problem = pixels_problem(width, height)
    if problem is not None:
        raise ValueError(f"the image {problem}")
    if step < row or len(record.data) < step * height:
        raise ValueError(
            f"{width} x {height} pixels of {record.encoding} in rows of {step} bytes do not fit into "
            f"{len(record.data)} bytes"
        )
    rows = record.data[: step * height].reshape(height, step)[:, :row]
    image = np.ascontiguousarray(rows).view(number).reshape((height, width, channels)[: 2 + (channels > 1)])
    if record.encoding in _SWAPPED:
        image = image[..., [2, 1, 0, 3][:channels]]
    return np.ascontiguousarray(image, dtype)


def _layout(encoding: str) -> tuple[str, int]:
    if encoding in _NAMED:
        return _NAMED[encoding]
    found = _NUMBERED.fullmatch(encoding)
    if found is None:
        raise ValueError(
            f"the encoding {encoding!r:.80} of the image is unknown here; known are {', '.join(_NAMED)}, 32FC1 ..."
        )
    return _KINDS[found[1]], int(found[2] or 1)


def of_image(value: Any) -> dict[str, Any]:
    """Return the fields of a `sensor_msgs/msg/Image` other than its header."""
    channels = _channels(value)
    data = np.ascontiguousarray(value, value.dtype.newbyteorder("<"))
    encoding = _OWN.get((value.dtype.name, channels))
    if encoding is None:
        letters = next((key for key, name in _KINDS.items() if name == value.dtype.name), None)
        if letters is None:
            raise EncodingError(f"ROS 2 has no images of {value.dtype.name}")
        encoding = f"{letters}C{channels}"
    height, width = value.shape[:2]
    return {
        "height": height,
        "width": width,
        "encoding": encoding,
        "step": width * channels * value.itemsize,
        "data": data.reshape(-1).view(np.uint8),
    }


def _channels(value: Any) -> int:
    if not isinstance(value, np.ndarray) or value.ndim not in (2, 3) or (value.ndim == 3 and value.shape[2] > 4):
        raise EncodingError("an image is an array of height x width, or height x width x 1 to 4 channels")
    return 1 if value.ndim == 2 else value.shape[2]


def to_compressed(record: Any) -> Any:
    """Return the image of a `sensor_msgs/msg/CompressedImage`.

    Raises:
      ValueError: it is not a picture, or is too large.
      UsageError: OpenCV is not installed.
    """
    data = record.data.tobytes()
    need_fair_size(data, "the picture")
    cv2 = _opencv()
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        raise ValueError("it is not a picture that OpenCV can read, or it is incomplete")
    return image


def of_compressed(value: Any) -> dict[str, Any]:
    """Return the fields of a `sensor_msgs/msg/CompressedImage` other than its header: JPEG, or PNG for 16 bits."""
    channels = _channels(value)
    how = "jpeg" if value.dtype == np.uint8 and channels in (1, 3) else "png"
    if value.dtype not in (np.uint8, np.uint16) or channels == 2:
        raise EncodingError(f"an image of {value.dtype.name} with {channels} channels cannot be compressed")
    done, data = _opencv().imencode(f".{how}", value)
    if not done:
        raise EncodingError(f"an image of {value.shape[1]} x {value.shape[0]} pixels cannot be written as {how}")
    return {"format": how, "data": data.reshape(-1)}


def _opencv() -> Any:
    try:
        import cv2
    except ImportError:
        raise UsageError('compressed images need OpenCV: pip install "hfg[vision]"') from None
    return cv2

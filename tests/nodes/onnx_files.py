"""Writes small networks as ONNX files, field by field of their protobuf schema (onnx.proto3), without the package."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np


def _varint(number: int) -> bytes:
    parts = bytearray()
    while number > 0x7F:
        parts.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*parts, number])


def _field(number: int, value: Any) -> bytes:
    """One field: an integer, a float, a text, or a message."""
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    if isinstance(value, float):
        return _varint(number << 3 | 5) + struct.pack("<f", value)
    data = value.encode() if isinstance(value, str) else value
    return _varint(number << 3 | 2) + _varint(len(data)) + data


def _tensor(name: str, values: np.ndarray) -> bytes:
    kind = 7 if values.dtype == np.int64 else 1
    dims = b"".join(_field(1, one) for one in values.shape)
    return dims + _field(2, kind) + _field(8, name) + _field(9, np.ascontiguousarray(values).tobytes())


def _value(name: str, shape: Sequence[int]) -> bytes:
    dims = b"".join(_field(1, _field(1, one)) for one in shape)
    return _field(1, name) + _field(2, _field(1, _field(1, 1) + _field(2, dims)))


def _node(kind: str, inputs: Sequence[str], output: str, **lists: Sequence[int]) -> bytes:
    parts = b"".join(_field(1, one) for one in inputs) + _field(2, output) + _field(3, output) + _field(4, kind)
    for name, numbers in lists.items():
        ints = b"".join(_field(8, one) for one in numbers)
        parts += _field(5, _field(1, name) + ints + _field(20, 7))
    return parts


def block_detector(weights: np.ndarray, offsets: np.ndarray) -> bytes:
    """Return a network in the layout of YOLO v8: each block of a picture is multiplied by weights, plus offsets.

    Args:
      weights: channels out x 3 x side x side.
      offsets: 1 x channels out x rows x columns of blocks.
    """
    out, _, side, _ = weights.shape
    _, _, rows, columns = offsets.shape
    nodes = [
        _node("Conv", ["image", "weights"], "blocks", kernel_shape=[side, side], strides=[side, side]),
        _node("Add", ["blocks", "offsets"], "moved"),
        _node("Reshape", ["moved", "shape"], "boxes"),
    ]
    shape = np.array([1, out, rows * columns], np.int64)
    tensors: dict[str, Any] = {
        "weights": weights.astype(np.float32),
        "offsets": offsets.astype(np.float32),
        "shape": shape,
    }
    graph = b"".join(_field(1, one) for one in nodes) + _field(2, "blocks")
    graph += b"".join(_field(5, _tensor(name, values)) for name, values in tensors.items())
    graph += _field(11, _value("image", [1, 3, rows * side, columns * side]))
    graph += _field(12, _value("boxes", shape.tolist()))
    return _field(1, 8) + _field(7, graph) + _field(8, _field(1, "") + _field(2, 13))

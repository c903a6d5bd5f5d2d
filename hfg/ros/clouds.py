"""Clouds of points of ROS 2 and of hfg: `sensor_msgs/msg/PointCloud2` and `PointCloud`. Depends on geometry."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from hfg.geometry import PointCloud

_TYPES: Final = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64")
"""Types of fields, from 1."""

_KEPT: Final = {"int8": "int32", "int16": "int32", "uint32": "float64"}
"""Types that a `PointCloud` does not have, and what they become."""

_MOST_FIELDS: Final = 100


def to_cloud(record: Any) -> tuple[Any, dict[str, Any]]:
    """Return points and other fields of a cloud.

    Raises:
      ValueError: its fields do not fit into its points, or it has no x and y.
    """
    count, step = record.width * record.height, record.point_step
    if record.row_step < record.width * step or len(record.data) < record.row_step * record.height or step < 1:
        raise ValueError(
            f"{record.height} rows of {record.width} points of {step} bytes do not fit into {len(record.data)} bytes"
        )
    rows = record.data[: record.row_step * record.height].reshape(record.height, record.row_step)
    points = np.ascontiguousarray(rows[:, : record.width * step]).reshape(count, step)
    if len(record.fields) > _MOST_FIELDS:
        raise ValueError(f"it has {len(record.fields)} fields; at most {_MOST_FIELDS} can be read")
    columns = {one.name: _column(points, one, big=record.is_bigendian) for one in record.fields if one.count == 1}
    missing = {"x", "y"} - columns.keys()
    if missing:
        raise ValueError(f"its points have no field {' and '.join(sorted(missing))}")
    axes = [columns.pop(name) for name in ("x", "y", "z") if name in columns]
    fields = {name: one.astype(_KEPT.get(one.dtype.name, one.dtype.name)) for name, one in columns.items() if name}
    return np.stack(axes, axis=1).astype(np.float64), fields


def _column(points: Any, field: Any, *, big: bool) -> Any:
    if not 1 <= field.datatype <= len(_TYPES):
        raise ValueError(f"its field {field.name!r:.80} is of type {field.datatype}, which ROS 2 does not have")
    dtype = np.dtype(_TYPES[field.datatype - 1])
    end = field.offset + dtype.itemsize
    if end > points.shape[1]:
        raise ValueError(f"its field {field.name!r:.80} ends at byte {end} of a point of {points.shape[1]} bytes")
    packed = np.ascontiguousarray(points[:, field.offset : end])
    return packed.view(dtype.newbyteorder(">" if big else "<"))[:, 0].astype(dtype)


def of_cloud(value: PointCloud, field: Any) -> dict[str, Any]:
    """Return the fields of a message other than its header; coordinates are float32, as everywhere in ROS 2."""
    names = ("x", "y", "z")
    space = np.zeros((len(value), 3), np.float32)
    space[:, : value.points.shape[1]] = value.points
    columns = {name: space[:, axis] for axis, name in enumerate(names)} | value.fields
    layout = np.dtype([(name, one.dtype.newbyteorder("<")) for name, one in columns.items()])
    packed = np.empty(len(value), layout)
    for name, one in columns.items():
        packed[name] = one
    return {
        "height": 1,
        "width": len(value),
        "fields": [
            field(name, layout.fields[name][1], 1 + _TYPES.index(one.dtype.name), 1)  # type: ignore[index]
            for name, one in columns.items()
        ],
        "point_step": layout.itemsize,
        "row_step": layout.itemsize * len(value),
        "data": packed.view(np.uint8).reshape(-1) if len(value) else np.zeros(0, np.uint8),
        "is_dense": bool(np.isfinite(value.points).all()),
    }

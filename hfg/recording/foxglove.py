"""Values of robots in Foxglove's schemas, so that a recording appears in its 3-D panel. Depends on `hfg.geometry`.

The schemas are Foxglove's published ones (github.com/foxglove/schemas, jsonschema/); the token and its exact value are
further fields, which other readers ignore.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from hfg.base.values import Colour
from hfg.geometry import FrameTransform, Grid, LaserScan, PointCloud, PoseInFrame, Scene, Transform
from hfg.recording.forms import bare

_TYPES: Final = {"|u1": 1, "|i1": 2, "<u2": 3, "<i2": 4, "<u4": 5, "<i4": 6, "<f4": 7, "<f8": 8}
"""Foxglove's numbers of numeric types."""


class Shown(NamedTuple):
    """How values of a type are written for Foxglove.

    Attributes:
      name: of the schema.
      properties: of its messages.
      fields: makes them of a value.
    """

    name: str
    properties: dict[str, Any]
    fields: Callable[[Any], dict[str, Any]]

    def schema(self, value: Any, token: dict[str, Any]) -> bytes:
        """Return the schema, with the schemas of the exact value and of the rest of the token."""
        properties = {**self.properties, "value": value, **token}
        draft = "https://json-schema.org/draft/2020-12/schema"
        return msgspec.json.encode(
            {"$schema": draft, "title": self.name, "type": "object", "properties": properties, "required": ["stamp"]}
        )


def shown(hint: Any) -> Shown | None:
    """Return how Foxglove shows values of a type; None if it has no schema for them."""
    hint = bare(hint)
    if typing.get_origin(hint) is list and bare(typing.get_args(hint)[0]) is FrameTransform:
        return _TRANSFORMS
    return _SHOWN.get(hint) if isinstance(hint, type) else None


# --- schemas ---


def _object(title: str, **properties: Any) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": properties}


_NUMBER: Final = {"type": "number"}
_TEXT: Final = {"type": "string"}
_COUNT: Final = {"type": "integer", "minimum": 0}
_TIME: Final = _object("time", sec=_COUNT, nsec={**_COUNT, "maximum": 999999999})
_VECTOR: Final = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION: Final = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE: Final = _object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION)
_HEADER: Final = {"timestamp": _TIME, "frame_id": _TEXT}
_PACKED: Final = {
    "type": "array",
    "items": _object("foxglove.PackedElementField", name=_TEXT, offset=_COUNT, type={"type": "integer"}),
}
_COLOUR: Final = _object("foxglove.Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_SOLID: Final = {"pose": _POSE, "size": _VECTOR, "color": _COLOUR}
_BYTES: Final = {"type": "string", "contentEncoding": "base64"}
_LINK: Final = {
    "timestamp": _TIME,
    "parent_frame_id": _TEXT,
    "child_frame_id": _TEXT,
    "translation": _VECTOR,
    "rotation": _QUATERNION,
}


def _list(title: str, **properties: Any) -> dict[str, Any]:
    return {"type": "array", "items": _object(title, **properties)}


_ENTITY: Final = {
    **_HEADER,
    "id": _TEXT,
    "lifetime": _object("duration", sec={"type": "integer"}, nsec={**_COUNT, "maximum": 999999999}),
    "frame_locked": {"type": "boolean"},
    "cubes": _list("foxglove.CubePrimitive", **_SOLID),
    "spheres": _list("foxglove.SpherePrimitive", **_SOLID),
    "cylinders": _list("foxglove.CylinderPrimitive", **_SOLID, bottom_scale=_NUMBER, top_scale=_NUMBER),
    "lines": _list(
        "foxglove.LinePrimitive",
        type={"type": "integer"},
        pose=_POSE,
        thickness=_NUMBER,
        scale_invariant={"type": "boolean"},
        points=_list("foxglove.Point3", x=_NUMBER, y=_NUMBER, z=_NUMBER),
        color=_COLOUR,
    ),
    "texts": _list(
        "foxglove.TextPrimitive",
        pose=_POSE,
        billboard={"type": "boolean"},
        font_size=_NUMBER,
        scale_invariant={"type": "boolean"},
        color=_COLOUR,
        text=_TEXT,
    ),
}


# --- messages ---


def _time(stamp: float) -> dict[str, int]:
    """Return a stamp as whole seconds and nanoseconds; Foxglove knows no time before 0."""
    fraction, whole = math.modf(max(stamp, 0.0))
    return {"sec": int(whole), "nsec": min(int(fraction * 1e9), 999_999_999)}


def _header(value: Any) -> dict[str, Any]:
    return {"timestamp": _time(value.stamp), "frame_id": value.frame_id}


def _named(numbers: Any) -> dict[str, float]:
    return dict(zip("xyzw", numbers.tolist(), strict=False))


def _pose(pose: Transform) -> dict[str, Any]:
    return {"position": _named(pose.translation), "orientation": _named(pose.rotation)}


def _of_pose(value: PoseInFrame) -> dict[str, Any]:
    return {**_header(value), "pose": _pose(value.pose)}


def _of_transform(value: FrameTransform) -> dict[str, Any]:
    return {
        "timestamp": _time(value.stamp),
        "parent_frame_id": value.parent,
        "child_frame_id": value.child,
        "translation": _named(value.transform.translation),
        "rotation": _named(value.transform.rotation),
    }


def _of_scan(value: LaserScan) -> dict[str, Any]:
    ranges = np.where(value.hits, value.ranges, 0.0)  # JSON has no infinity; what hit nothing is at the laser
    return {
        **_header(value),
        "pose": _pose(Transform.of()),
        "start_angle": value.start_angle,
        "end_angle": value.start_angle + value.step * max(len(ranges) - 1, 0),
        "ranges": ranges.tolist(),
        "intensities": [],
    }


def _of_cloud(value: PointCloud) -> dict[str, Any]:
    names = "xyz"[: value.points.shape[1]]
    columns: dict[str, Any] = {name: value.points[:, number] for number, name in enumerate(names)}
    if len(names) == 2:  # the panel draws points of space
        columns["z"] = np.zeros(len(value), np.float32)
    columns |= value.fields
    known = {name: _shortest(one) for name, one in columns.items()}
    packed = np.empty(len(value), [(name, one.dtype) for name, one in known.items()])
    for name, one in known.items():
        packed[name] = one
    offsets: Any = packed.dtype.fields or {}
    fields = [{"name": n, "offset": offsets[n][1], "type": _TYPES[one.dtype.str]} for n, one in known.items()]
    return {
        **_header(value),
        "pose": _pose(Transform.of()),
        "point_stride": packed.itemsize,
        "fields": fields,
        "data": packed.tobytes(),
    }


def _shortest(values: Any) -> Any:
    """Return numbers as a type that Foxglove has; real ones in single precision, as it draws them."""
    kept = values.dtype.str in _TYPES and values.dtype.kind != "f"
    return values if kept else values.astype(np.float32)


def _of_grid(value: Grid) -> dict[str, Any]:
    cells = _shortest(value.values)
    return {
        **_header(value),
        "pose": _pose(value.origin),
        "column_count": len(cells),  # Foxglove's columns are along x
        "cell_size": {"x": value.cell, "y": value.cell},
        "row_stride": len(cells) * cells.itemsize,
        "cell_stride": cells.itemsize,
        "fields": [{"name": "value", "offset": 0, "type": _TYPES[cells.dtype.str]}],
        "data": cells.T.tobytes(),
    }


def _colour(colour: Colour, opacity: float = 1.0) -> dict[str, float]:
    return {"r": colour.red / 255, "g": colour.green / 255, "b": colour.blue / 255, "a": opacity}


def _of_scene(value: Scene) -> dict[str, Any]:
    """Return one entity, which takes the place of the one before, so nothing has to be deleted."""
    solids: dict[str, list[dict[str, Any]]] = {"box": [], "ball": [], "cylinder": []}
    for one in value.solids:
        more = {"bottom_scale": 1.0, "top_scale": 1.0} if one.kind == "cylinder" else {}
        seen = {"pose": _pose(one.pose), "size": _named(one.size), "color": _colour(one.colour, one.opacity)}
        solids[one.kind].append({**seen, **more})
    flat = {"pose": _pose(Transform.of()), "scale_invariant": False}
    lines = [
        {
            **flat,
            "type": 0,  # from point to point
            "thickness": one.width,
            "points": [{"x": 0.0, "y": 0.0, "z": 0.0} | _named(point) for point in one.points],
            "color": _colour(one.colour),
        }
        for one in value.lines
    ]
    texts = [
        {
            "pose": _pose(Transform(one.place, np.array([0.0, 0.0, 0.0, 1.0]))),
            "billboard": True,
            "font_size": one.height,
            "scale_invariant": False,
            "color": _colour(one.colour),
            "text": one.text,
        }
        for one in value.labels
    ]
    entity = {
        **_header(value),
        "id": "scene",
        "lifetime": _time(value.lifetime_s),
        "frame_locked": False,
        "cubes": solids["box"],
        "spheres": solids["ball"],
        "cylinders": solids["cylinder"],
        "lines": lines,
        "texts": texts,
    }
    return {"deletions": [], "entities": [entity]}


_TRANSFORMS: Final = Shown(
    "foxglove.FrameTransforms",
    {"transforms": {"type": "array", "items": _object("foxglove.FrameTransform", **_LINK)}},
    lambda value: {"transforms": [_of_transform(one) for one in value]},
)
_SHOWN: Final = {
    FrameTransform: Shown("foxglove.FrameTransform", _LINK, _of_transform),
    PoseInFrame: Shown("foxglove.PoseInFrame", {**_HEADER, "pose": _POSE}, _of_pose),
    LaserScan: Shown(
        "foxglove.LaserScan",
        {
            **_HEADER,
            "pose": _POSE,
            "start_angle": _NUMBER,
            "end_angle": _NUMBER,
            "ranges": {"type": "array", "items": _NUMBER},
            "intensities": {"type": "array", "items": _NUMBER},
        },
        _of_scan,
    ),
    PointCloud: Shown(
        "foxglove.PointCloud",
        {**_HEADER, "pose": _POSE, "point_stride": _COUNT, "fields": _PACKED, "data": _BYTES},
        _of_cloud,
    ),
    Grid: Shown(
        "foxglove.Grid",
        {
            **_HEADER,
            "pose": _POSE,
            "column_count": _COUNT,
            "cell_size": _object("foxglove.Vector2", x=_NUMBER, y=_NUMBER),
            "row_stride": _COUNT,
            "cell_stride": _COUNT,
            "fields": _PACKED,
            "data": _BYTES,
        },
        _of_grid,
    ),
    Scene: Shown(
        "foxglove.SceneUpdate",
        {
            "deletions": _list("foxglove.SceneEntityDeletion", timestamp=_TIME, type={"type": "integer"}, id=_TEXT),
            "entities": _list("foxglove.SceneEntity", **_ENTITY),
        },
        _of_scene,
    ),
}

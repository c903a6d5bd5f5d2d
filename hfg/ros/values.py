"""Messages that are values of hfg, and how one becomes the other.

    std_msgs/msg/Bool, Int8 ... UInt64, Float32, Float64, String, Byte, Char   bool, int, float, str
    sensor_msgs/msg/Image, CompressedImage                                      an image (`hfg.images`)
    sensor_msgs/msg/LaserScan                                                   LaserScan
    sensor_msgs/msg/PointCloud2                                                 PointCloud
    nav_msgs/msg/OccupancyGrid                                                  Grid of int8
    geometry_msgs/msg/PoseStamped                                               PoseInFrame
    geometry_msgs/msg/Pose, Transform                                           Transform
    geometry_msgs/msg/TransformStamped, tf2_msgs/msg/TFMessage                  FrameTransform, a list of them
    geometry_msgs/msg/Twist                                                     Twist, in the plane
    rosgraph_msgs/msg/Clock                                                     float, in seconds

Parts that the value has no place for (intensities of a scan, the header of an image) are lost; the record has them
(`MessageType.unpack`). A frame without a name becomes "no_frame", and back. Depends on definitions and geometry.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from hfg.errors import EncodingError
from hfg.geometry import FrameTransform, Grid, LaserScan, PointCloud, PoseInFrame, Transform, Twist
from hfg.images import AnyImage
from hfg.ros.clouds import of_cloud, to_cloud
from hfg.ros.definitions import Record
from hfg.ros.pictures import of_compressed, of_image, to_compressed, to_image

NO_FRAME: Final = "no_frame"

Make: TypeAlias = Callable[[str], type[Record]]
"""Returns the class of a type's records."""


class Header(NamedTuple):
    """The parts of a message that a value lacks.

    Attributes:
      stamp: in seconds.
      frame_id: may be empty.
    """

    stamp: float
    frame_id: str


class Conversion(NamedTuple):
    """How messages of a type become values of hfg and back.

    Attributes:
      value_type: type of the values.
      to_value: returns the value of a record.
      to_record: returns the record of a value.
    """

    value_type: Any
    to_value: Callable[[Any], Any]
    to_record: Callable[[Any, Header, Make], Any]


def conversion(name: str) -> Conversion | None:
    """Return how messages of a type become values; None: they are records."""
    return _CONVERSIONS.get(name)


# --- headers ---


def seconds(time: Any) -> float:
    """Return a time or duration in seconds."""
    return float(time.sec + time.nanosec / 1e9)


def time(stamp: float, make: Make, name: str = "builtin_interfaces/msg/Time") -> Any:
    """Return a time as a record.

    Raises:
      EncodingError: ROS 2 has no such time: it is not finite, or more than 68 years away from 1970.
    """
    if not math.isfinite(stamp) or not -(2**31) <= stamp < 2**31 - 1:
        raise EncodingError(f"a stamp is a number of seconds from 1970 to 2038, found {stamp}")
    whole = math.floor(stamp)
    nanoseconds = round((stamp - whole) * 1e9)
    return make(name)(whole + nanoseconds // 10**9, nanoseconds % 10**9)


def _header(stamp: float, frame_id: str, make: Make) -> Any:
    return make("std_msgs/msg/Header")(time(stamp, make), "" if frame_id == NO_FRAME else frame_id)


def _stamped(record: Any) -> tuple[str, float]:
    return record.header.frame_id or NO_FRAME, seconds(record.header.stamp)


# --- poses ---


def _vector(value: Any) -> Any:
    return np.array([value.x, value.y, value.z], np.float64)


def _transform(place: Any, turn: Any) -> Transform:
    return Transform(_vector(place), np.array([turn.x, turn.y, turn.z, turn.w], np.float64))


def _pose(value: Transform, make: Make) -> Any:
    place = make("geometry_msgs/msg/Point")(*value.translation.tolist())
    return make("geometry_msgs/msg/Pose")(place, _quaternion(value, make))


def _quaternion(value: Transform, make: Make) -> Any:
    return make("geometry_msgs/msg/Quaternion")(*value.rotation.tolist())


def _moved(value: Transform, make: Make) -> Any:
    way = make("geometry_msgs/msg/Vector3")(*value.translation.tolist())
    return make("geometry_msgs/msg/Transform")(way, _quaternion(value, make))


def _to_link(record: Any) -> FrameTransform:
    parent, stamp = _stamped(record)
    moved = _transform(record.transform.translation, record.transform.rotation)
    return FrameTransform(parent, record.child_frame_id or NO_FRAME, moved, stamp)


def _of_link(value: FrameTransform, make: Make) -> Any:
    header = _header(value.stamp, value.parent, make)
    child = "" if value.child == NO_FRAME else value.child
    return make("geometry_msgs/msg/TransformStamped")(header, child, _moved(value.transform, make))


def _to_twist(record: Any) -> Twist:
    rest = record.linear.z, record.angular.x, record.angular.y
    if any(rest):
        raise ValueError(f"it moves out of the plane: linear z, angular x and y are {rest}; take the record instead")
    return Twist(record.linear.x, record.linear.y, record.angular.z)


def _of_twist(value: Twist, make: Make) -> Any:
    vector = make("geometry_msgs/msg/Vector3")
    return make("geometry_msgs/msg/Twist")(
        vector(float(value.vx), float(value.vy), 0.0), vector(0.0, 0.0, float(value.omega))
    )


# --- scans and grids ---


def _to_scan(record: Any) -> LaserScan:
    ranges = record.ranges.astype(np.float64)
    low, high = record.range_min, record.range_max
    return LaserScan(*_stamped(record), ranges, record.angle_min, record.angle_increment, low, high)


def _of_scan(value: LaserScan, _: Header, make: Make) -> Any:
    count = len(value.ranges)
    return make("sensor_msgs/msg/LaserScan")(
        header=_header(value.stamp, value.frame_id, make),
        angle_min=value.start_angle,
        angle_max=value.start_angle + value.step * max(count - 1, 0),
        angle_increment=value.step,
        range_min=value.min_range,
        range_max=value.max_range,
        ranges=value.ranges.astype(np.float32),
    )


def _to_grid(record: Any) -> Grid:
    about = record.info
    if len(record.data) != about.width * about.height:
        raise ValueError(f"its map has {len(record.data)} cells, but is {about.width} x {about.height}")
    cells = np.ascontiguousarray(record.data.reshape(about.height, about.width).T)  # its rows go along y
    frame, stamp = _stamped(record)
    return Grid(frame, stamp, _transform(about.origin.position, about.origin.orientation), about.resolution, cells)


def _of_grid(value: Grid, _: Header, make: Make) -> Any:
    if value.values.dtype != np.int8:
        raise EncodingError(f"a map has int8 in each cell, from 0 to 100, -1 for unknown; found {value.values.dtype}")
    width, height = value.values.shape
    stamp = time(value.stamp, make)
    about = make("nav_msgs/msg/MapMetaData")(stamp, value.cell, width, height, _pose(value.origin, make))
    header = _header(value.stamp, value.frame_id, make)
    return make("nav_msgs/msg/OccupancyGrid")(header, about, value.values.T.reshape(-1))


def _plain(name: str, value_type: type) -> Conversion:
    def to_record(value: Any, _: Header, make: Make) -> Any:
        return make(name)(value)

    return Conversion(value_type, lambda record: record.data, to_record)


_KINDS: Final = {
    bool: ["Bool"],
    int: [*(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)), "Byte", "Char"],
    float: ["Float32", "Float64"],
    str: ["String"],
}

_CONVERSIONS: Final = {
    **{
        f"std_msgs/msg/{kind}": _plain(f"std_msgs/msg/{kind}", value_type)
        for value_type, kinds in _KINDS.items()
        for kind in kinds
    },
    "sensor_msgs/msg/Image": Conversion(
        AnyImage,
        to_image,
        lambda value, header, make: make("sensor_msgs/msg/Image")(_header(*header, make), **of_image(value)),
    ),
    "sensor_msgs/msg/CompressedImage": Conversion(
        AnyImage,
        to_compressed,
        lambda value, header, make: make("sensor_msgs/msg/CompressedImage")(
            _header(*header, make), **of_compressed(value)
        ),
    ),
    "sensor_msgs/msg/LaserScan": Conversion(LaserScan, _to_scan, _of_scan),
    "sensor_msgs/msg/PointCloud2": Conversion(
        PointCloud,
        lambda record: PointCloud(*_stamped(record), *to_cloud(record)),
        lambda value, _, make: make("sensor_msgs/msg/PointCloud2")(
            _header(value.stamp, value.frame_id, make), **of_cloud(value, make("sensor_msgs/msg/PointField"))
        ),
    ),
    "nav_msgs/msg/OccupancyGrid": Conversion(Grid, _to_grid, _of_grid),
    "geometry_msgs/msg/PoseStamped": Conversion(
        PoseInFrame,
        lambda record: PoseInFrame(*_stamped(record), _transform(record.pose.position, record.pose.orientation)),
        lambda value, _, make: make("geometry_msgs/msg/PoseStamped")(
            _header(value.stamp, value.frame_id, make), _pose(value.pose, make)
        ),
    ),
    "geometry_msgs/msg/Pose": Conversion(
        Transform,
        lambda record: _transform(record.position, record.orientation),
        lambda value, _, make: _pose(value, make),
    ),
    "geometry_msgs/msg/Transform": Conversion(
        Transform,
        lambda record: _transform(record.translation, record.rotation),
        lambda value, _, make: _moved(value, make),
    ),
    "geometry_msgs/msg/TransformStamped": Conversion(
        FrameTransform, _to_link, lambda value, _, make: _of_link(value, make)
    ),
    "tf2_msgs/msg/TFMessage": Conversion(
        list[FrameTransform],
        lambda record: [_to_link(one) for one in record.transforms],
        lambda value, _, make: make("tf2_msgs/msg/TFMessage")([_of_link(one, make) for one in value]),
    ),
    "geometry_msgs/msg/Twist": Conversion(Twist, _to_twist, lambda value, _, make: _of_twist(value, make)),
    "rosgraph_msgs/msg/Clock": Conversion(
        float,
        lambda record: seconds(record.clock),
        lambda value, _, make: make("rosgraph_msgs/msg/Clock")(time(value, make)),
    ),
}

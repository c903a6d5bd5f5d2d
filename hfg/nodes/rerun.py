"""Rerun (rerun.io): images, scans, clouds, frames, paths, numbers and texts, to a file or a viewer on this computer."""

from __future__ import annotations

import ipaddress
import socket
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

import numpy as np

from hfg.base.clock import now
from hfg.errors import UsageError
from hfg.geometry import FrameTransform, LaserScan, PointCloud, PoseInFrame, Transform
from hfg.nodes._extras import require
from hfg.nodetypes.node import Node
from hfg.ports import Parameter, Slots
from hfg.types import describe_value

__all__ = ["RerunLog"]

_TIMELINE: Final = "run"
_PATIENCE_S: Final = 5.0
_KNOWN: Final = (
    "a number, a text, an image, a LaserScan, a PointCloud, a PoseInFrame, FrameTransforms, or a path: rows of 2 or 3 "
    "coordinates"
)


class RerunLog(Node):
    """Log values to Rerun, at the time of the run's clock.

    Images become Image or DepthImage, clouds Points3D, scans and paths LineStrips3D, poses and frames Transform3D,
    numbers Scalars, texts TextLog. Values with a frame are placed in it. Without a file and a viewer, nothing is
    encoded. If the viewer is not there when the run begins, the log says so, and the run continues without it.

    Attributes:
      values: one slot for each stream; each may take several edges.
      entities: names of the streams in Rerun, as in "robot/camera"; the others are named "values/0" and so on.
      file: the file to write, "run.rrd"; an existing one is overwritten. Empty: none.
      viewer: address of a viewer on this computer, "rerun+http://127.0.0.1:9876/proxy". Empty: none.

    Raises:
      ModuleNotFoundError: the extra `hfg[rerun]` is not installed.
      UsageError: the address is not one of this computer.
      OSError: the file cannot be written.
      TypeError: Rerun cannot show such a value.
    """

    entities = Parameter([], type=list[str])
    file = Parameter(Path())
    viewer = Parameter("")

    def setup(self) -> None:
        """Open the file, and connect to the viewer."""
        self._rerun: Any = None
        self._stream: Any = None
        self._has_file = self.file != Path()
        wants_viewer = bool(self.viewer) and _is_there(self.viewer, self)
        if not (self._has_file or wants_viewer):
            return
        if self._has_file:
            self.file.open("ab").close()  # Rerun's own error does not say why
        rerun = self._rerun = require("rerun", "rerun")
        stream = self._stream = rerun.RecordingStream("hfg", make_default=False, make_thread_default=False)
        sinks = [rerun.FileSink(str(self.file))] if self._has_file else []
        stream.set_sinks(*sinks, *([rerun.GrpcSink(self.viewer)] if wants_viewer else []))

    @Slots(Any, 1)
    def values(self, number: int, value: Any) -> None:
        """Log it."""
        if self._stream is not None:
            entity = self.entities[number] if number < len(self.entities) else f"values/{number}"
            self._stream.set_time(_TIMELINE, timestamp=max(now(), 0.0))
            for path, parts in _entities(self._rerun, entity, value):
                self._stream.log(path, *parts)

    def teardown(self) -> None:
        """Write the rest."""
        stream, self._stream = getattr(self, "_stream", None), None
        if stream is not None:
            try:
                stream.flush(timeout_sec=_PATIENCE_S)
            except RuntimeError as error:  # the viewer has gone, or the disk is full
                self.log.error("the last values did not reach Rerun: %s", error)
            stream.disconnect()


def _is_there(address: str, node: Node) -> bool:
    """Return whether a viewer listens; connecting to one that does not would block the run for seconds.

    Raises:
      UsageError: the address is not one of this computer.
    """
    try:
        parts = urlsplit(address)
        host, port = "127.0.0.1" if parts.hostname == "localhost" else parts.hostname or "", parts.port
        is_here = ipaddress.ip_address(host).is_loopback
    except ValueError:
        is_here, port = False, None
    if not is_here or port is None:
        raise UsageError(
            f'viewer of "{node.place.path}" must be an address of this computer with a port, such as '
            f'"rerun+http://127.0.0.1:9876/proxy", got {address!r:.80}; to reach another computer, go through ssh -L'
        )
    try:
        socket.create_connection((host, port), timeout=0.2).close()
    except OSError:
        node.log.warning("no viewer listens at %s, so nothing is sent to it; start it before the run: rerun", address)
        return False
    return True


def _entities(rerun: Any, entity: str, value: Any) -> list[tuple[str, tuple[Any, ...]]]:
    """Return the entities of a value, each with its archetypes."""
    match value:
        case str():
            return [(entity, (rerun.TextLog(value),))]
        case bool() | int() | float() | np.number() | np.bool_():
            return [(entity, (rerun.Scalars(float(value)),))]
        case LaserScan():
            return [(entity, (rerun.LineStrips3D(_strips(value)), rerun.CoordinateFrame(value.frame_id)))]
        case PointCloud():
            return [(entity, (rerun.Points3D(_in_space(value.points)), rerun.CoordinateFrame(value.frame_id)))]
        case PoseInFrame():
            return [(entity, (_transform(rerun, value.pose, parent_frame=value.frame_id),))]
        case FrameTransform():
            return _entities(rerun, entity, [value])
        case list() if value and all(isinstance(one, FrameTransform) for one in value):
            return [(f"{entity}/{one.child}", (_link(rerun, one),)) for one in value]
        case np.ndarray():
            return [(entity, (_of_array(rerun, value),))]
    raise TypeError(f"Rerun shows {_KNOWN}; got {describe_value(value)}")


def _link(rerun: Any, link: FrameTransform) -> Any:
    return _transform(rerun, link.transform, parent_frame=link.parent, child_frame=link.child)


def _transform(rerun: Any, transform: Transform, **frames: str) -> Any:
    rotation = rerun.Quaternion(xyzw=transform.rotation)
    return rerun.Transform3D(translation=transform.translation, quaternion=rotation, **frames)


def _in_space(points: Any) -> Any:
    """Return points of space; those of a plane are at height 0."""
    return points if points.shape[1] == 3 else np.column_stack([points, np.zeros(len(points))])


def _strips(scan: LaserScan) -> list[Any]:
    """Return the outline that a laser sees: a line for each run of neighbouring beams that hit something."""
    hits = scan.hits
    beams = np.flatnonzero(hits)
    angles, ranges = scan.angles[beams], scan.ranges[beams]
    points = np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(len(beams))])
    return np.split(points, np.flatnonzero(np.diff(beams) > 1) + 1) if len(beams) else []


def _of_array(rerun: Any, value: np.ndarray[Any, Any]) -> Any:
    channels = 1 if value.ndim == 2 else value.shape[2] if value.ndim == 3 else 0
    if value.dtype == np.uint8 and channels in (1, 3, 4):
        model = {1: "L", 3: "BGR", 4: "BGRA"}[channels]
        return rerun.Image(value if channels > 1 else value.reshape(value.shape[:2]), color_model=model)
    if value.dtype.kind == "f" and value.ndim == 2 and value.shape[1] in (2, 3):
        return rerun.LineStrips3D([_in_space(value)])
    if value.dtype in (np.float32, np.float64, np.uint16) and channels == 1:
        return rerun.DepthImage(value.reshape(value.shape[:2]))
    raise TypeError(f"Rerun shows {_KNOWN}; got {describe_value(value)}")

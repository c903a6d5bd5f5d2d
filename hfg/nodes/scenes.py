"""Scenes: clusters, tracks and paths as boxes, balls and lines, for the 3-D panel of Foxglove."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Interval, MinLen, Unit

from hfg.base.clock import now
from hfg.base.values import Colour
from hfg.geometry import Label, Line, PointCloud, Scene, Solid, Transform
from hfg.images import OneOf
from hfg.nodes.estimation import Track
from hfg.nodetypes.functions import node
from hfg.types import Named

__all__ = ["scene_of_clusters", "scene_of_path", "scene_of_tracks"]

Metres = Annotated[float, Interval(gt=0, le=100), Unit("m")]
Frame = Annotated[str, MinLen(1)]
Way: TypeAlias = Annotated[npt.NDArray[np.float64], OneOf((None, 2), (None, 3)), Named("Way")]
"""Points or poses of the plane, in order: a row of x and y, or of x, y and heading, for each."""


@node
def scene_of_clusters(labelled: PointCloud, *, colour: Colour = Colour(240, 130, 30)) -> Scene:
    """Show clusters as boxes around their points, with their numbers.

    Fires once per cloud.

    Args:
      labelled: as `clouds.cluster_points` sends it, with the field "cluster".
      colour: of the boxes.

    Returns:
      out: in the frame of the cloud; boxes lie along its axes, those of a cloud of the plane are flat.

    Raises:
      ValueError: the cloud has no field "cluster", or coordinates are not finite.
    """
    labelled.need_finite()
    if "cluster" not in labelled.fields:
        raise ValueError(
            f'the cloud in frame "{labelled.frame_id}" has no field "cluster"; take the output "labelled" of '
            "clouds.cluster_points"
        )
    number = labelled.fields["cluster"]
    space = np.zeros((len(labelled), 3))
    space[:, : labelled.points.shape[1]] = labelled.points
    solids, labels = [], []
    for one in np.unique(number[number >= 0]).tolist():
        low, high = space[number == one].min(0), space[number == one].max(0)
        with np.errstate(over="ignore"):
            middle, size = low / 2 + high / 2, np.minimum(high - low, 1e300)
        solids.append(Solid("box", Transform(middle, np.array([0.0, 0.0, 0.0, 1.0])), size, colour, 0.4))
        labels.append(Label(str(int(one)), np.array([middle[0], middle[1], high[2]]), colour))
    return Scene(labelled.frame_id, labelled.stamp, solids, labels=labels)


@node
def scene_of_tracks(
    tracks: list[Track],
    *,
    frame_id: Frame = "map",
    ahead_s: Annotated[float, Interval(ge=0, le=60), Unit("s")] = 1.0,
    size: Metres = 0.5,
    colour: Colour = Colour(40, 140, 240),
) -> Scene:
    """Show tracks as cylinders with their numbers, and lines to where they will be.

    Fires once per list of tracks.

    Args:
      tracks: as `estimation.TrackPoints` sends them.
      frame_id: the frame of the tracks, which they do not say.
      ahead_s: how far ahead in time a line goes.
      size: diameter of a cylinder; it is twice as high.
      colour: of those that were seen last time; others are faint.

    Returns:
      out: now, in the frame of the tracks; a track that is not at a finite place is left out.
    """
    solids, lines, labels = [], [], []
    for one in tracks:
        there = np.array([one.x, one.y])
        with np.errstate(all="ignore"):
            then = there + ahead_s * np.array([one.vx, one.vy])
        if not (np.isfinite(there).all() and np.isfinite(then).all()):
            continue
        solid = Transform.of(one.x, one.y, size)
        solids.append(Solid("cylinder", solid, np.array([size, size, 2 * size]), colour, 0.3 if one.missed else 0.8))
        labels.append(Label(str(one.number), np.array([one.x, one.y, 2.4 * size]), colour))
        lines.append(Line(np.stack([there, then]), colour))
    return Scene(frame_id, now(), solids, lines, labels)


@node
def scene_of_path(
    path: Way,
    *,
    frame_id: Frame = "map",
    width: Metres = 0.05,
    colour: Colour = Colour(60, 180, 75),
) -> Scene:
    """Show a path as a line on the ground.

    Fires once per path.

    Args:
      path: points, or poses whose headings are not shown; those that are not finite are left out.
      frame_id: the frame of the path, which it does not say.
      width: of the line.
      colour: of the line.

    Returns:
      out: now, in the frame of the path.
    """
    points: Any = path[:, :2]
    return Scene(frame_id, now(), lines=[Line(points[np.isfinite(points).all(1)], colour, width)])

"""The family `scenes`: boxes around clusters, cylinders at tracks, lines along paths."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hfg.geometry import PointCloud, Scene, Solid, Transform
from hfg.nodes import scenes
from hfg.nodes.estimation import Track
from hfg.testing import fire


def out(node: Any, **values: Any) -> Scene:
    scene: Scene = fire(node, **values).outputs["out"]
    return scene


def test_each_cluster_is_a_box_around_its_points() -> None:
    points = np.array([[0, 0, 0], [1, 2, 3], [9, 9, 9], [5, 5, 5], [5, 6, 5]], float)
    cloud = PointCloud("map", 2.0, points, {"cluster": np.array([1, 1, -1, 0, 0], np.int32)})
    scene = out(scenes.scene_of_clusters(), labelled=cloud)
    assert (scene.frame_id, scene.stamp) == ("map", 2.0)
    boxes = [(one.pose.translation.tolist(), one.size.tolist()) for one in scene.solids]
    assert boxes == [([5, 5.5, 5], [0, 1, 0]), ([0.5, 1, 1.5], [1, 2, 3])]
    assert [one.text for one in scene.labels] == ["0", "1"]
    with pytest.raises(ValueError, match='the cloud in frame "map" has no field "cluster"; take the output'):
        out(scenes.scene_of_clusters(), labelled=PointCloud("map", 2.0, points))


def test_each_track_is_a_cylinder_with_a_line_to_where_it_will_be() -> None:
    track = Track(4, 1.0, 2.0, 0.5, -1.0, 0.1, 9, 0, True)
    gone = track._replace(number=5, missed=3)
    lost = track._replace(number=6, x=math.nan)
    scene = out(scenes.scene_of_tracks(ahead_s=2.0, size=0.4, frame_id="odom"), tracks=[track, gone, lost])
    assert scene.frame_id == "odom"
    assert [one.pose.translation.tolist() for one in scene.solids] == [[1.0, 2.0, 0.4]] * 2
    assert scene.solids[0].opacity > scene.solids[1].opacity
    assert scene.lines[0].points.tolist() == [[1.0, 2.0], [2.0, 0.0]]
    assert [one.text for one in scene.labels] == ["4", "5"]


def test_a_path_of_poses_is_a_line_of_its_places() -> None:
    path = np.array([[0.0, 1.0, 0.3], [2.0, 3.0, 0.4], [np.nan, 0.0, 0.0]])
    (line,) = out(scenes.scene_of_path(width=0.1), path=path).lines
    assert line.points.tolist() == [[0.0, 1.0], [2.0, 3.0]]
    assert line.width == 0.1


def test_solids_and_scenes_that_mean_nothing_are_refused() -> None:
    with pytest.raises(ValueError, match="a solid has three lengths, none below 0"):
        Solid("box", Transform.of(), np.array([1.0, -1.0, 1.0]))
    with pytest.raises(ValueError, match="the lifetime of a scene is a number of seconds from 0, got nan"):
        Scene("map", 0.0, lifetime_s=math.nan)

"""Records with a frame and a stamp refuse what they cannot mean, and travel between processes unchanged."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import pytest

from hfg.encoding import decode, encode
from hfg.geometry import Grid, LaserScan, PointCloud, PoseInFrame, RingScan, Transform
from hfg.recording.values import Codec

ONE = Transform.of(1, 2, 3, 0.1, 0.2, 0.3)
RECORDS = [
    PoseInFrame("map", 1.5, ONE),
    LaserScan("laser", 1.5, np.array([1.0, np.inf, np.nan]), -1.0, 0.5),
    RingScan("laser", 1.5, np.ones((2, 4)), np.array([-0.1, 0.1]), 0.0, 0.5),
    PointCloud("laser", 1.5, np.array([[1.0, 2.0, np.nan]]), {"ring": np.array([3], np.int32)}),
    Grid("map", 1.5, ONE, 0.1, np.array([[0, 100], [0, -1]], np.int8)),
]


@pytest.mark.parametrize("record", RECORDS)
def test_records_are_the_same_again_after_files_and_recordings(record: Any) -> None:
    kind = type(record)
    for again in (decode(encode(record, kind), kind), Codec(kind).decode(_json(Codec(kind).encode(record)))):
        assert type(again) is kind
        assert again == record


def test_records_are_equal_by_their_parts() -> None:
    assert Transform.of(1) == Transform.of(1)
    assert Transform.of(1) != Transform.of(2)
    assert RECORDS[0] != RECORDS[1]


def _json(data: Any) -> Any:
    return msgspec.json.decode(msgspec.json.encode(data))


def test_the_angles_of_a_scan_follow_each_other_and_only_beams_that_ended_hit() -> None:
    scan = LaserScan("laser", 0.0, np.array([1.0, 0.05, 8.0, np.nan, np.inf, -1.0]), -1.0, 0.5, 0.1, 8.0)
    assert scan.angles.tolist() == [-1, -0.5, 0, 0.5, 1, 1.5]
    assert scan.hits.tolist() == [True, False, False, False, False, False]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PoseInFrame("", 0.0, ONE), "a frame has a name, got ''"),
        (lambda: PoseInFrame("map", math.inf, ONE), 'a stamp is a finite number of seconds, got inf in frame "map"'),
        (lambda: LaserScan("a", 0.0, np.ones((2, 2)), 0, 1), r"one range for each beam, got an array of \(2, 2\)"),
        (lambda: LaserScan("a", 0.0, np.ones(2), 0, math.nan), "angles of a scan are finite, got start 0 and step nan"),
        (lambda: RingScan("a", 0.0, np.ones((2, 2)), np.ones(3), 0, 1), r"got arrays of \(2, 2\) and \(3,\)"),
        (lambda: RingScan("a", 0.0, np.ones((1, 2)), np.full(1, np.nan), 0, 1), "angles of a scan are finite"),
        (lambda: PointCloud("a", 0.0, np.ones((2, 4))), r"rows of x, y or of x, y, z, got an array of \(2, 4\)"),
        (lambda: PointCloud("a", 0.0, np.ones((2, 3)), {"i": np.ones(3)}), r'each of the 2 points, got "i" of \(3,\)'),
        (lambda: PointCloud("a", 0.0, np.ones((2, 3)), {"z": np.ones(2)}), "a name other than x, y, z"),
        (lambda: Grid("a", 0.0, ONE, 0.0, np.ones((2, 2))), "a length above 0, got 0.0"),
        (lambda: Grid("a", 0.0, ONE, 0.1, np.ones(2)), r"rows along x and columns along y, got an array of \(2,\)"),
    ],
)
def test_records_refuse_what_they_cannot_mean(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_cloud_says_how_many_of_its_points_are_not_numbers() -> None:
    cloud = PointCloud("laser", 2.5, np.array([[1.0, 2.0], [np.nan, 0.0], [np.inf, 0.0]]), {"i": np.arange(3.0)})
    with pytest.raises(ValueError, match='2 of the 3 points of the cloud in frame "laser" at 2.500 s are not finite'):
        cloud.need_finite()
    one = cloud.select(np.isfinite(cloud.points).all(1))
    one.need_finite()
    assert (len(one), one.fields["i"].tolist()) == (1, [0.0])

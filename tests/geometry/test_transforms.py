"""Transforms, compared with SciPy's rotations and with matrices of 4 x 4."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from hfg.geometry import Transform

RNG = np.random.default_rng(1)


def some() -> Transform:
    return Transform(RNG.normal(0, 5, 3), RNG.normal(0, 1, 4))


def of_scipy(one: Transform) -> Rotation:
    return Rotation.from_quat(one.rotation)


SOME = [some() for _ in range(60)] + [Transform.of(1, 2, 3), Transform.of(yaw=math.pi), Transform.of(roll=math.pi)]


@pytest.mark.parametrize("one", SOME)
def test_rotations_are_those_of_scipy(one: Transform) -> None:
    assert np.allclose(one.turn, of_scipy(one).as_matrix(), atol=1e-12)
    assert np.allclose(one.angles, of_scipy(one).as_euler("xyz"), atol=1e-9)
    numbers = np.concatenate([one.translation, one.angles])
    assert np.allclose(Transform.of(*numbers).matrix, one.matrix, atol=1e-9)
    assert np.allclose(Transform.of_matrix(one.matrix).matrix, one.matrix, atol=1e-12)


def test_transforms_are_composed_inverted_and_applied_as_matrices_are() -> None:
    for one, other in pairwise(SOME):
        assert np.allclose((one @ other).matrix, one.matrix @ other.matrix, atol=1e-11)
        assert np.allclose(one.inverse().matrix, np.linalg.inv(one.matrix), atol=1e-11)
        points = RNG.normal(0, 5, (7, 3))
        expected = (np.c_[points, np.ones(7)] @ one.matrix.T)[:, :3]
        assert np.allclose(one.apply(points), expected, atol=1e-12)


def test_slerp_is_that_of_scipy_also_the_short_way_round_and_for_nearly_equal_rotations() -> None:
    near = [Transform(one.translation, one.rotation + RNG.normal(0, 1e-3, 4)) for one in SOME]
    opposite = [Transform(one.translation, -two.rotation) for one, two in zip(SOME, SOME[3:], strict=False)]
    for one, other in [*zip(SOME, near, strict=True), *zip(SOME, opposite, strict=False)]:
        ways = Slerp([0, 1], Rotation.concatenate([of_scipy(one), of_scipy(other)]))
        for share in (0.0, 0.25, 0.9, 1.0):
            middle = one.between(other, share)
            assert (of_scipy(middle).inv() * ways(share)).magnitude() < 1e-7
            assert np.allclose(middle.translation, (1 - share) * one.translation + share * other.translation)


def test_points_of_the_plane_stay_there_unless_they_are_tilted() -> None:
    points = np.array([[1.0, 0.0], [0.0, 2.0]])
    turned = Transform.of(x=3, z=9, yaw=math.pi / 2).apply(points)
    assert np.allclose(turned, [[3, 1], [1, 0]])
    tilted = Transform.of(z=1, pitch=math.pi / 2).apply(points)
    assert np.allclose(tilted, [[0, 0, 0], [0, 2, 1]])


def test_straight_up_and_down_all_of_the_turn_is_yaw() -> None:
    for pitch in (math.pi / 2, -math.pi / 2):
        one = Transform.of(roll=0.3, pitch=pitch, yaw=0.5)
        roll, up, yaw = one.angles
        assert (roll, up) == (0.0, pitch)
        assert np.allclose(Transform.of(pitch=up, yaw=yaw).turn, one.turn, atol=1e-7)


def test_a_rotation_is_scaled_to_length_one_and_then_never_changes_again() -> None:
    one = Transform(np.zeros(3), np.array([0.0, 0.0, 3.0, 4.0]))
    assert one.rotation.tolist() == [0, 0, 0.6, 0.8]
    for other in SOME:
        assert (Transform(other.translation, other.rotation).rotation == other.rotation).all()


@pytest.mark.parametrize(
    ("translation", "rotation", "message"),
    [
        ([0, 0, math.nan], [0, 0, 0, 1], "finite numbers and a rotation whose length is not 0, got .*nan"),
        ([0, 0, 0], [0, 0, 0, 0], "whose length is not 0"),
        ([0, 0, 0], [1e200, 0, 0, 0], "finite"),
        ([0, 0], [0, 0, 0, 1], r"a rotation of 4 \(x, y, z, w\), got \(2,\) and \(4,\)"),
        ([], [], r"got \(0,\) and \(0,\)"),
    ],
)
def test_what_is_no_transform_is_refused(translation: list[float], rotation: list[float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Transform(np.array(translation, float), np.array(rotation, float))


def test_a_matrix_that_mirrors_stretches_or_is_none_is_refused() -> None:
    for matrix in (np.diag([1.0, 1, -1, 1]), np.diag([2.0, 1, 1, 1]), np.full((4, 4), np.nan), np.eye(2)):
        with pytest.raises(ValueError, match="a rigid transform is a right-handed rotation and a translation"):
            Transform.of_matrix(matrix)


def test_what_is_too_far_away_for_a_float_is_refused_when_composed_and_passed_when_applied() -> None:
    far = Transform.of(x=1.5e308)
    with pytest.raises(ValueError, match="finite"):
        far @ far
    points = far.apply(np.array([[np.nan, 0, 0], [1.5e308, 1, np.inf]]))
    assert not np.isfinite(points[:, 0]).any()

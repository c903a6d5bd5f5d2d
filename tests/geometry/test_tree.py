"""A tree of frames, compared with matrices that are interpolated by SciPy; what is asked in vain is said."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from hfg.geometry import FrameError, FrameTransform, Transform, TransformTree

RNG = np.random.default_rng(2)
PARENTS = {"odom": "map", "base": "odom", "arm": "base", "camera": "arm", "laser": "base", "person": "map"}
STAMPS = [0.0, 0.4, 1.0, 1.1, 2.0]


def poses() -> dict[str, list[Transform]]:
    return {child: [Transform(RNG.normal(0, 3, 3), RNG.normal(0, 1, 4)) for _ in STAMPS] for child in PARENTS}


def matrix(known: list[Transform], stamp: float) -> np.ndarray:
    """The same by SciPy: where a frame is in its parent."""
    made = np.eye(4)
    turns = Rotation.from_quat([one.rotation for one in known])
    made[:3, :3] = Slerp(STAMPS, turns)(stamp).as_matrix()
    made[:3, 3] = [np.interp(stamp, STAMPS, [one.translation[axis] for one in known]) for axis in range(3)]
    return made


def test_the_way_between_any_two_frames_is_the_product_of_matrices() -> None:
    known, tree = poses(), TransformTree()
    told = [(stamp, child, number) for child in PARENTS for number, stamp in enumerate(STAMPS)]
    for number in RNG.permutation(len(told)):  # they come in any order
        stamp, child, which = told[number]
        tree.add(FrameTransform(PARENTS[child], child, known[child][which], stamp))
    for stamp in (0.0, 0.2, 1.05, 1.7, 2.0):
        places = {"map": np.eye(4)}
        for child, parent in PARENTS.items():
            places[child] = places[parent] @ matrix(known[child], stamp)
        for target in places:
            for source in places:
                expected = np.linalg.inv(places[target]) @ places[source]
                assert np.allclose(tree.lookup(target, source, stamp).matrix, expected, atol=1e-9)
    assert tree.frames == sorted(places)


def moving(**options: float) -> TransformTree:
    tree = TransformTree(**options)
    for stamp in (1.0, 2.0, 3.0):
        tree.add(FrameTransform("map", "base", Transform.of(x=stamp), stamp))
    tree.add(FrameTransform("base", "laser", Transform.of(z=0.5), static=True))
    return tree


def test_static_frames_hold_at_any_time() -> None:
    assert moving().lookup("base", "laser", 1e9).translation.tolist() == [0, 0, 0.5]
    assert moving().lookup("base", "base", -5.0).translation.tolist() == [0, 0, 0]


def test_a_stamp_that_is_too_new_or_too_old_is_refused_by_frame_and_what_is_known() -> None:
    tree = moving()
    with pytest.raises(
        FrameError,
        match=r'where "base" is in "map" is known from 1.000 s to 3.000 s, not at 3.250 s; wait for it, or allow slack',
    ):
        tree.lookup("map", "laser", 3.25)
    with pytest.raises(FrameError, match=r"not at 0.500 s; that is too old: the last 10 s are kept \(keep_s\)"):
        tree.lookup("laser", "map", 0.5)
    assert tree.lookup("map", "base", 3.25, slack_s=0.3).translation[0] == 3
    assert tree.lookup("map", "base", 0.75, slack_s=0.3).translation[0] == 1
    with pytest.raises(FrameError, match="not at nan s"):
        tree.lookup("map", "base", math.nan, slack_s=math.inf)


def test_what_is_too_old_is_forgotten_but_never_what_the_memory_begins_within() -> None:
    tree = moving(keep_s=0.5)
    assert tree.lookup("map", "base", 2.5).translation[0] == 2.5
    with pytest.raises(FrameError, match=r"known from 2.000 s to 3.000 s, not at 1.500 s"):
        tree.lookup("map", "base", 1.5)


def test_unknown_frames_and_such_that_are_not_connected_are_named_with_those_that_are_known() -> None:
    tree = moving()
    with pytest.raises(FrameError, match='the frame "camera" is unknown at 2.000 s; known are: "base", "laser", "map"'):
        tree.lookup("map", "camera", 2.0)
    tree.add(FrameTransform("world", "gps", Transform.of()))
    with pytest.raises(FrameError, match='"laser" and "gps" are not connected at 2.000 s: one is in "map", the other'):
        tree.lookup("gps", "laser", 2.0)
    with pytest.raises(FrameError, match="known are: none yet"):
        TransformTree().lookup("a", "b", 0.0)


def test_a_frame_has_one_parent_and_is_not_its_own_ancestor() -> None:
    tree = moving()
    with pytest.raises(FrameError, match='"base" is in "map", and cannot be in "odom" too at 4.000 s'):
        tree.add(FrameTransform("odom", "base", Transform.of(), 4.0))
    with pytest.raises(FrameError, match='a ring: "laser", "map", "base", "laser"'):
        tree.add(FrameTransform("laser", "map", Transform.of(), 4.0))
    with pytest.raises(ValueError, match='a frame is not its own parent, got "map" twice'):
        FrameTransform("map", "map", Transform.of())
    with pytest.raises(ValueError, match='a stamp is a finite number of seconds, got nan in frame "map"'):
        FrameTransform("map", "base", Transform.of(), math.nan)
    with pytest.raises(ValueError, match="a frame has a name, got ''"):
        FrameTransform("map", "", Transform.of())


def test_a_pose_with_the_same_stamp_replaces_the_one_before() -> None:
    tree = moving()
    tree.add(FrameTransform("map", "base", Transform.of(x=9), 2.0))
    assert tree.lookup("map", "base", 2.0).translation[0] == 9
    assert tree.lookup("map", "base", 2.5).translation[0] == 6

"""The family `clouds`: scans and clouds, each node compared with a plain loop, SciPy, or a world that is known."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
import scipy.ndimage
from scipy.spatial.distance import cdist

from hfg.geometry import Grid, LaserScan, PointCloud, RingScan, Transform
from hfg.nodes import clouds, robotics
from hfg.testing import fire

NO_HIT = (np.nan, np.inf, -1.0, 0.0, 30.0)


def scan(ranges: Any, step: float = 0.1, start: float = -1.0) -> LaserScan:
    return LaserScan("laser", 1.0, np.array(ranges, float), start, step)


def cloud(points: Any, **fields: Any) -> PointCloud:
    return PointCloud("laser", 1.0, np.array(points, float), fields)


def out(node: Any, **values: Any) -> Any:
    return fire(node, **values).outputs["out"]


# --- scans ---


def test_a_scan_becomes_a_cloud_and_the_same_scan_again() -> None:
    rng = np.random.default_rng(1)
    one = LaserScan("laser", 1.0, rng.uniform(1, 20, 720), -math.pi, math.pi / 360)
    one.ranges[:5] = NO_HIT
    made = out(clouds.scan_to_cloud(), scan=one)
    expected = [(r * math.cos(a), r * math.sin(a)) for r, a in zip(one.ranges[5:], one.angles[5:], strict=True)]
    assert np.allclose(made.points, expected)
    again = out(clouds.cloud_to_scan(), cloud=made)
    assert np.isinf(again.ranges[:5]).all()
    assert np.allclose(again.ranges[5:], one.ranges[5:])
    assert np.allclose(again.angles, one.angles)


def test_the_nearest_point_of_a_cloud_between_two_heights_is_what_a_beam_hits() -> None:
    one = cloud([(2, 0, 0), (1, 0, 5), (3, 0.01, 0.2), (np.nan, 0, 0), (0, 0, 0), (0, 4, 0)])
    made = out(clouds.cloud_to_scan(beams=4, lowest=-1, highest=1, start_angle=0.0), cloud=one)
    assert made.ranges.tolist() == [2, 4, math.inf, math.inf]


def test_rings_become_a_cloud_as_spherical_coordinates_say() -> None:
    rng = np.random.default_rng(2)
    ranges, elevations = rng.uniform(1, 20, (16, 90)), np.radians(np.linspace(-15, 15, 16))
    ranges[3, 4:9] = np.nan, np.inf, -1, 0, 100
    made = out(clouds.rings_to_cloud(), scan=RingScan("laser", 1.0, ranges, elevations, 0.3, 2 * math.pi / 90))
    expected = []
    for ring, column in itertools.product(range(16), range(90)):
        r, a, e = ranges[ring, column], 0.3 + column * 2 * math.pi / 90, elevations[ring]
        if 0 < r < 100:
            expected.append((r * math.cos(e) * math.cos(a), r * math.cos(e) * math.sin(a), r * math.sin(e), ring))
    assert np.allclose(np.c_[made.points, made.fields["ring"]], expected)
    assert made.fields["ring"].dtype == np.uint16


def test_scans_are_made_now_and_taken_apart() -> None:
    made = out(clouds.make_scan(start_angle=-1.0, step=0.5, frame_id="front"), ranges=np.array([1.0, np.nan, 40.0]))
    assert (made.frame_id, made.start_angle, made.step) == ("front", -1.0, 0.5)
    parts = fire(clouds.ranges_and_angles(), scan=made).outputs
    assert parts["ranges"].tolist() == [1, math.inf, math.inf]
    assert parts["angles"].tolist() == [-1, -0.5, 0]


def test_beams_outside_of_ranges_and_sectors_have_hit_nothing() -> None:
    kept = out(clouds.filter_scan_ranges(low=1.0, high=2.0), scan=scan([0.5, 1, 1.5, 2, 2.5, np.nan]))
    assert kept.ranges.tolist() == [math.inf, 1, 1.5, 2, math.inf, math.inf]
    round_ = scan(np.ones(8), math.pi / 4, 0.0)
    ahead = out(clouds.filter_scan_angles(first=-math.pi / 2, last=math.pi / 2), scan=round_)
    assert np.isfinite(ahead.ranges).tolist() == [True, True, True, False, False, False, True, True]
    back = out(clouds.filter_scan_angles(first=math.pi / 2, last=-math.pi / 2), scan=round_)
    assert np.isfinite(back.ranges).tolist() == [False, False, True, True, True, True, True, False]
    assert np.isfinite(out(clouds.filter_scan_angles(first=-math.pi, last=math.pi), scan=round_).ranges).all()


def test_points_in_the_air_behind_an_edge_are_taken_out_and_a_slanted_wall_is_not() -> None:
    step = math.radians(0.5)
    ranges = [5.0] * 10 + [2.0] * 5 + [3.0, 4.0] + [5.0] * 10  # a post, two veiled points, a wall
    left = out(clouds.filter_scan_shadows(angle=math.radians(5)), scan=scan(ranges, step)).ranges
    assert np.isinf(left[15:17]).all()
    assert left[10:15].tolist() == [2.0] * 5
    angles = np.radians(np.arange(0, 60, 0.5))
    wall = 1 / np.cos(angles)  # hit at 30 degrees at the least
    assert np.isfinite(out(clouds.filter_scan_shadows(), scan=scan(wall, step)).ranges).all()


def test_the_median_is_that_of_scipy_and_gaps_do_not_count() -> None:
    rng = np.random.default_rng(3)
    ranges = rng.uniform(1, 20, 200)
    smooth = out(clouds.filter_scan_median(window=5), scan=scan(ranges)).ranges
    assert np.allclose(smooth[2:-2], scipy.ndimage.median_filter(ranges, 5)[2:-2])
    ranges[rng.random(200) < 0.3] = np.nan
    smooth = out(clouds.filter_scan_median(window=7), scan=scan(ranges)).ranges
    for number in range(200):
        near = ranges[max(0, number - 3) : number + 4]
        expected = np.nanmedian(near) if np.isfinite(ranges[number]) else np.nan
        assert smooth[number] == pytest.approx(expected, nan_ok=True)


def test_scans_without_beams_and_beams_without_hits_pass_every_filter() -> None:
    for empty in (scan([]), scan(NO_HIT)):
        for name in ("ranges", "angles", "shadows", "median"):
            assert not out(getattr(clouds, f"filter_scan_{name}")(), scan=empty).hits.any()
        assert len(out(clouds.scan_to_cloud(), scan=empty)) == 0


# --- shapes ---


def test_clouds_are_cropped_by_a_box_and_by_distance_and_flattened() -> None:
    rng = np.random.default_rng(4)
    points = rng.uniform(-3, 3, (200, 3))
    points[0] = np.nan
    one = cloud(points, i=np.arange(200.0))
    box = out(clouds.crop_box(x_min=-1, x_max=2, y_min=-2, y_max=0, z_min=0, z_max=1), cloud=one)
    inside = [k for k, (x, y, z) in enumerate(points) if -1 <= x <= 2 and -2 <= y <= 0 and 0 <= z <= 1]
    assert box.fields["i"].tolist() == inside
    rest = out(clouds.crop_box(x_min=-1, x_max=2, y_min=-2, y_max=0, z_min=0, z_max=1, outside=True), cloud=one)
    assert sorted([*box.fields["i"], *rest.fields["i"]]) == list(range(200))
    near = out(clouds.crop_distance(low=1.0, high=2.0), cloud=one)
    assert near.fields["i"].tolist() == [k for k, p in enumerate(points) if 1 <= math.hypot(*p) <= 2]
    assert out(clouds.flatten_cloud(), cloud=one).points.shape == (200, 2)
    assert out(clouds.finite_points(), cloud=one).fields["i"].tolist() == list(range(1, 200))


@pytest.mark.parametrize("axes", [2, 3])
def test_a_voxel_grid_keeps_the_mean_of_each_cube(axes: int) -> None:
    points = np.random.default_rng(5).uniform(-2, 2, (500, axes))
    made = out(clouds.voxel_grid(side=0.5), cloud=cloud(points, i=np.arange(500.0)))
    cubes: dict[tuple[int, ...], list[int]] = {}
    for number, point in enumerate(points):
        cubes.setdefault(tuple(math.floor(one / 0.5) for one in point), []).append(number)
    expected = {members[0]: points[members].mean(0) for members in cubes.values()}
    assert set(made.fields["i"].astype(int)) == set(expected)
    for first, mean in zip(made.fields["i"], made.points, strict=True):
        assert np.allclose(mean, expected[int(first)])


def test_cubes_are_found_far_away_too() -> None:
    far = cloud([(1e300, 0, 0), (1e300, 0.05, 0), (-1e300, 0, 0), (1.7e308, 0, 0)])
    assert len(out(clouds.voxel_grid(side=0.1), cloud=far)) == 3
    assert len(out(clouds.voxel_grid(side=1e-6), cloud=cloud([(0.0, 0, 0)] * 9))) == 1


# --- planes and ground ---


def floor(rng: np.random.Generator, count: int, tilt: float = 0.1) -> np.ndarray:
    x, y = rng.uniform(-5, 5, (2, count))
    return np.stack([x, y, 1 + tilt * x - 0.05 * y + rng.normal(0, 0.01, count)], 1)


def test_a_plane_is_found_among_as_many_points_that_are_not_on_it() -> None:
    rng = np.random.default_rng(6)
    on, off = floor(rng, 400), rng.uniform(-5, 5, (400, 3))
    plane = out(clouds.fit_plane(), cloud=cloud(np.concatenate([on, off])))
    slopes, *_ = np.linalg.lstsq(np.c_[on[:, :2], np.ones(400)], on[:, 2], rcond=None)
    expected = np.array([-slopes[0], -slopes[1], 1]) / math.hypot(slopes[0], slopes[1], 1)
    assert math.acos(min(1, plane.normal @ expected)) < math.radians(0.3)
    assert plane.offset == pytest.approx(slopes[2] * expected[2], abs=0.01)
    assert 400 <= plane.points <= 420
    parts = fire(clouds.split_plane(), cloud=cloud(np.concatenate([on, off])), plane=plane).outputs
    assert len(parts["on"]) == plane.points
    assert len(parts["on"]) + len(parts["off"]) == 800


def test_the_same_cloud_and_seed_give_the_same_plane() -> None:
    points = cloud(np.random.default_rng(7).uniform(-1, 1, (5000, 3)))
    first, second = (out(clouds.fit_plane(seed=3, least=0.0), cloud=points) for _ in range(2))
    assert first.normal.tolist() == second.normal.tolist()
    assert first[1:] == second[1:]


def test_points_on_a_line_or_too_few_or_too_far_are_no_plane() -> None:
    line = np.outer(np.arange(50.0), [1, 2, 3])
    for points in (line, line[:2], np.zeros((0, 3)), np.full((9, 3), 1.0), line * 1e300):
        assert fire(clouds.fit_plane(tolerance=1e-6), cloud=cloud(points)).outputs == {}
    with pytest.raises(ValueError, match='fit_plane needs points of space, got a cloud of the plane in frame "laser"'):
        fire(clouds.fit_plane(), cloud=cloud(np.ones((4, 2))))


def height(x: Any, y: Any) -> Any:
    return -0.6 + 0.15 * x + 0.1 * np.sin(y / 2)


def test_the_ground_is_removed_where_it_rises_and_boxes_and_roofs_are_not() -> None:
    """A slope of 15 %, waves, a laser 0.6 m above it; 12 boxes and a roof: of either at most 1 % is mistaken."""
    rng = np.random.default_rng(8)
    x, y = rng.uniform(-20, 20, (2, 20_000))
    ground = np.stack([x, y, height(x, y) + rng.normal(0, 0.02, x.size)], 1)
    ground = ground[np.hypot(x, y) > 1]
    things = []
    for _ in range(12):
        bx, by = rng.uniform(4, 15, 2) * rng.choice([-1, 1], 2)
        px, py = bx + rng.uniform(-0.3, 0.3, 200), by + rng.uniform(-0.3, 0.3, 200)
        things.append(np.stack([px, py, height(px, py) + rng.uniform(0.35, 1.8, 200)], 1))
    px, py = rng.uniform(5, 9, (2, 500))
    things.append(np.stack([px, py, height(px, py) + 2.5], 1))
    above = np.concatenate(things)
    marks = np.r_[np.zeros(len(ground)), np.ones(len(above))]
    parts = fire(clouds.split_ground(height=-0.6), cloud=cloud(np.concatenate([ground, above]), thing=marks)).outputs
    assert np.mean(parts["obstacles"].fields["thing"]) > 0.99
    assert np.sum(parts["obstacles"].fields["thing"]) > 0.99 * len(above)
    assert len(parts["obstacles"]) + len(parts["ground"]) == len(marks)


# --- clusters and grids ---


def brute(points: np.ndarray, gap: float) -> list[set[int]]:
    """The same by all distances."""
    near, left, found = cdist(points, points) <= gap, set(range(len(points))), []
    while left:
        group = {min(left)}
        edge = set(group)
        while edge:
            edge = {int(k) for one in edge for k in np.flatnonzero(near[one])} - group
            group |= edge
        left -= group
        found.append(group)
    return found


@pytest.mark.parametrize("axes", [2, 3])
@pytest.mark.parametrize("gap", [0.1, 0.2, 0.35])
def test_clusters_are_those_of_all_distances(axes: int, gap: float) -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        points = np.concatenate([rng.uniform(0, 3, (150, axes)), rng.normal(1, 0.2, (150, axes))])
        parts = fire(clouds.cluster_points(gap=gap, least=3), cloud=cloud(points)).outputs
        expected = [group for group in brute(points, gap) if len(group) >= 3]
        numbers = parts["labelled"].fields["cluster"]
        found = [set(np.flatnonzero(numbers == number).tolist()) for number in range(len(parts["clusters"]))]
        assert sorted(map(sorted, found)) == sorted(map(sorted, expected))
        assert [one.points for one in parts["clusters"]] == sorted(map(len, found), reverse=True)
        for one, group in zip(parts["clusters"], found, strict=True):
            some = points[sorted(group)]
            assert np.allclose(one.centre[:axes], some.mean(0))
            assert np.allclose([one.low[:axes], one.high[:axes]], [some.min(0), some.max(0)])


def test_clusters_that_are_too_small_or_too_large_have_no_number() -> None:
    points = np.concatenate([np.zeros((10, 2)), np.full((3, 2), 5.0), np.full((1, 2), 9.0)])
    parts = fire(clouds.cluster_points(least=2, most=5), cloud=cloud(points)).outputs
    assert parts["labelled"].fields["cluster"].tolist() == [-1] * 10 + [0] * 3 + [-1]
    assert fire(clouds.cluster_points(), cloud=cloud(np.zeros((0, 3)))).outputs["clusters"] == []


def test_points_in_one_place_are_one_cluster_however_many_there_are() -> None:
    (one,), _ = clouds.cluster_points.function(cloud(np.ones((100_000, 3))))
    assert one.points == 100_000


def test_an_obstacle_grid_counts_as_a_histogram_does() -> None:
    points = np.random.default_rng(9).normal(0, 3, (5000, 3))
    grid = out(clouds.obstacle_grid(cell=0.5, size=10.0, least=8), cloud=cloud(points))
    edges = np.linspace(-5, 5, 21)
    counts, *_ = np.histogram2d(points[:, 0], points[:, 1], [edges, edges])
    assert grid.values.tolist() == np.where(counts >= 8, 100, 0).tolist()
    assert grid.origin.translation.tolist() == [-5, -5, 0]
    assert not out(clouds.obstacle_grid(), cloud=cloud(np.zeros((0, 2)))).values.any()
    with pytest.raises(ValueError, match="at most 25 million cells, got 10000000 x 10000000; take larger cells"):
        fire(clouds.obstacle_grid(cell=1e-3, size=10_000.0), cloud=cloud(points))


def test_costs_are_by_the_distance_to_the_nearest_obstacle_and_lead_round_it() -> None:
    values = np.zeros((30, 30), np.int8)
    values[15, :20] = 100
    grid = Grid("map", 0.0, Transform.of(), 0.1, values)
    costs = out(clouds.grid_costs(radius=0.3, margin=0.4, weight=5.0), grid=grid)
    cells = np.argwhere(values == 100)
    for i, j in itertools.product(range(30), range(30)):
        far = 0.1 * np.sqrt(((cells - (i, j)) ** 2).sum(1).min())
        expected = math.inf if far < 0.3 else 1 + 5 * max(0.0, min(1.0, 1 - (far - 0.3) / 0.4))
        assert costs[i, j] == pytest.approx(expected)
    path = robotics.plan_path.function(costs, np.array([0.5, 0.5]), np.array([2.5, 0.5]))
    assert path is not None
    assert path[:, 1].max() > 2.2
    assert (out(clouds.grid_costs(), grid=Grid("map", 0.0, Transform.of(), 0.1, values * 0)) == 1).all()


# --- bad input ---


@pytest.mark.parametrize(
    "make",
    [clouds.voxel_grid, clouds.fit_plane, clouds.split_ground, clouds.cluster_points, clouds.obstacle_grid],
)
def test_a_cloud_with_nan_is_refused_by_one_sentence_that_says_what_to_do(make: Any) -> None:
    wrong = cloud([(1, 2, 3), (np.nan, 0, 0), (0, np.inf, 0)])
    with pytest.raises(
        ValueError, match=r'2 of the 3 points of the cloud in frame "laser" at 1.000 s are not finite; take them out'
    ):
        fire(make(), cloud=wrong)


def test_a_map_that_is_empty_is_refused_by_one_sentence() -> None:
    empty = Grid("map", 2.0, Transform.of(), 0.1, np.zeros((0, 5)))
    with pytest.raises(ValueError, match='the grid in frame "map" at 2.000 s is empty, 0 x 5 cells: there is nothing'):
        fire(clouds.grid_costs(), grid=empty)


def test_dense_surfaces_are_apart_exactly_if_they_are_farther_apart_than_the_gap() -> None:
    """Two slanted planes of many points: cells of both are near to each other, and each point decides."""
    slant = np.array([[2.0, 1.0], [0.0, 2.0], [1.0, -2.0]]) / 3
    plane = np.stack(np.meshgrid(*2 * [np.linspace(0, 0.5, 50)]), -1).reshape(-1, 2) @ slant.T
    normal = np.cross(*slant.T) / np.linalg.norm(np.cross(*slant.T))
    for off, count in ((0.1001, 2), (0.0999, 1)):
        both = cloud(np.concatenate([plane, plane + off * normal]))
        clusters, _ = clouds.cluster_points.function(both, gap=0.1)
        assert len(clusters) == count


def test_far_away_points_are_clustered_like_near_ones() -> None:
    points = np.random.default_rng(6).uniform(0, 2, (200, 3))
    scattered = np.random.default_rng(7).uniform(-1e12, 1e12, (300, 3))
    near, _ = clouds.cluster_points.function(cloud(points), gap=0.2, least=2)
    both, _ = clouds.cluster_points.function(cloud(np.concatenate([points, scattered])), gap=0.2, least=2)
    assert [one.points for one in both] == [one.points for one in near]

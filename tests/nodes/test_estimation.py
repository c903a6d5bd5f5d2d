"""The family `estimation`, compared with least squares over all measurements, all permutations, and exponentials."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import hfg
from hfg.geometry import PointCloud, PoseInFrame
from hfg.nodes import estimation
from hfg.nodes.estimation import Track, Twist
from hfg.testing import fire

# --- Kalman filters ---

STEP, SEEN = np.array([[1.0, 0.5], [0.0, 1.0]]), np.array([[1.0, 0.0]])
ADDS, NOISE = np.array([[0.02, 0.01], [0.01, 0.04]]), np.array([[0.25]])


def least_squares(measured: np.ndarray, start: float) -> tuple[np.ndarray, np.ndarray]:
    """The last state and its covariance, from the normal equations of all states and measurements together."""
    count = len(measured) + 1
    information, right = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
    information[:2, :2] = np.eye(2) / start**2
    for k in range(1, count):
        rows = np.zeros((2, 2 * count))
        rows[:, 2 * k - 2 : 2 * k], rows[:, 2 * k : 2 * k + 2] = -STEP, np.eye(2)
        information += rows.T @ np.linalg.inv(ADDS) @ rows
        look = np.zeros((1, 2 * count))
        look[:, 2 * k : 2 * k + 2] = SEEN
        if np.isfinite(measured[k - 1]):
            information += look.T @ np.linalg.inv(NOISE) @ look
            right += look.T @ np.linalg.inv(NOISE) @ measured[k - 1 : k]
    return np.linalg.solve(information, right)[-2:], np.linalg.inv(information)[-2:, -2:]


def test_a_kalman_filter_is_least_squares_over_all_that_was_measured() -> None:
    rng = np.random.default_rng(1)
    measured = np.cumsum(rng.normal(0.3, 0.5, 12))
    measured[5] = np.nan  # a step without a measurement
    node = estimation.KalmanFilter(
        transition=STEP.tolist(), observation=SEEN.tolist(), process_noise=ADDS.tolist(),
        measurement_noise=NOISE.tolist(), start=10.0,
    )  # fmt: skip
    for number, one in enumerate(measured):
        done = fire(node, measured=np.array([one])).outputs
        state, covariance = least_squares(measured[: number + 1], 10.0)
        assert np.allclose(done["state"], state)
        assert np.allclose(done["covariance"], covariance)


def test_an_extended_filter_with_a_jacobian_is_the_information_filter_at_that_place() -> None:
    """A landmark at the origin, of which range and bearing are measured from a pose."""
    state, covariance = np.array([3.0, 4.0, 0.2]), np.diag([0.5, 0.3, 0.1])

    def looks(at: np.ndarray) -> np.ndarray:
        return np.array([np.hypot(at[0], at[1]), np.arctan2(-at[1], -at[0]) - at[2]])

    jacobian = np.stack([(looks(state + 1e-6 * axis) - looks(state - 1e-6 * axis)) / 2e-6 for axis in np.eye(3)], 1)
    noise, measured = np.diag([0.01, 0.0025]), looks(np.array([3.1, 4.2, 0.15]))
    found = estimation.correct(state, covariance, measured, jacobian, noise, expected=looks(state))
    information = np.linalg.inv(covariance) + jacobian.T @ np.linalg.inv(noise) @ jacobian
    step = np.linalg.solve(information, jacobian.T @ np.linalg.inv(noise) @ (measured - looks(state)))
    assert np.allclose(found[0], state + step, atol=1e-6)
    assert np.allclose(found[1], np.linalg.inv(information), atol=1e-6)


def test_a_singular_covariance_is_refused_by_one_sentence() -> None:
    node = estimation.KalmanFilter(process_noise=[[0.0, 0.0], [0.0, 0.0]], measurement_noise=[[-1e9]], start=1.0)
    with pytest.raises(ValueError, match="covariance of a measurement is singular or not finite, so it says nothing; "):
        fire(node, measured=np.array([1.0]))
    for wrong in (np.zeros((2, 2)), np.full((2, 2), np.nan)):
        with pytest.raises(ValueError, match="singular or not finite"):
            estimation.correct(np.zeros(2), np.zeros((2, 2)), np.zeros(2), np.eye(2), wrong)


def test_sizes_that_do_not_fit_are_told() -> None:
    with pytest.raises(ValueError, match=r"m = 2 numbers need .* got \['2 x 2', '1 x 2', '2 x 2', '1 x 1'\]"):
        fire(estimation.KalmanFilter(), measured=np.zeros(2))
    with pytest.raises(ValueError, match=r"got \['2 x 1/2'"):
        fire(estimation.KalmanFilter(transition=[[1.0], [1.0, 2.0]]), measured=np.zeros(1))


# --- in time ---


@hfg.node
def numbers(*, values: Any = ()) -> Iterator[Any]:
    yield from values


def ran(make: Any, hz: float, **values: Any) -> dict[str, list[Any]]:
    """Run a node in virtual time on values that come at a rate. Return what its outputs have sent."""
    graph = hfg.Graph()
    node = graph.add(make)
    for name, given in values.items():
        graph.connect(graph.add(numbers(values=given), name=name, max_rate_hz=hz).out, node.ports.inputs[name])
    for name in node.ports.outputs:
        graph.connect(node.ports.outputs[name], graph.output(name, Any))
    return dict(hfg.run(graph, clock="virtual").outputs)


def test_alpha_beta_is_its_recursion_and_leaves_out_what_is_not_finite() -> None:
    rng = np.random.default_rng(2)
    values = [float(one) for one in np.cumsum(rng.normal(1, 0.3, 20))]
    values[7] = math.nan
    found = ran(estimation.AlphaBeta(alpha=0.6, beta=0.2), 10, value=values)
    smooth, rate = values[0], 0.0
    for number, value in enumerate(values[1:], 1):
        smooth += rate * 0.1
        off = 0.0 if math.isnan(value) else value - smooth
        smooth, rate = smooth + 0.6 * off, rate + 0.2 * off / 0.1
        assert found["smooth"][number] == pytest.approx(smooth)
        assert found["rate"][number] == pytest.approx(rate)


# --- tracks ---


def cloud(points: Any, stamp: float) -> PointCloud:
    return PointCloud("map", stamp, np.array(points, float).reshape(-1, 2))


def test_targets_keep_their_numbers_when_they_cross_and_while_they_are_hidden() -> None:
    """Two people cross at 1 m/s, a trunk stands near; one of the people is hidden for half a second."""
    rng = np.random.default_rng(3)
    node = estimation.TrackPoints(noise=0.05, forget_s=1.0)
    seen: list[list[Track]] = []
    for tick in range(60):
        t = tick / 10
        places = [(t - 3, 0.15 * (t - 3)), (3 - t, 0.15 * (t - 3) + 0.2), (0.0, 2.0)]
        shown = [place for number, place in enumerate(places) if not (number == 0 and 40 <= tick < 45)]
        order = rng.permutation(len(shown))
        points = [shown[number] + rng.normal(0, 0.05, 2) for number in order]
        seen.append(fire(node, detections=cloud(points, t)).outputs["tracks"])
    by_place = [min(seen[10], key=lambda one: math.dist((one.x, one.y), at)).number for at in [(-2, 0), (2, 0), (0, 2)]]
    t = 5.9
    for number, at, velocity, moves in zip(
        by_place, [(t - 3, 0.435), (3 - t, 0.635), (0, 2)], [(1, 0.15), (-1, 0.15), (0, 0)], [True, True, False],
        strict=True,
    ):  # fmt: skip
        (one,) = [track for track in seen[-1] if track.number == number]
        assert math.dist((one.x, one.y), at) < 0.15
        assert math.dist((one.vx, one.vy), velocity) < 0.3
        assert one.moves is moves
    hidden = {one.number: one.missed for one in seen[44]}
    assert hidden[by_place[0]] == 5
    assert len(seen[-1]) == 3


def test_points_are_assigned_as_the_best_of_all_permutations() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        before, after = rng.uniform(0, 1, (4, 2)), rng.uniform(0, 1, (4, 2))
        tracks = estimation.PointTracks()
        for stamp in (0.0, 0.01):
            tracks.update(before, stamp, noise=1.0, gate=100, confirm=1, fastest=0.0, acceleration=0.0)
        first = tracks.update(before, 0.02, noise=1.0, gate=100, confirm=1, acceleration=0.0)
        second = tracks.update(after, 0.03, noise=1.0, gate=100, confirm=1, acceleration=0.0)
        # All targets are equally sure, so each has moved towards its point by the same share of the way.
        best = min(itertools.permutations(range(4)), key=lambda order: sum(((before - after[list(order)]) ** 2).sum(1)))
        for old, new, target, which in zip(first, second, before, best, strict=True):
            assert old.number == new.number
            to = after[which] - target
            moved = np.array([new.x - old.x, new.y - old.y])
            assert moved @ to == pytest.approx(math.hypot(*moved) * math.hypot(*to))


def test_a_point_outside_of_the_gate_is_another_target_and_one_that_is_not_seen_again_is_forgotten() -> None:
    tracks = estimation.PointTracks()
    for tick in range(5):
        (one,) = tracks.update(np.zeros((1, 2)), tick / 10, confirm=1)
    told = tracks.update(np.array([[1.5, 0.0]]), 0.5, confirm=1)
    assert [(each.number, each.missed) for each in told] == [(one.number, 1), (one.number + 1, 0)]
    assert tracks.update(np.zeros((0, 2)), 9.0, confirm=1) == []
    node = estimation.TrackPoints()
    assert fire(node, detections=cloud([], 1.0)).outputs["tracks"] == []
    with pytest.raises(ValueError, match=r"in the order of their stamps, got 0.500 s after 1.000 s"):
        fire(node, detections=cloud([], 0.5))
    with pytest.raises(ValueError, match="1 of the 1 points of the cloud"):
        fire(node, detections=cloud([(np.nan, 0)], 2.0))


# --- odometry ---


def test_a_robot_moves_as_the_exponential_of_its_velocity_says() -> None:
    for twist in (Twist(1, 0, 0.5), Twist(0.3, -0.7, -2.0), Twist(1, 1, 1e-9), Twist(0, 0, 3), Twist(2, 1, 0)):
        x, y, turn = estimation.moved_by(twist, 1.7)
        whole = expm(1.7 * np.array([[0, -twist.omega, twist.vx], [twist.omega, 0, twist.vy], [0, 0, 0]]))
        assert np.allclose([x, y], whole[:2, 2])
        assert np.allclose([math.cos(turn), math.sin(turn)], whole[:2, 0])


def test_wheels_of_three_drives_give_the_velocity_that_turns_them() -> None:
    wanted = Twist(0.4, 0.0, 0.7)
    left, right = 0.4 - 0.7 * 0.3, 0.4 + 0.7 * 0.3  # each wheel is 0.3 m from the middle
    two = fire(estimation.differential_twist(track=0.6), left=left, right=right).outputs["out"]
    assert two == pytest.approx(wanted)
    angle = math.atan2(0.5, 0.4 / 0.7)  # the front axle is 0.5 m ahead, and the centre of the turn v / omega aside
    car = fire(estimation.ackermann_twist(wheelbase=0.5), speed=0.4, steering=angle).outputs["out"]
    assert car == pytest.approx(wanted)
    rng = np.random.default_rng(5)
    x, y, roll = rng.uniform(-0.3, 0.3, 4), rng.uniform(-0.3, 0.3, 4), rng.uniform(-3, 3, 4)
    moved = Twist(0.4, -0.2, 0.7)
    speeds = []
    for px, py, direction in zip(x, y, roll, strict=True):
        vx, vy = moved.vx - moved.omega * py, moved.vy + moved.omega * px
        speeds.append(vx * math.cos(direction) + vy * math.sin(direction))
    node = estimation.OmniTwist(x=x.tolist(), y=y.tolist(), direction=roll.tolist())
    assert fire(node, speeds=np.array(speeds)).outputs["twist"] == pytest.approx(moved)


def test_wheels_that_cannot_tell_or_do_not_match_are_refused() -> None:
    with pytest.raises(ValueError, match="got 3 x, 3 y, 3 directions and 2 speeds"):
        fire(estimation.OmniTwist(), speeds=np.zeros(2))
    with pytest.raises(ValueError, match="in these places and directions cannot tell a velocity"):
        fire(estimation.OmniTwist(direction=[0.0, 0.0, 0.0]), speeds=np.zeros(3))
    with pytest.raises(ValueError, match="a velocity consists of finite numbers"):
        fire(estimation.IntegrateTwist(), twist=Twist(math.nan, 0, 0))


def test_a_circle_of_odometry_ends_where_it_began() -> None:
    twists = [Twist(0.5, 0.0, 2 * math.pi / 10)] * 101
    poses: list[PoseInFrame] = ran(estimation.IntegrateTwist(), 10, twist=twists)["pose"]
    assert poses[-1].frame_id == "odom"
    assert poses[-1].stamp == pytest.approx(10.0)
    assert np.allclose(poses[-1].pose.matrix, np.eye(4), atol=1e-9)
    radius = 0.5 * 10 / (2 * math.pi)
    assert np.allclose(poses[50].pose.translation, [0, 2 * radius, 0], atol=1e-9)


def test_fusion_learns_the_bias_of_the_gyroscope_as_least_squares_do() -> None:
    """The bias is the mean of what the gyroscope says more than the wheels, weighed with what was known before."""
    rng = np.random.default_rng(6)
    omega, bias, count, turned = 0.4 * np.sin(np.arange(101) / 40), 0.04, 100, 10.0
    wheels = [Twist(0.5, 0.0, float(one)) for one in omega + rng.normal(0, 0.3, count + 1)]
    rates = [float(one) for one in omega + bias + rng.normal(0, 0.01, count + 1)]
    made = estimation.FuseGyro(turn_noise=0.3, gyro_noise=0.01, start_bias=0.05, bias_noise=0.0)
    found = ran(made, 10, twist=wheels, yaw_rate=rates)
    more = np.array(rates[1:]) - [one.omega for one in wheels[1:]]
    certain = count / 0.3**2 + 1 / 0.05**2
    learned = more.sum() / 0.3**2 / certain
    assert found["bias"][-1] == pytest.approx(learned)
    heading = 0.1 * sum(rates[1:]) - turned * learned
    assert math.remainder(found["pose"][-1].pose.angles[2] - heading, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert found["covariance"][-1][2, 2] == pytest.approx(turned**2 / certain + 0.01**2 * turned)
    true = 0.1 * omega[1:].sum()
    assert abs(math.remainder(heading - true, 2 * math.pi)) < abs(0.1 * sum(rates[1:]) - true)


def test_the_jacobian_of_the_fusion_is_its_derivative() -> None:
    node = estimation.FuseGyro(speed_noise=0.0, gyro_noise=0.0, bias_noise=0.0)
    state, twist = np.array([1.0, 2.0, 0.5, 0.02]), Twist(0.7, -0.2, 0.3)

    def moved(at: np.ndarray) -> np.ndarray:
        return np.asarray(node._moved(at, np.eye(4), twist, 0.3, 0.01)[0])

    jacobian = np.stack([(moved(state + 1e-6 * axis) - moved(state - 1e-6 * axis)) / 2e-6 for axis in np.eye(4)], 1)
    _, covariance = node._moved(state, np.eye(4), twist, 0.3, 0.01)
    assert np.allclose(covariance, jacobian @ jacobian.T, atol=1e-6)


# --- extended filters ---


def range_and_bearing(state: np.ndarray) -> np.ndarray:
    """What a landmark at 3, 4 looks like from x, y, heading."""
    off = np.array([3.0, 4.0]) - state[:2]
    return np.array([math.hypot(*off), math.remainder(math.atan2(off[1], off[0]) - state[2], 2 * math.pi)])


def unicycle(state: np.ndarray, control: np.ndarray, dt: float) -> np.ndarray:
    v, omega = control
    return state + dt * np.array([v * math.cos(state[2]), v * math.sin(state[2]), omega])


def by_hand(state: np.ndarray, control: np.ndarray, dt: float) -> np.ndarray:
    v, _ = control
    return np.array([[1, 0, -dt * v * math.sin(state[2])], [0, 1, dt * v * math.cos(state[2])], [0, 0, 1]])


def seen_by_hand(state: np.ndarray) -> np.ndarray:
    x, y = 3.0 - state[0], 4.0 - state[1]
    far = math.hypot(x, y)
    return np.array([[-x / far, -y / far, 0], [y / far**2, -x / far**2, -1]])


UNICYCLE: dict[str, Any] = {
    "motion": unicycle, "measurement": range_and_bearing, "start": [0.1, -0.1, 0.05], "start_sigma": [0.3, 0.3, 0.2],
    "process_noise": np.diag([0.01, 0.01, 0.02]).tolist(), "measurement_noise": np.diag([0.04, 0.01]).tolist(),
    "angles": [1],
}  # fmt: skip


def test_an_extended_filter_knows_the_jacobians_that_it_is_not_given() -> None:
    rng = np.random.default_rng(7)
    true, seen, told = np.zeros(3), [], []
    for _ in range(60):
        control = np.array([0.8, 0.4])
        seen.append(range_and_bearing(true) + rng.normal(0, 1, 2) * [0.2, 0.1])
        told.append(control)
        true = unicycle(true, control, 0.1)
    seen[20][:] = np.nan
    numeric = ran(estimation.ExtendedKalmanFilter(**UNICYCLE), 10, measured=seen, control=told)
    exact = ran(
        estimation.ExtendedKalmanFilter(**UNICYCLE, motion_jacobian=by_hand, measurement_jacobian=seen_by_hand),
        10, measured=seen, control=told,
    )  # fmt: skip
    assert np.allclose(numeric["state"], exact["state"], atol=1e-6)
    assert np.allclose(numeric["covariance"], exact["covariance"], atol=1e-6)
    # the same in information form, step by step
    state, covariance = np.array(UNICYCLE["start"]), np.diag(np.square(UNICYCLE["start_sigma"]))
    noise = np.diag([0.04, 0.01])
    for number, measured in enumerate(seen):
        if number:
            jacobian = by_hand(state, told[number], 0.1)
            covariance = jacobian @ covariance @ jacobian.T + 0.1 * np.diag([0.01, 0.01, 0.02])
            state = unicycle(state, told[number], 0.1)
        if not np.isnan(measured).any():
            look, off = seen_by_hand(state), measured - range_and_bearing(state)
            off[1] = math.remainder(off[1], 2 * math.pi)
            information = np.linalg.inv(covariance) + look.T @ np.linalg.inv(noise) @ look
            spread = look @ covariance @ look.T + noise
            assert exact["distance"][number] == pytest.approx(math.sqrt(off @ np.linalg.inv(spread) @ off))
            state = state + np.linalg.solve(information, look.T @ np.linalg.inv(noise) @ off)
            covariance = np.linalg.inv(information)
        else:
            assert math.isnan(exact["distance"][number])
        assert np.allclose(exact["state"][number], state)
        assert np.allclose(exact["covariance"][number], covariance)


def test_with_linear_models_an_extended_filter_is_a_kalman_filter() -> None:
    rng = np.random.default_rng(8)
    measured = [np.array([one]) for one in np.cumsum(rng.normal(0.3, 0.5, 12))]
    noise = np.array([[0.02, 0.01], [0.01, 0.04]])
    extended = ran(
        estimation.ExtendedKalmanFilter(
            process_noise=(2 * noise).tolist(), measurement_noise=[[0.25]], start=[0.0, 0.0], start_sigma=[10.0, 10.0]
        ),
        2, measured=measured,
    )  # fmt: skip
    state, covariance = np.zeros(2), np.eye(2) * 100
    for number, one in enumerate(measured):
        if number:
            state, covariance = estimation.predict(state, covariance, STEP, noise)
        state, covariance = estimation.correct(state, covariance, one, SEEN, NOISE)
        assert np.allclose(extended["state"][number], state)
        assert np.allclose(extended["covariance"][number], covariance)


def test_a_measurement_outside_of_the_gate_is_left_out() -> None:
    node = estimation.ExtendedKalmanFilter(start_sigma=[0.1] * 4, gate=3.0)
    done = fire(node, measured=np.array([5.0, 0.0])).outputs
    assert done["distance"] == pytest.approx(5.0 / math.sqrt(0.01 + 0.01))
    assert done["state"].tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"measurement": lambda state: state}, 'the function "measurement" returns 2 finite numbers, got 4: '),
        ({"measurement": lambda state: state[:2] * math.nan}, 'the function "measurement" returns 2 finite numbers'),
        (
            {"measurement_jacobian": lambda state: np.eye(2)},
            '"measurement_jacobian" returns 2 x 4 finite numbers, got 2 x 2',
        ),
        ({"start_sigma": [1.0]}, "each number of the state has a standard deviation, got 4 in start and 1"),
        ({"process_noise": [[1.0]]}, "got 1 rows for 4"),
        ({"measurement_noise": [[1.0, 2.0], [2.0, -9e9]]}, "the covariance of a measurement is singular or not finite"),
        ({"angles": [2]}, "angles are numbers of a measurement, from 0 to 1, got \\[2\\]"),
    ],
)
def test_what_does_not_fit_an_extended_filter_is_one_sentence(parameters: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fire(estimation.ExtendedKalmanFilter(**parameters), measured=np.zeros(2))


# --- clusters to tracks ---


def labelled(groups: Any, stamp: float = 0.0) -> PointCloud:
    points = np.concatenate([np.asarray(one, float) for _, one in groups])
    numbers = np.concatenate([np.full(len(one), number, np.int32) for number, one in groups])
    return PointCloud("map", stamp, points, {"cluster": numbers})


def test_clusters_become_detections_with_the_covariance_of_their_points() -> None:
    rng = np.random.default_rng(9)
    groups = [(1, rng.normal([2, 3, 0], [0.3, 0.1, 0.2], (50, 3))), (-1, rng.normal(0, 9, (5, 3)))]
    groups.append((0, rng.normal([5, -1, 0], [0.05, 0.2, 0.9], (30, 3))))
    cloud = labelled(groups)
    mixed = cloud.select(rng.permutation(len(cloud)))
    found = fire(estimation.cluster_detections(noise=0.1, share=0.5), labelled=mixed).outputs["out"]
    assert found.fields["cluster"].tolist() == [0, 1]
    assert found.fields["points"].tolist() == [30, 50]
    for row, points in enumerate([groups[2][1], groups[0][1]]):
        spread = 0.01 * np.eye(2) + 0.5 * np.cov(points[:, :2].T, bias=True)
        assert np.allclose(found.points[row], points[:, :2].mean(0))
        names = ("cov_xx", "cov_xy", "cov_yy")
        assert [found.fields[name][row] for name in names] == pytest.approx([spread[0, 0], spread[0, 1], spread[1, 1]])
    low = fire(estimation.cluster_detections(height=1.5), labelled=mixed).outputs["out"]
    assert low.fields["cluster"].tolist() == [1]
    none = fire(estimation.cluster_detections(), labelled=labelled([(-1, np.zeros((4, 2)))])).outputs["out"]
    assert len(none) == 0


def test_a_track_trusts_each_detection_as_much_as_its_covariance_says() -> None:
    sharp, vague = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    fields = {"cov_xx": np.array([0.0001]), "cov_xy": np.array([0.0]), "cov_yy": np.array([1e4])}
    node = estimation.TrackPoints(confirm=1, acceleration=0.0, fastest=0.0, gate=100.0)
    fire(node, detections=PointCloud("map", 0.0, np.array([[0.0, 0.0]])))
    (one,) = fire(node, detections=PointCloud("map", 0.1, sharp + vague, fields)).outputs["tracks"]
    assert one.x == pytest.approx(1.0, abs=0.02)
    assert one.y == pytest.approx(0.0, abs=0.02)


def test_people_are_tracked_from_clusters() -> None:
    """Two people walk past each other; what a laser sees of them changes from scan to scan."""
    rng = np.random.default_rng(10)
    node, numbers = estimation.TrackPoints(forget_s=0.5), set()
    for tick in range(40):
        t = tick / 10
        people = [np.array([t - 2, 0.4]), np.array([2 - t, -0.4])]
        groups = [(number, one + rng.normal(0, 0.12, (rng.integers(8, 30), 2))) for number, one in enumerate(people)]
        detections = fire(estimation.cluster_detections(), labelled=labelled(groups, t)).outputs["out"]
        tracks = fire(node, detections=detections).outputs["tracks"]
        numbers |= {track.number for track in tracks}
        if tick > 5:
            assert len(tracks) == 2
            for track in tracks:
                assert min(math.dist((track.x, track.y), one) for one in people) < 0.25
    assert numbers == {1, 2}


def test_a_cloud_without_clusters_and_a_singular_detection_are_refused() -> None:
    with pytest.raises(ValueError, match='has no field "cluster", but none; take the output "labelled" of'):
        fire(estimation.cluster_detections(), labelled=cloud([(1, 2)], 0.0))
    fields = {"cov_xx": np.array([1.0]), "cov_xy": np.array([1.0]), "cov_yy": np.array([1.0])}
    with pytest.raises(ValueError, match="the covariance of a measurement is singular or not finite"):
        fire(estimation.TrackPoints(), detections=PointCloud("map", 0.0, np.zeros((1, 2)), fields))

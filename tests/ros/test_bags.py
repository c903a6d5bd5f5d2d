"""Bags of ROS 2 are recordings: MCAP and SQLite, folders and files, whole and damaged."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hfg
from examples.fetch_delivery import messages
from examples.fetch_delivery.perception.localising import Localise, Localiser
from examples.fetch_delivery.perception.records import Localised
from examples.fetch_delivery.world import Simulation
from hfg.errors import UsageError
from hfg.geometry import LaserScan, Transform
from hfg.recording import File, export_bag, play_into, record
from hfg.ros import message
from hfg.testing import Recorder

rosbag2: Any = pytest.importorskip("rosbags.rosbag2", reason="rosbags is part of hfg[ros2]")

BEGIN_NS = 1_700_000_000_000_000_000
STORAGES = list(rosbag2.StoragePlugin)


def write(folder: Path, storage: Any, topics: dict[str, tuple[str, list[tuple[int, bytes]]]]) -> Path:
    """Write a bag: type, times and messages by topic."""
    with rosbag2.Writer(folder, version=9, storage_plugin=storage) as bag:
        rows = []
        for topic, (name, found) in topics.items():
            kind = message(name)
            connection = bag.add_connection(topic, name, msgdef=kind.text, rihs01=kind.hash)
            rows += [(when, number, connection, data) for number, (when, data) in enumerate(found)]
        for when, _, connection, data in sorted(rows, key=lambda row: row[:2]):
            bag.write(connection, when, data)
    return folder


def numbers(count: int = 5) -> dict[str, tuple[str, list[tuple[int, bytes]]]]:
    """Return a topic of numbers, ten in a second."""
    kind = message("std_msgs/msg/Int32")
    return {"/number": (kind.name, [(BEGIN_NS + one * 10**8, kind.encode(one)) for one in range(count)])}


@hfg.node
def camera() -> Iterator[int]:
    """Give a number that the recording replaces."""
    yield -1


@hfg.node
def take(value: int) -> None:
    """Take it."""


def played(file: Path) -> list[int]:
    """Return the numbers that a graph receives from a bag."""
    graph = hfg.Graph("robot")
    graph.add(camera()) >> graph.add(take())
    assert not play_into(graph, file, ports={"/number": "camera.out"}).is_damaged
    seen = Recorder()
    hfg.run(graph, clock="virtual", trace=seen)
    return [token.value for token in seen.tokens("camera.out -> take.value") if isinstance(token.value, int)]


@pytest.mark.parametrize("storage", STORAGES)
def test_a_bag_is_played_in_place_of_a_source_and_says_what_is_in_it(storage: Any, tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", storage, numbers())
    (file,) = (one for one in bag.iterdir() if one.suffix in (".mcap", ".db3"))
    for path in (bag, file):
        with File(path) as recording:
            info = recording.info()
        assert [(one.path, one.type, one.values) for one in info.ports] == [("/number", "std_msgs/msg/Int32", 5)]
        assert (info.whole, info.losses, info.duration_s) == (True, [], 0.4)
        assert played(path) == [0, 1, 2, 3, 4]


def test_several_files_of_a_bag_are_one_recording(tmp_path: Path) -> None:
    found = numbers(12)["/number"][1]
    for number, storage in enumerate((STORAGES[0], STORAGES[1], STORAGES[0])):
        part = write(tmp_path / f"{number}", storage, {"/number": ("std_msgs/msg/Int32", found[4 * number :][:4])})
        (file,) = (one for one in part.iterdir() if one.suffix in (".mcap", ".db3"))
        (tmp_path / "bag").mkdir(exist_ok=True)
        file.rename(tmp_path / "bag" / f"bag_{9 + number}{file.suffix}")
    assert played(tmp_path / "bag") == list(range(12))


@pytest.mark.rule("L4")
def test_a_database_that_is_damaged_gives_what_can_be_read_and_says_the_rest(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", rosbag2.StoragePlugin.SQLITE3, numbers(2000))
    (file,) = bag.glob("*.db3")
    with sqlite3.connect(file) as base:
        base.execute("UPDATE messages SET topic_id = 99 WHERE id = 7")
    data = bytearray(file.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 4096] = bytes(4096)
    file.write_bytes(data)
    with File(file) as recording:
        info = recording.info()
    assert 0 < info.messages < 2000
    assert "has no topic, time or data; 1 message lost" in str(info.losses[0])
    assert "cannot be read after" in str(info.losses[-1])


@pytest.mark.parametrize(
    ("prepare", "sentence"),
    [
        (lambda folder: (folder / "a.db3").write_bytes(b"SQLite format 3\0" + bytes(99)), "is not a bag of ROS 2"),
        (lambda folder: sqlite3.connect(folder / "a.db3").execute("CREATE VIEW messages AS SELECT 1"), "no tables"),
        (lambda folder: (folder / "a.mcap.zstd").write_bytes(b""), "unpack them first"),
        (lambda folder: [(folder / name).write_bytes(b"") for name in ("a.mcap", "b.mcap")], "belong to several"),
        (lambda folder: (folder / "a.txt").write_bytes(b""), "it has 0 files .mcap or .db3"),
    ],
)
def test_folders_that_are_not_bags_are_refused(prepare: Any, sentence: str, tmp_path: Path) -> None:
    prepare(tmp_path)
    with pytest.raises(UsageError, match=sentence):
        File(tmp_path)


@hfg.node
def laser(*, count: int = 5) -> Iterator[LaserScan]:
    """Give scans."""
    for one in range(count):
        yield LaserScan("laser", float(one), np.arange(4.0) + one, -1.0, 0.5)


@hfg.node
def nearest(scan: LaserScan) -> float:
    """Return how near anything is."""
    return float(scan.ranges.min())


@hfg.node
def pair(distance: float) -> tuple[int, float]:
    """Return values that ROS 2 does not have."""
    return 1, distance


@hfg.node
def take_pair(value: tuple[int, float]) -> None:
    """Take it."""


def test_a_recording_is_written_as_a_bag_that_says_the_same(tmp_path: Path) -> None:
    graph = hfg.Graph("robot")
    graph.add(laser(), max_rate_hz=10) >> graph.add(nearest()) >> graph.add(pair()) >> graph.add(take_pair())
    hfg.run(graph, clock="virtual", begin=lambda run: record(run, tmp_path / "run.mcap"))
    done = export_bag(tmp_path / "run.mcap", tmp_path / "bag")
    assert (done.written, done.left_out) == ({"/laser/out": 5, "/nearest/out": 5}, {"pair.out": 5})
    assert done.why["pair.out"].startswith("ROS 2 has no message for values of tuple")
    with rosbag2.Reader(tmp_path / "bag") as bag:
        found = [(one.topic, when, one.msgtype, bytes(data)) for one, when, data in bag.messages()]
    scans = [(when, message(name).decode(data)) for topic, when, name, data in found if topic == "/laser/out"]
    assert [(when, scan.ranges[0]) for when, scan in scans] == [(one * 10**8, one) for one in range(5)]
    again = export_bag(tmp_path / "bag", tmp_path / "again")
    assert (again.written, again.left_out) == (done.written, {})
    with pytest.raises(UsageError, match="cannot write the bag"):
        export_bag(tmp_path / "run.mcap", tmp_path / "bag")


# --- the delivery robot ---


@hfg.node
def as_scan(scan: LaserScan) -> messages.Scan:
    """Bring a scan into the robot's form."""
    return messages.Scan(scan.ranges, scan.angles, scan.stamp, scan.max_range)


@hfg.node
def as_odometry(value: Any) -> messages.Odometry:
    """Bring odometry into the robot's form."""
    at, turn = value.pose.pose.position, value.pose.pose.orientation
    yaw = Transform(np.array([at.x, at.y, at.z]), np.array([turn.x, turn.y, turn.z, turn.w])).angles[2]
    speed = value.twist.twist
    twist = np.array([speed.linear.x, speed.linear.y, speed.angular.z])
    stamp = value.header.stamp
    return messages.Odometry(np.array([at.x, at.y, yaw]), twist, stamp.sec + stamp.nanosec / 1e9)


@hfg.node
def size_of(image: np.ndarray[Any, Any]) -> tuple[int, ...]:
    """Return the size of a picture."""
    shape: tuple[int, ...] = image.shape
    return shape


@hfg.node
def keep(localised: Localised) -> None:
    """Take where the robot is."""


def drive(folder: Path) -> tuple[Path, list[tuple[messages.Scan, messages.Odometry]]]:
    """Write what a robot measures that drives along a curve for two seconds; return its scans and odometry, too."""
    world = Simulation(seed=3)
    scan, odometry, image = (message(f"{name}") for name in TYPES)
    measured = []
    found: dict[str, list[tuple[int, bytes]]] = {"/scan": [], "/odom": [], "/image": []}
    for _ in range(20):
        world.command(0, messages.Twist(0.3, 0.0, 0.4))
        world.step(0.1)
        seen, where = world.scan(0), world.odometry(0)
        measured.append((seen, where))
        step = float(seen.angles[1] - seen.angles[0])
        beams = LaserScan("laser", seen.stamp, seen.ranges, float(seen.angles[0]), step, 0.0, seen.max_range)
        pose = Transform.of(where.pose[0], where.pose[1], yaw=where.pose[2])
        x, y, z, w = pose.rotation.tolist()
        speed = {"linear": {"x": where.twist[0], "y": where.twist[1]}, "angular": {"z": where.twist[2]}}
        at = {"position": {"x": where.pose[0], "y": where.pose[1]}, "orientation": {"x": x, "y": y, "z": z, "w": w}}
        stamp = {"sec": int(where.stamp), "nanosec": round(where.stamp % 1 * 1e9)}
        told = {"header": {"stamp": stamp}, "pose": {"pose": at}, "twist": {"twist": speed}}
        when = round(seen.stamp * 1e9)
        found["/scan"].append((when, scan.encode(beams)))
        found["/odom"].append((when, odometry.encode(told)))
        found["/image"].append((when, image.encode(world.front_picture(0), stamp=seen.stamp)))
    topics = {topic: (name, found[topic]) for topic, name in zip(found, TYPES, strict=True)}
    return write(folder, rosbag2.StoragePlugin.MCAP, topics), measured


TYPES = ("sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "sensor_msgs/msg/Image")


def test_the_delivery_robot_finds_its_way_by_a_bag(tmp_path: Path) -> None:
    bag, measured = drive(tmp_path / "bag")
    graph = hfg.Graph("robot")
    scan, odometry, localise = graph.add(as_scan()), graph.add(as_odometry()), graph.add(Localise())
    scan >> localise.scan
    odometry >> localise.odometry
    localise.localised >> graph.add(keep())
    graph.add(size_of())
    inputs = {"/scan": "as_scan.scan", "/odom": "as_odometry.value", "/image": "size_of.image"}
    play_into(graph, bag, ports=inputs)
    seen = Recorder()
    report = hfg.run(graph, clock="virtual", trace=seen)
    assert not report.errors
    assert [report.nodes[name].processed for name in ("as_scan", "localise", "size_of")] == [20, 20, 20]
    robot = Localiser()
    expected = [one for one in (robot.update(*both) for both in measured) if one is not None]
    found = [one.value for one in seen.tokens("localise.localised -> keep.localised") if type(one.value) is Localised]
    assert len(found) == len(expected) > 10
    for one, other in zip(found, expected, strict=True):
        assert one.sure == other.sure
        np.testing.assert_allclose(one.pose, other.pose, atol=0.01)  # ranges are float32 in ROS 2

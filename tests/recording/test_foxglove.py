"""Values of robots in a recording: Foxglove's fields, as its schemas say, and beside them the exact value."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader

import hfg
from hfg.base.values import Colour
from hfg.geometry import (
    FrameTransform,
    Grid,
    Label,
    LaserScan,
    Line,
    PointCloud,
    PoseInFrame,
    Scene,
    Solid,
    Transform,
)

POSE = Transform.of(1, 2, 3, 0.1, 0.2, 0.3)
SCAN = LaserScan("laser", 1.25, np.array([1.0, np.inf, 2.0, np.nan]), -0.5, 0.25)
CLOUD = PointCloud("laser", 1.25, np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 1 / 3]]), {"ring": np.array([3, 9], np.int32)})
GRID = Grid("map", 1.25, POSE, 0.5, np.array([[1, 2, 3], [4, 5, 6]], np.int8))
LINK = FrameTransform("map", "base", POSE, 1.25)
SCENE = Scene(
    "map",
    1.25,
    [Solid(kind, POSE, np.array([1.0, 2.0, 3.0]), Colour(255, 51, 0), 0.5) for kind in ("box", "ball", "cylinder")],
    [Line(np.array([[0.0, 1.0], [2.0, 3.0]]), width=0.1)],
    [Label("7", np.array([1.0, 2.0, 3.0]))],
    lifetime_s=1.5,
)


@hfg.node
def scans() -> Iterator[LaserScan]:
    yield SCAN


@hfg.node
def clouds() -> Iterator[PointCloud]:
    yield CLOUD


@hfg.node
def grids() -> Iterator[Grid]:
    yield GRID


@hfg.node
def poses() -> Iterator[PoseInFrame]:
    yield PoseInFrame("map", 1.25, POSE)


@hfg.node
def links() -> Iterator[list[FrameTransform]]:
    yield [LINK]


@hfg.node
def scenes() -> Iterator[Scene]:
    yield SCENE


@hfg.node
def wrong() -> Iterator[PointCloud]:
    yield GRID  # type: ignore[misc]


def recorded(source: Any, file: Path) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """Record one value. Return the name of its schema, the schema, and the message."""
    graph = hfg.Graph()
    graph.connect(graph.add(source, name="source").out, graph.output("out", Any))
    hfg.run(graph, clock="virtual", begin=lambda run: run.record(file, force=True))
    with file.open("rb") as stream:
        ((schema, _, message),) = make_reader(stream).iter_messages(topics=["source.out"])
    assert schema is not None
    return schema.name, json.loads(schema.data), json.loads(message.data)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (scans, "foxglove.LaserScan"),
        (clouds, "foxglove.PointCloud"),
        (grids, "foxglove.Grid"),
        (poses, "foxglove.PoseInFrame"),
        (links, "foxglove.FrameTransforms"),
        (scenes, "foxglove.SceneUpdate"),
    ],
)
def test_messages_have_the_schema_of_foxglove_and_are_played_as_they_were(tmp_path: Path, make: Any, name: str) -> None:
    said, schema, message = recorded(make(), tmp_path / "run.mcap")
    assert said == schema["title"] == name
    jsonschema.validate(message, schema)
    inside = {links: "transforms", scenes: "entities"}.get(make)
    header = message if inside is None else message[inside][0]
    assert header["timestamp"] == {"sec": 1, "nsec": 250_000_000}
    graph = hfg.Graph()
    graph.connect(graph.add(make(), name="source").out, graph.output("out", Any))
    hfg.recording.play_into(graph, tmp_path / "run.mcap")
    (value,) = hfg.run(graph, clock="virtual").outputs["out"]
    expected: dict[Any, Any] = {scans: SCAN, clouds: CLOUD, grids: GRID, links: [LINK], scenes: SCENE}
    assert value == expected.get(make, PoseInFrame("map", 1.25, POSE))


def unpacked(message: dict[str, Any], stride: str) -> np.ndarray:
    """Read packed elements by their fields alone, as Foxglove does."""
    kinds = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}
    fields = message["fields"]
    dtype = np.dtype(
        {
            "names": [one["name"] for one in fields],
            "formats": [kinds[one["type"]] for one in fields],
            "offsets": [one["offset"] for one in fields],
            "itemsize": message[stride],
        }
    )
    return np.frombuffer(base64.b64decode(message["data"]), dtype)


def test_clouds_grids_and_scans_are_where_foxglove_looks_for_them(tmp_path: Path) -> None:
    points = unpacked(recorded(clouds(), tmp_path / "run.mcap")[2], "point_stride")
    assert points.dtype.names == ("x", "y", "z", "ring")
    assert points["ring"].tolist() == [3, 9]
    assert np.allclose([points[axis] for axis in "xyz"], CLOUD.points.T)

    grid = recorded(grids(), tmp_path / "run.mcap")[2]
    cells = unpacked(grid, "cell_stride")["value"].reshape(-1, grid["column_count"])  # rows along y, as Foxglove says
    assert cells.T.tolist() == GRID.values.tolist()
    assert grid["row_stride"] == 2
    assert grid["pose"]["orientation"]["w"] == POSE.rotation[3]

    scan = recorded(scans(), tmp_path / "run.mcap")[2]
    assert (scan["start_angle"], scan["end_angle"], scan["ranges"]) == (-0.5, 0.25, [1.0, 0.0, 2.0, 0.0])


def test_a_value_of_another_type_than_its_port_is_kept_though_foxglove_cannot_show_it(tmp_path: Path) -> None:
    message = recorded(wrong(), tmp_path / "run.mcap")[2]
    assert "data" not in message
    assert message["value"]["class"] == "hfg.geometry.records:Grid"


def test_a_scene_is_one_entity_of_foxglove_with_its_things(tmp_path: Path) -> None:
    """The fields are those of foxglove.SceneEntity and its primitives, from Foxglove's documentation."""
    message = recorded(scenes(), tmp_path / "run.mcap")[2]
    (entity,) = message["entities"]
    assert (entity["frame_id"], entity["lifetime"]) == ("map", {"sec": 1, "nsec": 500_000_000})
    for name in ("cubes", "spheres", "cylinders"):
        (one,) = entity[name]
        assert one["size"] == {"x": 1.0, "y": 2.0, "z": 3.0}
        assert one["color"] == {"r": 1.0, "g": 0.2, "b": 0.0, "a": 0.5}
        assert one["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    (line,), (text,) = entity["lines"], entity["texts"]
    assert (line["type"], line["thickness"]) == (0, 0.1)
    assert line["points"] == [{"x": 0.0, "y": 1.0, "z": 0.0}, {"x": 2.0, "y": 3.0, "z": 0.0}]
    assert (text["text"], text["billboard"], text["font_size"]) == ("7", True, 0.2)

"""RerunLog: what Rerun's own tools read in the file it writes, and what it refuses."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from socket import create_server
from typing import Any

import numpy as np
import pytest

import hfg
from hfg.geometry import FrameTransform, LaserScan, PointCloud, PoseInFrame, Transform
from hfg.nodes.rerun import RerunLog

POSE = Transform.of(1, 2, 3)
VALUES = {
    "robot/camera": np.zeros((4, 6, 3), np.uint8),
    "depth": np.ones((4, 6), np.float32),
    "laser": LaserScan("laser", 0.0, np.array([1.0, 2.0, np.inf, 1.0]), 0.0, 0.5),
    "lidar": PointCloud("laser", 0.0, np.array([[1.0, 2.0], [3.0, 4.0]])),
    "tree": [FrameTransform("map", "base", POSE, 0.0)],
    "pose": PoseInFrame("map", 0.0, POSE),
    "path": np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]]),
    "number": 2.5,
    "words": "off we go",
}
SHOWN = {
    "/robot/camera": "Image:buffer",
    "/depth": "DepthImage:buffer",
    "/laser": "LineStrips3D:strips",
    "/lidar": "Points3D:positions",
    "/tree/base": "Transform3D:child_frame",
    "/pose": "Transform3D:parent_frame",
    "/path": "LineStrips3D:strips",
    "/number": "Scalars:scalars",
    "/words": "TextLog:text",
}


def once(value: Any) -> hfg.Node:
    """A source that sends a value once."""

    @hfg.node
    def source() -> Iterator[Any]:
        yield value

    return source()


def build(values: dict[str, Any] = VALUES, **parameters: Any) -> hfg.Graph:
    graph = hfg.Graph("robot")
    log: Any = graph.add(RerunLog(values=len(values), entities=list(values), **parameters), name="log")
    for number, value in enumerate(values.values()):
        source: Any = graph.add(once(value=value), name=f"source_{number}")
        graph.connect(source.out, log.values[number])
    return graph


@pytest.mark.slow
def test_rerun_reads_what_was_logged_with_the_time_of_the_run(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'hfg[rerun]'")
    file = tmp_path / "run.rrd"
    assert hfg.run(build(file=file), clock="virtual").outcome == "done"
    rerun = [sys.executable, "-m", "rerun", "rrd"]
    subprocess.run([*rerun, "verify", file], check=True, capture_output=True)
    said = subprocess.run([*rerun, "print", "-vvv", file], check=True, capture_output=True, text=True).stdout
    found = {match[1]: chunk for chunk in said.split("Chunk(") if (match := re.search(r"entity_path: (\S+)", chunk))}
    for entity, component in SHOWN.items():
        assert component in found[entity], entity
        assert "1970-01-01" in found[entity]  # virtual time begins at 0
    assert "2.5" in found["/number"]
    assert "off we go" in found["/words"]


def test_nothing_is_encoded_without_a_file_and_a_viewer(caplog: Any) -> None:
    with closing(create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    assert hfg.run(build(viewer=f"rerun+http://127.0.0.1:{port}/proxy"), clock="virtual").outcome == "done"
    assert "no viewer listens" in caplog.text


@pytest.mark.parametrize(
    "viewer", ["rerun+http://10.0.0.7:9876/proxy", "rerun+http://[::1/proxy", "9876", "http://127.0.0.1"]
)
def test_an_address_of_another_computer_is_refused(viewer: str) -> None:
    with pytest.raises(hfg.errors.NodeError, match="must be an address of this computer"):
        hfg.run(build(viewer=viewer), clock="virtual")


def test_a_value_that_rerun_cannot_show_is_named(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'hfg[rerun]'")
    with pytest.raises(hfg.errors.NodeError, match="Rerun shows a number, a text"):
        hfg.run(build({"strange": {"a": 1}}, file=tmp_path / "run.rrd"), clock="virtual")

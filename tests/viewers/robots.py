"""A small robot: an image, a scan, a cloud, frames and a number, a node that becomes active, and a line in the log."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import hfg
from hfg.geometry import FrameTransform, LaserScan, PointCloud, Transform
from hfg.images import Color

PICTURE = np.arange(480 * 640 * 3, dtype=np.uint32).astype(np.uint8).reshape(480, 640, 3)
RANGES = np.array([1.0, np.inf, 2.0])
POINTS = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


@hfg.node
def images() -> Iterator[Color]:
    while True:
        yield PICTURE


@hfg.node
def scans() -> Iterator[LaserScan]:
    while True:
        yield LaserScan("laser", hfg.now(), RANGES, -0.5, 0.5)


@hfg.node
def clouds() -> Iterator[PointCloud]:
    while True:
        yield PointCloud("laser", hfg.now(), POINTS, {})


@hfg.node
def frames() -> Iterator[list[FrameTransform]]:
    while True:
        yield [FrameTransform("map", "base", Transform.of(1, 2, 3), hfg.now())]


@hfg.node
def counts() -> Iterator[float]:
    number = 0.0
    while True:
        number += 1.0
        yield number


@hfg.node
def half(value: float) -> float:
    return value / 2


@hfg.node
def sink(value: Any) -> None:
    """Take anything."""


class Drive(hfg.Node):
    """Becomes active, and says so."""

    @hfg.slot
    def begin(self) -> None:
        self.log.warning("off we go")


def robot(rate_hz: float = 20.0) -> hfg.Graph:
    graph = hfg.Graph("robot")
    for name, make in (("camera", images), ("laser", scans), ("lidar", clouds), ("tree", frames)):
        source: Any = graph.add(make(), name=name, max_rate_hz=rate_hz)
        graph.connect(source.out, graph.add(sink(), name=f"{name}_sink").value)
    number = graph.add(counts(), name="number", max_rate_hz=rate_hz)
    halves = graph.add(half(), name="half")
    graph.connect(number.out, halves.value)
    graph.connect(halves.out, graph.add(sink(), name="end").value)
    graph.start.activates(graph.add(Drive(), name="drive").begin)
    return graph

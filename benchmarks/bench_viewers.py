"""Live images for Foxglove: 640 x 480 pixels, 30 per second, one viewer; the processor time per image.

Measured: all threads of the process that makes and sends the images, over the same number of images; the viewer is in
  the process that measures. Both send `foxglove.RawImage`, hfg as JSON, Foxglove's own server as protobuf.
Not measured: an application that draws the images.
"""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

import hfg
from benchmarks.goals import Goal, Side
from benchmarks.measure import Case
from hfg.images import Color

DISTRIBUTIONS = ("hfg", "foxglove-sdk", "websockets")
RUNS = 5
IMAGES = 150
RATE_HZ = 30.0
WARM_UP = 15
HEIGHT, WIDTH = 480, 640


def _pixels() -> np.ndarray[Any, Any]:
    return np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)


@hfg.node
def images() -> Iterator[Color]:
    """Give one image again and again."""
    pixels = _pixels()
    while True:
        yield pixels


@hfg.node
def sink(image: Color) -> None:
    """Take it."""


def _hfg(pipe: Connection) -> None:
    graph = hfg.Graph("images")
    graph.connect(graph.add(images(), max_rate_hz=RATE_HZ).out, graph.add(sink()).image)

    def begin(run: hfg.Run) -> None:
        pipe.send(run.foxglove().address)
        asyncio.get_running_loop().add_reader(pipe.fileno(), run.stop)

    hfg.run(graph, begin=begin)


def _sdk(pipe: Connection) -> None:
    import foxglove
    from foxglove.channels import RawImageChannel
    from foxglove.messages import RawImage, Timestamp

    server = foxglove.start_server(port=0)
    channel = RawImageChannel("/images.out")
    pipe.send(f"ws://127.0.0.1:{server.port}")
    pixels, due = _pixels(), time.monotonic()
    while not pipe.poll(max(0.0, due - time.monotonic())):
        stamp = Timestamp.from_epoch_secs(time.time())
        channel.log(
            RawImage(
                timestamp=stamp,
                frame_id="",
                width=WIDTH,
                height=HEIGHT,
                encoding="bgr8",
                step=3 * WIDTH,
                data=pixels.tobytes(),
            )
        )
        due += 1 / RATE_HZ
    server.stop()


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def per_image(serve: Callable[[Connection], None], count: int) -> dict[str, float]:
    """Look at images from a server; return its processor time for each, in ms, and their rate."""
    from websockets.sync.client import connect

    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(target=serve, args=(theirs,))
    process.start()
    with connect(ours.recv(), subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:  # type: ignore[list-item]
        while True:
            said = viewer.recv()
            if isinstance(said, str) and (known := json.loads(said)).get("op") == "advertise":
                break
        number = next(one["id"] for one in known["channels"] if one["schemaName"] == "foxglove.RawImage")
        viewer.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": number}]}))
        messages = (one for one in iter(viewer.recv, None) if isinstance(one, bytes) and one[0] == 1)
        for _ in range(WARM_UP):
            next(messages)
        assert process.pid is not None
        cpu, began = _cpu_s(process.pid), time.monotonic()
        for _ in range(count):
            next(messages)
        cpu, took = _cpu_s(process.pid) - cpu, time.monotonic() - began
    ours.send("end")
    process.join()
    return {"cpu": cpu * 1000 / count, "rate_hz": count / took}


CASES = {"hfg": Case(partial(per_image, _hfg), IMAGES, "ms")}
GOALS = [Goal("processor time per image, hfg / foxglove-sdk", Side("hfg"), Side("foxglove-sdk"), 1.2)]
SHOWS_CASES = True
SKIPPED: dict[str, str] = {}
if find_spec("foxglove") is None:
    SKIPPED["foxglove-sdk"] = "foxglove-sdk is not installed"
else:
    CASES["foxglove-sdk"] = Case(partial(per_image, _sdk), IMAGES, "ms")
MISSING = sorted(SKIPPED.values())

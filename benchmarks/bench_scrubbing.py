"""Scrubbing a recording of about 1 GB in the studio: places by chance, with everything that a page shows there.

Generated once: a camera of 640 x 480 at 15 Hz (each picture is noise, which does not shrink), ten numbers at 200 Hz,
and a mission whose activity moves twice per second. Measured: how long it takes to open the file and to read it once,
and per place from moving the cursor to the last byte of the last frame: activity, five values, a picture, a plot and
the timeline. `cpu` is processor time, which a busy machine changes less. `more_mb` is how much more memory the process
held at its peak than before.
`python -m benchmarks.bench_scrubbing --file /tmp/large.mcap`
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import resource
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import hfg
from hfg.images import Color
from hfg.recording import record
from hfg.studio.messages import read
from hfg.studio.project import RecordedProject
from hfg.studio.recorded import Recorded
from hfg.studio.replaying import Replay
from hfg.studio.studio import Studio
from hfg.studio.viewing import Frame

SECONDS = 60.0
PLACES = 100
LENGTH = 10


@hfg.node
def camera() -> Iterator[Color]:
    """Give pictures of noise."""
    random_ = np.random.default_rng(0)
    while True:
        yield random_.integers(0, 256, (480, 640, 3), np.uint8)


@hfg.node
def numbers() -> Iterator[float]:
    """Give numbers that do not shrink either."""
    random_ = np.random.default_rng(1)
    while True:
        yield float(random_.random())


@hfg.node
def passes(value: float) -> float:
    """Pass on."""
    return value


@hfg.node
def look(image: Color) -> None:
    """Take a picture."""


@hfg.node
def sink(value: float) -> None:
    """Take a number."""


class Walk(hfg.Node):
    """Be active for half a second, then hand on."""

    done = hfg.Event()

    @hfg.slot
    async def begin(self) -> None:
        """Walk."""
        await asyncio.sleep(0.5)
        self.done.trigger()


def robot() -> hfg.Graph:
    """A camera, a chain of functions, and a mission of two states."""
    graph = hfg.Graph("robot")
    graph.add(camera(), max_rate_hz=15) >> graph.add(look())
    port: Any = graph.add(numbers(), max_rate_hz=200).out
    for number in range(LENGTH - 1):
        node = graph.add(passes(), name=f"step_{number}")
        graph.connect(port, node.ports.inputs["value"])
        port = node.ports.outputs["out"]
    graph.connect(port, graph.add(sink()).ports.inputs["value"])
    there, back = graph.add(Walk(), name="there"), graph.add(Walk(), name="back")
    graph.start.activates(there.begin)
    there.done.activates(back.begin)
    back.done.activates(there.begin)
    return graph


def generate(file: Path, seconds: float) -> None:
    """Record a run in virtual time."""

    def begin(run: hfg.Run) -> None:
        record(run, file)

    hfg.run(robot(), clock="virtual", until_s=seconds, begin=begin)


class Outbox:
    """A page that paints at once, and counts bytes."""

    def __init__(self) -> None:
        self.frames = 0
        self.bytes = 0

    def put(self, frame: Frame) -> None:
        data = frame.data() if callable(frame.data) else frame.data
        self.frames += 1
        self.bytes += len(data)

    def close(self, code: int, reason: str) -> None:
        assert code == 1001, reason


SHOWN: list[tuple[str, dict[str, Any]]] = [
    ("activity", {}),
    ("image", {"path": "camera.out", "size": 640}),
    ("value", {"path": "camera.out"}),
    *(("value", {"path": f"step_{number}.out"}) for number in range(4)),
    ("history", {"path": "step_0.out"}),
    ("timeline", {"begin": 0.0, "end": SECONDS}),
]


async def scrub(file: Path, places: int) -> dict[str, float]:
    """Open the recording, wait until it was read once, and move the cursor to places by chance."""
    before, began = _memory(), time.perf_counter()
    recorded = Recorded(file)
    studio = Studio(RecordedProject(recorded.graph_after(0), file), recorded=recorded)
    replay = studio.steering
    assert isinstance(replay, Replay)
    found = {"opened_ms": 1e3 * (time.perf_counter() - began)}
    outbox = Outbox()
    viewer = studio.enter(outbox)
    studio.receive(viewer, read(b'{"t":"join"}'))
    await replay.read()
    found["read_s"] = time.perf_counter() - began
    for sub, (topic, args) in enumerate(SHOWN, 1):
        message = {"t": "sub", "sub": sub, "topic": topic, "hz": 60, "args": args}
        studio.receive(viewer, read(json.dumps(message).encode()))
    chance, took, worked = random.Random(0), [], []
    for _ in range(places):
        at = chance.uniform(0.0, replay.seconds(recorded.last))
        for subscription in viewer.subscriptions.values():
            subscription.painted(2**32)
        start, work = time.perf_counter(), time.thread_time()
        replay.seek(at)
        took.append(1e3 * (time.perf_counter() - start))
        worked.append(1e3 * (time.thread_time() - work))
    found |= {
        "p50_ms": statistics.median(took),
        "p95_ms": statistics.quantiles(took, n=20)[-1],
        "most_ms": max(took),
        "p50_cpu_ms": statistics.median(worked),
        "p95_cpu_ms": statistics.quantiles(worked, n=20)[-1],
        "more_mb": _memory() - before,
        "kb_a_place": outbox.bytes / places / 1e3,
    }
    await studio.close()
    return found


def _memory() -> float:
    """The most memory that the process has held so far, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> None:
    """Print one line per figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--file", type=Path, help="where the recording is kept; it is made if it is not there")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of the recording; 60 s are 1 GB")
    parser.add_argument("--places", type=int, default=PLACES)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = chosen.file or Path(folder) / "large.mcap"
        if not file.exists():
            generate(file, chosen.seconds)
        print(f"{'size_mb':12} {file.stat().st_size / 1e6:10.1f}")
        for name, value in asyncio.run(scrub(file, chosen.places)).items():
            print(f"{name:12} {value:10.1f}")


if __name__ == "__main__":
    main()

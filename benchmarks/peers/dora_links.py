"""dora: two nodes of a dataflow, each a process, under `dora run`; arrays go through the shared memory of Zenoh.

A queue that is full drops its oldest: nothing makes a node wait, so what is lost is counted. The first second is not:
dora loses and delays more while its nodes find each other.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.measure import ROOT
from benchmarks.parcels import Job, Post, letter, opened, picture

__all__ = ["command", "nodes"]

POOL = 128
"""Megabytes; as it comes a node has 8, which is one picture."""
WARM_UP_S = 1.0
LONGEST_S = 120


def command() -> str | None:
    """Return the runtime, which is a program of its own."""
    return shutil.which("dora", path=str(Path(sys.executable).parent)) or shutil.which("dora")


def nodes(job: Job) -> dict[str, float]:
    """Have the dataflow run, and read what its sink has noted."""
    found = command()
    if found is None:
        raise RuntimeError("dora has no runtime here: pip install dora-rs-cli")
    with tempfile.TemporaryDirectory(prefix="dora-") as folder:
        report = Path(folder) / "figures.json"
        given = json.dumps(job._asdict())
        arguments = [f"-m benchmarks.peers.dora_links {role} {report} '{given}'" for role in ("source", "sink")]
        python = {"path": sys.executable, "env": {"PYTHONPATH": str(ROOT)}, "shared_memory_pool_size": f"{POOL}MB"}
        flow = {
            "nodes": [
                {"id": "source", "args": arguments[0], "outputs": ["out"], **python},
                {
                    "id": "sink",
                    "args": arguments[1],
                    "inputs": {"in": {"source": "source/out", "queue_size": 1 if job.leaky else 100_000}},
                    **python,
                },
            ]
        }
        file = Path(folder) / "dataflow.yml"
        file.write_text(json.dumps(flow), encoding="utf-8")  # which is YAML too
        done = subprocess.run(
            [found, "run", str(file)], cwd=folder, capture_output=True, text=True, timeout=LONGEST_S, check=False
        )
        if not report.exists():
            raise RuntimeError(f"dora has run, and nothing has arrived:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
        figures: dict[str, float] = json.loads(report.read_text(encoding="utf-8"))
    if "error" in figures:
        raise RuntimeError(str(figures["error"]))
    return figures


def send(job: Job) -> None:
    """Send: a node."""
    import numpy as np
    import pyarrow
    from dora import Node

    node = Node()
    value = pyarrow.array(picture().reshape(-1)) if job.what == "picture" else None

    def give(number: int) -> None:
        written = letter(number)
        if value is None:
            node.send_output("out", pyarrow.array(np.frombuffer(written, np.uint8)))
        else:
            node.send_output("out", value, {"letter": written.hex()})

    stop = time.monotonic() + WARM_UP_S
    while time.monotonic() < stop:
        give(-1)
        time.sleep(0.01)
    for number in job.numbers():
        give(number)
    time.sleep(0.5)


def receive(job: Job) -> dict[str, Any]:
    """Receive: a node."""
    from dora import Node

    from benchmarks.parcels import SHAPE

    post = Post(job._replace(leaky=True))  # it may lose, whatever was asked for
    node = Node()
    for event in node:
        if event["type"] == "INPUT":
            value = event["value"].to_numpy(zero_copy_only=True)
            if job.what == "letter":
                post.take_letter(value)
            else:
                post.take_picture(*opened(bytes.fromhex(event["metadata"]["letter"])), value.reshape(SHAPE))
        elif event["type"] in ("STOP", "INPUT_CLOSED"):
            break
    try:
        return post.figures()
    except RuntimeError as error:
        return {"error": str(error)}


if __name__ == "__main__":
    role, path, told = sys.argv[1:]
    asked = Job(**json.loads(told))
    if role == "source":
        send(asked)
    else:
        Path(path).write_text(json.dumps(receive(asked)), encoding="utf-8")

"""Zenoh as it comes, between two processes: a publisher that puts, a subscriber with a callback.

What has to arrive is put with `BLOCK`, which waits while the network has no room, and what may be lost with `DROP`;
what is lost is counted. An express put leaves at once, others share batches.
"""

from __future__ import annotations

import asyncio
import json
import socket
import sys
import threading
import time
from typing import Any

import numpy as np
import zenoh

from benchmarks.crossing import POOL, begin
from benchmarks.parcels import SHAPE, Job, Post, letter, opened, picture_bytes

__all__ = ["puts"]

KEY = "benchmark/parcels"
SILENCE_S = 0.5
LONGEST_S = 120


def session(mode: str, address: str, shared: bool) -> Any:
    """Open one of two sessions that know of each other and of nobody else."""
    config = zenoh.Config()
    told = {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "listen/endpoints": [address] if mode == "listen" else [],
        "connect/endpoints": [address] if mode == "connect" else [],
        "transport/shared_memory/enabled": shared,
    }
    if shared:
        told["transport/shared_memory/transport_optimization/pool_size"] = POOL
    for key, value in told.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def puts(job: Job, *, express: bool = True, shared: bool = False, into_asyncio: bool = False) -> dict[str, float]:
    """Receive: this process.

    Args:
      job: what is to be sent.
      express: each put leaves at once.
      shared: through shared memory where Zenoh finds it worth while, as it does by itself.
      into_asyncio: to an event loop, woken once for all that has come; else to a thread of Zenoh.
    """
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        address = f"tcp/127.0.0.1:{found.getsockname()[1]}"
    post = Post(job)
    over = threading.Event()
    last = time.monotonic()

    def take(sample: Any) -> None:
        nonlocal last
        last = time.monotonic()
        value = sample.payload.to_bytes()
        if job.what == "letter":
            post.take_letter(value)
        else:
            picture = np.frombuffer(value, np.uint8).reshape(SHAPE)
            post.take_picture(*opened(sample.attachment.to_bytes()), picture)
        if post.is_over:
            over.set()

    here = session("listen", address, shared)
    process = begin("puts", {"job": job._asdict(), "address": address, "express": express, "shared": shared}, __name__)

    def wait() -> None:
        stop = time.monotonic() + LONGEST_S
        while time.monotonic() < stop and not over.wait(0.1):
            if process.poll() is not None and time.monotonic() - last > SILENCE_S:
                return

    if into_asyncio:
        asyncio.run(on_a_loop(here, take, wait))
    else:
        here.declare_subscriber(KEY, take)
        wait()
    process.kill()
    process.wait()
    here.close()
    return post.figures()


async def on_a_loop(here: Any, take: Any, wait: Any) -> None:
    """Take on the event loop, which is woken once for a burst."""
    from collections import deque

    loop = asyncio.get_running_loop()
    waiting: deque[Any] = deque()
    rung = False

    def look() -> None:
        nonlocal rung
        rung = False
        while waiting:
            take(waiting.popleft())

    def leave(sample: Any) -> None:
        nonlocal rung
        waiting.append(sample)
        if not rung:
            rung = True
            loop.call_soon_threadsafe(look)

    here.declare_subscriber(KEY, leave)
    await asyncio.to_thread(wait)


def put(job: Job, address: str, express: bool, shared: bool) -> None:
    """Send: the other process."""
    there = session("connect", address, shared)
    control = zenoh.CongestionControl.DROP if job.leaky else zenoh.CongestionControl.BLOCK
    publisher = there.declare_publisher(KEY, congestion_control=control, express=express)
    while not publisher.matching_status.matching:
        time.sleep(0.01)
    for number in job.numbers():
        if job.what == "letter":
            publisher.put(letter(number))
        else:
            publisher.put(picture_bytes(), attachment=letter(number))
    time.sleep(SILENCE_S)
    there.close()


if __name__ == "__main__":
    given = json.loads(sys.argv[2])
    given["job"] = Job(**given["job"])
    put(**given)

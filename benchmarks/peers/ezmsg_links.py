"""ezmsg: two units, the one that sends in a process of its own; messages go through its shared memory."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import AsyncIterator
from typing import Any

import ezmsg.core as ez

from benchmarks.parcels import Job, Post, letter, opened, picture

__all__ = ["units"]

logging.getLogger("ezmsg").setLevel(logging.ERROR)
SILENCE_S = 0.5


class Given(ez.Settings):
    """What both units know."""

    job: Any


class Source(ez.Unit):
    """Sends."""

    SETTINGS = Given
    OUTPUT = ez.OutputStream(tuple)

    @ez.publisher(OUTPUT)
    async def parcels(self) -> AsyncIterator[Any]:
        job: Job = self.SETTINGS.job
        value = picture() if job.what == "picture" else None
        began = time.monotonic()
        for number in range(job.number):
            wait_s = job.wait_s(began, number)
            if wait_s > 0:
                await asyncio.sleep(wait_s)
            yield self.OUTPUT, letter(number) if value is None else (letter(number), value)
        await asyncio.sleep(SILENCE_S)
        raise ez.Complete


class Sink(ez.Unit):
    """Takes; with the last one all is over."""

    SETTINGS = Given
    INPUT = ez.InputStream(tuple)

    @ez.subscriber(INPUT)
    async def take(self, value: Any) -> None:
        note(value)


class LeakySink(ez.Unit):
    """Takes the latest."""

    SETTINGS = Given
    INPUT = ez.InputStream(tuple, leaky=True, max_queue=1)

    @ez.subscriber(INPUT)
    async def take(self, value: Any) -> None:
        note(value)


def note(value: Any) -> None:
    """One has arrived."""
    post = Post.current
    if post.job.what == "letter":
        post.take_letter(value)
    else:
        post.take_picture(*opened(value[0]), value[1])
    if post.is_over:
        raise ez.NormalTermination


def units(job: Job) -> dict[str, float]:
    """Receive: this process."""
    Post.current = Post(job)
    given = Given(job=job)
    source, sink = Source(given), (LeakySink if job.leaky else Sink)(given)
    ez.run(SOURCE=source, SINK=sink, connections=((source.OUTPUT, sink.INPUT),), process_components=(source,))
    return Post.current.figures()

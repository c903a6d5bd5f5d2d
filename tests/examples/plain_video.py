"""The counterpart of examples/video.py in plain asyncio, with the same abilities: what hfg is measured against.

A camera on an absolute schedule, a detector in a thread that gets the latest picture at its own rate, every picture
drawn and kept in order, back-pressure, counts of what was done and dropped, errors that name who failed and when,
everything wound up at the end of the stream, at an error and at Ctrl-C. `python -m tests.examples.plain_video [FILE]`.
"""

from __future__ import annotations

import asyncio
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from examples.video import FIND_HZ, HZ, SHOWN_EVERY, Corners, camera, draw, find
from hfg.images import Image


class VideoError(Exception):
    """Somebody failed."""


class Latest:
    """A place for one picture: a newer one takes the place of one that nobody has taken."""

    def __init__(self) -> None:
        self.picture: Image | None = None
        self.there = asyncio.Event()
        self.over = False
        self.dropped = 0

    def put(self, picture: Image) -> None:
        self.dropped += self.picture is not None
        self.picture = picture
        self.there.set()

    def end(self) -> None:
        self.over = True
        self.there.set()

    async def get(self) -> Image | None:
        await self.there.wait()
        picture, self.picture = self.picture, None
        if not self.over:
            self.there.clear()
        return picture


@dataclass
class Video:
    """What goes on, and what has been."""

    pictures: int = 90
    file: str = ""
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("camera", "find", "draw", "film"), 0))
    shown: list[Image] = field(default_factory=list)
    corners: Corners = ()

    def call(self, name: str, work: Any, *arguments: Any, **options: Any) -> Any:
        """Do a piece of work, and say whose it was if it fails."""
        self.counts[name] += 1
        try:
            return work(*arguments, **options)
        except Exception as error:
            raise VideoError(f'"{name}" failed at its picture {self.counts[name]}: {error}') from error

    async def take(self, latest: Latest, drawn: asyncio.Queue[Image | None]) -> None:
        loop = asyncio.get_running_loop()
        began = loop.time()
        for number, picture in enumerate(camera.function(pictures=self.pictures)):
            await asyncio.sleep(began + number / HZ - loop.time())
            self.counts["camera"] += 1
            latest.put(picture)
            await drawn.put(self.call("draw", draw.function, picture, corners=self.corners))
        latest.end()
        await drawn.put(None)

    async def look(self, latest: Latest, thread: ThreadPoolExecutor) -> None:
        loop = asyncio.get_running_loop()
        due = loop.time()
        while (picture := await latest.get()) is not None:
            self.corners = await loop.run_in_executor(thread, self.call, "find", find.function, picture)
            due = max(due + 1 / FIND_HZ, loop.time())
            await asyncio.sleep(due - loop.time())

    async def film(self, drawn: asyncio.Queue[Image | None]) -> None:
        while (picture := await drawn.get()) is not None:
            if self.counts["film"] % SHOWN_EVERY == 0:
                self.shown.append(picture)
            self.counts["film"] += 1
        if self.file and not cv2.imwrite(self.file, np.hstack(self.shown)):
            raise VideoError(f'"{self.file}" cannot be written')

    async def run(self) -> str:
        """Until the camera has no more."""
        latest = Latest()
        drawn: asyncio.Queue[Image | None] = asyncio.Queue(1)
        with ThreadPoolExecutor(1) as thread:
            try:
                async with asyncio.TaskGroup() as tasks:
                    tasks.create_task(self.take(latest, drawn))
                    tasks.create_task(self.look(latest, thread))
                    tasks.create_task(self.film(drawn))
            except* VideoError as errors:
                raise errors.exceptions[0] from None
        done = ", ".join(f"{name} {count}" for name, count in self.counts.items())
        return f"done: {done}; {latest.dropped} pictures dropped before the detector"


if __name__ == "__main__":
    print(asyncio.run(Video(file=sys.argv[1] if len(sys.argv) > 1 else "").run()))

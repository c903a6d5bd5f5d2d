"""A run to record in virtual time: numbers, a picture, and a mission; with edits and a failure."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge

import hfg
from hfg.images import Gray
from hfg.recording import Recording, record

__all__ = ["patrol", "recording_of"]


@hfg.node
def count(*, upto: int = 100) -> Iterator[int]:
    """Count."""
    yield from range(upto)


@hfg.node
def scaled(value: int, *, factor: Annotated[int, Ge(0)] = 2) -> int:
    """Multiply."""
    return value * factor


@hfg.node
def picture(value: int) -> Gray:
    """Draw a square that is brighter for larger numbers."""
    image = np.zeros((48, 64), np.uint8)
    image[8:24, 8:24] = value % 256
    return image


@hfg.node
def look(image: Gray) -> None:
    """Take a picture."""


@hfg.node
def fails_at(value: int, *, limit: int = 160) -> None:
    """Fail once, at a number."""
    if value == limit:
        raise ValueError(f"{value} is too large")


class Walk(hfg.Node):
    """Be active for two seconds, then hand on."""

    done = hfg.Event()

    @hfg.slot
    async def begin(self) -> None:
        """Walk."""
        await asyncio.sleep(2.0)
        self.done.trigger()


class Round(hfg.Subgraph):
    """Go there and come back."""

    begin = hfg.slot(type=object)
    done = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        """Put one walk before the other."""
        there = graph.add(Walk(), name="there")
        back = graph.add(Walk(), name="back")
        self.begin.inner.activates(there.begin)
        there.done.activates(back.begin)
        back.done.activates(self.done.inner)


def patrol(upto: int = 100, rate: float = 10.0) -> hfg.Graph:
    """Ten numbers a second; a round that takes four seconds, then a rest."""
    graph = hfg.Graph("patrol")
    numbers = graph.add(count(upto=upto), name="numbers", max_rate_hz=rate)
    scale = graph.add(scaled(), name="scale")
    draw = graph.add(picture(), name="draw")
    numbers >> scale >> graph.add(fails_at(), name="check", on_error="skip")
    numbers >> draw >> graph.add(look(), name="look")
    round_, rest = graph.add(Round(), name="round"), graph.add(Walk(), name="rest")
    graph.start.activates(round_.begin)
    round_.done.activates(rest.begin)
    return graph


def recording_of(file: Path, graph: hfg.Graph | None = None, *, edits: bool = False) -> Path:
    """Record a run in virtual time; with edits, the factor is 5 from 3 s on, and `spare` is there from 6 s on."""

    async def steer(run: hfg.Run) -> None:
        await asyncio.sleep(3.0)
        run.set("scale.factor", 5)
        await asyncio.sleep(3.0)
        await run.edit(hfg.commands.Add("tests.studio.recordings:Walk", "spare"))

    async def main() -> None:
        found: list[Recording] = []
        steering: list[asyncio.Task[None]] = []

        def begin(run: hfg.Run) -> None:
            found.append(record(run, file))
            if edits:
                steering.append(asyncio.create_task(steer(run)))

        await hfg.run_async(graph or patrol(), clock="virtual", begin=begin)
        await asyncio.gather(*steering)
        assert found[0].error is None

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    return file

"""ezmsg: a unit per node, all in one process, messages by reference."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from itertools import pairwise
from typing import Any

import ezmsg.core as ez

from benchmarks.meters import Arrivals, Laps
from benchmarks.works import Participant

logging.getLogger("ezmsg").setLevel(logging.ERROR)


class Meter(ez.Settings):
    """What the units of one run share: possible because they are in one process."""

    meter: Any
    arrived: Any = None


class Numbers(ez.Unit):
    """Count."""

    SETTINGS = Meter
    OUTPUT = ez.OutputStream(int)

    @ez.publisher(OUTPUT)
    async def numbers(self) -> AsyncIterator[Any]:
        for number in range(self.SETTINGS.meter.tokens):
            yield self.OUTPUT, number


class Rounds(ez.Unit):
    """Count, each number when the one before has arrived."""

    SETTINGS = Meter
    OUTPUT = ez.OutputStream(int)

    @ez.publisher(OUTPUT)
    async def numbers(self) -> AsyncIterator[Any]:
        meter, arrived = self.SETTINGS.meter, self.SETTINGS.arrived
        for number in range(meter.tokens):
            meter.lap()
            yield self.OUTPUT, number
            await arrived.wait()
            arrived.clear()
        meter.lap()
        raise ez.NormalTermination


class Through(ez.Unit):
    """Pass on."""

    INPUT = ez.InputStream(int)
    OUTPUT = ez.OutputStream(int)

    @ez.subscriber(INPUT)
    @ez.publisher(OUTPUT)
    async def through(self, value: int) -> AsyncIterator[Any]:
        yield self.OUTPUT, value


class Join(ez.Unit):
    """Pair by hand: what came first waits."""

    LEFT = ez.InputStream(int)
    RIGHT = ez.InputStream(int)
    OUTPUT = ez.OutputStream(int)

    async def initialize(self) -> None:
        self.left: list[int] = []
        self.right: list[int] = []

    @ez.subscriber(LEFT)
    @ez.publisher(OUTPUT)
    async def take_left(self, value: int) -> AsyncIterator[Any]:
        self.left.append(value)
        if self.right:
            self.right.pop(0)
            yield self.OUTPUT, self.left.pop(0)

    @ez.subscriber(RIGHT)
    @ez.publisher(OUTPUT)
    async def take_right(self, value: int) -> AsyncIterator[Any]:
        self.right.append(value)
        if self.left:
            self.right.pop(0)
            yield self.OUTPUT, self.left.pop(0)


class Sink(ez.Unit):
    """Take, and end the run with the last."""

    SETTINGS = Meter
    INPUT = ez.InputStream(int)

    @ez.subscriber(INPUT)
    async def take(self, value: int) -> None:
        meter = self.SETTINGS.meter
        meter.take(value)
        if meter.count == meter.tokens:
            raise ez.NormalTermination


class Arrived(ez.Unit):
    """Say that it has arrived."""

    SETTINGS = Meter
    INPUT = ez.InputStream(int)

    @ez.subscriber(INPUT)
    async def take(self, value: int) -> None:
        self.SETTINGS.arrived.set()


def run(source: ez.Unit, length: int, end: ez.Unit) -> None:
    """A chain."""
    nodes = {f"NODE{number}": Through() for number in range(length)}
    units = [source, *nodes.values(), end]
    edges = tuple((before.OUTPUT, after.INPUT) for before, after in pairwise(units))
    ez.run(SOURCE=source, END=end, connections=edges, force_single_process=True, **nodes)


class Ezmsg(Participant):
    """Published messages, a task per subscriber."""

    name = "ezmsg"

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""
        meter = Arrivals(tokens)
        run(Numbers(Meter(meter=meter)), length, Sink(Meter(meter=meter)))
        return meter.figures(length + 1)

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: an asyncio.Event tells the source."""
        meter = Laps(tokens)
        settings = Meter(meter=meter, arrived=asyncio.Event())
        run(Rounds(settings), length, Arrived(settings))
        return meter.figures(length + 1)

    def join(self, tokens: int) -> dict[str, float]:
        """C."""
        meter = Arrivals(tokens)
        settings = Meter(meter=meter)
        source, left, right, both, end = Numbers(settings), Through(), Through(), Join(), Sink(settings)
        edges = (
            (source.OUTPUT, left.INPUT),
            (source.OUTPUT, right.INPUT),
            (left.OUTPUT, both.LEFT),
            (right.OUTPUT, both.RIGHT),
            (both.OUTPUT, end.INPUT),
        )
        ez.run(
            SOURCE=source,
            LEFT=left,
            RIGHT=right,
            BOTH=both,
            END=end,
            connections=edges,
            force_single_process=True,
        )
        return meter.figures()


PEERS = [Ezmsg()]

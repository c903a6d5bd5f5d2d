"""A robot fetches cubes: one graph holds its data, its events and the state it is in.

    start ══ search ══ fetch ══ deliver ══ search ══ ...            (activity)
    camera ── detect ── search, and the gate: detect rests while nobody searches

Shown: active edges in place of a state machine, a gate, a time-out of a state, a hybrid edge from data into a slot.
Run it with `hfg run examples/fetch.py --clock virtual -v`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Annotated

from annotated_types import Ge, Interval

import hfg


@hfg.node
def camera(*, cubes: Annotated[int, Ge(0)] = 8, empty: Annotated[int, Ge(0)] = 3) -> Iterator[str]:
    """Yield images: some of the empty floor, then one with a cube; at the end the floor stays empty."""
    for number in range(1, cubes + 1):
        yield from ["floor"] * empty
        yield f"cube {number}"
    while True:
        yield "floor"


@hfg.node
def detect(image: str) -> str | None:
    """Say which cube is in the image, or nothing."""
    return image if image.startswith("cube") else None


class Search(hfg.Node):
    """Drives around until a cube is reported."""

    found = hfg.Event(str)

    @hfg.slot
    def begin(self) -> None:
        print(f"{hfg.now():5.1f} s  search")

    @hfg.slot
    def see(self, cube: str) -> None:
        if self.active:
            self.found.trigger(cube)


class Fetch(hfg.Node):
    """Drives to a cube and picks it up."""

    picked = hfg.Event(str)
    duration = hfg.Parameter(3.0, Interval(gt=0), unit="s")

    @hfg.slot
    async def begin(self, cube: str) -> None:
        print(f"{hfg.now():5.1f} s  fetch {cube}")
        await asyncio.sleep(self.duration)
        self.picked.trigger(cube)


class Deliver(hfg.Node):
    """Brings a cube home."""

    done = hfg.Event()
    duration = hfg.Parameter(2.0, Interval(gt=0), unit="s")

    @hfg.slot
    async def begin(self, cube: str) -> None:
        print(f"{hfg.now():5.1f} s  deliver {cube}")
        await asyncio.sleep(self.duration)
        self.done.trigger()


class GiveUp(hfg.Node):
    """Tells that nothing is left to fetch."""

    home = hfg.Event()

    @hfg.slot
    def begin(self) -> None:
        print(f"{hfg.now():5.1f} s  nothing more to fetch")
        self.home.trigger()


def build() -> hfg.Graph:
    """Build the robot."""
    graph = hfg.Graph("fetch")
    eye = graph.add(camera(), max_rate_hz=2)
    detector = graph.add(detect())
    search = graph.add(Search(), active_for_s=20)
    fetch = graph.add(Fetch())
    deliver = graph.add(Deliver())
    give_up = graph.add(GiveUp())

    graph.connect(eye.out, detector.image)
    graph.connect(detector.out, search.see)
    graph.gate(detector, by=search)

    graph.start.activates(search.begin)
    graph.connect(search.found, fetch.begin, active=True)
    graph.connect(fetch.picked, deliver.begin, active=True)
    graph.connect(deliver.done, search.begin, active=True)
    graph.connect(search.timeout, give_up.begin, active=True)
    graph.connect(give_up.home, graph.stop)
    return graph

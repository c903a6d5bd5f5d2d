"""From one process to another, by hfg and others: `make bench-links`.

Measured: letters of 100 bytes and pictures of 6.2 megabytes, once as fast as it goes (microseconds between two that
  arrive), and once at 500 Hz or 50 Hz (how old they are when they are there); lossless, and leaky, where nobody waits
  and what is too many is lost and counted. Besides: activity over an edge that is cut, and the graph of
  examples/three_processes.py cut and in one piece.
Everybody sends the same bytes from one process, and has them in the other, pictures as an array there; start-up and the
  first tenth are not counted. Packages that are not installed are named and skipped.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Literal

from benchmarks import crossing
from benchmarks.goals import Goal, Side
from benchmarks.measure import Case
from benchmarks.parcels import Job

LETTER_HZ, PICTURE_HZ = 500, 50
LETTERS, PICTURES = 500, 60
"""At these rates: about a second."""
DISTRIBUTIONS = ("hfg", "eclipse-zenoh", "ezmsg", "dora-rs", "opencv-python-headless")
SHOWS_CASES = True

CASES: dict[str, Case] = {}
GOALS: list[Goal] = []
SKIPPED: dict[str, str] = {}
"""The cases that cannot be measured here, and why."""

Work = Callable[[Job], dict[str, float]]


def rows() -> None:
    """Everybody who brings something from one process to another."""
    for window, letters, pictures in ((1, 2_000, 300), (8, 10_000, 500), (64, 40_000, 500)):
        row(f"hfg edge, window {window}", partial(crossing.edge, window), letters, pictures)
    for window, letters in ((1, 2_000), (8, 10_000), (64, 60_000)):
        row(f"hfg link, window {window}", partial(crossing.link, window, "straight"), letters, 150 * (window == 8))
    for window, letters in ((1, 2_000), (64, 40_000)):
        row(f"hfg link, window {window}, over Zenoh", partial(crossing.link, window, "zenoh"), letters, 0)
    row("hfg link, window 8, Zenoh's shared memory", partial(crossing.link, 8, "shared"), 0, 500)
    row("hfg publish and subscribe, window 8", partial(crossing.meeting, 8), 8_000, 150)

    zenoh = peer("zenoh_links", "puts")
    row("Zenoh, express puts", zenoh, 40_000, 150, needs="zenoh")
    row("Zenoh, express puts to asyncio", partial(zenoh, into_asyncio=True), 40_000, 0, needs="zenoh")
    row("Zenoh, puts that share batches", partial(zenoh, express=False), 100_000, 0, needs="zenoh")
    row("Zenoh, its shared memory", partial(zenoh, shared=True), 0, 600, needs="zenoh")
    row("ezmsg", peer("ezmsg_links", "units"), 20_000, 300, needs="ezmsg")
    row("dora, large pool", peer("dora_links", "nodes"), 20_000, 600, needs="dora pyarrow")
    row("multiprocessing.Pipe", peer("standard_links", "pipe"), 60_000, 150)
    add(
        "socket pair, two asyncio loops | 100 B, rate",
        job_for(peer("standard_links", "socket_pair"), "letter", 0, False),
        2_000,
    )
    row("shared memory and semaphores", peer("standard_links", "ring"), 60_000, 500)


def leaky_rows() -> None:
    """Packages that can send without waiting."""
    row("hfg edge, latest", partial(crossing.edge, 8), 400_000, 200_000, leaky=True)
    row("hfg link, bounded, over Zenoh", partial(crossing.link, 1, "zenoh"), 20_000, 150, leaky=True)
    row("hfg publish and subscribe, latest", partial(crossing.meeting, 1), 20_000, 150, leaky=True)
    zenoh = peer("zenoh_links", "puts")
    row("Zenoh, puts that drop", zenoh, 40_000, 0, leaky=True, needs="zenoh")
    row("Zenoh, puts that drop, its shared memory", partial(zenoh, shared=True), 0, 600, leaky=True, needs="zenoh")
    row("ezmsg, leaky", peer("ezmsg_links", "units"), 40_000, 600, leaky=True, needs="ezmsg")
    row("dora, queue of one, large pool", peer("dora_links", "nodes"), 40_000, 1_000, leaky=True, needs="dora pyarrow")


def row(name: str, work: Work, letters: int, pictures: int, *, leaky: bool = False, needs: str = "") -> None:
    """Add who sends letters and pictures, both ways; none of what there are 0 of."""
    what: Literal["letter", "picture"]
    for what, size, count, slow, rate_hz in (
        ("letter", "100 B", letters, LETTERS, LETTER_HZ),
        ("picture", "6.2 MB", pictures, PICTURES, PICTURE_HZ),
    ):
        if count:
            column = f"leaky, {size}" if leaky else size
            add(f"{name} | {column}, rate", job_for(work, what, 0, leaky), count, needs=needs)
            if what == "picture" or not leaky:  # a letter has room at this rate, whether it might be lost or not
                add(f"{name} | {column}, latency", job_for(work, what, rate_hz, leaky), slow, needs=needs)


def job_for(work: Work, what: Literal["letter", "picture"], rate_hz: int, leaky: bool) -> Callable[[int], Any]:
    """Return what does so many."""
    return lambda count: work(Job(what, count, rate_hz, leaky))


def add(name: str, run: Callable[[int], Any], size: int, unit: str = "us", needs: str = "") -> None:
    """Add a case if what it needs is installed."""
    missing = next((module for module in needs.split() if find_spec(module) is None), None)
    if missing is None:
        CASES[name] = Case(run, size, unit)
    else:
        SKIPPED[name] = f"{missing} is not installed"


def peer(module: str, work: str) -> Callable[..., dict[str, float]]:
    """The work of another package, which is imported on use, so that other processes do not load it."""

    def do(job: Job, **options: Any) -> dict[str, float]:
        figures: dict[str, float] = getattr(import_module(f"benchmarks.peers.{module}"), work)(job, **options)
        return figures

    return do


def goal(name: str, ours: str, theirs: str, at_most: float, by: str = "wall", their_by: str = "") -> None:
    """Compare two cases."""
    GOALS.append(Goal(name, Side(ours, by), Side(theirs, their_by or by), at_most))


def goals() -> None:
    """What is to be reached; rates as times between two that arrive, so that less is better."""
    express, asyncio = "Zenoh, express puts", "Zenoh, express puts to asyncio"
    batches, sockets = "Zenoh, puts that share batches", "socket pair, two asyncio loops"
    for who in ("edge", "link"):
        small, first = "100 B, rate", f"100 B, {who}"
        goal(f"{first}, window 64 / {express}", f"hfg {who}, window 64 | {small}", f"{express} | {small}", 1 / 1.2)
        goal(f"{first}, window 64 / {batches}", f"hfg {who}, window 64 | {small}", f"{batches} | {small}", 1 / 1.2)
        goal(f"{first}, window 1 / {express}", f"hfg {who}, window 1 | {small}", f"{express} | {small}", 1 / 0.14)
        goal(f"{first}, window 1 / {sockets}", f"hfg {who}, window 1 | {small}", f"{sockets} | {small}", 1.5)
        for other in (express, asyncio):
            ours, theirs = f"hfg {who}, window 8 | 100 B, latency", f"{other} | 100 B, latency"
            goal(f"{first}, one way / {other}", ours, theirs, 1.1, "p50")
    shared, pool, large = "Zenoh, its shared memory", "dora, large pool", "hfg edge, window 8 | 6.2 MB"
    goal(f"6.2 MB, edge, window 8 / {shared}", f"{large}, rate", f"{shared} | 6.2 MB, rate", 1 / 1.2)
    goal(f"6.2 MB, edge, one way / {shared}", f"{large}, latency", f"{shared} | 6.2 MB, latency", 0.6, "p50")
    goal(f"6.2 MB, edge, window 8 / {pool}", f"{large}, rate", f"{pool} | 6.2 MB, rate", 1.0)
    add("examples/three_processes.py | seconds", crossing.pipeline, 30, "s", needs="cv2")
    add("activity over an edge that is cut | one way", crossing.activity, 1_000)
    if (os.cpu_count() or 1) > 1:
        apart = "examples/three_processes.py | seconds"
        goal("three processes / one process", apart, apart, 1 / 1.4, "wall", "one process")


rows()
leaky_rows()
goals()
MISSING = sorted(set(SKIPPED.values()))

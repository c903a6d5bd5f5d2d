"""What the framework costs in a mission: the delivery robot in its arena, three missions by their seeds.

Measured: the share of the framework's own lines in the processor time of the run, and in the part of that time in which
  the interpreter is held; arena, pictures and OpenCV are part of the whole. How many of the firings are interpreted.
  The first minute of each mission also runs twice under a recorder, fused and interpreted: the case fails if a recorded
  message, a count or a score differs.
Not measured: building the graph, and the end of the process.
"""

from __future__ import annotations

import glob
import tempfile
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

import hfg
from benchmarks.goals import Goal, Side
from benchmarks.measure import Case
from benchmarks.sampler import Sampler
from examples.fetch_delivery.mission import build
from hfg.engine.model.records import Counts
from hfg.recording.recording import ports_of

SEEDS = (1, 2, 3)
SECONDS = 180
COMPARED_S = 60
DISTRIBUTIONS = ("hfg", "numpy", "opencv-python-headless")
SHOWS_CASES = True


def mission(seed: int, seconds: int) -> dict[str, float]:
    """Processor time, the framework's shares of it, and what is interpreted; in seconds and percent."""
    sampler, fused = Sampler(), _Fused()
    with fused, sampler:
        plain = _run(seed, seconds, sampler=sampler)
    interpreted = 100 * (1 - fused.firings / plain["firings"])
    _compare(seed, min(seconds, COMPARED_S))
    return {
        "cpu": sampler.seconds,
        "processor": sampler.share(),
        "interpreter": sampler.share(held=True),
        "interpreted": interpreted,
    }


class _Fused:
    """Counts the firings of fused waves within its block."""

    firings = 0

    def __enter__(self) -> None:
        self._add = add = Counts.add_firings

        def count(counts: Counts, times: int, silently: int = 0) -> None:
            self.firings += times
            add(counts, times, silently)

        Counts.add_firings = count  # type: ignore[assignment, method-assign]

    def __exit__(self, *_: object) -> None:
        Counts.add_firings = self._add  # type: ignore[method-assign]


def _run(
    seed: int, seconds: int, *, fast: bool = True, file: Path | None = None, sampler: Sampler | None = None
) -> dict[str, Any]:
    """Run a mission in virtual time; say what it has come to, which is the same whether it was fused."""
    graph = build(seed, 1)
    world: Any = graph["world"]

    def begin(run: hfg.Run) -> None:
        if file is not None:
            run.record(file, select=_outputs(run))
        if sampler is not None:
            sampler.begin()

    report = hfg.run(graph, clock="virtual", until_s=seconds, fast=fast, begin=begin, block_warning_s=0)
    return {"nodes": report.nodes, "edges": report.edges, "firings": report.firings, "scores": world.simulation.scores}


def _outputs(run: hfg.Run) -> list[str]:
    """All outputs: who records events sees the number of each call, so that their nodes would not be fused."""
    return [glob.escape(path) for path, port in ports_of(run).items() if port.kind == "output"]


def _compare(seed: int, seconds: int) -> None:
    """Run the mission under a recorder, fused and interpreted.

    Raises:
      RuntimeError: they differ, or the first one was not fused.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / "fused.mcap", Path(folder) / "interpreted.mcap"]
        fused = _Fused()
        with fused:
            told = [_run(seed, seconds, fast=file is files[0], file=file) for file in files]
        if not fused.firings:
            raise RuntimeError(f"mission {seed}: nothing was fused under the recorder, so there is nothing to compare")
        differing = [key for key in told[0] if repr(told[0][key]) != repr(told[1][key])]
        if differing:
            raise RuntimeError(f"mission {seed}: fused and interpreted differ in {', '.join(differing)}")
        one, other = (list(_messages(file)) for file in files)
    if one != other or not one:
        place = next((n for n, pair in enumerate(zip(one, other, strict=False)) if pair[0] != pair[1]), len(one))
        raise RuntimeError(f"mission {seed}: fused and interpreted recordings differ from message {place} on")


def _messages(file: Path) -> Iterable[tuple[str, int, int, int, bytes]]:
    with file.open("rb") as stream:
        for _, channel, one in make_reader(stream).iter_messages(log_time_order=False):
            yield channel.topic, one.log_time, one.publish_time, one.sequence, one.data


CASES = {f"mission {seed}": Case(partial(mission, seed), SECONDS, "s") for seed in SEEDS}
SKIPPED: dict[str, str] = {}
GOALS = [
    Goal(f"{name}: {what}, %", Side(name, figure), 100.0, at_most, alone=True)
    for name in CASES
    for what, figure, at_most in (
        ("the framework's share of the processor", "processor", 5.0),
        ("its share while the interpreter is held", "interpreter", 9.0),
        ("firings that are interpreted", "interpreted", 5.0),
    )
]

"""Real processes die at random, during teardown too, while activity crosses the cut and wall clocks jump (A3, L2, X3).

`HFG_SOAK_DEATHS_S` says for how long; figures are printed (`-s`).
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

import hfg

pytest.importorskip("zenoh", reason="processes speak over Zenoh")

FOR_S = float(os.environ.get("HFG_SOAK_DEATHS_S", "480"))
COUNT = 600
GROUPS = ("safe", "lossy")
_WALL = time.time


@hfg.node
def numbers(*, count: int = COUNT) -> Iterator[int]:
    yield from range(count)


class Passing(hfg.Node):
    """Passes a value on in its time; the wall clock of its process jumps by up to a day, and it is torn down slowly."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    async def process(self, value: int) -> int:
        if value % 20 == 0:
            shift_s = random.uniform(-86_400.0, 86_400.0)
            time.time = lambda: _WALL() + shift_s
        await asyncio.sleep(0.004)
        return value

    async def teardown(self) -> None:
        await asyncio.sleep(0.3)


class Lit(hfg.Node):
    """Is given activity by each hundredth value, which then crosses the cut."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        self.out.send(value, activity=1 if value % 100 == 0 else None)


@hfg.node
def pair(a: int, b: int) -> tuple[int, int]:
    return a, b


def graph() -> hfg.Graph:
    """A chain of which nothing is lost, and one over which activity runs, behind which they join."""
    made = hfg.Graph("deaths")
    source, lit, both = made.add(numbers()), made.add(Lit()), made.add(pair())
    made.connect(source.out, lit.value)
    for name, port in (("safe", both.a), ("lossy", both.b)):
        made.group(name, process=True)
        last = None
        for number in range(2):
            node = made.add(Passing(), name=f"{name}{number}", group=name)
            before = lit.out if last is None else last.out
            made.connect(before, node.value, active=name == "lossy")
            last = node
        assert last is not None
        made.connect(last.out, port, active=name == "lossy")
    made.connect(both.out, made.output("out", tuple[int, int]))
    return made


def pids_by_group() -> dict[str, int]:
    """The processes of this one that have the names of groups: those that have begun to live."""
    found: dict[str, int] = {}
    for children in Path("/proc/self/task").glob("*/children"):
        for pid in children.read_text("ascii").split():
            with contextlib.suppress(OSError):
                name = Path(f"/proc/{pid}/comm").read_text().strip().removeprefix("hfg ")
                if name in GROUPS:
                    found[name] = int(pid)
    return found


class Round:
    """One run, whose processes are killed and stopped."""

    def __init__(self, seed: int) -> None:
        self.counts: Counter[str] = Counter()
        self.recoveries: list[float] = []
        self.found: list[tuple[int, int]] = []
        self._choose = random.Random(seed)
        self._came = asyncio.Event()
        self.pids: dict[str, int] = {}

    def _signal(self, name: str, number: signal.Signals) -> None:
        try:
            os.kill(self.pids[name], number)
        except ProcessLookupError:
            return
        self.counts[number.name] += 1

    async def _harm(self) -> None:
        choose = self._choose
        for _ in range(4):
            await asyncio.sleep(choose.uniform(0.1, 1.5))
            self.pids = pids_by_group()
            names = list(self.pids)
            if not names:
                continue
            if choose.random() < 0.25:
                name = choose.choice(names)
                self._signal(name, signal.SIGSTOP)
                await asyncio.sleep(choose.uniform(0.1, 1.0))
                self._signal(name, signal.SIGCONT)
            else:
                for name in choose.sample(names, choose.choice([1, 1, len(names)])):
                    self._signal(name, signal.SIGKILL)
            began = time.monotonic()
            self._came.clear()
            await self._came.wait()
            self.recoveries.append(time.monotonic() - began)

    async def live(self) -> hfg.Report:
        """Live it; gives the report."""
        dying: asyncio.Task[None] | None = None
        async with hfg.running(graph()) as run:
            harming = asyncio.create_task(self._harm())
            async for value in run.read("out"):
                self.found.append(value)
                if len(self.found) % 10 == 0 or value[0] > COUNT - 10:
                    self._came.set()
            harming.cancel()
            self.pids = pids_by_group()
            dying = asyncio.create_task(self._die_while_torn_down())
        await dying
        return run.report()

    async def _die_while_torn_down(self) -> None:
        await asyncio.sleep(self._choose.uniform(0.0, 0.35))
        for name in self._choose.sample(GROUPS, self._choose.choice([0, 1, 2])):
            if name in self.pids:
                self._signal(name, signal.SIGKILL)
                self.counts["in teardown"] += 1


@pytest.mark.soak
@pytest.mark.rule("A3", "L2", "X3")
@pytest.mark.timeout(FOR_S * 3 + 600)
def test_processes_die_at_random_and_nothing_is_torn_doubled_or_lost_in_silence() -> None:
    counts: Counter[str] = Counter()
    recoveries: list[float] = []
    until, seed = time.monotonic() + FOR_S, 0
    while time.monotonic() < until:
        one = Round(seed)
        report = asyncio.run(asyncio.wait_for(one.live(), 120.0))
        counts.update(one.counts)
        recoveries += one.recoveries
        lost = sum(edge.lost for edge in report.edges.values())
        missing = COUNT - len(one.found)
        counts.update(runs=1, tokens=len(one.found), lost=missing, counted=lost)
        assert all(a == b for a, b in one.found), f"seed {seed}: torn"
        assert one.found == sorted(set(one.found)), f"seed {seed}: doubled, or out of order"
        assert missing <= lost, f"seed {seed}: {missing} are missing, {lost} were counted"
        assert bool(lost) <= any("lost with a process" in error for error in report.errors), f"seed {seed}"
        seed += 1
    recoveries.sort()
    print(
        dict(counts),
        f"recoveries {len(recoveries)}, p50 {recoveries[len(recoveries) // 2]:.2f} s, longest {recoveries[-1]:.2f} s",
    )
    assert counts["SIGKILL"] > 0

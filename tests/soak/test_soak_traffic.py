"""Eight hours of traffic at 100 tokens a second, as fast as the machine can: memory stays flat (rules L1, L2)."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import hfg

pytest.importorskip("zenoh", reason="processes speak over Zenoh")

TOKENS = 8 * 3600 * 100


@hfg.node
def traffic(*, count: int = TOKENS) -> Iterator[int]:
    yield from range(count)


@hfg.node
def passed(value: int) -> int:
    return value + 1


class Last(hfg.Node):
    """Sees whether all came, in order."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    count = hfg.State(0)

    def process(self, value: int) -> None:
        self.count += 1
        if value != self.count:
            raise ValueError(f"{value} came in place of {self.count}")

    def end(self) -> None:
        self.out.send(self.count)


def resident_kb(process: int) -> int:
    status = Path(f"/proc/{process}/status").read_text("ascii")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))


def children() -> list[int]:
    return [int(one) for one in Path(f"/proc/self/task/{os.getpid()}/children").read_text("ascii").split()]


@pytest.mark.soak
@pytest.mark.timeout(3600)
@pytest.mark.rule("L1", "L2")
@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_eight_hours_of_traffic_leave_memory_flat() -> None:
    graph = hfg.Graph("traffic")
    graph.group("far", process=True)
    source, far, last = graph.add(traffic()), graph.add(passed(), group="far"), graph.add(Last())
    graph.connect(source.out, far.value)
    graph.connect(far.out, last.value)
    graph.connect(last.out, graph.output("out", int))
    seen: list[dict[str, int]] = []
    over = threading.Event()

    def look() -> None:
        while not over.wait(2.0):
            found = {"main": resident_kb(os.getpid())}
            for one in children():
                try:
                    name = Path(f"/proc/{one}/comm").read_text("ascii").strip()
                    found[name] = resident_kb(one)
                except (OSError, StopIteration):
                    continue  # it is gone, or has not begun
            seen.append(found)

    looking = threading.Thread(target=look)
    looking.start()
    begun = time.monotonic()
    try:
        report = hfg.run(graph)
    finally:
        over.set()
        looking.join()
    assert report.outputs == {"out": [TOKENS]}
    for name in ("main", "hfg far"):
        sizes = [one[name] for one in seen if name in one]
        early, late = sizes[len(sizes) // 5], sizes[-2]
        sys.stdout.write(f"{name}: {early} kB early, {max(sizes)} kB at most, {late} kB at the end\n")
        assert late < 1.1 * early + 2000, f"{name} grew from {early} kB to {late} kB"
    sys.stdout.write(f"{TOKENS} tokens in {time.monotonic() - begun:.0f} s\n")

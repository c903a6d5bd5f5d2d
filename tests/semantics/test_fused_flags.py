"""What comes amid a wave: a flag ends it behind the call under way, and what it has done stays done (R2, R4)."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg.engine.fusion.region import Region
from hfg.engine.model.running_node import RunningNode
from hfg.engine.runtime import settings
from tests.semantics.nodes import Keep, drive, forward, numbers, scale


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Behind the calls of which members, and of which wave, waves have ended before their time."""
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)
    found: list[tuple[str, int]] = []
    materialise = Region.materialise

    def noted(region: Region, k: int, locals_: dict[str, Any]) -> Any:
        worker = materialise(region, k, locals_)
        found.append((worker.path, worker.counts.firings))
        return worker

    monkeypatch.setattr(Region, "materialise", noted)
    return found


def _amid_a_call(meddle: Callable[[Any], object], group: str | None) -> list[int]:
    """Run a chain; what its member `mid` calls amid its eighth firing, with the region it is in."""
    regions: list[Any] = []

    @hfg.node
    def mid(value: int) -> int:
        if value == 7:
            meddle(regions[0]())
        return value

    async def main() -> list[int]:
        graph, keep = hfg.Graph(), Keep()
        graph.group("side", threads=1)
        nodes = [graph.add(node(), group=group) for node in (forward, mid, scale)]
        source = graph.add(numbers(count=20), group=group)
        graph.connect(source.out, nodes[0].value)
        for before, behind in itertools.pairwise(nodes):
            graph.connect(before.out, behind.value)
        graph.connect(nodes[-1].out, graph.add(keep, group=group).value)
        async with hfg.running(graph, clock="virtual") as run:
            regions.append(lambda: run._engine.core.by_path["mid"].region)
            await run.wait_finished()
        return keep.values

    return drive(main)


@pytest.mark.rule("R2")
@pytest.mark.parametrize("group", [None, "side"])
def test_a_wave_ends_behind_the_call_amid_which_another_thread_raises_a_flag(
    left: list[tuple[str, int]], group: str | None
) -> None:
    def meddle(region: Region) -> None:
        other = threading.Thread(target=region.flags.append, args=["slice"])
        other.start()
        other.join()

    assert _amid_a_call(meddle, group) == list(range(2, 42, 2))
    assert left[0] == ("mid", 7)


@pytest.mark.rule("R2")
def test_a_wave_that_begins_with_a_flag_up_ends_behind_its_first_call(
    left: list[tuple[str, int]],
) -> None:
    def meddle(region: Region) -> None:
        head, flags, step = region.head, region.flags, region.head.step

        def begin(worker: RunningNode) -> None:
            flags.forget = lambda: None  # as if another wave had been entered last
            flags.append("slice")
            head.use_step(step)
            step(worker)

        head.use_step(begin)

    assert _amid_a_call(meddle, None) == list(range(2, 42, 2))
    assert left[0] == ("numbers", 8)


@pytest.mark.rule("X1", "F3")
@pytest.mark.parametrize("then", ["fail", "give way and fail", "give way and wait"])
@pytest.mark.parametrize("fast", [True, False])
def test_statistics_that_are_read_amid_a_wave_leave_it_as_it_is(
    monkeypatch: pytest.MonkeyPatch, then: str, fast: bool
) -> None:
    """The first reading has waves measured; by the second they are plain again, and measured ones would be next."""
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)
    readings: list[Callable[[], object]] = []

    @hfg.node
    def plain(value: int) -> int:
        if value in {5, 80}:
            readings[0]()
            if value == 80:
                raise ValueError("eighty")
        return value

    @hfg.node
    async def polite(value: int) -> int:
        if value == 5:
            readings[0]()
        await asyncio.sleep(0)
        if value == 80:
            asyncio.get_running_loop().call_soon(readings[0])
            for _ in range(5):
                await asyncio.sleep(0)
            if then.endswith("fail"):
                raise ValueError("eighty")
            await asyncio.sleep(0.1)
        return value

    async def main() -> list[int]:
        graph, keep = hfg.Graph(), Keep()
        source, before = graph.add(numbers(count=90)), graph.add(forward())
        behind = graph.add(plain() if then == "fail" else polite(), on_error="skip", name="behind")
        graph.connect(source.out, before.value)
        graph.connect(before.out, behind.value)
        graph.connect(behind.out, graph.add(keep).value)
        async with hfg.running(graph, fast=fast, clock="virtual" if then == "fail" else "real") as run:
            readings.append(run.statistics)
            await run.wait_finished()
        return keep.values

    values = drive(main) if then == "fail" else asyncio.run(main())
    assert values == [value for value in range(1, 91) if value != 80 or then.endswith("wait")]

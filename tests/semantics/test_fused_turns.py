"""Waves in which async code only gives way to others (`sleep(0)`) stay fused, and mean what single firings mean.

Rules F3, F5, F10, P8, R2 to R5, X1, X3. While the wave gives way others meddle with its members.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.engine.fusion.region import Region
from hfg.engine.runtime import settings
from tests.semantics.meddling import MEMBERS, Turns, chain
from tests.semantics.nodes import Keep, forward, numbers, scale


@pytest.fixture(autouse=True)
def from_the_first_firing_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


@pytest.fixture
def exits(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The paths of members in whose call a wave has ended before its time."""
    found: list[str] = []
    materialise = Region.materialise

    def noted(region: Region, k: int, locals_: dict[str, Any]) -> Any:
        found.append(region.order[k].path)
        return materialise(region, k, locals_)

    monkeypatch.setattr(Region, "materialise", noted)
    return found


@pytest.mark.rule("R2", "F5")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_a_wave_that_only_gives_way_stays_one(clock: Any, exits: list[str]) -> None:
    @hfg.node
    async def polite(value: int) -> int:
        await asyncio.sleep(0)
        return value

    graph, sink = hfg.Graph(), Keep()
    source = graph.add(numbers(count=20))
    graph.connect(chain(graph, source.out, polite(), forward(), polite(), scale()), graph.add(sink).value)
    report = hfg.run(graph, clock=clock)
    assert sink.values == list(range(2, 42, 2))
    assert [report.nodes[name].firings for name in ("polite", "forward", "polite_2", "scale", "keep")] == [21] * 5
    if clock == "virtual":  # where no slice ends before its time
        assert exits == ["numbers"]  # which has nothing more


@pytest.mark.rule("R2")
def test_others_of_the_group_have_their_turn_while_a_wave_gives_way() -> None:
    seen: list[tuple[str, int]] = []

    @hfg.node
    async def polite(value: int) -> int:
        seen.append(("polite", value))
        await asyncio.sleep(0)
        return value

    @hfg.node
    def other(value: int) -> None:
        seen.append(("other", value))

    @hfg.node
    def sink(value: int) -> None:
        seen.append(("sink", value))

    def run(fast: bool) -> list[tuple[str, int]]:
        seen.clear()
        graph = hfg.Graph()
        chain(graph, graph.add(numbers(count=4), name="a").out, polite(), forward(), sink())
        chain(graph, graph.add(numbers(count=4), name="b").out, other())
        hfg.run(graph, clock="virtual", fast=fast)
        return list(seen)

    assert run(fast=True) == run(fast=False)


@pytest.mark.rule("P4", "R2")
def test_a_head_with_a_buffer_goes_on_before_who_fills_that_though_it_has_given_way() -> None:
    seen: list[tuple[str, int]] = []

    @hfg.node
    def source() -> Iterator[int]:
        for value in range(4):
            seen.append(("source", value))
            yield value

    @hfg.node
    async def polite(value: int) -> int:
        seen.append(("polite", value))
        await asyncio.sleep(0)
        return value

    def run(fast: bool) -> list[tuple[str, int]]:
        seen.clear()
        graph, head = hfg.Graph(), polite()
        graph.connect(graph.add(source()).out, graph.add(head).value, buffer=1)
        chain(graph, head.out, forward(), Keep())
        hfg.run(graph, clock="virtual", fast=fast)
        return list(seen)

    assert run(fast=True) == run(fast=False)


@pytest.mark.rule("F3", "F5")
def test_what_has_left_the_wave_is_taken_while_it_gives_way() -> None:
    async def main() -> None:
        turns = Turns(at=1)
        graph, sink = turns.graph()
        graph.group("beside", threads=1)
        early = Keep()
        graph.connect(graph["forward.out"], graph.add(early, name="early", group="beside").value)
        async with hfg.running(graph) as live:
            await turns.inside.wait()
            while not early.values:
                await asyncio.sleep(0)
            assert (early.values, sink.values) == ([1], [])
            turns.over = True
            await live.wait_finished()
        assert early.values == [1, 2, 3, 4, 5, 6]
        assert sink.values == [10, 20, 30, 40, 50, 60]

    asyncio.run(main())


@pytest.mark.rule("X2")
def test_code_that_waits_for_longer_behind_its_turns_goes_on_as_a_firing_like_any_other(exits: list[str]) -> None:
    async def main() -> None:
        turns = Turns(then=lambda: asyncio.sleep(1.0))
        graph, sink = turns.graph()
        turns.over = True
        report = await hfg.run_async(graph)
        assert sink.values == [10, 20, 30, 40, 50, 60]
        assert report.duration_s == 1.0
        assert [report.nodes[name].firings for name in MEMBERS] == [7] * 4

    Turns.run(main())
    assert exits == ["stops", "numbers"]


@pytest.mark.rule("R4")
@pytest.mark.parametrize("which", MEMBERS)
def test_a_member_is_removed_while_its_wave_gives_way(which: str) -> None:
    async def main() -> None:
        turns = Turns()
        graph, sink = turns.graph()
        async with hfg.running(graph) as live:
            await turns.inside.wait()
            edit = asyncio.create_task(live.edit(c.Remove(which)))
            await asyncio.sleep(0)
            turns.over = True
            await edit
            await live.wait_finished()
        assert sink.values[:2] == [10, 20]
        assert len(sink.values) <= 3

    Turns.run(main())


@pytest.mark.rule("X1")
@pytest.mark.parametrize("policy", ["skip", "disable", "restart"])
@pytest.mark.parametrize("error", [ValueError, hfg.EndOfStream, asyncio.CancelledError, SystemExit])
def test_code_that_raises_behind_its_turn_fails_as_it_does_amid_single_firings(
    error: type[BaseException], policy: str
) -> None:
    async def fails() -> None:
        raise error("no")

    async def outcome(fast: bool) -> tuple[list[Any], str]:
        turns = Turns(then=fails)
        graph, sink = turns.graph(on_error=policy)
        turns.over = True
        try:
            report = await hfg.run_async(graph, fast=fast)
        except hfg.errors.RunError as problem:
            return sink.values, str(problem)
        return sink.values, report.outcome

    assert Turns.run(outcome(fast=True)) == Turns.run(outcome(fast=False))


@pytest.mark.rule("X1")
def test_the_error_behind_a_turn_names_the_member_and_its_firing() -> None:
    async def fails() -> None:
        raise ValueError("no")

    async def main() -> None:
        turns = Turns(then=fails)
        graph, _ = turns.graph()
        turns.over = True
        with pytest.raises(hfg.errors.RunError, match='"stops" failed in firing 3'):
            await hfg.run_async(graph)

    Turns.run(main())


@pytest.mark.rule("X3")
def test_a_member_that_gives_way_for_ever_is_named_when_the_run_is_stopped() -> None:
    inside = asyncio.Event()

    @hfg.node
    async def stubborn(value: int) -> int:
        inside.set()
        while True:
            try:
                await asyncio.sleep(0)
            except asyncio.CancelledError:
                continue

    async def main() -> None:
        graph = hfg.Graph()
        chain(graph, graph.add(numbers(count=6)).out, forward(), stubborn(), Keep())
        async with hfg.running(graph) as live:
            live._engine.settings.teardown_limit_s = 0.05
            await inside.wait()
            live.stop()

    with pytest.raises(hfg.errors.RunError, match='"stubborn" failed in firing 1: it was cancelled and did not end'):
        asyncio.run(main())


@pytest.mark.rule("R7")
def test_statistics_read_while_a_wave_gives_way_change_nothing() -> None:
    async def main() -> None:
        turns = Turns()
        graph, sink = turns.graph()
        async with hfg.running(graph) as live:
            await turns.inside.wait()
            live.statistics()
            live.report()
            turns.over = True
            await live.wait_finished()
            assert [live.statistics().nodes[name].firings for name in MEMBERS] == [7] * 4
        assert sink.values == [10, 20, 30, 40, 50, 60]

    Turns.run(main())

"""Waves in which async code only gives way to others (`sleep(0)`) stay fused, and mean what single firings mean.

Rules F3, F5, F10, P8, R2 to R5, X1, X3. While the wave gives way others meddle with its members.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.engine.fusion.region import Region
from hfg.engine.runtime import settings
from tests.semantics.nodes import Keep, forward, numbers, scale

MEMBERS = ("forward", "lingers", "scale", "last")


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


class Turns:
    """Lets a test meddle with a wave whose second member gives way again and again."""

    def __init__(self, at: int = 3, then: Callable[[], Any] | None = None) -> None:
        self.at = at
        self.inside = asyncio.Event()
        self.over = False
        self.then = then

    def node(self) -> Any:
        @hfg.node
        async def lingers(value: int) -> int:
            if value == self.at:
                self.inside.set()
                while not self.over:
                    await asyncio.sleep(0)
                if self.then is not None:
                    await self.then()
            return value

        return lingers()


def chain(graph: hfg.Graph, port: Any, *nodes: Any) -> Any:
    for one in nodes:
        node, options = one if isinstance(one, tuple) else (one, {})
        graph.add(node, **options)
        graph.connect(port, node.value)
        port = getattr(node, "out", None)
    return port


def lingering(turns: Turns, count: int = 6, **options: Any) -> tuple[hfg.Graph, Keep]:
    graph, sink = hfg.Graph(), Keep()
    source = graph.add(numbers(count=count))
    member = (turns.node(), options)
    out = chain(graph, source.out, forward(), member, scale(factor=10), (forward(), {"name": "last"}))
    graph.connect(out, graph.add(sink).value)
    return graph, sink


def in_virtual_time(main: Coroutine[Any, Any, Any]) -> Any:
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main)


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
        graph, sink = lingering(turns)
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
        graph, sink = lingering(turns)
        turns.over = True
        report = await hfg.run_async(graph)
        assert sink.values == [10, 20, 30, 40, 50, 60]
        assert report.duration_s == 1.0
        assert [report.nodes[name].firings for name in MEMBERS] == [7] * 4

    in_virtual_time(main())
    assert exits == ["lingers", "numbers"]


@pytest.mark.rule("R3")
def test_a_pause_ends_the_wave_behind_the_call_that_gives_way_and_steps_go_on_from_there() -> None:
    async def main() -> None:
        turns = Turns()
        graph, sink = lingering(turns)
        async with hfg.running(graph) as live:
            await turns.inside.wait()
            live.pause()
            turns.over = True
            await live.wait_paused()
            assert sink.values == [10, 20]
            assert (await live.step(graph["scale"])).moved == ("scale",)
            assert (await live.step(graph["last"])).moved == ("last",)
            live.resume()
            await live.wait_finished()
        assert sink.values == [10, 20, 30, 40, 50, 60]

    in_virtual_time(main())


@pytest.mark.rule("P8")
def test_a_parameter_set_while_a_wave_gives_way_holds_for_a_member_that_has_not_fired_yet() -> None:
    async def main() -> None:
        turns = Turns()
        graph, sink = lingering(turns)
        async with hfg.running(graph) as live:
            await turns.inside.wait()
            live.set(graph["scale"].ports.parameters["factor"], 100)
            live.set(graph["scale"].ports.parameters["factor"], 1000)
            turns.over = True
            await live.wait_finished()
        assert sink.values == [10, 20, 3000, 4000, 5000, 6000]

    in_virtual_time(main())


@pytest.mark.rule("F9", "F10")
@pytest.mark.parametrize("slot", ["disable", "activate", "reset"])
@pytest.mark.parametrize("which", MEMBERS)
def test_a_signal_to_a_member_of_a_wave_that_gives_way_does_what_it_does_amid_single_firings(
    which: str, slot: str
) -> None:
    async def kept(fast: bool) -> tuple[list[Any], dict[str, int], tuple[str, ...]]:
        turns = Turns()
        graph, sink = lingering(turns)
        async with hfg.running(graph, fast=fast) as live:
            await turns.inside.wait()
            await live.trigger(graph[which].ports.slots[slot])
            turns.over = True
            await live.wait_quiet()
            firings = {path: node.firings for path, node in live.statistics().nodes.items()}
            return sink.values, firings, tuple(live.active())

    assert in_virtual_time(kept(fast=True)) == in_virtual_time(kept(fast=False))


@pytest.mark.rule("R4")
@pytest.mark.parametrize("which", MEMBERS)
def test_a_member_is_removed_while_its_wave_gives_way(which: str) -> None:
    async def main() -> None:
        turns = Turns()
        graph, sink = lingering(turns)
        async with hfg.running(graph) as live:
            await turns.inside.wait()
            edit = asyncio.create_task(live.edit(c.Remove(which)))
            await asyncio.sleep(0)
            turns.over = True
            await edit
            await live.wait_finished()
        assert sink.values[:2] == [10, 20]
        assert len(sink.values) <= 3

    in_virtual_time(main())


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
        graph, sink = lingering(turns, on_error=policy)
        turns.over = True
        try:
            report = await hfg.run_async(graph, fast=fast)
        except hfg.errors.RunError as problem:
            return sink.values, str(problem)
        return sink.values, report.outcome

    assert in_virtual_time(outcome(fast=True)) == in_virtual_time(outcome(fast=False))


@pytest.mark.rule("X1")
def test_the_error_behind_a_turn_names_the_member_and_its_firing() -> None:
    async def fails() -> None:
        raise ValueError("no")

    async def main() -> None:
        turns = Turns(then=fails)
        graph, _ = lingering(turns)
        turns.over = True
        with pytest.raises(hfg.errors.RunError, match='"lingers" failed in firing 3'):
            await hfg.run_async(graph)

    in_virtual_time(main())


@pytest.mark.rule("R5", "X3")
def test_a_run_that_is_stopped_while_a_wave_gives_way_counts_what_has_fired() -> None:
    async def main() -> None:
        turns = Turns()
        graph, sink = lingering(turns)
        async with hfg.running(graph) as live:
            await turns.inside.wait()
            live.stop()
        report = live.report()
        assert report.outcome == "stopped"
        assert [report.nodes[name].firings for name in MEMBERS] == [3, 3, 2, 2]
        assert sink.values == [10, 20]

    in_virtual_time(main())


@pytest.mark.rule("X3")
def test_a_run_that_is_cancelled_while_a_wave_gives_way_is_torn_down() -> None:
    async def main() -> None:
        turns = Turns()
        graph, sink = lingering(turns)
        task = asyncio.create_task(hfg.run_async(graph))
        await turns.inside.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert sink.values == [10, 20]

    in_virtual_time(main())


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
        graph, sink = lingering(turns)
        async with hfg.running(graph) as live:
            await turns.inside.wait()
            live.statistics()
            live.report()
            turns.over = True
            await live.wait_finished()
            assert [live.statistics().nodes[name].firings for name in MEMBERS] == [7] * 4
        assert sink.values == [10, 20, 30, 40, 50, 60]

    in_virtual_time(main())

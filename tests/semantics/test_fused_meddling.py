"""Who meddles with a fused wave amid a call, in a thread or giving way on the loop, meets what single firings do.

Rules F9, F10, P8, R3, R5, X3.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import hfg
from hfg.engine.runtime import settings
from tests.semantics.meddling import MEMBERS, Gate, Turns

Kind = type[Gate] | type[Turns]
both_kinds = pytest.mark.parametrize("kind", [Gate, Turns])


@pytest.fixture(autouse=True)
def from_the_first_firing_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


@pytest.mark.rule("R3")
@both_kinds
def test_a_pause_ends_the_wave_behind_the_call_under_way_and_steps_go_on_from_there(kind: Kind) -> None:
    async def main() -> None:
        wave = kind()
        graph, sink = wave.graph()
        async with hfg.running(graph) as live:
            await wave.until_inside()
            live.pause()
            wave.go_on()
            await live.wait_paused()
            assert sink.values == [10, 20]
            assert (await live.step(graph["scale"])).moved == ("scale",)
            assert (await live.step(graph["last"])).moved == ("last",)
            live.resume()
            await live.wait_finished()
        assert sink.values == [10, 20, 30, 40, 50, 60]

    kind.run(main())


@pytest.mark.rule("P8")
@both_kinds
def test_a_parameter_set_amid_a_wave_holds_for_a_member_that_has_not_fired_yet(kind: Kind) -> None:
    async def main() -> None:
        wave = kind()
        graph, sink = wave.graph()
        async with hfg.running(graph) as live:
            await wave.until_inside()
            live.set(graph["scale"].ports.parameters["factor"], 100)
            live.set(graph["scale"].ports.parameters["factor"], 1000)
            wave.go_on()
            await live.wait_finished()
        assert sink.values == [10, 20, 3000, 4000, 5000, 6000]

    kind.run(main())


@pytest.mark.rule("F9", "F10")
@pytest.mark.parametrize("slot", ["disable", "activate", "reset"])
@pytest.mark.parametrize("which", MEMBERS)
@both_kinds
def test_a_signal_to_a_member_amid_a_wave_does_what_it_does_amid_single_firings(
    kind: Kind, which: str, slot: str
) -> None:
    async def kept(fast: bool) -> tuple[list[Any], dict[str, int], tuple[str, ...]]:
        wave = kind()
        graph, sink = wave.graph()
        async with hfg.running(graph, fast=fast) as live:
            await wave.until_inside()
            await live.trigger(graph[which].ports.slots[slot])
            wave.go_on()
            await live.wait_quiet()
            firings = {path: node.firings for path, node in live.statistics().nodes.items()}
            return sink.values, firings, tuple(live.active())

    assert kind.run(kept(fast=True)) == kind.run(kept(fast=False))


@pytest.mark.rule("R5", "X3")
@both_kinds
def test_a_run_that_is_stopped_amid_a_wave_counts_what_has_fired(kind: Kind) -> None:
    async def main() -> None:
        wave = kind()
        graph, sink = wave.graph()
        async with hfg.running(graph) as live:
            await wave.until_inside()
            live.stop()
            if kind is Gate:  # what gives way is cancelled instead
                wave.go_on()
        assert live.report().outcome == "stopped"
        assert [live.report().nodes[name].firings for name in MEMBERS] == [3, 3, 2, 2]
        assert sink.values == [10, 20]

    kind.run(main())


@pytest.mark.rule("X3")
@both_kinds
def test_a_run_that_is_cancelled_amid_a_wave_is_torn_down(kind: Kind) -> None:
    async def main() -> None:
        wave = kind()
        graph, sink = wave.graph()
        task = asyncio.create_task(hfg.run_async(graph))
        await wave.until_inside()
        task.cancel()
        if kind is Gate:
            wave.go_on()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert sink.values[:2] == [10, 20]

    kind.run(main())

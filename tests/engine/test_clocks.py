"""What time it is: `now`, `elapsed` and their zeros; a clock of the machine that jumps touches no run (rule R6)."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator

import pytest

import hfg
from hfg.testing import fire, reference_run
from tests.semantics.nodes import Clock, KeepTokens, drive, run


@hfg.node
def ticks(*, count: int = 4) -> Iterator[tuple[float, float]]:
    for _ in range(count):
        yield hfg.now(), hfg.elapsed()


class Times(hfg.Node):
    value = hfg.Input(object)
    times = hfg.State(factory=list[object])

    def setup(self) -> None:
        self.times.append(hfg.elapsed())

    def process(self, value: object) -> None:
        self.times.append(value)


def ticking(**options: float) -> tuple[hfg.Graph, Times]:
    graph = hfg.Graph()
    node = graph.add(Times())
    graph.connect(graph.add(ticks(), **options).out, node.value)  # type: ignore[arg-type]
    return graph, node


@pytest.mark.rule("R6")
def test_in_virtual_time_both_begin_at_zero_with_the_run_and_have_no_noise() -> None:
    graph, node = ticking(max_rate_hz=10)
    report = run(graph)
    assert node.times == [0.0, (0.0, 0.0), (0.1, 0.1), (0.2, 0.2), (0.3, 0.3)]
    assert report.duration_s == 0.4


@pytest.mark.rule("R6")
def test_elapsed_counts_from_the_run_where_now_counts_from_the_loop() -> None:
    async def main() -> tuple[list[object], float, float, float]:
        graph, node = ticking(max_rate_hz=10)
        await asyncio.sleep(0.7)
        async with hfg.running(graph) as live:
            await asyncio.sleep(0.1)
            amid = live.elapsed()
            await live.wait_finished()
        after = live.elapsed()
        await asyncio.sleep(5)
        assert (amid, live.now()) == (0.1, 6.1)
        return node.times, amid, after, live.elapsed()

    times, _, after, later = drive(main)
    assert times == [0.0, (0.7, 0.0), (0.8, 0.1), (0.9, 0.2), (1.0, 0.3)]
    assert after == later == 0.4


@pytest.mark.rule("R6")
def test_on_the_real_clock_elapsed_is_the_run_s_and_now_is_the_date() -> None:
    graph, node = ticking()
    before = time.time()
    hfg.run(graph)
    setup, *others = node.times
    times: list[tuple[float, float]] = others  # type: ignore[assignment]
    assert 0 <= setup < 60  # type: ignore[operator]
    assert all(date >= before - 1e-3 and 0 <= since < 60 for date, since in times)


def test_outside_a_run_elapsed_has_no_zero_and_says_so() -> None:
    with pytest.raises(hfg.errors.NotRunning, match=r"counts from the start of the run.* run\.elapsed\(\)$"):
        hfg.elapsed()


def test_fire_and_the_oracle_tell_it_too() -> None:
    @hfg.node
    def since(value: int) -> float:
        return hfg.elapsed()

    assert fire(since(), value=1).outputs == {"out": 0.0}
    report = reference_run(ticking(max_rate_hz=10)[0])
    told = [elapsed for _, elapsed in report.values("ticks.out -> times.value")[:-1]]
    assert told == pytest.approx([0, 0.1, 0.2, 0.3])


@pytest.mark.rule("R6", "T5", "F11")
@pytest.mark.parametrize("step_s", [-86_400.0, 86_400.0])
def test_a_clock_of_the_machine_that_jumps_touches_no_run(monkeypatch: pytest.MonkeyPatch, step_s: float) -> None:
    """Somebody sets the date while a graph runs: it goes by the monotonic clock, with which it began."""
    date = time.time
    stepped: list[float] = []

    class Steps(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)

        def process(self, value: int) -> int:
            if value == 3:
                stepped.append(hfg.now())
                monkeypatch.setattr(time, "time", lambda: date() + step_s)
            return value

    graph = hfg.Graph()
    clock, steps, keep = graph.add(Clock(), max_rate_hz=200), graph.add(Steps()), graph.add(KeepTokens())
    graph.connect(clock.out, steps.value)
    graph.connect(steps.out, keep.value)

    async def main() -> None:
        async with hfg.running(graph) as live:
            async for token in live.tap(steps.out):
                if token.value == 8:
                    break
            assert live.elapsed() < 3600

    asyncio.run(main())
    stamps = [token.stamp for token in keep.tokens[:8]]
    assert stamps == sorted(stamps)
    assert stamps[-1] - stamps[0] < 3600
    assert stepped

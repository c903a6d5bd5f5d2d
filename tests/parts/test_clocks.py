"""One clock for all parts of a run (rules T5, R6)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

import hfg
from hfg.parts.model.clocks import DRIFT, Offset
from hfg.parts.processes import worker


@pytest.mark.slow
@pytest.mark.rule("T5")
@given(
    offset_s=st.floats(-1e6, 1e6),
    drift=st.floats(-DRIFT / 2, DRIFT / 2),
    rounds=st.lists(st.tuples(st.floats(0, 2), st.floats(0, 2), st.floats(0, 100)), min_size=1, max_size=40),
)
def test_the_offset_is_never_further_off_than_it_says(
    offset_s: float, drift: float, rounds: list[tuple[float, float, float]]
) -> None:
    """However long either way took, and however much the two clocks drift apart."""

    def there(here: float) -> float:
        return here + offset_s + drift * here

    offset, now = Offset(), 1000.0
    assert offset.within_s(now) == float("inf")
    for there_s, back_s, pause_s in rounds:
        asked = now
        offset.hear(asked, there(asked + there_s), now := now + there_s + back_s)
        now += pause_s
        assert abs(offset.offset_s - (there(now) - now)) <= offset.within_s(now) + 1e-6
    used_s, later = offset.offset_s, now + 1000
    assert abs(used_s - (there(later) - later)) <= offset.error_of(used_s, later) + 1e-6


@pytest.mark.rule("T5")
def test_the_quickest_answer_is_believed_until_it_is_old() -> None:
    offset = Offset()
    offset.hear(0.0, 10.001, 0.002)
    assert offset.offset_s == 10.0
    assert offset.within_s(0.002) == pytest.approx(0.001, rel=1e-3)
    offset.hear(1.0, 11.4, 1.5)  # took long
    assert offset.offset_s == 10.0
    offset.hear(1000.0, 1010.05, 1000.02)  # better than one that may have drifted for a thousand seconds
    assert offset.offset_s == pytest.approx(10.04)


@hfg.node
async def ticks(*, count: int = 4) -> AsyncIterator[int]:
    for number in range(count):
        await asyncio.sleep(0.5)
        yield number


class Times(hfg.Node):
    """What time it is where it runs."""

    value = hfg.Input(int)
    out = hfg.Output(tuple[float, float])

    def process(self, value: int) -> tuple[float, float]:
        return round(hfg.now(), 6), round(hfg.elapsed(), 6)


def far_away() -> hfg.Graph:
    graph = hfg.Graph("far away")
    graph.group("far", process=True)
    source, here, there = graph.add(ticks()), graph.add(Times(), name="here"), graph.add(Times(), group="far")
    graph.connect(source.out, here.value)
    graph.connect(source.out, there.value)
    graph.connect(here.out, graph.output("here", tuple[float, float]))
    graph.connect(there.out, graph.output("there", tuple[float, float]))
    return graph


@pytest.mark.rule("T5", "R6")
def test_it_is_as_late_in_a_part_that_was_begun_later_as_in_the_whole() -> None:
    async def main() -> None:
        await asyncio.sleep(3)  # so that the clock and the time since the start differ
        graph = far_away()
        async with hfg.running(graph) as run:

            async def all_of(name: str) -> list[tuple[float, float]]:
                return [value async for value in run.read(graph.outputs[name])]

            here, there = await asyncio.gather(all_of("here"), all_of("there"))
        assert there == here == [(3 + at, at) for at in (0.5, 1.0, 1.5, 2.0)]
        assert run.report().clocks == {}

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


@pytest.mark.rule("T5")
def test_of_a_part_on_another_machine_it_is_told_how_far_its_clock_may_be_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(worker, "machine", lambda: "another one")
    report = hfg.run(far_away(), clock="virtual")
    assert report.outcome == "done"
    assert list(report.clocks) == ["far"]
    assert 0 < report.clocks["far"] < 60
    assert "clock within" in str(report)

"""Statistics of a run: counts that are exact, times that are measured, waiting that says what for (R7)."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from typing import Any, TypeVar

import msgspec
import pytest

import hfg
from hfg import commands
from hfg.engine.observing.meters import BATCH, KEPT, Distribution
from hfg.testing import Recorder

T = TypeVar("T")


def drive(main: Callable[[], Coroutine[Any, Any, T]]) -> T:
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main())


@hfg.node
def numbers(*, count: int = 10) -> Iterator[int]:
    """Count."""
    yield from range(count)


@hfg.node
async def slow_numbers(*, count: int = 3) -> AsyncIterator[int]:
    """Count slowly."""
    for number in range(count):
        await asyncio.sleep(1)
        yield number


@hfg.node
def work(value: int) -> int:
    """Work a little."""
    until = time.perf_counter() + 0.0005
    while time.perf_counter() < until:
        pass
    return value


@hfg.node
async def ask(value: int) -> int:
    """Wait for two seconds, keeping nobody busy."""
    await asyncio.sleep(2)
    return value


@hfg.node
def odd(value: int) -> int | None:
    """Be silent about half of them."""
    return value if value % 2 else None


@hfg.node
def add(left: int, right: int) -> int:
    """Join."""
    return left + right


@hfg.node
def end(value: int) -> None:
    """Take."""


class Rings(hfg.Node):
    """Trigger for each value, several times."""

    value = hfg.Input(int)
    rang = hfg.Event(int)

    def process(self, value: int) -> None:
        """Three times."""
        for _ in range(3):
            self.rang.trigger(value)


class Ear(hfg.Node):
    """Hear."""

    @hfg.slot
    def hear(self, value: int) -> None:
        """Do nothing."""


def final(graph: hfg.Graph, **options: Any) -> hfg.Statistics:
    """The statistics of a whole run in virtual time."""

    async def main() -> hfg.Statistics:
        async with hfg.running(graph, **options) as run:
            run.statistics()  # from here on times are measured
            await run.wait_finished()
            return run.statistics()

    return drive(main)


def line(*nodes: Any, rate: float | None = None, count: int = 10, **options: Any) -> hfg.Graph:
    graph = hfg.Graph("line")
    port: Any = graph.add(numbers(count=count), name="source", max_rate_hz=rate).out
    for node in nodes:
        graph.add(node, **options)
        graph.connect(port, node.ports.inputs["value"])
        port = next(iter(node.ports.outputs.values()), None)
    return graph


@pytest.mark.rule("R7")
@pytest.mark.parametrize("fast", [True, False])
def test_counts_are_those_of_the_report(fast: bool) -> None:
    graph = line(odd(), end())

    async def main() -> tuple[hfg.Statistics, hfg.Report]:
        async with hfg.running(graph, fast=fast) as run:
            report = await run.wait_finished()
            return run.statistics(), report

    statistics, report = drive(main)
    assert (statistics.outcome, statistics.firings) == ("done", report.firings)
    for path, node in report.nodes.items():
        for field in msgspec.structs.asdict(node):
            assert getattr(statistics.nodes[path], field) == getattr(node, field), (path, field)
    for label, edge in report.edges.items():
        for field in msgspec.structs.asdict(edge):
            assert getattr(statistics.edges[label], field) == getattr(edge, field), (label, field)
    assert statistics.groups["loop"].firings == report.firings


@pytest.mark.parametrize("fast", [True, False])
def test_busy_time_is_that_of_the_code(fast: bool) -> None:
    statistics = final(line(work(), end(), count=40), fast=fast)
    busy = statistics.nodes["work"].busy
    assert busy.mean_s >= 0.0005
    assert busy.p50_s >= 0.0004
    assert busy.p50_s <= busy.p99_s <= busy.max_s
    assert busy.total_s == pytest.approx(busy.mean_s * 40)
    assert len(busy.last_s) == busy.count
    assert statistics.nodes["work"].busy_share > statistics.nodes["end"].busy_share
    assert statistics.groups["loop"].busy_s >= statistics.nodes["work"].busy.total_s
    assert 0 < statistics.groups["loop"].busy_share <= 1


@pytest.mark.parametrize("fast", [True, False])
def test_of_a_very_fast_node_some_firings_stand_for_all(fast: bool) -> None:
    statistics = final(line(odd(), end(), count=2000), fast=fast)
    node = statistics.nodes["odd"]
    assert node.processed == 2000
    assert BATCH <= node.busy.count <= 2000
    assert node.busy.total_s == pytest.approx(node.busy.mean_s * 2000, rel=0.1)
    assert len(node.busy.last_s) <= KEPT


def test_async_code_that_waits_is_at_work_but_keeps_nobody_busy() -> None:
    statistics = final(line(ask(), end(), count=3))
    node = statistics.nodes["ask"]
    assert node.busy.count == 3
    assert node.latency.mean_s == pytest.approx(2.0)  # on the run's clock
    assert node.busy_share <= 1.0
    assert statistics.duration_s == pytest.approx(6.0)
    assert "input value" not in node.waiting or node.waiting["input value"] < 0.1


def test_async_generators_slot_calls_and_threads_are_measured_too() -> None:
    graph = hfg.Graph("kinds")
    graph.group("aside", threads=1)
    source, rings, ear = graph.add(slow_numbers()), graph.add(Rings(), group="aside"), graph.add(Ear())
    graph.connect(source.out, rings.value)
    graph.connect(rings.rang, ear.hear)
    statistics = final(graph)
    assert [statistics.nodes[name].busy.count for name in ("slow_numbers", "rings", "ear")] == [4, 3, 9]
    assert statistics.nodes["ear"].calls == 9
    assert (statistics.groups["aside"].nodes, statistics.groups["aside"].firings) == (1, 4)
    assert statistics.groups["loop"].calls == 9


@pytest.mark.rule("R6", "R7")
def test_waiting_says_what_for_and_how_long() -> None:
    graph = hfg.Graph("waits")
    quick, slow = graph.add(numbers(count=5), name="quick"), graph.add(slow_numbers(count=5), name="slow")
    join, last = graph.add(add()), graph.add(end())
    graph.add(Ear())
    graph.connect(quick.out, join.left)
    graph.connect(slow.out, join.right)
    graph.connect(join.out, last.value)
    statistics = final(graph)
    assert statistics.duration_s == pytest.approx(5.0)
    assert statistics.nodes["add"].waiting == {"input right": pytest.approx(5.0)}
    assert statistics.nodes["end"].waiting == {"input value": pytest.approx(5.0)}
    assert statistics.nodes["quick"].waiting["output out"] == pytest.approx(5.0)
    assert statistics.nodes["slow"].waiting == {}  # its code is under way all the time
    assert statistics.nodes["ear"].waiting == {"signal": pytest.approx(5.0)}


def test_a_rate_and_a_full_queue_are_waited_for_by_name() -> None:
    assert final(line(end(), rate=10)).nodes["source"].waiting == {"rate": pytest.approx(1.0)}
    graph = hfg.Graph("full")
    rings = graph.add(Rings())
    graph.connect(graph.add(numbers(count=3), name="source").out, rings.value)
    slow = graph.add(ask())
    graph.connect(rings.rang, slow.value, capacity=2)
    graph.connect(slow.out, graph.add(end()).value)
    statistics = final(graph)
    assert statistics.nodes["rings"].waiting["queue"] > 5.0
    edge = statistics.edges["rings.rang -> ask.value"]
    assert (edge.sent, edge.deepest, edge.capacity, edge.untaken) == (10, 4, 2, 0)


def test_a_snapshot_tells_the_state_of_the_moment_and_stays_as_it_is() -> None:
    async def main() -> tuple[hfg.Statistics, hfg.Statistics]:
        graph = line(ask(), end(), count=3)
        async with hfg.running(graph) as run:
            run.statistics()
            await asyncio.sleep(1)
            early = run.statistics()
            await run.wait_finished()
            return early, run.statistics()

    early, late = drive(main)
    assert early.outcome == "running"
    assert {path: node.doing for path, node in early.nodes.items()} == {
        "source": "output out",
        "ask": "working",
        "end": "input value",
    }
    assert early.nodes["source"].firings < late.nodes["source"].firings
    with pytest.raises(AttributeError):
        late.nodes["ask"].firings = 3  # type: ignore[misc]


def test_a_rate_is_that_of_the_last_one_to_two_seconds() -> None:
    async def main() -> list[float]:
        async with hfg.running(line(end(), rate=20, count=100_000)) as run:
            run.statistics()
            rates = []
            for _ in range(3):
                await asyncio.sleep(2.5)
                now = run.statistics()
                rates += [now.nodes["end"].rate_hz, now.edges["source.out -> end.value"].rate_hz]
            return rates

    assert drive(main) == pytest.approx([20.0] * 6, rel=0.06)


@pytest.mark.rule("A1", "R7")
def test_activity_share_is_the_part_of_the_time() -> None:
    class Patient(hfg.Node):
        """Active for a while."""

        @hfg.slot
        def begin(self) -> None:
            """Be active."""

    graph = hfg.Graph("active")
    patient, other = graph.add(Patient(), name="patient", active_for_s=3.0), graph.add(Ear(), name="other")
    graph.start.activates(patient.begin)
    graph.connect(patient.timeout, other.activate, active=True)
    graph.connect(graph.add(slow_numbers(count=4)).out, graph.add(end()).value)
    statistics = final(graph)
    assert statistics.nodes["patient"].active_share == pytest.approx(0.75)
    assert statistics.nodes["other"].active_share == pytest.approx(0.25)


def test_statistics_are_json() -> None:
    statistics = final(line(odd(), end()))
    again = msgspec.json.decode(msgspec.json.encode(statistics), type=hfg.Statistics)
    assert again == statistics


def test_nodes_inside_an_iteration_have_theirs() -> None:
    @hfg.node
    def lists() -> Iterator[list[int]]:
        """Two lists."""
        yield [1, 2, 3]
        yield [4]

    class Each(hfg.Subgraph):
        """One element at a time."""

        value = hfg.Input(int)
        out = hfg.Output(int)

        def build(self, graph: hfg.Graph) -> None:
            """One node."""
            one = graph.add(odd(), name="one")
            graph.connect(self.value.inner, one.value)
            graph.connect(one.out, self.out.inner)

    graph = hfg.Graph("each")
    each = graph.add(Each(), name="each", iterate_over=["value"])
    graph.connect(graph.add(lists()).out, each.ports.inputs["value"])
    statistics = final(graph)
    assert statistics.nodes["each/one"].firings == 4
    assert statistics.nodes["each/one"].busy.count == 4


@pytest.mark.rule("R7")
@pytest.mark.parametrize("fast", [True, False])
def test_measuring_changes_nothing(fast: bool) -> None:
    def trace(measured: bool) -> Recorder:
        async def main() -> Recorder:
            graph = hfg.Graph("same")
            source, rings, ear = graph.add(slow_numbers()), graph.add(Rings()), graph.add(Ear())
            graph.connect(source.out, rings.value)
            graph.connect(rings.rang, ear.hear)
            slow = graph.add(ask(), on_error="skip", max_duration_s=1.0)
            graph.connect(rings.rang, slow.value)
            graph.connect(slow.out, graph.add(odd()).value)
            recorder = Recorder()
            async with hfg.running(graph, fast=fast, trace=recorder) as run:
                if measured:
                    run.statistics()
                await run.wait_finished()
            return recorder

        return drive(main)

    assert trace(True) == trace(False)


def test_measuring_may_begin_in_the_middle_with_a_generator_under_way() -> None:
    async def main() -> hfg.Statistics:
        graph = line(end(), rate=10, count=10)
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.45)
            assert run.statistics().nodes["source"].firings == 5
            await run.wait_finished()
            return run.statistics()

    statistics = drive(main)
    assert statistics.nodes["source"].firings == 11
    assert statistics.nodes["end"].busy.count == 5
    assert statistics.measured_s == pytest.approx(statistics.duration_s - 0.45)


def test_on_the_machines_clock_waiting_is_looked_at_now_and_then() -> None:
    async def main() -> hfg.Statistics:
        async with hfg.running(line(end(), rate=100, count=15)) as run:
            run.statistics()
            await run.wait_finished()
            return run.statistics()

    statistics = asyncio.run(main())
    source = statistics.nodes["source"]
    assert source.busy.count in (15, 16)  # the firing that ends it is measured only where it is interpreted
    assert 0 < source.waiting["rate"] <= statistics.duration_s
    assert statistics.nodes["end"].latency.max_s < 1.0


@pytest.mark.parametrize("scale", [1e-7, 1e-3, 10.0])
def test_percentiles_are_right_within_seven_percent(scale: float) -> None:
    distribution = Distribution()
    assert distribution.percentiles() == (0.0, 0.0)
    values = [scale * (1 + number) / 1000 for number in range(1000)]
    for start in range(0, 1000, BATCH):
        distribution.add(values[start : start + BATCH], 1.0)
    median, slow = distribution.percentiles()
    assert median == pytest.approx(scale * 0.5, rel=0.07)
    assert slow == pytest.approx(scale * 0.99, rel=0.07)
    assert distribution.longest == scale
    assert distribution.mean == pytest.approx(scale * 0.5005)


@hfg.node
def twice(value: int) -> int:
    """Another function with the same ports."""
    return value * 2


@pytest.mark.rule("R4")
@pytest.mark.parametrize("fast", [True, False])
def test_a_node_that_takes_the_place_of_another_is_measured_and_runs_its_own_code(fast: bool) -> None:
    seen: list[int] = []

    @hfg.node
    def keep(value: int) -> None:
        """Keep."""
        seen.append(value)

    async def main() -> hfg.Statistics:
        async with hfg.running(line(work(), keep(), rate=10, count=6), fast=fast) as run:
            run.statistics()
            await asyncio.sleep(0.25)
            await run.edit(commands.Replace("work", f"{__name__}:twice"))
            await run.wait_finished()
            return run.statistics()

    statistics = drive(main)
    assert seen == [0, 1, 2, 6, 8, 10]
    (path,) = [path for path in statistics.nodes if path not in ("source", "keep")]
    assert statistics.nodes[path].busy.count == 6


def test_joins_and_forks_are_measured_without_losing_their_short_ways() -> None:
    graph = hfg.Graph("diamond")
    source, left, right, join = graph.add(numbers(count=500)), graph.add(twice()), graph.add(twice()), graph.add(add())
    for node, port in ((left, join.left), (right, join.right)):
        graph.connect(source.out, node.ports.inputs["value"])
        graph.connect(node.out, port)
    graph.connect(join.out, graph.add(end()).value)
    statistics = final(graph)
    found = statistics.nodes["add"]
    assert found.processed == 500
    assert BATCH <= found.busy.count == found.latency.count < 500

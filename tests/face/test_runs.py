"""Runs as the face shows them: `run`, `run_async`, `running` and all that one can do in its block."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine, Iterator
from typing import Any, NamedTuple

import pytest

import hfg
from tests.limits import patience


class Pose(NamedTuple):
    x: float


class MapLookup(hfg.Node):
    key = hfg.Input(int)
    pose = hfg.Output(Pose)
    unknown = hfg.Event(int)
    asked = hfg.State(0)

    def process(self, key: int) -> Pose | None:
        self.asked += 1
        self.asked_by_run = [*getattr(self, "asked_by_run", []), key]
        if key > 100:
            self.unknown.trigger(key)
            return None
        return Pose(float(key))


class Wait(hfg.Node):
    begun = hfg.State(factory=list)
    done = hfg.Event(str)

    @hfg.slot
    def begin(self) -> None:
        self.begun.append(self.active)

    @hfg.slot
    def finish(self, word: str) -> None:
        self.done.trigger(word)


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    yield from range(count)


@hfg.node
def show(value: int) -> None: ...


class Fetch:
    """The graph of the face, with its ports at hand."""

    def __init__(self) -> None:
        self.graph = graph = hfg.Graph("fetch")
        self.lookup = lookup = graph.add(MapLookup())
        self.wait = graph.add(Wait())
        self.keys = keys = graph.input("keys", int)
        graph.connect(keys, lookup.key)
        self.poses = poses = graph.output("poses", Pose)
        graph.connect(lookup.pose, poses)


@pytest.fixture
def fetch() -> Fetch:
    return Fetch()


def counting(count: int = 3, **options: Any) -> hfg.Graph:
    graph = hfg.Graph("counting")
    graph.connect(graph.add(numbers(count=count), **options).out, graph.output("numbers", int))
    return graph


LOOPS = {"real": None, "virtual": hfg.VirtualTimeLoop}


@pytest.fixture(params=LOOPS)
def drive(request: pytest.FixtureRequest) -> Callable[[Coroutine[Any, Any, Any]], Any]:
    """Run a program on a real loop and on one in virtual time; nothing of the run may be left behind."""

    def run(main: Coroutine[Any, Any, Any]) -> Any:
        async def guarded() -> Any:
            async with asyncio.timeout(10):
                result = await main
            await asyncio.sleep(0)
            left = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
            assert not left, left
            return result

        before = set(threading.enumerate())
        with asyncio.Runner(loop_factory=LOOPS[request.param]) as runner:
            result = runner.run(guarded())
        left = [
            thread
            for thread in threading.enumerate()
            if thread not in before and thread.name.startswith("hfg") and "watch" not in thread.name
        ]
        assert not left, left
        return result

    return run


# --- run and run_async ---


def test_run_in_virtual_time_ends_after_until_s() -> None:
    graph = counting(count=1_000_000, max_rate_hz=1)
    # --- as written ---
    report = hfg.run(graph, clock="virtual", until_s=600, debug=True)
    # --- so far ---
    assert report.outcome == "until"
    assert report.duration_s == 600
    assert len(report.outputs["numbers"]) in (600, 601)


def test_run_async_gives_the_same_report(drive: Any) -> None:
    async def main() -> hfg.Report:
        report = await hfg.run_async(counting())
        return report  # noqa: RET504 - the line as the face has it

    assert drive(main()).outputs == {"numbers": [0, 1, 2]}


def test_run_in_a_running_loop_says_to_write_the_other_line(drive: Any) -> None:
    async def main() -> None:
        with pytest.raises(hfg.errors.UsageError, match=r"report = await hfg\.run_async\(graph\)"):
            hfg.run(counting())

    drive(main())


def test_debug_refuses_a_value_that_is_not_of_its_ports_type() -> None:
    @hfg.node
    def liar() -> Iterator[int]:
        yield "three"  # type: ignore[misc]

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.connect(graph.add(liar()).out, graph.add(show()).value)
        return graph

    assert hfg.run(build(), clock="virtual").outcome == "done"
    with pytest.raises(hfg.errors.NodeError, match=r"liar.*int"):
        hfg.run(build(), clock="virtual", debug=True)


# --- the block ---


def test_trigger_with_activity_makes_the_node_active(fetch: Fetch, drive: Any) -> None:
    async def main() -> None:
        wait = fetch.wait
        async with hfg.running(fetch.graph) as run:
            assert run.active() == []
            await run.trigger(wait.begin, activity=+1)
            await run.wait_quiet()
            assert run.active() == ["wait"]
            assert wait.begun == [True]
            assert wait.active

    drive(main())


def test_send_returns_when_the_graph_has_processed_the_token(fetch: Fetch, drive: Any) -> None:
    async def main() -> list[Pose]:
        keys, poses, lookup = fetch.keys, fetch.poses, fetch.lookup
        read: list[Pose] = []
        async with hfg.running(fetch.graph) as run:

            async def reading() -> None:
                async for pose in run.read(poses):
                    read.append(pose)  # noqa: PERF401

            reader = asyncio.create_task(reading())
            async with run.feed(keys) as feed:
                await feed.send(3)
                assert lookup.asked == 1
                await feed.send(4)
                assert lookup.asked == 2
            await reader  # the feed's end is the reader's
            report = await run.wait_finished()
        assert report.outcome == "done"
        return read

    assert drive(main()) == [Pose(3.0), Pose(4.0)]


def test_reader_that_does_not_read_holds_the_graph_back(fetch: Fetch, drive: Any) -> None:
    async def main() -> None:
        async with hfg.running(fetch.graph) as run, run.feed(fetch.keys, end=False) as feed:
            sending = asyncio.create_task(feed.send(3))
            await run.wait_quiet()
            assert not sending.done()
            async for pose in run.read(fetch.poses):
                assert pose == Pose(3.0)
                break
            await sending

    drive(main())


def test_threads_send_in_order(fetch: Fetch, drive: Any) -> None:
    async def main() -> list[Pose]:
        read: list[Pose] = []
        async with hfg.running(fetch.graph) as run:

            async def reading() -> None:
                async for pose in run.read(fetch.poses):
                    read.append(pose)  # noqa: PERF401

            reader = asyncio.create_task(reading())
            async with run.feed(fetch.keys) as feed:

                def driver() -> None:
                    futures = [feed.send_from_thread(number) for number in range(5)]
                    futures[-1].result(timeout=patience(5))
                    assert all(future.done() for future in futures)

                await asyncio.to_thread(driver)
            await reader
        return read

    assert drive(main()) == [Pose(float(number)) for number in range(5)]


def test_two_feeds_of_one_input_take_turns_until_one_ends_it(fetch: Fetch, drive: Any) -> None:
    async def main() -> None:
        async with hfg.running(fetch.graph) as run:

            async def reading() -> list[float]:
                return [pose.x async for pose in run.read(fetch.poses)]

            async def feeding(numbers: range, end: bool) -> None:
                async with run.feed(fetch.keys, end=end) as feed:
                    for number in numbers:
                        await feed.send(number)

            reader = asyncio.create_task(reading())
            await asyncio.gather(feeding(range(5), False), feeding(range(10, 15), False))
            async with run.feed(fetch.keys) as late:
                await feeding(range(20, 21), True)
                with pytest.raises(hfg.errors.UsageError, match='"keys" has ended'):
                    await late.send(1)
            assert sorted(await reader) == [0, 1, 2, 3, 4, 10, 11, 12, 13, 14, 20]

    drive(main())


def test_tap_looks_at_a_port_and_never_slows_the_graph(fetch: Fetch, drive: Any) -> None:
    async def main() -> list[Any]:
        tapped: list[Any] = []
        async with hfg.running(fetch.graph) as run:

            async def tapping() -> None:
                async for token in run.tap(fetch.lookup.pose):
                    tapped.append(token.value)  # noqa: PERF401

            async def reading() -> None:
                async for _ in run.read(fetch.poses):
                    pass

            tap, reader = asyncio.create_task(tapping()), asyncio.create_task(reading())
            await asyncio.sleep(0)
            async with run.feed(fetch.keys) as feed:
                for key in (1, 2):
                    await feed.send(key)
            await run.wait_finished()
            await asyncio.gather(tap, reader)  # both end with the run
        return tapped

    assert drive(main()) == [Pose(1.0), Pose(2.0), hfg.END]


def test_run_ends_behind_the_last_value_that_a_slow_reader_takes(drive: Any) -> None:
    async def main() -> tuple[str, list[int]]:
        graph, read = counting(), []
        async with hfg.running(graph) as run:

            async def reading() -> None:
                async for number in run.read(graph.outputs["numbers"]):
                    await asyncio.sleep(0.01)
                    read.append(number)

            reader = asyncio.create_task(reading())
            report = await run.wait_finished()
            await reader
        return report.outcome, read

    assert drive(main()) == ("done", [0, 1, 2])


def test_two_readers_share_out_the_values_and_a_late_one_finds_the_end(drive: Any) -> None:
    async def main() -> None:
        graph = counting(count=6)
        async with hfg.running(graph) as run:

            async def reading() -> list[int]:
                read = []
                async for number in run.read("numbers"):
                    read.append(number)
                    await asyncio.sleep(0.01)
                return read

            first, second = await asyncio.gather(reading(), reading())
            assert sorted(first + second) == list(range(6))
            assert first
            assert second
            assert await reading() == []

    drive(main())


def test_output_that_nobody_reads_stalls_a_run_that_waits_for_its_end(drive: Any) -> None:
    async def main() -> None:
        with pytest.raises(hfg.errors.Stalled, match=r'stalled: graph output "numbers" is not read .*run\.read'):
            async with hfg.running(counting()) as run:
                await run.wait_finished()

    drive(main())


def test_feed_and_read_take_ports_of_the_graph_and_nothing_else(fetch: Fetch, drive: Any) -> None:
    async def main() -> None:
        async with hfg.running(fetch.graph) as run:
            wrong: Any
            for wrong in (fetch.lookup.key, fetch.poses, "key", None, 3):
                with pytest.raises(hfg.errors.UsageError, match=r'is no input of graph "fetch", which has "keys"'):
                    run.feed(wrong)
            for wrong in (fetch.lookup.pose, fetch.keys, "pose", None):
                with pytest.raises(hfg.errors.UsageError, match=r'is no output of graph "fetch", which has "poses"'):
                    run.read(wrong)
            assert run.feed("keys") is not None
            assert run.read("poses") is not None

    drive(main())


def test_event_is_an_observable_of_tokens(fetch: Fetch, drive: Any, capsys: pytest.CaptureFixture[str]) -> None:
    async def main() -> None:
        lookup = fetch.lookup
        async with hfg.running(fetch.graph) as run:
            lookup.unknown.map(lambda t: t.value).subscribe(print)
            await run.trigger(lookup.unknown, 300)
            await run.wait_quiet()

    drive(main())
    assert capsys.readouterr().out == "300\n"


def test_wait_for_gives_the_next_signal(fetch: Fetch, drive: Any) -> None:
    async def main() -> None:
        async with hfg.running(fetch.graph) as run:
            waiting = asyncio.create_task(run.wait_for(fetch.wait.done))
            await asyncio.sleep(0)
            await run.trigger(fetch.wait.finish, "now")
            token = await waiting
            assert token.value == "now"

    drive(main())


def test_statistics_tell_what_was_done_so_far(drive: Any) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.connect(graph.add(numbers(count=3)).out, graph.add(show()).value)
        async with hfg.running(graph) as run:
            assert run.statistics().firings == 0
            assert run.statistics().outcome == "running"
            await run.wait_quiet()
            assert run.statistics().nodes["show"].processed == 3
            report = await run.wait_finished()
            assert report.outcome == "done"

    drive(main())


def test_block_holds_the_run_open_until_wait_finished(fetch: Fetch, drive: Any) -> None:
    async def main() -> None:
        async with hfg.running(fetch.graph) as run:
            await run.wait_quiet()
            await asyncio.sleep(0.01)
            assert run.statistics().outcome == "running"
            assert (await run.wait_finished()).outcome == "done"

    drive(main())


def test_leaving_the_block_stops_the_run(drive: Any) -> None:
    async def main() -> hfg.Report:
        async with hfg.running(counting(count=1_000_000, max_rate_hz=1000)) as run:
            async for number in run.read("numbers"):
                if number == 2:
                    break
        return run.report()

    assert drive(main()).outcome == "stopped"


def test_failure_of_the_run_comes_out_of_the_block(drive: Any) -> None:
    @hfg.node
    def fail(value: int) -> None:
        raise RuntimeError("broken wheel")

    async def main() -> None:
        graph = hfg.Graph()
        graph.connect(graph.add(numbers()).out, graph.add(fail()).value)
        with pytest.raises(hfg.errors.NodeError, match="broken wheel"):
            async with hfg.running(graph):
                await asyncio.sleep(3600)

    drive(main())


def test_error_of_the_block_comes_out_as_it_is(fetch: Fetch, drive: Any) -> None:
    async def main() -> None:
        with pytest.raises(KeyError, match="mine"):
            async with hfg.running(fetch.graph):
                raise KeyError("mine")

    drive(main())


@pytest.mark.slow
def test_whole_program_in_virtual_time() -> None:
    async def main() -> float:
        start = hfg.now()
        async with hfg.running(counting(count=100_000, max_rate_hz=1)) as run:
            async for number in run.read("numbers"):
                if number == 3600:
                    break
            assert run.now() == hfg.now()
            finished = hfg.now()
        assert hfg.now() == finished
        return finished - start

    # --- as written, with the result kept ---
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()) == pytest.approx(3600)


# --- fixed with it ---


def test_graph_has_one_run_at_a_time(drive: Any) -> None:
    async def main() -> None:
        graph = counting()
        async with hfg.running(graph) as run:
            with pytest.raises(hfg.errors.UsageError, match='graph "counting" runs already'):
                async with hfg.running(graph):
                    pass
            with pytest.raises(hfg.errors.UsageError, match='graph "counting" runs already'):
                await hfg.run_async(graph)
            numbers = [number async for number in run.read("numbers")]
            assert numbers == [0, 1, 2]
        assert (await hfg.run_async(graph)).outcome == "done"  # the refusals have not harmed it

    drive(main())


def test_second_run_starts_fresh(fetch: Fetch, drive: Any) -> None:
    """Neither state, nor what code wrote on the node, nor activity, nor tokens are left of the first."""

    async def main() -> None:
        lookup, wait = fetch.lookup, fetch.wait
        for _ in range(2):
            async with hfg.running(fetch.graph) as run:
                assert (lookup.asked, wait.begun, run.active()) == (0, [], [])
                assert not hasattr(lookup, "asked_by_run")
                await run.trigger(wait.begin, activity=+1)
                async with run.feed(fetch.keys) as feed:
                    sending = asyncio.create_task(feed.send(7))
                    await asyncio.sleep(0.01)
                    sending.cancel()
                    assert (lookup.asked, lookup.asked_by_run, run.active()) == (1, [7], ["wait"])
                    assert run.statistics().edges["map_lookup.pose -> poses"].untaken == 1
                    break  # a token lies before the reader; END is not waited for
        assert not wait.active

    drive(main())


def test_second_run_by_run_starts_fresh() -> None:
    graph = counting()
    first, second = hfg.run(graph, clock="virtual"), hfg.run(graph, clock="virtual")
    assert first == second


def test_events_are_refused_where_they_would_be_awaited(fetch: Fetch, drive: Any) -> None:
    async def main() -> None:
        async with hfg.running(fetch.graph):
            with pytest.raises(TypeError, match=r"run\.wait_for"):
                await fetch.lookup.unknown

    drive(main())


@pytest.mark.parametrize("debug", [False, True])
def test_thread_of_a_driver_may_trigger_events(drive: Any, debug: bool) -> None:
    """They are handed to the loop at once and in order, also while nothing else happens there."""

    class Driver(hfg.Node):
        seen = hfg.Event(int)

        def setup(self) -> None:
            self.thread = threading.Thread(target=self.work, daemon=True)

        @hfg.slot
        def begin(self) -> None:
            self.thread.start()

        def teardown(self) -> None:
            self.thread.join(patience(5))

        def work(self) -> None:
            for number in range(5):
                self.seen.trigger(number)

    class Ear(hfg.Node):
        heard = hfg.State(factory=list)

        @hfg.slot
        def hear(self, number: int) -> None:
            assert threading.current_thread() is threading.main_thread()
            self.heard.append(number)

    async def main() -> None:
        graph = hfg.Graph()
        driver, ear = graph.add(Driver()), graph.add(Ear())
        graph.connect(driver.seen, ear.hear)
        async with hfg.running(graph, debug=debug) as run:
            last = asyncio.create_task(run.wait_for(driver.seen))
            await asyncio.sleep(0)
            await run.trigger(driver.begin)
            await last
            while len(ear.heard) < 5:
                await asyncio.to_thread(threading.Event().wait, 0.001)
            assert ear.heard == [0, 1, 2, 3, 4]

    drive(main())

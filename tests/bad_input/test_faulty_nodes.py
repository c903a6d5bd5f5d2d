"""Nodes that raise, block, never come back, write wrongly or give back the wrong thing.

One clear sentence with the path.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import AsyncIterator
from typing import Any

import pytest

import hfg
from hfg.errors import NodeError
from tests.semantics.nodes import Ear, Keep, Ringing, drive, forward, numbers, run


def one(node: hfg.Node, *, count: int = 3, **options: Any) -> hfg.Graph:
    """A source, the node, and a sink behind its output if it has one."""
    graph = hfg.Graph()
    source = graph.add(numbers(count=count))
    graph.add(node, name="node", **options)
    graph.connect(source.out, next(iter(node.ports.inputs.values())))
    for output in node.ports.outputs.values():
        graph.connect(output, graph.add(Keep()).value)
    return graph


def sentence(graph: hfg.Graph, fast: bool, **options: Any) -> str:
    """What the failing run says."""
    with pytest.raises(NodeError) as raised:
        run(graph, fast, **options)
    assert raised.value.report.outcome == "failed"  # type: ignore[attr-defined]
    assert graph._run is None
    return str(raised.value)


# --- nodes that raise ---


@hfg.node
def broken(value: int) -> int:
    """Fails."""
    raise ZeroDivisionError("division by zero")


@hfg.node
async def broken_at_once(value: int) -> int:
    """Fails before it waits."""
    raise ZeroDivisionError("division by zero")


@hfg.node
async def broken_later(value: int) -> int:
    """Fails behind a wait."""
    await asyncio.sleep(1)
    raise ZeroDivisionError("division by zero")


@pytest.mark.parametrize("node", [broken, broken_at_once, broken_later])
def test_a_node_that_raises_is_named_with_its_firing(node: Any, fast: bool) -> None:
    expected = 'node "node" failed in firing 1: ZeroDivisionError: division by zero'
    assert sentence(one(node()), fast) == expected


def test_a_node_that_raises_in_a_thread_is_named_too() -> None:
    graph = one(broken(), group="work")
    graph.group("work", threads=1)
    assert sentence(graph, True) == 'node "node" failed in firing 1: ZeroDivisionError: division by zero'


@hfg.node
async def broken_source() -> AsyncIterator[int]:
    """Fails behind its first value."""
    yield 1
    raise ValueError("dry")


def test_a_source_that_raises_is_named(fast: bool) -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(broken_source()).out, graph.add(Keep()).value)
    assert sentence(graph, fast) == 'node "broken_source" failed in firing 2: ValueError: dry'


def test_the_users_frames_are_in_the_cause(fast: bool) -> None:
    with pytest.raises(NodeError) as raised:
        run(one(broken()), fast)
    cause = raised.value.__cause__
    assert cause is not None
    frame = cause.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    assert frame is not None
    assert frame.tb_frame.f_code.co_name == "broken"


class Hooked(hfg.Node):
    """Fails in one of its hooks."""

    fails = hfg.Parameter("")
    value = hfg.Input(int)
    asked = hfg.State(0)

    def fail(self, name: str) -> None:
        if self.fails == name:
            raise ValueError(f"in {name}")

    def setup(self) -> None:
        self.fail("setup")

    def ready(self) -> bool:
        self.fail("ready")
        return True

    def process(self, value: int) -> None:
        pass

    def end(self) -> None:
        self.fail("end")

    def teardown(self) -> None:
        self.fail("teardown")

    def on_activated(self) -> None:
        self.fail("on_activated")


@pytest.mark.parametrize("hook", ["setup", "ready", "end"])
def test_a_hook_that_raises_is_named(hook: str, fast: bool) -> None:
    assert sentence(one(Hooked(fails=hook)), fast) == f'node "node" failed in {hook}(): ValueError: in {hook}'


def test_a_teardown_that_raises_is_named_behind_a_run_that_went_well(fast: bool) -> None:
    with pytest.raises(
        hfg.errors.TeardownError, match=r'^node "node" failed in teardown\(\): ValueError: in teardown$'
    ):
        run(one(Hooked(fails="teardown")), fast)


def test_a_hook_of_activity_that_raises_is_named(fast: bool) -> None:
    graph = one(Hooked(fails="on_activated"))
    graph.connect(graph.start, graph["node"].activate)
    assert sentence(graph, fast) == 'node "node" failed in on_activated(): ValueError: in on_activated'


def test_a_ready_that_raises_is_not_asked_without_end_when_it_is_skipped(fast: bool) -> None:
    with pytest.raises(hfg.errors.Stalled, match='"node" says by ready'):
        run(one(Hooked(fails="ready"), on_error="skip"), fast)


# --- nodes that write wrongly ---


class Writes(hfg.Node):
    """Writes where it must not."""

    how = hfg.Parameter("")
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int | None:
        if self.how == "twice":
            self.out.send(1)
            self.out.send(2)
        elif self.how == "send and return":
            self.out.send(1)
            return 2
        return None

    @hfg.slot
    def hear(self, value: object) -> None:
        self.out.send(1)


def test_writing_an_output_twice_is_an_error_of_the_node(fast: bool) -> None:
    assert 'output "node.out" was written twice in one firing' in sentence(one(Writes(how="twice")), fast)
    assert 'output "node.out" was written twice in one firing' in sentence(one(Writes(how="send and return")), fast)


def test_writing_an_output_in_a_slot_handler_is_an_error_of_the_node(fast: bool) -> None:
    graph = one(Writes())
    graph.connect(graph.start, graph["node"].hear)
    said = sentence(graph, fast)
    assert said.startswith('node "node" failed in slot hear, call 1')
    assert 'output "node.out" was written in a slot handler' in said
    assert "trigger an event instead" in said


def test_writing_an_output_outside_a_firing_says_so(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        node = graph.add(Writes())
        async with hfg.running(graph, fast=fast):
            with pytest.raises(hfg.errors.UsageError, match='output "writes.out" was written outside a firing'):
                node.out.send(1)

    drive(main)


# --- nodes that give back the wrong thing ---


@hfg.node
def lies(value: int) -> int:
    """Says int, gives text."""
    return f"{value}"  # type: ignore[return-value]


def test_a_wrong_type_is_found_in_debug_mode_only(fast: bool) -> None:
    said = sentence(one(lies()), fast, debug=True)
    assert said == 'node "node" failed in firing 1: TypeError: output "node.out" is declared int, got str: \'1\''
    assert run(one(lies()), fast).outcome == "done"


class Pair(hfg.Node):
    value = hfg.Input(int)
    a = hfg.Output(int)
    b = hfg.Output(int)

    def process(self, value: int) -> Any:
        return (value,)


def test_a_result_that_does_not_fit_the_outputs_says_what_it_takes(fast: bool) -> None:
    said = sentence(one(Pair()), fast)
    assert 'node "node" failed in firing 1: TypeError' in said
    assert '"a", "b"' in said


def test_a_signal_of_the_wrong_type_is_found_in_debug_mode(fast: bool) -> None:
    class Rings(hfg.Node):
        value = hfg.Input(int)
        rang = hfg.Event(int)

        def process(self, value: int) -> None:
            self.rang.trigger("text")  # type: ignore[arg-type]

    graph = one(Rings())
    graph.connect(graph["node"].rang, graph.add(Ear()).hear)
    assert 'event "node.rang" is declared int, got str' in sentence(graph, fast, debug=True)


# --- nodes that block ---


class Blocks(hfg.Node):
    """Holds the loop."""

    value = hfg.Input(int)

    def process(self, value: int) -> None:
        time.sleep(0.15)


def test_a_node_that_blocks_the_loop_is_warned_about_once_with_path_and_remedy(
    caplog: pytest.LogCaptureFixture, fast: bool
) -> None:
    caplog.set_level(logging.WARNING)
    hfg.run(one(Blocks()), block_warning_s=0.04, fast=fast)
    warnings = [record for record in caplog.records if record.name.startswith("hfg")]
    assert len(warnings) == 1
    message = warnings[0].getMessage()
    assert message.startswith('node "node" has blocked the loop for more than 0.04 s')
    assert 'group="' in message
    assert warnings[0].path == "node"  # type: ignore[attr-defined]


def test_no_warning_when_none_is_wanted_or_the_node_is_quick_or_in_a_thread(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    hfg.run(one(Blocks(), count=1), block_warning_s=0)
    hfg.run(one(Blocks(), count=1), block_warning_s=1)
    graph = one(Blocks(), count=1, group="work")
    graph.group("work", threads=1)
    hfg.run(graph, block_warning_s=0.04)
    assert [record for record in caplog.records if record.name.startswith("hfg")] == []


# --- nodes that never come back ---


class Stuck(hfg.Node):
    """Its thread waits until the test lets it go."""

    value = hfg.Input(int)
    gate = threading.Event()

    def process(self, value: int) -> None:
        self.gate.wait(10)

    def teardown(self) -> None:
        raise AssertionError("it is not torn down while its code runs")


def test_a_thread_that_does_not_come_back_is_given_up_and_named() -> None:
    Stuck.gate.clear()
    graph = one(Stuck(), group="work", max_duration_s=0.05)
    graph.group("work", threads=1)
    try:
        with pytest.raises(
            hfg.errors.FiringTimeout, match='node "node" failed in firing 1: it took longer than max_dur'
        ):
            hfg.run(graph)
    finally:
        Stuck.gate.set()


def test_a_thread_that_does_not_come_back_at_the_end_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    Stuck.gate.clear()
    graph = one(Stuck(), group="work")
    graph.group("work", threads=1)

    async def main() -> None:
        async with hfg.running(graph) as running:
            running._engine.settings.teardown_limit_s = 0.1
            await asyncio.sleep(0.05)

    try:
        with pytest.raises(
            hfg.errors.TeardownError, match=r'node "node" failed in firing 1: its thread did not come back'
        ):
            asyncio.run(main())
    finally:
        Stuck.gate.set()


class SlowThread(hfg.Node):
    """Comes back a little later."""

    value = hfg.Input(int)
    story = hfg.State(factory=list)

    def process(self, value: int) -> None:
        self.story.append("in")
        time.sleep(0.1)
        self.story.append("out")

    def teardown(self) -> None:
        self.story.append("down")


def test_a_thread_has_its_time_to_come_back_before_its_node_is_torn_down() -> None:
    node = SlowThread()
    graph = one(node, count=1, group="work")
    graph.group("work", threads=1)

    async def main() -> None:
        async with hfg.running(graph):
            while not node.story:
                await asyncio.sleep(0.001)

    asyncio.run(main())
    assert node.story == ["in", "out", "down"]


@hfg.node
async def waits_for_ever(value: int) -> int:
    """Never comes back."""
    await asyncio.Event().wait()
    return value


def test_async_code_that_never_comes_back_is_given_up_at_its_limit(fast: bool) -> None:
    said = sentence(one(waits_for_ever(), max_duration_s=5), fast)
    assert said == 'node "node" failed in firing 1: it took longer than max_duration_s = 5 s and was given up'


@hfg.node
async def ignores_cancellation(value: int) -> int:
    """Cannot be cancelled."""
    while True:
        try:
            await asyncio.sleep(1000)
        except asyncio.CancelledError:
            continue


def test_async_code_that_cannot_be_cancelled_is_named_and_dropped_at_the_end(fast: bool) -> None:
    async def main() -> None:
        async with hfg.running(one(ignores_cancellation()), fast=fast):
            await asyncio.sleep(1)

    with pytest.raises(
        hfg.errors.TeardownError, match='node "node" failed in firing 1: it was cancelled and did not end'
    ):
        drive(main)


def test_async_code_that_ignores_its_time_limit_is_dropped_at_the_end(fast: bool) -> None:
    graph = one(ignores_cancellation(), max_duration_s=2, on_error="skip")
    report = run(graph, fast)
    assert report.nodes["node"].failed == 3


# --- code that raises what ends tasks ---


@pytest.mark.parametrize("problem", [asyncio.CancelledError, GeneratorExit, SystemExit])
def test_code_that_raises_what_is_no_error_does_not_hang_the_run(problem: type[BaseException], fast: bool) -> None:
    class Raises(hfg.Node):
        def process(self, value: int) -> None:
            raise problem

    with pytest.raises((NodeError, SystemExit)):
        run(one(Raises()), fast)


def test_async_code_that_cancels_itself_does_not_hang_the_run(fast: bool) -> None:
    class Cancels(hfg.Node):
        async def process(self, value: int) -> None:
            task = asyncio.current_task()
            assert task is not None
            task.cancel()
            await asyncio.sleep(1)

    with pytest.raises(NodeError, match='node "node" failed in firing 1: CancelledError'):
        run(one(Cancels()), fast)


# --- queues ---


class Bursts(hfg.Node):
    """Many signals in one firing."""

    value = hfg.Input(int)
    rang = hfg.Event(int)

    def process(self, value: int) -> None:
        for number in range(5):
            self.rang.trigger(number)


def test_queue_overflow_names_the_edge_and_the_remedy(fast: bool) -> None:
    graph = one(Bursts())
    graph.connect(graph["node"].rang, graph.add(Ear()).hear, capacity=2, overflow="error")
    said = sentence(graph, fast)
    assert 'failed in firing 1: QueueOverflow: queue of "node.rang -> ear.hear" is full' in said
    assert "raise capacity= or choose another overflow=" in said


class PingPong(hfg.Node):
    """Two signals for each one."""

    rang = hfg.Event(int)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.rang.trigger(value)
        self.rang.trigger(value)


def test_queue_limit_names_the_edge_and_the_remedy(fast: bool) -> None:
    graph = hfg.Graph()
    first, second = graph.add(PingPong(), name="first"), graph.add(PingPong(), name="second")
    graph.connect(graph.add(Ringing(count=1)).rang, first.hear)
    graph.connect(first.rang, second.hear, capacity=2, capacity_limit=6)
    graph.connect(second.rang, first.hear, capacity=2, capacity_limit=6)
    with pytest.raises(
        hfg.errors.QueueLimit, match=r'queue of "first.rang -> second.hear" .* capacity_limit = 6'
    ) as raised:
        run(graph, fast)
    assert "raise the limit or let the consumer take more" in str(raised.value)


# --- stalls ---


def _unfed(graph: hfg.Graph) -> None:
    graph.connect(graph.add(numbers(count=1)).out, graph.add(Two()).a)


class Two(hfg.Node):
    a = hfg.Input(int)
    b = hfg.Input(int)

    def process(self, a: int, b: int) -> None:
        pass


def _never_triggered(graph: hfg.Graph) -> None:
    node = graph.add(Two())
    graph.connect(graph.add(numbers(count=1)).out, node.a)
    graph.connect(graph.add(Silent()).out, node.b)


class Silent(hfg.Node):
    """Nothing comes in, so nothing goes out."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value


def _not_ready(graph: hfg.Graph) -> None:
    graph.connect(graph.add(numbers(count=1)).out, graph.add(NotReady()).value)


class NotReady(hfg.Node):
    value = hfg.Input(int)

    def ready(self) -> bool:
        return False

    def process(self, value: int) -> None:
        pass


def _source_not_ready(graph: hfg.Graph) -> None:
    graph.add(Shy())


class Shy(hfg.Node):
    def ready(self) -> bool:
        return False

    def process(self) -> None:
        pass


def _signals_left(graph: hfg.Graph) -> None:
    node = graph.add(Two())
    graph.connect(graph.add(Ringing(count=3)).rang, node.a)


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (_unfed, '"two" waits for its unconnected input "b", while tokens lie on "numbers.out -> two.a"'),
        (_never_triggered, '"two" waits for "b", while tokens lie on "numbers.out -> two.a"'),
        (
            _never_triggered,
            'source "numbers" has not ended and waits until its token is processed on "numbers.out -> two.a"',
        ),
        (_not_ready, '"not_ready" says by ready() that it is not ready, while tokens lie on "numbers.out -> not_ready'),
        (_source_not_ready, 'source "shy" has not ended and says by ready() that it is not ready'),
        (_signals_left, '"two" waits for its unconnected input "b", while tokens lie on "ringing.rang -> two.a"'),
    ],
)
def test_a_stall_says_which_node_waits_for_what_and_what_to_do(build: Any, said: str, fast: bool) -> None:
    graph = hfg.Graph()
    build(graph)
    with pytest.raises(hfg.errors.Stalled) as raised:
        run(graph, fast)
    assert said in str(raised.value)
    assert "run with allow_idle=True" in str(raised.value)
    assert raised.value.report.outcome == "stalled"  # type: ignore[attr-defined]


def test_a_graph_output_that_nobody_reads_is_a_stall_that_says_so(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.connect(graph.add(numbers(count=3)).out, graph.output("out", int))
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_finished()

    with pytest.raises(hfg.errors.Stalled, match='graph output "out" is not read'):
        drive(main)


# --- subscribers, operators, consumers ---


def test_a_subscriber_that_raises_is_logged_with_the_path_and_dropped(
    caplog: pytest.LogCaptureFixture, fast: bool
) -> None:
    graph = hfg.Graph()
    source, ear = graph.add(Ringing(count=3)), graph.add(Ear())
    graph.connect(source.rang, ear.hear)
    calls: list[int] = []
    others: list[int] = []

    def bad(token: hfg.Token[int]) -> None:
        calls.append(token.value)
        raise ValueError("mine")

    source.rang.subscribe(bad)
    source.rang.subscribe(lambda token: others.append(token.value))
    assert run(graph, fast).outcome == "done"
    assert (calls, others, ear.heard) == ([1], [1, 2, 3], [1, 2, 3])
    assert [record.getMessage() for record in caplog.records] == [
        'a subscriber of "ringing.rang" failed and was dropped'
    ]


def test_an_operator_that_raises_is_an_error_of_the_edge_by_the_consumers_policy(fast: bool) -> None:
    from reactivex import operators

    def build(on_error: Any) -> tuple[hfg.Graph, Keep]:
        graph = hfg.Graph()
        source, sink = graph.add(Ringing(count=3)), graph.add(Keep(), on_error=on_error)
        graph.connect(source.rang, sink.value, through=[operators.map(lambda token: 1 // (token.value - 2))])
        return graph, sink

    graph, _ = build("stop")
    said = sentence(graph, fast)
    assert said == (
        'node "keep" failed in an operator on edge "ringing.rang -> keep.value": '
        "ZeroDivisionError: integer division or modulo by zero"
    )
    graph, sink = build("skip")
    report = run(graph, fast)
    assert sink.values == [-1]  # Rx: an operator that has failed is over
    assert len(report.errors) == 1


def test_a_trace_consumer_that_raises_is_logged_and_removed(caplog: pytest.LogCaptureFixture, fast: bool) -> None:
    calls: list[Any] = []

    def bad(event: Any) -> None:
        calls.append(event)
        raise ValueError("mine")

    graph = one(forward())
    assert run(graph, fast, trace=bad).outcome == "done"
    assert len(calls) == 1
    assert graph["keep"].values == [1, 2, 3]
    assert [record.getMessage() for record in caplog.records] == ["a consumer of the trace failed and was removed"]


def test_an_observable_that_fails_ends_the_run_and_names_the_edge(fast: bool) -> None:
    import reactivex

    graph = hfg.Graph()
    graph.connect(reactivex.throw(ValueError("mine")), graph.add(Ear()).hear)
    assert 'the observable that feeds "observable -> ear.hear": ValueError: mine' in sentence(graph, fast)

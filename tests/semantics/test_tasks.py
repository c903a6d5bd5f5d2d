"""Tasks that a node's code starts by `start_soon`: children of the node (rules X1, X3, R5, F10, T5)."""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from typing import Any, Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hfg
from hfg import commands
from hfg.testing import Divergence, recorder, replay
from hfg.testing.nodes import Doubter, script
from hfg.trace import EventTriggered, TokenSent, TraceEvent
from tests.semantics.nodes import Ear, Keep, drive, forward, modifiers, named, numbers, of_kind, run, sent, slow_numbers
from tests.support.kinds import Beats, Tends

RUNS: list[hfg.Run] = []

Work = Callable[["Starter"], Coroutine[Any, Any, Any]]


class Starter(hfg.Node):
    """Starts what it is told to, wherever it is told to; writes down what it goes through."""

    value = hfg.Input(int, optional=True)
    out = hfg.Output(int)
    told = hfg.Event(object)
    story = hfg.State(factory=list)
    where = hfg.Parameter("process")
    work = hfg.Parameter[Any](None)

    def start(self, where: str) -> None:
        if where == self.where:
            self.start_soon(self.work(self))

    def say(self, what: object) -> None:
        self.story.append((hfg.elapsed(), what))

    def setup(self) -> None:
        self.say("setup")
        self.start("setup")

    def process(self, value: int) -> Any:
        self.start("process")
        return value

    @hfg.slot
    def poke(self) -> None:
        self.start("slot")

    def on_activated(self) -> None:
        self.start("hook")

    def end(self) -> None:
        self.say("end")
        self.start("end")

    def teardown(self) -> None:
        self.say("teardown")


class AsyncStarter(Starter):
    """The same with async code."""

    async def process(self, value: int) -> int:
        await asyncio.sleep(0)
        self.start("process")
        return value


async def says(node: Starter) -> None:
    """Say something a second later."""
    try:
        await asyncio.sleep(1)
        node.say("work")
        node.told.trigger(hfg.elapsed())
    except asyncio.CancelledError:
        node.say("cancelled")
        raise


async def stays(node: Starter) -> None:
    """Work until somebody ends it."""
    try:
        await asyncio.sleep(1e6)
    finally:
        node.say("cancelled")


async def fails(node: Starter) -> None:
    await asyncio.sleep(1)
    raise ValueError("no contact")


async def resists(node: Starter) -> None:
    """Do not end when cancelled."""
    while True:
        try:
            await asyncio.sleep(1e6)
        except asyncio.CancelledError:
            node.say("not I")


def starting(
    work: Work,
    where: str = "process",
    *,
    kind: type[Starter] = Starter,
    source: hfg.Node | None = None,
    **options: Any,
) -> tuple[hfg.Graph, Starter, Ear]:
    """One node that starts, an ear for what it triggers, and a source of one value."""
    graph = hfg.Graph()
    node, ear = kind(work=work, where=where), Ear()
    graph.add(node, name="node", **options)
    graph.add(ear, name="ear")
    graph.connect(graph.add(source or numbers(count=1), name="source").ports.outputs["out"], node.value)
    graph.connect(node.told, ear.hear)
    return graph, node, ear


# --- where it works, and when it is over ------------------------------------------------------------------------------


@pytest.mark.rule("R5")
@pytest.mark.parametrize("kind", [Starter, AsyncStarter])
@pytest.mark.parametrize("concurrency", [1, 2])
@pytest.mark.parametrize("where", ["setup", "process", "slot", "hook", "end"])
def test_the_run_waits_for_what_its_nodes_have_started(
    kind: type[Starter], concurrency: int, where: str, fast: bool
) -> None:
    if kind is Starter and concurrency > 1:
        concurrency = 1  # plain functions have one firing at a time
    graph, node, ear = starting(says, where, kind=kind, concurrency=concurrency)
    graph.connect(graph.start, node.poke)
    graph.connect(graph.start, node.activate)
    report = run(graph, fast)
    assert (report.outcome, report.duration_s, ear.heard) == ("done", 1, [1.0])
    assert node.story[-2:] == [(1, "work"), (1, "teardown")]


@pytest.mark.rule("R5")
def test_quiet_waits_for_them_too() -> None:
    graph, node, _ = starting(says, source=numbers(count=3))

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await running.wait_quiet()
            assert (running.elapsed(), [what for _, what in node.story].count("work")) == (1, 3)

    drive(main)


@pytest.mark.rule("X3")
def test_what_has_no_end_is_cancelled_before_its_node_is_torn_down(fast: bool) -> None:
    graph, node, _ = starting(stays, "setup")
    assert run(graph, fast, until_s=5).outcome == "until"
    assert node.story == [(0, "setup"), (0, "end"), (5, "cancelled"), (5, "teardown")]


@pytest.mark.rule("X3")
def test_one_that_was_started_as_the_run_ended_never_begins() -> None:
    graph, node, _ = starting(says)
    graph.connect(node.processed, graph.stop)
    assert run(graph).outcome == "stopped"
    assert "work" not in [what for _, what in node.story]


@pytest.mark.rule("X3")
def test_what_does_not_end_is_named_and_left_behind() -> None:
    graph, node, _ = starting(resists, "setup")

    async def main() -> str:
        with pytest.raises(hfg.errors.TeardownError) as error:
            await hfg.run_async(graph, until_s=1)
        await asyncio.sleep(0)
        assert [task for task in asyncio.all_tasks() if task is not asyncio.current_task()] == []
        return str(error.value)

    assert drive(main).startswith('node "node" failed in task "resists": it was cancelled and did not end within')
    assert node.story[-1][1] == "teardown"


@pytest.mark.rule("X3")
def test_what_fails_as_it_is_cancelled_is_told_with_the_other_errors() -> None:
    async def stumbles(_node: Starter) -> None:
        try:
            await asyncio.sleep(1e6)
        finally:
            raise OSError("door jammed")

    graph, node, _ = starting(stumbles, "setup", source=slow_numbers())
    with pytest.raises(hfg.errors.TeardownError, match='^node "node" failed in task "stumbles": OSError: door jammed'):
        run(graph, until_s=1)
    assert node.story[-1] == (1, "teardown")


@pytest.mark.rule("R3")
def test_a_pause_does_not_wait_for_them_and_they_go_on_meanwhile() -> None:
    graph, node, _ = starting(says, "setup")

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            running.pause()
            await running.wait_paused()
            assert running.elapsed() == 0
            await asyncio.sleep(2)
            assert node.story[-1] == (1, "work")
            running.resume()
            await running.wait_finished()

    drive(main)


@pytest.mark.rule("G4")
def test_an_element_waits_for_what_was_started_inside() -> None:
    graph, keep = hfg.Graph(), Keep()
    box = graph.add(EachStarts(), name="box")
    graph.connect(graph.add(one_list()).out, box.item)
    graph.connect(box.done, graph.add(keep).value)
    report = run(graph)
    assert (keep.values, report.duration_s) == ([[1, 2, 3]], 3)


@hfg.node
def one_list() -> Iterator[list[int]]:
    yield [1, 2, 3]


class EachStarts(hfg.Subgraph):
    """Starts something for each element."""

    iterate_over = ("item",)
    item = hfg.Input(Any)
    done = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        node = graph.add(Starter(work=says), name="node")
        graph.connect(self.item.inner, node.value)
        graph.connect(node.out, self.done.inner)


# --- errors -----------------------------------------------------------------------------------------------------------


@pytest.mark.rule("X1")
def test_an_error_in_one_is_the_nodes(fast: bool) -> None:
    graph, node, _ = starting(fails)
    with pytest.raises(
        hfg.errors.NodeError, match='^node "node" failed in task "fails", after its end: ValueError: no'
    ):
        run(graph, fast)
    assert node.story[-1] == (1, "teardown")
    graph, _, _ = starting(fails, "setup", source=slow_numbers())
    with pytest.raises(hfg.errors.NodeError, match='^node "node" failed in task "fails": ValueError: no contact'):
        run(graph, fast)


@pytest.mark.rule("X1")
@pytest.mark.parametrize("policy", ["skip", "disable", "restart"])
def test_its_policy_decides(policy: str, fast: bool) -> None:
    graph, node, ear = starting(fails, "slot", on_error=policy, restart_backoff_s=0.5)
    graph.connect(graph.start, node.poke)
    graph.connect(node.failed, ear.hear)
    report = run(graph, fast)
    assert report.outcome == "done"
    assert report.errors == ['node "node" failed in task "fails", after its end: ValueError: no contact']
    assert [failure.error.what for failure in ear.heard] == ['task "fails", after its end']
    assert [failure.taken for failure in ear.heard] == [{}]
    assert report.nodes["node"].restarts == (policy == "restart")
    if policy == "restart":
        assert node.story == [(1.5, "setup"), (1.5, "teardown")]


@pytest.mark.rule("X1")
def test_one_that_fails_amid_a_firing_takes_nothing_from_it(fast: bool) -> None:
    class Long(Starter):
        async def process(self, value: int) -> None:
            self.out.send(value)
            self.start("process")
            await asyncio.sleep(2)

    graph, node, _ = starting(fails, kind=Long, on_error="skip")
    keep = graph.add(Keep())
    graph.connect(node.out, keep.value)
    report = run(graph, fast)
    assert keep.values == [1]
    assert report.errors == ['node "node" failed in task "fails": ValueError: no contact']


@pytest.mark.rule("X1")
def test_a_firing_that_has_started_one_is_not_tried_again() -> None:
    class Tries(hfg.Node):
        value = hfg.Input(int)
        told = hfg.Event(float)

        async def process(self, value: int) -> None:
            self.start_soon(self.later())
            raise OSError("busy")

        async def later(self) -> None:
            await asyncio.sleep(1)
            self.told.trigger(hfg.elapsed())

    for concurrency in (1, 2):
        graph, ear = hfg.Graph(), Ear()
        node = graph.add(Tries(), name="node", retries=3, on_error="skip", concurrency=concurrency)
        graph.connect(graph.add(numbers(count=1)).out, node.value)
        graph.connect(node.told, graph.add(ear).hear)
        report = run(graph)
        assert (report.nodes["node"].retries, ear.heard) == (0, [1.0])


@pytest.mark.rule("X1")
@pytest.mark.parametrize("error", [SystemExit(3), hfg.EndOfStream()])
def test_what_ends_the_program_is_no_error_that_a_policy_gets_over_and_the_end_belongs_to_firings(
    error: BaseException,
) -> None:
    async def leaves(_node: Starter) -> None:
        raise error

    graph, _, _ = starting(leaves, on_error="skip")
    if isinstance(error, SystemExit):
        with pytest.raises(hfg.errors.NodeError, match='^node "node" failed in task "leaves".*: it called sys.exit'):
            run(graph)
    else:
        (sentence,) = run(graph).errors
        assert "a node ends in process() or ready() alone" in sentence


def test_one_that_cancels_itself_has_simply_ended() -> None:
    async def gives_up(_node: Starter) -> None:
        raise asyncio.CancelledError

    graph, _, _ = starting(gives_up)
    report = run(graph)
    assert (report.outcome, report.errors) == ("done", [])


# --- disabling, reset, edits ------------------------------------------------------------------------------------------


@pytest.mark.rule("F10")
def test_disabling_a_node_cancels_them_and_enabling_starts_afresh() -> None:
    graph, node, _ = starting(stays, "setup")

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await asyncio.sleep(1)
            await running.trigger(node.disable)
            await running.wait_quiet()
            assert node.story[-1] == (1, "cancelled")
            assert running.statistics().nodes["node"].tasks == ()
            await asyncio.sleep(1)
            await running.trigger(node.enable)
            await asyncio.sleep(1)
            assert running.statistics().nodes["node"].tasks == ("stays",)

    drive(main)
    assert node.story == [(2, "setup"), (3, "cancelled"), (3, "teardown")]


@pytest.mark.rule("F10")
def test_of_a_node_that_is_disabled_from_the_start_they_last_as_long_as_its_setup() -> None:
    graph, node, _ = starting(stays, "setup", enabled=False)
    report = run(graph)
    assert report.outcome == "done"
    assert node.story == [(0, "setup"), (0, "teardown")]  # cancelled before it had begun


@pytest.mark.rule("F10")
def test_a_firing_of_a_node_that_was_switched_off_starts_nothing() -> None:
    class Late(Starter):
        async def process(self, value: int) -> int:
            await asyncio.sleep(1)
            self.start("process")
            return value

    graph, node, ear = starting(says, kind=Late)

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await asyncio.sleep(0.5)
            await running.trigger(node.disable)
            await running.wait_finished()

    drive(main)
    assert ear.heard == []


@pytest.mark.rule("A9")
def test_reset_ends_them_before_the_node_begins_afresh() -> None:
    graph, node, _ = starting(stays, "setup")
    story: list[Any] = []

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await asyncio.sleep(1)
            story.append(node.story)
            await running.trigger(node.reset)
            await asyncio.sleep(1)
            story.append(node.story)

    drive(main)
    assert [what for _, what in story[0]] == ["setup", "end", "cancelled", "teardown"]
    assert story[1][0] == (1, "setup")


@pytest.mark.rule("R4")
def test_a_node_that_is_removed_or_replaced_takes_them_along() -> None:
    graph, node, _ = starting(stays, "setup")

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await asyncio.sleep(1)
            await running.edit(commands.Disconnect("node.told", "ear.hear"), commands.Replace("node", named(forward)))
            assert node.story[-2:] == [(1, "cancelled"), (1, "teardown")]
            await running.wait_quiet()

    drive(main)


@pytest.mark.rule("R4")
def test_one_may_edit_the_graph_and_even_remove_its_own_node() -> None:
    async def leaves(node: Starter) -> None:
        running = RUNS.pop()
        await running.edit(commands.Add(named(Keep), "kept"))
        await running.edit(commands.Remove("node"))
        raise AssertionError("it is gone")

    graph, node, _ = starting(leaves, "setup")

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            RUNS.append(running)
            await running.wait_quiet()
            assert "node" not in graph.nodes
            assert running.report().errors == []

    drive(main)
    assert node.story[-1][1] == "teardown"


@pytest.mark.rule("R4")
def test_one_that_replaces_its_own_node_would_wait_for_itself_and_is_refused() -> None:
    async def replaces(node: Starter) -> None:
        try:
            await RUNS.pop().edit(
                commands.Disconnect("node.told", "ear.hear"), commands.Replace("node", named(forward))
            )
        except hfg.errors.UsageError as error:
            node.say(str(error))

    graph, node, _ = starting(replaces, "setup")

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            RUNS.append(running)
            await running.wait_finished()

    drive(main)
    assert any("would wait for ever" in str(what) for _, what in node.story)


# --- what they send ---------------------------------------------------------------------------------------------------


@pytest.mark.rule("F3")
def test_outputs_belong_to_firings(fast: bool) -> None:
    async def writes(node: Starter) -> None:
        node.out.send(1)

    graph, _, _ = starting(writes)
    with pytest.raises(
        hfg.errors.NodeError,
        match=r'output "node.out" was written by the task "writes": outputs belong to process\(\) and end\(\); trigger',
    ):
        run(graph, fast)


@pytest.mark.rule("T5", "A3", "A5")
def test_a_signal_of_one_is_a_sending_of_its_own(fast: bool) -> None:
    """Its stamp is the present, it carries the activity that the node has then, and gives the firing no right to it."""

    class Long(Starter):
        async def process(self, value: int) -> int:
            self.start("process")
            await asyncio.sleep(2)
            return value

    graph, node, ear = starting(says, kind=Long)
    keep = graph.add(Keep())
    graph.connect(node.out, keep.value, active=True)
    graph.connect(node.told, ear.begin, active=True)
    graph.connect(graph.start, node.activate)
    trace: list[TraceEvent] = []
    run(graph, fast, trace=trace)
    (signal,) = [one.token for one in of_kind(trace, EventTriggered) if one.event == "node.told"]
    assert (signal.stamp - trace[0].time, signal.activity) == (1, 1)
    assert modifiers(trace, "node.told -> ear.begin") == [1]
    assert modifiers(trace, "node.out -> keep.value")[0] == 0


@pytest.mark.rule("F8")
def test_one_that_triggers_without_end_waits_for_room() -> None:
    async def floods(node: Starter) -> None:
        for number in range(100):
            await node.told.trigger_wait(number)

    class Slow(hfg.Node):
        heard = hfg.State(factory=list)

        @hfg.slot
        async def hear(self, value: object) -> None:
            await asyncio.sleep(1)
            self.heard.append(value)

    graph, node, _ = starting(floods)
    slow = graph.add(Slow())
    graph.connect(node.told, slow.hear, capacity=2)
    report = run(graph)
    assert slow.heard == list(range(100))
    assert report.edges["node.told -> slow.hear"].grown == 0


class Slow(hfg.Node):
    @hfg.slot
    async def hear(self, value: object) -> None:
        await asyncio.sleep(1)


async def never_ends(node: Starter) -> None:
    number = 0
    while True:
        number += 1
        await node.told.trigger_wait(number)


@pytest.mark.rule("F8", "X3")
@pytest.mark.parametrize("where", ["setup", "process"])
def test_one_that_waits_for_room_again_and_again_ends_with_the_run(where: str) -> None:
    graph, node, _ = starting(never_ends, where)
    graph.connect(node.told, graph.add(Slow()).hear, capacity=2)
    assert run(graph, until_s=10).outcome == "until"
    assert node.story[-1][1] == "teardown"


@pytest.mark.rule("F8", "X3")
def test_a_firing_that_waits_for_room_again_and_again_ends_with_the_run() -> None:
    class Floods(hfg.Node):
        value = hfg.Input(int)
        told = hfg.Event(object)

        async def process(self, value: int) -> None:
            while True:
                await self.told.trigger_wait(value)

    graph = hfg.Graph()
    node = graph.add(Floods())
    graph.connect(graph.add(script(values=(1,))).out, node.value)
    graph.connect(node.told, graph.add(Slow()).hear, capacity=2)
    assert run(graph, until_s=3).outcome == "until"


@pytest.mark.rule("A10", "F8")
def test_one_waits_for_room_before_the_start_too() -> None:
    seen: list[int] = []

    class Slow(hfg.Node):
        async def setup(self) -> None:
            await asyncio.sleep(1)
            seen.append(waiting.said)

        @hfg.slot
        def hear(self, value: object) -> None:
            """Nothing more."""

    class Waiting(hfg.Node):
        told = hfg.Event(int)
        said = hfg.State(0)

        def setup(self) -> None:
            self.start_soon(self.tell())

        async def tell(self) -> None:
            for number in range(100):
                self.said = number
                await self.told.trigger_wait(number)

    graph = hfg.Graph()
    waiting = graph.add(Waiting())
    graph.connect(waiting.told, graph.add(Slow()).hear, capacity=4)
    report = run(graph)
    assert seen == [3]
    assert report.edges["waiting.told -> slow.hear"].grown == 0


class Speaks(hfg.Node):
    """Says its last word behind one for which it waits, amid its firing."""

    value = hfg.Input(int)
    told = hfg.Event(object)

    async def process(self, value: int) -> None:
        await last_words(self)


async def last_words(node: Any) -> None:
    for word in ("first", "second"):
        await node.told.trigger_wait(word)
    node.told.trigger("third")


@pytest.mark.rule("F8", "F13")
@pytest.mark.parametrize("by_task", [True, False])
def test_it_is_not_quiet_while_code_that_waited_for_room_has_it_but_has_not_gone_on(by_task: bool, fast: bool) -> None:
    """Else events would end before it, and what it says then would be dropped."""
    graph, keep = hfg.Graph(), Keep()
    node = Starter(work=last_words) if by_task else Speaks()
    graph.connect(graph.add(numbers(count=1)).out, graph.add(node, name="node").ports.inputs["value"])
    graph.connect(node.ports.events["told"], graph.add(keep).value, capacity=1)
    report = run(graph, fast)
    assert keep.values == ["first", "second", "third"]
    assert report.edges["node.told -> keep.value"].dropped == 0


@pytest.mark.rule("F8")
def test_code_that_waits_for_room_before_what_never_moves_is_in_no_ring_and_its_queue_does_not_grow() -> None:
    """The events end instead, and what still comes is drained: memory is bounded."""

    async def floods(node: Starter) -> None:
        for number in range(3):
            await node.told.trigger_wait(number)

    class Joins(hfg.Node):
        first = hfg.Input(object)
        second = hfg.Input(object)

        def process(self, first: object, second: object) -> None: ...

    graph, node, _ = starting(floods, "setup")
    joins, other = graph.add(Joins()), graph.add(Starter(work=says, where=""), name="other")
    graph.connect(node.told, joins.first, capacity=1)
    graph.connect(other.told, joins.second)
    edge = run(graph).edges["node.told -> joins.first"]
    assert (edge.sent, edge.grown) == (3, 0)


@pytest.mark.rule("X1")
def test_code_of_one_in_a_thread_may_trigger() -> None:
    async def asks(node: Starter) -> None:
        await asyncio.to_thread(node.told.trigger, "from a thread")

    graph, _, ear = starting(asks)
    hfg.run(graph)
    assert ear.heard == ["from a thread"]


def test_one_sees_the_context_of_the_code_that_has_started_it() -> None:
    tenant = contextvars.ContextVar("tenant", default="nobody")

    class Sets(Starter):
        async def process(self, value: int) -> int:
            tenant.set(f"firing {value}")
            self.start("process")
            return value

    async def tells(node: Starter) -> None:
        node.told.trigger(tenant.get())

    graph, _, ear = starting(tells, kind=Sets, source=numbers(count=2))
    run(graph)
    assert ear.heard == ["firing 1", "firing 2"]


# --- beside the oracle ------------------------------------------------------------------------------------------------


@pytest.mark.rule("F10", "A9", "X1", "R5")
@pytest.mark.parametrize(
    ("slot", "heard"),
    [("", [1, 2, 3]), ("disable", [1]), ("reset", [1, 1, 2, 3]), ("deactivate", [1, 2, 3])],
)
def test_the_oracle_tends_them_as_the_engine_does(slot: str, heard: list[int]) -> None:
    """Three beats, 10 ms apart; behind the first of them something is done to the node."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node, late = graph.add(Beats(pause_s=0.01), name="beats"), graph.add(slow_words(), name="late")
        graph.connect(node.beat, graph.add(Keep()).value)
        if slot:
            graph.connect(late.ports.events["out.sent"], node.ports.slots[slot])
        return graph

    seen = recorder()
    run(build(), trace=seen)
    assert [value for value in seen.values("beats.beat -> keep.value") if value is not hfg.END] == heard
    replay(build, seen)
    seen.remove(next(event for event in seen if isinstance(event, TokenSent) and event.edge.startswith("beats.beat")))
    with pytest.raises(Divergence):
        replay(build, seen)


@hfg.node
async def slow_words() -> AsyncIterator[int]:
    await asyncio.sleep(0.015)
    yield 1


@pytest.mark.rule("X1")
@pytest.mark.parametrize(
    ("policy", "heard"), [("skip", [1, 1, 2, -2, 2]), ("disable", [1, 1]), ("restart", [1, 1]), ("stop", [1, 1])]
)
def test_the_oracle_judges_their_errors_as_the_engine_does(policy: Any, heard: list[int]) -> None:
    """The third of four tasks fails at once with the others; what the fourth says comes behind that."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(Tends(), name="tends", on_error=policy)
        graph.connect(graph.add(script(values=(1, 1, 3, 2))).out, node.value)
        graph.connect(node.later, graph.add(Keep()).value)
        graph.connect(node.failed, graph.add(Doubter()).hear)
        return graph

    seen = recorder()
    with contextlib.suppress(hfg.errors.NodeError):
        run(build(), trace=seen)
    assert [value for value in seen.values("tends.later -> keep.value") if value is not hfg.END] == heard
    replay(build, seen)


# --- random tasks -----------------------------------------------------------------------------------------------------

Policy = Literal["skip", "disable"]
POLICIES: list[Policy] = ["skip", "skip", "disable"]
TIMES = st.integers(0, 8).map(lambda quarters: quarters / 4)


@pytest.mark.slow
@pytest.mark.rule("R5", "R6")
@settings(deadline=None)
@given(
    plan=st.lists(st.lists(st.tuples(TIMES, st.booleans()), max_size=3), min_size=1, max_size=6),
    rate=st.sampled_from([None, 1.0, 2.0]),
    policy=st.sampled_from(POLICIES),
    fast=st.booleans(),
)
def test_whatever_is_started_is_heard_in_the_order_of_time_and_waited_for(
    plan: list[list[tuple[float, bool]]], rate: float | None, policy: Policy, fast: bool
) -> None:
    """Each firing starts some tasks, each of which waits, then speaks or fails."""

    class Many(Starter):
        def process(self, value: int) -> int:
            for position, (pause_s, bad) in enumerate(plan[value - 1]):
                self.start_soon(self.later(value, position, pause_s, bad))
            return value

        async def later(self, value: int, position: int, pause_s: float, bad: bool) -> None:
            await asyncio.sleep(pause_s)
            if bad:
                raise ValueError((value, position))
            self.told.trigger((value, position))

    graph = hfg.Graph()
    node, ear = graph.add(Many(), name="node", on_error=policy), graph.add(Ear())
    graph.connect(graph.add(numbers(count=len(plan)), max_rate_hz=rate).out, node.value)
    graph.connect(node.told, ear.hear)
    trace: list[TraceEvent] = []
    report = run(graph, fast, trace=trace)
    period = 1 / rate if rate else 0.0
    meant = [
        (number * period + pause_s, number + 1, position, bad)
        for number, row in enumerate(plan)
        for position, (pause_s, bad) in enumerate(row)
    ]
    off_at = min((when for when, _, _, bad in meant if bad and policy == "disable"), default=float("inf"))
    heard = [event.token.value for event in of_kind(trace, TokenSent) if event.edge.endswith("-> ear.hear")]
    at = {(value, position): when for when, value, position, _ in meant}
    assert [at[one] for one in heard] == sorted(at[one] for one in heard)
    surely = {(value, position) for when, value, position, bad in meant if not bad and when < off_at}
    perhaps = {(value, position) for when, value, position, bad in meant if not bad and when <= off_at}
    assert surely <= set(heard) <= perhaps
    assert ear.heard == heard
    assert report.outcome == "done"
    if policy == "skip":
        assert report.duration_s == max([len(plan) * period, *at.values()])
        assert len(report.errors) == sum(bad for *_, bad in meant)
    again: list[TraceEvent] = []
    run(graph, fast, trace=again)
    assert [str(event) for event in again] == [str(event) for event in trace]
    assert sent(trace, "node.told -> ear.hear") == heard

"""Do-activities: `async def do(self)` runs while its node is active (rule A15)."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

import hfg
from hfg import commands
from hfg.catalogue import describe_type
from hfg.testing import fire, replay
from hfg.trace import DoEnded, DoStarted, RunEnded, TokenSent, TraceEvent
from tests.semantics.nodes import Ear, activity, drive, named, numbers, of_kind, run

Work = Callable[["Busy"], Coroutine[Any, Any, Any]]
Plan = list[tuple[float, str]]


class Busy(hfg.Node):
    """Does what it is told to while it is active; writes down what it goes through."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    told = hfg.Event(object)
    story = hfg.State(factory=list)
    work = hfg.Parameter[Any](None)

    def say(self, what: object) -> None:
        self.story.append((hfg.elapsed(), what))

    def setup(self) -> None:
        self.say("setup")

    def process(self, value: int) -> int:
        return value

    @hfg.slot
    def hear(self) -> None:
        """Take activity."""

    def on_activated(self) -> None:
        self.say("activated")

    def on_deactivated(self) -> None:
        self.say("deactivated")

    async def do(self) -> Any:
        self.say("begins")
        try:
            return await self.work(self)
        except asyncio.CancelledError:
            self.say("cancelled")
            raise

    def teardown(self) -> None:
        self.say("teardown")


class Cues(hfg.Node):
    """Triggers what it is told to, when it is told to."""

    on, off, reset_it, enable_it, disable_it = (hfg.Event() for _ in range(5))
    cues = hfg.Parameter[Any](())

    @hfg.slot
    async def begin(self) -> None:
        """Trigger all of them."""
        for when, what in self.cues:
            if when > hfg.elapsed():
                await asyncio.sleep(when - hfg.elapsed())
            activity = {"on": 1, "off": -1}.get(what, 0)
            self.ports.events[what].trigger(activity=activity)


async def one_second(_node: Busy) -> str:
    await asyncio.sleep(1)
    return "well done"


async def for_ever(_node: Busy) -> None:
    await asyncio.Event().wait()


async def fails(_node: Busy) -> None:
    await asyncio.sleep(1)
    raise ValueError("no way")


async def resists(node: Busy) -> None:
    """Take two seconds to end when it is cancelled, and look round meanwhile."""
    try:
        await asyncio.sleep(1e6)
    except asyncio.CancelledError:
        await asyncio.sleep(2)
        node.say(f"active: {node.active}")
        node.told.trigger("last words")
        raise


async def swallows(node: Busy) -> str:
    """Return as if nothing had happened."""
    try:
        await asyncio.sleep(1e6)
    except asyncio.CancelledError:
        node.say("swallowed")
    return "not told"


async def fails_late(node: Busy) -> None:
    """Fail a while after it was cancelled."""
    try:
        await asyncio.sleep(1e6)
    finally:
        await asyncio.sleep(1)
        raise ValueError("too late")


async def stays(node: Busy) -> None:
    """Never end."""
    while True:
        try:
            await asyncio.sleep(1e6)
        except asyncio.CancelledError:
            node.say("not I")


def doing(work: Work, *cues: tuple[float, str], **options: Any) -> tuple[hfg.Graph, Busy, Ear]:
    """A node that works, cues for it, and an ear for what it has completed and told."""
    graph, node, ear = hfg.Graph(), Busy(work=work), Ear()
    cue = graph.add(Cues(cues=cues), name="cues")
    graph.add(node, name="node", **options)
    graph.add(ear, name="ear")
    graph.connect(graph.start, cue.begin)
    graph.connect(cue.on, node.hear, active=True)
    graph.connect(cue.off, node.hear, active=True)
    graph.connect(cue.reset_it, node.reset)
    graph.connect(cue.enable_it, node.enable)
    graph.connect(cue.disable_it, node.disable)
    graph.connect(node.completed, ear.hear)
    graph.connect(node.told, ear.hear)
    return graph, node, ear


def story(node: Busy) -> list[Any]:
    """What the node went through after its setup, up to its teardown."""
    return [one for one in node.story[1:] if one[1] != "teardown"]


def begun_and_ended(events: list[TraceEvent]) -> list[tuple[float, str]]:
    """When a do-activity has begun and ended."""
    return [(event.time, type(event).__name__) for event in of_kind(events, DoStarted, DoEnded)]


def sent_at(events: list[TraceEvent], edge: str) -> list[float]:
    """When something was put on an edge."""
    return [event.time for event in of_kind(events, TokenSent) if event.edge == edge]


# --- begin and end ----------------------------------------------------------------------------------------------------


@pytest.mark.rule("A15")
def test_it_begins_behind_on_activated_and_its_return_is_an_event(fast: bool) -> None:
    graph, node, ear = doing(one_second, (2, "on"))
    events: list[TraceEvent] = []
    report = run(graph, fast, trace=events)
    assert story(node) == [(2, "activated"), (2, "begins")]
    assert (ear.heard, report.duration_s, activity(events, "node")) == (["well done"], 3, [True])


@pytest.mark.rule("A15")
def test_by_an_active_edge_its_return_takes_the_activity_with_it(fast: bool) -> None:
    graph, node, ear = doing(one_second, (0, "on"))
    graph.connect(node.completed, ear.activate, active=True)
    events: list[TraceEvent] = []
    run(graph, fast, trace=events)
    assert (activity(events, "node"), activity(events, "ear")) == ([True, False], [True])
    assert story(node) == [(0, "activated"), (0, "begins"), (1, "deactivated")]


@pytest.mark.rule("A15")
def test_it_waits_for_an_async_on_activated(fast: bool) -> None:
    class Polite(Busy):
        async def on_activated(self) -> None:  # type: ignore[override]
            await asyncio.sleep(1)
            self.say("ready")

    graph = hfg.Graph()
    node = graph.add(Polite(work=one_second))
    graph.start.activates(node.hear)
    assert run(graph, fast).duration_s == 2
    assert story(node) == [(1, "ready"), (1, "begins")]


@pytest.mark.rule("A15")
def test_it_is_cancelled_as_the_activity_leaves_and_that_is_no_error(fast: bool) -> None:
    graph, node, ear = doing(for_ever, (1, "on"), (3, "off"))
    report = run(graph, fast)
    assert story(node) == [(1, "activated"), (1, "begins"), (3, "deactivated"), (3, "cancelled")]
    assert (report.outcome, report.errors, ear.heard) == ("done", [], [])


@pytest.mark.rule("A15")
def test_one_that_was_cancelled_tells_no_return(fast: bool) -> None:
    graph, node, ear = doing(swallows, (1, "on"), (3, "off"))
    run(graph, fast)
    assert (story(node)[-1], ear.heard) == ((3, "swallowed"), [])


@pytest.mark.rule("A15", "A6")
def test_activity_that_comes_while_there_is_some_leaves_it_alone(fast: bool) -> None:
    graph, node, ear = doing(one_second, (1, "on"), (1.5, "on"))
    run(graph, fast)
    assert (story(node), ear.heard) == ([(1, "activated"), (1, "begins")], ["well done"])


@pytest.mark.rule("A15", "A3")
def test_there_are_never_two_and_an_old_one_sees_and_gives_nothing_of_the_new_activity(fast: bool) -> None:
    graph, node, ear = doing(resists, (1, "on"), (2, "off"), (3, "on"), (9, "off"))
    graph.connect(node.told, ear.poke, active=True)
    events: list[TraceEvent] = []
    run(graph, fast, trace=events)
    assert begun_and_ended(events) == [(1, "DoStarted"), (4, "DoEnded"), (4, "DoStarted"), (11, "DoEnded")]
    assert (4, "active: False") in node.story
    assert ear.heard == ["last words", "last words"]
    assert activity(events, "ear") == []
    assert activity(events, "node") == [True, False, True, False]


@pytest.mark.rule("A15", "A5")
def test_it_may_give_the_activity_away_itself_and_ends_where_it_waits_next(fast: bool) -> None:
    async def hands_over(node: Busy) -> str:
        node.told.trigger("yours")
        node.say("still here")
        await asyncio.sleep(1)
        return "not told"

    graph, node, ear = doing(hands_over, (1, "on"))
    graph.connect(node.told, ear.activate, active=True)
    events: list[TraceEvent] = []
    run(graph, fast, trace=events)
    assert story(node)[2:] == [(1, "deactivated"), (1, "still here"), (1, "cancelled")]
    assert (ear.heard, activity(events, "ear")) == (["yours"], [True])


@pytest.mark.rule("A15")
def test_one_that_is_cancelled_before_its_first_step_never_begins() -> None:
    graph, node, _ = doing(for_ever, (1, "on"), (1, "off"))
    events: list[TraceEvent] = []
    run(graph, trace=events)
    assert story(node) == [(1, "activated"), (1, "deactivated")]
    assert begun_and_ended(events) == []


@pytest.mark.rule("A15", "R5")
def test_the_run_is_not_quiet_while_one_runs() -> None:
    graph, _, _ = doing(one_second, (0, "on"))

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await running.wait_quiet()
            assert running.elapsed() == 1

    drive(main)


@pytest.mark.rule("A15", "X3")
def test_the_end_of_the_run_cancels_it(fast: bool) -> None:
    graph, node, ear = doing(for_ever, (0, "on"))
    assert run(graph, fast, until_s=5).outcome == "until"
    assert node.story[-2:] == [(5, "cancelled"), (5, "teardown")]
    assert ear.heard == []


@pytest.mark.rule("A15", "X3")
def test_one_that_does_not_end_is_named_and_left_behind() -> None:
    graph, _, _ = doing(stays, (0, "on"))
    with pytest.raises(hfg.errors.TeardownError, match=r'^node "node" failed in do\(\): it was cancelled and did not'):
        run(graph, until_s=1)


# --- what it may do ---------------------------------------------------------------------------------------------------


@pytest.mark.rule("A15", "F3")
def test_outputs_belong_to_firings(fast: bool) -> None:
    async def writes(node: Busy) -> None:
        node.out.send(1)

    graph, _, _ = doing(writes, (0, "on"))
    with pytest.raises(hfg.errors.NodeError, match=r'^node "node" failed in do\(\): .*outputs belong to process\(\)'):
        run(graph, fast)


@pytest.mark.rule("A15", "T5")
def test_it_goes_on_beside_firings_and_its_return_does_not_wait_for_them(fast: bool) -> None:
    class Slow(Busy):
        async def process(self, value: int) -> int:  # type: ignore[override]
            await asyncio.sleep(5)
            return value

    graph, ear = hfg.Graph(), Ear()
    node, source = graph.add(Slow(work=one_second), name="node"), graph.add(numbers(count=1))
    graph.connect(source.out, node.value)
    graph.start.activates(node.hear)
    graph.connect(node.completed, graph.add(ear, name="ear").hear)
    events: list[TraceEvent] = []
    run(graph, fast, trace=events)
    assert (ear.heard, [event.time for event in of_kind(events, DoEnded)]) == (["well done"], [1])
    assert sent_at(events, "node.completed -> ear.hear") == [1]


@pytest.mark.rule("A15", "A11")
def test_a_gate_is_about_firings_and_leaves_it_alone(fast: bool) -> None:
    graph, _, ear = doing(one_second, (1, "on"))
    graph.gate(graph["node"], by=graph["ear"])
    run(graph, fast)
    assert ear.heard == ["well done"]


@pytest.mark.rule("A15", "A14")
def test_reset_activity_ends_it_and_start_may_begin_the_next() -> None:
    graph, events = hfg.Graph(), list[TraceEvent]()
    graph.start.activates(graph.add(Lasting()).hear)

    async def main() -> None:
        async with hfg.running(graph, clock="virtual", trace=events) as running:
            await asyncio.sleep(1)
            running.reset_activity()
            await asyncio.sleep(1)
            running.stop()

    drive(main)
    assert begun_and_ended(events) == [(0, "DoStarted"), (1, "DoEnded"), (1, "DoStarted")]


@pytest.mark.rule("A15", "A12")
def test_active_for_s_is_its_time_limit(fast: bool) -> None:
    graph, node, ear = doing(for_ever, (1, "on"), active_for_s=2)
    graph.connect(node.timeout, ear.activate, active=True)
    assert run(graph, fast).duration_s == 3
    assert story(node)[-1] == (3, "cancelled")


@pytest.mark.rule("A15", "G2")
def test_inside_a_subgraph_it_is_as_outside(fast: bool) -> None:
    graph, ear = hfg.Graph(), Ear()
    box = graph.add(Boxed(), name="box")
    cue = graph.add(Cues(cues=((2, "off"),)), name="cue")
    graph.start.activates(box.go)
    graph.connect(graph.start, cue.begin)
    graph.connect(cue.off, box.deactivate)
    graph.connect(box.deactivated, graph.add(ear).hear)
    events: list[TraceEvent] = []
    assert run(graph, fast, trace=events).duration_s == 2
    assert [(event.node, event.outcome) for event in of_kind(events, DoEnded)] == [("box/inner", "cancelled")]
    assert len(ear.heard) == 1


class Boxed(hfg.Subgraph):
    """A node that works for ever, in a box."""

    go = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(Busy(work=for_ever), name="inner")
        graph.connect(self.go.inner, inner.hear, active=True)


@pytest.mark.rule("A15", "R3")
def test_a_pause_does_not_hold_it() -> None:
    graph, _, ear = doing(one_second, (0, "on"))

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await asyncio.sleep(0.5)
            running.pause()
            await running.wait_paused()
            await asyncio.sleep(2)
            assert ear.heard == []
            running.resume()
            await running.wait_finished()

    drive(main)
    assert ear.heard == ["well done"]


# --- afresh -----------------------------------------------------------------------------------------------------------


@pytest.mark.rule("A15", "A9")
def test_reset_begins_it_anew_and_so_does_enabling_for_the_activity_is_kept(fast: bool) -> None:
    graph, _, ear = doing(
        one_second, (0, "on"), (0.5, "reset_it"), (1, "disable_it"), (5, "enable_it"), (5.5, "disable_it")
    )
    events: list[TraceEvent] = []
    run(graph, fast, trace=events)
    assert begun_and_ended(events) == [
        (0, "DoStarted"),
        (0.5, "DoEnded"),
        (0.5, "DoStarted"),
        (1, "DoEnded"),
        (5, "DoStarted"),
        (5.5, "DoEnded"),
    ]
    assert ear.heard == []
    assert activity(events, "node") == [True]


@pytest.mark.rule("A15", "F10")
def test_a_disabled_node_has_none() -> None:
    graph, node, ear = doing(one_second, (1, "disable_it"), (2, "on"), (3, "enable_it"))
    graph.connect(graph["cues"].on, node.activate)
    run(graph)
    assert (story(node), ear.heard) == ([], [])  # what came to a disabled node was discarded


@pytest.mark.rule("A15", "R4")
def test_an_edit_that_replaces_its_node_begins_that_of_the_new_one() -> None:
    graph, ear = hfg.Graph(), Ear()
    node = graph.add(Lasting(), name="node")
    graph.start.activates(node.hear)
    graph.connect(node.completed, graph.add(ear, name="ear").hear)
    events: list[TraceEvent] = []

    async def main() -> None:
        async with hfg.running(graph, clock="virtual", trace=events) as running:
            await asyncio.sleep(0.5)
            await running.edit(commands.Replace("node", named(Quick)))
            await running.wait_finished()

    drive(main)
    assert ear.heard == ["quick"]
    ended = [(event.time, event.outcome) for event in of_kind(events, DoEnded)]
    assert ended == [(0.5, "cancelled"), (1.5, "completed")]


class Lasting(hfg.Node):
    """Works for ever."""

    @hfg.slot
    def hear(self) -> None:
        """Take activity."""

    async def do(self) -> str:
        await asyncio.Event().wait()
        return "never"


class Quick(Lasting):
    """Works for a second."""

    async def do(self) -> str:
        await asyncio.sleep(1)
        return "quick"


# --- errors -----------------------------------------------------------------------------------------------------------


@pytest.mark.rule("A15", "X1")
def test_an_error_in_it_is_the_nodes(fast: bool) -> None:
    graph, _, _ = doing(fails, (0, "on"))
    with pytest.raises(hfg.errors.NodeError, match=r'^node "node" failed in do\(\): ValueError: no way'):
        run(graph, fast)


@pytest.mark.rule("A15", "X1")
@pytest.mark.parametrize(("policy", "begun"), [("skip", 1), ("disable", 1), ("restart", 3)])
def test_the_policy_of_its_node_decides(policy: Any, begun: int, fast: bool) -> None:
    """With "skip" it has ended until the next activity; "restart" begins it anew, for the activity is kept."""
    graph, node, ear = doing(fails, (0, "on"), on_error=policy, restart_limit=2, restart_backoff_s=0.5)
    graph.connect(node.failed, ear.hear)
    events: list[TraceEvent] = []
    if policy == "restart":
        with pytest.raises(hfg.errors.NodeError, match=r"failed in do\(\)"):
            run(graph, fast, trace=events)
    else:
        report = run(graph, fast, trace=events)
        assert report.errors == ['node "node" failed in do(): ValueError: no way']
        assert [failure.error.what for failure in ear.heard] == ["do()"]
    assert activity(events, "node") == [True]
    assert len(of_kind(events, DoStarted)) == begun


@pytest.mark.rule("A15", "X1")
def test_what_it_fails_with_as_it_is_cancelled_is_no_secret(fast: bool) -> None:
    async def stumbles(_node: Busy) -> None:
        try:
            await asyncio.sleep(1e6)
        finally:
            raise OSError("door jammed")

    graph, _, _ = doing(stumbles, (0, "on"), (1, "off"), on_error="skip")
    assert run(graph, fast).errors == ['node "node" failed in do(): OSError: door jammed']
    graph, _, _ = doing(stumbles, (0, "on"))
    with pytest.raises(hfg.errors.TeardownError, match=r'^node "node" failed in do\(\): OSError: door jammed'):
        run(graph, until_s=1)


@pytest.mark.rule("A15", "X1")
def test_a_cancellation_that_nobody_asked_for_is_an_error(fast: bool) -> None:
    async def loses(_node: Busy) -> None:
        raise asyncio.CancelledError

    graph, _, _ = doing(loses, (0, "on"))
    with pytest.raises(hfg.errors.NodeError, match=r'^node "node" failed in do\(\)'):
        run(graph, fast)


@pytest.mark.rule("A15", "X1")
def test_retries_are_about_firings_and_it_takes_none_from_them() -> None:
    class Unsteady(hfg.Node):
        value = hfg.Input(int)

        def process(self, value: int) -> None:
            tries.append(value)
            if len(tries) < 3:
                raise OSError("busy")

        async def do(self) -> None:
            await asyncio.sleep(1)

    tries: list[int] = []
    graph, ear = hfg.Graph(), Ear()
    node = graph.add(Unsteady(), name="node", retries=5, retry_backoff_s=0.1)
    graph.connect(graph.add(numbers(count=1)).out, node.value, active=True)
    graph.connect(graph.start, graph["numbers"].activate)
    graph.connect(node.completed, graph.add(ear).hear)
    report = run(graph)
    assert (report.nodes["node"].retries, tries, ear.heard) == (2, [1, 1, 1], [None])


# --- declared, seen, told ---------------------------------------------------------------------------------------------


@pytest.mark.rule("A15")
def test_one_that_is_not_async_or_of_a_subgraph_is_refused() -> None:
    with pytest.raises(hfg.errors.DeclarationError, match=r"node, which must be `async def do\(self\)`"):
        type("Plain", (hfg.Node,), {"do": lambda self: None})

    async def do(self: Any) -> None: ...

    with pytest.raises(hfg.errors.DeclarationError, match="a subgraph runs no code of its own"):
        type("Box", (hfg.Subgraph,), {"do": do, "build": lambda self, graph: None})


@pytest.mark.rule("A15", "P3")
def test_completed_has_the_type_of_what_it_returns_and_others_have_none() -> None:
    assert Lasting().completed.type is str
    assert list(Lasting().ports.events) == []
    with pytest.raises(hfg.errors.UsageError, match='no event "completed": its type ear has no do-activity'):
        _ = Ear().completed
    graph = hfg.Graph()
    node, target = graph.add(Lasting()), graph.add(Counts())
    with pytest.raises(hfg.errors.GraphError, match="str"):
        graph.connect(node.completed, target.count)


class Counts(hfg.Node):
    """Takes numbers."""

    @hfg.slot
    def count(self, number: int) -> None:
        """Take one."""


@pytest.mark.rule("A15", "R1")
def test_the_check_refuses_one_in_a_thread() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    graph.start.activates(graph.add(Lasting(), group="work").hear)
    assert [problem.what for problem in graph.check() if problem.severity == "error"] == [
        'its do-activity is async, but its group "work" is a thread'
    ]


@pytest.mark.rule("A15", "R4")
def test_an_edit_moves_none_into_a_thread() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    graph.start.activates(graph.add(Lasting(), name="node").hear)

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await asyncio.sleep(1)
            with pytest.raises(hfg.errors.GraphError, match='its do-activity is async, but its group "work" is a thr'):
                await running.edit(commands.Move("node", "work"))
            running.stop()

    drive(main)


@pytest.mark.rule("A15")
def test_the_check_says_that_nothing_makes_it_active() -> None:
    graph = hfg.Graph()
    node = graph.add(Lasting())
    graph.connect(graph.start, node.hear)
    assert [problem.why for problem in graph.check() if problem.check == "never-active"] == [
        "though it has a do-activity, which runs only while it is active"
    ]


@pytest.mark.rule("A15", "R7")
def test_who_looks_sees_it_among_what_goes_on() -> None:
    graph, _, _ = doing(for_ever, (0, "on"))

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await asyncio.sleep(1)
            assert running.statistics().nodes["node"].tasks == ("do",)
            running.stop()

    drive(main)


@pytest.mark.rule("A15")
@pytest.mark.parametrize("work", [one_second, for_ever, fails, resists, swallows])
def test_the_oracle_says_the_same(work: Work) -> None:
    cues = (0, "on"), (0.5, "off"), (1, "on"), (1, "off"), (4, "on"), (4.5, "reset_it"), (6, "disable_it"), (7, "off")

    def build() -> hfg.Graph:
        graph, node, ear = doing(work, *cues, (8, "enable_it"), (9, "on"), (9.5, "off"), on_error="skip")
        graph.connect(node.completed, ear.activate, active=True)
        return graph

    events: list[TraceEvent] = []
    run(build(), trace=events)
    replay(build, events)


@pytest.mark.rule("A15", "X3", "R5")
@pytest.mark.parametrize("how", ["fails", "until"])
@pytest.mark.parametrize("work", [for_ever, fails_late, resists, swallows, stays])
def test_so_it_does_where_the_run_ends_amid_one(work: Work, how: str) -> None:
    """It may take its time to end, within the limit; what it says then nobody hears, though somebody is connected."""

    class Fails(hfg.Node):
        @hfg.slot
        def hear(self) -> None:
            raise ValueError("that is all")

    def build() -> hfg.Graph:
        graph, _, _ = doing(work, (0, "on"), (1.5, "disable_it"), (2, "enable_it"))
        if how == "fails":
            cue = graph["cues"]
            graph.connect(cue.ports.events["enable_it"], graph.add(Fails(), name="fails").hear)
        return graph

    events: list[TraceEvent] = []
    with contextlib.suppress(hfg.errors.RunError):
        run(build(), trace=events, until_s=1 if how == "until" else None)
    assert isinstance(events[-1], RunEnded)
    replay(build, events, until_s=1 if how == "until" else None)


@pytest.mark.rule("A15")
def test_fire_runs_one_to_its_end() -> None:
    fired = fire(Quick(), hook="do", active=True)
    assert (fired.answer, fired.events) == ("quick", [("completed", "quick")])
    with pytest.raises(hfg.errors.UsageError, match="waits for something that never comes"):
        fire(Lasting(), hook="do")


@pytest.mark.rule("A15")
def test_descriptions_and_drawings_show_it() -> None:
    event = describe_type(Lasting).events[-1]
    assert (event.name, event.type, event.doc) == (
        "completed",
        "str",
        "The do-activity has returned; with its result.",
    )
    graph = hfg.Graph()
    graph.add(Lasting(), name="node")
    assert "do" in graph.draw()


@pytest.mark.rule("A15", "L2")
def test_the_check_refuses_one_in_a_group_with_a_ledger() -> None:
    graph = hfg.Graph()
    graph.group("kept", process=True, ledger=True)
    graph.start.activates(graph.add(Lasting(), group="kept").hear)
    assert any("it has a do-activity, and activity is not kept" in problem.what for problem in graph.check())


@pytest.mark.rule("A15", "L1")
def test_in_another_process_it_is_as_here() -> None:
    """`completed` leads the activity over the cut."""
    graph, ear = hfg.Graph(), Ear()
    graph.group("away", process=True)
    node = graph.add(Quick(), name="node", group="away")
    graph.add(ear, name="ear")
    graph.start.activates(node.hear)
    graph.connect(node.completed, ear.hear, active=True)
    events: list[TraceEvent] = []
    assert run(graph, trace=events).outcome == "done"
    assert activity(events, "node") == [True, False]
    assert activity(events, "ear") == [True]
    assert begun_and_ended(events) == [(0, "DoStarted"), (1, "DoEnded")]


# --- one that does not end


LEFT = 'node "node" failed in do(): it was cancelled and did not end within 5 s'


@pytest.mark.rule("A15", "X3", "R5")
def test_one_that_does_not_end_is_left_behind_and_the_next_begins(caplog: pytest.LogCaptureFixture) -> None:
    async def stays_once(node: Busy) -> str:
        if len([what for _, what in node.story if what == "begins"]) > 1:
            return "well done"
        try:
            await stays(node)
        finally:
            node.say("closed")
        return ""

    def build() -> tuple[hfg.Graph, Busy]:
        graph, node, _ = doing(stays_once, (1, "on"), (2, "off"), (3, "on"))
        return graph, node

    graph, node = build()
    events: list[TraceEvent] = []
    report = run(graph, trace=events)
    assert report.outcome == "done"
    assert report.errors == [LEFT]
    assert begun_and_ended(events) == [(1, "DoStarted"), (7, "DoEnded"), (7, "DoStarted"), (7, "DoEnded")]
    assert [event.outcome for event in of_kind(events, DoEnded)] == ["cancelled", "completed"]
    assert (7, "closed") in node.story
    (said,) = [one.getMessage() for one in caplog.records if one.levelname == "ERROR"]
    assert said == f"{LEFT}; it is left behind: do not catch CancelledError, or raise it again after cleaning up"
    replay(lambda: build()[0], events)


@pytest.mark.rule("A15", "F10", "X3")
@pytest.mark.parametrize("what", ["disable_it", "reset_it"])
def test_a_node_is_switched_off_or_reset_though_its_activity_does_not_end(what: str) -> None:
    def build() -> tuple[hfg.Graph, Busy]:
        graph, node, _ = doing(stays, (1, "on"), (2, what), (9, "off"))
        return graph, node

    graph, node = build()
    events: list[TraceEvent] = []
    report = run(graph, trace=events)
    assert report.errors[0] == LEFT
    assert begun_and_ended(events)[1] == (7, "DoEnded")
    assert node.story[0] == ((7, "setup") if what == "reset_it" else (0, "setup"))
    replay(lambda: build()[0], events)


@pytest.mark.rule("A15", "R4", "X3")
def test_an_edit_that_removes_a_node_ends_though_its_activity_does_not() -> None:
    graph, node, _ = doing(stays, (1, "on"))

    async def main() -> tuple[float, hfg.Report]:
        async with hfg.running(graph) as running:
            await asyncio.sleep(2)
            await running.edit(commands.Remove("node"))
            over = running.elapsed()
            await running.wait_finished()
        return over, running.report()

    over, report = drive(main)
    assert over == 7
    assert report.errors == [LEFT]
    assert node.story[-1] == (7, "teardown")


@pytest.mark.rule("A15", "X3")
def test_one_that_ends_in_time_is_no_error() -> None:
    graph, _, _ = doing(resists, (1, "on"), (2, "off"), (30, "on"), (31, "off"))
    assert run(graph).errors == []

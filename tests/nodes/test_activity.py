"""The family `activity`: nodes that look at activity, make and take it, and lead it on."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg.nodes import activity, flow
from hfg.testing import fire
from hfg.testing.diagrams import check, run
from hfg.trace import ActivityChanged, TraceEvent


class Behaviour(hfg.Node):
    """Takes some seconds; gives up as often as it is told to, then succeeds."""

    takes_s = hfg.Parameter(1.0)
    gives_up = hfg.Parameter(0)
    done = hfg.Event(Any)
    gave_up = hfg.Event(Any)
    begun = hfg.State(factory=list[Any])

    @hfg.slot
    def begin(self, value: Any) -> None:
        self.begun.append(value)
        self.start_soon(self._work(value))

    async def _work(self, value: Any) -> None:
        await asyncio.sleep(self.takes_s)
        name = f"{value}{self.place.name}"
        (self.gave_up if len(self.begun) <= self.gives_up else self.done).trigger(name)

    @hfg.slot
    def cancel(self) -> None:
        """What takes the activity away."""


class Heard(hfg.Node):
    """Writes down what it is told, when, and whether that brought activity."""

    told = hfg.State(factory=list[tuple[float, Any, bool]])

    @hfg.slot
    def hear(self, token: hfg.Token[Any]) -> None:
        self.told.append((round(hfg.elapsed(), 6), token.value, token.activity == 1))


@hfg.node
def script(*, values: tuple[Any, ...] = ()) -> Iterator[Any]:
    yield from values


def ways_of_activity(graph: hfg.Graph) -> list[str]:
    """Run a graph; give the nodes that became active, in order, with the time."""
    found: list[str] = []

    def note(event: TraceEvent) -> None:
        if isinstance(event, ActivityChanged) and event.active:
            found.append(f"{event.node} {event.time:g}")

    hfg.run(graph, clock="virtual", trace=note)
    return found


# --- activity and data ---


@pytest.mark.rule("A3", "A5", "A6")
def test_an_activity_gate_passes_one_value_behind_each_activity() -> None:
    found = run(activity.ActivityGate(), **one("values[0]", "1-2-3-4|"), begin="-+---+")
    assert found == {"passed[0]": ".-(+2)-.-(+4)|", "activity": "-+~--+~"}


def one(name: str, line: str) -> dict[str, Any]:
    return {name: line}


def test_an_activity_gate_stays_open_behind_edges_that_are_not_active() -> None:
    node = activity.ActivityGate()
    assert fire(node, values=[1], active=False).outputs == {}
    assert fire(node, values=[2], active=True).outputs == {"passed[0]": 2}
    assert fire(node, values=[3]).outputs == {"passed[0]": 3}


def test_activity_that_comes_with_a_value_lets_it_pass() -> None:
    found = run(activity.ActivityGate(), **one("values[0]", "1-(+2)-3|"))
    assert found["passed[0]"] == ".-(+2)-.|"


def test_an_inverted_activity_gate_passes_while_it_is_not_active() -> None:
    node = activity.ActivityGate(values=2, inverted=True)
    assert fire(node, values=[1, "a"], active=False).outputs == {"passed[0]": 1, "passed[1]": "a"}
    assert fire(node, values=[1, "a"], active=True).outputs == {}


def test_an_activity_switch_has_two_ways() -> None:
    found = run(activity.ActivitySwitch(), value="1-2-3|", begin="-+")
    assert found == {"when_active": ".-(+2)-.|", "when_inactive": "1-.-3|", "activity": "-+~"}


@pytest.mark.rule("A4")
def test_a_generator_makes_activity_of_every_value() -> None:
    check(activity.ActivityGenerator(), value="1-2|", expected={"out": "(+1)-(+2)|"})
    assert run(activity.ActivityGenerator(), value="1|", active=False) == {"out": "1|"}


@pytest.mark.rule("A4", "A9")
def test_an_absorber_lets_activity_vanish_and_values_pass() -> None:
    found = run(activity.ActivityAbsorber(), value="1(+2)-3(~4)|", take="---+")
    assert found["out"] == "12-34|"
    assert found.get("activity", "").count("+") == found.get("activity", "").count("~")


def test_an_absorber_leaves_nobody_active() -> None:
    graph = hfg.Graph()
    absorber, heard = graph.add(activity.ActivityAbsorber()), graph.add(Heard())
    graph.start.activates(absorber.take)
    graph.connect(graph.add(script(values=(1,))).out, absorber.value)
    graph.connect(absorber.out, heard.hear, active=True)
    assert ways_of_activity(graph) == ["activity_absorber/pass_without 0"]
    assert [active for _, _, active in heard.told] == [False]
    assert not any(node.active for node in (heard, absorber))


@pytest.mark.rule("A4", "A6")
def test_an_inactivity_generator_deactivates_whoever_takes_its_signal() -> None:
    check(activity.InactivityGenerator(), emit="!-3", expected={"deactivation": "~-(~3)"})
    check(activity.InactivityGenerator(), emit="-(+!)", expected={"deactivation": "-~", "activity": "-+"})


# --- waiting, and doing once ---


@pytest.mark.rule("A3", "A5")
def test_the_next_message_behind_the_activity_takes_it_along() -> None:
    found = run(activity.WaitForMessage(), message="1-2-3|", begin="-+")
    assert found == {"received": "1-(+2)-3", "activity": "-+~"}


def test_a_text_is_waited_for_and_others_are_not() -> None:
    found = run(activity.WaitForText(wanted="s"), message="s-a-s-s|", begin="-+")
    assert found == {"received": "s---(+s)-s", "activity": "-+--~"}


def test_a_command_is_sent_once_and_the_activity_goes_on() -> None:
    found = run(activity.OneShotCommand(), value="1-2-3|", begin="-+")
    assert found["out"] == ".-2-.|"
    assert found["done"] == "--+"


def test_a_command_is_sent_once_more_when_activity_comes_again() -> None:
    found = run(activity.OneShotCommand(), value="1-2-3-4-5|", begin="-+---+")
    assert found["out"] == ".-2-.-4-.|"
    assert found["done"] == "--+---+"


# --- one behaviour after another ---


def test_steps_are_done_one_after_the_other_and_the_activity_is_where_something_happens() -> None:
    graph = hfg.Graph()
    sequence, heard = graph.add(activity.Sequence(steps=3)), graph.add(Heard())
    for number, name in enumerate("abc"):
        step = graph.add(Behaviour(takes_s=number + 1.0), name=name)
        sequence.steps[number].activates(step.begin)
        step.done.activates(sequence.done[number])
    graph.start.activates(sequence.begin)
    sequence.finished.activates(heard.hear)
    assert ways_of_activity(graph) == [
        "sequence 0",
        "a 0",
        "sequence 1",
        "b 1",
        "sequence 3",
        "c 3",
        "sequence 6",
        "heard 6",
    ]
    assert heard.told == [(6.0, "Noneabc", True)]


def test_a_step_that_gives_up_breaks_the_sequence_off() -> None:
    graph = hfg.Graph()
    sequence, heard = graph.add(activity.Sequence()), graph.add(Heard())
    first, second = graph.add(Behaviour(gives_up=1), name="first"), graph.add(Behaviour(), name="second")
    for number, step in enumerate((first, second)):
        sequence.steps[number].activates(step.begin)
        step.done.activates(sequence.done[number])
        step.gave_up.activates(sequence.gave_up[number])
    graph.start.activates(sequence.begin)
    sequence.broken_off.activates(heard.hear)
    hfg.run(graph, clock="virtual")
    assert heard.told == [(1.0, "Nonefirst", True)]
    assert second.begun == []


def test_a_step_that_is_not_due_has_no_effect() -> None:
    node = activity.Sequence()
    assert fire(node, slot="done[0]", value=1).events == []
    assert fire(node, slot="begin", value=1).events == [("steps[0]", 1)]
    assert fire(node, slot="done[1]", value=2).events == []
    assert fire(node, slot="gave_up[1]", value=2).events == []
    assert fire(node, slot="done[0]", value=3).events == [("steps[1]", 3)]
    assert fire(node, slot="done[0]", value=4).events == []
    assert fire(node, slot="done[1]", value=5).events == [("finished", 5)]
    assert fire(node, slot="done[1]", value=6).events == []


def test_ways_are_tried_until_one_succeeds() -> None:
    graph = hfg.Graph()
    fallback, heard = graph.add(activity.Fallback(ways=3)), graph.add(Heard())
    for number, name in enumerate("abc"):
        way = graph.add(Behaviour(gives_up=1 if name == "a" else 0), name=name)
        fallback.ways[number].activates(way.begin)
        way.done.activates(fallback.done[number])
        way.gave_up.activates(fallback.gave_up[number])
    graph.start.activates(fallback.begin)
    fallback.finished.activates(heard.hear)
    assert ways_of_activity(graph) == ["fallback 0", "a 0", "fallback 1", "b 1", "fallback 2", "heard 2"]
    assert heard.told == [(2.0, "Noneb", True)]


def test_when_all_ways_have_given_up_that_is_told() -> None:
    node = activity.Fallback()
    assert fire(node, slot="gave_up[0]", value=0).events == []
    assert fire(node, slot="begin", value=7).events == [("ways[0]", 7)]
    assert fire(node, slot="done[1]", value=0).events == []
    assert fire(node, slot="gave_up[0]", value=1).events == [("ways[1]", 7)]
    assert fire(node, slot="gave_up[1]", value=2).events == [("exhausted", 2)]


@pytest.mark.rule("A3", "A6")
def test_branches_are_done_at_once_and_activity_is_gathered() -> None:
    graph = hfg.Graph()
    parallel, heard = graph.add(activity.Parallel()), graph.add(Heard())
    for number, name in enumerate("ab"):
        branch = graph.add(Behaviour(takes_s=2.0 - number), name=name)
        parallel.branches[number].activates(branch.begin)
        branch.done.activates(parallel.done[number])
    graph.start.activates(parallel.begin)
    parallel.finished.activates(heard.hear)
    assert ways_of_activity(graph) == ["parallel 0", "a 0", "b 0", "parallel 1", "heard 2"]
    assert heard.told == [(2.0, ["Nonea", "Noneb"], True)]
    assert not parallel.active


def test_what_a_branch_says_twice_counts_once() -> None:
    node = activity.Parallel()
    assert fire(node, slot="done[0]", value=0).events == []
    assert fire(node, slot="begin", value=1).events == [("branches[0]", 1), ("branches[1]", 1)]
    assert fire(node, slot="done[0]", value="a").events == []
    assert fire(node, slot="done[0]", value="b").events == []
    assert fire(node, slot="done[1]", value="c").events == [("finished", ["b", "c"])]
    assert fire(node, slot="done[1]", value="c").events == []


def test_a_number_begins_one_of_several_behaviours() -> None:
    check(activity.Branch(), begin="(+1)-0-2", expected={"ways[1]": "(+1)", "ways[0]": "--0", "other": "----2"})
    assert fire(activity.Branch(), slot="begin", value=-1).events == [("other", -1)]


# --- time ---


@pytest.mark.rule("A3", "A9")
def test_a_wait_holds_the_activity_and_hands_it_on() -> None:
    check(activity.Wait(seconds=0.03), begin="-(+7)------|", expected={"done": "----(+7)", "activity": "-+--~"})
    check(activity.Wait(seconds=0.03), begin="-7|", active=False, expected={"done": ""})
    check(activity.Wait(seconds=0), begin="-7-|", expected={"done": "-7"})


def test_a_wait_is_broken_off_when_its_activity_is_taken_away() -> None:
    found = run(activity.Wait(seconds=0.05), begin="(+1)---------|", deactivate="--!")
    assert found == {"activity": "+-~"}


def test_a_wait_that_is_broken_off_keeps_no_run_open() -> None:
    graph = hfg.Graph()
    wait, before = graph.add(activity.Wait(seconds=1000)), graph.add(Behaviour(takes_s=2))
    graph.start.activates(wait.begin)
    graph.connect(graph.start, before.begin)
    graph.connect(before.done, wait.deactivate)
    assert hfg.run(graph, clock="virtual").duration_s == 2


def test_a_wait_begun_anew_takes_the_place_of_the_one_before() -> None:
    check(activity.Wait(seconds=0.04), begin="1--2------|", expected={"done": "-------2"})


def limited_graph(takes_s: float, *, active: bool) -> tuple[hfg.Graph, Callable[[], dict[str, list[Any]]]]:
    graph = hfg.Graph()
    limit = graph.add(activity.TimeLimit(seconds=2), name="limit")
    work = graph.add(Behaviour(takes_s=takes_s), name="work")
    finished, expired = graph.add(Heard(), name="finished"), graph.add(Heard(), name="expired")
    for source, target in (
        (graph.start, limit.begin),
        (limit.work, work.begin),
        (work.done, limit.done),
        (limit.cancel, work.cancel),
        (limit.finished, finished.hear),
        (limit.expired, expired.hear),
    ):
        graph.connect(source, target, active=active)
    return graph, lambda: {"finished": finished.told, "expired": expired.told}


@pytest.mark.parametrize("active", [True, False])
def test_a_behaviour_that_is_done_in_time_keeps_its_activity(active: bool) -> None:
    graph, heard = limited_graph(1, active=active)
    ways = ways_of_activity(graph)
    assert heard() == {"finished": [(1.0, "Nonework", active)], "expired": []}
    assert ways == (["limit 0", "work 0", "limit 1", "finished 1"] if active else [])


@pytest.mark.rule("A4", "A6")
@pytest.mark.parametrize("active", [True, False])
def test_the_activity_of_a_behaviour_that_takes_too_long_goes_on_without_it(active: bool) -> None:
    graph, heard = limited_graph(5, active=active)
    ways = ways_of_activity(graph)
    assert heard() == {"finished": [], "expired": [(2.0, None, active)]}
    assert ways == (["limit 0", "work 0", "expired 2"] if active else [])


def retrying(gives_up: int, **parameters: Any) -> tuple[hfg.Graph, Behaviour, Heard, Heard]:
    graph = hfg.Graph()
    retry, work = graph.add(activity.Retry(**parameters)), graph.add(Behaviour(gives_up=gives_up), name="work")
    finished, exhausted = graph.add(Heard(), name="finished"), graph.add(Heard(), name="exhausted")
    graph.start.activates(retry.begin)
    retry.attempt.activates(work.begin)
    work.done.activates(retry.done)
    work.gave_up.activates(retry.gave_up)
    retry.finished.activates(finished.hear)
    retry.exhausted.activates(exhausted.hear)
    return graph, work, finished, exhausted


def test_a_behaviour_is_begun_again_until_it_succeeds() -> None:
    graph, work, finished, exhausted = retrying(2)
    hfg.run(graph, clock="virtual")
    assert (len(work.begun), finished.told, exhausted.told) == (3, [(3.0, "Nonework", True)], [])


def test_attempts_are_limited() -> None:
    graph, work, finished, exhausted = retrying(5, attempts=2)
    hfg.run(graph, clock="virtual")
    assert (len(work.begun), finished.told, exhausted.told) == (2, [], [(2.0, "Nonework", True)])


def test_the_activity_is_here_in_the_pause_between_two_attempts() -> None:
    graph, _, finished, _ = retrying(1, pause_s=3.0)
    assert ways_of_activity(graph) == ["retry 0", "work 0", "retry 1", "work 4", "retry 5", "finished 5"]
    assert finished.told == [(5.0, "Nonework", True)]


def test_a_pause_is_broken_off_when_the_activity_is_taken_away() -> None:
    graph, work, finished, exhausted = retrying(1, pause_s=1000.0)
    clock = graph.add(Behaviour(takes_s=2.5), name="clock")
    graph.connect(graph.start, clock.begin)
    graph.connect(clock.done, graph["retry"].deactivate)
    report = hfg.run(graph, clock="virtual")
    assert (len(work.begun), finished.told, exhausted.told, report.duration_s) == (1, [], [], 2.5)


def test_figure_17_as_nodes_of_the_library() -> None:
    """Wait for the start signal, switch the lamp on, go on."""
    graph = hfg.Graph()
    graph.add(script(values=("start", "hello", "start")), max_rate_hz=1)
    boot, wait = graph.add(activity.Wait(seconds=0.5), name="boot"), graph.add(activity.WaitForText())
    lamp, on = graph.add(activity.OneShotCommand(), name="lamp"), graph.add(flow.Latch(), name="on", max_rate_hz=10)
    sent, drive = graph.add(Heard(), name="sent"), graph.add(Heard(), name="drive")
    graph.start.activates(boot.begin)
    boot.done.activates(wait.begin)
    wait.received.activates(lamp.begin)
    lamp.done.activates(drive.hear)
    graph.connect("script.out", "wait_for_text.message")
    graph.connect(graph.add(script(values=("on",)), name="command").out, on.value)
    graph.connect(on.out, lamp.value)
    graph.connect(lamp.out, sent.hear)
    graph.connect(drive.activated, on.close)
    report = hfg.run(graph, clock="virtual", until_s=10)
    assert report.outcome == "done"
    assert [time for time, _, _ in sent.told] == [time for time, _, _ in drive.told]
    assert len(drive.told) == 1
    assert 2.0 <= drive.told[0][0] <= 2.1


# --- activity is handed on once ---


@pytest.mark.rule("A3", "A5")
@pytest.mark.parametrize("kind", [activity.Sequence, activity.Fallback, activity.Branch, activity.Retry])
def test_one_call_of_an_active_node_hands_its_activity_on_once(kind: type[hfg.Node]) -> None:
    """Two signals of one call would both carry +1 over active edges; only `Parallel` is made for that."""
    choose = random.Random(kind.__name__)
    node = kind()
    slots = [name for name, spec in node._type.slots.items() if spec.handler_name]
    calls = [fire(node, slot=choose.choice(slots), value=choose.randrange(3), active=True) for _ in range(200)]
    sent = {len(call.events) for call in calls}
    assert 1 in sent <= {0, 1}

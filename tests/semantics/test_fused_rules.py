"""Each rule on a graph of a few nodes that fuses it: what is expected was counted out on paper, fused or not."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.engine.runtime import settings
from tests.semantics.nodes import KeepTokens, run
from tests.semantics.test_fused import fused_order
from tests.support import kinds as nodes

MANY = 40
"""Waves: enough for a node that is never plain to be left out of a region."""


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


def outside(graph: hfg.Graph, node: Any, **options: Any) -> Any:
    """Add a node that no region takes in: one with a time limit."""
    return graph.add(node, max_duration_s=100.0, **options)


# --- silence


@hfg.node
def total(first: int = 0, second: int = 0) -> int:
    return first + second


@pytest.mark.rule("F4")
def test_a_member_is_not_called_when_all_its_optional_inputs_are_silent(fast: bool) -> None:
    graph = hfg.Graph()
    source, twos, threes = graph.add(nodes.script(values=(1, 2, 3, 6, 7))), nodes.some(), nodes.some(modulus=3)
    both = graph.add(total())
    for port, part in (("first", graph.add(twos, name="twos")), ("second", graph.add(threes, name="threes"))):
        graph.connect(source.out, part.value)
        graph.connect(part.out, both.ports.inputs[port])
    graph.connect(both.out, graph.output("totals", int))
    assert run(graph, fast).outputs["totals"] == [2, 3, 12]


@pytest.mark.rule("F4")
def test_a_member_is_not_called_when_one_of_two_mandatory_inputs_is_silent(fast: bool) -> None:
    graph = hfg.Graph()
    source, twos, both = graph.add(nodes.script(values=(1, 2, 3, 4))), graph.add(nodes.some()), graph.add(nodes.add())
    graph.connect(source.out, twos.value)
    graph.connect(twos.out, both.a)
    graph.connect(source.out, both.b)
    graph.connect(both.out, graph.output("sums", int))
    assert run(graph, fast).outputs["sums"] == [4, 8]


@pytest.mark.rule("T2", "F4")
def test_a_silence_that_waits_while_another_member_leaves_its_wave_stays_one(fast: bool) -> None:
    graph = hfg.Graph()
    source, twos, both = graph.add(nodes.script(values=(1, 3, 4, 5))), graph.add(nodes.some()), graph.add(nodes.add())
    passes = graph.add(nodes.Speaks(way="token"))
    graph.connect(source.out, twos.value)
    graph.connect(source.out, passes.value)
    graph.connect(twos.out, both.a)
    graph.connect(passes.out, both.b)
    graph.connect(both.out, graph.output("sums", int))
    assert run(graph, fast).outputs["sums"] == [8]


@pytest.mark.rule("R7")
def test_the_silences_of_all_behind_a_silent_member_are_counted(fast: bool) -> None:
    graph = hfg.Graph()
    source, twos, behind = graph.add(nodes.script(values=(1, 2, 3, 5))), graph.add(nodes.some()), nodes.double()
    graph.connect(source.out, twos.value)
    graph.connect(twos.out, graph.add(behind).value)
    graph.connect(behind.out, graph.add(nodes.sink(), name="last").value)
    report = run(graph, fast)
    assert [(report.nodes[name].firings, report.nodes[name].silent) for name in ("double", "last")] == [(5, 3), (5, 3)]


# --- stamps


class Stamped(hfg.Node):
    """A source whose outputs have stamps of their own: the number itself by one, one more by the other."""

    older = hfg.Output(int)
    newer = hfg.Output(int)
    left = hfg.State(MANY)

    def process(self) -> None:
        if not self.left:
            raise hfg.EndOfStream
        self.left -= 1
        number = MANY - self.left
        self.older.send(number, stamp=float(number))
        self.newer.send(number, stamp=number + 1.0)


@hfg.node
async def later_sum(a: int, b: int) -> int:
    await asyncio.sleep(0.01)
    return a + b


@pytest.mark.rule("T5")
@pytest.mark.parametrize("ports", [("a", "b"), ("b", "a")])
@pytest.mark.parametrize("kind", ["plain", "async", "thread"])
def test_what_a_head_sends_has_the_newest_stamp_of_what_it_took(fast: bool, kind: str, ports: tuple[str, str]) -> None:
    graph, kept = hfg.Graph(), KeepTokens()
    graph.group("work", threads=1)
    group = "work" if kind == "thread" else None
    source, behind = graph.add(Stamped()), graph.add(nodes.double(), group=group)
    both = graph.add(later_sum() if kind == "async" else nodes.add(), name="both", group=group)
    graph.connect(source.older, both.ports.inputs[ports[0]])
    graph.connect(source.newer, both.ports.inputs[ports[1]])
    graph.connect(both.out, behind.value)
    graph.connect(behind.out, graph.add(kept).value)
    run(graph, fast)
    assert [token.stamp for token in kept.tokens] == [number + 1.0 for number in range(1, MANY + 1)]


@pytest.mark.rule("T5", "F3")
def test_an_explicit_stamp_leaves_with_what_a_member_sends_by_itself(fast: bool) -> None:
    graph, kept = hfg.Graph(), KeepTokens()
    source, speaks = graph.add(nodes.script(values=(1, 2, 3, 4))), graph.add(nodes.Speaks(way="stamped"))
    graph.connect(source.out, speaks.value)
    graph.connect(speaks.out, graph.add(kept).value)
    run(graph, fast)
    assert [token.stamp for token in kept.tokens] == [1.0, 2.0, 3.0, 4.0]


# --- activity


class Looks(hfg.Node):
    """Says whether it is active when it is called."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return int(self.active)


class Gives(hfg.Node):
    """Passes values on, one of them with activity."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        self.out.send(value, activity=1 if value == 3 else None)


@pytest.mark.rule("A6")
def test_a_head_receives_the_activity_that_a_token_brings(fast: bool) -> None:
    graph = hfg.Graph()
    source, gives, looks = graph.add(nodes.script(values=tuple(range(6)))), outside(graph, Gives()), graph.add(Looks())
    behind = graph.add(nodes.double())
    graph.connect(source.out, gives.value)
    graph.connect(gives.out, looks.value, active=True)
    graph.connect(looks.out, behind.value)
    graph.connect(behind.out, graph.output("active", int))
    assert run(graph, fast).outputs["active"] == [0, 0, 0, 2, 2, 2]


@hfg.node
def same(value: int) -> int:
    return value


@pytest.mark.rule("A5", "A3")
@pytest.mark.parametrize("group", [None, "work"])
def test_a_member_that_keeps_silent_gives_its_activity_away_with_what_it_sends_next(
    fast: bool, group: str | None
) -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, gives = graph.add(nodes.script(values=tuple(range(6)))), outside(graph, Gives())
    head, keeps = graph.add(same(), group=group), graph.add(nodes.some(), name="keeps", group=group)
    looks = graph.add(Looks(), group=group)
    graph.connect(source.out, gives.value)
    graph.connect(gives.out, head.value, active=True)
    graph.connect(head.out, keeps.value, active=True)
    graph.connect(keeps.out, looks.value, active=True)
    graph.connect(looks.out, graph.output("active", int))
    report = run(graph, fast)
    assert report.outputs["active"] == [0, 0, 1]
    assert [name for name, node in report.nodes.items() if node.active] == ["looks"]


class Calls(hfg.Node):
    """Triggers one event after the other in each call, and remembers whether it was active before."""

    first = hfg.Event()
    second = hfg.Event()
    seen: Any = hfg.State(factory=list)

    @hfg.slot
    def begin(self) -> None:
        self.seen.append(self.active)
        self.first.trigger(None)
        self.second.trigger(None)


class Hears(hfg.Node):
    seen: Any = hfg.State(factory=list)

    @hfg.slot
    def hear(self, token: hfg.Token[object]) -> None:
        self.seen.append((token.activity, self.active))


@pytest.mark.rule("A3", "A5")
def test_all_signals_of_a_call_carry_the_activity_that_the_first_gives_away(fast: bool) -> None:
    graph, calls, first, second = hfg.Graph(), Calls(), Hears(), Hears()
    source = graph.add(nodes.Script(count=4, every=1))
    graph.add(calls)
    graph.connect(source.seen, calls.begin)
    graph.connect(graph.start, calls.activate, active=True)
    graph.connect(calls.first, graph.add(first, name="first").hear, active=True)
    graph.connect(calls.second, graph.add(second, name="second").hear, active=True)
    run(graph, fast)
    assert calls.seen == [True, False, False, False]
    assert first.seen == second.seen == [(1, True), (0, True), (0, True), (0, True)]


# --- order


@pytest.mark.rule("F9", "R2")
def test_a_slot_has_its_token_before_an_input_that_was_connected_earlier(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = hfg.Graph()
    source, double, tally = graph.add(nodes.script(), name="s"), graph.add(nodes.double(), name="d"), nodes.Tally()
    graph.connect(source.out, double.value)
    graph.connect(source.out, graph.add(tally, name="t").note)
    assert fused_order(graph, monkeypatch) == ["s", "t", "d"] * 3 + ["s"]


@pytest.mark.rule("R2")
def test_members_go_depth_first(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = hfg.Graph()
    source, first, second = graph.add(nodes.script(), name="s"), graph.add(nodes.double(), name="a"), nodes.double()
    graph.connect(source.out, first.value)
    graph.connect(source.out, graph.add(second, name="c").value)
    graph.connect(first.out, graph.add(nodes.double(), name="b").value)
    assert fused_order(graph, monkeypatch) == ["s", "a", "b", "c"] * 3 + ["s"]


@pytest.mark.rule("R2")
def test_who_stands_behind_a_member_that_leaves_its_wave_follows_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = hfg.Graph()
    source = graph.add(nodes.script(values=(1, 2, 3)), name="s")
    fails = graph.add(nodes.picky(at=2), name="f", on_error="skip")
    graph.connect(source.out, fails.value)
    graph.connect(source.out, graph.add(nodes.double(), name="b").value)
    graph.connect(fails.out, graph.add(nodes.double(), name="a").value)
    assert fused_order(graph, monkeypatch) == ["s", "f", "a", "b", "s", "f", "b", "s", "f", "a", "b", "s"]


@pytest.mark.rule("R2", "P4")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_who_takes_from_a_buffer_goes_before_the_next_wave(monkeypatch: pytest.MonkeyPatch, clock: Any) -> None:
    graph = hfg.Graph()
    source, awaits = graph.add(nodes.script(), name="s"), graph.add(nodes.calm(), name="a")
    graph.connect(source.out, awaits.value)
    graph.connect(awaits.out, graph.add(nodes.sink(), name="b").value, buffer=3)
    begun_and_over = ["a", "a"]
    assert fused_order(graph, monkeypatch, clock) == ["s", *begun_and_over, "b"] * 3 + ["s"]


# --- who hears, and who waits


@pytest.mark.rule("T4", "F6")
@pytest.mark.parametrize("relay", [nodes.double, nodes.calm])
def test_of_slots_that_listen_while_they_are_active_those_of_active_nodes_are_called(fast: bool, relay: Any) -> None:
    graph = hfg.Graph()
    source, relays, takes = (
        graph.add(nodes.script()),
        graph.add(relay(), name="relays"),
        graph.add(nodes.Tally(), name="takes"),
    )
    hearers = [graph.add(nodes.Attentive(), name=f"h{number}") for number in range(6)]
    graph.connect(source.out, relays.value)
    for hears in hearers:
        graph.connect(relays.out, hears.say)
    graph.connect(relays.out, takes.value)
    for hears in hearers[2:4]:
        graph.connect(graph.start, hears.activate, active=True)
    report = run(graph, fast)
    assert [report.nodes[f"h{number}"].calls for number in range(6)] == [0, 0, 4, 4, 0, 0]  # with `activate`
    assert takes.count == 3
    assert {edge.sent for label, edge in report.edges.items() if label.startswith("relays.out -> h")} == {4}  # with END


@hfg.node
def seconds(*, count: int = 4) -> Iterator[int]:
    for _ in range(count):
        yield round(hfg.elapsed())


@hfg.node
async def takes_a_second(value: int) -> None:
    await asyncio.sleep(1)


@pytest.mark.rule("F5")
@pytest.mark.parametrize("group", [None, "work"])
def test_who_feeds_a_head_waits_for_those_behind_it_outside(fast: bool, group: str | None) -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, head = outside(graph, seconds()), graph.add(same(), group=group, release="sequential")
    member = graph.add(same(), name="member", group=group)
    graph.connect(source.out, head.value)
    graph.connect(head.out, member.value)
    graph.connect(member.out, outside(graph, takes_a_second(), release="sequential").value)
    graph.connect(source.out, graph.output("seconds", int))
    assert run(graph, fast).outputs["seconds"] == [0, 1, 2, 3]


# --- code that gives way


class SendsAndGivesWay(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    async def process(self, value: int) -> None:
        self.out.send(value)
        await asyncio.sleep(0)


@pytest.mark.rule("F3")
@pytest.mark.parametrize("clock", ["virtual", "real"])
def test_what_was_sent_before_a_member_gives_way_leaves_with_its_firing(fast: bool, clock: Any) -> None:
    graph, sends, both = hfg.Graph(), SendsAndGivesWay(), nodes.add()
    source = graph.add(nodes.script(values=(1, 2, 3)))
    graph.connect(source.out, graph.add(sends).value)
    graph.connect(sends.out, graph.add(both).a)
    graph.connect(source.out, both.b)
    graph.connect(both.out, graph.output("sums", int))
    assert hfg.run(graph, clock=clock, fast=fast).outputs["sums"] == [2, 4, 6]

"""Activity: who has it, how it moves and forks, what modifiers do (rules A1-A7)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg.trace import ActivityChanged, EventTriggered, TraceEvent
from tests.semantics.nodes import (
    Both,
    Countdown,
    Ear,
    Fork,
    Keep,
    KeepsModifiers,
    KeepTokens,
    Pair,
    Ringing,
    Runner,
    Send,
    activity,
    drive,
    gaps,
    modifiers,
    numbers,
    of_kind,
    run,
    slow_numbers,
    traced,
)

# --- A1, A2, A7 ---


@pytest.mark.rule("A1")
def test_no_node_is_active_at_the_start_and_afterwards_none_is_either(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(Runner())
    graph.connect(source.out, node.value)
    run(graph, fast)
    assert node.seen == [False, False]
    assert not node.active
    graph.start.activates(node.begin)
    run(graph, fast)
    assert node.seen == [True, True]
    assert not node.active  # outside a run
    assert not graph.edges[0].active
    assert graph.edges[1].active


@pytest.mark.rule("A2")
def test_activity_does_not_change_whether_or_how_a_node_fires() -> None:
    stories = []
    for active in (False, True):
        graph = hfg.Graph()
        source, node, sink = graph.add(numbers(count=4)), graph.add(Runner()), graph.add(Keep())
        graph.connect(source.out, node.value)
        graph.connect(node.out, sink.value)
        graph.connect(graph.start, node.begin, active=active)
        trace = [event for event in traced(graph) if not isinstance(event, ActivityChanged | EventTriggered)]
        stories.append([str(event).replace("activity=1", "activity=0") for event in trace])
    assert stories[0] == stories[1]


@pytest.mark.rule("A7")
def test_an_edge_that_is_not_active_changes_nothing_by_its_tokens() -> None:
    graph = hfg.Graph()
    source, send = graph.add(numbers(count=1)), graph.add(Send(modifier=1))
    ear, sink = graph.add(Ear()), graph.add(Keep())
    graph.connect(source.out, send.value)
    graph.connect(send.rang, ear.hear)
    graph.connect(send.out, sink.value)
    assert of_kind(traced(graph), ActivityChanged) == []


@pytest.mark.rule("A7", "A9")
def test_the_slots_activate_and_deactivate_act_on_any_edge(fast: bool) -> None:
    graph = hfg.Graph()
    node = graph.add(Both())
    first, second = graph.add(Countdown(count=1)), graph.add(slow_numbers(count=1, pause_s=5))
    graph.connect(first.out, node.activate)
    graph.connect(second.out, node.deactivate)
    report = run(graph, fast)
    assert report.nodes["both"].active is False
    assert activity(traced(graph), "both") == [True, False]


# --- A3, A5 ---


@pytest.mark.rule("A3", "A5")
def test_activity_moves_along_an_active_edge_with_the_first_token(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=2)), graph.add(Runner()), graph.add(KeepTokens())
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.out, sink.value, active=True)
    report = run(graph, fast)
    assert [token.activity for token in sink.tokens] == [1]
    assert (report.nodes["runner"].active, report.nodes["keep_tokens"].active) == (False, True)
    assert node.seen == [True, False]


@pytest.mark.rule("A5", "T3")
def test_sending_only_silence_keeps_activity(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(gaps(count=3)), graph.add(Runner()), graph.add(Keep())
    late = graph.add(Ear())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value, active=True)
    graph.start.activates(late.begin)
    report = run(graph, fast)
    assert report.nodes["ear"].active
    assert sink.values == [1, 3]


@pytest.mark.rule("A5")
def test_sending_only_over_edges_that_are_not_active_keeps_activity(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=3)), graph.add(Runner()), graph.add(KeepTokens())
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert node.seen == [True, True, True]
    assert report.nodes["runner"].active
    assert [token.activity for token in sink.tokens] == [0, 0]


@pytest.mark.rule("A3", "A5")
def test_one_firing_forks_activity_over_several_sendings(fast: bool) -> None:
    graph = hfg.Graph()
    source, fork = graph.add(numbers(count=2)), graph.add(ForkWithSlot())
    ears, sinks = [graph.add(Ear()) for _ in range(3)], [graph.add(KeepTokens()) for _ in range(2)]
    graph.connect(source.out, fork.value)
    graph.start.activates(fork.begin)
    graph.connect(fork.first, ears[0].hear, active=True)
    graph.connect(fork.first, ears[1].hear, active=True)
    graph.connect(fork.second, ears[2].hear, active=True)
    graph.connect(fork.a, sinks[0].value, active=True)
    graph.connect(fork.b, sinks[1].value, active=True)
    report = run(graph, fast)
    assert [report.nodes[f"ear{end}"].active for end in ("", "_2", "_3")] == [True, True, True]
    assert [[token.activity for token in sink.tokens] for sink in sinks] == [[1, 0], [1, 0]]
    assert not report.nodes["fork_with_slot"].active


class ForkWithSlot(Fork):
    """A fork that can be made active."""

    @hfg.slot
    def begin(self) -> None:
        pass


@pytest.mark.rule("A3", "A5")
def test_one_call_forks_activity_too(fast: bool) -> None:
    graph = hfg.Graph()
    fork, ears = graph.add(Fork()), [graph.add(Ear()) for _ in range(2)]
    graph.start.activates(fork.poke)
    graph.connect(fork.first, ears[0].hear, active=True)
    graph.connect(fork.second, ears[1].hear, active=True)
    report = run(graph, fast)
    assert [report.nodes[name].active for name in ("fork", "ear", "ear_2")] == [False, True, True]


@pytest.mark.rule("A3")
def test_the_right_to_fork_ends_with_the_firing_or_call(fast: bool) -> None:
    graph = hfg.Graph()
    rings, node = graph.add(Ringing(count=2)), graph.add(Runner())
    ear = graph.add(KeepsModifiers())
    graph.connect(graph.start, node.activate)
    graph.connect(rings.rang, node.ring)
    graph.connect(node.rang, ear.hear, active=True)
    run(graph, fast)
    assert ear.seen == [1, 0]


@pytest.mark.rule("A3", "A12")
def test_a_timeout_takes_the_right_to_fork_away() -> None:
    graph = hfg.Graph()
    node, first, second = graph.add(Waits(), active_for_s=0.5), graph.add(KeepsModifiers()), graph.add(KeepsModifiers())
    graph.start.activates(node.begin)
    graph.connect(node.rang, first.hear)
    graph.connect(node.later, second.hear, active=True)
    graph.connect(node.timeout, first.hear, active=True)
    trace = traced(graph)
    assert modifiers(trace, "waits.timeout -> keeps_modifiers.hear") == [1]
    assert modifiers(trace, "waits.later -> keeps_modifiers_2.hear") == [0]


@pytest.mark.rule("A3", "G2")
def test_deactivating_the_box_around_a_node_takes_the_right_to_fork_away(fast: bool) -> None:
    class Box(hfg.Subgraph):
        begin = hfg.slot(type=object)
        rang = hfg.Event(int)
        later = hfg.Event(int)

        def build(self, graph: hfg.Graph) -> None:
            node = graph.add(Waits())
            graph.connect(self.begin.inner, node.begin, active=True)
            graph.connect(node.rang, self.rang.inner, active=True)
            graph.connect(node.later, self.later.inner, active=True)

    async def main() -> list[list[int]]:
        graph = hfg.Graph()
        box, first, second = graph.add(Box()), graph.add(KeepsModifiers()), graph.add(KeepsModifiers())
        graph.start.activates(box.begin)
        graph.connect(box.rang, first.hear, active=True)
        graph.connect(box.later, second.hear, active=True)
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(0.5)
            await run.trigger(box.deactivate)
            await run.wait_quiet()
        return [first.seen, second.seen]

    assert drive(main) == [[1], [0]]


class Waits(hfg.Node):
    """Triggers now and a second later, in one call."""

    rang = hfg.Event(int)
    later = hfg.Event(int)

    @hfg.slot
    async def begin(self) -> None:
        self.rang.trigger(1)
        await asyncio.sleep(1)
        self.later.trigger(2)


# --- A4 ---


@pytest.mark.rule("A4", "A5")
@pytest.mark.parametrize("modifier", [1, -1, 0])
def test_an_explicit_modifier_is_kept_on_active_edges_and_only_plus_one_takes_the_senders_activity(
    modifier: int, fast: bool
) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=1)), graph.add(SendWithSlot(modifier=modifier))
    ear, sink, plain = graph.add(KeepsModifiers()), graph.add(KeepTokens()), graph.add(KeepTokens())
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.rang, ear.hear, active=True)
    graph.connect(node.out, sink.value, active=True)
    graph.connect(node.out, plain.value)
    trace: list[TraceEvent] = []
    run(graph, fast, trace=trace.append)
    assert ear.seen == [modifier]
    assert [token.activity for token in sink.tokens] == [modifier]
    assert [token.activity for token in plain.tokens] == [0]
    left_for_end = int(modifier != 1)
    assert modifiers(trace, "send_with_slot.out -> keep_tokens.value") == [modifier, left_for_end]


class SendWithSlot(Send):
    """Can be made active."""

    @hfg.slot
    def begin(self) -> None:
        pass


class PassesTokensOn(hfg.Node):
    """A relay."""

    said = hfg.Event(int)
    other = hfg.Event(int)

    @hfg.slot
    def hear(self, token: hfg.Token[int]) -> None:
        self.said.trigger(token)

    @hfg.slot
    def fork(self, token: hfg.Token[int]) -> None:
        self.said.trigger(token)
        self.other.trigger(token.value)

    @hfg.slot
    def hold_back(self, token: hfg.Token[int]) -> None:
        self.said.trigger(token, activity=0)


@pytest.mark.rule("A4", "A5")
@pytest.mark.parametrize(
    ("slot", "sent", "active_then"),
    [("hear", [1], ["b"]), ("fork", [1, 1], ["b", "c"]), ("hold_back", [0], ["a"])],
)
def test_a_relay_hands_its_activity_on_or_keeps_it_and_never_doubles_it(
    slot: str, sent: list[int], active_then: list[str], fast: bool
) -> None:
    graph = hfg.Graph()
    a, b, c = (graph.add(PassesTokensOn(), name=name) for name in "abc")
    graph.connect(a.said, b.hear, active=True)
    graph.connect(a.other, c.hear, active=True)
    trace: list[TraceEvent] = []

    async def main() -> list[str]:
        async with hfg.running(graph, fast=fast, trace=trace.append) as run:
            await run.trigger(a.ports.slots[slot], 1, activity=+1)
            await run.wait_quiet()
            return run.active()

    assert drive(main) == active_then
    assert modifiers(trace, "a.said -> b.hear") + modifiers(trace, "a.other -> c.hear") == sent


@pytest.mark.rule("A4", "A3")
def test_a_token_without_activity_that_is_passed_on_counts_as_its_value(fast: bool) -> None:
    graph = hfg.Graph()
    a, b = graph.add(PassesTokensOn(), name="a"), graph.add(PassesTokensOn(), name="b")
    graph.connect(a.said, b.hear, active=True)
    graph.start.activates(a.ports.slots["activate"])

    async def main() -> list[str]:
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(a.hear, hfg.Token(1, 0, 0.0))
            await run.wait_quiet()
            return run.active()

    assert drive(main) == ["b"]


@pytest.mark.rule("A4", "A3")
def test_an_output_is_held_back_by_an_explicit_zero_alone(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=1)), graph.add(SendWithSlot(modifier=0))
    taker = graph.add(Ear())
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.out, taker.hear, active=True)
    trace: list[TraceEvent] = []
    run(graph, fast, trace=trace.append)
    assert modifiers(trace, "send_with_slot.out -> ear.hear") == [0, 1]  # END takes what was held back


@pytest.mark.rule("A4")
def test_an_inactive_node_can_give_activity(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, ear = graph.add(numbers(count=1)), graph.add(Send(modifier=1)), graph.add(Ear())
    graph.connect(source.out, node.value)
    graph.connect(node.rang, ear.hear, active=True)
    report = run(graph, fast)
    assert report.nodes["ear"].active


class PassesOn(hfg.Node):
    """Passes on the token, or its value."""

    value = hfg.Input(int)
    whole = hfg.Output(int)
    part = hfg.Output(int)

    def process(self, value: hfg.Token[int]) -> None:
        self.whole.send(value)
        self.part.send(value.value)


@pytest.mark.rule("A4")
def test_a_token_passed_on_keeps_its_modifier_its_value_does_not() -> None:
    graph = hfg.Graph()
    source, send, node = graph.add(numbers(count=1)), graph.add(Send(modifier=-1)), graph.add(PassesOn())
    whole, part = graph.add(KeepTokens()), graph.add(KeepTokens())
    graph.connect(source.out, send.value)
    graph.connect(send.out, node.value, active=True)
    graph.connect(node.whole, whole.value, active=True)
    graph.connect(node.part, part.value, active=True)
    trace = traced(graph)
    assert modifiers(trace, "passes_on.whole -> keep_tokens.value") == [-1, 0]
    assert modifiers(trace, "passes_on.part -> keep_tokens_2.value") == [0, 0]


# --- A6 ---


@pytest.mark.rule("A6")
@pytest.mark.parametrize(
    ("before", "a", "b", "after", "changes"),
    [
        (False, 1, 0, True, 1),
        (False, -1, 1, True, 1),
        (True, -1, 1, True, 0),
        (True, 1, -1, True, 0),
        (True, -1, 0, False, 1),
        (False, -1, -1, False, 0),
        (True, 0, 0, True, 0),
    ],
)
def test_minus_acts_first_then_plus_and_only_the_net_change_counts(
    before: bool, a: int, b: int, after: bool, changes: int
) -> None:
    graph = hfg.Graph()
    source, node = graph.add(Countdown(count=1)), graph.add(PairWithSlot())
    one, two = graph.add(Send(modifier=a)), graph.add(Send(modifier=b))
    graph.connect(source.out, one.value)
    graph.connect(source.out, two.value)
    graph.connect(one.out, node.a, active=True)
    graph.connect(two.out, node.b, active=True)
    if before:
        graph.start.activates(node.begin)
    trace = traced(graph)
    assert node.seen == [after]
    assert len(activity(trace, "pair_with_slot")) == changes + before


class PairWithSlot(Pair):
    """Can be made active."""

    @hfg.slot
    def begin(self) -> None:
        pass


@pytest.mark.rule("A6")
def test_a_slots_token_acts_before_its_handler(fast: bool) -> None:
    graph = hfg.Graph()
    node = graph.add(Looks())
    graph.start.activates(node.begin)
    run(graph, fast)
    assert node.seen == [True]


class Looks(hfg.Node):
    seen = hfg.State(factory=list)

    @hfg.slot
    def begin(self) -> None:
        self.seen.append(self.active)


@pytest.mark.rule("A6", "F4")
def test_modifiers_act_in_a_silent_firing_too(fast: bool) -> None:
    graph = hfg.Graph()
    source, holes, send, node = (
        graph.add(numbers(count=1)),
        graph.add(Silent()),
        graph.add(Send(modifier=1)),
        graph.add(Pair()),
    )
    graph.connect(source.out, holes.value)
    graph.connect(holes.out, node.a)
    graph.connect(source.out, send.value)
    graph.connect(send.out, node.b, active=True)
    report = run(graph, fast)
    assert node.seen == []
    assert report.nodes["pair"].active


class Silent(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        pass

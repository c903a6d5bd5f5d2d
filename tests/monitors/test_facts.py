"""Facts about activity, written down from the rules alone: what a debug run must refuse, and what it must not."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg import commands
from hfg.errors import FileError, GraphError, MonitorViolated
from hfg.graph.structure import facts
from hfg.testing import explore

Play = Callable[..., None]


class State(hfg.Node):
    """Sends what it is told to."""

    a, b = hfg.Event(), hfg.Event()

    @hfg.slot
    def take(self) -> None:
        """Receive activity."""

    @hfg.slot
    def send(self, word: str) -> None:
        for letter in word:
            if letter in "ab":
                (self.a if letter == "a" else self.b).trigger()
            else:
                self.a.trigger(activity=1 if letter == "+" else -1)


def build(*claims: str, limit_s: float | None = None) -> hfg.Graph:
    """Three states: `one` leads to `two` by a, and to `three` by b; both lead back by a."""
    graph = hfg.Graph("states")
    one, three = (graph.add(State(), name=name) for name in ("one", "three"))
    two = graph.add(State(), name="two", active_for_s=limit_s)
    graph.start.activates(one.take)
    one.a.activates(two.take)
    one.b.activates(three.take)
    two.a.activates(one.take)
    three.a.activates(one.take)
    for claim in claims:
        getattr(graph, claim)("one", "two", "three")
    return graph


@pytest.fixture
def play(virtual_time: Callable[[Any], None]) -> Play:
    """Plays commands, "node:word", one after the other."""

    def run(graph: hfg.Graph, *words: str, debug: bool = True, policy: str | None = None) -> None:
        async def main() -> None:
            async with hfg.running(graph, debug=debug, policy=policy) as run:
                await run.wait_quiet()
                for one in words:
                    name, _, word = one.partition(":")
                    if name == "wait":
                        await asyncio.sleep(2.0)
                    elif name == "reset":
                        run.reset_activity()
                    elif name in ("activate", "deactivate"):
                        await run.trigger(getattr(graph.nodes[word], name))
                    else:
                        await run.trigger(graph[f"{name}.send"], word)
                    await run.wait_quiet()

        virtual_time(main())

    return run


@pytest.mark.rule("A3", "A5", "A10")
def test_activity_that_goes_round_is_exactly_one_from_the_start_on(play: Play) -> None:
    play(build("exactly_one", "at_most_one"), "one:a", "two:a", "one:b", "three:a", "two:a")


@pytest.mark.rule("A3")
def test_a_fork_violates_at_most_one(play: Play) -> None:
    with pytest.raises(MonitorViolated) as raised:
        play(build("at_most_one"), "one:ab")
    text = str(raised.value)
    assert 'the graph states that at most one of "one", "two", "three" is active, but after 0 s' in text
    assert '"one.a -> two.take" gets +1' in text
    assert '"one" is no longer active' in text


@pytest.mark.rule("A3")
def test_the_same_event_twice_violates_at_most_one(play: Play) -> None:
    with pytest.raises(MonitorViolated, match=r'"two" is active and activity lies on|activity lies on .* and activity'):
        play(build("at_most_one"), "one:aa")


@pytest.mark.rule("A4")
def test_an_inactive_node_that_sends_activity_violates_at_most_one(play: Play) -> None:
    with pytest.raises(MonitorViolated, match='at most one of "one"'):
        play(build("at_most_one"), "two:+")


@pytest.mark.rule("A4")
def test_an_active_node_that_says_plus_one_moves_its_activity(play: Play) -> None:
    play(build("exactly_one"), "one:+", "two:+")


@pytest.mark.rule("A4", "A6")
def test_a_minus_one_violates_exactly_one_and_not_at_most_one(play: Play) -> None:
    play(build("at_most_one"), "three:-")
    with pytest.raises(MonitorViolated, match="none of them is"):
        play(build("exactly_one"), "three:-")


@pytest.mark.rule("A7")
def test_the_slot_activate_counts(play: Play) -> None:
    with pytest.raises(MonitorViolated, match='"one" is active and "two" is active'):
        play(build("at_most_one"), "activate:two")
    with pytest.raises(MonitorViolated, match="none of them is"):
        play(build("exactly_one"), "deactivate:one")


@pytest.mark.rule("A14")
def test_a_reset_begins_anew_and_violates_nothing(play: Play) -> None:
    play(build("exactly_one"), "one:a", "reset", "one:b", "reset")


@pytest.mark.rule("A12")
def test_a_time_out_that_leads_on_violates_nothing_and_one_beside_it_does(play: Play) -> None:
    graph = build("exactly_one", limit_s=1.0)
    graph.connect("two.timeout", "three.take", active=True)
    play(graph, "one:a", "wait", "three:a")
    graph = build("at_most_one", limit_s=1.0)
    graph.connect("two.timeout", "three.activate")
    with pytest.raises(MonitorViolated, match="after 1 s"):
        play(graph, "one:a", "wait")


@pytest.mark.rule("A10")
def test_before_activity_comes_exactly_one_is_not_judged(play: Play) -> None:
    graph = build("exactly_one")
    graph.edit(commands.Disconnect("start", "one.take"))
    play(graph, "one:a", "two:ab")


def test_a_run_without_debug_does_not_look(play: Play) -> None:
    play(build("at_most_one"), "one:ab", debug=False)


@pytest.mark.rule("R4")
def test_a_fact_that_an_edit_states_first_while_the_graph_runs_is_checked_from_then_on(
    virtual_time: Callable[[Any], None],
) -> None:
    async def main() -> None:
        graph = build()
        async with hfg.running(graph, debug=True) as run:
            await run.wait_quiet()
            await run.edit(commands.Fact("at most one", ("one", "two", "three")))
            await run.trigger(graph["one.send"], "ab")
            await run.wait_finished()

    with pytest.raises(MonitorViolated, match="the graph states that at most one of"):
        virtual_time(main())


@pytest.mark.rule("G2")
def test_a_subgraph_stands_for_all_nodes_inside(play: Play) -> None:
    graph = build()
    graph.edit(commands.Enclose(("two", "three"), "box"))
    graph.at_most_one("box")
    with pytest.raises(MonitorViolated, match='at most one of "box" is active'):
        play(graph, "one:ab")


def test_explore_fails_where_a_fact_is_violated() -> None:
    def fork() -> hfg.Graph:
        graph = build("at_most_one")
        graph.start.activates(graph["two.take"])
        return graph

    with pytest.raises(AssertionError, match='the graph states that at most one of "one"'):
        explore(fork, runs=3)
    assert explore(build, runs=3).runs == 3


# --- facts are part of the graph


def test_facts_follow_their_nodes_through_edits() -> None:
    graph = build("at_most_one")
    graph.edit(commands.Rename("two", "second"))
    graph.edit(commands.Enclose(("second", "three"), "box"))
    assert str(graph.facts[0]) == 'at most one of "one", "box/second", "box/three" is active'


@pytest.mark.rule("R4")
def test_a_fact_goes_with_its_node_and_comes_back_with_it() -> None:
    graph = build("at_most_one")
    graph.edit(commands.Remove("two"))
    assert graph.facts == []
    graph.undo()
    assert len(graph.facts) == 1


@pytest.mark.rule("R4")
def test_a_node_in_the_place_of_another_takes_over_its_facts() -> None:
    graph = build("at_most_one")
    graph.edit(commands.Replace("two", f"{__name__}:State"))
    assert graph.facts[0].nodes[1] is graph.nodes["two"]
    graph.undo()
    assert graph.facts[0].nodes[1] is graph.nodes["two"]


def test_an_edit_states_a_fact_and_takes_it_back() -> None:
    graph = build()
    graph.edit(commands.Fact("exactly one", ("one", "two")))
    assert [fact.claim for fact in graph.facts] == ["exactly one"]
    graph.edit(commands.Fact("exactly one", ("two", "one"), stated=False))
    assert graph.facts == []
    graph.undo()
    assert [fact.claim for fact in graph.facts] == ["exactly one"]
    with pytest.raises(GraphError, match='it is not stated that at most one of "one", "two" is active'):
        graph.edit(commands.Fact("at most one", ("one", "two"), stated=False))


def test_a_file_keeps_facts(tmp_path: Any) -> None:
    graph = build("at_most_one", "exactly_one")
    hfg.save(graph, tmp_path / "states.hfg.yaml")
    again = hfg.load(tmp_path / "states.hfg.yaml", allow=["tests"])
    assert [str(fact) for fact in again.facts] == [str(fact) for fact in graph.facts]


def test_a_fact_in_a_file_that_names_nobody_is_reported_with_its_place(tmp_path: Any) -> None:
    file = tmp_path / "states.hfg.yaml"
    hfg.save(build("at_most_one"), file)
    file.write_text(file.read_text().replace("- two\n", "- too\n"))
    with pytest.raises(FileError, match=r'facts\[0\].*"too"'):
        hfg.load(file)


def test_commands_rebuild_facts() -> None:
    graph = build("at_most_one")
    again = hfg.Graph("states")
    again.edit(*graph.as_commands())
    assert [str(fact) for fact in again.facts] == [str(fact) for fact in graph.facts]


def test_a_fact_that_is_stated_twice_is_one() -> None:
    graph = build("at_most_one", "at_most_one")
    assert len(graph.facts) == 1


@pytest.mark.rule("L4")
def test_a_graph_states_at_most_so_many_facts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(facts, "MOST_FACTS", 1)
    graph = build("at_most_one")
    with pytest.raises(GraphError, match="states 1 facts already, as many as are allowed"):
        graph.exactly_one("one", "two")


def test_bad_facts_are_refused_with_the_remedy() -> None:
    graph = build()
    with pytest.raises(GraphError, match=r"graph.at_most_one needs two nodes or more, or a subgraph, got 1"):
        graph.at_most_one("one")
    with pytest.raises(GraphError, match='names "one" twice'):
        graph.exactly_one("one", "one", "two")
    with pytest.raises(GraphError, match='"four"'):
        graph.at_most_one("one", "four")
    with pytest.raises(GraphError, match="takes nodes or their paths, got 3"):
        graph.at_most_one("one", 3)  # type: ignore[arg-type]
    with pytest.raises(GraphError, match='which is not in graph "states"'):
        graph.at_most_one("one", State())
    assert graph.facts == []

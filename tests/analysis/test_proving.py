"""At most one, exactly one, together, lost: what is proved of a graph before it runs (rules A3-A15, G2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import msgspec
import pytest

import hfg
from examples.fetch_delivery.mission import build
from hfg import commands
from hfg.analysis.game import Game
from hfg.analysis.playing import Play
from hfg.analysis.proving import regions_of, verdict
from hfg.analysis.searching import pairs_together, search
from hfg.errors import GraphError, UsageError
from hfg.graph.flat import flatten
from hfg.nodes import activity
from hfg.testing import replay_activity


class Step(hfg.Node):
    """A state that ends in one of two ways."""

    done = hfg.Event()
    failed_to = hfg.Event()

    @hfg.slot
    def begin(self) -> None:
        """Take the activity."""

    @hfg.slot
    def tick(self, well: bool) -> None:
        (self.done if well else self.failed_to).trigger()


class Both(Step):
    """A state that leaves in both ways at once."""

    @hfg.slot
    def tick(self, well: bool) -> None:
        self.done.trigger()
        self.failed_to.trigger()


def ring(kind: type[Step] = Step) -> hfg.Graph:
    graph = hfg.Graph("ring")
    one, other = graph.add(kind(), name="one"), graph.add(Step(), name="other")
    graph.start.activates(one.begin)
    one.done.activates(other.begin)
    other.done.activates(one.begin)
    return graph


def test_a_machine_is_proved_by_counting() -> None:
    report = hfg.analyse_activity(ring())
    (region,) = report.regions
    assert region.nodes == ("one", "other")
    assert region.exactly_one.holds
    assert region.exactly_one.method == "counting"
    assert report.states() == [
        ((), ("start -> one.begin",)),
        (("one",), ()),
        ((), ("one.done -> other.begin",)),
        (("other",), ()),
        ((), ("other.done -> one.begin",)),
    ]
    assert not report.may_be_active_together("one", "other")
    assert not report.problems


def test_a_fork_is_found_with_the_steps_that_lead_to_it() -> None:
    graph = ring(Both)
    graph["one"].failed_to.activates(graph["other"].begin)
    found = hfg.analyse_activity(graph).at_most_one("one", "other")
    assert found.holds is False
    assert [step.text for step in found.steps] == [
        '"one" takes the activity from "start -> one.begin"',
        '"one.tick" is called and sends done and failed_to',
    ]
    assert found.steps[-1].under_way == ("one.done -> other.begin", "one.failed_to -> other.begin")
    assert str(found) == 'at most one of "one", "other" is active: broken in 2 steps'


def test_two_ways_out_of_which_each_firing_takes_one_are_no_fork() -> None:
    graph = ring()
    graph["one"].failed_to.activates(graph["other"].begin)
    assert hfg.analyse_activity(graph).exactly_one("one", "other").holds


def test_a_second_start_is_broken_at_once() -> None:
    graph = ring()
    graph.start.activates(graph["other"].begin)
    found = hfg.analyse_activity(graph).at_most_one("one", "other")
    assert found.holds is False
    assert found.steps == ()


def test_lost_activity_is_found() -> None:
    graph = ring()
    graph.connect(graph["other"].activated, graph["one"].deactivate)
    report = hfg.analyse_activity(graph)
    assert report.at_most_one("one", "other").holds
    assert report.exactly_one("one", "other").holds is False
    (problem,) = report.problems
    assert problem.check == "activity-lost"


def test_an_explicit_modifier_makes_activity_and_takes_it_away() -> None:
    graph = ring()
    makes, takes = graph.add(activity.ActivityGenerator(), name="makes"), graph.add(activity.InactivityGenerator())
    graph.connect(graph.input("data", int), makes.value)
    graph.connect(makes.out, graph["one"].begin, active=True)
    takes.deactivation.activates(graph["one"].begin)
    report = hfg.analyse_activity(graph)
    assert report.at_most_one("one", "other").holds is False
    lost = report.exactly_one("one", "other")
    assert lost.holds is False


def test_a_subgraph_that_times_out_gives_all_its_activity_for_one() -> None:
    class Box(hfg.Subgraph):
        begin = hfg.slot(type=object)

        def build(self, graph: hfg.Graph) -> None:
            both = graph.add(Both(), name="both")
            left, right = graph.add(Step(), name="left"), graph.add(Step(), name="right")
            self.begin.inner.activates(both.begin)
            both.done.activates(left.begin)
            both.failed_to.activates(right.begin)

    graph = hfg.Graph()
    box, after = graph.add(Box(), name="box", active_for_s=5), graph.add(Step(), name="after")
    graph.start.activates(box.begin)
    box.timeout.activates(after.begin)
    report = hfg.analyse_activity(graph)
    assert report.may_be_active_together("box/left", "box/right")
    assert not report.may_be_active_together("after", "box/left")
    assert report.at_most_one("after", "box/left").holds
    assert not report.at_most_one("box").holds
    assert report.without_limit == ["after"]


def test_async_code_that_sends_twice_keeps_its_right_in_between() -> None:
    """Another node works between the two sendings, so what it does counts, too (rule A3)."""

    class Slow(Step):
        @hfg.slot
        async def tick(self, well: bool) -> None:
            self.done.trigger()
            self.failed_to.trigger()

    graph = hfg.Graph()
    slow, left, right = (graph.add(kind(), name=n) for kind, n in ((Slow, "slow"), (Step, "left"), (Step, "right")))
    graph.start.activates(slow.begin)
    slow.done.activates(left.begin)
    slow.failed_to.activates(right.begin)
    report = hfg.analyse_activity(graph)
    assert report.may_be_active_together("left", "right")
    assert report.at_most_one("left", "right").holds is False
    assert report.may_be_active_together("slow", "left") is False


def test_activity_on_a_discarded_token_goes_back_to_its_sender() -> None:
    """The target of the active edge may be disabled: the sender stays or becomes active (rules A8, F10)."""
    graph = ring()
    graph.connect(graph.add(Step(), name="switch").done, graph["other"].disable)
    found = hfg.analyse_activity(graph).exactly_one("one", "other")
    assert found.holds


def test_a_gate_keeps_a_node_from_sending() -> None:
    class Fires(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Event()

        def process(self, value: int) -> None:
            self.out.trigger()

        @hfg.slot
        def begin(self) -> None:
            """Take the activity."""

    def build(gated: bool) -> hfg.Graph:
        graph = hfg.Graph()
        fires, after, never = graph.add(Fires()), graph.add(Step(), name="after"), graph.add(Step(), name="never")
        graph.connect(graph.input("data", int), fires.value)
        graph.start.activates(fires.begin)
        fires.out.activates(after.begin)
        after.done.activates(fires.begin)
        never.done.activates(fires.begin)
        if gated:
            graph.gate(fires, by=never)
        return graph

    assert hfg.analyse_activity(build(gated=False)).may_be_active("after")
    report = hfg.analyse_activity(build(gated=True))
    assert not report.may_be_active("after")
    assert [problem.check for problem in report.problems] == ["activity-never-comes", "activity-stays"]


def test_the_concurrency_relation_contains_every_pair_that_the_search_finds() -> None:
    graph = ring(Both)
    graph["one"].failed_to.activates(graph["other"].begin)
    third = graph.add(Step(), name="third")
    graph["other"].failed_to.activates(third.begin)
    game = Game(flatten(graph))
    (nodes,) = regions_of(game)
    play = Play(game, nodes)
    pairs = pairs_together(play)
    found = search(play, 10_000)
    assert found.is_complete
    firsts = [place for place in pairs if any(state & place for state in found.reached)]
    assert len(firsts) == len(pairs) == 8, "all places can be reached, and the relation has no other"
    for state in found.reached:
        for place in firsts:
            for other in firsts:
                if place != other and state & place and state & other:
                    assert pairs[place] & other


def test_a_limit_says_how_far_it_got_and_what_bounds_it() -> None:
    graph = ring(Both)
    graph["one"].failed_to.activates(graph["other"].begin)
    third = graph.add(Step(), name="third")
    graph["other"].failed_to.activates(third.begin)
    report = hfg.analyse_activity(graph, max_states=3)
    (region,) = report.regions
    assert not region.is_complete
    assert region.unproved == (
        "3 states were looked at, and there are more: which can be left, and whether activity can be lost, is not "
        "known; a larger limit looks further (max_states=, --states)"
    )
    found = report.at_most_one("third")
    assert found.holds is None
    assert "3 states" in found.why
    assert "max_states=" in found.why
    assert report.may_be_active("third"), "what was not looked at is possible"


@pytest.mark.parametrize("limit", [0, -1, 1.5, True])
def test_a_wrong_limit_is_refused(limit: object) -> None:
    with pytest.raises(UsageError, match="max_states= is how many states to look at"):
        hfg.analyse_activity(ring(), max_states=limit)  # type: ignore[arg-type]


def test_an_unknown_path_is_refused() -> None:
    report = hfg.analyse_activity(ring())
    with pytest.raises(GraphError, match='no node or subgraph "three"'):
        report.at_most_one("three")
    with pytest.raises(UsageError, match="name the nodes"):
        report.exactly_one()


@pytest.mark.parametrize("robots", [1, 4])
def test_exactly_one_state_of_the_delivery_mission_is_active(robots: int) -> None:
    report = hfg.analyse_activity(build(robots=robots))
    assert len(report.regions) == robots
    for number, region in enumerate(report.regions):
        assert len(region.nodes) == 47
        assert region.exactly_one.holds
        assert report.exactly_one(f"robot_{number}").holds
    assert not report.problems
    assert not report.unread


def test_the_search_agrees_with_counting_about_the_mission() -> None:
    """Two methods that share little are right or wrong together rarely."""
    game = Game(flatten(build()))
    play = Play(game, game.nodes)
    found = search(play, 10_000)
    counted = verdict(play, found, play.nodes, "exactly one")
    some = [index for index in play.nodes if not game.flat.path(index).endswith("approach")]
    searched = verdict(play, found, some, "at most one")
    assert counted.method == "counting"
    assert searched.holds


def test_a_report_is_plain_data() -> None:
    data = hfg.analyse_activity(ring(Both)).as_data()
    assert msgspec.json.decode(msgspec.json.encode(data)) == data


# --- facts that are stated


class Hidden(hfg.Node):
    """Its code cannot be read."""

    a, b = hfg.Event(), hfg.Event()

    @hfg.slot
    def take(self) -> None:
        """Receive activity."""

    @hfg.slot
    def send(self, name: str) -> None:
        getattr(self, name).trigger()


class Open(Hidden):
    """Its code can be read, and two conditions that exclude each other look as if they did not."""

    @hfg.slot
    def send(self, name: str) -> None:
        if name == "a":
            self.a.trigger()
        if name != "a":
            self.b.trigger()


def three(kind: type[Hidden], *facts: str) -> hfg.Graph:
    graph = hfg.Graph("three")
    one, two, last = graph.add(kind(), name="one"), graph.add(kind(), name="two"), graph.add(kind(), name="last")
    graph.start.activates(one.take)
    one.a.activates(two.take)
    one.b.activates(last.take)
    two.a.activates(one.take)
    last.a.activates(one.take)
    for fact in facts:
        getattr(graph, fact)("one", "two", "last")
    return graph


def test_a_fact_is_a_premise_where_code_cannot_be_read_and_the_proof_says_so() -> None:
    assert hfg.analyse_activity(three(Hidden)).at_most_one("two", "last").holds is False
    report = hfg.analyse_activity(three(Hidden, "at_most_one"))
    found = report.at_most_one("two", "last")
    assert found.holds
    assert found.given == ('at most one of "one", "two", "last" is active',)
    assert not [one for one in report.problems if one.check == "fact-in-doubt"]
    assert "taken for granted" in str(report)


def test_a_fact_that_code_which_was_read_seems_to_violate_is_in_doubt() -> None:
    report = hfg.analyse_activity(three(Open, "at_most_one"))
    assert report.at_most_one("two", "last").holds
    assert [one.path for one in report.problems if one.check == "fact-in-doubt"] == ["one"]
    fact = report.facts[0]
    assert fact.verdict is not None
    assert fact.verdict.holds is False


def test_a_fact_that_follows_anyway_is_no_premise() -> None:
    graph = three(Hidden)
    graph.edit(*(commands.MakeActive(*edge, False) for edge in (("one.b", "last.take"), ("last.a", "one.take"))))
    graph.exactly_one("one", "two")
    report = hfg.analyse_activity(graph)
    assert report.facts[0].verdict is not None
    assert report.facts[0].verdict.given == ()


def test_exactly_one_as_a_premise_excludes_that_activity_is_lost() -> None:
    graph = three(Hidden)
    graph.connect("one.a", "two.deactivate")
    graph["two.take"]  # is entered, and may be deactivated at any moment
    assert hfg.analyse_activity(graph).exactly_one("one", "two", "last").holds is False
    graph.exactly_one("one", "two", "last")
    found = hfg.analyse_activity(graph).exactly_one("one", "two", "last")
    assert found.holds
    assert found.given


# --- what comes first


class Says(hfg.Node):
    """Sends a modifier of its own."""

    a = hfg.Event()

    @hfg.slot
    def take(self) -> None:
        """Receive activity."""

    @hfg.slot
    def send(self) -> None:
        self.a.trigger(activity=1)


def relay() -> hfg.Graph:
    graph = hfg.Graph("relay")
    one, two = graph.add(Says(), name="one"), graph.add(Says(), name="two")
    graph.start.activates(one.take)
    one.a.activates(two.take)
    return graph


@pytest.mark.rule("A4", "A10", "F9")
def test_a_call_comes_after_what_start_has_sent_to_the_node_so_it_is_active_then() -> None:
    graph = relay()
    found = hfg.analyse_activity(graph).at_most_one("one", "two")
    assert found.holds is False
    assert len(found.steps) == 3, "the first +1 of `one` takes its activity along, the second makes more"


@pytest.mark.rule("A10", "F9")
def test_where_setup_may_send_a_call_may_come_first() -> None:
    class Early(Says):
        def setup(self) -> None:
            self.a.trigger()

    graph = relay()
    graph.add(Early(), name="early")
    found = hfg.analyse_activity(graph).at_most_one("one", "two")
    assert len(found.steps) == 1


# --- modifiers that the code of a node hides from a quick look


def pass_on(event: Any) -> None:
    """Send +1 on behalf of a node."""
    event.trigger(activity=1)


class ByHelper(Says):
    @hfg.slot
    def send(self) -> None:
        pass_on(self.a)


class ByKeywords(Says):
    @hfg.slot
    def send(self) -> None:
        options: Any = {"activity": 1}
        self.a.trigger(**options)


class ByNameOfPort(Says):
    @hfg.slot
    def send(self) -> None:
        getattr(self, "a").trigger(activity=1)  # noqa: B009


class ByLambda(Says):
    @hfg.slot
    def send(self) -> None:
        (lambda: self.a.trigger(activity=1))()


@pytest.mark.rule("A4")
@pytest.mark.parametrize("kind", [Says, ByHelper, ByKeywords, ByNameOfPort, ByLambda])
def test_modifiers_are_found_wherever_the_code_sends_them(kind: type[Says]) -> None:
    """A node that is not active makes activity, so there are two."""
    graph = ring()
    graph.add(kind(), name="makes").a.activates(graph["one.begin"])
    assert hfg.analyse_activity(graph).at_most_one("one", "other").holds is False


@hfg.node
def active_token(value: int) -> int:
    return hfg.Token(value, 1)  # type: ignore[return-value]


class ActiveToken(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return hfg.Token(value, 1)  # type: ignore[return-value]


@pytest.mark.rule("A4")
@pytest.mark.parametrize("kind", [active_token, ActiveToken])
def test_a_token_that_is_returned_has_a_modifier_of_its_own(kind: Any) -> None:
    graph = ring()
    makes = graph.add(kind(), name="makes")
    graph.connect(graph.input("data", int), makes.value)
    graph.connect(makes.out, graph["one.begin"], active=True)
    found = hfg.analyse_activity(graph).at_most_one("one", "other")
    assert found.holds is False
    assert replay_activity(graph, found).most == 2


# --- after an edit


@pytest.mark.rule("R4")
def test_the_analysis_follows_edits_of_a_graph_at_rest() -> None:
    graph = relay()
    assert hfg.analyse_activity(graph).may_be_active("two")
    graph.edit(commands.MakeActive("one.a", "two.take", False))
    report = hfg.analyse_activity(graph)
    assert report.regions[0].nodes == ("one",)
    graph.undo()
    assert hfg.analyse_activity(graph).may_be_active("two")


@pytest.mark.rule("R4")
def test_the_analysis_follows_edits_of_a_run(virtual_time: Callable[[Any], None]) -> None:
    async def main() -> None:
        async with hfg.running(relay()) as run:
            await run.wait_quiet()
            await run.edit(commands.MakeActive("one.a", "two.take", False))
            assert hfg.analyse_activity(run.graph).regions[0].nodes == ("one",)
            await run.edit(commands.Fact("at most one", ("one", "two")))
            assert [one.fact for one in hfg.analyse_activity(run.graph).facts] == [
                'at most one of "one", "two" is active'
            ]

    virtual_time(main())


# --- time


def limited(*, on_error: Literal["stop", "disable"] = "stop") -> hfg.Graph:
    graph = hfg.Graph("limited")
    one = graph.add(Hidden(), name="one", active_for_s=5.0)
    two, home = graph.add(Hidden(), name="two"), graph.add(Hidden(), name="home", on_error=on_error)
    graph.start.activates(one.take)
    one.a.activates(two.take)
    one.timeout.activates(home.take)
    return graph


@pytest.mark.rule("A12", "G2")
def test_a_time_out_that_leads_on_bounds_how_long_a_node_is_active() -> None:
    graph = limited()
    report = hfg.analyse_activity(graph)
    assert report.leaves_within_s == {"one": 5.0}
    assert report.without_limit == ["two", "home"]
    graph.edit(commands.MakeActive("one.timeout", "home.take", False))
    assert hfg.analyse_activity(graph).leaves_within_s == {}


@pytest.mark.rule("A8", "A12")
def test_a_time_out_that_leads_only_to_a_node_that_can_be_disabled_bounds_nothing() -> None:
    assert hfg.analyse_activity(limited(on_error="disable")).leaves_within_s == {}


@pytest.mark.rule("A12", "G2")
def test_a_time_out_of_a_subgraph_bounds_all_nodes_inside() -> None:
    report = hfg.analyse_activity(build())
    limits = report.leaves_within_s
    inside = [path for path in limits if path.startswith("robot_0/explore/go_to/")]
    assert inside
    assert limits["robot_0/explore/go_to/plan"] <= min(limits[path] for path in inside)


def test_a_node_that_no_activity_can_reach_is_one_finding_of_the_checks() -> None:
    graph = hfg.Graph()
    first, lost, behind = (graph.add(Step(), name=name) for name in ("first", "lost", "behind"))
    graph.start.activates(first.begin)
    lost.done.activates(behind.begin)
    behind.done.activates(first.begin)
    named = [problem for problem in graph.check() if problem.check == "never-active"]
    assert [(problem.path, problem.what) for problem in named] == [
        ("lost", 'nothing in the graph makes it active, nor "behind" behind it')
    ]
    assert "activity-never-comes" not in {problem.check for problem in hfg.analyse_activity(graph).problems}

"""Subgraphs: how they are built, promoted, iterated, and what is left when building fails."""

from __future__ import annotations

import pytest

import hfg
from hfg.errors import ConnectionError, DeclarationError, GraphError, UsageError  # noqa: A004 - what it is about
from hfg.graph import Graph, Subgraph
from hfg.graph.structure.level import level_of


class Plan(hfg.Node):
    goal = hfg.Input(int)
    path = hfg.Output(int)
    arrived = hfg.Event(int)
    limit = hfg.Parameter(1.0)
    slow = hfg.Parameter(0.5)

    def process(self, goal: int) -> int:
        return goal

    @hfg.slot
    def begin(self, at: int) -> None: ...


class FollowPerson(Subgraph):
    person = hfg.Input(int)
    path = hfg.Output(int)
    done = hfg.Event(int)
    begin = hfg.slot(type=int)
    speed = hfg.Parameter(2.5)

    def build(self, graph: Graph) -> None:
        plan = graph.add(Plan())
        graph.connect(self.person.inner, plan.goal)
        graph.connect(plan.path, self.path.inner)
        graph.connect(plan.arrived, self.done.inner)
        graph.connect(self.begin.inner, plan.begin)
        graph.promote(self.speed, plan.ports.parameters["limit"])


class Outer(Subgraph):
    speed = hfg.Parameter(4.0)

    def build(self, graph: Graph) -> None:
        self.inside = graph.add(FollowPerson())
        graph.promote(self.speed, self.inside.speed)


class Broken(Subgraph):
    def build(self, graph: Graph) -> None:
        graph.group("arm")
        graph.add(FollowPerson())
        self.kept = graph.add(Plan())
        graph.gate(self.kept, by=graph.nodes["follow_person"])
        around = self.place.graph
        around.connect(around.start, self.enable)
        raise RuntimeError("no camera")


@pytest.fixture
def graph() -> Graph:
    return Graph("fetch")


# --- building ---


@pytest.mark.rule("G3")
def test_subgraph_is_built_when_it_is_added(graph: Graph) -> None:
    follow = FollowPerson()
    with pytest.raises(UsageError, match="has no graph yet"):
        _ = follow.graph
    graph.add(follow)
    assert list(follow.graph.nodes) == ["plan"]
    assert follow.graph.path == "follow_person"
    assert follow.graph.nodes["plan"].place.path == "follow_person/plan"


@pytest.mark.rule("G3")
def test_subgraphs_nest(graph: Graph) -> None:
    outer = graph.add(Outer(), name="a")
    assert graph["a/follow_person/plan"] is outer.inside.graph.nodes["plan"]


def test_build_that_raises_leaves_nothing(graph: Graph) -> None:
    plan = graph.add(Plan())
    graph.connect(graph.start, plan.enable)
    broken = Broken()
    with pytest.raises(RuntimeError, match="no camera"):
        graph.add(broken)
    assert list(graph.nodes) == ["plan"]
    assert [edge.label for edge in graph.edges] == ["start -> plan.enable"]
    assert list(graph.groups) == ["loop"]
    for node in (broken, broken.kept):
        with pytest.raises(UsageError, match="is not in a graph"):
            _ = node.place
    with pytest.raises(UsageError, match="has no graph yet"):
        _ = broken.graph
    graph.connect(graph.start, graph.add(broken.kept, name="broken").enable)  # nothing of it is taken
    assert list(graph.nodes) == ["plan", "broken"]


def test_subgraph_whose_inside_fails_leaves_nothing_either(graph: Graph) -> None:
    class Around(Subgraph):
        def build(self, graph: Graph) -> None:
            graph.add(Plan())
            graph.add(Broken())

    with pytest.raises(RuntimeError):
        graph.add(Around())
    assert not graph.nodes
    assert list(graph.groups) == ["loop"]


def test_subgraph_does_not_process() -> None:
    with pytest.raises(DeclarationError, match="does not fire itself"):

        class Wrong(Subgraph):
            def process(self) -> None: ...


def test_options_about_firings_are_refused_on_a_subgraph(graph: Graph) -> None:
    for options in ({"max_rate_hz": 3.0}, {"on_error": "skip"}, {"priority": 1}, {"release": "pipelined"}):
        with pytest.raises(GraphError, match=f"{next(iter(options))} means nothing"):
            graph.add(FollowPerson(), **options)
    graph.add(FollowPerson(), group="vision", active_for_s=5.0, enabled=False)
    assert list(graph.nodes) == ["follow_person"]


@pytest.mark.rule("G2")
def test_subgraph_has_no_ports_of_firing(graph: Graph) -> None:
    follow = graph.add(FollowPerson())
    with pytest.raises(UsageError, match="does not fire itself"):
        graph.connect(follow.processed, graph.stop)
    with pytest.raises(UsageError):
        graph.connect(graph.start, follow.activate)
    graph.connect(follow.activated, graph.stop)


@pytest.mark.rule("P10")
def test_inside_of_a_subgraph_has_no_ports_of_its_own(graph: Graph) -> None:
    follow = graph.add(FollowPerson())
    with pytest.raises(GraphError, match=r"declare `keys = hfg\.Input"):
        follow.graph.input("keys", int)


@pytest.mark.rule("A10")
def test_start_inside_is_the_start_of_the_whole(graph: Graph) -> None:
    follow = graph.add(FollowPerson())
    assert follow.graph.start is graph.start
    follow.graph.start.activates(follow.graph.nodes["plan"].activate)
    assert not graph.edges  # it belongs to the graph whose node was named
    assert follow.graph.edges[-1].label == "start -> follow_person/plan.activate"


# --- promotion ---


@pytest.mark.rule("G3")
def test_promoted_parameter_takes_the_subgraphs_value_now_and_later(graph: Graph) -> None:
    follow = graph.add(FollowPerson(speed=3.0))
    limit = graph["follow_person/plan.limit"]
    assert limit.value == 3.0
    follow.speed.value = 1.5
    assert limit.value == 1.5


@pytest.mark.rule("G3")
def test_promotion_goes_through_all_levels(graph: Graph) -> None:
    outer = graph.add(Outer())
    outer.speed.value = 7.0
    assert graph["outer/follow_person/plan.limit"].value == 7.0


@pytest.mark.rule("G3")
def test_promoted_value_is_refused_by_all_or_none(graph: Graph) -> None:
    class Limited(hfg.Node):
        slow = hfg.Parameter(0.5, hfg_lt(1))

        def process(self) -> None: ...

    class Two(Subgraph):
        speed = hfg.Parameter(0.2)

        def build(self, graph: Graph) -> None:
            graph.promote(self.speed, graph.add(Plan()).ports.parameters["limit"])
            graph.promote(self.speed, graph.add(Limited()).ports.parameters["slow"])

    two = graph.add(Two())
    with pytest.raises(ValueError, match="must be < 1"):
        two.speed.value = 3.0
    assert (two.speed.value, graph["two/plan.limit"].value, graph["two/limited.slow"].value) == (0.2, 0.2, 0.2)


def hfg_lt(limit: float) -> object:
    from annotated_types import Lt

    return Lt(limit)


@pytest.mark.rule("G3")
def test_promotions_that_cannot_be_are_refused(graph: Graph) -> None:
    follow = graph.add(FollowPerson())
    inner = follow.graph.add(Plan())
    slow, limit = inner.ports.parameters["slow"], follow.graph.nodes["plan"].ports.parameters["limit"]
    with pytest.raises(GraphError, match="promoted already"):
        follow.graph.promote(follow.speed, limit)
    with pytest.raises(GraphError, match="not a parameter of the subgraph"):
        graph.promote(follow.speed, slow)
    with pytest.raises(GraphError, match="not in the graph inside"):
        follow.graph.promote(follow.speed, Plan().ports.parameters["slow"])
    with pytest.raises(GraphError, match=r"got 2\.5 as the first"):
        follow.graph.promote(2.5, slow)  # type: ignore[arg-type]
    follow.graph.connect(limit, slow)
    with pytest.raises(GraphError, match=r'is set by the edge from "follow_person/plan\.limit"'):
        follow.graph.promote(follow.speed, slow)
    assert level_of(follow.graph).promotions.by_name == {"speed": [limit]}


# --- iteration ---


class Each(Subgraph):
    item = hfg.Input(int)
    factor = hfg.Input(int, optional=True)
    result = hfg.Output(int)
    seen = hfg.Event(int)
    begin = hfg.slot(type=int)
    iterate_over = ("item",)

    def build(self, graph: Graph) -> None:
        plan = graph.add(Plan())
        graph.connect(self.item.inner, plan.goal)
        graph.connect(plan.path, self.result.inner)


class Lists(hfg.Node):
    items = hfg.Input(list[int], optional=True)
    one = hfg.Output(int)
    many = hfg.Output(list[int])
    seen = hfg.Event(list[int])

    def process(self, items: list[int] | None) -> None: ...


@pytest.mark.rule("G4")
def test_iterating_subgraph_takes_collections_and_gives_lists(graph: Graph) -> None:
    each, lists, other = graph.add(Each()), graph.add(Lists()), graph.add(Lists())
    graph.connect(lists.many, each.ports.inputs["item"])
    graph.connect(each.ports.outputs["result"], other.items)
    graph.connect(lists.one, each.factor)  # repeats
    with pytest.raises(ConnectionError, match=r'"each_2\.item" expects Collection\[int\], "lists.one" sends int'):
        graph.connect(lists.one, graph.add(Each()).ports.inputs["item"])


@pytest.mark.rule("G4")
def test_iteration_may_be_said_when_adding(graph: Graph) -> None:
    follow, lists = graph.add(FollowPerson(), iterate_over=["person"]), graph.add(Lists())
    graph.connect(lists.many, follow.ports.inputs["person"])
    with pytest.raises(GraphError, match='names "persn", which is not an input; did you mean "person"'):
        graph.add(FollowPerson(), iterate_over=["persn"])
    assert list(graph.nodes) == ["follow_person", "lists"]


@pytest.mark.rule("G4")
def test_activity_and_signals_do_not_cross_the_border_of_an_iteration(graph: Graph) -> None:
    each, lists, plan = graph.add(Each()), graph.add(Lists()), graph.add(Plan())
    item = each.ports.inputs["item"]
    with pytest.raises(ConnectionError, match="no activity can go into it"):
        graph.connect(lists.many, item, active=True)
    with pytest.raises(ConnectionError, match="takes no signals"):
        graph.connect(lists.seen, item)
    with pytest.raises(ConnectionError, match="signals cannot cross"):
        graph.connect(plan.path, each.begin)
    with pytest.raises(ConnectionError, match="signals cannot cross"):
        graph.connect(each.seen, plan.begin)
    assert not graph.edges
    graph.connect(plan.arrived, each.enable)  # automatic ports are those of the node

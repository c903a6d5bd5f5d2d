"""Graphs as the face shows them: adding, connecting, gates, the graph's own ports, subgraphs, and what is refused."""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest
from reactivex import operators as ops

import hfg


class Pose(NamedTuple):
    x: float
    y: float


@hfg.node
def numbers(*, count: int = 10) -> Iterator[int]:
    yield from range(count)


class MapLookup(hfg.Node):
    key = hfg.Input(int)
    map = hfg.Input(dict[int, Pose], optional=True)
    pose = hfg.Output(Pose)
    unknown = hfg.Event(int)
    tolerance = hfg.Parameter(0.1)

    def process(self, key: int, map: dict[int, Pose] | None) -> Pose | None:  # noqa: A002
        if key % 2:
            self.unknown.trigger(key)
            return None
        return Pose(float(key), 0.0)


class Drive(hfg.Node):
    """Keeps where it was to go, and whether it was active then."""

    goals = hfg.State(factory=list)

    @hfg.slot
    def goal(self, pose: Pose) -> None:
        self.goals.append((pose.x, self.active))


class Explore(hfg.Node):
    begun = hfg.State(factory=list)
    done = hfg.Event()

    @hfg.slot
    def begin(self, key: int | None) -> None:
        self.begun.append((key, self.active))
        self.done.trigger()


class Wait(hfg.Node):
    """Stays where it is."""

    begun = hfg.State(0)

    @hfg.slot
    def begin(self) -> None:
        self.begun += 1


class Seen(hfg.Node):
    values = hfg.State(factory=list)

    @hfg.slot
    def see(self, value: Any) -> None:
        self.values.append(value)


def test_graph_of_the_face_does_what_its_lines_say() -> None:
    drive, explore, wait, deliver = Drive(), Explore(), Wait(), Explore()

    # --- as written ---
    graph = hfg.Graph("fetch")
    camera = graph.add(numbers(count=3), name="camera", group="vision", max_rate_hz=30)
    lookup = graph.add(MapLookup(tolerance=0.2), on_error="skip", release="pipelined", active_for_s=5.0)
    graph.group("vision", threads=1, policy="priority")
    for node in (drive, explore, wait):
        graph.add(node)
    graph.add(deliver, name="deliver")
    graph.connect(camera.out, lookup.key)
    graph.connect(lookup.pose, drive.goal, active=True)
    lookup.unknown.activates(explore.begin)
    graph.start.activates(wait.begin)
    graph.connect(deliver.done, graph.stop)
    # --- so far ---

    graph.connect(explore.done, deliver.begin, active=True)
    assert list(graph.nodes) == ["camera", "map_lookup", "drive", "explore", "wait", "deliver"]
    assert [edge.active for edge in graph.edges] == [False, True, True, True, False, True]
    # What a reader of these lines may see too: nothing leads activity to the lookup, and "vision" has no priorities.
    assert [(found.severity, found.path, found.check) for found in graph.check()] == [
        ("warning", "map_lookup", "never-active"),
        ("warning", "map_lookup", "unheard-timeout"),
        ("hint", "vision", "unused-scheduling"),
    ]
    report = hfg.run(graph, clock="virtual")
    assert report.outcome == "stopped"
    assert drive.goals == [(0.0, False)]
    assert explore.begun == [(1, False)]
    assert wait.begun == 1
    assert report.nodes["wait"].active
    assert report.duration_s == pytest.approx(1 / 30)


def test_active_edge_and_activates_are_the_same() -> None:
    graph = hfg.Graph()
    lookup, explore, seen = graph.add(MapLookup()), graph.add(Explore()), graph.add(Seen())
    first = lookup.unknown.activates(explore.begin)
    second = graph.connect(lookup.unknown, seen.see, active=True)
    assert first.active
    assert first.options == second.options


def test_default_names_are_in_snake_case_and_numbered() -> None:
    graph = hfg.Graph()
    nodes = [graph.add(MapLookup()), graph.add(numbers()), graph.add(MapLookup()), graph.add(MapLookup())]
    assert [node.place.name for node in nodes] == ["map_lookup", "numbers", "map_lookup_2", "map_lookup_3"]


@hfg.node
def blur(value: int) -> int:
    return 10 * value


def test_short_form_connects_the_only_free_ports() -> None:
    graph = hfg.Graph()
    camera, blur_1, show = graph.add(numbers(count=3)), graph.add(blur()), graph.add(Seen())
    camera >> blur_1 >> show
    hfg.run(graph, clock="virtual")
    assert show.values == [0, 10, 20]


def test_short_form_that_could_mean_two_ports_is_refused_with_both() -> None:
    graph = hfg.Graph()
    camera, lookup, show = graph.add(numbers()), graph.add(MapLookup()), graph.add(Seen())
    with pytest.raises(hfg.errors.UsageError) as error:
        camera >> lookup
    assert '"map_lookup.key"' in str(error.value)
    assert '"map_lookup.map"' in str(error.value)
    with pytest.raises(hfg.errors.UsageError) as error:
        lookup >> show
    assert '"map_lookup.pose"' in str(error.value)
    assert '"map_lookup.unknown"' in str(error.value)
    assert graph.edges == []


class Look(hfg.Node):
    looked = hfg.State(factory=list)

    @hfg.slot
    def look(self, value: int) -> None:
        self.looked.append((hfg.now(), value))


class Burst(hfg.Node):
    """Triggers several times in one firing."""

    value = hfg.Input(int)
    seen = hfg.Event(int)

    def process(self, value: int) -> None:
        for number in range(value, value + 3):
            self.seen.trigger(number)


def test_capacity_overflow_and_operators_stand_on_the_edge() -> None:
    graph = hfg.Graph()
    source, a, b = graph.add(numbers(count=2), max_rate_hz=1), graph.add(Burst()), graph.add(Look())
    graph.connect(source.out, a.value)
    graph.connect(a.seen, b.look, capacity=100, overflow="drop_oldest", through=[ops.debounce(0.2)])
    hfg.run(graph, clock="virtual")
    assert b.looked == [(0.2, 2), (1.2, 3)]


def test_capacity_with_drop_oldest_keeps_the_newest() -> None:
    graph = hfg.Graph()
    a, b = graph.add(Burst()), graph.add(Seen())
    graph.connect(graph.add(numbers(count=1)).out, a.value)
    graph.connect(a.seen, b.see, capacity=2, overflow="drop_oldest")
    report = hfg.run(graph, clock="virtual")
    assert b.values == [1, 2]
    assert report.edges["burst.seen -> seen.see"].dropped == 1


def test_gate_lets_one_firing_a_second_through_while_the_state_is_inactive() -> None:
    graph = hfg.Graph()
    camera = graph.add(numbers(count=20), max_rate_hz=10)
    detector, fetch = graph.add(blur()), graph.add(Wait())
    graph.connect(camera.out, detector.value)
    graph.gate(detector, by=fetch, idle_rate_hz=1.0)
    report = hfg.run(graph, clock="virtual")
    assert report.nodes["blur"].processed == 2
    assert report.nodes["blur"].silent == 18


def test_nodes_and_ports_are_found_by_path() -> None:
    class FetchCube(hfg.Subgraph):
        def build(self, graph: hfg.Graph) -> None:
            graph.add(Drive(), name="go_to")

    graph = hfg.Graph()
    box = graph.add(FetchCube())
    node = graph.add(blur())
    assert graph["fetch_cube/go_to.goal"].path == "fetch_cube/go_to.goal"
    assert graph["fetch_cube/go_to"] is box.graph["go_to"]
    assert node.ports.inputs["value"] is node.value
    assert node.place.path == "blur"
    assert graph["fetch_cube/go_to"].place.path == "fetch_cube/go_to"
    with pytest.raises(hfg.errors.GraphError, match="go_too"):
        graph["fetch_cube/go_too"]


def test_inputs_and_outputs_of_the_graph_are_connected_like_others() -> None:
    graph = hfg.Graph()
    lookup = graph.add(MapLookup())
    keys = graph.input("keys", int)
    graph.connect(keys, lookup.key)
    poses = graph.output("poses", Pose)
    graph.connect(lookup.pose, poses)
    assert graph.inputs == {"keys": keys}
    assert graph["poses"] is poses
    assert graph.check() == []


# --- a subgraph, as written ---


class Plan(hfg.Node):
    goal = hfg.Input(Pose)
    arrived = hfg.Event()
    limit = hfg.Parameter(1.0)
    speeds = hfg.State(factory=list)

    def process(self, goal: Pose) -> None:
        self.speeds.append(self.limit)
        self.arrived.trigger()


class FollowPerson(hfg.Subgraph):
    person = hfg.Input(Pose)
    done = hfg.Event()
    speed = hfg.Parameter(2.5)

    def build(self, graph: hfg.Graph) -> None:
        plan = graph.add(Plan())
        graph.connect(self.person.inner, plan.goal)
        graph.connect(plan.arrived, self.done.inner)
        graph.promote(self.speed, plan.ports.parameters["limit"])


def test_subgraph_relays_its_ports_and_promotes_its_parameter() -> None:
    @hfg.node
    def people() -> Iterator[Pose]:
        yield from (Pose(1.0, 1.0), Pose(2.0, 2.0))

    graph = hfg.Graph()
    follow, seen = graph.add(FollowPerson(speed=3.0)), graph.add(Seen())
    plan = graph["follow_person/plan"]
    graph.connect(graph.add(people()).out, follow.person)
    graph.connect(follow.done, seen.see)
    assert plan.limit == 3.0
    report = hfg.run(graph, clock="virtual")
    assert seen.values == [None, None]
    assert plan.speeds == [3.0, 3.0]
    assert list(report.nodes) == ["follow_person/plan", "seen", "people"]
    follow.ports.parameters["speed"].value = 4.0
    assert plan.limit == 4.0


def test_two_of_a_subgraph_are_two() -> None:
    graph = hfg.Graph()
    first, second = graph.add(FollowPerson(speed=1.0)), graph.add(FollowPerson(speed=2.0))
    assert first.place.path == "follow_person"
    assert graph["follow_person_2/plan"].limit == 2.0
    assert first.graph["plan"].limit == 1.0
    assert second.graph["plan"] is graph["follow_person_2/plan"]


# --- check ---


def test_check_gives_problems_and_a_run_refuses_errors() -> None:
    @hfg.node
    def merge(fresh: int, old: int) -> int:
        return fresh + old

    graph = hfg.Graph()
    total = graph.add(merge())
    graph.connect(graph.add(numbers(count=2), group="vision").out, total.fresh)
    graph.connect(total.out, total.old)
    problems = graph.check()
    assert {problem.severity for problem in problems} >= {"error"}
    for problem in problems:
        assert all((problem.path, problem.severity, problem.what, problem.why, problem.remedy))
    ran: list[int] = []
    with pytest.raises(hfg.errors.CheckFailed) as error:
        hfg.run(graph, clock="virtual", trace=lambda _: ran.append(1))
    assert not ran
    assert [problem for problem in error.value.problems if problem.severity == "error"]


def test_refusal_of_a_graph_with_very_many_errors_stays_readable() -> None:
    graph = hfg.Graph()
    for _ in range(100):
        graph.add(numbers(), group="vision")
    with pytest.raises(hfg.errors.CheckFailed, match=r"(?s)^the graph has 100 errors:.*\.\.\. and 80 more") as error:
        hfg.run(graph)
    assert len(str(error.value).splitlines()) == 22
    assert len([problem for problem in error.value.problems if problem.severity == "error"]) == 100


# --- fixed with it ---

RESERVED = [
    "setup",
    "process",
    "do",
    "completed",
    "ready",
    "end",
    "teardown",
    "on_activated",
    "on_deactivated",
    "ports",
    "place",
    "active",
    "log",
    "inner",
    "start_soon",
    "activated",
    "deactivated",
    "processed",
    "failed",
    "timeout",
    "enable",
    "disable",
    "activate",
    "deactivate",
    "reset",
]


def test_public_names_of_a_node_are_the_reserved_ones_and_no_others() -> None:
    assert {name for name in dir(hfg.Node) if not name.startswith("_")} == set(RESERVED)


PORTS: dict[str, Callable[[], object]] = {
    "input": lambda: hfg.Input(int),
    "output": lambda: hfg.Output(int),
    "event": lambda: hfg.Event(int),
    "parameter": lambda: hfg.Parameter(1),
    "state": lambda: hfg.State(1),
}


@pytest.mark.parametrize("kind", PORTS)
@pytest.mark.parametrize("name", RESERVED)
def test_reserved_name_is_refused_where_it_is_declared(name: str, kind: str) -> None:
    declared = PORTS[kind]()
    with pytest.raises(hfg.errors.DeclarationError) as error:
        types.new_class("Wrong", (hfg.Node,), exec_body=lambda body: body.update({name: declared}))
    assert f'"{name}"' in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", RESERVED)
def test_reserved_argument_of_a_function_is_refused_with_the_renaming_to_write(name: str) -> None:
    namespace: dict[str, Any] = {}
    exec(f"def read({name}: str) -> str: ...", namespace)
    with pytest.raises(hfg.errors.DeclarationError) as error:
        hfg.node(namespace["read"])
    assert f'inputs={{"{name}": ' in str(error.value)
    renamed = hfg.node(namespace["read"], inputs={name: "file"})
    assert list(renamed().ports.inputs) == ["file"]


def test_shared_name_goes_by_direction_and_is_refused_in_short() -> None:
    @hfg.node(outputs={"image": int})
    def soften(image: int) -> tuple[int]:
        return (image + 1,)

    graph = hfg.Graph()
    camera, node, seen = graph.add(numbers(count=2)), graph.add(soften()), graph.add(Seen())
    with pytest.raises(hfg.errors.UsageError) as error:
        node.image  # noqa: B018
    assert 'ports.inputs["image"]' in str(error.value)
    assert 'ports.outputs["image"]' in str(error.value)
    camera >> node >> seen
    hfg.run(graph, clock="virtual")
    assert seen.values == [1, 2]


def test_init_is_not_overridden() -> None:
    with pytest.raises(hfg.errors.DeclarationError, match=r"setup\(\)"):

        class Wrong(hfg.Node):
            def __init__(self) -> None: ...


def test_calling_a_function_node_like_its_function_is_answered() -> None:
    with pytest.raises(TypeError, match=r"^blur\(\.\.\.\) makes a node; the function itself is blur\.function$"):
        blur(3)  # type: ignore[call-arg]
    assert blur.function(3) == 30


def test_check_hints_at_a_type_that_cannot_be_found_by_name() -> None:
    @hfg.node
    def local(value: int) -> None: ...

    graph = hfg.Graph()
    graph.connect(graph.add(numbers(count=1)).out, graph.add(local()).value)
    (problem,) = graph.check()
    assert (problem.severity, problem.path) == ("hint", "local")


def test_type_without_process_never_fires_and_lives_by_its_slots() -> None:
    graph = hfg.Graph()
    wait = graph.add(Wait())
    graph.start.activates(wait.begin)
    report = hfg.run(graph, clock="virtual")
    assert (report.nodes["wait"].firings, report.nodes["wait"].calls) == (0, 1)

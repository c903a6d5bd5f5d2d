"""Where everything of a drawing goes: the mission from top to bottom, data beside it, lines that can be followed."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations, pairwise
from statistics import median

import pytest

import hfg
from examples import fetch
from examples.fetch_delivery.mission import build as two_robots
from examples.fetch_delivery.mission import robot
from examples.figures import robot as robot_figures
from hfg.graph.drawing import Layout, Line, NodeBox, View, lay_out
from hfg.graph.structure.level import HasLevel
from tests.graph.test_svg import State, at_random, join, mission, source, step


def delivery() -> HasLevel:
    """The mission of the delivery robot: 15 nodes, 76 edges, 5 gates."""
    box = robot.build()["robot_0"]
    assert isinstance(box, hfg.Subgraph)
    return box.graph


def large(count: int, seed: int = 0) -> hfg.Graph:
    """States in a long mission with branches and ways back, and data that feeds some of them; `count` nodes in all."""
    chance, graph = random.Random(seed), hfg.Graph(f"large {count}")
    states = [graph.add(State(), name=f"state_{number}") for number in range(count * 2 // 5)]
    graph.start.activates(states[0].begin)
    for number, (one, other) in enumerate(pairwise(states)):
        graph.connect(one.done, other.begin, active=True)
        if number % 7 == 3:
            graph.connect(one.lost, states[max(0, number - chance.randrange(2, 6))].begin, active=True)
    outs = [graph.add(source(), name=f"source_{number}") for number in range(count // 5)]
    rest = count - len(states) - len(outs)
    for number in range(rest):
        if number % 3:
            node = graph.add(step(), name=f"step_{number}")
            graph.connect(chance.choice(outs[-12:]).out, node.value)
        else:
            node = graph.add(join(), name=f"join_{number}")
            graph.connect(chance.choice(outs[-12:]).out, node.left)
            graph.connect(chance.choice(outs[-12:]).out, node.right)
        outs.append(node)
    for number, state in enumerate(states[::3]):
        graph.connect(outs[number * 2 % len(outs)].out, state.value)
    return graph


GRAPHS: dict[str, Callable[[], HasLevel]] = {
    "delivery": delivery,
    "fetch": fetch.build,
    "mission": mission,
    "50 nodes": lambda: large(50),
    "300 nodes": lambda: large(300),
    **{f"random {seed}": partial(at_random, seed) for seed in range(5)},
}
VIEWS = ("activity", "mission", "all")
CASES = [(name, kind) for name in GRAPHS for kind in VIEWS]
LAID: dict[tuple[str, str], Layout] = {}


def laid(name: str, kind: str) -> Layout:
    """Lay a graph out, once for all tests; that of the delivery robot as it is on the page of its documentation."""
    if (name, kind) not in LAID:
        LAID[name, kind] = lay_out(GRAPHS[name](), View(kind=kind, depth=0 if name == "delivery" else None))  # type: ignore[arg-type]
    return LAID[name, kind]


def named(drawn: Layout, name: str) -> NodeBox:
    return next(one for one in drawn.nodes if one.name == name)


def strokes(line: Line) -> Iterator[tuple[float, float, float, float]]:
    """Give the parts of a line: left, top, right and bottom."""
    for (x1, y1), (x2, y2) in pairwise(line.points):
        yield min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)


def bends(line: Line) -> int:
    return len(line.points) - 2


# --- the sentences of the design


def test_the_mission_of_the_delivery_robot_takes_at_most_0_9_megapixels() -> None:
    drawn = laid("delivery", "mission")
    assert drawn.width * drawn.height <= 0.9e6


def test_activity_begins_on_top() -> None:
    drawn = laid("delivery", "mission")
    states = sorted((one for one in drawn.nodes if one.is_state), key=lambda one: one.y)
    assert [one.name for one in states][:7] == [
        "wait_for_start",
        "advance",
        "fetch",
        "bring",
        "read_cube",
        "lookup",
        "explore",
    ] or states[6].name == "deliver"
    begin = next(line for line in drawn.lines if line.tag is not None and line.tag.text == "begin")
    assert begin.is_active
    assert begin.points[0][1] < begin.points[-1][1] == states[0].y


@pytest.mark.parametrize("name", GRAPHS)
def test_an_active_edge_that_does_not_lead_back_has_at_most_two_bends(name: str) -> None:
    if name.startswith("random"):
        return
    drawn = laid(name, "mission")
    into_sides = {line for line in drawn.lines if line.is_active and line.points[-1][1] == line.points[-2][1]}
    most = max(bends(line) for line in drawn.lines if line.is_active and not line.is_back and line not in into_sides)
    assert most <= 2


@pytest.mark.parametrize("name", ["delivery", "fetch", "50 nodes"])
def test_no_line_runs_outside_of_all_nodes_by_more_than_its_tracks(name: str) -> None:
    drawn = laid(name, "mission")
    left, right = min(one.x for one in drawn.nodes), max(one.x + one.width for one in drawn.nodes)
    for line in drawn.lines:
        if line.tag is None:
            assert all(left - 100 <= x <= right + 100 for x, _ in line.points)


def test_ways_back_to_one_slot_come_back_as_one_line_with_dots() -> None:
    drawn = laid("delivery", "mission")
    back = [line for line in drawn.lines if line.is_back and line.edges[0].target == "robot_0/fetch.begin"]
    assert len(back) == 4
    assert len({line.points[-3:] for line in back}) == 1  # the same gutter, the same corner, the same slot
    assert sum(len(line.dots) for line in drawn.lines if line.net == back[0].net) >= 3


def test_gates_and_time_outs_are_marks_on_their_node() -> None:
    drawn = laid("delivery", "mission")
    gates = {one.name: [badge.says for badge in one.badges if badge.kind == "gate"] for one in drawn.nodes}
    assert {name: says for name, says in gates.items() if says} == {
        "wait_for_start": [""],
        "advance": [""],
        "read_cube": [""],
        "look_first": ["advance"],
        "look_again": ["read_cube"],
    }
    clocks = {(one.name, port.says) for one in drawn.nodes for port in one.ports if port.kind == "timeout"}
    assert clocks == {("advance", "10.1 s"), ("read_cube", "10.1 s")}
    limited = hfg.Graph()
    limited.add(State(), name="alone", active_for_s=5)
    assert [(badge.kind, badge.says) for badge in lay_out(limited).nodes[0].badges] == [("timeout", "5 s")]


def test_ports_of_the_level_are_tags_where_they_are_used() -> None:
    drawn = laid("delivery", "mission")
    tags = [name for line in drawn.lines if line.tag is not None and line.tag.text for name in line.tag.ports]
    assert tags.count("robot_0.odometry.inner") == 5
    assert tags.count("robot_0.scan.inner") == 6


def test_edges_between_the_same_two_places_are_a_bundle_with_their_number() -> None:
    drawn = laid("delivery", "mission")
    bundles = {
        (line.edges[0].source.rpartition(".")[0], line.edges[0].target.rpartition(".")[0], line.kind): len(line.edges)
        for line in drawn.lines
        if line.count_at is not None
    }
    p = "robot_0/"
    assert bundles == {
        (p + "perception", p + "fetch", "data"): 3,
        (p + "perception", p + "explore", "data"): 2,
        (p + "perception", p + "deliver", "data"): 3,
        (p + "perception", p + "fetch", "signal"): 2,
        (p + "perception", p + "deliver", "signal"): 2,
    }


def test_every_edge_is_drawn_or_tagged_in_the_mission_and_drawn_among_all_edges() -> None:
    for kind in ("mission", "all"):
        drawn = laid("delivery", kind)
        assert len({edge.label for line in drawn.lines for edge in line.edges}) == 76
        assert drawn.hidden == 0
    assert not [
        line for line in laid("delivery", "all").lines if line.tag is not None and line.tag.kind in ("to", "from")
    ]


def test_the_view_activity_has_states_what_feeds_them_and_one_line_for_each_pair() -> None:
    drawn = laid("delivery", "activity")
    feeders = {one.id.removeprefix("robot_0/") for one in drawn.nodes if not one.is_state}
    assert feeders == {
        "newest",
        "refused",
        *(f"perception/{one}" for one in ("localise", "others", "targets", "stations", "cube")),
    }
    assert "give_way" not in {one.name for one in drawn.nodes}
    says = {(line.edges[0].source, line.edges[0].target): line.says for line in drawn.lines if line.is_active}
    assert says["robot_0/advance.done", "robot_0/fetch.begin"] == "done or 10.1 s"
    assert drawn.hidden > 30


def test_what_several_lines_from_a_node_say_is_written_once() -> None:
    drawn = lay_out(robot_figures.figure_19(), View(kind="activity", depth=0))
    written = [(line.edges[0].source.partition(".")[0], line.says) for line in drawn.lines if line.says_at]
    assert len(written) == len(set(written))
    assert [says for _, says in written].count("cube") == 1
    assert len([line for line in drawn.lines if line.says == "cube"]) > 1


def test_a_node_with_bars_and_nothing_else_is_low() -> None:
    drawn = lay_out(robot_figures.figure_19(), View(kind="mission", depth=0, measured=True))
    for one in drawn.nodes:
        has_rows = any(port.kind not in ("input", "output") or port.says for port in one.ports)
        assert (one.height == 48) == (not has_rows), one.id


# --- what holds for all graphs and views


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_lines_have_right_angles_and_run_from_port_to_port(name: str, kind: str) -> None:
    drawn = laid(name, kind)
    ports = {(port.x, port.y) for one in drawn.nodes for port in one.ports}
    for line in drawn.lines:
        assert all(a[0] == b[0] or a[1] == b[1] for a, b in pairwise(line.points))
        if kind != "activity" and line.tag is None and not line.combs:
            assert {line.points[0], line.points[-1]} <= ports
        for comb in line.combs:
            assert comb[-1] in ports


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_no_two_nodes_overlap_and_no_line_runs_through_a_node(name: str, kind: str) -> None:
    drawn = laid(name, kind)
    nodes = [one for one in drawn.nodes if not one.is_open]
    for one, other in combinations(nodes, 2):
        apart = one.x + one.width <= other.x or other.x + other.width <= one.x
        assert apart or one.y + one.height <= other.y or other.y + other.height <= one.y, (one.id, other.id)
    for line in drawn.lines:
        for left, top, right, bottom in strokes(line):
            for one in nodes:
                inside = left < one.x + one.width - 1 and right > one.x + 1
                assert not (inside and top < one.y + one.height - 1 and bottom > one.y + 1), (line.edges, one.id)


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_no_two_labels_overlap_and_none_lies_on_a_node(name: str, kind: str) -> None:
    drawn = laid(name, kind)
    boxes = [
        (tag.x, tag.y, tag.x + tag.width, tag.y + tag.height) for line in drawn.lines if (tag := line.tag) and tag.text
    ]
    boxes += [(x - 9, y - 8, x + 9, y + 8) for line in drawn.lines if line.count_at for x, y in [line.count_at]]
    boxes += [(x, y - 8, x + 6, y) for line in drawn.lines if line.says_at for x, y in [line.says_at]]
    nodes = [(one.x, one.y, one.x + one.width, one.y + one.height) for one in drawn.nodes if not one.is_open]
    for (x1, y1, x2, y2), (x3, y3, x4, y4) in [*combinations(boxes, 2), *((a, b) for a in boxes for b in nodes)]:
        assert x2 <= x3 or x4 <= x1 or y2 <= y3 or y4 <= y1


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_lines_never_lie_on_each_other_unless_they_share_an_end(name: str, kind: str) -> None:
    drawn = laid(name, kind)
    parts = [(line, part) for line in drawn.lines for part in strokes(line)]
    for (line, (left, top, right, bottom)), (other, (left2, top2, right2, bottom2)) in combinations(parts, 2):
        if line is other or (line.net == other.net and line.net >= 0):
            continue
        shared = {line.points[0], line.points[-1]} & {other.points[0], other.points[-1]}
        if left == right == left2 == right2 and not shared:
            assert min(bottom, bottom2) <= max(top, top2), (line.edges, other.edges)
        if top == bottom == top2 == bottom2 and not shared:
            assert min(right, right2) <= max(left, left2), (line.edges, other.edges)


def test_inputs_are_left_outputs_right_slots_on_top_and_events_at_the_bottom() -> None:
    sides = {"input": (0, None), "output": (1, None), "slot": (None, 0), "event": (None, 1), "timeout": (None, 1)}
    for name in GRAPHS:
        for one in laid(name, "mission").nodes:
            for port in one.ports:
                x, y = sides.get(port.kind, (None, None))
                assert x is None or port.x == one.x + x * one.width
                assert y is None or port.y == one.y + y * one.height


def test_a_subgraph_is_a_box_around_what_lies_in_it_at_any_depth() -> None:
    drawn = laid("mission", "mission")
    boxes = {one.id: one for one in drawn.nodes if one.is_open}
    assert list(boxes) == ["fetch", "nest", "nest/skill"]
    for one in drawn.nodes:
        around = boxes.get(one.id.rpartition("/")[0])
        if around is not None:
            assert around.x < one.x
            assert around.y < one.y
            assert one.x + one.width < around.x + around.width
            assert one.y + one.height < around.y + around.height


def test_open_subgraphs_stand_side_by_side_rather_than_become_too_high() -> None:
    drawn = lay_out(two_robots(robots=2))
    first, second = named(drawn, "robot_0"), named(drawn, "robot_1")
    assert first.y == second.y
    assert first.x + first.width <= second.x
    assert drawn.height < drawn.width < 3 * drawn.height


def test_a_folded_subgraph_says_how_many_nodes_are_inside() -> None:
    drawn = lay_out(mission(), View(depth=0))
    assert {one.name: one.inner for one in drawn.nodes if one.kind == "subgraph"} == {"fetch": 2, "nest": 3}
    assert [badge.by for badge in named(drawn, "blur").badges] == ["fetch"]


def test_an_edge_straight_through_a_subgraph_is_drawn_inside_it() -> None:
    class Through(hfg.Subgraph):
        value = hfg.Input(int)
        out = hfg.Output(int)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.value.inner, self.out.inner)

    graph = hfg.Graph()
    box = graph.add(Through())
    graph.connect(graph.add(source()).out, box.value)
    graph.connect(box.out, graph.add(step()).value)
    inner = next(line for line in lay_out(graph).lines if line.tag is not None)
    assert inner.tag is not None
    assert inner.tag.text == "out"
    assert [one.name for one in lay_out(graph).nodes if one.kind == "wire"] == ["value"]


def test_all_ports_are_shown_when_they_are_asked_for() -> None:
    graph = hfg.Graph()
    graph.add(State(), name="alone")
    assert not lay_out(graph).nodes[0].ports
    shown = lay_out(graph, View(all_ports=True)).nodes[0]
    assert [one.name for one in shown.ports] == ["value", "begin", "cancel", "done", "lost"]


def test_a_chain_of_data_is_straight_and_leads_to_the_right() -> None:
    graph = hfg.Graph()
    nodes = [graph.add(source()), *(graph.add(step()) for _ in range(5))]
    for one, other in pairwise(nodes):
        one >> other
    lines = lay_out(graph).lines
    assert [bends(line) for line in lines] == [0] * 5
    assert all(line.points[0][0] < line.points[-1][0] for line in lines)


def test_a_circle_of_activity_goes_back_where_one_comes_round() -> None:
    graph = hfg.Graph()
    a, b, c = (graph.add(State(), name=name) for name in "abc")
    graph.start.activates(a.begin)
    for one, other in ((a, b), (b, c), (c, a)):
        graph.connect(one.done, other.begin, active=True)
    drawn = lay_out(graph)
    assert [named(drawn, name).row for name in "abc"] == [0, 1, 2]
    assert [line.edges[0].label for line in drawn.lines if line.is_back] == ["c.done -> a.begin"]


def test_what_is_not_connected_is_put_side_by_side() -> None:
    graph = hfg.Graph()
    for _ in range(100):
        graph.add(step())
    drawn = lay_out(graph)
    assert 0.5 < drawn.width / drawn.height < 4


# --- stability, and what somebody has put down


def test_equal_graphs_have_equal_layouts() -> None:
    assert lay_out(at_random(3)) == lay_out(at_random(3))
    assert lay_out(delivery(), View(depth=0)) == lay_out(delivery(), View(depth=0))


def test_a_small_edit_moves_other_nodes_little() -> None:
    graph = robot.build()["robot_0"].graph
    before = {one.id: (one.x, one.y, one.row, one.lane) for one in lay_out(graph, View(depth=0)).nodes}
    new = graph.add(State(), name="another")
    graph.connect(graph["explore"].ports.events["done"], new.ports.slots["cancel"])
    after = {one.id: (one.x, one.y, one.row, one.lane) for one in lay_out(graph, View(depth=0)).nodes}
    assert {key: after[key][2:] for key in before} == {key: value[2:] for key, value in before.items()}
    moved = [abs(after[key][0] - x) + abs(after[key][1] - y) for key, (x, y, *_) in before.items()]
    assert max(moved) < 150
    assert median(moved) < 60


def test_places_that_somebody_has_chosen_are_kept_and_others_give_way() -> None:
    graph = fetch.build()
    places = {"search": (400.0, 300.0), "camera": (10.0, 20.0)}
    drawn = lay_out(graph, View(places=places))
    assert {name: (named(drawn, name).x, named(drawn, name).y) for name in places} == places
    for one, other in combinations(drawn.nodes, 2):
        apart = one.x + one.width <= other.x or other.x + other.width <= one.x
        assert apart or one.y + one.height <= other.y or other.y + other.height <= one.y


def test_who_moves_one_node_moves_no_other() -> None:
    graph = fetch.build()
    before = {one.id: (one.x, one.y) for one in lay_out(graph).nodes}
    places = {"give_up": (before["give_up"][0] - 2000.0, before["give_up"][1] + 400.0)}
    drawn = lay_out(graph, View(places=places))
    assert {one.id: (one.x, one.y) for one in drawn.nodes} == before | places
    assert drawn.width >= max(one.x + one.width for one in drawn.nodes)
    assert drawn.height >= max(one.y + one.height for one in drawn.nodes)


def test_a_node_that_nobody_has_placed_comes_along_with_the_others() -> None:
    graph = fetch.build()
    before = {one.id: (one.x, one.y) for one in lay_out(graph).nodes}
    places = {key: (x + 3000.0, y) for key, (x, y) in before.items() if key != "give_up"}
    drawn = lay_out(graph, View(places=places))
    assert {one.id: (one.x, one.y) for one in drawn.nodes} == {key: (x + 3000.0, y) for key, (x, y) in before.items()}


def test_a_selection_is_laid_out_around_others_that_stay() -> None:
    graph = fetch.build()
    places = {one.id: (one.x, one.y) for one in lay_out(graph).nodes}
    moved = places | {"fetch": (2000.0, 1000.0), "camera": (places["camera"][0], places["camera"][1] + 200.0)}
    drawn = lay_out(graph, View(places=moved, only=frozenset({"fetch"})))
    assert {one.id: (one.x, one.y) for one in drawn.nodes if one.id != "fetch"} == {
        key: value for key, value in moved.items() if key != "fetch"
    }
    back = named(drawn, "fetch")
    assert abs(back.x - places["fetch"][0]) + abs(back.y - places["fetch"][1]) < 100


@pytest.mark.slow
def test_lines_find_their_way_among_nodes_that_somebody_has_put_anywhere() -> None:
    graph = delivery()
    chance = random.Random(1)
    spots = [(440.0 * x, 220.0 * y) for x in range(4) for y in range(4)]
    chance.shuffle(spots)
    places = {one.id: spots.pop() for one in lay_out(graph, View(depth=0)).nodes}
    drawn = lay_out(graph, View(depth=0, places=places))
    for line in drawn.lines:
        for left, top, right, bottom in strokes(line):
            for one in drawn.nodes:
                inside = left < one.x + one.width - 1 and right > one.x + 1
                assert not (inside and top < one.y + one.height - 1 and bottom > one.y + 1), (line.edges, one.id)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_lines_find_their_way_where_there_is_no_row_and_no_lane(seed: int) -> None:
    graph, chance = at_random(seed), random.Random(seed)
    nodes = lay_out(graph).nodes
    places = {
        one.id: (one.x * 1.3 + chance.randrange(-20, 20), one.y * 1.6 + chance.randrange(-10, 10)) for one in nodes
    }
    drawn = lay_out(graph, View(places=places))
    assert {one.id: (one.x, one.y) for one in drawn.nodes} == places
    for line in drawn.lines:
        for left, top, right, bottom in strokes(line):
            for one in drawn.nodes:
                inside = left < one.x + one.width - 1 and right > one.x + 1
                assert not (inside and top < one.y + one.height - 1 and bottom > one.y + 1), (line.edges, one.id)


@pytest.mark.slow
@pytest.mark.parametrize("places", [{}, {"state_0": (-500.0, 0.0)}], ids=["as laid out", "one of them moved"])
def test_300_nodes_take_well_under_a_second_of_processor_time(places: dict[str, tuple[float, float]]) -> None:
    graph = large(300)
    took = []
    for _ in range(3):
        begun = time.process_time()
        lay_out(graph, View(places=places))
        took.append(time.process_time() - begun)
    assert median(took) < 1.0

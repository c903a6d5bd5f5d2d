"""SVG drawings: the notation of the paper, and that lines can be followed and no text breaks them.

What is checked is the geometry before it is written (`sheet`), and the written file as XML.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reactivex import operators as ops

import hfg
from hfg.base.controls import name_problem
from hfg.graph.drawing.parts import Card
from hfg.graph.drawing.picture import Box, Pin, Shape, View, picture
from hfg.graph.drawing.sheet import Sheet, sheet

SVG = "{http://www.w3.org/2000/svg}"


@hfg.node
def source() -> Iterator[int]:
    yield 1


@hfg.node
def step(value: int) -> int:
    return value


@hfg.node
def join(left: int, right: int) -> int:
    return left + right


class State(hfg.Node):
    value = hfg.Input(int, optional=True)
    done = hfg.Event(int)
    lost = hfg.Event(int)
    limit = hfg.Parameter(0.5)

    @hfg.slot
    def begin(self) -> None: ...

    @hfg.slot
    def cancel(self) -> None: ...


class Skill(hfg.Subgraph):
    begin = hfg.slot(type=object)
    image = hfg.Input(int)
    result = hfg.Output(int)
    done = hfg.Event(int)
    limit = hfg.Parameter(1.0)

    def build(self, graph: hfg.Graph) -> None:
        detect, go_to = graph.add(step(), name="detect"), graph.add(State(), name="go_to", active_for_s=5)
        graph.connect(self.image.inner, detect.value)
        graph.connect(detect.out, self.result.inner)
        graph.connect(self.begin.inner, go_to.begin, active=True)
        graph.connect(go_to.done, self.done.inner, active=True)
        graph.connect(go_to.timeout, graph.abort)
        graph.gate(detect, by=go_to, idle_rate_hz=1)
        graph.promote(self.limit, go_to.ports.parameters["limit"])


class Nest(hfg.Subgraph):
    begin = hfg.slot(type=object)
    image = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        skill = graph.add(Skill(), name="skill")
        graph.connect(self.begin.inner, skill.begin, active=True)
        graph.connect(self.image.inner, skill.image)


def mission() -> hfg.Graph:
    """All that there is to draw, once."""
    graph = hfg.Graph("mission")
    graph.group("vision")
    camera = graph.add(source(), name="camera", max_rate_hz=30, group="vision")
    blur = graph.add(step(), name="blur", group="vision")
    fetch, nest = graph.add(Skill(), name="fetch", active_for_s=60), graph.add(Nest(), name="nest")
    find, show = graph.add(State(), name="find", enabled=False), graph.add(step(), name="show")
    camera >> blur
    graph.connect(blur.out, fetch.image, buffer=4)
    graph.connect(blur.out, nest.image)
    graph.connect(fetch.result, show.value)
    graph.start.activates(fetch.begin)
    graph.connect(fetch.done, find.begin, active=True)
    graph.connect(find.done, nest.begin, active=True)
    graph.connect(find.lost, fetch.begin, active=True)
    graph.connect(find.lost, graph.stop)
    graph.connect(fetch.timeout, find.cancel, capacity=3, overflow="drop_oldest", through=[ops.take(1)])
    graph.connect(find.done, fetch.ports.parameters["limit"])
    graph.gate(blur, by="fetch/go_to")
    graph.gate(find, by=find)
    return graph


def at_random(seed: int, count: int = 24) -> hfg.Graph:
    chance, graph = random.Random(seed), hfg.Graph(f"random {seed}")
    outs: list[Any] = []
    states: list[State] = []
    for number in range(count):
        kind = chance.choice(["source", "step", "join", "state", "state"])
        if kind == "state":
            state = graph.add(State(), name=f"state_{number}")
            for other in chance.sample(states, min(len(states), 2)):
                graph.connect(chance.choice([other.done, other.lost]), state.begin, active=chance.random() < 0.7)
            if states:
                graph.connect(state.done, chance.choice(states).cancel, active=chance.random() < 0.5)
            if outs and chance.random() < 0.5:
                graph.connect(chance.choice(outs).out, state.value)
            states.append(state)
        elif kind == "source" or not outs:
            outs.append(graph.add(source(), name=f"source_{number}"))
        elif kind == "step":
            node = graph.add(step(), name=f"step_{number}")
            graph.connect(chance.choice(outs).out, node.value)
            outs.append(node)
        else:
            both = graph.add(join(), name=f"join_{number}")
            graph.connect(chance.choice(outs).out, both.left)
            graph.connect(chance.choice(outs).out, both.right)
            outs.append(both)
    return graph


def laid(graph: hfg.Graph, view: View | None = None) -> Sheet:
    return sheet(picture(graph, view or View()))


def card(drawn: Sheet, name: str) -> Card:
    return next(one for one in drawn.cards if one.of.name == name)


def mark(of: Card, name: str) -> tuple[float, float]:
    """Give where a port is, as a part of the width and height of its node."""
    found = next(one for one in of.marks if one.name == name)
    return (found.x - of.x) / of.width, (found.y - of.y) / of.height


# --- the notation


def test_inputs_are_left_outputs_right_slots_on_top_and_events_at_the_bottom() -> None:
    drawn = laid(mission())
    blur, find = card(drawn, "blur"), card(drawn, "find")
    assert (mark(blur, "value")[0], mark(blur, "out")[0]) == (0, 1)
    assert (mark(find, "begin")[1], mark(find, "cancel")[1]) == (0, 0)
    assert (mark(find, "done")[1], mark(find, "lost")[1]) == (1, 1)
    assert mark(card(drawn, "go_to"), "limit")[0] == 0


def test_synchronous_ports_are_dark_squares_and_asynchronous_ones_light_circles() -> None:
    found = ElementTree.fromstring(mission().draw(format="svg"))
    blur = node(found, "blur")
    assert len(blur.findall(f"{SVG}rect[@class='hfg-port']")) == 2
    assert not blur.findall(f"{SVG}circle")
    assert len(node(found, "find").findall(f"{SVG}circle[@fill='#ffffff']")) == 4


def node(found: ElementTree.Element, path: str) -> ElementTree.Element:
    return next(one for one in found.iter(f"{SVG}g") if one.get("data-path") == path)


def test_active_edges_are_double_and_others_are_not() -> None:
    found = ElementTree.fromstring(mission().draw(format="svg"))
    edges = [one for one in found.iter(f"{SVG}g") if one.get("class") == "hfg-edge"]
    double = {
        (one.findtext(f"{SVG}title") or "").partition(" ")[0]
        for one in edges
        if one.find(f"{SVG}path[@class='hfg-gap']") is not None
    }
    single = {
        (one.findtext(f"{SVG}title") or "").partition(" ")[0]
        for one in edges
        if one.find(f"{SVG}path[@class='hfg-gap']") is None
    }
    assert (double, single) == ({"active"}, {"edge", "gate"})


def test_rates_time_outs_queues_and_gates_are_told() -> None:
    text = mission().draw(format="svg")
    for said in (
        "30 Hz",
        "active for 60 s",
        "disabled",
        "buffer 4",
        "drop_oldest, capacity 3, 1 operator",
        "else 1 Hz",
    ):
        assert f">{said}<" in text
    assert ">gate: rests unless active<" in text


def test_groups_have_colours_and_a_legend_unless_there_is_none() -> None:
    found = ElementTree.fromstring(mission().draw(format="svg"))
    fill = {path: rect_of(node(found, path)).get("fill") for path in ("camera", "blur", "find")}
    assert fill["camera"] == fill["blur"] != fill["find"]
    texts = [text.text for text in found.iter(f"{SVG}text")]
    assert "group vision" in texts
    assert "on the loop" in texts
    plain = hfg.Graph()
    plain.add(step())
    assert "on the loop" not in plain.draw(format="svg")


def rect_of(group: ElementTree.Element) -> ElementTree.Element:
    return next(one for one in group.iter(f"{SVG}rect") if "hfg-node" in (one.get("class") or ""))


def test_a_subgraph_is_a_box_around_what_lies_in_it_at_any_depth() -> None:
    drawn = laid(mission())
    boxes = {one.of.path: one for one in drawn.cards if isinstance(one.of, Box)}
    assert list(boxes) == ["fetch", "nest", "nest/skill"]
    for one in drawn.cards:
        around = boxes.get(one.of.path.rpartition("/")[0])
        if around is not None:
            assert around.x < one.x
            assert around.y < one.y
            assert one.x + one.width < around.x + around.width
            assert one.y + one.height < around.y + around.height


@pytest.mark.slow
def test_subgraphs_can_be_folded_by_depth_or_by_name() -> None:
    graph = mission()
    assert paths(graph.draw(format="svg", depth=0)) == {"camera", "blur", "fetch", "nest", "find", "show"}
    assert "nest/skill" in paths(graph.draw(format="svg", depth=1))
    assert "nest/skill/detect" not in paths(graph.draw(format="svg", depth=1))
    assert paths(graph.draw(format="svg", fold=["nest"])) - paths(graph.draw(format="svg", depth=0)) == {
        "fetch/detect",
        "fetch/go_to",
    }
    folded = {one.of.name: one.of for one in laid(graph, View(depth=0)).cards}
    assert [name for name, of in folded.items() if isinstance(of, Shape) and of.is_folded] == ["fetch", "nest"]


def paths(text: str) -> set[str]:
    return set(re.findall(r'data-path="([^"]*)"', text))


def test_folding_holds_for_the_other_formats_too() -> None:
    assert "subgraph" not in mission().draw(depth=0)
    assert "cluster" not in mission().draw(depth=0, format="dot")


def test_a_gate_from_within_a_folded_subgraph_comes_from_the_subgraph() -> None:
    leads = [one for one in laid(mission(), View(depth=0)).leads if one.arrows[0].is_gate]
    assert len(leads) == 2  # that of find, too, but none of those that are folded
    lead = leads[0]
    by, blur = card(laid(mission(), View(depth=0)), "fetch"), card(laid(mission(), View(depth=0)), "blur")
    assert by.x < lead.ways[0][0][0] < by.x + by.width
    assert blur.x < lead.ways[0][-1][0] < blur.x + blur.width


def test_all_ports_are_shown_when_they_are_asked_for() -> None:
    graph = hfg.Graph()
    graph.add(State(), name="alone")
    assert not card(laid(graph), "alone").marks
    shown = laid(graph, View(all_ports=True))
    assert [one.name for one in card(shown, "alone").marks] == ["value", "begin", "cancel", "done", "lost"]


@pytest.mark.rule("G2")
def test_what_is_active_is_outlined_with_the_subgraphs_around_it() -> None:
    graph = mission()
    found = ElementTree.fromstring(graph.draw(format="svg", active=["find", "fetch/go_to"]))
    lit = {
        one.get("data-path") for one in found.iter(f"{SVG}g") if any("hfg-on" in (c.get("class") or "") for c in one)
    }
    assert lit - {None} == {"find", "fetch/go_to", "fetch"}
    assert "hfg-on" not in graph.draw(format="svg").partition("</style>")[2]


def test_a_graph_that_runs_shows_what_is_active_now() -> None:
    seen: list[str] = []

    class Look(hfg.Node):
        @hfg.slot
        def begin(self) -> None:
            seen.append(graph.draw(format="svg"))

    graph = hfg.Graph()
    waiting, look = graph.add(State(), name="waiting"), graph.add(Look())
    graph.start.activates(waiting.activate)
    graph.connect(waiting.activated, look.begin)
    hfg.run(graph, clock="virtual")
    assert (
        'data-path="waiting"><title>waiting\nState\ngroup loop\nactive</title><rect class="hfg-node hfg-on"' in seen[0]
    )


def test_a_subgraph_can_be_drawn_alone_even_if_it_is_gated_from_outside() -> None:
    graph = mission()
    assert {"nest/skill", "nest/skill/go_to"} < paths(graph["nest"].graph.draw(format="svg"))
    outside, fetch = graph.add(State(), name="outside"), graph["fetch"]
    fetch.graph.gate("go_to", by=outside)
    assert ">outside<" in fetch.graph.draw(format="svg")


def test_an_edge_straight_through_a_subgraph_is_drawn_inside_it() -> None:
    class Through(hfg.Subgraph):
        value = hfg.Input(int)
        out = hfg.Output(int)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.value.inner, self.out.inner)

    graph = hfg.Graph()
    first, box, last = graph.add(source()), graph.add(Through()), graph.add(step())
    graph.connect(first.out, box.value)
    graph.connect(box.out, last.value)
    drawn = laid(graph)
    around = card(drawn, "through")
    inner = next(way for lead in drawn.leads for way in lead.ways if way[0][0] == around.x)
    assert inner[-1][0] == around.x + around.width


def test_an_empty_graph_is_drawn() -> None:
    assert ElementTree.fromstring(hfg.Graph("empty").draw(format="svg")).get("aria-label") == "empty"


@pytest.mark.slow
def test_subgraphs_inside_each_other_are_drawn_however_deep() -> None:
    class Deeper(hfg.Subgraph):
        pass

    graph = inside = hfg.Graph()
    for _ in range(300):
        inside = inside.add(Deeper()).graph
    inside.add(step())
    assert len(paths(graph.draw(format="svg"))) == 301


# --- lines can be followed

GRAPHS = [mission(), *(at_random(seed) for seed in range(5))]
LAID = {graph.name: laid(graph) for graph in GRAPHS}


@pytest.mark.parametrize("drawn", LAID.values(), ids=list(LAID))
def test_lines_run_from_port_to_port_with_right_angles(drawn: Sheet) -> None:
    ports = {(one.x, one.y) for card in drawn.cards for one in card.marks}
    for lead in drawn.leads:
        for arrow, way in zip(lead.arrows, lead.ways, strict=True):
            assert all(a[0] == b[0] or a[1] == b[1] for a, b in pairwise(way))
            for end, pin in ((way[0], arrow.out_of), (way[-1], arrow.into)):
                if pin is not None and pin.kind != "active":
                    assert end in ports


@pytest.mark.parametrize("drawn", LAID.values(), ids=list(LAID))
def test_no_line_runs_through_a_node_and_no_two_nodes_overlap(drawn: Sheet) -> None:
    nodes = [one for one in drawn.cards if isinstance(one.of, Shape)]
    for number, one in enumerate(nodes):
        for other in nodes[number + 1 :]:
            apart = one.x + one.width <= other.x or other.x + other.width <= one.x
            assert apart or one.y + one.height <= other.y or other.y + other.height <= one.y
    for lead in drawn.leads:
        for way in lead.ways:
            for (x1, y1), (x2, y2) in pairwise(way):
                for one in nodes:
                    left, right = sorted((x1, x2))
                    top, bottom = sorted((y1, y2))
                    inside = left < one.x + one.width - 1 and right > one.x + 1
                    assert not (inside and top < one.y + one.height - 1 and bottom > one.y + 1), one.of.path


@pytest.mark.parametrize("drawn", LAID.values(), ids=list(LAID))
def test_lines_of_different_ports_never_lie_on_each_other_on_their_way(drawn: Sheet) -> None:
    """Where they end at one port they meet, and where they leave one they part; between, each is by itself."""
    upright: list[tuple[float, float, float, str, str]] = []
    for lead in drawn.leads:
        for arrow, way in zip(lead.arrows, lead.ways, strict=True):
            begin, end = f"{arrow.tail} {arrow.out_of}", f"{arrow.head} {arrow.into}"
            for (x1, y1), (x2, y2) in pairwise(way[1:-1]):
                if x1 == x2:
                    upright.append((x1, min(y1, y2), max(y1, y2), begin, end))
    for number, (x, top, bottom, begin, end) in enumerate(upright):
        for x2, top2, bottom2, begin2, end2 in upright[number + 1 :]:
            if begin != begin2 and end != end2 and x == x2:
                assert min(bottom, bottom2) <= max(top, top2)


def test_data_leads_to_the_right() -> None:
    for drawn in LAID.values():
        for lead in drawn.leads:
            for arrow, way in zip(lead.arrows, lead.ways, strict=True):
                if not arrow.is_signal and not arrow.is_gate and not arrow.is_back:
                    assert way[0][0] < way[-1][0]


def test_a_chain_is_straight() -> None:
    graph = hfg.Graph()
    nodes = [graph.add(source()), *(graph.add(step()) for _ in range(5))]
    for one, other in pairwise(nodes):
        one >> other
    assert [len(way) for lead in laid(graph).leads for way in lead.ways] == [2] * 5


def test_a_circle_goes_back_where_one_comes_round() -> None:
    graph = hfg.Graph()
    a, b, c = (graph.add(State(), name=name) for name in "abc")
    graph.start.activates(a.begin)
    graph.connect(a.done, b.begin, active=True)
    graph.connect(b.done, c.begin, active=True)
    graph.connect(c.done, a.begin, active=True)
    drawn = laid(graph)
    assert card(drawn, "a").x < card(drawn, "b").x < card(drawn, "c").x


@pytest.mark.slow
def test_what_is_not_connected_is_put_side_by_side() -> None:
    graph = hfg.Graph()
    for _ in range(100):
        graph.add(step())
    drawn = laid(graph)
    assert 0.5 < drawn.width / drawn.height < 4


def test_a_graph_is_drawn_alike_each_time() -> None:
    assert at_random(3).draw(format="svg") == at_random(3).draw(format="svg")


# --- hostile texts

HOSTILE = [
    "<script>alert(1)</script>",
    '"onload="alert(1)',
    "]]><![CDATA[",
    "&amp;&#0;&lt;",
    "a\x00b\x1b[31m\x07",
    "\ud800 alone \udfff",
    "\ufffe\uffff",
    "\u202eright to left\u202c",
    "Z\u0300\u0301\u0302\u0303" * 20,
    "中文 \U0001f600 \ufdfd",
    "two\nlines\r\nthree\ttabs",
    "x" * 5000,
    "'",
    "-->",
    "url(#x);}</style>",
]


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_no_name_breaks_the_file(name: str) -> None:
    check_text(name)


@pytest.mark.slow
@given(st.text(min_size=1))
def test_no_text_at_all_breaks_the_file(name: str) -> None:
    check_text(name)


@hfg.node
def hear(value: object) -> None: ...


def check_text(name: str) -> None:
    found = ElementTree.fromstring(named(name.replace("/", "_").replace(".", "_"), name).encode())
    expected = ElementTree.fromstring(named("name", "value"))
    assert [one.tag for one in found.iter()] == [one.tag for one in expected.iter()]
    assert not [attribute for one in found.iter() for attribute in one.attrib if attribute.startswith("on")]


def named(name: str, value: object) -> str:
    """Draw a graph in which everything that can be has this name, and a value that shows itself by its text."""
    if name_problem(name) is not None:
        name = "name"  # nothing can be named so; values can
    graph = hfg.Graph(name)
    graph.group(name)
    first, second = graph.add(source(), name=name, group=name), graph.add(hear(), name=f"x{name}")
    graph.connect(first.out, second.value, initial=[value])
    return graph.draw(format="svg")


def test_a_long_name_is_shortened_in_its_middle_and_told_in_full_when_one_points_at_it() -> None:
    graph = hfg.Graph()
    name = "a" + "x" * 100 + "z"
    graph.add(step(), name=name)
    text = graph.draw(format="svg")
    shown = next(one.text or "" for one in ElementTree.fromstring(text).iter(f"{SVG}text") if "…" in (one.text or ""))
    assert shown[0] == "a"
    assert shown[-1] == "z"
    assert len(shown) < 40
    assert f"<title>{name}\n" in text


def test_a_file_needs_nothing_besides_itself() -> None:
    text = mission().draw(format="svg")
    assert set(re.findall(r"\w+://[^\s\"'<]*", text)) == {"http://www.w3.org/2000/svg"}
    assert "<script" not in text
    assert "url(" not in text


def test_a_pin_tells_whether_its_name_is_needed() -> None:
    graph = hfg.Graph()
    graph.add(source()) >> graph.add(step())
    arrow = picture(graph).arrows[0]
    assert (arrow.out_of, arrow.into) == (Pin("output", "out", is_plain=True), Pin("input", "value", is_plain=True))

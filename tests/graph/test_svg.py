"""SVG drawings: the notation of the paper, and that lines can be followed and no text breaks them.

What is checked is the written file, as XML; where everything goes is checked in `test_layout`.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reactivex import operators as ops

import hfg
from hfg.base.controls import name_problem

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


# --- the notation


def test_synchronous_ports_are_dark_squares_and_asynchronous_ones_light_circles() -> None:
    found = ElementTree.fromstring(mission().draw(format="svg"))
    blur = node(found, "blur")
    assert len(blur.findall(f"{SVG}rect[@class='hfg-sync']")) == 2
    assert not blur.findall(f"{SVG}circle")
    assert len(node(found, "find").findall(f"{SVG}circle[@class='hfg-async']")) == 4


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
    assert (double, single) == ({"active"}, {"edge"})


def test_rates_time_outs_queues_and_gates_are_told() -> None:
    text = mission().draw(format="svg", view="all")
    for said in ("30 Hz", "60 s", "buffer 4", "drop_oldest, capacity 3, 1 operator", "fetch/go_to", "go_to, else 1 Hz"):
        assert f">{said}<" in text, said
    assert ">rests unless active<" in text
    assert "rests unless fetch/go_to is active" in text
    assert 'class="hfg-body hfg-off"' in text  # disabled


def test_groups_have_colours_and_a_legend_unless_there_is_none() -> None:
    found = ElementTree.fromstring(mission().draw(format="svg"))
    paths = ("camera", "blur", "find")
    stripes = {path: len(node(found, path).findall(f"{SVG}path[@class='hfg-group1']")) for path in paths}
    assert stripes == {"camera": 1, "blur": 1, "find": 0}
    texts = [text.text for text in found.iter(f"{SVG}text")]
    assert "group vision" in texts
    assert "on the loop" in texts
    plain = hfg.Graph()
    plain.add(step())
    assert "on the loop" not in plain.draw(format="svg")


def test_the_fifth_group_has_the_first_colour_with_another_stripe() -> None:
    graph = hfg.Graph()
    for number in range(6):
        graph.group(f"group_{number}")
        graph.add(step(), name=f"node_{number}", group=f"group_{number}")
    found = ElementTree.fromstring(graph.draw(format="svg"))
    stripe = [node(found, f"node_{number}").findall(f"{SVG}path")[1] for number in (0, 4)]
    assert stripe[0].get("class") == stripe[1].get("class") == "hfg-group1"
    assert (stripe[0].get("d") or "").count("z") == 1
    assert (stripe[1].get("d") or "").count("z") > 2


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


def paths(text: str) -> set[str]:
    return set(re.findall(r'data-path="([^"]*)"', text))


def test_folding_holds_for_the_other_formats_too() -> None:
    assert "subgraph" not in mission().draw(depth=0)
    assert "cluster" not in mission().draw(depth=0, format="dot")


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
        'data-path="waiting"><title>waiting\nState\ngroup loop\nactive</title><rect class="hfg-body hfg-on"' in seen[0]
    )


def test_a_subgraph_can_be_drawn_alone_even_if_it_is_gated_from_outside() -> None:
    graph = mission()
    assert {"nest/skill", "nest/skill/go_to"} < paths(graph["nest"].graph.draw(format="svg"))
    outside, fetch = graph.add(State(), name="outside"), graph["fetch"]
    fetch.graph.gate("go_to", by=outside)
    assert "rests unless outside is active" in fetch.graph.draw(format="svg")


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

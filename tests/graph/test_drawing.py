"""Drawings: what is to be seen of a graph, and that no name can break the text around it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import reactivex
from hypothesis import given
from hypothesis import strategies as st
from reactivex import operators as ops

import hfg
from hfg.base.controls import name_problem
from hfg.errors import UsageError
from hfg.graph.drawing import dot, mermaid


@hfg.node
def source() -> Iterator[int]:
    yield 1


@hfg.node
def step(value: int) -> int:
    return value


class Station(hfg.Node):
    value = hfg.Input(int, optional=True)
    done = hfg.Event(int)
    limit = hfg.Parameter(0.5)

    @hfg.slot
    def begin(self) -> None: ...


class Box(hfg.Subgraph):
    begin = hfg.slot(type=object)
    done = hfg.Event(int)
    limit = hfg.Parameter(1.0)

    def build(self, graph: hfg.Graph) -> None:
        inside = graph.add(Station(), name="inside")
        graph.connect(self.begin.inner, inside.begin, active=True)
        graph.connect(inside.done, self.done.inner, active=True)
        graph.promote(self.limit, inside.ports.parameters["limit"])


class Empty(hfg.Subgraph):
    pass


def test_data_is_plain_signals_are_dashed_and_active_edges_are_thick() -> None:
    graph = hfg.Graph()
    first, second = graph.add(source(), max_rate_hz=2), graph.add(step())
    a, b = graph.add(Station(), name="a"), graph.add(Station(), name="b", active_for_s=5)
    first >> second
    graph.connect(second.out, a.value, active=True)
    graph.start.activates(a.begin)
    graph.connect(a.done, b.begin)
    graph.connect(b.timeout, graph.stop, active=True)
    assert mermaid(graph) == (
        "flowchart LR\n"
        '    n0(("start"))\n'
        '    n1((("stop")))\n'
        '    n2["source<br/>2 Hz"]\n'
        '    n3["step"]\n'
        '    n4["a"]\n'
        '    n5["b<br/>active for 5 s"]\n'
        "    n2 --> n3\n"
        '    n3 ==>|"→ value"| n4\n'
        '    n0 ==>|"→ begin"| n4\n'
        '    n4 -.->|"done → begin"| n5\n'
        '    n5 ==>|"timeout"| n1\n'
        "    classDef state fill:#fff3d0,stroke:#b8860b,color:#000\n"
        "    class n3,n4,n5 state\n"
        "    linkStyle 2,4 stroke-dasharray:7 4\n"
    )


def test_the_same_for_graphviz() -> None:
    graph = hfg.Graph("two")
    a, b = graph.add(Station(), name="a"), graph.add(Station(), name="b")
    graph.connect(a.done, b.begin, active=True)
    graph.gate(a, by=b)
    assert dot(graph) == (
        'digraph "two" {\n'
        '    graph [rankdir=LR, fontname="sans-serif"]\n'
        '    node [fontname="sans-serif"]\n'
        '    edge [fontname="sans-serif", fontsize=11]\n'
        '    n0 [label="a", shape=box, style=filled, fillcolor="#fff3d0"]\n'
        '    n1 [label="b", shape=box, style=filled, fillcolor="#fff3d0"]\n'
        '    n0 -> n1 [label="done → begin", style=dashed, color="black:invis:black"]\n'
        '    n1 -> n0 [label="gate", style=dotted, arrowhead=odot, constraint=false]\n'
        "}\n"
    )


def test_labels_tell_of_queues_initial_tokens_operators_and_gates() -> None:
    graph = hfg.Graph()
    a, b = graph.add(Station(), name="a"), graph.add(Station(), name="b", enabled=False)
    graph.connect(a.done, b.begin, capacity=3, overflow="drop_oldest", through=[ops.take(1)])
    graph.connect(a.done, b.value, capacity_limit=99, initial=[1, 2, 3, 4, 5])
    graph.connect(reactivex.of(1), a.begin, overflow="latest")
    c = graph.add(Station(), name="c")
    graph.connect(a.ports.parameters["limit"], c.ports.parameters["limit"], buffer=4)
    graph.gate(a, by=b, idle_rate_hz=0.5)
    shown = graph.draw()
    for said in (
        "done → begin, drop_oldest, capacity 3, 1 operator",
        "done → value, at most 99, initial 1, 2, 3, 4 and 1 more",
        '{{"observable"}}',
        "→ begin, latest",
        'n1 -.-o|"gate, else 0.5 Hz"| n0',
        "b<br/>disabled",
        "limit, buffer 4",
    ):
        assert said in shown


def test_a_subgraph_is_a_box_with_its_ports_and_can_be_drawn_alone() -> None:
    graph = hfg.Graph()
    box, after, state = graph.add(Box()), graph.add(Station(), name="after"), graph.add(Station(), name="state")
    graph.start.activates(box.begin)
    graph.connect(box.done, after.begin, active=True)
    graph.connect(box.timeout, box.deactivate)
    graph.connect(state.done, after.value)
    graph.connect(state.ports.parameters["limit"], box.ports.parameters["limit"])
    graph.gate(state, by=box)
    graph.add(Empty())
    lines = graph.draw().splitlines()
    inside = lines[lines.index('    subgraph g0["box"]') : lines.index("    end")]
    named = [line.split('"')[1] for line in inside[1:]]
    assert named == ["begin", "done", "timeout", "deactivate", "limit", "active", "inside"]
    assert any('["empty"]' in line for line in lines)
    assert "subgraph" not in box.graph.draw()
    assert [line.split('"')[1] for line in box.graph.draw().splitlines()[1:4]] == ["begin", "done", "inside"]


def test_what_is_active_in_a_run_is_seen() -> None:
    seen: list[str] = []

    class Look(hfg.Node):
        @hfg.slot
        def begin(self) -> None:
            seen.extend([mermaid(graph), dot(graph)])

    graph = hfg.Graph()
    waiting, look = graph.add(Station(), name="waiting"), graph.add(Look())
    graph.start.activates(waiting.activate)
    graph.connect(waiting.activated, look.begin)
    assert "class n1 state" in graph.draw()
    hfg.run(graph, clock="virtual")
    assert "class n1 active" in seen[0]
    assert "penwidth=4" in seen[1]


LABEL = r'"(?:[^"\\`<>&#]|#\w+;|<br/>)*"'
MERMAID_LINE = re.compile(
    rf"flowchart LR|end|subgraph g\d+\[{LABEL}\]|n\d+(?:\[|\(\[|\(+){LABEL}(?:\]|\]\)|\)+)"
    rf"|n\d+ (?:-->|==>|-\.->|-\.-o)(?:\|{LABEL}\|)? n\d+|classDef .*|class .*|linkStyle .*"
)
DOT_LABEL = re.compile(r'label="(?:[^"\\]|\\["\\n])*"')


@pytest.mark.parametrize("name", ['say "go"', "<b>&amp;#35;", "back\\nslash `tick`", "λ 中 \U0001f600", "end"])
def test_no_name_breaks_the_drawing(name: str) -> None:
    check_text(name)


@pytest.mark.slow
@given(st.text(min_size=1).filter(lambda name: not set(name) & set("/.") and name_problem(name) is None))
def test_no_text_at_all_breaks_the_drawing(name: str) -> None:
    check_text(name)


def check_text(name: str) -> None:
    graph = hfg.Graph(name)
    first, second = graph.add(source(), name=name), graph.add(Station(), name=f"x{name}")
    graph.connect(first.out, second.value)
    for line in mermaid(graph).removesuffix("\n").split("\n"):
        assert MERMAID_LINE.fullmatch(line.strip(" ")), line
    assert len(DOT_LABEL.findall(dot(graph))) == 3


def test_the_ending_says_what_is_written(tmp_path: Path) -> None:
    graph = hfg.Graph("g")
    for ending, write in ((".mmd", mermaid), (".dot", dot)):
        file = tmp_path / f"g{ending}"
        assert graph.draw(file) == write(graph)
        assert file.read_text(encoding="utf-8") == write(graph)
    with pytest.raises(UsageError, match=r"a drawing ends in \.svg or \.mmd or \.dot; rename the file"):
        graph.draw(tmp_path / "g.png")
    with pytest.raises(UsageError, match="No such file or directory; name a file in a folder"):
        graph.draw(tmp_path / "nowhere" / "g.mmd")


def test_a_notebook_shows_a_graph_by_itself() -> None:
    graph = hfg.Graph()
    assert graph._repr_svg_() == graph.draw(format="svg")

"""What is saved and loaded is the same graph: the same text when it is saved again, and the same run."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
import pytest
from annotated_types import Interval, Len, MinLen, MultipleOf
from numpy.typing import NDArray
from reactivex import operators as ops

import hfg
from hfg.base.values import same
from hfg.files import Document, build, describe, text_of
from hfg.files.findings import Findings
from hfg.files.reading import read_bytes
from hfg.testing.plans import GraphPlan
from hfg.types import Shape
from tests.files.programs import Ear, Merged, Mode, Pose, Scaling, difference, double, numbers, plan_of, shown
from tests.support.shrinking import shrink

Turn = Annotated[NDArray[np.float64], Shape(3, 3)]


def read_text(text: str) -> Document:
    """What a file with this text says."""
    found = read_bytes(text.encode(), "a.hfg.yaml", Findings())
    assert found is not None
    return found.document


def again(graph: hfg.Graph) -> hfg.Graph:
    """The graph that the graph's own file describes, which is the same."""
    document = describe(graph)
    other = build(document)
    assert text_of(describe(other)) == text_of(document)
    return other


def smallest(plan: GraphPlan, seed: int, folder: Path) -> str:
    """The smallest graph found that does not come back, and what becomes of it."""
    small = shrink(plan, lambda one: difference(one, seed, folder / "graph.hfg.yaml") is not None)
    return f"{small}\n{difference(small, seed, folder / 'graph.hfg.yaml')}"


@pytest.mark.slow
@pytest.mark.parametrize("block", range(10))
def test_random_graphs_come_back_as_they_are(block: int, tmp_path: Path) -> None:
    """By their text and by everything that happens in a run under one schedule."""
    for seed in range(20 * block, 20 * block + 20):
        plan = plan_of(seed)
        if plan is None:
            continue
        why = difference(plan, seed, tmp_path / "graph.hfg.yaml")
        if why is not None:
            pytest.fail(smallest(plan, seed, tmp_path), pytrace=False)


def test_a_file_reads_as_the_graph_is_drawn() -> None:
    graph = hfg.Graph("line")
    graph.group("vision", threads=2, policy="priority")
    source = graph.add(numbers(count=5), name="camera", max_rate_hz=10, group="vision")
    look, ear = graph.add(shown(share=0.25), priority=3), graph.add(Ear())
    graph.connect(source.out, look.value, buffer=2)
    debounced = [hfg.operator(ops.debounce)(0.2), hfg.operator(ops.distinct_until_changed)()]
    graph.connect(graph["shown.out.sent"], ear.hear, capacity=100, overflow="drop_oldest", through=debounced)
    graph.connect(ear.rang, graph.stop, active=True)
    graph.connect(look.out, graph.output("seen", int))
    graph.gate(look, by=ear, idle_rate_hz=1.5)
    graph.edit(
        hfg.commands.Note("camera", "position", [120, 40.5]),
        hfg.commands.Note("camera", "comment", "two\nlines"),
        hfg.commands.Note("", "title", "no"),
    )
    assert text_of(describe(graph)) == (
        """\
hfg: 1
name: line
notes:
  title: "no"
groups:
  vision:
    threads: 2
    policy: priority
outputs:
  seen: int
nodes:
  camera:
    type: tests.files.programs:numbers
    group: vision
    max_rate_hz: 10
    parameters:
      count: 5
    position: [120, 40.5]
    notes:
      comment: |-
        two
        lines
  shown:
    type: tests.files.programs:shown
    priority: 3
    gate:
      by: ear
      idle_rate_hz: 1.5
    parameters:
      share: 0.25
  ear:
    type: tests.files.programs:Ear
edges:
  - camera.out -> shown.value:
      buffer: 2
  - shown.out.sent -> ear.hear:
      capacity: 100
      overflow: drop_oldest
      through:
        - type: reactivex.operators:debounce
          arguments: [0.2]
        - reactivex.operators:distinct_until_changed
  - ear.rang -> stop:
      active: true
  - shown.out -> seen
"""
    )
    other = again(graph)
    assert other.notes("camera") == graph.notes("camera")
    assert other.notes() == {"title": "no"}


def test_values_of_parameters_come_back_in_their_types() -> None:
    graph = hfg.Graph()
    graph.add(shown(mode=Mode.GOOD, corners=(1, 2, 3), pose=Pose(1.5), text="no: #1 \u2028"), name="look")
    graph.add(numbers(step=float("inf")))
    graph.add(numbers(step=float("nan")))
    look = again(graph)["look"]
    assert [look._parameters[name] for name in ("mode", "corners", "pose", "text")] == [
        Mode.GOOD,
        (1, 2, 3),
        Pose(1.5),
        "no: #1 \u2028",
    ]
    assert again(graph)["numbers"]._parameters["step"] == float("inf")


def test_the_loop_keeps_its_policy() -> None:
    graph = hfg.Graph()
    graph.group("loop", policy="priority")
    assert again(graph).groups["loop"].policy == "priority"
    assert build(read_text("hfg: 1\ngroups: {loop: {policy: fair}}\n")).groups["loop"].policy == "fair"


def test_vectors_of_ports_keep_their_size() -> None:
    graph = hfg.Graph()
    merged = graph.add(Merged(values=3))
    for port in merged.values:
        graph.connect(graph.add(numbers()).out, port)
    assert len(again(graph)["merged"].values) == 3
    assert "numbers_3.out -> merged.values[2]" in text_of(describe(graph))


def test_what_operators_are_given_comes_back_in_its_type() -> None:
    graph = hfg.Graph()
    graph.add(numbers())
    ear = graph.add(Ear())
    begun = hfg.operator(ops.start_with)((1, 2), Pose(3.0))
    graph.connect(graph["numbers.out.sent"], ear.hear, through=[begun])
    assert again(graph).edges[0].options.through == (begun,)


def test_machines_are_states_and_edges() -> None:
    door = hfg.StateMachine(
        ["closed", "open"], [("push", "closed", "open"), ("pull", "open", "closed")], initial="closed", final=["closed"]
    )
    assert hfg.StateMachine.of(again(door.graph())) == door


@pytest.mark.parametrize("name", ["a b", "a -> b", "no", "1", "a: b", "ä", "- x", "'", " x "])
def test_any_name_of_a_node_is_possible(name: str) -> None:
    graph = hfg.Graph("x")
    graph.connect(graph.add(numbers(), name=name).out, graph.add(double()).value)
    other = again(graph)
    assert list(other.nodes) == [name, "double"]
    assert other.edges[0].label == graph.edges[0].label


# --- subgraphs ---


def test_a_subgraph_with_a_type_is_told_by_its_type_and_what_is_otherwise_inside() -> None:
    graph = hfg.Graph()
    graph.group("side")
    graph.add(Scaling(factor=5), name="scaling")
    assert "inside" not in text_of(describe(graph))
    graph.edit(
        hfg.commands.SetParameter("scaling/second.factor", 7),
        hfg.commands.SetParameter("scaling/first.factor", 6),
        hfg.commands.Disable("scaling/first"),
        hfg.commands.Move("scaling/second", "side"),
        hfg.commands.Note("scaling/second", "position", [1, 2]),
    )
    other = again(graph)
    inside = other["scaling"].graph
    assert other["scaling"]._parameters == {"factor": 5}
    assert [inside[name]._parameters["factor"] for name in ("first", "second")] == [6, 7]
    assert not inside["first"]._options.enabled
    assert inside["second"]._options.group == "side"
    assert other.notes("scaling/second") == {"position": [1, 2]}
    assert "graph:" not in text_of(describe(graph))


def test_an_edited_inside_is_told_whole_with_its_promotions() -> None:
    graph = hfg.Graph()
    graph.add(Scaling(factor=5), name="scaling")
    graph.edit(
        hfg.commands.Add("tests.files.programs:double", "scaling/third"),
        hfg.commands.Disconnect("scaling/second.out", "scaling.scaled.inner"),
        hfg.commands.Connect("scaling/second.out", "scaling/third.value"),
        hfg.commands.Connect("scaling/third.out", "scaling.scaled.inner"),
    )
    other = again(graph)
    assert list(other["scaling"].graph.nodes) == ["first", "second", "third"]
    other["scaling"].ports.parameters["factor"].value = 9
    assert other["scaling/first"]._parameters["factor"] == 9
    assert [gate.target.place.path for gate in other["scaling"].graph.gates] == ["scaling/second"]


def test_a_subgraph_without_a_type_of_its_own_has_its_ports_and_parameters_in_the_file() -> None:
    class Local(hfg.Subgraph):
        value = hfg.Input(int)
        start = hfg.slot(type=int)
        scaled = hfg.Output(int)
        factor = hfg.Parameter(3, Interval(ge=0, le=9), unit="m")

        def build(self, graph: hfg.Graph) -> None:
            node, ear = graph.add(double(), name="node"), graph.add(Ear())
            self.value.inner >> node >> self.scaled.inner
            graph.promote(self.factor, node.ports.parameters["factor"])
            graph.connect(graph.start, ear.activate)
            graph.connect(self.start.inner, ear.hear)

    graph = hfg.Graph()
    graph.add(Local(factor=4), name="local")
    text = text_of(describe(graph))
    assert "- /start -> ear.activate\n        - start -> ear.hear\n" in text
    local = again(graph)["local"]
    assert local._parameters == {"factor": 4}
    assert local.graph["node"]._parameters == {"factor": 4}
    with pytest.raises(ValueError, match="must be <= 9"):
        local.ports.parameters["factor"].value = 10


class Every(hfg.Subgraph):
    """Has a parameter of every kind that users set."""

    soft = hfg.Parameter(False)
    count = hfg.Parameter(
        3, Interval(ge=0, le=9), MultipleOf(3), unit="items", step=3, group="numbers/few", help="how many"
    )
    title = hfg.Parameter("no: #1")
    way = hfg.Parameter("fast", choices=("fast", "good"), shown_if="soft")
    code = hfg.Parameter(8, choices={"Otsu": 8, "Plain": 0}, shown_if={"way": "good"})
    mode = hfg.Parameter(Mode.FAST, shown_if={"way": ["fast", "good"], "count": Interval(ge=1, lt=9)})
    letter = hfg.Parameter("a", type=Literal["a", "b"], shown_if={"mode": Mode.GOOD})
    sides = hfg.Parameter(frozenset({"a"}), type=frozenset[Literal["a", "b"]])
    some = hfg.Parameter(["a"], choices=("a", "b"), type=list[str])
    band = hfg.Parameter(hfg.Span(0.1, 0.5), Interval(ge=0, le=1), shown_if={"some": [["a"], ["a", "b"]]})
    frame = hfg.Parameter(hfg.Colour(255, 128, 0), shown_if={"code": 8})
    picture = hfg.Parameter(Path("a.png"), pattern="*.png *.jpg", save=True)
    folder = hfg.Parameter(None, type=Path | None, directory=True, shown_if={"sides": MinLen(1)})
    gains = hfg.Parameter((0.0, 1.0), Interval(ge=-5, le=5))
    names = hfg.Parameter(["a"], Len(1, 9), type=list[str])
    offset = hfg.Parameter(np.eye(3), Interval(ge=-1, le=1), type=Turn)

    def build(self, graph: hfg.Graph) -> None:
        graph.add(double(), name="node")


SET: dict[str, Any] = {
    "soft": True,
    "count": 6,
    "title": "yes",
    "way": "good",
    "code": 0,
    "mode": Mode.GOOD,
    "letter": "b",
    "sides": frozenset({"a", "b"}),
    "some": ["b", "a"],
    "band": hfg.Span(0.0, 1.0),
    "frame": hfg.Colour(1, 2, 3),
    "picture": Path("b.jpg"),
    "folder": Path("there"),
    "gains": (-5.0, 0.1),
    "names": ["b", "- c"],
    "offset": -np.eye(3),
}
"""Of `Every`, other values than the defaults."""


@pytest.mark.slow
def test_a_subgraph_without_a_type_keeps_everything_that_is_said_of_its_parameters() -> None:
    body = {name: Every.__dict__[name] for name in SET} | {"build": Every.build}
    local: type[hfg.Subgraph] = type("Local", (hfg.Subgraph,), body)
    graph = hfg.Graph()
    graph.add(local(**SET), name="local")
    back = again(graph)["local"]
    for name, spec in local._type.parameters.items():
        other = back._type.parameters[name]
        assert msgspec.structs.replace(other, default=0) == msgspec.structs.replace(spec, default=0)
        assert same(other.default, spec.default)
    assert all(same(back._parameters[name], value) for name, value in SET.items())
    text = text_of(describe(graph))
    assert "          shown_if: soft\n" in text
    assert "          labels:\n            - Otsu\n            - Plain\n" in text


def test_gates_over_the_borders_of_subgraphs_name_who_is_meant() -> None:
    class Local(hfg.Subgraph):
        def build(self, graph: hfg.Graph) -> None:
            graph.add(Ear(), name="near")
            graph.add(Ear(), name="gated")
            graph.gate("gated", by="near")

    graph = hfg.Graph()
    for name, box in (("local", Local()), ("other", Local()), ("scaling", Scaling())):
        graph.add(box, name=name)
    graph.gate("local/near", by="other/near", idle_rate_hz=2)
    graph.gate("scaling/first", by="local")
    graph.gate("other", by="scaling/second")
    text = text_of(describe(graph))
    assert [line.strip() for line in text.splitlines() if "by:" in line] == [
        "by: /other/near",
        "by: near",
        "by: scaling/second",
        "by: near",
        "by: local",
    ]
    gates = {gate.target.place.path: gate.by.place.path for level in (graph,) for gate in again(level).gates}
    assert gates == {"local/near": "other/near", "scaling/first": "local", "other": "scaling/second"}


def test_saving_changes_nothing_and_may_be_done_while_it_runs(tmp_path: Path) -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(numbers(), max_rate_hz=1).out, graph.add(double(), name="double").value)
    graph.edit(hfg.commands.SetParameter("double.factor", 5))

    async def main() -> None:
        async with hfg.running(graph) as run:
            hfg.save(graph, tmp_path / "a.hfg.yaml")
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    assert hfg.load(tmp_path / "a.hfg.yaml")["double"]._parameters["factor"] == 5
    graph.undo()


@pytest.mark.slow
def test_random_graphs_have_parameters_of_every_kind_that_are_set() -> None:
    """And a plan prints as the program that sets them."""
    plans = [plan for seed in range(0, 60, 3) if (plan := plan_of(seed)) is not None]
    tuned = [(plan, node) for plan in plans for node in plan.nodes if node.type == "Tuned"]
    assert len({name for _, node in tuned for name in node.parameters}) >= 9
    names: dict[str, Any] = {}
    exec(repr(tuned[-1][0]), names)
    assert text_of(describe(names["graph"])) == text_of(describe(tuned[-1][0].build()))

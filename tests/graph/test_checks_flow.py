"""What the checks find of stalls, signals that multiply or never come, types through subgraphs, and scheduling."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.errors import CheckFailed, Problem
from hfg.graph import Graph, Subgraph
from hfg.testing.nodes import script, slow_double
from tests.support.making import Allowed, random_plan

ROOT = Path(__file__).resolve().parents[2]


class Need(hfg.Node):
    a = hfg.Input(int)
    b = hfg.Input(int, optional=True)
    out = hfg.Output(int)

    def process(self, a: int, b: int | None) -> int: ...


class Bell(hfg.Node):
    """Lives by its slots."""

    rang = hfg.Event(int)
    stopped = hfg.Event(int)

    @hfg.slot
    def ring(self, value: int) -> None: ...

    @hfg.slot
    def stop(self, value: int) -> None: ...


class Both(hfg.Node):
    a = hfg.Input(int)
    b = hfg.Input(int)
    rang = hfg.Event(int)

    def process(self, a: int, b: int) -> None: ...


class Words(hfg.Node):
    word = hfg.Input(str)

    def process(self, word: str) -> None: ...


class Anything(Subgraph):
    """Its port takes all, what is inside does not."""

    value = hfg.Input(Any)

    def build(self, graph: Graph) -> None:
        self.words = graph.add(Words())
        graph.connect(self.value.inner, self.words.word)


@pytest.fixture
def graph() -> Graph:
    return Graph("flow")


def found(graph: Graph, check: str) -> list[Problem]:
    return [problem for problem in graph.check() if problem.check == check]


def one(graph: Graph, check: str) -> Problem:
    (problem,) = found(graph, check)
    return problem


# --- who stands still ---


@pytest.mark.rule("F1", "F5")
def test_an_unconnected_input_names_who_stands_still_because_of_it(graph: Graph) -> None:
    source, other = graph.add(script()), graph.add(script())
    first, second, third = (graph.add(Need(), name=name) for name in ("first", "second", "third"))
    graph.connect(source.out, first.b)
    graph.connect(first.out, second.a)
    graph.connect(second.out, third.a)
    graph.connect(other.out, third.b)
    problem = one(graph, "unconnected-input")
    assert (problem.path, problem.severity) == ("first.a", "warning")
    assert 'nor does what waits for its tokens: "second", "third"' in problem.why
    assert 'its tokens are never taken, so this stands still: "script"' in problem.why


@pytest.mark.rule("F1", "P7", "F10")
def test_who_has_tokens_of_its_own_or_is_not_waited_for_does_not_stand_still(graph: Graph) -> None:
    lonely = graph.add(Need(), name="lonely")
    delayed, after = graph.add(Need(), name="delayed"), graph.add(Need(), enabled=False)
    graph.connect(lonely.out, delayed.a, initial=[1])
    graph.connect(lonely.out, after.a)
    assert "nor does" not in one(graph, "unconnected-input").why


# --- signals ---


@pytest.mark.rule("F8")
def test_a_signal_that_comes_back_twice_may_fill_the_ring(graph: Graph) -> None:
    first, second, third = (graph.add(Bell(), name=name) for name in ("first", "second", "third"))
    graph.connect(first.rang, second.ring)
    graph.connect(first.rang, third.ring)
    graph.connect(second.rang, first.ring)
    assert not found(graph, "filling-ring")
    graph.connect(third.rang, first.ring)
    problem = one(graph, "filling-ring")
    assert (problem.path, problem.severity) == ("first.rang", "warning")
    assert "come back 2 times" in problem.what


@pytest.mark.rule("F8")
def test_a_signal_that_comes_back_by_two_slots_of_the_same_node_fills_too(graph: Graph) -> None:
    bell = graph.add(Bell())
    graph.connect(bell.rang, bell.ring)
    assert not found(graph, "filling-ring")
    graph.connect(bell.rang, bell.stop)
    assert one(graph, "filling-ring").path == "bell.rang"


@pytest.mark.rule("F8", "P5")
@pytest.mark.parametrize("bound", [{"overflow": "latest"}, {"capacity_limit": 100}, {"overflow": "drop_oldest"}])
def test_a_ring_with_a_bounded_edge_does_not_fill(graph: Graph, bound: dict[str, Any]) -> None:
    bell = graph.add(Bell())
    graph.connect(bell.rang, bell.ring)
    graph.connect(bell.rang, bell.stop, **bound)
    assert not found(graph, "filling-ring")


@pytest.mark.rule("F8")
def test_different_events_are_alternatives_and_a_node_that_waits_for_both_makes_one_of_two(graph: Graph) -> None:
    bell, left, right, both = graph.add(Bell()), graph.add(Bell()), graph.add(Bell()), graph.add(Both())
    graph.connect(bell.rang, left.ring)
    graph.connect(bell.stopped, left.stop)
    graph.connect(left.rang, bell.ring)
    assert not found(graph, "filling-ring")
    graph.connect(bell.rang, right.ring)
    graph.connect(left.stopped, both.a)
    graph.connect(right.stopped, both.b)
    graph.connect(both.rang, bell.stop)
    assert not found(graph, "filling-ring")


@pytest.mark.rule("A9", "A12", "X1")
def test_edges_from_automatic_events_that_never_come_are_found(graph: Graph) -> None:
    bell, need = graph.add(Bell()), graph.add(Need(), on_error="skip", active_for_s=1.0)
    box = graph.add(Anything())
    for event in (bell.timeout, bell.failed, bell.processed, box.timeout):
        graph.connect(event, bell.activate)
    assert [p.path for p in found(graph, "silent-event")] == [
        "bell.timeout -> bell.activate",
        "bell.failed -> bell.activate",
        "bell.processed -> bell.activate",
        "anything.timeout -> bell.activate",
    ]
    for event in (need.timeout, need.failed, need.processed, bell.activated):
        graph.connect(event, bell.deactivate)
    assert len(found(graph, "silent-event")) == 4


@pytest.mark.rule("X1")
def test_a_declared_event_of_the_same_name_as_nothing_automatic_is_left_alone(graph: Graph) -> None:
    bell = graph.add(Bell())
    graph.connect(bell.stopped, bell.ring)
    assert not found(graph, "silent-event")


@pytest.mark.rule("F2")
def test_a_node_none_of_whose_slots_anything_leads_to_is_a_hint(graph: Graph) -> None:
    bell = graph.add(Bell())
    problem = one(graph, "unfed-slots")
    assert (problem.path, problem.severity, problem.what) == ("bell", "hint", "nothing leads to its slots ring, stop")
    graph.connect(graph.add(script()).out, bell.stop)
    assert not found(graph, "unfed-slots")


# --- through subgraphs ---


@pytest.mark.rule("P3", "G1")
def test_types_that_only_the_whole_edge_shows_not_to_fit_are_an_error(graph: Graph) -> None:
    box, source = graph.add(Anything()), graph.add(script())
    graph.connect(source.out, box.value)
    problem = one(graph, "type-mismatch")
    assert (problem.path, problem.severity) == ("script.out -> anything/words.word", "error")
    assert "int is sent, str is expected" in problem.what
    with pytest.raises(CheckFailed, match="port types do not fit"):
        hfg.run(graph, clock="virtual")


@pytest.mark.rule("P3", "P9")
def test_operators_on_the_way_may_change_the_type(graph: Graph) -> None:
    class Turned(Subgraph):
        value = hfg.slot(type=Any)

        def build(self, graph: Graph) -> None:
            graph.connect(self.value.inner, graph.add(Bell()).ring)

    class Says(hfg.Node):
        word = hfg.Event(str)

    says, turned = graph.add(Says()), graph.add(Turned())
    graph.connect(says.word, turned.value, through=[lambda words: words])
    assert not found(graph, "type-mismatch")


# --- scheduling ---


@pytest.mark.rule("R1")
def test_async_code_in_a_thread_is_an_error_before_anything_runs(graph: Graph) -> None:
    graph.group("work", threads=1)
    graph.connect(graph.add(script()).out, graph.add(slow_double(), group="work").value)
    assert one(graph, "async-in-thread").severity == "error"
    graph.move(graph["slow_double"], group="loop")
    assert not found(graph, "async-in-thread")


@pytest.mark.rule("R2")
def test_a_priority_that_nobody_looks_at_and_a_policy_that_finds_no_deadline_are_hints(graph: Graph) -> None:
    node, other = graph.add(Need(), deadline_s=0.5), graph.add(Need(), priority=3)
    assert [(p.path, p.severity) for p in found(graph, "unused-scheduling")] == [("need_2", "hint")]
    graph.group("urgent", policy="deadline", threads=0)
    assert "no node in it has deadline_s" in found(graph, "unused-scheduling")[-1].what
    graph.group("ranked", policy="priority", threads=0)
    graph.move(node, group="urgent")
    graph.move(other, group="ranked")
    assert not found(graph, "unused-scheduling")


# --- all together ---


@pytest.mark.parametrize("block", range(4))
def test_random_sound_graphs_give_no_error(block: int) -> None:
    for seed in range(50 * block, 50 * block + 50):
        errors = [str(p) for p in random_plan(seed, Allowed()).build().check() if p.severity == "error"]
        assert not errors, f"seed {seed}: {errors}"


def test_all_findings_are_collected_before_one_error_is_raised(graph: Graph) -> None:
    graph.connect(graph.add(script()).out, graph.add(Anything()).value)
    graph.add(Bell(), group="nowhere")
    lonely = graph.add(Need())
    graph.connect(lonely.out, lonely.b)
    with pytest.raises(CheckFailed) as caught:
        hfg.run(graph, clock="virtual")
    assert [problem.severity for problem in caught.value.problems].count("error") == 3
    assert {problem.check for problem in caught.value.problems} >= {"type-mismatch", "unknown-group", "data-ring"}


def test_every_check_has_a_name_and_is_explained() -> None:
    """The page lists exactly the names that findings can have."""
    sources = [
        *(ROOT / "hfg" / "graph").rglob("*.py"),
        *(ROOT / "hfg" / "files").rglob("*.py"),
        ROOT / "hfg" / "analysis" / "checks.py",
        ROOT / "hfg" / "activity" / "description.py",
        ROOT / "hfg/cli/check.py",
    ]
    text = "".join(source.read_text(encoding="utf-8") for source in sources)
    assert text.count("Problem(\n") == len(re.findall(r'check="[a-z-]+"', text))
    names = set(re.findall(r'check="([a-z-]+)"', text))
    page = (ROOT / "docs" / "howto" / "checks.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^### `([a-z-]+)`", page, flags=re.MULTILINE)) == names

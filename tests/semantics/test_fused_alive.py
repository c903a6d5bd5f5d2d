"""Regions in which something is active: fused they do what nodes do one by one, and activity does not end a wave.

Regions are fused from the first firing on here. Each graph runs interpreted and fused; calls, values and counts agree.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg.engine.runtime import settings
from tests.semantics.calls import note_calls
from tests.semantics.nodes import forward, numbers
from tests.semantics.test_fused import check
from tests.support.making import Allowed

WAVES = 30
ALL_FUSED = 0.9  # but for starts, ends, and calls that the run makes


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


class Looks(hfg.Node):
    """Passes on, and says whether it is active."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value

    @hfg.slot
    def begin(self) -> None:
        pass


class Steps(Looks):
    """Triggers while it is active; by an active edge its activity goes along."""

    go = hfg.Event()

    def process(self, value: int) -> int:
        if self.active:
            self.go.trigger()
        return value


class Flips(hfg.Node):
    """Turns something on and off, every three values."""

    value = hfg.Input(int)
    on = hfg.Event()
    off = hfg.Event()

    def process(self, value: int) -> None:
        if value % 3 == 0:
            (self.on if value % 2 else self.off).trigger()


class Holds(hfg.Node):
    """A state, no more."""

    @hfg.slot
    def begin(self) -> None:
        pass


class Hears(hfg.Node):
    """Hears values by a slot, and tells of each by an event."""

    heard = hfg.Event(int)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.heard.trigger(value)


def chain(graph: hfg.Graph, *nodes: Any, active: bool = False) -> list[Any]:
    """A source and nodes behind it, named a, b, c ..."""
    out: Any = graph.add(numbers(count=WAVES)).out
    for name, node in zip("abcdefgh", nodes, strict=False):
        graph.add(node, name=name)
        graph.connect(out, node.value, active=active)
        out = node.out
    return list(nodes)


def an_active_member() -> hfg.Graph:
    graph = hfg.Graph()
    graph.start.activates(chain(graph, forward(), Looks(), forward())[1].begin)
    return graph


def a_gate(opened: bool) -> Callable[[], hfg.Graph]:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        state = graph.add(Holds())
        if opened:
            graph.start.activates(state.begin)
        graph.gate(chain(graph, forward(), forward(), forward())[1], by=state)
        return graph

    return build


def a_gate_that_a_member_turns() -> hfg.Graph:
    graph = hfg.Graph()
    nodes = chain(graph, forward(), forward(), forward())
    flips, state = graph.add(Flips()), graph.add(Holds())
    graph.connect(nodes[0].out, flips.value)
    graph.connect(flips.on, state.activate)
    graph.connect(flips.off, state.deactivate)
    graph.gate(nodes[2], by=state)
    return graph


def activity_along_the_edges() -> hfg.Graph:
    graph = hfg.Graph()
    nodes = chain(graph, Looks(), Looks(), Steps(), active=True)
    nodes[-1].go.activates(nodes[0].begin)
    graph.start.activates(nodes[0].begin)
    return graph


def a_ring(forwards: bool) -> Callable[[], hfg.Graph]:
    """Activity goes from each to the next by an event, with the waves or against them."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        nodes = chain(graph, Steps(), Steps(), Steps())
        for number, node in enumerate(nodes):
            node.go.activates(nodes[(number + (1 if forwards else -1)) % len(nodes)].begin)
        graph.start.activates(nodes[0].begin)
        return graph

    return build


def an_outsider_amid_a_wave() -> hfg.Graph:
    graph = hfg.Graph()
    nodes = chain(graph, forward(), forward(), Looks())
    hears = graph.add(Hears())
    graph.connect(nodes[0].out, hears.hear)
    graph.connect(hears.heard, nodes[2].begin)
    return graph


def who_hears_that_it_was_processed() -> hfg.Graph:
    graph = hfg.Graph()
    nodes = chain(graph, forward(), forward(), Looks())
    graph.connect(nodes[0].processed, nodes[2].begin)
    return graph


@hfg.node
async def rests(value: int) -> int:
    return value


def a_source_that_was_processed_before_async_code() -> hfg.Graph:
    """Async members and those that announce do not go together, also where a source announces."""
    graph = hfg.Graph()
    chain(graph, rests(), forward())
    graph.connect(graph["numbers"].processed, graph.add(Holds(), name="hears").begin)
    return graph


GRAPHS = {
    "an active member": an_active_member,
    "an open gate": a_gate(True),
    "a closed gate": a_gate(False),
    "a gate that a member turns": a_gate_that_a_member_turns,
    "activity along the edges": activity_along_the_edges,
    "a ring by events": a_ring(True),
    "a ring against the waves": a_ring(False),
    "an outsider amid a wave": an_outsider_amid_a_wave,
    "who hears that it was processed": who_hears_that_it_was_processed,
}


@pytest.mark.rule("A3", "A5", "A6", "A9", "A11", "F9", "R2")
@pytest.mark.parametrize("build", GRAPHS.values(), ids=GRAPHS)
def test_fused_it_does_what_single_firings_do(build: Callable[[], hfg.Graph], monkeypatch: pytest.MonkeyPatch) -> None:
    calls = note_calls(monkeypatch)
    found = []
    for fast in (False, True):
        report = hfg.run(build(), clock="virtual", fast=fast)
        found.append((calls.take()[0], report.nodes, report.edges))
    assert found[0] == found[1]
    firings = sum(node.firings for node in found[1][1].values())
    assert calls.fused > ALL_FUSED * firings


@pytest.mark.rule("A9", "F9")
def test_a_source_before_async_code_announces_each_firing(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = note_calls(monkeypatch)
    build = a_source_that_was_processed_before_async_code
    found = []
    for fast in (False, True):
        report = hfg.run(build(), clock="virtual", fast=fast)
        found.append((calls.take()[0], report.nodes, report.edges))
    assert found[0] == found[1]
    assert found[1][1]["hears"].calls == WAVES


@pytest.mark.rule("G2", "A9")
def test_a_watched_subgraph_stays_active_while_activity_passes_its_edges(monkeypatch: pytest.MonkeyPatch) -> None:
    class Box(hfg.Subgraph):
        value = hfg.Input(int)
        begin = hfg.slot(type=object)

        def build(self, graph: hfg.Graph) -> None:
            first, second = graph.add(Looks(), name="first"), graph.add(Steps(), name="second")
            graph.connect(self.value.inner, first.value)
            first.out.activates(second.value)
            second.go.activates(first.begin)
            self.begin.inner.activates(first.begin)

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        box, hears = graph.add(Box(), name="box"), graph.add(Holds())
        graph.connect(graph.add(numbers(count=WAVES)).out, box.value)
        graph.start.activates(box.begin)
        graph.connect(box.activated, hears.begin)
        graph.connect(box.deactivated, hears.begin)
        return graph

    calls = note_calls(monkeypatch)
    told = []
    for fast in (False, True):
        report = hfg.run(build(), clock="virtual", fast=fast)
        told.append((calls.take()[0], report.nodes, report.edges))
    assert told[0] == told[1]
    assert told[1][1]["holds"].calls == 1


@pytest.mark.slow
@pytest.mark.rule("A3", "A5", "A6", "A9", "A11", "A12", "F9", "G2", "R2", "T4")
@pytest.mark.parametrize("block", range(4))
def test_random_graphs_full_of_activity_do_the_same(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = note_calls(monkeypatch)
    for seed in range(8 * block, 8 * block + 8):
        check(calls, seed, alive_shapes(seed))


SEEN_TO_FAIL = (430, 466, 480, 483, 543, 1093, 1236, 1446)  # places of calls, silence, and waves within waves


@pytest.mark.slow
@pytest.mark.rule("A6", "A9", "A11", "F4", "F8", "F9", "R2")
@pytest.mark.parametrize("seed", SEEN_TO_FAIL)
def test_what_was_wrong_once_is_right(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    check(note_calls(monkeypatch), seed, alive_shapes(seed))


def alive_shapes(seed: int) -> Allowed:
    """Activity everywhere, and now and then what ends a wave."""
    return Allowed(
        plain=True,
        alive=True,
        max_nodes=4 + seed % 9,
        doing=seed % 3 == 0,
        sending=seed % 4 == 1,
        waiting=seed % 5 == 0,
        failures=seed % 3 == 1,
        disabling=seed % 2 == 0,
        lossy=seed % 2 == 0,
    )


class Asks(Looks):
    """Is asked whether it is ready."""

    def ready(self) -> bool:
        return True


class TakesTokens(hfg.Node):
    value = hfg.Input(int)

    def process(self, value: hfg.Token[int]) -> None:
        pass


REASONS: dict[str, tuple[Callable[[], Any], dict[str, Any], str]] = {
    "ready": (Asks, {}, "ready()"),
    "tokens": (TakesTokens, {}, "take values"),
    "retries": (Looks, {"retries": 2}, "retries="),
}


@pytest.mark.parametrize(("make", "options", "reason"), REASONS.values(), ids=REASONS)
def test_a_node_that_is_not_fused_has_a_reason(make: Callable[[], Any], options: dict[str, Any], reason: str) -> None:
    graph, node = hfg.Graph(), make()
    first = graph.add(forward(), name="first")
    graph.connect(graph.add(numbers(count=WAVES)).out, first.value)
    graph.add(node, name="odd", **options)
    graph.connect(first.out, node.value)
    runs: list[hfg.Run] = []
    hfg.run(graph, clock="virtual", begin=runs.append)
    explained = runs[0].explain()
    assert not explained["odd"].fused
    assert reason in explained["odd"].reason
    assert [path for path, one in explained.items() if one.refused] == ["odd"]
    assert explained["first"].members == ("numbers", "first")
    assert runs[0].explain("odd") == {"odd": explained["odd"]}


def test_a_throttled_gate_and_a_run_without_fast_paths_are_named() -> None:
    graph = hfg.Graph()
    nodes = chain(graph, forward(), forward())
    graph.gate(nodes[1], by=graph.add(Holds()), idle_rate_hz=10.0)
    runs: list[hfg.Run] = []
    for fast in (True, False):
        hfg.run(graph, clock="virtual", fast=fast, begin=runs.append)
    assert "idle_rate_hz=" in runs[0].explain()["b"].reason
    assert "fast=False" in runs[1].explain()["a"].reason
    assert not runs[1].explain()["a"].refused
    assert runs[0].explain()["b"] == runs[1].explain()["b"]  # of itself, whatever else the run does


def test_a_glance_says_who_is_fused() -> None:
    graph = hfg.Graph()
    chain(graph, forward(), forward())
    runs: list[hfg.Run] = []
    for fast in (True, False):
        hfg.run(graph, clock="virtual", fast=fast, begin=runs.append)
        fused = {node.path for node in runs[-1].glance().nodes if node.fused}
        assert fused == {path for path, one in runs[-1].explain().items() if one.fused}
        assert bool(fused) == fast

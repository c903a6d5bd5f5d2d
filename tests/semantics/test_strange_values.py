"""What a value does when somebody looks at it, no run depends on: it is at most an error of a node (X1, T1)."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hfg
from hfg.engine.runtime import settings
from hfg.testing import recorder, replay
from tests.support import kinds as nodes
from tests.support.strange import ERRORS, STRANGE, broken, gives

MODES = ("interpreted", "fused", "debug", "threads", "recorded", "tapped", "traced", "iterated", "several")


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FUSE_AFTER", 0)


@hfg.node(outputs=Any)
def same(value: Any) -> Any:
    return value


@hfg.node
def counted(items: Sequence[int]) -> int:
    return len(items)


@hfg.node
def named(items: Mapping[str, int]) -> int:
    return sum(items.values())


@hfg.node
def listed(items: list[tuple[int, str]]) -> int:
    return sum(number for number, _ in items)


@hfg.node
def in_rows(items: NDArray[np.float64]) -> float:
    return float(items[0])


@hfg.node
def more(items: int) -> int:
    return items + 1


@hfg.node
def chosen(items: bool | str) -> str:
    return "yes" if items else "no"


@hfg.node
async def later(items: set[int]) -> int:
    await asyncio.sleep(0)
    return max(items)


class Both(hfg.Node):
    """Gives a value back for two outputs, which mostly does not do."""

    items = hfg.Input(Any)
    one = hfg.Output(Any)
    other = hfg.Output(Any)

    def process(self, items: Any) -> Any:
        return items


class Sends(hfg.Node):
    """Sends and signals it by itself."""

    items = hfg.Input(Any)
    out = hfg.Output(Any)
    said = hfg.Event(Any)

    def process(self, items: Any) -> None:
        self.said.trigger(items)
        self.out.send(items)


class Hears(hfg.Node):
    """Takes it by slots, and tells what became of it."""

    told = hfg.Event(Any)

    @hfg.slot
    def hear(self, value: Any) -> None:
        self.told.trigger(value)

    @hfg.slot
    def number(self, value: int) -> None:
        self.told.trigger(value + 1)


class Scales(hfg.Node):
    """Has parameters that edges set."""

    items = hfg.Input(Any)
    factor = hfg.Parameter(1)
    names = hfg.Parameter([], type=list[str])
    free = hfg.Parameter(None, type=Any)

    def process(self, items: Any) -> None:
        pass


class Each(hfg.Subgraph):
    """One by one."""

    each = hfg.Input(Any)
    given = hfg.Output(Any)
    iterate_over = ("each",)

    def build(self, graph: hfg.Graph) -> None:
        self.each.inner >> graph.add(same()) >> self.given.inner


def strange_graph(what: str, mode: str) -> hfg.Graph:
    """A value on its way through all that a graph consists of."""
    graph = hfg.Graph()
    group: dict[str, Any] = {}
    if mode == "threads":
        graph.group("side", threads=1)
        group = {"group": "side"}
    source = graph.add(gives(what=what), name="source")
    passed = graph.add(same(), name="passed", **group)
    graph.connect(source.out, passed.value)
    consumers: list[Any] = [counted(), named(), listed(), in_rows(), more(), chosen()]
    for consumer in consumers:
        graph.connect(passed.out, graph.add(consumer, on_error="skip", **group).items)
    several: dict[str, Any] = {"concurrency": 2} if mode == "several" else {}
    waits = graph.add(later(), on_error="skip", **several)
    graph.connect(source.out, waits.items)
    both, sends, hears, scales = Both(), Sends(), Hears(), Scales()
    graph.add(both, on_error="skip", **group)
    graph.add(sends, on_error="skip", **group)
    graph.add(hears, on_error="skip")
    graph.add(scales, on_error="skip")
    graph.connect(passed.out, both.items)
    graph.connect(passed.out, sends.items)
    graph.connect(sends.said, hears.hear)
    graph.connect(sends.out, hears.number)
    graph.connect(source.out, scales.items)
    graph.connect(sends.out, scales.ports.parameters["factor"])
    graph.connect(sends.said, scales.ports.parameters["names"])
    graph.connect(both.one, scales.ports.parameters["free"])
    graph.connect(scales.failed, graph.add(nodes.Doubter(), name="doubts").hear)
    graph.connect(hears.told, graph.output("told", Any))
    graph.connect(passed.out, graph.add(nodes.either(), on_error="skip", **group).ports.inputs["first"], buffer=2)
    if mode == "iterated":
        each = graph.add(Each(), on_error="skip")
        graph.connect(source.out, each.each)
        graph.connect(each.given, graph.add(same(), name="behind").value)
    return graph


def run_strange(graph: hfg.Graph, mode: str, folder: Path) -> hfg.Report:
    """Run it in one of the ways there are, with who looks."""
    taps: list[Any] = []

    def begin(run: hfg.Run) -> None:
        if mode == "recorded":
            run.record(folder / "run.mcap", lossless=False)
        if mode == "tapped":
            edges: Any = run._engine.core.edges
            taps.extend(run.tap(edge) for edge in edges)
            run.statistics()

    trace = recorder() if mode == "traced" else None
    report = hfg.run(
        graph, clock="virtual", fast=mode != "interpreted", debug=mode == "debug", trace=trace, begin=begin
    )
    if trace is not None:
        replay(graph, trace)
    return report


@pytest.mark.slow
@pytest.mark.rule("X1", "F3", "P8")
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("what", STRANGE)
def test_a_value_that_nobody_can_look_at_is_at_most_an_error_of_a_node(what: str, mode: str, tmp_path: Path) -> None:
    report = run_strange(strange_graph(what, mode), mode, tmp_path)
    assert report.outcome == "done"
    assert report.nodes["passed"].firings == 4
    assert str(report)


def failing_graph(how: str, mode: str) -> hfg.Graph:
    """A node that fails, in a thread or on the loop."""
    graph = hfg.Graph()
    group: dict[str, Any] = {}
    if mode == "threads":
        graph.group("side", threads=1)
        group = {"group": "side"}
    source, fails = graph.add(nodes.script()), graph.add(broken(how=how), name="fails", on_error="skip", **group)
    graph.connect(source.out, fails.value)
    graph.connect(fails.out, graph.add(nodes.sink(), name="behind").value)
    return graph


@pytest.mark.rule("X1")
@pytest.mark.parametrize("mode", ["interpreted", "fused", "debug", "threads"])
@pytest.mark.parametrize("how", [how for how, make in ERRORS.items() if isinstance(make(), Exception)])
def test_an_error_of_a_strange_kind_is_one_of_the_node_that_raised_it(how: str, mode: str, tmp_path: Path) -> None:
    report = run_strange(failing_graph(how, mode), mode, tmp_path)
    assert report.outcome == "done"
    assert report.nodes["fails"].failed == 3
    assert report.nodes["behind"].silent == 3


@pytest.mark.rule("X1")
@pytest.mark.parametrize("mode", ["interpreted", "fused", "debug", "threads"])
@pytest.mark.parametrize("how", [how for how, make in ERRORS.items() if not isinstance(make(), Exception)])
def test_what_ends_a_task_or_the_program_ends_the_run_and_names_the_node(how: str, mode: str, tmp_path: Path) -> None:
    with pytest.raises(hfg.errors.NodeError, match='node "fails" failed'):
        run_strange(failing_graph(how, mode), mode, tmp_path)

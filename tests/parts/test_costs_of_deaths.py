"""What a death costs is known before the run, for each connected part of each group (rule L2)."""

from __future__ import annotations

import asyncio
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.cli.table import View
from hfg.engine.observing.glance import Glance
from hfg.graph.flat import cut, flatten
from hfg.parts.model.components import components
from hfg.parts.model.costs import costs_of_deaths
from hfg.parts.processes import launching
from hfg_transports.memory import Faults, Network
from tests.parts.test_deaths import Killer, at, killed, numbers, pair, relay
from tests.parts.test_losses_at_random import Hearing, Telling, origins, passing

__all__ = ["killed"]

TWO_CHAINS = """
import hfg
from collections.abc import Iterator


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    yield from range(count)


@hfg.node
def slow(x: int) -> int:
    return x


def graph() -> hfg.Graph:
    graph = hfg.Graph("two")
    graph.group("p", process=True)
    source = graph.add(numbers())
    for name in ("a", "b"):
        node = graph.add(slow(), name=name, group="p")
        graph.connect(source.out, node.x)
        graph.connect(node.out, graph.output(f"{name}_out", int), active=name == "b")
    return graph
"""


def two_chains(**options: Any) -> hfg.Graph:
    """Two chains in one group, one of which can be switched off, and a join behind both."""
    graph = hfg.Graph()
    graph.group("both", process=True, **options)
    source, join = graph.add(numbers(count=40)), graph.add(pair())
    for name, port in (("plain", join.a), ("switched", join.b)):
        node = graph.add(relay(), name=name, group="both")
        graph.connect(source.out, node.value)
        graph.connect(node.out, port)
    graph.connect(join.out, graph.output("out", tuple[int, int]))
    graph.connect(graph.start, graph["switched"].enable)
    return graph


@pytest.mark.rule("L2")
def test_each_connected_part_of_a_group_has_its_own_cost() -> None:
    plain, switched = components(cut(flatten(two_chains())))["both"]
    assert (plain.nodes, plain.cost) == (("plain",), "nothing")
    assert (switched.nodes, switched.cost, switched.joined) == (("switched",), "unknown", "pair")
    assert switched.uncertain == '"switched" may be disabled while it runs'
    first, second = costs_of_deaths(two_chains())
    assert first.what == "a death costs nothing"
    assert 'it ends the run because "pair" would pair tokens that do not belong together' in second.what
    assert "ledger=True" in second.remedy


@pytest.mark.rule("L2")
def test_a_death_after_which_a_join_would_be_torn_ends_the_run_with_a_sentence(killed: Any) -> None:
    killed(at(0.03, "both"))
    with pytest.raises(
        hfg.errors.RunError, match=r'"pair" would pair tokens that do not belong together.*may_misalign=True'
    ):
        hfg.run(two_chains(), clock="virtual", until_s=30.0)


@pytest.mark.rule("L2")
def test_a_group_that_may_misalign_goes_on(killed: Any) -> None:
    made: list[Killer] = killed(at(0.03, "both"))
    assert hfg.run(two_chains(may_misalign=True), clock="virtual", until_s=30.0).outcome == "done"
    assert made[0].lives == {"both": 2}


def into_a_ledger(*, joins: bool, **options: Any) -> hfg.Graph:
    """A group of which tokens may be lost, and one behind it with a ledger."""
    graph = hfg.Graph()
    graph.group("loses", process=True, **options)
    graph.group("keeps", process=True, ledger=True)
    source = graph.add(numbers(count=40))
    first, then = (graph.add(passing(takes_s=0.01), name=name, group="loses") for name in ("first", "then"))
    graph.start.activates(first.activate)
    graph.connect(source.out, first.value)
    graph.connect(first.out, then.value, active=True)
    last: hfg.Node
    if joins:
        last = graph.add(pair(), group="keeps")
        graph.connect(then.out, last.a)
        graph.connect(source.out, last.b)
    else:
        last = graph.add(relay(), name="last", group="keeps")
        graph.connect(then.out, last.value)
    graph.connect(last.out, graph.output("out", Any))
    return graph


@pytest.mark.rule("L2")
def test_check_knows_that_a_ledger_does_not_count_what_is_lost_before_it() -> None:
    joined, *_ = costs_of_deaths(into_a_ledger(joins=True))
    assert 'it ends the run because "pair" would pair tokens that do not belong together' in joined.what
    assert (
        joined.why
        == '"then.out -> pair.a" leads to group "keeps", whose ledger knows the tokens that have arrived but '
        "not the lost ones"
    )
    alone, *_ = costs_of_deaths(into_a_ledger(joins=False))
    assert alone.what == "a death costs an unknown number of tokens"


@pytest.mark.rule("L2")
def test_a_join_behind_a_ledger_is_not_torn_by_a_death_before_it(killed: Any) -> None:
    killed(at(0.03, "loses"))
    with pytest.raises(hfg.errors.RunError, match=r'"pair" would pair tokens that do not belong together'):
        hfg.run(into_a_ledger(joins=True), clock="virtual", until_s=30.0)


@pytest.mark.rule("L2")
@pytest.mark.parametrize(("seed", "lost"), [(2, 2), (10, 4)])
def test_what_is_lost_before_a_ledger_is_counted_and_the_run_ends(
    monkeypatch: pytest.MonkeyPatch, seed: int, lost: int
) -> None:
    class Made(launching.LoopLauncher):
        def __init__(self) -> None:
            super().__init__(network=Network(Faults(loss=0.2, repetition=0.1, delay_s=(0.001, 0.003)), seed=seed))

        async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> Any:
            launched = await super().launch(run, part, host, incarnations)
            if part == "loses" and incarnations[0] == 1:
                asyncio.get_running_loop().call_later(0.0537 + 0.0113 * seed, launched.kill)
            return launched

    monkeypatch.setattr(launching, "LoopLauncher", Made)
    graph = hfg.Graph()
    graph.group("loses", process=True)
    graph.group("keeps", process=True, ledger=True)
    source, first = graph.add(origins()), graph.add(passing(takes_s=0.01), name="first", group="loses")
    tells, hears = graph.add(Telling(), group="loses"), graph.add(Hearing(), group="loses")
    last = graph.add(passing(), name="last", group="keeps")
    graph.connect(source.out, first.value)
    graph.connect(first.out, tells.value)
    graph.connect(tells.said, hears.hear)
    graph.connect(tells.out, last.value)
    graph.connect(last.out, graph.output("out", int))
    report = hfg.run(graph, clock="virtual", until_s=60.0)
    assert report.outcome == "done"
    assert report.edges["telling.out -> last.value"].lost == 40 - len(report.outputs["out"]) == lost


@pytest.mark.slow
@pytest.mark.rule("L2")
def test_check_says_what_a_death_costs(tmp_path: Path) -> None:
    (tmp_path / "two.py").write_text(TWO_CHAINS)
    command = [sys.executable, "-m", "hfg", "check", "two.py:graph"]
    text = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert 'group "p": a: a death costs nothing' in text
    assert 'group "p": b: a death costs what was taken and not passed on' in text
    assert "give the group ledger=True" in text
    told = json.loads(subprocess.run([*command, "--json"], cwd=tmp_path, capture_output=True, check=True).stdout)
    assert [one["path"] for one in told if one["check"] == "cost-of-death"] == ['group "p": a', 'group "p": b']


def test_whoever_reads_of_a_promise_about_deaths_finds_its_test() -> None:
    root = Path(__file__).parents[2]
    section = (root / "docs/links.md").read_text("utf-8").partition("## Promises about deaths")[2]
    rows = re.findall(r"^\| (?!promise|---)(.+?) \| `(.+?)::(.+?)` \|$", section, re.MULTILINE)
    assert len(rows) > 10
    for promise, file, name in rows:
        assert f"def {name}(" in (root / file).read_text("utf-8"), f"nothing tests that {promise}"


def test_may_misalign_is_said_of_a_group_with_a_process() -> None:
    with pytest.raises(hfg.errors.GraphError, match="with process=True"):
        hfg.Graph().group("g", may_misalign=True)


@pytest.mark.rule("L2")
def test_top_says_how_many_tokens_are_lost_with_processes() -> None:
    view = View()
    view.look(Glance("g", "running", 1.0, 1.0, [], lost=3))
    assert "3 tokens lost with processes" in "\n".join(view.lines(100, 10))

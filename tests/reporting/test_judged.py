"""A page shows what a run had to keep to: monitors with the stretches that violate them, and budgets used."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path

import hfg
from hfg import monitors as m


@hfg.node
def ticks() -> Iterator[int]:
    yield from range(5)


@hfg.node
async def slowly(number: int) -> int:
    await asyncio.sleep(0.3)
    return number


@hfg.node
def last(number: int) -> None: ...


def page(tmp_path: Path, graph: hfg.Graph, **watched: m.Property) -> str:
    file = tmp_path / "run.html"

    def begin(run: hfg.Run) -> None:
        run.report_page(file)
        if watched:
            m.watch(run, on_violation="note", **watched)

    hfg.run(graph, clock="virtual", begin=begin)
    return file.read_text()


def late() -> hfg.Graph:
    graph = hfg.Graph("late")
    source, slow = graph.add(ticks(), max_rate_hz=1), graph.add(slowly(), deadline_s=0.2)
    graph.connect(source.out, slow.number)
    graph.connect(slow.out, graph.add(last()).number, deadline_s=0.6)
    return graph


def test_each_monitor_has_its_verdict_a_line_over_the_run_and_the_stretch_of_each_violation(tmp_path: Path) -> None:
    graph = late()
    graph.monitor("<few>", "never(sent(ticks.out, value == 2))")
    text = page(tmp_path, graph, all=m.always(m.fired("last") | ~m.fired("last")))
    assert '<h3>&lt;few&gt;: <span class="bad">violated</span></h3>' in text
    assert '<rect class="bad" x="400.0" width="2" height="12"/>' in text  # 2 s of 5 s
    assert '<figure class="violation" data-time="2.000000">' in text
    assert "<pre>0 s  ticks.out  0\n1 s  ticks.out  1\n2 s  ticks.out  2</pre>" in text
    assert '<h3>all: <span class="good">holds</span></h3>' in text


def test_of_many_violations_the_first_are_shown_and_the_others_counted(tmp_path: Path) -> None:
    graph = late()
    graph.group("loop")
    text = page(tmp_path, graph, **{f"low_{number}": m.never(m.sent("slowly.out")) for number in range(2)})
    assert text.count("violated, 5 times") == 0  # what stays violated is violated once
    assert text.count('<figure class="violation"') == 2


def test_each_deadline_has_a_bar_of_the_share_that_was_used(tmp_path: Path) -> None:
    text = page(tmp_path, late())
    assert "<td>slowly</td><td>the node</td>" in text
    assert '<td class="number" data-by="0.2">0.2 s</td>' in text
    assert ">0.3 s</td>" in text
    assert 'aria-label="150% of the deadline"' in text
    assert "<td>last</td><td>slowly.out -&gt; last.number</td>" in text
    assert '<rect class="good" width="50.0" height="12"/>' in text


def test_a_run_that_nothing_was_asked_of_has_neither_section(tmp_path: Path) -> None:
    graph = hfg.Graph("free")
    graph.connect(graph.add(ticks()).out, graph.add(last()).number)
    text = page(tmp_path, graph)
    assert 'id="monitors"' not in text
    assert 'id="deadlines"' not in text

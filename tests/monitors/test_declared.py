"""Monitors are a part of a graph: declared, saved, edited and checked, and each run is judged by them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg import monitors as m
from hfg.errors import CheckFailed, FileError, GraphError, MonitorViolated, UsageError
from hfg.files import build, describe, text_of
from hfg.files.building import load
from tests.monitors.test_watching import chain, lit, sink, ticks


def texts(graph: hfg.Graph) -> dict[str, str]:
    return {name: str(spec.property) for name, spec in graph.monitors.items()}


halted: list[str] = []


class Halt(hfg.Node):
    """Keeps what it was given."""

    @hfg.slot
    def halt(self, why: str) -> None:
        halted.append(why)


def watched(graph: hfg.Graph, **options: Any) -> tuple[hfg.Report, m.Monitors]:
    found: list[m.Monitors] = []
    report = hfg.run(graph, clock="virtual", begin=lambda run: found.append(m.declared(run)), **options)
    return report, found[0]


def test_each_run_is_judged_by_the_monitors_of_its_graph() -> None:
    graph = lit()
    graph.monitor("dark", "never(active(box) & sent(ticks.out, value == 4))")
    graph.monitor("ends", m.eventually(m.sent("ticks.out", lambda number: number == 9)))
    for _ in range(2):
        report, found = watched(graph)
        assert found.verdicts == {"dark": m.Verdict.VIOLATED, "ends": m.Verdict.HOLDS}
        assert [violation.after_s for violation in found.violations] == [4.0]
        assert report.outcome == "done"
        assert len(report.errors) == 1
        assert report.errors[0].startswith('monitor "dark" is violated after 4 s: never(active(box) & ')


def test_a_monitor_that_is_violated_often_is_one_error_that_says_how_often() -> None:
    graph = chain(count=1000)
    graph.monitor("even", "never(sent(ticks.out, value.real == 3) | sent(double.out))")
    report, found = watched(graph)
    assert found.counts == {"even": 999}
    assert len(found.violations) == 100
    assert [error.rpartition("\n")[2] for error in report.errors] == ["(and 998 more of this monitor)"]


def test_a_violation_can_end_the_run() -> None:
    graph = chain()
    graph.monitor("few", "never(sent(ticks.out, value == 4))", on_violation="fail")
    with pytest.raises(MonitorViolated) as caught:
        hfg.run(graph, clock="virtual")
    assert caught.value.report.outcome == "failed"  # type: ignore[attr-defined]
    assert caught.value.report.nodes["ticks"].firings == 5  # type: ignore[attr-defined]


@pytest.mark.rule("F8", "A7")
def test_a_violation_triggers_a_slot_with_its_text_and_an_event_of_another_type_with_nothing() -> None:
    graph = lit()
    halted.clear()
    graph.add(Halt())
    graph.monitor("few", "never(sent(ticks.out, value == 4))", triggers="halt.halt")
    graph.monitor("late", "never(sent(ticks.out, value == 6))", triggers="light.on")
    graph.monitor("dark", "never(active(box) & sent(ticks.out, value == 7))", triggers="box/state.begin")
    watched(graph)
    assert [str(text).partition(":")[0] for text in halted] == ['monitor "few" is violated after 4 s']


def test_monitors_are_in_the_file_of_a_graph_and_in_its_commands() -> None:
    graph = lit()
    graph.monitor("dark", "never(active(box))")
    graph.monitor("few", m.never(m.sent("ticks.out", "value > 4")), on_violation="fail")
    text = text_of(describe(graph))
    assert (
        "monitors:\n"
        "  dark: never(active(box))\n"
        "  few:\n"
        "    property: never(sent(ticks.out, value > 4))\n"
        "    on_violation: fail\n"
    ) in text
    loaded = build(describe(graph))
    assert loaded.monitors == graph.monitors
    made = hfg.Graph("chain")
    made.edit(*(c.decode(c.encode(graph.as_commands()))))
    assert made.monitors == graph.monitors


def test_a_condition_that_is_code_cannot_be_saved() -> None:
    graph = chain()
    graph.monitor("few", m.never(m.sent("ticks.out", lambda number: number > 4)))
    with pytest.raises(FileError, match='its condition at "ticks.out" is code; write it as text'):
        describe(graph)


def test_a_file_with_a_malformed_monitor_is_refused_with_its_line(tmp_path: Any) -> None:
    file = tmp_path / "a.hfg.yaml"
    file.write_text("hfg: 1\nname: a\nmonitors:\n  dark: never(actve(drive))\n")
    with pytest.raises(FileError) as caught:
        load(file)
    said = str(caught.value)
    assert 'a.hfg.yaml:4: monitor "dark": line 1, column 7: a formula is expected, got "actve"' in said


@pytest.mark.rule("R4", "G1")
def test_monitors_follow_nodes_that_get_other_paths_and_undo_takes_that_back() -> None:
    graph = lit()
    graph.monitor("dark", "never(active(box/state) & sent(ticks.out, value == 4))", triggers="box/state.begin")
    before = texts(graph)
    graph.edit(c.Rename("box", "lamp"), c.Rename("ticks", "clock"))
    assert texts(graph) == {"dark": "never(active(lamp/state) & sent(clock.out, value == 4))"}
    assert graph.monitors["dark"].triggers == "lamp/state.begin"
    graph.edit(c.Enclose(("clock", "double"), "source"))
    assert texts(graph) == {"dark": "never(active(lamp/state) & sent(source/clock.out, value == 4))"}
    graph.edit(c.Dissolve("source"))
    assert texts(graph) == {"dark": "never(active(lamp/state) & sent(clock.out, value == 4))"}
    for _ in range(3):
        graph.undo()
    assert texts(graph) == before
    assert watched(graph)[1].verdicts == {"dark": m.Verdict.VIOLATED}


def test_commands_set_and_remove_monitors() -> None:
    graph = chain()
    graph.edit(c.SetMonitor("few", "never(sent(ticks.out, value == 4))"))
    graph.edit(c.SetMonitor("few", "never(sent(ticks.out, value == 5))"))
    assert texts(graph) == {"few": "never(sent(ticks.out, value == 5))"}
    graph.edit(c.RemoveMonitor("few"))
    assert not graph.monitors
    graph.undo()
    assert list(graph.monitors) == ["few"]
    with pytest.raises(GraphError, match='there is no monitor "fw"; did you mean "few"'):
        graph.edit(c.RemoveMonitor("fw"))
    with pytest.raises(GraphError, match='would break the graph.*there is no "tick.out"'):
        graph.edit(c.SetMonitor("few", "never(sent(tick.out))"))


@pytest.mark.rule("R4")
def test_a_running_graph_follows_edits_of_its_monitors() -> None:
    graph = chain()

    async def main() -> m.Monitors:
        async with hfg.running(graph) as run:
            await asyncio.sleep(2.5)
            await run.edit(c.SetMonitor("few", "never(sent(ticks.out, value == 4 | value == 1))"))
            await asyncio.sleep(3)
            await run.edit(c.Rename("ticks", "clock"), c.SetMonitor("late", "never(sent(clock.out, value == 8))"))
            await asyncio.sleep(1)
            await run.edit(c.RemoveMonitor("few"))
            await run.wait_finished()
            return m.declared(run)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        found = runner.run(main())
    assert [(one.monitor, one.stretch[-1].value) for one in found.violations] == [("few", 4), ("late", 8)]
    assert list(found.verdicts) == ["late"]


@pytest.mark.parametrize(
    ("property_", "options", "sentence"),
    [
        ("never(active(drive))", {}, 'at "monitors.it": there is no "drive": graph "chain" has no node "drive"'),
        ("never(sent(numbers))", {}, '"numbers" is a port of the whole graph: name the port of a node'),
        ("never(sent(ticks))", {}, '"ticks" is a node: sent() takes a port'),
        ("never(active(ticks.out))", {}, '"ticks.out" is no node'),
        ("never(fired(sink))", {"triggers": "double.number"}, "is neither a slot nor an event"),
        ("never(fired(sink))", {"triggers": "halt.number"}, "cannot be given a text, which says what was violated"),
    ],
)
def test_the_check_finds_monitors_that_cannot_judge(property_: str, options: Any, sentence: str) -> None:
    class Take(hfg.Node):
        @hfg.slot
        def number(self, number: int) -> None: ...

    graph = chain()
    graph.add(Take(), name="halt")
    graph.input("numbers", int)
    graph.monitor("it", property_, **options)
    assert sentence in "\n".join(map(str, graph.check()))
    with pytest.raises(CheckFailed):
        hfg.run(graph, clock="virtual")


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda graph: graph.monitor("it", m.active("ticks")), 'monitor "it" needs a property'),
        (lambda graph: graph.monitor("", "never(active(a))"), "a monitor needs a name"),
        (
            lambda graph: graph.monitor("it", "never(active(a))", on_violation="shout"),
            'on_violation must be one of "note"',
        ),
        (lambda graph: graph.monitor("it", "never(active(a))", on_violaton="fail"), 'did you mean "on_violation"?'),
        (lambda graph: graph.monitor("it", "never(active(a)"), 'monitor "it": line 1, column 16'),
        (lambda graph: [graph.monitor("it", f"never(active({one}))") for one in "ab"], "declared already"),
    ],
)
def test_what_cannot_be_declared_is_refused_and_changes_nothing(
    make: Callable[[hfg.Graph], object], sentence: str
) -> None:
    graph = chain()
    with pytest.raises(GraphError) as caught:
        make(graph)
    assert sentence in str(caught.value)
    assert len(graph.monitors) < 2


def test_a_graph_without_monitors_says_how_to_declare_one() -> None:
    with pytest.raises(UsageError, match="declares no monitor: write graph.monitor"):
        watched(chain())


def test_a_library_of_boxes_declares_monitors_once() -> None:
    """Declaring the same again is allowed, as subgraphs of one type do."""
    graph = chain()
    for _ in range(2):
        graph.monitor("few", "never(sent(ticks.out, value == 4))")
    assert list(graph.monitors) == ["few"]


@pytest.mark.parametrize("format_", ["svg", "mmd", "dot"])
def test_a_drawing_shows_the_monitors_at_the_nodes_that_they_name(format_: Any) -> None:
    graph = lit()
    assert "monitor dark" not in graph.draw(format=format_)
    graph.monitor("dark", "never(active(box/state) & sent(ticks.out, value == 4))")
    assert graph.draw(format=format_, depth=5).count("monitor dark") in (2, 4)  # in an SVG in the tooltips, too


@hfg.node
async def slowly(number: int) -> int:
    """The longer, the larger the number."""
    await asyncio.sleep(number / 10)
    return number


@pytest.mark.rule("T5")
def test_a_deadline_from_a_source_is_a_monitor_of_the_age_of_its_tokens() -> None:
    graph = hfg.Graph("late")
    source, work = graph.add(ticks(), max_rate_hz=1), graph.add(slowly())
    graph.connect(source.out, work.number)
    graph.connect(work.out, graph.add(sink()).number)
    graph.monitor("fast", "never(sent(sink.number, older_than_s=0.5))")
    graph.monitor("small", "never(sent(sink.number, value < 8, older_than_s=0.6))")
    _, found = watched(graph)
    assert [(one.monitor, one.stretch[-1].value) for one in found.violations] == [("fast", 6), ("small", 7)]
    assert build(describe(graph)).monitors == graph.monitors

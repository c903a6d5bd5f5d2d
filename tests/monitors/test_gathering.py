"""Monitors over several parts of a run judge as they do over one, and say what they cannot know."""

from __future__ import annotations

import asyncio
import random
from collections.abc import AsyncIterator
from typing import Any

import pytest

import hfg
from hfg import commands
from hfg import monitors as m
from hfg.errors import GraphError, MonitorViolated, UsageError
from hfg.monitors import Property, Verdict, gathering
from hfg.parts.processes import launching
from hfg_transports.memory import Faults, Network
from tests.monitors.slow import random_formula
from tests.monitors.test_declared import Halt, halted
from tests.monitors.test_watching import Light, State, chain, double, lit, sink, ticks
from tests.parts.mortal import mortal_parts

RUNS: list[hfg.Run] = []
LATER: list[m.Monitors] = []


class Begin(hfg.Node):
    """Begins to watch while the graph runs."""

    number = hfg.Input(int)

    def process(self, number: int) -> None:
        if number == 3:
            both = m.never(m.active("box") & m.sent("ticks.out"))
            LATER.append(m.watch(RUNS[-1], both=both))


def cut(graph: hfg.Graph, **groups: list[str]) -> hfg.Graph:
    """Put nodes into processes, by the name of the group."""
    for name, nodes in groups.items():
        graph.group(name, process=True)
        for node in nodes:
            graph.move(node, group=name)
    return graph


def found(graph: hfg.Graph, *, clock: Any = "virtual", **options: Any) -> tuple[m.Monitors, hfg.Report]:
    """Run a graph, and return what the monitors have found that it declares."""
    runs: list[hfg.Run] = []
    report = hfg.run(graph, clock=clock, begin=runs.append, **options)
    return m.declared(runs[0]), report


@pytest.mark.rule("L1")
def test_a_monitor_over_three_processes_judges_in_the_order_of_the_runs_clock() -> None:
    graph = cut(chain(), far=["double"], farther=["sink"])
    graph.monitor("in_order", "precedes(sent(ticks.out, value == 4), sent(double.out, value == 8))")
    graph.monitor("reversed", "precedes(fired(sink), sent(double.out, value == 0))")
    graph.monitor("answered", "leads_to(sent(ticks.out), fired(sink), within_s=0.5)")
    monitors, report = found(graph)
    assert monitors.verdicts == {
        "in_order": Verdict.HOLDS,
        "reversed": Verdict.VIOLATED,
        "answered": Verdict.VIOLATED,
    }  # of ten ticks one is silent
    assert [(one.monitor, round(one.after_s, 6)) for one in monitors.violations] == [
        ("reversed", 0.0),
        ("answered", 3.5),
    ]
    stretch = [(seen.what, seen.value) for seen in monitors.violations[0].stretch]
    assert stretch == [("double.out", 0)]
    assert [error[:24] for error in report.errors] == ['monitor "reversed" is vi', 'monitor "answered" is vi']


@pytest.mark.rule("R5")
def test_a_violation_over_two_processes_triggers_a_slot_in_a_third_before_the_run_ends() -> None:
    graph = chain()
    graph.add(Halt(), name="halt")
    cut(graph, far=["double"], third=["halt"])
    halted.clear()
    graph.monitor("last", "never(sent(double.out, value == 18) & once(sent(ticks.out)))", triggers="halt.halt")
    _, report = found(graph)
    assert [text.partition(":")[0] for text in halted] == ['monitor "last" is violated after 9 s']
    assert report.outcome == "done"


@pytest.mark.parametrize("number", [4, 18])
def test_a_violation_over_two_processes_can_end_the_run_also_at_its_very_end(number: int) -> None:
    graph = cut(chain(), far=["double"])
    text = f"never(sent(double.out, value == {number}) & once(sent(ticks.out)))"
    graph.monitor("few", text, on_violation="fail")
    with pytest.raises(MonitorViolated, match='monitor "few" is violated after'):
        hfg.run(graph, clock="virtual")


class Slow(launching.LoopLauncher):
    """All that processes say to each other takes 20 ms."""

    def __init__(self) -> None:
        super().__init__(network=Network(Faults(delay_s=(0.02, 0.02)), seed=1))


def test_a_process_that_does_not_answer_ends_the_monitor_before_too_many_points_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(launching, "LoopLauncher", Slow)
    monkeypatch.setattr(gathering, "_MOST_WAITING", 5)
    graph = cut(chain(rate_hz=1000.0), far=["sink"])
    graph.monitor("few", "never(sent(ticks.out) & fired(ticks) & sent(double.out) & fired(double) & fired(sink))")
    monitors, report = found(graph)
    assert monitors.verdicts == {"few": Verdict.UNKNOWN}
    assert '5 points have come while the process of group "far" has not answered; nothing more' in report.errors[0]


def test_a_violation_that_is_told_when_the_time_is_up_fails_the_run_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(launching, "LoopLauncher", Slow)
    graph = cut(chain(), far=["double"])
    graph.monitor("few", "never(sent(double.out, value == 8) & once(sent(ticks.out)))", on_violation="fail")
    with pytest.raises(MonitorViolated) as caught:
        hfg.run(graph, clock="virtual", until_s=4.03)
    report = caught.value.report  # type: ignore[attr-defined]
    assert report.outcome == "failed"
    assert 4.10 < report.duration_s < 4.12  # 8 is sent after 4.10 s, and told after 4.12 s


def test_monitors_of_one_run_watch_other_processes_too_and_know_what_is_active_there() -> None:
    graph = cut(lit(), far=["box"], farther=["double"])
    monitors: list[m.Monitors] = []
    dark = m.never(m.active("box") & m.sent("ticks.out", lambda number: number == 4))
    hfg.run(graph, clock="virtual", begin=lambda run: monitors.append(m.watch(run, dark=dark)))
    assert [(one.monitor, one.after_s) for one in monitors[0].violations] == [("dark", 4.0)]
    with pytest.raises(MonitorViolated):
        monitors[0].check()


def test_a_monitor_that_begins_later_learns_what_is_active_in_other_processes() -> None:
    graph = cut(lit(), far=["box"])
    graph.connect(graph["ticks"].out, graph.add(Begin(), name="begin").number)
    hfg.run(graph, clock="virtual", begin=RUNS.append)
    assert LATER[-1].counts == {"both": 1}
    assert LATER[-1].violations[0].after_s == 1.0


@pytest.mark.rule("R4")
def test_monitors_over_processes_come_and_go_by_edits_of_the_running_graph() -> None:
    graph = cut(chain(), far=["double"])
    graph.monitor("few", "never(sent(double.out, value == 99) & once(sent(ticks.out)))")

    async def main() -> None:
        async with hfg.running(graph) as run:
            await asyncio.sleep(2.5)
            text = "precedes(sent(ticks.out, value == 99), sent(double.out, value == 8))"
            await run.edit(commands.SetMonitor("late", text))
            await asyncio.sleep(4)
            monitors = m.declared(run)
            assert monitors.verdicts == {"few": Verdict.HOLDS, "late": Verdict.VIOLATED}
            await run.edit(commands.RemoveMonitor("late"))
            assert monitors.verdicts == {"few": Verdict.HOLDS}
            await run.undo()
            assert monitors.verdicts == {"few": Verdict.HOLDS, "late": Verdict.HOLDS}  # it starts over

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        (
            m.never(m.sent("double.out", lambda number: number > 9)),
            'the condition at "double.out" is code, and the process of group "far" needs it: write it as text',
        ),
        (m.measured(m.never(m.sent("double.out", "value > 9"))), 'is measured, but of the process of group "far" only'),
        (m.never(m.active("duble")), 'no node "duble"'),
    ],
)
def test_what_cannot_be_watched_elsewhere_is_refused(what: Property, sentence: str) -> None:
    graph = cut(chain(), far=["double"])
    with pytest.raises((UsageError, GraphError)) as caught:
        hfg.run(graph, clock="virtual", begin=lambda run: m.watch(run, few=what))
    assert sentence in str(caught.value)


def test_a_condition_that_raises_elsewhere_ends_its_monitor() -> None:
    graph = cut(chain(), far=["double"])
    graph.monitor("odd", "never(sent(double.out, value.vx > 3))")
    monitors, report = found(graph)
    assert monitors.verdicts == {"odd": Verdict.UNKNOWN}
    assert report.errors[0].startswith('monitor "odd" is not known since 0 s: its condition raised ')
    with pytest.raises(MonitorViolated, match="nothing more is judged"):
        monitors.check()


# --- what is lost with a process --------------------------------------------------------------------------------------


def killed_at(graph: hfg.Graph, parts: dict[str, Any], after_s: float) -> tuple[m.Monitors, hfg.Report]:
    runs: list[hfg.Run] = []

    async def kill() -> None:
        await asyncio.sleep(after_s)
        parts["far"].kill()

    async def main() -> hfg.Report:
        killing: list[asyncio.Task[None]] = []

        def begin(run: hfg.Run) -> None:
            runs.append(run)
            killing.append(asyncio.create_task(kill()))

        return await hfg.run_async(graph, begin=begin)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        report = runner.run(main())
    return m.declared(runs[0]), report


@pytest.mark.rule("L3")
def test_after_the_death_of_a_process_no_monitor_that_looked_there_says_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = cut(chain(), far=["double"])
    graph.monitor("near", "never(sent(ticks.out, value == 99))")
    graph.monitor("order", "precedes(sent(ticks.out), sent(double.out))")  # remembers, so it is over
    graph.monitor("small", "never(sent(double.out, value == 99))")
    graph.monitor("eight", "never(sent(double.out, value == 16))")  # violated after the death
    graph.monitor("four", "never(once(sent(double.out, value == 4)))")  # violated before
    monitors, report = killed_at(graph, mortal_parts(monkeypatch), 4.5)
    assert monitors.verdicts == {
        "near": Verdict.HOLDS,
        "order": Verdict.UNKNOWN,
        "small": Verdict.UNKNOWN,
        "eight": Verdict.VIOLATED,
        "four": Verdict.VIOLATED,
    }
    gaps = [error for error in report.errors if "is not known since" in error]
    assert [error.split()[1] for error in gaps] == ['"order"', '"small"', '"eight"', '"four"']
    assert all("since 4." in error and 'the process of group "far" is gone' in error for error in gaps)
    assert ["nothing more is judged" in error for error in gaps] == [True, False, False, True]


@pytest.mark.slow
@pytest.mark.rule("L1", "L3")
def test_monitors_over_real_processes_find_what_they_find_in_one() -> None:
    graph = cut(chain(count=40, rate_hz=100.0), far=["double"], farther=["sink"])
    graph.monitor("order", "precedes(sent(ticks.out, value == 4), sent(double.out, value == 8))")
    graph.monitor("reversed", "precedes(fired(sink), sent(double.out, value == 0))")
    graph.monitor("answered", "leads_to(sent(double.out), fired(sink), within_s=5)")
    graph.monitor("few", "never(at_least(20, fired(sink)) & once(sent(double.out, value == 2)))")
    monitors, report = found(graph, clock="real")
    assert monitors.verdicts == {
        "order": Verdict.HOLDS,
        "reversed": Verdict.VIOLATED,
        "answered": Verdict.HOLDS,
        "few": Verdict.VIOLATED,
    }
    assert monitors.counts == {"reversed": 1, "few": 1}
    assert len(report.errors) == 2


# --- as in one piece --------------------------------------------------------------------------------------------------

ATOMS = [
    *(m.sent(port) for port in ("a.out", "double.out", "b.out", "light.on", "light.off")),
    m.sent("a.out", "value > 5"),
    m.sent("double.out", "value == 4 | value == 12"),
    m.fired("sink"),
    m.active("state"),
]
NODES = ["a", "double", "sink", "b", "light", "state"]


@hfg.node
async def later() -> AsyncIterator[int]:
    """Count from 0, at no moment of the other source."""
    for number in range(10):
        await asyncio.sleep(0.7719)
        yield number


def two_chains() -> hfg.Graph:
    """Two chains, of which nothing happens at one moment; what happens at one moment on a chain has one order."""
    graph = hfg.Graph("two")
    a, b = graph.add(ticks(), name="a", max_rate_hz=1.0), graph.add(later(), name="b")
    graph.connect(a.out, graph.add(double(), name="double").number)
    graph.connect(graph["double"].out, graph.add(sink(), name="sink").number)
    light, state = graph.add(Light(), name="light"), graph.add(State(), name="state")
    graph.connect(b.out, light.number)
    graph.connect(light.on, state.activate)
    graph.connect(light.off, state.deactivate)
    return graph


def random_property(rng: random.Random) -> Property:
    one, other = random_formula(rng, 2, ATOMS), random_formula(rng, 2, ATOMS)
    within_s = rng.choice([0.5, 1.3, 3.1])
    return rng.choice(
        [
            m.always(one),
            m.precedes(one, other),
            m.leads_to(one, other, within_s=within_s),
            m.eventually(one, within_s=within_s),
            m.until(one, other, within_s=within_s),
        ]
    )


def cut_at_random(rng: random.Random, properties: dict[str, Property]) -> hfg.Graph:
    graph = two_chains()
    places: dict[str, list[str]] = {}
    for node in NODES:
        places.setdefault(rng.choice(["", "one", "two", "three"]), []).append(node)
    places.pop("", None)
    for name, what in properties.items():
        graph.monitor(name, str(what))
    return cut(graph, **places)


def said(monitors: m.Monitors) -> Any:
    """All that monitors have found, whose order at one moment is that of their names."""
    found = sorted((round(one.after_s, 6), one.monitor, str(one.stretch)) for one in monitors.violations)
    return monitors.verdicts, monitors.counts, [(after_s, name) for after_s, name, _ in found]


def agrees(seed: int) -> None:
    rng = random.Random(seed)
    properties = {f"m{number}": random_property(rng) for number in range(12)}
    whole = two_chains()
    for name, what in properties.items():
        whole.monitor(name, str(what))
    in_pieces = said(found(cut_at_random(rng, properties))[0])
    assert in_pieces == said(found(whole)[0]), f"seed {seed}: {properties}"


@pytest.mark.rule("L1", "G1")
@pytest.mark.parametrize("block", range(2))
def test_random_monitors_find_the_same_however_a_graph_is_cut(block: int) -> None:
    for seed in range(10 * block, 10 * block + 10):
        agrees(seed)


@pytest.mark.soak
def test_a_thousand_times_random_monitors_find_the_same_however_a_graph_is_cut() -> None:
    for seed in range(1000, 2000):
        agrees(seed)

"""Monitors judge a run in progress: where they listen, when a deadline is over, and what they leave as it is."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg import monitors as m
from hfg.errors import GraphError, MonitorViolated, UsageError
from hfg.monitors import Property, Verdict


@hfg.node
def ticks(*, count: int = 10) -> Iterator[int]:
    """Count from 0."""
    yield from range(count)


@hfg.node
def double(number: int) -> int | None:
    """Nothing for 3, else twice as much."""
    return None if number == 3 else 2 * number


@hfg.node
def sink(number: int) -> None:
    """Take it."""


class Light(hfg.Node):
    """Is active between 2 and 5."""

    number = hfg.Input(int)
    on = hfg.Event()
    off = hfg.Event()

    def process(self, number: int) -> None:
        if number == 2:
            self.on.trigger()
        if number == 5:
            self.off.trigger()


class State(hfg.Node):
    @hfg.slot
    def begin(self) -> None:
        pass


class Box(hfg.Subgraph):
    """A state in a box."""

    on = hfg.slot(type=object)
    off = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        state = graph.add(State(), name="state")
        graph.connect(self.on.inner, state.activate)
        graph.connect(self.off.inner, state.deactivate)


def chain(count: int = 10, rate_hz: float = 1.0) -> hfg.Graph:
    """A source, which doubles, and a sink."""
    graph = hfg.Graph("chain")
    source = graph.add(ticks(count=count), name="ticks", max_rate_hz=rate_hz)
    doubled, end = graph.add(double(), name="double"), graph.add(sink(), name="sink")
    graph.connect(source.out, doubled.number)
    graph.connect(doubled.out, end.number)
    return graph


def lit() -> hfg.Graph:
    """The same, and a light in a box."""
    graph = chain()
    light, box = graph.add(Light(), name="light"), graph.add(Box(), name="box")
    graph.connect(graph["ticks"].out, light.number)
    graph.connect(light.on, box.on)
    graph.connect(light.off, box.off)
    return graph


def judged(graph: hfg.Graph, on_violation: Any = "note", **properties: Property) -> m.Monitors:
    """Run a graph in virtual time, and return what its monitors have found."""
    found: list[m.Monitors] = []
    hfg.run(
        graph, clock="virtual", begin=lambda run: found.append(m.watch(run, on_violation=on_violation, **properties))
    )
    return found[0]


def test_a_value_that_must_not_pass_is_found_with_what_passed_before_it() -> None:
    found = judged(chain(), small=m.never(m.sent("double.out", lambda number: number > 9)))
    assert found.verdicts == {"small": Verdict.VIOLATED}
    (violation,) = found.violations[:1]
    assert (violation.after_s, violation.stretch[-1].value) == (5.0, 10)
    assert [seen.value for seen in violation.stretch] == [0, 2, 4, 8, 10]
    with pytest.raises(
        MonitorViolated, match=r'monitor "small" is violated after 5 s: never\(sent\(double.out, ...\)\)'
    ):
        found.check()


def test_what_holds_is_said_to_hold() -> None:
    found = judged(chain(), small=m.never(m.sent("double.out", lambda number: number > 99)))
    assert (found.verdicts, found.violations) == ({"small": Verdict.HOLDS}, [])
    found.check()


def test_a_subgraph_is_active_as_long_as_a_node_inside_is() -> None:
    dark = m.never(m.active("box") & m.sent("ticks.out", lambda number: number == 4))
    found = judged(lit(), dark=dark, later=m.never(m.active("box") & m.sent("ticks.out", lambda number: number == 7)))
    assert found.verdicts == {"dark": Verdict.VIOLATED, "later": Verdict.HOLDS}


def test_a_firing_counts_if_the_function_ran() -> None:
    graph = lit()
    found = judged(graph, nine=m.never(m.at_least(10, m.fired("sink"))), eight=m.never(m.at_least(9, m.fired("sink"))))
    assert found.verdicts == {"nine": Verdict.HOLDS, "eight": Verdict.VIOLATED}  # of ten ticks one is silent


def test_a_deadline_is_over_when_its_time_is_and_not_at_the_next_event() -> None:
    heard: list[tuple[float, float]] = []

    def late(violation: m.Violation) -> None:
        heard.append((hfg.elapsed(), violation.after_s))

    what = m.leads_to(
        m.sent("ticks.out", lambda number: number == 3), m.sent("double.out", lambda n: n == 6), within_s=2.5
    )
    found = judged(chain(), late, answered=what)
    assert [round(one, 6) for both in heard for one in both] == [5.5, 5.5]
    assert found.verdicts == {"answered": Verdict.VIOLATED}


def test_a_deadline_keeps_no_run_alive() -> None:
    found: list[m.Monitors] = []
    what = m.eventually(m.sent("double.out", lambda number: number > 99), within_s=1000)
    report = hfg.run(chain(), clock="virtual", begin=lambda run: found.append(m.watch(run, never_comes=what)))
    assert report.duration_s == hfg.run(chain(), clock="virtual").duration_s
    assert found[0].verdicts == {"never_comes": Verdict.OPEN}
    found[0].check()


def test_a_violation_may_end_the_run() -> None:
    with pytest.raises(MonitorViolated, match=r'monitor "few" is violated') as caught:
        judged(chain(), "fail", few=m.never(m.sent("ticks.out", lambda number: number == 4)))
    assert caught.value.report.nodes["ticks"].firings == 5  # type: ignore[attr-defined]


def test_a_condition_that_raises_ends_its_monitor_and_nothing_else(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "hfg.monitors"):
        found = judged(
            chain(),
            odd=m.never(m.sent("ticks.out", lambda number: 1 / (number - 2))),
            all=m.always(m.sent("ticks.out", lambda number: number < 10)),
        )
    assert set(found.broken) == {"odd"}
    assert found.verdicts == {"odd": Verdict.UNKNOWN, "all": Verdict.HOLDS}
    assert 'monitor "odd" judges nothing more, because its condition raised ZeroDivisionError' in caplog.text
    with pytest.raises(MonitorViolated, match='monitor "odd" has judged nothing since its condition raised'):
        found.check()


@pytest.mark.rule("R7")
def test_a_watched_chain_stays_fused() -> None:
    def fused(**properties: Property) -> list[bool]:
        graph = chain(200, 1000.0)
        runs: list[hfg.Run] = []
        seen: list[bool] = []

        def begin(run: hfg.Run) -> None:
            m.watch(run, **properties)  # type: ignore[arg-type]  # none of them is called on_violation
            runs.append(run)

        @hfg.node
        def ask(number: int) -> None:
            if number == 150:
                seen.extend(one.fused for one in runs[0].explain().values())

        graph.connect(graph["ticks"].out, graph.add(ask(), name="ask").number)
        hfg.run(graph, clock="virtual", begin=begin)
        return seen

    answered = m.sent("double.out").implies(m.once(m.sent("ticks.out")))
    assert fused() == fused(dark=m.never(m.active("sink")), answered=m.always(answered))
    assert any(fused())


@pytest.mark.parametrize(
    ("make", "error", "sentence"),
    [
        (lambda: m.never(m.sent("nobody.out")), GraphError, "nobody"),
        (
            lambda: m.never(m.sent("double")),
            UsageError,
            '"double" is not a port: sent() takes one, such as "double.out"',
        ),
        (lambda: m.never(m.active("duble")), GraphError, 'there is no node "duble" in this process'),
        (lambda: m.active("double"), UsageError, 'monitor "it" needs a property, such as always(formula)'),
    ],
)
def test_what_cannot_be_watched_is_refused_before_the_run(
    make: Callable[[], Any], error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error) as caught:
        judged(chain(), it=make())
    assert sentence in str(caught.value)


def test_what_is_to_be_done_with_violations_is_checked() -> None:
    with pytest.raises(UsageError, match=r'on_violation is "note", "fail" or a function'):
        judged(chain(), "shout", it=m.never(m.active("double")))

"""The margin of a property has the sign of its verdict, and is how far values are from another verdict."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg import monitors as m
from hfg.errors import UsageError
from hfg.monitors import Property, Verdict
from hfg.monitors.margins import MarginJudge
from tests.monitors.slow import POINTS, random_formula


def random_property(rng: random.Random) -> Property:
    one, other = random_formula(rng, 2), random_formula(rng, 2)
    within_s = rng.choice([0.0, 1.0, 3.0])
    return rng.choice(
        [
            m.always(one),
            m.never(one),
            m.precedes(one, other),
            m.leads_to(one, other, within_s=within_s),
            m.eventually(one, within_s=within_s),
            m.until(one, other, within_s=within_s),
        ]
    )


def agree(seed: int) -> None:
    """Each point is a number at each of three ports; what is true of it is that it is above 0."""
    rng = random.Random(seed)
    what = random_property(rng)
    judge, measuring = what.judge(0.0), m.measured(what).judge(0.0)
    assert isinstance(measuring, MarginJudge)
    t = 0.0
    for _ in range(rng.randint(1, 12)):
        t += rng.choice([0.0, 0.5, 1.0, 2.0])
        values: Any = {atom: rng.uniform(-1, 1) for atom in POINTS}
        judge.point(t, *(values[atom] > 0 for atom in judge.atoms))
        measuring.take(t, values)
        assert (judge.verdict is Verdict.VIOLATED) == (measuring.margin < 0), f"{seed}: {what} at {t}"
    for one in (judge, measuring):
        one.pass_to(t + 5)
    assert (judge.verdict is Verdict.VIOLATED) == (measuring.margin < 0), f"{seed}: {what}"


@pytest.mark.parametrize("block", range(4))
def test_the_margin_is_below_0_where_the_property_is_violated(block: int) -> None:
    for seed in range(250 * block, 250 * block + 250):
        agree(seed)


@pytest.mark.soak
def test_the_margins_of_ten_thousand_properties_have_the_signs_of_their_verdicts() -> None:
    for seed in range(10_000, 20_000):
        agree(seed)


@hfg.node
def speeds() -> Iterator[float]:
    yield from (0.5, 0.9, 1.1, 0.7)


@hfg.node
def motor(speed: float) -> None: ...


def run(**properties: Property) -> m.Monitors:
    graph = hfg.Graph("motor")
    graph.connect(graph.add(speeds(), max_rate_hz=1).out, graph.add(motor()).speed)
    found: list[m.Monitors] = []
    measured = {name: m.measured(what) for name, what in properties.items()}
    hfg.run(graph, clock="virtual", begin=lambda run: found.append(m.watch(run, on_violation="note", **measured)))
    return found[0]


def test_a_run_is_as_far_from_a_violation_as_its_values_are() -> None:
    fast, slow = m.sent("speeds.out", "value > 1.2"), m.sent("speeds.out", "value < 0.6")
    found = run(
        limit=m.never(fast),
        tight=m.never(m.sent("speeds.out", "value > 1")),
        both=m.never(fast | slow),
        calms=m.leads_to(m.sent("speeds.out", "value > 1"), m.sent("speeds.out", "value < 0.8"), within_s=2),
        runs=m.never(m.active("motor")),
    )
    assert found.margins == pytest.approx({"limit": 0.1, "tight": -0.1, "both": -0.1, "calms": 0.1, "runs": math.inf})
    assert {violation.monitor: violation.after_s for violation in found.violations} == {"tight": 2.0, "both": 0.0}
    assert found.verdicts["limit"] is Verdict.HOLDS
    assert found.verdicts["tight"] is Verdict.VIOLATED


def test_a_condition_that_is_no_comparison_with_a_number_has_no_size() -> None:
    assert run(any=m.never(m.sent("speeds.out", lambda speed: speed > 2))).margins == {"any": math.inf}
    assert run(text=m.never(m.sent("speeds.out", 'value == "fast"'))).margins == {"text": math.inf}


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (m.leads_to(*POINTS[:2]), "can never be violated, so it has no margin: give it a time, within_s="),
        (POINTS[0], "measured takes a property, such as never(formula), got "),
        (None, "measured takes a property"),
    ],
)
def test_what_has_no_margin_is_refused(given: Any, sentence: str) -> None:
    with pytest.raises(UsageError) as error:
        m.measured(given)
    assert sentence in str(error.value)

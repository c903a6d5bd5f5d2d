"""Formulas look back, and their compiled form equals their definition."""

from __future__ import annotations

import random

import pytest

from hfg import monitors as m
from hfg.errors import UsageError
from hfg.monitors.compiling import compiled
from hfg.monitors.formulas import Formula
from tests.monitors.slow import POINTS, holds, random_formula, random_trace

P, Q, R = POINTS


def agree(seed: int) -> None:
    rng = random.Random(seed)
    formula = random_formula(rng, 3)
    atoms, step = compiled([formula])
    trace = random_trace(rng)
    for at, (t, truths) in enumerate(trace):
        assert step(t, *(truths[atom] for atom in atoms)) == (holds(formula, trace, at),), f"{formula} at {at}: {trace}"


@pytest.mark.parametrize("block", range(10))
def test_a_compiled_formula_holds_where_its_definition_says(block: int) -> None:
    for seed in range(100 * block, 100 * block + 100):
        agree(seed)


@pytest.mark.soak
def test_ten_thousand_formulas_hold_where_their_definitions_say() -> None:
    for seed in range(10_000, 20_000):
        agree(seed)


def truths(formula: Formula, *points: tuple[float, set[Formula]]) -> list[bool]:
    """Where a formula holds on a trace: at each point its time, and what is true."""
    atoms, step = compiled([formula])
    return [step(t, *(atom in true for atom in atoms))[0] for t, true in points]


def test_once_remembers_for_as_long_as_it_is_told() -> None:
    points = [(0.0, {P}), (2.0, set()), (3.0, set())]
    assert truths(m.once(P, within_s=2), *points) == [True, True, False]
    assert truths(m.once(P), *points) == [True, True, True]
    assert truths(m.once(P, at_least_s=1), *points) == [False, True, True]


def test_since_ends_where_what_has_to_hold_does_not() -> None:
    points = [(0.0, {Q}), (1.0, {P}), (2.0, set()), (3.0, {P})]
    assert truths(m.since(P, Q), *points) == [True, True, False, False]


def test_a_rate_is_a_number_of_points_within_a_time() -> None:
    points = [(0.0, {P}), (0.4, {P}), (0.9, {P}), (2.0, {P})]
    assert truths(m.at_least(3, P, within_s=1), *points) == [False, False, True, False]


def test_a_part_that_stands_twice_is_remembered_once() -> None:
    both = m.previously(P) & m.previously(P)
    assert truths(both | ~m.previously(P), (0.0, {P}), (1.0, set()), (2.0, {P})) == [True, True, True]


def test_formulas_say_themselves_in_the_words_that_made_them() -> None:
    formula = m.once(m.sent("a.out"), within_s=5) & ~m.active("drive")
    assert str(formula) == "(once(sent(a.out), within_s=5) & ~active(drive))"
    assert str(m.leads_to(P, Q, within_s=3)) == "leads_to(sent(p.out), sent(q.out), within_s=3)"


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: bool(P), "use"),
        (
            lambda: P & True,  # type: ignore[operator]
            "& takes formulas, such as active(node) or sent(port), got True",
        ),
        (lambda: m.once(P, within_s=-1), "once looks back by seconds from 0 on"),
        (lambda: m.once(P, at_least_s=3, within_s=2), "the least first, got at least 3 and at most 2"),
        (lambda: m.once(P, within_s=float("nan")), "got at least 0.0 and at most nan"),
        (lambda: m.at_least(0, P), "counts points, from 1 to 1,000,000, got 0"),
        (lambda: m.sent(3), "sent takes a port of the graph, given itself or by path, got 3"),
        (
            lambda: m.sent("a.out", when=3),  # type: ignore[arg-type]
            "takes a condition",
        ),
        (lambda: m.active(None), "active takes a node of the graph"),
        (
            lambda: m.leads_to(P, Q, within_s="soon"),  # type: ignore[arg-type]
            "within_s of leads_to is a time in seconds, from 0 on, got 'soon'",
        ),
        (
            lambda: m.always(m.never(P)),  # type: ignore[arg-type]
            "always takes formulas",
        ),
    ],
)
def test_what_is_not_a_formula_is_refused_in_one_sentence(make: object, sentence: str) -> None:
    with pytest.raises(UsageError) as caught:
        make()  # type: ignore[operator]
    assert (sentence if sentence != "use" else "combine formulas with & | ~") in str(caught.value)

"""Dwyer's patterns in each of his scopes, and what looks ahead up to a deadline."""

from __future__ import annotations

import pytest

from hfg import monitors as m
from hfg.monitors.formulas import Formula
from hfg.monitors.properties import Property, Verdict

P, Q, R, S = (m.sent(f"{name}.out") for name in "pqrs")
NAMES = {"p": P, "q": Q, "r": R, "s": S}


def verdict(what: Property, points: str, end: float | None = None) -> Verdict:
    """Judge a run of points one second apart, "p . qr" say: at each what is true, "." for nothing of it."""
    judge = what.judge(0.0)
    t = 0.0
    for t, point in enumerate(points.split(), 1):
        judge.point(float(t), *(atom in {NAMES[one] for one in point if one != "."} for atom in judge.atoms))
    judge.pass_to(float(t) if end is None else end)
    return judge.verdict


def between(formula: Formula) -> Formula:
    """The points after a q to which no r has come since."""
    return m.since(~R, Q) & formula


PATTERNS = [
    # absence of p
    ("absence, globally", m.never(P), ["q r", ""], ["q p"]),
    ("absence, before r", m.always(R.implies(~m.once(P))), ["q r p", "p q"], ["p r"]),
    ("absence, after q", m.never(P & m.once(Q)), ["p q r"], ["q . p"]),
    ("absence, between q and r", m.never(R & m.once(m.since(~R, Q) & P)), ["p q r", "q p"], ["q p r"]),
    ("absence, after q until r", m.never(between(P)), ["p q r p"], ["q p r", "q p"]),
    # universality of p
    ("universality, globally", m.always(P), ["p pq"], ["p q"]),
    ("universality, after q", m.always(m.once(Q).implies(P)), [". pq p"], ["q p"]),
    ("universality, after q until r", m.always((m.since(~R, Q) & ~R).implies(P)), [". pq p r ."], ["pq . r"]),
    # precedence: s before p
    ("precedence, globally", m.precedes(S, P), ["s p p", "q"], ["p s"]),
    ("precedence, after q", m.always((P & m.once(Q)).implies(m.once(S & m.once(Q)))), ["p q s p"], ["s q p"]),
]


@pytest.mark.parametrize(("name", "what", "good", "bad"), PATTERNS, ids=[one[0] for one in PATTERNS])
def test_a_pattern_holds_of_the_runs_that_it_is_for(name: str, what: Property, good: list[str], bad: list[str]) -> None:
    assert [verdict(what, points) for points in good] == [Verdict.HOLDS] * len(good)
    assert [verdict(what, points) for points in bad] == [Verdict.VIOLATED] * len(bad)


def test_existence_has_come_or_has_not_yet() -> None:
    assert verdict(m.eventually(P), "q p") is Verdict.HOLDS
    assert verdict(m.eventually(P), "q q") is Verdict.OPEN


def test_existence_after_q_is_asked_for_by_each_q() -> None:
    what = m.leads_to(Q, P)
    assert verdict(what, "r r") is Verdict.HOLDS
    assert verdict(what, "q r p") is Verdict.HOLDS
    assert verdict(what, "q p q") is Verdict.OPEN


def test_a_response_must_come_in_time() -> None:
    what = m.leads_to(P, S, within_s=2)
    assert verdict(what, "p . s") is Verdict.HOLDS  # at the moment of the deadline it is in time
    assert verdict(what, "p . . s") is Verdict.VIOLATED
    assert verdict(what, "ps . . .") is Verdict.HOLDS
    assert verdict(what, "p", end=2.5) is Verdict.OPEN
    assert verdict(what, "p", end=3.5) is Verdict.VIOLATED


def test_the_oldest_question_sets_the_deadline_and_one_answer_answers_all() -> None:
    what = m.leads_to(P, S, within_s=3)
    assert verdict(what, "p p p s") is Verdict.HOLDS
    assert verdict(what, "p p p p s") is Verdict.VIOLATED


def test_until_asks_for_both() -> None:
    assert verdict(m.until(P, Q), "p p q r") is Verdict.HOLDS
    assert verdict(m.until(P, Q), "p r q") is Verdict.VIOLATED
    assert verdict(m.until(P, Q), "p p") is Verdict.OPEN
    assert verdict(m.until(P, Q, within_s=2), "p p p") is Verdict.VIOLATED


def test_eventually_is_counted_from_the_start() -> None:
    assert verdict(m.eventually(P, within_s=2), "q p") is Verdict.HOLDS
    assert verdict(m.eventually(P, within_s=2), "q q p") is Verdict.VIOLATED


def test_what_was_violated_stays_so() -> None:
    assert verdict(m.never(P), "p q q") is Verdict.VIOLATED
    assert verdict(m.leads_to(P, S, within_s=1), "p . . p s") is Verdict.VIOLATED

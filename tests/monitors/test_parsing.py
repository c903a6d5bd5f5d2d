"""Properties are text as well: what they print is read as the same; what is malformed is refused with its place."""

from __future__ import annotations

import contextlib
import random
from types import SimpleNamespace

import pytest

from hfg import monitors as m
from hfg.errors import UsageError
from hfg.monitors.conditions import parse_condition
from tests.monitors.slow import random_formula


@pytest.mark.parametrize("block", range(5))
def test_what_a_property_prints_is_read_as_the_same_property(block: int) -> None:
    for seed in range(100 * block, 100 * block + 100):
        rng = random.Random(seed)
        one, other = random_formula(rng, 3), random_formula(rng, 3)
        for made in (m.always(one), m.never(one), m.leads_to(one, other, within_s=rng.random()), m.until(one, other)):
            assert m.parse(str(made)) == made


@pytest.mark.parametrize(
    "text",
    [
        "never(active(robot/drive) & sent(robot/drive.lamp[0], value == true))",
        'always(sent(door.state, value.name == "open" | ~value.locked & value.count[1] >= -2.5))',
        'leads_to(fired("go home"), sent(a.b), within_s=0.1234567)',
        "never(sent(steer.found, value > 3, older_than_s=0.05) | sent(steer.found, older_than_s=1))",
        "precedes(previously(active(a)), at_least(3, fired(b), within_s=1e-07))",
    ],
)
def test_a_text_is_read_and_printed_as_it_is(text: str) -> None:
    assert str(m.parse(text)) == text


def test_implies_and_throughout_are_read_as_what_they_stand_for() -> None:
    a, b = m.active("a"), m.active("b")
    assert m.parse("always(implies(active(a), throughout(active(b), last_s=2)))") == m.always(
        a.implies(m.throughout(b, last_s=2))
    )


def test_a_chain_is_printed_with_one_pair_of_brackets() -> None:
    chain = m.active("n0")
    for number in range(1, 60):
        chain |= m.active(f"n{number}")
    assert m.parse(str(m.never(chain))) == m.never(chain)


@pytest.mark.parametrize(
    ("text", "value", "holds"),
    [
        ("value", 0, False),
        ("value > 3", 4, True),
        ("~(value > 3)", 4, False),
        ("value.x == 1 & value.y[1] != null", SimpleNamespace(x=1, y=[0, 2]), True),
        ("value.x == 1 & value.y[1] != null", {"x": 1, "y": [0, None]}, False),
        ('value == "on" | value == true', "on", True),
    ],
)
def test_a_condition_is_judged_by_its_text(text: str, value: object, holds: bool) -> None:
    assert parse_condition(text)(value) is holds
    assert parse_condition(str(parse_condition(text)))(value) is holds


MALFORMED = {
    "neve(active(a))": 'column 1: a property is expected, got "neve"; did you mean "never"?',
    "never(actve(a))": 'column 7: a formula is expected, got "actve"; did you mean "active"?',
    "never(active())": "column 14: active takes a path, such as robot/drive",
    "never(active(a)": 'column 16: ")" is expected at the end of never(...), got the end',
    "never(active(a)) x": 'column 18: nothing more is expected, got "x"',
    "never(active(a) & not)": 'column 19: a formula is expected, got "not"',
    "never(sent(a.b, value.__class__ == 3))": "column 23: the public name of a field is expected",
    "never(sent(a.b, 3 < value))": "column 17: a condition begins with value",
    "never(once(active(a), within=3))": "column 23: once takes within_s= and at_least_s= here",
    "never(once(active(a), within_s=-3))": "column 7: once looks back by seconds from 0 on",
    "never(sent(a.b, value, value))": "column 24: sent takes older_than_s= here",
    "never(sent(a.b, older_than_s=-1))": "column 7: sent looks back by seconds from 0 on",
    "leads_to(active(a))": 'column 19: "," is expected between the formulas of leads_to',
    "never(at_least(1.5, active(a)))": "column 16: at_least counts points, got 1.5",
    'never(active("a\\q"))': 'column 14: ""a\\q"" has a "\\" that means nothing',
    "never(\n active(a) ? )": "line 2, column 12: '?' is no part of the language",
    "": "column 1: a property is expected, got the end",
}


@pytest.mark.parametrize("text", MALFORMED)
def test_what_is_malformed_is_refused_with_line_and_column(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        m.parse(text)
    assert str(caught.value).startswith("line ")
    assert MALFORMED[text] in str(caught.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (f"never({'(' * 60}active(a){')' * 61}", "more than 40 brackets are nested"),
        (f"never({'~' * 60}active(a))", "more than 40 brackets are nested"),
        (f"never({'active(a) | ' * 150}active(a))", '"|" joins at most 100 parts'),
        (f"never({' ' * 5000}active(a))", "a condition has at most 4,000 characters, got 5,016"),
    ],
)
def test_the_size_of_a_text_is_bounded(text: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence.replace("|", r"\|")):
        m.parse(text)


def test_any_text_is_read_or_refused() -> None:
    pieces = ["never(", "active(a)", "sent(a.b", ", value", ".x", " > ", "3", '"q"', "~", "(", ")", "&", "|", "once(",
              "within_s=", ",", " ", "\n", "[", "]", "é", "\\"]  # fmt: skip
    rng = random.Random(0)
    for _ in range(3000):
        text = "".join(rng.choice(pieces) for _ in range(rng.randint(1, 12)))
        with contextlib.suppress(UsageError):
            m.parse(text)

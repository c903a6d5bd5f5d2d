"""Every rule of docs/semantics.md has a test that names it, and no test names a rule that is not there.

A red case here is a missing test, not a missing feature: write one that fails without the rule, and mark it
`@pytest.mark.rule("F4")`.
"""

from __future__ import annotations

import ast
import functools
import re
from collections import defaultdict
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
SEMANTICS = (TESTS.parent / "docs" / "semantics.md").read_text(encoding="utf-8")

LATER: dict[str, str] = {}


def rules() -> dict[str, str]:
    """Return each rule's number with the text of its section."""
    parts = re.split(r"^#{2,3} ", SEMANTICS, flags=re.MULTILINE)
    sections = {}
    for part in parts:
        if number := re.match(r"([TPFAGXRL]\d+)\b", part):
            sections[number[1]] = part
    return sections


@functools.cache
def marks() -> dict[str, list[str]]:
    """Return, for each number in a `rule` mark, where it stands; found without running the tests."""
    found: dict[str, list[str]] = defaultdict(list)
    for file in sorted(TESTS.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "rule"):
                continue
            if ast.unparse(node.func) == "pytest.mark.rule":
                for argument in node.args:
                    assert isinstance(argument, ast.Constant), f"{file.name}:{node.lineno}: write the rule out"
                    found[str(argument.value)].append(f"{file.relative_to(TESTS)}:{node.lineno}")
    return found


RULES = rules()


@pytest.mark.slow
def test_each_rule_has_a_test() -> None:
    for rule in RULES:
        assert rule in marks() or rule in LATER, f"no test carries @pytest.mark.rule({rule!r})"


@pytest.mark.slow
def test_marks_name_rules_that_exist() -> None:
    strangers = {number: places for number, places in marks().items() if number not in RULES}
    assert not strangers


@pytest.mark.slow
def test_rules_for_later_exist_and_have_no_test_yet() -> None:
    for rule, reason in LATER.items():
        assert rule in RULES, f"{rule} is put off but not in docs/semantics.md"
        assert rule not in marks(), f"{rule} has a test now: take it off LATER ({reason})"
        assert "**Later.**" in RULES[rule], f"docs/semantics.md should say that {rule} is for later"


def test_each_rule_gives_its_intent() -> None:
    assert [rule for rule, text in RULES.items() if "*Intent:*" not in text] == []


@pytest.mark.parametrize("family", "TPFAGXRL")
def test_numbers_have_no_gap(family: str) -> None:
    numbers = [int(rule[1:]) for rule in RULES if rule[0] == family]
    assert numbers == list(range(1, len(numbers) + 1))
    assert numbers

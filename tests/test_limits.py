"""Tests hold on a slow machine too: no example has a deadline, and limits by the clock on the wall are scaled."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests import limits

TESTS = Path(__file__).resolve().parent
WAITING = ("run", "communicate", "check_output", "check_call", "Barrier")


def calls() -> Iterator[tuple[str, ast.Call, str]]:
    for file in sorted(TESTS.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                yield f"{file.relative_to(TESTS)}:{node.lineno}", node, name


@pytest.mark.slow
def test_no_example_has_a_deadline() -> None:
    assert settings.default is not None
    assert settings.default.deadline is None
    given = [
        where
        for where, call, name in calls()
        if name in ("settings", "register_profile")
        and any(one.arg == "deadline" and getattr(one.value, "value", 0) is not None for one in call.keywords)
    ]
    assert given == []


@pytest.mark.slow
def test_other_programs_and_threads_are_waited_for_with_patience() -> None:
    given = [
        where
        for where, call, name in calls()
        if name in WAITING
        and any(one.arg == "timeout" and isinstance(one.value, ast.Constant) for one in call.keywords)
    ]
    assert given == [], "write timeout=patience(...), of tests.limits"


def test_the_limit_of_each_test_is_scaled(request: pytest.FixtureRequest) -> None:
    marker = request.node.get_closest_marker("timeout")
    assert marker is not None
    assert marker.args == (limits.patience(60),)


@pytest.mark.timeout(300)
def test_so_is_one_of_its_own(request: pytest.FixtureRequest) -> None:
    marker = request.node.get_closest_marker("timeout")
    assert marker is not None
    assert marker.args == (limits.patience(300),)


@pytest.mark.parametrize(("said", "factor"), [("20", 20.0), ("0.1", 1.0)])
def test_patience_can_be_given(monkeypatch: pytest.MonkeyPatch, said: str, factor: float) -> None:
    monkeypatch.setenv("HFG_PATIENCE", said)
    assert limits.factor.__wrapped__() == factor

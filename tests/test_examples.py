"""Every file in examples/ runs as its reader would run it, and says in its first lines what it shows."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.limits import patience

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted(file for file in (ROOT / "examples").glob("*.py") if not file.name.startswith("_"))
ON_PICTURES = sorted((ROOT / "examples" / "vision").glob("*.py"))  # tests/examples/test_vision.py runs them


def hfg(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hfg", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=patience(50),
    )


def example_id(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


def test_there_are_examples() -> None:
    assert EXAMPLES


@pytest.mark.parametrize("file", [*EXAMPLES, *ON_PICTURES], ids=example_id)
def test_example_says_what_it_shows(file: Path) -> None:
    docstring = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
    assert docstring, f"{example_id(file)} begins with a docstring that says what it shows"


@pytest.mark.slow
@pytest.mark.parametrize("file", [*EXAMPLES, *ON_PICTURES], ids=example_id)
def test_example_has_a_sound_graph(file: Path) -> None:
    checked = hfg("check", str(file), "--json")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    alarms = [problem for problem in json.loads(checked.stdout) if problem["severity"] != "hint"]
    assert not alarms, alarms


@pytest.mark.slow
@pytest.mark.parametrize("file", EXAMPLES, ids=example_id)
def test_example_runs_well_in_virtual_time(file: Path) -> None:
    ran = hfg("run", str(file), "--clock", "virtual", "--until", "600", "--json")
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["firings"] > 0

"""Every fault that is planted in a copy of the package is found, by `make soak`; what is planted is checked always."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.soak.mutants import MUTANTS, Mutant

ROOT = Path(__file__).parents[2]
LONGEST_S = 600


def name_of(mutant: Mutant) -> str:
    return f"{mutant.rule}: {mutant.name}"


@pytest.mark.parametrize("mutant", MUTANTS, ids=name_of)
def test_what_a_mutant_replaces_is_still_there_once(mutant: Mutant) -> None:
    assert (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.old) == 1


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package and of the tests that look for mutants."""
    folder = tmp_path_factory.mktemp("mutants")
    ignored = shutil.ignore_patterns("__pycache__")
    for part in ("hfg", "tests", "transports"):
        shutil.copytree(ROOT / part, folder / part, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", folder)
    used = run_in(folder, "-c", "import hfg; print(hfg.__file__)").stdout
    assert used.startswith(str(folder)), f"{used} is not the copy"
    return folder


def run_in(copy: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the package of the copy."""
    environment = os.environ | {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, *arguments]
    return subprocess.run(
        command, cwd=copy, env=environment, capture_output=True, text=True, timeout=LONGEST_S, check=False
    )


def spent_s() -> float:
    """Seconds of CPU that programs which this one has started, and which are over, have spent."""
    times = os.times()
    return times.children_user + times.children_system


def finder(copy: Path, tests: Sequence[str]) -> str:
    """The first test that fails in the copy; "" if none does."""
    ran = run_in(copy, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests)
    assert ran.returncode in (0, 1), ran.stdout[-2000:] + ran.stderr[-2000:]
    failed = re.search(r"^(?:FAILED|ERROR) (\S+)", ran.stdout, re.MULTILINE)
    return failed[1] if failed else ""


@pytest.mark.soak
@pytest.mark.timeout(LONGEST_S + 60)
@pytest.mark.parametrize("tests", sorted({mutant.tests for mutant in MUTANTS}))
def test_without_a_mutant_nothing_is_found(tests: tuple[str, ...], copy: Path) -> None:
    assert finder(copy, tests) == ""


@pytest.mark.soak
@pytest.mark.timeout(LONGEST_S + 60)
@pytest.mark.parametrize("mutant", MUTANTS, ids=name_of)
def test_each_mutant_is_found(mutant: Mutant, copy: Path) -> None:
    file = copy / mutant.file
    whole = file.read_text(encoding="utf-8")
    file.write_text(whole.replace(mutant.old, mutant.new), encoding="utf-8")
    began = spent_s()
    try:
        found = finder(copy, mutant.tests)
    finally:
        file.write_text(whole, encoding="utf-8")
    print(f"| {mutant.name} | {mutant.rule} | {found} | {spent_s() - began:.1f} |")
    assert found, f"no test finds that {mutant.name} ({mutant.rule}); widen {', '.join(mutant.tests)}"

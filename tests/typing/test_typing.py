"""The face as type checkers see it: `accepted.py` has no errors, `refused.py` one on each line that says so."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parent.parent


@pytest.fixture
def refused(tmp_path: Path) -> Path:
    """A copy of refused.py without its first line, which silences checkers."""
    copy = tmp_path / "refused.py"
    first, _, rest = (HERE / "refused.py").read_text().partition("\n")
    assert first.startswith("# type: ignore")
    copy.write_text("#\n" + rest)
    return copy


def check(refused: Path, *command: str) -> None:
    checker = shutil.which(command[0], path=str(Path(sys.executable).parent)) or shutil.which(command[0])
    if checker is None:
        pytest.skip(f"{command[0]} is not installed")
    run = subprocess.run(
        [checker, *command[1:], str(HERE / "accepted.py"), str(refused)], cwd=ROOT, capture_output=True, text=True
    )
    output = run.stdout + run.stderr
    accepted = [line for line in output.splitlines() if "accepted.py:" in line and "error" in line]
    assert not accepted, "\n".join(accepted)
    found = {int(number) for number in re.findall(r"refused\.py:(\d+):.*error", output)}
    lines = enumerate(refused.read_text().splitlines(), start=1)
    expected = {number for number, line in lines if line.endswith("# error")}
    assert found == expected, f"not refused: {sorted(expected - found)}, refused: {sorted(found - expected)}\n{output}"


@pytest.mark.slow
@pytest.mark.rule("P1", "P3")
@pytest.mark.timeout(300)  # without a cache mypy reads numpy and reactivex first
def test_mypy_sees_wrong_types_and_directions(refused: Path) -> None:
    check(refused, "mypy", "--strict", "--no-error-summary")


@pytest.mark.slow
@pytest.mark.rule("P1", "P3")
@pytest.mark.timeout(300)
def test_pyright_sees_wrong_types_and_directions(refused: Path) -> None:
    check(refused, "pyright", "--pythonpath", sys.executable)

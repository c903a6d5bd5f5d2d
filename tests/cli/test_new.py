"""`hfg new`: files that work as they are."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Command

ROOT = Path(__file__).resolve().parents[2]


def test_new_files_say_what_comes_next(command: Command) -> None:
    shown = command("new", "node", "MapLookup")
    assert (shown.code, shown.err) == (0, "")
    assert "hfg nodes map_lookup.py" in shown.out
    assert "hfg run robot.py" in command("new", "graph", "robot").out
    assert "map_lookup:MapLookup" in command("nodes", "map_lookup.py").out
    assert command("check", "robot.py").out == 'graph "robot": no errors, no warnings\n'
    assert command("run", "robot.py", "--clock", "virtual").code == 0


@pytest.mark.slow
@pytest.mark.timeout(300)  # without a cache mypy reads numpy and reactivex first
def test_new_files_pass_mypy_strict_ruff_and_their_own_tests(command: Command, tmp_path: Path) -> None:
    for kind, name in (("node", "find_a_rather_long_name_of_forty_letters"), ("graph", "robot.py")):
        assert command("new", kind, name).code == 0
    files = [str(file) for file in tmp_path.rglob("*.py") if file.name != "steps.py"]
    assert len(files) == 4
    folder = Path(sys.executable).parent
    for tool in (
        ["ruff", "check", "--isolated", "--extend-select", "ANN,B,I,RUF,SIM,UP"],
        ["ruff", "format", "--check", "--isolated"],
    ):
        _run([shutil.which(tool[0], path=str(folder)) or tool[0], *tool[1:], *files], tmp_path)
    _run([sys.executable, "-m", "mypy", "--strict", *files], ROOT)
    _run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), str(tmp_path)],
        ROOT,
    )


def test_names_may_be_files_in_folders(command: Command, tmp_path: Path) -> None:
    (tmp_path / "nodes").mkdir()
    assert command("new", "node", "nodes/MapLookup.py").code == 0
    assert {file.name for file in (tmp_path / "nodes").iterdir()} == {"map_lookup.py", "test_map_lookup.py"}


def _run(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("node", "steps"), "overwrites nothing"),
        (("graph", "2fast"), "names no module"),
        (("graph", "class"), "names no module"),
        (("graph", ""), "names no module"),
        (("graph", "test_me"), "names no module"),
        (("graph", "größe"), "letters of a to z"),
        (("graph", "x" * 41), "up to 40 letters"),
        (("graph", "json"), 'would hide the module "json"'),
        (("graph", "hfg"), 'would hide the module "hfg"'),
        (("graph", "no/such/robot"), "there is no folder no/such"),
        (("robot", "x"), "robot"),
        (("node",), "name"),
        ((), "command"),
    ],
)
def test_wrong_use_writes_nothing(command: Command, tmp_path: Path, arguments: tuple[str, ...], sentence: str) -> None:
    shown = command("new", *arguments)
    assert (shown.code, shown.out) == (2, "")
    assert sentence.lower() in shown.err.lower()
    assert shown.err.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["steps.py"]


def test_an_existing_test_is_not_overwritten_either(command: Command, tmp_path: Path) -> None:
    (tmp_path / "test_robot.py").write_text("mine")
    assert command("new", "node", "robot").code == 2
    assert not (tmp_path / "robot.py").exists()
    assert (tmp_path / "test_robot.py").read_text() == "mine"

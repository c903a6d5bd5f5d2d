"""`hfg new plugin`: a package that installs, is found and passes its test."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Command

ROOT = Path(__file__).resolve().parents[2]


def run(command: list[str], folder: Path, *paths: Path) -> str:
    """Run a program as a user would who has the folders on his path."""
    path = os.pathsep.join(map(str, (*paths, ROOT)))
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": path}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.timeout(300)  # pip, mypy and a few processes that import all
def test_the_package_installs_is_found_and_passes_its_test(command: Command, tmp_path: Path) -> None:
    shown = command("new", "plugin", "MyLamps")
    assert (shown.code, shown.err) == (0, "")
    assert "pip install -e my-lamps" in shown.out
    package, site, elsewhere = tmp_path / "my-lamps", tmp_path / "site", tmp_path / "elsewhere"
    elsewhere.mkdir()
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    run([*pip, "--disable-pip-version-check", "--target", str(site), str(package)], tmp_path)
    hfg = [sys.executable, "-m", "hfg"]
    listed = run([*hfg, "nodes", "--category", "my_lamps"], elsewhere, site)
    assert "my_lamps.nodes:MyLamps  Tell how far the values went" in listed
    assert "my_lamps.nodes:scaled" in listed
    page = run([*hfg, "nodes", "MyLamps"], elsewhere, site)
    assert "far: float" in page
    assert "how far it may go. (> 0, in m)" in page
    told = run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(package)], elsewhere, site)
    assert "6 passed" in told
    (elsewhere / "robot.py").write_text(
        "import hfg\nfrom my_lamps.nodes import MyLamps, scaled\ngraph = hfg.Graph('robot')\n"
        "lamps = graph.add(MyLamps(limit=3.0))\ngraph.connect(graph.add(scaled()).out, lamps.value)\n"
        "graph.connect(graph.input('value', float), graph.nodes['scaled'].ports.inputs['value'])\n"
    )
    run([*hfg, "convert", "robot.py", "robot.hfg.yaml"], elsewhere, site)
    assert "my_lamps.nodes:MyLamps" in (elsewhere / "robot.hfg.yaml").read_text(encoding="utf-8")
    assert "no errors" in run([*hfg, "check", "robot.hfg.yaml"], elsewhere, site)


@pytest.mark.slow
@pytest.mark.timeout(300)  # without a cache mypy reads numpy and reactivex first
def test_what_is_written_passes_mypy_strict_and_ruff(command: Command, tmp_path: Path) -> None:
    assert command("new", "plugin", "a_rather_long_name_of_forty_letters_each").code == 0
    package = tmp_path / "a-rather-long-name-of-forty-letters-each"
    ruff = shutil.which("ruff", path=str(Path(sys.executable).parent)) or "ruff"
    run([ruff, "check", "--isolated", "--extend-select", "ANN,B,I,RUF,SIM,UP", "."], package)
    run([ruff, "format", "--check", "--isolated", "."], package)
    sources = [str(package / part) for part in ("src", "tests")]
    run([sys.executable, "-m", "mypy", "--strict", *sources], package, package / "src")


def test_an_empty_folder_is_taken(command: Command, tmp_path: Path) -> None:
    (tmp_path / "plugins" / "my-lamps").mkdir(parents=True)
    assert command("new", "plugin", "plugins/my_lamps").code == 0
    assert (tmp_path / "plugins" / "my-lamps" / "src" / "my_lamps" / "nodes.py").is_file()


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("2fast", "names no module"),
        ("class", "names no module"),
        ("", "names no module"),
        ("test_me", "names no module"),
        ("größe", "letters of a to z"),
        ("x" * 41, "up to 40 letters"),
        ("json", 'would hide the module "json"'),
        ("hfg", 'would hide the module "hfg"'),
        ("numpy", 'there is a module "numpy" already'),
        ("no/such/lamps", "there is no folder no/such"),
        ("full", "full is there already and not empty"),
        ("taken", "taken is there already and not empty"),
    ],
)
def test_wrong_names_write_nothing(command: Command, tmp_path: Path, name: str, sentence: str) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    (tmp_path / "taken").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    shown = command("new", "plugin", name)
    assert (shown.code, shown.out) == (2, "")
    assert sentence in shown.err
    assert shown.err.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


def test_a_folder_that_cannot_be_written_is_named(command: Command, tmp_path: Path) -> None:
    (tmp_path / "my-lamps").mkdir()
    real = Path.open

    def full(file: Path, *arguments: object, **options: object) -> object:
        if file.name == "pyproject.toml":
            raise OSError(28, "No space left on device")
        return real(file, *arguments, **options)  # type: ignore[call-overload]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "open", full)
        shown = command("new", "plugin", "my_lamps")
    assert shown.code == 2
    assert "pyproject.toml cannot be written: No space left on device" in shown.err

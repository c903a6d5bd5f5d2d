"""What is built and installed: both packages, their types, the command and the plugin."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Build the wheel, without isolation and so without a network, and return the names of its files."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    (file,) = folder.glob("*.whl")
    with zipfile.ZipFile(file) as archive:
        return archive.namelist()


@pytest.mark.slow
def test_wheel_holds_every_module_of_both_packages(wheel: list[str]) -> None:
    for source, package in ((ROOT, "hfg"), (ROOT / "transports", "hfg_transports")):
        for file in (source / package).rglob("*.py"):
            assert file.relative_to(source).as_posix() in wheel


def test_wheel_holds_nothing_else(wheel: list[str]) -> None:
    tops = {name.split("/")[0] for name in wheel}
    assert tops == {"hfg", "hfg_transports", f"hfg-{PROJECT['version']}.dist-info"}


@pytest.mark.parametrize("package", ["hfg", "hfg_transports"])
def test_wheel_is_marked_as_typed(wheel: list[str], package: str) -> None:
    assert f"{package}/py.typed" in wheel


def test_wheel_carries_the_licence(wheel: list[str]) -> None:
    assert any(name.endswith("licenses/LICENSE") for name in wheel)


def test_installed_version_is_the_one_in_pyproject() -> None:
    """If this fails after an edit of pyproject.toml, the installation is older: run make again."""
    assert importlib.metadata.version("hfg") == PROJECT["version"]


def test_changelog_knows_the_version() -> None:
    assert f"## {PROJECT['version']}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def declared_entry_points() -> list[importlib.metadata.EntryPoint]:
    groups = {"console_scripts": PROJECT.get("scripts", {})} | PROJECT.get("entry-points", {})
    return [
        importlib.metadata.EntryPoint(name=name, value=value, group=group)
        for group, entries in groups.items()
        for name, value in entries.items()
    ]


@pytest.mark.parametrize("entry", declared_entry_points(), ids=lambda entry: f"{entry.group}:{entry.name}")
def test_declared_entry_points_are_installed_and_load(entry: importlib.metadata.EntryPoint) -> None:
    installed = importlib.metadata.entry_points(group=entry.group, name=entry.name)
    assert entry.value in {found.value for found in installed}, f"{entry} is not installed: run make again"
    assert entry.load() is not None


def test_transports_have_a_door_for_strangers() -> None:
    """The group may be empty, but each transport of ours that is declared lies in the package of transports."""
    for value in PROJECT.get("entry-points", {}).get("hfg.transports", {}).values():
        assert value.startswith("hfg_transports.")


def test_extra_all_holds_every_other_extra() -> None:
    extras = set(PROJECT["optional-dependencies"])
    (everything,) = PROJECT["optional-dependencies"]["all"]
    assert set(everything.removeprefix("hfg[").removesuffix("]").split(",")) == extras - {"all"}


@pytest.mark.slow
def test_python_m_hfg_is_the_command() -> None:
    shown = subprocess.run([sys.executable, "-m", "hfg", "--version"], capture_output=True, text=True, check=False)
    assert (shown.returncode, shown.stdout.strip()) == (0, f"hfg {PROJECT['version']}")

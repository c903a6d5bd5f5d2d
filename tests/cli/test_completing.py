"""What the Tab key offers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import hfg
import hfg.nodes.flow
from tests.cli.conftest import Command

Tab = Callable[[str], list[str]]


@pytest.fixture
def tab(command: Command, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Tab:
    """Press Tab at the end of a line, as zsh asks for it."""

    def press(line: str) -> list[str]:
        monkeypatch.setenv("_HFG_COMPLETE", "complete_fish")
        monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
        monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
        with pytest.raises(SystemExit):
            command()
        return [offer.partition("\t")[0] for offer in capsys.readouterr().out.split("\n") if offer]

    return press


def test_verbs_and_options(tab: Tab) -> None:
    assert tab("hfg t") == ["tap", "top", "tune", "trigger"]
    assert "--trace" in tab("hfg run steps.py --t")


def test_files_and_the_graphs_in_them_without_running_them(tab: Tab) -> None:
    Path("loud.py").write_text("raise SystemExit('never run')\ngraph = hfg.Graph('loud')\n_own = Graph()\n")
    Path("broken.py").write_text("def (")
    Path("folder").mkdir()
    assert tab("hfg run ") == ["broken.py", "folder/", "loud.py", "steps.py"]
    assert tab("hfg run st") == ["steps.py"]
    assert tab("hfg run steps.py") == ["steps.py:build"]
    assert tab("hfg check loud.py:gr") == ["loud.py:graph"]
    assert tab("hfg run broken.py") == []
    assert tab("hfg run nowhere/x") == []


def test_ports_and_parameters_of_the_target(tab: Tab) -> None:
    assert tab("hfg tap steps.py:build st") == ["steps.out"]
    assert tab("hfg tap steps.py:build ear.") == ["ear.rang", "ear.quiet", "ear.heard", "ear.begin"]
    assert tab("hfg run steps.py:build --param st") == ["steps.count="]
    assert tab("hfg tap nowhere.py x") == []


@pytest.mark.rule("L4")
def test_names_that_a_shell_would_carry_out_are_not_offered(tab: Tab) -> None:
    """Some shells put an offer into the line as it is, and others evaluate it at once."""
    for name in ("$(id)", "`id`", "a;id", "a b", "a\x1b[2J", "a|id", "--allow=id", "a'b"):
        Path(f"{name}.py").touch()
    assert tab("hfg run ") == ["steps.py"]
    assert tab("hfg run $") == tab("hfg run a") == []
    graph = hfg.Graph("evil")
    for name in ("$(id)", "good"):
        graph.add(hfg.nodes.flow.Count(), name=name)
    hfg.save(graph, "evil.hfg.yaml")
    assert {one.partition(".")[0] for one in tab("hfg tap evil.hfg.yaml ")} == {"good"}
    assert {one.partition(".")[0] for one in tab("hfg run evil.hfg.yaml --param ")} <= {"good"}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_for_a_shell_can_be_shown(
    command: Command, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], shell: str
) -> None:
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")  # tests may run where no shell is around
    with pytest.raises(SystemExit) as left:
        command("--show-completion", shell)
    assert not left.value.code
    shown = capsys.readouterr().out
    assert "_HFG_COMPLETE" in shown
    assert f"complete_{shell}" in shown


def test_a_home_that_cannot_be_written_gets_a_sentence(
    command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    home = tmp_path / "home"
    home.write_text("a file, no directory")
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    shown = command("--install-completion", "bash")
    assert shown.code == 1
    assert shown.err.startswith(f'hfg: "{home}')

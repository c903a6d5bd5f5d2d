"""Whoever may put files next to ours, or gives us a folder of files, does not decide what code we run (L4, L5)."""

from __future__ import annotations

import importlib.util
import marshal
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import hfg
from hfg import catalogue
from hfg.cli import main
from hfg.cli.target import load_graph
from hfg.errors import FileError, TargetError
from hfg.files.allowed import project_of
from hfg.parts.processes.process import _import_as

pytestmark = [pytest.mark.rule("L4"), pytest.mark.rule("L5")]

PLANTED = "open('planted', 'w')\n"
GRAPH = "import hfg\nonly = hfg.Graph('ours')\n"


@pytest.fixture
def shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder like /tmp, in which we are."""
    folder = tmp_path / "shared"
    folder.mkdir()
    folder.chmod(0o1777)
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(autouse=True)
def nothing_planted_has_run(tmp_path: Path) -> Iterator[None]:
    yield
    assert not list(tmp_path.rglob("planted"))


def plant_bytecode(file: Path) -> None:
    """Put code next to a file that Python takes for that of the file."""
    there = file.stat()
    code = compile(PLANTED + GRAPH.replace("ours", "theirs"), str(file), "exec")
    place = Path(importlib.util.cache_from_source(str(file)))
    place.parent.mkdir(exist_ok=True)
    place.write_bytes(
        importlib.util.MAGIC_NUMBER + struct.pack("<III", 0, int(there.st_mtime), there.st_size) + marshal.dumps(code)
    )


def test_no_bytecode_next_to_a_file_is_taken_for_its_code(shared: Path) -> None:
    file = shared / "robot_with_bytecode.py"
    file.write_text(GRAPH)
    plant_bytecode(file)
    assert load_graph(str(file)).name == "ours"
    assert load_graph(f"{file.name}:only").name == "ours"


def test_no_bytecode_next_to_a_file_is_taken_for_its_code_in_another_process(shared: Path) -> None:
    file = shared / "robot_of_a_part.py"
    file.write_text(GRAPH)
    plant_bytecode(file)
    _import_as("hfg_target_1", str(file))
    assert sys.modules.pop("hfg_target_1").only.name == "ours"


@pytest.mark.parametrize("target", ["robot.py", "robot.py:only"])
def test_no_module_is_imported_from_a_folder_of_all_users(shared: Path, target: str) -> None:
    (shared / "planted_module.py").write_text(PLANTED)
    (shared / "robot.py").write_text(f"import planted_module\n{GRAPH}")
    with pytest.raises(TargetError, match="no module is imported from .*shared, as every user may put some there"):
        load_graph(target)


@pytest.mark.parametrize("arguments", [("run", "planted_module:graph"), ("tap", "planted_module:graph", "a.out")])
def test_no_name_of_a_module_or_run_runs_code_in_a_folder_of_all_users(
    shared: Path, arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    (shared / "planted_module.py").write_text(PLANTED)
    assert main([*arguments]) == 2
    assert 'there is no module "planted_module" here or installed' in capsys.readouterr().err


def test_a_file_of_a_graph_may_import_nothing_from_a_folder_of_all_users(shared: Path) -> None:
    (shared / "planted_module.py").write_text(PLANTED)
    file = shared / "a.hfg.yaml"
    file.write_text("hfg: 1\nnodes:\n  a: {type: 'planted_module:A'}\n")
    with pytest.raises(FileError, match="every user may put modules into that folder"):
        hfg.load(file, allow=["planted_module"])


def test_a_mark_of_a_project_in_a_folder_of_all_users_makes_none(shared: Path) -> None:
    (shared / "pyproject.toml").touch()
    ours = shared / "ours"
    ours.mkdir()
    assert project_of(ours / "a.hfg.yaml") == ours
    (ours / "pyproject.toml").touch()
    (ours / "graphs").mkdir()
    assert project_of(ours / "graphs" / "a.hfg.yaml") == ours


@pytest.fixture
def strange(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that we have got from somebody, in which we are."""
    folder = tmp_path / "strange"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.path", [*sys.path])
    return folder


@pytest.mark.parametrize("what", ["flip_flop", "FlipFlop", "logic", "logic:FlipFlop"])
def test_to_look_an_installed_type_up_runs_no_code_of_the_folder(
    strange: Path, what: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(strange / "cache"))
    for name in ("flip_flop", "FlipFlop", "logic"):
        (strange / f"{name}.py").write_text(PLANTED)
    monkeypatch.setattr("hfg.catalogue.finding.offers", lambda: (catalogue.Offer("hfg.nodes.logic"),))
    monkeypatch.setattr("hfg.catalogue.keeping.offers", lambda: (catalogue.Offer("hfg.nodes.logic"),))
    assert main(["nodes", what]) == 0
    assert "FlipFlop" in capsys.readouterr().out
    assert str(strange) not in sys.path


def test_a_run_is_looked_for_before_modules_of_the_folder_can_be_imported(
    strange: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def finds(_name: str) -> list[object]:
        assert str(strange) not in sys.path
        raise TargetError("there is no such run")

    monkeypatch.setattr("hfg.cli.tap.find", finds)
    assert main(["tap", "fetch", "camera.out"]) == 2


@pytest.mark.parametrize("place", ["fetch.py", "fetch/__init__.py"])
def test_the_name_of_a_run_is_never_that_of_a_module(
    strange: Path, place: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder from somebody else would run code because its user looks at a run from within it."""
    monkeypatch.setenv("XDG_STATE_HOME", str(strange / "state"))
    (strange / place).parent.mkdir(exist_ok=True)
    (strange / place).write_text(PLANTED + GRAPH)
    assert main(["tap", "fetch", "camera.out"]) == 2
    assert '"fetch" names a run: to run a graph, name its file, as in hfg tap fetch.py' in capsys.readouterr().err


@pytest.mark.parametrize("line", ["hfg tap fetch c", "hfg run fetch --param x", "hfg check fetch --param x"])
def test_the_tab_key_imports_nothing_for_one_word(strange: Path, line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (strange / "fetch.py").write_text(PLANTED + GRAPH)
    monkeypatch.setenv("_HFG_COMPLETE", "complete_fish")
    monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
    with pytest.raises(SystemExit):
        main([])


@pytest.mark.parametrize(("place", "named"), [("webcam.py", "webcam.py"), ("webcam/__init__.py", "webcam.nodes")])
def test_to_look_up_a_type_that_is_not_installed_runs_no_code_of_the_folder(
    strange: Path, place: str, named: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(strange / "cache"))
    monkeypatch.setattr("hfg.catalogue.finding.offers", lambda: (catalogue.Offer("hfg.nodes.logic"),))
    monkeypatch.setattr("hfg.catalogue.keeping.offers", lambda: (catalogue.Offer("hfg.nodes.logic"),))
    (strange / place).parent.mkdir(exist_ok=True)
    (strange / place).write_text(PLANTED)
    assert main(["nodes", "webcam"]) == 2
    assert named in capsys.readouterr().err

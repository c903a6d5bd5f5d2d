"""A graph file has no function called but those that are declared for it, and reads no file elsewhere (rule L4)."""

from __future__ import annotations

import json
import os
import sys
import textwrap
from pathlib import Path
from urllib.parse import quote

import pytest

import hfg
from hfg.base.whole import GrowingFile
from hfg.cli import main
from hfg.encoding import find_reference
from hfg.errors import EncodingError, FileError

pytestmark = pytest.mark.rule("L4")

EDGE = """
    hfg: 1
    nodes:
      src: {type: 'hfg.testing.nodes:Script'}
      show: {type: 'hfg.nodes.display.text:TextDisplay'}
    edges:
      - src.seen -> show.show:
          through:
    """


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the files are, and where `touch ran` would leave its mark."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*sys.path])
    return tmp_path


def write(text: str, name: str = "a.hfg.yaml") -> Path:
    file = Path(name)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(textwrap.dedent(text).lstrip())
    return file


def through(*operators: object) -> Path:
    return write(textwrap.dedent(EDGE) + "".join(f"        - {json.dumps(one)}\n" for one in operators))


def mapped(reference: str) -> Path:
    value = {"$type": "reference", "value": reference}
    return through({"type": "reactivex.operators:map", "arguments": [value]})


@pytest.mark.parametrize(
    "name", ["asyncio.base_events.os.system", "Observable", "Any", "pipe", "_map.os.system", "__builtins__.exec"]
)
def test_an_operator_of_reactivex_is_one_that_it_lists(name: str) -> None:
    file = through({"type": f"reactivex.operators:{name}", "arguments": ["touch ran"]})
    with pytest.raises(FileError, match="has no"):
        hfg.load(file)
    assert not Path("ran").exists()


@pytest.mark.parametrize("verb", ["check", "draw", "convert", "run", "play"])
def test_no_verb_runs_what_an_operator_leads_to(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(through({"type": "reactivex.operators:asyncio.base_events.os.system", "arguments": ["touch ran"]}))
    assert main(["play", "x.mcap", "--into", file] if verb == "play" else [verb, file]) != 0
    assert "has no" in "".join(capsys.readouterr())
    assert not Path("ran").exists()


@pytest.mark.parametrize(
    "reference",
    [
        "os:system",
        "subprocess:Popen",
        "builtins:exec",
        "numpy:load",
        "hfg:load",
    ],
)
def test_a_file_refers_to_no_function_that_just_is_there(reference: str) -> None:
    with pytest.raises(FileError, match="must not have any function called"):
        hfg.load(mapped(reference))


def test_modules_that_are_allowed_and_not_wanted_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    (file := Path("plain.hfg.yaml")).write_text("hfg: 1\nnodes:\n  a: {type: 'hfg.testing.nodes:Script'}\n")
    hfg.load(file, allow=["nope"])
    assert 'plain.hfg.yaml: "nope" is allowed, but the file wants no code of it; leave it out' in caplog.text
    hfg.load(file, allow=["nope", "json"])
    assert '"nope" and "json" are allowed, but the file wants no code of them; leave them out' in caplog.text


def test_a_function_of_an_allowed_module_may_be_referred_to_and_nothing_that_it_has_imported() -> None:
    write("from os import system\ndef twice(x): return 2 * x\n", "my_functions.py")
    assert hfg.load(mapped("my_functions:twice"), allow=["my_functions"]).nodes
    with pytest.raises(FileError, match=r"hfg.load\(..., allow=\[\"my_functions\"\]\)"):
        hfg.load(mapped("my_functions:twice"))  # although it is imported now
    with pytest.raises(FileError, match="must not have any function called"):
        hfg.load(mapped("my_functions:system"), allow=["my_functions"])


def test_types_of_data_may_be_referred_to() -> None:
    assert hfg.load(mapped("builtins:str")).nodes
    assert hfg.load(mapped("datetime:timedelta")).nodes


def test_a_name_leads_through_classes_and_through_no_module() -> None:
    assert find_reference("collections.abc:Mapping.get")
    with pytest.raises(EncodingError, match="has no"):
        find_reference("hfg.registry:importlib.import_module")


@pytest.mark.parametrize("module", ["evil-mod", "evil mod", "evil.", "9evil"])
def test_what_is_no_name_of_a_module_is_not_imported(module: str) -> None:
    write("open('ran', 'w')", f"{module}.py")
    sys.path.insert(0, str(Path.cwd()))
    file = write(f"hfg: 1\nnodes:\n  n: {{type: '{module}:n'}}")
    with pytest.raises(FileError, match="is no name of a module"):
        hfg.load(file)
    assert not Path("ran").exists()


def test_a_type_of_a_port_imports_no_program_of_an_imported_package() -> None:
    write("", "given_package/__init__.py")
    write("open('ran', 'w')", "given_package/__main__.py")
    sys.path.insert(0, str(Path.cwd()))
    import given_package  # type: ignore[import-not-found]  # noqa: F401

    file = write("hfg: 1\ninputs: {a: given_package.__main__.T}")
    with pytest.raises(FileError, match="is a program"):
        hfg.load(file)
    assert not Path("ran").exists()


def test_another_file_is_included_by_its_name_alone(folder: Path) -> None:
    other = write("hfg: 1\nnodes: {}\n", "elsewhere/part.hfg.yaml").resolve()
    quoted = quote(str(other), safe="").replace(".", "%2E")
    file = write(f"hfg: 1\nnodes:\n  n: {{type: 'hfg.files.boxes:File[{quoted}]'}}", "project/a.hfg.yaml")
    with pytest.raises(FileError, match="include that, with file: below the node"):
        hfg.load(file)


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="this system opens through links")
@pytest.mark.parametrize("how", ["symbolic link", "hard link", "pipe"])
def test_a_growing_file_is_not_written_into_what_stands_in_its_place(how: str) -> None:
    prey, part = Path("prey"), Path("run.mcap.part")
    prey.write_text("precious")
    if how == "symbolic link":
        part.symlink_to(prey)
    elif how == "hard link":
        part.hardlink_to(prey)
    else:
        os.mkfifo(part)
    with pytest.raises(OSError):  # noqa: PT011 - of the system
        GrowingFile(Path("run.mcap"), append=False, at_once=True)
    assert prey.read_text() == "precious"


def test_a_growing_file_takes_the_place_of_what_an_earlier_one_left() -> None:
    Path("run.mcap.part").write_text("what was left, and is longer")
    file = GrowingFile(Path("run.mcap"), append=False, at_once=True)
    file.write(b"new")
    file.complete()
    assert Path("run.mcap").read_text() == "new"


def test_a_name_of_a_module_may_be_too_long_for_a_file() -> None:
    file = write(f"hfg: 1\nnodes:\n  n: {{type: 'a{'9' * 5000}:n'}}")
    assert list(hfg.load(file).nodes) == ["n"]  # whose type is missing, like that of any other unknown module


def test_a_name_of_an_included_file_may_be_too_long_for_the_system() -> None:
    file = write(f"hfg: 1\nnodes:\n  n: {{file: {'a' * 5000}}}")
    with pytest.raises(FileError, match="cannot be the name of a file"):
        hfg.load(file)

"""`hfg new node|graph|plugin NAME`: begins a file and its test, or a package, from the texts in `templates/`."""

from __future__ import annotations

import keyword
import re
import sys
from collections.abc import Mapping
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final

import typer

from hfg.cli import show
from hfg.errors import TargetError

verbs = typer.Typer()

Name = Annotated[str, typer.Argument(help="as in map_lookup, MapLookup or nodes/map_lookup.py")]

_LONGEST_NAME = 40  # a longer one would make lines that formatters break
_PLUGIN: Final = {
    "pyproject.toml": "project",
    "README.md": "readme",
    "src/{module}/nodes.py": "nodes",
    "tests/test_{module}.py": "test_of_nodes",
}
"""The files of a package with their templates."""
_PLUGIN_EMPTY: Final = {"src/{module}/__init__.py": '"""Node types for hfg."""\n', "src/{module}/py.typed": ""}


@verbs.callback()
def new() -> None:
    """Create a node type, a graph or a package, with tests."""


@verbs.command("node")
def _node(name: Name) -> int:
    """Write a node type with ports of all kinds, and its test."""
    return _write(name, "node", "")


@verbs.command("graph")
def _graph(name: Name) -> int:
    """Write a graph of three nodes, and its test."""
    return _write(name, "graph", "run")


@verbs.command("plugin")
def _plugin(
    name: Annotated[str, typer.Argument(help="of the package, as in my_lamps, MyLamps or plugins/my-lamps")],
) -> int:
    """Write a package with a node type, its test and the entry point that hfg needs."""
    parent, module = _place(name)
    if find_spec(module) is not None:
        raise TargetError(f'there is a module "{module}" already, which the package would hide: take another name')
    folder = parent / module.replace("_", "-")
    if folder.is_symlink() or folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise TargetError(f"{folder} is there already and not empty: hfg new overwrites nothing; take another name")
    words = _words(module) | {"distribution": folder.name}
    texts = {place: filled(template, words) for place, template in _PLUGIN.items()} | _PLUGIN_EMPTY
    write_all({folder / place.format(**words): text for place, text in texts.items()})
    show.write(f"{folder} is there; try pip install -e {folder}, then hfg nodes {words['Name']} and pytest {folder}\n")
    return 0


def _words(module: str) -> dict[str, str]:
    return {"module": module, "Name": "".join(word.capitalize() for word in module.split("_"))}


def filled(template: str, words: Mapping[str, str]) -> str:
    """Return the text of a template; braces of the text itself are doubled in it."""
    return files("hfg.cli").joinpath("templates", f"{template}.txt").read_text("utf-8").format(**words)


def write_all(texts: Mapping[Path, str]) -> None:
    """Write files that are not there yet, with the folders they lie in."""
    for file, text in texts.items():
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            with file.open("x", encoding="utf-8") as stream:
                stream.write(text)
        except OSError as error:
            raise TargetError(f"{file} cannot be written: {error.strerror}") from None


def _write(named: str, template: str, verb: str) -> int:
    file = _file(named)
    tests = file.with_name(f"test_{file.name}")
    for one in (file, tests):
        if one.exists() or one.is_symlink():
            raise TargetError(f"{one} is there already: hfg new overwrites nothing; take another name")
    words = _words(file.stem)
    write_all({file: filled(template, words), tests: filled(f"test_of_{template}", words)})
    next_step = f"hfg run {file}" if verb else f"hfg nodes {file}"
    show.write(f"{file} and {tests} are there; try {next_step} and pytest {tests}\n")
    return 0


def _file(named: str) -> Path:
    """The file that is meant, in snake case."""
    parent, module = _place(named.removesuffix(".py"))
    return parent / f"{module}.py"


def _place(named: str) -> tuple[Path, str]:
    """Return the folder and the name of the module, in snake case.

    Raises:
      TargetError: no module can be named so.
    """
    place = Path(named)
    module = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", place.name).replace("-", "_").lower()
    if not module.isidentifier() or keyword.iskeyword(module) or module.startswith(("_", "test_")):
        raise TargetError(f'"{named}" names no module: letters, digits and _, no word of Python, as in map_lookup')
    if not module.isascii() or len(module) > _LONGEST_NAME:
        raise TargetError(f'"{named}" is not a good name for a file: take up to {_LONGEST_NAME} letters of a to z')
    if module in sys.stdlib_module_names or module == "hfg":
        raise TargetError(f'a module {module} would hide the module "{module}" of Python or hfg: take another name')
    if not place.parent.is_dir():
        raise TargetError(f"there is no folder {place.parent}: make it first")
    return place.parent, module

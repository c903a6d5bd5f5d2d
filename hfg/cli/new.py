"""`hfg new node|graph NAME`: begins a file, and its test beside it. Stands on `templates`."""

from __future__ import annotations

import keyword
import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from hfg.cli import templates
from hfg.errors import TargetError

__all__ = ["new"]

new = typer.Typer(help="Begin a node type or a graph: a file that works, and its test.")

Name = Annotated[str, typer.Argument(help="as in map_lookup, MapLookup or nodes/map_lookup.py")]

_LONGEST_NAME = 40  # a longer one would make lines that formatters break


@new.command("node")
def _node(name: Name) -> int:
    """Write a node type with ports of all kinds, and its test."""
    return _write(name, templates.NODE, templates.NODE_TEST, "")


@new.command("graph")
def _graph(name: Name) -> int:
    """Write a graph of three nodes, and its test."""
    return _write(name, templates.GRAPH, templates.GRAPH_TEST, "run")


def _write(named: str, code: str, test: str, verb: str) -> int:
    file = _file(named)
    tests = file.with_name(f"test_{file.name}")
    for one in (file, tests):
        if one.exists() or one.is_symlink():
            raise TargetError(f"{one} is there already: hfg new overwrites nothing; take another name")
    words = {"module": file.stem, "Name": "".join(word.capitalize() for word in file.stem.split("_"))}
    for one, template in ((file, code), (tests, test)):
        try:
            with one.open("x", encoding="utf-8") as stream:
                stream.write(template.format(**words))
        except OSError as error:
            raise TargetError(f"{one} cannot be written: {error.strerror}") from None
    next_step = f"hfg run {file}" if verb else f"hfg nodes {file}"
    sys.stdout.write(f"{file} and {tests} are there; try {next_step} and pytest {tests}\n")
    return 0


def _file(named: str) -> Path:
    """The file that is meant, in snake case.

    Raises:
      TargetError: no module can be named so.
    """
    place = Path(named)
    stem = place.stem if place.suffix == ".py" else place.name
    module = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", stem).replace("-", "_").lower()
    if not module.isidentifier() or keyword.iskeyword(module) or module.startswith(("_", "test_")):
        raise TargetError(f'"{named}" names no module: letters, digits and _, as in map_lookup')
    if not module.isascii() or len(module) > _LONGEST_NAME:
        raise TargetError(f'"{named}" is no good name for a file: take up to {_LONGEST_NAME} letters of a to z')
    if module in sys.stdlib_module_names or module == "hfg":
        raise TargetError(f'a file {module}.py would hide the module "{module}" of Python or hfg: take another name')
    if not place.parent.is_dir():
        raise TargetError(f"there is no folder {place.parent}: make it first")
    return place.with_name(f"{module}.py")

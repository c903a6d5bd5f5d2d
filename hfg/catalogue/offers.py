"""Where node types may be: the standard library, what installed distributions offer, and the project's own folder.

A distribution offers node types by an entry point in the group `hfg.nodes`, whose value names a module, a package (then
all in it counts) or one node type, "package.module:Name". Stands on importlib; imports none of those places.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Final

import msgspec

__all__ = ["LIBRARY", "Offer", "allowed_packages", "is_allowed", "offers"]

LIBRARY: Final = "hfg.nodes"
"""The package of the standard library, and the name of the group of entry points."""


class Offer(msgspec.Struct, frozen=True):
    """A module or package with node types.

    Attributes:
      module: its name, or as the entry point has it.
      name: of one node type in it, or "" for all of them.
      origin: who says so, for messages: "" for the standard library, else the entry point and its distribution.
    """

    module: str
    name: str = ""
    origin: str = ""


def offers() -> tuple[Offer, ...]:
    """Give the standard library first, then what is installed, by the names of the entry points."""
    return (Offer(LIBRARY), *_installed())


def _installed() -> Iterator[Offer]:
    found = sorted(entry_points(group=LIBRARY), key=lambda entry: (entry.name, entry.value))
    seen: set[tuple[str, str]] = set()
    for entry in found:
        module, _, name = (part.strip() for part in entry.value.partition("[")[0].partition(":"))
        if (module, name) not in seen:  # an editable installation beside another one gives each twice
            seen.add((module, name))
            yield Offer(module, name, _origin(entry))


def _origin(entry: EntryPoint) -> str:
    distribution = entry.dist.name if entry.dist is not None else "a distribution without a name"
    return f'the entry point "{entry.name}" of {distribution}'


def allowed_packages(project: Path | str | None = None) -> frozenset[str]:
    """Give the modules and packages from which a graph file may name node types without being told otherwise.

    The standard library, what installed distributions offer, and what lies in the project's folder or in its `src`.
    Nothing is imported.

    Args:
      project: the folder; the working directory if not given.
    """
    allowed = {offer.module for offer in offers()}
    folder = Path.cwd() if project is None else Path(project)
    allowed.update(_modules_in([folder, folder / "src"]))
    return frozenset(allowed)


def _modules_in(folders: Iterable[Path]) -> Iterator[str]:
    for folder in folders:
        try:
            entries = sorted(folder.iterdir())
        except OSError:  # there is no src, or nobody may look
            continue
        for entry in entries:
            name = entry.stem if entry.suffix == ".py" else entry.name
            # A folder without Python files is no package, whatever it is called; a file random.py would not be found.
            is_module = entry.suffix == ".py" or (entry.is_dir() and any(entry.glob("*.py")))
            if is_module and name.isidentifier() and name not in sys.stdlib_module_names and name != "hfg":
                yield name


def is_allowed(module: str, allowed: Iterable[str]) -> bool:
    """Say whether a module is one of the allowed packages or lies in one.

    Example:
      >>> is_allowed("hfg.nodes.flow", {"hfg.nodes"}), is_allowed("os", {"hfg.nodes"}), is_allowed("hfg", {"hfg.nodes"})
      (True, False, False)
    """
    return any(f"{module}.".startswith(f"{one}.") for one in allowed)

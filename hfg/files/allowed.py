"""Which modules a graph file may have imported: reading a file runs no other code (docs/howto/files.md).

Allowed are hfg itself, packages that installed node types (entry points `hfg.nodes`), modules of the file's own
project, what the caller allows, and what the program has imported already. Stands on the catalogue's offers.
"""

from __future__ import annotations

import ast
import functools
import importlib.util
import sys
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Final

__all__ = ["Allowed", "installed_packages", "project_of"]

_ALWAYS: Final = ("hfg", "reactivex.operators")
_MARK: Final = "pyproject.toml"


def project_of(file: Path) -> Path:
    """Give the folder that a file's modules and included files lie in.

    The nearest one upwards with a pyproject.toml, else the file's own.
    """
    folder = file.resolve().parent
    return next((one for one in (folder, *folder.parents) if (one / _MARK).is_file()), folder)


@functools.cache
def installed_packages() -> tuple[str, ...]:
    """Give the packages whose distributions say that they have node types."""
    from hfg.catalogue.offers import offers

    return tuple(sorted({offer.module.partition(".")[0] for offer in offers()}))


class Allowed:
    """What one file, and those it includes, may import.

    Attributes:
      project: the folder whose modules are allowed.
    """

    def __init__(self, file: Path, extra: Iterable[str] = ()) -> None:
        self.project = project_of(file)
        self._folder = file.resolve().parent
        self._extra = tuple(extra)

    def refusal(self, module: str) -> str | None:
        """Say why a module must not be imported, with the remedy; None if it may be."""
        if module in sys.modules or _is_in(module, (*_ALWAYS, *self._extra)):
            return None
        top = module.partition(".")[0]
        if not top.isidentifier() or self._is_ours(top) or _is_in(module, installed_packages()):
            return None  # what is no name is told by whoever looks for it
        if _spec(top) is None:
            return None  # there is none, which is told as well
        return (
            f'module "{module}" is not one that this file may import, as a file alone must not run code: it is neither '
            f"in the project {self.project.name} nor installed for hfg; if you trust it allow it, with --allow "
            f'{top} or hfg.load(..., allow=["{top}"])'
        )

    def refusal_of_type(self, text: str) -> str | None:
        """Say the same of the modules that a type written as a text names."""
        return next((why for module in _modules_in(text) if (why := self.refusal(module)) is not None), None)

    def _is_ours(self, top: str) -> bool:
        """Whether a module lies in the project; one beside the file is made importable."""
        spec = _spec(top)
        if spec is None:
            for folder in dict.fromkeys((self._folder, self.project, self.project / "src")):
                if (folder / f"{top}.py").is_file() or (folder / top).is_dir():
                    sys.path.append(str(folder))
                    importlib.invalidate_caches()
                    return True
            return False
        places = [spec.origin] if spec.origin else list(spec.submodule_search_locations or ())
        return any(self._holds(Path(place)) for place in places)

    def _holds(self, place: Path) -> bool:
        try:
            within = place.resolve().relative_to(self.project)
        except ValueError:
            return False
        return not {"site-packages", "dist-packages"} & set(within.parts)


def _is_in(module: str, packages: Iterable[str]) -> bool:
    return any(module == one or module.startswith(f"{one}.") for one in packages)


def _spec(top: str) -> ModuleSpec | None:
    """Where a module would come from; a name without dots is looked for and not imported."""
    try:
        return importlib.util.find_spec(top)
    except (ImportError, ValueError):
        return None


def _modules_in(text: str) -> Iterator[str]:
    """The modules that may be imported to find what a text names: the longest that is imported already, or all."""
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return  # told where it is read
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            parts = ast.unparse(node).split(".")
            if all(part.isidentifier() for part in parts):
                modules = [".".join(parts[:end]) for end in range(len(parts) - 1, 0, -1)]
                yield next((one for one in modules if one in sys.modules), modules[0])

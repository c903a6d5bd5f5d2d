"""Which modules a graph file may have imported: reading a file runs no other code (docs/howto/files.md, rule L4).

Allowed are hfg itself, packages that installed node types (entry points `hfg.nodes`), what the program has imported
already, and what the caller allows; a module beside the file is not, as it came with the file. To be imported already
does not make all that a module holds open to files: they name node types, operators and types of data, and other
functions only of modules that the caller allows. Depends on the catalogue's offers.
"""

from __future__ import annotations

import ast
import functools
import importlib.util
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Final

from hfg.base.sources import is_open_to_all
from hfg.encoding import is_data_type
from hfg.files import boxes
from hfg.graph.structure.operators import OperatorFunction
from hfg.nodetypes.description import look_up
from hfg.nodetypes.functions import NodeFunction
from hfg.nodetypes.node import Node

_ALWAYS: Final = ("hfg", "reactivex.operators")
_REMEDY: Final = '--allow {top} or hfg.load(..., allow=["{top}"])'
_MARK: Final = "pyproject.toml"
_PLAIN: Final = (bool, int, float, complex, str, bytes, list, tuple, dict, set, frozenset)


def project_of(file: Path) -> Path:
    """Return the folder that a file's modules and included files lie in.

    The nearest one upwards with a pyproject.toml, else the file's own. In a folder like /tmp, another user can have put
    one there.
    """
    folder = file.resolve().parent
    around = (one for one in (folder, *folder.parents) if (one / _MARK).is_file() and not is_open_to_all(one))
    return next(around, folder)


@functools.cache
def installed_packages() -> tuple[str, ...]:
    """Return the packages whose distributions say that they have node types."""
    from hfg.catalogue.offers import offers

    return tuple(sorted({offer.module.partition(".")[0] for offer in offers()}))


class Allowed:
    """The modules that one file, and those it includes, may import.

    Args:
      file: the one.
      extra: packages that are allowed.
      remedy: how they are allowed, with the package as {top}.

    Attributes:
      project: the folder in which modules that are allowed are looked for, and in which included files lie.
      wanted: the modules that were refused, in order, as they would be allowed.
    """

    def __init__(self, file: Path, extra: Iterable[str] = (), remedy: str = _REMEDY) -> None:
        self.project = project_of(file)
        self._folder = file.resolve().parent
        self._extra = tuple(extra)
        self._remedy = remedy
        self.wanted: dict[str, None] = {}
        self._asked: set[str] = set()

    def unneeded(self) -> str | None:
        """Return a sentence about packages that are allowed although nothing has asked for them; None without any."""
        extra = [f'"{one}"' for one in self._extra if not any(_is_in(module, (one,)) for module in self._asked)]
        if not extra:
            return None
        names, pronoun = " and ".join(extra), "it" if len(extra) == 1 else "them"
        verb = "is" if len(extra) == 1 else "are"
        return (
            f"{names} {verb} allowed, but the file wants no code of {pronoun}; leave {pronoun} out, or correct the name"
        )

    def refusal(self, module: str) -> str | None:
        """Return why a module must not be imported, with the remedy; None if it may be."""
        self._asked.add(module)
        if module in sys.modules:
            return None
        if module.endswith(".__main__"):
            return f'"{module:.80}" is a program, no module; name the module that has what this file needs'
        if _is_in(module, _ALWAYS) or _is_in(module, installed_packages()):
            return None
        if not module:
            return None  # which is reported where it is looked up
        parts = module.split(".")
        if not all(part.isidentifier() for part in parts):
            return f'"{module:.80}" is no name of a module; write "module:name", as in "my_robot.nodes:Camera"'
        top = parts[0]
        spec, folder = _spec(top), None
        if spec is None:
            folder = self._folder_of(top)
        if folder is not None and is_open_to_all(folder):
            return (
                f'module "{module}" would come from {_place(None, folder, top)}, and every user may put modules into '
                "that folder; move the file and its modules into a folder of yours"
            )
        if _is_in(module, self._extra):
            if folder is not None:
                sys.path.append(str(folder))
                importlib.invalidate_caches()
            return None
        if spec is None and folder is None:
            return None  # there is none, which is reported as well
        self.wanted[top] = None
        return (
            f'module "{module}" is not one that this file may import, as a file alone must not run code (it would come '
            f"from {_place(spec, folder, top)}); if you trust it allow it, with "
            f"{self._remedy.format(top=top)}"
        )

    def refusal_of_value(self, reference: str, found: object) -> str | None:
        """Return why a value must not be what a reference stands for, though its module may be imported."""
        module = reference.partition(":")[0]
        if isinstance(found, NodeFunction | OperatorFunction) or _is_declared(found):
            return None
        top = module.partition(".")[0]
        if _is_in(module, self._extra) and str(getattr(found, "__module__", "")).partition(".")[0] == top:
            return None
        sentence = f'"{reference:.80}" is {found!r:.80}, and a file alone must not have any function called'
        if top in sys.stdlib_module_names:
            return f"{sentence}; name a function of yours that calls it, with @hfg.operator or @hfg.node above"
        self.wanted[top] = None
        return (
            f"{sentence}; write @hfg.operator or @hfg.node above it, or if you trust the module allow it, with "
            f"{self._remedy.format(top=top)}"
        )

    def refusal_of_reference(self, reference: str) -> str | None:
        """Return why what is named must not be looked for."""
        module, colon, name = reference.partition(":")
        if module == boxes.__name__ and name.startswith("File["):
            return f'"{reference:.80}" stands for another file; include that, with file: below the node'
        return self.refusal(module) if colon else None

    def refusal_of_type(self, text: str) -> str | None:
        """Return the same of the modules that a type written as a text names."""
        return next((why for module in _modules_in(text) if (why := self.refusal(module)) is not None), None)

    def _folder_of(self, top: str) -> Path | None:
        """The folder in which a module lies that Python does not find by itself."""
        for folder in dict.fromkeys((self._folder, self.project, self.project / "src")):
            with suppress(OSError):  # no file has a name that is longer than the system allows
                if (folder / f"{top}.py").is_file() or (folder / top).is_dir():
                    return folder
        return None


def _is_declared(found: object) -> bool:
    """Return whether that is a class of nodes or of data, which a file may name."""
    return isinstance(found, type) and (found in _PLAIN or issubclass(found, Node) or is_data_type(found))


def _place(spec: ModuleSpec | None, folder: Path | None, top: str) -> str:
    """Where a module would come from."""
    if folder is not None:
        file = folder / f"{top}.py"
        return str(file if file.is_file() else folder / top)
    if spec is None:
        return "nowhere"
    return spec.origin or next(iter(spec.submodule_search_locations or ()), "built in")


def _is_in(module: str, packages: Iterable[str]) -> bool:
    return any(module == one or module.startswith(f"{one}.") for one in packages)


def _spec(top: str) -> ModuleSpec | None:
    """Where a module would come from; a name without dots is looked for and not imported."""
    try:
        return importlib.util.find_spec(top)
    except (ImportError, ValueError):
        return None


def _modules_in(text: str) -> Iterator[str]:
    """The modules that are imported to find what a text names: none but the one that has it already, or the longest."""
    try:
        tree = ast.parse(text, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return  # told where it is read
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            parts = ast.unparse(node).split(".")
            if all(part.isidentifier() for part in parts):
                modules = [".".join(parts[:end]) for end in range(len(parts) - 1, 0, -1)]
                known = (one for one in modules if one in sys.modules and _has(one, parts))
                yield next(known, modules[0])


def _has(module: str, parts: list[str]) -> bool:
    """Return whether a module that is imported has what a type names, so that no other is imported to look for it."""
    return look_up(module, ".".join(parts[module.count(".") + 1 :])) is not None

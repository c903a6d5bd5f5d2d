"""Packages that import their public names when they are first used (PEP 562). Depends on nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import Any


def on_demand(package: str, names: Mapping[str, Iterable[str]]) -> Callable[[str], Any]:
    """Return a `__getattr__` for a package: it imports names from their modules, and submodules by their names.

    Type checkers do not see what it finds: import the names under `TYPE_CHECKING` too, and define `__getattr__` outside
    of it, because they would accept any name otherwise.

    Args:
      package: the name of the package.
      names: the public names by the submodule that has them, such as {"graph": ["Graph", "Subgraph"]}.
    """
    home_of = {name: home for home, listed in names.items() for name in listed}

    def find(name: str) -> Any:
        if name in home_of:
            found = getattr(import_module(f"{package}.{home_of[name]}"), name)
        else:
            found = submodule(name)
        setattr(sys.modules[package], name, found)  # Python asks only once
        return found

    def submodule(name: str) -> Any:
        module = f"{package}.{name}"
        if not name.startswith("_"):
            try:
                return import_module(module)
            except ModuleNotFoundError as error:
                if error.name != module:  # the module exists, something that it imports does not
                    raise
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return find

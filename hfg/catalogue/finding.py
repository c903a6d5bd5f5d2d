"""Imports the places and lists the node types in them; reports each broken place in one message and continues.

A module offers the node types that it declares under public names, and those that its `__all__` lists. A module that
makes its types on demand, or wants to offer others, has a function `__node_types__()` that returns them. Packages are
walked, except modules whose names begin with an underscore, and tests. Depends on `offers` and `describing`.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from hfg.catalogue.describing import TypeDescription, describe_type
from hfg.catalogue.offers import Offer, offers
from hfg.errors import in_words
from hfg.graph import Subgraph
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.functions import FunctionNode, NodeFunction
from hfg.nodetypes.node import Node

_BASES: Final = (Node, Subgraph, FunctionNode)
_TESTS: Final = ("test", "tests", "conftest")


@dataclass(frozen=True, slots=True)
class Catalogue:
    """The node types that were found.

    Attributes:
      types: each once, in the order of their places.
      problems: a message for each broken place.
    """

    types: tuple[TypeDescription, ...] = ()
    problems: tuple[str, ...] = ()


def installed(of: Iterable[Offer] | None = None) -> Catalogue:
    """Import the standard library and all installed distributions, and list the node types that they offer.

    Args:
      of: other places instead of those.
    """
    search = _Search()
    for offer in offers() if of is None else of:
        search.offer(offer)
    return search.catalogue()


def types_of(module: ModuleType | str) -> Catalogue:
    """List the node types of a module, or of a package and the modules in it.

    Args:
      module: a module or a name; a name is imported. If this fails, the catalogue is empty and has the reason.
    """
    search = _Search()
    if isinstance(module, str):
        search.offer(Offer(module))
    else:
        search.module(module)
    return search.catalogue()


class _Search:
    """Goes from offer to offer; a type with several offers is listed where it is found first."""

    def __init__(self) -> None:
        self.found: list[TypeDescription] = []
        self.problems: list[str] = []
        self._seen: set[int] = set()

    def catalogue(self) -> Catalogue:
        return Catalogue(tuple(self.found), tuple(self.problems))

    def offer(self, offer: Offer) -> None:
        module = self._attempt(offer.module, offer.origin, lambda: importlib.import_module(offer.module))
        if module is None:
            return
        if not offer.name:
            self.module(module)
            return
        value: Any = module
        for part in offer.name.split("."):
            value = getattr(value, part, None)
        kind = _type_in(value)
        if kind is not None:
            self._add([kind], offer.module)
        elif isinstance(value, ModuleType):
            self.module(value)
        else:
            said = "has no such name" if value is None else "is neither a node type nor a module"
            self.problems.append(f"{offer.origin} names {offer.module}:{offer.name}, which {said}: correct its value")

    def module(self, module: ModuleType) -> None:
        """List the types of a module, then those of the modules in it."""
        offered = getattr(module, "__node_types__", None)
        kinds = self._attempt(module.__name__, "", lambda: list(_offered(offered) if offered else _declared(module)))
        self._add(kinds or [], module.__name__)
        for name in submodules(module):
            inner = self._attempt(name, "", lambda name=name: importlib.import_module(name))  # type: ignore[misc]
            if inner is not None:
                self.module(inner)

    def _add(self, kinds: Iterable[NodeType], module: str) -> None:
        for kind in kinds:
            if id(kind.origin) not in self._seen:
                self._seen.add(id(kind.origin))
                self.found.append(describe_type(kind, offered_by=module))

    def _attempt(self, name: str, origin: str, action: Callable[[], Any]) -> Any:
        """Run a user's code. Return its result; None if it fails, whatever it raises, and record a message."""
        try:
            return action()
        except Exception as error:
            self.problems.append(_sentence(name, origin, error))
        except SystemExit:
            told = f"{name}{_by(origin)} called sys.exit when it was imported"
            self.problems.append(f'{told}; put what it runs under if __name__ == "__main__":')
        return None


def _sentence(name: str, origin: str, error: Exception) -> str:
    if isinstance(error, ModuleNotFoundError) and error.name is not None:
        if f"{name}.".startswith(f"{error.name}."):
            return f'there is no module "{name}"{_by(origin).rstrip(",")}: is it installed, and spelled like that?'
        return f'{name}{_by(origin)} needs the module "{error.name}", which is not installed'
    where = next(
        (f" ({Path(one.filename).name}:{one.lineno})" for one in reversed(traceback.extract_tb(error.__traceback__))),
        "",
    )
    return f"{name}{_by(origin)} cannot be imported: {' '.join(in_words(error).split())}{where}"


def _by(origin: str) -> str:
    return f", which {origin} names," if origin else ""


def _offered(offered: Callable[[], Iterable[Any]]) -> Iterator[NodeType]:
    for value in offered():
        kind = _type_in(value)
        if kind is None:
            raise TypeError(f"__node_types__() returned {value!r:.80}, which is not a node type")
        yield kind


def _declared(module: ModuleType) -> Iterator[NodeType]:
    """Yield the types that a module, or a package and its modules, declares or lists, in order."""
    listed = getattr(module, "__all__", ())
    for name, value in list(vars(module).items()):
        kind = None if name.startswith("_") else _type_in(value)
        if kind is not None and (name in listed or f"{kind.module}.".startswith(f"{module.__name__}.")):
            yield kind


def _type_in(value: Any) -> NodeType | None:
    """Return the type of a node function or a class of nodes; None for anything else."""
    if isinstance(value, NodeFunction) or (
        inspect.isclass(value) and issubclass(value, Node) and value not in _BASES and not inspect.isabstract(value)
    ):
        kind: NodeType = value._type
        return kind
    return None


def submodules(package: ModuleType) -> list[str]:
    """Return the names of the modules in a package, one level deep."""
    path = getattr(package, "__path__", ())
    return [
        f"{package.__name__}.{one.name}"
        for one in sorted(pkgutil.iter_modules(path), key=lambda one: one.name)
        if not one.name.startswith(("_", "test_")) and one.name not in _TESTS
    ]

"""Finds the graph of a TARGET: in a module or Python file, as a graph or a function that builds one, or a graph file.

A target is `module:graph`, `file.py`, `file.py:graph`, `file.hfg.yaml` or `file.apex`. A file or module is imported as
Python itself would import it, except that nothing else is imported from a folder in which every user may put modules,
such as /tmp (rule L5). Depends on `arguments`, the files' floor and the graph floor.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import typing
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from hfg.base.sources import is_open_to_all, spec_of_file
from hfg.cli.arguments import builder_arguments
from hfg.errors import TargetError, in_words
from hfg.files import apex, load
from hfg.graph import Graph
from hfg.nodetypes.functions import NodeFunction
from hfg.nodetypes.node import Node

SUFFIXES: Final = (".apex", ".apexs")
"""Of files of CS::APEX."""


def load_graph(target: str, given: Sequence[str] | None = None, allow: Sequence[str] | None = None) -> Graph:
    """Import the target. Return its graph, which is built if necessary.

    Args:
      target: as users write it.
      given: arguments of the function that builds it, "count=3" each.
      allow: packages that a graph file may import, too.

    Raises:
      FileError: a graph file describes no graph.
      TargetError: there is no such file, module or name, its code fails, or the name is not of a graph; `__cause__` is
        the user's exception.
    """
    given = given or ()
    if target.endswith((".yaml", ".yml")):
        if given:
            raise TargetError(f"{target} is a graph file, not a function, so --arg {given[0]} means nothing to it")
        return load(target, allow=allow or ())
    if target.endswith(SUFFIXES):
        for option, values in (("--arg", given), ("--allow", allow)):
            if values:
                raise TargetError(f"{target} is a file of CS::APEX, so {option} {values[0]} means nothing to it")
        return apex.load(target)
    if allow:
        raise TargetError(
            f"{target} is code, which imports what it likes, so --allow {allow[0]} means nothing to it; leave it out"
        )
    place, name = _split(target)
    module = load_module(place)
    found = _named(module, name, place, bool(given)) if name else _only(module, place, bool(given))
    if isinstance(found, Graph):
        if given:
            raise TargetError(f"{place} holds a graph that is built already, so --arg {given[0]} means nothing to it")
        return found
    arguments = builder_arguments(place, found, given)
    try:
        graph = found(**arguments)
    except SystemExit as error:
        raise TargetError(f"{place}: {_name(found)}() left the program; let it return the graph instead") from error
    except Exception as error:
        raise TargetError(f"{place}: {_name(found)}() failed: {in_words(error)}") from error
    if inspect.iscoroutine(graph):
        graph.close()
        raise TargetError(f"{place}: {_name(found)}() is async; let a plain function build the graph")
    if not isinstance(graph, Graph):
        raise TargetError(
            f"{place}: {_name(found)}() returned {_a(graph)}, not a Graph: return the graph that it builds"
        )
    return graph


def names_code(target: str) -> bool:
    """Say whether a target names a file or a graph in a module; one word may mean something else."""
    return target.endswith((".py", ".yaml", ".yml", *SUFFIXES)) or any(sign in target for sign in ":/\\")


def load_module(place: str) -> ModuleType:
    """Import a module by name, or a Python file by its path.

    Raises:
      TargetError: it is not there, or its code fails.
    """
    if place.endswith((".yaml", ".yml")):
        raise TargetError(f"{place} is a graph file, not a module; name a Python file or a module")
    if place.endswith(".py") or "/" in place or "\\" in place:
        return _load_file(Path(place))
    if Path(place).is_file():
        raise TargetError(f"{place} is not a Python file: name one that ends in .py, or a module that builds the graph")
    if place.startswith("."):
        raise TargetError(f'"{place}" is not a module; name one from here on, as in package.module, or a file')
    import_from_here()
    try:
        return importlib.import_module(place)
    except ModuleNotFoundError as error:
        if error.name is not None and (place + ".").startswith(error.name + "."):
            hint = f"; is {place}.py meant?" if Path(f"{place}.py").exists() else ""
            raise TargetError(f'there is no module "{error.name}" here or installed{hint}') from None
        raise TargetError(f"importing {place} failed: {in_words(error)}{_left_out(error, Path.cwd())}") from error
    except Exception as error:
        raise TargetError(f"importing {place} failed: {in_words(error)}") from error
    except SystemExit as error:
        raise TargetError(
            f'importing {place} left the program; put what it runs under if __name__ == "__main__":'
        ) from error


def _load_file(file: Path) -> ModuleType:
    if not file.is_file():
        what = "is a folder, name a file in it" if file.is_dir() else "does not exist"
        raise TargetError(f"{file}: {what}")
    file = file.resolve()
    _import_from(file.parent)
    name = file.stem
    if name in sys.modules:
        loaded = getattr(sys.modules[name], "__file__", None)
        if loaded is not None and Path(loaded).resolve() == file:
            return sys.modules[name]
    is_findable = name.isidentifier() and name not in sys.modules and not is_open_to_all(file.parent)
    spec = importlib.util.find_spec(name) if is_findable else None
    if spec is None or spec.origin is None or Path(spec.origin).resolve() != file:
        # Another module has this name, or it cannot be one. Node types are then not found by name outside this process.
        spec = spec_of_file(f"hfg_target_{abs(hash(file))}", file)
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[spec.name]
        if isinstance(error, SystemExit):
            raise TargetError(
                f'{file.name} left the program; put what it runs under if __name__ == "__main__":'
            ) from error
        if not isinstance(error, Exception):
            raise
        raise TargetError(f"{file.name} failed: {in_words(error)}{_left_out(error, file.parent)}") from error
    return module


def import_from_here(*, last: bool = False) -> None:
    """Let what lies in the working directory be imported, before what is installed or after it."""
    _import_from(Path.cwd(), last=last)


def _import_from(folder: Path, *, last: bool = False) -> None:
    """Let the target import its neighbours, as `python file.py` would, unless another user can have put them there."""
    if str(folder) not in sys.path and not is_open_to_all(folder):
        sys.path.insert(len(sys.path) if last else 0, str(folder))


def _left_out(error: BaseException, folder: Path) -> str:
    """Say why a module is not found that lies in a folder."""
    if not isinstance(error, ModuleNotFoundError) or not is_open_to_all(folder):
        return ""
    return f"; no module is imported from {folder}, as every user may put some there: move it into a folder of yours"


def _split(target: str) -> tuple[str, str]:
    place, colon, name = target.rpartition(":")
    if colon and not ("/" in name or "\\" in name):  # not the colon of C:\\graph.py
        if not place or not name:
            raise TargetError(f'"{target}" names nothing: write module:graph, file.py or file.py:graph')
        return place, name
    return target, ""


def _named(module: ModuleType, name: str, place: str, has_arguments: bool) -> Any:
    found: Any = module
    for part in name.split("."):
        if not hasattr(found, part):
            raise TargetError(f'{place} has no "{name}"; {_there_are(module)}')
        found = getattr(found, part)
    if isinstance(found, NodeFunction) or (isinstance(found, type) and issubclass(found, Node)):
        raise TargetError(f"{place}:{name} is a node type: add it to a Graph, and name that; {_there_are(module)}")
    if isinstance(found, Graph) or _can_build(found) or (has_arguments and inspect.isroutine(found)):
        return found
    if callable(found) and not isinstance(found, type):
        raise TargetError(
            f"{place}:{name} needs arguments to build a graph: {_signature(found)}; give them, as in --arg NAME=VALUE"
        )
    raise TargetError(
        f"{place}:{name} is {_a(found)}, not a Graph and not a function that builds one; {_there_are(module)}"
    )


def _only(module: ModuleType, place: str, has_arguments: bool) -> Any:
    for candidates in (() if has_arguments else (_graphs(module),)) + (_builders(module, has_arguments),):
        if len(candidates) == 1:
            return next(iter(candidates.values()))
        if candidates:
            choices = ", ".join(f"{place}:{name}" for name in candidates)
            raise TargetError(f"{place} has {len(candidates)} graphs: name one of {choices}", candidates)
    raise TargetError(
        f"{place} has no graph: it needs a Graph, or a function without arguments that is annotated to return one"
    )


def _there_are(module: ModuleType) -> str:
    names = [*_graphs(module), *_builders(module)]
    return f"it has {', '.join(names)}" if names else "it has no graph at all"


def _graphs(module: ModuleType) -> dict[str, Graph]:
    """The graphs of a module, each under the first name it has."""
    found: dict[str, Graph] = {}
    for name, value in vars(module).items():
        if (
            isinstance(value, Graph)
            and not name.startswith("_")
            and not any(value is other for other in found.values())
        ):
            found[name] = value
    return found


def _builders(module: ModuleType, has_arguments: bool = False) -> dict[str, Callable[..., Any]]:
    """The functions that a module defines itself and that promise a graph; without arguments, if none are given."""
    return {
        name: value
        for name, value in vars(module).items()
        if inspect.isfunction(value) and value.__module__ == module.__name__ and not name.startswith("_")
        if (has_arguments or _can_build(value)) and _promises_graph(value)
    }


def _promises_graph(function: Callable[..., Any]) -> bool:
    try:
        return typing.get_type_hints(function).get("return") is Graph
    except Exception:  # hints of the user's that cannot be resolved promise nothing
        return False


def _can_build(value: Any) -> bool:
    if not callable(value) or isinstance(value, type):
        return False
    try:
        parameters = inspect.signature(value).parameters.values()
    except (TypeError, ValueError):
        return False
    variadic = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return all(one.default is not one.empty or one.kind in variadic for one in parameters)


def _signature(value: Any) -> str:
    try:
        return f"{_name(value)}{inspect.signature(value)}"
    except (TypeError, ValueError):
        return _name(value)


def _name(value: Any) -> str:
    return str(getattr(value, "__name__", value))


def _a(value: Any) -> str:
    name = value.__name__ if isinstance(value, type) else type(value).__name__
    return f"the class {name}" if isinstance(value, type) else f"{'an' if name[:1].lower() in 'aeiou' else 'a'} {name}"

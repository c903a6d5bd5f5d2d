"""`hfg nodes [WHAT]`: shows the catalogue of node types: a list by category, or a page for one type.

Installed types are listed and searched by their index, which is kept in a file; for pages and JSON they are imported.
Depends on the catalogue, `target` and `show`.
"""

from __future__ import annotations

import difflib
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from hfg import catalogue
from hfg.cli import show
from hfg.errors import TargetError

if TYPE_CHECKING:
    from hfg.catalogue import Catalogue, Entry, Index, ParameterDescription, TypeDescription

Listed = TypeVar("Listed", "Entry", "TypeDescription")

_LIBRARY = "hfg.nodes"
_WIDEST_NAME = 30
_NARROWEST = 40
_WIDEST = 120  # longer lines are hard to read


def nodes(
    what: Annotated[
        str | None,
        typer.Argument(help="a module, a file.py, a family of the library, or one node type; default: all"),
    ] = None,
    search: Annotated[
        str | None, typer.Option("--search", "-s", help="Show only types that match these words, best first.")
    ] = None,
    category: Annotated[str | None, typer.Option("--category", "-c", help="Show only types of this category.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write complete descriptions as JSON.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show hfg's own frames in tracebacks.")] = False,
) -> int:
    """List the node types of a module, or all that are installed; or describe one type."""
    show.set_debug(debug)
    if what is None and not json:
        return _installed(search, category)
    found, is_one = _meant(what)
    for problem in found.problems:
        show.sentence(problem)
    types = list(found.types) if category is None else _of_category(found.types, category)
    if search is not None:
        chosen = catalogue.search(types, search)
        if not chosen and not json:
            return _nothing(catalogue.index_of(types), search)
        types = chosen
    if json:
        show.json(types)
    elif is_one and types:
        show.write("\n\n".join("\n".join(_page(one)) for one in types) + "\n")
    elif types:
        show.write("\n".join(_list(types, by_category=search is None)) + "\n")
    else:
        show.write(f"no node types in {what}\n")
    return 0


def _installed(search: str | None, category: str | None) -> int:
    """List what is installed, from its index: nothing has to be imported."""
    kept = catalogue.installed_index()
    for problem in kept.problems:
        show.sentence(problem)
    entries = kept.index.entries
    if search is not None:
        found = [entries[number] for number in catalogue.ranked(kept.index, search)]
        if not found:
            return _nothing(kept.index, search)
        if missing := catalogue.unmatched(kept.index, search):
            named = " or ".join(f'"{word}"' for word in missing)
            show.sentence(
                f"no node type matches {named}{_near(kept.index, ' '.join(missing))}; these match the other words:"
            )
        # a category that does not exist is reported by what exists, not by what was found
        known = entries if category is None else _of_category(entries, category)
        entries = [one for one in found if one in known]
    elif category is not None:
        entries = _of_category(entries, category)
    if entries:
        show.write("\n".join(_list(entries, by_category=search is None)) + "\n")
    elif search is not None:
        show.write(f'no node type of the category "{category}" matches "{search}"\n')
    else:
        show.write("no node types are installed; name a module or a file: hfg nodes robot.py\n")
    return 0


def _nothing(index: Index, search: str) -> int:
    hint = _near(index, search) or "; hfg nodes lists all"
    show.write(f'no node type matches "{search}"{hint}\n')
    return 0


def _near(index: Index, words: str) -> str:
    near = catalogue.near_words(index, words)
    return f"; search for {' or '.join(near)}?" if near else ""


# --- what is meant ---


def _meant(what: str | None) -> tuple[Catalogue, bool]:
    """Return the matching types, and whether the request names one type."""
    if what is None:
        return catalogue.installed(), False
    place, colon, name = what.rpartition(":")
    if colon and not ("/" in name or "\\" in name):
        return _only_named(_in(place), what, name), True
    if what.endswith(".py") or "/" in what or "\\" in what or Path(what).is_file() or _is_family(what):
        return _in(what), False
    # What lies here may have any name, and is not imported for one word: it could be the name of a node type.
    if not _is_installed(what):
        _need_elsewhere(what)
        if _is_module(what):
            return _in(what), False
    found = catalogue.installed()
    try:
        return _only_named(found, what, what), True
    except TargetError:
        if _is_module(what, also_pythons=True):
            return _in(what), False
        raise


def _in(place: str) -> Catalogue:
    if _is_family(place):
        return catalogue.types_of(import_module(f"{_LIBRARY}.{place}"))
    from hfg.cli import target  # imports the graph layer, which a search does without

    return catalogue.types_of(target.load_module(place))


def _is_installed(name: str) -> bool:
    """Whether an installed type has this name, as its index says."""
    return any(_loosely(name) == _loosely(one.title) for one in catalogue.installed_index().index.entries)


def _loosely(name: str) -> str:
    return name.lower().replace("_", "")


def _is_family(name: str) -> bool:
    return name.isidentifier() and not name.startswith("_") and find_spec(f"{_LIBRARY}.{name}") is not None


def _is_module(name: str, *, also_pythons: bool = False) -> bool:
    """Whether a module of this name can be imported; one of Python's own is not what is meant at first."""
    top = name.partition(".")[0]
    if not also_pythons and top in sys.stdlib_module_names:
        return False
    if top.isidentifier() and PathFinder.find_spec(top, [str(Path.cwd())]) is not None:
        return True
    try:
        return find_spec(name) is not None
    except (ImportError, ValueError):  # no such package around it, or no name of a module at all
        return False


def _need_elsewhere(name: str) -> None:
    """Refuse one word that names a module in the working directory.

    Raises:
      TargetError: it does; the message says how to name it.
    """
    if not name.isidentifier() or PathFinder.find_spec(name, [str(Path.cwd())]) is None:
        return
    clear = f"{name}.py" if Path(f"{name}.py").is_file() else f"a module in it, as in {name}.nodes"
    raise TargetError(
        f'no node type "{name}" is installed, and one word runs no code that lies here: if that is meant, name {clear}'
    )


def _only_named(found: Catalogue, what: str, name: str) -> Catalogue:
    """Keep the types of that name.

    Raises:
      TargetError: there is none; it names the nearest.
    """
    types = catalogue.named(found.types, name)
    if not types:
        for problem in found.problems:
            show.sentence(problem)
        known = {spelling for one in found.types for spelling in (one.title, one.name)}
        near = difflib.get_close_matches(name.rpartition(".")[2], sorted(known), n=3)
        hint = f"; is {' or '.join(near)} meant?" if near else "; hfg nodes lists what there is"
        raise TargetError(f'there is no module, family or node type "{what}" here or installed{hint}')
    return catalogue.Catalogue(tuple(types))


def _of_category(types: Iterable[Listed], category: str) -> list[Listed]:
    found = catalogue.categories(types)
    wanted = next((name for name in found if name.lower() == category.lower()), None)
    if wanted is None:
        there_are = ", ".join(found) or "none"
        raise TargetError(f'there is no category "{category}"; there are {there_are}')
    return found[wanted]


# --- a list ---


def _width() -> int:
    columns = shutil.get_terminal_size((_WIDEST, 24)).columns
    return max(_NARROWEST, min(columns, _WIDEST) if sys.stdout.isatty() else _WIDEST)


def _list(types: Iterable[Listed], *, by_category: bool) -> Iterator[str]:
    """Show a line for each type; what was searched for is in the order of how near it is."""
    if not by_category:
        yield from _rows([(one.reference, one.summary) for one in types], "")
        return
    groups = catalogue.categories(types)
    rows = {name: [(_title(name, one), one.summary) for one in group] for name, group in groups.items()}
    for index, (name, group) in enumerate(rows.items()):
        if index:
            yield ""
        yield f"{name} ({len(group)})"
        yield from _rows(group, "  ")


def _title(category: str, described: Entry | TypeDescription) -> str:
    """Name a type in the list of its category; what is not of the library by its reference."""
    in_family = described.module == f"{_LIBRARY}.{category}" or described.module.startswith(f"{_LIBRARY}.{category}.")
    return described.title if in_family else described.reference


def _rows(rows: Sequence[tuple[str, str]], indent: str) -> Iterator[str]:
    width = _width()
    names = min(max(len(name) for name, _ in rows), max(_WIDEST_NAME, width // 2))
    for name, text in rows:
        line = f"{indent}{name:{names}}  {text}".rstrip()
        yield line if len(line) <= width else f"{line[: width - 3]}..."


# --- a page ---


def _page(described: TypeDescription) -> Iterator[str]:
    width = _width()
    kind = "subgraph" if described.subgraph else "source" if described.source else "node"
    yield f"{described.reference}  ({kind}, {described.category})"
    yield from textwrap.wrap(described.summary, width)
    for paragraph in described.text.split("\n\n"):
        if paragraph.strip():
            yield ""
            yield from _paragraph(paragraph, width)
    kinds: dict[str, list[tuple[str, str]]] = {}
    for what, port in described.ports():
        name = f"{port.name}[...]" if port.vector else port.name
        typed = f"{name}: {port.type}" if port.type else name
        if port.optional:
            typed += f" = {port.default!r}" if port.default is not None else " (optional)"
        kinds.setdefault(f"{what}s", []).append((typed, port.doc))
    if described.parameters:
        kinds["parameters"] = [(_typed(one), _said(one)) for one in described.parameters]
    if described.errors:
        kinds["errors"] = [(error.name, error.when) for error in described.errors]
    for what, entries in kinds.items():
        yield ""
        yield what
        yield from _entries(entries, width)
    if described.apex:
        yield ""
        yield f"CS::APEX: {', '.join(described.apex)}"


def _paragraph(paragraph: str, width: int) -> Iterator[str]:
    """Fold a paragraph; one with indented lines, such as a list or code, is left as it stands."""
    lines = paragraph.splitlines()
    if any(line.startswith((" ", "-", "*", ">>>")) for line in lines):
        yield from lines
    else:
        yield from textwrap.wrap(" ".join(lines), width)


def _typed(parameter: ParameterDescription) -> str:
    if parameter.trigger:
        return f"{parameter.name} (trigger)"
    return f"{parameter.name}: {parameter.type}" + ("" if parameter.required else f" = {parameter.default!r}")


def _said(parameter: ParameterDescription) -> str:
    facts = parameter.facts()
    return " ".join(filter(None, [parameter.doc, f"({', '.join(facts)})" if facts else ""]))


def _entries(entries: Iterable[tuple[str, str]], width: int) -> Iterator[str]:
    for name, text in entries:
        yield f"  {name}"
        yield from textwrap.wrap(text, width, initial_indent="      ", subsequent_indent="      ")

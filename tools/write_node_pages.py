"""docs/nodes, written from the library itself: `python -m tools.write_node_pages [FOLDER]`, or `make docs-nodes`.

There is one page per family, with everything that the catalogue has about its types, and an index. A generated family
with hundreds of types has a page of tables. The same library yields the same pages. Depends on the catalogue, not on
runs.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePath
from typing import Any, Final

from hfg.catalogue.describing import ParameterDescription, PortDescription, TypeDescription
from hfg.catalogue.finding import submodules, types_of
from hfg.catalogue.offers import LIBRARY
from hfg.catalogue.searching import categories

_MOST_IN_WHOLE: Final = 150  # types of one family; larger families are shown as tables
_NOTE: Final = "<!-- Written by `make docs-nodes` from the docstrings of the library: change those. -->"

DISTRIBUTIONS: Final = {"cv": "opencv-python-headless"}
"""Families that are generated from another distribution: their page depends on its version."""


def pages() -> dict[str, str]:
    """Return the text of each page by name, the index first.

    Raises:
      RuntimeError: a family cannot be imported; the message has the reason.
    """
    families: dict[str, list[TypeDescription]] = {}
    for module in submodules(importlib.import_module(LIBRARY)):
        found = types_of(module)
        if found.problems:
            raise RuntimeError("; ".join(found.problems))
        if found.types:
            families[module.rpartition(".")[2]] = list(found.types)
    written = {f"{name}.md": _text(_family(name, types)) for name, types in sorted(families.items())}
    return {"index.md": _text(_index(families)), **written}


def _text(lines: Iterable[str]) -> str:
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).rstrip() + "\n"


def _index(families: dict[str, list[TypeDescription]]) -> Iterator[str]:
    total = sum(map(len, families.values()))
    yield from (_NOTE, "", "# The standard library of nodes", "")
    yield f"{total} node types in {len(families)} families. `hfg nodes` shows the same on a terminal, and"
    yield "`hfg nodes --search WORDS` looks for words."
    yield from ("", "| family | types | what is in it |", "|---|---|---|")
    for name, types in sorted(families.items()):
        yield f"| [{name}]({name}.md) | {len(types)} | {_cell(_about(name))} |"
    yield from ("", "## All types", "")
    for name, types in sorted(families.items()):
        links = ", ".join(
            f"[{one.title}]({name}.md#{_anchor(one.title)})" if len(types) <= _MOST_IN_WHOLE else f"`{one.title}`"
            for one in sorted(types, key=lambda one: one.title.lower())
        )
        yield from (f"**{name}**: {links}", "")


def _about(family: str) -> str:
    doc = inspect.getdoc(importlib.import_module(f"{LIBRARY}.{family}")) or ""
    return doc.partition("\n")[0]


def _family(name: str, types: Sequence[TypeDescription]) -> Iterator[str]:
    yield from (_NOTE, "", f"# {LIBRARY}.{name}", "", _about(name), "")
    if name in DISTRIBUTIONS:
        yield from (made_with(name), "")
    yield from ("```python no-run", f"from hfg.nodes import {name}", "```", "")
    if len(types) > _MOST_IN_WHOLE:
        yield from _tables(types)
        return
    yield from ("| type | what it does |", "|---|---|")
    for one in types:
        yield f"| [{one.title}](#{_anchor(one.title)}) | {_cell(one.summary)} |"
    for one in types:
        yield from ("", *_whole(one))


def made_with(family: str) -> str:
    """Return what a generated family was made from."""
    try:
        return f"Made with {DISTRIBUTIONS[family]} {version(DISTRIBUTIONS[family])}."
    except PackageNotFoundError:
        return f"Made with another build of {DISTRIBUTIONS[family]}."


def _tables(types: Sequence[TypeDescription]) -> Iterator[str]:
    for category, group in categories(types).items():
        yield from (
            "",
            f"## {category}",
            "",
            "| type | in | out | parameters | what it does |",
            "|---|---|---|---|---|",
        )
        for one in group:
            incoming = ", ".join(f"{port.name}: {port.type}" for port in one.inputs)
            outgoing = ", ".join(f"{port.name}: {port.type}" for port in one.outputs)
            parameters = ", ".join(f"{each.name}={_default(each)}" for each in one.parameters)
            cells = (f"`{one.title}`", _cell(incoming), _cell(outgoing), _cell(parameters), _cell(one.summary))
            yield f"| {' | '.join(cells)} |"


def _whole(one: TypeDescription) -> Iterator[str]:
    yield from (f"## {one.title}", "", _prose(one.summary), "")
    for paragraph in one.text.split("\n\n"):
        yield from (_prose(paragraph), "")
    rows = [(kind, *_port(port)) for kind, port in one.ports() if not _is_trigger(one, port)]
    rows += [("parameter", *_parameter(each)) for each in one.parameters if not each.size]
    if rows:
        yield from ("| | name | type | what it means |", "|---|---|---|---|")
        for kind, name, type_, said in rows:
            yield f"| {kind} | `{name}` | {_code(type_)} | {_cell(said)} |"
        yield ""
    if one.errors:
        yield f"Raises {'; '.join(f'`{error.name}`: {_prose(error.when)}' for error in one.errors)}"
        yield ""
    if one.apex:
        yield f"CS::APEX: {', '.join(f'`{name}`' for name in one.apex)}"


def _is_trigger(one: TypeDescription, port: PortDescription) -> bool:
    return any(each.trigger and each.name == port.name for each in one.parameters)


def _port(port: PortDescription) -> tuple[str, str, str]:
    name = f"{port.name}[...]" if port.vector else port.name
    absent = "" if port.default is None else f"; `{_plain(port.default)}` if absent"
    return name, port.type, f"{port.doc}{' (optional' + absent + ')' if port.optional else ''}"


def _parameter(each: ParameterDescription) -> tuple[str, str, str]:
    if each.trigger:
        return each.name, "trigger", each.doc
    facts = each.facts()
    facts += ["read-only"] if each.read_only else ["must be given"] if each.required else []
    default = "" if each.required else f" = {_default(each)}"
    said = " ".join(filter(None, [each.doc, f"({', '.join(facts)})" if facts else ""]))
    return f"{each.name}{default}", each.type, said


def _default(each: ParameterDescription) -> str:
    return "..." if each.required else _plain(each.default)


def _plain(value: Any) -> str:
    """Return a value as text that is the same each time."""
    if isinstance(value, frozenset | set) and value:  # its own order differs from process to process
        return "{" + ", ".join(sorted(map(repr, value))) + "}"
    plain = str(value) if isinstance(value, PurePath) else value
    return re.sub(r" at 0x[0-9a-f]+", "", " ".join(repr(plain).split()))


def _anchor(title: str) -> str:
    return re.sub(r"[^\w\- ]", "", title.lower())


def _code(text: str) -> str:
    return f"`{_bars(text)}`" if text else ""


def _bars(text: str) -> str:
    return text.replace("|", "\\|")


def _cell(text: str) -> str:
    return _bars(_prose(" ".join(text.split())))


def _prose(text: str) -> str:
    """Escape Markdown in a text: anything that looks like a tag or a link."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(
        part if part.startswith("`") else re.sub(r"\]\(", "]&#40;", part.replace("<", "&lt;").replace("*", "\\*"))
        for part in parts
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pages into a folder, by default docs/nodes, and remove pages of families that are gone."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    folder = Path(given[0] if given else "docs/nodes")
    written = pages()
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.md"):
        if old.name not in written:
            old.unlink()
    for name, text in written.items():
        (folder / name).write_text(text, encoding="utf-8")
    sys.stdout.write(f"{len(written)} pages are in {folder}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Reads the docstring of a node type: summary, text, an entry for each port and parameter, errors, older names.

The form is Google's. `Args:`, `Attributes:` and `Returns:` describe ports and parameters; `Raises:` lists exceptions
that a firing may raise as part of its contract; the lines `CS::APEX: csapex::Delay.` and `Category: filters.` are our
own. Depends on docstring-parser, not on node types.
"""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass, field
from typing import Final

from docstring_parser import DocstringParam, DocstringRaises, DocstringReturns, ParseError
from docstring_parser.google import GoogleParser

_OWN_LINES: Final = re.compile(r"^(CS::APEX|Category):[ ]*(.*(?:\n(?!\s*$)(?!CS::APEX:|Category:).*)*)", re.MULTILINE)
_APEX_NAME: Final = re.compile(r"[A-Za-z_]\w*(?:::\w+)+")
_ENTRY: Final = re.compile(r"^(\w+):\s+(.*)$")


@dataclass(frozen=True, slots=True)
class Documentation:
    """The contents of a docstring.

    Attributes:
      summary: the first line.
      text: the text after it, without the sections.
      entries: descriptions of ports and parameters, by name.
      result: the text of `Returns:` or `Yields:`, for the only output.
      errors: name of an exception, and when it is raised.
      apex: names of the CS::APEX nodes that it replaces.
      category: the text of the line `Category:`, or "".
    """

    summary: str = ""
    text: str = ""
    entries: dict[str, str] = field(default_factory=dict)
    result: str = ""
    errors: tuple[tuple[str, str], ...] = ()
    apex: tuple[str, ...] = ()
    category: str = ""


def read_documentation(doc: str) -> Documentation:
    r"""Read a docstring; parts that are not in Google form stay in its text.

    Examples:
      >>> read = read_documentation("Hold back.\n\nArgs:\n  seconds: how long.\n\nCS::APEX: csapex::Delay.")
      >>> read.summary, read.entries, read.apex
      ('Hold back.', {'seconds': 'how long.'}, ('csapex::Delay',))
    """
    apex: list[str] = []
    category = ""
    for match in _OWN_LINES.finditer(doc):
        if match[1] == "Category":
            category = _in_one_line(match[2]).rstrip(".")
        else:
            apex += _APEX_NAME.findall(match[2])
    plain = inspect.cleandoc(_OWN_LINES.sub("", doc))
    try:
        read = GoogleParser().parse(plain)
    except ParseError:  # an entry without a colon: then the sections cannot be read
        summary, _, text = plain.partition("\n")
        return Documentation(summary, text.strip(), {}, "", (), tuple(apex), category)
    entries: dict[str, str] = {}
    errors: list[tuple[str, str]] = []
    result = ""
    for meta in read.meta:
        said = _in_one_line(meta.description or "")
        if isinstance(meta, DocstringParam):
            entries.update((name.strip().lstrip("*"), said) for name in meta.arg_name.split(","))
        elif isinstance(meta, DocstringRaises):
            errors += [(name.strip(), said) for name in (meta.type_name or "").split(",")]
        elif isinstance(meta, DocstringReturns) and meta.type_name:
            # docstring-parser reads the first of several entries as the type of a single result
            entries.update(_entries(f"{meta.type_name}: {meta.description or ''}"))
            result = result or said
        elif isinstance(meta, DocstringReturns):
            result = result or said
    return Documentation(
        _in_one_line(read.short_description or ""),
        (read.long_description or "").strip(),
        entries,
        result,
        tuple(errors),
        tuple(apex),
        category,
    )


def _entries(text: str) -> dict[str, str]:
    """Read "name: description" lines; a line that starts differently continues the previous one."""
    found: dict[str, str] = {}
    name = ""
    for line in text.splitlines():
        match = _ENTRY.match(line)
        if match is not None and (not name or not line.startswith(" ")):
            name = match[1]
            found[name] = match[2].strip()
        elif name:
            found[name] = f"{found[name]} {line.strip()}".strip()
    return found


def _in_one_line(text: str) -> str:
    return " ".join(text.split())

"""Docstrings, comments and pages refer only to rules, files and modules that exist.

A reference that leads nowhere is worse than none: the reader searches for it. When a case fails, update the text
that refers to the old name.
"""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = [
    file
    for folder in ("hfg", "transports", "tests", "benchmarks", "examples")
    for file in (ROOT / folder).rglob("*.py")
]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("*/README.md")]
TOP = "hfg|hfg_transports|tests|benchmarks|examples|docs|transports"

RULE = re.compile(r"(?<![\w.#/%:*-])([A-Z]\d{1,2})(?![\w*]|[.:]\w)")
FILE = re.compile(rf"(?<![\w./<-])((?:(?:{TOP})/[\w./-]*)?[\w-]+\.(?:md|py|svg|toml|txt|jsonl))\b(?![\w*/:])")
MODULE = re.compile(
    r"(?<![\w./@-])((?:hfg|hfg_transports|tests|benchmarks|examples)(?:\.[a-zA-Z_]\w*)+)(?![\w/-]|\.\w)"
)
BELOW = re.compile(r"\b(?:Stands|Depends|Builds) on ([^.;]*(?:\.\w[^.;]*)*)")
SECTION = re.compile(r'\b([A-Z]{6,})(?:\.md)?(?: §|, ")')

# Files that a sentence makes up, to say what would happen with one.
INVENTED = {
    "arm.toml",
    "base.toml",
    "examples/NAME.py",
    "file.py",
    "filters.py",
    "halves.py",
    "hill.py",
    "map.svg",
    "note.txt",
    "steps.py",
    "ways.svg",
}
NOT_MODULES = {"hfg.transports", "hfg.node.fetch", "hfg.node.fetch.go_to", "hfg.something"}  # entry points, loggers
METHODS = {"I1"}  # of OpenCV's compare_shapes


class Prose(NamedTuple):
    """A piece of text that people read: its file, its first line, and the text itself."""

    file: Path
    line: int
    text: str

    def at(self, match: re.Match[str]) -> str:
        return f"{self.file.relative_to(ROOT)}:{self.line + self.text.count(chr(10), 0, match.start())}"


class Source(NamedTuple):
    """What a Python file says: docstrings and comments, its strings, and the parts of all names that it imports."""

    prose: list[Prose]
    strings: list[Prose]
    imports: set[str]


@cache
def read(file: Path) -> Source:
    text = file.read_text(encoding="utf-8")
    found = Source([], [], set())
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.strings.append(Prose(file, node.lineno, node.value))
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            found.prose.append(Prose(file, node.lineno, node.value.value))
        elif isinstance(node, ast.Import):
            found.imports.update(part for alias in node.names for part in alias.name.split("."))
        elif isinstance(node, ast.ImportFrom):
            found.imports.update((node.module or "").split("."), (alias.name for alias in node.names))
    for comment in re.finditer(r"(?:^|\s)# .*$", text, re.M):
        found.prose.append(Prose(file, text.count("\n", 0, comment.start(0)) + 1, comment[0].lstrip("\n")))
    return found


def in_page(file: Path) -> Iterator[Prose]:
    """Yield the page without its fenced blocks, whose lines stay as empty lines."""
    text = file.read_text(encoding="utf-8")
    yield Prose(file, 1, re.sub(r"^( *)```.*?^\1```$", lambda m: "\n" * m[0].count("\n"), text, flags=re.M | re.S))


@cache
def sources() -> list[Prose]:
    return [prose for file in sorted(SOURCES) for prose in read(file).prose]


@cache
def pages() -> list[Prose]:
    return [prose for file in sorted(PAGES) if file.name != "CHANGELOG.md" for prose in in_page(file)]


@cache
def rules() -> set[str]:
    return set(re.findall(r"^### ([A-Z]\d+)\b", (ROOT / "docs/semantics.md").read_text(encoding="utf-8"), re.M))


@cache
def files() -> set[str]:
    """Return every file's path, and each of its ends: a text may leave out the folders that are clear."""
    hidden = {"build", "dist", "out", "__pycache__"}
    found = set()
    for folder in [ROOT, *(path for path in ROOT.iterdir() if path.is_dir())]:
        if folder.name.startswith(".") or folder.name in hidden:
            continue
        for file in folder.glob("*.*") if folder == ROOT else folder.rglob("*.*"):
            parts = file.relative_to(ROOT).parts
            found |= {"/".join(parts[start:]) for start in range(len(parts))}
    return found


@cache
def exists(name: str) -> bool:
    """Return whether a dotted name is a module, or something in one."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        module = ".".join(parts[:length])
        try:
            found = importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name is not None and not module.startswith(error.name):  # it is there, and needs an extra
                return True
            continue
        for part in parts[length:]:
            if not hasattr(found, part):
                return part in getattr(found, "__annotations__", {}) or part in getattr(found, "__slots__", ())
            found = getattr(found, part)
        return True
    return False


@pytest.mark.slow
def test_rule_numbers_are_those_of_the_rules() -> None:
    dead = [
        f"{prose.at(match)}: {match[1]}"
        for prose in [*sources(), *pages()]
        for match in RULE.finditer(prose.text)
        if match[1] not in rules() | METHODS
    ]
    assert not dead, "no such rule in docs/semantics.md: " + ", ".join(dead)


@pytest.mark.slow
def test_rule_numbers_in_messages_are_those_of_the_rules() -> None:
    dead = [
        f"{message.at(match)}: {number}"
        for file in SOURCES
        if file.is_relative_to(ROOT / "hfg")
        for message in read(file).strings
        for match in re.finditer(r"\brules? ((?:[A-Z]\d+(?:, | and |, and )?)+)", message.text)
        for number in re.findall(r"[A-Z]\d+", match[1])
        if number not in rules()
    ]
    assert not dead, "no such rule in docs/semantics.md: " + ", ".join(dead)


@pytest.mark.slow
def test_files_that_are_named_exist() -> None:
    dead = [
        f"{prose.at(match)}: {match[1]}"
        for prose in sources()
        for match in FILE.finditer(prose.text)
        if match[1] not in files() and match[1] not in INVENTED
    ]
    assert not dead, "no such file: " + ", ".join(dead)


def test_files_of_the_project_that_pages_name_exist() -> None:
    """Pages make up many files of their readers; only a path that begins in a folder of the project must exist."""
    ours = re.compile(
        rf"(?<![\w./<-])((?:{TOP}|model|rules|fusion|runtime|executing|editing|observing|face)/[\w./-]+\.\w+)"
    )
    dead = [
        f"{prose.at(match)}: {match[1]}"
        for prose in pages()
        for match in ours.finditer(prose.text)
        if match[1] not in files() | INVENTED
    ]
    assert not dead, "no such file: " + ", ".join(dead)


@pytest.mark.slow
def test_modules_and_names_that_are_named_exist() -> None:
    dead = [
        f"{prose.at(match)}: {match[1]}"
        for prose in [*sources(), *pages()]
        for match in MODULE.finditer(prose.text)
        if match[1] not in NOT_MODULES and not exists(match[1])
    ]
    assert not dead, "no such module or name: " + ", ".join(dead)


@pytest.mark.slow
def test_a_module_imports_what_it_says_it_stands_on() -> None:
    dead = [
        f"{prose.at(match)}: {name}"
        for file in SOURCES
        if file.name != "__init__.py"
        for prose in read(file).prose
        if prose.line == 1
        for match in BELOW.finditer(prose.text)
        for name in re.findall(r"`(?:[\w.]+\.)?(\w+)`", match[1].partition(" not ")[0])
        if name not in read(file).imports
    ]
    assert not dead, "named, but not imported: " + ", ".join(dead)


@pytest.mark.slow
def test_documents_whose_sections_are_named_exist() -> None:
    dead = [
        f"{prose.at(match)}: {match[1]}"
        for prose in [*sources(), *pages()]
        for match in SECTION.finditer(prose.text)
        if f"{match[1]}.md" not in files()
    ]
    assert not dead, "no such document: " + ", ".join(dead)


@pytest.mark.parametrize(
    ("pattern", "text", "found"),
    [
        (RULE, "slots first (D10 of docs/semantics.md, F9).", ["D10", "F9"]),
        (RULE, "H264 and B-frames, 'U16', x.A5", []),
        (FILE, "see docs/howto/nodes.md, and worker.py", ["docs/howto/nodes.md", "worker.py"]),
        (MODULE, "see hfg.base.token and hfg.run.", ["hfg.base.token", "hfg.run"]),
        (BELOW, "Stands on `problem` and `hfg.engine`; knows no run.", ["`problem` and `hfg.engine`"]),
        (SECTION, '(ARCHITECTURE §1), the paper\'s §5.2 (SEMANTICS, "quiet")', ["ARCHITECTURE", "SEMANTICS"]),
    ],
)
def test_references_are_seen(pattern: re.Pattern[str], text: str, found: list[str]) -> None:
    assert [name for name in pattern.findall(text) if name != "U16"] == found


def test_the_glossary_has_every_term_of_the_rules() -> None:
    table = re.search(r"^## Terms$.*?^## T: ", (ROOT / "docs/semantics.md").read_text(encoding="utf-8"), re.M | re.S)
    assert table is not None
    terms = {term for row in re.findall(r"^\| \*\*([^*]+)\*\*", table[0], re.M) for term in row.split(", ")}
    glossary = (ROOT / "docs/glossary.md").read_text(encoding="utf-8").lower()
    assert not {term for term in terms - {"A(v)", "a"} if term not in glossary}

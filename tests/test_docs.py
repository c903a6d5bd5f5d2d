"""Every Python block of README and docs runs, page by page and in order, as a reader would try it.

A page is one module: later blocks see the names of earlier ones. Blocks with a top-level `await` run on a loop in
virtual time. What a block prints is compared with the ```` ```output ```` block behind it, if there is one.
```` ```python no-run ```` marks the few fragments that cannot stand alone; they must still be Python.
"""

from __future__ import annotations

import ast
import asyncio
import inspect
import io
import linecache
import re
import sys
import types
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import hfg

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
FENCE = re.compile(r"^(?P<indent> *)```(?P<info>[^\n`]*)\n(?P<code>.*?)^(?P=indent)```$", re.MULTILINE | re.DOTALL)
MOST_FRAGMENTS_A_PAGE = 3
FLAWED = {"wrong", "loop", "flawed"}  # graphs that show what a check finds
# In the first, hfg builds one subgraph by itself, to compare it with what became of it. The others are only drawn.
NO_PROGRAM = re.compile("built again|states of .*")


class Block(NamedTuple):
    """A fenced block: its first line in the page, what stands behind the backticks, and its text."""

    line: int
    info: str
    code: str


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            text.count("\n", 0, match.start()) + 2,
            match["info"].strip(),
            re.sub(rf"^{match['indent']}", "", match["code"], flags=re.MULTILINE).rstrip(),
        )
        for match in FENCE.finditer(text)
    ]


def page_id(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


class Page:
    """A page while it runs: a real module, so that type hints resolve and node types are found by name."""

    def __init__(self, page: Path) -> None:
        self.path = page
        self.module = types.ModuleType(re.sub(r"\W", "_", page_id(page)))
        sys.modules[self.module.__name__] = self.module
        self.runner = asyncio.Runner(loop_factory=hfg.VirtualTimeLoop)

    def run(self, block: Block) -> str:
        """Execute one block and return what it printed; errors point into the page."""
        code = "\n" * (block.line - 1) + block.code + "\n"
        name = f"{self.path}:{block.line}"  # one name per block, else inspect would read the source of another
        linecache.cache[name] = (len(code), None, code.splitlines(keepends=True), name)
        compiled = compile(code, name, "exec", flags=ast.PyCF_ALLOW_TOP_LEVEL_AWAIT, dont_inherit=True)
        with redirect_stdout(io.StringIO()) as printed:
            outcome = eval(compiled, self.module.__dict__)
            if inspect.iscoroutine(outcome):
                self.runner.run(outcome)
        return printed.getvalue()

    def close(self) -> None:
        self.runner.close()
        del sys.modules[self.module.__name__]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_page_runs_as_written(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    graphs: list[hfg.Graph] = []
    make = hfg.Graph.__init__

    def remembered(graph: hfg.Graph, *arguments: Any, **options: Any) -> None:
        make(graph, *arguments, **options)
        graphs.append(graph)

    monkeypatch.setattr(hfg.Graph, "__init__", remembered)
    live, printed = Page(page), ""
    try:
        for block in blocks(page):
            if block.info == "python":
                printed = live.run(block)
            elif block.info == "output":
                assert printed.rstrip() == block.code, f"{page_id(page)}:{block.line} promises another output"
        whole = [
            one for one in graphs if not one.path and one.name not in FLAWED and not NO_PROGRAM.fullmatch(one.name)
        ]
        alarms = [str(problem) for graph in whole for problem in graph.check() if problem.severity != "hint"]
        assert not alarms, "\n".join(alarms)  # sound as they are, a check must not frighten their readers
    finally:
        live.close()


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_fragments_are_python_and_few(page: Path) -> None:
    fragments = [block for block in blocks(page) if block.info == "python no-run"]
    assert len(fragments) <= MOST_FRAGMENTS_A_PAGE, "make the examples run instead"
    for block in fragments:
        ast.parse(block.code)


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_blocks_say_what_they_are(page: Path) -> None:
    known = {"python", "python no-run", "output", "mermaid", "yaml", "console", "text", "toml", "json"}
    for block in blocks(page):
        assert block.info in known, f"{page_id(page)}:{block.line}: ```{block.info}"


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_links_inside_the_project_lead_somewhere(page: Path) -> None:
    prose = FENCE.sub("", page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", prose):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{page_id(page)} links to {target}"
        if anchor:
            assert anchor in anchors(file), f"{page_id(page)} links to {target}, which has no such heading"


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub makes of the page's headings."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", page.read_text(encoding="utf-8")), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_names_of_the_face_exist(page: Path) -> None:
    """Fragments and prose cannot run, but `hfg.something` in them can be looked up."""
    text = re.sub(r"\[[^\]]*\]\([^)]*\)", "", page.read_text(encoding="utf-8"))
    for name in set(re.findall(r"(?<![\w./\[@-])hfg\.([A-Za-z_]\w*)", text)) - {"hfg", "yaml", "transports"}:
        known = name in hfg.__all__ or (ROOT / "hfg" / name).is_dir() or (ROOT / "hfg" / f"{name}.py").exists()
        assert known, f"{page_id(page)} speaks of hfg.{name}, which does not exist"

"""The drawings in README and documentation are those of the graphs they name.

A page names the graph in a comment above the drawing, `<!-- drawing: examples/figures/data.py:figure_2 -->`, and behind
it what else `graph.draw` is to know, as in `ports="all"`, or `inside="fetch"` for the inside of a subgraph. The drawing
is a file, or Mermaid in the page itself. With HFG_REDRAW=1, `make docs-drawings`, they are drawn anew
instead of compared.
"""

from __future__ import annotations

import ast
import importlib
import os
import re
from pathlib import Path
from typing import Any, Protocol

import pytest

from tools.build_docs import DIAGRAMS, diagram_name, diagrams

ROOT = Path(__file__).resolve().parent.parent
COMMENT = r"<!-- drawing: (?P<target>\S+)(?P<options>[^\n]*) -->\n"
IN_PAGE = re.compile(COMMENT + r"```mermaid\n(?P<text>.*?)```", re.DOTALL)
IN_FILE = re.compile(COMMENT + r"!\[(?P<says>[^\]]*)\]\((?P<file>[^)]+\.svg)\)")
WRITTEN = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in WRITTEN if re.search(COMMENT, page.read_text(encoding="utf-8"))]
REDRAW = bool(os.environ.get("HFG_REDRAW"))
FIGURES = [*range(2, 17), "17 a", "17 b", 18, 19]


class Drawn(Protocol):
    """A graph, or what is drawn like one."""

    def draw(self, *, format: Any = None, **options: Any) -> str:  # noqa: A002 - as graphs call it
        """Give the text of the drawing."""


def named(match: re.Match[str]) -> tuple[Drawn, dict[str, object]]:
    """Build the graph that a comment names, and read how it is to be drawn; `inside=` names a subgraph of it."""
    file, _, name = match["target"].partition(":")
    module = importlib.import_module(file.removesuffix(".py").replace("/", "."))
    call = ast.parse(f"draw({match['options']})", mode="eval").body
    assert isinstance(call, ast.Call)
    drawn, options = getattr(module, name)(), {str(one.arg): ast.literal_eval(one.value) for one in call.keywords}
    inside = options.pop("inside", None)
    return (drawn if inside is None else drawn[inside].graph), options


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_drawings_are_those_of_their_graphs(page: Path) -> None:
    def drawn(match: re.Match[str]) -> str:
        graph, options = named(match)
        text = graph.draw(**options)
        return f"<!-- drawing: {match['target']}{match['options']} -->\n```mermaid\n{text}```"

    shown = page.read_text(encoding="utf-8")
    redrawn = IN_PAGE.sub(drawn, shown)
    if REDRAW:
        page.write_text(redrawn, encoding="utf-8")
    else:
        assert shown == redrawn, "make docs-drawings draws them anew"
    for match in IN_FILE.finditer(shown):
        graph, options = named(match)
        file = page.parent / match["file"]
        text = graph.draw(format="svg", **options)
        if REDRAW:
            file.parent.mkdir(exist_ok=True)
            file.write_text(text, encoding="utf-8")
        else:
            assert file.read_text(encoding="utf-8") == text, f"{file.name}: make docs-drawings draws it anew"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_each_comment_has_its_drawing_and_each_picture_says_what_it_shows(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    pictures = list(IN_FILE.finditer(text))
    assert len(re.findall(COMMENT, text)) == len(pictures) + len(IN_PAGE.findall(text))
    assert all(len(match["says"]) > 10 for match in pictures)


def test_no_drawing_is_left_over() -> None:
    shown = {
        (page.parent / match["file"]).resolve()
        for page in PAGES
        for match in IN_FILE.finditer(page.read_text(encoding="utf-8"))
    }
    names = {f"{diagram_name(source)}.{variant}.svg" for source in diagrams() for variant in ("light", "dark")}
    kept = {file.name for file in (ROOT / "docs" / DIAGRAMS).glob("*.svg")}
    assert kept == names, "a Mermaid diagram has changed: run `make docs-mermaid`, or python -m tools.draw_mermaid"
    assert set((ROOT / "docs").rglob("*.svg")) == shown | {ROOT / "docs" / DIAGRAMS / name for name in names}


def test_every_figure_has_its_place() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    headings = " ".join(re.findall(r"^## Figures? (.*?):", text, re.MULTILINE))
    assert [figure for figure in FIGURES if not re.search(rf"\b{figure}\b", headings)] == []

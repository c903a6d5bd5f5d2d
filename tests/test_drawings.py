"""The drawings in README and documentation are those of the graphs they name.

A page names the graph in a comment above the drawing, `<!-- drawing: examples/figures/data.py:figure_2 -->`. With
HFG_REDRAW=1 in the environment the drawings are written anew instead of compared.
"""

from __future__ import annotations

import importlib
import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DRAWING = re.compile(r"<!-- drawing: (?P<target>\S+) -->\n```mermaid\n(?P<text>.*?)```", re.DOTALL)
WRITTEN = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in WRITTEN if DRAWING.search(page.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_drawings_are_those_of_their_graphs(page: Path) -> None:
    def drawn(match: re.Match[str]) -> str:
        file, _, name = match["target"].partition(":")
        module = importlib.import_module(file.removesuffix(".py").replace("/", "."))
        text = getattr(module, name)().draw()
        return f"<!-- drawing: {match['target']} -->\n```mermaid\n{text}```"

    shown = page.read_text(encoding="utf-8")
    redrawn = DRAWING.sub(drawn, shown)
    if os.environ.get("HFG_REDRAW"):
        page.write_text(redrawn, encoding="utf-8")
    else:
        assert shown == redrawn, "HFG_REDRAW=1 pytest tests/test_drawings.py draws them anew"


def test_every_figure_has_its_place() -> None:
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    headings = " ".join(re.findall(r"^## Figures? (.*?):", text, re.MULTILINE))
    assert [figure for figure in [*range(2, 15), "17 a", "17 b", 18] if not re.search(rf"\b{figure}\b", headings)] == []

"""docs/nodes says what the library says."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tools.write_node_pages import DISTRIBUTIONS, made_with, main, pages

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "nodes"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Written by a process of its own: types that other tests have made or imported say more than a user sees."""
    folder = tmp_path_factory.mktemp("pages")
    subprocess.run(
        [sys.executable, "-m", "tools.write_node_pages", str(folder)], check=True, capture_output=True, cwd=ROOT
    )
    return {file.name: file.read_text(encoding="utf-8") for file in folder.glob("*.md")}


@pytest.mark.slow
def test_the_pages_are_up_to_date(written: dict[str, str]) -> None:
    old = [name for name, text in written.items() if _is_comparable(name) and _on_disk(name) != text]
    gone = sorted(file.name for file in FOLDER.glob("*.md") if file.name not in written)
    assert not old, f"{', '.join(old)} in docs/nodes differ from the docstrings: write them anew with `make docs-nodes`"
    assert not gone, f"docs/nodes has pages of families that are gone, {gone}: `make docs-nodes` removes them"


def _on_disk(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8") if (FOLDER / name).is_file() else ""


def _is_comparable(name: str) -> bool:
    """What is generated from another distribution differs from version to version of it, and so does the index."""
    generated = [family for family in DISTRIBUTIONS if name in (f"{family}.md", "index.md")]
    return all(made_with(family) in _on_disk(f"{family}.md") or not _on_disk(f"{family}.md") for family in generated)


@pytest.mark.slow
def test_they_are_the_same_each_time(written: dict[str, str]) -> None:
    assert pages() == pages()
    assert " at 0x" not in "".join(written.values())


def test_a_page_has_all_that_is_known_of_a_type(written: dict[str, str]) -> None:
    page = written["logic.md"]
    part = page[page.index("## Hysteresis") :]
    part = part[: part.index("\n## ", 5)]
    for line in (
        "Say whether a number is high",
        "| input | `value` | `float` |",
        "| output | `is_high` | `bool` |",
        "| event | `rose` | `float` |",
        "| parameter | `low = 0.4` | `float` |",
        "Raises `ValueError`: ",
    ):
        assert line in part
    assert "| [Hysteresis](#hysteresis) | " in page
    assert "[Hysteresis](logic.md#hysteresis)" in written["index.md"]


@pytest.mark.slow
def test_they_are_written_where_one_says_and_old_ones_go(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "gone.md").write_text("of a family that is no more")
    assert main([str(tmp_path)]) == 0
    names = {file.name for file in tmp_path.iterdir()}
    assert {"index.md", "logic.md", "flow.md"} <= names
    assert "gone.md" not in names
    assert f"{len(names)} pages are in" in capsys.readouterr().out

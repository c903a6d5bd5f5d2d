"""The limits of what is read are one table, which the docs show as it is, and the environment raises."""

from __future__ import annotations

from pathlib import Path

import pytest

from hfg.bounds import BOUNDS, PICTURE_PIXELS

PAGE = Path(__file__).resolve().parent.parent / "docs" / "howto" / "untrusted.md"


@pytest.mark.rule("L4")
def test_the_docs_have_each_limit_as_it_is() -> None:
    rows = [f"| `{one.variable}` | {one.usual:,} | {one.what} |" for one in BOUNDS]
    assert [line for line in PAGE.read_text().splitlines() if line.startswith("| `HFG_MOST")] == rows


@pytest.mark.parametrize(("said", "most"), [("5", 5), ("", 2**27), ("many", 2**27), ("-1", 2**27), ("1e9", 2**27)])
def test_a_variable_sets_a_limit_and_what_is_no_number_sets_none(
    said: str, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(PICTURE_PIXELS.variable, said)
    assert PICTURE_PIXELS.most == most

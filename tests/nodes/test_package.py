"""The package of the standard library: light, and a family is there when it is named."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import hfg.nodes

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "library.md"


@pytest.mark.slow
def test_no_family_is_imported_before_it_is_asked_for() -> None:
    told = "import sys, hfg.nodes; print([name for name in sys.modules if name.startswith('hfg.nodes.')])"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_what_is_no_family_is_no_attribute() -> None:
    with pytest.raises(AttributeError, match="no attribute 'no_such_family'"):
        _ = hfg.nodes.no_such_family
    assert not hasattr(hfg.nodes, "_private")


def test_the_page_on_the_library_names_what_there_is() -> None:
    text = PAGE.read_text(encoding="utf-8")
    families = [name for name in dir(hfg.nodes) if re.fullmatch("[a-z]+", name) and f"`{name}`" in text]
    named = re.findall(rf"`({'|'.join(families)})\.(\w+)`", text)
    assert ("flow", "SampleAndHold") in named
    assert [f"{family}.{name}" for family, name in named if not hasattr(getattr(hfg.nodes, family), name)] == []

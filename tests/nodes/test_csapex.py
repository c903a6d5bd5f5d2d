"""The page that says what became of the nodes of CS::APEX names only what there is, and all that says so of itself."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

from hfg.catalogue import describe_type

PAGE = (Path(__file__).parents[2] / "docs/howto/csapex.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`(flow|time|activity|logic|values|collections|files|display)\.(\w+)", PAGE)))


@pytest.mark.parametrize(("family", "name"), NAMED)
def test_the_page_names_types_that_there_are(family: str, name: str) -> None:
    assert name in import_module(f"hfg.nodes.{family}").__all__


@pytest.mark.parametrize("family", ["flow", "time", "activity", "logic", "values", "collections", "files", "display"])
def test_what_a_type_stands_for_is_on_the_page(family: str) -> None:
    module = import_module(f"hfg.nodes.{family}")
    for name in module.__all__:
        for apex in describe_type(getattr(module, name)._type).apex:
            assert apex.rpartition("::")[2] in PAGE, f"{family}.{name} stands for {apex}"

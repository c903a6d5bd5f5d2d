"""Commands that somebody else wrote import no code but that which a graph file may (rule L4)."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

import hfg
from hfg.errors import GraphError

pytestmark = pytest.mark.rule("L4")

COMMANDS: list[dict[str, Any]] = [
    {"do": "Add", "type": "arm_of_others:Arm", "path": "arm"},
    {"do": "Replace", "path": "arm", "type": "arm_of_others:Arm"},
    {"do": "AddInput", "name": "a", "type": "list[arm_of_others.Pose]"},
    {"do": "AddSubgraph", "path": "box", "events": {"a": "arm_of_others.Pose"}},
    {"do": "Connect", "source": "a.b", "target": "c.d", "through": [{"type": "arm_of_others:smoothed"}]},
    {"do": "SetEdge", "source": "a.b", "target": "c.d", "through": [{"type": "arm_of_others:smoothed"}]},
    {
        "do": "SetParameter",
        "path": "a.b",
        "value": [{"$type": "arm_of_others:Pose", "value": {}}],
    },
]


@pytest.fixture(autouse=True)
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One beside the program that nobody has imported, and that tells when somebody does."""
    (tmp_path / "arm_of_others.py").write_text("raise RuntimeError('it ran')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command["do"])
def test_a_command_that_names_the_code_of_others_is_refused_before_it_is_applied(command: dict[str, Any]) -> None:
    with pytest.raises(GraphError, match=r'hfg.commands.decode\(..., allow=\["arm_of_others"\]\)'):
        hfg.commands.decode(json.dumps([command]))
    assert "arm_of_others" not in sys.modules


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command["do"])
def test_what_is_allowed_is_read(command: dict[str, Any]) -> None:
    assert hfg.commands.decode(json.dumps([command]), allow=["arm_of_others"])


def test_types_of_hfg_need_no_leave() -> None:
    graph = hfg.Graph()
    text = '[{"do":"Add","type":"hfg.nodes.values.constants:ConstantInt","path":"a"}]'
    graph.edit(*hfg.commands.decode(text))
    assert list(graph.nodes) == ["a"]


def test_a_value_refers_to_no_function_that_just_is_there() -> None:
    value = {"$type": "reference", "value": "os:system"}
    operator = {"type": "reactivex.operators:map", "arguments": [value]}
    command = {"do": "Connect", "source": "a.b", "target": "c.d", "through": [operator]}
    with pytest.raises(GraphError, match="must not have any function called"):
        hfg.commands.decode(json.dumps([command]))


@hfg.node
def acts(value: int, *, how: Callable[[int], int] = abs) -> int:
    return how(value)


def test_a_text_without_a_tag_refers_to_no_code_when_it_is_applied() -> None:
    """Nobody can tell from the command what type the parameter has, so such a text is not compared with the rule."""
    graph = hfg.Graph()
    graph.add(acts(), name="acts")
    command = {"do": "SetParameter", "path": "acts.how", "value": "os:system"}
    (decoded,) = hfg.commands.decode(json.dumps([command]))
    with pytest.raises(GraphError, match="acts.how"):
        graph.edit(decoded)
    with pytest.raises(hfg.errors.EncodingError, match="a text alone does not refer to code"):
        graph["acts"].ports.parameters["how"].spec.decode("os:system")
    assert graph["acts"].ports.parameters["how"].value is abs


def test_a_time_of_day_in_a_value_is_no_reference() -> None:
    value = {"$type": "datetime:datetime", "value": "2026-01-02T10:00:00"}
    command = {"do": "SetParameter", "path": "a.b", "value": value}
    assert hfg.commands.decode(json.dumps([command]))


def test_an_included_file_is_named_if_it_is_in_the_project(tmp_path: Path) -> None:
    for folder, is_read in ((tmp_path, True), (tmp_path.parent, False)):
        quoted = quote(str(folder / "part.hfg.yaml"), safe="").replace(".", "%2E")
        text = json.dumps([{"do": "Add", "type": f"hfg.files.boxes:File[{quoted}]", "path": "a"}])
        if is_read:
            assert hfg.commands.decode(text)
        else:
            with pytest.raises(GraphError, match="stands for another file"):
                hfg.commands.decode(text)

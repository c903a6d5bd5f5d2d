"""`hfg convert`, and graph files as TARGET."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from hfg.files import schema
from tests.cli.conftest import Command


def test_code_becomes_a_file_that_checks_draws_and_runs_alike(command: Command) -> None:
    assert command("convert", "steps.py:build", "steps.hfg.yaml").out == ""
    text = Path("steps.hfg.yaml").read_text()
    assert "type: steps:third" in text
    assert command("convert", "steps.hfg.yaml").out == text
    for verb in (["run", "--clock", "virtual", "--json"], ["check"], ["draw"]):
        code, file = (command(*verb, target) for target in ("steps.py:build", "steps.hfg.yaml"))
        assert code.code == file.code == 0
        if verb == ["check"]:
            assert code.out == file.out
        if verb == ["draw"]:
            assert code.out == file.out


def test_a_parameter_of_a_graph_file_is_set_for_a_run(command: Command) -> None:
    command("convert", "steps.py:build", "steps.hfg.yaml")
    shown = command("run", "steps.hfg.yaml", "--clock", "virtual", "--param", "steps.count=2")
    assert shown.code == 0
    assert shown.out.startswith("step 0\nstep 1\n")
    assert "step 2" not in shown.out


@pytest.mark.slow
def test_the_schema_is_written(command: Command) -> None:
    assert command("convert", "--schema").out == schema(types=True)
    assert command("convert", "--schema", "graph.schema.json").code == 0
    assert Path("graph.schema.json").read_text() == schema(types=True)
    assert command("convert", "--schema", "no/such/folder.json").code == 2


@pytest.mark.slow
def test_the_schema_knows_node_types_of_an_allowed_module_of_the_current_folder(command: Command) -> None:
    shown = command("convert", "--schema", "--allow", "steps")
    assert (shown.code, shown.err) == (0, "")
    assert '"const": "steps:third"' in shown.out
    shown = command("convert", "--schema", "--allow", "stairs")
    assert (shown.code, shown.out) == (2, "")
    assert 'hfg: stairs has no node types for the schema: there is no module "stairs"' in shown.err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["convert"], "there is no TARGET: write hfg convert graph.py graph.hfg.yaml"),
        (["convert", "steps.py:build", "steps.yaml"], "steps.yaml is no name of a graph file; call it steps.hfg.yaml"),
        (["convert", "--schema", "a", "b"], "--schema needs no TARGET"),
        (
            ["run", "steps.hfg.yaml", "--arg", "count=3"],
            "is a graph file, not a function, so --arg count=3 means nothing",
        ),
        (["run", "steps.py:build", "--allow", "x"], "is code, which imports what it likes, so --allow x means nothing"),
        (["run", "missing.hfg.yaml"], "missing.hfg.yaml: there is no such file"),
    ],
)
def test_wrong_uses_get_one_sentence(arguments: list[str], sentence: str, command: Command) -> None:
    shown = command(*arguments)
    assert shown.code == 2
    assert sentence in shown.err
    assert shown.err.count("\n") == 1


APEX = """#!/usr/bin/csapex
nodes:
  - {type: 'csapex::IntRangeGenerator', uuid: 'csapex::IntRangeGenerator_0'}
  - {type: 'csapex::CountMessages', uuid: 'csapex::CountMessages_0'}
connections:
  - {uuid: 'csapex::IntRangeGenerator_0:|:out_0', targets: ['csapex::CountMessages_0:|:in_0']}
"""


@pytest.mark.slow
def test_a_file_of_csapex_becomes_a_graph_file_with_a_report(command: Command) -> None:
    Path("count.apex").write_text(APEX)
    shown = command("convert", "count.apex", "count.hfg.yaml")
    assert shown.code == 0
    assert shown.out.startswith("count.apex: 2 nodes, 1 connection, no notes\n  mapped: no nodes, 1 connection\n")
    assert "type: hfg.nodes.flow:Count\n" in Path("count.hfg.yaml").read_text()
    without = command("convert", "count.apex")
    assert (without.out, without.err) == (Path("count.hfg.yaml").read_text(), shown.out)
    report = msgspec.json.decode(command("convert", "count.apex", "--json").out)
    assert [one["state"] for one in report["nodes"]] == ["approximated", "approximated"]
    assert report["connections"][0]["target"] == "IntRangeGenerator_0.out -> CountMessages_0.value"
    for target in ("count.apex", "count.hfg.yaml"):
        assert command("check", target).code == 0
        assert command("run", target, "--clock", "virtual").code == 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["run", "count.apex", "--arg", "a=1"], "count.apex is a file of CS::APEX, so --arg a=1 means nothing to it"),
        (["run", "lost.apex"], "lost.apex: there is no such file"),
        (["convert", "steps.py:build", "--json"], "--json tells what became of a file of CS::APEX; leave it out"),
        (["convert", "count.apex", "count.yaml"], "count.yaml is no name of a graph file; call it count.hfg.yaml"),
    ],
)
def test_wrong_uses_of_files_of_csapex_get_one_sentence(arguments: list[str], sentence: str, command: Command) -> None:
    Path("count.apex").write_text(APEX)
    shown = command(*arguments)
    assert shown.code == 2
    assert sentence in shown.err
    assert shown.err.count("\n") == 1

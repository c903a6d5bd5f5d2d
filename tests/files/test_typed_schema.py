"""The JSON schema of graph files knows the installed node types: what it accepts loads, what it refuses does not."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

import hfg
from hfg.catalogue import installed
from hfg.errors import FileError
from hfg.files import schema
from hfg.registry import find

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted((ROOT / "examples").rglob("*.hfg.yaml"))


@cache
def known() -> dict[str, Any]:
    made: dict[str, Any] = json.loads(schema(types=True), parse_constant=pytest.fail)
    return made


def complaints(text: str) -> list[str]:
    """What a checker says of a file."""
    checker = jsonschema.Draft202012Validator(known())
    return [error.message for error in checker.iter_errors(yaml.safe_load(text))]


@pytest.mark.slow
def test_it_is_a_schema_and_knows_all_types_that_are_installed() -> None:
    jsonschema.Draft202012Validator.check_schema(known())
    offered = known()["$defs"]["NodeDocument"]["properties"]["type"]["anyOf"]
    assert [one.get("const") for one in offered[:-1]] == sorted(one.reference for one in installed().types)
    assert all(one["description"] for one in offered[:-1])


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.name))
def test_each_example_keeps_it(file: Path) -> None:
    assert complaints(file.read_text(encoding="utf-8")) == []


def defaults() -> Iterator[tuple[str, Any, Any]]:
    """Each parameter of the library: the part of the schema, its specification and its default as files have it."""
    for one in installed().types:
        kind: Any = getattr(find(one.reference), "_type", None)
        part = known()["$defs"][f"parameters of {one.reference}"]["properties"]
        for said in one.parameters if kind is not None else ():
            if said.name in part and not said.required:
                yield f"{one.reference} {said.name}", part[said.name], kind.parameters[said.name]


@pytest.mark.slow
def test_it_accepts_the_default_of_each_parameter() -> None:
    count = 0
    for where, part, spec in defaults():
        count += 1
        data = spec.encode(spec.default)
        assert jsonschema.Draft202012Validator(part).is_valid(data), f"{where} = {data!r}"
    assert count > 900


@pytest.mark.slow
def test_it_says_what_each_parameter_means_with_its_unit_and_limits() -> None:
    wait = known()["$defs"]["parameters of hfg.nodes.activity:Wait"]["properties"]["seconds"]
    assert wait["type"] == ["number", "string"]  # "inf" is one
    assert wait["minimum"] == 0
    assert wait["default"] == 1.0
    assert wait["description"]


@pytest.mark.parametrize(
    ("node", "complaint"),
    [
        ("type: hfg.nodes.activity:Wait, parameters: {second: 1}", "'second' was unexpected"),
        ("type: hfg.nodes.activity:Wait, parameters: {seconds: soon}", "'soon' does not match"),
        ("type: hfg.nodes.activity:Wait, parameters: {seconds: -1}", "-1 is less than the minimum of 0"),
        ("type: hfg.nodes.video:WriteVideo, parameters: {path: a.avi, codec: H264}", "'H264' is not one of"),
        (
            "type: hfg.nodes.video:WriteVideo, parameters: {path: a.avi, fps: 0}",
            "less than or equal to the minimum of 0",
        ),
        ("type: hfg.nodes.video:WriteVideo, parameters: {path: 3}", "3 is not of type 'string'"),
    ],
)
def test_what_it_refuses_is_not_loaded(node: str, complaint: str, tmp_path: Path) -> None:
    text = f"hfg: 1\nnodes:\n  a: {{{node}}}\n"
    said = complaints(text)
    assert said
    assert complaint in " ".join(said)
    file = tmp_path / "a.hfg.yaml"
    file.write_text(text)
    with pytest.raises(FileError):
        hfg.load(file)


def test_types_that_it_does_not_know_are_left_to_the_loader() -> None:
    assert complaints("hfg: 1\nnodes:\n  a: {type: 'my_robot.nodes:Arm', parameters: {gain: 3}}\n") == []


@pytest.mark.slow
def test_a_package_of_ones_own_is_known_where_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my_arm.py").write_text(ARM)
    monkeypatch.syspath_prepend(tmp_path)
    made = json.loads(schema(allow=["my_arm"]))
    checker = jsonschema.Draft202012Validator(made)
    part = {"hfg": 1, "nodes": {"a": {"type": "my_arm:Arm", "parameters": {"gain": 3}}}}
    assert checker.is_valid(part)
    part["nodes"]["a"]["parameters"]["gain"] = 30  # type: ignore[index]
    assert not checker.is_valid(part)
    with pytest.raises(hfg.errors.UsageError, match="my_leg has no node types for the schema"):
        schema(allow=["my_leg"])


ARM = '''
from annotated_types import Interval

import hfg


class Arm(hfg.Node):
    """Moves.

    Attributes:
      gain: how fast.
    """

    gain = hfg.Parameter(1.0, Interval(ge=0, le=10), unit="1/s")
'''

"""The YAML that is written: what is read from it is what was written, by other readers too; and its schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import hfg.files
import hfg.files.findings
import hfg.files.reading
from hfg.files import EdgeDocument, describe, parsing, schema, text_of
from hfg.files.emitting import emit
from hfg.files.parsing import parse, plain
from tests.files.programs import plan_of
from tests.files.test_included import FOLLOW, WHOLE

ODD = [
    "no",
    "on",
    "1e3",
    "12:30",
    "a: b",
    "- x",
    "? y",
    "|x",
    "a #b",
    "x:",
    "2020-01-01",
    "a\nb\n",
    "a\n\n",
    "\na",
    "=",
]
ODD += [
    "<<",
    "a\n b\n",
    "a\n\n\nb",
    "...",
    " ",
    "--- a",
    "--- ",
    "&a",
    "*a",
    "!x",
    "%x",
    "@",
    "`",
    "'",
    '"',
    "~",
    "0o7",
]
TEXTS = st.text(st.characters(exclude_categories=["Cs"])) | st.sampled_from(ODD)
SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | TEXTS
DATA = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4), max_leaves=20
)


def read_back(text: str) -> Any:
    findings: list[tuple[int, str]] = []
    found = parse(text, lambda line, sentence: findings.append((line, sentence)))
    assert not findings
    return None if found is None else plain(found)


@pytest.mark.slow
@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.dictionaries(TEXTS, DATA, min_size=1, max_size=4))
def test_what_is_written_is_read_the_same_by_every_reader(data: dict[str, Any]) -> None:
    """By ours, with libyaml and without it, and by PyYAML, whose words are those of YAML 1.1."""
    text = emit(data)
    assert read_back(text) == data
    assert yaml.safe_load(text) == data
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parsing, "_Parser", None)
        assert read_back(text) == data


def test_words_are_those_of_yaml_1_2() -> None:
    text = (
        "{a: no, b: on, c: 010, d: 1e3, e: 12:30, f: 2020-01-01, g: 0x1f, h: 0o17, i: .5, j: ~, k: , l: '1', m: -.inf}"
    )
    assert read_back(text) == {
        "a": "no",
        "b": "on",
        "c": 10,
        "d": 1000.0,
        "e": "12:30",
        "f": "2020-01-01",
        "g": 31,
        "h": 15,
        "i": 0.5,
        "j": None,
        "k": None,
        "l": "1",
        "m": float("-inf"),
    }


def test_values_of_several_lines_and_lists_are_read_easily() -> None:
    text = "a: |\n  one\n\n  two\nb:\n  - c: 1\n    d: 2\n  - [1, 2.5]\n  -\n    - x\n"
    assert emit({"a": "one\n\ntwo\n", "b": [{"c": 1, "d": 2}, [1, 2.5], ["x"]]}) == text.replace("-\n    - x", "- - x")


# --- the schema ---


def test_the_schema_beside_the_code_is_the_one_of_the_code() -> None:
    """`hfg convert --schema hfg/files/graph.schema.json` writes it anew."""
    file = Path(hfg.files.__file__).with_name("graph.schema.json")
    assert file.read_text(encoding="utf-8") == schema()


def valid(text: str) -> bool:
    found: dict[str, Any] = read_back(text)
    checker = jsonschema.Draft202012Validator(json.loads(schema()))
    return checker.is_valid(found)


@pytest.mark.slow
def test_every_file_that_is_written_keeps_the_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(json.loads(schema()))
    for seed in range(40):
        plan = plan_of(seed)
        if plan is not None:
            assert valid(text_of(describe(plan.build())))
    assert valid(FOLLOW)
    assert valid(WHOLE)
    assert valid("hfg: 1\nnodes:\nedges:\n  - source: a b.x\n    target: c -> d.y\n    active: true\n")


@pytest.mark.parametrize(
    "text",
    [
        "name: x",
        "hfg: 2",
        "hfg: 1\nnam: x",
        "hfg: 1\nnodes: {a: {}}",
        "hfg: 1\nnodes: {a: {type: 'x:y', priority: high}}",
        "hfg: 1\nnodes: {a: {type: 'x:y', on_error: skp}}",
        "hfg: 1\nedges: [a.b - c.d]",
        "hfg: 1\nedges: [{a.b -> c.d: {activ: true}}]",
        "hfg: 1\nedges: [{source: a.b}]",
    ],
)
def test_the_schema_refuses_what_loading_refuses(text: str) -> None:
    assert not valid(text)


def test_what_a_person_writes_otherwise_is_the_same_document() -> None:
    flow = "{hfg: 1, name: g, edges: [{a.x -> b.y: {active: true}}, {source: a.x, target: c.y}, a.x -> d.y]}"
    findings = hfg.files.findings.Findings()
    read = hfg.files.reading.read_bytes(flow.encode(), "flow", findings)
    assert read is not None
    assert not findings.problems
    plain_edges = [EdgeDocument("a.x", "c.y"), EdgeDocument("a.x", "d.y")]
    assert read.document.edges == [EdgeDocument("a.x", "b.y", active=True), *plain_edges]
    assert text_of(read.document) == (
        "hfg: 1\nname: g\nedges:\n  - a.x -> b.y:\n      active: true\n  - a.x -> c.y\n  - a.x -> d.y\n"
    )

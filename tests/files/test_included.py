"""Subgraphs in files of their own: included with parameters, found by name, edited, saved from elsewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

import hfg
import tests.files.programs  # noqa: F401 - files may name types of modules that are imported
from hfg.files import describe, load, save, text_of

FOLLOW = """\
hfg: 1
name: follow
notes:
  author: somebody
inputs:
  value: int
outputs:
  scaled: int
events:
  rang: int
parameters:
  factor:
    type: int
    default: 3
    limits:
      ge: 0
nodes:
  double:
    type: tests.files.programs:double
    position: [1, 2]
  ear:
    type: tests.files.programs:Ear
    gate:
      by: double
edges:
  - value -> double.value
  - double.out -> scaled
  - double.out.sent -> ear.hear
  - ear.rang -> rang
promotes:
  factor:
    - double.factor
"""
WHOLE = """\
hfg: 1
name: whole
outputs:
  seen: int
nodes:
  numbers:
    type: tests.files.programs:numbers
  once:
    file: parts/follow.hfg.yaml
    parameters:
      factor: 5
  again:
    file: parts/follow.hfg.yaml
    inside:
      double:
        position: [7, 8]
      ear:
        enabled: false
edges:
  - numbers.out -> once.value
  - once.scaled -> again.value
  - again.scaled -> seen
  - once.rang -> stop:
      capacity: 2
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("parts").mkdir()
    Path("parts/follow.hfg.yaml").write_text(FOLLOW)
    Path("whole.hfg.yaml").write_text(WHOLE)


def test_an_included_file_is_a_subgraph_with_its_ports_and_parameters() -> None:
    graph = load("whole.hfg.yaml")
    save(graph, "whole.hfg.yaml")
    assert Path("whole.hfg.yaml").read_text() == WHOLE
    once, again = graph["once"], graph["again"]
    assert type(once) is type(again)
    assert list(once._type.inputs) == ["value"]
    assert [graph[f"{name}/double"]._parameters["factor"] for name in ("once", "again")] == [5, 3]
    assert graph.notes("once/double") == {"position": [1, 2]}
    assert graph.notes("again/double") == {"position": [7, 8]}
    seen: list[int] = []
    graph["once/ear"].rang.subscribe(lambda token: seen.append(token.value))
    with pytest.raises(ValueError, match="must be >= 0"):
        once.ports.parameters["factor"].value = -1


def test_a_file_can_be_named_wherever_a_type_is() -> None:
    graph = load("whole.hfg.yaml")
    reference = graph["once"]._type.reference
    assert reference is not None
    other = hfg.Graph()
    other.edit(hfg.commands.Add(reference, "box", {"factor": 7}))
    assert other["box/double"]._parameters["factor"] == 7
    empty = hfg.Graph("whole")
    empty.edit(*graph.as_commands())
    assert [edge.label for edge in empty.edges] == [edge.label for edge in graph.edges]


def test_an_inside_that_was_edited_stands_in_the_including_file_from_then_on() -> None:
    graph = load("whole.hfg.yaml")
    graph.edit(hfg.commands.Remove("again/ear"))
    save(graph, "whole.hfg.yaml")
    assert Path("parts/follow.hfg.yaml").read_text() == FOLLOW
    other = load("whole.hfg.yaml")
    assert list(other["again"].graph.nodes) == ["double"]
    assert list(other["once"].graph.nodes) == ["double", "ear"]
    assert text_of(describe(other, beside="whole.hfg.yaml")) == Path("whole.hfg.yaml").read_text()
    other["again"].ports.parameters["factor"].value = 9
    assert other["again/double"]._parameters["factor"] == 9


def test_a_graph_saved_in_another_folder_names_its_files_from_there(tmp_path: Path) -> None:
    Path("pyproject.toml").touch()
    Path("other").mkdir()
    graph = load("whole.hfg.yaml")
    save(graph, "other/whole.hfg.yaml")
    assert "file: ../parts/follow.hfg.yaml" in Path("other/whole.hfg.yaml").read_text()
    assert list(load("other/whole.hfg.yaml").nodes) == ["numbers", "once", "again"]
    elsewhere = tmp_path.parent / "elsewhere"
    elsewhere.mkdir(exist_ok=True)
    with pytest.raises(hfg.errors.FileError, match="is outside of the project .* save beside it, or copy it there"):
        save(graph, elsewhere / "whole.hfg.yaml")


def test_a_file_that_changed_is_another_type_the_next_time() -> None:
    first = load("whole.hfg.yaml")
    Path("parts/follow.hfg.yaml").write_text(FOLLOW.replace("default: 3", "default: 4"))
    second = load("whole.hfg.yaml")
    assert [graph["again/double"]._parameters["factor"] for graph in (first, second)] == [3, 4]
    assert type(first["again"]) is not type(second["again"])
    assert type(load("whole.hfg.yaml")["again"]) is type(second["again"])


def test_files_include_files_that_include_files() -> None:
    Path("parts/middle.hfg.yaml").write_text(
        "hfg: 1\ninputs: {value: int}\noutputs: {out: int}\nparameters: {by: {type: int, default: 2}}\n"
        "nodes:\n  inner: {file: follow.hfg.yaml}\n"
        "edges:\n  - value -> inner.value\n  - inner.scaled -> out\npromotes: {by: [inner.factor]}\n"
    )
    Path("top.hfg.yaml").write_text("hfg: 1\nnodes:\n  m: {file: parts/middle.hfg.yaml, parameters: {by: 6}}\n")
    graph = load("top.hfg.yaml")
    assert graph["m/inner/double"]._parameters["factor"] == 6
    save(graph, "top.hfg.yaml")
    assert Path("top.hfg.yaml").read_text() == (
        "hfg: 1\nname: graph\nnodes:\n  m:\n    file: parts/middle.hfg.yaml\n    parameters:\n      by: 6\n"
    )


def test_what_a_file_says_about_the_inside_of_an_included_file_counts_more_than_what_that_says() -> None:
    """At any depth: the outermost file decides."""
    Path("parts/middle.hfg.yaml").write_text(
        "hfg: 1\nnodes:\n  inner: {file: follow.hfg.yaml, inside: {double: {parameters: {factor: 4}}}}\n"
    )
    Path("top.hfg.yaml").write_text(
        "hfg: 1\nnodes:\n  a: {file: parts/middle.hfg.yaml}\n"
        "  b: {file: parts/middle.hfg.yaml, inside: {inner/double: {parameters: {factor: 9}}}}\n"
    )
    graph = load("top.hfg.yaml")
    assert [graph[f"{name}/inner/double"]._parameters["factor"] for name in ("a", "b")] == [4, 9]
    text = text_of(describe(graph, beside="top.hfg.yaml"))
    save(graph, "top.hfg.yaml")
    assert text_of(describe(load("top.hfg.yaml"), beside="top.hfg.yaml")) == text

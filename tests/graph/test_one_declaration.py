"""An option is declared once: whatever is done with a graph keeps it, also options that nothing else in hfg knows."""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.engine.runtime.settings import RunFields, RunGiven
from hfg.graph import EdgeGiven, EdgeOptions, GroupGiven, GroupSpec, NodeGiven, NodeOptions
from hfg.graph.structure.option import declared
from tests.support import one_more_option, option_tables

ALL = [2.5, 3, 7]
"""The values that `one_more_option` gives to its options of an edge, a node and a group."""
_ROW = (
    "| `max_age_s` | a number above 0, or None for no limit |  | No signal waits longer. Only on edges from events. |"
)
ENDS = {
    "made": ALL,
    "saved and loaded": [*ALL, True],
    "as commands": ALL,
    "edited, undone, redone": [[9.0, 3, 1], ALL, [9.0, 3, 1]],
    "grouped and dissolved": [ALL, ALL],
    "copied": ALL,
    "cut into processes": [[2.5, 2.5], True, True, True],
    "drawn": [True] * 6,
    "in the schema": ["Its share of the processor.", 1, 0, True],
    "in the docs": [_ROW, True, True],
    "run": ["done", 3, 5, 5],
    "on the command line": [1, True],
}


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    """What becomes of options that are declared in another process, before it imports hfg."""
    script = Path(inspect.getfile(one_more_option))
    done = subprocess.run(
        [sys.executable, "-m", one_more_option.__name__],
        capture_output=True,
        text=True,
        check=False,
        cwd=script.parents[2],
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


@pytest.mark.parametrize("path", ENDS)
@pytest.mark.rule("R4", "G1", "L1")
def test_an_option_that_is_only_declared_is_at_the_end_of_each_path(found: dict[str, Any], path: str) -> None:
    assert found[path] == ENDS[path]


def test_an_option_that_is_only_declared_is_refused_where_it_cannot_be(found: dict[str, Any]) -> None:
    beginnings = [
        '"begin.processed" -> "twice.activate": max_age_s must be a number above 0, or None for no limit, got -1',
        '"twice.out" -> "begin.activate": max_age_s=2.5 is for edges from events, "twice.out" is an output',
        'node "more": weight must be a whole number from 1 on, got 0',
        'subgraph "box": it does not fire itself, so weight means nothing',
        "lap must be a whole number from 1 on, got 0",
    ]
    for sentence, beginning in zip(found["refused"], beginnings, strict=True):
        assert sentence.startswith(beginning)


def test_no_path_is_left_out(found: dict[str, Any]) -> None:
    assert found.keys() == one_more_option.PATHS.keys() == {*ENDS, "refused"}


@pytest.mark.parametrize(
    ("given", "kind"),
    [(EdgeGiven, EdgeOptions), (NodeGiven, NodeOptions), (GroupGiven, GroupSpec), (RunGiven, RunFields)],
)
def test_type_checkers_know_the_options_that_are_declared(given: Any, kind: Any) -> None:
    assert list(given.__annotations__) == list(declared(kind))


def test_the_tables_in_the_docs_are_those_of_the_declarations() -> None:
    """`python -m tests.support.option_tables` writes them."""
    text = option_tables.PAGE.read_text(encoding="utf-8")
    assert text == option_tables.written(text)


def test_type_checkers_and_calls_refuse_what_is_no_option() -> None:
    """Mypy runs over this file and reports a comment that ignores nothing."""
    graph = hfg.Graph()
    with pytest.raises(TypeError, match='graph.connect: there is no option "capacty", .* did you mean "capacity"'):
        graph.connect(graph.start, graph.stop, capacty=3)  # type: ignore[call-overload]
    with pytest.raises(hfg.errors.ConnectionError, match="capacity must be a whole number from 1 on, got '3'"):
        graph.connect(graph.start, graph.stop, capacity="3")  # type: ignore[call-overload]
    with pytest.raises(TypeError, match='graph.add: there is no option "retry"'):
        graph.add(hfg.Subgraph(), retry=3)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match='graph.group: there is no option "thread"'):
        graph.group("work", thread=3)  # type: ignore[call-arg]
    with pytest.raises(hfg.errors.GraphError, match="unexpected keyword argument 'capacty'"):
        hfg.commands.SetEdge("a.out", "b.value", capacty=3)  # type: ignore[call-arg]

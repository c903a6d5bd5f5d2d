"""The figures of `tools/house.py`, on a tree that is small enough to count by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools import house

WORKER = """
from __future__ import annotations
from typing import TYPE_CHECKING, Any  # two names
if TYPE_CHECKING:
    from hfg.graph.level import Level

class Worker:
    def go(self, level: Level) -> Any:
        # a comment
        level.busy = self.busy = True
        assert level
        del level.parent.child

    @property
    def state(self): ...
    @state.setter
    def state(self, value): ...
    def _hidden(self): ...
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    files = {
        "hfg/__init__.py": "from hfg.graph import level\n",
        "hfg/graph/__init__.py": "",
        "hfg/graph/level.py": "def f():\n    from ..engine import worker\n",
        "hfg/engine/__init__.py": "def long():\n    '''Says\n    something.'''\n" + 40 * "    f()\n",
        "hfg/engine/worker.py": WORKER,
        "tests/test_layers.py": "FLOORS = {'hfg.graph': 1, 'hfg.engine': 2, 'hfg': 2}\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_small_tree_has_the_figures_that_one_counts(tree: Path) -> None:
    found = house.figures(tree)
    lines = len(WORKER.splitlines())
    assert found["lines"] == str(1 + 2 + 43 + lines)
    assert (found["lines of hfg.engine"], found["lines of hfg.graph"]) == (str(43 + lines), "2")
    assert (found["modules"], found["packages with their subpackages"], found["layers"]) == ("5", "3", "2")
    assert found["arrows between components"] == "3"  # hfg to graph, graph to engine and back
    assert found["import cycles (modules in them)"] == "1 (2)"  # one way in a function, the other for type checkers
    assert found["public methods of the largest classes"] == "Worker 2"
    assert found["functions over 40 lines"] == "1"
    assert found["foreign writes in graph and engine"] == "2"
    assert found["Any"] == "1"
    assert found["asserts"] == "1"
    assert found["comments per 100 lines"] == f"{100 * 2 / (46 + lines):.1f}"


def test_each_tree_has_a_column_and_components_stand_together(tree: Path) -> None:
    found = house.figures(tree)
    older = {name: figure for name, figure in found.items() if name != "lines of hfg.graph"}
    rows = list(house.table({"older": older, "this tree": found}))
    assert rows[0] == "|  | older | this tree |"
    assert rows[2:5] == [
        f"| lines | {found['lines']} | {found['lines']} |",
        f"| lines of hfg.engine | {found['lines of hfg.engine']} | {found['lines of hfg.engine']} |",
        "| lines of hfg.graph |  | 2 |",
    ]

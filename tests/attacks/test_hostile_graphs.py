"""A small text of a graph takes neither all memory nor forever: monitors, promotions, values, pasted nodes (L4)."""

from __future__ import annotations

import csv
import io
import json
import os
from base64 import b64decode
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hfg
from hfg.encoding import decode
from hfg.errors import EncodingError, FileError, GraphError, UsageError
from hfg.graph.editing import history_of
from hfg.graph.editing.changes import PromotionChange
from hfg.graph.structure import monitors
from hfg.monitors import active, at_least, parse
from hfg.monitors.compiling import compiled
from hfg.nodes.activity import Wait
from hfg.nodes.files import ArrayRows, read_array, read_arrays
from hfg.studio import clipboard
from hfg.studio.capturing import value_as_file
from hfg.testing import fire

pytestmark = [pytest.mark.rule("L4"), pytest.mark.timeout(120)]

PRIME = 2**61 - 1
"""Whole numbers that it divides have the hash 0."""


def test_a_file_with_more_monitors_than_are_allowed_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The history of edits keeps all of them for each that was declared."""
    monkeypatch.setattr(monitors, "MOST_MONITORS", 3)
    several = "".join(f"  m{number}: never(active(a))\n" for number in range(4))
    file = tmp_path / "a.hfg.yaml"
    file.write_text(f"hfg: 1\nnodes:\n  a: {{type: 'hfg.nodes.activity:Wait'}}\nmonitors:\n{several}")
    with pytest.raises(FileError, match='monitor "m3": the graph declares 3 monitors already'):
        hfg.load(file)
    graph = hfg.Graph("g")
    graph.add(Wait(), name="a")
    for number in range(3):
        graph.monitor(f"m{number}", "never(active(a))")
    graph.monitor("m2", "never(active(a))")
    with pytest.raises(GraphError, match="as many as are allowed"):
        graph.monitor("m3", "never(active(a))")
    graph.edit(hfg.commands.SetMonitor("m2", "always(active(a))"))


@pytest.mark.parametrize("number", ["1e999", "1e300", "1000001", "1.5", "0", "-1"])
def test_a_monitor_counts_a_number_of_points_that_can_be_remembered(number: str) -> None:
    with pytest.raises(UsageError, match="at_least counts points|counts points, from 1 to 1,000,000"):
        parse(f"never(at_least({number}, active(a)))")


def test_a_monitor_needs_memory_only_for_points_that_have_come() -> None:
    formula = at_least(1_000_000, active("a"), within_s=10)
    _, step = compiled([formula])
    assert step(0.0, True) == (False,)
    states: Any = step.__closure__
    assert [len(cell.cell_contents) for cell in states if hasattr(cell.cell_contents, "maxlen")] == [1]


class Box(hfg.Subgraph):
    """A subgraph with a parameter for many nodes."""

    seconds = hfg.Parameter(1.0)
    other = hfg.Parameter(1.0)

    def build(self, graph: hfg.Graph) -> None:
        for number in range(6):
            graph.add(Wait(), name=f"a{number}")


def promotes(number: int, outer: str = "seconds") -> hfg.commands.Command:
    return hfg.commands.Promote(f"box.{outer}", f"box/a{number}.seconds")


def test_parameters_that_are_promoted_one_by_one_are_kept_once(tmp_path: Path) -> None:
    """Each time all before were kept again: a file of a megabyte took gigabytes."""
    graph = hfg.Graph("g")
    graph.add(Box(), name="box")
    before = hfg.commands.encode(graph.as_commands())
    graph.edit(promotes(0), promotes(1), promotes(2, "other"), promotes(3), hfg.commands.Disable("box/a5"), promotes(4))
    after = hfg.commands.encode(graph.as_commands())
    changes = [one for one in history_of(graph).done[-1].changes if isinstance(one, PromotionChange)]
    assert [[len(ports) for ports in one.after.values()] for one in changes] == [[3, 1], [4, 1]]
    graph.undo()
    assert hfg.commands.encode(graph.as_commands()) == before
    graph.redo()
    assert hfg.commands.encode(graph.as_commands()) == after
    graph.edit(hfg.commands.SetParameter("box.seconds", 3.0))
    assert [graph[f"box/a{number}"].seconds for number in range(6)] == [3.0, 3.0, 1.0, 3.0, 3.0, 1.0]
    with pytest.raises(GraphError):
        graph.edit(promotes(5), promotes(5))
    assert not any(port.name == "a5" for ports in changes[-1].after.values() for port in ports)


def test_numbers_with_one_hash_are_no_set_of_a_graph_file() -> None:
    many = [number * PRIME for number in range(1000)]
    with pytest.raises(EncodingError, match="invalid member .*have the same hash"):
        decode(many, set[int])
    with pytest.raises(EncodingError, match="invalid key .*have the same hash"):
        decode([[one, 1] for one in many], dict[int, int])
    assert len(decode([number * 2**40 for number in range(5000)], frozenset[int])) == 5000


def test_what_is_pasted_is_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """It comes from the clipboard, and may be somebody else's; the loop of the run waits meanwhile."""
    looked = 0

    class Counts(dict[str, Any]):
        def __contains__(self, key: object) -> bool:
            nonlocal looked
            looked += 1
            return super().__contains__(key)

    node_in = clipboard._node_in
    monkeypatch.setattr(clipboard, "_node_in", lambda path, nodes: node_in(path, Counts(dict.fromkeys(nodes))))
    text = json.dumps([{"do": "Add", "type": "hfg.testing.nodes:double", "path": f"b{n}/x"} for n in range(300)])
    pasted = clipboard.pasted(hfg.Graph("g"), text, "", ())
    assert [one["path"] for one in pasted[:3]] == ["x", "x_2", "x_3"]
    assert len({one["path"] for one in pasted}) == 300
    assert looked < 300 * 10


def test_no_text_becomes_a_formula_of_a_spreadsheet() -> None:
    rows = [{"=name": "=cmd|' /C calc'!A0", "b": -1}, {"=name": "@sum(1)", "b": "a=b"}]
    written = b64decode(value_as_file(rows, "a.out", "csv")["base64"]).decode()
    assert list(csv.reader(io.StringIO(written))) == [
        ["'=name", "b"],
        ["'=cmd|' /C calc'!A0", "-1"],
        ["'@sum(1)", "a=b"],
    ]


# --- files of numpy


def saved(file: Path, array: Any) -> str:
    np.save(file, array)
    return str(file)


def test_booleans_that_are_none_are_refused(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npy", np.zeros(4, np.bool_))
    data = Path(path).read_bytes()
    Path(path).write_bytes(data[:-1] + b"\2")
    with pytest.raises(ValueError, match="holds values other than 0 and 1"):
        read_array.function(path)
    rows = ArrayRows(path=path)
    for _ in range(3):
        fire(rows)
    with pytest.raises(ValueError, match="holds values other than 0 and 1"):
        fire(rows)
    np.savez(tmp_path / "a.npz", a=np.frombuffer(b"\2\1", np.bool_))
    with pytest.raises(ValueError, match="holds values other than 0 and 1"):
        read_arrays.function(str(tmp_path / "a.npz"))


def test_a_file_that_another_user_cuts_while_its_rows_are_sent_ends_no_process(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npy", np.zeros((10_000, 10)))
    rows = ArrayRows(path=path)
    assert fire(rows).outputs["row"].shape == (10,)
    os.truncate(path, 200)

    def sends_all() -> None:
        for _ in range(10_000):
            fire(rows)

    with pytest.raises(ValueError, match=r"a.npy\" was cut off meanwhile, before row \d+"):
        sends_all()


@pytest.mark.parametrize(
    "array",
    [np.zeros((3, 0)), np.zeros((0, 3)), np.arange(6.0).reshape(2, 3), np.asfortranarray(np.eye(3)), np.ones(4)],
)
def test_rows_of_each_kind_of_array_are_sent(tmp_path: Path, array: Any) -> None:
    found = list(ArrayRows(path=saved(tmp_path / "a.npy", array)).process())
    assert len(found) == len(array)
    for one, row in zip(found, array, strict=True):
        np.testing.assert_array_equal(one, row)
        assert one.flags.writeable

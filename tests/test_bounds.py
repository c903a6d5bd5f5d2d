"""The limits of what is read are one table, which the docs show as it is, and the environment raises."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import hfg
from hfg.base.bounds import BOUNDS, PICTURE_PIXELS, Bound
from hfg.encoding.pictures import need_fair_size
from hfg.encoding.plain import json_value
from hfg.graph.editing import history_of
from hfg.graph.editing.changes import NotesChange
from hfg.graph.structure import naming
from hfg.nodes.activity import Wait
from hfg.nodes.files.reading import json_of, read_bytes
from hfg.recording import File
from hfg.recording.chunks import Budget, content_of
from hfg.ros import message
from hfg.tuning import tune
from tests.attacks.fuzzing import KINDS
from tests.limits import patience

PAGE = Path(__file__).resolve().parent.parent / "docs" / "howto" / "untrusted.md"


@pytest.mark.rule("L4")
def test_the_docs_have_each_limit_as_it_is() -> None:
    rows = [f"| `{one.variable}` | {one.usual:,} | {one.what} |" for one in BOUNDS]
    assert [line for line in PAGE.read_text().splitlines() if line.startswith("| `HFG_MOST")] == rows


@pytest.mark.parametrize(("said", "most"), [("5", 5), ("", 2**27), ("many", 2**27), ("-1", 2**27), ("1e9", 2**27)])
def test_a_variable_sets_a_limit_and_what_is_no_number_sets_none(
    said: str, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(PICTURE_PIXELS.variable, said)
    assert PICTURE_PIXELS.most == most


MESSAGE = struct.pack("<BQHIQQ", 5, 22, 1, 0, 7, 0)


def _chunk(folder: Path) -> None:
    (folder / "a.mcap").write_bytes(KINDS["recording"].samples()[0])
    with File(folder / "a.mcap") as recording:
        raise ValueError(str(recording.losses()))


def _graph(folder: Path) -> None:
    (folder / "a.hfg.yaml").write_text("hfg: 1\nname: g\nnodes: {}\n")
    hfg.load(folder / "a.hfg.yaml")


def _bytes(folder: Path) -> None:
    (folder / "a").write_bytes(bytes(50))
    read_bytes.function(folder / "a")


def _ports(folder: Path) -> None:
    (folder / "a.hfg.yaml").write_text(
        "hfg: 1\nnodes:\n  a: {type: 'hfg.nodes.flow:Merge', parameters: {values: 1000000000}}\n"
    )
    hfg.load(folder / "a.hfg.yaml")


def _activity(_folder: Path) -> None:
    graph = hfg.Graph("g")
    for _ in range(6):
        graph.start.activates(graph.add(Wait()).begin)
    hfg.analyse_activity(graph)


def _groups(folder: Path) -> None:
    """The history of edits keeps all groups for each that was declared."""
    names = "".join(f"  group{number}: {{}}\n" for number in range(6))
    (folder / "a.hfg.yaml").write_text(f"hfg: 1\ngroups:\n{names}nodes: {{}}\n")
    hfg.load(folder / "a.hfg.yaml")


def _journal(folder: Path) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph("g")
        graph.add(Wait(), name="a")
        return graph

    (folder / "a.jsonl").write_text("{}\n{}\n")
    tune(build, ["a.seconds=1,2"], minimize="duration_s", journal=folder / "a.jsonl")


READERS: dict[str, Callable[[Path], object]] = {
    "HFG_MOST_ACTIVE_EDGES": _activity,
    "HFG_MOST_CHUNK_BYTES": _chunk,
    "HFG_MOST_CHUNK_MESSAGES": lambda folder: content_of(9 * MESSAGE, lambda _kind, _data: None),
    "HFG_MOST_FILE_BYTES": _bytes,
    "HFG_MOST_GRAPH_FILE_BYTES": _graph,
    "HFG_MOST_GROUPS": _groups,
    "HFG_MOST_JOURNAL_BYTES": _journal,
    "HFG_MOST_JSON_VALUES": lambda folder: json_of(b"[1,2,3,4,5,6,7,8,9]", "it"),
    "HFG_MOST_NODES_AND_PORTS": _ports,
    "HFG_MOST_PICTURE_PIXELS": lambda folder: need_fair_size(KINDS["picture"].samples()[0], "it"),
    "HFG_MOST_RECORDING_RATIO": lambda folder: Budget(1000).spend(0, 2**33),
    "HFG_MOST_ROS_VALUES": lambda folder: message("tf2_msgs/msg/TFMessage").unpack(b"\0\1" + bytes(99)),
}


@pytest.mark.rule("L4")
@pytest.mark.parametrize("bound", BOUNDS, ids=lambda bound: bound.variable)
def test_each_limit_is_kept_by_who_reads(bound: Bound, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(bound.variable, "5")
    with pytest.raises(Exception, match=f"the limit is 5; if you trust it, set {bound.variable} to a larger number"):
        READERS[bound.variable](tmp_path)


def doubled(times: int) -> list[hfg.commands.Command]:
    """Return commands, the nodes of which double with each."""
    return [
        hfg.commands.AddSubgraph("box"),
        hfg.commands.Add("hfg.testing.nodes:Counter", "box/counter"),
        *(hfg.commands.Copy("box", f"box/copy {number}") for number in range(times)),
    ]


@pytest.mark.rule("L4")
def test_copies_of_copies_do_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forty commands would make a million million nodes; a recording of a stranger may hold them."""
    monkeypatch.setenv("HFG_MOST_NODES_AND_PORTS", "100")
    graph = hfg.Graph("g")
    with pytest.raises(hfg.errors.GraphError, match="would have 128 nodes and ports: the limit is 100"):
        graph.edit(*doubled(40))
    assert list(graph.nodes) == []
    for command in doubled(5):
        graph.edit(command)
    with pytest.raises(hfg.errors.GraphError, match="would have 128 nodes and ports: the limit is 100"):
        graph.edit(hfg.commands.Copy("box", "another"))
    graph.undo()
    graph.edit(hfg.commands.Copy("box", "another"))


@pytest.mark.rule("L4")
@pytest.mark.parametrize("how", ["add", "replace"])
def test_all_ports_of_a_graph_are_counted_together(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HFG_MOST_NODES_AND_PORTS", "100")
    graph = hfg.Graph("g")
    merge = "hfg.nodes.flow:Merge"
    graph.edit(hfg.commands.Add(merge, "a", {"values": 60}), hfg.commands.Add(merge, "b", {"values": 2}))
    adds, replaces = hfg.commands.Add(merge, "c", {"values": 60}), hfg.commands.Replace("b", merge, {"values": 60})
    with pytest.raises(hfg.errors.GraphError, match="nodes and ports: the limit is 100"):
        graph.edit(adds if how == "add" else replaces)


@pytest.mark.rule("L4")
def test_files_that_include_each_other_again_and_again_do_not_fill_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seven files of a kilobyte each make a thousand million nodes."""
    monkeypatch.setenv("HFG_MOST_NODES_AND_PORTS", "1000")
    for number in range(7):
        node = f"{{file: f{number + 1}.hfg.yaml}}" if number < 6 else "{type: 'hfg.testing.nodes:Counter'}"
        nodes = "".join(f"  n{one}: {node}\n" for one in range(9))
        (tmp_path / f"f{number}.hfg.yaml").write_text(f"hfg: 1\nnodes:\n{nodes}")
    assert len(hfg.load(tmp_path / "f5.hfg.yaml").nodes) == 9
    with pytest.raises(hfg.errors.FileError, match=r'f3.hfg.yaml:\d+: "n\d": with this file the graph has 1,\d+ nodes'):
        hfg.load(tmp_path / "f0.hfg.yaml")


@pytest.mark.rule("L4")
def test_ports_of_a_file_that_is_included_again_and_again_are_counted_each_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HFG_MOST_NODES_AND_PORTS", "1000")
    merge = "{type: 'hfg.nodes.flow:Merge', parameters: {values: 400}}"
    (tmp_path / "inner.hfg.yaml").write_text(f"hfg: 1\nnodes:\n  merge: {merge}\n")
    (tmp_path / "outer.hfg.yaml").write_text(
        "hfg: 1\nnodes:\n" + "".join(f"  n{number}: {{file: inner.hfg.yaml}}\n" for number in range(3))
    )
    with pytest.raises(hfg.errors.FileError, match="inner.hfg.yaml:.* would have 1,200 nodes and ports: the limit is"):
        hfg.load(tmp_path / "outer.hfg.yaml")


@pytest.mark.rule("L4")
def test_marks_within_texts_of_json_are_no_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HFG_MOST_JSON_VALUES", "5")
    long = b'["' + b"[,:" * 100 + b'\\\\\\"[[[[[["]'
    assert len(json_value(long)[0]) == 308
    with pytest.raises(ValueError, match="it has 6 values or more"):
        json_value(b"[[],[],[" + b" " * 20 + b"]]")


@pytest.mark.slow
@pytest.mark.rule("L4")
@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited as on Linux")
@pytest.mark.parametrize("part", [b"[],", b"[[[]]],", b'{"":[]},', b"{},"])
def test_no_value_of_json_costs_more_than_a_hundred_bytes(part: bytes) -> None:
    """In a process of its own, whose memory nobody else has used."""
    code = (
        "from hfg.encoding.plain import json_value\n"
        f"data = b'[' + {part!r} * 200_000 + b'0]'\nmarks = sum(map(data.count, (b'[', b'{{', b':', b',')))\n"
        "used = lambda: int(open('/proc/self/statm').read().split()[1]) * 4096\n"
        "before = used()\nvalue = json_value(data)\nprint((used() - before) / marks)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=patience(100)
    )
    assert 10 < float(done.stdout) < 100


@pytest.mark.rule("L4")
def test_the_history_of_edits_keeps_of_each_note_what_it_changes() -> None:
    """Commands of a stranger may make thousands of notes one by one, each of which was kept with all before it."""
    graph = hfg.Graph("g")
    graph.edit(*(hfg.commands.Note("", f"note {number}", number) for number in range(100)))
    (done,) = history_of(graph).done
    changes = [one for one in done.changes if isinstance(one, NotesChange)]
    assert all(len(one.before) + len(one.after) == 1 for one in changes)
    graph.edit(hfg.commands.Note("", "note 7", "another"))
    graph.edit(hfg.commands.Note("", "note 8", None))
    after = graph.notes()
    assert (after["note 7"], after.get("note 8")) == ("another", None)
    graph.undo()
    graph.undo()
    assert graph.notes() == {f"note {number}": number for number in range(100)}
    graph.redo()
    graph.redo()
    assert graph.notes() == after
    for _ in range(3):
        graph.undo()
    assert graph.notes() == {}


@pytest.mark.rule("L4")
def test_what_was_meant_is_not_looked_for_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of thousands of wrong names in a file was compared with thousands of others, for hours."""
    monkeypatch.setattr(naming, "_comparing", naming._Comparing())
    known = [f"node {number}" for number in range(1000)]
    found = [naming.nearest("nodes 7", known) for _ in range(301)]
    assert found == ["node 7"] * 300 + [None]
    assert naming.nearest("nodes 7", known[:20]) == "node 7", "few names are always compared"
    assert naming.nearest("n" * 101, ["n" * 100]) is None
    assert "there are" in naming.suggest("nodes 7", known)

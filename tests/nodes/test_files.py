"""The family `files`: in real programs, on real files."""

from __future__ import annotations

import errno
import json
import os
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import hfg
from hfg.nodes import collections, files, flow, values
from hfg.testing import fire
from tests.limits import patience

PICTURE = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)


@pytest.fixture(autouse=True)
def in_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Each test has a working directory of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def everything(node: Any, output: str | None = None) -> list[Any]:
    """Run a source that ends and give what it sent."""
    graph = hfg.Graph()
    graph.add(node)
    port = next(iter(node.ports.outputs.values())) if output is None else node.ports.outputs[output]
    graph.connect(port, graph.output("all", Any))
    report = hfg.run(graph, clock="virtual", debug=True)
    assert report.outcome == "done"
    return list(report.outputs["all"])


def written(node: Any, *given: Any) -> list[Any]:
    """Run a sink on these values and give the paths that it tells."""
    graph = hfg.Graph()
    graph.add(node)
    (port,) = node.ports.inputs.values()
    graph.connect(graph.add(values.ListSource(values=given)).out, port)
    for output in node.ports.outputs.values():
        graph.connect(output, graph.output("paths", Any))
    report = hfg.run(graph, clock="virtual", debug=True)
    assert report.outcome == "done"
    return list(report.outputs.get("paths", []))


def result(node: Any, **inputs: Any) -> Any:
    (found,) = fire(node, **inputs).outputs.values()
    return found


# --- lines, values, rows ---


def test_a_text_is_given_line_by_line() -> None:
    Path("a.txt").write_bytes("eins\r\nzwei\n\nfünf".encode())
    assert everything(files.TextLines(path="a.txt")) == ["eins", "zwei", "", "fünf"]
    assert result(files.read_text(), path="a.txt") == "eins\nzwei\n\nfünf"


def test_a_text_has_the_encoding_that_is_said() -> None:
    Path("a.txt").write_text("fünf", encoding="latin-1")
    assert everything(files.TextLines(path="a.txt", encoding="latin-1")) == ["fünf"]
    with pytest.raises(hfg.errors.NodeError, match=r'cannot read "a.txt": .*utf-8.*; set another encoding'):
        everything(files.TextLines(path="a.txt"))
    with pytest.raises(ValueError, match="set another encoding"):
        fire(files.read_text(), path="a.txt")


@pytest.mark.parametrize(
    ("node", "text", "first"),
    [
        (files.TextLines(path="a", loop=True), "1\n2\n", ["1", "2"]),
        (files.JsonLines(path="a", loop=True), "1\n2\n", [1, 2]),
        (files.CsvRows(path="a", header=False, loop=True), "1\n2\n", [{"0": 1}, {"0": 2}]),
    ],
)
def test_a_stream_of_a_file_may_begin_again(node: Any, text: str, first: list[Any]) -> None:
    Path("a").write_text(text)
    graph = hfg.Graph()
    graph.connect(
        graph.add(node, max_rate_hz=1).ports.outputs[next(iter(node.ports.outputs))], graph.output("all", Any)
    )
    report = hfg.run(graph, clock="virtual", until_s=4.5)
    assert report.outputs["all"] == [*first, *first, first[0]]


@pytest.mark.parametrize("made", [files.TextLines, files.JsonLines, files.CsvRows])
def test_a_file_without_anything_ends_even_in_a_loop(made: Any) -> None:
    Path("a").write_text("")
    assert everything(made(path="a", loop=True)) == []


def test_json_lines_are_values() -> None:
    Path("a").write_text('{"a": 1}\n\n[2]\nnull\n"x"')
    assert everything(files.JsonLines(path="a")) == [{"a": 1}, [2], "x"]


def test_a_line_that_is_no_json_is_an_error_or_told() -> None:
    Path("a").write_text("1\n{\n3\n")
    with pytest.raises(hfg.errors.NodeError, match=r'ValueError: line 2 of "a" is no JSON'):
        everything(files.JsonLines(path="a"))
    assert everything(files.JsonLines(path="a", skip_invalid=True)) == [1, 3]
    node = files.JsonLines(path="a", skip_invalid=True)
    assert [fire(node).events for _ in range(3)] == [[], [("invalid", "{")], []]


TABLE = 'name,age,at\nEve,7,"1,5"\n"B ""b""",,x\n\nAnn\n'


def test_a_table_is_rows_with_types() -> None:
    Path("a.csv").write_text(TABLE)
    rows = [
        {"name": "Eve", "age": 7, "at": "1,5"},
        {"name": 'B "b"', "age": None, "at": "x"},
        {"name": "Ann", "age": None, "at": None},
    ]
    assert everything(files.CsvRows(path="a.csv")) == rows
    assert result(files.read_csv(), path="a.csv") == rows
    assert everything(files.CsvRows(path="a.csv", guess=False))[1] == {"name": 'B "b"', "age": "", "at": "x"}
    typed = files.CsvRows(path="a.csv", columns={"age": "float", "name": "text", "at": "text"})
    assert everything(typed)[0] == {"name": "Eve", "age": 7.0, "at": "1,5"}


def test_a_table_may_have_no_header_and_another_delimiter() -> None:
    Path("a.csv").write_text("1;yes\n2.5;no\n")
    node = files.CsvRows(path="a.csv", header=False, delimiter=";", columns={"1": "bool"})
    assert everything(node) == [{"0": 1, "1": True}, {"0": 2.5, "1": False}]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a,b\n1,2\n1,2,3\n", 'line 3 of "a.csv" is wrong: it has 3 values for 2 columns'),
        ("a,b\nx,2\n", 'line 2 of "a.csv" is wrong: "a" should be int, got \'x\''),
    ],
)
def test_a_row_that_is_wrong_is_told_with_its_line(text: str, sentence: str) -> None:
    Path("a.csv").write_text(text)
    with pytest.raises(ValueError, match=sentence):
        fire(files.read_csv(columns={"a": "int"}), path="a.csv")
    with pytest.raises(hfg.errors.NodeError, match=sentence):
        everything(files.CsvRows(path="a.csv", columns={"a": "int"}))


# --- whole files ---


def test_json_and_bytes_are_read_whole() -> None:
    Path("a.json").write_text('{"a": [1, 2]}')
    assert result(files.read_json(), path="a.json") == {"a": [1, 2]}
    assert result(files.read_bytes(), path=Path("a.json")) == b'{"a": [1, 2]}'
    Path("a.json").write_text("{")
    with pytest.raises(ValueError, match='"a.json" is no JSON'):
        fire(files.read_json(), path="a.json")


def test_arrays_come_back_as_they_were() -> None:
    array = np.arange(6.0).reshape(3, 2)
    assert written(files.WriteArray(path="a.npy"), array) == ["a.npy"]
    np.testing.assert_array_equal(result(files.read_array(), path="a.npy"), array)
    np.testing.assert_array_equal(everything(files.ArrayRows(path="a.npy")), array)
    for compressed in (True, False):
        written(files.WriteArrays(path="a.npz", compressed=compressed), {"x": array, "y": np.arange(2)})
        found = result(files.read_arrays(), path="a.npz")
        assert sorted(found) == ["x", "y"]
        np.testing.assert_array_equal(found["x"], array)


def test_a_stream_is_stacked_to_an_array_when_it_ends() -> None:
    written(files.StackArrays(path="rows.npy"), np.zeros(2), np.ones(2))
    np.testing.assert_array_equal(np.load("rows.npy"), [[0, 0], [1, 1]])
    written(files.StackArrays(path="numbers.npy"), 1.5, 2)
    np.testing.assert_array_equal(np.load("numbers.npy"), [1.5, 2.0])
    written(files.StackArrays(path="none.npy"))
    assert np.load("none.npy").shape == (0,)
    with pytest.raises(hfg.errors.NodeError, match=r"must be the same, got \(3,\) after \(2,\)"):
        written(files.StackArrays(path="wrong.npy"), np.zeros(2), np.zeros(3))


def test_a_run_that_is_stopped_stacks_what_there_is() -> None:
    graph = hfg.Graph()
    source, stack = (
        graph.add(values.ConstantFloat(value=2.0), max_rate_hz=1),
        graph.add(files.StackArrays(path="a.npy")),
    )
    graph.connect(source.out, stack.value)
    hfg.run(graph, clock="virtual", until_s=2.5)
    np.testing.assert_array_equal(np.load("a.npy"), [2.0, 2.0, 2.0])


@pytest.mark.parametrize(
    ("node", "content", "sentence"),
    [
        (files.read_array(), b"nonsense", '"a" is not a numpy file'),
        (files.read_array(), b"", '"a" is not a numpy file'),
        (files.read_arrays(), b"PK\x03\x04nonsense", '"a" is not a numpy file'),
        (files.read_image(), b"nonsense", '"a" is not a picture'),
        (files.read_image(), b"", '"a" is not a picture'),
        (files.read_raw_image(), cv2.imencode(".png", PICTURE)[1].tobytes()[:40], '"a" is not a picture'),
    ],
)
def test_a_file_of_another_kind_is_told(node: Any, content: bytes, sentence: str) -> None:
    Path("a").write_bytes(content)
    with pytest.raises(ValueError, match=sentence):
        fire(node, path="a")


def test_python_objects_are_neither_written_nor_read() -> None:
    np.save("a.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(ValueError, match="without Python objects"):
        fire(files.read_array(), path="a.npy")
    with pytest.raises(ValueError, match="Object arrays"):
        fire(files.WriteArray(path="b.npy"), array=np.array([{}]))
    assert not Path("b.npy").exists()


def test_one_array_and_several_are_told_apart() -> None:
    np.save("a.npy", np.zeros(2))
    np.savez("a.npz", x=np.zeros(2))
    with pytest.raises(ValueError, match="use read_array$"):
        fire(files.read_arrays(), path="a.npy")
    with pytest.raises(ValueError, match="use read_arrays$"):
        fire(files.read_array(), path="a.npz")
    np.save("one.npy", np.float64(1))
    for path, what in (("one.npy", "one value"), ("a.npz", "several arrays")):
        with pytest.raises(ValueError, match=f"has no rows because it holds {what}"):
            fire(files.ArrayRows(path=path))


# --- pictures ---


@pytest.mark.parametrize("path", ["a", "a.xyz", ""])
def test_a_name_that_no_picture_has_is_refused_where_it_is_set(path: str) -> None:
    with pytest.raises(ValueError, match=r'parameter "write_image.path" must be a file name like \*.png'):
        files.WriteImage(path=path)


def test_images_are_written_and_read_again() -> None:
    assert written(files.WriteImage(path="out/{number:03}.png"), PICTURE, PICTURE[..., 0]) == [
        "out/001.png",
        "out/002.png",
    ]
    np.testing.assert_array_equal(result(files.read_image(), path="out/001.png"), PICTURE)
    assert result(files.read_image(), path="out/002.png").shape == (6, 8, 3)
    assert result(files.read_image(mode="gray"), path="out/001.png").shape == (6, 8)
    assert result(files.read_raw_image(), path="out/002.png").shape == (6, 8)
    depth = np.full((4, 4), 3000, dtype=np.uint16)
    written(files.WriteImage(path="depth.png"), depth)
    np.testing.assert_array_equal(result(files.read_raw_image(), path="depth.png"), depth)


def test_the_quality_makes_files_smaller() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    for quality in (10, 95):
        written(files.WriteImage(path=f"{quality}.jpg", quality=quality), noise)
    assert Path("10.jpg").stat().st_size < Path("95.jpg").stat().st_size / 2


@pytest.mark.parametrize(
    ("path", "image"),
    [("a.png", np.zeros((2, 2, 2), np.uint8)), ("a.png", np.zeros((2, 2), bool))],
)
def test_an_image_that_a_format_does_not_take_is_told(path: str, image: Any) -> None:
    with pytest.raises(ValueError, match=r"an image of .*, 2 x 2.*cannot be written as"):
        fire(files.WriteImage(path=path), image=image)
    assert not Path(path).exists()


@pytest.fixture
def pictures() -> None:
    Path("in").mkdir()
    for number in (1, 2, 10):
        cv2.imwrite(f"in/{number}.png", np.full((2, 2, 3), number, np.uint8))


@pytest.mark.usefixtures("pictures")
@pytest.mark.parametrize(("order", "numbers"), [("name", [1, 10, 2]), ("number", [1, 2, 10])])
def test_a_directory_of_images_is_given_in_order(order: str, numbers: list[int]) -> None:
    images = everything(files.ImageFiles(pattern="in/*.png", order=order), "image")
    assert [int(image[0, 0, 0]) for image in images] == numbers
    assert everything(files.FilePaths(pattern="in/*.png", order=order)) == [f"in/{number}.png" for number in numbers]
    assert everything(files.ImageFiles(pattern="in/1.png", mode="gray"), "image")[0].shape == (2, 2)


@pytest.mark.usefixtures("pictures")
def test_the_newest_file_is_the_last_if_that_is_the_order() -> None:
    for age, name in enumerate(("in/10.png", "in/1.png", "in/2.png")):
        os.utime(name, (age, age))
    assert everything(files.FilePaths(pattern="in/*", order="modified")) == ["in/10.png", "in/1.png", "in/2.png"]


@pytest.mark.usefixtures("pictures")
def test_directories_inside_are_gone_through_and_are_no_files() -> None:
    Path("in/deep/er").mkdir(parents=True)
    Path("in/deep/er/3.png").touch()
    assert everything(files.FilePaths(pattern="in/**/*.png")) == [
        "in/1.png",
        "in/10.png",
        "in/2.png",
        "in/deep/er/3.png",
    ]
    assert everything(files.FilePaths(pattern="in/*"))[-1] == "in/2.png"
    assert result(files.list_directory(), path="in") == ["in/1.png", "in/10.png", "in/2.png"]
    assert result(files.list_directory(kind="directories"), path="in") == ["in/deep"]
    assert result(files.list_directory(kind="all", pattern="d*"), path="in") == ["in/deep"]
    assert result(files.list_directory(pattern="3*", recursive=True), path="in") == ["in/deep/er/3.png"]


@pytest.mark.usefixtures("pictures")
def test_a_player_tells_of_its_rounds_and_can_be_stopped_begun_again_and_ended() -> None:
    node = files.FilePaths(pattern="in/*.png", order="number", loop=True)

    def step() -> tuple[Any, list[str]]:
        fired = fire(node)
        return fired.outputs.get("path"), [name for name, _ in fired.events]

    assert [step() for _ in range(4)] == [
        ("in/1.png", ["began"]),
        ("in/2.png", []),
        ("in/10.png", []),
        ("in/1.png", ["ended", "began"]),
    ]
    fire(node, slot="stop")
    assert fire(node, hook="ready").answer is False
    fire(node, slot="play")
    assert fire(node, hook="ready").answer is True
    assert step() == ("in/2.png", [])
    fire(node, slot="restart")
    assert step() == ("in/1.png", ["began"])
    fire(node, slot="abort")
    with pytest.raises(hfg.EndOfStream):
        fire(node, hook="ready")


@pytest.mark.usefixtures("pictures")
def test_a_player_ends_behind_its_last_file() -> None:
    node = files.FilePaths(pattern="in/1.png")
    assert fire(node).outputs == {"path": "in/1.png"}
    last = fire(node)
    assert (last.outputs, last.events, last.ended) == ({}, [("ended", None)], True)


@pytest.mark.usefixtures("pictures")
def test_a_player_in_a_graph_is_stopped_and_played_on_by_events() -> None:
    graph = hfg.Graph()
    player = graph.add(files.FilePaths(pattern="in/*", order="number", loop=True), max_rate_hz=10)

    class Hand(hfg.Node):
        stop = hfg.Event()
        play = hfg.Event()
        abort = hfg.Event()

        async def process(self) -> Any:
            import asyncio

            for event, pause_s in ((self.stop, 0.25), (self.play, 1.0), (self.abort, 0.2)):
                await asyncio.sleep(pause_s)
                event.trigger()
                yield None

    hand = graph.add(Hand())
    for name in ("stop", "play", "abort"):
        graph.connect(hand.ports.events[name], player.ports.slots[name])
    graph.connect(player.path, graph.output("all", str))
    report = hfg.run(graph, clock="virtual")
    assert (report.outcome, report.outputs["all"]) == (
        "done",
        ["in/1.png", "in/2.png", "in/10.png", "in/1.png", "in/2.png", "in/10.png"],
    )


@pytest.mark.usefixtures("pictures")
def test_a_file_that_is_no_picture_is_an_error_or_told() -> None:
    Path("in/11.png").write_text("nothing")
    node = files.ImageFiles(pattern="in/*.png", order="number", skip_invalid=True)
    assert [fire(node).events for _ in range(4)][3] == [("invalid", "in/11.png")]
    assert len(everything(files.ImageFiles(pattern="in/*.png", skip_invalid=True), "image")) == 3
    with pytest.raises(hfg.errors.NodeError, match='"in/11.png" is not a picture'):
        everything(files.ImageFiles(pattern="in/*.png"), "image")


# --- writing ---


def test_each_value_has_a_file_of_its_own_if_the_path_says_so() -> None:
    assert written(files.WriteText(path="out/{number:02}.txt", first=9), "a", "b") == ["out/09.txt", "out/10.txt"]
    assert Path("out/10.txt").read_text() == "b"
    assert written(files.WriteText(path="last.txt"), "a", "b") == ["last.txt", "last.txt"]
    assert Path("last.txt").read_text() == "b"
    assert written(files.WriteBytes(path="a{{}}.bin"), b"\0") == ["a{}.bin"]
    written(files.WriteJson(path="a.json"), {"a": (1, np.float32(0.5))})
    assert json.loads(Path("a.json").read_text()) == {"a": [1, 0.5]}


def test_a_file_that_is_there_may_be_kept() -> None:
    Path("1.txt").write_text("old")
    with pytest.raises(FileExistsError, match=r'cannot write "1.txt" \(relative to ".*"\): it is there already'):
        fire(files.WriteText(path="{number}.txt", overwrite=False), text="new")
    assert Path("1.txt").read_text() == "old"


@pytest.mark.parametrize("path", ["{0.__class__}", "{number.real}", "a\0b", "{"])
def test_a_path_that_cannot_be_is_refused_where_it_is_set(path: str) -> None:
    with pytest.raises(ValueError, match=r'parameter "write_text.path" must satisfy is_a_'):
        files.WriteText(path=path)


def test_a_path_that_asks_for_another_field_says_which_there_are() -> None:
    with pytest.raises(ValueError, match="wants the value 'name', but there are number, time"):
        fire(files.WriteText(path="{name}"), text="a")


def no_room(*_: Any) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("node", "inputs"),
    [
        (files.WriteText(path="old"), {"text": "new"}),
        (files.WriteBytes(path="old"), {"data": b"new"}),
        (files.WriteJson(path="old"), {"value": 1}),
        (files.WriteArray(path="old"), {"array": np.zeros(3)}),
        (files.WriteArrays(path="old"), {"arrays": {"a": np.zeros(3)}}),
        (files.WriteImage(path="old.png"), {"image": PICTURE}),
    ],
)
def test_a_full_disk_leaves_the_old_file_whole(
    node: Any, inputs: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    name = node.path
    Path(name).write_text("old")
    monkeypatch.setattr(os, "fsync", no_room)
    with pytest.raises(
        OSError, match=rf'cannot write "{name}" \(relative to ".*"\): the disk is full; make room on it'
    ):
        fire(node, **inputs)
    assert [path.name for path in Path().iterdir()] == [name]
    assert Path(name).read_text() == "old"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a disk that is always full")
@pytest.mark.parametrize("flush", [True, False])
@pytest.mark.parametrize(
    ("made", "value"), [(files.WriteLines, "a"), (files.WriteJsonLines, [1]), (files.WriteCsv, {"a": 1})]
)
def test_a_full_disk_is_one_sentence_of_a_growing_file(made: Any, value: Any, flush: bool) -> None:
    with pytest.raises(
        hfg.errors.RunError, match='OSError: cannot write "/dev/full": the disk is full; make room on it'
    ):
        written(made(path="/dev/full", flush=flush), value)


def test_a_new_file_has_the_permissions_of_the_old_one_and_a_link_stays_one() -> None:
    Path("real").write_text("old")
    Path("real").chmod(0o640)
    Path("link").symlink_to("real")
    written(files.WriteText(path="link"), "new")
    assert Path("link").is_symlink()
    assert Path("real").read_text() == "new"
    assert stat.S_IMODE(Path("real").stat().st_mode) == 0o640


def test_lines_are_there_as_soon_as_they_are_written() -> None:
    node = files.WriteLines(path="deep/a.txt")
    fire(node, text="one")
    assert Path("deep/a.txt.part").read_text() == "one\n"
    fire(node, text="zwölf")
    fire(node, hook="end")
    assert Path("deep/a.txt").read_bytes() == "one\nzwölf\n".encode()


def test_lines_that_are_not_flushed_are_there_at_the_end_in_any_case() -> None:
    node = files.WriteLines(path="a.txt", flush=False)
    fire(node, text="one")
    assert Path("a.txt.part").read_text() == ""
    fire(node, hook="teardown")
    assert Path("a.txt").read_text() == "one\n"


def test_a_stream_of_values_comes_back_from_its_file() -> None:
    given = [{"a": 1}, [2.5, "x"], "y"]
    written(files.WriteJsonLines(path="a.jsonl"), *given)
    assert everything(files.JsonLines(path="a.jsonl")) == given
    written(files.WriteJsonLines(path="a.jsonl", append=True), 3)
    assert everything(files.JsonLines(path="a.jsonl")) == [*given, 3]
    written(files.WriteJsonLines(path="a.jsonl"), 4)
    assert everything(files.JsonLines(path="a.jsonl")) == [4]


def test_a_table_comes_back_from_its_file() -> None:
    rows = [{"name": "Eve, a", "age": 7}, {"name": 'B "b"'}]
    written(files.WriteCsv(path="a.csv"), *rows)
    assert Path("a.csv").read_text() == 'name,age\n"Eve, a",7\n"B ""b""",\n'
    assert everything(files.CsvRows(path="a.csv")) == [rows[0], {"name": 'B "b"', "age": None}]
    written(files.WriteCsv(path="a.csv", append=True), {"name": "Ann", "age": 1})
    assert everything(files.CsvRows(path="a.csv"))[2] == {"name": "Ann", "age": 1}
    written(files.WriteCsv(path="b.csv", columns=["age", "name"], delimiter=";"), rows[0])
    assert Path("b.csv").read_text() == "age;name\n7;Eve, a\n"


def test_a_row_with_a_key_that_is_no_column_is_told() -> None:
    with pytest.raises(
        hfg.errors.NodeError, match='the row has "b", but the columns of "a.csv" are a; say all of them'
    ):
        written(files.WriteCsv(path="a.csv"), {"a": 1}, {"a": 1, "b": 2})
    assert Path("a.csv").read_text() == "a\n1\n"


@pytest.mark.parametrize("made", [files.WriteLines, files.WriteJsonLines, files.WriteCsv])
def test_a_stream_of_nothing_makes_a_file_without_anything(made: Any) -> None:
    written(made(path="a"))
    assert Path("a").read_bytes() == b""


# --- what is wrong with a path ---

READERS: list[Any] = [
    files.read_text,
    files.read_bytes,
    files.read_json,
    files.read_csv,
    files.read_array,
    files.read_arrays,
    files.read_image,
    files.read_raw_image,
    files.list_directory,
]
SOURCES: list[Any] = [files.TextLines, files.JsonLines, files.CsvRows, files.ArrayRows]
SINKS: list[tuple[Any, Any]] = [
    (files.WriteText, "a"),
    (files.WriteBytes, b"a"),
    (files.WriteJson, 1),
    (files.WriteArray, np.zeros(2)),
    (files.WriteArrays, {"a": np.zeros(2)}),
    (files.WriteLines, "a"),
    (files.WriteJsonLines, 1),
    (files.WriteCsv, {"a": 1}),
    (files.StackArrays, 1.0),
]


@pytest.mark.parametrize("made", READERS)
def test_a_file_that_is_missing_is_one_sentence(made: Any) -> None:
    with pytest.raises(FileNotFoundError) as error:
        fire(made(), path="no/such.file")
    assert (
        str(error.value)
        == f'cannot read "no/such.file" (relative to "{Path.cwd()}"): there is no such file or directory'
    )


@pytest.mark.slow
@pytest.mark.parametrize("made", SOURCES)
def test_a_source_names_its_path_in_the_graph_and_the_file_that_is_missing(made: Any) -> None:
    missing = Path("such.file").absolute()
    with pytest.raises(hfg.errors.NodeError) as error:
        everything(made(path=str(missing)))
    assert str(error.value) == (
        f'node "{made._type.name}" failed in firing 1: FileNotFoundError: cannot read "{missing}": there is no such '
        "file or directory"
    )


@pytest.mark.parametrize("made", [files.FilePaths, files.ImageFiles])
def test_a_pattern_that_describes_no_file_is_told(made: Any) -> None:
    with pytest.raises(FileNotFoundError, match=r'cannot read "in/\*.png" \(relative to'):
        fire(made(pattern="in/*.png"))


@pytest.mark.parametrize("made", [made for made in READERS if made is not files.list_directory])
def test_a_directory_is_no_file(made: Any) -> None:
    with pytest.raises(IsADirectoryError, match="it is a directory; name a file in it"):
        fire(made(), path=".")


def test_a_file_is_no_directory() -> None:
    Path("a").touch()
    with pytest.raises(NotADirectoryError, match="a part of the path is a file, no directory"):
        fire(files.list_directory(), path="a")
    for pattern in ("", "/absolute"):
        with pytest.raises(ValueError, match="is not a pattern for names"):
            fire(files.list_directory(pattern=pattern), path=".")


@pytest.mark.parametrize(("made", "value"), SINKS)
def test_a_sink_does_not_write_onto_a_directory(made: Any, value: Any) -> None:
    Path("a").mkdir()
    with pytest.raises(hfg.errors.RunError, match=r'IsADirectoryError: cannot write "a" .*: it is a directory'):
        written(made(path="a"), value)
    assert list(Path("a").iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may do everything")
def test_what_is_not_permitted_is_told() -> None:
    Path("a").touch()
    Path("a").chmod(0)
    with pytest.raises(PermissionError, match="it is not permitted"):
        fire(files.read_text(), path="a")


@pytest.mark.parametrize(("made", "value"), SINKS)
def test_what_may_not_be_written_is_told(made: Any, value: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: Any, **__: Any) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "open", forbidden)
    monkeypatch.setattr(os, "open", forbidden)
    with pytest.raises(hfg.errors.RunError, match=r'PermissionError: cannot write "a" .*: it is not permitted; change'):
        written(made(path="a"), value)


@pytest.mark.parametrize("made", [*SOURCES, *(made for made, _ in SINKS)])
def test_a_path_that_was_not_set_is_told(made: Any) -> None:
    with pytest.raises(hfg.errors.RunError, match='no path is set; set the parameter "path"'):
        everything(made()) if made in SOURCES else written(made(), dict(SINKS)[made])


@pytest.mark.parametrize("made", SOURCES)
def test_a_name_that_no_file_can_have_is_refused(made: Any) -> None:
    with pytest.raises(ValueError, match="must satisfy is_a_path"):
        made(path="a\0b")


# --- the program's own streams, in programs ---

ECHO = """
import hfg
from hfg.nodes import files, values

graph = hfg.Graph()
lines, out = graph.add(files.StandardInput()), graph.add(files.StandardOutput())
upper = graph.add(values.change_case(case="upper"))
graph.connect(lines.line, upper.text)
graph.connect(upper.out, out.text)
report = hfg.run(graph)
print(report.outcome)
"""


def program(text: str, **how: Any) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", text],
        stdin=how.get("stdin", subprocess.PIPE),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )


@pytest.mark.slow
def test_a_program_answers_each_line_of_a_pipe_as_it_comes() -> None:
    with program(ECHO) as running:
        assert running.stdin is not None
        assert running.stdout is not None
        for line in ("eins", "zwei"):
            running.stdin.write(line + "\n")
            running.stdin.flush()
            assert running.stdout.readline() == line.upper() + "\n"  # before the next one is sent
        rest, errors = running.communicate("drei\nvier", timeout=patience(60))
    assert (rest, errors, running.returncode) == ("DREI\nVIER\ndone\n", "", 0)


@pytest.mark.slow
def test_a_program_that_is_stopped_does_not_wait_for_the_keyboard() -> None:
    with program(ECHO.replace("hfg.run(graph)", "hfg.run(graph, until_s=0.2)")) as running:
        try:
            assert running.wait(timeout=patience(60)) == 0  # nothing was sent, and the pipe is still open
        finally:
            running.kill()
        assert running.stdout is not None
        assert running.stdout.read().strip() != ""


@pytest.fixture
def standard_input(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Path], None]]:
    """Let a file be the standard input of this program."""
    opened: list[Any] = []

    def become(path: Path) -> None:
        opened.append(path.open())
        monkeypatch.setattr(sys, "stdin", opened[-1])

    yield become
    for file in opened:
        file.close()


def test_a_file_is_read_as_standard_input(standard_input: Callable[[Path], None]) -> None:
    Path("in.txt").write_bytes(b"a\r\n\xff\nb")
    standard_input(Path("in.txt"))
    assert everything(files.StandardInput()) == ["a", "\ufffd", "b"]
    assert everything(files.StandardInput()) == []
    standard_input(Path(os.devnull))
    assert everything(files.StandardInput()) == []


def test_what_one_run_left_is_there_for_the_next(standard_input: Callable[[Path], None]) -> None:
    Path("in.txt").write_text("a\nb\nc\n")
    standard_input(Path("in.txt"))
    graph = hfg.Graph()
    lines, take = graph.add(files.StandardInput()), graph.add(flow.Take(count=1))
    graph.connect(lines.line, take.value)
    graph.connect(take.out, graph.output("all", Any))
    assert hfg.run(graph, clock="virtual").outputs["all"] == ["a"]
    assert everything(files.StandardInput())[-1] == "c"


def test_a_program_without_standard_input_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(hfg.errors.NodeError, match="OSError: cannot read standard input"):
        everything(files.StandardInput())


def test_two_nodes_cannot_share_standard_input(standard_input: Callable[[Path], None]) -> None:
    Path("in.txt").write_text("a\nb\n")
    standard_input(Path("in.txt"))
    graph = hfg.Graph()
    for name in ("first", "second"):
        graph.connect(graph.add(files.StandardInput()).line, graph.output(name, str))
    with pytest.raises(hfg.errors.NodeError, match="read by another node already: connect both to one StandardInput"):
        hfg.run(graph, clock="virtual")


def test_reading_in_a_thread_group_gives_the_same() -> None:
    Path("a.jsonl").write_text("1\n2\n3\n")
    graph = hfg.Graph()
    graph.group("files", threads=1)
    source = graph.add(files.JsonLines(path="a.jsonl"), group="files")
    sink = graph.add(files.WriteJsonLines(path="b.jsonl"), group="files")
    graph.connect(source.value, sink.value)
    assert hfg.run(graph).outcome == "done"
    assert Path("b.jsonl").read_text() == "1\n2\n3\n"


def test_paths_become_contents() -> None:
    Path("in").mkdir()
    for name in "ab":
        Path(f"in/{name}.txt").write_text(name * 2)
    graph = hfg.Graph()
    paths, text, size = (
        graph.add(files.FilePaths(pattern="in/*.txt")),
        graph.add(files.read_text()),
        graph.add(collections.size()),
    )
    graph.connect(paths.path, text.path)
    graph.connect(text.out, size.items)
    graph.connect(size.out, graph.output("sizes", int))
    assert hfg.run(graph, clock="virtual").outputs["sizes"] == [2, 2]

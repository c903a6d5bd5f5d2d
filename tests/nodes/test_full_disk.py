"""Nodes that write leave a complete file or none where the disk is full, and fail with a sentence that says why.

Every node of the library with a parameter that names a file to save is tried; a new one fails here until `full_disk`
says what it is fed. A limit on the size of files stands in for the disk: the system refuses to write in the middle of a
write, as a full disk does.
"""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import hfg
from hfg.base.whole import GrowingFile, need_writable, write_whole
from hfg.catalogue import installed
from hfg.catalogue.offers import Offer
from hfg.errors import UsageError
from hfg.registry import find
from tests.nodes.full_disk import ways

ROOT = Path(__file__).resolve().parents[2]
NO_FILE = {"hfg.nodes.links:Publish"}  # its outbox is kept by the link, and tested there


def writers() -> list[str]:
    """References of the node types that save a file."""
    found = []
    for one in installed([Offer("hfg.nodes")]).types:
        kind: Any = getattr(find(one.reference), "_type", None)
        if kind is not None and any(spec.save for spec in kind.parameters.values()) and one.reference not in NO_FILE:
            found.append(one.reference)
    return found


@pytest.mark.slow
def test_each_writing_node_of_the_library_is_fed_here() -> None:
    assert len(writers()) >= 19
    assert [reference for reference in writers() if not ways(reference)] == []


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What each node left, without a limit and with several."""
    asked = json.dumps({"references": writers(), "folder": str(tmp_path_factory.mktemp("full"))})
    done = subprocess.run(
        [sys.executable, "-m", "tests.nodes.full_disk"],
        cwd=ROOT,
        env={**os.environ, "MPLBACKEND": "Agg", "OPENCV_LOG_LEVEL": "SILENT"},
        input=asked,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files")
def test_a_node_that_writes_leaves_a_complete_file_or_none(outcomes: list[dict[str, Any]]) -> None:
    whole = [one for one in outcomes if one["limit"] is None]
    assert [one for one in whole if one["error"] or not one["left"]["file"] or one["left"]["part"]] == []
    limited = [one for one in outcomes if one["limit"] is not None]
    assert len(limited) == 3 * len(whole) > 60
    assert [one for one in limited if one["left"]["file"]] == []
    assert [one for one in limited if "OSError: cannot write" not in one["error"]] == []
    assert [one for one in limited if "may not be as large there" not in one["error"]] == []
    assert [one for one in outcomes if one["left"]["else"]] == []


# --- what they stand on -----------------------------------------------------------------------------------------------


class _Disk:
    """A disk that takes so many bytes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, room: int) -> None:
        self.room = room
        monkeypatch.setattr("hfg.base.whole.os.fsync", self._sync)

    def _sync(self, descriptor: int) -> None:
        if os.fstat(descriptor).st_size > self.room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_file_that_cannot_be_brought_to_the_disk_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "a.txt"
    write_whole(file, lambda stream: stream.write(b"old"))
    _Disk(monkeypatch, 3)
    with pytest.raises(OSError, match="No space left"):
        write_whole(file, lambda stream: stream.write(b"new and longer"))
    assert [one.name for one in tmp_path.iterdir()] == ["a.txt"]
    assert file.read_text() == "old"


def test_pages_drawings_and_graphs_are_whole_or_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _Disk(monkeypatch, 10)
    graph = hfg.Graph("robot")
    with pytest.raises(UsageError, match="No space left"):
        graph.draw(tmp_path / "a.svg")
    with pytest.raises(UsageError, match="No space left"):
        hfg.save(graph, tmp_path / "a.hfg.yaml")
    pages: list[Any] = []
    hfg.run(graph, clock="virtual", begin=lambda run: pages.append(run.report_page(tmp_path / "a.html")))
    assert pages[0].error is not None
    assert list(tmp_path.iterdir()) == []


def test_a_piece_that_does_not_fit_is_taken_back_and_the_file_is_never_complete(tmp_path: Path) -> None:
    file = GrowingFile(tmp_path / "a.txt", append=False, at_once=True)
    file.write(b"one\n")
    stream = file._file

    class Full:
        """Takes two bytes more."""

        def write(self, data: memoryview) -> int:
            if len(data) < 4:
                raise OSError(errno.ENOSPC, "full")
            return stream.write(data[:2])

        def __getattr__(self, name: str) -> Any:
            return getattr(stream, name)

    file._file = Full()  # type: ignore[assignment]
    with pytest.raises(OSError, match="full"):
        file.write(b"two\n")
    file._file = stream
    file.write(b"three\n")  # there is room again
    with pytest.raises(OSError, match="1 pieces could not be written; the others are in"):
        file.complete()
    assert (tmp_path / "a.txt.part").read_text() == "one\nthree\n"
    assert not (tmp_path / "a.txt").exists()


def test_a_file_that_is_appended_to_keeps_its_name_and_its_whole_lines(tmp_path: Path) -> None:
    place = tmp_path / "a.log"
    place.write_text("zero\n")
    file = GrowingFile(place, append=True, at_once=False)
    assert not file.is_empty
    file.write(b"one\n")
    file.complete()
    assert place.read_text() == "zero\none\n"


def test_what_is_no_file_is_written_to_directly(tmp_path: Path) -> None:
    write_whole(Path(os.devnull), lambda stream: stream.write(b"gone"))
    file = GrowingFile(Path(os.devnull), append=False, at_once=True)
    file.write(b"gone")
    file.complete()
    assert Path(os.devnull).is_char_device()
    need_writable(tmp_path / "later.html")
    assert not (tmp_path / "later.html").exists()

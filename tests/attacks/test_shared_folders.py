"""In a folder in which others may write, another user can put something in the way; it does no harm (rules L4, L5)."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import hfg
from hfg.base.whole import GrowingFile, need_writable, read_plain, write_whole
from hfg.errors import SharedMemoryError, UsageError
from hfg.files.writing import write_text
from hfg.nodes.files.access import find_files
from hfg.recording.writing import open_new
from hfg.sharedmemory import sweep
from hfg.studio.journal import Journal
from hfg.studio.project import Project
from hfg.studio.refusing import Refused

pytest.importorskip("tests.attacks.another_user", exc_type=ImportError)
from tests.attacks.another_user import as_nobody

pytestmark = [pytest.mark.rule("L4"), pytest.mark.rule("L5"), pytest.mark.timeout(60)]
only_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can begin a process of another user"
)


@pytest.fixture
def shared() -> Iterator[Path]:
    """A folder like /tmp."""
    folder = Path(tempfile.mkdtemp(prefix="hfg-attack-", dir="/tmp"))
    folder.chmod(0o1777)
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def precious(tmp_path: Path) -> Path:
    file = tmp_path / "precious"
    file.write_text("precious")
    return file


def appends(path: Path) -> None:
    file = GrowingFile(path, append=True, at_once=True)
    file.write(b"mine")
    file.complete()


WRITES: dict[str, Callable[[Path], object]] = {
    "a whole file": lambda path: write_whole(path, lambda file: file.write(b"mine")),
    "at the end of a file": appends,
    "a growing file": lambda path: GrowingFile(path, append=False, at_once=True),
    "a page, later": need_writable,
    "a graph": lambda path: write_text("mine", path),
    "a recording": lambda path: open_new(path, force=False),
    "a recording, by force": lambda path: open_new(path, force=True),
}


@only_root
@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_nothing_is_written_through_a_link_of_another_user(
    shared: Path, precious: Path, write: Callable[[Path], object]
) -> None:

    def leads_astray() -> None:
        (shared / "one").symlink_to(precious)
        (shared / "two").symlink_to(precious.parent / "new")

    as_nobody(leads_astray)
    for name in ("one", "two"):
        with pytest.raises((OSError, UsageError), match="link of another user is in its place|already exists"):
            write(shared / name)
    assert precious.read_text() == "precious"
    assert not (precious.parent / "new").exists()


@only_root
@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_nothing_waits_at_a_pipe_of_another_user_or_tells_him_what_is_written(
    shared: Path, write: Callable[[Path], object]
) -> None:
    as_nobody(lambda: os.mkfifo(shared / "one"))
    with pytest.raises((OSError, UsageError), match="a pipe of another user is in its place|already exists"):
        write(shared / "one")


@only_root
def test_a_pipe_in_place_of_the_journal_does_not_hold_a_studio_up(shared: Path) -> None:
    as_nobody(lambda: os.mkfifo(shared / ".graph.hfg-journal"))
    assert Journal(shared, None, "").offer is None


def test_a_pipe_in_place_of_the_graph_file_does_not_hold_a_studio_up(tmp_path: Path) -> None:
    file = tmp_path / "one.hfg.yaml"
    hfg.save(hfg.Graph("one"), file)
    project = Project(hfg.load(file), tmp_path, file)
    file.unlink()
    os.mkfifo(file)
    project.look()
    assert "was changed on disk" in project.elsewhere
    assert project.difference()
    with pytest.raises(Refused, match="no longer a file"):
        project.reread()


def test_what_is_no_plain_file_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(OSError, match="plain file|directory"):
            read_plain(path, 10)
    (tmp_path / "file").write_bytes(b"0123456789abc")
    assert read_plain(tmp_path / "file", 10) == b"0123456789"


def test_a_pipe_among_pictures_is_none_of_them(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "2.png")
    for name in ("1.png", "3.png"):
        (tmp_path / name).touch()
    assert [file.name for file in find_files(str(tmp_path / "*.png"), "name")] == ["1.png", "3.png"]
    assert find_files(str(tmp_path / "2.png"), "name") == [tmp_path / "2.png"]  # which the user has named


def test_no_part_of_a_file_has_a_name_that_can_be_taken_first(tmp_path: Path) -> None:
    names: list[str] = []
    for _ in range(3):
        write_whole(tmp_path / "one", lambda _: names.extend(one.name for one in tmp_path.glob(".hfg-*.part")))
    assert len(set(names)) == 3
    assert not [name for name in names if str(os.getpid()) in name.split("-")]


def test_a_file_that_is_replaced_hands_down_no_right_to_run_as_its_owner(tmp_path: Path) -> None:
    there = tmp_path / "one"
    there.touch()
    there.chmod(0o4755)
    write_whole(there, lambda file: file.write(b"new"))
    assert there.stat().st_mode & 0o7777 == 0o755


@only_root
def test_segments_of_another_user_are_not_opened_when_ours_are_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """There can be hundreds of thousands of them, and to open each would take the loop of a run a minute."""
    theirs = [Path(f"/dev/shm/hfg-attack{os.getpid()}-a-1-o{number}") for number in range(3)]
    opened: list[str] = []

    def opens(name: str, *, writable: bool) -> tuple[int, int]:
        opened.append(name)
        raise SharedMemoryError(name)

    monkeypatch.setattr("hfg.sharedmemory.names.open_existing", opens)

    def makes() -> None:
        for one in theirs:
            one.touch()

    as_nobody(makes)
    try:
        assert sweep(f"hfg-attack{os.getpid()}-") == []
        assert opened == []
    finally:
        for one in theirs:
            one.unlink()

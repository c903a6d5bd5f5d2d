"""In a folder in which others may write, another user can put something in the way; it does no harm (rules L4, L5)."""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import hfg
from hfg.base import whole
from hfg.base.places import Place
from hfg.base.whole import GrowingFile, need_writable, read_plain, write_whole
from hfg.cli.completing import targets
from hfg.errors import FileError, SharedMemoryError, UsageError
from hfg.files.writing import write_text
from hfg.nodes.files.access import find_files
from hfg.recording.writing import open_new
from hfg.sharedmemory import sweep
from hfg.studio.journal import Journal
from hfg.studio.project import Project
from hfg.studio.refusing import Refused
from hfg.testing import fire

pytest.importorskip("tests.attacks.another_user", exc_type=ImportError)
from tests.attacks.another_user import NOBODY, as_nobody

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
@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_nothing_is_written_over_a_link_of_another_user_on_the_way(
    shared: Path, precious: Path, write: Callable[[Path], object]
) -> None:
    """Linux can be told not to follow such links (fs.protected_symlinks), and is not everywhere."""
    as_nobody(lambda: (shared / "out").symlink_to(precious.parent))
    mine = precious.parent / "mine"
    mine.symlink_to(shared / "out")
    for path in (shared / "out" / "precious", shared / "out" / "new", mine / "new"):
        with pytest.raises((OSError, UsageError), match="link of another user is in its place|already exists"):
            write(path)
    assert precious.read_text() == "precious"
    assert {one.name for one in precious.parent.iterdir()} == {"precious", "mine"}


@only_root
@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_nothing_is_written_into_a_file_that_another_user_has_put_into_a_shared_folder(
    shared: Path, write: Callable[[Path], object]
) -> None:
    def puts() -> None:
        (shared / "one").write_text("theirs")
        (shared / "one").chmod(0o666)

    as_nobody(puts)
    with pytest.raises((OSError, UsageError), match="a file of another user is in its place|already exists"):
        write(shared / "one")
    assert (shared / "one").read_text() == "theirs"


def comes_after_the_check(monkeypatch: pytest.MonkeyPatch, puts: Callable[[], object]) -> None:
    """Another user tries all the time, so that at some point he comes between a check and what was checked for."""

    class Attacked(Place):
        def __init__(self, path: Path) -> None:
            super().__init__(path)
            as_nobody(puts)

    monkeypatch.setattr(whole, "Place", Attacked)


@only_root
@pytest.mark.parametrize("name", sorted(WRITES.keys() - {"a page, later"}))  # which writes nothing yet
def test_nothing_waits_at_a_pipe_that_another_user_puts_there_after_the_check(
    shared: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    comes_after_the_check(monkeypatch, lambda: os.mkfifo(shared / "one"))
    with pytest.raises((OSError, UsageError), match="a pipe of another user is in its place|exists"):
        WRITES[name](shared / "one")


@only_root
def test_no_pipe_that_another_user_listens_at_is_told_anything(shared: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    comes_after_the_check(monkeypatch, lambda: os.mkfifo(shared / "one"))
    opened, listening = os.open, []

    def opens_while_he_listens(path: str, flags: int, mode: int = 0o777, *, dir_fd: int | None = None) -> int:
        if path == "one" and flags & os.O_WRONLY:
            listening.append(opened(shared / "one", os.O_RDONLY | os.O_NONBLOCK))
        return opened(path, flags, mode, dir_fd=dir_fd)

    monkeypatch.setattr(os, "open", opens_while_he_listens)
    with pytest.raises(PermissionError, match="a pipe of another user is in its place"):
        appends(shared / "one")
    monkeypatch.undo()
    assert os.read(listening[0], 100) == b""
    os.close(listening[0])


@only_root
@pytest.mark.parametrize("name", ["at the end of a file", "a recording, by force"])
def test_nothing_is_written_into_a_file_that_another_user_puts_there_after_the_check(
    shared: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    comes_after_the_check(monkeypatch, lambda: (shared / "one").write_text("theirs"))
    with pytest.raises((OSError, UsageError), match="a file of another user is in its place"):
        WRITES[name](shared / "one")
    assert (shared / "one").read_text() == "theirs"


@pytest.fixture
def theirs() -> Iterator[Path]:
    """A folder in which another user may do everything, and in which we write."""
    folder = Path(tempfile.mkdtemp(prefix="hfg-attack-", dir="/tmp"))
    folder.chmod(0o777)
    os.chown(folder, NOBODY, NOBODY)
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def astray(theirs: Path, precious: Path) -> Callable[[], None]:
    """What another user does to lead us from his folder into ours, which has a file of the same name."""
    (theirs / "out").mkdir()
    (theirs / "out").chmod(0o777)
    (theirs / "out" / "precious").write_text("theirs")

    def exchanges() -> None:
        (theirs / "out").rename(theirs / "moved")
        (theirs / "out").symlink_to(precious.parent)

    return exchanges


@only_root
@pytest.mark.parametrize("name", sorted(WRITES.keys() - {"a page, later", "a recording"}))
def test_what_was_checked_is_written_to_although_the_way_leads_elsewhere_by_then(
    theirs: Path, precious: Path, astray: Callable[[], None], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    comes_after_the_check(monkeypatch, astray)
    made: Any = WRITES[name](theirs / "out" / "precious")
    if made is not None:
        (made.complete if isinstance(made, GrowingFile) else made.close)()
    assert precious.read_text() == "precious"
    assert [one.name for one in precious.parent.iterdir()] == ["precious"]
    assert [one.name for one in (theirs / "moved").iterdir()] == ["precious"]


@only_root
def test_a_file_gets_its_name_where_it_was_begun(theirs: Path, precious: Path, astray: Callable[[], None]) -> None:
    growing = GrowingFile(theirs / "out" / "precious", append=False, at_once=True)
    growing.write(b"mine")
    as_nobody(astray)
    growing.complete()
    assert (theirs / "moved" / "precious").read_text() == "mine"
    assert precious.read_text() == "precious"


def test_no_handle_is_left_open(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "one")
    before = os.listdir("/proc/self/fd")  # noqa: PTH208
    write_whole(tmp_path / "link", lambda file: file.write(b"mine"))
    appends(tmp_path / "link")
    need_writable(tmp_path / "link")
    open_new(tmp_path / "one", force=True).close()
    for wrong in ("nowhere/one", "one/two", "", "../..", "circle/one"):
        (tmp_path / "circle").unlink(missing_ok=True)
        (tmp_path / "circle").symlink_to("circle")
        with pytest.raises(OSError, match="No such|[Dd]irectory|levels of symbolic"):
            write_whole(tmp_path / wrong, lambda file: file.write(b"mine"))
    assert os.listdir("/proc/self/fd") == before  # noqa: PTH208


def test_a_pipe_of_ours_waits_for_its_reader(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    heard: list[bytes] = []
    reader = threading.Thread(target=lambda: heard.append(pipe.read_bytes()))
    writer = threading.Thread(target=appends, args=(pipe,))
    writer.start()
    reader.start()
    writer.join()
    reader.join()
    assert heard == [b"mine"]


def permissions(file: Path) -> int:
    return file.stat().st_mode & 0o777


def puts_a_link(unfinished: Path, to: Path) -> None:
    unfinished.rename(unfinished.with_name("moved"))
    unfinished.symlink_to(to)


@only_root
def test_no_file_gets_permissions_through_a_link_that_takes_the_place_of_what_is_written(
    theirs: Path, precious: Path
) -> None:
    precious.chmod(0o600)
    target = theirs / "one"
    target.touch()
    target.chmod(0o666)
    growing = GrowingFile(target, append=False, at_once=True)
    growing.write(b"mine")
    as_nobody(lambda: puts_a_link(growing.place, precious))
    growing.complete()
    assert permissions(precious) == 0o600
    target.unlink()
    target.touch()
    target.chmod(0o666)

    def write(_: object) -> None:
        (unfinished,) = theirs.glob(".hfg-*.part")
        as_nobody(lambda: puts_a_link(unfinished, precious))

    write_whole(target, write)
    assert permissions(precious) == 0o600
    assert precious.read_text() == "precious"


@only_root
def test_a_file_of_another_user_hands_its_permissions_down_to_none_of_ours(theirs: Path) -> None:
    def puts() -> None:
        (theirs / "one").touch()
        (theirs / "one").chmod(0o666)

    as_nobody(puts)
    before = os.umask(0o077)
    try:
        write_whole(theirs / "one", lambda file: file.write(b"mine"))
    finally:
        os.umask(before)
    assert permissions(theirs / "one") == 0o600


@only_root
def test_a_video_is_written_into_no_other_file_whatever_is_put_in_its_place(
    theirs: Path, precious: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another user who may write to the folder wins the race against OpenCV most of the time; here, always."""
    from hfg.nodes.video import WriteVideo

    precious.chmod(0o600)
    (precious.parent / "video.avi").symlink_to(precious)

    real = cv2.VideoWriter

    def after_the_attack(path: str, *rest: Any) -> Any:
        (unfinished,) = theirs.glob(".out-*")
        as_nobody(lambda: puts_a_link(unfinished, precious if unfinished.is_file() else precious.parent))
        return real(path, *rest)

    after_the_attack.fourcc = real.fourcc  # type: ignore[attr-defined]
    monkeypatch.setattr(cv2, "VideoWriter", after_the_attack)
    node = WriteVideo(path=str(theirs / "out.avi"))
    fire(node, image=np.zeros((48, 64, 3), np.uint8))
    fire(node, slot="finish")
    assert precious.read_text() == "precious"
    assert permissions(precious) == 0o600
    assert (theirs / "out.avi").read_bytes()[:4] == b"RIFF"


@only_root
def test_a_video_gets_its_name_where_it_was_begun(theirs: Path, precious: Path, astray: Callable[[], None]) -> None:
    from hfg.nodes.video import WriteVideo

    ours = precious.rename(precious.with_name("out.avi"))
    node = WriteVideo(path=str(theirs / "out" / "out.avi"))
    fire(node, image=np.zeros((48, 64, 3), np.uint8))
    as_nobody(astray)
    fire(node, slot="finish")
    assert ours.read_text() == "precious"
    assert (theirs / "moved" / "out.avi").read_bytes()[:4] == b"RIFF"


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


def test_a_pipe_in_place_of_a_graph_file_is_refused(tmp_path: Path) -> None:
    """Another user can exchange a file that a graph includes while the graph is loaded."""
    os.mkfifo(tmp_path / "one.hfg.yaml")
    with pytest.raises(FileError, match="not a plain file"):
        hfg.load(tmp_path / "one.hfg.yaml")


def test_the_tab_key_reads_no_file_that_is_larger_than_any_graph(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "large.py"
    file.write_text("one = Graph()\n" + "#" * 1000)
    assert targets(f"{file}:") == [f"{file}:one"]
    monkeypatch.setenv("HFG_MOST_GRAPH_FILE_BYTES", "5")
    assert targets(f"{file}:") == []


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

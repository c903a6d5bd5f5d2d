"""Files of SQLite, journals and settings that another user has prepared decide nothing, and stop nothing (L4, L5)."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

import hfg
from hfg.errors import RunError, UsageError
from hfg.links.pubsub.outbox import KeptValue, OutboxFile
from hfg.nodes.activity import Wait
from hfg.parts.model.ledgers import LedgerFile
from hfg.tuning import tune

pytest.importorskip("tests.attacks.another_user", exc_type=ImportError)
from tests.attacks.another_user import NOBODY, as_nobody
from tests.limits import patience

pytestmark = [pytest.mark.rule("L4"), pytest.mark.rule("L5")]

only_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can begin a process of another user"
)
KINDS: dict[str, Callable[[str], Any]] = {
    "outbox": lambda path: OutboxFile(path, "camera/front", "int"),
    "ledger": lambda path: LedgerFile(path, "total"),
}
of_each_kind = pytest.mark.parametrize("opened", KINDS.values(), ids=KINDS)
_PAGE, _SECTOR, _NONCE = 4096, 512, 12345
_MAGIC = bytes.fromhex("d9d505f920a163d7")


def journal_that_names(file: Path, database: Path) -> bytes:
    """A journal of a database as a transaction over several files leaves it: SQLite removes the file that it names."""
    head = _MAGIC + struct.pack(">IIIII", 1, _NONCE, database.stat().st_size // _PAGE, _SECTOR, _PAGE)
    page = database.read_bytes()[:_PAGE]
    checksum = (_NONCE + sum(page[at] for at in range(_PAGE - 200, 0, -200))) & 0xFFFFFFFF
    name = str(file).encode()
    tail = struct.pack(">I", 0x40000000 // _PAGE + 1) + name + struct.pack(">II", len(name), sum(name)) + _MAGIC
    return head.ljust(_SECTOR, b"\0") + struct.pack(">I", 1) + page + struct.pack(">I", checksum) + tail


def carries_out(file: Path, statements: str) -> None:
    """Let SQLite do something with a file, and close it."""
    with contextlib.closing(sqlite3.connect(file)) as database:
        database.executescript(statements)


@of_each_kind
def test_no_journal_beside_a_file_removes_another_file(tmp_path: Path, opened: Callable[[str], Any]) -> None:
    precious, database = tmp_path / "precious", tmp_path / "box"
    precious.write_text("precious")
    opened(str(database)).close()
    carries_out(database, "PRAGMA journal_mode = DELETE")
    Path(f"{database}-journal").write_bytes(journal_that_names(precious, database))
    with pytest.raises(RunError, match="cannot be used: box-journal names another file to be removed"):
        opened(str(database))
    assert precious.read_text() == "precious"


@of_each_kind
@pytest.mark.parametrize("ending", ["-journal", "-wal", "-shm"])
@pytest.mark.parametrize("is_link", [True, False])
def test_no_link_or_pipe_beside_a_file_is_followed(
    tmp_path: Path, opened: Callable[[str], Any], ending: str, is_link: bool
) -> None:
    """An archive that was unpacked can hold both."""
    precious, other = tmp_path / "precious", tmp_path / f"box{ending}"
    precious.write_text("precious")
    other.symlink_to(precious) if is_link else os.mkfifo(other)
    with pytest.raises(RunError, match=f"cannot be used: box{ending} is not a plain file"):
        opened(str(tmp_path / "box"))
    assert precious.read_text() == "precious"


@of_each_kind
@pytest.mark.parametrize(
    "said",
    [
        "CREATE VIEW hfg_ledger AS SELECT 1 part",
        "CREATE TABLE hfg_outbox (name TEXT PRIMARY KEY, type TEXT, stream TEXT, last INT, more AS (name || type))",
        "CREATE TABLE t (a); CREATE TRIGGER hfg_t AFTER INSERT ON t BEGIN DELETE FROM t; END",
    ],
)
def test_a_file_with_a_program_in_it_is_refused(tmp_path: Path, opened: Callable[[str], Any], said: str) -> None:
    """A view that has no end would hold the run up forever."""
    carries_out(tmp_path / "box", said)
    with pytest.raises(RunError, match="cannot be used: (it has a .* that is not of this version of hfg|use DROP)"):
        opened(str(tmp_path / "box"))


def test_a_ledger_that_holds_something_else_than_bytes_is_broken(tmp_path: Path) -> None:
    LedgerFile(str(tmp_path / "box"), "total").close()
    carries_out(tmp_path / "box", "INSERT INTO hfg_ledger VALUES ('total', 'x', 'y', 'z')")
    with pytest.raises(RunError, match="is broken: its checksum does not match"):
        LedgerFile(str(tmp_path / "box"), "total")


@pytest.mark.parametrize(
    ("statement", "sentence"),
    [
        ("INSERT INTO hfg_outbox_value VALUES (1, 'text', 2)", "it holds what no publisher has kept"),
        ("UPDATE hfg_outbox SET last = 'x'", "it holds what no publisher has kept"),
        (
            "INSERT INTO hfg_outbox_value VALUES (1, zeroblob(9), zeroblob(9))",
            "its values have 18 bytes, the limit is 5",
        ),
    ],
)
def test_an_outbox_that_no_publisher_has_written_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, statement: str, sentence: str
) -> None:
    OutboxFile(str(tmp_path / "box"), "camera/front", "int").close()
    carries_out(tmp_path / "box", statement)
    with monkeypatch.context() as patch:
        if "limit" in sentence:
            patch.setattr("hfg.links.pubsub.outbox.FILE_BYTES", hfg.base.bounds.FILE_BYTES._replace(usual=5))
        with pytest.raises(RunError, match=f"cannot be used: {sentence}"):
            OutboxFile(str(tmp_path / "box"), "camera/front", "int")


def test_an_outbox_of_before_is_opened_again(tmp_path: Path) -> None:
    first = OutboxFile(str(tmp_path / "box"), "camera/front", "int")
    first.keep(KeptValue(1, b"a", b"b"), 0, {"one"})
    first.close()
    again = OutboxFile(str(tmp_path / "box"), "camera/front", "int")
    assert (again.kept, again.members) == ([KeptValue(1, b"a", b"b")], {"one"})
    again.close()


@of_each_kind
def test_a_new_file_can_be_read_and_so_locked_by_its_user_only(tmp_path: Path, opened: Callable[[str], Any]) -> None:
    opened(str(tmp_path / "box")).close()
    assert (tmp_path / "box").stat().st_mode & 0o777 == 0o600


@pytest.fixture
def shared() -> Iterator[Path]:
    """A folder like /tmp."""
    folder = Path(tempfile.mkdtemp(prefix="hfg-attack-", dir="/tmp"))
    folder.chmod(0o1777)
    yield folder
    shutil.rmtree(folder)


@of_each_kind
def test_no_such_file_lies_where_others_can_put_a_journal_beside_it(shared: Path, opened: Callable[[str], Any]) -> None:
    with pytest.raises(RunError, match="cannot be used: other users can write to its folder"):
        opened(str(shared / "box"))
    assert list(shared.iterdir()) == []


@only_root
@of_each_kind
def test_no_link_of_another_user_leads_to_a_database_of_ours(tmp_path: Path, opened: Callable[[str], Any]) -> None:
    ours = tmp_path / "cookies"
    carries_out(ours, "CREATE TABLE cookies (name)")
    folder = Path(tempfile.mkdtemp(prefix="hfg-attack-", dir="/tmp"))
    try:
        folder.chmod(0o755)
        os.chown(folder, NOBODY, NOBODY)
        as_nobody(lambda: (folder / "box").symlink_to(ours))
        with pytest.raises(RunError, match="cannot be used: a symbolic link of another user is in its place"):
            opened(str(folder / "box"))
    finally:
        shutil.rmtree(folder)
    with contextlib.closing(sqlite3.connect(ours)) as file:
        assert file.execute("SELECT count(*) FROM sqlite_schema").fetchone() == (1,)


# --- the journal of a search


def waiting() -> hfg.Graph:
    graph = hfg.Graph("waiting")
    graph.start.activates(graph.add(Wait(), name="wait").begin)
    return graph


def search(journal: Path) -> str:
    found = tune(
        waiting, ["wait.seconds=1..5"], minimize="duration_s", journal=journal, evaluations=3, method="random",
        processes=1,
    )  # fmt: skip
    return str(found)


@only_root
@pytest.mark.slow
def test_no_other_user_can_lock_a_journal(shared: Path) -> None:
    (shared / "mine").mkdir(mode=0o755)
    journal = shared / "mine" / "journal"
    before = search(journal)

    def locks() -> str:
        try:
            with journal.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except PermissionError as error:
            return str(error.strerror)
        return "locked"

    assert as_nobody(locks) == "Permission denied"
    assert search(journal) == before


@pytest.mark.slow
@pytest.mark.parametrize("scores", [[], [1.0, 2.0]])
def test_a_journal_whose_runs_lack_scores_is_refused(tmp_path: Path, scores: list[float]) -> None:
    journal = tmp_path / "journal"
    search(journal)
    head, *lines = journal.read_bytes().splitlines()
    changed = [msgspec.json.encode({**msgspec.json.decode(line), "scores": scores}) for line in lines]
    journal.write_bytes(b"\n".join([head, *changed, b""]))
    with pytest.raises(UsageError, match=f"not the journal of a search: candidate 0 has {len(scores)} scores, not 1"):
        search(journal)


def test_a_journal_of_too_many_values_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HFG_MOST_JSON_VALUES", "50")
    (tmp_path / "journal").write_text("[" + "[]," * 100 + "[]]\n")
    with pytest.raises(UsageError, match="not the journal of a search: it has 202 values or more, the limit is 50"):
        search(tmp_path / "journal")


# --- settings of matplotlib

PLOTS = """
import sys
from hfg.nodes.display import TimePlot
from hfg.testing import fire
assert "matplotlib" not in sys.modules
print(fire(TimePlot(every=1), value=1.0).outputs["plot"].shape)
"""


def plots(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    pytest.importorskip("matplotlib")
    return subprocess.run(
        [sys.executable, "-P", "-c", PLOTS], cwd=folder, capture_output=True, text=True, timeout=patience(120),
        env={**os.environ, "PYTHONPATH": os.pathsep.join(one or os.getcwd() for one in sys.path), **environment},  # noqa: PTH109
        check=False,
    )  # fmt: skip


@pytest.mark.slow
def test_settings_of_matplotlib_in_a_folder_are_not_read_unless_they_are_named(tmp_path: Path) -> None:
    """In matplotlib 3.9 and 3.10, what they say of colours can be any code."""
    (tmp_path / "matplotlibrc").write_text("figure.facecolor: red\n")
    refused = plots(tmp_path)
    assert refused.returncode == 1
    assert f"matplotlib would take its settings from {tmp_path / 'matplotlibrc'}" in refused.stderr
    assert plots(tmp_path, MATPLOTLIBRC="matplotlibrc").stdout == "(480, 640, 3)\n"

"""The file that a studio edits, inside its folder: open, save, how many edits are not saved, who else has written it.

A file that another program has changed is never overwritten without being asked. Depends on the files' floor and
`journal`.
"""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec
from typing_extensions import override

from hfg.base.bounds import GRAPH_FILE_BYTES
from hfg.base.whole import read_plain
from hfg.files import describe, load, save, text_of
from hfg.files.opening import SUFFIX
from hfg.graph import Graph
from hfg.graph.editing import Transaction, history_of
from hfg.studio.journal import Journal
from hfg.studio.records import FileRecord, JournalOffer
from hfg.studio.refusing import Refused

__all__ = ["Project", "RecordedProject"]

_MOST_FILES: Final = 1000
_MOST_LINES: Final = 5000
_MOST_BYTES: Final = GRAPH_FILE_BYTES.most + 1


class Project:
    """A graph and where it comes from.

    Attributes:
      graph: the whole graph.
      folder: nothing outside of it is opened or written.
      file: where the graph was read from or written to last; None if it has no file yet.
      allow: packages that files and commands may import besides.
    """

    def __init__(
        self,
        graph: Graph,
        folder: Path,
        file: Path | None = None,
        *,
        name: str = "",
        allow: Iterable[str] = (),
        read: Callable[[str], Graph] | None = None,
        keep: bool = True,
    ) -> None:
        """Take a graph that was read already.

        Args:
          graph: the whole graph.
          folder: nothing outside of it is opened or written.
          file: where the graph comes from.
          name: of the graph in the file, if that is code with several.
          allow: packages that files and commands may import besides.
          read: reads a file, or the graph of a name in it, "file.py:name"; by default only graph files.
          keep: keep unsaved edits in a journal; not for a run that another program has begun.
        """
        self.graph = graph
        self.folder = folder.resolve()
        self.file = None if file is None else file.resolve()
        self.allow = tuple(allow)
        self._name = name
        self._read = read or (lambda target: load(target, allow=self.allow))
        self._saved: Transaction | None = None
        self._dirty_from_start = 0
        self._print = self._fingerprint()
        self._elsewhere = ""
        self._seen = self._stat()
        self._keeps = keep
        self.journal = self._new_journal()

    def _new_journal(self) -> Journal:
        return Journal(self.folder, self.file, self._print, keep=self._keeps)

    # --- what pages see ---

    def record(self) -> FileRecord:
        """Return the state of the file."""
        file = self.file
        offer = self.journal.offer
        return FileRecord(
            name=self.graph.name if file is None else file.name,
            path="" if file is None else str(file.relative_to(self.folder)),
            folder=self.folder.name,
            kind="none" if file is None else "yaml" if file.name.endswith(SUFFIX) else "python",
            changes=self.changes,
            can_save=file is not None and file.name.endswith(SUFFIX),
            elsewhere=self.elsewhere,
            graph=self.graph.name,
            journal=None if offer is None else JournalOffer(*offer),
        )

    @property
    def changes(self) -> int:
        """How many steps the graph is away from what the file says."""
        history = history_of(self.graph)
        if self._saved is None:
            return len(history.done) + self._dirty_from_start
        if self._saved in history.done:
            return len(history.done) - 1 - history.done.index(self._saved)
        if self._saved in history.undone:
            return len(history.undone) - history.undone.index(self._saved)
        return len(history.done) + 1

    @property
    def elsewhere(self) -> str:
        """Why saving does not simply overwrite the file; "" if it does."""
        return f"{self._elsewhere} Yours has {_count(self.changes)}." if self._elsewhere else ""

    def look(self) -> None:
        """See whether another program has written the file. It is read only if its time or size has changed."""
        stat = self._stat()
        if stat == self._seen:
            return
        self._seen, elsewhere = stat, ""
        if self.file is not None and self._fingerprint() != self._print:
            what = "was removed" if stat is None else "was changed on disk by another program"
            elsewhere = f"{self.file.name} {what}."
        self._elsewhere = elsewhere

    def _stat(self) -> tuple[int, int] | None:
        try:
            found = None if self.file is None else self.file.stat()
        except OSError:
            return None
        return None if found is None else (found.st_mtime_ns, found.st_size)

    def _fingerprint(self) -> str:
        """Tell contents apart."""
        try:
            return "" if self.file is None else hashlib.sha256(read_plain(self.file, _MOST_BYTES)).hexdigest()
        except OSError:
            return ""

    # --- reading and writing ---

    def within(self, path: str) -> Path:
        """Return a path inside the folder.

        Raises:
          Refused: it leads out of the folder.
        """
        if not path or "\0" in path:
            raise Refused("file", "a file has a name")
        found = (self.folder / path).resolve()
        if not found.is_relative_to(self.folder):
            raise Refused("file", f'"{path}" leads out of the folder "{self.folder.name}", which the studio was given')
        return found

    def open(self, path: str, *, discard: bool) -> None:
        """Take another file's graph, of code also "file.py:name"; without a path an empty one.

        Raises:
          Refused: there are unsaved edits, or it is outside of the folder.
          FileError: it holds no graph.
          TargetError: it is code without a graph, or with several; `choices` are their names.
        """
        if not path:
            self.begin(Graph("graph"), discard=discard)
            return
        self.need_saved(discard)
        place, name = _split(path)
        file = self.existing(place)
        self._take(self._read(_target(file, name)), file, name)

    def existing(self, path: str) -> Path:
        """Return the path of a file inside the folder.

        Raises:
          Refused: it leads out of the folder, or there is no such file.
        """
        file = self.within(path)
        if not file.is_file():
            raise Refused("file", f'there is no file "{path}" in the folder "{self.folder.name}"')
        return file

    def begin(self, graph: Graph, *, discard: bool) -> None:
        """Take a graph that has no file yet.

        Raises:
          Refused: there are unsaved edits.
        """
        self.need_saved(discard)
        self._take(graph, None)

    def reread(self) -> None:
        """Take the file as it is on the disk."""
        if self.file is None:
            raise Refused("file", "the graph has no file that could be read again; save it first")
        if not self.file.is_file():
            raise Refused("file", f"{self.file.name} is no longer a file")
        self._take(self._read(_target(self.file, self._name)), self.file, self._name)

    def need_saved(self, discard: bool) -> None:
        """Refuse to lose edits, unless they are given up."""
        if self.changes and not discard:
            raise Refused("changed", f"{_count(self.changes)} would be lost; save first, or discard them")

    def _take(self, graph: Graph, file: Path | None, name: str = "") -> None:
        self.journal.drop()
        self.graph, self.file, self._name = graph, file, name
        self._now_saved()
        self.journal = self._new_journal()

    def save(self, path: str, *, force: bool) -> None:
        """Write the file, or another one.

        Raises:
          Refused: another program has written it, it exists already, or it is not a graph file.
          FileError: a file cannot hold part of the graph.
        """
        file = self.file if not path else self.within(path)
        if file is None:
            raise Refused("file", f'the graph has no file yet: save it under a name that ends in "{SUFFIX}"')
        if not file.name.endswith(SUFFIX):
            raise Refused(
                "file",
                f'{file.name} is code, which the studio does not write: save under a name that ends in "{SUFFIX}"',
            )
        self._seen = None
        self.look()
        if not force and file == self.file and self._elsewhere:
            raise Refused("changed", self.elsewhere)
        if not force and file != self.file and file.exists():
            raise Refused("changed", f"{file.name} is there already; overwrite it, or choose another name")
        save(self.graph, file)
        self.journal.drop()
        self.file, self._name = file, ""
        self._now_saved()
        self.journal = self._new_journal()

    def _now_saved(self) -> None:
        done = history_of(self.graph).done
        self._saved = done[-1] if done else None
        self._dirty_from_start = 0
        self._print = self._fingerprint()
        self._seen = self._stat()
        self._elsewhere = ""

    def take_journal(self, *, take: bool) -> None:
        """Carry out the edits that were not saved when a studio ended, or drop them."""
        if take:
            self.journal.replay(self.graph, self.allow)
        else:
            self.journal.drop()
            self.journal = self._new_journal()

    def close(self) -> None:
        """The studio ends; what is not saved stays in the journal."""
        self.journal.close(keep=self.changes > 0)

    # --- questions ---

    def listing(self, path: str) -> dict[str, Any]:
        """Return the folders and graph files of a folder."""
        folder = self.within(path or ".")
        if not folder.is_dir():
            raise Refused("file", f'"{path}" is not a folder')
        entries = sorted(folder.iterdir(), key=lambda one: one.name)[:_MOST_FILES]
        shown = [one for one in entries if not one.name.startswith(".")]
        files = [one for one in shown if one.is_file() and one.name.endswith((SUFFIX, ".py", ".mcap"))]
        return {
            "path": "" if folder == self.folder else str(folder.relative_to(self.folder)),
            "folders": [one.name for one in shown if one.is_dir() and not one.name.startswith("__")],
            "files": [
                {"name": one.name, "kind": _kind(one), "size": one.stat().st_size, "changed": one.stat().st_mtime}
                for one in files
            ],
        }

    def difference(self) -> list[str]:
        """Return the difference between the file on the disk and the graph, line by line."""
        mine = text_of(describe(self.graph, beside=self.file)).splitlines()
        theirs: Sequence[str] = ()
        if self.file is not None and self.file.name.endswith(SUFFIX) and self.file.is_file():
            theirs = read_plain(self.file, _MOST_BYTES).decode(errors="replace").splitlines()
        name = "new" if self.file is None else self.file.name
        return list(difflib.unified_diff(theirs, mine, f"{name} (disk)", f"{name} (yours)", lineterm=""))[:_MOST_LINES]

    # --- recordings ---

    def graph_project(self) -> Project:
        """Return the project that can open graphs of this folder: this one, unless it is that of a recording."""
        return self

    def recording(self, graph: Graph, file: Path) -> RecordedProject:
        """Return the project of a recording in the same folder."""
        return RecordedProject(graph, file, self.folder, allow=self.allow, read=self._read)


class RecordedProject(Project):
    """The project of a recording, which has nothing to save."""

    def __init__(
        self,
        graph: Graph,
        file: Path,
        folder: Path | None = None,
        *,
        allow: Iterable[str] = (),
        read: Callable[[str], Graph] | None = None,
    ) -> None:
        super().__init__(graph, folder or file.resolve().parent, allow=allow, read=read, keep=False)
        self._recording = file.resolve()

    @override
    def record(self) -> FileRecord:
        path = str(self._recording.relative_to(self.folder))
        return msgspec.structs.replace(
            super().record(), name=self._recording.name, path=path, kind="recording", changes=0
        )

    @override
    def graph_project(self) -> Project:
        return Project(Graph("graph"), self.folder, allow=self.allow, read=self._read)


def _split(path: str) -> tuple[str, str]:
    """Return a path, and the name after its colon, if it leads to code."""
    place, colon, name = path.rpartition(":")
    return (place, name) if colon and place.endswith(".py") else (path, "")


def _target(file: Path, name: str) -> str:
    return f"{file}:{name}" if name else str(file)


def _kind(file: Path) -> str:
    return "yaml" if file.name.endswith(SUFFIX) else "recording" if file.suffix == ".mcap" else "python"


def _count(changes: int) -> str:
    return "1 change" if changes == 1 else f"{changes} changes"

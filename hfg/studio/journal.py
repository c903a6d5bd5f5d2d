"""Edits that are not saved yet, in a file next to the graph's: they survive the sudden end of the studio.

Each line is a step: commands, "undo" or "redo". A new studio does not have the commands that
were saved before, so undoing one of them is written as the whole graph. Depends on the files' floor.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

import msgspec

from hfg.base.logs import Log
from hfg.base.whole import GrowingFile
from hfg.errors import HfgError
from hfg.files import describe, text_of
from hfg.files.opening import SUFFIX
from hfg.graph import Graph
from hfg.graph.editing import Transaction, history_of
from hfg.graph.editing.commands import Command, decode, encode
from hfg.studio.refusing import Refused

__all__ = ["Journal"]

_LOGGER: Final = Log("hfg.studio")
_MOST_BYTES: Final = 64 << 20


class _Line(msgspec.Struct, omit_defaults=True):
    """One line.

    Attributes:
      base: of the first line: which contents of the file the steps begin with.
      commands: of an edit, as text.
      joined: it and the edit before are one step.
      did: "undo" or "redo".
      graph: the whole graph as a file would say it, in place of all before.
    """

    base: str = ""
    commands: str = ""
    joined: bool = False
    did: str = ""
    graph: str = ""


class Journal:
    """The journal of one file.

    Attributes:
      offer: how many edits another studio has left, and when; None if none.
    """

    def __init__(self, folder: Path, file: Path | None, base: str, *, keep: bool = True) -> None:
        name = "graph" if file is None else file.name
        self.path = (folder if file is None else file.parent) / f".{name}.hfg-journal"
        self._base = base
        self._begun = False
        self._done = self._undone = 0  # steps that a new studio could undo and redo as well
        self._broken = not keep
        self.offer = self._found() if keep else None

    def _found(self) -> tuple[int, float] | None:
        try:
            there = self.path.lstat()
            lines = self._lines()
        except (OSError, msgspec.MsgspecError):
            return None
        steps = sum(1 for line in lines if not line.base and not line.joined)
        return (steps, there.st_mtime) if steps else None

    def _lines(self) -> list[_Line]:
        number = os.open(self.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)  # a pipe would wait forever
        with os.fdopen(number, "rb") as file:
            there = os.fstat(number)
            if not stat.S_ISREG(there.st_mode) or there.st_uid != os.geteuid() or there.st_size > _MOST_BYTES:
                raise OSError(f"{self.path} is not a file of this user, or is too long")
            found = []
            for text in file.read().splitlines():
                with suppress(msgspec.MsgspecError):  # the last one may be half a line
                    found.append(msgspec.json.decode(text, type=_Line))
            return found

    # --- writing ---

    def edited(self, commands: Iterable[Command], *, joined: bool) -> None:
        """The graph was edited."""
        try:
            line = _Line(commands=encode(commands), joined=joined)
        except HfgError:  # a value that is not data
            return
        self._done += 0 if joined else 1
        self._undone = 0
        self._write(line)

    def undone(self, graph: Graph) -> None:
        """The last edit was taken back."""
        if self._done:
            self._done, self._undone = self._done - 1, self._undone + 1
            self._write(_Line(did="undo"))
        else:
            self._whole(graph)

    def redone(self, graph: Graph) -> None:
        """It was carried out again."""
        if self._undone:
            self._done, self._undone = self._done + 1, self._undone - 1
            self._write(_Line(did="redo"))
        else:
            self._whole(graph)

    def _whole(self, graph: Graph) -> None:
        self._done = self._undone = 0
        with suppress(HfgError):  # a graph that no file can hold
            self._write(_Line(graph=text_of(describe(graph, beside=self.path.with_name(f"x{SUFFIX}")))))

    def _write(self, line: _Line) -> None:
        if self._broken:
            return
        try:
            if not self._begun:
                self._set_aside()
                self._append(_Line(base=self._base))
                self._begun, self.offer = True, None
            self._append(line)
        except OSError as error:
            self._broken = True
            _LOGGER.warning("unsaved edits are not kept in %s: %s", self.path, error.strerror)

    def _set_aside(self) -> None:
        """Edits that were offered and neither taken up nor dropped stay, in a file next to it."""
        if self.offer is not None:
            aside = self.path.with_name(f"{self.path.name}-before")
            _LOGGER.warning("unsaved edits of an earlier studio, which were not taken up, are in %s", aside)
            self.path.replace(aside)
        else:
            self.path.unlink(missing_ok=True)

    def _append(self, line: _Line) -> None:
        file = GrowingFile(self.path, append=True, at_once=True)
        file.write(msgspec.json.encode(line) + b"\n")
        file.complete()

    # --- afterwards ---

    def replay(self, graph: Graph, allow: Iterable[str]) -> None:
        """Carry out what another studio has left.

        Raises:
          Refused: the file is not the one that the edits were made on.
          GraphError: an edit cannot be carried out; those before it are.
        """
        if self.offer is None:
            raise Refused("state", "there are no unsaved edits")
        lines = self._lines()
        if lines and lines[0].base != self._base:
            raise Refused("changed", "the file was changed since those edits were made; they cannot be taken up")
        if any(line.graph for line in lines):
            raise Refused(
                "changed",
                f"the edits undo what was saved before; the graph as it was is in {self.path.name}, in its last line "
                'with "graph"',
            )
        self.offer = None
        for line in lines:
            if line.commands:
                commands = decode(line.commands, allow=allow)
                graph.edit(*commands)
                if line.joined and len(history_of(graph).done) > 1:
                    history_of(graph).join_last(Transaction.joined)
                self.edited(commands, joined=line.joined)
            elif line.did == "undo":
                graph.undo()
                self.undone(graph)
            elif line.did == "redo":
                graph.redo()
                self.redone(graph)

    def drop(self) -> None:
        """Its edits are saved or given up: remove it."""
        if self.offer is not None or self._begun:
            self._begun, self.offer = True, None
            self.close(keep=False)
        self._begun = False

    def close(self, *, keep: bool) -> None:
        """Write no more."""
        if not keep and self._begun:
            with suppress(OSError):
                self.path.unlink()

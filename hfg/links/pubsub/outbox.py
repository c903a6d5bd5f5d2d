"""A file of published values that are not acknowledged: the next publisher with this file resumes with them (rule L2).

A value is in the file before it is sent. Acknowledged values are removed when the next one is written. The file is a
SQLite database, and open to one publisher at a time.
"""

from __future__ import annotations

import secrets
import sqlite3
import threading
from collections.abc import Sequence, Set
from typing import Final, NamedTuple

from hfg.base.bounds import FILE_BYTES
from hfg.base.databases import open_database
from hfg.errors import RunError

_TABLES: Final = {
    "hfg_outbox": "name TEXT PRIMARY KEY, type TEXT, stream TEXT, last INT",
    "hfg_outbox_value": "number INTEGER PRIMARY KEY, metadata BLOB, value BLOB",
    "hfg_outbox_member": "id TEXT PRIMARY KEY",
}


class KeptValue(NamedTuple):
    """A value that was published and may not be done.

    Attributes:
      number: its number in the stream; they follow one another.
      metadata, value: it, encoded.
    """

    number: int
    metadata: bytes
    value: bytes


class OutboxFile:
    """Keeps the values of one publisher.

    Args:
      path: path of the file; it is created if it does not exist.
      name: the common name of the programs.
      fingerprint: fingerprint of the type of the values.

    Attributes:
      path: see above.
      stream: identity of the stream published with this file, by all incarnations of the publisher together.
      last: number of the last value that was ever stored; 0 if there was none.
      kept: values in the file when it was opened, in order.
      members: consumers that wanted every value at that time.

    Raises:
      RunError: it is not an outbox, has values of another name or type, or is open in another publisher.
    """

    def __init__(self, path: str, name: str, fingerprint: str) -> None:
        self.path = path
        self._name = name
        self._lock = threading.Lock()
        try:
            self._file = open_database(path, _TABLES)
        except (sqlite3.Error, OSError, ValueError) as error:
            raise self._refuse(error) from error
        try:
            self._file.execute("PRAGMA journal_mode = WAL")  # one wait for the disk a change instead of three
            self._need_fair()
            self.stream, self.last = self._begin(fingerprint)
            rows = self._file.execute("SELECT number, metadata, value FROM hfg_outbox_value ORDER BY number")
            self.kept = [KeptValue(*row) for row in rows]
            self.members = {one for (one,) in self._file.execute("SELECT id FROM hfg_outbox_member")}
        except BaseException as error:
            self._file.close()
            raise (self._refuse(error) if isinstance(error, sqlite3.Error | ValueError) else error) from error

    def _need_fair(self) -> None:
        """Check that what is kept fits into memory, and is what is kept in such a file.

        Raises:
          ValueError: it does not, or is not.
        """
        size, wrong = self._file.execute(
            "SELECT total(length(metadata) + length(value)), "
            "count(*) - total(typeof(metadata) = 'blob' AND typeof(value) = 'blob') FROM hfg_outbox_value"
        ).fetchone()
        wrong += self._file.execute(
            "SELECT count(*) FROM hfg_outbox WHERE typeof(stream) <> 'text' OR typeof(last) <> 'integer'"
        ).fetchone()[0]
        if wrong:
            raise ValueError("it holds what no publisher has kept")
        if size > FILE_BYTES.most:
            raise ValueError(f"its values have {size:,.0f} bytes, {FILE_BYTES.remedy}")

    def _begin(self, fingerprint: str) -> tuple[str, int]:
        """Return the stream to continue, and its last number; a new stream if no value of the old one is left."""
        found = self._file.execute("SELECT name, type, stream, last FROM hfg_outbox").fetchone()
        count = self._file.execute("SELECT count(*) FROM hfg_outbox_value").fetchone()[0]
        if found is not None and found[:2] == (self._name, fingerprint):
            return found[2], found[3]
        if found is not None and count:
            what = f'of "{found[0]}"' if found[0] != self._name else "of another type"
            raise RunError(
                f'outbox "{self.path}" has {count} values {what}, so "{self._name}" cannot be published with '
                "it: let that publisher finish, or use another file"
            )
        stream = secrets.token_hex(8)
        self._file.execute("DELETE FROM hfg_outbox")
        self._file.execute("DELETE FROM hfg_outbox_member")
        self._file.execute("INSERT INTO hfg_outbox VALUES (?, ?, ?, 0)", (self._name, fingerprint, stream))
        return stream, 0

    def keep(self, value: KeptValue, done: int, members: Set[str]) -> None:
        """Keep one more, no longer those up to a number, and who is there; when it returns that is on the disk.

        Raises:
          RunError: it cannot be.
        """
        others: list[tuple[str, Sequence[object]]] = []
        if members != self.members:
            others = [("DELETE FROM hfg_outbox_member", ())]
            others += [("INSERT INTO hfg_outbox_member VALUES (?)", (one,)) for one in members]
        self._change(
            *others,
            ("DELETE FROM hfg_outbox_value WHERE number <= ?", (done,)),
            ("INSERT OR REPLACE INTO hfg_outbox_value VALUES (?, ?, ?)", value),  # of an end that was not heard
            ("UPDATE hfg_outbox SET last = ?", (value.number,)),
        )
        self.members = set(members)

    def forget(self, done: int) -> None:
        """Keep no longer those up to a number.

        Raises:
          RunError: the file cannot be written.
        """
        self._change(("DELETE FROM hfg_outbox_value WHERE number <= ?", (done,)))

    def clear(self) -> None:
        """Forget the stream after all values are acknowledged: the next publisher with this file starts a new stream.

        Raises:
          RunError: the file cannot be written.
        """
        self._change(*((f"DELETE FROM hfg_outbox{one}", ()) for one in ("", "_value", "_member")))

    def close(self) -> None:
        """End it; what is kept stays."""
        with self._lock:
            self._file.close()

    def _change(self, *statements: tuple[str, Sequence[object]]) -> None:
        """Run a transaction.

        If its caller is cancelled, another one may start while a thread still finishes this one.
        """
        with self._lock:
            try:
                self._file.execute("BEGIN")
                for statement, values in statements:
                    self._file.execute(statement, values)
                self._file.execute("COMMIT")
            except sqlite3.Error as error:
                if self._file.in_transaction:
                    self._file.execute("ROLLBACK")
                raise self._refuse(error) from error

    def _refuse(self, error: Exception) -> RunError:
        why = getattr(error, "strerror", None) or error
        return RunError(
            f'outbox "{self.path}" of "{self._name}" cannot be used: {why}; use a writable path of an '
            "outbox, or of a file that does not exist, that no other publisher has open"
        )

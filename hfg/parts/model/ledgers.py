"""Where what a part has done is kept: in the memory of the main part, which survives it, or in a file (rule L2).

A ledger has one entry, and writing replaces it at once or not at all. Knows nothing of what is in an entry.
"""

from __future__ import annotations

import sqlite3
import zlib
from typing import Final, NamedTuple

from hfg.base.databases import open_database
from hfg.errors import RunError

_TABLES: Final = {"hfg_ledger": "part TEXT PRIMARY KEY, life INT, sum INT, data BLOB"}


class Entry(NamedTuple):
    """The stored data of a part.

    Attributes:
      incarnation: the highest incarnation number in its run.
      data: as the part has sent it.
    """

    incarnation: int
    data: bytes


class Ledger:
    """Stores an entry for the duration of the run.

    Attributes:
      entry: the entry that was written last.
      is_slow: writing may take some milliseconds.
    """

    is_slow = False

    def __init__(self) -> None:
        self.entry: Entry | None = None

    def write(self, entry: Entry) -> None:
        """Put this in the place of what was there; when it returns it is kept.

        Raises:
          RunError: it cannot be.
        """
        self.entry = entry

    def clear(self) -> None:
        """The run has ended well: the next one starts from scratch."""
        self.entry = None

    def close(self) -> None:
        """End it."""


class LedgerFile(Ledger):
    """Keeps the entry of one part in a file, which is open to one part of one run at a time."""

    is_slow = True

    def __init__(self, path: str, part: str) -> None:
        """Open the file, and read what is there.

        Args:
          path: path of the file; it is created if it does not exist.
          part: the part that the entry belongs to.

        Raises:
          RunError: it is not a ledger, is broken, or is open in another run.
        """
        super().__init__()
        self.path = path
        self._part = part
        try:
            self._file = open_database(path, _TABLES)
        except (sqlite3.Error, OSError, ValueError) as error:
            raise self._refuse(error) from error
        try:
            found = self._file.execute("SELECT life, sum, data FROM hfg_ledger WHERE part = ?", (part,)).fetchone()
        except sqlite3.Error as error:
            self._file.close()
            raise self._refuse(error) from error
        if found is not None:
            incarnation, checksum, data = found
            if not isinstance(incarnation, int) or not isinstance(data, bytes) or zlib.crc32(data) != checksum:
                self._file.close()
                raise RunError(
                    f'ledger "{path}" of group "{part}" is broken: its checksum does not match; restore it '
                    "from a copy, or remove it to start over"
                )
            self.entry = Entry(incarnation, data)

    def write(self, entry: Entry) -> None:
        """See `Ledger`."""
        row = (self._part, entry.incarnation, zlib.crc32(entry.data), entry.data)
        try:
            self._file.execute("INSERT OR REPLACE INTO hfg_ledger VALUES (?, ?, ?, ?)", row)
        except sqlite3.Error as error:
            raise self._refuse(error) from error
        self.entry = entry

    def clear(self) -> None:
        """See `Ledger`."""
        try:
            self._file.execute("DELETE FROM hfg_ledger WHERE part = ?", (self._part,))
        except sqlite3.Error as error:
            raise self._refuse(error) from error
        self.entry = None

    def close(self) -> None:
        """See `Ledger`."""
        self._file.close()

    def _refuse(self, error: Exception) -> RunError:
        why = getattr(error, "strerror", None) or error
        return RunError(
            f'ledger "{self.path}" of group "{self._part}" cannot be used: {why}; use a writable path of a '
            "ledger, or of a file that does not exist, that no other run or group has open"
        )


def ledger_of(where: bool | str, part: str) -> Ledger:
    """Open the ledger of a part.

    Args:
      where: True or the path of a file.
      part: its name.

    Raises:
      RunError: the file cannot be used.
    """
    return LedgerFile(where, part) if isinstance(where, str) else Ledger()

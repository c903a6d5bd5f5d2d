"""Files of SQLite that another user may have written or redirected: opened with care, or refused (rules L4, L5).

SQLite trusts a journal next to such a file: a user who can write to the folder decides by it what is in the file, and
can name another file that is removed. A view in the file is a program. Depends on bounds and `places`.
"""

from __future__ import annotations

import errno
import os
import sqlite3
import stat
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from hfg.base.bounds import FILE_BYTES
from hfg.base.places import Place, need_own
from hfg.base.private import is_open_to_others

_NAMES_ANOTHER: Final = bytes.fromhex("d9d505f920a163d7")
"""The end of a journal that names a file to be removed; a journal of one file never does."""


def open_database(path: str, tables: Mapping[str, str]) -> sqlite3.Connection:
    """Open a file for this program only, and make what is missing.

    A new file can be read by this user only, because a user who can read it could lock it.

    Args:
      path: of the file.
      tables: the columns of each table. A file with anything else in it is refused.

    Raises:
      OSError: another user decides what is in it.
      sqlite3.Error: it cannot be used.
      ValueError: it was made for something else.
    """
    with Place(Path(path)) as place:
        _need_alone(place)
        with suppress(FileExistsError):
            os.close(place.open(os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode=0o600))
        database = sqlite3.connect(place.path, timeout=0.0, isolation_level=None, check_same_thread=False)
    try:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, FILE_BYTES.most)
        database.execute("PRAGMA trusted_schema = OFF")
        database.execute("PRAGMA synchronous = FULL")
        database.execute("PRAGMA locking_mode = EXCLUSIVE")
        database.execute("BEGIN EXCLUSIVE")
        for name, columns in tables.items():
            database.execute(f"CREATE TABLE IF NOT EXISTS {name} ({columns})")
        _need_only(database, tables)
        database.execute("COMMIT")
    except BaseException:
        database.close()
        raise
    return database


def _need_alone(place: Place) -> None:
    """Refuse a file that another user could have prepared.

    Raises:
      OSError: one could have.
    """
    there, around = place.found(), _folder_of(place)
    if is_open_to_others(around):
        what = f"other users can write to its folder {place.path.parent}; name a file in a folder of yours"
        raise PermissionError(errno.EPERM, what, str(place.path))
    if there is not None:
        need_own(place, there)
        if not stat.S_ISREG(there.st_mode):
            raise OSError(errno.EINVAL, "it is not a plain file", str(place.path))
    for ending in ("-journal", "-wal", "-shm"):  # SQLite would follow a link, and wait at a pipe
        name = f"{place.name}{ending}"
        found = place.found(name)
        if found is not None and not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, f"{name} is not a plain file; remove it", str(place.path))
    with suppress(FileNotFoundError), os.fdopen(place.open(os.O_RDONLY, f"{place.name}-journal"), "rb") as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - len(_NAMES_ANOTHER)))
        if file.read() == _NAMES_ANOTHER:
            what = f"{place.name}-journal names another file to be removed; remove it"
            raise OSError(errno.EINVAL, what, str(place.path))


def _folder_of(place: Place) -> os.stat_result:
    return os.fstat(place.folder) if place.folder is not None else place.path.parent.stat()


def _need_only(database: sqlite3.Connection, tables: Mapping[str, str]) -> None:
    """Refuse views, triggers, and tables that are not as they were made.

    Raises:
      ValueError: there are some.
    """
    for kind, name, said in database.execute("SELECT type, name, sql FROM sqlite_schema"):
        is_ours = kind == "table" and said == f"CREATE TABLE {name} ({tables.get(name)})"
        if not is_ours and not (kind == "index" and said is None):
            raise ValueError(f'it has a {kind} "{name!s:.40}" that is not of this version of hfg')

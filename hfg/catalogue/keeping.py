"""Keeps the index of all installed node types in a file, so that a search does not have to import them.

The file belongs to a fingerprint of everything that the catalogue is made from: the versions of hfg and Python, all
installed distributions, and name, size and time of each file of the packages that offer node types. If any of it
changes, the types are imported again. The same happens if another user could have written the file. A catalogue with
problems is not kept. Depends on `finding` and `searching`.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import importlib.util
import os
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Final

import msgspec

from hfg.base.private import make_private, unsafe_place
from hfg.catalogue.offers import Offer, offers
from hfg.catalogue.searching import Index, index_of

_FORMAT: Final = "1"
_INSTALLED: Final = (".dist-info", ".egg-info", ".egg-link", ".pth")
_WRITTEN_BY_OTHERS: Final = stat.S_IWGRP | stat.S_IWOTH
_MOST: Final = 64 << 20  # bytes: the library's own index has less than one


class Kept(msgspec.Struct, frozen=True):
    """An index, and a message for each broken place."""

    index: Index
    problems: tuple[str, ...] = ()


def installed_index(folder: Path | None = None) -> Kept:
    """Return the index of all that is installed: from the file if it is up to date, else by importing everything.

    Args:
      folder: where the file is kept; "hfg" in the user's folder for caches by default.
    """
    places = offers()
    path = (folder or _folder()) / f"catalogue-{_fingerprint(places)}.json"
    with contextlib.suppress(OSError, msgspec.DecodeError):
        return Kept(msgspec.json.decode(_read_own(path), type=Index))
    from hfg.catalogue.finding import installed  # imports the graph layer, which a stored index makes unnecessary

    found = installed(places)
    index = index_of(found.types)
    if not found.problems:
        _keep(path, index)
    return Kept(index, found.problems)


def _read_own(path: Path) -> bytes:
    """Return what a file contains that only this user can have written: it says which code a node type imports.

    Raises:
      OSError: there is no such file, it is too large, or another user could have written it.
    """
    _need_safe(path)
    with open(path, "rb", opener=_without_links) as file:
        found = os.fstat(file.fileno())
        if found.st_size > _MOST or found.st_uid != os.geteuid() or found.st_mode & _WRITTEN_BY_OTHERS:
            raise PermissionError(errno.EPERM, "not a file of this user alone", str(path))
        return file.read()


def _need_safe(path: Path) -> None:
    """Refuse a place where another user can exchange a file for an older one of ours.

    Raises:
      OSError: it is one.
    """
    place = unsafe_place(path)
    if place is not None:
        raise PermissionError(errno.EPERM, "other users can replace what lies in it", str(place))


def _without_links(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)  # a pipe would wait forever


def _folder() -> Path:
    """Return the folder for caches of this user, as the desktop specification has it."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path("~/.cache").expanduser()) / "hfg"


def _keep(path: Path, index: Index) -> None:
    """Write the file whole or not at all, and remove older ones; without a place for it nothing is kept."""
    with contextlib.suppress(OSError, RuntimeError):
        _need_safe(path)
        make_private(path.parent)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix="new-", delete=False) as file:
            file.write(msgspec.json.encode(index))
        Path(file.name).replace(path)
        for old in path.parent.glob("catalogue-*.json"):
            if old != path:
                old.unlink(missing_ok=True)


def _fingerprint(places: Iterable[Offer]) -> str:
    digest = hashlib.blake2b(digest_size=12)
    offered = (f"{one.module}:{one.name}" for one in places)
    for part in (_FORMAT, version("hfg"), sys.version, *offered, *_distributions(), *_sources(places)):
        digest.update(part.encode(errors="surrogateescape") + b"\0")
    return digest.hexdigest()


def _distributions() -> Iterator[str]:
    """Yield what is installed: the names of these folders contain name and version."""
    for entry in sys.path:
        with contextlib.suppress(OSError):
            yield from sorted(f"{entry}/{name}" for name in os.listdir(entry or ".") if name.endswith(_INSTALLED))  # noqa: PTH208


def _sources(places: Iterable[Offer]) -> Iterator[str]:
    """Yield each file of the packages that offer something, which a developer may have changed."""
    for package in dict.fromkeys(place.module.partition(".")[0] for place in places):
        spec = None
        with contextlib.suppress(ImportError, ValueError):
            spec = importlib.util.find_spec(package)
        for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
            yield from sorted(_files(folder))
        if spec is not None and spec.origin is not None:
            yield from _stated(spec.origin)


def _files(folder: str) -> Iterator[str]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                if entry.name != "__pycache__":
                    yield from _files(entry.path)
            elif not entry.name.endswith((".pyc", ".md")):
                yield from _stated(entry.path)


def _stated(path: str) -> Iterator[str]:
    with contextlib.suppress(OSError):
        found = os.stat(path)  # noqa: PTH116 - half as long as pathlib, and there are hundreds
        yield f"{path} {found.st_size} {found.st_mtime_ns}"

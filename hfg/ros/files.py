"""Files of definitions: `.msg`, `.srv` and `.action`, and their names. Depends on names."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Final

from hfg.errors import UsageError
from hfg.ros.names import dds_name

_SUFFIXES: Final = {".msg": "msg", ".srv": "srv", ".action": "action"}
_MOST_FILES: Final = 10_000
_MOST_BYTES: Final = 2**20


def texts(what: str | os.PathLike[str], name: str) -> dict[str, str]:
    """Return the texts of definitions by name of the type; see `hfg.ros.messages.register`.

    Raises:
      UsageError: a file cannot be read, or is of another kind.
    """
    if name:
        dds_name(name)
        return {name: os.fspath(what)}
    path = Path(what)
    files = sorted(one for one in path.rglob("*") if one.suffix in _SUFFIXES) if path.is_dir() else [path]
    if not files or len(files) > _MOST_FILES:
        raise UsageError(f"{path} has {len(files):,} .msg, .srv or .action files; 1 to {_MOST_FILES:,} can be read")
    found = {}
    for file in files:
        if file.suffix not in _SUFFIXES:
            raise UsageError(f"{file} is not a .msg, .srv or .action file")
        found[_name_of(file)] = _read(file)
    return found


def _name_of(file: Path) -> str:
    folder = file.resolve().parent
    kind = _SUFFIXES[file.suffix]
    package = folder.parent.name if folder.name == kind else folder.name
    package = re.sub(r"[^a-z0-9_]", "_", package.lower()).strip("_")
    name = f"{package}/{kind}/{file.stem}"
    dds_name(name)
    return name


def on_path(name: str) -> str:
    """Return the text of a type that is below a folder of HFG_ROS_PATH.

    Raises:
      UsageError: it is not, or cannot be read.
    """
    package, kind, short = name.split("/")
    folders = [Path(one) for one in os.environ.get("HFG_ROS_PATH", "").split(os.pathsep) if one]
    file = Path(package, kind, f"{short}.{kind}")
    for folder in folders:
        if (folder / file).is_file():
            return _read(folder / file)
    where = f"below {' or '.join(map(str, folders))}" if folders else "and HFG_ROS_PATH names no folder to look in"
    raise UsageError(f'the type "{name}" is unknown: there is no {file} {where}')


def _read(file: Path) -> str:
    try:
        with file.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
        text = data.decode()
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read {file}: {getattr(error, 'strerror', None) or 'it is not UTF-8'}") from None
    if len(data) > _MOST_BYTES:
        raise UsageError(f"{file} has more than {_MOST_BYTES:,} bytes")
    return text

"""The user's part of a traceback: without frames of hfg and of the libraries between hfg and node code.

No dependencies.
"""

from __future__ import annotations

import traceback
from pathlib import Path
from types import TracebackType
from typing import Final

_OURS: Final = str(Path(__file__).resolve().parent.parent)
_STANDARD: Final = str(Path(traceback.__file__).parent)
_MACHINERY: Final = (
    "asyncio",
    "importlib",
    "runpy.py",
    "<frozen importlib",
    "<frozen runpy",
    "<hfg region",
    "concurrent/futures",
    "threading.py",
    "typer",
)


def is_ours(file: str) -> bool:
    """Return whether a frame of this file is hfg's own."""
    return file.startswith(_OURS)


def is_standard(file: str) -> bool:
    """Return whether a frame of this file belongs to Python's standard library."""
    return file.startswith(f"{_STANDARD}/") and "site-packages" not in file


def is_machinery(file: str) -> bool:
    """Return whether a frame of this file is of no use to users."""
    inside = file.removeprefix(f"{_STANDARD}/").replace("\\", "/")
    return is_ours(file) or ((inside != file or file.startswith("<")) and inside.startswith(_MACHINERY))


def users_part(found: TracebackType | None) -> TracebackType | None:
    """Return a traceback with only the user's frames, for a log record or an error that is shown."""
    kept: list[TracebackType] = []
    while found is not None:
        if not is_machinery(found.tb_frame.f_code.co_filename):
            kept.append(found)
        found = found.tb_next
    result: TracebackType | None = None
    for one in reversed(kept):
        result = TracebackType(result, one.tb_frame, one.tb_lasti, one.tb_lineno)
    return result

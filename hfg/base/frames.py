"""Which part of a traceback is the user's: without the frames of hfg and of what lies between it and node code.

Stands on nothing.
"""

from __future__ import annotations

import traceback
from pathlib import Path
from types import TracebackType
from typing import Final

__all__ = ["is_machinery", "is_ours", "is_standard", "users_part"]

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
    """Whether a frame of this file is hfg's own."""
    return file.startswith(_OURS)


def is_standard(file: str) -> bool:
    """Whether a frame of this file is one of Python's own library."""
    return file.startswith(f"{_STANDARD}/") and "site-packages" not in file


def is_machinery(file: str) -> bool:
    """Whether a frame of this file tells a user nothing."""
    inside = file.removeprefix(f"{_STANDARD}/").replace("\\", "/")
    return is_ours(file) or ((inside != file or file.startswith("<")) and inside.startswith(_MACHINERY))


def users_part(found: TracebackType | None) -> TracebackType | None:
    """Give a traceback of the user's frames alone, for a log record or an error that is shown."""
    kept: list[TracebackType] = []
    while found is not None:
        if not is_machinery(found.tb_frame.f_code.co_filename):
            kept.append(found)
        found = found.tb_next
    result: TracebackType | None = None
    for one in reversed(kept):
        result = TracebackType(result, one.tb_frame, one.tb_lasti, one.tb_lineno)
    return result

"""Loads a file of Python only from its text, and says where other users could put code (rule L5).

Python takes the bytecode in `__pycache__` for that of a file if the time and size in it are right. In a folder like
/tmp, another user can make that folder first, and so decide what a file of ours does. No dependencies.
"""

from __future__ import annotations

import importlib.util
import stat
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType

from typing_extensions import override


class _FromText(SourceFileLoader):
    """Neither reads nor writes bytecode."""

    @override
    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        code: CodeType = self.source_to_code(self.get_data(path), path)
        return code


def spec_of_file(name: str, file: Path | str) -> ModuleSpec:
    """Return how a file is imported under a name."""
    spec = importlib.util.spec_from_file_location(name, file, loader=_FromText(name, str(file)))
    assert spec is not None
    return spec


def is_open_to_all(folder: Path) -> bool:
    """Say whether every user may put files into a folder, as into /tmp."""
    try:
        return bool(folder.stat().st_mode & stat.S_IWOTH)
    except OSError:
        return False

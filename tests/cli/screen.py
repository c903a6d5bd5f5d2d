"""A terminal as one sees it, as far as hfg speaks to it."""

from __future__ import annotations

import io
import re

__all__ = ["Screen"]


class Screen(io.StringIO):
    """Takes what is written and shows what stands there; only as wide as it is told, and it wraps."""

    def __init__(self, columns: int = 80) -> None:
        super().__init__()
        self.columns = columns
        self.rows = [""]
        self.row = 0
        self.column = 0
        self.is_gone = False

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        if self.is_gone:
            raise OSError(5, "Input/output error")
        for part in re.findall(r"\x1b\[\d*[A-Za-z]|[^\x1b]", text):
            self._take(part)
        return len(text)

    def _take(self, part: str) -> None:
        if part == "\n":
            self.row, self.column = self.row + 1, 0
        elif part == "\r":
            self.column = 0
        elif part.endswith("A") and len(part) > 1:
            self.row -= int(part[2:-1])
            assert self.row >= 0, "above the top"
        elif part.endswith("G") and len(part) > 1:
            self.column = int(part[2:-1]) - 1
        elif part == "\x1b[K":
            self.rows[self.row] = self.rows[self.row][: self.column]
        elif part == "\x1b[J":
            self.rows[self.row] = self.rows[self.row][: self.column]
            del self.rows[self.row + 1 :]
        elif not part.startswith("\x1b"):
            if self.column == self.columns:
                self.row, self.column = self.row + 1, 0
                self._grow()
            line = self.rows[self.row].ljust(self.column)
            self.rows[self.row] = line[: self.column] + part + line[self.column + 1 :]
            self.column += 1
        self._grow()

    def _grow(self) -> None:
        while len(self.rows) <= self.row:
            self.rows.append("")

    @property
    def shown(self) -> list[str]:
        """The rows from the top, without empty ones at the end."""
        return "\n".join(self.rows).rstrip("\n").split("\n")

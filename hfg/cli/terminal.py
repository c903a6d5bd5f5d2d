"""Lines at the foot of a terminal that change in place, below whatever else is printed meanwhile.

Text for standard output and standard error appears exactly as it was written, above the lines. Nothing is left
to restore when the process dies: the cursor stays as it is, and there is no second screen. Depends on `controls`.
"""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TextIO

from rich.cells import cell_len

from hfg.base import controls


def is_terminal(*streams: TextIO) -> bool:
    """Whether all of them go to a terminal that can move its cursor."""
    dumb = os.environ.get("TERM", "dumb" if os.name == "posix" else "") in ("dumb", "unknown")
    return not dumb and all(controls.is_terminal(stream) for stream in streams)


class Foot:
    """Draws lines at the foot of a terminal, again and again.

    When the terminal goes away, drawing stops without an error.

    Attributes:
      coloured: whether colours are welcome there (https://no-color.org).
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._lines: Sequence[str] = ()
        self._widths: list[int] = []
        self._gone = False
        self._part = ""  # of a line that was not ended; the drawn lines are below it
        self._in_a_line = False  # it may be a prompt: the lines wait. If more of it comes, it is not a prompt
        self._lock = threading.RLock()
        self.coloured = not os.environ.get("NO_COLOR")

    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        try:
            columns, rows = os.get_terminal_size(self._stream.fileno())
        except (OSError, ValueError):
            columns, rows = 0, 0
        return columns or 80, rows or 24

    def is_ready(self) -> bool:
        """Whether drawing would come out now; a terminal that is held (Ctrl-S) would hold us too."""
        if self._gone or self._in_a_line:
            return False
        try:
            return bool(select.select((), (self._stream,), (), 0)[1])
        except (OSError, ValueError):
            return os.name != "posix"  # where select is only for sockets

    def draw(self, lines: Sequence[str], widths: list[int] | None = None) -> None:
        """Show these lines in place of those before, each no wider than the terminal."""
        with self._lock:
            if self._gone or self._in_a_line:
                return
            over = "".join(f"{line}\x1b[K\n" for line in lines)
            begin = self._up() if self._lines or not self._part else "\n"
            self._write(f"{begin}{over}\x1b[J")
            self._lines = lines
            self._widths = [cell_len(line) for line in lines] if widths is None else widths

    def clear(self) -> None:
        """Take the lines away."""
        with self._lock:
            if self._lines:
                column = cell_len(self._part) % self.size()[0]
                back = f"\x1b[1A\x1b[{column + 1}G" if self._part else ""
                self._write(f"{self._up()}\x1b[J{back}")
                self._lines = ()

    def leave(self) -> None:
        """Remove the lines permanently, without waiting long for a thread that draws."""
        if self._lock.acquire(timeout=0.1):
            try:
                self.clear()
            finally:
                self._lock.release()
        self._gone = True

    @contextmanager
    def beneath(self) -> Iterator[None]:
        """Inside the block, keep the lines below what is written to standard output and standard error."""
        before = sys.stdout, sys.stderr
        above = [_Above(self, stream) for stream in before]
        sys.stdout, sys.stderr = above
        try:
            yield
        finally:
            sys.stdout, sys.stderr = before
            self.clear()
            for stream in above:
                stream.flush()

    def above(self, stream: TextIO, text: str) -> None:
        """Write this above the lines."""
        with self._lock:
            lines, widths = self._lines, self._widths
            self.clear()
            stream.write(text)
            stream.flush()
            _, newline, part = text.rpartition("\n")
            more_of_it = bool(self._part) and not newline
            self._part = (part if newline else self._part + part).rpartition("\r")[2]
            self._in_a_line = bool(self._part) and (not more_of_it or not self._part.isprintable())
            if lines:
                self.draw(lines, widths)

    def _up(self) -> str:
        """Go to the first line; in a terminal that was made narrower they take more rows than were written."""
        if not self._lines:
            return ""
        columns, _ = self.size()
        rows = sum(max(1, -(-width // columns)) for width in self._widths)
        return f"\r\x1b[{rows}A"

    def _write(self, text: str) -> None:
        if self._gone:
            return
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            self._gone = True


class _Above:
    """Stands in for a stream while lines are at the foot: whole lines go through at once."""

    def __init__(self, foot: Foot, stream: TextIO) -> None:
        self._foot = foot
        self._stream = stream
        self._part = ""
        self._lock = threading.Lock()

    def write(self, text: str) -> int:
        with self._lock:
            whole, newline, self._part = (self._part + text).rpartition("\n")
            if newline:
                self._foot.above(self._stream, whole + newline)
        return len(text)

    def writelines(self, lines: Any) -> None:
        self.write("".join(lines))

    def flush(self) -> None:
        with self._lock:
            part, self._part = self._part, ""
            if part:
                self._foot.above(self._stream, part)
            else:
                self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

"""What nodes print for people."""

from __future__ import annotations

import sys

from hfg.base.controls import escaped, is_terminal


def print_line(text: str, *, error: bool = False) -> None:
    """Write a line to the program's output, whatever letters its terminal knows; a terminal is not steered by it."""
    stream = sys.stderr if error else sys.stdout
    if is_terminal(stream):
        text = escaped(text)
    try:
        stream.write(text + "\n")
    except UnicodeError:
        stream.write(text.encode("ascii", "backslashreplace").decode() + "\n")
    stream.flush()

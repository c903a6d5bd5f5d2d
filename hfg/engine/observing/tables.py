"""Numbers of a run as a table of text, for `print`. Knows nothing of what the numbers mean."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

__all__ = ["seconds", "table"]


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table. Columns after the first are aligned right; empty ones are left out."""
    cells = [[_text(cell) for cell in row] for row in rows]
    shown = [index for index in range(len(columns)) if index == 0 or any(row[index] for row in cells)]
    lines = [[columns[index] for index in shown], *([row[index] for index in shown] for row in cells)]
    widths = [max(len(line[place]) for line in lines) for place in range(len(shown))]
    return [
        "  ".join(
            cell.ljust(width) if place == 0 else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]


def seconds(value: float) -> str:
    """Return a duration as people read it, without the noise of floats."""
    return f"{value:.6g} s"


def _text(cell: object) -> str:
    if cell is True:
        return "yes"
    if cell is False or cell == 0:
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)

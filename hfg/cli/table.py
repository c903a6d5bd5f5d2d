"""The live table of a run's nodes: glances in, lines of text out. Depends on the `Glance` of the engine; draws nothing.

fetch  running  12.3 s  5 nodes  3 errors
active  search
busy  loop 3 %  camera 81 %
node      rate  busy  queue  active  errors  now
camera    29.9  81 %      0                  working
...
"""

from __future__ import annotations

from collections import deque
from typing import Final, NamedTuple

from rich.cells import cell_len, set_cell_size

from hfg.base.bars import bar
from hfg.engine import Glance, MonitorGlance, NodeGlance

_OVER_S: Final = 1.0
_NARROWEST_PATH: Final = 10
_FEWEST_ROWS: Final = 3  # before them the groups and who is active leave
_BOLD, _DIM, _GREEN, _RED = "1", "2", "32", "31"


class Row(NamedTuple):
    """The values of one node in the table.

    Attributes:
      rate_hz: firings and calls a second of the run's clock, over the last second.
      busy_share: of the machine's last second, for how much its code kept its group busy.
      budget: the share of its deadline that the oldest data had used up when it was done; None without a deadline.
    """

    path: str
    group: str
    rate_hz: float
    busy_share: float
    queued: int
    active: bool
    errors: int
    doing: str
    fused: bool
    budget: float | None = None


class _Column(NamedTuple):
    title: str
    width: int
    importance: int  # the least important leave first where there is no room


_COLUMNS: Final = (
    _Column("rate", 6, 9),
    _Column("busy", 5, 8),
    _Column("queue", 5, 6),
    _Column("budget", 10, 5),
    _Column("active", 6, 7),
    _Column("fused", 5, 3),
    _Column("errors", 6, 5),
    _Column("now", 14, 4),
)


class View:
    """Makes a table of the newest glance and those of the second before it."""

    def __init__(self) -> None:
        self._glances: deque[tuple[Glance, dict[str, NodeGlance]]] = deque()

    def look(self, glance: Glance) -> None:
        """Take in a new glance."""
        glances = self._glances
        glances.append((glance, {node.path: node for node in glance.nodes}))
        while len(glances) > 2 and glances[1][0].machine_s <= glance.machine_s - _OVER_S:
            glances.popleft()

    @property
    def has_rates(self) -> bool:
        """Whether each node was seen at two times: the first glance lacks those of other processes."""
        new, _ = self._glances[-1]
        return bool(new.nodes) and all(
            new.machine_s - node.age_s > old.machine_s - then.age_s
            for node in new.nodes
            for old, then in (self._first(node),)
        )

    def _first(self, node: NodeGlance) -> tuple[Glance, NodeGlance]:
        """Return the oldest glance at a node."""
        return next((old, before[node.path]) for old, before in self._glances if node.path in before)

    def rows(self) -> list[Row]:
        """The rows of all nodes, in order of adding; with only one glance, nothing has a rate yet."""
        new, _ = self._glances[-1]
        rows = []
        for node in new.nodes:
            old, then = self._first(node)
            newer_s = then.age_s - node.age_s  # counts of another process are older than the glance
            seconds, machine_s = (new.duration_s - old.duration_s + newer_s, new.machine_s - old.machine_s + newer_s)
            done, busy_s = node.done - then.done, node.busy_s - then.busy_s
            rows.append(
                Row(
                    node.path,
                    node.group,
                    done / seconds if done > 0 and seconds > 0 else 0.0,
                    min(1.0, busy_s / machine_s) if busy_s > 0 and machine_s > 0 else 0.0,
                    node.queued,
                    node.active,
                    node.failed,
                    node.doing,
                    node.fused,
                    node.oldest_s / node.deadline_s if node.deadline_s > 0 else None,
                )
            )
        return rows

    def lines(self, columns: int, height: int, *, coloured: bool = False) -> list[str]:
        """Draw the table into the columns and rows of a terminal.

        Where there is no room for all nodes the busiest are shown, and how many are not.
        """
        rows = self.rows()
        width, height = max(columns - 1, 4), max(height - 1, 1)  # a full last column or row makes terminals scroll
        paint = _Paint(width, coloured)
        head = self._head(rows, paint)
        lines = head if height > len(head) + _FEWEST_ROWS else head[:1]
        room = height - len(lines) - 1
        if room > 0 and rows:
            shown = rows
            if len(rows) > room:
                shown = sorted(rows, key=lambda row: -round(row.busy_share, 2))[: room - 1]
            lines += _body(shown, rows, paint)
            if len(shown) < len(rows):
                lines.append(paint(f"… {len(rows) - len(shown)} more, less busy", _DIM))
        return lines

    def _head(self, rows: list[Row], paint: _Paint) -> list[str]:
        glance = self._glances[-1][0]
        errors = sum(row.errors for row in rows)
        told = [glance.graph, glance.outcome, f"{glance.duration_s:.1f} s", _count(len(rows), "node")]
        if glance.lost:
            told.append(_count(glance.lost, "token") + " lost with processes")
        lines = [paint("  ".join([*told, *([_count(errors, "error")] if errors else [])]), _BOLD)]
        if glance.growing:
            grown = (f"{label} to {capacity}" for label, capacity in glance.growing.items())
            lines.append(paint("queues of rings grow:  " + "  ".join(grown), _BOLD))
        if glance.monitors:
            broken = any(one.violations for one in glance.monitors)
            lines.append(paint("monitors  " + "  ".join(map(_judged, glance.monitors)), _RED if broken else ""))
        active = [row.path for row in rows if row.active]
        if active:
            lines.append(paint("active  " + "  ".join(active), _GREEN))
        groups: dict[str, float] = {}
        for row in rows:
            groups[row.group] = groups.get(row.group, 0.0) + row.busy_share
        lines.append(paint("busy  " + "  ".join(f"{name} {_percent(min(1.0, groups[name]))}" for name in groups)))
        return lines


class _Paint:
    """Cuts a line to the width and colours it."""

    def __init__(self, width: int, coloured: bool) -> None:
        self.width = width
        self._coloured = coloured

    def __call__(self, text: str, style: str = "") -> str:
        clean = text if text.isprintable() else "".join(sign if sign.isprintable() else "?" for sign in text)
        cut = clean if cell_len(clean) <= self.width else set_cell_size(clean, self.width - 1) + "…"
        return f"\x1b[{style}m{cut}\x1b[0m" if self._coloured and style else cut


def _body(shown: list[Row], rows: list[Row], paint: _Paint) -> list[str]:
    """The titles and a line for each row, in as many columns as there is room for."""
    longest = max(cell_len(row.path) for row in rows)
    absent = {"errors"} if not any(row.errors for row in rows) else set()
    absent |= {"budget"} if all(row.budget is None for row in rows) else set()
    absent |= {"fused"} if not any(row.fused for row in rows) else set()
    columns = [column for column in _COLUMNS if column.title not in absent]
    while columns:
        path_width = paint.width - sum(column.width + 2 for column in columns)
        if path_width >= min(longest, _NARROWEST_PATH):
            break
        columns.remove(min(columns, key=lambda column: column.importance))
    path_width = max(4, min(longest, paint.width - sum(column.width + 2 for column in columns)))
    titles = "".join(f"  {_aligned(column.title, column)}" for column in columns)
    lines = [paint(f"{'node':{path_width}}{titles}".rstrip(), _DIM)]
    for row in shown:
        cells = _cells(row)
        line = _path(row.path, path_width) + "".join(f"  {_aligned(cells[one.title], one)}" for one in columns)
        lines.append(paint(line.rstrip(), _RED if row.errors else _GREEN if row.active else ""))
    return lines


def _cells(row: Row) -> dict[str, str]:
    return {
        "rate": _number(row.rate_hz),
        "busy": _percent(row.busy_share),
        "queue": str(row.queued) if row.queued else "",
        "budget": "" if row.budget is None else _budget(row.budget),
        "active": "yes" if row.active else "",
        "fused": "yes" if row.fused else "",
        "errors": str(row.errors) if row.errors else "",
        "now": row.doing,
    }


def _aligned(text: str, column: _Column) -> str:
    if column.title in ("now", "active", "fused"):
        return text[: column.width].ljust(column.width)
    return text.rjust(column.width)


def _path(path: str, width: int) -> str:
    """The end of a path says more than its beginning."""
    if cell_len(path) <= width:
        return set_cell_size(path, width)
    while cell_len(path) > width - 1:
        path = path[1:]
    return set_cell_size("…" + path, width)


def _number(value: float) -> str:
    if value >= 999.5:
        return f"{value / 1000:.1f}k" if value < 99_950 else f"{value / 1000:.0f}k"
    return f"{value:.0f}" if value >= 99.5 or value == 0 else f"{value:.1f}"


def _budget(used: float) -> str:
    return f"{bar(used, 4)} {_percent(min(used, 9.99))}"


def _judged(monitor: MonitorGlance) -> str:
    times = f" {monitor.violations} times" if monitor.violations > 1 else ""
    return f"{monitor.name} {monitor.verdict}{times}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"

"""A comparison as a page: tables, and the activity of both sides one below the other. Depends on `comparing`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from hfg.comparing.comparing import ActivityRow, Comparison, said_of
from hfg.graph.drawing.text import escaped
from hfg.reporting.html import plain_page
from hfg.reporting.sections import Sections

_MOST_ROWS: Final = 2000
_MOST_NODES: Final = 300
_WIDTH, _LABEL, _ROW, _AXIS = 1000.0, 260.0, 24.0, 18.0
_STYLE: Final = (
    "<style>text{font:12px system-ui,sans-serif;fill:#333}.a{fill:#1f6feb}.b{fill:#c2410c}.axis{stroke:#999}"
    ".differs{font-weight:600}@media(prefers-color-scheme:dark){text{fill:#ddd}.a{fill:#79b8ff}.b{fill:#ff8a4c}}</style>"
)


def page(found: Comparison) -> str:
    """Return the comparison as HTML."""
    a, b = found.sides
    title = f"{a.name} and {b.name}"
    sections = Sections(f"the comparison of {title}")
    heads = ("", f"A: {a.name}", f"B: {b.name}")
    rows = [
        ("outcome", a.outcome, b.outcome),
        *([("why", a.why, b.why)] if a.why or b.why else []),
        ("duration (s)", str(a.duration_s), str(b.duration_s)),
    ]
    sections.add_table("Both runs", heads, rows)
    if not found.differs:
        sections.add_text("Both runs", "Nothing differs.")
    if found.scores:
        sections.add_table(
            "Scores",
            ("score", "A", "B", "B - A", "of runs"),
            [(row.name, str(row.a), str(row.b), str(row.change), row.change.runs) for row in found.scores],
        )
    _add_tokens(sections, found)
    if found.activity:
        _add_activity(sections, found.activity, found.duration_s)
    if found.counts:
        counts = [(row.what, _number(row.a), _number(row.b)) for row in found.counts]
        _add_rows(sections, "Counts that differ", ("what", "A", "B"), counts)
    if found.graph:
        lines = [(f"only in {'A' if one[0] == '-' else 'B'}", one[2:]) for one in found.graph]
        _add_rows(sections, "Graphs", ("where", "command"), lines)
    if found.notes:
        _add_rows(sections, "Not compared", ("what",), [(note,) for note in found.notes])
    return plain_page(title, sections.sections())


def _number(count: int | None) -> str:
    return "none" if count is None else f"{count:,}"


def _add_rows(sections: Sections, name: str, heads: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    sections.add_table(name, heads, rows[:_MOST_ROWS])
    if len(rows) > _MOST_ROWS:
        sections.add_text(name, f"The table has the first {_MOST_ROWS:,} of {len(rows):,} rows.")


def _add_tokens(sections: Sections, found: Comparison) -> None:
    if found.ports is None:
        return
    name, first = "Tokens", found.first
    if first is None:
        sections.add_text(name, "All tokens are equal.")
    else:
        over = f", over {', '.join(first.edges)}" if first.edges else ""
        sections.add_text(name, f'The first that differs is token {first.turn} of "{first.port}"{over}.')
        sections.add_table(name, ("side", "token"), [("A", said_of(first.a)), ("B", said_of(first.b))])
    rows = [(one.port, one.a, one.b, one.differs_at or "equal") for one in found.ports]
    _add_rows(sections, name, ("port", "tokens of A", "tokens of B", "first that differs"), rows)


def _add_activity(sections: Sections, rows: Sequence[ActivityRow], duration_s: float) -> None:
    name = "Who was active, and when"
    shown = sorted(rows, key=lambda row: row.differs_at_s is None)[:_MOST_NODES]
    caption = "A above, B below. Names of nodes whose activity differs are bold."
    if len(rows) > len(shown):
        caption += f" These are {len(shown)} of {len(rows)} nodes."
    sections.add_picture(name, _drawn(shown, duration_s), caption=caption)


def _drawn(rows: Sequence[ActivityRow], duration_s: float) -> str:
    height = _AXIS + len(rows) * _ROW + 4
    scale = (_WIDTH - _LABEL - 10) / max(duration_s, 1e-9)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH:g} {height:g}" width="{_WIDTH:g}" '
        f'height="{height:g}">{_STYLE}'
    ]
    for tick in range(6):
        x = _LABEL + (_WIDTH - _LABEL - 10) * tick / 5
        parts.append(f'<path class="axis" d="M{x:.1f} {_AXIS - 4:g}V{height:g}" stroke-opacity=".4"/>')
        anchor = ' text-anchor="end"' if tick == 5 else ""
        parts.append(f'<text x="{x + 2:.1f}" y="11"{anchor}>{duration_s * tick / 5:.4g} s</text>')
    for index, row in enumerate(rows):
        y = _AXIS + index * _ROW
        kind = "" if row.differs_at_s is None else ' class="differs"'
        label = row.node if len(row.node) <= 38 else "…" + row.node[-37:]
        parts.append(f'<text{kind} x="4" y="{y + 15:g}">{escaped(label)}</text>')
        for side, spans, top in (("a", row.a, y + 2), ("b", row.b, y + 12)):
            parts += [
                f'<rect class="{side}" x="{_LABEL + begin * scale:.2f}" y="{top:g}" '
                f'width="{max((end - begin) * scale, 1):.2f}" height="9"/>'
                for begin, end in spans
            ]
    return "".join(parts) + "</svg>"

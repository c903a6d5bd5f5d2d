"""A report as text: one HTML file that contains everything.

Names chosen by users are always text, never markup: they are escaped here, and the script sets them as text. The page's
content policy forbids it to load anything. Depends on `observing`, the engine's reports and the drawing.
"""

from __future__ import annotations

import base64
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

import msgspec

from hfg.engine import Report, Statistics
from hfg.errors import HfgError
from hfg.graph import Graph
from hfg.graph.drawing.text import escaped
from hfg.monitors.watching import Monitors
from hfg.reporting.drawn import Drawn
from hfg.reporting.judged import budgets_section, monitors_section
from hfg.reporting.observing import MOST_NODES, SPANS, Observed
from hfg.reporting.pictures import png

_MOST_ROWS: Final = 2000  # rows of a table
_RULES: Final = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; media-src data:"
)


class Page:
    """The page of a run; written once.

    Args:
      graph: the graph in its current state.
      drawn: the graph and its states, drawn.
      observed: the observations of the run.
      report: the run's report.
      statistics: times and depths.
      error: the error that the run failed with.
      outcome: how it ended; None while it runs.
      when: seconds since 1970 at its start; None in virtual time, so that equal runs have equal pages.
      own: sections that users have added, as HTML.
      refused: why nodes cannot be fused, by path (`Run.explain`).
      judged: the monitors of the run.
    """

    def __init__(
        self,
        graph: Graph,
        drawn: Drawn,
        observed: Observed,
        report: Report,
        statistics: Statistics,
        error: HfgError | None,
        outcome: str | None,
        when: float | None,
        own: Sequence[str] = (),
        refused: Mapping[str, str] | None = None,
        judged: Sequence[Monitors] = (),
    ) -> None:
        self.graph, self.drawn, self.own, self.refused = graph, drawn, own, refused or {}
        self.observed, self.report, self.statistics = observed, report, statistics
        self.error, self.when, self.judged = error, when, judged
        self.outcome = outcome or "still running"
        self.begun_at = observed.begun_at or 0.0
        self.notes: list[str] = []  # what the page leaves out

    def text(self) -> str:
        """Return the page as HTML."""
        return "".join(self._pieces())

    def _pieces(self) -> Iterator[str]:
        body = [
            *self._clock(),
            *self.own,
            *self._drawing(),
            *self._states(),
            *self._timeline(),
            *monitors_section(self.judged, self.begun_at, self.report.duration_s),
            *self._errors(),
            *budgets_section(self.graph, self.statistics),
            *self._pictures(),
            *self._nodes(),
            *self._edges(),
            *self._groups(),
        ]
        yield from _head(f"Run of {self.graph.name}")
        yield from self._summary()
        yield "</header>\n<main>\n"
        yield from body
        yield from self._left_out()
        yield f'</main>\n<script type="application/json" id="data">{_json(self._data())}</script>\n'
        yield f"<script>\n{_file('tables.js')}{_file('page.js')}</script>\n</body>\n</html>\n"

    # --- how it went

    def _summary(self) -> Iterator[str]:
        kind = "good" if self.outcome in ("done", "stopped", "until", "still running") else "bad"
        facts = [
            ("duration", _seconds(self.report.duration_s)),
            ("firings", f"{self.report.firings:,}"),
            ("nodes", str(len(self.report.nodes))),
            ("edges", str(len(self.report.edges))),
        ]
        if self.report.lost_activity:
            facts.append(("activity lost", f"{self.report.lost_activity} times"))
        facts += [(f"dropped, {reason}", f"{count:,}") for reason, count in sorted(self.observed.dropped.items())]
        if self.when is not None:
            facts.append(("begun", time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(self.when))))
        yield f'<p class="outcome {kind}">{escaped(self.outcome)}</p>\n<dl class="facts">\n'
        for name, value in facts:
            yield f"<div><dt>{escaped(name)}</dt><dd>{escaped(value)}</dd></div>\n"
        yield "</dl>\n"
        if self.error is not None:
            yield f'<pre class="error">{escaped(str(self.error))}</pre>\n'

    def _errors(self) -> Iterator[str]:
        errors = self.observed.errors
        shown = [said for _, _, said in errors]  # the table already has most of the report's text
        told = [one for one in self.report.errors[:_MOST_ROWS] if not any(said in one for said in shown)]
        if not errors and not told:
            return
        yield '<section id="errors"><h2>Errors</h2>\n'
        rows = [((at, _seconds(at - self.begun_at)), (node, node), (said, said)) for at, node, said in errors]
        if rows:
            yield from _table("errors", ("time", "node", "what"), rows)
        if self.observed.more_errors:
            self.notes.append(f"{self.observed.more_errors:,} more errors after the first {len(errors)}")
        for sentence in told:
            yield f"<pre>{escaped(sentence)}</pre>\n"
        yield "</section>\n"

    # --- who was active when

    def _clock(self) -> Iterator[str]:
        yield '<div class="bar" id="clock"><button type="button" id="before" title="the change before">◀</button>'
        yield '<input type="range" id="time" min="0" max="1" step="any" value="1" aria-label="time">'
        yield '<button type="button" id="after" title="the next change">▶</button> '
        yield '<output id="now"></output> <span id="who"></span></div>\n'

    def _drawing(self) -> Iterator[str]:
        self.notes += self.drawn.left_out
        if self.observed.edits:
            count = self.observed.edits
            times = "once" if count == 1 else f"{count:,} times"
            self.notes.append(f"the graph was changed {times}; the drawing shows its final state")
        yield '<section id="drawing"><h2>The graph</h2>\n<div class="bar">'
        yield '<span class="right"><button type="button" id="fit">fit</button> '
        yield '<button type="button" id="smaller">-</button> <button type="button" id="larger">+</button>'
        yield '</span></div>\n<div class="picture" id="graph">'
        yield self.drawn.graph
        yield "</div>\n"
        if self.refused:
            yield "<p>Tinted nodes cannot be fused with others; the table of nodes says why.</p>\n"
        yield "</section>\n"

    def _states(self) -> Iterator[str]:
        if self.drawn.states:
            yield '<section id="states" class="own"><h2>The states</h2>\n<div class="picture">'
            yield self.drawn.states
            yield "</div>\n"
            yield from (f'<p class="caption">{escaped(said)}</p>\n' for said in self.drawn.said)
            yield "</section>\n"

    def _timeline(self) -> Iterator[str]:
        joined = sum(times.joined for times in self.observed.times.values())
        if joined:
            self.notes.append(f"{joined:,} times of activity are merged with the preceding ones")
        for what, kept in (("active", self.observed.times), ("at work", self.observed.rows.counts)):
            if len(kept) >= MOST_NODES:
                self.notes.append(f"when further nodes were {what}: only {MOST_NODES:,} are kept")
        yield '<section id="timeline"><h2>Who was active, and when</h2>\n<div class="bar">'
        yield '<button type="button" id="whole">whole run</button> <button type="button" id="out">-</button> '
        yield '<button type="button" id="in">+</button> '
        yield '<label><input type="checkbox" id="all"> firings of every node</label></div>\n'
        yield '<div class="rows"><canvas id="rows" role="img" aria-label="A row for each node that was ever active '
        yield "with its active times, and one for each group with how often its nodes fired; the tables below have "
        yield 'the sums"></canvas></div>\n</section>\n'

    def _data(self) -> dict[str, Any]:
        now, begun = self.observed.now, self.begun_at
        duration = max(now - begun, self.report.duration_s, 0.0)
        active = [
            {"path": path, "spans": [(round(a - begun, 6), round(b - begun, 6)) for a, b in times.until(now)]}
            for path, times in self.observed.times.items()
        ]
        used = min(int(duration / self.observed.rows.span_s) + 1, 2 * SPANS)
        return {
            "duration": duration,
            "active": [one for one in active if one["spans"]],
            "span": self.observed.rows.span_s,
            "counts": {path: list(row[:used]) for path, row in self.observed.rows.counts.items()},
            "groups": {path: one.group for path, one in self.statistics.nodes.items()},
            "refused": self.refused,
        }

    # --- tables and pictures

    def _nodes(self) -> Iterator[str]:
        rows = []
        duration = self.report.duration_s
        for path, one in self.statistics.nodes.items():
            times = self.observed.times.get(path)
            active = 0.0 if times is None else times.total_until(self.observed.now)
            busy, latency, counts = one.busy, one.latency, (one.firings, one.silent, one.calls, one.failed)
            rows.append(
                (
                    (path, path),
                    (one.group, one.group),
                    *((count, f"{count:,}" if count else "") for count in counts),
                    (active, f"{_seconds(active)} ({active / duration:.0%})" if active and duration else ""),
                    (busy.mean_s, _seconds(busy.mean_s) if busy.count else ""),
                    (busy.total_s, _seconds(busy.total_s) if busy.count else ""),
                    (latency.p99_s, _seconds(latency.p99_s) if latency.count else ""),
                    (one.queued, str(one.queued) if one.queued else ""),
                    (one.doing, one.doing),
                    *([(self.refused.get(path, ""),) * 2] if self.refused else []),
                )
            )
        heads = (
            *("node", "group", "firings", "silent", "calls", "failed", "active", "mean", "busy", "latency, 99 %"),
            *("queued", "in the end"),
            *(["not fused because"] if self.refused else []),
        )
        yield '<section id="nodes"><h2>Nodes</h2>\n'
        yield from _table("nodes", heads, self._most("nodes", rows))
        yield "</section>\n"

    def _edges(self) -> Iterator[str]:
        rows = [
            (
                (label, label),
                *(
                    (count, f"{count:,}" if count else "")
                    for count in (one.sent, one.dropped, one.drained, one.untaken, one.deepest, one.grown)
                ),
            )
            for label, one in self.statistics.edges.items()
        ]
        yield '<section id="edges"><h2>Edges</h2>\n'
        heads = ("edge", "sent", "dropped", "drained", "untaken", "deepest", "grown")
        yield from _table("edges", heads, self._most("edges", rows))
        yield "</section>\n"

    def _groups(self) -> Iterator[str]:
        rows = [
            (
                (name, name),
                *((count, f"{count:,}") for count in (one.nodes, one.firings, one.calls)),
                (one.busy_s, _seconds(one.busy_s)),
                (one.busy_share, f"{one.busy_share:.0%}"),
            )
            for name, one in self.statistics.groups.items()
        ]
        yield '<section id="groups"><h2>Groups</h2>\n'
        yield from _table("groups", ("group", "nodes", "firings", "calls", "busy", "busy share"), rows)
        yield "</section>\n"

    def _most(self, what: str, rows: list[Any]) -> list[Any]:
        if len(rows) > _MOST_ROWS:
            self.notes.append(f"the table of {what} has the first {_MOST_ROWS:,} of {len(rows):,}")
        return rows[:_MOST_ROWS]

    def _pictures(self) -> Iterator[str]:
        gallery = self.observed.gallery
        if gallery is None or not gallery.by_port:
            return
        yield '<section id="pictures"><h2>Pictures</h2>\n'
        for port, kept in gallery.by_port.items():
            seen = gallery.seen[port]
            yield f'<h3>{escaped(port)}</h3>\n<p>{len(kept)} of {seen:,}</p>\n<div class="gallery">\n'
            for at, image in kept:
                since = at - self.begun_at
                data = base64.b64encode(png(image)).decode()
                says = escaped(f"{port} at {_seconds(since)}")
                yield f'<figure data-time="{since:.6f}"><img src="data:image/png;base64,{data}" alt="{says}">'
                yield f"<figcaption>{escaped(_seconds(since))}</figcaption></figure>\n"
            yield "</div>\n"
        yield "</section>\n"
        if gallery.left_out:
            self.notes.append(f"pictures of {len(gallery.left_out)} more ports")

    def _left_out(self) -> Iterator[str]:
        if self.notes:
            yield '<section id="left_out"><h2>What this page leaves out</h2>\n<ul>\n'
            yield from (f"<li>{escaped(note)}</li>\n" for note in self.notes)
            yield "</ul>\n</section>\n"


def plain_page(title: str, sections: Iterable[str]) -> str:
    """Return a page of sections that is not about one run.

    Args:
      title: on top of it.
      sections: as HTML.
    """
    script = f"<script>\n{_file('tables.js')}</script>\n</body>\n</html>\n"
    return "".join([*_head(title), "</header>\n<main>\n", *sections, "</main>\n", script])


def _head(title: str) -> Iterator[str]:
    yield '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
    yield f'<meta http-equiv="Content-Security-Policy" content="{_RULES}">\n'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
    yield f"<title>{escaped(title)}</title>\n<style>\n{_file('page.css')}</style>\n</head>\n<body>\n<header>\n"
    yield f"<h1>{escaped(title)}</h1>\n"


def _file(name: str) -> str:
    return files("hfg.reporting").joinpath(name).read_text(encoding="utf-8")


def _json(data: object) -> str:
    """Return data for a script element, escaped so that no text in it can end the element."""
    text = msgspec.json.encode(_sound(data)).decode()
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _sound(data: Any) -> Any:
    """Replace lone surrogates, which names may have and JSON may not."""
    if isinstance(data, str):
        return data.encode("utf-8", "replace").decode()
    if isinstance(data, dict):
        return {_sound(key): _sound(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_sound(one) if isinstance(one, dict | str) else one for one in data]
    return data


Cell = tuple[Any, str]
"""A cell: the value to sort by, and the text to show."""


def _table(name: str, heads: Sequence[str], rows: Iterable[Sequence[Cell]]) -> Iterator[str]:
    yield f'<div class="table"><table id="table-{name}"><thead><tr>'
    rows = list(rows)
    first = rows[0] if rows else [("", "")] * len(heads)
    for head, (by, _) in zip(heads, first, strict=True):
        kind = "" if isinstance(by, str) else ' class="number"'
        yield f'<th scope="col"{kind}><button type="button">{escaped(head)}</button></th>'
    yield "</tr></thead><tbody>\n"
    for row in rows:
        yield "<tr>"
        for by, shown in row:
            if isinstance(by, str):
                yield f"<td>{escaped(shown)}</td>"
            else:
                yield f'<td class="number" data-by="{by!r}">{escaped(shown)}</td>'
        yield "</tr>\n"
    yield "</tbody></table></div>\n"


def _seconds(duration: float) -> str:
    """Return a duration in a readable unit."""
    if duration >= 100:
        return f"{duration:,.0f} s"
    if duration >= 0.1 or duration == 0:
        return f"{duration:.3g} s"
    return f"{duration * 1e3:.3g} ms" if duration >= 1e-4 else f"{duration * 1e6:.3g} µs"

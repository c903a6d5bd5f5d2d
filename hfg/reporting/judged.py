"""What a run had to keep to, for its page: monitors with the stretches that violate them, and budgets that are used.

Depends on the monitors and the deadlines of the graph.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from hfg.engine import Statistics
from hfg.graph import Graph
from hfg.graph.drawing.text import escaped
from hfg.graph.flat import flatten
from hfg.graph.flat.deadlines import deadlines
from hfg.monitors.properties import Verdict
from hfg.monitors.violations import Violation
from hfg.monitors.watching import Monitors

_MOST_SHOWN = 10  # violations of a monitor, each with its stretch
_GOOD = (Verdict.HOLDS, Verdict.OPEN)


def monitors_section(judged: Iterable[Monitors], begun_at: float, duration_s: float) -> Iterator[str]:
    """Yield the section about monitors: a line over the run for each, and its violations; nothing if there are none.

    Args:
      judged: the monitors of the run.
      begun_at: when the run began, on its clock.
      duration_s: how long it has run.
    """
    pieces = [piece for one in judged for piece in _of(one, begun_at, duration_s)]
    if pieces:
        yield '<section id="monitors"><h2>Monitors</h2>\n'
        yield from pieces
        yield "</section>\n"


def _of(judged: Monitors, begun_at: float, duration_s: float) -> Iterator[str]:
    offset_s = judged.began - begun_at
    by_name: dict[str, list[Violation]] = {}
    for violation in judged.violations:
        by_name.setdefault(violation.monitor, []).append(violation)
    for name, verdict in judged.verdicts.items():
        found, count = by_name.get(name, []), judged.counts.get(name, 0)
        kind = "good" if verdict in _GOOD else "bad"
        times = "" if count < 2 else f", {count:,} times"
        yield f'<h3>{escaped(name)}: <span class="{kind}">{verdict.value}{times}</span></h3>\n'
        yield f"<p>{escaped(str(judged.properties[name]))}</p>\n"
        yield _line([one.after_s + offset_s for one in found], duration_s)
        for violation in found[:_MOST_SHOWN]:
            yield from _violation(violation, violation.after_s + offset_s)
        if count > _MOST_SHOWN:
            yield f"<p>and {count - _MOST_SHOWN:,} more violations</p>\n"


def _violation(violation: Violation, at_s: float) -> Iterator[str]:
    said = escaped("\n".join(str(seen) for seen in violation.stretch) or "nothing had come")
    yield f'<figure class="violation" data-time="{at_s:.6f}"><figcaption>violated at {at_s:.6g} s, after</figcaption>'
    yield f"<pre>{said}</pre></figure>\n"


def _line(violated_s: Iterable[float], duration_s: float) -> str:
    """Return a line over the run, with a mark at each violation."""
    marks = "".join(
        f'<rect class="bad" x="{min(998.0, 1000 * at_s / duration_s) if duration_s > 0 else 0.0:.1f}" width="2" '
        'height="12"/>'
        for at_s in violated_s
    )
    return (
        '<svg class="judged" viewBox="0 0 1000 12" preserveAspectRatio="none" role="img" aria-label="when it was '
        f'violated"><rect class="good" y="4" width="1000" height="4"/>{marks}</svg>\n'
    )


def budgets_section(graph: Graph, statistics: Statistics) -> Iterator[str]:
    """Yield the section about deadlines: how much of each was used; nothing if none is declared."""
    flat = flatten(graph)
    rows = [
        _budget(path, seconds, by, statistics.nodes[path].latency.max_s)
        for index, (seconds, by) in deadlines(flat).items()
        if (path := flat.nodes[index].path) in statistics.nodes and statistics.nodes[path].latency.count
    ]
    if rows:
        yield '<section id="deadlines"><h2>Deadlines</h2>\n<div class="table"><table id="table-deadlines"><thead><tr>'
        for head in ("node", "declared by", "deadline", "longest", "used", ""):
            kind = ' class="number"' if head in ("deadline", "longest", "used") else ""
            yield f'<th scope="col"{kind}><button type="button">{head}</button></th>'
        yield "</tr></thead><tbody>\n"
        yield from rows
        yield "</tbody></table></div>\n</section>\n"


def _budget(path: str, deadline_s: float, by: str, longest_s: float) -> str:
    used = longest_s / deadline_s
    cells = ((deadline_s, f"{deadline_s:g} s"), (longest_s, f"{longest_s:.3g} s"), (used, f"{used:.0%}"))
    numbers = "".join(f'<td class="number" data-by="{cell!r}">{shown}</td>' for cell, shown in cells)
    kind, width = "good" if used <= 1 else "bad", 100 * min(1.0, used)
    return (
        f"<tr><td>{escaped(path)}</td><td>{escaped(by or 'the node')}</td>{numbers}"
        '<td><svg class="judged" viewBox="0 0 100 12" preserveAspectRatio="none" role="img" '
        f'aria-label="{used:.0%} of the deadline"><rect class="whole" width="100" height="12"/>'
        f'<rect class="{kind}" width="{width:.1f}" height="12"/></svg></td></tr>\n'
    )

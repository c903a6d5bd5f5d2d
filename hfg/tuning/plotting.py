"""Drawings of a search as SVG, in light and dark: scores by candidate and by parameter, or two scores with their front.

Depends on `searching`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from hfg.graph.drawing.text import escaped
from hfg.tuning.scores import Score
from hfg.tuning.searching import Evaluation
from hfg.tuning.space import Space

_WIDTH, _HEIGHT, _GAP, _MARGIN = 420.0, 200.0, 50.0, 60.0
_MOST_PANELS: Final = 24
_STYLE: Final = (
    "<style>text{font:12px system-ui,sans-serif;fill:#333}.axis{stroke:#999;fill:none}.dot{fill:#1f6feb;"
    "fill-opacity:.55}.best{stroke:#c2410c;fill:none;stroke-width:2}.chosen{fill:#c2410c}.bad{stroke:#b91c1c}"
    "@media(prefers-color-scheme:dark){text{fill:#ddd}.dot{fill:#79b8ff}}</style>"
)

_Point = tuple[float, float]


def plot(scores: Sequence[Score], space: Space, evaluations: Sequence[Evaluation], front: Sequence[Evaluation]) -> str:
    """Return the drawing of a search as SVG.

    Args:
      scores: of the search.
      space: its parameters.
      evaluations: all candidates.
      front: those of which none is better.
    """
    panels = list(_panels(scores, space, evaluations, front))[:_MOST_PANELS]
    height = len(panels) * (_HEIGHT + _GAP) + 20
    body = "".join(
        f'<g transform="translate({_MARGIN:g} {20 + index * (_HEIGHT + _GAP):g})">{panel}</g>\n'
        for index, panel in enumerate(panels)
    )
    width = _WIDTH + _MARGIN + 20
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
        f'height="{height:g}" role="img" aria-label="scores of {len(evaluations)} candidates">\n{_STYLE}\n'
        f"{body}</svg>\n"
    )


def _panels(
    scores: Sequence[Score], space: Space, evaluations: Sequence[Evaluation], front: Sequence[Evaluation]
) -> Iterable[str]:
    good = [one for one in evaluations if not one.failed]
    bad = [float(one.number) for one in evaluations if one.failed]
    names = [score.name for score in scores]
    if len(names) > 1:
        dots = [(one.means[0].value, one.means[1].value) for one in good]
        chosen = [(one.means[0].value, one.means[1].value) for one in front]
        yield _panel(dots, names[0], names[1], chosen=chosen)
    for number, score in enumerate(scores):
        dots = [(float(one.number), one.means[number].value) for one in good]
        line, best = list[_Point](), math.inf
        for at, value in dots:
            best = min(best, score.loss(value))
            line.append((at, score.loss(best)))
        yield _panel(dots, "candidate", score.name, line=line, bad=bad)
    for tuned in space.tuned:
        if len(tuned.cells) == 1:
            cell = tuned.cells[0]
            dots = []
            for one in good:
                taken = tuned.take(one.values[tuned.path])
                if taken is not None:
                    dots.append((float(taken[0]), one.means[0].value))
            name = f"{tuned.path} (number of the choice)" if cell.options else tuned.path
            yield _panel(dots, name, names[0])


def _panel(
    dots: Sequence[_Point],
    across: str,
    up: str,
    *,
    line: Sequence[_Point] = (),
    bad: Sequence[float] = (),
    chosen: Sequence[_Point] = (),
) -> str:
    left, right = _ends([x for x, _ in dots] + list(bad))
    low, high = _ends([y for _, y in dots])

    def at(point: _Point) -> tuple[str, str]:
        x = (point[0] - left) / (right - left) * _WIDTH
        return f"{x:.1f}", f"{_HEIGHT - (point[1] - low) / (high - low) * _HEIGHT:.1f}"

    parts = [f'<path class="axis" d="M0 0V{_HEIGHT:g}H{_WIDTH:g}"/>']
    parts += [f'<circle class="dot" cx="{x}" cy="{y}" r="3"/>' for x, y in map(at, dots)]
    parts += [f'<circle class="chosen" cx="{x}" cy="{y}" r="4"/>' for x, y in map(at, chosen)]
    parts += [f'<path class="bad" d="M{at((x, low))[0]} {_HEIGHT:g}v-8"/>' for x in bad]
    if line:
        steps = [f"{'H' if index else 'M'}{x}{'V' if index else ' '}{y}" for index, (x, y) in enumerate(map(at, line))]
        parts.append(f'<path class="best" d="{"".join(steps)}"/>')
    parts.append(f'<text x="-6" y="10" text-anchor="end">{high:.4g}</text>')
    parts.append(f'<text x="-6" y="{_HEIGHT:g}" text-anchor="end">{low:.4g}</text>')
    parts.append(f'<text x="0" y="{_HEIGHT + 16:g}">{left:.4g}</text>')
    parts.append(f'<text x="{_WIDTH:g}" y="{_HEIGHT + 16:g}" text-anchor="end">{right:.4g}</text>')
    parts.append(f'<text x="{_WIDTH / 2:g}" y="{_HEIGHT + 16:g}" text-anchor="middle">{escaped(across)}</text>')
    parts.append(f'<text x="4" y="-6">{escaped(up)}</text>')
    return "".join(parts)


def _ends(numbers: Sequence[float]) -> tuple[float, float]:
    low, high = min(numbers, default=0.0), max(numbers, default=1.0)
    return (low, high) if high > low else (low - 0.5, high + 0.5)

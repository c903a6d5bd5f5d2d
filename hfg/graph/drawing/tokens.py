"""The colours of drawings, for light and dark screens, as one style sheet.

Orange is activity and nothing else. Four colours of groups can be distinguished with every kind of colour vision; there
is no fifth with that distance. So from the fifth group on they come again with another stripe, and the legend names
each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

_TOKENS: Final = {
    "canvas": ("#f3f5f8", "#0f1318"),
    "raised": ("#ffffff", "#1f2730"),
    "line2": ("#b6c0cb", "#4a5869"),
    "ink": ("#17202b", "#e9eef4"),
    "ink2": ("#3f4c5a", "#b9c5d1"),
    "ink3": ("#596777", "#92a2b3"),
    "edge": ("#2a3644", "#c9d4df"),
    "soft": ("#64748a", "#8fa3b8"),
    "data": ("#8c9aab", "#5c6c7e"),
    "on": ("#d9480f", "#ff7a3d"),
    "box": ("#8a97a6", "#8595a6"),
    "group1": ("#2ea46b", "#5decbf"),
    "group2": ("#9f66b6", "#9b5ab6"),
    "group3": ("#842954", "#6b6e3c"),
    "group4": ("#661f85", "#d8cff8"),
}
_RULES: Final = (
    (".hfg text", "fill", "ink"),
    (".hfg .hfg-soft", "fill", "ink2"),
    (".hfg-paper", "fill", "canvas"),
    (".hfg-body", "fill", "raised"),
    (".hfg-body", "stroke", "ink3"),
    (".hfg-behind", "stroke", "ink3"),
    (".hfg-box", "stroke", "box"),
    (".hfg rect.hfg-on", "stroke", "on"),
    (".hfg-sync", "fill", "edge"),
    (".hfg-async", "fill", "raised"),
    (".hfg-async,.hfg-hands", "stroke", "edge"),
    (".hfg-line", "stroke", "edge"),
    (".hfg-tip", "fill", "edge"),
    (".hfg-line.hfg-signal", "stroke", "soft"),
    (".hfg-tip.hfg-signal", "fill", "soft"),
    (".hfg-line.hfg-back", "stroke", "data"),
    (".hfg-tip.hfg-back", "fill", "data"),
    (".hfg-halo,.hfg-gap", "stroke", "canvas"),
    (".hfg-pill", "fill", "canvas"),
    (".hfg-pill", "stroke", "line2"),
    (".hfg-badge", "fill", "ink"),
    (".hfg-icon", "stroke", "ink2"),
    (".hfg-group1", "fill", "group1"),
    (".hfg-group2", "fill", "group2"),
    (".hfg-group3", "fill", "group3"),
    (".hfg-group4", "fill", "group4"),
)
_FORM: Final = """\
.hfg text{white-space:pre;stroke:none}
.hfg-body{stroke-width:1.25px}.hfg-box{stroke-width:1.25px;fill:none}.hfg rect.hfg-on{stroke-width:3px}
.hfg-off{stroke-dasharray:5 4}.hfg-behind,.hfg-hands,.hfg-icon,.hfg-line,.hfg-halo,.hfg-gap{fill:none}
.hfg-behind{stroke-width:1.25px}.hfg-async,.hfg-hands,.hfg-icon{stroke-width:1.5px}
.hfg-line{stroke-width:1.5px}.hfg-bundle{stroke-width:2.5px}.hfg-line.hfg-active{stroke-width:5px}
.hfg-line.hfg-signal{stroke-dasharray:4 3}.hfg-line.hfg-active{stroke-dasharray:none}
.hfg-halo{stroke-width:6px}.hfg-halo.hfg-wide{stroke-width:9px}.hfg-gap{stroke-width:2px}
.hfg-dashed{stroke-dasharray:3 2}.hfg-badge{fill-opacity:.07}.hfg-ground{fill-opacity:.13}
"""
_GROUPS: Final = 4


def _sheet(dark: bool) -> str:
    return "\n".join(f"{selector}{{{what}:{_TOKENS[token][dark]}}}" for selector, what, token in _RULES)


STYLE: Final = f"{_FORM}{_sheet(False)}\n@media (prefers-color-scheme:dark){{\n{_sheet(True)}\n}}\n"


def stripe(groups: Sequence[str], group: str, x: float, y: float, width: float, height: float) -> str:
    """Draw a node's group: a stripe on its left, and a tint of its ground."""
    number = [one for one in groups if one != "loop"].index(group)
    colour, look = f"hfg-group{number % _GROUPS + 1}", number // _GROUPS % 4
    x, y, width, height = x + 0.6, y + 0.6, width - 1.2, height - 1.2
    rest = f"h{width - 6:g}a5 5 0 0 1 5 5v{height - 10:g}a5 5 0 0 1 -5 5h{6 - width:g}z"
    ground = f'<path class="hfg-ground {colour}" d="M{x + 6:g} {y:g}{rest[: rest.rindex("h")]}h{6 - width:g}z"/>'
    steps = {
        0: [(0.0, height - 8)],
        1: _dashes(height - 8, 6, 4),
        2: _dashes(height - 8, 2, 3),
        3: [(0.0, height - 8)],
    }[look]
    wide = 1.4 if look == 3 else 4.0
    bars = "".join(f"M{x:g} {y + 4 + at:g}h{wide:g}v{long:g}h{-wide:g}z" for at, long in steps)
    if look == 3:
        bars += f"M{x + 2.8:g} {y + 4:g}h{wide:g}v{height - 8:g}h{-wide:g}z"
    return f'{ground}<path class="{colour}" d="{bars}"/>'


def _dashes(height: float, long: float, gap: float) -> list[tuple[float, float]]:
    return [(number * (long + gap), long) for number in range(max(1, int((height + gap) // (long + gap))))]

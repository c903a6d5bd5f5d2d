"""Times that differ by rounding only."""

from __future__ import annotations

import math


def slack_s(span_s: float, stamp: float) -> float:
    """Return by how much a stamp may miss the end of a span because floats are rounded.

    It is a millionth of the span, or a few steps between floats where stamps are large, as those of a clock that counts
    from 1970; never more than a quarter of the span.
    """
    return min(max(1e-6 * span_s, 4 * math.ulp(stamp)), span_s / 4)

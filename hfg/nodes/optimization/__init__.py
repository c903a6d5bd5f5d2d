"""Optimization: a search for the best numbers inside a graph, by events, and the trials it is judged by.

_optimizing  Optimize
_judging     Trial
"""

from __future__ import annotations

from hfg.nodes.optimization._judging import Trial
from hfg.nodes.optimization._optimizing import Found, Optimize

__all__ = ["Found", "Optimize", "Trial"]

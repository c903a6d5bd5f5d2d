"""Hypothesis strategies: tokens, graphs, schedules.

Failing graphs are shrunk to a small graph whose `repr` is the program that builds it.

Examples:
  >>> from hypothesis import given
  >>> @given(graphs(), schedules())
  ... def test_no_token_is_lost(build, seed): ...
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

from hypothesis import strategies as st

from hfg.base.token import END, NO_MESSAGE, Token
from hfg.testing.making import SYNCHRONOUS, Allowed, Making
from hfg.testing.plans import GraphPlan

__all__ = ["SYNCHRONOUS", "Allowed", "DrawingChooser", "graphs", "schedules", "tokens"]

T = TypeVar("T")


class DrawingChooser:
    """Chooses by drawing, so that Hypothesis can shrink the choices."""

    def __init__(self, draw: st.DrawFn) -> None:
        self._draw = draw

    def number(self, least: int, most: int) -> int:
        """Draw a whole number."""
        return self._draw(st.integers(least, most))

    def one_of(self, choices: Sequence[T]) -> T:
        """Draw one of them."""
        return choices[self._draw(st.integers(0, len(choices) - 1))]

    def chance(self, percent: int) -> bool:
        """Draw True with this probability."""
        return self._draw(st.integers(0, 99)) >= 100 - percent


@st.composite
def _plans(draw: st.DrawFn, allowed: Allowed | None) -> GraphPlan:
    return Making(DrawingChooser(draw), allowed or Allowed()).plan()


def graphs(allowed: Allowed | None = None) -> st.SearchStrategy[GraphPlan]:
    """Return plans of graphs: call one to build a new graph each time.

    Args:
      allowed: what may occur; `SYNCHRONOUS` is what rule F7 speaks of.
    """
    return _plans(allowed)


def tokens(values: st.SearchStrategy[Any] | None = None, *, markers: bool = True) -> st.SearchStrategy[Token[Any]]:
    """Return tokens with every modifier; NO_MESSAGE always has none (T3)."""
    value = st.integers(-9, 9) if values is None else values
    stamp = st.floats(0, 1000, allow_nan=False)
    number = st.integers(1, 99)
    found = st.builds(Token, value, st.sampled_from([0, 1, -1]), stamp, number)
    if markers:
        found |= st.builds(Token, st.just(NO_MESSAGE), st.just(0), stamp, number)
        found |= st.builds(Token, st.just(END), st.sampled_from([0, 1]), stamp, number)
    return found


def schedules() -> st.SearchStrategy[int]:
    """Return seeds: each is one order in which what may run is run.

    For `hfg.run(graph, policy="random", seed=seed)` and `reference_run(graph, seed=seed)`.
    """
    return st.integers(0, 2**16)

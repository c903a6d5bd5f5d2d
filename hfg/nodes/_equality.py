"""Whether two values are the same, for nodes that take values of any type. Depends on nothing."""

from __future__ import annotations

from typing import Any


def same(a: Any, b: Any) -> bool:
    """Return whether two values are equal, even if `==` gives an array or raises."""
    try:
        answer = a == b
        return bool(answer.all() and a.shape == b.shape) if hasattr(answer, "all") else bool(answer)
    except Exception:  # two values that do not know each other are two values
        return False

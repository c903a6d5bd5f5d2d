"""Nodes that count what they lose. No dependencies."""

from __future__ import annotations

from collections.abc import Mapping


class Counting:
    """Mix into a node class whose own counts belong into the report: `class Radio(Counting, Node)`."""

    __slots__ = ()

    def statistics(self) -> Mapping[str, int]:
        """Return the counts by their names, during a run and after it."""
        return {}

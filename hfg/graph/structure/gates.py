"""Gates: work coupled to activity without touching the node (rule A11). Depends on nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import msgspec

from hfg.nodetypes.node import Node


class Gate(msgspec.Struct, frozen=True, eq=False):
    """While `by` is inactive, `target` rests, or does `idle_rate_hz` firings a second."""

    target: Node
    by: Node
    idle_rate_hz: float | None = None


class Gates:
    """The gates of one level.

    Attributes:
      listed: in order of gating.
    """

    __slots__ = ("_gated", "listed")

    def __init__(self, gated: set[Node]) -> None:
        """Begin without gates; `gated` is that of the whole graph, in which a node has at most one gate."""
        self.listed: list[Gate] = []
        self._gated = gated

    def __iter__(self) -> Iterator[Gate]:
        return iter(self.listed)

    def append(self, gate: Gate) -> None:
        """Set a gate after all others."""
        self.insert(len(self.listed), gate)

    def insert(self, position: int, gate: Gate) -> None:
        """Set a gate at its place in the order."""
        self.listed.insert(position, gate)
        self._gated.add(gate.target)

    def remove(self, position: int) -> None:
        """Take the gate at a position away."""
        self._gated.discard(self.listed.pop(position).target)

    def keep(self, fits: Callable[[Gate], bool]) -> None:
        """Take all others away."""
        for gate in [gate for gate in self.listed if not fits(gate)]:
            self.remove(self.listed.index(gate))

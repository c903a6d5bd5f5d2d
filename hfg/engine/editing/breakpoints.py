"""What users see of a paused run: breakpoints, and the results of steps (rule R3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from hfg.base.token import Token

__all__ = ["Breakpoint", "Step"]


class Step(msgspec.Struct, frozen=True):
    """What one step did.

    Attributes:
      moved: paths of the nodes that fired or were called, in order; a node of a wave may be there twice.
      why_not: why nothing moved: what the node is waiting for; "" if something did.
    """

    moved: tuple[str, ...]
    why_not: str = ""


class Breakpoint:
    """Pauses the run; made by `Run.break_at`.

    Attributes:
      path: the current path of the node before whose firings and calls the run pauses, or of the edge or port whose
        tokens are checked.
      hits: how often it has paused the run.
      token: the token that paused the run last; None for a node.
    """

    def __init__(self, place: Any, path: str, remove: Callable[[Breakpoint], None]) -> None:
        self.path = path
        self.place = place
        self.hits = 0
        self.token: Token[Any] | None = None
        self._remove = remove

    def remove(self) -> None:
        """Stop pausing the run; a run that is paused stays paused. The second call does nothing."""
        self._remove(self)

    def was_hit(self, token: Token[Any] | None = None) -> None:
        """Count that it has paused the run, on a token if it checks tokens."""
        self.hits += 1
        if token is not None:
            self.token = token

    def follow(self, place: Any) -> None:
        """Move to the node that has replaced its own (R4)."""
        self.place = place

    def rename(self, path: str) -> None:
        """Note the new path of its place."""
        self.path = path

    def __repr__(self) -> str:
        return f'<Breakpoint at "{self.path}", {self.hits} hits>'

"""Why the pump, or a fused wave, must look at other things."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from typing_extensions import override

__all__ = ["Flags"]

_FOR_A_WAVE: Final = frozenset({"disturbed", "dissolved", "sends"})
"""Flags that only end the wave in progress."""


class Flags(list[str]):
    """Why the pump, or a wave, must look at other things. The pump reads it between two steps.

    A wave does not even read it. After each call it checks whether the type of the result is the previous one, which it
    must do anyway; and whoever raises a flag lets it forget those types.

    Attributes:
      forget: lets the wave that was entered last forget the types of its results; from any thread.
    """

    __slots__ = ("forget",)

    def __init__(self) -> None:
        super().__init__()
        self.forget: Callable[[], None] = _nothing

    @override
    def append(self, why: str) -> None:
        """Raise a flag; from any thread. The flag is first, so that a wave without types finds the reason."""
        super().append(why)
        self.forget()

    def lower_those_of_waves(self) -> bool:
        """A wave has ended. Return whether a flag is up that was not only for that wave."""
        self[:] = [flag for flag in self if flag not in _FOR_A_WAVE]
        return bool(self)


def _nothing() -> None:
    pass

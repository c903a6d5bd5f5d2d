"""Bars of text. Depends on nothing."""

from __future__ import annotations


def bar(share: float, width: int) -> str:
    """Return a bar of a share from 0 to 1; more than all is all."""
    filled = width if share >= 1 else round(width * share)
    return "█" * filled + "░" * (width - filled)

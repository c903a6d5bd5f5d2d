"""How a run is to be done: the arguments of `hfg.run`, in one place. Stands on `trace` and `errors`."""

from __future__ import annotations

from hfg.errors import UsageError
from hfg.trace import Consumer

__all__ = ["FUSE_AFTER", "Settings"]

FUSE_AFTER = 250
"""Firings of a head before its region is fused: forming one costs about as much as they save."""


class Settings:
    """How a run is to be done; the arguments of `hfg.run`.

    Raises:
      UsageError: one of them cannot be.
    """

    def __init__(
        self,
        *,
        debug: bool = False,
        policy: str | None = None,
        seed: int | None = None,
        trace: Consumer | None = None,
        fast: bool = True,
        fuse_after: int | None = None,
        until_s: float | None = None,
        allow_idle: bool = False,
        block_warning_s: float = 0.1,
        teardown_limit_s: float = 5.0,
    ) -> None:
        if until_s is not None and not _seconds(until_s):
            raise UsageError(f"until_s must be seconds from 0 on, or None for no end, got {until_s!r}")
        if not _seconds(block_warning_s):
            raise UsageError(f"block_warning_s must be seconds, or 0 for never, got {block_warning_s!r}")
        if seed is not None and type(seed) is not int:
            raise UsageError(f"seed must be a whole number, got {seed!r}")
        self.debug = debug
        self.policy = policy
        self.seed = seed
        self.trace = trace
        self.fast = fast
        self.fuse_after = FUSE_AFTER if fuse_after is None else fuse_after
        self.until_s = until_s
        self.allow_idle = allow_idle
        self.block_warning_s = block_warning_s
        self.teardown_limit_s = teardown_limit_s


def _seconds(value: object) -> bool:
    return isinstance(value, int | float) and value >= 0

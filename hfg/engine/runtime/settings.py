"""How a run is to be done: the options of `hfg.run`, in one place. Stands on `trace` and `errors`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypedDict

from hfg.errors import UsageError
from hfg.trace import Consumer

__all__ = ["CHECK_ALL", "FUSE_AFTER", "RunOptions", "Settings"]

CHECK_ALL = False
"""Whether runs ask after every step for the invariants of all their nodes and edges; the tests of the semantics do."""

FUSE_AFTER = 25
"""Firings of a head before its region is fused: forming one costs what so many interpreted ones do, 0.2 ms a node."""


class RunOptions(TypedDict, total=False):
    """What may be said of any run, and left out; `hfg.run` tells what it means."""

    until_s: float | None
    debug: bool
    policy: str | None
    seed: int | None
    trace: Consumer | None
    block_warning_s: float
    fast: bool
    watch: bool | str | None
    settings: str | Path | None


class Settings:
    """How a run is to be done: its options, checked, and what else holds of each run.

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
        until_s: float | None = None,
        allow_idle: bool = False,
        block_warning_s: float = 0.1,
        watch: bool | str | None = None,
        settings: str | Path | None = None,
    ) -> None:
        if until_s is not None and not _seconds(until_s):
            raise UsageError(f"until_s must be seconds from 0 on, or None for no end, got {until_s!r}")
        if not _seconds(block_warning_s):
            raise UsageError(f"block_warning_s must be seconds, or 0 for never, got {block_warning_s!r}")
        for name, value in (("debug", debug), ("fast", fast), ("allow_idle", allow_idle)):
            if not isinstance(value, bool):
                raise UsageError(f"{name} must be True or False, got {value!r}")
        if seed is not None and type(seed) is not int:
            raise UsageError(f"seed must be a whole number, got {seed!r}")
        if not _may_be_watched(watch):
            raise UsageError(f"watch must be True or False, or what hfg top shows as the program, got {watch!r}")
        if settings is not None and not isinstance(settings, str | Path):
            raise UsageError(f'settings must be the file of a realm, as in settings="cell.toml", got {settings!r:.80}')
        self.debug = debug
        self.check_all = CHECK_ALL
        self.policy = policy
        self.seed = seed
        self.trace = trace
        self.fast = fast
        self.fuse_after = FUSE_AFTER
        self.until_s = until_s
        self.allow_idle = allow_idle
        self.block_warning_s = block_warning_s
        self.watch = _watch_asked() if watch is None else watch
        self.watch_said = watch is not None
        self.settings = None if settings is None else str(settings)
        self.teardown_limit_s = 5.0  # X3


def _may_be_watched(watch: object) -> bool:
    return watch is None or isinstance(watch, bool) or (isinstance(watch, str) and watch != "")


def _watch_asked() -> bool:
    """Whether the environment asks for runs that other processes can look at.

    Raises:
      UsageError: nobody knows what it asks for.
    """
    asked = os.environ.get("HFG_WATCH", "")
    if asked not in ("", "0", "1"):
        raise UsageError(f'HFG_WATCH is "{asked}": set it to 1, so that hfg top can look at runs, or to 0')
    return asked == "1"


def _seconds(value: object) -> bool:
    return isinstance(value, int | float) and value >= 0

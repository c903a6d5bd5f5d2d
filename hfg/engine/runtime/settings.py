"""How a run is done: its options, which `hfg.graph.structure.options` declares, and what else holds for each run."""

from __future__ import annotations

import os

import msgspec

from hfg.errors import UsageError
from hfg.graph.structure.option import declared, refuse_values
from hfg.graph.structure.options import RunFields

__all__ = ["CHECK_ALL", "FUSE_AFTER", "Settings"]

CHECK_ALL = False
"""Whether runs check the invariants of all their nodes and edges after every step; the tests of the semantics do."""

FUSE_AFTER = 25
"""Firings of a head before its region is fused: forming one costs as much as 25 interpreted ones, 0.2 ms per node."""


class Settings(RunFields, kw_only=True):
    """How a run is done: its options, checked, and what else holds for each run.

    Attributes:
      allow_idle: a quiet graph keeps running.
      watch_said: `watch` was given, and does not come from the environment.
      check_all: see `CHECK_ALL`.
      fuse_after: see `FUSE_AFTER`.
      teardown_limit_s: how long a teardown may take (X3).

    Raises:
      UsageError: a value is not allowed.
    """

    allow_idle: bool = False
    watch_said: bool = False
    check_all: bool = msgspec.field(default_factory=lambda: CHECK_ALL)
    fuse_after: int = msgspec.field(default_factory=lambda: FUSE_AFTER)
    teardown_limit_s: float = 5.0

    def __post_init__(self) -> None:
        refuse_values(Settings, "", {name: getattr(self, name) for name in declared(Settings)}, UsageError)
        if not isinstance(self.allow_idle, bool):
            raise UsageError(f"allow_idle must be True or False, got {self.allow_idle!r}")
        self.watch_said = self.watch is not None
        if self.watch is None:
            self.watch = _watch_asked()
        if self.settings is not None:
            self.settings = str(self.settings)

    def everywhere(self) -> dict[str, object]:
        """Return the options that the other processes of the run have, too."""
        return {name: getattr(self, name) for name, one in declared(RunFields).items() if one.option.everywhere}


def _watch_asked() -> bool:
    """Return whether the environment asks for runs that other processes can watch.

    Raises:
      UsageError: its value means nothing.
    """
    asked = os.environ.get("HFG_WATCH", "")
    if asked not in ("", "0", "1"):
        raise UsageError(f'HFG_WATCH is "{asked}": set it to 1, so that hfg top can watch runs, or to 0')
    return asked == "1"

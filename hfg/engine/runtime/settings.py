"""How a run is done. This is the place to add an option of a run.

`hfg.run` and its relatives, the flags of `hfg run`, the other processes of a run and the table in docs/reference.md are
made of the declarations here. The engine finds the options in its `Settings`.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any, TypedDict, get_args

import msgspec

from hfg.errors import UsageError
from hfg.graph.structure.option import Fields, Option, declared, refuse_values
from hfg.graph.structure.options import Policy
from hfg.trace import Consumer

__all__ = ["CHECK_ALL", "FUSE_AFTER", "RunFields", "RunGiven", "Settings"]

CHECK_ALL = False
"""Whether runs check the invariants of all their nodes and edges after every step; the tests of the semantics do."""

FUSE_AFTER = 25
"""Firings of a head before its region is fused: forming one costs as much as 25 interpreted ones, 0.2 ms per node."""


_NAMES = ", ".join(f'"{name}"' for name in get_args(Policy))


class RunGiven(TypedDict, total=False):
    """The options of a run."""

    until_s: float | None
    debug: bool
    policy: str | None
    seed: int | None
    trace: Consumer | None
    block_warning_s: float
    fast: bool
    watch: bool | str | None
    settings: str | Path | None


class RunFields(Fields[RunGiven], kw_only=True):
    """How a run is done."""

    until_s: Annotated[
        float | None,
        Option(
            "End the run after this many seconds on its clock.",
            least=0,
            expects="seconds from 0 on, or None for no end",
        ),
    ] = None
    debug: Annotated[
        bool,
        Option(
            "Check every value against its port's type, and detect nodes that modify a shared value (T1).",
            everywhere=True,
        ),
    ] = False
    policy: Annotated[
        str | None,
        Option(
            f"The scheduling policy of all groups, instead of their own: {_NAMES} (R2).",
            expects="the name of a policy",
            flag="--policy",
            everywhere=True,
        ),
    ] = None
    seed: Annotated[
        int | None,
        Option(
            'The seed of the policy "random", and of the jitter of retries.',
            expects="a whole number",
            flag="--seed",
            everywhere=True,
        ),
    ] = None
    trace: Annotated[
        Any,
        Option(
            "Receives every event of the run (R7): a list, a function, or another consumer. Removed if it raises.",
            expects="a list, a function or another consumer",
        ),
    ] = None
    block_warning_s: Annotated[
        float,
        Option(
            "Warn about a firing that blocks the event loop for longer than this; 0 never warns.",
            least=0,
            expects="seconds, or 0 for never",
            everywhere=True,
        ),
    ] = 0.1
    fast: Annotated[
        bool, Option("Fuse plain nodes and use fast paths. Results are the same without it.", everywhere=True)
    ] = True
    watch: Annotated[
        bool | str | None,
        Option(
            "Let `hfg top` and `hfg tap` in other processes of the same user watch the run, on the real clock. A "
            "string is the name that they show for the program. Default: whether the environment has HFG_WATCH=1.",
            expects="True or False, or what hfg top shows as the program",
        ),
    ] = None
    settings: Annotated[
        str | Path | None,
        Option(
            "File with the settings of the network: where agents are found, and who else may watch the run.",
            expects='the file of a realm, as in settings="cell.toml"',
        ),
    ] = None


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

"""Runs of this user in other processes, which can be attached to (rule L5). Depends on the engine's sockets."""

from __future__ import annotations

import contextlib

from hfg.engine.face.watching import run_names, run_sockets
from hfg.errors import HfgError

__all__ = ["runs_of_this_user"]


def runs_of_this_user() -> list[str]:
    """Return the names of the runs that can be attached to, as `--attach` takes them."""
    try:
        with contextlib.closing(run_sockets()) as there:
            return run_names(there)
    except HfgError:
        return []

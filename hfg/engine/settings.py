"""How a run is to be done: the arguments of `hfg.run`, in one place. Stands on `trace`."""

from __future__ import annotations

from collections.abc import Callable

from hfg.trace import TraceEvent

__all__ = ["Settings"]


class Settings:
    """How a run is to be done; the arguments of `hfg.run`."""

    def __init__(
        self,
        *,
        debug: bool = False,
        policy: str | None = None,
        seed: int | None = None,
        trace: Callable[[TraceEvent], None] | None = None,
        fast: bool = True,
        until_s: float | None = None,
        allow_idle: bool = False,
        block_warning_s: float = 0.1,
        teardown_limit_s: float = 5.0,
    ) -> None:
        self.debug = debug
        self.policy = policy
        self.seed = seed
        self.trace = trace
        self.fast = fast
        self.until_s = until_s
        self.allow_idle = allow_idle
        self.block_warning_s = block_warning_s
        self.teardown_limit_s = teardown_limit_s

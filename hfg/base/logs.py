"""Where hfg and the nodes of its graphs log: below "hfg", those of a node at "hfg.node." and its path.

A path has dots there instead of slashes, so `logging.getLogger("hfg.node.fetch").setLevel(...)` speaks of all that is
inside the subgraph "fetch". A record says its `path` as well. A handler that raises loses a record and harms nobody:
what goes wrong with logging is no error of the node that logs. Stands on errors.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, MutableMapping
from contextlib import suppress
from contextvars import ContextVar
from typing import Any, Final, TypeAlias

from hfg.errors import in_words

__all__ = ["Log", "Logger", "current_log", "log", "node_log"]

Logger: TypeAlias = logging.LoggerAdapter[logging.Logger]

_NODES: Final = "hfg.node"


class Log(Logger):
    """A logger that never raises; with a path its records carry it."""

    def __init__(self, name: str, path: str = "") -> None:
        super().__init__(logging.getLogger(name), {})
        self.path = path

    def process(self, msg: Any, kwargs: MutableMapping[str, Any]) -> tuple[Any, MutableMapping[str, Any]]:
        """Add the path to what the record says anyway."""
        if self.path:
            kwargs["extra"] = {**(kwargs.get("extra") or {}), "path": self.path}
        return msg, kwargs

    def log(self, level: int, msg: object, *args: object, **kwargs: Any) -> None:
        """See `logging.Logger.log`; a handler that raises is told of on standard error."""
        if not self.isEnabledFor(level):
            return
        kwargs["stacklevel"] = kwargs.get("stacklevel", 1) + 1  # the line that is named is the caller's, not this one
        try:
            super().log(level, msg, *args, **kwargs)
        except Exception as error:
            with suppress(OSError, ValueError, AttributeError):  # there may be no standard error either
                sys.stderr.write(
                    f'hfg: a log handler raised {in_words(error)}; a record of "{self.logger.name}" is lost, and the '
                    "run goes on\n"
                )


current_log: Final[ContextVar[Callable[[], Logger] | None]] = ContextVar("hfg.log", default=None)
"""Set by the engine around the code of a run: gives the log of the node whose code asks."""


def node_log(path: str) -> Log:
    """Give the log of the node at a path."""
    return Log(f"{_NODES}.{path.replace('/', '.')}", path)


def log() -> Logger:
    """Give the log of the node whose function calls this, "hfg.node." and its path; outside a run "hfg.node".

    For functions, which have no `self.log`. What a function calls may call it as well.

    Examples:
      >>> def brighten(image: int) -> int:
      ...     log().debug("brightening %s", image)
      ...     return image + 1
      >>> brighten(1)
      2
    """
    give = current_log.get()
    return Log(_NODES) if give is None else give()

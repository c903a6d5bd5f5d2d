"""Loggers of hfg and of nodes: below "hfg"; a node logs to "hfg.node." plus its path.

The path has dots instead of slashes there, so `logging.getLogger("hfg.node.fetch").setLevel(...)` applies to everything
inside the subgraph "fetch". Records have the path in their attribute `path`, too. If a handler raises, a record is lost
and nothing else: an error in logging is not an error of the node that logs. Depends on errors.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, MutableMapping
from contextlib import suppress
from contextvars import ContextVar
from typing import Any, Final, TypeAlias

from hfg.errors import in_words

Logger: TypeAlias = logging.LoggerAdapter[logging.Logger]

_NODES: Final = "hfg.node"


class Log(Logger):
    """A logger that never raises. If it has a path, its records carry it."""

    def __init__(self, name: str, path: str = "") -> None:
        super().__init__(logging.getLogger(name), {})
        self.path = path

    def process(self, msg: Any, kwargs: MutableMapping[str, Any]) -> tuple[Any, MutableMapping[str, Any]]:
        """Add the path to the record's other attributes."""
        if self.path:
            kwargs["extra"] = {**(kwargs.get("extra") or {}), "path": self.path}
        return msg, kwargs

    def log(self, level: int, msg: object, *args: object, **kwargs: Any) -> None:
        """See `logging.Logger.log`. A handler that raises is reported on standard error."""
        if not self.isEnabledFor(level):
            return
        kwargs["stacklevel"] = kwargs.get("stacklevel", 1) + 1  # name the caller's line, not this one
        try:
            super().log(level, msg, *args, **kwargs)
        except Exception as error:
            with suppress(OSError, ValueError, AttributeError):  # standard error may be unavailable, too
                sys.stderr.write(
                    f'hfg: a log handler raised {in_words(error)}; a record of "{self.logger.name}" is lost, '
                    "and the run continues\n"
                )


current_log: Final[ContextVar[Callable[[], Logger] | None]] = ContextVar("hfg.log", default=None)
"""Set by the engine around the code of a run: returns the log of the node that the calling code belongs to."""


def node_log(path: str) -> Log:
    """Return the log of the node at a path."""
    return Log(f"{_NODES}.{path.replace('/', '.')}", path)


def log() -> Logger:
    """Return the log of the node whose function calls this, "hfg.node." plus its path; outside a run "hfg.node".

    Use it in functions, which have no `self.log`, and in code that they call.

    Examples:
      >>> def brighten(image: int) -> int:
      ...     log().debug("brightening %s", image)
      ...     return image + 1
      >>> brighten(1)
      2
    """
    give = current_log.get()
    return Log(_NODES) if give is None else give()

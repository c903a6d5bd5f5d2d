"""Log records for pages: the newest of them, from any thread. Depends on the standard library."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from typing import Any, Final

__all__ = ["LogKeeper"]

_KEPT: Final = 500
_MOST_LETTERS: Final = 2000


class LogKeeper(logging.Handler):
    """Keeps records of hfg's loggers until they are taken."""

    def __init__(self, time: Callable[[], float]) -> None:
        super().__init__(logging.INFO)
        self._time = time
        self._kept: deque[list[Any]] = deque(maxlen=_KEPT)
        self._count = 0
        logging.getLogger("hfg").addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a record."""
        self._kept.append(
            [self._time(), record.levelname.lower(), getattr(record, "path", ""), record.getMessage()[:_MOST_LETTERS]]
        )
        self._count += 1

    def take(self) -> dict[str, Any] | None:
        """Return what was kept since the last time."""
        count, self._count = self._count, 0
        if not count:
            return None
        records = [self._kept.popleft() for _ in range(len(self._kept))]
        return {"records": records, "lost": max(0, count - len(records))}

    def close(self) -> None:
        """Keep no more."""
        logging.getLogger("hfg").removeHandler(self)
        super().close()

"""Tells when a node blocks the loop: one warning with its path and the remedy.

A thread of the process looks from time to time which worker's code is on which loop; if it is the same firing for
longer than the run's limit, it says so, also when the code never returns. The hot path only notes whose code runs.
Stands on `core`.
"""

from __future__ import annotations

import logging
import threading
import time

from hfg.engine.model.core import Core

__all__ = ["Watch", "watchdog"]

_LOGGER = logging.getLogger("hfg.engine")


class Watch:
    """One run under watch."""

    def __init__(self, core: Core, limit_s: float) -> None:
        self.core = core
        self.limit_s = limit_s
        self.seen: tuple[int, int, int] | None = None
        self.since = 0.0
        self.warned: set[int] = set()

    def look(self, now: float) -> None:
        """Compare with the last look; any thread."""
        worker = self.core.current or self.core.speaker
        if worker is None:
            self.seen = None
            return
        seen = (worker.index, worker.firings, worker.call_number)
        if seen != self.seen:
            self.seen, self.since = seen, now
        elif now - self.since >= self.limit_s and worker.index not in self.warned:
            self.warned.add(worker.index)
            _LOGGER.warning(
                'node "%s" has blocked the loop for more than %g s: nothing else on the loop can move; '
                "put it into a thread with "
                'graph.add(..., group="work") and graph.group("work", threads=1)',
                worker.path,
                self.limit_s,
                extra={"path": worker.path},
            )


class _Watchdog:
    """One daemon thread for all runs of the process; it ends when nothing is left to watch."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watches: list[Watch] = []
        self._wake = threading.Event()
        self._thread: threading.Thread | None = None

    def watch(self, core: Core, limit_s: float) -> Watch:
        """Begin to watch a run; a limit of 0 or less watches nothing."""
        watch = Watch(core, limit_s)
        if limit_s > 0:
            with self._lock:
                self._watches.append(watch)
                if self._thread is None:
                    self._thread = threading.Thread(target=self._live, name="hfg watchdog", daemon=True)
                    self._thread.start()
        return watch

    def forget(self, watch: Watch) -> None:
        """The run is over."""
        with self._lock:
            if watch in self._watches:
                self._watches.remove(watch)

    def _live(self) -> None:
        idle = 0
        while True:
            with self._lock:
                watches = list(self._watches)
                if not watches:
                    idle += 1
                    if idle > 100:  # some seconds without a run
                        self._thread = None
                        return
                else:
                    idle = 0
            now = time.monotonic()
            for watch in watches:
                watch.look(now)
            self._wake.wait(min([watch.limit_s / 4 for watch in watches], default=0.05))


watchdog = _Watchdog()

"""Warns when a node blocks the loop: once, with its path and the remedy.

One thread of the process checks periodically which node's code runs on which loop. It warns if that is the same firing
for longer than the run's limit, even if the code never returns. The hot path only notes whose code runs.
"""

from __future__ import annotations

import sys
import threading
import time

from hfg.base.logs import Log
from hfg.engine.model import Core, RunningNode
from hfg.graph.checks.nodes import needs_loop
from hfg.nodetypes.node import Node

__all__ = ["Watch", "remedy_for", "watchdog"]

_SLICE_S = 0.005  # how long the pump may keep the loop to itself where nodes are slow
_LOOKS_WHILE_BUSY = 20  # quick looks after the loop was running; then at leisure, so that an idle robot sleeps
_LOGGER = Log("hfg.engine")


class Watch:
    """One run that is watched."""

    def __init__(self, core: Core, limit_s: float, *, virtual: bool) -> None:
        self.core = core
        self.limit_s = limit_s
        self.seen: tuple[int, int, int] | None = None
        self.since = 0.0
        self.warned: set[int] = set()
        self.slice = -1
        self.thread = threading.get_ident()
        self.virtual = virtual

    def look(self, now: float) -> bool:
        """Compare with the last look. Return whether the loop is running; from any thread."""
        self._end_slice()
        worker = self._at_work()
        if worker is None:
            self.seen = None
            return self.core.pumping
        region = worker.region
        seen = (worker.index, worker.counts.firings + (region.waves if region is not None else 0), worker.counts.calls)
        if seen != self.seen:
            self.seen, self.since = seen, now
        elif now - self.since >= self.limit_s > 0 and worker.index not in self.warned:
            self.warned.add(worker.index)
            _LOGGER.warning(
                'node "%s" has blocked the loop for more than %g s: nothing else on the loop can move; %s',
                worker.path,
                self.limit_s,
                remedy_for(worker.node),
                extra={"path": worker.path},
            )
        return True

    def _end_slice(self) -> None:
        """End the pump's slice after the current call if nodes are too slow for it to look at the clock."""
        core = self.core
        slice_ = core.slices if core.pumping else -1
        if slice_ == self.slice and slice_ >= 0 and not core.flags and not self.virtual:
            core.flags.append("slice")
        self.slice = slice_

    def _at_work(self) -> RunningNode | None:
        """Return the node whose code runs on the loop; in a fused region, by the current line."""
        worker = self.core.current or self.core.running_node
        region = worker.region if worker is not None else None
        if region is None or not region.running:
            return worker
        frames = sys._current_frames()  # noqa: SLF001 (documented; there is no other way)
        return region.at_work(frames.get(self.thread)) or worker


def remedy_for(node: Node | None) -> str:
    """Return what to do about a node that blocks the loop; one that needs the loop cannot run in a thread (R1)."""
    why_loop = needs_loop(node) if node is not None else ""
    if not why_loop:
        return 'put it into a thread with graph.add(..., group="work") and graph.group("work", threads=1)'
    return (
        f"{why_loop}, so it cannot be put into a thread: write `await asyncio.to_thread(function, ...)` in its async "
        "code for what takes so long, or move that into a plain node of its own, which can"
    )


class _Watchdog:
    """One daemon thread for all runs of the process; it ends when nothing is left to watch."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watches: list[Watch] = []
        self._wake = threading.Event()
        self._thread: threading.Thread | None = None

    def watch(self, core: Core, limit_s: float, *, virtual: bool) -> Watch:
        """Start to watch a run; a limit of 0 or less warns of nothing."""
        watch = Watch(core, limit_s, virtual=virtual)
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
        idle = looks = 0
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
            if any([watch.look(now) for watch in watches]):  # noqa: C419 - each has its look
                looks = _LOOKS_WHILE_BUSY
            looks -= 1
            often = [watch.limit_s / 4 for watch in watches if watch.limit_s > 0]
            self._wake.wait(_SLICE_S if looks > 0 else min(often, default=0.05))


watchdog = _Watchdog()

"""What measures the code of running nodes: it wraps the code, and the rest of the engine does not know.

Of a node that is very fast only some firings between two looks are measured and stand for the others, so that measuring
costs next to nothing; all are counted. Depends on `running_node` and `stepping`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from math import frexp, ldexp
from time import monotonic
from types import CoroutineType
from typing import Any

from hfg.base.stepping import measured_steps
from hfg.engine.model.running_node import RunningNode

__all__ = ["BATCH", "KEPT", "Distribution", "Meter"]

KEPT = 100
"""How many of the newest measurements are kept one by one."""

BATCH = 32
"""How many firings and calls of a node are measured between two looks at most; of the others one knows the number."""

_PER_OCTAVE = 8  # buckets from one power of two to the next, so a percentile is right within 7 %


class Distribution:
    """Sum, maximum, percentiles and the newest of very many measurements, in seconds.

    Attributes:
      count: how many were measured.
      stands_for: how many they stand for.
      total: of those; what was not measured is taken to be like what was.
      longest: of what was measured.
      newest: the last ones, oldest first.
    """

    __slots__ = ("_buckets", "_known", "count", "longest", "newest", "stands_for", "total")

    def __init__(self) -> None:
        self.count = 0
        self.stands_for = 0.0
        self.total = 0.0
        self.longest = 0.0
        self.newest: deque[float] = deque(maxlen=KEPT)
        self._buckets: dict[int, float] = {}
        self._known: tuple[int, tuple[float, float]] = (0, (0.0, 0.0))

    @property
    def mean(self) -> float:
        """0 if nothing was measured."""
        return self.total / self.stands_for if self.stands_for else 0.0

    def add(self, batch: list[float], each: float) -> None:
        """Take in a batch, each of which stands for so many."""
        self.count += len(batch)
        self.stands_for += len(batch) * each
        self.total += sum(batch) * each
        self.longest = max(self.longest, *batch)
        self.newest.extend(batch)
        buckets = self._buckets
        for seconds in batch:
            mantissa, exponent = frexp(seconds)
            bucket = exponent * _PER_OCTAVE + int(mantissa * 2 * _PER_OCTAVE)
            buckets[bucket] = buckets.get(bucket, 0.0) + each

    def percentiles(self) -> tuple[float, float]:
        """The median and the 99th percentile; 0 if nothing was measured."""
        if self._known[0] != self.count:
            buckets = sorted(self._buckets.items())
            self._known = (self.count, (self._at(buckets, 0.5), self._at(buckets, 0.99)))
        return self._known[1]

    def _at(self, buckets: list[tuple[int, float]], part: float) -> float:
        rank = self.stands_for * part
        for bucket, count in buckets:
            rank -= count
            if rank <= 0:
                exponent, mantissa = divmod(bucket - _PER_OCTAVE, _PER_OCTAVE)
                middle = ldexp((mantissa + _PER_OCTAVE + 0.5) / (2 * _PER_OCTAVE), exponent)
                return min(middle, self.longest)
        return self.longest


class Meter:
    """Measures the code of one running node: its process function and the handlers of its slots.

    Attributes:
      code: the process function itself, for a step that measures by itself.
      left: how much is still to be measured before the next look.
      busy_s: for how long its code kept its group busy.
      spent: how long firings and calls took, what async code waits for included.
      delays: from the stamp of what a firing or call took to its end.
      waiting: seconds by what the node waited for.
      active: seconds for which it was active.
      boxes: where each firing and call that is measured is noted, with the time of its end on the run's clock.
      mark, before: firings and calls at the last and the last but one full second, for the rate.
    """

    __slots__ = (
        "_fresh",
        "_fresh_busy",
        "_fresh_delays",
        "_now",
        "_pieces",
        "_wrapped",
        "active",
        "before",
        "boxes",
        "busy_s",
        "code",
        "delays",
        "left",
        "mark",
        "spent",
        "waiting",
        "worker",
    )

    def __init__(self, worker: RunningNode) -> None:
        self.worker = worker
        self.code: Any = worker.process
        self.left = BATCH
        self.busy_s = 0.0
        self.spent = Distribution()
        self.delays = Distribution()
        self.waiting: dict[str, float] = {}
        self.active = 0.0
        self.boxes: tuple[deque[Any], ...] = ()
        self.mark = self.before = worker.counts.done
        self._fresh: list[float] = []
        self._fresh_delays: list[float] = []
        self._fresh_busy = 0.0
        self._pieces = self._done()
        self._now = worker.core.now
        self._wrapped: set[str] = set()

    def measure(self) -> None:
        """From now on the node's code is measured; its step is to be chosen again."""
        worker = self.worker
        worker.be_measured(self)
        if worker.iteration is None and worker.process is not None:
            kind = worker.type.process_kind
            if kind in ("generator", "async generator"):
                worker.process = self._generators(self.code)
                if worker.execution.generator is not None:
                    worker.execution.draw_from(self._drawn(worker.execution.generator))
            else:
                worker.process = self._calls(self.code)
        self.measure_slots()

    def refit(self) -> None:
        """The worker has another node: what was measured stays, its code is measured from now on."""
        self.code = self.worker.process
        self._wrapped.clear()
        self.measure()

    def measure_slots(self) -> None:
        """Wrap the handlers of slots that are connected by now."""
        worker = self.worker
        for name in set(worker.handlers) - self._wrapped:
            self._wrapped.add(name)
            worker.handlers[name] = self._calls(worker.handlers[name])
            if name in worker.plain_handlers:
                worker.plain_handlers[name] = self._calls(worker.plain_handlers[name])
        for edge in worker.slot_edges:
            if edge.handler is not None:
                edge.handler = worker.plain_handlers[edge.port_name]

    def took(self, seconds: float, delay: float | None = None, busy: float | None = None) -> None:
        """A firing or call took so long, and ended so long after the stamp of what it took.

        Of that time it kept its group busy for `busy`; async code that waits does not.
        """
        self.left -= 1
        self._fresh.append(seconds)
        for boxes in self.boxes:
            boxes.append((self.worker, self._now(), seconds))
        self._fresh_busy += seconds if busy is None else busy
        if delay is not None:
            self._fresh_delays.append(delay)

    def fold(self) -> None:
        """Sum up what was measured since the last look, and measure on."""
        region = self.worker.region
        if region is not None:
            region.settle_counts()
            region.measure_on()
        done = self._done()
        pieces, self._pieces = done - self._pieces, done
        batch, self._fresh = self._fresh, []
        delays, self._fresh_delays = self._fresh_delays, []
        busy, self._fresh_busy = self._fresh_busy, 0.0
        each = pieces / len(batch) if self.left <= 0 and pieces > len(batch) else 1.0
        if batch:
            self.spent.add(batch, each)
            self.busy_s += busy * each
        if delays:
            self.delays.add(delays, each)
        self.left = BATCH

    def _done(self) -> int:
        worker = self.worker
        return worker.counts.processed + worker.counts.calls

    def _calls(self, code: Callable[..., Any]) -> Callable[..., Any]:
        worker = self.worker
        now = self._now
        took = self.took

        def measured(*arguments: Any) -> Any:
            if self.left <= 0:
                return code(*arguments)
            stamp = None if worker.is_source else worker.stamp
            began = monotonic()
            try:
                result = code(*arguments)
            except BaseException:
                took(monotonic() - began)
                raise
            if type(result) is CoroutineType and not worker.group.threaded:
                return self.awaited(result, began, stamp)
            took(monotonic() - began, None if stamp is None else now() - stamp)
            return result

        return measured

    async def awaited(self, coroutine: Any, began: float, stamp: float | None) -> Any:
        """Await code that waits; only its own steps keep the group busy."""
        busy = [0.0]
        try:
            return await measured_steps(coroutine, busy, monotonic)
        finally:
            self.took(monotonic() - began, None if stamp is None else self._now() - stamp, busy[0])

    def _generators(self, code: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *arguments: self._drawn(code(*arguments))

    def _drawn(self, generator: Any) -> Any:
        return _AsyncDrawn(self, generator) if hasattr(generator, "__anext__") else _Drawn(self, generator)


class _Drawn(Iterator[Any]):
    """A generator whose steps are measured; `measured` is the generator itself, for those who measure by themselves."""

    def __init__(self, meter: Meter, generator: Any) -> None:
        self._meter = meter
        self.measured = generator
        self.close = getattr(generator, "close", lambda: None)

    def __next__(self) -> Any:
        if self._meter.left <= 0:
            return next(self.measured)
        began = monotonic()
        try:
            return next(self.measured)
        finally:
            self._meter.took(monotonic() - began)


class _AsyncDrawn(AsyncIterator[Any]):
    """An async generator whose steps are measured."""

    def __init__(self, meter: Meter, generator: Any) -> None:
        self._meter = meter
        self._generator = generator
        self.aclose = generator.aclose

    def __anext__(self) -> Coroutine[Any, Any, Any]:
        if self._meter.left <= 0:
            return self._generator.__anext__()  # type: ignore[no-any-return]
        return self._meter.awaited(self._generator.__anext__(), monotonic(), None)

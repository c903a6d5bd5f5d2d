"""The clocks that every participant carries in its sink or source, so that all are measured from the same points.

Start-up and shutdown are not measured, and the first tenth of the tokens is the warm-up. A token that did not arrive is
an error here: losing tokens must not count as speed.
"""

from __future__ import annotations

from itertools import pairwise
from time import perf_counter, perf_counter_ns, process_time

__all__ = ["Arrivals", "Laps"]


class Arrivals:
    """Throughput: from the arrival of the first tenth of the tokens at the sink until that of the last."""

    def __init__(self, tokens: int) -> None:
        self.tokens = tokens
        self.warm = max(1, tokens // 10)
        self.count = 0
        self.began = self.ended = (0.0, 0.0)

    def take(self, value: int) -> None:
        """Count one token that has arrived."""
        self.count = count = self.count + 1
        if count == self.warm:
            self.began = (perf_counter(), process_time())
        elif count == self.tokens:
            self.ended = (perf_counter(), process_time())

    def figures(self, hops: int = 1) -> dict[str, float]:
        """Microseconds per token, divided by its hops: by the clock, and of this process only.

        The two differ when the machine was busy with something else, or when a participant rests or has more threads.
        """
        if self.count != self.tokens or self.tokens < 2:
            raise RuntimeError(f"{self.count} of {self.tokens} tokens have arrived; at least two and all have to")
        scale = 1e6 / (self.tokens - self.warm) / hops
        wall, cpu = ((after - before) * scale for before, after in zip(self.began, self.ended, strict=True))
        return {"wall": wall, "cpu": cpu}


class Laps:
    """Latency: how long each token takes when the next one leaves only after it has arrived."""

    def __init__(self, tokens: int) -> None:
        self.tokens = tokens
        self.times: list[int] = []

    def lap(self) -> None:
        """A round is over, and the next begins: called once before the first and once after each."""
        self.times.append(perf_counter_ns())

    def figures(self, hops: int) -> dict[str, float]:
        """Microseconds a hop: the median round, and the one that only a hundredth of them exceed."""
        if len(self.times) != self.tokens + 1:
            raise RuntimeError(f"{len(self.times) - 1} of {self.tokens} rounds were made")
        warm = self.times[self.tokens // 10 :]
        rounds = sorted(after - before for before, after in pairwise(warm))
        return {
            "median": rounds[len(rounds) // 2] / hops / 1e3,
            "p99": rounds[len(rounds) * 99 // 100] / hops / 1e3,
        }

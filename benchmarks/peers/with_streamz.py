"""streamz: maps and a sink, fed by emit."""

from __future__ import annotations

from streamz import Stream

from benchmarks.meters import Arrivals, Laps
from benchmarks.works import Participant


def through(value: int) -> int:
    """Pass on."""
    return value


def mapped(length: int, meter: Arrivals) -> Stream:
    """A stream whose sink is behind `length` maps."""
    source = end = Stream()
    for _ in range(length):
        end = end.map(through)
    end.sink(meter.take)
    return source


class Streamz(Participant):
    """Synchronous push."""

    name = "streamz"

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""
        meter = Arrivals(tokens)
        source = mapped(length, meter)
        for value in range(tokens):
            source.emit(value)
        return meter.figures(length + 1)

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: `emit` returns when the value is through."""
        meter = Laps(tokens)
        source = mapped(length, Arrivals(tokens))
        for value in range(tokens):
            meter.lap()
            source.emit(value)
        meter.lap()
        return meter.figures(length + 1)

    def join(self, tokens: int) -> dict[str, float]:
        """C."""
        meter = Arrivals(tokens)
        source = Stream()
        source.map(through).zip(source.map(through)).map(lambda pair: pair[0]).sink(meter.take)
        for value in range(tokens):
            source.emit(value)
        return meter.figures()


PEERS = [Streamz()]

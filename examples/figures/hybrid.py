"""Figures 5 to 11 of the paper: data and events in one graph, with and without translation (§3.2 and §4).

Every function builds the graph of one figure; `docs/model/hybrid.md` walks through them.
Look at one with `hfg draw examples/figures/hybrid.py:figure_9`, run it with
`hfg run examples/figures/hybrid.py:figure_9 --clock virtual`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import hfg


@hfg.node
def camera(*, images: int = 4) -> Iterator[int]:
    yield from range(1, images + 1)


@hfg.node
def brighten(image: int) -> int:
    return image * 10


class Compare(hfg.Node):
    """Waits for both inputs; tells when they are far apart."""

    first = hfg.Input(int)
    second = hfg.Input(int)
    difference = hfg.Output(int)
    far = hfg.Event(int)

    def process(self, first: int, second: int) -> None:
        self.difference.send(second - first)
        if second - first > 20:
            self.far.trigger(second - first)


class Record(hfg.Node):
    """Writes down data, and starts over on a signal; that goes past the data."""

    value = hfg.Input(int)
    written = hfg.State(factory=list[int])

    def process(self, value: int) -> None:
        self.written.append(value)
        print("value", value)

    @hfg.slot
    def mark(self, why: int) -> None:
        print("mark", why)


def figure_5() -> hfg.Graph:
    """Only what SDF+ has: outputs lead to inputs, events to slots (equation 5)."""
    graph = hfg.Graph("figure 5")
    eye, bright = graph.add(camera()), graph.add(brighten())
    compare, record = graph.add(Compare()), graph.add(Record())
    eye >> bright
    graph.connect(eye.out, compare.first)
    graph.connect(bright.out, compare.second)
    graph.connect(compare.difference, record.value)
    graph.connect(compare.far, record.mark)
    return graph


class Everything(hfg.Node):
    """Has a port of each kind: the dark ones, in step, and the light ones, which are not."""

    input = hfg.Input(int)
    output = hfg.Output(int)
    event = hfg.Event(int)

    def process(self, input: int) -> int:  # noqa: A002 - the paper's word
        return input

    @hfg.slot
    def slot(self, value: int) -> None:
        self.event.trigger(value)


@hfg.node
def number(*, value: int = 1) -> Iterator[int]:
    yield value


@hfg.node
def show(value: int) -> None:
    print(value)


def figure_6() -> hfg.Graph:
    """All four kinds of ports, and (equation 6) all four kinds of edges between them."""
    graph = hfg.Graph("figure 6")
    source, every = graph.add(number()), graph.add(Everything(), name="v_k")
    graph.connect(source.out, every.input)
    graph.connect(every.output, every.slot)
    graph.connect(every.event, graph.add(show()).value)
    graph.connect(every.event, graph.add(Tell()).told)
    return graph


class Tell(hfg.Node):
    @hfg.slot
    def told(self, value: int) -> None:
        print("told", value)


def figure_7() -> hfg.Graph:
    """The graph of figure 5; the simplified notation is that of every drawing here."""
    return figure_5()


class Clicks(hfg.Node):
    """Clicks several times at once, as impatient people do."""

    click = hfg.Event(int)
    last = hfg.Event()
    times = hfg.Parameter(5)

    @hfg.slot
    def begin(self) -> None:
        for count in range(1, self.times + 1):
            self.click.trigger(count)
        self.last.trigger()


class Buffer(hfg.Node):
    """A translation node of SDF+: takes signals by a slot and gives them as data; full, it forgets the oldest.

    It is a source, so only its own code can tell when it has ended.
    """

    out = hfg.Output(int)
    size = hfg.Parameter(3)
    waiting = hfg.State(factory=deque[int])
    closed = hfg.State(False)
    dropped = hfg.State(0)

    def ready(self) -> bool:
        return bool(self.waiting) or self.closed

    def process(self) -> int:
        if not self.waiting:
            raise hfg.EndOfStream
        return self.waiting.popleft()

    @hfg.slot
    def put(self, value: int) -> None:
        if len(self.waiting) == self.size:
            self.waiting.popleft()
            self.dropped += 1
        self.waiting.append(value)

    @hfg.slot
    def close(self) -> None:
        self.closed = True


class ToEvent(hfg.Node):
    """The other translation node: takes data, gives signals."""

    value = hfg.Input(int)
    signal = hfg.Event(int)

    def process(self, value: int) -> None:
        self.signal.trigger(value)


@hfg.node
def double(value: int) -> int:
    return 2 * value


class Report(hfg.Node):
    """Says what it hears."""

    heard = hfg.State(factory=list[int])

    @hfg.slot
    def hear(self, value: int) -> None:
        self.heard.append(value)
        print("heard", value)


def figure_8(size: int = 3) -> hfg.Graph:
    """SDF+ needs a node on each way between signals and data."""
    graph = hfg.Graph("figure 8")
    clicks, buffer, twice = graph.add(Clicks()), graph.add(Buffer(size=size)), graph.add(double())
    to_event, report = graph.add(ToEvent()), graph.add(Report())
    graph.connect(graph.start, clicks.begin)
    graph.connect(clicks.click, buffer.put)
    graph.connect(clicks.last, buffer.close)
    buffer.out >> twice >> to_event
    graph.connect(to_event.signal, report.hear)
    return graph


def figure_9() -> hfg.Graph:
    """HFG does not: an event leads into an input, an output into a slot."""
    graph = hfg.Graph("figure 9")
    clicks, twice, report = graph.add(Clicks()), graph.add(double()), graph.add(Report())
    graph.connect(graph.start, clicks.begin)
    graph.connect(clicks.click, twice.value)
    graph.connect(twice.out, report.hear)
    return graph


@hfg.node
def square(value: int) -> int:
    return value * value


@hfg.node
def both(left: int, right: int) -> int:
    return left + right


class Answer(hfg.Node):
    """Turns the result back into a signal."""

    value = hfg.Input(int)
    answered = hfg.Event(int)

    def process(self, value: int) -> None:
        self.answered.trigger(value)


def figure_10() -> hfg.Graph:
    """A synchronous sub-graph handles each event and answers with one."""
    graph = hfg.Graph("figure 10")
    clicks, report = graph.add(Clicks(), name="v_s"), graph.add(Report())
    begin, twice, squared = graph.add(double(), name="begin"), graph.add(double()), graph.add(square())
    joined, answer = graph.add(both()), graph.add(Answer())
    graph.connect(graph.start, clicks.begin)
    graph.connect(clicks.click, begin.value)
    begin >> twice
    begin >> squared
    graph.connect(twice.out, joined.left)
    graph.connect(squared.out, joined.right)
    joined >> answer
    graph.connect(answer.answered, report.hear)
    return graph


@hfg.node
def positions() -> Iterator[str]:
    yield from ("here", "there")


@hfg.node
def obstacles() -> Iterator[str]:
    yield from ("chair", "table", "cat", "wall")


@hfg.node
def commands() -> Iterator[str]:
    yield "home"


class Drive(hfg.Node):
    """Has a slot for each stream and handles whatever comes, whenever it comes."""

    told = hfg.State(factory=list[str])

    def tell(self, what: str) -> None:
        self.told.append(what)
        print(f"{hfg.now():.1f} s  {what}")

    @hfg.slot
    def position(self, where: str) -> None:
        self.tell(f"at {where}")

    @hfg.slot
    def obstacle(self, what: str) -> None:
        self.tell(f"avoid {what}")

    @hfg.slot
    def command(self, where: str) -> None:
        self.tell(f"go {where}")


def figure_11() -> hfg.Graph:
    """Synchronous streams of different rates converge in the slots of one node."""
    graph = hfg.Graph("figure 11")
    drive = graph.add(Drive(), name="v")
    graph.connect(graph.add(positions(), max_rate_hz=1).out, drive.position)
    graph.connect(graph.add(obstacles(), max_rate_hz=2.5).out, drive.obstacle)
    graph.connect(graph.add(commands()).out, drive.command)
    return graph

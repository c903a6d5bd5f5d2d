"""Node types for the tests of hfg itself: those of `hfg.testing.nodes`, and those that behave in rarer ways.

Their behaviour depends only on their inputs, never on time or chance. The program that a plan prints imports everything
from here.
"""

from __future__ import annotations

import asyncio
import contextlib
import enum
from collections.abc import Iterator
from pathlib import Path, PosixPath
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Gt, Interval
from numpy import array
from numpy.typing import NDArray

import hfg
from hfg import Colour, Span
from hfg.ports.outputs import OutputPort
from hfg.testing.nodes import (
    AsyncRelay,
    Counter,
    Doubter,
    Failing,
    Greeter,
    Latch,
    Merge,
    OnlyTwice,
    Passing,
    Pulse,
    Relay,
    Scaled,
    Script,
    Sieve,
    Stateful,
    Tally,
    Waiting,
    add,
    ascript,
    double,
    script,
    sink,
    slow_double,
    some,
)
from hfg.types import Shape
from tests.support.operators import through
from tests.support.strange import STRANGE

__all__ = [
    "PAUSES",
    "WAYS",
    "AsyncRelay",
    "Attentive",
    "Beats",
    "Clings",
    "Colour",
    "Counter",
    "Doubter",
    "Draws",
    "EachOfEach",
    "EachOfThose",
    "Effort",
    "Failing",
    "Gate",
    "Greeter",
    "Heeds",
    "Hums",
    "LastWord",
    "Latch",
    "Lends",
    "LendsLater",
    "Lives",
    "LivesTwice",
    "Merge",
    "OnlyTwice",
    "Pairs",
    "Parts",
    "Passing",
    "PassingLater",
    "PosixPath",
    "Pulse",
    "Relay",
    "Scaled",
    "Script",
    "Sends",
    "Sieve",
    "Span",
    "Speaks",
    "SpeaksLater",
    "SpeaksTwice",
    "SpeaksTwiceLater",
    "Stateful",
    "Stubborn",
    "Talks",
    "TalksLater",
    "Tally",
    "Tends",
    "Ticks",
    "Tuned",
    "Turn",
    "Unsteady",
    "Utters",
    "UttersLater",
    "Waiting",
    "Watch",
    "Works",
    "add",
    "array",
    "ascript",
    "calling",
    "calm",
    "double",
    "either",
    "gives_up",
    "handing",
    "listed",
    "mood",
    "odd",
    "parted",
    "picky",
    "restless",
    "script",
    "sink",
    "slow_double",
    "some",
    "summed",
    "through",
    "unlent",
    "with_default",
]


@hfg.node
def with_default(value: int, other: int = 5) -> int:
    """Return the sum; what is absent counts five."""
    return value + other


@hfg.node
def either(first: int | None = None, second: int | None = None) -> int | None:
    """Return the first that is there; all inputs are optional."""
    return second if first is None else first


class Parts(NamedTuple):
    """What `parted` gives: even and odd values by different outputs."""

    even: int | None
    odd: int | None


@hfg.node(outputs=Parts)
def parted(value: int) -> Parts | None:
    """Split a stream; zero is silence on both."""
    if value == 0:
        return None
    return Parts(None, value) if value % 2 else Parts(value, value if value % 4 == 0 else None)


@hfg.node
def mood(value: int) -> int:
    """Return a number of one type or another."""
    return value > 3 if value % 3 == 0 else value


@hfg.node
def picky(value: int, *, at: int = 3) -> int:
    """Fail at every value that `at` divides."""
    if value % at == 0:
        raise ValueError(f"cannot do {value}")
    return value


@hfg.node
def gives_up(value: int, *, at: int = 3) -> int:
    """End, as any node may, or speak as a generator does, which is an error of a function."""
    if value % at == 0:
        raise (StopIteration if value % 2 else hfg.EndOfStream)
    return value


@hfg.node
def handing(value: int) -> Any:
    """Return a token now and then, with a modifier or without."""
    return value if value % 3 else hfg.Token(value, value % 2)


@hfg.node(outputs=Any)
def odd(value: Any, *, what: str = "0-d array", every: int = 2) -> Any:
    """Return a value now and then that cannot be inspected."""
    return STRANGE[what]() if isinstance(value, int) and value % every == 0 else value


@hfg.node
async def calm(value: int) -> int:
    """Return the value at once."""
    return value


@hfg.node
async def restless(value: int) -> int:
    """Wait now and then, or only let others have a turn."""
    if value % 3 == 0:
        await asyncio.sleep(0.003)
    elif value % 3 == 1:
        await asyncio.sleep(0)
    return value


async def _later(value: int) -> int:
    if value % 4 == 0:
        await asyncio.sleep(0.002)
    return value + 1


@hfg.node
def calling(value: int) -> Any:
    """Return the call of an async function now and then."""
    return _later(value) if value % 2 == 0 else value


class Sends(hfg.Node):
    """Sends, returns, or keeps silent."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rest = hfg.Output(int)

    def process(self, value: int) -> None:
        """Send on one or both ways."""
        if value % 3 == 0:
            self.out.send(value)
        if value % 2 == 0:
            self.rest.send(value)


def _say(port: OutputPort[int], way: str, value: int) -> int | None:
    """Answer by an output in one of the ways there are; the caller must return the result."""
    match way:
        case "return":
            return value
        case "either" if value % 2:
            return value
        case "stamped":
            port.send(value, stamp=float(value))
        case "held":
            port.send(value, activity=0)
        case "given":
            port.send(value, activity=1 if value % 2 else None)
        case "taken":
            port.send(value, activity=-1 if value % 2 else None)
        case "token":
            port.send(hfg.Token(value, 0, 0.5))
        case "both":  # an error: once is enough
            port.send(value)
            return value
        case "seldom" if value % 3:
            pass
        case _:
            port.send(value)
    return None


WAYS = ("send", "return", "either", "seldom", "stamped", "held", "given", "taken", "token")
"""How a node may answer: by `send`, by what it returns, by one or the other, with a stamp, with a token ..."""


PAUSES = ("none", "turn", "wait", "mixed")
"""What async code does before it answers: nothing, let others have a turn, wait, or one and then the other."""


async def _pause(pause: str, value: int) -> None:
    if pause == "turn" or (pause == "mixed" and value % 3 == 1):
        await asyncio.sleep(0)
    elif pause == "wait" or (pause == "mixed" and value % 3 == 2):
        await asyncio.sleep(0.002)


class Speaks(hfg.Node):
    """Answers by its one output, in the way that it is given."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    way = hfg.Parameter("send")

    def process(self, value: int) -> int | None:
        """Delegate to a helper function."""
        return _say(self.out, self.way, value)


class SpeaksLater(hfg.Node):
    """The same from async code, before or after a pause; or in a task of its own."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    way = hfg.Parameter("send")
    pause = hfg.Parameter("turn")
    by_task = hfg.Parameter(False)

    async def process(self, value: int) -> int | None:
        """Delegate to a helper function."""
        if self.by_task:
            task = asyncio.create_task(self.answer(value))
            await _pause(self.pause, value)
            return await task
        return await self.answer(value)

    async def answer(self, value: int) -> int | None:
        """Pause, then answer; four comes before the pause."""
        if value == 4:
            answer = _say(self.out, self.way, value)
            await _pause(self.pause, value)
            return answer
        await _pause(self.pause, value)
        return _say(self.out, self.way, value)


class SpeaksTwice(hfg.Node):
    """Answers by two outputs: by one as it is given, by the other mostly by what it returns."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rest = hfg.Output(int)
    way = hfg.Parameter("send")

    def process(self, value: int) -> tuple[int | None, int | None] | None:
        """Send and return."""
        answer = _say(self.out, self.way, value)
        if value % 2:
            self.rest.send(-value)
            return None if answer is None else (answer, None)
        return answer, value


class SpeaksTwiceLater(hfg.Node):
    """The same from async code."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rest = hfg.Output(int)
    way = hfg.Parameter("send")
    pause = hfg.Parameter("turn")

    async def process(self, value: int) -> tuple[int | None, int | None] | None:
        """Send by one, pause, then send by the other and return."""
        if value % 2:
            self.rest.send(-value)
        await _pause(self.pause, value)
        answer = _say(self.out, self.way, value)
        if value % 2:
            return None if answer is None else (answer, None)
        return answer, value


class Talks(hfg.Node):
    """A source as a class that answers in the way that it is given."""

    out = hfg.Output(int)
    count = hfg.Parameter(3)
    way = hfg.Parameter("send")
    at = hfg.State(0)

    def process(self) -> int | None:
        """Return the next number."""
        if self.at >= self.count:
            raise hfg.EndOfStream
        self.at += 1
        return _say(self.out, self.way, self.at)


class TalksLater(hfg.Node):
    """The same from async code."""

    out = hfg.Output(int)
    count = hfg.Parameter(3)
    way = hfg.Parameter("send")
    pause = hfg.Parameter("turn")
    at = hfg.State(0)

    async def process(self) -> int | None:
        """Return the next number."""
        if self.at >= self.count:
            raise hfg.EndOfStream
        self.at += 1
        await _pause(self.pause, self.at)
        return _say(self.out, self.way, self.at)


class Draws(hfg.Node):
    """The same as a generator: what it sends before it yields leaves with that."""

    out = hfg.Output(int)
    count = hfg.Parameter(3)
    way = hfg.Parameter("send")

    def process(self) -> Iterator[int | None]:
        """Yield the numbers."""
        for number in range(1, self.count + 1):
            yield _say(self.out, self.way, number)


class Lends(hfg.Node):
    """Fills an array that its output lends, and sends it."""

    value = hfg.Input(int)
    out = hfg.Output(NDArray[np.int64])

    def process(self, value: int) -> None:
        """Fill it."""
        array = self.out.loan(2, np.int64)
        array[:] = value
        self.out.send(array)


class LendsLater(hfg.Node):
    """The same from async code: it borrows before a pause and sends after it."""

    value = hfg.Input(int)
    out = hfg.Output(NDArray[np.int64])
    pause = hfg.Parameter("turn")

    async def process(self, value: int) -> None:
        """Fill it, late."""
        array = self.out.loan(2, np.int64)
        await _pause(self.pause, value)
        array[:] = value
        self.out.send(array)


@hfg.node
def unlent(array: NDArray[np.int64]) -> int:
    """Return what is in an array that was lent."""
    return int(array[0])


class Utters(hfg.Node):
    """Lives by its slot, whose helper triggers; every third value it would send, which is not for a slot (F9)."""

    said = hfg.Event(int)
    out = hfg.Output(int)
    calls = hfg.State(0)

    @hfg.slot
    def utter(self, value: int) -> None:
        """Leave it to the helper; a few times, so that rings end."""
        self.calls += 1
        if self.calls <= 12:
            self.help(value)

    def help(self, value: int) -> None:
        """Trigger, or try to send."""
        if value % 3 == 2:
            self.out.send(value)
        self.said.trigger(value)


class UttersLater(hfg.Node):
    """The same from async code."""

    said = hfg.Event(int)
    out = hfg.Output(int)
    pause = hfg.Parameter("turn")
    calls = hfg.State(0)

    @hfg.slot
    async def utter(self, value: int) -> None:
        """Pause, then leave it to the helper; a few times, so that rings end."""
        self.calls += 1
        if self.calls <= 8:
            await _pause(self.pause, value)
            await self.help(value)

    async def help(self, value: int) -> None:
        """Trigger, or try to send."""
        if value % 3 == 2:
            self.out.send(value)
        self.said.trigger(value)


class Pairs(hfg.Node):
    """A source with two outputs: numbers up to `count` by one, their opposites by the other but for every third."""

    out = hfg.Output(int)
    rest = hfg.Output(int)
    count = hfg.Parameter(3)
    at = hfg.State(0)

    def process(self) -> None:
        """Send the next pair."""
        if self.at >= self.count:
            raise hfg.EndOfStream
        self.at += 1
        self.rest.send(-self.at)
        if self.at % 3:
            self.out.send(self.at)


class PassingLater(hfg.Node):
    """Passes tokens on, after a pause, or again with the next."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    pause = hfg.Parameter("turn")

    async def process(self, value: hfg.Token[int]) -> hfg.Token[int] | None:
        """Send it or return it."""
        await _pause(self.pause, value.value)
        if value.value % 2:
            return value
        self.out.send(value)
        return None


class Attentive(hfg.Node):
    """A relay that listens only while it is active; every answer may take the activity along."""

    said = hfg.Event(int)
    gave_up = hfg.Event()
    calls = hfg.State(0)

    @hfg.slot(while_active=True)
    def say(self, value: int) -> None:
        """Pass the value on, a few hundred times at most, so that rings end."""
        self.calls += 1
        if self.calls > 12:
            self.gave_up.trigger()
        else:
            self.said.trigger(value)

    @hfg.slot(while_active=True)
    async def hand_on(self, token: hfg.Token[int]) -> None:
        """Pass the token on."""
        self.calls += 1
        if self.calls <= 12:
            self.said.trigger(token)


class Effort(enum.Enum):
    """What a parameter chooses from."""

    LITTLE = 1
    MUCH = 2


Turn = Annotated[NDArray[np.float64], Shape(2, 2)]


class Tuned(hfg.Node):
    """Has a parameter of every kind that is not a plain number or text, and adds up their values."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    soft = hfg.Parameter(False)
    effort = hfg.Parameter(Effort.LITTLE, shown_if="soft")
    code = hfg.Parameter(8, choices={"Otsu": 8, "Plain": 0}, shown_if={"effort": Effort.MUCH})
    sides = hfg.Parameter(frozenset(), type=frozenset[Literal["left", "right"]])
    picks = hfg.Parameter([], choices=("a", "b", "c"), type=list[str])
    share = hfg.Parameter(0.5, Interval(ge=0, le=1), unit="m", step=0.25, group="numbers/few")
    band = hfg.Parameter(hfg.Span(0, 3), Interval(ge=-9, le=9), shown_if={"share": Gt(0.25)})
    frame = hfg.Parameter(hfg.Colour(255, 128, 0))
    file = hfg.Parameter(Path("a.png"), pattern="*.png *.jpg", save=True)
    folder = hfg.Parameter(None, type=Path | None, directory=True)
    gains = hfg.Parameter((0, 1, 2))
    turn = hfg.Parameter(np.eye(2), type=Turn)
    names = hfg.Parameter([], type=list[str])
    press = hfg.Parameter(trigger=True)
    done = hfg.Parameter(0.0, Interval(ge=0, le=1), read_only=True)
    said = hfg.Parameter("", read_only=True)

    def process(self, value: int) -> int:
        """Return the value and all that is set, and say so."""
        self.done = (self.done + 0.25) % 1
        numbers = [
            self.soft,
            self.effort.value,
            self.code,
            len(self.sides),
            *map(ord, self.picks),
            round(4 * self.share),
        ]
        numbers += [*self.band, *self.frame, len(str(self.file)), len(str(self.folder)), *self.gains]
        numbers += [int(self.turn.sum()), sum(map(len, self.names))]
        self.said = f"{value}: {sum(numbers)}"
        return value + sum(numbers)


class Unsteady(hfg.Node):
    """Waits, and fails as often for a token as its value says; now and then it has sent a signal before."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    tried = hfg.Event(int)
    pause_s = hfg.Parameter(0.003)

    def setup(self) -> None:
        """Nothing was tried so far: tokens are distinguished by stamp and number, values may come again."""
        self.tries: dict[tuple[float, int, int], int] = {}

    async def process(self, value: hfg.Token[int]) -> int:
        """Fail at the first tries; a signal leaves amid the second, so that there is no third."""
        tries = _one_more(self.tries, value)
        if tries % 2 and tries <= value.value % 4:
            self.out.send(-tries)  # it is thrown away
        await asyncio.sleep(self.pause_s)
        if tries == 2 and value.value % 5 == 3:
            self.tried.trigger(tries)
        if tries <= value.value % 4:
            raise ConnectionError(f"try {tries} of {value.value}")
        return value.value + tries


class Stubborn(hfg.Node):
    """Fails as often for a token as its value says, without waiting.

    Its counts survive resets: with a `setup()` to forget it, which takes its time in a thread, the reset of a subgraph
    would not be a single moment.
    """

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: hfg.Token[int]) -> int:
        """Fail, or answer."""
        tries = _one_more(self.__dict__.setdefault("tries", {}), value)
        if tries <= value.value % 3:
            raise ConnectionError(f"try {tries} of {value.value}")
        return value.value + tries


def _one_more(tries: dict[tuple[float, int, int], int], token: hfg.Token[int]) -> int:
    which = (token.stamp, token.sequence, token.value)
    tries[which] = tries.get(which, 0) + 1
    return tries[which]


class LastWord(hfg.Node):
    """Keeps its activity until its end, and sends its last tokens against it."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    left = hfg.Event(int)

    def process(self, value: int) -> None:
        """Hold the activity back."""
        self.out.send(value, activity=0)

    def end(self) -> None:
        """Say it on both ways, with -1 if active."""
        self.out.send(99, activity=-1 if self.active else None)
        self.left.trigger(99)


class Hums(hfg.Node):
    """A source without end."""

    out = hfg.Output(int)
    tone = hfg.Parameter(1)

    def process(self) -> int:
        """Return the tone."""
        return self.tone


class Clings(hfg.Node):
    """Never comes back from its teardown."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        """Pass the value on."""
        return value

    async def teardown(self) -> None:
        """Wait until it is cancelled."""
        await asyncio.Event().wait()


class Tends(hfg.Node):
    """Starts a task for each value and each call, which speaks later, twice or for whom there is room, or fails."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    later = hfg.Event(int)
    pause_s = hfg.Parameter(0.003)
    heard: Any = hfg.State(0)

    def process(self, value: int) -> int:
        """Pass the value on and leave the rest to the task."""
        self.start_soon(self.speak(value))
        return value

    @hfg.slot
    def hear(self) -> None:
        """Start one more; of the first two calls, so that rings end."""
        self.heard += 1
        if self.heard <= 2:
            self.start_soon(self.speak(10 * self.heard))

    async def speak(self, value: int) -> None:
        """Wait, then signal; every third value fails, and even ones say more."""
        await asyncio.sleep(self.pause_s)
        if value % 3 == 0:
            raise ValueError(f"cannot do {value}")
        self.later.trigger(value)
        if value % 2 == 0:
            await asyncio.sleep(2 * self.pause_s)
            await self.later.trigger_wait(-value)
            self.later.trigger(value)


class Beats(hfg.Node):
    """Speaks by a task of its `setup()` a few times, and lives by its slot."""

    beat = hfg.Event(int)
    pause_s = hfg.Parameter(0.003)
    heard: Any = hfg.State(0)

    def setup(self) -> None:
        """Begin."""
        self.start_soon(self.beats())

    async def beats(self) -> None:
        """Speak three times."""
        for number in range(1, 4):
            await asyncio.sleep(self.pause_s)
            self.beat.trigger(number)

    @hfg.slot
    def hear(self) -> None:
        """Count."""
        self.heard += 1


class Ticks(hfg.Node):
    """A source that tells every so often by an event, and is called."""

    out = hfg.Output(int)
    go = hfg.Event(int)
    count = hfg.Parameter(8)
    every = hfg.Parameter(3)
    at = hfg.State(0)

    def process(self) -> int | None:
        """Return the next number; every fourth is silence."""
        if self.at >= self.count:
            raise hfg.EndOfStream
        self.at += 1
        if self.at % self.every == 0:
            self.go.trigger(self.at)
        return self.at if self.at % 4 else None

    @hfg.slot
    def nudge(self, value: Any) -> None:
        """Hear it, no more."""


class Lives(hfg.Node):
    """Fires, tells every so often by an event, and is called: what a state of a mission does."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    go = hfg.Event(int)
    every = hfg.Parameter(2)
    count = hfg.State(0)

    def process(self, value: int) -> int | None:
        """Return the value; what five divides is silence."""
        self.count += 1
        if self.count % self.every == 0:
            self.go.trigger(value)
        return value if value % 5 else None

    @hfg.slot
    def nudge(self, value: Any) -> None:
        """Hear it, no more."""


class LivesTwice(hfg.Node):
    """The same with two inputs and two outputs, by which it sends."""

    value = hfg.Input(int)
    other = hfg.Input(int, optional=True)
    out = hfg.Output(int)
    rest = hfg.Output(int)
    go = hfg.Event(int)

    def process(self, value: int, other: int | None = None) -> None:
        """Send by one, or by both and tell."""
        self.out.send(value)
        if other:
            self.rest.send(other)
            self.go.trigger(other)

    @hfg.slot
    def nudge(self, value: Any) -> None:
        """Hear it, no more."""


class Heeds(hfg.Node):
    """Lives by two slots, one of which listens only while it is active; triggers every few calls."""

    go = hfg.Event(int)
    every = hfg.Parameter(2)
    count = hfg.State(0)

    @hfg.slot
    def nudge(self, value: Any) -> None:
        """Count, and tell."""
        self.count += 1
        if self.count % (1 + self.every) == 0:
            self.go.trigger(self.count)

    @hfg.slot(while_active=True)
    def hear(self, value: Any) -> None:
        """Hear it, no more."""


class Works(hfg.Node):
    """Works while it is active, in one of several manners, a few times; passes on what comes meanwhile."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    told = hfg.Event(int)
    manner = hfg.Parameter("later")
    pause_s = hfg.Parameter(0.003)
    begun: Any = hfg.State(0)

    def process(self, value: int) -> int:
        """Pass the value on."""
        return value

    @hfg.slot
    def hear(self) -> None:
        """Do nothing; the signal may carry activity."""

    async def do(self) -> int:
        """Return at once or later, tell something, fail, resist its end or work for long; so often that rings end."""
        self.begun += 1
        if self.begun > 3:
            await asyncio.sleep(0.05)
            raise ValueError("that is enough")
        match self.manner:
            case "later":
                await asyncio.sleep(self.pause_s)
            case "tells":
                self.told.trigger(self.begun)
                await asyncio.sleep(self.pause_s)
                await self.told.trigger_wait(-self.begun)
            case "fails":
                await asyncio.sleep(self.pause_s)
                raise ValueError(f"cannot do it for the {self.begun}. time")
            case "resists" | "clings" | "stays":
                await self._resist()
            case "long":
                await asyncio.sleep(0.3)
        return int(self.begun)

    async def _resist(self) -> None:
        try:
            await asyncio.sleep(4 * self.pause_s)
        except asyncio.CancelledError:
            await asyncio.sleep(self.pause_s)
            self.told.trigger(100 + int(self.active))
            if self.manner == "resists":
                raise
            while self.manner == "stays":
                with contextlib.suppress(asyncio.CancelledError):
                    await asyncio.sleep(1.0)


class Gate(hfg.Node):
    """Asks by an event and hears the answers by a slot: a ring, held open by nothing but the queue of what it asks.

    The `how` says what asks: the slot that begins, a task, both, or each answer once more.
    """

    request = hfg.Event(int)
    aside = hfg.Event(int)
    count = hfg.Parameter(5)
    how = hfg.Parameter("burst")
    begun: Any = hfg.State(0)
    heard: Any = hfg.State(0)

    @hfg.slot
    def begin(self) -> None:
        """Ask; once, so that rings end."""
        self.begun += 1
        if self.begun > 1:
            return
        if self.how in ("task", "both"):
            self.start_soon(self.pump(self.count))
        if self.how in ("burst", "both", "again"):
            for number in range(self.count):
                self.request.trigger(number)
            self.aside.trigger(-1)

    async def pump(self, count: int) -> None:
        """Ask as fast as there is room, and say something else now and then."""
        for number in range(count):
            await self.request.trigger_wait(10 + number)
            if number % 3 == 2:
                self.aside.trigger(number)
        self.aside.trigger(-2)

    @hfg.slot
    def answer(self, value: int) -> None:
        """Count; perhaps ask twice more for each of the first answers."""
        self.heard += 1
        if self.how == "again" and self.heard <= 4:
            self.request.trigger(value + 1)
            self.request.trigger(value + 2)


class Watch(hfg.Node):
    """Runs alongside everything else: a task whose signals have no particular receiver, for longer than most."""

    tick = hfg.Event(int)
    period_s = hfg.Parameter(0.02)
    count = hfg.Parameter(6)
    greets = hfg.Parameter(False)

    def setup(self) -> None:
        """Start; the start of the task is invisible, so the parameters are read here, before any edit."""
        if self.greets:
            self.tick.trigger(-1)
        self.start_soon(self.ticks(self.count, self.period_s))

    async def ticks(self, count: int, period_s: float) -> None:
        """Tell the time."""
        for number in range(count):
            await asyncio.sleep(period_s)
            self.tick.trigger(number)


@hfg.node
def listed(value: int) -> list[list[int]]:
    """Make lists of a value, empty ones too."""
    return [[value] * (number % 3) for number in range(value % 4)]


@hfg.node
def summed(lists: list[list[int]]) -> int:
    """Return the sum of all that is in the lists."""
    return sum(map(sum, lists))


class EachOfThose(hfg.Subgraph):
    """For each of a list: twice what is even, later; silence of the others."""

    each = hfg.Input(int)
    given = hfg.Output(int)
    iterate_over = ("each",)

    def build(self, graph: hfg.Graph) -> None:
        """Draw it."""
        self.each.inner >> graph.add(some()) >> graph.add(slow_double(pause_s=0.001)) >> self.given.inner


class EachOfEach(hfg.Subgraph):
    """For each list of a list what `EachOfThose` does."""

    lists = hfg.Input(list[int])
    given = hfg.Output(list[int])
    iterate_over = ("lists",)

    def build(self, graph: hfg.Graph) -> None:
        """Draw it."""
        self.lists.inner >> graph.add(EachOfThose()) >> self.given.inner

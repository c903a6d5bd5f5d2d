"""Two readings of the rules: the same small graphs for the engine and for the oracle.

What is expected was counted out on paper from the rules alone, before either was asked.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from typing import Any

import pytest
import reactivex.operators as ops

import hfg
from hfg import END, NO_MESSAGE
from hfg.testing import Recorder, recorder
from hfg.testing.nodes import (
    AsyncRelay,
    Doubter,
    Relay,
    Scaled,
    Script,
    Tally,
    add,
    ascript,
    double,
    script,
    sink,
    slow_double,
)
from hfg.trace import RunEnded, TokenSent
from tests.semantics.nodes import drive, forward
from tests.semantics.readings import signs, starts

# --- F5, F6: pipelined means taken


@pytest.mark.rule("F5")
@pytest.mark.parametrize(
    ("release", "expected"),
    [
        # While the consumer works on one value the source makes the next.
        ("pipelined", [1.0, 2.0, 3.0]),
        # The source begins with the next when the consumer is done.
        ("sequential", [1.0, 3.0, 5.0]),
    ],
)
def test_a_pipelined_producer_works_while_its_consumer_does(perform: Any, release: Any, expected: list[float]) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.add(ascript(values=(1, 2, 3), pause_s=1.0)) >> graph.add(slow_double(pause_s=1.0), release=release)
        return graph

    assert perform(build, lambda seen: starts(seen, "slow_double", kind="process")) == expected


@pytest.mark.rule("F5", "P4")
def test_pipelined_is_still_one_token_on_the_edge(perform: Any) -> None:
    """One under work and one waiting, never two waiting."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.add(script(values=(1, 2, 3))) >> graph.add(slow_double(pause_s=1.0), release="pipelined")
        return graph

    # The first is taken at once, so the second can be made at once; the third when that is taken, and so on.
    assert perform(build, lambda seen: starts(seen, "script")) == [0.0, 0.0, 1.0, 2.0]


@pytest.mark.rule("F5")
def test_sequential_waits_through_a_pipelined_node_only_until_its_tokens_are_taken(perform: Any) -> None:
    """The wave of the source is over as soon as the slow end of the chain has taken what the middle made of it."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        (
            graph.add(script(values=(1, 2, 3)))
            >> graph.add(double())
            >> graph.add(slow_double(pause_s=1.0), release="pipelined")
        )
        return graph

    assert perform(build, lambda seen: starts(seen, "script")) == [0.0, 0.0, 1.0, 2.0]


@pytest.mark.rule("F6")
def test_a_pipelined_slot_frees_the_output_when_the_call_takes_the_token(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, relay = graph.add(script(values=(1, 2, 3))), graph.add(AsyncRelay(), release="pipelined")
        graph.connect(source.out, relay.say)
        return graph

    assert perform(build, lambda seen: starts(seen, "script")) == [0.0, 0.0, 0.005, 0.01]


# --- P4: a buffer is a row of relays


@pytest.mark.slow
@pytest.mark.rule("P4")
@pytest.mark.parametrize(
    ("release", "buffer", "expected"),
    [
        ("sequential", 0, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
        ("sequential", 2, [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]),
        ("pipelined", 0, [0.0, 0.0, 1.0, 2.0, 3.0, 4.0]),
        ("pipelined", 2, [0.0, 0.0, 0.0, 0.0, 1.0, 2.0]),
    ],
)
def test_with_a_buffer_the_producer_runs_ahead(perform: Any, release: Any, buffer: int, expected: list[float]) -> None:
    def buffered() -> hfg.Graph:
        graph = hfg.Graph()
        source, slow = graph.add(script(values=(1, 2, 3, 4, 5))), graph.add(slow_double(pause_s=1.0), release=release)
        graph.connect(source.out, slow.value, buffer=buffer)
        return graph

    def relayed() -> hfg.Graph:
        graph = hfg.Graph()
        last: Any = graph.add(script(values=(1, 2, 3, 4, 5)))
        for _ in range(buffer):
            last >> (relay := graph.add(forward(), release="pipelined"))
            last = relay
        last >> graph.add(slow_double(pause_s=1.0), release=release)
        return graph

    assert perform(relayed, lambda seen: starts(seen, "script")) == expected
    assert perform(buffered, lambda seen: starts(seen, "script")) == expected
    assert perform(buffered, lambda seen: starts(seen, "slow_double", kind="process")) == [0.0, 1.0, 2.0, 3.0, 4.0]


@pytest.mark.rule("P4", "A6")
def test_modifiers_travel_through_a_buffer_with_their_tokens(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, slow = graph.add(Says(signs=(None, None, 1, None))), graph.add(slow_double(pause_s=1.0))
        graph.connect(source.out, slow.value, active=True, buffer=3)
        return graph

    found = perform(build, lambda seen: (signs(seen, "says.out -> slow_double.value"), seen.activity()))
    assert found == ([(1, 0), (2, 0), (3, 1), (4, 0), (END, 0)], [(2.0, "slow_double", True)])


@pytest.mark.rule("P4", "F5")
def test_a_buffer_ends_the_wave_in_front_of_it_as_a_pipelined_relay_does(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, middle = graph.add(script(values=(1, 2, 3))), graph.add(double())
        source >> middle
        graph.connect(middle.out, graph.add(slow_double(pause_s=1.0)).value, buffer=1)
        return graph

    # The second lies in the buffer while the first is worked on; the third is made, and waits at the middle's output.
    assert perform(build, lambda seen: starts(seen, "double")) == [0.0, 0.0, 1.0, 2.0]


@pytest.mark.rule("P4", "F12")
def test_what_lies_in_a_buffer_before_a_node_that_ends_is_drained(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        total = graph.add(add())
        graph.connect(graph.add(ascript(values=(1,), pause_s=1.0)).out, total.a)
        graph.connect(graph.add(script(values=(1, 2, 3, 4))).out, total.b, buffer=5)
        return graph

    def read(seen: Recorder) -> Any:
        edge = "script.out -> add.b"
        return seen.outcome, seen.taken(edge), seen.dropped(edge), seen.drained(edge)

    assert perform(build, read) == ("done", [1, 2], [2], [3, 4, END])


# --- P7: a delay ends the wave


@pytest.mark.rule("P7")
@pytest.mark.parametrize(
    ("initial", "expected"), [((), [0.0, 1.0, 2.0, 3.0]), ((0,), [0.0, 0.0, 1.0, 2.0]), ((0, 0), [0.0, 0.0, 1.0, 2.0])]
)
def test_a_delay_ends_a_sequential_wave(perform: Any, initial: tuple[int, ...], expected: list[float]) -> None:
    """A source, a middle, and behind the delay somebody slow, sequential all of them.

    Without a delay the source waits for all three. With one it waits until no more lies there than there was at first.
    """

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, middle = graph.add(script(values=(1, 2, 3))), graph.add(double())
        source >> middle
        slow = graph.add(slow_double(pause_s=1.0), release="sequential")
        graph.connect(middle.out, slow.value, initial=initial)
        return graph

    assert perform(build, lambda seen: starts(seen, "script")) == expected


# --- P8: parameters change between firings


class Looks(hfg.Node):
    """Takes a second, and reads its parameter before and after."""

    value = hfg.Input(int)
    seen = hfg.Output(tuple[int, int])
    gain = hfg.Parameter(1)

    async def process(self, value: int) -> tuple[int, int]:
        before = self.gain
        await asyncio.sleep(1.0)
        return before, self.gain


class Once(hfg.Node):
    """Triggers its event after half a second, once."""

    rung = hfg.Event(int)
    done = hfg.State(False)

    async def process(self) -> None:
        if self.done:
            raise hfg.EndOfStream
        await asyncio.sleep(0.5)
        self.done = True
        self.rung.trigger(7)


@hfg.node
def pairs(value: tuple[int, int]) -> None:
    """Take them."""


def looking() -> hfg.Graph:
    graph = hfg.Graph()
    looks = graph.add(Looks())
    graph.add(script(values=(1, 2))) >> looks.value
    looks.seen >> graph.add(pairs()).value
    return graph


@pytest.mark.rule("P8")
def test_a_signal_sets_a_parameter_between_firings_and_no_firing_waits_for_it(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = looking()
        graph.connect(graph.add(Once()).rung, graph["looks"].ports.parameters["gain"])
        return graph

    found = perform(build, lambda seen: (seen.values("looks.seen -> pairs.value"), starts(seen, "looks")))
    assert found == ([(1, 1), (7, 7), END], [0.0, 1.0, 2.0])


@pytest.mark.rule("P8")
def test_a_parameter_that_is_set_from_outside_waits_for_the_end_of_the_firing() -> None:
    seen = recorder()

    async def main() -> None:
        graph = looking()
        async with hfg.running(graph, trace=seen) as run:
            await asyncio.sleep(0.5)
            run.set(graph["looks"].ports.parameters["gain"], 7)
            await run.wait_finished()

    drive(main)
    assert seen.values("looks.seen -> pairs.value") == [(1, 1), (7, 7), END]


@hfg.node
def endless(*, value: int = 1) -> Iterator[int]:
    while True:
        yield value


@pytest.mark.rule("P8")
def test_a_generator_function_s_own_parameter_is_refused_with_the_remedy() -> None:
    async def main() -> None:
        graph = hfg.Graph()
        source = graph.add(endless(), max_rate_hz=10.0)
        source >> graph.add(sink())
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.25)
            with pytest.raises(hfg.errors.HfgError, match=r"endless\.value.*reset|endless\.value.*class"):
                run.set(source.ports.parameters["value"], 9)

    drive(main)


# --- P9: operators lose nothing, and complete with their node


def _is_not_two(token: hfg.Token[int]) -> bool:
    return token.value != 2


@pytest.mark.rule("P9")
@pytest.mark.parametrize(
    ("operator", "expected"),
    [
        (lambda: ops.start_with(0), [0, 1, 2, 3]),
        (lambda: ops.retry(2), [1, 2, 3]),
        (lambda: ops.filter(_is_not_two), [1, 3]),
    ],
    ids=["start_with", "retry", "filter"],
)
def test_operators_are_connected_before_the_first_firing(perform: Any, operator: Any, expected: list[int]) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, tally = graph.add(Script(count=3, every=1)), graph.add(Tally())
        graph.connect(source.seen, tally.note, through=[operator()])
        return graph

    assert perform(build, lambda seen: seen.values("script.seen -> tally.note")) == expected


@pytest.mark.rule("P9")
def test_an_event_completes_when_its_node_has_ended_though_others_go_on(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, tally = graph.add(Script(count=2, every=1)), graph.add(Tally())
        graph.connect(source.seen, tally.note, through=[ops.buffer_with_count(4), ops.map(len)])
        graph.add(ascript(values=(1, 2), pause_s=1.0)) >> graph.add(sink())
        return graph

    def read(seen: Recorder) -> Any:
        edge = "script.seen -> tally.note"
        return [(one.time, one.token.value) for one in seen.of(TokenSent) if one.edge == edge], seen[-1].time

    assert perform(build, read) == ([(0.0, 2)], 2.0)


# --- F3: on its edges before any subscriber hears of it


class Says(hfg.Node):
    """A source: 1, 2, 3 ... with the given explicit modifiers; None lets A3 decide."""

    out = hfg.Output(int)
    signs = hfg.Parameter[tuple[int | None, ...]]((None,))
    at = hfg.State(0)

    def process(self) -> None:
        if self.at == len(self.signs):
            raise hfg.EndOfStream
        self.at += 1
        self.out.send(self.at, activity=self.signs[self.at - 1])


class Echo(hfg.Node):
    said = hfg.Event(int)

    @hfg.slot
    def hit(self, value: int) -> None:
        self.said.trigger(value)


@pytest.mark.rule("F3")
def test_a_signal_is_on_its_edges_before_a_subscriber_answers_it() -> None:
    seen = recorder()

    async def main() -> None:
        graph = hfg.Graph()
        echo, tally = graph.add(Echo()), graph.add(Tally())
        graph.connect(echo.said, tally.note)
        async with hfg.running(graph, trace=seen) as run:
            echo.said.subscribe(lambda token: echo.said.trigger(token.value + 1) if token.value < 3 else None)
            await run.trigger(echo.hit, 0)
            await run.wait_finished()

    drive(main)
    assert seen.values("echo.said -> tally.note") == [0, 1, 2, 3]


# --- F4: the last firing


class Farewell(hfg.Node):
    """Has something to say at its end."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    gain = hfg.Parameter(3)

    def process(self, value: int) -> int:
        return value

    def end(self) -> None:
        self.out.send(99)


@pytest.mark.rule("F4", "P8")
def test_in_the_firing_of_the_end_parameters_are_silent(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(Farewell())
        graph.add(script(values=(1,))) >> node.value
        graph.connect(node.out, graph.add(sink(), name="values").value)
        graph.connect(node.ports.parameters["gain"], graph.add(sink(), name="gains").value)
        return graph

    found = perform(
        build,
        lambda seen: (seen.values("farewell.out -> values.value"), seen.values("farewell.gain -> gains.value")),
    )
    assert found == ([1, 99, END], [3, NO_MESSAGE, END])


@pytest.mark.rule("F4", "A5", "T4")
@pytest.mark.parametrize(("last_word", "expected"), [(True, [(99, 1), (END, 0)]), (False, [(END, 1)])])
def test_end_is_a_sending_of_its_own(perform: Any, last_word: bool, expected: list[tuple[Any, int]]) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node: Any = graph.add(Farewell() if last_word else double(), name="node")
        graph.add(script(values=())) >> node.value
        graph.start.activates(node.activate)
        graph.connect(node.out, graph.add(sink()).value, active=True)
        return graph

    assert perform(build, lambda seen: signs(seen, "node.out -> sink.value")) == expected


# --- F10, A10: the beginning


@pytest.mark.rule("F10", "P7")
def test_a_node_that_is_disabled_from_the_start_discards_its_initial_tokens(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        total = graph.add(add(), enabled=False)
        graph.connect(graph.add(Script(count=1, every=1)).seen, total.a, initial=[5])
        graph.connect(graph.add(script(values=(1,))).out, total.b, initial=[6])
        return graph

    assert perform(
        build, lambda seen: (seen.outcome, seen.dropped("script.seen -> add.a"), seen.dropped("script_2.out -> add.b"))
    ) == ("done", [5], [6])


@pytest.mark.rule("F10", "P7")
def test_what_lies_behind_a_node_that_is_disabled_from_the_start_goes_as_if_it_were_disabled_now(perform: Any) -> None:
    """An initial token of its output is untaken and goes; a signal stays, though it has sent neither."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source = graph.add(Script(count=1, every=1), enabled=False)
        graph.connect(source.out, graph.add(sink(), name="told").value, initial=[5])
        graph.connect(source.seen, graph.add(sink(), name="heard").value, initial=[6])
        return graph

    def read(seen: Recorder) -> Any:
        edges = ("script.out -> told.value", "script.seen -> heard.value")
        return seen.outcome, [(seen.dropped(edge), seen.taken(edge)) for edge in edges]

    assert perform(build, read) == ("done", [([5], []), ([], [6])])


class Early(hfg.Node):
    """Triggers while it is set up."""

    ready_now = hfg.Event(int)

    def setup(self) -> None:
        self.ready_now.trigger(1)


@pytest.mark.rule("A10", "F9")
def test_the_signals_of_start_lie_on_their_edges_before_a_source_is_enabled(perform: Any) -> None:
    """A source that `start` activates is active in its first firing, whatever others do while they are set up."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, early = graph.add(script(values=(1, 2))), graph.add(Early())
        graph.connect(early.ready_now, graph.add(Tally()).note)
        graph.start.activates(source.activate)
        graph.connect(source.out, graph.add(sink()).value, active=True)
        return graph

    assert perform(build, lambda seen: signs(seen, "script.out -> sink.value")) == [(1, 1), (2, 0), (END, 0)]


# --- F11: a grid


@hfg.node
async def paced(*, pauses: tuple[float, ...] = ()) -> AsyncIterator[int]:
    """Pause before each value, counted from when the one before was processed."""
    for at, pause in enumerate(pauses):
        await asyncio.sleep(pause)
        yield at


@pytest.mark.rule("F11")
def test_a_late_start_does_not_move_the_grid_and_what_was_missed_is_not_made_up(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.add(paced(pauses=(0.25, 1.5, 0.1, 2.5, 0.0, 0.0))) >> graph.add(double(), max_rate_hz=1.0)
        return graph

    # Due at 0.25, 1.25, 2.25 ...; ready at 0.25, 1.75, 1.85, 4.75, and then at once.
    assert perform(build, lambda seen: starts(seen, "double", kind="process")) == [0.25, 1.75, 2.25, 4.75, 5.25, 6.25]


# --- F12, F13: behind the end


class LastWord(hfg.Node):
    out = hfg.Output(int)
    at = hfg.State(0)

    def process(self) -> None:
        self.at += 1
        if self.at > 1:
            raise hfg.EndOfStream
        self.out.send(self.at, activity=0)

    def end(self) -> None:
        if self.active:
            self.out.send(99, activity=-1)


class Three(hfg.Node):
    a = hfg.Input(int)
    b = hfg.Input(int)
    c = hfg.Input(int)

    def process(self, a: int, b: int, c: int) -> None: ...


@pytest.mark.rule("F12", "P5", "A4")
def test_tokens_are_drained_in_their_order_and_act_in_it(perform: Any) -> None:
    """Of one edge -1 lies before END, which carries the activity: whoever has ended keeps it."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        first, other, three = (
            graph.add(LastWord(), name="first"),
            graph.add(LastWord(), name="other"),
            graph.add(Three()),
        )
        graph.start.activates(first.activate)
        graph.connect(first.out, three.a)
        graph.connect(first.out, three.b, active=True, initial=(0,))
        graph.connect(other.out, three.c)
        return graph

    found = perform(
        build,
        lambda seen: (signs(seen, "first.out -> three.b"), seen.drained("first.out -> three.b"), seen.active_at_end()),
    )
    assert found == ([(1, 0), (99, -1), (END, 1)], [99, END], ["three"])


class Sometimes(hfg.Node):
    """Four values; with the first and the third also a signal."""

    out = hfg.Output(int)
    rung = hfg.Event(int)
    at = hfg.State(0)

    def process(self) -> None:
        self.at += 1
        if self.at > 4:
            raise hfg.EndOfStream
        if self.at in (1, 3):
            self.rung.trigger(self.at)
        self.out.send(self.at)


class Beside(hfg.Node):
    value = hfg.Input(int)
    beside = hfg.Input(int, optional=True)
    both = hfg.Output(tuple[int, int | None])

    def process(self, value: int, beside: int | None) -> tuple[int, int | None]:
        return value, beside


@hfg.node
def anything(value: object) -> None:
    """Take it."""


@pytest.mark.rule("F13", "F4")
def test_a_signal_behind_the_end_of_its_edge_is_dropped_and_nobody_waits_for_it(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, beside = graph.add(Sometimes()), graph.add(Beside())
        graph.connect(source.out, beside.value)
        graph.connect(source.rung, beside.beside)
        graph.connect(beside.both, graph.add(anything()).value)
        return graph

    found = perform(
        build,
        lambda seen: (
            seen.outcome,
            seen.values("beside.both -> anything.value"),
            seen.dropped("sometimes.rung -> beside.beside"),
        ),
    )
    assert found == ("done", [(1, 1), (2, None), (3, None), (4, None), END], [3])


# --- A4, A5: explicit modifiers


@pytest.mark.rule("A4", "A5")
@pytest.mark.parametrize(
    ("modifiers", "expected", "left"),
    [
        pytest.param((0, None, None), [0, 1, 0, 0], False, id="an explicit 0 holds the activity back"),
        pytest.param((1, None), [1, 0, 0], False, id="an explicit +1 of an active sender takes it"),
        pytest.param((-1, None), [-1, 1, 0], False, id="an explicit -1 does not"),
        pytest.param((0, -1, 0), [0, -1, 0, 1], False, id="END carries what was held back"),
    ],
)
def test_explicit_modifiers_of_an_active_sender(perform: Any, modifiers: Any, expected: list[int], left: bool) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source = graph.add(Says(signs=modifiers))
        graph.start.activates(source.activate)
        graph.connect(source.out, graph.add(sink()).value, active=True)
        return graph

    found = perform(build, lambda seen: [token.activity for token in seen.tokens("says.out -> sink.value")])
    assert found == expected
    assert perform(build, lambda seen: "says" in seen.active_at_end()) is left


@pytest.mark.rule("A4")
def test_an_explicit_plus_of_an_inactive_sender_goes_out_and_takes_nothing(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.connect(graph.add(Says(signs=(1, 1))).out, graph.add(sink()).value, active=True)
        return graph

    found = perform(build, lambda seen: (signs(seen, "says.out -> sink.value"), seen.active_at_end()))
    assert found == ([(1, 1), (2, 1), (END, 0)], ["sink"])


class PassesOn(hfg.Node):
    """Passes on the token itself."""

    said = hfg.Event(int)

    @hfg.slot
    def hear(self, token: hfg.Token[int]) -> None:
        self.said.trigger(token)


@pytest.mark.rule("A4", "A5", "A6")
def test_a_relay_of_tokens_never_doubles_activity(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        one, two = graph.add(PassesOn(), name="one"), graph.add(PassesOn(), name="two")
        graph.connect(graph.add(Says(signs=(1,))).out, one.hear, active=True)
        graph.connect(one.said, two.hear, active=True)
        return graph

    assert perform(build, lambda seen: [change[1:] for change in seen.activity()]) == [
        ("one", True),
        ("one", False),
        ("two", True),
    ]


@pytest.mark.rule("A4", "A3")
def test_a_token_without_a_modifier_that_is_passed_on_counts_as_its_value(perform: Any) -> None:
    """It came over an edge that is not active, so its a = 0 is nobody's word: the activity of who passes it on goes."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, relay, tally = graph.add(Script(count=1, every=1)), graph.add(PassesOn()), graph.add(Tally())
        graph.start.activates(relay.activate)
        graph.connect(source.seen, relay.hear)
        graph.connect(relay.said, tally.note, active=True)
        return graph

    def read(seen: Recorder) -> Any:
        return signs(seen, "passes_on.said -> tally.note"), seen.active_at_end()

    # `start` lies before the relay before anything that a source says.
    assert perform(build, read) == ([(1, 1)], ["tally"])


class Forks(hfg.Node):
    """An explicit +1 on its event, then its output."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    said = hfg.Event(int)

    def process(self, value: int) -> int:
        self.said.trigger(value, activity=1)
        return value


@pytest.mark.rule("A3", "A4", "A5")
def test_what_an_explicit_plus_took_may_still_fork_in_the_same_firing(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        forks = graph.add(Forks())
        graph.add(script(values=(1, 2))) >> forks.value
        graph.start.activates(forks.activate)
        graph.connect(forks.said, graph.add(Tally()).note, active=True)
        graph.connect(forks.out, graph.add(sink()).value, active=True)
        return graph

    found = perform(
        build, lambda seen: (signs(seen, "forks.said -> tally.note"), signs(seen, "forks.out -> sink.value"))
    )
    assert found == ([(1, 1), (2, 1)], [(1, 1), (2, 0), (END, 0)])


# --- R5: sources that work for nobody


class Repeats(hfg.Node):
    """A source without end; whoever is connected to its parameter waits for it."""

    out = hfg.Output(int)
    value = hfg.Parameter(0)

    def process(self) -> int:
        return self.value


@pytest.mark.rule("R5", "F12")
@pytest.mark.parametrize("count", [1, 5])
def test_what_lies_before_a_source_that_is_given_up_is_drained(perform: Any, count: int) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        repeats, total = graph.add(Repeats()), graph.add(add())
        graph.connect(graph.add(script(values=tuple(range(count)))).out, repeats.ports.parameters["value"])
        graph.connect(repeats.out, total.a)
        graph.connect(graph.add(script(values=(1,))).out, total.b)
        return graph

    assert perform(build, lambda seen: seen.outcome) == "done"


@pytest.mark.slow
@pytest.mark.rule("R5", "F12", "F7")
def test_who_feeds_a_source_that_is_given_up_and_others_goes_on_for_those(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        repeats, total, source = graph.add(Repeats()), graph.add(add()), graph.add(script(values=tuple(range(9))))
        graph.connect(source.out, repeats.ports.parameters["value"])
        graph.connect(source.out, graph.add(sink()).value)
        graph.connect(repeats.out, total.a)
        graph.connect(graph.add(script(values=())).out, total.b)
        return graph

    found = perform(build, lambda seen: (seen.outcome, seen.values("script.out -> sink.value")))
    assert found == ("done", [0, 1, 2, 3, 4, 5, 6, 7, 8, END])


@pytest.mark.rule("R5", "F12")
def test_the_slots_of_a_source_that_works_for_nobody_go_on(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        hums, total = graph.add(Hums(), max_rate_hz=10.0), graph.add(add())
        graph.connect(hums.out, total.a)
        graph.connect(graph.add(script(values=())).out, total.b)
        graph.connect(graph.add(ascript(values=(1, 2), pause_s=1.0)).out, hums.note)
        return graph

    assert perform(build, lambda seen: (seen.outcome, seen.calls("hums"))) == ("done", ["note", "note"])


@pytest.mark.rule("R5")
@pytest.mark.parametrize("rate", [None, 10.0])
def test_a_blocked_source_has_stalled_also_beside_one_without_end_that_works_for_nobody(
    perform: Any, rate: float | None
) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        total, never = graph.add(add()), graph.add(add(), name="never")
        graph.connect(graph.add(Repeats(), max_rate_hz=rate).out, total.a)
        graph.connect(graph.add(script(values=())).out, total.b)
        graph.connect(graph.add(script(), name="blocked").out, never.a)
        return graph

    found = perform(build, lambda seen: (seen.outcome, seen.values("blocked.out -> never.a")))
    assert found == ("stalled", [1])


@pytest.mark.slow
@pytest.mark.rule("R5", "F12")
def test_what_works_for_nobody_goes_on_for_whoever_is_set_up_afresh(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        twice = graph.add(EndsItself())
        graph.connect(graph.add(Repeats()).out, twice.value)
        graph.connect(twice.out, graph.add(sink()).value)
        graph.connect(graph.add(ascript(values=(1,), pause_s=1.0)).out, twice.reset)
        return graph

    found = perform(build, lambda seen: (seen.outcome, seen.values("ends_itself.out -> sink.value")))
    assert found == ("done", [0, 0, END, 0, 0, END])


class EndsItself(hfg.Node):
    """Ends when it has passed on two values."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    left = hfg.State(2)

    def ready(self) -> bool:
        if not self.left:
            raise hfg.EndOfStream
        return True

    def process(self, value: int) -> int:
        self.left -= 1
        return value


class Hums(hfg.Node):
    """A source without end that may be spoken to."""

    out = hfg.Output(int)

    def process(self) -> int:
        return 0

    @hfg.slot
    def note(self, value: int) -> None: ...


@pytest.mark.rule("A11", "R5")
def test_a_resting_source_keeps_nothing_alive_beside_one_that_works_for_nobody(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        total, resting = graph.add(add()), graph.add(Repeats(), name="resting")
        graph.connect(graph.add(Repeats()).out, total.a)
        graph.connect(graph.add(script(values=(1, 2))).out, total.b)
        graph.gate(resting, by=graph.add(Relay()))
        return graph

    found = perform(build, lambda seen: (seen.of(RunEnded)[-1].outcome, seen.firings("resting"), seen.firings("add")))
    assert found == ("done", 0, 3)


# --- A9


@pytest.mark.rule("A9", "A4")
def test_processed_carries_activity_that_an_explicit_zero_held_back(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, doubter = graph.add(Says(signs=(0,))), graph.add(Doubter())
        graph.start.activates(source.activate)
        graph.connect(source.out, graph.add(sink()).value, active=True)
        graph.connect(source.processed, doubter.hear, active=True)
        return graph

    found = perform(
        build, lambda seen: (signs(seen, "says.out -> sink.value"), signs(seen, "says.processed -> doubter.hear"))
    )
    assert found == ([(1, 0), (END, 0)], [(None, 1)])


@pytest.mark.rule("P8", "P6")
def test_a_token_sets_a_parameter_as_it_is_taken_also_in_a_silent_firing(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        scaled = graph.add(Scaled())
        graph.connect(graph.add(script(values=(1, None, 1))).out, scaled.value)
        graph.connect(graph.add(script(values=(5, 7, None))).out, scaled.ports.parameters["factor"])
        graph.connect(scaled.out, graph.add(sink()).value)
        return graph

    assert perform(build, lambda seen: seen.values("scaled.out -> sink.value")) == [5, NO_MESSAGE, 7, END]

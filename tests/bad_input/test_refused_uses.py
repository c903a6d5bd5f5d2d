"""Wrong uses as new users make them, by table: each gets one clear sentence that says what is wrong and what to write.

None is silent, and none shows frames of hfg's own in the traceback that the command line prints. `test_how_many` counts
them, together with those that have tests of their own.
"""

from __future__ import annotations

import ast
import asyncio
import inspect
import io
from collections.abc import Callable, Iterator
from contextlib import chdir, redirect_stderr
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from annotated_types import Ge, Interval

import hfg
from hfg import commands
from hfg.cli import show
from hfg.encoding import TokenCodec, decode, encode
from hfg.engine.observing.report import RunPage
from hfg.sharedmemory import Reader, Ring, segment_name, sweep
from hfg.testing import diagrams, explore, fire, reference_run
from hfg.trace import TraceEvent
from tests.cli.conftest import STEPS, Command, command

pytestmark = pytest.mark.slow

__all__ = ["command"]  # a fixture

OURS = str(Path(hfg.__file__).parent)


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    yield from range(count)


@hfg.node
def inc(value: int) -> int:
    return value + 1


class Count(hfg.Node):
    """Sums up."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rang = hfg.Event(int)
    limit = hfg.Parameter(3)
    total = hfg.State(0)

    def process(self, value: int) -> int:
        self.total += value
        return self.total

    @hfg.slot
    def start_at(self, value: int) -> None:
        self.total = value


def build() -> hfg.Graph:
    graph = hfg.Graph("small")
    source, middle, count = graph.add(numbers()), graph.add(inc()), graph.add(Count())
    graph.connect(source.out, middle.ports.inputs["value"])
    graph.connect(middle.out, count.value)
    graph.connect(count.out, graph.output("total", int))
    graph.input("more", int)
    return graph


def build_with(extra: str) -> hfg.Graph:
    return hfg.Graph(extra)


async def build_later() -> hfg.Graph:
    return build()


def virtual(main: Callable[[], Any]) -> Any:
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main())


def running(do: Callable[[Any, Any], Any], *, over: bool = False) -> Callable[[], Any]:
    """Do it with a run, or with one that is over."""

    async def main() -> None:
        graph = build()
        async with hfg.running(graph) as run:
            if not over:
                await answered(do(run, graph))
        if over:
            await answered(do(run, graph))

    async def answered(result: Any) -> None:
        if inspect.isawaitable(result):
            await result

    return lambda: virtual(main)


def fed(do: Callable[[Any], Any]) -> Callable[[], Any]:
    """Do it with a feed of a run."""

    async def main() -> None:
        graph = hfg.Graph("fed")
        graph.connect(graph.input("in", int), graph.add(Count()).value)
        async with hfg.running(graph) as run, run.feed("in") as feed:
            result = do(feed)
            if inspect.isawaitable(result):
                await result

    return lambda: virtual(main)


class Draws(hfg.Node):
    band = hfg.Parameter(hfg.Span(0.2, 0.8), Interval(ge=0, le=1))
    frame = hfg.Parameter(hfg.Colour(255, 128, 0))
    store = hfg.Parameter(Path("a.png"), pattern="*.png")
    offset = hfg.Parameter(np.zeros(3))
    method = hfg.Parameter(8, choices={"Otsu": 8, "Plain": 0})
    done = hfg.Parameter(0.0, read_only=True)

    def process(self, value: int) -> None:
        self.done += 0.1


def _into_read_only() -> None:
    graph = hfg.Graph()
    draws = graph.add(Draws())
    graph.connect(draws.ports.parameters["band"], draws.ports.parameters["done"])


def _declares(**said: Any) -> type:
    return type("Declared", (hfg.Node,), {"a": hfg.Parameter(1, **said)})


def reported(file: Any, **options: Any) -> Callable[[], Any]:
    return lambda: hfg.run(build(), clock="virtual", begin=lambda run: run.report_page(file, **options))


def put_on_page(add: Callable[[RunPage], Any]) -> Callable[[], Any]:
    """Add something to a page, in a folder where there is a file called "note.txt" and one that is too large."""

    def begin(run: hfg.Run) -> None:
        Path("note.txt").write_text("hello")
        with Path("large.webm").open("wb") as large:
            large.truncate(65 * 2**20)
        add(run.report_page("run.html"))

    def run() -> None:
        with TemporaryDirectory() as folder, chdir(folder):
            hfg.run(build(), clock="virtual", begin=begin)

    return run


def edited(*given: Any) -> Callable[[], Any]:
    return lambda: build().edit(*given)


def inside(node: Callable[[], hfg.Node], **options: Any) -> Callable[[], Any]:
    """Run a graph around a node, under the name "node"."""

    def run() -> None:
        graph = hfg.Graph("one")
        source, made = graph.add(numbers()), graph.add(node(), name="node", **options)
        ports: list[Any] = [*made.ports.inputs.values(), *made.ports.slots.values()]
        graph.connect(source.out, ports[0])
        hfg.run(graph, clock="virtual", debug=True)

    return run


def added(**options: Any) -> Callable[[], Any]:
    return lambda: hfg.Graph("one").add(inc(), **{"name": "node", **options})


@hfg.node
def divides(value: int) -> int:
    return value // 0


@hfg.node
def gives_text(value: int) -> int:
    return "text"  # type: ignore[return-value]


@hfg.node
def gives_a_generator(value: int) -> int:
    return (one for one in (value,))  # type: ignore[return-value]


@hfg.node
def runs_another(value: int) -> int:
    return hfg.run(build()).firings


@hfg.node
def asks_its_place(value: int) -> int:
    return len(inc().place.path)


class Twice(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        self.out.send(1)
        self.out.send(2)


class SendsAndGives(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        self.out.send(1)
        return 2


class SendsInASlot(hfg.Node):
    out = hfg.Output(int)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.out.send(value)


class SendsInSetup(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def setup(self) -> None:
        self.out.send(1)

    def process(self, value: int) -> None: ...


class RingsWrongly(hfg.Node):
    value = hfg.Input(int)
    rang = hfg.Event(int)

    def process(self, value: int) -> None:
        self.rang.trigger("text")  # type: ignore[arg-type]


class AwaitsAnEvent(hfg.Node):
    value = hfg.Input(int)
    rang = hfg.Event(int)

    async def process(self, value: int) -> None:
        await self.rang


class NotReady(hfg.Node):
    def ready(self) -> bool:
        raise ValueError("no answer")

    def process(self, value: int) -> None: ...


class FailsSetup(hfg.Node):
    def setup(self) -> None:
        raise OSError("no camera")

    def process(self, value: int) -> None: ...


class FailsTeardown(hfg.Node):
    def teardown(self) -> None:
        raise OSError("no camera")

    def process(self, value: int) -> None: ...


class FailsEnd(hfg.Node):
    def end(self) -> None:
        raise OSError("no camera")

    def process(self, value: int) -> None: ...


def says_true(trace: list[TraceEvent]) -> Any:
    return True


def says_one(trace: list[TraceEvent]) -> Any:
    return ["wrong", 1]


async def says_later(trace: list[TraceEvent]) -> Any:
    return []


def claims(trace: list[TraceEvent]) -> None:
    assert not trace, "there are events"


def invariant(function: Any) -> Callable[[], Any]:
    return lambda: explore(build, runs=2, invariants=[function])


def run_with(**options: Any) -> Callable[[], Any]:
    return lambda: hfg.run(build(), **{"clock": "virtual", **options})


BLOCK = "is a block of async code: write `async with hfg.running(graph) as run:` in an async function"
BUILDER = "explore(build) takes the function that builds the graph"
NO_NODE = 'graph "small" has no node "nobody"; there are "numbers", "inc", "count"'
OF_A_NODE = "is no node of this run"

USES: dict[str, tuple[Callable[[], Any], str]] = {
    # --- fire ---
    "fire a class": (lambda: fire(Count, value=3), "fire takes a node, not its type: write"),  # type: ignore[arg-type]
    "fire a function node": (lambda: fire(inc, value=3), "fire takes a node, not its type:"),  # type: ignore[arg-type]
    "fire a function": (lambda: fire(len), "decorate a function with @hfg.node, then write"),  # type: ignore[arg-type]
    "fire nothing": (lambda: fire(None), "fire takes a node, as a node type makes it when i"),  # type: ignore[arg-type]
    "fire a graph": (lambda: fire(build()), 'fire takes one node; graph "small" runs as a w'),  # type: ignore[arg-type]
    "fire without names": (lambda: fire(inc(), 3), "by the names of inputs: write fire(node, value=3)"),
    "fire without a value": (lambda: fire(inc()), 'inc needs a value for "value": fire(node, value=...)'),
    "fire with a typo": (lambda: fire(inc(), valeu=3), 'inc has no input "valeu"; its inputs are "value"'),
    "fire a wrong type": (lambda: fire(inc(), value="x"), "input \"inc.value\" is declared int, got str: 'x'"),
    "fire gives a wrong type": (lambda: fire(gives_text(), value=1), 'output "gives_text.out" is declared int, got st'),
    "fire rings a wrong type": (lambda: fire(RingsWrongly(), value=1), 'event "rings_wrongly.rang" is declared int, g'),
    "fire no slot": (lambda: fire(Count(), slot="start"), 'count has no slot "start"; it has "start_at"'),
    "fire a slot without a value": (lambda: fire(Count(), slot="start_at"), 'takes a value: fire(node, slot="start_at'),
    "fire a slot's wrong type": (lambda: fire(Count(), slot="start_at", value="a"), 'slot "count.start_at" is declare'),
    "fire a slot by name": (lambda: fire(Count(), slot="start_at", at=1), 'a slot takes value=..., got "at"'),
    "fire no hook": (lambda: fire(Count(), hook="stup"), '"stup" is not a hook of a node; did you mean "setup"?'),
    "fire process as a hook": (
        lambda: fire(Count(), hook="process"),
        "is not a hook of a node: leave hook= out for a ",
    ),
    "fire a hook it has not": (lambda: fire(Count(), hook="end"), 'count does not define "end", so there is nothing t'),
    "fire a hook with values": (lambda: fire(FailsEnd(), hook="end", value=1), 'hook "end" takes no values, got "valu'),
    "fire a hook that is none": (lambda: fire(Count(), hook=print), "is not a hook of a node"),  # type: ignore[arg-type]
    "fire two things": (lambda: fire(Count(), hook="end", slot="start_at"), "one at a time: write two calls"),
    "fire no parameter": (lambda: fire(Count(), parameters={"limt": 3}, value=1), 'no parameter "limt"; its parameter'),
    "fire a list of parameters": (lambda: fire(Count(), parameters=[3], value=1), "values b"),  # type: ignore[arg-type]
    "fire half active": (lambda: fire(Count(), active="yes", value=1), "active= is what nod"),  # type: ignore[arg-type]
    "fire twice to one output": (lambda: fire(Twice(), value=1), '"twice.out" was written twice in one firing'),
    # --- explore, diagrams, the oracle ---
    "explore a graph": (lambda: explore(build()), f"{BUILDER}, for each run has a graph of"),  # type: ignore[arg-type]
    "explore a number": (lambda: explore(5), f"{BUILDER}, for each run has a graph of its o"),  # type: ignore[arg-type]
    "explore what builds none": (lambda: explore(lambda: 5), "this one returned 5"),  # type: ignore[arg-type,return-value]
    "explore async": (lambda: explore(build_later), "this one is async: let a plain functio"),  # type: ignore[arg-type]
    "explore with arguments": (lambda: explore(build_with), "missing a required argument: '"),  # type: ignore[arg-type]
    "explore no runs": (lambda: explore(build, runs=0), "how many schedules to try, 1 at least, got 0"),
    "explore fewer": (lambda: explore(build, runs=-3), "how many schedules to try, 1 at least, got -3"),
    "explore half a run": (lambda: explore(build, runs=1.5), "how many schedules to try, 1"),  # type: ignore[arg-type]
    "explore a seed": (lambda: explore(build, runs=1, seed="x"), "seed= is a whole number,"),  # type: ignore[arg-type]
    "explore a result": (lambda: explore(build, runs=1, result=3), "result= is a function t"),  # type: ignore[arg-type]
    "explore the past": (lambda: explore(build, runs=1, until_s=-1), "until_s must be seconds from 0 on"),
    "explore one invariant": (lambda: explore(build, invariants=claims), "a list of functio"),  # type: ignore[arg-type]
    "explore names": (lambda: explore(build, invariants=["lost"]), "a function that takes"),  # type: ignore[list-item]
    "an invariant that is a class": (invariant(Count), "an invariant is a function that takes a trace, got"),
    "an invariant that is true": (invariant(says_true), '"says true" returned True: let it return a list of problems'),
    "an invariant with numbers": (invariant(says_one), '"says one" returned 1: let it return a list of problems'),
    "an invariant that is async": (invariant(says_later), '"says later" is async: let a plain function look at the'),
    "a diagram of a type": (lambda: diagrams.run(inc, value="1"), "a diagram drives a node,"),  # type: ignore[arg-type]
    "a diagram of nothing": (lambda: diagrams.run(3, value="1"), "a diagram drives a node,"),  # type: ignore[arg-type]
    "a diagram that is a number": (lambda: diagrams.run(inc(), value=1), "a diagram is a te"),  # type: ignore[arg-type]
    "a diagram for no port": (lambda: diagrams.run(inc(), valve="1"), '"valve" is not an input or a slot; there'),
    "a diagram's letter": (lambda: diagrams.run(inc(), value="1?"), '"?" at 1 of the diagram "1?" means nothing'),
    "the oracle chooses": (lambda: reference_run(build(), choose=3), "choose= is a function"),  # type: ignore[arg-type]
    # --- run ---
    "run a function": (lambda: hfg.run(build), "a Graph can run, not function: write hfg.ru"),  # type: ignore[arg-type]
    "run a node": (lambda: hfg.run(inc()), "a Graph can run, not inc: write hfg.run(graph)"),  # type: ignore[arg-type]
    "run nothing": (lambda: hfg.run(None), "a Graph can run, not NoneType: write hfg.run(gr"),  # type: ignore[arg-type]
    "run on no clock": (run_with(clock="virtuel"), 'clock must be "real" or "virtual", got \'virtuel\''),
    "run until text": (run_with(until_s="3"), "until_s must be seconds from 0 on, or None for no end, got '3'"),
    "run until nothing": (run_with(until_s=float("nan")), "until_s must be seconds from 0 on, or None for no end, got"),
    "run a little debug": (run_with(debug="yes"), "debug must be True or False, got 'yes'"),
    "run not fast": (run_with(fast="no"), "fast must be True or False, got 'no'"),
    "run idle": (run_with(allow_idle=1), "allow_idle must be True or False, got 1"),
    "run into a file": (run_with(trace="x.json"), "trace must be a function that takes each event of the run, or a li"),
    "run into a tuple": (run_with(trace=(1,)), "trace must be a function that takes each event of the run, or a list"),
    "run no policy": (run_with(policy="randm"), 'unknown policy "randm": there are deadline, fair, fifo, priority, ra'),
    "run a seed of nothing": (run_with(seed=3), 'seed=3 has no effect, for no group of graph "small" has the policy'),
    "run half a seed": (run_with(seed=0.5, policy="random"), "seed must be a whole number, got 0.5"),
    "run no warning": (run_with(block_warning_s=-1), "block_warning_s must be seconds, or 0 for never, got -1"),
    "run begins with a number": (run_with(begin=3), "begin= is a plain function that takes the run, as in begin=lambd"),
    "run begins alone": (run_with(begin=lambda: None), "begin= takes the run, as in begin=lambda run: ..., and this o"),
    "run begins later": (run_with(begin=build_later), "for what waits, write `async with hfg.running(graph) as run:`"),
    "run begins with a coroutine": (run_with(begin=lambda run: asyncio.sleep(0)), "for what waits, write `async with"),
    "run a typo": (run_with(untl_s=3), 'a run has no option "untl_s"; did you mean "until_s"?'),
    "run watched in no time": (run_with(watch=True), "watch= needs the real clock: in virtual time a run is over befo"),
    "run in a loop": (lambda: virtual(build_and_run), "write `report = await hfg.run_async(graph)`"),
    "with running": (lambda: hfg.running(build()).__enter__(), BLOCK),  # type: ignore[attr-defined]
    "await running": (lambda: hfg.running(build()).__await__(), BLOCK),  # type: ignore[attr-defined]
    "for running": (lambda: iter(hfg.running(build())), BLOCK),  # type: ignore[call-overload]
    "running at once": (lambda: hfg.running(build()).stop(), "nothing runs yet, so ther"),  # type: ignore[attr-defined]
    # --- a run ---
    "trigger an input": (running(lambda run, g: run.trigger(g["count"].value, 3)), "run.trigger is for slots and even"),
    "trigger a text": (running(lambda run, g: run.trigger(g["count"].start_at, "x")), 'slot "count.start_at" expects'),
    "trigger nothing": (running(lambda run, g: run.trigger(g["count"].start_at)), 'slot "count.start_at" expects int,'),
    "trigger 5": (running(lambda run, g: run.trigger(g["count"].start_at, 1, activity=5)), "activity must be -1, 0 or"),
    "trigger now": (running(lambda run, g: run.trigger(g["count"].start_at, 1, stamp="now")), "stamp must be seconds"),
    "trigger another's": (running(lambda run, g: run.trigger(Count().start_at, 1)), OF_A_NODE),
    "feed an output": (running(lambda run, g: run.feed("total")), '"total" is no input of graph "small", which has "m'),
    "feed nobody": (running(lambda run, g: run.feed("more")), 'graph input "more" is not connected: graph.connect('),
    "read an input": (running(lambda run, g: run.read("more")), '"more" is no output of graph "small", which has "tot'),
    "read a node's": (running(lambda run, g: run.read(g["count"].out)), '"count.out" is no output of graph "small"'),
    "tap a typo": (running(lambda run, g: run.tap("count.ot")), '"count" has no port "ot"; did you mean "out"?'),
    "tap a node": (running(lambda run, g: run.tap("count")), "a tap looks at a port or an edge: name one of its ports"),
    "tap backwards": (running(lambda run, g: run.tap("count.out", max_rate_hz=-1)), "max_rate_hz is how many tokens a"),
    "tap nothing": (running(lambda run, g: run.tap("count.out", size=0)), "size is how many tokens a tap keeps, 1 or"),
    "trace into nothing": (running(lambda run, g: run.trace(None)), "trace must be a function that takes each event"),
    "trace little": (running(lambda run, g: run.trace(print, size=0)), "size is how many events the consumer's buffer"),
    "set a value": (running(lambda run, g: run.set(g["count"].limit, 4)), 'node.ports.parameters["name"], got 3'),
    "set what is read-only": (
        running(lambda run, g: run.set(hfg.Graph().add(Draws()).ports.parameters["done"], 0.5)),
        'parameter "draws.done" is read-only: only its node sets it; read node.done, or connect node.ports.parameters',
    ),
    "give what is read-only": (lambda: Draws(done=0.5), 'parameter "draws.done" is read-only: only its node sets it'),
    "lead into what is read-only": (
        lambda: _into_read_only(),
        '"draws.band" cannot lead into the parameter "draws.done"',
    ),
    "give a pair for a span": (
        lambda: Draws(band=(0.1, 0.2)),
        'parameter "draws.band" must be hfg.Span(low, high) of fl',
    ),
    "give a span upside down": (
        lambda: Draws(band=hfg.Span(0.9, 0.1)),
        "must have low <= high, got Span(low=0.9, high=0",
    ),
    "give a text for a colour": (lambda: Draws(frame="red"), "must be a colour, as in hfg.Colour(255, 128, 0) or"),
    "give a colour too bright": (
        lambda: Draws(frame=hfg.Colour(0, 0, 256)),
        "must have red, green and blue from 0 to 2",
    ),
    "read no colour": (lambda: hfg.Colour.of("red"), '\'red\' is not a colour; write "#rrggbb", as in "#ff8000"'),
    "give another kind of file": (
        lambda: Draws(store=Path("a.gif")),
        "must be a file name like *.png, got 'a.gi",
    ),
    "give another shape": (
        lambda: Draws(offset=np.zeros(2)),
        "must be of type Array[float64] and shape 3, got an array",
    ),
    "choose what is not there": (lambda: Draws(method=1), "must be one of 8 (Otsu), 0 (Plain), got 1"),
    "declare a step of nothing": (lambda: _declares(step=0), "has a step of 0; a step must be a number above 0"),
    "declare by a limit": (
        lambda: hfg.Parameter(Ge(0)),
        "is a limit, but the first argument of a parameter is its default; wri",
    ),
    "declare a pattern of a number": (
        lambda: _declares(pattern="*.png"),
        "but pattern=, directory= and save= are for p",
    ),
    "declare a choice of letters": (
        lambda: _declares(choices="ab"),
        "choices are several values, got 'ab'; write choi",
    ),
    "declare shown by nobody": (
        lambda: _declares(shown_if="other"),
        'is shown by "other", which is not a parameter with a',
    ),
    "declare shown by code": (
        lambda: _declares(shown_if={"other": bool}),
        "that only code can decide, <class 'bool'>, an",
    ),
    "declare shown by itself": (
        lambda: _declares(shown_if="a"),
        "depends on its own value to be shown, so it could be hidden forever;",
    ),
    "store a lambda": (
        lambda: encode(lambda: 1),
        "cannot be found by a name, so it cannot be stored; define it in a mo",
    ),
    "store an object": (
        lambda: encode(object()),
        "is not data that can be stored; use plain values, arrays, dataclasses",
    ),
    "read data of code": (
        lambda: decode({"$type": "os:system", "value": ""}),
        'is of type "os:system", which is not a type',
    ),
    "send what has no type": (
        lambda: TokenCodec(dict[str, Any]),
        "dict[str, Any] cannot be sent to another process: Any does not",
    ),
    "send code": (
        lambda: TokenCodec(list[Callable[[], None]]),
        "is code, and code cannot be sent; send data that describes what to do",
    ),
    "send another type": (
        lambda: TokenCodec(list[int], what='the value of "a.out"').encode(hfg.Token(["x"])),  # type: ignore[arg-type]
        "the value of \"a.out\"[0] cannot be sent: expected int, found str: 'x'; send what the port declares",
    ),
    "receive what nobody sends": (
        lambda: TokenCodec(int, what='a value for "b.value"').decode(b"\x80\x04", b""),
        'a value for "b.value" was refused on arrival: Expected `array`, got `object`',
    ),
    "open shared memory of strangers": (
        lambda: Reader("hfg-a-b-1-c", 1, lambda name: False),
        "shared memory 'hfg-a-b-1-c' was not announced on this host, so it is not op",
    ),
    "a ring of too many slots": (
        lambda: Ring("hfg-a-b-1-c", 1000, 1),
        "a ring has 1 to 252 slots of at least one byte",
    ),
    "a name that is a path": (
        lambda: segment_name("lab", "../arm", 1, "image"),
        '"../arm" cannot be part of the name of shared memory: use up to 48 letters, digits',
    ),
    "sweep everything": (lambda: sweep("/"), "'/' is not a prefix of names of shared memory of hfg, which begin with"),
    "set a wrong type": (
        running(lambda run, g: run.set(g["count"].ports.parameters["limit"], "x")),
        "parameter \"count.limit\" must be of type int, got 'x'",
    ),
    "edit a text": (running(lambda run, g: run.edit("remove count")), "an edit takes commands, got 'remove count'; wr"),
    "edit a list": (running(lambda run, g: run.edit([commands.Remove("count")])), "an edit takes commands, got ["),
    "edit a class": (running(lambda run, g: run.edit(commands.Remove)), "an edit takes commands, got <class"),
    "edit nobody": (running(lambda run, g: run.edit(commands.Remove("nobody"))), NO_NODE),
    "undo nothing": (running(lambda run, g: run.undo()), "nothing to undo: nothing was edited by commands yet"),
    "redo nothing": (running(lambda run, g: run.redo()), "nothing to redo: nothing was undone since the last edit"),
    "reload nobody": (running(lambda run, g: run.reload("nobody")), 'module "nobody" cannot be reloaded: it is not im'),
    "reload a file": (running(lambda run, g: run.reload("robot.py")), 'name the module, "robot", not its file'),
    "reload a number": (running(lambda run, g: run.reload(3)), "reload takes a module or its name, as in run.reload("),
    "step on": (
        running(lambda run, g: run.step()),
        "a wave cannot step while the run is not paused: run.pause() first",
    ),
    "break at nobody": (running(lambda run, g: run.break_at("nobody")), NO_NODE),
    "break at a node when": (running(lambda run, g: run.break_at("count", when=bool)), "when= looks at a token: give"),
    "break when 3": (running(lambda run, g: run.break_at("count.out", when=3)), "when= takes a function of the token"),
    "wait for a slot": (running(lambda run, g: run.wait_for(g["count"].start_at)), "run.wait_for waits for an event o"),
    "wait for the start": (running(lambda run, g: run.wait_for(g.start)), '"start" was triggered as the run began'),
    "wake a stranger": (running(lambda run, g: run.wake(inc())), OF_A_NODE),
    "feed a text": (fed(lambda feed: feed.send("x")), "graph input \"in\" expects int, got str: 'x'"),
    "feed a text from a thread": (fed(lambda feed: feed.send_from_thread("x")), 'graph input "in" expects int, got'),
    "feed 7 from a thread": (fed(lambda feed: feed.send_from_thread(1, activity=7)), "activity must be -1, 0 or +1"),
    "trigger behind the end": (running(lambda run, g: run.trigger(g["count"].start_at, 1), over=True), "the run is ov"),
    "edit behind the end": (
        running(lambda run, g: run.edit(commands.Remove("count")), over=True),
        "the run is over: edit the graph with graph.edit(...)",
    ),
    "undo behind the end": (running(lambda run, g: run.undo(), over=True), "the run is over: edit the graph with grap"),
    "wait behind the end": (running(lambda run, g: run.wait_for(g["count"].rang), over=True), 'before "count.rang" wa'),
    # --- editing at rest ---
    "a text as a command": (edited("x"), "an edit takes commands, got 'x'; write one, as in hfg.commands.Connect('a.o"),
    "remove nobody": (edited(commands.Remove("nobody")), NO_NODE),
    "connect nobody": (edited(commands.Connect("numbers.out", "nobody.value")), NO_NODE),
    "connect a typo": (edited(commands.Connect("numbers.ot", "inc.value")), 'no port "ot"; did you mean "out"?'),
    "connect a second": (edited(commands.Connect("inc.out", "inc.value")), '"inc.value" takes one edge and has one fr'),
    "connect an object": (
        edited(commands.Connect(build()["inc"].out, "inc.value")),
        'Connect takes source as a text such as "camera.out"',
    ),
    "disconnect no edge": (edited(commands.Disconnect("numbers.out", "count.value")), "graph.edges lists those that t"),
    "rename into a path": (edited(commands.Rename("count", "a/b")), '"/" separates the parts of a path; use "a_b"'),
    "rename to another": (edited(commands.Rename("count", "inc")), 'already has a node "inc"; choose another name'),
    "undo at rest": (lambda: build().undo(), "nothing to undo: nothing was edited by commands yet"),
    "redo at rest": (lambda: build().redo(), "nothing to redo: nothing was undone since the last edit"),
    "no such path": (lambda: build()["nobody"], NO_NODE),
    "no such port": (lambda: build()["count.vlue"], '"count" has no port "vlue"; did you mean "value"?'),
    "a number as a path": (lambda: build()[3], 'a path is a text such as "fetch/go_to.goal", g'),  # type: ignore[index]
    "report into a folder": (reported("."), 'cannot be written to ".": Is a directory; name a file in a folder that y'),
    "report nowhere": (reported("nowhere/run.html"), "No such file or directory; name a file in a folder that you ca"),
    "report into 3": (reported(3), 'needs a file, as in run.report_page("run.html"), got 3'),
    "report with fewer pictures": (
        reported("x.html", pictures=-1),
        "pictures= must be an integer from 0 to 1000, got -1",
    ),
    "section 3": (put_on_page(lambda page: page.add_text(3, "x")), "section must be a string, got 3"),  # type: ignore[arg-type]
    "text 3": (put_on_page(lambda page: page.add_text("x", 3)), "text must be a string, got 3"),  # type: ignore[arg-type]
    "a row too short": (
        put_on_page(lambda page: page.add_table("x", ("a", "b"), [(1,)])),
        "a row needs as many cells as the table has heads, 2, got (1,)",
    ),
    "a picture of floats": (
        put_on_page(lambda page: page.add_picture("x", np.zeros((9, 9)))),
        "the text of an SVG drawing or a file, got ndarray of shape (9, 9) and type float",
    ),
    "a picture that is 3": (put_on_page(lambda page: page.add_picture("x", 3)), "of an SVG drawing or a file, got int"),
    "a picture nowhere": (
        put_on_page(lambda page: page.add_picture("x", "nowhere.png")),
        '"nowhere.png" cannot be read: No such file or directory',
    ),
    "a picture of text": (
        put_on_page(lambda page: page.add_picture("x", "note.txt")),
        '"note.txt" ends in none of .png, .jpg, .jpeg, .gif, .webp, .svg, which browsers show',
    ),
    "a picture at noon": (
        put_on_page(lambda page: page.add_picture("x", "<svg/>", at_s="noon")),  # type: ignore[arg-type]
        "at_s= must be a number of seconds, got 'noon'",
    ),
    "a film": (
        put_on_page(lambda page: page.add_video("x", "film.avi")),
        '"film.avi" ends in none of .webm, .mp4, .ogv, which browsers show',
    ),
    "a large film": (
        put_on_page(lambda page: page.add_video("x", "large.webm")),
        '"large.webm" has 65 MB, but a page takes at most 64 MB per file; mention its name in a text instead',
    ),
    "a film that stands": (
        put_on_page(lambda page: page.add_video("x", "large.webm", speed=0)),
        "speed= of a video must be above 0, got 0",
    ),
    "report with dots": (reported("x.html", picture_size=1), "picture_size= must be an integer from 16 to 4096, got 1"),
    "draw a pdf": (lambda: build().draw("x.pdf"), 'cannot be drawn into "x.pdf": a drawing ends in .svg or .mmd or .'),
    "draw as a pdf": (lambda: build().draw(format="pdf"), "cannot be drawn into format='pdf': a drawing ends in .svg"),  # type: ignore[arg-type]
    "draw into nothing": (lambda: build().draw("\0.svg"), "embedded null byte; name a file in a folder that you can w"),
    "draw half open": (lambda: build().draw(depth=-1), "depth= says how many subgraphs inside each other are shown op"),
    "draw open": (lambda: build().draw(depth=True), "are shown open, 0 or more, got True"),
    "draw some ports": (lambda: build().draw(ports="some"), 'ports= is "used", those that edges lead to, or "all", g'),  # type: ignore[arg-type]
    "fold a text": (lambda: build().draw(fold="count"), 'fold= takes a list of nodes or paths, as in fold=["fetch"]'),
    "fold nobody": (lambda: build().draw(fold=["nobody"]), NO_NODE),
    "fold a node": (
        lambda: build().draw(fold=["count"]),
        '"count" cannot be folded, because it is not a subgraph; leave it',
    ),
    "show 3 as active": (lambda: build().draw(active=[3]), "active= takes its nodes or their paths, got 3; add it fir"),  # type: ignore[list-item]
    "show a stranger": (lambda: build().draw(active=[inc()]), "active= takes its nodes or their paths, got <inc()>; a"),
    "draw a number": (lambda: build().draw(3), 'is drawn into a file, as in graph.draw("gra'),  # type: ignore[arg-type]
    "a graph called 3": (lambda: hfg.Graph(3), "a graph needs a name that is a text and not"),  # type: ignore[arg-type]
    "gate by nobody": (lambda: build_gate(), "write graph.gate(detector, by=fetch)"),
    # --- options of nodes and groups ---
    "no rate": (added(max_rate_hz=0), 'node "node": max_rate_hz must be a number above 0, or None for no limit, got 0'),
    "no such policy of errors": (added(on_error="ignore"), 'on_error must be one of "stop", "skip", "disable", "resta'),
    "no time": (added(max_duration_s=-1), "max_duration_s must be a number above 0, or None for no limit, got -1"),
    "no such release": (added(release="fast"), 'release must be one of "auto", "sequential", "pipelined", got \'fast'),
    "a high priority": (added(priority="high"), "priority must be a whole number, got 'high'"),
    "active for nothing": (added(active_for_s=0), "active_for_s must be a number above 0, or None for no limit, got 0"),
    "fewer restarts": (added(restart_limit=-1), "restart_limit must be a whole number from 0 on, got -1"),
    "a deadline in words": (added(deadline_s="soon"), "deadline_s must be a number above 0, or None for no limit"),
    "no group": (inside(inc, group="visoin"), 'its group "visoin" is not declared'),
    "a group without a name": (lambda: hfg.Graph().group(""), "a group needs a name, got ''"),
    "no such policy": (lambda: hfg.Graph().group("a", policy="x"), 'group "a": policy must'),  # type: ignore[arg-type]
    "add a type": (lambda: hfg.Graph().add(inc), "graph.add takes a node, got <node type in"),  # type: ignore[type-var]
    # --- code of nodes ---
    "code that divides": (inside(divides), 'node "node" failed in firing 1: ZeroDivisionError: '),
    "code that gives a text": (inside(gives_text), "TypeError: output \"node.out\" is declared int, got str: 'text'"),
    "code that gives a generator": (inside(gives_a_generator), 'output "node.out" is declared int, got generator'),
    "code that runs another": (inside(runs_another), "write `report = await hfg.run_async(graph)`"),
    "code of a node in no graph": (inside(asks_its_place), "is not in a graph, so it has no place: add it first"),
    "code that sends twice": (inside(Twice), 'output "node.out" was written twice in one firing: it takes one token'),
    "code that sends and gives": (inside(SendsAndGives), '"node.out" was written twice in one firing: return or send'),
    "code that sends in a slot": (inside(SendsInASlot), 'output "node.out" was written in a slot handler: outputs bel'),
    "code that sends in setup": (inside(SendsInSetup), 'output "node.out" was written outside a firing: outputs belon'),
    "code that rings wrongly": (inside(RingsWrongly), 'event "node.rang" is declared int, got str'),
    "code that awaits an event": (inside(AwaitsAnEvent), '"node.rang" cannot be awaited: write `await run.wait_for(ev'),
    "code that is not ready": (inside(NotReady), 'node "node" failed in ready(): ValueError: no answer'),
    "code that fails in setup": (inside(FailsSetup), 'node "node" failed in setup(): OSError: no camera'),
    "code that fails in teardown": (inside(FailsTeardown), 'node "node" failed in teardown(): OSError: no camera'),
    "code that fails at the end": (inside(FailsEnd), 'node "node" failed in end(): OSError: no camera'),
}


async def build_and_run() -> None:
    hfg.run(build())


def build_gate() -> None:
    graph = build()
    graph.gate(graph["count"], graph["inc"])


@pytest.mark.parametrize("name", USES)
def test_a_wrong_use_gets_one_sentence(name: str) -> None:
    use, said = USES[name]
    with pytest.raises((hfg.errors.HfgError, TypeError, ValueError, AttributeError)) as raised:
        use()
    sentence = str(raised.value)
    assert said in sentence
    if not isinstance(raised.value, hfg.errors.CheckFailed):  # which lists what it has found, one a line
        assert "\n" not in sentence
    with redirect_stderr(io.StringIO()) as shown:
        show.user_traceback(raised.value)
    assert OURS not in shown.getvalue()


def test_an_invariant_may_assert_and_its_failure_has_seed_and_schedule() -> None:
    with pytest.raises(hfg.testing.ScheduleFailure) as raised:
        explore(build, runs=3, invariants=[claims])
    assert "claims: AssertionError: there are events" in str(raised.value)
    assert 'assert not trace, "there are events"' in str(raised.value)
    assert f'policy="random", seed={raised.value.seed}' in str(raised.value)
    assert "its schedule (" in str(raised.value)


# --- the command line ---

ONE = STEPS.replace("\nother = build\n", "\n")

FILES = {
    "steps.py": ONE,
    "text.txt": "hello",
    "empty.py": "x = 1\n",
    "imports.py": "import nothing_like_this\n",
    "half.py": "def f(:\n",
    "two.py": "import hfg\na = hfg.Graph()\nb = hfg.Graph()\n",
    "later.py": "import hfg\nasync def build() -> hfg.Graph:\n    return hfg.Graph()\n",
    "nothing.py": "import hfg\ndef build() -> hfg.Graph:\n    return None\n",
    "zero.py": "import hfg\ndef build() -> hfg.Graph:\n    return 1 / 0\n",
    "leaves.py": "import sys\nsys.exit(3)\n",
    "null.py": "\0",
    "fails.py": ONE.replace("return step if", "return step / 0 if"),
    "refused.py": ONE.replace("ear.heard)", "ear.hearing)"),
}

LINES = {
    "run text.txt": "text.txt is not a Python file: name one that ends in .py, or a module that builds the graph",
    "run missing.txt": 'there is no module "missing" here or installed',
    "run missing.py": "missing.py: does not exist",
    "run empty.py": "empty.py has no graph: it needs a Graph, or a function",
    "run folder/": "folder: is a folder, name a file in it",
    "run imports.py": "imports.py failed: ModuleNotFoundError: No module named 'nothing_like_this'",
    "run half.py": "half.py failed: SyntaxError: invalid syntax (half.py, line 1)",
    "run two.py": "two.py has 2 graphs: name one of two.py:a, two.py:b",
    "run later.py": "later.py: build() is async; let a plain function build the graph",
    "run nothing.py": "nothing.py: build() returned a NoneType, not a Graph: return the graph that it builds",
    "run zero.py": "zero.py: build() failed: ZeroDivisionError: division by zero",
    "run leaves.py": 'leaves.py left the program; put what it runs under if __name__ == "__main__":',
    "run null.py": "null.py failed: SyntaxError",
    "run fails.py --clock virtual": 'node "third" failed in firing 1: ZeroDivisionError: division by zero',
    "run refused.py": "refused.py",
    "run steps.py:nope": 'steps.py has no "nope"; it has build',
    "run steps.py:steps": "steps.py:steps is a node type: add it to a Graph, and name that; it has build",
    "run steps.py:": '"steps.py:" names nothing: write module:graph, file.py or file.py:graph',
    "run :build": '":build" names nothing: write module:graph, file.py or file.py:graph',
    "run nothing.like.this": 'there is no module "nothing',
    "run .steps": '".steps" is not a module; name one from here on, as in package.module, or a file',
    "run steps.yaml": "steps.yaml: there is no such file",
    "run": "Missing argument 'target'; hfg --help shows what there is",
    "run steps.py more": "Got unexpected extra argument(s) (more)",
    "runn steps.py": "No such command 'runn'. Did you mean 'run'?",
    "run steps.py --until -1": "Invalid value for '--until': seconds are not negative, got -1",
    "run steps.py --until x": "Invalid value for '--until': Input should be a valid number",
    "run steps.py --until nan": "until_s must be seconds from 0 on",
    "run steps.py --clock virtuel": "Invalid value for '--clock': 'virtuel' is not one of 'real', 'virtual'",
    "run steps.py --clock": "Option '--clock' requires an argument",
    "run steps.py --param x": '--param "x" sets nothing: write --param node.parameter=value',
    "run steps.py --param steps.count": '--param "steps.count" sets nothing: write --param node.parameter=value',
    "run steps.py --param steps.count=x": "parameter \"steps.count\" must be of type int, got 'x'",
    "run steps.py --param steps.cont=1": 'node "steps" has no parameter "cont"; it has count',
    "run steps.py --param nobody.count=1": 'graph "steps" has no node "nobody"; it has steps, third, ear',
    "run steps.py --param =3": '--param "=3" sets nothing: write --param node.parameter=value',
    "run steps.py --policy randm --clock virtual": 'unknown policy "randm": there are deadline, fair, fifo',
    "run steps.py --seed 3 --clock virtual": 'seed=3 has no effect, for no group of graph "steps" has the policy',
    "run steps.py --seed x": "Invalid value for '--seed': Input should be a valid integer",
    "run steps.py --trace x.yaml": "the trace cannot be written as x.yaml: name it x.jsonl, one JSON object per line",
    "run steps.py --trace nowhere/x.json": "the trace cannot be written to nowhere/x.json: No such file or directory",
    "run steps.py --trac x.json": "No such option: --trac (Possible options: ",
    "check": "Missing argument 'target'",
    "check missing.py": "missing.py: does not exist",
    "check text.txt": "text.txt is not a Python file",
    "check steps.py more": "Got unexpected extra argument(s) (more)",
    "run steps.py --clock virtual --report nowhere/x.html": 'cannot be written to "nowhere/x.html": No such file or d',
    "run steps.py --clock virtual --report x.html --pictures -1": "pictures= must be an integer from 0 to 1000, got -1",
    "draw steps.py x.pdf": 'graph "steps" cannot be drawn into "x.pdf": a drawing ends in .svg or .mmd or .dot',
    "draw steps.py x": 'graph "steps" cannot be drawn into "x": a drawing ends in .svg or .mmd or .dot; rename',
    "draw steps.py --format pdf": "Invalid value for '--format': 'pdf' is not one of 'svg', 'mmd', 'dot'",
    "draw steps.py --fold nobody": 'graph "steps" has no node "nobody"',
    "draw steps.py --fold third": '"third" cannot be folded, because it is not a subgraph; leave it out of fold=',
    "draw steps.py --depth -1": "depth= says how many subgraphs inside each other are shown open, 0 or more, got -1",
    "draw steps.py --ports some": "Invalid value for '--ports': 'some' is not one of 'used', 'all'",
    "draw missing.py": "missing.py: does not exist",
    "draw steps.py nowhere/x.mmd": "No such file or directory; name a file in a folder that you can write to",
    "nodes missing": 'there is no module, family or node type "missing" here or installed',
    "nodes text.txt": "text.txt is not a Python file",
    "new node 3abc": '"3abc" names no module: letters, digits and _, no word of Python, as in map_lookup',
    "new node class": '"class" names no module: letters, digits and _, no word of Python, as in map_lookup',
    "new node": "Missing argument 'name'",
    "new nod x": "No such command 'nod'. Did you mean 'node'?",
    "new": "Missing command; hfg --help shows what there is",
    "tap steps.py": "Missing argument 'path'",
    "tap steps.py steps.ot --clock virtual": '"steps" has no port "ot"; did you mean "out"?',
    "tap steps.py nobody.out --clock virtual": 'graph "steps" has no node "nobody"; there are "steps", "third"',
    "tap steps.py steps --clock virtual": '"steps" is a node, and a tap looks at a port or an edge: name one of its',
    "tap steps.py steps.out --rate -1 --clock virtual": "max_rate_hz is how many tokens a second a tap gives at most",
    "tap steps.py steps.out --rate x": "Invalid value for '--rate': Input should be a valid number",
    "tap 99999999 x": "no graph that could be looked at runs in process 99999999",
    "top 99999999": "no graph that could be looked at runs in process 99999999",
    "top a b": "Got unexpected extra argument(s) (b)",
    "--verson": "No such option: --verson (Possible options: --version)",
    "-x": "No such option: -x; hfg --help shows what there is",
}


@pytest.mark.parametrize("line", LINES)
def test_a_wrong_line_gets_one_sentence_behind_the_users_own_frames(line: str, command: Command) -> None:
    for name, text in FILES.items():
        Path(name).write_text(text, encoding="utf-8")
    Path("folder").mkdir()
    shown = command(*line.split())
    *frames, sentence = shown.err.splitlines()
    assert shown.code in (1, 2)
    assert sentence.startswith("hfg: ")
    assert LINES[line] in sentence
    assert OURS not in shown.err
    assert frames == [] or frames[0].startswith(("Traceback", "  File", "SyntaxError"))


# --- how many ---

ELSEWHERE = [Path(__file__).parent, Path(__file__).parent.parent / "face", Path(__file__).parent.parent / "graph"]


def refused_in(file: Path) -> int:
    """How many refusals a file of tests asserts with their sentence; a table of parameters counts once."""
    calls = [one for one in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(one, ast.Call)]
    return sum(
        isinstance(one.func, ast.Attribute)
        and one.func.attr == "raises"
        and any(given.arg == "match" for given in one.keywords)
        for one in calls
    )


def test_how_many() -> None:
    others = sum(refused_in(file) for folder in ELSEWHERE for file in folder.glob("test_*.py"))
    assert len({said for _, said in USES.values()} | set(LINES.values())) > 190  # different ones
    assert len(USES) + len(LINES) + others >= 250

"""Parts that say what is well formed and not so: it is refused, counted, said once, and changes nothing (rule L4).

One of the parts, `liar`, does its work and says untrue things beside; what others compute is as without it.
"""

from __future__ import annotations

import asyncio
import logging
import random
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest

import hfg
from hfg.graph.flat import MAIN
from hfg.parts.model.agreement import Answer, Question, Rest, Step
from hfg.parts.model.clocks import RunClock
from hfg.parts.model.messages import (
    Ask,
    Begin,
    Call,
    Closed,
    Ended,
    Failed,
    Finish,
    GoesOn,
    Hears,
    Joins,
    Keep,
    Kept,
    Logged,
    Message,
    Open,
    Opened,
    Parcel,
    Passed,
    Reborn,
    Rests,
    Result,
    Seen,
    Sees,
    Shares,
    Speaks,
    TellTime,
    Told,
    pack,
    unpack,
)
from hfg.parts.processes import launching
from hfg.parts.processes.launching import LoopLauncher
from hfg.parts.processes.worker import Worker
from hfg.parts.running.channels import Channel
from hfg.parts.steering.run import CutRun
from hfg_transports.memory import Faults, Network

COUNT = 20
HUGE = 2**62
LONG_S = 60.0  # of virtual time: the run has not ended by itself
TO_TRUE, TO_LIAR = "numbers.out -> first.value", "numbers.out -> third.value"
FROM_TRUE, FROM_LIAR = "first.out -> second.value", "third.out -> fourth.value"  # from one to the other
OUT_OF_TRUE, OUT_OF_LIAR = "fourth.out -> out", "second.out -> there"
LABELS = [TO_TRUE, TO_LIAR, FROM_TRUE, FROM_LIAR, OUT_OF_TRUE, OUT_OF_LIAR, "no -> where", ""]


def cut_run(run: hfg.Run) -> CutRun:
    assert isinstance(run, CutRun)
    return run


@hfg.node
async def numbers(*, count: int = COUNT) -> AsyncIterator[int]:
    for number in range(count):
        await asyncio.sleep(0.004)
        yield number


@hfg.node
async def plus(value: int, *, adds: int = 1) -> int:
    await asyncio.sleep(0.001)
    return value + adds


def graph_of_two() -> hfg.Graph:
    """Two parts, each of which feeds the other and the main one."""
    graph = hfg.Graph("two")
    graph.group("true", process=True)
    graph.group("liar", process=True)
    source = graph.add(numbers())
    first, fourth = (graph.add(plus(), name=name, group="true") for name in ("first", "fourth"))
    second, third = (graph.add(plus(), name=name, group="liar") for name in ("second", "third"))
    graph.connect(source.out, first.value)
    graph.connect(first.out, second.value)
    graph.connect(second.out, graph.output("there", int))
    graph.connect(source.out, third.value)
    graph.connect(third.out, fourth.value)
    graph.connect(fourth.out, graph.output("out", int))
    return graph


WANTED = {name: [number + 2 for number in range(COUNT)] for name in ("out", "there")}


class World:
    """A run with parts on the loop, of which one can be made to say anything.

    Attributes:
      workers: the parts, by name.
      channels: of the main part, by name of the other; the last life of each.
      refused: who was not believed, and why.
      raised: what has come out of callbacks.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, faults: Faults | None = None, seed: int = 0) -> None:
        self.workers: dict[str, Worker] = {}
        self.refused: list[tuple[str, str]] = []
        self.raised: list[dict[str, Any]] = []
        self.channels: dict[str, Channel] = {}
        self.network = network = Network(faults, seed=seed)
        self.begun = begun = asyncio.Event()
        began, made, refuse = Worker.__init__, Channel.__init__, Channel.refuse

        def note_worker(worker: Worker, session: Any, run: str, name: str, *rest: Any) -> None:
            began(worker, session, run, name, *rest)
            self.workers[name] = worker

        def note_channel(channel: Channel, session: Any, run: str, here: str, there: str, *rest: Any) -> None:
            made(channel, session, run, here, there, *rest)
            if here == MAIN:
                self.channels[there] = channel

        def note_refused(channel: Channel, why: str) -> None:
            self.refused.append((channel._there, why))
            refuse(channel, why)

        monkeypatch.setattr(Worker, "__init__", note_worker)
        monkeypatch.setattr(Channel, "__init__", note_channel)
        monkeypatch.setattr(Channel, "refuse", note_refused)

        class Beginning(LoopLauncher):
            async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> Any:
                launched: Any = await super().launch(run, part, host, incarnations)
                launched.begins = begun.set
                return launched

        monkeypatch.setattr(launching, "LoopLauncher", lambda: Beginning(network=network))

    def say(self, to: str, message: Message) -> None:
        """The liar says it."""
        well_formed = unpack(pack(message))
        assert well_formed is not None
        self.workers["liar"]._channels[to].send(well_formed)

    def run(self, plan: Callable[[hfg.Run], Any]) -> hfg.Report:
        """Run the two parts, and this beside them."""
        tasks: list[asyncio.Task[Any]] = []

        async def beside(run: hfg.Run) -> None:
            await self.begun.wait()
            await asyncio.sleep(0.02)
            await plan(run)

        def begin(run: hfg.Run) -> None:
            asyncio.get_running_loop().set_exception_handler(lambda _, context: self.raised.append(context))
            tasks.append(asyncio.create_task(beside(run)))

        report = hfg.run(graph_of_two(), clock="virtual", until_s=LONG_S, begin=begin)
        assert tasks[0].done()
        tasks[0].result()
        assert not self.raised, self.raised
        assert all(session.failed == 0 for session in self.network.sessions)
        return report


REST = Rest("liar", 7, {FROM_LIAR: (0, 0, "open", True)}, {})
TO_MAIN: dict[str, Message] = {
    "an edge that is not there": Speaks("no -> where", False, 1),
    "an edge of another part": Joins(OUT_OF_TRUE, 1, 1, 1),
    "where a life goes on that needs no telling": Joins(OUT_OF_LIAR, 3, 1, 1),
    "that more was taken than has left": Hears(TO_LIAR, "over", HUGE),
    "memory that is not of the edge": Shares(OUT_OF_LIAR, "hfg-run-other", 1),
    "that another is set up": Opened("true"),
    "that another has failed": Ended("true", "failed", Failed("RunError", "no")),
    "that another rests": Rests(Rest("true", 1, {}, {})),
    "that it has other edges": Rests(REST),
    "an answer of another": Told(Answer("true", "rests", 1)),
    "what is to be kept, without a ledger": Keep(1, b"x" * 1000),
    "that it is torn down, untold": Closed("liar", {}, {}, ["no"], HUGE),
    "that another is torn down": Closed("true", {}, {}, [], 0),
    "what only the main part says": Finish("failed"),
    "that a part is to begin": Begin(),
    "that somebody begins anew": Reborn("true", HUGE),
}
TO_A_NEIGHBOUR: dict[str, Message] = {
    "an edge that is not there": Hears("no -> where", "over", 0),
    "an edge of the main part": Speaks(TO_TRUE, False, 0),
    "the other end of an edge": Speaks(FROM_TRUE, False, 0),
    "where a life goes on that needs no telling": Joins(FROM_LIAR, 5, 1, 5),
    "that more was taken than has left": Hears(FROM_TRUE, "over", 10_000),
    "memory of another edge": Shares(FROM_LIAR, "hfg-run-x-1-edge_0", 1),
    "that it is to begin": Begin(),
    "that the run is over": Finish("done"),
    "that it is to pause": Call(1, "pause", {}),
    "that a queue is to grow": Ask(Question("grow", 1, FROM_LIAR)),
    "that it is kept": Kept(1),
    "that somebody begins anew": Reborn("liar", HUGE),
    "what time it is": TellTime(0.0, 1e300),
    "that it is to be another graph": Open("", {}, {}, RunClock("", 0.0, 0.0), []),
}
AS_MAIN: dict[str, Message] = {
    "that it is to be another graph": Open("", {}, {}, RunClock("", 0.0, 0.0), []),
    "that it is to begin, again": Begin(),
    "what time it is, unasked": TellTime(0.0, 1.0),
    "that a life begins that has ended": Reborn("liar", 1),
    "which queue grows, in no words": Ask(Question("grow", 1, 7)),
    "what cannot be missing": Ask(Question("lose", 1, {"a": "b"})),
    "what a part says": Opened("true"),
}


LIES = {f"to the main part, {what}": (MAIN, message) for what, message in TO_MAIN.items()}
LIES |= {f"to a neighbour, {what}": ("true", message) for what, message in TO_A_NEIGHBOUR.items()}


@pytest.mark.rule("L4")
@pytest.mark.parametrize(("to", "message"), LIES.values(), ids=LIES)
def test_what_a_part_says_and_is_not_so_is_refused_and_said_once_and_changes_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, to: str, message: Message
) -> None:
    world = World(monkeypatch)

    async def plan(_: hfg.Run) -> None:
        world.say(to, message)
        world.say(to, message)

    report = world.run(plan)
    assert (report.outcome, report.outputs, report.errors) == ("done", WANTED, [])
    assert [who for who, _ in world.refused] == ["liar", "liar"]
    assert len([line for line in caplog.messages if 'group "liar" is not trusted: it has sent' in line]) == 1


@pytest.mark.rule("L4")
@pytest.mark.parametrize("message", AS_MAIN.values(), ids=AS_MAIN)
def test_a_part_does_not_do_what_it_cannot_be_told(monkeypatch: pytest.MonkeyPatch, message: Message) -> None:
    world = World(monkeypatch)

    async def plan(_: hfg.Run) -> None:
        world.channels["true"].send(message)

    report = world.run(plan)
    assert (report.outcome, report.outputs, report.errors) == ("done", WANTED, [])
    assert [who for who, _ in world.refused] == [MAIN]


PARCEL = Parcel(b"", b"")
NOTHING_COMES_OF_IT: dict[str, Message] = {
    "the result of what was never asked": Result(77, {"nodes": HUGE}),
    "a look at what nobody looks at": Seen(77, [Passed(0.0, "sent", "first", PARCEL)], [PARCEL], HUGE),
    "that it is set up, again": Opened("liar"),
    "an answer that is not waited for": Told(Answer("liar", "fullest", HUGE, value="much")),
    "where it goes on": GoesOn(OUT_OF_LIAR, 3, HUGE),
    "memory that was never offered": Sees(TO_LIAR, "x", HUGE),
}


@pytest.mark.rule("L4")
@pytest.mark.parametrize("message", NOTHING_COMES_OF_IT.values(), ids=NOTHING_COMES_OF_IT)
def test_what_nobody_waits_for_any_more_is_heard_and_nothing_comes_of_it(
    monkeypatch: pytest.MonkeyPatch, message: Message
) -> None:
    world = World(monkeypatch)

    async def plan(_: hfg.Run) -> None:
        world.say(MAIN, message)

    report = world.run(plan)
    assert (report.outcome, report.outputs, world.refused) == ("done", WANTED, [])


@pytest.mark.rule("L4", "R7")
def test_who_was_not_asked_to_look_is_not_heard_and_what_cannot_be_read_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = World(monkeypatch)
    seen: list[Any] = []

    async def plan(run: hfg.Run) -> None:
        tap, other = run.tap("first.out"), run.tap("second.out")
        numbers = sorted(cut_run(run)._asking._subscriptions)
        await asyncio.sleep(0.01)
        world.say(MAIN, Seen(numbers[0], tokens=[PARCEL]))  # which the other part was asked for
        world.say(MAIN, Seen(numbers[1], tokens=[Parcel(b"\xff", b"", shown="me")]))
        seen.extend([token.value async for token in tap])
        assert other.seen >= COUNT - 5

    assert world.run(plan).outputs == WANTED
    assert seen[:-1] == list(range(seen[0], COUNT + 1))  # and END
    assert len(world.refused) == 2


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    "value", [None, 7, {"nodes": 3}, {"nodes": {"first": {}}, "edges": {}, "errors": [], "lost_activity": 0}]
)
def test_counts_that_are_none_are_refused_and_those_of_others_are_left_out(
    monkeypatch: pytest.MonkeyPatch, value: Any
) -> None:
    world = World(monkeypatch)

    async def plan(run: hfg.Run) -> None:
        await run.refresh()
        run.statistics()  # asks anew
        number = max(cut_run(run)._asking._waiting)
        for one in (number - 1, number):
            world.say(MAIN, Result(one, value))
        await asyncio.sleep(0.01)
        assert run.statistics().nodes["first"].firings > 0

    assert world.run(plan).outputs == WANTED
    assert len(world.refused) == 2  # the answer of another, and its own that is none


@pytest.mark.slow
@pytest.mark.rule("L4")
def test_records_with_ever_new_loggers_hold_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)

    async def plan(_: hfg.Run) -> None:
        for number in range(3000):
            world.say(MAIN, Logged(f"untrue.{number}", 30, "x", "", 1e300, "", HUGE, ""))

    before = len(logging.root.manager.loggerDict)
    assert world.run(plan).outputs == WANTED
    assert len(logging.root.manager.loggerDict) - before <= 1002


@pytest.mark.slow
@pytest.mark.rule("L4", "L1")
def test_words_behind_tokens_that_never_come_hold_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(monkeypatch)

    async def plan(_: hfg.Run) -> None:
        for _word in range(3000):
            world.say(MAIN, Speaks(OUT_OF_LIAR, False, HUGE))

    assert world.run(plan).outputs["out"] == WANTED["out"]
    assert len(world.refused) == 2000


def a_lie(choose: random.Random) -> Message:
    """Something well formed that the liar cannot know, or that is for others to say."""
    label, count = choose.choice(LABELS), choose.choice([0, 1, 5, 10_000, HUGE])
    part, stream = choose.choice(["", "true", "x", "part true"]), choose.choice([-1, 0, 1, 3, HUGE])
    steps: list[Step] = ["rests", "fullest", "lose", "grow", "stuck", "finish", "end"]
    step = choose.choice(steps)
    value = choose.choice([None, 1, "a", [1], {"a": 1}, ["a", "b"], [[]]])
    account = (choose.choice([0, count]), count, choose.choice(["open", "over", "so"]), True)
    own = [FROM_LIAR, OUT_OF_LIAR, TO_LIAR, FROM_TRUE]  # of these it may say what it likes that can be so
    lies: list[Callable[[], Message]] = [
        lambda: Speaks(choose.choice([one for one in LABELS if one not in own]), choose.random() < 0.5, count),
        lambda: Hears(choose.choice([one for one in LABELS if one not in own]), "over", count),
        lambda: Hears(choose.choice([FROM_TRUE, TO_LIAR]), "deaf", HUGE),
        lambda: Joins(label, count, stream, choose.choice([0, 3, HUGE]), "deaf"),
        lambda: GoesOn(label, stream, count),
        lambda: Shares(label, f"hfg-run-{part}", stream),
        lambda: Sees(label, f"hfg-run-{part}", stream, "no"),
        lambda: Opened(part, None),
        lambda: Ended(part, "failed", Failed("NodeError", "x", "y")),
        lambda: Closed(choose.choice([part, "liar"]), {}, {}, ["x"] * 50, 5),
        lambda: Rests(Rest(choose.choice([part, "liar"]), count, {label: account}, {label: account})),
        lambda: Told(Answer(choose.choice([part, "liar"]), step, count, value=value)),
        lambda: Ask(Question(step, count, value)),
        lambda: Keep(count, b"x" * choose.randrange(1000)),
        lambda: Kept(count),
        lambda: Result(choose.randrange(20), value, Failed("x", "y") if choose.random() < 0.3 else None),
        lambda: Seen(choose.randrange(20), tokens=[Parcel(b"\xc1", b"\xc1")], count=count),
        lambda: Logged(part, 30, "x" * choose.randrange(5000), label, float(count), "", stream, ""),
        lambda: Reborn(part, count),
        lambda: TellTime(float(count), float("nan")),
        lambda: Call(count, choose.choice(["pause", "set", "edit", "leave", "no"]), {"number": value}),
        lambda: Finish("failed"),
        lambda: Begin(),
    ]
    return choose.choice(lies)()


@pytest.mark.slow
@pytest.mark.rule("L4", "L1")
@pytest.mark.parametrize("block", range(4))
def test_whatever_a_part_says_at_random_the_others_compute_what_they_do(
    monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    for seed in range(20 * block, 20 * block + 20):
        choose = random.Random(seed)
        with monkeypatch.context() as patch:
            world = World(patch, Faults(loss=0.1, repetition=0.1, delay_s=(0.0, 0.003)), seed)

            async def plan(_: hfg.Run, world: World = world, choose: random.Random = choose) -> None:
                for _word in range(choose.randint(1, 40)):
                    world.say(choose.choice([MAIN, "true"]), a_lie(choose))
                    await asyncio.sleep(choose.choice([0.0, 0.0, 0.001, 0.004]))

            report = world.run(plan)
        assert (report.outcome, report.outputs) == ("done", WANTED), f"seed {seed}"
        assert {who for who, _ in world.refused} <= {"liar"}, f"seed {seed}: {world.refused}"

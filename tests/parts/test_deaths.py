"""Parts that die and begin anew, in virtual time: what is lost, what not, and when it is enough (rules L2, L3, X1)."""

from __future__ import annotations

import asyncio
import random
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg.graph.flat import cut, flatten
from hfg.parts.model.deaths import Deaths
from hfg.parts.model.inheriting import Alignment, Inheritance, inheriting, keeping
from hfg.parts.processes import launching
from hfg_transports.memory import Faults, Network

LEDGER: dict[str, list[int]] = {}
LONG_S = 30.0  # of virtual time: the run has not ended by itself


@hfg.node
def numbers(*, count: int = 60) -> Iterator[int]:
    yield from range(count)


@hfg.node
async def relay(value: int, *, takes_s: float = 0.004) -> int:
    await asyncio.sleep(takes_s)
    return value + 1000


@hfg.node
async def pair(a: int, b: int) -> tuple[int, int]:
    await asyncio.sleep(0.003)
    return a, b


@hfg.node
def odd_only(value: int) -> int | None:
    return value if value % 2 else None


@hfg.node
async def write(value: int, *, name: str) -> None:
    """Write a line unless it is there; the effect comes some time before the end of the firing."""
    lines = LEDGER.setdefault(name, [])
    if not lines or lines[-1] < value:
        lines.append(value)
    await asyncio.sleep(0.002)


@hfg.node
async def ticks(*, count: int = 20) -> AsyncIterator[int]:
    for number in range(count):
        await asyncio.sleep(0.01)
        yield number


class Killer(launching.LoopLauncher):
    """Begins parts on the loop, over a network with delays, and kills them when it is time."""

    def __init__(self, plan: Callable[[Killer], Any], seed: int = 0) -> None:
        super().__init__(network=Network(Faults(delay_s=(0.0, 0.003)), seed=seed))
        self.parts: dict[str, Any] = {}
        self.lives: dict[str, int] = {}
        self._plan = plan
        self._killing: asyncio.Task[None] | None = None

    async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> Any:
        launched = self.parts[part] = await super().launch(run, part, host, incarnations)
        self.lives[part] = self.lives.get(part, 0) + 1
        if self._killing is None:
            self._killing = asyncio.create_task(self._kill())
        return launched

    async def _kill(self) -> None:
        await asyncio.sleep(0.03)  # all are set up by then
        await self._plan(self)

    async def close(self) -> None:
        if self._killing is not None:
            self._killing.cancel()
        await super().close()


@pytest.fixture
def killed(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Killer]]:
    """Have parts killed in the next run."""

    def use(plan: Callable[[Killer], Any], seed: int = 0) -> list[Killer]:
        made: list[Killer] = []

        class Made(Killer):
            def __init__(self) -> None:
                super().__init__(plan, seed)
                made.append(self)

        monkeypatch.setattr(launching, "LoopLauncher", Made)
        return made

    return use


def at(seconds: float, *names: str) -> Callable[[Killer], Any]:
    """Kill these parts at one moment."""

    async def plan(killer: Killer) -> None:
        await asyncio.sleep(seconds)
        for name in names:
            killer.parts[name].kill()

    return plan


def in_turn(*deaths: tuple[float, str]) -> Callable[[Killer], Any]:
    """Kill them one after the other, each so long after the run has begun; at first one is back after 0.1 s."""

    async def plan(killer: Killer) -> None:
        passed = 0.0
        for moment, name in deaths:
            await asyncio.sleep(moment - passed)
            passed = moment
            killer.parts[name].kill()

    return plan


def at_random(seed: int, names: list[str], times: int) -> Callable[[Killer], Any]:
    """Kill one of them now and then; seldom enough to be forgiven."""

    async def plan(killer: Killer) -> None:
        choose = random.Random(seed)
        for _ in range(times):
            await asyncio.sleep(choose.uniform(0.0, 0.12))
            killer.parts[choose.choice(names)].kill()

    return plan


def chain(*, relays: int = 1, count: int = 60) -> hfg.Graph:
    graph = hfg.Graph("chain")
    last = graph.add(numbers(count=count)).out
    for number in range(relays):
        graph.group(f"relay{number}", process=True)
        one = graph.add(relay(), name=f"relay{number}", group=f"relay{number}")
        graph.connect(last, one.value)
        last = one.out
    graph.connect(last, graph.output("out", int))
    return graph


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("moment", [0.0005 * number for number in range(1, 40, 3)])
def test_a_relay_that_dies_at_any_moment_loses_and_doubles_nothing(killed: Any, moment: float) -> None:
    made = killed(at(moment, "relay0"))
    report = hfg.run(chain(count=20), clock="virtual")
    assert made[0].lives == {"relay0": 2}
    assert report.outputs == {"out": [1000 + number for number in range(20)]}
    assert any('the process of group "relay0" was restarted 1 times' in error for error in report.errors)


@pytest.mark.slow
@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("seed", range(12))
def test_relays_in_a_row_that_die_at_random_lose_and_double_nothing(killed: Any, seed: int) -> None:
    made = killed(at_random(seed, ["relay0", "relay1", "relay2"], 5), seed)
    report = hfg.run(chain(relays=3), clock="virtual")
    assert sum(made[0].lives.values()) >= 5
    assert report.outputs == {"out": [3000 + number for number in range(60)]}


@pytest.mark.rule("L2", "L3")
def test_two_neighbours_that_die_at_one_moment_lose_and_double_nothing(killed: Any) -> None:
    made = killed(at(0.03, "relay0", "relay1"))
    report = hfg.run(chain(relays=3, count=30), clock="virtual")
    assert made[0].lives == {"relay0": 2, "relay1": 2, "relay2": 1}
    assert report.outputs == {"out": [3000 + number for number in range(30)]}


def relays(*takes_s: float, count: int) -> hfg.Graph:
    """Relays in a row that take so long each."""
    graph = chain(relays=len(takes_s), count=count)
    for number, seconds in enumerate(takes_s):
        graph[f"relay{number}"].takes_s = seconds
    return graph


@pytest.mark.rule("L2", "F12")
def test_what_came_before_the_end_is_not_done_because_the_consumer_has_ended(killed: Any) -> None:
    """The first two have seen the end, and the value before it is still on its way, when all of them die."""
    made = killed(at(0.02, "relay0", "relay1", "relay2"))
    report = hfg.run(relays(0.0, 0.0, 0.05, count=1), clock="virtual", until_s=LONG_S)
    assert made[0].lives == {"relay0": 2, "relay1": 2, "relay2": 2}
    assert (report.outcome, report.outputs) == ("done", {"out": [3000]})


@pytest.mark.rule("L2")
def test_what_a_consumer_had_when_it_died_is_sent_to_its_next_life_as_new(killed: Any) -> None:
    """The producer had begun anew before, and was told by the one that died what it need not count again."""
    made = killed(in_turn((0.7, "relay0"), (0.85, "relay1")))
    report = hfg.run(relays(0.3, 0.5, count=2), clock="virtual", until_s=LONG_S)
    assert made[0].lives == {"relay0": 2, "relay1": 2}
    assert (report.outcome, report.outputs) == ("done", {"out": [2000, 2001]})


def joined(count: int) -> hfg.Graph:
    """What takes two ways belongs together where they meet."""
    graph = hfg.Graph()
    for name in ("left", "right", "join"):
        graph.group(name, process=True)
    source, both = graph.add(numbers(count=count)), graph.add(pair(), group="join")
    for name, port, takes_s in (("left", both.a, 0.001), ("right", both.b, 0.006)):
        one = graph.add(relay(takes_s=takes_s), name=name, group=name)
        graph.connect(source.out, one.value)
        graph.connect(one.out, port)
    graph.connect(both.out, graph.output("out", tuple[int, int]))
    return graph


@pytest.mark.slow
@pytest.mark.rule("L2")
@pytest.mark.parametrize("seed", range(10))
def test_what_a_join_puts_together_belongs_together_whoever_dies(killed: Any, seed: int) -> None:
    killed(at_random(seed, ["left", "right", "join"], 5), seed)
    report = hfg.run(joined(40), clock="virtual")
    assert report.outputs == {"out": [(1000 + number, 1000 + number) for number in range(40)]}


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize(
    "deaths",
    [
        ((0.0, "join"), (0.05, "left")),
        ((0.0, "left"), (0.0, "join")),
        ((0.0, "left"), (0.0, "right"), (0.0, "join")),
        ((0.0, "right"), (0.06, "join"), (0.105, "right"), (0.2, "left")),
    ],
    ids=["it waits to be told by one that dies", "both begin anew", "all do", "what waits there is counted"],
)
@pytest.mark.parametrize("count", [1, 8])
def test_a_join_goes_on_when_those_before_it_begin_anew_too(killed: Any, deaths: Any, count: int) -> None:
    killed(in_turn(*deaths))
    report = hfg.run(joined(count), clock="virtual", until_s=LONG_S)
    assert report.outcome == "done"
    assert report.outputs == {"out": [(1000 + number, 1000 + number) for number in range(count)]}


@pytest.mark.rule("L2", "P3")
@pytest.mark.parametrize("seed", range(5))
def test_silence_of_a_relay_is_told_once_as_well(killed: Any, seed: int) -> None:
    killed(at_random(seed, ["far"], 4), seed)
    graph = hfg.Graph()
    graph.group("far", process=True)
    source = graph.add(numbers())
    slow, odd = graph.add(relay(), group="far"), graph.add(odd_only(), group="far")
    graph.connect(source.out, slow.value)
    graph.connect(slow.out, odd.value)
    graph.connect(odd.out, graph.output("out", int))
    assert hfg.run(graph, clock="virtual").outputs == {"out": [1000 + number for number in range(60) if number % 2]}


@pytest.mark.rule("L2")
@pytest.mark.parametrize("seed", range(6))
def test_a_sink_with_a_ledger_has_each_effect_once_and_in_order(killed: Any, seed: int) -> None:
    killed(at_random(seed, ["relay", "sink"], 6), seed)
    name = f"ledger {seed}"
    graph = hfg.Graph()
    graph.group("relay", process=True)
    graph.group("sink", process=True)
    source, one, last = (
        graph.add(numbers()),
        graph.add(relay(), group="relay"),
        graph.add(write(name=name), group="sink"),
    )
    graph.connect(source.out, one.value)
    graph.connect(one.out, last.value)
    assert hfg.run(graph, clock="virtual").outcome == "done"
    assert LEDGER.pop(name) == [1000 + number for number in range(60)]


@pytest.mark.rule("L2")
def test_a_source_that_dies_begins_again_and_its_consumer_goes_on_with_what_comes(killed: Any) -> None:
    killed(at(0.105, "source"))
    graph = hfg.Graph()
    graph.group("source", process=True)
    source, one = graph.add(ticks(), group="source"), graph.add(relay())
    graph.connect(source.out, one.value)
    graph.connect(one.out, graph.output("out", int))
    report = hfg.run(graph, clock="virtual")
    found = report.outputs["out"]
    before = found.index(1000, 1)
    assert found[:before] == [1000 + number for number in range(before)]
    assert found[before:] == [1000 + number for number in range(20)]
    again = f'edge "ticks.out -> relay.value": its source "ticks" started over, and repeats up to {before} tokens'
    assert again in report.errors


class Ears(hfg.Node):
    """Is told, and shouts."""

    heard = hfg.Event(int)

    @hfg.slot
    async def hear(self) -> None:
        await asyncio.sleep(0.01)
        self.heard.trigger(1)


@pytest.mark.rule("A10", "L2")
def test_what_no_edge_counts_is_named_with_the_most_that_it_can_be(
    killed: Any, caplog: pytest.LogCaptureFixture
) -> None:
    killed(at(0.1, "far"))
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, last = graph.add(ticks()), graph.add(relay())
    lit, ears = graph.add(relay(), name="lit", group="far"), graph.add(Ears(), group="far")
    graph.start.activates(lit.activate)
    graph.connect(source.out, lit.value)
    graph.connect(lit.out, last.value, active=True)
    graph.connect(lit.processed, ears.hear, capacity=5)
    graph.connect(last.out, graph.output("out", int))
    report = hfg.run(graph, clock="virtual")
    told = [error for error in report.errors if error.startswith('group "far", each time: ')]
    assert [one.removeprefix('group "far", each time: ') for one in told] == [
        "up to 2 firings and slot calls in progress were lost with it",
        "up to 5 tokens on its own edges, signals not sent yet among them, were lost with it; more if queues had grown",
        "start was triggered in it again, with 1 signal: activity that had left it may exist once more for each",
    ]
    assert all(one.removeprefix('group "far", each time: ') in caplog.text for one in told)


@pytest.mark.rule("L2", "X1")
def test_a_part_that_dies_again_and_again_ends_the_run_with_one_sentence(killed: Any) -> None:
    async def plan(killer: Killer) -> None:
        while True:
            await asyncio.sleep(0.05)
            killer.parts["relay0"].kill()

    killed(plan)
    with pytest.raises(hfg.errors.RunError, match=r'group "relay0" is gone: .*it died 6 times within 60 s'):
        hfg.run(chain(count=100_000), clock="virtual")


def test_pauses_grow_and_old_deaths_are_forgotten() -> None:
    deaths = Deaths(limit=3, within_s=10.0)
    assert [deaths.died(now) for now in (0.0, 1.0, 2.0)] == [0.1, 0.2, 0.4]
    assert deaths.died(10.5) == 0.4  # that of 0.0 is forgotten
    assert deaths.died(10.6) is None
    assert deaths.count == 5


@pytest.mark.rule("L2")
def test_only_parts_that_answer_each_token_with_one_inherit_positions() -> None:
    assert inheriting(cut(flatten(chain(relays=2)))) == {"relay0", "relay1"}
    graph = chain(relays=2)
    graph.connect(graph["relay1"].out, graph.output("again", int), active=True)
    assert inheriting(cut(flatten(graph))) == {"relay0"}


class LastWord(hfg.Node):
    """Says one thing more when nothing more comes."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value

    def end(self) -> None:
        self.out.send(-1)


@pytest.mark.rule("L2", "F4")
def test_who_has_a_last_word_at_its_end_has_no_position_for_it() -> None:
    graph = hfg.Graph()
    graph.group("summing", process=True)
    summing = graph.add(LastWord(), group="summing")
    graph.connect(graph.add(numbers(count=3)).out, summing.value)
    graph.connect(summing.out, graph.output("out", int))
    assert inheriting(cut(flatten(graph))) == frozenset()
    assert hfg.run(graph, clock="virtual").outputs == {"out": [0, 1, 2, -1]}


@pytest.mark.rule("L2")
def test_two_chains_in_one_part_do_not_keep_step() -> None:
    """One may be far ahead of the other, so what is done in one says nothing of what is in the other."""
    graph = hfg.Graph()
    graph.group("both", process=True)
    for name, takes_s in (("slow", 0.01), ("fast", 0.0)):
        source = graph.add(numbers(count=40), name=f"{name}_numbers")
        middle = graph.add(relay(takes_s=takes_s), name=name, group="both")
        graph.connect(source.out, middle.value)
        graph.connect(middle.out, graph.output(f"{name}_out", int))
    assert inheriting(cut(flatten(graph))) == {"both"}
    wanted = [1000 + number for number in range(40)]
    assert hfg.run(graph, clock="virtual").outputs == {"slow_out": wanted, "fast_out": wanted}


def in_circles() -> hfg.Graph:
    """What leaves a process meets there again with what another has made of it."""
    graph = hfg.Graph()
    for name in ("here", "there"):
        graph.group(name, process=True)
    first, other = graph.add(relay(takes_s=0.0), group="here"), graph.add(relay(takes_s=0.0), group="there")
    both = graph.add(pair(), group="here")
    graph.connect(graph.add(numbers(count=30)).out, first.value)
    graph.connect(first.out, other.value)
    graph.connect(first.out, both.a)
    graph.connect(other.out, both.b)
    graph.connect(both.out, graph.output("out", tuple[int, int]))
    return graph


@pytest.mark.rule("L1", "L2")
@pytest.mark.parametrize("deaths", [(), ("here",), ("there",), ("here", "there")])
def test_two_parts_that_feed_each_other_keep_what_they_do_and_do_not_wait_for_each_other(
    killed: Any, deaths: tuple[str, ...]
) -> None:
    cutting = cut(flatten(in_circles()))
    assert (inheriting(cutting), keeping(cutting)) == (frozenset(), {"here": True, "there": True})
    killed(at(0.04, *deaths))
    report = hfg.run(in_circles(), clock="virtual", until_s=LONG_S)
    assert (report.outcome, report.outputs) == ("done", {"out": [(1000 + at, 2000 + at) for at in range(30)]})


@pytest.mark.rule("L2")
def test_a_loop_by_way_of_the_main_part_is_one_as_well() -> None:
    graph = chain(relays=2)
    assert inheriting(cut(flatten(graph))) == {"relay0", "relay1"}
    again = graph.add(relay(), group="relay0", name="again")
    pairs = graph.add(pair(), group="relay0", name="pairs")
    graph.connect(graph["relay1"].out, (between := graph.add(relay(), name="between")).value)
    graph.connect(between.out, again.value)
    graph.connect(graph["relay0"].out, pairs.a)
    graph.connect(again.out, pairs.b)
    graph.connect(pairs.out, graph.output("pairs", tuple[int, int]))
    assert set(keeping(cut(flatten(graph)))) == {"relay0", "relay1"}


@pytest.mark.rule("L1", "F12")
@pytest.mark.parametrize(("shorter", "longer"), [("a", "b"), ("b", "a")])
def test_a_source_that_goes_on_longer_than_its_partner_is_not_held_up(shorter: str, longer: str) -> None:
    """One node of the part has ended, and what is still for it is drained; another one goes on."""
    graph = hfg.Graph()
    graph.group("far", process=True)
    before, both = graph.add(relay(takes_s=0.0), group="far"), graph.add(pair(), group="far")
    graph.connect(graph.add(numbers(count=5)).out, both.ports.inputs[shorter])
    graph.connect(graph.add(numbers(count=40)).out, before.value)
    graph.connect(before.out, both.ports.inputs[longer])
    graph.connect(before.out, graph.output("all", int))
    graph.connect(both.out, graph.output("pairs", tuple[int, int]))
    assert inheriting(cut(flatten(graph))) == {"far"}
    report = hfg.run(graph, clock="virtual", until_s=LONG_S)
    assert report.outcome == "done"
    assert report.outputs["all"] == [1000 + number for number in range(40)]
    assert len(report.outputs["pairs"]) == 5


@hfg.node
async def latest(value: int) -> None:
    LEDGER.setdefault("latest", []).append(value)


class Counts(hfg.Node):
    """Says a number now and then, whether somebody listens or not."""

    said = hfg.Event(int)

    @hfg.slot
    def go(self, value: int) -> None:
        self.said.trigger(value)


@pytest.mark.rule("L3", "P5")
def test_signals_that_may_be_lost_go_on_when_both_ends_have_begun_anew(killed: Any) -> None:
    LEDGER.pop("latest", None)
    killed(in_turn((0.1, "listener"), (0.15, "speaker")))
    graph = hfg.Graph()
    for name in ("speaker", "listener"):
        graph.group(name, process=True)
    speaker, source = graph.add(Counts(), group="speaker"), graph.add(ticks(count=60))
    graph.connect(source.out, speaker.go)
    graph.connect(speaker.said, graph.add(latest(), group="listener").value, overflow="drop_oldest")
    assert hfg.run(graph, clock="virtual", until_s=LONG_S).outcome == "done"
    found = LEDGER.pop("latest")
    assert found[-1] == 59
    assert [number for number in found if number > 40] == list(range(41, 60))


@pytest.mark.rule("L2")
def test_who_does_not_know_yet_where_it_goes_on_is_waited_for() -> None:
    alignment = Alignment({"a": 0, "b": 0})
    alignment.done("a", 4)
    alignment.hold("a", [fifth := (("five", 0, 0.0), (1, 5))])
    before = alignment.start
    alignment.done("b", 0)  # nothing was ever sent there
    assert (before, alignment.start, alignment.let_go()) == (None, 5, {"a": [fifth], "b": []})


@pytest.mark.rule("L2")
def test_positions_are_those_of_the_edge_that_goes_on_longest() -> None:
    inheritance = Inheritance(["a", "b"])
    assert inheritance.arrive("b", [(1, 1), (1, 2), (1, 3)], ended=False) == []
    assert inheritance.arrive("a", [(1, 1)], ended=False) == [(1, 1)]
    assert inheritance.arrive("a", [(1, 2)], ended=True) == [(1, 2), (1, 3)]
    assert inheritance.arrive("b", [(1, 4)], ended=True) == [(1, 4)]


@pytest.mark.rule("L2")
def test_edges_go_on_behind_the_last_number_of_which_anybody_knows() -> None:
    alignment = Alignment({"a": 0, "b": 0}, ["c"])
    alignment.done("a", 4)
    alignment.hold("b", [(("six", 0, 0.0), (1, 6))])
    before = alignment.start
    alignment.came("c", 3)
    assert (before, alignment.start, alignment.passed_over("a")) == (None, 6, 1)
    assert Alignment({"a": 2}, ["c"]).start is None


@pytest.mark.rule("L2", "P7")
def test_initial_values_are_taken_before_the_first_number() -> None:
    alignment = Alignment({"a": 2})
    alignment.done("a", 5)  # in the seventh firing
    assert alignment.start == 8
    unused = Alignment({"a": 2})
    unused.done("a", 0)
    assert unused.start == 1

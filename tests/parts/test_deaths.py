"""Parts that die and begin anew, in virtual time: what is lost, what not, and when it is enough (rules L2, L3, X1)."""

from __future__ import annotations

import asyncio
import random
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg.graph.flat import cut, flatten
from hfg.parts.model.inheriting import Alignment, inheriting
from hfg.parts.model.lives import Deaths
from hfg.parts.processes import launching
from hfg_transports.memory import Faults, Network

LEDGER: dict[str, list[int]] = {}


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

    async def launch(self, run: str, part: str, host: str, lives: tuple[int, int]) -> Any:
        launched = self.parts[part] = await super().launch(run, part, host, lives)
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
    assert any('the process of group "relay0" was begun again 1 times' in error for error in report.errors)


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


@pytest.mark.rule("L2")
@pytest.mark.parametrize("seed", range(10))
def test_what_a_join_puts_together_belongs_together_whoever_dies(killed: Any, seed: int) -> None:
    killed(at_random(seed, ["left", "right", "join"], 5), seed)
    graph = hfg.Graph()
    for name in ("left", "right", "join"):
        graph.group(name, process=True)
    source, both = graph.add(numbers(count=40)), graph.add(pair(), group="join")
    for name, port, takes_s in (("left", both.a, 0.001), ("right", both.b, 0.006)):
        one = graph.add(relay(takes_s=takes_s), name=name, group=name)
        graph.connect(source.out, one.value)
        graph.connect(one.out, port)
    graph.connect(both.out, graph.output("out", tuple[int, int]))
    report = hfg.run(graph, clock="virtual")
    assert report.outputs == {"out": [(1000 + number, 1000 + number) for number in range(40)]}


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
    found = hfg.run(graph, clock="virtual").outputs["out"]
    before = found.index(1000, 1)
    assert found[:before] == [1000 + number for number in range(before)]
    assert found[before:] == [1000 + number for number in range(20)]


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
    graph.move(graph["numbers"], group="relay1")  # a source: what it sends answers nothing
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
    assert inheriting(cut(flatten(graph))) == frozenset()
    wanted = [1000 + number for number in range(40)]
    assert hfg.run(graph, clock="virtual").outputs == {"slow_out": wanted, "fast_out": wanted}


@pytest.mark.rule("L2")
def test_edges_go_on_behind_the_producer_that_knows_most() -> None:
    alignment = Alignment(["a", "b"])
    alignment.goes_on("a", (1, 4))
    assert alignment.arrive("a", []) == {}
    fifth, sixth = ((("five", 0, 0.0), (1, 5)), (("six", 0, 0.0), (1, 6)))
    assert alignment.arrive("a", [fifth, sixth]) == {}
    alignment.goes_on("b", (1, 5))
    assert alignment.arrive("b", []) == {"a": (1, [sixth])}
    assert alignment.arrive("b", [sixth]) == {"b": (0, [sixth])}

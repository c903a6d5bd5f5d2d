"""Agents and the runs that they begin parts of, in virtual time over the transport in memory (rules L1 to L3, X3)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, TypeVar

import msgspec
import pytest

import hfg
from hfg.engine.face.watching import Answer, Question
from hfg.errors import NoAnswer, QueryRefused, TransportError
from hfg.parts.hosts import requests
from hfg.parts.hosts.agent import Agent
from hfg.parts.hosts.realm import GONE_S, Realm, RunIs, agent_place
from hfg.parts.hosts.remote_parts import AgentLauncher
from hfg.parts.hosts.requests import ask
from hfg.parts.processes import launching
from hfg_transports.memory import MemorySession, Network

T = TypeVar("T")
OnTheLoop = launching.LoopLauncher  # before tests put another in its place


@hfg.node
async def numbers(*, count: int = 20) -> AsyncIterator[int]:
    for number in range(count):
        await asyncio.sleep(0.1)
        yield number


@hfg.node
async def relay(value: int) -> int:
    await asyncio.sleep(0.01)
    return value


def chain(*hosts: str, count: int = 20) -> hfg.Graph:
    graph = hfg.Graph("chain")
    last = graph.add(numbers(count=count)).out
    for host in hosts:
        graph.group(f"on_{host}", host=host)
        one = graph.add(relay(), name=f"relay_{host}", group=f"on_{host}")
        graph.connect(last, one.value)
        last = one.out
    graph.connect(last, graph.output("out", int))
    return graph


class Computer:
    """A host whose processes are tasks."""

    def __init__(self, network: Network) -> None:
        self.begun: dict[str, list[Any]] = {}
        self.absent: set[str] = set()
        self.forgotten: list[str] = []
        self._launcher = OnTheLoop(network=network)
        self._numbers = iter(range(1, 100))

    async def part(self, order: requests.Start) -> Any:
        task = await self._launcher.launch(order.run, order.part, "", order.incarnations)
        task.process = next(self._numbers)
        self.begun.setdefault(order.part, []).append(task)
        return task

    async def main(self, order: requests.Deploy) -> Any:
        raise AssertionError("nothing is deployed here")

    def missing(self, modules: list[str]) -> requests.Missing:
        return requests.Missing([one for one in modules if one in self.absent], "/robot")

    def read_log(self, run: str, offset: int) -> requests.Chunk:
        return requests.Chunk("", 0)

    def forget(self, run: str) -> None:
        self.forgotten.append(run)

    async def close(self) -> None:
        """Nothing was begun."""


class World:
    """A network with agents."""

    def __init__(self) -> None:
        self.network = Network(lease_s=1.0)
        self.computers = {host: Computer(self.network) for host in ("arm", "leg")}
        self.agents: dict[str, Agent] = {}
        self.sessions: dict[str, MemorySession] = {}

    async def agent(self, host: str) -> Agent:
        session = self.sessions[host] = await self.network.open(host=host)
        agent = self.agents[host] = Agent(session, self.computers[host])
        await agent.open()
        return agent

    def kill(self, host: str) -> None:
        """The agent dies, and with it what it has begun."""
        self.sessions[host].die()
        for lives in self.computers[host].begun.values():
            for task in lives:
                task.kill()

    async def close(self) -> None:
        for host, agent in self.agents.items():
            if not self.sessions[host]._closed:
                await agent.close()
                await self.sessions[host].close()

    async def realm(self) -> Realm:
        return Realm(await self.network.open(host="somewhere"))


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    """Runs find their agents in here."""
    world = World()
    monkeypatch.setattr(launching, "LoopLauncher", lambda: AgentLauncher(OnTheLoop(network=world.network, host="base")))
    return world


def play(world: World, scene: Callable[[], Awaitable[T]]) -> T:
    """Play a scene in virtual time; agents are ended behind it."""

    async def main() -> T:
        try:
            return await scene()
        finally:
            await world.close()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main())


@pytest.mark.rule("L1", "L2")
def test_parts_run_on_the_hosts_that_their_groups_name(world: World) -> None:
    async def scene() -> hfg.Report:
        await world.agent("arm")
        await world.agent("leg")
        return await hfg.run_async(chain("arm", "leg"), clock="virtual")

    assert play(world, scene).outputs == {"out": list(range(20))}
    assert {host: list(computer.begun) for host, computer in world.computers.items()} == {
        "arm": ["on_arm"],
        "leg": ["on_leg"],
    }
    assert all(len(computer.forgotten) == 1 for computer in world.computers.values())


def refused(world: World, sentence: str, *, agent: str) -> None:
    """Let a chain run of which a node lives on the host "arm", with an agent here; see why it is not begun."""

    async def scene() -> None:
        await world.agent(agent)
        await hfg.run_async(chain("arm"), clock="virtual")

    with pytest.raises(TransportError, match=f"^{sentence}"):
        play(world, scene)


def test_a_host_without_an_agent_is_named_with_those_that_have_one(world: World) -> None:
    sentence = 'host "arm" has no agent that can be reached from here; there are agents of "leg": run `hfg agent` on'
    refused(world, sentence, agent="leg")
    assert not world.computers["leg"].begun


def test_two_agents_of_one_name_that_did_not_see_each_other_get_nothing(world: World) -> None:
    async def scene() -> None:
        await world.agent("arm")
        first = world.sessions["arm"]
        world.network.cut(first)
        await world.agent("arm")
        second = world.sessions["arm"]
        world.network.heal(first)
        try:
            await hfg.run_async(chain("arm"), clock="virtual")
        finally:
            first.die()
            second.die()

    with pytest.raises(TransportError, match='^2 agents are named "arm" .*stop all but one, or rename one'):
        play(world, scene)


def test_an_agent_whose_name_is_taken_does_not_begin(world: World) -> None:
    async def scene() -> None:
        await world.agent("arm")
        await Agent(await world.network.open(host="arm"), world.computers["arm"]).open()

    with pytest.raises(TransportError, match='^another agent is already named "arm" .*give this one another name'):
        play(world, scene)


def test_modules_that_are_missing_are_named_before_anything_begins_for_all_hosts_at_once(world: World) -> None:
    async def scene() -> None:
        await world.agent("arm")
        await world.agent("leg")
        world.computers["arm"].absent = world.computers["leg"].absent = {__name__}
        await hfg.run_async(chain("arm", "leg"), clock="virtual")

    with pytest.raises(TransportError) as caught:
        play(world, scene)
    sentences = str(caught.value).split("; and ")
    assert [one.partition(",")[0] for one in sentences] == [
        f'host "{host}" has no module "{__name__}"' for host in ("arm", "leg")
    ]
    assert all('which "numbers" needs: install it for the Python of its agent' in one for one in sentences)
    assert not world.computers["arm"].begun


def test_another_version_of_hfg_is_named_with_both(world: World) -> None:
    async def scene() -> None:
        agent = await world.agent("arm")
        agent._announced.close()  # type: ignore[union-attr]
        other = msgspec.structs.replace(agent.me, hfg="0.0.9", python="3.10.2")
        world.sessions["arm"].announce(agent_place(other), msgspec.msgpack.encode(other))
        await hfg.run_async(chain("arm"), clock="virtual")

    with pytest.raises(
        TransportError, match=r'^host "arm" has hfg 0\.0\.9 \(Python 3\.10\.2\), and here is hfg .*same'
    ):
        play(world, scene)


@pytest.mark.rule("L2", "L3")
def test_a_part_that_dies_begins_anew_by_its_agent_and_nothing_is_lost(world: World) -> None:
    async def scene() -> list[Any]:
        await world.agent("arm")
        async with hfg.running(chain("arm"), clock="virtual") as run:
            reading = asyncio.create_task(read(run))
            await asyncio.sleep(0.55)
            world.computers["arm"].begun["on_arm"][0].kill()
            await run.wait_finished()
            return await reading

    assert play(world, scene) == list(range(20))
    assert len(world.computers["arm"].begun["on_arm"]) == 2


async def read(run: hfg.Run) -> list[Any]:
    return [value async for value in run.read("out")]


@pytest.mark.rule("L2", "L3")
def test_while_an_agent_is_gone_all_wait_and_with_the_next_one_they_go_on(world: World) -> None:
    async def scene() -> tuple[list[Any], list[str]]:
        await world.agent("arm")
        realm = await world.realm()
        async with hfg.running(chain("arm"), clock="virtual") as run:
            reading = asyncio.create_task(read(run))
            await asyncio.sleep(0.55)
            world.kill("arm")
            await asyncio.sleep(60)
            (place,) = realm.runs
            told = await ask(realm.session, place, requests.Parts())
            await world.agent("arm")
            await run.wait_finished()
            return await reading, [part.state for part in told.parts]

    values, states = play(world, scene)
    assert values == list(range(20))
    assert states == ["running", "returning"]


@pytest.mark.rule("L3")
def test_a_cable_that_is_pulled_for_less_than_the_patience_of_both_ends_nothing(world: World) -> None:
    async def scene() -> list[Any]:
        await world.agent("arm")
        async with hfg.running(chain("arm"), clock="virtual") as run:
            reading = asyncio.create_task(read(run))
            await asyncio.sleep(0.55)
            there = world.network.sessions
            world.network.cut(*there)
            await asyncio.sleep(GONE_S - 1.0)
            world.network.heal(*there)
            await run.wait_finished()
            return await reading

    assert play(world, scene) == list(range(20))
    assert len(world.computers["arm"].begun["on_arm"]) == 1


@pytest.mark.rule("X3")
def test_when_the_main_part_is_killed_the_agent_ends_its_parts(world: World) -> None:
    async def scene() -> tuple[bool, bool]:
        await world.agent("arm")
        before = world.network.sessions
        running = asyncio.create_task(hfg.run_async(chain("arm", count=10_000), clock="virtual"))
        await asyncio.sleep(1.0)
        (task,) = world.computers["arm"].begun["on_arm"]
        next(one for one in world.network.sessions if one not in before).die()  # the first was that of the main part
        await asyncio.sleep(GONE_S - 1.0)
        early = task._task.done()
        await asyncio.sleep(4.0)  # and some for the last words, which nobody hears
        late = task._task.done()
        running.cancel()
        await asyncio.wait({running})
        return early, late

    assert play(world, scene) == (False, True)
    assert world.computers["arm"].forgotten


def test_an_agent_that_is_ended_ends_its_parts_and_the_run_waits_for_the_next(world: World) -> None:
    async def scene() -> list[Any]:
        agent = await world.agent("arm")
        async with hfg.running(chain("arm"), clock="virtual") as run:
            reading = asyncio.create_task(read(run))
            await asyncio.sleep(0.55)
            await agent.close()
            await world.sessions["arm"].close()
            assert world.computers["arm"].begun["on_arm"][0]._task.done()
            await world.agent("arm")
            await run.wait_finished()
            return await reading

    assert play(world, scene) == list(range(20))


@pytest.mark.slow
def test_a_part_is_restarted_when_somebody_asks_for_it_and_that_is_no_death(world: World) -> None:
    async def scene() -> tuple[list[Any], list[tuple[str, str, int]]]:
        await world.agent("arm")
        realm = await world.realm()
        async with hfg.running(chain("arm", count=100), clock="virtual") as run:
            reading = asyncio.create_task(read(run))
            (place,) = realm.runs
            for _ in range(7):  # more often than deaths are forgiven
                await asyncio.sleep(1.0)
                await ask(realm.session, place, requests.Restart("on_arm"))
            await asyncio.sleep(1.0)
            told = await ask(realm.session, place, requests.Parts())
            await run.wait_finished()
            return await reading, [(part.group, part.host, part.restarts) for part in told.parts]

    values, parts = play(world, scene)
    assert values == list(range(100))
    assert parts == [("", "base", 0), ("on_arm", "arm", 7)]


def test_who_looks_at_a_run_from_another_host_sees_its_table_and_no_port(world: World) -> None:
    async def scene() -> tuple[Answer, Answer]:
        await world.agent("arm")
        realm = await world.realm()
        async with hfg.running(chain("arm"), clock="virtual"):
            (place,) = realm.runs

            async def look(question: Question) -> Answer:
                told = await ask(realm.session, place, requests.Look(msgspec.json.encode(question)))
                return msgspec.json.decode(told.answer, type=Answer)

            return await look(Question("glance")), await look(Question("tap", path="numbers.out"))

    glance, tap = play(world, scene)
    assert glance.glance is not None
    assert glance.glance.graph == "chain"
    assert tap.error == "tokens at a port can be tapped only on the host of the main part: run hfg tap there"


def test_types_of_the_program_itself_are_not_found_on_other_hosts(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hfg.files.building.modules_of", lambda _: {"__main__": "numbers"})

    sentence = 'host "arm" cannot import the type of "numbers", which is in the program itself .*into a module, and'
    refused(world, sentence, agent="arm")


def test_what_is_asked_in_vain_of_a_run_is_refused_with_what_there_is(world: World) -> None:
    async def scene() -> None:
        await world.agent("arm")
        realm = await world.realm()
        async with hfg.running(chain("arm"), clock="virtual"):
            (place,) = realm.runs
            await ask(realm.session, place, requests.Restart("leg"))

    with pytest.raises(QueryRefused, match='^the run has no group "leg" with a process of its own; it has "on_arm"'):
        play(world, scene)


def test_a_run_is_stopped_from_outside_and_is_told_of_no_more(world: World) -> None:
    async def scene() -> tuple[str, int, int]:
        await world.agent("arm")
        realm = await world.realm()
        running = asyncio.create_task(hfg.run_async(chain("arm", count=10_000), clock="virtual"))
        await realm.until(lambda: realm.runs, 10)
        await asyncio.sleep(1.0)
        (place,) = realm.runs
        await ask(realm.session, place, requests.Stop())
        report = await running
        await asyncio.sleep(0)
        return report.outcome, len(realm.runs), len(world.computers["arm"].forgotten)

    assert play(world, scene) == ("stopped", 0, 1)


@pytest.mark.rule("L2")
def test_of_two_lives_the_agent_begins_the_next_when_the_former_is_gone_and_an_order_twice_once(world: World) -> None:
    async def scene() -> None:
        agent = await world.agent("arm")
        realm = await world.realm()
        realm.session.announce("runs/one", msgspec.msgpack.encode(RunIs("one", "graph", "graph.py", "base", 1)))
        place, begun = agent_place(agent.me), world.computers["arm"].begun

        async def start(life: int) -> int:
            order = requests.Start("hfg/one", "far", (life, 1), [], 0)
            return (await ask(realm.session, place, order)).process

        assert [await start(1), await start(1), await start(2)] == [1, 1, 2]
        first, second = begun["far"]
        assert first._task.done()
        assert not second._task.done()
        with pytest.raises(QueryRefused, match="incarnation 1 of group"):
            await start(1)
        assert "no process of it" in (await ask(realm.session, place, requests.Wait("hfg/one", "far", 1))).how
        assert (await ask(realm.session, place, requests.Wait("hfg/one", "far", 2), timeout_s=60)).how == ""
        await ask(realm.session, place, requests.End("hfg/one", "far", 2))
        assert second._task.done()

    play(world, scene)


def test_what_is_no_question_is_refused_with_a_sentence(world: World) -> None:
    async def scene() -> None:
        agent = await world.agent("arm")
        realm = await world.realm()
        with pytest.raises(QueryRefused, match="^the question cannot be understood"):
            await realm.session.ask(f"{agent_place(agent.me)}/{requests.Check.verb}", b"\xff")
        with pytest.raises(NoAnswer):
            await ask(realm.session, "agents/arm/nobody", requests.Check([]))

    play(world, scene)


def test_in_virtual_time_there_is_no_realm() -> None:
    with pytest.raises(hfg.errors.UsageError, match="^settings= needs the real clock"):
        hfg.run(chain(), clock="virtual", settings="cell.toml")

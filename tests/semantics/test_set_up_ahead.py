"""What a node sends from `setup()` on, before it takes part in the run, is kept until it does (rules R4, F10, P5)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

import hfg
from hfg import commands as c
from hfg.testing import Recorder, recorder, replay
from hfg.trace import EventTriggered, NodeEnabled, StructureChanged, TokenSent

HERE = __name__
ALL = [1, 10, 11, 2, 12]


class Says(hfg.Node):
    """Speaks in `setup()`, which waits meanwhile, and in a task that it starts."""

    said = hfg.Event(int)

    async def setup(self) -> None:
        self.said.trigger(1)
        self.start_soon(self.more())
        await asyncio.sleep(0.010)
        self.said.trigger(2)

    async def more(self) -> None:
        self.said.trigger(10)
        await asyncio.sleep(0.005)
        self.said.trigger(11)
        await asyncio.sleep(0.010)
        self.said.trigger(12)


class Pumps(hfg.Node):
    """Sends without end, as fast as there is room."""

    said = hfg.Event(int)

    def setup(self) -> None:
        self.start_soon(self.pump())

    async def pump(self) -> None:
        number = 0
        while True:
            number += 1
            await self.said.trigger_wait(number)


class Ticks(hfg.Node):
    """Speaks every 2 ms."""

    said = hfg.Event(int)

    def setup(self) -> None:
        self.said.trigger(0)
        self.start_soon(self.tick())

    async def tick(self) -> None:
        for number in range(1, 6):
            await asyncio.sleep(0.002)
            self.said.trigger(number)


class Hears(hfg.Node):
    heard = hfg.Event(int)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.heard.trigger(value)


class Switch(hfg.Node):
    """Enables another."""

    on = hfg.Event(None)

    @hfg.slot
    def turn(self) -> None:
        self.on.trigger()


@hfg.node
def once() -> Iterator[int]:
    yield 1


@hfg.node
async def busy(value: int) -> None:
    await asyncio.sleep(0.05)


def graph(*, says: bool = False, enabled: bool = True) -> hfg.Graph:
    """Somebody who hears, and somebody who is busy until 50 ms."""
    made = hfg.Graph("ahead")
    heard = made.add(Hears(), name="hears")
    made.connect(made.add(once(), name="once").out, made.add(busy(), name="busy").value)
    switch = made.add(Switch(), name="switch")
    if says:
        one = made.add(Says(), name="says", enabled=enabled)
        made.connect(one.said, heard.hear)
        made.connect(switch.on, one.enable)
    return made


def edited(made: hfg.Graph, *commands: c.Command, turn: bool = False, endless: bool = False) -> Recorder:
    """Edit it at 20 ms, or switch on; give what was seen."""
    trace = recorder()

    async def main() -> None:
        async with hfg.running(made, trace=trace) as run:
            await asyncio.sleep(0.020)
            if turn:
                await run.trigger(made["switch"].ports.slots["turn"])
            else:
                await run.edit(*commands)
            if endless:
                await asyncio.sleep(0.060)
            else:
                await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    return trace


def sent(trace: Recorder, edge: str) -> list[tuple[float, int, float]]:
    return [
        (one.time, one.token.value, one.token.stamp) for one in trace if isinstance(one, TokenSent) if one.edge == edge
    ]


def came(trace: Recorder) -> list[int]:
    return [one.token.value for one in trace if isinstance(one, EventTriggered) and one.event == "hears.heard"]


def begun(trace: Recorder) -> float:
    return next(one.time for one in trace if isinstance(one, StructureChanged | NodeEnabled))


ADD = (c.Add(f"{HERE}:Says", "says"), c.Connect("says.said", "hears.hear"))
WAITS = c.Disconnect("once.out", "busy.value")


@pytest.mark.rule("R4", "T5")
def test_what_an_added_node_says_while_it_is_set_up_comes_when_the_edit_takes_effect() -> None:
    trace = edited(graph(), *ADD)
    assert came(trace) == ALL
    assert begun(trace) == pytest.approx(0.030)
    found = sent(trace, "says.said -> hears.hear")
    assert [value for _, value, _ in found] == ALL
    assert [time for time, _, _ in found] == pytest.approx([0.030] * 4 + [0.035])
    assert [stamp for _, _, stamp in found] == pytest.approx([0.020, 0.020, 0.025, 0.030, 0.035])


@pytest.mark.rule("R4")
def test_what_its_tasks_say_while_the_edit_waits_for_others_is_not_lost() -> None:
    trace = edited(graph(), *ADD, WAITS)
    assert begun(trace) == pytest.approx(0.050)
    assert came(trace) == ALL


@pytest.mark.rule("R4")
def test_the_oracle_says_the_same_of_a_node_that_speaks_while_its_edit_waits() -> None:
    trace = edited(graph(), c.Add(f"{HERE}:Ticks", "ticks"), c.Connect("ticks.said", "hears.hear"), WAITS)
    assert came(trace) == [0, 1, 2, 3, 4, 5]
    replay(graph, trace)


@pytest.mark.rule("R4", "F8")
def test_code_that_waits_for_room_waits_until_the_edit_takes_effect() -> None:
    trace = edited(
        graph(),
        c.Add(f"{HERE}:Pumps", "says"),
        WAITS,
        c.Connect("says.said", "busy.value", capacity=2),
        endless=True,
    )
    assert [value for _, value, _ in sent(trace, "says.said -> busy.value")][:2] == [1, 2]
    assert begun(trace) == pytest.approx(0.050)


@pytest.mark.rule("R4")
def test_what_a_replacement_says_as_it_is_set_up_comes_when_it_has_replaced() -> None:
    trace = edited(graph(says=True), c.Replace("says", f"{HERE}:Says"))
    assert came(trace) == ALL + ALL


@pytest.mark.rule("F10", "R4")
def test_what_a_node_says_as_it_is_enabled_by_an_edit_comes_when_it_is() -> None:
    trace = edited(graph(says=True, enabled=False), c.Enable("says"))
    assert came(trace) == ALL


@pytest.mark.rule("F10")
def test_what_a_node_says_as_it_is_enabled_by_its_slot_comes_when_it_is() -> None:
    trace = edited(graph(says=True, enabled=False), turn=True)
    assert came(trace) == ALL


class Fails(Says):
    async def setup(self) -> None:
        await super().setup()
        raise ValueError("no")


@pytest.mark.rule("R4")
def test_an_edit_that_fails_leaves_nothing_of_what_its_nodes_have_said() -> None:
    trace = recorder()

    async def main() -> None:
        made = graph(says=True, enabled=False)
        async with hfg.running(made, trace=trace) as run:
            with pytest.raises(hfg.errors.NodeError, match="no"):
                await run.edit(c.Enable("says"), c.Add(f"{HERE}:Fails", "fails"), c.Connect("fails.said", "hears.hear"))
            await asyncio.sleep(0.060)
            assert came(trace) == []
            await run.edit(c.Enable("says"))
            await asyncio.sleep(0.060)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    assert came(trace) == ALL


@pytest.mark.rule("P5", "R4")
def test_what_an_edge_refuses_that_was_said_ahead_fails_as_in_setup() -> None:
    with pytest.raises(hfg.errors.NodeError, match=r'"says".*setup\(\).*queue of "says.said -> busy.value" is full'):
        edited(graph(), ADD[0], WAITS, c.Connect("says.said", "busy.value", overflow="error", capacity=1))


@pytest.mark.rule("F10", "R4")
def test_tasks_of_a_replacement_of_a_disabled_node_end_with_its_setup() -> None:
    made = graph(says=True, enabled=False)
    trace = edited(made, c.Replace("says", f"{HERE}:Ticks"))
    assert came(trace) == []
    assert not [one for one in trace if isinstance(one, EventTriggered) and one.time > begun(trace)]

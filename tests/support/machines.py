"""A Hypothesis machine: the engine and the oracle get the same things from outside, step by step, and must do the same.

Feeds, signals into slots, events that are triggered, parameters that are set, activity that is reset. After every step
the run goes on until it is quiet; what it did is replayed on the oracle. Shrinks to the few steps that are needed.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from typing import Any

from hypothesis import assume
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

import hfg
from hfg.base.token import END
from hfg.errors import HfgError
from hfg.testing.conformance import Replay
from hfg.testing.plans import GraphPlan
from hfg.testing.recording import Recorder
from hfg.testing.reference import ReferenceMachine, reference_run
from hfg.trace import TraceEvent
from tests.support.making import Allowed, graphs

__all__ = ["STIMULATED", "EngineAgainstOracle"]

STIMULATED = Allowed(max_nodes=5, feeds=True, gates=False, failing_calls=False, doing=True)
"""What occurs in the graphs of the machine."""

MOST_MOVES = 800
MOST_EVENTS = 4000


class _LiveRun:
    """A run that waits for what it is told; every step takes the loop to the next quiet moment."""

    def __init__(self, plan: GraphPlan, seed: int) -> None:
        self.graph = plan.build()
        self.trace = Recorder()
        self.goes_round = False  # what came from outside has set something going that never stops
        self.failure: HfgError | None = None
        self.now = 0.0
        self.feeds: dict[str, Any] = {}
        self._seed = seed
        self._runner = asyncio.Runner(loop_factory=hfg.VirtualTimeLoop)
        self._steps: asyncio.Queue[Callable[[Any], Awaitable[None]] | None] = asyncio.Queue()
        self._sending: list[asyncio.Task[None]] = []
        self._runner.run(self._begin())

    @property
    def is_over(self) -> bool:
        """Whether nothing more can be done to it."""
        return self._main.done()

    def do(self, step: Callable[[Any], Awaitable[None]]) -> None:
        """Do something to the run and let it come to rest."""
        self._runner.run(self._do(step))

    def end(self) -> None:
        """Let the run end by itself."""
        self._runner.run(self._do(None))
        self._runner.close()

    def close(self) -> None:
        """Give up."""
        self._main.cancel()
        self._runner.run(asyncio.sleep(0))
        self._runner.close()

    def send(self, name: str, value: int) -> None:
        """Send into a feed, without waiting until it is processed."""
        self._sending.append(asyncio.create_task(self._send(name, value)))

    async def _send(self, name: str, value: int) -> None:
        with contextlib.suppress(HfgError):  # the run may be over before
            await self.feeds[name].send(value)

    async def _begin(self) -> None:
        self._rested = asyncio.Event()
        self._main = asyncio.create_task(self._hold())
        await self._resting()

    async def _hold(self) -> None:
        try:
            async with hfg.running(self.graph, policy="random", seed=self._seed, trace=self._see) as run:
                self._run = run
                for name, port in self.graph.inputs.items():
                    self.feeds[name] = await run.feed(port).__aenter__()
                await self._rest(run)
                while (step := await self._steps.get()) is not None:
                    await step(run)
                    await self._rest(run)
                for sending in self._sending:
                    sending.cancel()  # or leaving the feed would wait for what will never be processed
                for feed in self.feeds.values():
                    await feed.__aexit__(None, None, None)
                await run.wait_finished()
        except HfgError as error:
            self.failure = error

    def _see(self, event: TraceEvent) -> None:
        self.trace.append(event)
        if len(self.trace) == MOST_EVENTS:
            self.goes_round = True
            asyncio.get_running_loop().call_soon(self._run.stop)

    async def _rest(self, run: Any) -> None:
        await asyncio.sleep(0)
        await run.wait_quiet()
        self.now = run.now()
        self._rested.set()

    async def _do(self, step: Callable[[Any], Awaitable[None]] | None) -> None:
        self._rested.clear()
        self._steps.put_nowait(step)
        await self._resting(until_end=step is None)

    async def _resting(self, *, until_end: bool = False) -> None:
        rest = asyncio.create_task(self._rested.wait())
        waiters: list[asyncio.Future[Any]] = [self._main] if until_end else [self._main, rest]
        await asyncio.wait(waiters, return_when=asyncio.FIRST_COMPLETED)
        rest.cancel()
        if self._main.done():
            self._main.result()


class EngineAgainstOracle(RuleBasedStateMachine):
    """Subclass it, or run it as it is: `run_state_machine_as_test(EngineAgainstOracle)`."""

    allowed = STIMULATED

    def __init__(self) -> None:
        super().__init__()
        self.live: _LiveRun | None = None
        self.differs = False

    @initialize(data=st.data(), seed=st.integers(0, 1000))
    def begin(self, data: st.DataObject, seed: int) -> None:
        """Draw a graph that does not go round for ever, and start it."""
        plan = data.draw(graphs(self.allowed).filter(_comes_to_rest), label="graph")
        self.plan = plan
        self.replaying = Replay(plan.build(), held_open=True)
        self.seen = 0
        self.live = _LiveRun(plan, seed)
        self.compare()

    # --- what comes from outside

    @precondition(lambda self: self.goes_on and self.plan.feeds)
    @rule(data=st.data(), value=st.integers(0, 4))
    def feed(self, data: st.DataObject, value: int) -> None:
        """Send into an input of the graph."""
        name = data.draw(st.sampled_from(self.plan.feeds), label="feed")
        self.stimulate(lambda machine: machine.feed(name, value), self._sending(name, value))

    @precondition(lambda self: self.goes_on)
    @rule(data=st.data(), value=st.integers(0, 4), activity=st.sampled_from([0, 1, -1]))
    def call(self, data: st.DataObject, value: int, activity: int) -> None:
        """Send a signal into a slot: the node's own, or `enable`, `disable`, `reset`, `activate`, `deactivate`."""
        node = data.draw(st.sampled_from(self.plan.nodes), label="node")
        path = self.plan.paths()[node.name]
        assert self.live is not None
        running = self.live.graph[path]
        automatic = ["activate", "deactivate", "disable", "enable", "reset"]
        if not self.replaying.machine.is_enabled(self.replaying.machine.paths[path]):
            automatic = ["enable"]  # the only slot that a disabled node answers
            declared: list[str] = []
        else:
            declared = list(running.ports.slots)
        slot = data.draw(st.sampled_from([*declared, *automatic]), label="slot")

        async def call(run: Any) -> None:
            await run.trigger(running.ports.slots[slot], value, activity=activity)

        self.stimulate(lambda machine: machine.call_from_outside(path, slot, value, activity), call)

    @precondition(lambda self: self.goes_on and self._events())
    @rule(data=st.data(), value=st.integers(0, 4), activity=st.sampled_from([None, 0, 1, -1]))
    def trigger(self, data: st.DataObject, value: int, activity: int | None) -> None:
        """Trigger an event of a node."""
        path, event = data.draw(st.sampled_from(self._events()), label="event")
        assert self.live is not None
        port = self.live.graph[path].ports.events[event]
        sent = None if port.type is None else value

        async def trigger(run: Any) -> None:
            await run.trigger(port, sent, activity=activity)

        self.stimulate(lambda machine: machine.trigger_from_outside(path, event, sent, activity), trigger)

    @precondition(lambda self: self.goes_on and any(node.type == "Scaled" for node in self.plan.nodes))
    @rule(data=st.data(), value=st.integers(0, 4))
    def set(self, data: st.DataObject, value: int) -> None:
        """Set a parameter."""
        owners = [node.name for node in self.plan.nodes if node.type == "Scaled"]
        path = self.plan.paths()[data.draw(st.sampled_from(owners), label="node")]
        assert self.live is not None
        parameter = self.live.graph[path].ports.parameters["factor"]

        async def set_it(run: Any) -> None:
            run.set(parameter, value)

        self.stimulate(lambda machine: machine.set_from_outside(path, "factor", value), set_it)

    @precondition(lambda self: self.goes_on)
    @rule()
    def reset_activity(self) -> None:
        """Take all activity away and start again (A14)."""

        async def reset(run: Any) -> None:
            run.reset_activity()

        self.stimulate(ReferenceMachine.reset_activity, reset)

    @precondition(lambda self: not self.goes_on)
    @rule()
    def look(self) -> None:
        """Nothing more can be done to a run that is over."""

    # --- comparing

    @property
    def goes_on(self) -> bool:
        """Whether the run still takes something."""
        return self.live is not None and not self.live.is_over

    def stimulate(self, oracle: Callable[[ReferenceMachine], None], engine: Callable[[Any], Awaitable[None]]) -> None:
        """Do the same to both and compare what follows."""
        assert self.live is not None
        self.replaying.tell(oracle)
        self.live.do(engine)
        self.compare()

    def compare(self) -> None:
        """Replay what the run did since the last time."""
        assert self.live is not None
        assume(not self.live.goes_round)
        self.differs = True  # until all of it is seen to be right
        for event in self.live.trace[self.seen :]:
            self.replaying.see(event)
        self.seen = len(self.live.trace)
        if self.live.is_over:
            self.replaying.check_over()
        else:
            self.replaying.check_quiet(self.live.now)
        self.differs = False

    def teardown(self) -> None:
        """Let the run end by itself and compare the end as well."""
        if self.live is None:
            return
        if self.differs or self.live.goes_round or self.live.is_over or self.replaying.machine.outcome is not None:
            self.live.close()
            return
        for name in self.plan.feeds:
            self.replaying.machine.feeding[name] = []
            self.replaying.machine.feed(name, END)
        self.replaying.machine.held_open = False
        self.live.end()
        self.compare()
        self.replaying.machine.close()

    def _sending(self, name: str, value: int) -> Callable[[Any], Awaitable[None]]:
        async def send(run: Any) -> None:
            assert self.live is not None
            self.live.send(name, value)
            await asyncio.sleep(0)

        return send

    def _events(self) -> list[tuple[str, str]]:
        assert self.live is not None
        paths = self.plan.paths()
        return [
            (paths[node.name], event)
            for node in self.plan.nodes
            for event in self.live.graph[paths[node.name]].ports.events
            if self._has_room(paths[node.name], event)
        ]

    def _has_room(self, path: str, event: str) -> bool:
        """Whether a trigger from outside would not wait: code outside a node awaits full queues (F8)."""
        machine = self.replaying.machine
        lines = machine.lines_from(machine.paths[path], "event", event)
        return all(len(line.queue) + 1 < line.capacity for line in lines)


def _comes_to_rest(plan: GraphPlan) -> bool:
    try:
        reference_run(plan.build(), max_moves=MOST_MOVES)
    except RuntimeError:
        return False
    return True

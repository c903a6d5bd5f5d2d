"""A robot waits for its start signal, switches a lamp on, and drives: figures 13 and 17 of the paper.

    start ══ boot ══ equals ══ gate ══ lamp ══ drive ══ stop                                 (activity)
    channel ─────────┘  ticks ─┘                                                             (data)

Shown: data moves a state without code that knows of states. `equals` compares every message, whether it is active or
not; only what it finds while active carries the activity on, so the start signal that comes too early does nothing.
`gate` lets values pass while it is active, and since the first one takes the activity along, exactly one passes.
Run it with `python examples/wait_for_start.py` or `hfg run examples/wait_for_start.py --clock virtual`.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator

import hfg


def tell(text: str) -> None:
    print(f"{hfg.now():4.1f} s  {text}")


@hfg.node
async def channel() -> AsyncIterator[str]:
    """Simulate what others send to the robot."""
    for pause_s, message in [(1.0, "start"), (2.0, "hello"), (1.0, "start")]:
        await asyncio.sleep(pause_s)
        tell(f'message "{message}"')
        yield message


class Boot(hfg.Node):
    """Takes its time."""

    done = hfg.Event()

    @hfg.slot
    async def begin(self) -> None:
        tell("boot")
        await asyncio.sleep(2)
        tell("ready to start")
        self.done.trigger()


class Equals(hfg.Node):
    """Tells of every message that is the one it knows."""

    message = hfg.Input(str)
    equal = hfg.Event(str)
    to = hfg.Parameter("start")

    def process(self, message: str) -> None:
        if message == self.to:
            self.equal.trigger(message)

    @hfg.slot
    def listen(self) -> None:
        """Be active from here on; comparing needs nothing else."""


class ActivityGate(hfg.Node):
    """Passes values on while it is active."""

    def process(self, value: bool) -> bool | None:
        return value if self.active else None

    @hfg.slot
    def open(self) -> None:
        """Be active from here on."""


@hfg.node
def ticks() -> Iterator[bool]:
    """Say "on", again and again."""
    while True:
        yield True


@hfg.node
def lamp(on: bool) -> None:
    """Switch the lamp."""
    tell(f"lamp {'on' if on else 'off'}")


class Drive(hfg.Node):
    """What the robot was waiting for."""

    arrived = hfg.Event()

    @hfg.slot
    async def begin(self) -> None:
        tell("drive")
        await asyncio.sleep(3)
        tell("arrived")
        self.arrived.trigger()


def build() -> hfg.Graph:
    graph = hfg.Graph("wait-for-start")
    messages, switch = graph.add(channel()), graph.add(ticks(), max_rate_hz=2)
    boot, equals, gate = graph.add(Boot()), graph.add(Equals()), graph.add(ActivityGate(), name="gate")
    light, drive = graph.add(lamp()), graph.add(Drive())

    graph.connect(messages.out, equals.message)
    graph.connect(switch.out, gate.ports.inputs["value"])

    graph.start.activates(boot.begin)
    boot.done.activates(equals.listen)
    equals.equal.activates(gate.open)
    graph.connect(gate.ports.outputs["out"], light.on, active=True)
    light.processed.activates(drive.begin)
    graph.connect(drive.arrived, graph.stop)
    return graph


if __name__ == "__main__":
    hfg.run(build(), clock="virtual")

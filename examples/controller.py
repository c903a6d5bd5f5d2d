"""A PID controller holds a cart where it is wanted: 100 steps a second, set points now and then, a plot at 10 Hz.

    wanted ── target ──> pid <── position ── cart        (thin: at a rate of its own, by `sent`)
                          └────── force ──────^└─ plot

Shown: loops of a fixed step, streams of different rates (`output.sent`, into parameters and through an operator), and a
gain that is changed while the graph runs, found too soft and taken back: `python examples/controller.py`, with
`--virtual` at once. The rate is a grid: steps do not drift on the machine's clock, and in virtual time they are exact.
The plot is text and needs nothing; for a picture of the same curve give `run.tap("cart.position")` to matplotlib.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator

import reactivex.operators as ops
from annotated_types import Ge

import hfg

RATE_HZ = 100.0


class Cart(hfg.Node):
    """A kilogram on wheels with some friction, next to a ruler."""

    position = hfg.Output(float)
    force = hfg.Parameter(0.0)
    x = hfg.State(0.0)
    speed = hfg.State(0.0)

    def process(self) -> float:
        if hfg.elapsed() >= 6:
            raise hfg.EndOfStream
        self.speed += (self.force - 0.5 * self.speed) / RATE_HZ
        self.x += self.speed / RATE_HZ
        return self.x


class Pid(hfg.Node):
    """Pulls towards its target."""

    force = hfg.Output(float)
    target = hfg.Parameter(0.0)
    kp = hfg.Parameter(20.0, Ge(0))
    ki = hfg.Parameter(5.0, Ge(0))
    kd = hfg.Parameter(6.0, Ge(0))
    total = hfg.State(0.0)
    before = hfg.State(0.0)

    def process(self, position: float) -> float:
        error = self.target - position
        self.total += error / RATE_HZ
        slope, self.before = (position - self.before) * RATE_HZ, position
        return self.kp * error + self.ki * self.total - self.kd * slope


@hfg.node
def wanted() -> Iterator[float]:
    yield from (1.0, -0.5, 0.5)


@hfg.node
def plot(position: float) -> None:
    print(f"{hfg.elapsed():4.1f} s {position:+.3f} {' ' * round(20 * (position + 1.2))}*")


def build() -> hfg.Graph:
    graph = hfg.Graph("controller")
    goals, cart = graph.add(wanted(), max_rate_hz=0.5), graph.add(Cart(), max_rate_hz=RATE_HZ)
    pid, curve = graph.add(Pid()), graph.add(plot())
    graph.connect(cart.position, pid.ports.inputs["position"])
    graph.connect(pid.force.sent, cart.ports.parameters["force"])
    graph.connect(goals.out.sent, pid.ports.parameters["target"])
    graph.connect(cart.position.sent, curve.position, through=[ops.sample(0.1)])
    return graph


async def steer() -> None:
    """Try a softer controller for a second."""
    async with hfg.running(build()) as run:
        await asyncio.sleep(2.505)
        await run.edit(hfg.commands.SetParameter("pid.kp", 4.0))
        await asyncio.sleep(1)
        await run.undo()
        await run.wait_finished()


if __name__ == "__main__":
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop if "--virtual" in sys.argv else hfg.PunctualLoop) as runner:
        runner.run(steer())

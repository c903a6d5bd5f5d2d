"""The counterpart of examples/controller.py in plain asyncio, with the same abilities: what hfg is measured against.

A fixed step without drift, set points at a rate of their own, gains with limits that can be changed and changed back
while it runs, a plot that samples, and an end.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable

RATE_HZ = 100.0


async def every(period_s: float, step: Callable[[], Awaitable[None] | None]) -> None:
    """Call a step on a grid; what was missed is not made up."""
    loop = asyncio.get_running_loop()
    begin, count = loop.time(), 0
    while True:
        if loop.time() < begin + count * period_s:
            await asyncio.sleep(begin + count * period_s - loop.time())
        waiting = step()
        if waiting is not None:
            await waiting
        count = max(count + 1, int((loop.time() - begin) / period_s))


class Cart:
    """A kilogram on wheels with some friction, and a ruler beside it."""

    def __init__(self) -> None:
        self.force = self.x = self.speed = 0.0

    def step(self) -> float:
        self.speed += (self.force - 0.5 * self.speed) / RATE_HZ
        self.x += self.speed / RATE_HZ
        return self.x


class Pid:
    """Pulls towards its target."""

    def __init__(self) -> None:
        self.target = self.total = self.before = 0.0
        self.gains = {"kp": 20.0, "ki": 5.0, "kd": 6.0}
        self.undone: list[tuple[str, float]] = []

    def set(self, name: str, value: float) -> None:
        """Change a gain."""
        if name not in self.gains:
            raise ValueError(f"there is no gain {name}")
        if value < 0:
            raise ValueError(f"{name} must be >= 0, got {value}")
        self.undone.append((name, self.gains[name]))
        self.gains[name] = value

    def undo(self) -> None:
        """Take the last change back."""
        name, value = self.undone.pop()
        self.gains[name] = value

    def step(self, position: float) -> float:
        error = self.target - position
        self.total += error / RATE_HZ
        slope, self.before = (position - self.before) * RATE_HZ, position
        return self.gains["kp"] * error + self.gains["ki"] * self.total - self.gains["kd"] * slope


class Plot:
    """Shows the newest position, if there is a new one."""

    def __init__(self, begin: float) -> None:
        self.begin = begin
        self.newest: float | None = None

    def show(self) -> None:
        position, self.newest = self.newest, None
        if position is not None:
            since = asyncio.get_running_loop().time() - self.begin
            print(f"{since:4.1f} s {position:+.3f} {' ' * round(20 * (position + 1.2))}*")


async def steer() -> None:
    """Try a softer controller for a second."""
    loop = asyncio.get_running_loop()
    begin = loop.time()
    cart, pid, plot = Cart(), Pid(), Plot(begin)
    goals = iter((1.0, -0.5, 0.5))

    def next_goal() -> None:
        pid.target = next(goals, pid.target)

    def control() -> None:
        if loop.time() - begin < 6 - 1e-9:
            plot.newest = cart.step()
            cart.force = pid.step(plot.newest)
        else:
            for task in tasks:
                task.cancel()

    tasks = [
        asyncio.create_task(every(2.0, next_goal)),
        asyncio.create_task(every(0.1, plot.show)),
        asyncio.create_task(every(1 / RATE_HZ, control)),
    ]
    try:
        await asyncio.sleep(2.505)
        pid.set("kp", 4.0)
        await asyncio.sleep(1)
        pid.undo()
        done = await asyncio.gather(*tasks, return_exceptions=True)
        for error in done:
            if isinstance(error, Exception):
                raise error
    finally:
        for task in tasks:
            task.cancel()


if __name__ == "__main__":
    asyncio.run(steer())
    sys.exit(0)

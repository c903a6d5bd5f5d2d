"""The vacuum cleaner of examples/cleaner.py in plain asyncio: what one writes without hfg.

The same abilities as there: states that may last only so long, a run that can be paused, stepped and stopped from
outside, a tick that does not drift, as fast as the machine can if the time is not real, an error that names the state
and its tick, and a timeline of the states. Run it with `python -m tests.examples.plain_cleaner`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

from examples.cleaner import (
    AT_HOME,
    BACK_OFF_S,
    CHARGED,
    CLEAN,
    DIRTY,
    ENOUGH,
    HZ,
    LOST_S,
    LOW,
    Drive,
    Senses,
    World,
    back_off,
    charge,
    go_home,
    roam,
    spot,
)


class CleanerError(Exception):
    """The cleaner could not go on."""


def after_roam(senses: Senses) -> str:
    if senses.cleaned > ENOUGH:
        return "clean"
    if senses.battery < LOW:
        return "go_home"
    if senses.bumped:
        return "back_off"
    return "spot" if senses.dirt > DIRTY else ""


def after_spot(senses: Senses) -> str:
    return "roam" if senses.dirt < CLEAN or senses.bumped else ""


def after_go_home(senses: Senses) -> str:
    return "charge" if abs(senses.home) < AT_HOME else ""


def after_charge(senses: Senses) -> str:
    return "roam" if senses.battery > CHARGED else ""


@dataclass
class State:
    """How to drive, what follows, how long it may last, and what then follows."""

    drive: Callable[[Senses], Drive]
    after: Callable[[Senses], str] = lambda senses: ""
    lasts_s: float = float("inf")
    then: str = ""


STATES = {
    "roam": State(roam.function, after_roam),
    "back_off": State(back_off.function, lasts_s=BACK_OFF_S, then="roam"),
    "spot": State(spot.function, after_spot),
    "go_home": State(go_home.function, after_go_home, lasts_s=LOST_S, then="lost"),
    "charge": State(charge.function, after_charge),
}


@dataclass
class Cleaner:
    """The machine, and who watches and steers it."""

    world: World
    real: bool = False
    state: str = "roam"
    since: float = 0.0
    ticks: int = 0
    outcome: str = ""
    timeline: list[tuple[float, str]] = field(default_factory=list)
    drive: Drive = field(default_factory=lambda: Drive(0.0))

    def __post_init__(self) -> None:
        self.may_go_on = asyncio.Event()
        self.may_go_on.set()
        self.stepped = asyncio.Event()
        self.steps = 0

    def pause(self) -> None:
        self.may_go_on.clear()

    def resume(self) -> None:
        self.may_go_on.set()

    def stop(self) -> None:
        self.outcome = "stopped"
        self.resume()

    async def step(self) -> None:
        self.steps += 1
        self.stepped.clear()
        self.resume()
        await self.stepped.wait()

    def enter(self, state: str, now: float) -> None:
        self.state, self.since = state, now
        self.timeline.append((now, state))

    def tick(self, now: float) -> None:
        """Move, see what has happened, and drive on."""
        state = STATES[self.state]
        if now - self.since >= state.lasts_s:
            self.enter(state.then, self.since + state.lasts_s)
            if self.state == "lost":
                raise CleanerError(f"lost on the way home, at {now:.1f} s")
            state = STATES[self.state]
        try:
            senses = self.world.move(self.drive)
            self.drive = state.drive(senses)
            following = state.after(senses)
        except Exception as error:
            raise CleanerError(f'state "{self.state}" failed in tick {self.ticks}: {error}') from error
        if following == "clean":
            self.outcome = "stopped"
        if following:
            self.enter(following, now)

    async def run(self) -> str:
        """Tick until the room is clean or somebody stops it."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        self.enter("roam", 0.0)
        while not self.outcome:
            await self.may_go_on.wait()
            now = self.ticks / HZ
            if self.real:
                await asyncio.sleep(began + now - loop.time())
            self.tick(now)
            self.ticks += 1
            if self.steps:
                self.steps -= 1
                self.pause()
                self.stepped.set()
        return self.outcome


if __name__ == "__main__":
    cleaner = Cleaner(World(1))
    print(f"{asyncio.run(cleaner.run())} after {(cleaner.ticks - 1) / HZ:.1f} s")

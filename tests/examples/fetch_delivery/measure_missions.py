"""Runs missions one after another, held to what must be true while they run, and writes a table of how they went.

    python -m tests.examples.fetch_delivery.measure_missions --seeds 1-8 --robots 4 --minutes 10
    python -m tests.examples.fetch_delivery.measure_missions --worlds random --robots 1

A robot is stuck if it has neither got nor delivered a cube in the last two minutes. Speed is by processor time, of
which one process uses one core: what else the machine does has an influence on it, by up to a half.
"""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass
from typing import Annotated

import typer

from tests.examples.fetch_delivery import worlds
from tests.examples.fetch_delivery.watching import Watch, watched

STUCK_S = 120.0


@dataclass(frozen=True)
class Row:
    """How one run went; a number for each robot where there is one."""

    world: str
    seed: int
    delivered: list[int]
    wrong: int
    returned: int
    reported: int
    contact_s: list[float]
    stuck: list[int]
    pictures: int
    cost: float  # seconds of processor time for each simulated one
    found: list[str]
    story: str  # which step began when: two rows with equal counts are equal missions only if this is equal too

    def __str__(self) -> str:
        delivered = " ".join(f"{count:2d}" for count in self.delivered)
        contact = " ".join(f"{seconds:4.1f}" for seconds in self.contact_s)
        stuck = ", ".join(map(str, self.stuck)) or "none"
        return (
            f"| {self.world} | {self.seed} | {delivered} | {self.wrong} | {self.returned} | {self.reported} "
            f"| {contact} | {stuck} | {self.pictures} | {1 / self.cost:.1f} | {len(self.found)} | {self.story} |"
        )


def measured(seed: int, robots: int, minutes: float, world: str = "usual") -> Row:
    began = time.process_time()
    watch: Watch = watched(seed, robots, minutes=minutes, surroundings=worlds.world(world))
    cost = (time.process_time() - began) / (60 * minutes)
    scores, now = watch.simulation.scores, watch.simulation.now_s
    last = [max((at for at, _ in score.fetched + score.delivered), default=0.0) for score in scores]
    return Row(
        world,
        seed,
        [len(score.delivered) for score in scores],
        sum(len(score.wrong) for score in scores),
        sum(len(score.returned) for score in scores),
        sum(len(score.reported) for score in scores),
        [score.contact_s for score in scores],
        [number for number, at in enumerate(last) if now - at > STUCK_S],
        watch.pictures,
        cost,
        watch.found,
        hashlib.sha256(repr(watch.steps).encode()).hexdigest()[:8],
    )


def summary(rows: list[Row], minutes: float) -> str:
    delivered = [count for row in rows for count in row.delivered]
    contact = [seconds for row in rows for seconds in row.contact_s]
    share = sum(contact) / (len(contact) * 60 * minutes)
    return (
        f"{len(rows)} runs: {sum(delivered) / len(delivered):.2f} delivered by each robot, {min(delivered)} to "
        f"{max(delivered)}; {sum(row.wrong for row in rows)} wrong; {100 * share:.2f} % of the time in contact, "
        f"{100 * max(contact) / (60 * minutes):.2f} % at most; {sum(len(row.stuck) for row in rows)} stuck; "
        f"{sum(len(row.found) for row in rows)} times something was not as it must be"
    )


def missions(seeds: str, names: list[str]) -> list[tuple[int, str]]:
    """Pair seeds and worlds: each world of several has the next seed, one world has all of them."""
    first, _, last = seeds.partition("-")
    numbers = range(int(first), int(last or first) + 1)
    if len(names) == 1:
        return [(seed, names[0]) for seed in numbers]
    return [(numbers[index % len(numbers)], name) for index, name in enumerate(names)]


def main(
    seeds: Annotated[str, typer.Option(help="One, or the first and the last.")] = "1-8",
    robots: Annotated[int, typer.Option(min=1, max=4)] = 4,
    minutes: Annotated[float, typer.Option(min=0.1)] = 10.0,
    world_names: Annotated[
        str, typer.Option("--worlds", help="Names with commas between them; named: all these; random: 20 drawn ones.")
    ] = "usual",
) -> None:
    """Run missions and write a table."""
    names = {"named": list(worlds.NAMED), "random": [f"random {number}" for number in range(worlds.RANDOM)]}
    print(f"{robots} robots, {minutes:g} minutes\n")
    columns = "world, seed, delivered, wrong, returned, reported, contact (s), stuck, pictures, times real time, "
    columns += "not as it must, story"
    print("| " + columns.replace(", ", " | ") + " |")
    print("|" + "---|" * len(columns.split(", ")), flush=True)
    rows = []
    for seed, name in missions(seeds, names.get(world_names, world_names.split(","))):
        rows.append(measured(seed, robots, minutes, name))
        print(rows[-1], flush=True)
        for sentence in rows[-1].found[:5]:
            print(f"    {sentence}")
    print(f"\n{summary(rows, minutes)}")


if __name__ == "__main__":
    typer.run(main)

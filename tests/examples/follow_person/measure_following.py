"""Run many seeds, and write a table: `python -m tests.examples.follow_person.measure_following --seeds 1-10`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
import typer

from examples.follow_person.mission import build
from examples.follow_person.running import Result, carry_out
from examples.follow_person.world import Conditions

HEADS = (
    "seed",
    "m",
    "contacts",
    "lost",
    "s until found",
    "distance",
    "2 to 8 m, %",
    "max m/s",
    "kept",
    "wrong, s",
    "slow, %",
    "x real time",
)


def row(seed: int, result: Result) -> tuple[object, ...]:
    """Return what a run has shown."""
    score, verdict = result.score, result.verdict
    if score is None or not score.distances:
        return (seed, result.outcome, result.error, *[""] * (len(HEADS) - 3))
    far = np.array(score.distances)
    return (
        seed,
        round(score.walked_m),
        score.contacts,
        verdict.lost,
        round(verdict.longest_lost_s, 1),
        f"{far.min():.1f} to {far.max():.1f}",
        round(100 * float(np.mean((far >= 2) & (far <= 8))), 1),
        round(max(score.speeds), 2),
        f"{verdict.kept} of {verdict.crossings}",
        round(verdict.wrong_s, 1),
        round(100 * verdict.slow_share, 1),
        round(result.simulated_s / max(result.processor_s, 1e-9), 1),
    )


def rows(course: Literal["open", "dense"], seeds: range, metres: float) -> Iterator[tuple[object, ...]]:
    """Yield one row for each run."""
    for seed in seeds:
        yield row(seed, carry_out(build(seed, metres=metres, conditions=Conditions(course=course))))


def main(
    course: Annotated[Literal["open", "dense"], typer.Option()] = "open",
    seeds: Annotated[str, typer.Option(help="First and last one: 1-10.")] = "1-10",
    metres: Annotated[float, typer.Option(min=1)] = 1700.0,
) -> None:
    """Write a table in Markdown."""
    first, _, last = seeds.partition("-")
    print("| " + " | ".join(HEADS) + " |")
    print("|" + "---|" * len(HEADS))
    for cells in rows(course, range(int(first), int(last or first) + 1), metres):
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)


if __name__ == "__main__":
    typer.run(main)

"""Run the delivery robots: `python -m examples.fetch_delivery --seed 1 --robots 1 --minutes 3`."""

from __future__ import annotations

import argparse
import time

import hfg
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.world import FAULTS, Simulation, fault


def main() -> None:
    arguments = argparse.ArgumentParser(prog="python -m examples.fetch_delivery", description="Robots deliver cubes.")
    arguments.add_argument("--seed", type=int, default=1, help="decides what looks like chance")
    arguments.add_argument("--robots", type=int, default=1, choices=range(1, 5), help="how many")
    arguments.add_argument("--minutes", type=float, default=3.0, help="how long, in the arena's time")
    arguments.add_argument(
        "--fault", action="append", default=[], choices=FAULTS, help="what shall go wrong after 30 s"
    )
    given = arguments.parse_args()
    graph = build(given.seed, given.robots, faults=tuple(fault(name) for name in given.fault))
    began = time.perf_counter()
    hfg.run(graph, clock="virtual", until_s=60 * given.minutes)
    took = time.perf_counter() - began
    simulation: Simulation = graph["world"].simulation
    for number, score in enumerate(simulation.scores):
        print(f"robot {number}: {score}")
    print(f"{given.minutes:g} minutes in {took:.0f} s, {60 * given.minutes / took:.1f} times real time")


if __name__ == "__main__":
    main()

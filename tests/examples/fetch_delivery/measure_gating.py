"""What is saved where pictures are taken only for the steps that need them, as a table.

python -m tests.examples.fetch_delivery.measure_gating --seeds 1-3 --minutes 3

Processor time is that of the firings of nodes, so it is right whatever else the machine does.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field

import hfg
from examples.fetch_delivery.mission import build
from hfg.trace import CallEnded, CallStarted, FiringEnded, FiringStarted, TraceEvent
from tests.examples.fetch_delivery.watching import Watch

PICTURES = ("targets", "digits", "cube")  # the nodes of the perception that look at pictures


@dataclass
class Use:
    """What a mission has needed.

    Attributes:
      pictures: so many were taken.
      looking_s: processor time of the nodes that look at them.
      perception_s: of all the perception.
      taking_s: of the arena, which renders them.
      whole_s: of everything.
      delivered: cubes.
      found: what was wrong.
    """

    pictures: int = 0
    looking_s: float = 0.0
    perception_s: float = 0.0
    taking_s: float = 0.0
    whole_s: float = 0.0
    delivered: int = 0
    found: list[str] = field(default_factory=list)


def measure(seed: int, gated: bool, minutes: float) -> Use:
    """Run one robot alone."""
    graph = build(seed, gated=gated)
    watch, use = Watch(graph), Use()
    began = 0.0

    def look(event: TraceEvent) -> None:
        nonlocal began
        watch(event)
        if isinstance(event, FiringStarted | CallStarted):
            began = time.process_time()
        elif isinstance(event, FiringEnded | CallEnded):
            took_s = time.process_time() - began
            name = event.node.rpartition("/")[2]
            use.looking_s += took_s * (name in PICTURES)
            use.perception_s += took_s * ("/perception/" in event.node)
            use.taking_s += took_s * (event.node == "world")

    start = time.process_time()
    hfg.run(graph, clock="virtual", until_s=60 * minutes, trace=look)
    use.whole_s = time.process_time() - start
    use.pictures, use.found = watch.pictures, watch.found
    use.delivered = len(watch.simulation.scores[0].delivered)
    return use


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--seeds", default="1-3", help="from-to")
    arguments.add_argument("--minutes", type=float, default=3.0, help="how long each mission lasts")
    given = arguments.parse_args()
    first, _, last = given.seeds.partition("-")
    print("| seed | pictures | delivered | looking at pictures | whole perception | arena | everything |")
    print("|---|---|---|---|---|---|---|")
    for seed in range(int(first), int(last or first) + 1):
        for gated in (True, False):
            use = measure(seed, gated, given.minutes)
            times = (f"{value:.1f} s" for value in (use.looking_s, use.perception_s, use.taking_s, use.whole_s))
            how = "on demand" if gated else "always"
            print(f"| {seed}, {how} | {use.pictures} | {use.delivered} | {' | '.join(times)} |", flush=True)
            for what in use.found:
                print(what)


if __name__ == "__main__":
    main()

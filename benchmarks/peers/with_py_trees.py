"""py_trees: a sequence of ten behaviours of which one is running; each tick it is the next one's turn."""

from __future__ import annotations

import py_trees
from py_trees.common import Status

from benchmarks.meters import Arrivals
from benchmarks.ours import STATES
from benchmarks.works import Participant


class Turn(py_trees.behaviour.Behaviour):
    """Run for one tick."""

    def initialise(self) -> None:
        self.fresh = True

    def update(self) -> Status:
        fresh, self.fresh = self.fresh, False
        return Status.RUNNING if fresh else Status.SUCCESS


class PyTrees(Participant):
    """A tick of the root moves the running behaviour one on."""

    name = "py_trees"

    def step(self, tokens: int) -> dict[str, float]:
        """E."""
        meter = Arrivals(tokens)
        root = py_trees.composites.Sequence("ring", memory=True)
        root.add_children([Turn(f"s{number}") for number in range(STATES)])
        for number in range(tokens):
            root.tick_once()
            meter.take(number)
        return meter.figures()


PEERS = [PyTrees()]

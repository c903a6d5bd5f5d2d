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


class Action(py_trees.behaviour.Behaviour):
    """Run for some ticks; the last of them is the first one of the next action."""

    def __init__(self, name: str, ticks: int) -> None:
        super().__init__(name)
        self.ticks = ticks

    def initialise(self) -> None:
        self.left = self.ticks

    def update(self) -> Status:
        self.left -= 1
        return Status.RUNNING if self.left >= 0 else Status.SUCCESS


class Condition(py_trees.behaviour.Behaviour):
    """All is well."""

    def update(self) -> Status:
        return Status.SUCCESS


class Mission:
    """A tree of a battery, and tasks one after another, each with an action that repairs it."""

    def __init__(self, tasks: int, ticks: int) -> None:
        self.tasks = tasks
        self.ticks = ticks

    def tick(self, count: int) -> dict[str, float]:
        """Tick the root so often."""
        meter = Arrivals(count)
        tasks = py_trees.composites.Sequence("tasks", memory=True)
        for number in range(self.tasks):
            task = py_trees.composites.Selector(f"task{number}", memory=True)
            task.add_children([Action("act", self.ticks), Action("repair", self.ticks)])
            tasks.add_child(task)
        root = py_trees.composites.Sequence("mission", memory=False)
        root.add_children([Condition("battery"), tasks])
        for number in range(count):
            root.tick_once()
            meter.take(number)
        return meter.figures()


PEERS = [PyTrees()]

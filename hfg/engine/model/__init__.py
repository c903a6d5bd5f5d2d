"""What a run is made of: its nodes, subgraphs and ready queues, and the state they share.

vertex    one node in the plan: its code and its edges      shape     what these say about each of its firings
worker    one node while it runs                            core      one run, and what it needs of those above
scopes    subgraphs, gates      groups    nodes that run one at a time      policies  who of them is next
iteration   the border of a subgraph that iterates (G4)
concurrent   firings of a node that are under way at once      tasks     what its code has started beside its firings
current   whose code runs       sharing   who uses which values, in debug mode      invariants  what holds of all of it

These refer to each other all over, and import each other one way only: what stands below the class of nodes is generic
in it. The names below have it filled in; they are for everybody outside of this wing.
"""

from typing import TypeAlias

from hfg.engine.model import concurrent, core, events, groups, iteration, scopes, tasks
from hfg.engine.model.running_node import RunningNode

__all__ = [
    "ConcurrentFiring",
    "ConcurrentFirings",
    "Core",
    "Doing",
    "Gate",
    "Group",
    "Iteration",
    "RunningEvent",
    "RunningNode",
    "Runtime",
    "Scope",
    "Task",
    "Tasks",
]

Core: TypeAlias = core.Core[RunningNode]
Doing: TypeAlias = tasks.Doing[RunningNode]
ConcurrentFiring: TypeAlias = concurrent.ConcurrentFiring[RunningNode]
ConcurrentFirings: TypeAlias = concurrent.ConcurrentFirings[RunningNode]
Gate: TypeAlias = scopes.Gate[RunningNode]
Group: TypeAlias = groups.Group[RunningNode]
Runtime: TypeAlias = core.Runtime[RunningNode]
Iteration: TypeAlias = iteration.Iteration[RunningNode]
RunningEvent: TypeAlias = events.RunningEvent[RunningNode]
Scope: TypeAlias = scopes.Scope[RunningNode]
Task: TypeAlias = tasks.Task[RunningNode]
Tasks: TypeAlias = tasks.Tasks[RunningNode]

"""What a run consists of: its nodes, subgraphs and ready queues, and the state that they share.

vertex       one node in the plan: its code and edges    node_state    what its firings and calls change
running_node one node while it runs                      records       parts of its state
concurrent   its firings that are in progress at once    tasks         what its code has started besides
core         one run, and what it needs of higher layers groups        nodes that run one at a time
policies     which of them is next                       scopes        subgraphs and gates
iteration    the border of a subgraph that iterates      current       whose code runs
sharing      who uses which values, in debug mode        invariants    what holds of all of it

These refer to each other in all directions, but imports go one way only: what is below the class of nodes is generic in
it. The names here have it filled in, for all other packages.
"""

from typing import TypeAlias

from hfg.engine.model import concurrent, core, events, groups, iteration, jobs, scopes, tasks
from hfg.engine.model.running_node import RunningNode

__all__ = [
    "ConcurrentFiring",
    "ConcurrentFirings",
    "Core",
    "Doing",
    "Gate",
    "Group",
    "Iteration",
    "Job",
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
Job: TypeAlias = jobs.Job[RunningNode]
RunningEvent: TypeAlias = events.RunningEvent[RunningNode]
Scope: TypeAlias = scopes.Scope[RunningNode]
Task: TypeAlias = tasks.Task[RunningNode]
Tasks: TypeAlias = tasks.Tasks[RunningNode]

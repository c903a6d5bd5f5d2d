"""What a run is made of: its nodes, subgraphs and ready queues, and the state they share.

vertex    one node in the plan: its code and its edges      shape     what these say about each of its firings
worker    one node while it runs                            core      one run, and what it needs of those above
scopes    subgraphs, gates      groups    nodes that run one at a time      policies  who of them is next
iteration   the border of a subgraph that iterates (G4)
flights   firings of a node that are under way at once      tasks     what its code has started beside its firings
current   whose code runs       sharing   who uses which values, in debug mode      invariants  what holds of all of it

These refer to each other all over, and import each other one way only: what stands below the class of nodes is generic
in it. The names below have it filled in; they are for everybody outside of this wing.
"""

from typing import TypeAlias

from hfg.engine.model import core, events, flights, groups, iteration, scopes, tasks
from hfg.engine.model.worker import Worker

__all__ = [
    "Core",
    "Doing",
    "Flight",
    "Flights",
    "Gate",
    "Group",
    "Host",
    "Iteration",
    "RunningEvent",
    "Scope",
    "Task",
    "Tasks",
    "Worker",
]

Core: TypeAlias = core.Core[Worker]
Doing: TypeAlias = tasks.Doing[Worker]
Flight: TypeAlias = flights.Flight[Worker]
Flights: TypeAlias = flights.Flights[Worker]
Gate: TypeAlias = scopes.Gate[Worker]
Group: TypeAlias = groups.Group[Worker]
Host: TypeAlias = core.Host[Worker]
Iteration: TypeAlias = iteration.Iteration[Worker]
RunningEvent: TypeAlias = events.RunningEvent[Worker]
Scope: TypeAlias = scopes.Scope[Worker]
Task: TypeAlias = tasks.Task[Worker]
Tasks: TypeAlias = tasks.Tasks[Worker]

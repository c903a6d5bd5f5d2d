"""Broken copies of the delivery mission: an active edge too many, one missing, a gate too few."""

from __future__ import annotations

from collections.abc import Callable

import hfg
from examples.fetch_delivery.mission import build
from hfg import commands

Change = Callable[[hfg.Graph], None]

ROBOT = "robot_0"
VISIT = f"{ROBOT}/fetch/visit"
FETCH = f"{ROBOT}/fetch"


def too_many(source: str, target: str) -> Change:
    """Add an active edge, or make one active."""

    def change(graph: hfg.Graph) -> None:
        graph.edit(commands.Connect(source, target, active=True))

    return change


def not_active(source: str, target: str) -> Change:
    """Let an edge no longer transport activity."""

    def change(graph: hfg.Graph) -> None:
        graph.edit(commands.MakeActive(source, target, False))

    return change


def missing(source: str, target: str) -> Change:
    """Remove an edge."""

    def change(graph: hfg.Graph) -> None:
        graph.edit(commands.Disconnect(source, target))

    return change


def ungated(path: str) -> Change:
    """Remove a gate."""

    def change(graph: hfg.Graph) -> None:
        graph.edit(commands.Ungate(path))

    return change


MUTANTS: dict[str, Change] = {
    "position done also retreats": too_many(f"{VISIT}/position.done", f"{VISIT}/retreat.begin"),
    "wait done also leaves": too_many(f"{VISIT}/wait.done", f"{VISIT}/leave.begin"),
    "arrived also docks": too_many(f"{VISIT}/go_to.arrived", f"{VISIT}/dock.begin"),
    "fetched also reads": too_many(f"{ROBOT}/fetch.done", f"{ROBOT}/read_cube.begin"),
    "a sign also fetches": too_many(f"{ROBOT}/lookup.sign", f"{ROBOT}/fetch.begin"),
    "two starts": too_many("start", f"{ROBOT}/read_cube.begin"),
    "time-out of the planner also follows": too_many(f"{VISIT}/go_to/plan.timeout", f"{VISIT}/go_to/follow.stop"),
    "an attempt also fetches": too_many(f"{ROBOT}/bring.attempt", f"{ROBOT}/fetch.begin"),
    "dock done is not active": not_active(f"{VISIT}/dock.done", f"{VISIT}/settle.begin"),
    "position done is not active": not_active(f"{VISIT}/position.done", f"{VISIT}/dock.begin"),
    "lost is not active": not_active(f"{VISIT}/position.lost", f"{VISIT}/retreat.begin"),
    "a time-out of position is not active": not_active(f"{VISIT}/position.timeout", f"{VISIT}/retreat.begin"),
    "visit done is not active": not_active(f"{ROBOT}/deliver/visit.done", f"{ROBOT}/deliver/tries.done"),
    "received is not active": not_active(f"{ROBOT}/read_cube.received", f"{ROBOT}/lookup.key"),
    "the time-out of the way is not active": not_active(f"{VISIT}/go_to.timeout", f"{VISIT}.gave_up.inner"),
    "no edge to the wait": missing(f"{VISIT}/lamp_on.done", f"{VISIT}/wait.begin"),
    "no edge to the station": missing(f"{FETCH}/select.station", f"{FETCH}/visit.begin"),
    "no way out of a view that gives up": missing(f"{ROBOT}/explore.gave_up", f"{FETCH}.begin"),
    "no way for a view to give up": missing(f"{ROBOT}/explore/view.gave_up", f"{ROBOT}/explore.gave_up.inner"),
    "no edge from the plan": missing(f"{VISIT}/go_to/plan.path", f"{VISIT}/go_to/follow.path"),
    "no gate of dock": ungated(f"{VISIT}/dock"),
    "no gate of leave": ungated(f"{VISIT}/leave"),
    "no gate of position": ungated(f"{VISIT}/position"),
}


def broken(name: str) -> hfg.Graph:
    """Build a broken copy."""
    graph = build()
    MUTANTS[name](graph)
    return graph

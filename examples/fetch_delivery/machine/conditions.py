"""What must hold of a mission that a state machine decides: the same demands, of its states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from operator import eq
from typing import Any

import hfg
from examples.fetch_delivery.machine.mission import STATES
from examples.fetch_delivery.mission.conditions import demands
from hfg import monitors as m

__all__ = ["conditions"]


def conditions(robot: hfg.Subgraph) -> dict[str, m.Property]:
    """Return what must hold of the mission of one robot, by name.

    Args:
      robot: the robot, in its graph.
    """
    entered = f"{robot.graph.path}/control.entered"
    return demands(
        robot.graph.path,
        {state: m.since(~m.sent(entered), m.sent(entered, partial(eq, state))) for state in _innermost(STATES, "")},
    )


def _innermost(states: Iterable[Any], prefix: str) -> Iterator[str]:
    for state in states:
        name, inside = (state, ()) if isinstance(state, str) else (state["name"], state.get("children", ()))
        yield from _innermost(inside, f"{prefix}{name}/") if inside else (f"{prefix}{name}",)

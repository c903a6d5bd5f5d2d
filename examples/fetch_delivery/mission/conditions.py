"""What must hold of every mission, as monitors: `watch(run, **conditions(graph["robot_0"]))` judges a run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from operator import or_

import hfg
from examples.fetch_delivery.messages import Twist
from hfg import monitors as m

__all__ = ["conditions", "demands", "steps"]

LONGEST_ERRAND_S = 300.0
LONGEST_S = {"go_to/plan": 8.2, "go_to/follow": 60.2, "go_to/queue": 60.2, "position": 20.2, "dock": 10.2, "wait": 20.2}
LONGEST_S |= {"select": 5.2, "view": 5.2, "turn": 15.2, "retreat": 6.2, "settle": 0.7, "advance": 10.2}
LONGEST_S |= {"leave": 6.2, "read_cube": 10.2, "confirm": 4.2}
"""How long each step may hold the activity: its time-out where it has one, else the moment it takes."""

STANDING = ("settle", "lamp_on/once/gate", "lamp_on/once/export", "wait", "lamp_off/once/gate", "dark/once/gate")
"""The steps in which the lamp may be on."""


def conditions(robot: hfg.Subgraph) -> dict[str, m.Property]:
    """Return what must hold of the mission of one robot, by name.

    Args:
      robot: the robot, in its graph.
    """
    path = robot.graph.path
    active = {step: m.active(f"{path}/{step}") for step in steps(robot)}
    somewhere = reduce(or_, active.values())
    number = path.rpartition("_")[2]
    settled = m.sent(f"world.delivered[{number}]") | m.sent(f"{path}.report")
    return {
        "one_step": m.never(_two_of(active.values())),
        "never_lost": m.leads_to(~somewhere, somewhere, within_s=0),
        "settled": m.leads_to(m.sent(f"{path}/read_cube.received"), settled, within_s=LONGEST_ERRAND_S),
        **demands(path, active),
    }


def demands(path: str, in_step: Mapping[str, m.Formula]) -> dict[str, m.Property]:
    """Return what must hold of a robot whatever decides about its steps, by name.

    Args:
      path: that of the robot.
      in_step: when it is in a step, by the name of the step.
    """
    lit = m.since(~m.sent(f"{path}.lamp", _is_off), m.sent(f"{path}.lamp", _is_on))
    shown = lit & reduce(or_, (one for step, one in in_step.items() if not step.endswith(STANDING)))
    found = {
        "dark": m.never(m.sent(f"{path}.command", _moves) & lit),
        "lit_standing": m.leads_to(shown, ~shown, within_s=0),  # at one moment it is switched, and the step changes
    }
    for step, one in in_step.items():
        longest = next((seconds for name, seconds in LONGEST_S.items() if step.endswith(name)), None)
        if longest is not None:
            found[f"leaves_{step.replace('/', '_')}"] = m.leads_to(one, ~one, within_s=longest)
    return found


def steps(robot: hfg.Subgraph) -> list[str]:
    """Return all steps of a mission: the nodes inside to which active edges lead, by their paths in the robot."""
    return list(_steps(robot, ""))


def _steps(box: hfg.Subgraph, prefix: str) -> Iterator[str]:
    entered = {edge.target.node for edge in box.graph.edges if edge.options.active}
    for name, node in box.graph.nodes.items():
        if isinstance(node, hfg.Subgraph):
            yield from _steps(node, f"{prefix}{name}/")
        elif node in entered:
            yield f"{prefix}{name}"


def _two_of(formulas: Iterable[m.Formula]) -> m.Formula:
    """Two or more hold at once."""
    first, second, *rest = formulas
    one, two = first | second, first & second
    for formula in rest:
        one, two = one | formula, two | (one & formula)
    return two


def _is_on(lamp: bool) -> bool:
    return lamp


def _is_off(lamp: bool) -> bool:
    return not lamp


def _moves(command: Twist) -> bool:
    return bool(command.vx or command.vy or command.omega)

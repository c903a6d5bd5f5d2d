"""What must hold of every mission, as monitors: `watch(run, **conditions("robot_0"))` judges it while it runs."""

from __future__ import annotations

from itertools import combinations

from examples.fetch_delivery.messages import Twist
from hfg import monitors as m

__all__ = ["conditions"]

STEPS = ("wait_for_start", "advance", "fetch", "read_cube", "lookup", "explore", "bring", "deliver")
"""The states of the mission (figure 19): it is in one of them at most, and between two of them its activity is on its
way."""

LONGEST_ERRAND_S = 300.0


def conditions(robot: str) -> dict[str, m.Property]:
    """Return what must hold of the mission of one robot, by name.

    Args:
      robot: its path, such as "robot_0".
    """
    steps = [m.active(f"{robot}/{step}") for step in STEPS]
    two_at_once = [one & other for one, other in combinations(steps, 2)]
    several = two_at_once[0]
    for pair in two_at_once[1:]:
        several |= pair
    lit = m.since(~m.sent(f"{robot}.lamp", _is_off), m.sent(f"{robot}.lamp", _is_on))
    number = robot.rpartition("_")[2]
    settled = m.sent(f"world.delivered[{number}]") | m.sent(f"{robot}.report")
    return {
        "one_step": m.never(several),
        "dark": m.never(m.sent(f"{robot}.command", _moves) & lit),
        "settled": m.leads_to(m.sent(f"{robot}/read_cube.received"), settled, within_s=LONGEST_ERRAND_S),
    }


def _is_on(lamp: bool) -> bool:
    return lamp


def _is_off(lamp: bool) -> bool:
    return not lamp


def _moves(command: Twist) -> bool:
    return bool(command.vx or command.vy or command.omega)

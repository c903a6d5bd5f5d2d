"""The bytes of an action of ROS 2: sending a goal, its feedback, cancelling it. Pure.

An action is three services and two topics below its name; see https://design.ros2.org/articles/actions.html. Each
message begins with the 16 bytes of the goal's id. The rest is aligned as in a message of its own, so
no further types are needed here.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from hfg.errors import EncodingError

ID: Final = 16
"""Bytes of a goal's id."""

CANCEL: Final = "action_msgs/srv/CancelGoal"

_HEADER: Final = b"\0\1\0\0"  # little endian, as rmw_zenoh writes
_NO_STAMP: Final = bytes(8)


class Status(IntEnum):
    """How a goal has ended; action_msgs/msg/GoalStatus."""

    UNKNOWN = 0
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


def goal_request(goal_id: bytes, goal: bytes | bytearray) -> bytes:
    """Return the request that sends a goal.

    Args:
      goal_id: its id.
      goal: its message, encoded.
    """
    return _HEADER + goal_id + goal[len(_HEADER) :]


def is_accepted(response: bytes | bytearray) -> bool:
    """Read the response to a goal.

    Raises:
      EncodingError: it is too short.
    """
    if len(response) <= len(_HEADER):
        raise EncodingError(f"the response to a goal has {len(response)} bytes, which is too short")
    return bool(response[len(_HEADER)])


def result_request(goal_id: bytes) -> bytes:
    """Return the request for the result of a goal."""
    return _HEADER + goal_id


def cancel_request(goal_id: bytes) -> bytes:
    """Return the request that cancels a goal."""
    return _HEADER + goal_id + _NO_STAMP


def read_feedback(message: bytes | bytearray) -> tuple[bytes, bytes]:
    """Return the goal's id and the feedback, encoded.

    Raises:
      EncodingError: it is too short.
    """
    begin = len(_HEADER) + ID
    if len(message) < begin:
        raise EncodingError(f"the feedback has {len(message)} bytes, which is too short")
    return bytes(message[len(_HEADER) : begin]), _HEADER + bytes(message[begin:])

"""Which types a service and an action consist of, and the texts of `.srv` and `.action` files.

Source: https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html and the type descriptions of ROS 2.
Depends on definitions.
"""

from __future__ import annotations

from typing import Final

from hfg.errors import UsageError
from hfg.ros.definitions import BASE, NAME, SEQUENCE, Fields, parsed

STANDARD: Final = {
    "std_srvs/srv/Empty": "---",
    "std_srvs/srv/SetBool": "bool data\n---\nbool success\nstring message",
    "std_srvs/srv/Trigger": "---\nbool success\nstring message",
    "example_interfaces/srv/AddTwoInts": "int64 a\nint64 b\n---\nint64 sum",
    "example_interfaces/srv/SetBool": "bool data\n---\nbool success\nstring message",
    "example_interfaces/srv/Trigger": "---\nbool success\nstring message",
    "example_interfaces/action/Fibonacci": "int32 order\n---\nint32[] sequence\n---\nint32[] sequence",
    "action_msgs/srv/CancelGoal": ("GoalInfo goal_info\n---\nint8 return_code\naction_msgs/GoalInfo[] goals_canceling"),
}
"""Services and actions that are known without a file: those of the demonstrations, and what actions themselves use."""

_EVENT: Final = "service_msgs/msg/ServiceEventInfo"
_ID: Final = "unique_identifier_msgs/msg/UUID"
_TIME: Final = "builtin_interfaces/msg/Time"


def of_text(name: str, text: str) -> dict[str, Fields]:
    """Return all types of a `.msg`, `.srv` or `.action` file.

    Args:
      name: of the message, service or action, "std_srvs/srv/SetBool".
      text: of the file.

    Raises:
      UsageError: the text has too many or too few parts, or one cannot be read.
    """
    package, kind, short = name.split("/")
    if kind == "msg":
        return parsed(text, name)
    roles = ("Request", "Response") if kind == "srv" else ("Goal", "Result", "Feedback")
    texts = _split(text)
    if len(texts) != len(roles):
        raise UsageError(
            f"{name!r:.200} has {len(texts)} parts between lines of ---; it needs {', '.join(roles).lower()}"
        )
    made: dict[str, Fields] = {}
    for role, part in zip(roles, texts, strict=True):
        (fields,) = parsed(part, f"{package}/msg/{short}").values()
        made[f"{name}_{role}"] = fields
    return made | (of_service(name) if kind == "srv" else _of_action(name))


def _split(text: str) -> list[str]:
    parts: list[list[str]] = [[]]
    for line in text.splitlines():
        if line.strip() == "---":
            parts.append([])
        else:
            parts[-1].append(line)
    return ["\n".join([*lines, ""]) for lines in parts]


def of_service(name: str) -> dict[str, Fields]:
    """Return the types that a service has besides its request and response."""
    request, response = (NAME, f"{name}_Request"), (NAME, f"{name}_Response")
    event = [("info", (NAME, _EVENT)), ("request", (SEQUENCE, (request, 1))), ("response", (SEQUENCE, (response, 1)))]
    whole = [("request_message", request), ("response_message", response), ("event_message", (NAME, f"{name}_Event"))]
    return {f"{name}_Event": event, name: whole}


def _of_action(name: str) -> dict[str, Fields]:
    """Return the types that an action has besides its goal, result and feedback."""
    goal, result, feedback = ((NAME, f"{name}_{role}") for role in ("Goal", "Result", "Feedback"))
    which = ("goal_id", (NAME, _ID))
    send, get, message = f"{name}_SendGoal", f"{name}_GetResult", f"{name}_FeedbackMessage"
    return {
        f"{send}_Request": [which, ("goal", goal)],
        f"{send}_Response": [("accepted", (BASE, ("bool", 0))), ("stamp", (NAME, _TIME))],
        f"{get}_Request": [which],
        f"{get}_Response": [("status", (BASE, ("int8", 0))), ("result", result)],
        message: [which, ("feedback", feedback)],
        **of_service(send),
        **of_service(get),
        name: [
            ("goal", goal),
            ("result", result),
            ("feedback", feedback),
            ("send_goal_service", (NAME, send)),
            ("get_result_service", (NAME, get)),
            ("feedback_message", (NAME, message)),
        ],
    }

"""Types of ROS 2: the message, service or action of a name, with its hash, its CDR bytes and its values in hfg.

    message("std_msgs/msg/String").encode("hello")

Messages of the common packages are those that the library rosbags knows; services and actions of std_srvs,
example_interfaces and action_msgs are listed here. All others are read from files below the folders in HFG_ROS_PATH:
`<package>/msg/<Name>.msg`, and alike for srv and action. A value is what hfg has for it (see `values`), else a record
with the message's fields. Depends on names, values and rosbags (`hfg[ros2]`).
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Any, Final

from hfg.errors import EncodingError, UsageError, in_words
from hfg.ros.names import dds_name
from hfg.ros.values import KNOWN, Conversion

_DISTRO: Final = "jazzy"
_LONGEST_FILE: Final = 1_000_000  # bytes of a definition
_EVENT: Final = "service_msgs/msg/ServiceEventInfo"
_UUID: Final = "unique_identifier_msgs/msg/UUID"

_DEFINITIONS: Final = {
    "std_srvs/srv/Empty": "---",
    "std_srvs/srv/SetBool": "bool data\n---\nbool success\nstring message",
    "std_srvs/srv/Trigger": "---\nbool success\nstring message",
    "example_interfaces/srv/AddTwoInts": "int64 a\nint64 b\n---\nint64 sum",
    "action_msgs/srv/CancelGoal": "action_msgs/GoalInfo goal_info\n---\nint8 return_code\n"
    "action_msgs/GoalInfo[] goals_canceling",
    "example_interfaces/action/Fibonacci": "int32 order\n---\nint32[] sequence\n---\nint32[] sequence",
}


class MessageType:
    """A type of messages.

    Attributes:
      name: "std_msgs/msg/String".
      dds_name: as on the wire.
      value_type: what `decode` returns.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.dds_name = dds_name(name)
        self._conversion: Conversion | None = KNOWN.get(name)
        self._class = _store().types[name]
        self.value_type: Any = self._class if self._conversion is None else self._conversion.type

    @property
    def hash(self) -> str:
        """The hash of the definition, "RIHS01_..."."""
        return _hash(self.name)

    def encode(self, value: Any) -> bytes:
        """Return the message of a value.

        Args:
          value: of `value_type`, or a record: an object or a mapping with the message's fields; fields that are left
            out have their defaults.

        Raises:
          EncodingError: it is not of the type.
        """
        try:
            if self._conversion is not None and not hasattr(value, "__msgtype__"):
                value = self._conversion.to_ros(value)
            if not isinstance(value, self._class):
                value = _record(self.name, value)
            return bytes(_store().serialize_cdr(value, self.name))
        except Exception as error:
            raise EncodingError(f"a value is not a {self.name}: {in_words(error)}") from error

    def decode(self, data: bytes) -> Any:
        """Return the value of a message.

        Raises:
          EncodingError: it is not of the type.
        """
        try:
            value = _store().deserialize_cdr(data, self.name)
            return value if self._conversion is None else self._conversion.from_ros(value)
        except Exception as error:  # the library raises many kinds
            raise EncodingError(f"{len(data)} bytes are not a {self.name}: {in_words(error)}") from error


class ServiceType:
    """A type of services.

    Attributes:
      name: "std_srvs/srv/SetBool".
      dds_name: as on the wire.
      request, response: the types of its messages.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.dds_name = dds_name(name)
        self.request = MessageType(f"{name}_Request")
        self.response = MessageType(f"{name}_Response")

    @property
    def hash(self) -> str:
        """The hash of the definition, "RIHS01_..."."""
        return _hash(self.name)


class ActionType:
    """A type of actions.

    Attributes:
      name: "example_interfaces/action/Fibonacci".
      goal, result, feedback: the types of its values.
      send_goal, get_result: its services.
      feedback_message: the type of its topic.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.goal = MessageType(f"{name}_Goal")
        self.result = MessageType(f"{name}_Result")
        self.feedback = MessageType(f"{name}_Feedback")
        self.send_goal = ServiceType(f"{name}_SendGoal")
        self.get_result = ServiceType(f"{name}_GetResult")
        self.feedback_message = MessageType(f"{name}_FeedbackMessage")

    def read_result(self, response: bytes) -> tuple[int, Any]:
        """Return status and result in a response of `get_result`.

        Raises:
          EncodingError: it is not of the type.
        """
        value = self.get_result.response.decode(response)
        return int(value.status), value.result


@cache
def message(name: str) -> MessageType:
    """Return a type of messages.

    Raises:
      UsageError: there is no such type.

    Examples:
      >>> message("std_msgs/msg/String").hash[:15]
      'RIHS01_df668c74'
    """
    _define(name, "msg")
    return MessageType(name)


@cache
def service(name: str) -> ServiceType:
    """Return a type of services.

    Raises:
      UsageError: there is no such type.
    """
    _define(name, "srv")
    return ServiceType(name)


@cache
def action(name: str) -> ActionType:
    """Return a type of actions.

    Raises:
      UsageError: there is no such type.
    """
    _define(name, "action")
    return ActionType(name)


# --- definitions ---


@cache
def _store() -> Any:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError:
        raise UsageError("types of ROS 2 need rosbags: pip install 'hfg[ros2]'") from None
    distro = os.environ.get("ROS_DISTRO", "") or _DISTRO
    known = {one.name.removeprefix("ROS2_").lower(): one for one in Stores if one.name.startswith("ROS2_")}
    if distro not in known:
        raise UsageError(f'ROS_DISTRO="{distro}" is not known: take one of {", ".join(known)}')
    store: Any = get_typestore(known[distro])
    if _EVENT in store.fielddefs:
        # rosbags hashes `char` as a type of its own; in ROS 2 it is another word for uint8.
        constants, fields = store.fielddefs[_EVENT]
        base, bytes_ = _nodetype("BASE"), _nodetype("ARRAY")
        gid = ("client_gid", (bytes_, ((base, ("uint8", 0)), 16)))
        store.fielddefs[_EVENT] = (constants, [gid if one[0] == "client_gid" else one for one in fields])
    return store


def _nodetype(name: str) -> Any:
    from rosbags.interfaces import Nodetype

    return Nodetype[name]


@cache
def _hash(name: str) -> str:
    return str(_store().hash_rihs01(name))


def _define(name: str, kind: str) -> None:
    """Add a type to the store, with those it depends on."""
    store = _store()
    dds_name(name)
    if name.split("/")[1] != kind:
        raise UsageError(f'"{name}" is not of the kind "{kind}": write package/{kind}/Name')
    if name in store.types or (kind == "action" and f"{name}_Goal" in store.types):
        return
    text = _DEFINITIONS.get(name) or _read(name)
    parts = [part.strip() for part in f"\n{text}\n".split("\n---")]
    expected = {"msg": 1, "srv": 2, "action": 3}[kind]
    if len(parts) != expected:
        raise UsageError(f'the definition of "{name}" has {len(parts)} parts, and a {kind} has {expected}')
    if kind == "msg":
        _add(name, parts[0])
    elif kind == "srv":
        _add_service(name, *parts)
    else:
        _add_action(name, *parts)


def _read(name: str) -> str:
    package, kind, short = name.split("/")
    folders = [Path(one) for one in os.environ.get("HFG_ROS_PATH", "").split(os.pathsep) if one]
    for folder in folders:
        file = folder / package / kind / f"{short}.{kind}"
        if not file.is_file():
            continue
        if file.stat().st_size > _LONGEST_FILE:
            raise UsageError(f'"{file}" has more than {_LONGEST_FILE:,} bytes, and is not read')
        return file.read_text(encoding="utf-8", errors="replace")
    where = f"below {' or '.join(map(str, folders))}" if folders else "and HFG_ROS_PATH names no folder to look in"
    raise UsageError(f'the type "{name}" is not known: there is no {package}/{kind}/{short}.{kind} {where}')


def _add(name: str, text: str) -> None:
    """Add one struct, and the messages that it depends on."""
    from rosbags.typesys import get_types_from_msg

    stand_in = f"{name.split('/')[0]}/msg/{name.split('/')[2]}"
    try:
        found: Any = get_types_from_msg(text, stand_in)[stand_in]
    except Exception as error:
        raise UsageError(f'the definition of "{name}" cannot be read: {in_words(error)}') from error
    for _, (kind, inner) in found[1]:
        inner_kind, what = inner[0] if kind in (_nodetype("ARRAY"), _nodetype("SEQUENCE")) else (kind, inner)
        if inner_kind == _nodetype("NAME"):
            _define(what, "msg")
    _store().register({name: found})


def _add_fields(name: str, *fields: tuple[str, Any]) -> None:
    _store().register({name: ([], list(fields))})


def _named(name: str) -> tuple[Any, str]:
    return _nodetype("NAME"), name


def _add_service(name: str, request: str, response: str) -> None:
    _add(f"{name}_Request", request)
    _add(f"{name}_Response", response)
    _add_whole(name)


def _add_whole(name: str) -> None:
    """Add the struct that is hashed for a service, of its request, response and event."""
    some = [(_nodetype("SEQUENCE"), (_named(f"{name}_{part}"), 1)) for part in ("Request", "Response")]
    _add_fields(f"{name}_Event", ("info", _named(_EVENT)), ("request", some[0]), ("response", some[1]))
    whole = [(f"{part.lower()}_message", _named(f"{name}_{part}")) for part in ("Request", "Response", "Event")]
    _add_fields(name, *whole)


def _add_action(name: str, goal: str, result: str, feedback: str) -> None:
    for part, text in (("Goal", goal), ("Result", result), ("Feedback", feedback)):
        _add(f"{name}_{part}", text)
    who, base = ("goal_id", _named(_UUID)), _nodetype("BASE")
    stamp = ("stamp", _named("builtin_interfaces/msg/Time"))
    _add_fields(f"{name}_SendGoal_Request", who, ("goal", _named(f"{name}_Goal")))
    _add_fields(f"{name}_SendGoal_Response", ("accepted", (base, ("bool", 0))), stamp)
    _add_whole(f"{name}_SendGoal")
    _add_fields(f"{name}_GetResult_Request", who)
    _add_fields(f"{name}_GetResult_Response", ("status", (base, ("int8", 0))), ("result", _named(f"{name}_Result")))
    _add_whole(f"{name}_GetResult")
    _add_fields(f"{name}_FeedbackMessage", who, ("feedback", _named(f"{name}_Feedback")))


# --- records ---


def _record(name: str, value: Any) -> Any:
    """Make the library's object of a mapping or object with the fields; what is left out has its default."""
    import numpy as np

    store = _store()
    fields = store.fielddefs[name][1]
    given = value if isinstance(value, dict) else {key: getattr(value, key) for key, _ in fields if hasattr(value, key)}
    if unknown := sorted(set(given) - {key for key, _ in fields}):
        raise ValueError(f'it has no field "{unknown[0]}"; there are {", ".join(key for key, _ in fields)}')
    if not isinstance(value, dict) and not given and fields:
        raise TypeError(f"got {type(value).__name__}; pass a mapping with {', '.join(key for key, _ in fields)}")
    made = {}
    for key, (kind, inner) in fields:
        is_many = kind in (_nodetype("ARRAY"), _nodetype("SEQUENCE"))
        (inner_kind, what), count = inner if is_many else ((kind, inner), 0)
        if inner_kind == _nodetype("NAME"):
            some = given.get(key, [{}] * (count if kind == _nodetype("ARRAY") else 0) if is_many else {})
            made[key] = [_record(what, one) for one in some] if is_many else _record(what, some)
        elif is_many and what[0] != "string":
            default = np.zeros(count if kind == _nodetype("ARRAY") else 0, what[0])
            made[key] = np.asarray(given.get(key, default), dtype="u1" if what[0] in ("byte", "char") else what[0])
        elif is_many:
            made[key] = list(given.get(key, ()))
        else:
            made[key] = given.get(key, _ZERO.get(what[0], 0))
    return store.types[name](**made)


_ZERO: Final[dict[str, Any]] = {"string": "", "wstring": "", "bool": False, "float32": 0.0, "float64": 0.0}

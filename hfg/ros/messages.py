"""Types of messages, services and actions in ROS 2: bytes as rmw_zenoh and bags have them, and values as hfg has them.

`message("sensor_msgs/msg/LaserScan")` decodes to an `hfg.geometry.LaserScan`; `hfg.ros.values` lists which types have
such a value. A message of any other type is a `Record` with its fields, made from its definition. The common packages
of ROS 2 are known; `register` reads further `.msg`, `.srv` and `.action` files, and other types are looked for in the
folders of HFG_ROS_PATH: `<package>/msg/<Name>.msg`. Depends on definitions and values.

Examples:
  >>> text = message("std_msgs/msg/String")
  >>> text.dds_name, text.value_type, text.decode(text.encode("hello"))
  ('std_msgs::msg::dds_::String_', <class 'str'>, 'hello')
"""

from __future__ import annotations

import functools
import os
import struct
from collections.abc import Callable, Mapping
from typing import Any, Final

from hfg.base.bounds import ROS_VALUES
from hfg.errors import EncodingError, UsageError
from hfg.ros import definitions as of
from hfg.ros import values
from hfg.ros.definitions import Record
from hfg.ros.names import dds_name
from hfg.ros.typestore import Types

Buffer = bytes | bytearray | memoryview

_LITTLE: Final = b"\0\1\0\0"
_BIG: Final = b"\0\0\0\0"
_SPARE: Final = 64  # bytes after a message: some writers add padding, rclpy 4 for each empty array of long numbers
_HEADER: Final = "std_msgs/msg/Header"
_PARTS: Final = ("_Request", "_Response", "_Goal", "_Result", "_Feedback", "_FeedbackMessage", "_Event")
_TIME: Final = "builtin_interfaces/msg/Time"


class MessageType:
    """A type of messages.

    Attributes:
      name: "std_msgs/msg/String".
      dds_name: "std_msgs::msg::dds_::String_".
      record: the class with the message's own fields.
      value_type: type of the values that `decode` returns: the record, or another type of hfg.
      has_stamp: it begins with a header or a time.
    """

    def __init__(self, name: str, types: Types) -> None:
        self.name = name
        self.dds_name = dds_name(name)
        self._types = types
        self.record = types.record(name)
        self._size = of.size_of(name, types.known)
        types.store.get_msgdef(name)  # makes code, which would hold up the first message
        self._conversion = values.conversion(name) if types.is_standard(name) else None
        self.value_type: Any = self.record if self._conversion is None else self._conversion.value_type
        first = types.known[name][0][1]
        self.has_stamp = first in ((of.NAME, _HEADER), (of.NAME, _TIME))

    @functools.cached_property
    def hash(self) -> str:
        """The hash of the definition, "RIHS01_...": both sides of a topic have the same."""
        return of.hash_of(self.name, self._types.known)

    @functools.cached_property
    def text(self) -> str:
        """The definition as bags have it, with those of the types in it."""
        return of.text_of(self.name, self._types.known)

    def encode(self, value: Any, *, stamp: float = 0.0, frame_id: str = "") -> bytes:
        """Return a message: CDR, little endian, with its 4 bytes of header.

        Args:
          value: of `value_type`, or a record, or a mapping of its fields; what is left out has its default.
          stamp: for the message's header if the value has no stamp of its own, in seconds.
          frame_id: for the message's header if the value has no frame of its own.

        Raises:
          EncodingError: the value is not of the type, or does not fit into the message.
        """
        return bytes(self.encode_once(value, stamp=stamp, frame_id=frame_id))

    def encode_once(self, value: Any, *, stamp: float = 0.0, frame_id: str = "") -> bytearray:
        """Return the same as `encode`, without its copy, which costs as much time as the rest of an image."""
        if self._conversion is not None and not isinstance(value, self.record | Mapping):
            header = values.Header(stamp, frame_id)
            try:
                value = self._conversion.to_record(value, header, self._types.record)
            except EncodingError as error:
                raise EncodingError(f"{self.name}: {error}") from None
            except (AttributeError, TypeError, ValueError, OverflowError) as error:
                raise EncodingError(f"{value!r:.80} cannot be sent as {self.name}: {error}") from None
        return self._packed(value)

    def decode(self, buffer: Buffer) -> Any:
        """Return the value of a message, of `value_type`. Its arrays may be views of the buffer, and cannot be written.

        Raises:
          EncodingError: the bytes are not such a message, need too much memory, or have no such value.
        """
        record = self.unpack(buffer)
        if self._conversion is None:
            return record
        try:
            return self._conversion.to_value(record)
        except (TypeError, ValueError, OverflowError) as error:
            raise EncodingError(f"a message of {self.name} has no value here: {error}") from None

    def pack(self, record: Record | Mapping[str, Any]) -> bytes:
        """Return the message of a record, or of a mapping of its fields.

        Raises:
          EncodingError: a field does not fit; the message names it.
        """
        return bytes(self._packed(record))

    def _packed(self, record: Record | Mapping[str, Any]) -> bytearray:
        fitting = self._types.fit(self.name)(record, self.name.rpartition("/")[2])
        store = self._types.store
        try:
            made: memoryview = store.serialize_cdr(fitting, self.name, little_endian=True)
        except (OverflowError, struct.error, UnicodeEncodeError) as error:
            raise EncodingError(f"a record of {self.name} cannot be encoded: {error}") from None
        buffer = made.obj
        return buffer if isinstance(buffer, bytearray) and len(buffer) == made.nbytes else bytearray(made)

    def unpack(self, buffer: Buffer) -> Record:
        """Return the record of a message; see `decode`.

        Raises:
          EncodingError: the bytes are not such a message, or need too much memory.
        """
        data = memoryview(buffer).cast("B").toreadonly()
        head = bytes(data[:4])
        if head[:2] not in (_LITTLE[:2], _BIG[:2]) or len(data) < 4:
            raise EncodingError(f"a message of {self.name} begins with {head.hex(' ')}, which is not plain CDR")
        self._need_room(len(data) - 4)
        definition = self._types.store.get_msgdef(self.name)
        decode = definition.deserialize_cdr_le if head[1] else definition.deserialize_cdr_be
        try:
            record: Record
            record, end = decode(data[4:], 0, definition.cls, self._types.store)
        except (ValueError, struct.error, of.serde_error()) as error:
            raise EncodingError(f"{len(data)} bytes are not a message of {self.name}: {error}") from None
        if not 0 <= len(data) - 4 - end <= _SPARE:
            raise EncodingError(f"a message of {self.name} ends after {end + 4} bytes, but there are {len(data)}")
        return record

    def _need_room(self, count: int) -> None:
        needed = self._size.values + count * self._size.dense
        if self._size.least > count + 8:
            raise EncodingError(f"a message of {self.name} has at least {self._size.least} bytes, found {count}")
        if needed > ROS_VALUES.most:
            raise EncodingError(
                f"a message of {self.name} with {count:,} bytes can have {int(needed):,} values; {ROS_VALUES.remedy}"
            )

    def stamp(self, buffer: Buffer) -> float | None:
        """Return the time in a message's header in seconds; None if it has none or is too short."""
        data = memoryview(buffer).cast("B")
        if not self.has_stamp or len(data) < 12:
            return None
        seconds, nanoseconds = struct.unpack_from("<iI" if data[1] else ">iI", data, 4)
        return float(seconds + nanoseconds / 1e9)

    def __repr__(self) -> str:
        return f"message({self.name!r})"


class ServiceType:
    """A type of services.

    Attributes:
      name: "std_srvs/srv/SetBool".
      dds_name: "std_srvs::srv::dds_::SetBool_".
      request, response: types of its messages.
    """

    def __init__(self, name: str, types: Types) -> None:
        self.name = name
        self.dds_name = dds_name(name)
        self._types = types
        self.request = _message(types, f"{name}_Request")
        self.response = _message(types, f"{name}_Response")

    @functools.cached_property
    def hash(self) -> str:
        """The hash of the definition, "RIHS01_..."."""
        return of.hash_of(self.name, self._types.known)


class ActionType:
    """A type of actions.

    Attributes:
      name: "example_interfaces/action/Fibonacci".
      goal, result, feedback: types of its messages, as users see them.
      send_goal: the service that accepts goals: `goal_id` and `goal`; `accepted` and `stamp`.
      get_result: the service that waits for the end: `goal_id`; `status` and `result`.
      cancel_goal: the service that cancels, the same for all actions.
      feedback_message: the type of the topic of feedback: `goal_id` and `feedback`.
      status: the type of the topic of states, the same for all actions.
    """

    def __init__(self, name: str, types: Types) -> None:
        self.name = name
        self._types = types
        self.goal = _message(types, f"{name}_Goal")
        self.result = _message(types, f"{name}_Result")
        self.feedback = _message(types, f"{name}_Feedback")
        self.feedback_message = _message(types, f"{name}_FeedbackMessage")
        self.send_goal = ServiceType(f"{name}_SendGoal", types)
        self.get_result = ServiceType(f"{name}_GetResult", types)
        self.cancel_goal = ServiceType("action_msgs/srv/CancelGoal", types)
        self.status = _message(types, "action_msgs/msg/GoalStatusArray")

    def read_result(self, response: Buffer) -> tuple[int, Any]:
        """Return status and result in a response of `get_result`.

        Raises:
          EncodingError: it is not of the type.
        """
        value: Any = self.get_result.response.unpack(response)
        return int(value.status), value.result

    @functools.cached_property
    def hash(self) -> str:
        """The hash of the definition, "RIHS01_..."."""
        return of.hash_of(self.name, self._types.known)


@functools.cache
def shared() -> Types:
    """Return the types of this process, which `register` adds to."""
    return Types()


def message(name: str) -> MessageType:
    """Return a type of messages.

    Args:
      name: package, kind and name: "std_msgs/msg/String"; "std_msgs/String" is the same.

    Raises:
      UsageError: there is no such type, or `hfg[ros2]` is not installed.
    """
    return _message(shared(), _full(name, "msg"))


def service(name: str) -> ServiceType:
    """Return a type of services: "std_srvs/srv/SetBool".

    Raises:
      UsageError: there is no such type, or `hfg[ros2]` is not installed.
    """
    made: ServiceType = _once(shared(), _full(name, "srv"), ServiceType)
    return made


def action(name: str) -> ActionType:
    """Return a type of actions: "example_interfaces/action/Fibonacci".

    Raises:
      UsageError: there is no such type, or `hfg[ros2]` is not installed.
    """
    made: ActionType = _once(shared(), _full(name, "action"), ActionType)
    return made


def register(what: str | os.PathLike[str], name: str = "") -> list[str]:
    """Make further types known in this process.

    Args:
      what: a `.msg`, `.srv` or `.action` file, or a folder of them. A file `my_robot/msg/Arm.msg` is
        "my_robot/msg/Arm"; one in another place takes the name of its folder as that of its package. With a name: the
        text of such a file.
      name: of the type in the text: "my_robot/msg/Arm".

    Returns:
      The names of the types.

    Raises:
      UsageError: a text cannot be read, contains an unknown type, or a type is known already with another definition.
    """
    return shared().register(what, name)


def types_of(name: str, text: str) -> MessageType:
    """Return the type of messages that a bag describes: ours if it is defined so, otherwise one of its own.

    Args:
      name: of the type.
      text: its definition, and those of the types in it.

    Raises:
      UsageError: the text cannot be read.
    """
    ours = shared()
    full = _full(name, "msg")
    made = of.parsed(text, full) if text.strip() or full not in ours.known else {}
    if all(ours.known.get(one) == fields for one, fields in made.items()):
        return _message(ours, full)
    return _message(Types(ours.known | made, ours), full)


def _message(types: Types, name: str) -> MessageType:
    made: MessageType = _once(types, name, MessageType)
    return made


def _once(types: Types, name: str, make: Callable[[str, Types], Any]) -> Any:
    if name not in types.made:
        types.complete(name)
        types.made[name] = make(name, types)
    return types.made[name]


def _full(name: str, kind: str) -> str:
    package, separator, short = name.partition("/")
    full = f"{package}/{kind}/{short}" if separator and "/" not in short else name
    dds_name(full)
    if full.split("/")[1] != kind and not (kind == "msg" and full.endswith(_PARTS)):
        raise UsageError(f'"{name}" is not of the kind "{kind}": write package/{kind}/Name')
    return full

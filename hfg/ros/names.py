"""Names of ROS 2: what is valid, how a name in a node becomes a full one, and remapping.

Pure text. The rules are those of https://design.ros2.org/articles/topic_and_service_names.html. Depends on errors.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

from hfg.errors import UsageError

LONGEST: Final = 255
"""Characters of a full name, as in ROS 2."""

_PART: Final = r"[A-Za-z_][A-Za-z0-9_]*"
_FULL: Final = re.compile(rf"(/{_PART})+")
_GIVEN: Final = re.compile(rf"(~|~?/?{_PART}(/{_PART})*)")
_TYPE: Final = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Z][A-Za-z0-9_]*)")
_DDS: Final = re.compile(r"([a-z][a-z0-9_]*)::(msg|srv|action)::dds_::([A-Z][A-Za-z0-9_]*)_")


def full_name(name: str, namespace: str, node: str, remapped: Mapping[str, str] | None = None) -> str:
    """Return the full name of a topic, service or action.

    Args:
      name: as written: "/absolute", "relative" to the namespace, or "~/private" to the node.
      namespace: of the node, "/robot1"; "/" for none.
      node: its name.
      remapped: full names by full names, see `remapping`.

    Raises:
      UsageError: the name is not valid in ROS 2.

    Examples:
      >>> full_name("scan", "/robot1", "driver"), full_name("~/scan", "/", "driver")
      ('/robot1/scan', '/driver/scan')
    """
    if not _GIVEN.fullmatch(name) or "__" in name:
        raise UsageError(
            f"{name!r:.300} is not a name in ROS 2: write parts of letters, digits and single underscores that do not "
            'begin with a digit, as in "/robot1/scan", "scan" or "~/scan"'
        )
    above = namespace.rstrip("/")
    if name.startswith("/"):
        full = name
    elif name.startswith("~"):
        full = f"{above}/{node}" + (f"/{name[1:].lstrip('/')}" if len(name) > 1 else "")
    else:
        full = f"{above}/{name}"
    full = (remapped or {}).get(full, full)
    if len(full) > LONGEST:
        raise UsageError(f"the name {full!r:.80}... has {len(full)} characters, and ROS 2 knows at most {LONGEST}")
    return full


def need_namespace(text: str) -> str:
    """Return a namespace in full, "/" for none.

    Raises:
      UsageError: the text is not a namespace.
    """
    full = "/" + text.strip("/")
    if full != "/" and not _FULL.fullmatch(full):
        raise UsageError(f'{text!r:.300} is not a namespace in ROS 2: write one as in "/robot1"')
    return full


def need_node_name(text: str) -> str:
    """Return the name of a node.

    Raises:
      UsageError: the text is not a node name.
    """
    if not re.fullmatch(_PART, text) or len(text) > LONGEST:
        raise UsageError(f"{text!r:.300} is not a node name in ROS 2: write letters, digits and underscores")
    return text


def node_name_of(text: str) -> str:
    """Make a name of a node from any text, such as a graph's name."""
    made = re.sub(r"[^A-Za-z0-9_]+", "_", text).strip("_")[:LONGEST]
    return made if re.match(r"[A-Za-z_]", made) else f"hfg_{made}".rstrip("_")


def remapping(text: str, namespace: str, node: str) -> dict[str, str]:
    """Read rules as `ros2 run --ros-args -r` takes them: "scan:=/front/scan image:=/cam/image".

    Raises:
      UsageError: a rule cannot be read.
    """
    rules = {}
    for rule in text.split():
        old, separator, new = rule.partition(":=")
        if not separator:
            raise UsageError(f'{rule!r:.300} is not a rule: write the old and new name, as in "scan:=/front/scan"')
        rules[full_name(old, namespace, node)] = full_name(new, namespace, node)
    return rules


def dds_name(ros: str) -> str:
    """Return how DDS and rmw_zenoh name a type.

    Raises:
      UsageError: the text is not a type name.

    Examples:
      >>> dds_name("std_msgs/msg/String")
      'std_msgs::msg::dds_::String_'
    """
    found = _TYPE.fullmatch(ros)
    if found is None:
        raise UsageError(
            f'{ros!r:.300} is not a type name in ROS 2: write package, kind and name, as in "std_msgs/msg/String"'
        )
    return f"{found[1]}::{found[2]}::dds_::{found[3]}_"


def ros_name(dds: str) -> str | None:
    """Return the name in ROS of a type that DDS names; None if the text is not one.

    Examples:
      >>> ros_name("std_msgs::msg::dds_::String_")
      'std_msgs/msg/String'
    """
    found = _DDS.fullmatch(dds)
    return None if found is None else f"{found[1]}/{found[2]}/{found[3]}"

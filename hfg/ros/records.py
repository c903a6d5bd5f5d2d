"""Classes of records by the name of their type, `geometry_msgs__msg__Twist`: made when they are first asked for.

So values of such a class can be saved, recorded and sent to another process, which finds the class by its name.
Depends on messages.
"""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    from hfg.errors import UsageError
    from hfg.ros.messages import shared

    if name.startswith("_") or name.count("__") != 2:
        raise AttributeError(name)
    try:
        found = shared().record(name.replace("__", "/"))
    except UsageError as error:
        raise AttributeError(str(error)) from None
    globals()[name] = found
    return found

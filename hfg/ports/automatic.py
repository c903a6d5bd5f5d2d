"""The ports that every node has without declaring them (rule A9).

This module has their names and their declarations on `Node`. The event `sent` of an output is named after the output:
"out.sent". Depends on events and slots.
"""

from __future__ import annotations

from typing import Any, Final

from hfg.errors import Failure
from hfg.ports.events import Event
from hfg.ports.slots import Slot

__all__ = [
    "AUTOMATIC_EVENTS",
    "AUTOMATIC_SLOTS",
    "SUBGRAPH_EVENTS",
    "SUBGRAPH_SLOTS",
    "automatic_event",
    "automatic_slot",
    "is_automatic_event",
    "sent_name",
    "sent_of",
]

AUTOMATIC_EVENTS: Final[dict[str, Any]] = {
    "activated": None,
    "deactivated": None,
    "processed": None,
    "failed": Failure,
    "timeout": None,
    "completed": Any,
}
"""Name and type of the events that the runner triggers; `completed` exists only with a do-activity (A15)."""

AUTOMATIC_SLOTS: Final = ("enable", "disable", "activate", "deactivate", "reset")
"""Slots that the runner itself handles, whatever their signals carry."""

SUBGRAPH_EVENTS: Final = ("activated", "deactivated", "timeout")
"""A subgraph does not fire itself, so it has only these (rule G2)."""

SUBGRAPH_SLOTS: Final = ("enable", "disable", "deactivate", "reset")
"""`activate` is missing because it would not say which inner node it means (rule G2)."""


_SENT: Final = ".sent"  # no declared name has a dot


def sent_name(output: str) -> str:
    """Return the name of the event that repeats the tokens of an output."""
    return output + _SENT


def sent_of(event: str) -> str | None:
    """Return the output that a `sent` event belongs to, or None if the event is not a `sent` event."""
    return event.removesuffix(_SENT) if event.endswith(_SENT) else None


def is_automatic_event(name: str) -> bool:
    """Return whether the runner triggers the event, rather than the node's code."""
    return name in AUTOMATIC_EVENTS or name.endswith(_SENT)


def automatic_event(name: str) -> Event[Any]:
    """Declare an automatic event."""
    event: Event[Any] = Event(AUTOMATIC_EVENTS[name])
    event.name = name
    return event


def automatic_slot(name: str) -> Slot[object]:
    """Declare an automatic slot."""
    made: Slot[object] = Slot(None, object)
    made.name = name
    return made

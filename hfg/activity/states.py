"""Nodes that are states of a machine: how they react to letters, and a type for each set of letters.

A generated state has an event for each letter that it knows. Its type is determined by its letters, so it can be found
by name like any other type: `hfg.activity.states:State[push,pull]`. Depends on node types, not on machines or graphs.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any, Final
from urllib.parse import quote, unquote

from hfg.nodetypes.declaration import RESERVED
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Parameter, slot

__all__ = ["StateNode", "event_name", "letter_name", "one_by_one", "state_type"]

_MANGLED: Final = "letter_"
_OWN: Final = frozenset({"enter", "final", "missing", "read"})


class StateNode(Node):
    """A state of a machine. While it is active, it answers a letter by triggering the event of that name.

    An active edge from that event leads to the next state. Derive from this class for states that do something: declare
    an event for each letter, and work in `on_activated`, in `do`, or in an `enter` of your own.

    Attributes:
      enter: the slot by which activity enters.
      read: the slot that receives letters while the node is active.
      missing: the event that answers letters for which the state has no event.
      final: whether a word that ends here is accepted. Only `StateMachine.of` reads it.
    """

    missing = Event(str)
    final = Parameter(False)

    @slot
    def enter(self) -> None:
        """Become active. The active edge does the work; override this to do more."""

    @slot(while_active=True)
    def read(self, letter: str) -> None:
        """Answer a letter by triggering its event, or `missing`.

        Args:
          letter: the letter.
        """
        name = event_name(letter)
        if name in self._type.events:
            self._port("event", name).trigger()
        else:
            self.missing.trigger(letter)


@node
def one_by_one(letter: str) -> str:
    """Pass letters on as data, so that all states have read a letter before the next one arrives.

    With signals, a letter could reach the state that is about to become active too early.
    """
    return letter


@functools.lru_cache(maxsize=1024)
def event_name(letter: str) -> str:
    """Return the name of the event that answers a letter: the letter, unless an event cannot have that name."""
    can_be = letter.isidentifier() and not letter.startswith(("_", _MANGLED))
    if can_be and letter not in RESERVED and letter not in _OWN:
        return letter
    return _MANGLED + "".join(one if one.isascii() and one.isalnum() else f"_{ord(one):x}_" for one in letter)


def letter_name(event: str) -> str:
    """Return the letter that an event answers; the inverse of `event_name`."""
    if not event.startswith(_MANGLED):
        return event
    parts = event.removeprefix(_MANGLED).split("_")
    return "".join(chr(int(part, 16)) if place % 2 else part for place, part in enumerate(parts))


def state_type(letters: Iterable[str]) -> type[StateNode]:
    """Return the type of states that know these letters; the same type for the same letters."""
    return _state_type(tuple(dict.fromkeys(letters)))


@functools.cache
def _state_type(letters: tuple[str, ...]) -> type[StateNode]:
    name = f"State[{','.join(quote(letter, safe='').replace('.', '%2E') for letter in letters)}]"
    body: dict[str, Any] = {event_name(letter): Event() for letter in letters}
    body |= {"__module__": __name__, "__qualname__": name, "__doc__": "A state of a machine."}
    return type("State", (StateNode,), body)


def __getattr__(name: str) -> Any:
    if name.startswith("State[") and name.endswith("]"):
        inside = name.removeprefix("State[").removesuffix("]")
        return state_type(unquote(letter) for letter in inside.split(",") if letter)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""Finds transports by name: they are packages of their own, which the core never imports (entry points)."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Final

from hfg.errors import TransportError, in_words
from hfg.transport import Transport

__all__ = ["transport"]

_GROUP: Final = "hfg.transports"
_REMEDY: Final = {"zenoh": "pip install 'hfg[zenoh]'"}
_ELSE: Final = "install the package with it"


def transport(name: str) -> Transport:
    """Give the transport of this name.

    Raises:
      TransportError: there is none, or it cannot be imported.
    """
    found = {point.name: point for point in entry_points(group=_GROUP)}
    if name not in found:
        names = ", ".join(sorted(found)) or "none"
        raise TransportError(f'no transport is called "{name}"; installed are: {names}; {_REMEDY.get(name, _ELSE)}')
    try:
        made = found[name].load()
    except Exception as error:
        remedy = _REMEDY.get(name, _ELSE)
        raise TransportError(f'transport "{name}" cannot be imported ({in_words(error)}); {remedy}') from error
    if isinstance(made, type):
        made = made()
    if not isinstance(made, Transport):
        raise TransportError(f'the entry point "{name}" of {_GROUP} gives no transport but {made!r:.80}')
    return made

"""Finds transports by name: they are packages of their own, which the core never imports (entry points).

The transport between programs of one user on one computer, "local", is part of the core. Depends on `hfg.links.local`.
"""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any, Final

from hfg.errors import TransportError, in_words
from hfg.links.local import LocalSession, LocalTransport
from hfg.transport import Session, Transport

_GROUP: Final = "hfg.transports"
_REMEDY: Final = {"zenoh": "pip install 'hfg[zenoh]'"}
_ELSE: Final = "install the package with it"


def transport(name: str) -> Transport:
    """Return the transport with this name.

    Raises:
      TransportError: there is none, or it cannot be imported.
    """
    if name == "local":
        return LocalTransport()
    found = {point.name: point for point in entry_points(group=_GROUP)}
    if name not in found:
        names = ", ".join(sorted(["local", *found]))
        raise TransportError(f'no transport is called "{name}"; installed are: {names}; {_REMEDY.get(name, _ELSE)}')
    try:
        made = found[name].load()
    except Exception as error:
        remedy = _REMEDY.get(name, _ELSE)
        raise TransportError(f'transport "{name}" cannot be imported ({in_words(error)}); {remedy}') from error
    if isinstance(made, type):
        made = made()
    if not isinstance(made, Transport):
        raise TransportError(f'the entry point "{name}" of {_GROUP} does not provide a transport, but {made!r:.80}')
    return made


async def open_session(name: str, **settings: Any) -> Session:
    """Open a session of a transport; of "local" if these settings name no address (L5).

    Without a setting that names one nothing listens on a network address, and nothing connects to one.

    Args:
      name: of the transport; "" for "zenoh" if there are settings, otherwise "local".
      **settings: of the transport.

    Raises:
      TransportError: the session cannot be opened.
      FileError: something is wrong with the settings file.
    """
    chosen = transport(name or ("zenoh" if settings else "local"))
    only_here = getattr(chosen, "only_here", None)
    said = None if only_here is None else await only_here(**settings)
    return await (chosen.open(**settings) if said is None else LocalTransport().open(**said))


async def open_sessions(settings: dict[str, Any] | None, folder: str) -> tuple[Session, Session]:
    """Open the sessions of one part of a run: to all parts, and to those on the same host. They may be the same one.

    Args:
      settings: of the network; None if all parts are on this host.
      folder: in which the parts on this host meet; "" if they meet over the network, too.

    Raises:
      TransportError: a session cannot be opened.
      FileError: something is wrong with the settings file.
    """
    if settings is None:
        near = await LocalTransport().open(folder=folder)
        return near, near
    session = await open_session("", **settings)
    if isinstance(session, LocalSession) or not folder:
        return session, session
    try:
        return session, await LocalTransport().open(folder=folder, host=session.host)
    except BaseException:
        await session.close()
        raise

"""The one module that imports Zenoh: which version there is, and everything that is marked unstable in it.

Zenoh is an extra of hfg, so it is imported when the first session is opened. Other modules use only its stable classes;
`Callback(indirect=...)` and the links of a session are not stable, and wrapped here. Depends on errors.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

from hfg.errors import TransportError

if TYPE_CHECKING:
    import zenoh

OLDEST: Final = (1, 10)
"""The oldest version that this was tried with; the major one must be the same."""

_Item = TypeVar("_Item", contravariant=True)


class Connection(NamedTuple):
    """One link of a session to another.

    Attributes:
      peer: the id of the other session.
      address: of its end.
      certificate: the name in its certificate; None if it has shown none.
    """

    peer: str
    address: str
    certificate: str | None


def load() -> ModuleType:
    """Import Zenoh.

    Raises:
      TransportError: it is not installed, cannot be imported or is of another version.
    """
    try:
        version = importlib.metadata.version("eclipse-zenoh")
    except importlib.metadata.PackageNotFoundError:
        raise TransportError("the transport Zenoh is not installed; pip install 'hfg[zenoh]'") from None
    numbers = tuple(int(part) for part in version.split(".")[:2] if part.isdigit())
    if numbers[:1] != OLDEST[:1] or numbers < OLDEST:
        raise TransportError(
            f"eclipse-zenoh {version} is installed, and hfg needs {OLDEST[0]}.{OLDEST[1]} or a newer {OLDEST[0]}.x; "
            "pip install --upgrade 'hfg[zenoh]'"
        )
    try:
        return importlib.import_module("zenoh")
    except ImportError as error:
        raise TransportError(
            f"eclipse-zenoh {version} is installed but cannot be imported: {error}; "
            "pip install --force-reinstall 'hfg[zenoh]'"
        ) from error


def callback(function: Callable[[Any], None]) -> Any:
    """Have a function called in a thread of its own.

    That thread keeps the interpreter for a burst (697,000 messages a second), where the network's own thread would take
    it for each message (109,000).
    """
    import zenoh

    return zenoh.handlers.Callback(function, indirect=True)


def network_callback(function: Callable[[Any], None], finished: Callable[[], None]) -> Any:
    """Have functions called in the network's thread: for the few messages of one question no thread is worth making.

    They must return at once.
    """
    import zenoh

    return zenoh.handlers.Callback(function, finished, indirect=False)


def connections(session: zenoh.Session) -> list[Connection]:
    """Return the links that a session has now."""
    return [Connection(str(link.zid), link.dst, link.auth_identifier) for link in session.info.links()]


def watch_connections(session: zenoh.Session, told: Callable[[bool], None]) -> Any:
    """Have a function called with whether there is a connection to a session, now and on each change."""
    put = load().SampleKind.PUT

    def changed(event: zenoh.TransportEvent) -> None:
        told(event.kind == put)

    return session.info.declare_transport_events_listener(callback(changed), history=True)


def keeping_publisher(session: zenoh.Session, key: str, kept: int, **quality: Any) -> Any:
    """Declare a publisher that gives its last messages to those who subscribe later."""
    import zenoh.ext

    return zenoh.ext.declare_advanced_publisher(
        session, key, cache=zenoh.ext.CacheConfig(max_samples=kept), publisher_detection=True, **quality
    )


def catching_subscriber(session: zenoh.Session, key: str, handler: Any, most: int) -> Any:
    """Declare a subscriber that gets the last messages that publishers have kept."""
    import zenoh.ext

    history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=most)
    return zenoh.ext.declare_advanced_subscriber(session, key, handler, history=history)

"""Opens Zenoh's session for the settings; each failure is one clear error with a remedy.

Blocks until a client has found its agent, so it is called in a thread. Depends on settings, config, diagnosing and
binding.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from hfg.base.logs import log
from hfg.base.private import check_parents, check_private
from hfg.errors import TransportError
from hfg_transports.zenoh import binding
from hfg_transports.zenoh.config import configuration, listens, targets
from hfg_transports.zenoh.diagnosing import Reason, files_that_do_not_fit, why_unreachable
from hfg_transports.zenoh.keys import key_of
from hfg_transports.zenoh.settings import Mode, Settings, open_addresses, problems_of

if TYPE_CHECKING:
    import zenoh

WAIT_S: Final = 10.0
"""How long an agent is waited for."""

_LOOK_S: Final = 0.02


def open_session(settings: Settings | None = None, mode: Mode = "peer", *, wait_s: float = WAIT_S) -> zenoh.Session:
    """Open a session.

    Args:
      settings: the network.
      mode: "router" is what an agent is; a "peer" has connections to all others if settings have `meet`, where peers
        listen, and otherwise is a client; a "client" speaks with everybody through an agent, which sees to what it may
        do.
      wait_s: how long a client, or a peer that is told where to connect, waits for somebody to be there.

    Raises:
      TransportError: it cannot be opened: Zenoh is not installed or of another version, the settings are wrong, an
        address is taken, a certificate does not fit, or nobody is there.
    """
    settings = settings or Settings()
    if exposed := check_session(settings, mode):
        log().warning(
            "insecure: nobody proves who he is at %s, so whoever can connect there can run code as this user",
            " and ".join(f'"{address}"' for address in exposed),
        )
    return open_checked(settings, mode, wait_s=wait_s)


def check_session(settings: Settings, mode: Mode) -> list[str]:
    """Return the addresses of a session without authentication.

    Raises:
      TransportError: Zenoh is not installed or of another version, the settings are wrong or do not allow such
        addresses, or a certificate does not fit.
    """
    binding.load()
    if mode not in ("router", "peer", "client"):
        raise TransportError(f'there is no mode "{mode}"; take router, peer or client')
    if problems := problems_of(settings):
        raise TransportError("; ".join(str(problem) for problem in problems[:3]))
    if settings.tls is not None and (reason := files_that_do_not_fit(settings.tls)) is not None:
        raise TransportError(f"{reason.what}; {reason.remedy}")
    if settings.key:
        key_of(settings.key)
    exposed = open_addresses(settings)
    for address in (*settings.listen, *settings.meet, *settings.agents, *settings.connect):
        if (reason := _exposed_socket(address)) is None:
            continue
        if not settings.insecure:
            raise TransportError(f"{reason.what}; {reason.remedy}")
        exposed.append(address)
    return exposed


def open_checked(
    settings: Settings, mode: Mode, *, wait_s: float, more: Mapping[str, Any] | None = None
) -> zenoh.Session:
    """Open a session of settings that `check_session` has accepted.

    Args:
      settings: the network.
      mode: see `open_session`.
      wait_s: see `open_session`.
      more: keys of Zenoh's configuration that are to be different.

    Raises:
      TransportError: an address is taken, or no agent can be reached.
    """
    library = binding.load()
    config = library.Config()
    for key, value in {**configuration(settings, mode, wait_s=wait_s), **(more or {})}.items():
        config.insert_json5(key, json.dumps(value))
    try:
        session: zenoh.Session = library.open(config)
    except library.ZError as error:
        raise TransportError(_sentence(str(error), settings, mode)) from error
    if mode == "peer" and settings.connect and settings.tls is None:
        _wait_for_somebody(session, settings, wait_s)
    return session


def _exposed_socket(address: str) -> Reason | None:
    """Say why other users could be at one of the ends of a local socket; None if they cannot, or it is none.

    Zenoh asks neither end who the other is, so only a folder that no other user can enter keeps others away: from who
    listens there, and from who connects.
    """
    protocol, _, place = address.partition("/")
    if protocol != "unixsock-stream":
        return None
    folder, purpose = Path(place).parent, f'of the socket "{address}"'
    try:
        check_private(folder, folder.stat(), purpose)
        check_parents(folder, purpose)
    except OSError as error:
        remedy = f"write mkdir -m 700 {folder}" if isinstance(error, FileNotFoundError) else "name another folder"
        return Reason(f'"{address}" cannot be used: {folder}: {error.strerror}', remedy)
    except TransportError as error:
        return Reason(f"other users could steer this computer: {error}", "insecure = true trusts all of them")
    return None


def _wait_for_somebody(session: zenoh.Session, settings: Settings, wait_s: float) -> None:
    """Peers connect in the background and forever; at the start they log when no program is there."""
    until = time.monotonic() + wait_s
    while not (session.info.routers_zid() or session.info.peers_zid()):
        if time.monotonic() > until:
            session.close()
            raise TransportError(_unreachable(settings, "peer"))
        time.sleep(_LOOK_S)


def _sentence(said: str, settings: Settings, mode: Mode) -> str:
    """Say what Zenoh means; its own words end in the place in its source."""
    said = re.sub(r"\s*\bat /\S+\.rs:\d+\.?", "", said).strip(" .")
    if "Unable to connect" in said:
        return _unreachable(settings, mode)
    listening = " or ".join(f'"{address}"' for address in listens(settings, mode))
    if "already in use" in said:
        named = re.search(r"(?:tcp|tls)/\S+?(?=[:\s]*\[)|(?<=on )\S+:\d+", said)
        address = f'"{named[0]}"' if named else listening
        return f"{address} is taken by another program; is an hfg agent running already? else listen at another port"
    if "Cannot assign requested address" in said or "os error 99" in said:
        return f"this computer has no address {listening}; correct listen"
    if "Permission denied" in said:
        return f"this program may not listen at {listening}; take a port above 1023"
    if "failed to lookup" in said or "Name or service not known" in said:
        return f"there is no host as in {listening}; correct listen"
    return f"Zenoh cannot open a session: {said}; correct the settings"


def _unreachable(settings: Settings, mode: Mode) -> str:
    """Say why, for each address."""
    parts = []
    for address in targets(settings, mode):
        reason = why_unreachable(address, settings.tls, settings.key)
        parts.append(f'cannot connect to "{address}": {reason.what}; {reason.remedy}')
    return " / ".join(parts)

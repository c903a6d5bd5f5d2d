"""Zenoh's configuration for the settings: each key that differs from its default.

Plain data, so it can be looked at without Zenoh. Each has a comment with the reason. Depends on settings and names.
"""

from __future__ import annotations

import secrets
from typing import Any, Final

from hfg_transports.zenoh.keys import tls_of_key
from hfg_transports.zenoh.names import Keys
from hfg_transports.zenoh.settings import Access, Mode, Settings, Tls, is_loopback

LONG: Final = 256 * 1024
"""Bytes from which a put may take longer than the event loop should stand still for."""

_BATCHES: Final = 16
"""Of 64 KiB that wait in each priority. With two, as it comes, a burst of tokens finds no room and is dropped, and each
that is dropped costs its link a round trip; with sixteen 100,000 puts in a row lost none."""
_MOST_SESSIONS: Final = 1000
_ACCEPT_MS: Final = 5000
_RETRY: Final = {"period_init_ms": 50, "period_max_ms": 250, "period_increase_factor": 2}
_ROOM: Final = 64 * 1024
"""What Zenoh adds to a message: the key, lengths."""


def configuration(settings: Settings, mode: Mode, *, wait_s: float) -> dict[str, Any]:
    """Return Zenoh's configuration, by key.

    Args:
      settings: checked ones.
      mode: how the session takes part.
      wait_s: how long a client waits for an agent.
    """
    if mode == "peer" and not _is_among_peers(settings):
        mode = "client"
    told: dict[str, Any] = {
        "mode": mode,
        "scouting/multicast/enabled": False,  # nothing is looked for on the network
        "scouting/gossip/enabled": mode != "client",  # peers tell each other where peers are
        "scouting/delay": 1,  # opening waits for half a second otherwise, for those who answer the multicast
        "listen/endpoints": listens(settings, mode),
        "connect/endpoints": targets(settings, mode),
        "connect/retry": _RETRY,
        # Of one attempt: one whose bytes are swallowed is given up as soon as a neighbour would be, and tried again.
        "transport/unicast/open_timeout": max(1000, int(settings.lease_s * 1000)),
        # Connections that say nothing must not keep others out: as many may be pending as there may be sessions.
        "transport/unicast/accept_pending": _MOST_SESSIONS,
        "transport/unicast/max_sessions": _MOST_SESSIONS,
        "transport/unicast/accept_timeout": max(_ACCEPT_MS, int(settings.lease_s * 1000)),
        "transport/link/tx/lease": int(settings.lease_s * 1000),
        "transport/link/tx/queue/size": dict.fromkeys(_PRIORITIES, _BATCHES),
        # Declarations are not dropped: one to a program that hangs would hold the loop for five seconds.
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 1_000_000,
        "transport/link/rx/max_message_size": settings.largest_message + _ROOM,
        "transport/shared_memory/enabled": settings.shared_memory > 0,
    }
    if settings.shared_memory:
        told["transport/shared_memory/transport_optimization/pool_size"] = settings.shared_memory
    if mode == "client":
        told |= {"connect/timeout_ms": max(1, int(wait_s * 1000)), "connect/exit_on_failure": True}
    else:  # in the background: whoever is not there yet may come
        told |= {"connect/timeout_ms": -1, "connect/exit_on_failure": False}
    if mode == "peer":
        # Where programs meet the first of them listens. When it goes the others go on trying to connect there, and find
        # whoever comes next. (Going on trying to *listen* there would do as well, but Zenoh never ends that: closing
        # then takes ten seconds, and the address stays taken.)
        told |= {"listen/timeout_ms": 0, "listen/exit_on_failure": False}
    if settings.tls is not None:
        told["transport/link/tls"] = _tls(settings.tls)
    if settings.key:
        told["transport/link/tls"] = tls_of_key(settings.key)
    if settings.access is not None and mode == "router":
        told["access_control"] = _access_control(settings.access, Keys(settings.realm))
    return told


_PRIORITIES: Final = (
    "control",
    "real_time",
    "interactive_high",
    "interactive_low",
    "data_high",
    "data",
    "data_low",
    "background",
)


def listens(settings: Settings, mode: Mode) -> list[str]:
    """Return the addresses at which a session listens."""
    if mode == "router":
        return list(settings.listen)
    if mode == "peer" and _is_among_peers(settings):
        return [*map(_beside, settings.meet), *([] if settings.connect else settings.meet)]
    return []


def _is_among_peers(settings: Settings) -> bool:
    """Whether there is an address at which peers listen.

    All others communicate through agents, which enforce permissions.

    With certificates connections among peers would pass by the agent, and so by its access control; and if the agent is
    on another host, peers on that host cannot be reached.
    """
    return bool(settings.meet) and settings.tls is None and not _is_elsewhere(settings.connect)


def _beside(address: str) -> str:
    """Return where a peer listens besides the one address that only the first of them has."""
    protocol, _, place = address.partition("/")
    if protocol == "unixsock-stream":
        return f"{address}-{secrets.token_hex(4)}"
    return f"{protocol}/{place.rpartition(':')[0]}:0"


def targets(settings: Settings, mode: Mode) -> list[str]:
    """Return the addresses to which a session connects."""
    if mode == "router":
        return list(settings.agents)
    if settings.connect:
        return list(settings.connect)
    meet = settings.meet if mode == "peer" and _is_among_peers(settings) else ()
    return [*(_reachable(address) for address in settings.listen), *meet]


def _is_elsewhere(addresses: tuple[str, ...]) -> bool:
    return any(not is_loopback(address) for address in addresses)


def _reachable(address: str) -> str:
    """An address of this host from within it: who listens everywhere is not reached at "everywhere"."""
    return address.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")


def _tls(tls: Tls) -> dict[str, Any]:
    return {
        "root_ca_certificate": tls.authority,
        "enable_mtls": tls.mutual,
        "verify_name_on_connect": True,
        "listen_certificate": tls.certificate,
        "listen_private_key": tls.key,
        "connect_certificate": tls.certificate,
        "connect_private_key": tls.key,
    }


_ALL_MESSAGES: Final = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "declare_queryable",
    "reply",
    "liveliness_token",
    "declare_liveliness_subscriber",
    "liveliness_query",
)


def _access_control(access: Access, keys: Keys) -> dict[str, Any]:
    """Only the rules listed here apply; Zenoh does not report refusals.

    A question does not carry the caller's name, so the key states what may be requested: its last two chunks, for a
    rule that looked for "ro" anywhere would let a viewer steer a worker that is called "ro".
    """
    everything = [f"{keys.data}/**", f"{keys.questions}/**", f"{keys.presences}/**", f"{keys.versions}/**"]
    presence = [f"{keys.presences}/**", f"{keys.versions}/**"]
    read_verbs = [f"{keys.questions}/**/ro/*"]

    def rule(name: str, flow: str, where: list[str], *messages: str) -> dict[str, Any]:
        return {"id": name, "permission": "allow", "flows": [flow], "key_exprs": where, "messages": list(messages)}

    rules = [
        rule("write-in", "ingress", everything, *_ALL_MESSAGES),
        rule("write-out", "egress", everything, *_ALL_MESSAGES),
        rule("values-in", "ingress", [f"{keys.data}/**"], "declare_subscriber"),
        rule("values-out", "egress", [f"{keys.data}/**"], "put", "delete"),
        rule("presence-in", "ingress", presence, "declare_liveliness_subscriber", "liveliness_query"),
        rule("presence-out", "egress", presence, "liveliness_token"),
        rule("questions-in", "ingress", read_verbs, "query"),
        rule("questions-out", "egress", read_verbs, "declare_queryable", "reply"),
    ]
    write, read = [one["id"] for one in rules[:2]], [one["id"] for one in rules[2:]]
    subjects, policies = [], []
    for name, who, what in (("write", access.write, write), ("read", access.read, read)):
        if who:
            subjects.append({"id": name, "cert_common_names": list(who)})
            policies.append({"rules": what, "subjects": [name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }

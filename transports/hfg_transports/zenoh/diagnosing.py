"""Finds out what Zenoh does not tell: why an address cannot be reached.

Whatever the reason, Zenoh says "Unable to connect ... Timeout!" for a missing listener, for an unknown host, and for
every certificate that does not fit. So after the failure the same way is tried once more with Python's own TLS, which
knows the reason, on both ends: the other one says by an alert what it dislikes. Depends on settings and keys.
"""

from __future__ import annotations

import os
import socket
import ssl
from pathlib import Path
from typing import Final, NamedTuple

from hfg.base.private import exposure_of_key, may_be_changed, unsafe_place
from hfg_transports.zenoh.keys import authority_of_key
from hfg_transports.zenoh.settings import Tls

_PATIENCE_S: Final = 1.0
_EXPIRED, _NOT_YET_VALID = 10, 9
_OTHER_AUTHORITY: Final = {2, 18, 19, 20, 21}
_WRONG_NAME: Final = {62, 64}
"""As OpenSSL numbers what is wrong with a certificate; its words differ from version to version."""

_NEW_KEYS: Final = "make new ones by hfg keys new"


class Reason(NamedTuple):
    """Why, and what to do."""

    what: str
    remedy: str


_CROWDED: Final = Reason(
    "that port takes connections, but has not answered yet",
    "that computer is busy, or somebody opens many connections there: try again, and if it stays so, let its firewall "
    "admit only your hosts",
)


def files_that_do_not_fit(tls: Tls) -> Reason | None:
    """Look at the files of the certificates, which Zenoh reads when it connects and says nothing about."""
    for name in ("authority", "certificate", "key"):
        file = Path(getattr(tls, name))
        try:
            with file.open("rb") as stream:
                found = os.fstat(stream.fileno())
        except OSError as error:
            return Reason(f"tls.{name}: {file} cannot be read: {error.strerror}", f"correct the path, or {_NEW_KEYS}")
        if name == "key" and (exposure := exposure_of_key(file, found)):
            return Reason(f"tls.key: {exposure[0]}", exposure[1])
        if (place := unsafe_place(file)) is not None:
            return Reason(
                f"tls.{name}: other users can replace what lies in {place}, and so {file}",
                "move it to a folder of yours",
            )
        if name == "authority" and may_be_changed(found):
            return Reason(
                f"tls.authority: other users can change {file}, and so decide whom this program trusts",
                f"write chown {os.geteuid()} {file}; chmod go-w {file}",
            )
    try:
        ssl.create_default_context(cafile=tls.authority)
    except ssl.SSLError:
        return Reason(f"tls.authority: {tls.authority} is no certificate", "name a PEM file")
    try:
        ssl.create_default_context().load_cert_chain(tls.certificate, tls.key)
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            return Reason(
                f"tls.key: {tls.key} is not the key to {tls.certificate}", "name the two that were made together"
            )
        return Reason(f"tls.certificate: {tls.certificate} and {tls.key} are no certificate and key", "name PEM files")
    return None


def why_unreachable(address: str, tls: Tls | None, key: str = "") -> Reason:
    """Say why a session could not connect to an address.

    Args:
      address: where.
      tls: the certificates, if there are any.
      key: the file of the key, if there is one instead.
    """
    protocol, _, rest = address.partition("/")
    place = rest.partition("?")[0].partition("#")[0]
    if protocol == "unixsock-stream":
        return _unix(place)
    host, _, port = place.rpartition(":")
    host = host.strip("[]")
    try:
        with socket.create_connection((host, int(port)), timeout=_PATIENCE_S) as connection:
            if protocol == "tls" and tls is not None:
                return _handshake(connection, host, tls)
            if protocol == "tls" and key:
                return _handshake_with_key(connection, key)
            return Reason("somebody listens there, but does not speak Zenoh without TLS", "is it TLS (tls/...)?")
    except socket.gaierror:
        return Reason(f'there is no host "{host}"', "correct the name")
    except ConnectionRefusedError:
        return Reason("nobody listens there", "start hfg agent there, or correct the address")
    except TimeoutError:
        return Reason("nobody answers there", "is the host switched on, and does its firewall let the port through?")
    except OSError as error:
        return Reason(error.strerror or str(error), "correct the address")


def _unix(place: str) -> Reason:
    if Path(place).exists():
        allowed = os.access(place, os.R_OK | os.W_OK)
        return (
            Reason("nobody listens at that socket any more", "start hfg agent")
            if allowed
            else Reason("that socket may not be used by you", "change its permissions, or your group")
        )
    return Reason("there is no such socket", "start hfg agent, or correct the address")


def _handshake(connection: socket.socket, host: str, tls: Tls) -> Reason:
    connection.settimeout(_PATIENCE_S)
    context = ssl.create_default_context(cafile=tls.authority)
    context.load_cert_chain(tls.certificate, tls.key)
    try:
        secure = context.wrap_socket(connection, server_hostname=host)
    except ssl.SSLCertVerificationError as error:
        return _about_theirs(error, host)
    except ssl.SSLError as error:
        return _about_ours(error.reason or str(error))
    except TimeoutError:
        return _CROWDED
    try:
        with secure:
            secure.recv(1)  # in TLS 1.3 who dislikes the certificate says so after the handshake
    except ssl.SSLError as error:
        return _about_ours(error.reason or str(error))
    except TimeoutError:
        return Reason("the certificates fit, but nobody speaks Zenoh there", "is it the port of an hfg agent?")
    return Reason("the certificates fit, but the connection was closed", "is the agent's realm full, or stopping?")


def _handshake_with_key(connection: socket.socket, key: str) -> Reason:
    """Return what is wrong with the listener; this does not require proving that we have the key."""
    connection.settimeout(_PATIENCE_S)
    context = ssl.create_default_context(cadata=authority_of_key(key))
    context.check_hostname = False
    try:
        context.wrap_socket(connection).close()
    except ssl.SSLCertVerificationError:
        return Reason("somebody listens there who has not our key", "take the same file for key = ... there")
    except ssl.SSLError as error:
        return _about_ours(error.reason or str(error))
    except TimeoutError:
        return _CROWDED
    return Reason("somebody listens there who has our key, but did not answer in time", _CROWDED.remedy)


def _about_theirs(error: ssl.SSLCertVerificationError, host: str) -> Reason:
    if error.verify_code == _EXPIRED:
        return Reason("the certificate there has expired", _NEW_KEYS)
    if error.verify_code == _NOT_YET_VALID:
        return Reason("the certificate there is not yet valid", "is the clock of one of the two hosts wrong?")
    if error.verify_code in _WRONG_NAME:
        return Reason(
            f'the certificate there is not for "{host}"', f"connect by the name that is in it, or {_NEW_KEYS}"
        )
    if error.verify_code in _OTHER_AUTHORITY:
        return Reason("the certificate there was signed by another authority", "use keys that were made together")
    return Reason(f"the certificate there does not fit: {error.verify_message}", _NEW_KEYS)


def _about_ours(alert: str) -> Reason:
    if "CERTIFICATE_EXPIRED" in alert:
        return Reason("our certificate has expired", _NEW_KEYS)
    if "UNKNOWN_CA" in alert:
        return Reason(
            "our certificate was signed by another authority than is trusted there", "use keys that were made together"
        )
    if "CERTIFICATE_REQUIRED" in alert or "BAD_CERTIFICATE" in alert or "CERTIFICATE_UNKNOWN" in alert:
        return Reason("our certificate is refused there", "use keys that were made together")
    return Reason(f"TLS fails: {alert.lower().replace('_', ' ')}", "does a TLS listener (tls/...) of hfg run there?")

"""Credentials and certificates: by the environment or a file, never in a graph (rule L5).

Depends on `_failures` and `hfg.base.private`.
"""

from __future__ import annotations

import os
import re
import ssl
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl, urlsplit

from annotated_types import Predicate

from hfg.base.private import exposure_of_key
from hfg.nodes.buses._failures import Refused

_NAMED: Final = re.compile(r"(env:[A-Za-z_]\w*|file:[^\0]+)?", re.ASCII)
_SECRET: Final = re.compile(
    r"pass(word|wd|phrase)?$|pwd$|secret|token|api.?key|auth(orization)?$|credential|cookie", re.I
)
_LONGEST: Final = 64 * 1024


def _saying(sentence: str, check: Any) -> Predicate:
    """Return a limit that says a sentence when it is broken."""
    check.__name__ = sentence
    return Predicate(check)


def _is_named(source: str) -> bool:
    return _NAMED.fullmatch(source) is not None


def _is_open(address: str) -> bool:
    """Return whether an address has no password and nothing that looks like a token."""
    try:
        parts = urlsplit(address)
        return parts.password is None and "@" not in parts.netloc and not any(map(_SECRET.search, _keys(parts.query)))
    except ValueError:
        return True  # it is refused for what it is


def _keys(query: str) -> list[str]:
    return [key for key, _ in parse_qsl(query, keep_blank_values=True)]


def _are_open(names: Mapping[str, str]) -> bool:
    return not any(map(_SECRET.search, names))


SOURCE: Final = _saying(
    '"env:NAME" or "file:PATH", where the secret is: a secret itself is never part of a graph', _is_named
)
"""Limit of the parameter "secret"."""

NO_SECRET: Final = _saying(
    'an address without a password or token, which are never part of a graph: name the parameters "user" and "secret"',
    _is_open,
)
"""Limit of an address."""

NO_SECRETS: Final = _saying(
    'names without passwords, tokens and cookies, which are never part of a graph: use the parameter "secret" '
    "or the environment",
    _are_open,
)
"""Limit of headers and variables."""


def secret_of(source: str) -> str:
    """Return the secret that a parameter names; "" of none.

    Raises:
      Refused: it is not there, or others can read the file.
    """
    kind, _, name = source.partition(":")
    if kind == "env":
        found = os.environ.get(name, "")
        if not found:
            raise Refused(f"the environment has no secret {name}; set it before the program starts")
        return found
    return _of_file(name) if kind == "file" else ""


def _of_file(name: str) -> str:
    try:
        with Path(name).open("rb") as file:
            exposure = exposure_of_key(name, os.fstat(file.fileno()))
            text = file.read(_LONGEST + 1)
        if exposure is not None:
            raise Refused("; ".join(exposure))
        if len(text) > _LONGEST:
            raise Refused(f'"{name}" is too long for a secret')
        return text.decode().rstrip("\r\n")
    except (OSError, UnicodeError) as error:
        raise Refused(f'the secret in "{name}" cannot be read: {error}') from None


def client_tls(ca_file: str) -> ssl.SSLContext:
    """Return what a client needs to know of servers; without a file, the authorities of this computer.

    Raises:
      Refused: the file cannot be used.
    """
    try:
        return ssl.create_default_context(cafile=ca_file or None)
    except OSError as error:
        raise Refused(f'the authorities in "{ca_file}" cannot be used: {error.strerror or error}') from None


def server_tls(certificate: str, key: str) -> ssl.SSLContext | None:
    """Return what a server proves itself with; None without a certificate.

    Raises:
      Refused: the files cannot be used, or others know the key.
    """
    if not certificate:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        exposure = exposure_of_key(key or certificate, Path(key or certificate).stat())
        if exposure is None:
            context.load_cert_chain(certificate, key or None)
            return context
    except OSError as error:
        raise Refused(f'the certificate "{certificate}" cannot be used: {error.strerror or error}') from None
    raise Refused("; ".join(exposure))

"""Keys and names of hfg as Zenoh's key expressions, and back.

Zenoh gives a meaning to `* $ # ?`, and to chunks that begin with `@`: a wildcard never matches those, which keeps data
about a system (`@hfg/...`) apart from its data. So each chunk is percent-encoded where it has one of these. Everything
of hfg lies below the version of its wire format and the realm: programs of two realms, or of two versions, do not hear
each other. Depends on errors.
"""

from __future__ import annotations

import re
from typing import Final
from urllib.parse import unquote

from hfg.errors import MessageTooLarge, TransportError

WIRE_VERSION: Final = 1
"""Goes up when programs with the old one would misunderstand the new."""

LONGEST_KEY: Final = 32 * 1024
"""Bytes. A key expression that does not fit into one batch of 64 KiB ends the process in a panic of Zenoh's."""

_FORBIDDEN: Final = re.compile("[*$#?%@\x00-\x1f\x7f\ud800-\udfff]")


def escape(name: str) -> str:
    """Return a name whose chunks Zenoh takes as they are.

    Raises:
      TransportError: it has an empty chunk.

    Examples:
      >>> escape("arm/what?"), escape("größe/50 %")
      ('arm/what%3F', 'größe/50 %25')
    """
    if not all(name.split("/")):
        raise TransportError(f'"{name}" is no name: between its "/" there must be something; leave out the empty parts')
    return _FORBIDDEN.sub(lambda found: "".join(f"%{one:02X}" for one in _bytes(found[0])), name)


def unescape(key: str) -> str:
    """Return the name that was escaped.

    Examples:
      >>> unescape("arm/what%3F")
      'arm/what?'
    """
    return unquote(key, errors="surrogatepass")


def _bytes(char: str) -> bytes:
    return char.encode("utf-8", errors="surrogatepass")


class Keys:
    """Where everything of a realm lies.

    Attributes:
      data: below it are the datagrams, by key.
      questions: below it are those who answer, by name.
      presences: below it is who is there: session and number, metadata, name.
      versions: below it is which session speaks which version; outside of any version, so that all see it.
    """

    def __init__(self, realm: str) -> None:
        chunk = escape(realm)
        self.data = f"hfg/{WIRE_VERSION}/{chunk}/d"
        self.questions = f"hfg/{WIRE_VERSION}/{chunk}/q"
        self.presences = f"@hfg/{WIRE_VERSION}/{chunk}/p"
        self.versions = f"@hfg/versions/{chunk}"


def join(prefix: str, *chunks: str) -> str:
    """Put a key together.

    Raises:
      MessageTooLarge: it is longer than `LONGEST_KEY`.
    """
    key = "/".join((prefix, *chunks))
    length = len(key.encode())
    if length > LONGEST_KEY:
        raise MessageTooLarge(
            f'the name that begins with "{key[:60]}" makes a key of {length} bytes, and the longest has {LONGEST_KEY}; '
            "take a shorter name or less metadata"
        )
    return key

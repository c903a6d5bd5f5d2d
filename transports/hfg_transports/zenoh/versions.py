"""Other programs in the realm, and their versions: programs of different versions cannot communicate.

Each session leaves a token with its version where all versions look. The last to come is refused; those that were there
before log a warning. Depends on names.
"""

from __future__ import annotations

import importlib.metadata

from hfg_transports.zenoh.names import WIRE_VERSION, Keys, escape


def version_key(keys: Keys, session: str) -> str:
    """Return the key of the token by which a session says what it speaks."""
    return f"{keys.versions}/{WIRE_VERSION}/{escape(importlib.metadata.version('hfg'))}/{session}"


def complaint(keys: Keys, key: str, realm: str) -> str | None:
    """Return an error message if the session of another token uses another version; None if it is the same."""
    wire, _, rest = key.removeprefix(f"{keys.versions}/").partition("/")
    if wire == str(WIRE_VERSION) or not key.startswith(keys.versions):
        return None
    theirs, ours = rest.partition("/")[0], importlib.metadata.version("hfg")
    return (
        f'in the realm "{realm}" there is hfg {theirs} with version {wire} of the wire format, and this is hfg {ours} '
        f"with version {WIRE_VERSION}; install the same hfg for all programs, or take another realm"
    )

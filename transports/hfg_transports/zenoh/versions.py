"""Who else is in the realm, and whether it speaks the same: programs of two versions do not hear each other.

Each session leaves a token with its version where all versions look. Who comes last is refused; who was there before
logs a warning. Stands on names.
"""

from __future__ import annotations

import importlib.metadata

from hfg_transports.zenoh.names import WIRE_VERSION, Keys, escape

__all__ = ["complaint", "version_key"]


def version_key(keys: Keys, session: str) -> str:
    """Give the key of the token by which a session says what it speaks."""
    return f"{keys.versions}/{WIRE_VERSION}/{escape(importlib.metadata.version('hfg'))}/{session}"


def complaint(keys: Keys, key: str, realm: str) -> str | None:
    """Say in a sentence that the session of another token speaks otherwise; None if it speaks the same."""
    wire, _, rest = key.removeprefix(f"{keys.versions}/").partition("/")
    if wire == str(WIRE_VERSION) or not key.startswith(keys.versions):
        return None
    theirs, ours = rest.partition("/")[0], importlib.metadata.version("hfg")
    return (
        f'in the realm "{realm}" there is hfg {theirs} with version {wire} of the wire format, and this is hfg {ours} '
        f"with version {WIRE_VERSION}; install the same hfg for all programs, or take another realm"
    )

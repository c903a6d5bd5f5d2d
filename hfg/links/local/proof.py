"""How both ends of a connection prove that they know the secret of their place, without telling it.

    listener  -> caller     a nonce
    caller    -> listener   version, a nonce, its name, and the proof: a MAC over both nonces and both names
    listener  -> caller     the same for the other role, so that a proof cannot be sent back to whom it came from

Both nonces make a key for this one connection. Each frame has a MAC with that key over its number, so that none can be
forged, repeated, left out or taken from another connection. Pure functions and counters; no sockets.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import struct
from typing import Final

NONCE_SIZE: Final = 32
PROOF_SIZE: Final = 32
TAG_SIZE: Final = 16

_CLAIM: Final = struct.Struct(f"<B{NONCE_SIZE}s8s{PROOF_SIZE}s")
CLAIM_SIZE: Final = _CLAIM.size
_VERSION: Final = 1
_NUMBER: Final = struct.Struct("<Q")


class Refused(Exception):
    """What came cannot be from a program that has the secret and speaks this version."""


def _mac(secret: bytes, role: bytes, *parts: bytes) -> bytes:
    """All parts have a fixed size, so that there is one way only to read them."""
    return hashlib.blake2b(b"".join(parts), key=secret, digest_size=PROOF_SIZE, person=role).digest()


class Listener:
    """The end that was connected to.

    Attributes:
      nonce: to be sent to the caller first.
    """

    def __init__(self, secret: bytes, name: bytes) -> None:
        self.nonce = secrets.token_bytes(NONCE_SIZE)
        self._secret = secret
        self._name = name

    def check(self, claim: bytes) -> tuple[bytes, bytes, Seals]:
        """Return the name of the caller, the proof for it, and what opens its frames.

        Raises:
          Refused: the caller does not have the secret.
        """
        version, nonce, name, proof = _CLAIM.unpack(claim)
        said = (self.nonce, nonce, self._name, name)
        if version != _VERSION:
            raise Refused(f"it speaks version {version} of the protocol, and this program version {_VERSION}")
        if not hmac.compare_digest(proof, _mac(self._secret, b"caller", *said)):
            raise Refused("it does not know the secret")
        return name, _mac(self._secret, b"listener", *said), Seals(_mac(self._secret, b"frames", *said))


class Caller:
    """The end that connects."""

    def __init__(self, secret: bytes, name: bytes, listener: bytes) -> None:
        self._secret = secret
        self._name = name
        self._listener = listener
        self._said: tuple[bytes, ...] = ()

    def claim(self, nonce: bytes) -> bytes:
        """Return what proves to the listener that this end has the secret."""
        own = secrets.token_bytes(NONCE_SIZE)
        self._said = (nonce, own, self._listener, self._name)
        return _CLAIM.pack(_VERSION, own, self._name, _mac(self._secret, b"caller", *self._said))

    def check(self, proof: bytes) -> Seals:
        """Return what seals the frames of this connection.

        Raises:
          Refused: the listener does not have the secret.
        """
        if not hmac.compare_digest(proof, _mac(self._secret, b"listener", *self._said)):
            raise Refused("it does not know the secret")
        return Seals(_mac(self._secret, b"frames", *self._said))


class Seals:
    """The seals of one connection's frames, in order; each end counts for itself."""

    def __init__(self, key: bytes) -> None:
        self._keyed = hashlib.blake2b(key=key, digest_size=TAG_SIZE)
        self._number = 0

    def next(self, frame: bytes | memoryview) -> bytes:
        """Return the seal of the next frame."""
        sealing = self._keyed.copy()
        sealing.update(_NUMBER.pack(self._number))
        sealing.update(frame)
        self._number += 1
        return sealing.digest()

"""A key that all programs of a realm have, as certificates: both ends of a connection prove that they have it.

The key makes an authority, the same one wherever the key is. Each session has a certificate of its own, signed by that
authority, and trusts no other. So TLS does what it does with certificates from files: both ends prove who they are, and
what is sent is encrypted, authenticated and cannot be replayed. The owner of the key can do everything. Depends on the
package cryptography, of the extra zenoh.
"""

from __future__ import annotations

import base64
import datetime
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from hfg.base.private import exposure_of_key, unsafe_place
from hfg.errors import TransportError

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePublicKey

SHORTEST: Final = 32
"""Bytes of a key. What others can guess proves nothing, and they can try as often as they like."""
_LONGEST: Final = 4096
_MAKE_ONE: Final = "hfg keys secret FILE makes one"
_AUTHORITY: Final = "hfg shared key"
_BEGAN: Final = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
_ENDS: Final = datetime.datetime(2120, 1, 1, tzinfo=datetime.UTC)
"""Whoever has the key can make another certificate at any time, so an end means nothing; and clocks differ."""
_ORDER: Final = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551
"""Of the curve P-256."""


def key_of(file: str) -> bytes:
    """Read a key.

    Raises:
      TransportError: it cannot be read, others can read it, or it can be guessed.
    """
    try:
        with Path(file).open("rb") as stream:
            found = os.fstat(stream.fileno())
            key = stream.read(_LONGEST).strip()
    except OSError as error:
        raise TransportError(
            f"key: {file} cannot be read: {error.strerror}; correct the path, or {_MAKE_ONE}"
        ) from None
    if exposure := exposure_of_key(file, found):
        raise TransportError(f"key: {'; '.join(exposure)}")
    if (place := unsafe_place(Path(file))) is not None:
        raise TransportError(
            f"key: other users can replace what lies in {place}, and so {file}; move it to a folder of yours"
        )
    if len(key) < SHORTEST:
        raise TransportError(f"key: {file} has {len(key)} bytes, and at least {SHORTEST} are needed; {_MAKE_ONE}")
    return key


def authority_of_key(file: str) -> str:
    """Return the certificate of the authority that a key makes, as PEM.

    Raises:
      TransportError: the key cannot be used.
    """
    from cryptography.hazmat.primitives import serialization

    return _certificates(key_of(file))[0].public_bytes(serialization.Encoding.PEM).decode()


def tls_of_key(file: str) -> dict[str, Any]:
    """Return Zenoh's TLS configuration for a key.

    Raises:
      TransportError: the key cannot be used, or cryptography is not installed.
    """
    key = key_of(file)
    try:
        from cryptography.hazmat.primitives import serialization
    except ImportError:
        raise TransportError("a key needs the package cryptography; pip install 'hfg[zenoh]'") from None
    authority, certificate, own = _certificates(key)
    pem = serialization.Encoding.PEM
    plain = own.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    told = {"root_ca_certificate_base64": authority.public_bytes(pem)}
    for end in ("listen", "connect"):
        told |= {f"{end}_certificate_base64": certificate.public_bytes(pem), f"{end}_private_key_base64": plain}
    # Every holder of the key may listen anywhere, so there is no name to compare with the address.
    return {name: base64.b64encode(said).decode() for name, said in told.items()} | {
        "enable_mtls": True,
        "verify_name_on_connect": False,
    }


def _certificates(key: bytes) -> tuple[x509.Certificate, x509.Certificate, Any]:
    """Return the authority that the key makes, and a new certificate that it has signed, with its private key."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.kdf.hkdf import HKDF
    from cryptography.x509.oid import ExtendedKeyUsageOID

    # Longer than the curve needs, so that all of its keys are as likely as each other.
    seed = HKDF(hashes.SHA256(), length=48, salt=None, info=b"hfg authority of a shared key, 1").derive(key)
    signing = ec.derive_private_key(int.from_bytes(seed, "big") % (_ORDER - 1) + 1, ec.SECP256R1())
    own = ec.generate_private_key(ec.SECP256R1())
    uses = x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH])
    names = x509.SubjectAlternativeName([x509.DNSName("hfg.invalid")])
    authority = _builder(_AUTHORITY, signing.public_key(), is_authority=True).sign(signing, hashes.SHA256())
    leaf = _builder("hfg", own.public_key(), is_authority=False)
    certificate = leaf.add_extension(uses, critical=False).add_extension(names, critical=False)
    return authority, certificate.sign(signing, hashes.SHA256()), own


def _builder(common: str, public: EllipticCurvePublicKey, *, is_authority: bool) -> x509.CertificateBuilder:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    def named(common: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common)])

    constraints = x509.BasicConstraints(ca=is_authority, path_length=0 if is_authority else None)
    return (
        x509.CertificateBuilder()
        .subject_name(named(common))
        .issuer_name(named(_AUTHORITY))
        .public_key(public)
        .serial_number(x509.random_serial_number())
        .not_valid_before(_BEGAN)
        .not_valid_after(_ENDS)
        .add_extension(constraints, critical=True)
    )

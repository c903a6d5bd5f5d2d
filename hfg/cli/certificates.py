"""Makes a test authority and certificates signed by it, as PEM files that only their owner may read.

A *test* authority: its key is stored next to the certificates that it signs, so anyone who can read the folder can pose
as any host. Depends on the package cryptography, of the extra zenoh, because the command line of OpenSSL is not
everywhere and differs from version to version.
"""

from __future__ import annotations

import datetime
import ipaddress
import os
import secrets
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, TypeAlias

from hfg.base.private import make_private, unsafe_place
from hfg.errors import TargetError

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey

AUTHORITY: Final = "authority"
"""The file name of what signs all others."""

Kind: TypeAlias = Literal["agent", "worker", "viewer"]
"""An agent is connected to, so its certificate says for which hosts it is; nobody else can pose as one."""

_LONGEST_NAME: Final = 64
"""Characters of a common name, by the standard."""
_MAKE_ONE: Final = "hfg keys new makes an authority"
_PAST: Final = datetime.timedelta(minutes=10)
"""Certificates are valid from before they were made: clocks of hosts differ."""


def make_authority(folder: Path, *, days: int) -> None:
    """Write the certificate and key of a new authority.

    Raises:
      TargetError: there is one already, the files cannot be written, or cryptography is not installed.
    """
    _library()
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec

    _refuse_to_overwrite(folder, AUTHORITY)
    key = ec.generate_private_key(ec.SECP256R1())
    # Two authorities of one name look the same to a verifier, until the signatures of one do not fit the other.
    name = _name(f"hfg test authority {secrets.token_hex(4)}")
    usage = x509.KeyUsage(
        digital_signature=False,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=True,
        crl_sign=True,
        encipher_only=False,
        decipher_only=False,
    )
    certificate = (
        _valid(days)
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    _write(folder, AUTHORITY, certificate, key)


def make_certificate(folder: Path, name: str, kind: Kind, *, hosts: Sequence[str] = (), days: int) -> None:
    """Write a certificate, signed by the authority in the folder, and its key.

    Args:
      folder: where the authority lies, and these will.
      name: its common name, by which access is given; and of the files.
      kind: what may be done with it.
      hosts: names and addresses by which an agent is reached.
      days: how long it is valid.

    Raises:
      TargetError: there is no authority, the files exist or cannot be written, the name or a host is not valid,
        or cryptography is not installed.
    """
    _library()
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID

    if not name or len(name) > _LONGEST_NAME or "/" in name or name.startswith(".") or name == AUTHORITY:
        raise TargetError(f'"{name}" is not a name for a certificate: take up to {_LONGEST_NAME} letters, as in arm')
    _refuse_to_overwrite(folder, name)
    above, its_key = _authority(folder)
    key = ec.generate_private_key(ec.SECP256R1())
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH]
    if kind == "agent":
        uses.append(ExtendedKeyUsageOID.SERVER_AUTH)
    builder = (
        _valid(days)
        .subject_name(_name(name))
        .issuer_name(above.subject)
        .public_key(key.public_key())
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(uses), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(its_key.public_key()), critical=False)
    )
    if kind == "agent":
        builder = builder.add_extension(x509.SubjectAlternativeName([_host(host) for host in hosts]), critical=False)
    _write(folder, name, builder.sign(its_key, hashes.SHA256()), key)


def _library() -> None:
    try:
        import cryptography  # noqa: F401
    except ImportError:
        raise TargetError("making keys needs the package cryptography; pip install 'hfg[zenoh]'") from None


def _name(common: str) -> x509.Name:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common)])


def _valid(days: int) -> x509.CertificateBuilder:
    from cryptography import x509

    now = datetime.datetime.now(datetime.UTC)
    until = now + datetime.timedelta(days=days)
    begin = min(now, until) - _PAST  # of one that has expired already, for tests
    builder = x509.CertificateBuilder().serial_number(x509.random_serial_number())
    return builder.not_valid_before(begin).not_valid_after(until)


def _host(host: str) -> x509.GeneralName:
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        if not host:
            raise ValueError
        return x509.DNSName(host)
    except ValueError:
        raise TargetError(f'"{host}" is not a host: take a name in ASCII or an address, as in arm.local') from None


def _authority(folder: Path) -> tuple[x509.Certificate, EllipticCurvePrivateKey]:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    certificate, key = (folder / f"{AUTHORITY}.{ending}" for ending in ("pem", "key"))
    need_safe(key)
    try:
        made = x509.load_pem_x509_certificate(certificate.read_bytes())
        loaded = load_pem_private_key(key.read_bytes(), None)
    except OSError as error:
        raise TargetError(
            f"{error.filename} cannot be read: {error.strerror}; hfg keys new makes an authority"
        ) from None
    except (ValueError, TypeError):
        raise TargetError(
            f"{certificate} and {key} are not a certificate and a key; hfg keys new makes an authority"
        ) from None
    if not isinstance(loaded, EllipticCurvePrivateKey):
        raise TargetError(f"{key} is a key of another kind than hfg makes; {_MAKE_ONE}")
    return made, loaded


def need_safe(file: Path) -> None:
    """Refuse to keep a key where another user can put one of his in its place.

    Raises:
      TargetError: he can.
    """
    place = unsafe_place(file)
    if place is not None:
        raise TargetError(
            f"{file}: no place for keys, because other users can replace what lies in {place}: take a folder of yours"
        )


def _refuse_to_overwrite(folder: Path, name: str) -> None:
    for ending in ("pem", "key"):
        file = folder / f"{name}.{ending}"
        if file.exists() or file.is_symlink():
            raise TargetError(f"{file} is there already: keys are never overwritten; take another folder or name")


def _write(folder: Path, name: str, certificate: x509.Certificate, key: EllipticCurvePrivateKey) -> None:
    """Write both; no other user can read the key at any moment."""
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    secret = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    try:
        make_private(folder)
        need_safe(folder / name)
        for file, content, mode in (
            (folder / f"{name}.key", secret, 0o600),
            (folder / f"{name}.pem", certificate.public_bytes(Encoding.PEM), 0o644),
        ):
            descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(content)
    except OSError as error:
        raise TargetError(f"{error.filename} cannot be written: {error.strerror}") from None

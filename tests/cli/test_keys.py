"""`hfg keys`: an authority for tests and certificates, written once and readable by their owner alone."""

from __future__ import annotations

import stat
import sys
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from tests.cli.conftest import Command

ALL = {f"{name}.{ending}" for name in ("authority", "agent", "worker", "viewer") for ending in ("pem", "key")}


def certificate(file: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(file.read_bytes())


def test_new_makes_a_key_for_each_part_and_says_what_comes_next(command: Command, tmp_path: Path) -> None:
    shown = command("keys", "new", "keys")
    assert (shown.code, shown.err) == (0, "")
    assert {file.name for file in (tmp_path / "keys").iterdir()} == ALL
    for part in ("[tls]", 'certificate = "keys/agent.pem"', "[access]", 'read = ["viewer"]', "it is for tests"):
        assert part in shown.out


def test_keys_can_be_read_by_their_owner_alone(command: Command, tmp_path: Path) -> None:
    command("keys", "new", "keys")
    modes = {file.name: stat.S_IMODE(file.stat().st_mode) for file in (tmp_path / "keys").glob("*.key")}
    assert set(modes.values()) == {0o600}
    assert stat.S_IMODE((tmp_path / "keys").stat().st_mode) == 0o700


def test_certificates_say_who_may_be_connected_to_and_for_which_hosts(command: Command, tmp_path: Path) -> None:
    command("keys", "new", "keys", "--host", "arm.local", "--host", "192.0.2.7")
    agent, worker = (certificate(tmp_path / "keys" / f"{name}.pem") for name in ("agent", "worker"))
    names = agent.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["arm.local"]
    assert [str(one) for one in names.get_values_for_type(x509.IPAddress)] == ["192.0.2.7"]
    assert worker.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value == "worker"
    uses = worker.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(uses) == [ExtendedKeyUsageOID.CLIENT_AUTH]
    agent.verify_directly_issued_by(certificate(tmp_path / "keys" / "authority.pem"))


def test_add_makes_one_more_by_the_same_authority(command: Command, tmp_path: Path) -> None:
    command("keys", "new", "keys")
    assert command("keys", "add", "keys", "base", "--host", "base.local").code == 0
    certificate(tmp_path / "keys/base.pem").verify_directly_issued_by(certificate(tmp_path / "keys/authority.pem"))


def test_keys_are_never_overwritten(command: Command, tmp_path: Path) -> None:
    command("keys", "new", "keys")
    before = {file: file.read_bytes() for file in (tmp_path / "keys").iterdir()}
    shown = command("keys", "new", "keys")
    assert shown.code == 2
    assert "authority.pem is there already: keys are never overwritten; take another folder or name" in shown.err
    shown = command("keys", "add", "keys", "agent")
    assert shown.code == 2
    assert "agent.pem is there already: keys are never overwritten" in shown.err
    assert {file: file.read_bytes() for file in (tmp_path / "keys").iterdir()} == before


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["add", "nowhere", "arm"], "authority.pem cannot be read: No such file or directory; hfg keys new makes an"),
        (["add", "keys", "a/b"], '"a/b" is not a name for a certificate: take up to 64 letters, as in arm'),
        (["add", "keys", "authority"], '"authority" is not a name for a certificate'),
        (["add", "keys", "arm", "--host", "größe"], '"größe" is not a host: take a name in ASCII or an address'),
        (["new", "file/keys"], "cannot be written: Not a directory"),
    ],
)
def test_wrong_use_is_one_sentence(command: Command, tmp_path: Path, arguments: list[str], sentence: str) -> None:
    command("keys", "new", "keys")
    (tmp_path / "file").write_text("")
    shown = command("keys", *arguments)
    assert shown.code == 2
    assert sentence in shown.err
    assert shown.err.count("\n") == 1


def test_a_file_that_is_no_authority_is_named(command: Command, tmp_path: Path) -> None:
    command("keys", "new", "keys")
    (tmp_path / "keys/authority.pem").write_text("hello")
    said = command("keys", "add", "keys", "arm").err
    assert "are not a certificate and a key; hfg keys new makes an authority" in said


def test_without_cryptography_the_remedy_is_named(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    missing: Any = None
    monkeypatch.setitem(sys.modules, "cryptography", missing)
    shown = command("keys", "new", "keys")
    assert shown.code == 2
    assert "making keys needs the package cryptography; pip install 'hfg[zenoh]'" in shown.err


@pytest.mark.rule("L5")
@pytest.mark.parametrize("verb", [["secret", "shared/cell.key"], ["new", "shared/keys"], ["add", "shared/old", "arm"]])
def test_keys_are_not_kept_where_another_user_can_replace_them(
    command: Command, tmp_path: Path, verb: list[str]
) -> None:
    """He would put an authority of his own in the place of ours, and then be whoever he likes."""
    shared = tmp_path / "shared"
    command("keys", "new", "shared/old")
    shared.chmod(0o777)
    shown = command("keys", *verb)
    assert shown.code == 2
    assert f"no place for keys, because other users can replace what lies in {shared}" in shown.err
    assert {file.name for file in shared.rglob("*") if file.is_file()} == ALL

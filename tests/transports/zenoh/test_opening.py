"""What keeps a session from being opened: one sentence each, with what to do; Zenoh itself says "Timeout!" to most."""

from __future__ import annotations

import importlib.metadata
import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from hfg.errors import TransportError
from hfg_transports.zenoh import Tls, binding, open_session
from tests.transports.zenoh.conftest import Certificates, free_port, settings

SHORT_S = 0.4
"""Long enough for whoever answers at all, for these never do."""


@pytest.fixture
def taken() -> Iterator[int]:
    """A port at which somebody listens who never says anything."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        yield int(one.getsockname()[1])


def refusal(mode: Any = "client", wait_s: float = SHORT_S, **fields: Any) -> str:
    """Give the sentence of an error; the session that is opened nevertheless is closed."""
    with pytest.raises(TransportError) as raised:
        open_session(settings(**fields), mode, wait_s=wait_s).close()
    return str(raised.value)


def test_a_port_that_is_taken(taken: int) -> None:
    assert refusal("router", listen=(f"tcp/127.0.0.1:{free_port()}", f"tcp/127.0.0.1:{taken}")) == (
        f'"tcp/127.0.0.1:{taken}" is taken by another program; is an hfg agent running already? '
        "else listen at another port"
    )


def test_a_port_that_is_taken_with_tls(taken: int, certificates: Certificates) -> None:
    said = refusal("router", listen=(f"tls/127.0.0.1:{taken}",), tls=certificates.tls("agent"))
    assert f'127.0.0.1:{taken}" is taken by another program; is an hfg agent running already?' in said


def test_an_address_of_another_computer() -> None:
    said = refusal("router", listen=("tcp/192.0.2.1:7447",), insecure=True)
    assert said == 'this computer has no address "tcp/192.0.2.1:7447"; correct listen'


@pytest.mark.parametrize("mode", ["client", "peer"])
def test_nobody_listens_there(mode: str) -> None:
    port = free_port()
    assert refusal(mode, connect=(f"tcp/127.0.0.1:{port}",)) == (
        f'cannot connect to "tcp/127.0.0.1:{port}": nobody listens there; start hfg agent there, or correct the address'
    )


def test_a_host_that_does_not_exist() -> None:
    assert refusal(connect=("tcp/nowhere.invalid:7447",)) == (
        'cannot connect to "tcp/nowhere.invalid:7447": there is no host "nowhere.invalid"; correct the name'
    )


def test_somebody_else_listens_there(taken: int) -> None:
    assert "somebody listens there, but does not speak Zenoh without TLS" in refusal(
        connect=(f"tcp/127.0.0.1:{taken}",)
    )


def test_a_socket_file_that_is_not_there(tmp_path: Path) -> None:
    said = refusal(connect=(f"unixsock-stream/{tmp_path}/none.sock",))
    assert "there is no such socket; start hfg agent, or correct the address" in said


def test_wrong_settings_are_told_before_anything_is_opened() -> None:
    said = refusal(listen=("tcp/127.0.0.1:7447",), insecure=False)
    assert '"listen": "tcp/127.0.0.1:7447" is open: whoever connects there' in said
    said = refusal(connect=("tcp/127.0.0.1:7447",), insecure=False)
    assert '"connect": "tcp/127.0.0.1:7447" is open: whoever listens there' in said


def test_a_mode_that_does_not_exist() -> None:
    assert refusal("agent") == 'there is no mode "agent"; take router, peer or client'


# --- the library ---


def test_zenoh_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", none)
    assert refusal() == "the transport Zenoh is not installed; pip install 'hfg[zenoh]'"


@pytest.mark.parametrize("version", ["0.11.0", "1.9.4", "2.0.0"])
def test_zenoh_of_another_version(monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    monkeypatch.setattr(importlib.metadata, "version", lambda name: version)
    assert refusal() == (
        f"eclipse-zenoh {version} is installed, and hfg needs 1.10 or a newer 1.x; pip install --upgrade 'hfg[zenoh]'"
    )


def test_a_broken_installation(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(name: str) -> Any:
        raise ImportError("no such symbol")

    monkeypatch.setattr(importlib, "import_module", broken)
    with pytest.raises(TransportError, match="installed but cannot be imported: no such symbol; pip install --force"):
        binding.load()


# --- certificates ---


def meeting(certificates: Certificates, theirs: Tls, ours: Tls, host: str = "localhost") -> str:
    """Give what a client is told by an agent whose certificates do not fit, or whom its own do not."""
    port = free_port()
    agent = open_session(settings(listen=(f"tls/localhost:{port}",), tls=theirs), "router")
    try:
        said = refusal(connect=(f"tls/{host}:{port}",), tls=ours, wait_s=1.0)
    finally:
        agent.close()
    return said.removeprefix(f'cannot connect to "tls/{host}:{port}": ')


@pytest.mark.slow
def test_their_certificate_has_expired(certificates: Certificates) -> None:
    said = meeting(certificates, certificates.tls("expired"), certificates.tls("worker"))
    assert said == "the certificate there has expired; make new ones by hfg keys new"


@pytest.mark.slow
def test_their_certificate_is_for_another_host(certificates: Certificates) -> None:
    said = meeting(certificates, certificates.tls("elsewhere"), certificates.tls("worker"))
    assert said == (
        'the certificate there is not for "localhost"; connect by the name that is in it, or make new ones by '
        "hfg keys new"
    )


@pytest.mark.slow
def test_their_certificate_is_of_another_authority(certificates: Certificates) -> None:
    theirs = certificates.tls("agent", folder=certificates.other)
    said = meeting(certificates, theirs, certificates.tls("worker"))
    assert said == "the certificate there was signed by another authority; use keys that were made together"


@pytest.mark.slow
def test_our_certificate_has_expired(certificates: Certificates) -> None:
    said = meeting(certificates, certificates.tls("agent"), certificates.tls("expired"))
    assert said == "our certificate has expired; make new ones by hfg keys new"


@pytest.mark.slow
def test_our_certificate_is_of_another_authority(certificates: Certificates) -> None:
    ours = certificates.tls("worker", folder=certificates.other)
    said = meeting(certificates, certificates.tls("agent"), ours)
    assert said == (
        "our certificate was signed by another authority than is trusted there; use keys that were made together"
    )


@pytest.mark.slow
def test_a_file_of_the_certificates_is_missing_or_none(certificates: Certificates, tmp_path: Path) -> None:
    nowhere = str(tmp_path / "nowhere.pem")
    text = tmp_path / "text.pem"
    text.write_text("hello")
    address: dict[str, Any] = {"connect": (f"tls/localhost:{free_port()}",)}
    for name in ("authority", "certificate", "key"):
        said = refusal(**address, tls=certificates.tls("worker", folder=None, **{name: nowhere}))
        assert said.startswith(f"tls.{name}: {nowhere} cannot be read: No such file or directory; correct the path")
    assert refusal(**address, tls=certificates.tls("worker", authority=str(text))) == (
        f"tls.authority: {text} is no certificate; name a PEM file"
    )
    assert "are no certificate and key; name PEM files" in refusal(
        **address, tls=certificates.tls("worker", certificate=str(text))
    )
    other = certificates.tls("agent").key
    assert refusal(**address, tls=certificates.tls("worker", key=other)) == (
        f"tls.key: {other} is not the key to {certificates.tls('worker').certificate}; "
        "name the two that were made together"
    )


def test_a_client_without_a_certificate_is_refused(certificates: Certificates) -> None:
    """By an agent of ours; the client is Zenoh as it is, for ours could not even be told to come without."""
    port = free_port()
    agent = open_session(settings(listen=(f"tls/localhost:{port}",), tls=certificates.tls("agent")), "router")
    try:
        for tls in ({}, {"enable_mtls": False}):
            config = zenoh.Config()
            authority = certificates.tls("agent").authority
            told: dict[str, Any] = {
                "mode": "client",
                "scouting/multicast/enabled": False,
                "connect/endpoints": [f"tls/localhost:{port}"],
                "connect/timeout_ms": 500,
                "transport/link/tls": {"root_ca_certificate": authority, **tls},
            }
            for key, value in told.items():
                config.insert_json5(key, json.dumps(value))
            with pytest.raises(zenoh.ZError, match="Unable to connect"):
                zenoh.open(config)
    finally:
        agent.close()


# --- who may be at the other end, and who knows the keys


@pytest.mark.rule("L5")
@pytest.mark.parametrize("mode", ["router", "client", "peer"])
@pytest.mark.parametrize("name", ["listen", "meet", "agents", "connect"])
def test_a_socket_in_a_folder_that_others_can_enter_is_refused_wherever_it_is_named(
    tmp_path: Path, name: str, mode: str
) -> None:
    """Zenoh asks nobody who he is, so another user could listen at an address to which this program connects."""
    tmp_path.chmod(0o755)
    fields: dict[str, Any] = {name: (f"unixsock-stream/{tmp_path}/agent.sock",), "insecure": False}
    said = refusal(mode, **fields)
    assert f"{tmp_path}, of the socket" in said
    assert f"can be entered by others: write chmod 700 {tmp_path}; insecure = true trusts all of them" in said


@pytest.mark.rule("L5")
def test_a_socket_in_a_folder_that_others_can_replace_is_refused(tmp_path: Path) -> None:
    (tmp_path / "private").mkdir(mode=0o700)
    tmp_path.chmod(0o777)
    said = refusal(insecure=False, connect=(f"unixsock-stream/{tmp_path}/private/agent.sock",))
    assert f"other users can replace folders in {tmp_path}; write chmod go-w {tmp_path}" in said


@pytest.mark.rule("L5")
def test_a_socket_in_a_folder_that_is_not_there_yet_is_refused(tmp_path: Path) -> None:
    """Who makes the folder first would decide who listens there."""
    said = refusal("router", insecure=False, agents=(f"unixsock-stream/{tmp_path}/none/agent.sock",))
    assert f"{tmp_path}/none: No such file or directory; write mkdir -m 700 {tmp_path}/none" in said


@pytest.mark.rule("L5")
def test_insecure_sockets_are_logged_at_each_start(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    tmp_path.chmod(0o755)
    address = f"unixsock-stream/{tmp_path}/agent.sock"
    open_session(settings(agents=(address,)), "router").close()
    assert f'insecure: nobody proves who he is at "{address}"' in caplog.text


@pytest.mark.rule("L5")
@pytest.mark.parametrize(
    ("name", "mode", "sentence"),
    [
        ("worker.key", 0o644, "tls.key: other users can read or change {file}; write chmod 600 {file}"),
        (
            "authority.pem",
            0o666,
            "tls.authority: other users can change {file}, and so decide whom this program trusts",
        ),
    ],
)
def test_files_of_certificates_that_others_can_use_or_change_are_refused(
    tmp_path: Path, name: str, mode: int, sentence: str
) -> None:
    mine = Certificates(tmp_path)
    (tmp_path / name).chmod(mode)
    said = refusal(connect=(f"tls/localhost:{free_port()}",), tls=mine.tls("worker"))
    assert sentence.format(file=tmp_path / name) in said


def test_a_port_that_takes_connections_and_says_nothing_may_be_crowded(
    taken: int, tmp_path: Path, certificates: Certificates
) -> None:
    key = tmp_path / "cell.key"
    key.write_text("x" * 40)
    key.chmod(0o600)
    address = (f"tls/127.0.0.1:{taken}",)
    ways: list[dict[str, Any]] = [{"key": str(key)}, {"tls": certificates.tls("worker")}]
    for way in ways:
        said = refusal(connect=address, **way)
        assert "that port takes connections, but has not answered yet; that computer is busy, or somebody opens" in said


@pytest.mark.rule("L5")
def test_connections_that_say_nothing_keep_nobody_out() -> None:
    """Zenoh itself admits a hundred at a time, and closes a port for others while so many are pending."""
    port = free_port()
    agent = open_session(settings(listen=(f"tcp/127.0.0.1:{port}",)), "router")
    mute = [socket.create_connection(("127.0.0.1", port)) for _ in range(150)]
    try:
        open_session(settings(connect=(f"tcp/127.0.0.1:{port}",)), "client", wait_s=4.0).close()
    finally:
        for one in mute:
            one.close()
        agent.close()

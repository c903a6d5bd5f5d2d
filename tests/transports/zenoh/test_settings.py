"""The settings file: what it says, and everything that is wrong with it, each with its line."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec import structs

from hfg.errors import FileError
from hfg_transports.zenoh import Mode, Settings, read_settings
from hfg_transports.zenoh.config import configuration
from hfg_transports.zenoh.settings import problems_of

WHOLE = """\
realm = "cell-4"
host = "arm"
listen = ["tls/arm.local:7447"]
agents = ["tls/base.local:7447"]
lease_s = 3

[tls]
authority = "keys/authority.pem"
certificate = "keys/arm.pem"
key = "/elsewhere/arm.key"

[access]
write = ["arm", "base"]
read = ["viewer"]
"""


def findings(tmp_path: Path, text: str) -> list[str]:
    file = tmp_path / "hfg.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FileError) as raised:
        read_settings(file)
    return [str(one).removeprefix(f"{tmp_path}/") for one in raised.value.problems]


def test_a_whole_file_is_read_and_its_paths_are_seen_from_its_folder(tmp_path: Path) -> None:
    (tmp_path / "hfg.toml").write_text(WHOLE, encoding="utf-8")
    settings = read_settings(tmp_path / "hfg.toml")
    assert (settings.realm, settings.host, settings.lease_s) == ("cell-4", "arm", 3.0)
    assert settings.tls is not None
    assert settings.access is not None
    assert settings.tls.certificate == str(tmp_path / "keys/arm.pem")
    assert settings.tls.key == "/elsewhere/arm.key"
    assert settings.access.read == ("viewer",)


def test_an_empty_file_is_this_computer_alone(tmp_path: Path) -> None:
    (tmp_path / "hfg.toml").write_text("", encoding="utf-8")
    assert read_settings(tmp_path / "hfg.toml") == Settings()


@pytest.mark.rule("L5")
@pytest.mark.parametrize("mode", ["router", "peer", "client"])
def test_without_settings_nothing_listens_and_nothing_connects(mode: Mode) -> None:
    told = configuration(Settings(), mode, wait_s=1)
    assert told["scouting/multicast/enabled"] is False
    assert told["listen/endpoints"] == told["connect/endpoints"] == []


@pytest.mark.rule("L5")
@pytest.mark.parametrize("mode", ["router", "peer", "client"])
def test_nothing_listens_at_an_address_that_no_setting_names(mode: Mode) -> None:
    one = ("tcp/127.0.0.1:1",)
    for named in (Settings(listen=one), Settings(connect=one), Settings(agents=("tcp/10.0.0.1:1",))):
        settings = structs.replace(named, insecure=True)
        listening = configuration(settings, mode, wait_s=1)["listen/endpoints"]
        assert listening == (list(settings.listen) if mode == "router" else [])


def test_peers_that_meet_listen_beside_the_address_at_which_they_meet() -> None:
    both = ("tcp/127.0.0.1:1", "unixsock-stream//run/cell/meet")
    first, second, *rest = configuration(Settings(meet=both, insecure=True), "peer", wait_s=1)["listen/endpoints"]
    assert first == "tcp/127.0.0.1:0"
    assert second.startswith("unixsock-stream//run/cell/meet-")
    assert rest == list(both)


@pytest.mark.rule("L5")
@pytest.mark.parametrize("options", ["#enable_mtls=false", "#verify_name_on_connect=false", "?rel=1"])
def test_options_of_zenoh_in_an_address_cannot_switch_proofs_off(options: str) -> None:
    (problem,) = problems_of(Settings(listen=(f"tls/127.0.0.1:1{options}",), key="cell.key"))
    assert "could switch off that both ends prove who they are" in problem.what
    assert problem.remedy == 'write "tls/127.0.0.1:1"'


def test_all_findings_come_at_once_with_their_lines(tmp_path: Path) -> None:
    text = """\
reallm = "x"
listen = ["tcp/0.0.0.0:7447", "udp/127.0.0.1:1", "127.0.0.1:7447", "tcp/127.0.0.1", "tls/127.0.0.1:99999"]
agents = "tls/base.local:7447"

lease_s = 600

[tls]
certificate = 3
"""
    assert findings(tmp_path, text) == [
        'hfg.toml:1: "reallm": there is no such key; did you mean "realm"?',
        'hfg.toml:2: "listen": "tcp/0.0.0.0:7447" is open: whoever connects there, other users of the same computer '
        'too, can run code as this user; write "tls/0.0.0.0:7447" with key = ... or [tls], or insecure = true if all '
        "of them are to be trusted",
        'hfg.toml:2: "listen": "udp/127.0.0.1:1": "udp" is not spoken here; take tcp, tls, unixsock-stream',
        'hfg.toml:2: "listen": "127.0.0.1:7447" is no address; write "protocol/host:port", as in tls/arm.local:7447',
        'hfg.toml:2: "listen": "tcp/127.0.0.1" has no host and port; write "tcp/127.0.0.1:7447"',
        'hfg.toml:2: "listen": "tls/127.0.0.1:99999": there is no port 99999; take one below 65536',
        'hfg.toml:3: "agents": expected `array`, got `str`; write agents = ["tls/base.local:7447"]',
        'hfg.toml:5: "lease_s": 600.0 s is no time to wait; take 0.2 to 60',
        'hfg.toml:7: "tls": "authority" is missing; add authority = ...',
        'hfg.toml:7: "tls": "key" is missing; add key = ...',
        'hfg.toml:8: "tls.certificate": expected `str`, got `int`; correct the value',
    ]


TLS = '[tls]\nauthority = "a"\ncertificate = "b"\nkey = "c"\n'


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ('realm = "a/b"', 'hfg.toml:1: "realm": "a/b" is no name; take any text without "/"'),
        ('host = ""', 'hfg.toml:1: "host": "" is no name; take any text without "/"'),
        ("largest_message = 1", 'hfg.toml:1: "largest_message": 1 bytes cannot be kept; take 65536 to 1073741824'),
        ("shared_memory = -1", 'hfg.toml:1: "shared_memory": -1 bytes cannot be had; take 0 for none'),
        (
            'listen = ["tls/localhost:7447"]',
            'hfg.toml:1: "listen": "tls/localhost:7447" needs certificates or a key; add a table [tls] or key = ...; '
            "hfg keys new makes some",
        ),
        (
            '[access]\nwrite = ["arm"]',
            'hfg.toml:1: "access": names are those of certificates, and nobody has to show one; add a table [tls]',
        ),
        (
            f'insecure = true\n{TLS}mutual = false\n[access]\nwrite = ["arm"]',
            'hfg.toml:7: "access": names are those of certificates, and nobody has to show one; '
            "leave out mutual = false in [tls]",
        ),
        (
            f"{TLS}mutual = false",
            'hfg.toml:5: "tls.mutual": whoever connects proves nothing, and can run code as this user; leave it out, '
            "or write insecure = true",
        ),
        (f'key = "cell.key"\n{TLS}', 'hfg.toml:1: "key": there is a table [tls] too; take one of the two'),
        (
            f'listen = ["tls/localhost:1"]\n{TLS}[access]\nwrite = ["arm", ""]\nread = ["arm"]',
            'hfg.toml:7: "access.write": a name is empty; leave it out',
        ),
        (
            f'listen = ["tcp/127.0.0.1:7447"]\ninsecure = true\n{TLS}[access]\nwrite = ["arm"]',
            'hfg.toml:1: "listen": "tcp/127.0.0.1:7447" asks for no certificate, so [access] would refuse all who come '
            'there; write "tls/127.0.0.1:7447"',
        ),
        (
            f'listen = ["tls/localhost:1"]\n{TLS}[access]\nread = ["viewer"]',
            'hfg.toml:6: "access": nobody may write, so nothing could run; add write = ["arm"]',
        ),
        ("realm = ", "hfg.toml:1: it is no TOML: invalid value; correct the line"),
        ("tls = 3", 'hfg.toml:1: "tls": expected `object | null`, got `int`; begin a table with [tls]'),
        ("a = 1\na = 2", "hfg.toml:2: it is no TOML: cannot overwrite a value; correct the line"),
    ],
)
def test_each_finding_says_what_is_wrong_and_what_to_do(tmp_path: Path, text: str, finding: str) -> None:
    assert findings(tmp_path, text)[0] == finding


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"nowhere\.toml: it cannot be read: No such file or directory; name a file"):
        read_settings(tmp_path / "nowhere.toml")
    (tmp_path / "latin.toml").write_bytes(b'host = "\xe4rm"')
    with pytest.raises(FileError, match=r"latin\.toml: it is no UTF-8 at byte 8; save it as UTF-8"):
        read_settings(tmp_path / "latin.toml")


@pytest.mark.rule("L5")
def test_settings_that_other_users_can_change_are_refused(tmp_path: Path) -> None:
    """They could add an address, and insecure = true."""
    file = tmp_path / "hfg.toml"
    file.write_text('realm = "cell"\n')
    file.chmod(0o666)
    with pytest.raises(FileError, match=f"other users can change it, .*; write chmod go-w {file}"):
        read_settings(file)
    file.chmod(0o644)
    assert read_settings(file).realm == "cell"


def test_whoever_says_so_listens_to_everybody() -> None:
    assert not problems_of(Settings(listen=("tcp/0.0.0.0:7447",), insecure=True))


@pytest.mark.parametrize("address", ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tcp/10.0.0.1:7447"])
def test_who_meets_at_an_agent_speaks_through_that(address: str) -> None:
    """Those behind it listen nowhere, so no connection can be made to them."""
    assert configuration(Settings(connect=(address,), insecure=True), "peer", wait_s=1)["mode"] == "client"


def test_who_listens_everywhere_is_reached_from_within_at_loopback() -> None:
    told = configuration(Settings(listen=("tcp/0.0.0.0:7447",), insecure=True), "client", wait_s=1)
    assert told["connect/endpoints"] == ["tcp/127.0.0.1:7447"]

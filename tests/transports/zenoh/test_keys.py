"""A key that all programs of a realm have, instead of certificates (rule L5)."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from hfg.cli import main
from hfg.cli.certificates import make_authority, make_certificate
from hfg.errors import TransportError
from hfg.transport import Traffic
from hfg_transports.zenoh import Tls, ZenohTransport
from tests.transports.zenoh.conftest import Open, free_port, into, put_until, soon

pytestmark = [pytest.mark.rule("L5"), pytest.mark.asyncio]


@pytest.fixture
def key(tmp_path: Path) -> str:
    file = tmp_path / "cell.key"
    assert main(["keys", "secret", str(file)]) == 0
    return str(file)


def state_of(file: str) -> tuple[bytes, int]:
    """Return what is in it, and who may do what with it."""
    return Path(file).read_bytes(), Path(file).stat().st_mode & 0o777


@pytest.fixture
def address() -> str:
    return f"tls/127.0.0.1:{free_port()}"


async def test_who_has_the_key_meets_and_is_answered(open_one: Open, key: str, address: str) -> None:
    agent = await open_one(mode="router", listen=(address,), key=key)
    one, other = [await open_one(mode="client", connect=(address,), key=key) for _ in range(2)]
    came: asyncio.Queue[Any] = asyncio.Queue()
    other.subscribe("a/b", into(came))
    publisher = one.publisher("a/b", Traffic.TOKENS)
    await put_until(lambda: not came.empty(), lambda: publisher.put(b"header", b"payload"))

    async def answer(question: bytes) -> bytes:
        return question + b"!"

    agent.answer("agent", answer)
    assert await soon(one.ask("agent", b"why", timeout_s=10)) == b"why!"


@pytest.mark.parametrize("how", ["another key", "certificates", "nothing"])
async def test_who_has_it_not_gets_nowhere(
    open_one: Open, key: str, address: str, how: str, tmp_path: Path, certificates: Any
) -> None:
    await open_one(mode="router", listen=(address,), key=key)
    proof: dict[str, Any] = {"insecure": True}
    if how == "another key":
        main(["keys", "secret", str(tmp_path / "other.key")])
        proof = {"key": str(tmp_path / "other.key")}
    elif how == "certificates":
        proof = {"tls": certificates.tls("worker")}
    there = address if how != "nothing" else address.replace("tls/", "tcp/")
    with pytest.raises(TransportError, match="cannot connect to"):
        await ZenohTransport().open(mode="client", connect=(there,), wait_s=1.0, **proof)


async def test_who_listens_without_the_key_is_not_believed(
    open_one: Open, key: str, address: str, certificates: Any
) -> None:
    await open_one(mode="router", listen=(address,), tls=certificates.tls("agent"))
    with pytest.raises(TransportError, match="somebody listens there who has not our key"):
        await ZenohTransport().open(mode="client", connect=(address,), wait_s=1.0, key=key)


@pytest.mark.parametrize(
    ("text", "mode", "sentence"),
    [
        ("short", 0o600, "has 5 bytes, and at least 32 are needed; hfg keys secret FILE makes one"),
        ("x" * 64, 0o644, "other users can read or change"),
        ("", None, "cannot be read: No such file or directory"),
    ],
)
async def test_a_key_that_proves_nothing_is_refused(
    tmp_path: Path, address: str, text: str, mode: int | None, sentence: str
) -> None:
    file = tmp_path / "cell.key"
    if mode is not None:
        file.write_text(text)
        file.chmod(mode)
    with pytest.raises(TransportError, match=sentence):
        await ZenohTransport().open(mode="router", listen=(address,), key=str(file))


async def test_a_key_that_another_user_can_replace_is_refused(key: str, address: str) -> None:
    folder = Path(key).parent
    before = folder.stat().st_mode
    folder.chmod(0o777)
    try:
        with pytest.raises(TransportError, match=f"other users can replace what lies in {folder}, and so {key}"):
            await ZenohTransport().open(mode="router", listen=(address,), key=key)
    finally:
        folder.chmod(before & 0o777)


async def test_a_certificate_that_another_user_can_replace_is_refused(tmp_path: Path, address: str) -> None:
    """Zenoh reads the files when it connects, which is after they were looked at."""
    folder = tmp_path / "keys"
    make_authority(folder, days=1)
    make_certificate(folder, "agent", "agent", hosts=["127.0.0.1"], days=1)
    folder.chmod(0o777)
    authority, certificate, own = (str(folder / name) for name in ("authority.pem", "agent.pem", "agent.key"))
    tls = Tls(authority=authority, certificate=certificate, key=own)
    with pytest.raises(TransportError, match=f"tls.authority: other users can replace what lies in {folder}, and so"):
        await ZenohTransport().open(mode="router", listen=(address,), tls=tls)


async def test_a_key_is_never_overwritten(key: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = state_of(key)
    assert main(["keys", "secret", key]) == 2
    assert "cannot be written: File exists" in capsys.readouterr().err
    assert state_of(key) == before
    assert before[1] == 0o600


async def test_to_go_without_a_proof_is_said_at_each_start(open_one: Open, caplog: pytest.LogCaptureFixture) -> None:
    where = f"tcp/127.0.0.1:{free_port()}"
    await open_one(mode="router", listen=(where,), insecure=True)
    await open_one(mode="client", connect=(where,), insecure=True)
    said = [one.getMessage() for one in caplog.records if "insecure" in one.getMessage()]
    assert (
        said
        == [f'insecure: nobody proves who he is at "{where}", so whoever can connect there can run code as this user']
        * 2
    )


async def test_to_take_anybody_without_a_certificate_is_said_at_each_start(
    open_one: Open, caplog: pytest.LogCaptureFixture, address: str, certificates: Any
) -> None:
    tls = certificates.tls("agent", mutual=False)
    for _ in range(2):
        session = await open_one(mode="router", listen=(address,), tls=tls, insecure=True)
        await session.close()
    said = [one.getMessage() for one in caplog.records if "insecure" in one.getMessage()]
    what = "so whoever can connect there can run code as this user"
    assert said == [f'insecure: nobody proves who he is at "{address}", {what}'] * 2


async def test_a_local_socket_in_a_folder_that_others_can_enter_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "open"
    folder.mkdir()
    folder.chmod(0o755)
    with pytest.raises(TransportError, match=f"{folder}, .*, can be entered by others"):
        await ZenohTransport().open(mode="router", listen=(f"unixsock-stream/{folder}/meet",))


async def test_settings_without_an_address_open_nothing() -> None:
    with pytest.raises(TransportError, match="these settings name no address"):
        await ZenohTransport().open()

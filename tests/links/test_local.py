"""Sessions of one user on one computer: places, proofs, frames and connections (docs/links.md)."""

from __future__ import annotations

import asyncio
import os
import random
import socket
import sys
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.errors import TransportError
from hfg.links.local import LocalSession, LocalTransport, connection, place, session, wire
from hfg.links.local.place import NAME_SIZE, Place
from hfg.links.local.proof import CLAIM_SIZE, NONCE_SIZE, Caller, Listener, Refused, Seals
from hfg.links.local.wire import LONG, Frame, Inflow, Kind, frame
from hfg.transport import Message, Traffic
from tests.limits import patience

pytestmark = [pytest.mark.skipif(sys.platform != "linux", reason="the sockets are Linux's"), pytest.mark.rule("L5")]

LARGEST = 8 * 2**20
SECRET = b"s" * 32
A, B = b"a" * NAME_SIZE, b"b" * NAME_SIZE


class Heard:
    """What has come, to be waited for."""

    def __init__(self) -> None:
        self.messages: list[Message] = []
        self._more = asyncio.Event()

    def __call__(self, burst: list[Message]) -> None:
        assert burst
        self.messages += burst
        self._more.set()

    @property
    def headers(self) -> list[bytes]:
        return [bytes(header) for header, _ in self.messages]

    async def wait(self, true: Callable[[], object]) -> None:
        async with asyncio.timeout(patience(20)):
            while not true():
                self._more.clear()
                await self._more.wait()


class Two:
    """Two sessions, one of which hears what the other puts."""

    def __init__(self, here: LocalSession, there: LocalSession) -> None:
        self.here, self.there = here, there
        self.heard = Heard()
        there.subscribe("a key", self.heard)
        self.exact = here.publisher("a key", Traffic.TOKENS)
        self.leaky = here.publisher("a key", Traffic.BULK)

    async def is_known(self) -> None:
        """Wait until the one knows what the other wants."""
        async with asyncio.timeout(patience(20)):
            while not self.exact.wanted:
                await asyncio.sleep(0)


@asynccontextmanager
async def two(folder: Path) -> AsyncIterator[Two]:
    here, there = [await LocalTransport().open(folder=folder, largest_message=LARGEST) for _ in range(2)]
    try:
        both = Two(here, there)
        await both.is_known()
        yield both
    finally:
        await here.close()
        await there.close()


def run(folder: Path, scenario: Callable[[Two], Coroutine[Any, Any, None]]) -> None:
    async def main() -> None:
        async with two(folder / "place") as both:
            await scenario(both)

    asyncio.run(main())


# --- datagrams


@pytest.mark.slow
def test_datagrams_arrive_whole_and_in_order_whatever_their_size(tmp_path: Path) -> None:
    async def scenario(both: Two) -> None:
        source = random.Random(7)
        sizes = [source.choice((0, 1, 100, 60_000, LONG, LONG + 1, LONG + 100, 3 * 2**20)) for _ in range(60)]
        headers = [b"%d" % number + bytes(source.choice((0, 10, 2**17, 2**18))) for number in range(60)]
        values = [source.randbytes(size) for size in sizes]
        for number, (header, value) in enumerate(zip(headers, values, strict=True)):
            both.exact.put(header, value)
            if number % 20 == 19:
                await both.heard.wait(lambda number=number: len(both.heard.messages) > number)  # type: ignore[misc]
        assert both.heard.headers == headers
        assert [bytes(payload) for _, payload in both.heard.messages] == values

    run(tmp_path, scenario)


def test_what_has_come_cannot_be_written_to(tmp_path: Path) -> None:
    async def scenario(both: Two) -> None:
        both.exact.put(b"", bytes(100))
        both.exact.put(b"", memoryview(bytearray(2**20)))
        await both.heard.wait(lambda: len(both.heard.messages) == 2)
        assert all(memoryview(payload).readonly for _, payload in both.heard.messages)

    run(tmp_path, scenario)


def test_what_is_too_many_for_one_that_does_not_read_is_lost_and_never_half(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "_MOST_UNSENT", 2**20)

    async def scenario(both: Two) -> None:
        value = bytes(range(250)) * 400
        for number in range(100):  # 10 MB, and nobody reads before this is over
            both.exact.put(b"%d" % number, value)
        while b"last" not in both.heard.headers:
            both.exact.put(b"last")
            await asyncio.sleep(0)
        came = [int(header) for header in both.heard.headers if header.isdigit()]
        assert came == list(range(len(came)))
        assert 10 <= len(came) < 100
        assert all(bytes(payload) == value for header, payload in both.heard.messages if bytes(header).isdigit())

    run(tmp_path, scenario)


def test_what_may_be_lost_does_not_wait_behind_what_has_not_left(tmp_path: Path) -> None:
    async def scenario(both: Two) -> None:
        for number in range(20):  # nobody reads before this is over
            both.leaky.put(b"%d" % number, bytes(2**17))
        both.leaky.put(b"long", bytes(2**20))
        both.exact.put(b"exact")
        await both.heard.wait(lambda: b"exact" in both.heard.headers)
        assert b"0" in both.heard.headers
        assert not {b"19", b"long"} & set(both.heard.headers)

    run(tmp_path, scenario)


def test_what_was_put_before_the_end_is_still_sent(tmp_path: Path) -> None:
    async def scenario(both: Two) -> None:
        for number in range(5):
            both.exact.put(b"%d" % number, bytes(2**20))  # more than the system takes at once
        await both.here.close()
        await both.heard.wait(lambda: len(both.heard.messages) == 5)

    run(tmp_path, scenario)


def test_the_end_does_not_wait_for_ever_for_one_that_does_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "_CLOSES_S", 0.01)

    async def scenario(both: Two) -> None:
        monkeypatch.setattr(connection.Incoming, "_read", lambda _: None)
        for incoming in [one.incoming for one in both.there._neighbours.values()]:
            assert incoming is not None
            asyncio.get_running_loop().remove_reader(incoming._socket.fileno())
        for number in range(5):
            both.exact.put(b"%d" % number, bytes(2**20))
        await both.here.close()
        assert not both.heard.messages

    run(tmp_path, scenario)


# --- who may come


def test_a_session_that_was_killed_leaves_a_socket_that_the_next_one_removes(tmp_path: Path) -> None:
    async def main() -> None:
        where = Place(tmp_path / "place")
        where.listen(A).close()  # as the end of a process does
        assert where.names() == [A]
        opened = await LocalTransport().open(folder=tmp_path / "place")
        assert A not in where.names()
        await opened.close()
        assert where.names() == []
        where.close()

    asyncio.run(main())


@pytest.mark.parametrize("junk", [b"", b"x" * CLAIM_SIZE, b"\x01" + bytes(CLAIM_SIZE - 1)])
def test_who_does_not_know_the_secret_is_turned_away_and_others_go_on(tmp_path: Path, junk: bytes) -> None:
    async def scenario(both: Two) -> None:
        loop = asyncio.get_running_loop()
        stranger = both.here._place.connect(both.there._name)
        assert stranger is not None
        assert len(await loop.sock_recv(stranger, 1000)) == NONCE_SIZE
        await loop.sock_sendall(stranger, junk)
        if not junk:
            stranger.shutdown(socket.SHUT_WR)
        assert await loop.sock_recv(stranger, 1) == b""
        stranger.close()
        assert both.there.refused == bool(junk)
        both.exact.put(b"1")
        await both.heard.wait(lambda: both.heard.headers == [b"1"])

    run(tmp_path, scenario)


def test_who_knocks_too_often_is_turned_away_at_once_and_no_one_waits_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "GREETS_S", 0.05)

    async def scenario(both: Two) -> None:
        strangers = []
        async with asyncio.timeout(patience(20)):
            while not both.there.refused:
                try:
                    strangers.append(both.here._place.connect(both.there._name))
                except BlockingIOError:  # more wait than the system keeps
                    await asyncio.sleep(0)
        assert both.there._greeted <= session._MOST_GREETED
        async with asyncio.timeout(patience(20)):
            while both.there._greeted:
                await asyncio.sleep(0.01)
        for one in strangers:
            assert one is not None
            one.close()
        both.exact.put(b"1")
        await both.heard.wait(lambda: both.heard.headers == [b"1"])

    run(tmp_path, scenario)


def test_other_users_are_turned_away_before_anything_is_read_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def scenario(both: Two) -> None:
        stranger = both.here._place.connect(both.there._name)
        assert stranger is not None
        with monkeypatch.context() as patch:
            patch.setattr(os, "geteuid", lambda: 12345)
            assert await asyncio.get_running_loop().sock_recv(stranger, 1) == b""  # not even a nonce
            assert both.here._place.connect(both.there._name) is None  # who connects looks as well
        stranger.close()
        assert both.there.refused >= 1

    run(tmp_path, scenario)


def test_a_frame_without_its_seal_ends_the_connection_which_is_made_again(tmp_path: Path) -> None:
    async def scenario(both: Two) -> None:
        (neighbour,) = both.here._neighbours.values()
        assert neighbour.outgoing is not None
        neighbour.outgoing._seals.next(b"")  # one is left out
        both.exact.put(b"lost")
        while b"came" not in both.heard.headers:
            both.exact.put(b"came")
            await asyncio.sleep(0)
        assert b"lost" not in both.heard.headers
        assert both.there.refused == 1

    run(tmp_path, scenario)


# --- places


def test_a_place_is_a_folder_of_this_user_alone(tmp_path: Path) -> None:
    folder = tmp_path / "place"
    Place(folder).close()
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (folder / "secret").stat().st_mode & 0o777 == 0o600
    assert [file.name for file in folder.iterdir()] == ["secret"]
    first, second = Place(folder), Place(folder)
    assert first.secret == second.secret
    first.close()
    second.close()


def test_a_place_that_others_can_enter_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "place"
    folder.mkdir(mode=0o755)
    folder.chmod(0o755)
    with pytest.raises(TransportError, match=f"can be entered by others: write chmod 700 {folder}"):
        Place(folder)


def test_a_place_that_is_a_link_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / "place").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(TransportError, match="cannot be used"):
        Place(tmp_path / "place")
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_place_in_a_folder_in_which_others_can_replace_it_is_refused(tmp_path: Path) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    with pytest.raises(TransportError, match=f"other users can replace folders in {shared}; write chmod go-w"):
        Place(shared / "place")
    shared.chmod(0o1777)  # as /tmp
    Place(shared / "place").close()


def test_a_place_of_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    user = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: user + 1)
    with pytest.raises(TransportError, match=f"belongs to user {user}, and this is user {user + 1}: remove it"):
        Place(tmp_path / "place")


@pytest.mark.parametrize("spoil", ["short", "long", "link", "readable"])
def test_a_secret_that_is_not_ours_is_refused(tmp_path: Path, spoil: str) -> None:
    folder = tmp_path / "place"
    Place(folder).close()
    secret = folder / "secret"
    if spoil == "link":
        secret.rename(tmp_path / "secret")
        secret.symlink_to(tmp_path / "secret")
    elif spoil == "readable":
        secret.chmod(0o644)
    else:
        secret.write_bytes(bytes(31 if spoil == "short" else 33))
    with pytest.raises(TransportError, match="remove it"):
        Place(folder)


def test_a_path_may_be_longer_than_a_socket_s(tmp_path: Path) -> None:
    where = Place(tmp_path / ("x" * 200) / "place")
    listening = where.listen(A)
    connected = where.connect(A)
    assert connected is not None
    for one in (listening, connected, where):
        one.close()


def test_where_nobody_can_be_asked_who_he_is_that_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(TransportError, match="no SO_PEERCRED"):
        Place(tmp_path / "place")


def test_each_user_has_a_folder_for_each_realm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    one, other = place.user_folder("cell-1"), place.user_folder("../../cell-2")
    assert one != other
    assert one.parent == other.parent == tmp_path / "hfg"


# --- proofs and frames, without sockets


def shake(secret: bytes = SECRET, other: bytes = SECRET) -> tuple[Seals, Seals]:
    listener, caller = Listener(secret, B), Caller(other, A, B)
    name, proof, theirs = listener.check(caller.claim(listener.nonce))
    assert name == A
    return caller.check(proof), theirs


def test_both_ends_prove_that_they_have_the_secret() -> None:
    ours, theirs = shake()
    assert [ours.next(b"x") for _ in range(3)] == [theirs.next(b"x") for _ in range(3)]
    assert ours.next(b"x") != theirs.next(b"y")
    with pytest.raises(Refused):
        shake(other=b"x" * 32)


def test_a_claim_is_of_no_use_a_second_time_or_to_anybody_else() -> None:
    listener, caller = Listener(SECRET, B), Caller(SECRET, A, B)
    claim = caller.claim(listener.nonce)
    for other in (Listener(SECRET, B), Listener(SECRET, A)):
        with pytest.raises(Refused, match="secret"):
            other.check(claim)
    _, proof, _ = listener.check(claim)
    again = Caller(SECRET, A, B)
    again.claim(listener.nonce)
    with pytest.raises(Refused):
        again.check(proof)
    with pytest.raises(Refused, match="version 2"):
        listener.check(b"\x02" + claim[1:])


def test_a_listener_cannot_send_a_caller_his_own_proof_back() -> None:
    caller = Caller(SECRET, A, B)
    claim = caller.claim(bytes(NONCE_SIZE))
    with pytest.raises(Refused):
        caller.check(claim[-32:])


FRAMES = st.tuples(
    st.sampled_from(Kind),
    st.binary(max_size=20),
    st.binary(max_size=50),
    st.one_of(st.binary(max_size=300), st.sampled_from([LONG - 1, LONG, LONG + 1, LONG + 1000]).map(bytes)),
)


def as_bytes(frames: list[Any], seals: Seals) -> bytes:
    return b"".join(b"".join(map(bytes, frame(seals, *one))) for one in frames)


def feed(inflow: Inflow, data: bytes, sizes: random.Random) -> list[Frame]:
    """Give it in pieces of any size, as a socket does."""
    found, rest = [], memoryview(data)
    while rest:
        room = inflow.room
        piece = rest[: min(len(room), sizes.choice((1, 7, 100, 10_000, 10**6)))]
        room[: len(piece)] = piece
        found += inflow.take(len(piece))
        rest = rest[len(piece) :]
    return found


@pytest.mark.slow
@given(st.lists(FRAMES, max_size=8), st.integers(0, 2**32))
def test_frames_come_out_as_they_went_in_whatever_the_pieces(frames: list[Any], seed: int) -> None:
    found = feed(Inflow(Seals(SECRET), LARGEST), as_bytes(frames, Seals(SECRET)), random.Random(seed))
    assert [(kind, key, header, bytes(payload)) for kind, key, header, payload in found] == frames


@pytest.mark.slow
@given(st.lists(FRAMES, min_size=2, max_size=4, unique=True), st.sampled_from(["drop", "repeat", "swap", "other key"]))
def test_frames_that_are_left_out_repeated_exchanged_or_of_another_connection_are_refused(
    frames: list[Any], how: str
) -> None:
    seals = Seals(SECRET if how != "other key" else b"x" * 32)
    pieces = [as_bytes([one], seals) for one in frames]
    told = {
        "drop": pieces[1:],
        "repeat": [pieces[0], pieces[0]],
        "swap": [pieces[1], pieces[0]],
        "other key": pieces,
    }[how]
    with pytest.raises(Refused, match="wrong seal"):
        feed(Inflow(Seals(SECRET), LARGEST), b"".join(told), random.Random(1))


def fuzz(rounds: int, seed: int) -> int:
    """Change bytes of good frames; returns how many streams were refused. None may raise anything else."""
    source, refused = random.Random(seed), 0
    kinds = list(Kind)
    for _ in range(rounds):
        frames = [
            (source.choice(kinds), source.randbytes(3), source.randbytes(source.choice((0, 9))), source.randbytes(20))
            for _ in range(source.randrange(1, 4))
        ]
        data = bytearray(as_bytes(frames, Seals(SECRET)))
        for _ in range(source.randrange(1, 4)):
            at = source.randrange(len(data))
            match source.randrange(4):
                case 0:
                    data[at] ^= 1 << source.randrange(8)
                case 1:
                    data[at : at + 4] = source.randbytes(4)
                case 2:
                    del data[at:]
                case _:
                    data[at:at] = source.choice((b"\xff\xff\xff\xff", bytes(7), source.randbytes(11)))
            if not data:
                data = bytearray(b"\0")
        inflow = Inflow(Seals(SECRET), LARGEST)
        try:
            found = feed(inflow, bytes(data), source)
            assert [tuple(one) for one in found] == frames[: len(found)], "a forged frame was believed"
        except Refused:
            refused += 1
    return refused


def test_what_is_not_a_frame_is_refused_and_nothing_forged_is_believed() -> None:
    assert fuzz(2_000, 1) > 1_000


@pytest.mark.soak
@pytest.mark.timeout(0)
def test_a_million_forged_streams_of_frames() -> None:
    assert fuzz(1_000_000, random.SystemRandom().getrandbits(32)) > 500_000


def test_a_frame_that_would_be_too_long_is_refused_before_it_has_come() -> None:
    ours, theirs = Seals(SECRET), Seals(SECRET)
    for inflow, head in (
        (Inflow(theirs, LARGEST), wire._HEAD.pack(0, 1, 0, LARGEST + 1)),
        (Inflow(theirs, LARGEST), wire._HEAD.pack(0, 1, 2**31, 0)),
        (Inflow(theirs, LARGEST), wire._HEAD.pack(0, 2**16 - 1, 0, 0)),
        (Inflow(theirs, LARGEST), wire._HEAD.pack(99, 1, 0, 0)),
    ):
        with pytest.raises(Refused, match="not a frame"):
            feed(inflow, head + ours.next(head), random.Random(1))

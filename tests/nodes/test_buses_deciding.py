"""What a connection decides, what a message is, and which parameters look like a secret: plain code, without a loop."""

from __future__ import annotations

import ssl
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.nodes import buses
from hfg.nodes.buses._failures import Lost, Refused, explained, printable
from hfg.nodes.buses._forms import BadMessage, Splitter, framed, from_bytes, to_bytes
from hfg.nodes.buses._life import Life
from hfg.nodes.buses._secrets import secret_of


def life(attempts: int = 0) -> Life:
    made = Life(0.1, 10.0, attempts, "seed")
    made.connect()
    return made


def pauses(one: Life, count: int) -> list[float]:
    found = []
    for _ in range(count):
        retry = one.lose("away", 0.0)
        assert retry.pause_s is not None
        found.append(retry.pause_s)
        one.connect()
    return found


def test_pauses_double_up_to_the_longest_and_a_part_of_each_is_drawn() -> None:
    found = pauses(life(), 10)
    for number, pause_s in enumerate(found):
        most = min(10.0, 0.1 * 2**number)
        assert 0.75 * most <= pause_s <= most


def test_two_clients_do_not_return_in_the_same_moment() -> None:
    others = Life(0.1, 10.0, 0, "another")
    others.connect()
    assert pauses(life(), 3) != pauses(others, 3)


def test_a_connection_that_lasted_begins_with_the_first_pause_again() -> None:
    one = life()
    pauses(one, 5)
    one.open(100.0)
    retry = one.lose("away", 200.0)
    assert retry.pause_s is not None
    assert retry.pause_s <= 0.1


def test_a_server_that_hangs_up_at_once_is_not_asked_faster_and_faster() -> None:
    one = life()
    for round_ in range(8):
        one.open(float(round_))
        pause_s = one.lose("hung up", float(round_)).pause_s
        one.connect()
    assert pause_s is not None
    assert pause_s > 5.0


def test_it_gives_up_after_so_many_attempts_in_a_row() -> None:
    one = life(attempts=3)
    pauses(one, 2)
    assert one.lose("away", 0.0).pause_s is None
    assert one.phase == "over"


def test_a_reason_is_news_once_and_again_after_the_connection_was_open() -> None:
    one, told = life(), []
    for why in ("away", "away", "wrong", "wrong"):
        told.append(one.lose(why, 0.0).is_news)
        one.connect()
    one.open(1.0)
    told.append(one.lose("wrong", 2.0).is_news)
    assert told == [True, False, True, False, True]


@given(st.lists(st.binary(max_size=30)), st.integers(1, 9))
def test_lines_are_the_same_however_the_stream_is_cut(parts: list[bytes], most: int) -> None:
    whole, cut = Splitter("lines", most), Splitter("lines", most)
    stream = b"".join(parts)
    expected = whole.feed(stream) + whole.finish()
    found = [line for part in parts for line in cut.feed(part)] + cut.finish()
    assert found == expected
    assert cut.too_long == whole.too_long
    assert all(len(line) <= most for line in found)


def test_a_line_that_never_ends_is_held_in_bounded_memory_and_the_next_one_is_heard() -> None:
    splitter = Splitter("lines", 10)
    for _ in range(1000):
        assert splitter.feed(b"x" * 1000) == []
    assert len(splitter._rest) <= 10
    assert splitter.feed(b"\nwell\r\n") == [b"well"]
    assert splitter.too_long == 1


def test_messages_are_read_back_as_they_were() -> None:
    assert from_bytes(to_bytes("grün", "text"), "text") == "grün"
    assert from_bytes(to_bytes({"a": [1, None]}, "json"), "json") == {"a": [1, None]}
    assert from_bytes(to_bytes(bytearray(b"\0"), "bytes"), "bytes") == b"\0"


def test_a_message_of_another_form_is_refused_with_what_to_do() -> None:
    with pytest.raises(TypeError, match='a message is str, got int; convert it, or set the parameter "form"'):
        to_bytes(3, "text")
    with pytest.raises(BadMessage, match="a message of 2 bytes is not UTF-8"):
        from_bytes(b"\xff\xff", "text")
    with pytest.raises(BadMessage, match="is not JSON"):
        from_bytes(b"[" * 100_000, "json")
    with pytest.raises(ValueError, match="an end of a line cannot be sent as a line"):
        framed(b"a\nb", "lines")


# --- secrets ---


@pytest.mark.rule("L5")
@pytest.mark.parametrize(
    ("type_", "parameters"),
    [
        (buses.MqttPublish, {"secret": "hunter2"}),
        (buses.MqttPublish, {"broker": "mqtt://me:hunter2@host"}),
        (buses.HttpClient, {"url": "https://host/?access_token=hunter2"}),
        (buses.HttpClient, {"headers": {"Authorization": "hunter2"}}),
        (buses.WebSocketClient, {"headers": {"X-Api-Key": "hunter2"}}),
        (buses.Subprocess, {"environment": {"DB_PASSWORD": "hunter2"}}),
    ],
)
def test_what_looks_like_a_secret_is_refused_where_the_node_is_made(type_: type, parameters: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="never part of a graph"):
        type_(**parameters)


@pytest.mark.rule("L5")
def test_a_secret_comes_from_the_environment_or_a_file_of_this_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BROKER", "hunter2")
    file = tmp_path / "secret"
    file.write_text("hunter3\n")
    file.chmod(0o600)
    assert [secret_of(one) for one in ("", "env:BROKER", f"file:{file}")] == ["", "hunter2", "hunter3"]
    file.chmod(0o644)
    with pytest.raises(Refused, match="other users can read or change .*chmod 600"):
        secret_of(f"file:{file}")
    with pytest.raises(Refused, match="the environment has no secret NOTHING"):
        secret_of("env:NOTHING")


# --- failures ---


def test_failures_are_sentences_and_say_whether_another_attempt_helps() -> None:
    assert isinstance(explained(ConnectionRefusedError(111, "")), Lost)
    assert "nothing listens there" in str(explained(ConnectionRefusedError(111, "")))
    assert "in use" in str(explained(OSError(98, "")))
    assert isinstance(explained(PermissionError(13, "")), Refused)
    expired = ssl.SSLCertVerificationError(1, "")
    expired.verify_message = "certificate has expired"
    assert isinstance(explained(expired), Refused)
    assert "certificate has expired" in str(explained(expired))


def test_an_error_of_a_library_is_explained_by_that_of_the_system_below_it() -> None:
    error = RuntimeError("All attempts failed")
    error.__cause__ = ConnectionRefusedError(111, "")
    assert "nothing listens there" in str(explained(error))


def test_what_the_other_side_says_cannot_steer_a_terminal() -> None:
    assert printable("a\x1b[2Jb\n") == "a?[2Jb?"
    assert len(printable("x" * 10_000)) == 300

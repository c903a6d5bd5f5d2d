"""The two ends of an exact link, step by step: what each says when, and what it refuses."""

from __future__ import annotations

import random
from typing import Any

import msgspec
import pytest

from hfg.errors import MessageTooLarge, UsageError
from hfg.links import ExactConsumer, ExactProducer, Outbox, Outgoing
from hfg.links.frames import Probe, Status, Tokens, read_from_consumer, read_from_producer, write
from hfg.transport import Position

FAR = 2**62


def deliver(out: list[Outgoing], end: ExactProducer | ExactConsumer) -> None:
    for one in out:
        end.receive(one.header, one.payload)


def settle(producer: ExactProducer, *consumers: ExactConsumer, now: float = 0.0) -> int:
    """Let both sides speak until they are silent; gives how many datagrams that took."""
    count = 0
    while True:
        down = producer.flush(now)
        for one in down:
            for consumer in consumers:
                if one.to in (None, consumer.name):
                    consumer.receive(one.header, one.payload)
        up = [one for consumer in consumers for one in consumer.flush()]
        deliver(up, producer)
        if not down and not up:
            return count
        count += len(down) + len(up)
        assert count < 100, "they do not come to rest"


def pair(**options: Any) -> tuple[ExactProducer, ExactConsumer]:
    """A producer and its consumer "a" that have met."""
    producer, consumer = ExactProducer(1, **options), ExactConsumer("a", 2, capacity=options.get("window", 8) + 8)
    producer.admit("a")
    settle(producer, consumer)
    return producer, consumer


def token(text: str) -> tuple[bytes, bytes]:
    return b"", text.encode()


def values(consumer: ExactConsumer) -> list[str]:
    return [bytes(one.value).decode() for one in consumer.take_all()]


@pytest.mark.rule("L1")
def test_a_full_window_makes_the_producer_wait_until_a_token_is_done() -> None:
    producer, consumer = pair(window=2)
    producer.send(token("x"))
    producer.send(token("y"))
    settle(producer, consumer)
    assert not producer.free
    with pytest.raises(UsageError, match="the window of 2 tokens is full"):
        producer.send(token("z"))
    assert values(consumer) == ["x", "y"]
    assert not producer.free
    consumer.done()
    settle(producer, consumer)
    assert producer.free
    assert producer.released == 1


@pytest.mark.rule("L1")
def test_into_a_slot_the_output_is_free_when_the_token_is_accepted_and_the_token_is_kept_until_it_is_done() -> None:
    producer, consumer = pair(window=1, release="accepted", depth=2)
    for text in "xyz":
        producer.send(token(text))
        settle(producer, consumer)
    assert producer.unfinished == 3
    assert producer.released == 3
    assert not producer.free, "three are all that one window and a depth of two keep"
    values(consumer)
    consumer.done(3)
    settle(producer, consumer)
    assert producer.unfinished == 0


def test_tokens_of_one_turn_go_in_one_datagram() -> None:
    producer, consumer = pair(window=64)
    for number in range(64):
        producer.send((b"m%d" % number, b"v%d" % number))
    (one,) = producer.flush(0.0)
    consumer.receive(one.header, one.payload)
    taken = consumer.take_all()
    assert [tuple(one.token) for one in taken] == [(b"m%d" % number, b"v%d" % number) for number in range(64)]
    consumer.done(64)
    assert len(consumer.flush()) == 1


def test_a_large_value_goes_alone_and_is_not_copied() -> None:
    producer, consumer = pair(largest_batch=100)
    large = bytearray(1000)
    for value in (b"small", large, b"a", b"b"):
        producer.send((b"", value))
    out = producer.flush(0.0)
    assert [len(read_from_producer(one.header).metadata) for one in out] == [1, 1, 2]  # type: ignore[union-attr]
    assert out[1].payload is large
    deliver(out, consumer)
    assert [bytes(one.value) for one in consumer.take_all()] == [b"small", bytes(large), b"a", b"b"]


def test_a_value_that_no_datagram_holds_is_refused_before_anything_is_sent() -> None:
    producer, consumer = pair(largest_token=10)
    with pytest.raises(MessageTooLarge, match="a token of 11 bytes and 0 of metadata cannot be sent: the"):
        producer.send((b"", b"x" * 11))
    with pytest.raises(MessageTooLarge, match="a token of 1 bytes and 5000 of metadata cannot be sent"):
        producer.send((b"m" * 5000, b"x"))
    assert settle(producer, consumer) == 0


def test_a_view_of_numbers_is_sent_as_its_bytes() -> None:
    producer, consumer = pair()
    producer.send((b"", memoryview(b"abcdefgh").cast("I")))
    settle(producer, consumer)
    assert values(consumer) == ["abcdefgh"]


@pytest.mark.rule("L2")
def test_what_is_lost_is_sent_again_when_a_later_datagram_shows_it() -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    producer.flush(0.0)  # lost
    producer.send(token("y"))
    settle(producer, consumer)
    assert values(consumer) == ["x", "y"]
    assert producer.counts.resent == 2
    assert consumer.counts.early == 1


@pytest.mark.rule("L2", "L3")
def test_what_is_lost_last_is_sent_again_when_a_probe_shows_it() -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    producer.flush(0.0)  # lost
    assert settle(producer, consumer, now=0.05) == 0, "it is not yet time to be impatient"
    assert producer.due == pytest.approx(0.1)
    settle(producer, consumer, now=0.1)
    assert values(consumer) == ["x"]


@pytest.mark.rule("L2")
def test_nothing_is_sent_twice_to_a_consumer_that_is_only_slow() -> None:
    producer, consumer = pair()
    for text in "xyz":
        producer.send(token(text))
    settle(producer, consumer)
    for seconds in range(100):
        settle(producer, consumer, now=float(seconds))
    assert producer.counts.resent == 0
    assert values(consumer) == ["x", "y", "z"]


@pytest.mark.rule("L3")
def test_an_absent_consumer_is_probed_less_and_less_often_and_never_sent_a_token() -> None:
    producer = ExactProducer(1, probe_s=0.1, slowest_probe_s=0.5)
    producer.admit("a")
    producer.send(token("x"))
    now, sent = 0.0, []
    while now < 60.0:
        sent += producer.flush(now)
        now = producer.due or 60.0
    assert len(sent) < 60 / 0.5 + 5
    assert all(type(read_from_producer(one.header)) is Probe for one in sent)


@pytest.mark.rule("L3")
def test_who_is_heard_again_after_a_silence_is_soon_asked_again_though_it_says_nothing_new() -> None:
    producer, consumer = pair(probe_s=0.1, slowest_probe_s=0.4)
    producer.send(token("x"))
    settle(producer, consumer)
    waits = [producer.due or 0.0]
    for _ in range(3):  # it is cut off, and is slow with what it has
        producer.flush(waits[-1])
        waits.append(producer.due or 0.0)
    assert waits == pytest.approx([0.1, 0.3, 0.7, 1.1])
    settle(producer, consumer, now=waits[-1])
    assert producer.due == pytest.approx(1.2)
    settle(producer, consumer, now=producer.due or 0.0)
    assert producer.due == pytest.approx(1.4), "it answers, so it is there and slow"


@pytest.mark.rule("L3")
def test_nobody_speaks_while_nothing_is_to_be_done() -> None:
    producer, consumer = pair()
    assert producer.due is None
    assert settle(producer, consumer, now=1e6) == 0


@pytest.mark.rule("L2")
def test_a_consumer_that_returns_goes_on_behind_its_ledger() -> None:
    producer, consumer = pair()
    for text in "xyz":
        producer.send(token(text))
    settle(producer, consumer)
    consumer.take()
    returned = ExactConsumer("a", 3, ledger=Position(1, 1))
    settle(producer, returned)
    assert values(returned) == ["y", "z"]
    assert producer.counts.restarts == 1
    assert returned.counts.missed == 0


@pytest.mark.rule("L2")
def test_a_ledger_that_is_behind_its_own_word_is_told_and_counted() -> None:
    producer, consumer = pair()
    for text in "xyz":
        producer.send(token(text))
    settle(producer, consumer)
    values(consumer)
    consumer.done(2)
    settle(producer, consumer)
    returned = ExactConsumer("a", 3, ledger=Position(1, 1))
    settle(producer, returned)
    assert values(returned) == ["z"]
    assert returned.counts.missed == 1


@pytest.mark.rule("L2")
def test_a_former_life_of_the_consumer_is_not_believed() -> None:
    producer, zombie = pair()
    producer.send(token("x"))
    settle(producer, zombie)
    heir = ExactConsumer("a", 3)
    settle(producer, heir)
    zombie.take()
    zombie.done()
    deliver(zombie.flush(), producer)
    assert producer.unfinished == 1
    assert producer.counts.stale == 1
    assert values(heir) == ["x"]
    settle(producer, heir, zombie, now=1.0)
    assert zombie.newer_incarnation == 3, "it can know that it is to leave"


@pytest.mark.rule("L2")
def test_only_the_expected_life_of_a_consumer_is_believed_if_somebody_knows_it() -> None:
    producer = ExactProducer(1)
    producer.admit("a", 7)
    producer.send(token("x"))
    forged, true = ExactConsumer("a", 99), ExactConsumer("a", 7)
    settle(producer, forged, true)
    assert producer.counts.stale >= 1
    assert forged.waiting == 0
    assert values(true) == ["x"]


@pytest.mark.rule("L2")
def test_a_producer_that_returns_begins_a_new_stream_and_its_former_life_is_fenced() -> None:
    zombie, consumer = pair()
    zombie.send(token("old 1"))
    settle(zombie, consumer)
    zombie.send(token("old 2"))
    heir = ExactProducer(5)
    heir.admit("a")
    heir.send(token("new 1"))
    settle(heir, consumer)
    settle(zombie, consumer)
    assert values(consumer) == ["old 1", "new 1"], "what had arrived of the old stream comes first"
    assert consumer.counts.streams == 1
    assert consumer.counts.stale == 1
    consumer.done(2)
    out = consumer.flush()
    deliver(out, zombie)
    deliver(out, heir)
    assert zombie.newer_epoch == 5
    assert zombie.unfinished == 2
    assert heir.unfinished == 0


@pytest.mark.rule("L2")
def test_what_is_known_to_be_gone_with_a_producer_is_counted() -> None:
    first, consumer = pair()
    first.send(token("x"))
    first.send(token("y"))
    first.flush(0.0)  # lost
    deliver(first.flush(1.0), consumer)  # a probe
    heir = ExactProducer(5)
    heir.admit("a")
    settle(heir, consumer)
    assert consumer.counts.abandoned == 2


@pytest.mark.rule("L2")
def test_with_an_outbox_a_producer_that_returns_loses_nothing_and_repeats_nothing() -> None:
    first, consumer = pair()
    for text in "xy":
        first.send(token(text))
    settle(first, consumer)
    heir = ExactProducer(5, outbox=Outbox(1, 1, (token("x"), token("y"), token("z"))))
    heir.admit("a", after=0)
    settle(heir, consumer)
    assert values(consumer) == ["x", "y", "z"]
    assert consumer.counts.streams == 0


@pytest.mark.rule("L2")
def test_one_put_reaches_all_consumers_and_the_slowest_frees_the_output() -> None:
    producer, near, far = ExactProducer(1, window=1), ExactConsumer("near", 1), ExactConsumer("far", 1)
    producer.admit("near")
    producer.admit("far")
    settle(producer, near, far)
    producer.send(token("x"))
    out = producer.flush(0.0)
    assert [one.to for one in out] == [None]
    for one in (near, far):
        deliver(out, one)
        assert values(one) == ["x"]
    near.done()
    deliver(near.flush(), producer)
    assert not producer.free
    far.done()
    deliver(far.flush(), producer)
    assert producer.free


@pytest.mark.rule("L2")
def test_who_joins_late_gets_what_is_sent_from_then_on() -> None:
    producer, near = pair()
    producer.send(token("x"))
    settle(producer, near)
    late = ExactConsumer("late", 1)
    producer.admit("late")
    producer.send(token("y"))
    settle(producer, near, late)
    assert values(late) == ["y"]
    assert values(near) == ["x", "y"]


def test_who_is_dismissed_holds_nobody_up() -> None:
    producer, _ = pair(window=1)
    producer.send(token("x"))
    producer.dismiss("a")
    assert producer.free
    assert producer.counts.given_up == 1


def test_an_output_without_consumers_is_always_free() -> None:
    producer = ExactProducer(1, window=1)
    for _ in range(5):
        producer.send(token("x"))
    assert producer.released == 5


@pytest.mark.rule("L2")
def test_a_relay_that_returns_without_memory_repeats_what_the_next_one_knows() -> None:
    sink = ExactConsumer("sink", 1)
    former = ExactProducer(2, inherits=True)
    former.admit("sink")
    for number in range(1, 4):
        former.send(token(str(number)), Position(1, number))
    settle(former, sink)
    assert values(sink) == ["1", "2", "3"]
    sink.done(2)
    heir = ExactProducer(3, inherits=True)
    heir.admit("sink")
    for number in range(2, 5):
        heir.send(token(str(number)), Position(1, number))
    settle(heir, sink)
    assert values(sink) == ["4"]
    assert heir.released == 2
    sink.done(2)
    settle(heir, sink)
    assert heir.unfinished == 0


def test_a_relay_knows_what_it_has_sent_before() -> None:
    producer = ExactProducer(2, inherits=True)
    producer.admit("sink")
    producer.send(token("1"), Position(1, 1))
    assert producer.takes(Position(1, 1))
    producer.send(token("1"), Position(1, 1))
    assert producer.unfinished == 1
    assert producer.counts.repeated == 1


def test_numbers_that_jump_wait_until_all_before_is_done() -> None:
    producer, sink = ExactProducer(2, inherits=True), ExactConsumer("sink", 1)
    producer.admit("sink")
    producer.send(token("1"), Position(1, 1))
    settle(producer, sink)
    assert not producer.takes(Position(5, 1))
    with pytest.raises(UsageError, match=r"numbers jump from \(1, 2\) to \(5, 1\)"):
        producer.send(token("1"), Position(5, 1))
    values(sink)
    sink.done()
    settle(producer, sink)
    assert producer.takes(Position(5, 1))
    producer.send(token("1 again"), Position(5, 1))
    settle(producer, sink)
    assert values(sink) == ["1 again"]


@pytest.mark.rule("L2")
def test_a_relay_whose_stream_is_over_elsewhere_does_not_wait_for_ever() -> None:
    sink = ExactConsumer("sink", 1, ledger=Position(9, 4))
    relay = ExactProducer(3, inherits=True)
    relay.admit("sink")
    relay.send(token("old"), Position(1, 1))
    settle(relay, sink)
    assert relay.unfinished == 0
    assert relay.counts.superseded == 1
    relay.send(token("new"), Position(9, 5))
    settle(relay, sink)
    assert values(sink) == ["new"]


@pytest.mark.rule("L1")
def test_a_consumer_has_no_more_than_its_capacity_whatever_the_producer_thinks() -> None:
    producer, consumer = ExactProducer(1, window=10), ExactConsumer("a", 1, capacity=3)
    producer.admit("a")
    settle(producer, consumer)
    for number in range(10):
        producer.send(token(str(number)))
    got: list[str] = []
    while len(got) < 10:
        settle(producer, consumer)
        assert consumer.unfinished <= 3
        batch = values(consumer)
        assert batch
        got += batch
        consumer.done(len(batch))
    assert got == [str(number) for number in range(10)]
    assert producer.counts.resent == 0, "credits kept it from sending what there was no room for"


@pytest.mark.rule("L1")
def test_a_consumer_accepts_no_more_than_its_capacity_of_a_producer_that_heeds_no_credits() -> None:
    producer, consumer = ExactProducer(1), ExactConsumer("a", 2, capacity=3)
    producer.admit("a")
    settle(producer, consumer)
    consumer.receive(write(Tokens(1, 1, 1, 1, [b""] * 2)), msgspec.msgpack.encode([b"1", b"2"]))
    assert values(consumer) == ["1", "2"]
    consumer.receive(write(Tokens(1, 1, 3, 2, [b""] * 3)), msgspec.msgpack.encode([b"3", b"4", b"5"]))
    assert values(consumer) == ["3"]
    assert consumer.counts.overrun == 2


def test_a_life_of_a_producer_ends_without_a_word_and_the_next_goes_on() -> None:
    producer, consumer = pair()
    assert producer.close() == []
    heir = ExactProducer(3)
    heir.admit("a")
    settle(heir, consumer)
    deliver(heir.close(over=True), consumer)
    assert consumer.closed
    another = ExactProducer(4)
    another.admit("a")
    settle(another, consumer)
    assert not consumer.closed, "it was not over after all"


def test_a_consumer_is_told_when_the_link_is_over() -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    settle(producer, consumer)
    deliver(producer.close(over=True), consumer)
    assert consumer.closed
    assert producer.counts.given_up == 1
    assert producer.close() == []
    assert producer.flush(100.0) == []
    assert producer.due is None
    with pytest.raises(UsageError, match="the link is closed"):
        producer.send(token("y"))


@pytest.mark.parametrize(
    "make",
    [
        lambda: ExactProducer(0),
        lambda: ExactProducer(1, window=0),
        lambda: ExactProducer(1, depth=-1),
        lambda: ExactConsumer("a", 0),
        lambda: ExactConsumer("a", 1, capacity=0),
    ],
)
def test_numbers_that_cannot_be_are_refused(make: Any) -> None:
    with pytest.raises(UsageError, match="a link needs"):
        make()


def test_a_name_that_no_frame_can_say_is_refused() -> None:
    for name in ("", "a" * 513):
        with pytest.raises(UsageError, match="a consumer's name has 1 to 512 characters"):
            ExactProducer(1).admit(name)
        with pytest.raises(UsageError, match="a consumer's name has 1 to 512 characters"):
            ExactConsumer(name, 1)


def test_more_cannot_be_done_than_was_taken() -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    settle(producer, consumer)
    with pytest.raises(UsageError, match="1 tokens cannot be done, 0 have been taken and are not"):
        consumer.done()


@pytest.mark.rule("L2")
def test_a_datagram_that_is_still_on_its_way_is_not_sent_again() -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    settle(producer, consumer)
    values(consumer)
    producer.send(token("y"))
    on_its_way = producer.flush(0.0)
    consumer.done()
    deliver(consumer.flush(), producer)  # knows nothing of y, nor of what it came in
    assert producer.flush(0.0) == []
    deliver(on_its_way, consumer)
    assert values(consumer) == ["y"]
    assert producer.counts.resent == 0


@pytest.mark.rule("L2")
def test_a_repetition_is_answered_at_once_since_its_word_may_be_lost() -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    out = producer.flush(0.0)
    deliver(out, consumer)
    values(consumer)
    consumer.done()
    consumer.flush()  # lost
    deliver(out, consumer)
    deliver(consumer.flush(), producer)
    assert producer.unfinished == 0
    assert consumer.counts.repeated == 1


@pytest.mark.rule("L2")
def test_what_a_zombie_adds_to_a_stream_that_its_heir_carries_on_is_refused() -> None:
    zombie, consumer = pair()
    zombie.send(token("x"))
    settle(zombie, consumer)
    heir = ExactProducer(5, outbox=Outbox(1, 1, (token("x"),)))
    heir.admit("a", after=0)
    settle(heir, consumer)
    zombie.send(token("forged y"))
    settle(zombie, consumer)
    heir.send(token("y"))
    settle(heir, consumer)
    assert values(consumer) == ["x", "y"]


@pytest.mark.rule("L2")
@pytest.mark.parametrize(("epoch", "stream"), [(1, 1), (1, 5), (5, 1), (5, 4), (0, 9)])
def test_a_probe_of_a_former_life_or_stream_moves_nobody(epoch: int, stream: int) -> None:
    _, consumer = pair()
    heir = ExactProducer(5)
    heir.admit("a")
    heir.send(token("x"))
    settle(heir, consumer)
    consumer.receive(write(Probe("a", 2, epoch, stream, 70, 80, 9, False, False)))
    heir.send(token("y"))
    settle(heir, consumer)
    assert values(consumer) == ["x", "y"]
    assert consumer.counts.stale == 1


@pytest.mark.rule("L2")
def test_what_was_seen_of_a_former_life_proves_nothing_to_a_new_one() -> None:
    producer, consumer = pair()
    for now in range(50):
        producer.send(token("x"))
        settle(producer, consumer, now=float(now))
        values(consumer)
        consumer.done()
        settle(producer, consumer, now=float(now))
    heir = ExactProducer(5)
    heir.admit("a")
    settle(heir, consumer)
    (one,) = [one for one in _statuses(heir, consumer) if one.epoch == 5]
    assert one.seen < 5


def _statuses(producer: ExactProducer, consumer: ExactConsumer) -> list[Status]:
    producer.send(token("x"))
    deliver(producer.flush(0.0), consumer)
    values(consumer)
    consumer.done()
    return [read_from_consumer(one.header) for one in consumer.flush()]


# --- what is hostile


def status(**changes: Any) -> bytes:
    fields: dict[str, Any] = {
        "consumer": "a",
        "incarnation": 2,
        "epoch": 1,
        "stream": 1,
        "accepted": 0,
        "done": 0,
        "limit": 8,
        "seen": 0,
    }
    return write(Status(**(fields | changes)))


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("changes", "count"),
    [
        ({"accepted": 5, "done": 5}, "refused"),
        ({"accepted": 0, "done": 1}, "refused"),
        ({"accepted": 1, "limit": 0}, "refused"),
        ({"stream": 7}, "refused"),
        ({"consumer": "b"}, "strangers"),
        ({"incarnation": 1}, "stale"),
        ({"incarnation": 0}, "stale"),
        ({"epoch": FAR}, "fenced"),
        ({"epoch": 0, "stream": 0}, "late"),
    ],
)
def test_a_producer_frees_nothing_for_a_status_that_cannot_be(changes: dict[str, Any], count: str) -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    producer.receive(status(**changes))
    assert getattr(producer.counts, count) == 1
    assert producer.unfinished == 1
    settle(producer, consumer)
    assert values(consumer) == ["x"]


@pytest.mark.rule("L4")
def test_a_producer_believes_no_serial_number_that_it_never_gave() -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    producer.receive(status(seen=FAR))
    settle(producer, consumer)
    assert values(consumer) == ["x"]


@pytest.mark.rule("L4")
def test_another_version_is_told_apart_from_garbage() -> None:
    producer, consumer = pair()
    for end in (producer, consumer):
        end.receive(bytes([0x91, 2 * 16 + 1]))
        end.receive(b"\xc1")
        end.receive(b"")
        assert (end.counts.other_versions, end.counts.refused) == (1, 2)


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("header", "payload"),
    [
        (write(Tokens(1, 1, 1, 9, [b""] * 3)), b"\x92\xc4\x01x\xc4\x01y"),
        (write(Tokens(1, 1, 1, 9, [b""] * 3)), b"\xdd\xff\xff\xff\xff"),
        (write(Tokens(1, 1, 1, 9, [b""] * 3)), b""),
        (write(Tokens(1, 1, 1, 9, [])), b"x"),
        (write(Tokens(1, 1, 1, 9, [b""] * 5000)), b"x"),
        (write(Tokens(1, 1, 1, 9, [b"m" * 5000])), b"x"),
        (write(Tokens(1, 1, -1, 9, [b""])), b"x"),
        (write(Tokens(1, 1, 2**63, 9, [b""])), b"x"),
        (write(Status("a", 1, 1, 1, 1, 1, 1, 1)), b""),
        (b"\x96\x11\x01\x01\x01\x01\xdd\xff\xff\xff\xff", b""),
    ],
)
def test_a_consumer_refuses_tokens_that_cannot_be(header: bytes, payload: bytes) -> None:
    producer, consumer = pair()
    consumer.receive(header, payload)
    assert consumer.counts.refused == 1
    assert consumer.waiting == 0
    producer.send(token("x"))
    settle(producer, consumer)
    assert values(consumer) == ["x"]


@pytest.mark.rule("L4")
@pytest.mark.parametrize("number", range(20))
def test_nothing_that_arrives_raises_or_makes_it_hold_more_than_it_may(number: int) -> None:
    """True frames with fields changed by chance, and bytes changed by chance."""
    chance = random.Random(number)
    producer, consumer = pair()
    for _ in range(8):
        producer.send(token("x"))
    true = [
        producer.flush(0.0)[0].header,
        write(Probe("a", 2, 1, 1, 1, 8, 5, False, False)),
        status(),
        status(accepted=3, done=2),
    ]
    interesting = [0, 1, 2, 3, 5, 8, 127, 128, 2**31, FAR, 2**63, -1, None, "a", [], b""]
    for _ in range(300):
        header = chance.choice(true)
        if chance.random() < 0.5:
            changed = bytearray(header)
            for _ in range(chance.randrange(1, 4)):
                changed[chance.randrange(len(changed))] = chance.randrange(256)
            header = bytes(changed[: chance.randrange(len(changed) + 1)] if chance.random() < 0.3 else changed)
        else:
            fields = msgspec.msgpack.decode(header)
            fields[chance.randrange(1, len(fields))] = chance.choice(interesting)
            header = write(fields)
        payload = bytes(chance.randrange(256) for _ in range(chance.randrange(20)))
        for end in (producer, consumer):
            end.receive(header, payload)
            end.check_invariants()
        assert len(producer.flush(0.0)) <= 3
        assert len(consumer.flush()) <= 1


def test_a_status_says_what_a_producer_needs_to_know() -> None:
    producer, consumer = pair()
    producer.send(token("x"))
    deliver(producer.flush(0.0), consumer)
    consumer.take()
    consumer.done()
    (one,) = consumer.flush()
    assert read_from_consumer(one.header) == Status("a", 2, 1, 1, accepted=1, done=1, limit=17, seen=3)

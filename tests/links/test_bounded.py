"""The link that may lose tokens: never out of order, never twice, and every loss is in a number."""

from __future__ import annotations

import random
from typing import Any

import pytest

from hfg.errors import MessageTooLarge, UsageError
from hfg.links import BoundedConsumer, BoundedProducer
from hfg.links.frames import Status, Tokens, write


def numbers(consumer: BoundedConsumer) -> list[int]:
    return [one.sequence for one in consumer.take_all()]


def send(producer: BoundedProducer, count: int) -> list[tuple[bytes, Any]]:
    """So many tokens, each in a datagram of its own."""
    out = []
    for _ in range(count):
        producer.send((b"m", b"v"))
        out += [(one.header, one.payload) for one in producer.flush()]
    return out


@pytest.mark.rule("P5")
@pytest.mark.parametrize(
    ("overflow", "left"), [("drop_oldest", [7, 8, 9, 10]), ("drop_newest", [1, 2, 3, 4]), ("latest", [10])]
)
def test_a_full_queue_loses_by_its_policy_and_counts(overflow: Any, left: list[int]) -> None:
    producer, consumer = BoundedProducer(1), BoundedConsumer(capacity=4, overflow=overflow)
    for one in send(producer, 10):
        consumer.receive(*one)
    assert consumer.counts.dropped == 10 - len(left)
    assert numbers(consumer) == left


@pytest.mark.rule("P5")
def test_with_the_policy_error_the_queue_keeps_what_it_has_and_says_so() -> None:
    producer, consumer = BoundedProducer(1), BoundedConsumer(capacity=2, overflow="error")
    first, second, third = send(producer, 3)
    consumer.receive(*first)
    consumer.receive(*second)
    assert not consumer.overflowed
    consumer.receive(*third)
    assert consumer.overflowed
    assert numbers(consumer) == [1, 2]


@pytest.mark.rule("L2")
def test_a_gap_is_a_loss_that_is_counted_when_the_next_token_comes() -> None:
    producer, consumer = BoundedProducer(1), BoundedConsumer()
    sent = send(producer, 5)
    for index in (0, 3, 4):
        consumer.receive(*sent[index])
    assert consumer.counts.lost == 2
    assert numbers(consumer) == [1, 4, 5]


@pytest.mark.rule("L2")
def test_what_was_overtaken_or_comes_twice_is_not_taken() -> None:
    producer, consumer = BoundedProducer(1), BoundedConsumer()
    sent = send(producer, 3)
    for index in (0, 2, 1, 2):
        consumer.receive(*sent[index])
    assert numbers(consumer) == [1, 3]
    assert consumer.counts.late == 2


def test_who_comes_late_has_lost_nothing_but_of_a_new_producer_the_beginning_counts() -> None:
    producer, consumer = BoundedProducer(1), BoundedConsumer()
    consumer.receive(*send(producer, 9)[-1])
    assert consumer.counts.lost == 0
    heir = BoundedProducer(2)
    consumer.receive(*send(heir, 3)[-1])
    assert (consumer.counts.lost, consumer.counts.streams) == (2, 1)
    consumer.receive(*send(producer, 1)[0])
    assert consumer.counts.stale == 1, "a former life is not heard any more"
    assert [one.position for one in consumer.take_all()] == [(1, 9), (2, 3)]


@pytest.mark.rule("L2")
def test_only_the_expected_producer_is_heard_if_somebody_knows_it() -> None:
    consumer = BoundedConsumer(producer=3)
    consumer.receive(*send(BoundedProducer(9), 1)[0])
    consumer.receive(*send(BoundedProducer(3), 1)[0])
    assert [one.stream for one in consumer.take_all()] == [3]
    consumer.believe(4)
    consumer.receive(*send(BoundedProducer(4), 1)[0])
    assert consumer.waiting == 1


def test_tokens_of_one_turn_go_in_one_datagram() -> None:
    producer, consumer = BoundedProducer(1), BoundedConsumer(capacity=100)
    for number in range(50):
        producer.send((b"", b"%d" % number))
    (one,) = producer.flush()
    consumer.receive(one.header, one.payload)
    assert [bytes(token.value) for token in consumer.take_all()] == [b"%d" % number for number in range(50)]
    assert producer.flush() == []


@pytest.mark.rule("L2")
@pytest.mark.parametrize("seed", range(30))
def test_whatever_the_channel_does_each_token_is_received_lost_or_late(seed: int) -> None:
    chance = random.Random(seed)
    producer, consumer = BoundedProducer(1, largest_batch=chance.choice([20, 60_000])), BoundedConsumer(capacity=5)
    producer.send((b"", b"1"))
    consumer.receive(*next((one.header, one.payload) for one in producer.flush()))
    flying: list[tuple[bytes, Any]] = []
    got: list[int] = []
    for _ in range(300):
        action = chance.random()
        if action < 0.5:
            for _ in range(chance.randrange(1, 4)):
                producer.send((b"", b"%d" % (producer.position.sequence + 1)))
            flying += [(one.header, one.payload) for one in producer.flush()]
        elif flying and action < 0.8:
            consumer.receive(*flying.pop(0 if chance.random() < 0.8 else chance.randrange(len(flying))))
        elif flying and action < 0.85:
            flying.pop()
        elif flying and action < 0.9:
            flying.append(chance.choice(flying))
        else:
            for one in consumer.take_all():
                assert int(bytes(one.value)) == one.sequence
                got.append(one.sequence)
        consumer.check_invariants()
    got += numbers(consumer)
    assert got == sorted(set(got))
    counts = consumer.counts
    assert counts.received == len(got) + counts.dropped
    producer.send((b"", b"last"))
    consumer.receive(*[(one.header, one.payload) for one in producer.flush()][-1])
    assert counts.received + counts.lost == producer.position.sequence


@pytest.mark.rule("L4")
def test_what_is_no_token_is_refused_and_counted() -> None:
    consumer = BoundedConsumer()
    for header in (b"", b"\xc1", write(Status("a", 1, 1, 1, 1, 1, 1, 1)), write(Tokens(1, 1, 0, 0, [b""]))):
        consumer.receive(header, b"")
    consumer.receive(write(Tokens(1, 1, 1, 0, [b"", b""])), b"\x91\xc4\x00")
    consumer.receive(bytes([0x91, 0x51]))
    assert (consumer.counts.refused, consumer.counts.other_versions) == (5, 1)
    assert consumer.waiting == 0


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(UsageError, match="a link needs epoch >= 1"):
        BoundedProducer(0)
    with pytest.raises(UsageError, match="a link needs capacity >= 1"):
        BoundedConsumer(capacity=0)
    with pytest.raises(MessageTooLarge, match="a token of 9 bytes and 0 of metadata cannot be sent"):
        BoundedProducer(1, largest_token=8).send((b"", memoryview(b"123456789")))

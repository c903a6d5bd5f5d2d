"""Events: triggering, subscribers and operators."""

from __future__ import annotations

import logging
import threading
from datetime import timedelta
from typing import Any

import pytest
from reactivex import Observable
from reactivex import operators as ops
from reactivex.testing import TestScheduler

import hfg
from hfg.errors import NotRunning, UsageError
from hfg.ports import EventPort


class Seen(hfg.Node):
    seen = hfg.Event(int)
    done = hfg.Event()


@pytest.fixture
def event() -> EventPort[int]:
    return Seen().seen


def test_an_event_outside_a_run_says_what_to_do(event: EventPort[int]) -> None:
    with pytest.raises(NotRunning, match=r'"seen\.seen" cannot trigger outside a run.*hfg\.run'):
        event.trigger(3)
    with pytest.raises(NotRunning, match="cannot trigger"):
        event.trigger_wait(3).send(None)


@pytest.mark.rule("A4")
def test_a_trigger_hands_value_modifier_and_stamp_to_the_runner(event: EventPort[int]) -> None:
    calls: list[Any] = []
    event._emit = lambda *call: calls.append(call)
    event.trigger(3)
    event.trigger(4, activity=-1, stamp=2.0)
    event.trigger()
    assert calls == [(3, None, None), (4, -1, 2.0), (None, None, None)]


def test_a_waiting_trigger_awaits_the_runner(event: EventPort[int]) -> None:
    async def emit(*call: Any) -> None:
        calls.append(call)

    calls: list[Any] = []
    event._emit_wait = emit
    with pytest.raises(StopIteration):
        event.trigger_wait(3, activity=1).send(None)
    assert calls == [(3, 1, None)]


def test_an_event_is_an_observable_of_tokens(event: EventPort[int]) -> None:
    got: list[Any] = []
    event.map(lambda token: token.value * 2).filter(lambda value: value > 2).subscribe(got.append)
    for value in (1, 2, 3):
        event._notify(hfg.Token(value))
    assert isinstance(event, Observable)
    assert got == [4, 6]


def test_nobody_listens_until_somebody_subscribes(event: EventPort[int]) -> None:
    assert event._observers is None
    subscription = event.subscribe(print)
    assert event._observers
    subscription.dispose()
    assert not event._observers


def test_a_subscriber_that_raises_is_logged_with_the_path_and_dropped(
    event: EventPort[int], caplog: pytest.LogCaptureFixture
) -> None:
    got: list[int] = []

    def fail(token: hfg.Token[int]) -> None:
        raise ZeroDivisionError

    event.subscribe(fail)
    event.subscribe(lambda token: got.append(token.value))
    with caplog.at_level(logging.ERROR):
        event._notify(hfg.Token(1))
        event._notify(hfg.Token(2))
    assert got == [1, 2]
    assert len(caplog.records) == 1
    assert 'a subscriber of "seen.seen" failed and was dropped' in caplog.text
    assert "ZeroDivisionError" in caplog.text


def test_an_operator_that_raises_reaches_its_subscriber_only(event: EventPort[int]) -> None:
    errors: list[Exception] = []
    event.map(lambda token: 1 / token.value).subscribe(print, errors.append)
    event._notify(hfg.Token(0))
    assert [type(error) for error in errors] == [ZeroDivisionError]


def test_completing_tells_subscribers_even_when_one_fails(
    event: EventPort[int], caplog: pytest.LogCaptureFixture
) -> None:
    ended: list[str] = []

    def fail() -> None:
        raise ZeroDivisionError

    event.subscribe(on_completed=fail)
    event.pipe(ops.to_list()).subscribe(lambda tokens: ended.append(f"{len(tokens)} tokens"))
    event._notify(hfg.Token(1))
    event._complete()
    assert ended == ["1 tokens"]
    assert "failed when the event completed" in caplog.text


def test_a_subscriber_may_leave_while_it_is_told(event: EventPort[int]) -> None:
    got: list[int] = []
    event.take(1).subscribe(lambda token: got.append(token.value))
    event.subscribe(lambda token: got.append(token.value))
    event._notify(hfg.Token(1))
    event._notify(hfg.Token(2))
    assert got == [1, 1, 2]


@pytest.mark.parametrize(
    "debounced",
    [
        lambda event: event.pipe(ops.debounce(5.0)),
        lambda event: event.debounce(5.0),
        lambda event: event.map(str).pipe(ops.map(str)).debounce(timedelta(seconds=5)),
        lambda event: event.partition(lambda token: True)[0].debounce(5.0),
    ],
)
def test_whatever_is_derived_from_an_event_uses_the_scheduler_of_the_run(event: EventPort[int], debounced: Any) -> None:
    """Without it reactivex would wait on a thread, and in virtual time for ever."""
    scheduler = TestScheduler()
    event._scheduler = scheduler
    got: list[Any] = []
    threads = threading.active_count()
    debounced(event).subscribe(got.append)
    event._notify(hfg.Token(1))
    event._notify(hfg.Token(2))
    assert got == []
    assert threading.active_count() == threads
    scheduler.advance_by(6.0)
    assert len(got) == 1


def test_a_scheduler_of_ones_own_wins(event: EventPort[int]) -> None:
    event._scheduler, mine = TestScheduler(), TestScheduler()
    got: list[Any] = []
    event.debounce(5.0).subscribe(got.append, scheduler=mine)
    event._notify(hfg.Token(1))
    mine.advance_by(6.0)
    assert len(got) == 1


def test_subscribing_from_another_thread_than_the_runs_is_refused(event: EventPort[int]) -> None:
    event._thread = -1
    for observable in (event, event.map(str)):
        with pytest.raises(UsageError, match=r'"seen\.seen" was subscribed to from a thread that is not its run'):
            observable.subscribe(print)


def test_awaiting_an_event_is_answered_with_wait_for(event: EventPort[int]) -> None:
    async def wait(observable: Any) -> None:
        await observable

    for observable in (event, event.map(str)):
        with pytest.raises(TypeError, match=r"run\.wait_for"):
            wait(observable).send(None)


def test_operators_that_need_a_lock_find_one(event: EventPort[int]) -> None:
    got: list[Any] = []
    other = Seen().seen
    event.merge(other).subscribe(lambda token: got.append(token.value))
    event.zip(other).subscribe(lambda pair: got.append(tuple(token.value for token in pair)))
    event._notify(hfg.Token(1))
    other._notify(hfg.Token(2))
    assert got == [1, 2, (1, 2)]


def test_sharing_keeps_its_own_class(event: EventPort[int]) -> None:
    got: list[Any] = []
    shared = event.publish()
    shared.subscribe(got.append)
    shared.connect()
    event._notify(hfg.Token(1))
    assert len(got) == 1

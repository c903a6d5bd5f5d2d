"""Large arrays between processes of one host go through shared memory, and nothing of it is left behind (L1, L4)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import hfg
from hfg.base.token import Token
from hfg.encoding import TokenCodec
from hfg.errors import EncodingError
from hfg.parts.model.messages import Sees, Shares
from hfg.parts.running.rings import Borrowing, Lending, LendingCounts, segment_of, segments_of, sweep_run, sweep_runs
from hfg.sharedmemory import unavailable
from tests.limits import patience

PROGRAM = Path(__file__).with_name("pictures.py")
pytestmark = pytest.mark.skipif(unavailable() is not None, reason=str(unavailable()))


Array = npt.NDArray[np.uint8]
LARGE, SMALL = 2**16, 2**10


class Edge:
    """Both ends of an edge, and what lies between them."""

    def __init__(self, window: int = 2, life: int = 1) -> None:
        self.run = f"hfg/test{os.getpid()}"
        self.shares: list[Shares] = []
        self.sees: list[Sees] = []
        self.under_way = 0
        self.codec = TokenCodec[Array](Array)
        self.lending = Lending(self.run, life, 0, "a.out -> b.in", window, lambda: self.under_way, self.shares.append)
        self.borrowing = Borrowing(self.run, self.sees.append)

    def send(self, size: int, number: int = 0) -> tuple[bytes, bytes]:
        return self.send_array(np.full(size, number, np.uint8))

    def send_array(self, array: Array) -> tuple[bytes, bytes]:
        sent = self.lending.encode(self.codec, Token(array))
        self.under_way += 1
        self.lending.sent()
        return sent

    def done(self) -> None:
        self.under_way -= 1
        self.lending.settle()

    def agree(self) -> None:
        self.borrowing.open(self.shares[-1])
        self.lending.seen(self.sees[-1])

    def see(self, sent: tuple[bytes, bytes]) -> Array:
        return self.codec.decode(*sent, view=self.borrowing.view).value


@pytest.fixture
def edge() -> Iterator[Edge]:
    made = Edge()
    yield made
    made.lending.close()
    assert left_behind(segments_of(made.run)) == []


def is_lent(sent: tuple[bytes, bytes]) -> bool:
    return len(sent[1]) < SMALL


def test_nothing_more_leaves_until_the_consumer_has_said_whether_it_can_open_the_ring(edge: Edge) -> None:
    assert edge.lending.is_answered
    edge.send(LARGE)
    assert not edge.lending.is_answered
    edge.agree()
    assert edge.lending.is_answered
    assert is_lent(edge.send(LARGE))


def test_no_more_tokens_leave_than_find_a_slot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hfg.parts.running.rings._LARGEST", 5 * LARGE)
    edge = Edge(window=64)
    try:
        edge.send(LARGE)
        assert edge.lending.room == 64
        edge.agree()
        rooms = []
        for _ in range(3):
            rooms.append(edge.lending.room)
            assert is_lent(edge.send(LARGE))
        edge.send(SMALL)
        assert [*rooms, edge.lending.room] == [3, 2, 1, 0]
        edge.done()
        edge.done()
        assert edge.lending.room == 1
    finally:
        edge.lending.close()


@pytest.mark.rule("L4")
def test_small_arrays_make_no_ring_and_the_first_large_one_does(edge: Edge) -> None:
    edge.send(SMALL)
    assert edge.lending.ring is None
    assert edge.shares == []
    edge.send(LARGE)
    assert names([one.segment for one in edge.shares]) == {segment_of(edge.run, 1, 0)}


class Camera(hfg.Node):
    """Sends nothing by itself."""

    image = hfg.Output(Array)

    def process(self) -> None:
        return None


@pytest.mark.rule("L4", "T1")
def test_what_was_loaned_from_the_output_lies_where_it_is_sent_from(edge: Edge) -> None:
    edge.send(LARGE)
    edge.agree()
    camera = Camera()
    camera.image._loan_from(edge.lending.loan)
    picture = camera.image.loan((2**8, 2**8), np.uint8)
    picture[:] = 7
    assert is_lent(sent := edge.send_array(picture))
    assert edge.lending.ring is not None
    assert (edge.lending.ring.counts.loaned, edge.lending.ring.counts.copied) == (1, 0)
    assert (edge.see(sent) == 7).all()
    with pytest.raises(ValueError, match="read-only"):
        picture[0, 0] = 8


@pytest.mark.rule("L4")
def test_who_can_be_loaned_nothing_fills_an_ordinary_array(edge: Edge) -> None:
    camera = Camera()
    assert camera.image.loan(3).shape == (3,)
    camera.image._loan_from(edge.lending.loan)
    assert camera.image.loan((2, 2), np.uint8).shape == (2, 2)  # small ones are copied
    assert edge.lending.ring is None
    kept = [camera.image.loan((LARGE,), np.uint8) for _ in range(6)]  # more than there are slots
    assert edge.lending.ring is not None
    assert edge.lending.ring.counts.loaned == 4
    assert camera.image.loan((2 * LARGE,), np.uint8).nbytes == 2 * LARGE  # larger than a slot
    assert camera.image.loan((LARGE,), object).dtype == object
    edge.lending.close()
    assert [array.nbytes for array in [*kept, camera.image.loan((LARGE,), np.uint8)]] == [LARGE] * 7


@pytest.mark.rule("L4")
def test_until_the_consumer_has_opened_the_ring_arrays_go_the_ordinary_way(edge: Edge) -> None:
    assert not is_lent(edge.send(LARGE, 3))
    edge.borrowing.open(edge.shares[0])
    assert not is_lent(edge.send(LARGE, 4))
    edge.lending.seen(edge.sees[0])
    sent = edge.send(LARGE, 5)
    assert is_lent(sent)
    assert (edge.see(sent) == 5).all()
    assert not is_lent(edge.send(SMALL + 1))
    assert edge.lending.counts == LendingCounts(early=2)


@pytest.mark.rule("L4", "P4")
def test_slots_are_free_again_in_the_order_in_which_tokens_are_done(edge: Edge) -> None:
    edge.send(LARGE)
    edge.agree()
    for number in range(4):  # a window of two and two to spare
        assert is_lent(edge.send(LARGE, number))
    assert not is_lent(edge.send(LARGE))
    assert edge.lending.counts.without_slot == 1
    edge.done()  # the first, which had no lease
    assert not is_lent(edge.send(LARGE))
    edge.done()
    assert is_lent(edge.send(LARGE))


@pytest.mark.rule("L4")
def test_an_array_larger_than_the_first_goes_the_ordinary_way(edge: Edge) -> None:
    edge.send(LARGE)
    edge.agree()
    assert not is_lent(edge.send(2 * LARGE))
    assert is_lent(edge.send(LARGE))
    assert edge.lending.counts == LendingCounts(early=1, too_large=1)


@pytest.mark.rule("L4", "L2")
def test_a_token_that_the_link_does_not_need_gives_its_slot_back_at_once(edge: Edge) -> None:
    edge.send(LARGE)
    edge.agree()
    ring = edge.lending.ring
    assert ring is not None
    edge.lending.encode(edge.codec, Token(np.zeros(LARGE, np.uint8)))
    assert ring.free == 3
    edge.lending.sent()  # and no more tokens are under way than before
    assert ring.free == 4


@pytest.mark.rule("L4")
def test_a_value_that_cannot_be_sent_gives_its_slots_back(edge: Edge) -> None:
    edge.send(LARGE)
    edge.agree()
    assert edge.lending.ring is not None
    values = TokenCodec[list[Any]](tuple[Array, int])
    with pytest.raises(EncodingError):
        edge.lending.encode(values, Token((np.zeros(LARGE, np.uint8), "no number")))
    assert edge.lending.ring.free == 4


@pytest.mark.rule("L4", "L2")
def test_a_consumer_that_begins_anew_waits_for_the_ring_before_it_sees_what_is_sent_again(edge: Edge) -> None:
    edge.send(LARGE)
    edge.agree()
    sent = edge.send(LARGE, 7)
    edge.borrowing = Borrowing(edge.run, edge.sees.append)  # the former one was killed
    edge.lending.admit()
    with pytest.raises(EncodingError):
        edge.see(sent)
    assert edge.borrowing.is_awaited
    assert not is_lent(edge.send(LARGE, 8))
    edge.lending.seen(edge.sees[0])  # a late word of the previous incarnation says nothing of this one
    assert not is_lent(edge.send(LARGE, 8))
    edge.agree()
    assert (edge.see(sent) == 7).all()
    assert not edge.borrowing.is_awaited
    edge.done()
    edge.done()
    assert is_lent(edge.send(LARGE, 9))


@pytest.mark.rule("L4")
def test_a_consumer_that_cannot_open_the_ring_is_sent_copies_and_the_ring_is_gone(edge: Edge) -> None:
    edge.send(LARGE)
    edge.borrowing.open(Shares("a.out -> b.in", "hfg-run-another-1-edge_0", 1))
    assert "was not announced" in edge.sees[0].refused
    edge.lending.seen(Sees("a.out -> b.in", edge.shares[0].segment, edge.shares[0].lane, "it is on another host"))
    assert left_behind(segments_of(edge.run)) == []
    assert not is_lent(edge.send(LARGE))
    edge.lending.admit()
    assert len(edge.shares) == 1


@pytest.mark.rule("L4")
def test_without_room_for_a_ring_arrays_are_copied_and_it_is_said_why(
    edge: Edge, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hfg.sharedmemory.names._LARGEST", LARGE)
    assert not is_lent(edge.send(LARGE))
    assert not is_lent(edge.send(LARGE))
    assert edge.shares == []
    (record,) = caplog.records
    assert 'edge "a.out -> b.in" copies its arrays: shared memory is full' in record.getMessage()


@pytest.mark.rule("L4", "L2")
def test_without_room_for_a_consumer_that_begins_anew_arrays_are_copied_to_it(
    edge: Edge, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    edge.send(LARGE)
    edge.agree()
    monkeypatch.setattr("hfg.sharedmemory.names._LARGEST", 1)
    edge.done()
    edge.lending.admit()
    (record,) = caplog.records
    assert 'edge "a.out -> b.in" copies its arrays: shared memory is full' in record.getMessage()
    assert not is_lent(edge.send(LARGE))


@pytest.mark.rule("L5")
def test_no_name_of_shared_memory_can_be_taken_by_another_user_who_has_seen_one(edge: Edge) -> None:
    """He sees all names in /dev/shm; whoever took the next lane of a ring ended the run when a consumer died."""
    edge.send(LARGE)
    other = Lending(edge.run, 1, 0, "a.out -> b.in", 2, lambda: 0, edge.shares.append)
    other.encode(edge.codec, Token(np.zeros(LARGE, np.uint8)))
    for _ in range(3):
        edge.lending.admit()
    assert len({one.segment for one in edge.shares}) == 2
    lanes = [one.lane for one in edge.shares]
    assert len(set(lanes)) == 5
    assert not [lane for lane in lanes if lane < 1000]
    other.close()


def test_who_sweeps_removes_nothing_of_who_lives() -> None:
    edge = Edge()
    edge.send(LARGE)
    sweep_run(edge.run)
    sweep_runs()
    edge.agree()
    assert is_lent(edge.send(LARGE))
    edge.lending.close()


def run_program(
    *, count: int = 20, keeps: bool = False, flip_dies_at: int = -1, mark: Path | None = None, judge_dies_at: int = -1
) -> Any:
    """Run it, and wait until all its processes are gone: they hold its output open."""
    pytest.importorskip("hfg_transports.zenoh")
    arguments = json.dumps([count, keeps, flip_dies_at, str(mark), judge_dies_at])
    done = subprocess.run(
        [sys.executable, str(PROGRAM), arguments], capture_output=True, text=True, timeout=patience(100), check=False
    )
    return done, [json.loads(line) for line in done.stdout.splitlines()]


def run_of(said: list[dict[str, Any]]) -> str:
    """Give how the names of the shared memory of the run begin."""
    (segment,) = {str(one["there"]) for one in said if one.get("there")}
    assert segment.startswith("hfg-run-")
    return segment.rpartition("-edge_")[0].rpartition("-")[0]


def names(segments: Iterable[str]) -> set[str]:
    """Return the names without what is random at their ends."""
    return {one.rpartition("_")[0] for one in segments if one}


def left_behind(run: str) -> list[str]:
    return [one.name for one in Path("/dev/shm").iterdir() if one.name.startswith(run)]


@pytest.mark.slow
@pytest.mark.rule("L1", "L4")
def test_pictures_go_through_shared_memory_both_ways_and_arrive_to_the_bit() -> None:
    done, said = run_program()
    assert done.returncode == 0, done.stderr
    assert [one["number"] for one in said] == list(range(20))
    assert all(one["right"] for one in said)
    run = run_of(said)
    assert names(one["there"] for one in said) == {f"{run}-1-edge_1"}
    assert names(one["here"] for one in said) == {f"{run}-1-edge_0"}
    assert left_behind(run) == []


@pytest.mark.slow
@pytest.mark.rule("L1")
def test_a_consumer_that_keeps_all_it_sees_gets_the_rest_the_ordinary_way_and_that_is_counted() -> None:
    done, said = run_program(keeps=True, count=24)
    assert done.returncode == 0, done.stderr
    assert [one["number"] for one in said if one["right"]] == list(range(24))
    placed = sum(one["there"] != "" for one in said)
    assert 0 < placed <= 11  # nine may be under way, and there are two to spare
    assert said[-1]["there"] == ""
    assert 'edge "frames.out -> flip.frame" has sent' in done.stderr
    assert "because no slot was free" in done.stderr
    assert left_behind(run_of(said)) == []


@pytest.mark.slow
@pytest.mark.rule("L1", "L2")
def test_a_process_that_is_killed_begins_anew_with_a_ring_of_its_own_and_nothing_is_left_behind(tmp_path: Path) -> None:
    done, said = run_program(count=40, flip_dies_at=15, mark=tmp_path / "dead")
    assert done.returncode == 0, done.stderr
    assert said.count({"dies": "flip"}) == 1
    said.remove({"dies": "flip"})
    assert [one["number"] for one in said] == list(range(40))
    assert all(one["right"] for one in said)
    run = run_of(said)
    after = said[16:]
    assert f"{run}-1-edge_1" in names(one["there"] for one in after)
    assert f"{run}-2-edge_0" in names(one["here"] for one in after)
    assert left_behind(run) == []


@pytest.mark.slow
@pytest.mark.rule("L1")
def test_a_main_part_that_is_killed_leaves_no_shared_memory_behind_for_the_others_see_to_it() -> None:
    done, said = run_program(judge_dies_at=12)
    assert done.returncode == -9
    assert said[-1] == {"dies": "judge"}
    assert left_behind(run_of(said)) == []

"""Slots in shared memory: given back when nobody looks any more, never overwritten before, and gone after any death."""

from __future__ import annotations

import gc
import multiprocessing
import os
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from hfg.base.token import Token
from hfg.encoding import ArrayHead, Lease, TokenCodec
from hfg.errors import EncodingError, SharedMemoryError, UsageError
from hfg.images import Image
from hfg.sharedmemory import Reader, Ring, segment_name, segment_prefix, sweep, unavailable
from hfg.sharedmemory.layout import MAGIC
from hfg.sharedmemory.names import open_existing
from tests.sharedmemory import actors

pytestmark = pytest.mark.skipif(unavailable() is not None, reason="no shared memory here")

SHM = Path("/dev/shm")
REALM = f"test{os.getpid()}"


def left() -> list[str]:
    return sorted(path.name for path in SHM.glob(f"hfg-{REALM}-*"))


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    yield
    if left():  # views in cycles are gone after a collection, which takes seconds where much was imported
        gc.collect()
    swept = sweep(f"hfg-{REALM}-")
    assert left() == []
    assert swept == []


@pytest.fixture
def ring() -> Iterator[Ring]:
    made = Ring(segment_name(REALM, "a", 1, "image"), slots=3, slot_size=4096, smallest=1)
    yield made
    made.close()


def reader_of(ring: Ring) -> Reader:
    return Reader(ring.name, ring.admit(), lambda name: name == ring.name)


def filled(ring: Ring, number: int) -> Any:
    array = ring.loan((4, 8), np.uint8)
    if array is not None:
        array[:] = number
    return array


def head_of(array: np.ndarray[Any, Any], lease: Lease | None) -> ArrayHead:
    assert lease is not None
    return ArrayHead(array.dtype.str, array.shape, lease)


@pytest.mark.rule("L1", "T1")
def test_a_loaned_array_is_seen_by_the_consumer_without_a_copy(ring: Ring) -> None:
    reader = reader_of(ring)
    array = filled(ring, 7)
    head = head_of(array, ring.place(array))
    view = reader.view(head)
    assert np.array_equal(view, array)
    assert not view.flags.writeable
    assert not array.flags.writeable
    with pytest.raises(ValueError, match="WRITEABLE"):
        view.flags.writeable = True
    assert ring.counts.copied == 0


@pytest.mark.rule("L3")
def test_a_slot_is_free_when_the_token_is_done_and_the_last_view_is_gone(ring: Ring) -> None:
    reader, other = reader_of(ring), reader_of(ring)
    array = filled(ring, 1)
    lease = ring.place(array)
    head = head_of(array, lease)
    assert lease is not None
    del array
    view, part = reader.view(head), other.view(head)[1:, ::2]
    assert ring.free == 2
    ring.done(lease)
    assert ring.free == 2  # both look at it
    del view
    assert ring.free == 2
    assert part.max() == 1
    del part
    assert ring.free == 3


@pytest.mark.rule("L3")
def test_views_that_are_gone_first_do_not_free_what_is_not_done(ring: Ring) -> None:
    reader = reader_of(ring)
    array = filled(ring, 1)
    lease = ring.place(array)
    head = head_of(array, lease)
    assert lease is not None
    del array
    assert reader.view(head).max() == 1
    assert (ring.free, reader.held) == (2, 0)
    assert reader.view(head).max() == 1  # the token comes once more, for it was not done
    ring.done(lease)
    assert ring.free == 3
    with pytest.raises(UsageError, match="not an outstanding lease"):
        ring.done(lease)


@pytest.mark.rule("L3")
def test_without_a_free_slot_arrays_go_the_ordinary_way_and_are_counted(ring: Ring) -> None:
    held = [filled(ring, number) for number in range(3)]
    assert filled(ring, 3) is None
    assert ring.place(np.zeros((4, 8))) is None
    assert ring.place(np.zeros(4097, np.uint8)) is None
    assert (ring.counts.without_slot, ring.counts.too_large, ring.counts.loaned) == (1, 1, 3)
    del held
    assert ring.free == 3
    lease = ring.place(np.full((4, 8), 5, np.int16))
    assert lease is not None
    assert ring.counts.copied == 1
    assert reader_of(ring).view(ArrayHead("<i2", (4, 8), lease)).max() == 5


@pytest.mark.rule("L1")
def test_parts_of_a_loaned_array_are_sent_where_they_are(ring: Ring) -> None:
    reader = reader_of(ring)
    array = ring.loan((8, 8), np.int32)
    assert array is not None
    array[:] = np.arange(64).reshape(8, 8)
    part, across = array[2:5], array[:, 1]
    first, second = ring.place(part), ring.place(across)
    assert first is not None
    assert first.offset == 2 * 8 * 4
    assert np.array_equal(reader.view(head_of(part, first)), part)
    assert second is not None
    assert second.slot != first.slot  # its elements do not lie together, so it was copied
    assert np.array_equal(reader.view(head_of(across, second)), across)


@pytest.mark.rule("L2", "L4")
def test_a_stale_lease_is_refused(ring: Ring) -> None:
    reader = reader_of(ring)
    array = filled(ring, 1)
    lease = ring.place(array)
    assert lease is not None
    head = head_of(array, lease)
    del array
    ring.done(lease)
    for number in range(2, 6):  # every slot is used again
        assert filled(ring, number) is not None
    with pytest.raises(ValueError, match="its lease is stale"):
        reader.view(head)
    assert ring.free == 3


@pytest.mark.rule("L4")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"slot": 3}, "does not have a lease of"),
        ({"slot": -1}, "does not have a lease of"),
        ({"segment": "hfg-x-y-1-z"}, "does not have a lease of"),
        ({"offset": 4090}, "exceeds its slot"),
        ({"offset": -1}, "exceeds its slot"),
        ({"generation": 2}, "stale"),
        ({"generation": -1}, "stale"),
        ({"generation": 2**70}, "stale"),
    ],
)
def test_a_lease_that_nobody_gave_is_refused(ring: Ring, change: dict[str, Any], words: str) -> None:
    reader = reader_of(ring)
    array = filled(ring, 1)
    lease = ring.place(array)
    assert lease is not None
    parts = {name: getattr(lease, name) for name in lease.__struct_fields__} | change
    with pytest.raises(ValueError, match=words):
        reader.view(ArrayHead("|u1", (4, 8), Lease(**parts)))
    with pytest.raises(ValueError, match="no array can have the shape|bytes that can be here"):
        reader.view(ArrayHead("|u1", (-4, 8), lease))
    ring.done(lease)
    del array
    assert ring.free == 3


@pytest.mark.rule("L4")
def test_only_segments_that_the_agent_has_announced_are_opened(ring: Ring) -> None:
    lane = ring.admit()
    for name in (ring.name, "../etc/passwd", "hfg-a/b", f"/{ring.name}"):
        with pytest.raises(SharedMemoryError, match="was not announced on this host"):
            Reader(name, lane, lambda name: "/" in name)
    for name in ("passwd", "sem.x", "hfg-a-b-1", ".."):
        with pytest.raises(SharedMemoryError, match="not a name of shared memory of hfg"):
            Reader(name, lane, lambda name: True)
    with pytest.raises(SharedMemoryError, match="cannot be opened .*: its producer has gone"):
        Reader(ring.name, 99, lambda name: True)
    other = SHM / segment_name(REALM, "a", 1, "strange")
    for content in (b"", bytes(5000), MAGIC + b"\xff" * 5000):
        other.write_bytes(content)
        with pytest.raises(SharedMemoryError, match="is not ready|is not a ring of this version"):
            Reader(other.name, lane, lambda name: True)
    other.unlink()


def test_some_bytes_can_be_read_behind_each_array_even_where_it_fills_the_last_slot(ring: Ring) -> None:
    reader = reader_of(ring)
    arrays = [ring.loan((4096,), np.uint8) for _ in range(3)]
    for array in arrays:
        assert array is not None
        head = ArrayHead("|u1", (4096,), lease=ring.place(array))
        view: Any = reader.view(head)
        end = view.ctypes.data + view.nbytes
        mapped = np.frombuffer(view.base.base, np.uint8)
        assert end + 64 <= mapped.ctypes.data + mapped.nbytes
        del view, mapped


def test_what_cannot_be_made_is_said(ring: Ring) -> None:
    with pytest.raises(SharedMemoryError, match="needs 60000.* MB and /dev/shm has .*docker run --shm-size"):
        Ring(segment_name(REALM, "a", 1, "huge"), slots=1, slot_size=60_000_000_000)
    with pytest.raises(SharedMemoryError, match="shared memory named .* already exists"):
        Ring(ring.name, slots=1, slot_size=1)
    with pytest.raises(SharedMemoryError, match="1 to 252 slots"):
        Ring(segment_name(REALM, "a", 1, "b"), slots=253, slot_size=1)
    with pytest.raises(SharedMemoryError, match="cannot be part of the name of shared memory"):
        segment_prefix(REALM, "../a", 1)
    with pytest.raises(SharedMemoryError, match="does not fit into a slot of 4096 bytes"):
        ring.loan((4097,), np.uint8)
    with pytest.raises(SharedMemoryError, match="does not fit into a slot"):
        ring.loan((1,), object)
    with pytest.raises(SharedMemoryError, match="not a prefix of names of shared memory of hfg"):
        sweep("")


def test_a_closed_ring_leaves_nothing_but_the_views_that_live(ring: Ring) -> None:
    reader = reader_of(ring)
    array = filled(ring, 9)
    view = reader.view(head_of(array, ring.place(array)))
    ring.close()
    ring.close()
    assert left() == []
    assert view.max() == array.max() == 9
    with pytest.raises(UsageError, match="is closed"):
        filled(ring, 1)


def test_sweeping_leaves_alone_what_has_a_living_producer(ring: Ring) -> None:
    lane = ring.admit()
    assert sweep(segment_prefix(REALM, "a", 1)) == []
    assert left() == [ring.name, f"{ring.name}.{lane}"]


@pytest.mark.rule("L1", "L4")
def test_tokens_with_images_travel_by_lease_where_there_is_a_slot(ring: Ring) -> None:
    reader, codec = reader_of(ring), TokenCodec[Any](list[Image])
    images = [np.full((10, 20), number, np.uint8) for number in range(5)]
    metadata, value = codec.encode(Token(images), place=ring.place)
    assert (ring.counts.placed, ring.counts.without_slot) == (3, 2)
    assert 2 * 200 < len(value) < 4 * 200
    found = codec.decode(metadata, value, view=reader.view).value
    assert all(map(np.array_equal, found, images))
    with pytest.raises(EncodingError, match="in shared memory, which is not open to this end"):
        codec.decode(metadata, value)


@pytest.mark.rule("L2", "L3")
@pytest.mark.parametrize("seed", range(20))
def test_what_somebody_looks_at_is_never_overwritten(seed: int) -> None:
    """Random lives: two consumers that hold views, die and return, a producer that keeps some of what it loaned."""
    random = Random(seed)
    ring = Ring(segment_name(REALM, "a", 1, "random"), slots=4, slot_size=64, smallest=1)
    lanes = [ring.admit() for _ in range(2)]
    readers = [Reader(ring.name, lane, lambda name: True) for lane in lanes]
    views: list[list[tuple[int, Any]]] = [[], []]
    kept: list[tuple[int, Any]] = []
    out: list[tuple[int, ArrayHead, Lease]] = []
    for number in range(1, 250):
        match random.randrange(6):
            case 0 | 1:
                array = filled(ring, number % 251)
                if array is None:
                    assert kept or out or any(views)
                    continue
                kept.append((number % 251, array))
                lease = ring.place(array)
                assert lease is not None
                out.append((number % 251, ArrayHead("|u1", (4, 8), lease), lease))
            case 2 if out:
                who = random.randrange(2)
                content, head, _ = random.choice(out)
                views[who].append((content, readers[who].view(head)[random.randrange(3) :]))
            case 3 if out:
                ring.done(out.pop(random.randrange(len(out)))[2])
            case 4:
                some = random.choice([kept, *views])
                if some:
                    del some[random.randrange(len(some))]
            case 5 if random.random() < 0.2:  # a consumer dies, and its place is taken by another
                who = random.randrange(2)
                views[who].clear()
                ring.dismiss(lanes[who])
                lanes[who] = ring.admit()
                readers[who] = Reader(ring.name, lanes[who], lambda name: True)
        for content, array in [*kept, *views[0], *views[1]]:
            assert (array == content).all()
    for _, _, lease in out:
        ring.done(lease)
    array = None
    kept.clear()
    views[0].clear()
    views[1].clear()
    assert ring.free == 4
    ring.close()


# --- processes that are killed ---


FORKED = multiprocessing.get_context("forkserver")  # warm, so that hundreds can be killed
FORKED.set_forkserver_preload(["tests.sharedmemory.actors"])


@pytest.mark.rule("L2")
@pytest.mark.timeout(600)
@pytest.mark.parametrize("many", [100, pytest.param(1000, marks=pytest.mark.soak)])
def test_nothing_is_left_of_producers_that_are_killed_at_any_moment(many: int) -> None:
    random, prefix = Random(many), segment_prefix(REALM, "killed", 1)
    found = 0
    for number in range(many):
        here, there = FORKED.Pipe()
        process = FORKED.Process(target=actors.produce, args=(f"{prefix}out{number}", 4, there), daemon=True)
        process.start()
        there.close()
        assert here.poll(60)
        assert here.recv() == "begin"
        if number % 2:
            assert here.poll(60)
            assert here.recv() == "ready"
        time.sleep(random.random() * 0.002)  # not to wait for anything: any moment may be the last
        process.kill()
        process.join()
        process.close()
        here.close()
        swept = sweep(prefix)
        found += bool(swept)
        assert left() == []
    assert found > many // 2


@pytest.mark.rule("L2", "L3")
@pytest.mark.timeout(600)
@pytest.mark.parametrize("many", [100, pytest.param(1000, marks=pytest.mark.soak)])
def test_what_killed_consumers_held_comes_back_and_others_go_on(many: int) -> None:
    random = Random(many)
    ring = Ring(segment_name(REALM, "lives", 1, "out"), slots=6, slot_size=2**16, smallest=1)
    size = sum(path.stat().st_blocks for path in SHM.glob(f"{ring.name}*"))

    def begin() -> tuple[Any, Any, int]:
        lane = ring.admit()
        here, there = FORKED.Pipe()
        process = FORKED.Process(target=actors.consume, args=(ring.name, lane, there), daemon=True)
        process.start()
        there.close()
        assert here.poll(60)
        assert here.recv() == "ready"
        return process, here, lane

    def end(consumer: tuple[Any, Any, int]) -> None:
        process, here, lane = consumer
        process.kill()
        process.join()
        process.close()
        here.close()
        ring.dismiss(lane)

    steady = begin()
    for number in range(many):
        mortal = begin()
        for step in range(random.randrange(4)):
            content = (number + step) % 256
            array = ring.loan(actors.SHAPE, np.uint8)
            assert array is not None, ring.counts
            array[:] = content
            lease = ring.place(array)
            head = head_of(array, lease)
            assert lease is not None
            del array
            for _, here, _ in (steady, mortal):
                here.send(head)
            assert steady[1].recv() == (content, content)
            ring.done(lease)
            if random.random() < 0.3:
                break  # it dies while it looks
            assert mortal[1].recv() == (content, content)
        end(mortal)
    steady[1].send(None)
    assert steady[1].recv() is None
    assert ring.free == 6
    end(steady)
    assert sum(path.stat().st_blocks for path in SHM.glob(f"{ring.name}*")) == size
    ring.close()


@pytest.mark.rule("L5")
def test_a_fifo_of_somebody_else_under_the_name_of_a_segment_stops_nobody() -> None:
    """To open it in the usual way would wait for whoever opens its other end."""
    fifo = SHM / f"hfg-{REALM}-1-edge_0"
    os.mkfifo(fifo, 0o666)
    try:
        sweep(f"hfg-{REALM}-")
        with pytest.raises(SharedMemoryError):
            open_existing(fifo.name, writable=False)
    finally:
        fifo.unlink(missing_ok=True)

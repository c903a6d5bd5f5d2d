"""Processes that the tests kill: a producer and a consumer of a ring, as busy as they can be."""

from __future__ import annotations

from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from hfg.encoding import ArrayHead
from hfg.sharedmemory import Reader, Ring

SHAPE = (64, 1024)


def produce(name: str, slots: int, told: Connection) -> None:
    """Make a ring, then loan, place and take back for ever."""
    told.send("begin")
    ring = Ring(name, slots, 2**16, smallest=1)
    ring.admit()
    told.send("ready")
    while True:
        array = ring.loan(SHAPE, np.uint8)
        assert array is not None
        array[:] = 1
        lease = ring.place(array)
        assert lease is not None
        ring.done(lease)
        lane = ring.admit()
        ring.dismiss(lane)


def consume(name: str, lane: int, inbox: Connection) -> None:
    """View what it is told of, hold some of it, and tell what it has seen."""
    reader = Reader(name, lane, lambda segment: segment == name)
    inbox.send("ready")
    held: list[Any] = []
    while True:
        head: ArrayHead | None = inbox.recv()
        if head is None:
            held.clear()
            inbox.send(None)
            continue
        held.append(reader.view(head))
        held[:] = held[-2:]
        inbox.send((int(held[-1].min()), int(held[-1].max())))

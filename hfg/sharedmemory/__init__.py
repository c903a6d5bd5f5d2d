"""Large arrays between processes of one host without a copy: a ring of slots in shared memory that are leased.

    names   what segments are called, and sweeping up after those that were killed
    ring    the producer's side: loans slots, and gets them back
    reader  a consumer's side: read-only views

A producer keeps one `Ring` for an output and puts a `Lease` into what it sends; a consumer views the array with a
`Reader`. A slot is free again when the producer's link says that the token is done and nobody holds a view any more, so
the slots are the credits and nothing is ever overwritten under a reader. Only Linux has it; `unavailable()` says why
not. Knows neither links nor an event loop.
"""

from hfg.sharedmemory.names import segment_name, segment_prefix, sweep, unavailable
from hfg.sharedmemory.reader import Reader
from hfg.sharedmemory.ring import Ring, RingCounts

__all__ = ["Reader", "Ring", "RingCounts", "segment_name", "segment_prefix", "sweep", "unavailable"]

"""Large arrays between processes of one host without a copy: a ring of leased slots in shared memory.

    names   names of segments, and removing segments of processes that were killed
    ring    the producer's side: loans slots, and gets them back
    reader  a consumer's side: read-only views

A producer keeps one `Ring` per output and puts a `Lease` into the messages that it sends; a consumer views the array
with a `Reader`. A slot is free again when the producer's link reports the token as acknowledged and no view of it
exists any more. So the slots are the credits, and a slot is never overwritten while a reader uses it. Available on
Linux only; `unavailable()` returns the reason. Does not depend on links or an event loop.
"""

from hfg.sharedmemory.names import segment_name, segment_prefix, sweep, unavailable
from hfg.sharedmemory.reader import Reader
from hfg.sharedmemory.ring import Ring, RingCounts

__all__ = ["Reader", "Ring", "RingCounts", "segment_name", "segment_prefix", "sweep", "unavailable"]

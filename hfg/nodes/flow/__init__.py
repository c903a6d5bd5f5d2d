"""The ways that values take: passed on, chosen, kept, joined, collected, and brought from one rate to another.

    passing     one in, one out: relay, the first ones, those that differ, a value as an event, the end as an event
    routing     several ways: merge, mux, demux, switch, gate
    joining     what belongs together: by step, by stamp, the newest of each; sample and hold
    keeping     values that are kept and given again: latch, buffer, cache, a cell that nodes share
    collecting  several values as one: counters, the last ones, windows
    timing      values that come later or less often: delay, debounce, throttle
    background  work concurrent with the stream

All of them pass on values, never token objects (rule A4), so activity passes through them only over active edges, as it
does through any node. `docs/howto/library.md` shows how to choose.
"""

from hfg.nodes.flow.background import Background
from hfg.nodes.flow.collecting import Accumulate, Count, CountItems, Recent, TimeWindow, Window
from hfg.nodes.flow.joining import CombineLatest, Join, JoinByStamp, SampleAndHold, Synchronizer
from hfg.nodes.flow.keeping import Cache, HoldableBuffer, Latch, MemoryCell, TriggeredLatch
from hfg.nodes.flow.passing import (
    AtEnd,
    Different,
    Distinct,
    EveryNth,
    MarkerDetector,
    MessageEvent,
    ProcessSignal,
    Skip,
    Take,
    TakeWhile,
    relay,
)
from hfg.nodes.flow.routing import Demux, Gate, Merge, Mux, Rejoin, switch
from hfg.nodes.flow.timing import Debounce, Delay, Throttle

__all__ = [
    "Accumulate",
    "AtEnd",
    "Background",
    "Cache",
    "CombineLatest",
    "Count",
    "CountItems",
    "Debounce",
    "Delay",
    "Demux",
    "Different",
    "Distinct",
    "EveryNth",
    "Gate",
    "HoldableBuffer",
    "Join",
    "JoinByStamp",
    "Latch",
    "MarkerDetector",
    "MemoryCell",
    "Merge",
    "MessageEvent",
    "Mux",
    "ProcessSignal",
    "Recent",
    "Rejoin",
    "SampleAndHold",
    "Skip",
    "Synchronizer",
    "Take",
    "TakeWhile",
    "Throttle",
    "TimeWindow",
    "TriggeredLatch",
    "Window",
    "relay",
    "switch",
]

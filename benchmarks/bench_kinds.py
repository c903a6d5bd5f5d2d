"""Each kind of node and edge at the same work, beside asyncio.Queue and reactivex.

Measured: the steady state of a run, from the arrival of the first tenth of the tokens at the sink until that of the
  last (A, C, E), or each token's own round (B); all rules are in force and nobody observes. Not measured: building and
  starting (see bench_shape) and user code (each node passes on).
"""

from __future__ import annotations

from benchmarks.ours import KINDS
from benchmarks.peers.queues import Queues
from benchmarks.peers.with_reactivex import Reactivex
from benchmarks.works import cases

HOPS = 80_000
COLUMNS = ("A1", "A10", "A50", "B10", "C", "E0", "E")
ROWS = [*KINDS, Queues(), Reactivex()]
DISTRIBUTIONS = ("hfg", "reactivex")
CASES = cases(ROWS, COLUMNS, HOPS)

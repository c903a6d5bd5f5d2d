"""The same work by hfg and others, in the same run; who is not installed is named and skipped.

Measured: as in bench_kinds, with fewer tokens (some are slow). The same number of tokens, the same values and the same
  depth for all; what each of them leaves out of the work is said beside its figures.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from benchmarks.ours import KINDS, Machine, States
from benchmarks.works import Participant, cases

HOPS = 60_000
RUNS = 3
COLUMNS = ("A1", "A10", "A50", "B1", "B10", "B50", "C", "S")
FLOW = ("chain", "flight", "join")


class Row(Participant):
    """A participant under its name on the page, with the works that are compared."""

    def __init__(self, name: str, participant: Any, *works: str) -> None:
        self.name = name
        for work in works:
            setattr(self, work, getattr(participant, work))


class Late:
    """A participant that is imported when it has something to do: the others' processes stay free of it."""

    def __init__(self, module: str, name: str) -> None:
        self.module = module
        self.name = name

    def __getattr__(self, work: str) -> Any:
        def do(*arguments: int) -> Any:
            peers = import_module(f"benchmarks.peers.{self.module}").PEERS
            return getattr(next(peer for peer in peers if peer.name == self.name), work)(*arguments)

        return do


def peer(name: str, module: str, *works: str) -> Row:
    """A row of another framework."""
    return Row(name, Late(module, name), *works)


NEEDED = {
    peer("reactivex", "with_reactivex", *FLOW): "reactivex",
    peer("csp", "with_csp", *FLOW): "csp",
    peer("aiostream", "with_aiostream", *FLOW): "aiostream",
    peer("streamz", "with_streamz", *FLOW): "streamz",
    peer("ezmsg", "with_ezmsg", *FLOW): "ezmsg",
    peer("transitions", "with_transitions", "step"): "transitions",
    peer("py_trees", "with_py_trees", "step"): "py_trees",
}
"""The rows that need a package, and which."""

MISSING = [f"{package} is not installed" for package in NEEDED.values() if find_spec(package) is None]
DISTRIBUTIONS = ("hfg", *(package for package in NEEDED.values() if find_spec(package) is not None))
CASES = cases(
    [
        Row("hfg, functions", KINDS[0], *FLOW),
        Row("hfg, async functions", KINDS[2], *FLOW),
        Row("hfg, activity round ten nodes", States(), "step"),
        Row("hfg, a StateMachine of ten states", Machine(), "step"),
        peer("plain calls", "plain", *FLOW),
        peer("await in place", "plain", "chain"),
        peer("asyncio.Queue(1)", "queues", *FLOW),
        *(row for row, package in NEEDED.items() if package in DISTRIBUTIONS),
    ],
    COLUMNS,
    HOPS,
)

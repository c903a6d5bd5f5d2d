"""What hfg has to reach, beside whom, and whether it does: `make bench-goals`, or `--against DIR` for all of it.

Measured: each case as in the suite it comes from, in fresh processes, several rounds there and back; the figure of a
  goal is the median of the rounds' ratios. Where somebody computes it is processor time, so that others on the machine
  lengthen it less; where somebody waits (stages, the camera, edits, rates) it is the clock.
Not measured: who is not installed, and what the engine does not do; both are named in the table.
Everybody gets the same number of tokens and the same values, and times go from the arrival of the first tenth to that
  of the last.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from benchmarks import asking, bench_edits, bench_shape, rates, threaded, variants
from benchmarks.goals import Goal, Side
from benchmarks.measure import BEFORE, Case
from benchmarks.ours import ASYNC, FUNCTION, SUSPENDING, Machine

HOPS = 500_000
LETTERS = 4_000
REQUESTS = 200
STAGE_TOKENS = 100
PICTURES = 20 * threaded.PHOTOGRAPHS
SECONDS = 20
NOT_WORSE = 1.05
"""As it was before, but for what the machine makes of it."""
DISTRIBUTIONS = ("hfg", "csp", "reactivex", "transitions", "opencv-python-headless")

CASES: dict[str, Case] = {}
GOALS: list[Goal] = []
SKIPPED: dict[str, str] = {}
"""The cases that cannot be measured here, and why."""


def goal(
    name: str, ours: str, peer: str | float, at_most: float, *, by: str = "cpu", peer_by: str = "", alone: bool = False
) -> None:
    """Compare two cases, or one with a number."""
    other = Side(peer, peer_by or by) if isinstance(peer, str) else peer
    GOALS.append(Goal(name, Side(ours, by), other, at_most, alone))


def case(name: str, run: Callable[[int], Any], size: int, unit: str = "us", needs: str = "") -> str:
    """Add one if what it needs is installed; gives its name."""
    missing = next((module for module in needs.split() if find_spec(module) is None), None)
    if missing is None:
        CASES.setdefault(name, Case(run, size, unit))
    else:
        SKIPPED[name] = f"{missing} is not installed"
    return name


def peer(module: str, who: str, work: str, *made_with: Any) -> Callable[..., Any]:
    """The work of another package, which is imported on use, so that other processes do not load it."""

    def do(*arguments: int) -> Any:
        return getattr(getattr(import_module(f"benchmarks.peers.{module}"), who)(*made_with), work)(*arguments)

    return do


def flows() -> None:
    """Functions: chains, forks and joins, silence, an edge that could be active."""
    function, tokens = FUNCTION, {length: HOPS // (length + 1) for length in (1, 10, 50)}
    chain = {length: f"chain of {length}" for length in tokens}
    for length, count in tokens.items():
        name = chain[length]
        ours = case(f"hfg, {name}", partial(function.chain, length), count)
        csp = case(f"csp, {name}", partial(peer("with_csp", "Csp", "chain"), length), count, needs="csp")
        maps = case(f"reactivex, {name}", partial(peer("with_reactivex", "Reactivex", "chain"), length), count)
        goal(f"{name} / csp", ours, csp, 0.6 if length == 50 else 0.5)
        goal(f"{name} / reactivex", ours, maps, 0.5)
        if length == 50:
            bare = case(f"bare calls, {name}", partial(peer("plain", "Bare", "chain"), length), count)
            goal(f"{name} / bare calls", ours, bare, 2.5)
        watched = case(f"hfg, {name}, statistics", partial(variants.measured, length), count)
        goal(f"{name}: with statistics / without", watched, ours, 1.5)

    ours = case("hfg, fork and join", function.join, HOPS // 6)
    zipped = case("reactivex, fork and join", peer("with_reactivex", "Reactivex", "join"), HOPS // 6)
    csp = case("csp, fork and join", peer("with_csp", "Csp", "join"), HOPS // 6, needs="csp")
    goal("fork and join / reactivex zip", ours, zipped, 0.6)
    goal("fork and join / csp", ours, csp, 1.0)

    half = case("hfg, half of the values silent", partial(variants.silent, True), tokens[10])
    none = case("hfg, none silent", partial(variants.silent, False), tokens[10])
    goal("half of the values silent / none", half, none, 1.2)
    edge = case("hfg, an active edge", variants.active_edge, tokens[10])
    goal("an active edge, nobody active / none", edge, "hfg, chain of 10", 1.2)


def signals() -> None:
    """Events and slots."""
    tokens = HOPS // 22
    ours = case("hfg, event → slot", variants.signals, tokens)
    subjects = case("reactivex, subjects", partial(peer("with_reactivex", "Reactivex", "signals"), 10), tokens)
    goal("event → slot, chain of 10 / reactivex subjects", ours, subjects, 1.0)
    for slots in (1, 10):
        count = HOPS // 5 // slots
        output = case(f"hfg, an output to {slots}", partial(variants.fan, variants.Values, slots), count)
        event = case(f"hfg, an event to {slots}", partial(variants.fan, variants.Pulses, slots), count)
        goal(f"output → slot / event → slot, {slots} of them", output, event, 1.3)


def coroutines() -> None:
    """Async functions."""
    tokens = HOPS // 22
    for kind, node, at_most in ((ASYNC, "through", 0.2), (SUSPENDING, "through_waiting", 1.0)):

        def queues(count: int, node: str = node) -> dict[str, float]:
            module = import_module("benchmarks.peers.queues")
            figures: dict[str, float] = module.Queues(getattr(module, node)).chain(10, count)
            return figures

        ours = case(f"hfg, {kind.name}", partial(kind.chain, 10), tokens)
        theirs = case(f"asyncio.Queue(1), {kind.name}", queues, tokens)
        goal(f"{kind.name}, chain of 10 / asyncio.Queue(1)", ours, theirs, at_most)


def requests() -> None:
    """Requests that wait, several at once."""
    ours = case(f"hfg, {REQUESTS} requests", asking.by_hfg, REQUESTS, "s")
    by_hand = case(f"by hand, {REQUESTS} requests", asking.by_hand, REQUESTS, "s")
    goal(f"{REQUESTS} requests of 80 ms, 8 at once / semaphore and gather", ours, by_hand, 1.1, by="wall")


def machines() -> None:
    """State machines of a few and of many states."""
    for states in (10, 100):
        ours = case(f"hfg, {states} states", Machine(states).step, LETTERS)
        step = peer("with_transitions", "Transitions", "step", states)
        theirs = case(f"transitions, {states} states", step, LETTERS, needs="transitions")
        goal(f"a letter to {states} states / transitions", ours, theirs, 1.0)
    goal("a letter to 100 states / to 10", "hfg, 100 states", "hfg, 10 states", 1.3)


def threads() -> None:
    """Work that overlaps."""
    for number in (2, 3, 4):
        ours = case(f"hfg, {number} stages", partial(threaded.stages, number), STAGE_TOKENS, "s")
        goal(f"{number} stages of 20 ms in threads / ideal", ours, ours, 1.05, by="wall", peer_by="ideal")
    for who, way in (("hfg", threaded.by_groups), ("by hand", threaded.by_hand)):
        case(f"{who}, the camera", partial(threaded.camera, way), PICTURES, needs="cv2 skimage")
    goal("the camera, two groups / threads by hand", "hfg, the camera", "by hand, the camera", 1.1, by="wall")


def clocks() -> None:
    """Rates on the real clock: percent."""
    for rate in (30, 100, 500, 1000):
        ours = case(f"hfg, {rate} Hz", partial(rates.error, rates.by_hfg, rate), rate * SECONDS, "%")
        timer = case(f"asyncio, {rate} Hz", partial(rates.error, rates.by_asyncio, rate), rate * SECONDS, "%")
        goal(f"mean error at {rate} Hz (beside: asyncio)", ours, timer, 0.2, by="error", alone=True)
        if rate >= 500:  # where the machine itself pauses for longer than a period, now and then
            by = partial(rates.error, rates.by_asyncio_without_bursts, rate)
            timer = case(f"asyncio without bursts, {rate} Hz", by, rate * SECONDS, "%")
            goal(f"mean error at {rate} Hz (beside: asyncio by F11)", ours, timer, 0.2, by="error", alone=True)


def sizes() -> None:
    """Ten thousand nodes, as before; and edits in many."""
    for name, by in (("memory of a node", "value"), ("build and check", "cpu"), ("hop", "cpu")):
        ours = f"{name} | {bench_shape.LARGEST}"
        if ours not in bench_shape.CASES:
            SKIPPED[ours] = "this system does not tell it"
        else:
            CASES[ours] = bench_shape.CASES[ours]
        SKIPPED[BEFORE + ours] = "needs --against DIR, a checkout of hfg"
        goal(f"{name}, {bench_shape.LARGEST:,} nodes / before", ours, BEFORE + ours, NOT_WORSE, by=by)
    for name in ("add a node", "remove a node"):
        for length in (1_000, 10_000):
            ours = f"{name} | {length}"
            if ours in bench_edits.CASES:
                CASES[ours] = bench_edits.CASES[ours]
            else:
                SKIPPED[ours] = "bench_edits has no such case"
            goal(f"{name}, in {length:,} / 1 ms", ours, 1.0, 1.0, by="value")


for _part in (flows, signals, coroutines, requests, machines, threads, clocks, sizes):
    _part()

AGAINST = [name for name in CASES if BEFORE + name in SKIPPED]
"""What `--against` measures with the other checkout too."""

"""What a run requires of its graph and its options: each function raises an error that says what to change (R1, R6)."""

from __future__ import annotations

import asyncio
import inspect

from hfg.base.logs import Log
from hfg.engine.runtime.settings import Settings
from hfg.errors import CheckFailed, GraphError, UsageError
from hfg.graph.checks import check_flat
from hfg.graph.checks.endless import endless
from hfg.graph.flat import FlatGraph

__all__ = [
    "need_begin",
    "need_clock",
    "need_no_loop",
    "need_no_problem",
    "need_no_real_clock",
    "need_use_of_seed",
    "no_graph",
    "refuse_endless",
]

_GRAPH = Log("hfg.graph")


def need_clock(clock: str) -> None:
    """Refuse a clock of another name."""
    if clock not in ("real", "virtual"):
        raise UsageError(f'clock must be "real" or "virtual", got {clock!r}')


def need_no_loop() -> None:
    """Refuse to block a running event loop."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return
    raise UsageError("hfg.run blocks, and an event loop is running here: write `report = await hfg.run_async(graph)`")


def no_graph(found: object) -> UsageError:
    """Return the error for something that is not a graph."""
    how = f"hfg.run({found.__name__}())" if inspect.isfunction(found) else "hfg.run(graph)"
    return UsageError(f"a Graph can run, not {type(found).__name__}: write {how}")


def need_no_real_clock(settings: Settings) -> None:
    """In virtual time, refuse options that have an effect only on the real clock."""
    if settings.watch_said and settings.watch:
        raise UsageError(
            "watch= needs the real clock: in virtual time a run is over before anybody looks; leave watch= out, or "
            'write clock="real"'
        )
    if settings.settings is not None:
        raise UsageError(
            "settings= needs the real clock: in virtual time all parts of a graph share one loop; leave settings= "
            'out, or write clock="real"'
        )


def need_no_problem(flat: FlatGraph) -> None:
    """Refuse a graph with errors; what else the checks found is logged."""
    problems = check_flat(flat)
    if any(problem.severity == "error" for problem in problems):
        raise CheckFailed(problems)
    for problem in problems:
        if problem.severity == "warning":
            _GRAPH.warning('"%s": %s: %s; %s', problem.path, problem.what, problem.why, problem.remedy)


def need_use_of_seed(flat: FlatGraph, settings: Settings) -> None:
    """Refuse a seed if no policy and no pause before a retry draws random numbers."""
    policies = [settings.policy] if settings.policy else [group.policy for group in flat.groups.values()]
    if settings.seed is None or "random" in policies:
        return
    if not any(node.options.retry_jitter for one in flat.walk() for node in one.nodes):
        raise UsageError(
            f'seed={settings.seed} has no effect, for no group of graph "{flat.level.name}" has the policy "random": '
            f'write policy="random", seed={settings.seed}, or leave it out'
        )


def need_begin(begin: object) -> None:
    """Refuse anything but a plain function that takes the run."""
    if begin is None:
        return
    if not callable(begin) or inspect.iscoroutinefunction(begin):
        raise UsageError(
            f"begin= is a plain function that takes the run, as in begin=lambda run: ..., got {begin!r:.80}; for what "
            "waits, write `async with hfg.running(graph) as run:`"
        )
    try:
        inspect.signature(begin).bind(None)
    except TypeError as error:
        raise UsageError(f"begin= takes the run, as in begin=lambda run: ..., and this one does not: {error}") from None
    except ValueError:
        pass  # a builtin that does not tell


def refuse_endless(flat: FlatGraph) -> None:
    """R6: under a virtual clock a source that never ends and waits for nothing would hold time still forever.

    Only where that is certain; else the engine notices that time has stood still for millions of firings.
    """
    for node in endless(flat, virtual=True):
        raise GraphError(
            f'source "{node.path}" has no rate, waits for nothing and never ends, so virtual time would stand still '
            "for ever: give it max_rate_hz=, or let it raise hfg.EndOfStream"
        )

"""Which sources still work for somebody: when none of those that are left does, they keep no run alive (rule R5).

Judged anew whenever a node ends, is enabled, disabled or reset, a gate lets a source rest or go on, and the structure
changes; never per token. Stands on `agenda`.
"""

from __future__ import annotations

from collections.abc import Collection

from hfg.engine.model.core import Core
from hfg.engine.model.worker import DISABLED, ENDED, FUTILE, RESTING, Worker
from hfg.engine.rules.agenda import unblock

__all__ = ["judge_sources"]


def judge_sources(core: Core) -> None:
    """Sources are futile as long as all that are left work for nobody; one that rests keeps no run alive (A11)."""
    if not core.futile and any(_works_for_somebody(one) for one in core.sources):
        return  # as mostly, and seen at the first of them
    left = [one for one in core.sources if not one.blocked & (ENDED | DISABLED | RESTING)]
    core.futile = bool(left) and len(_for_nobody(left)) == len(left)
    for source in core.sources:
        if core.futile and source in left:
            if not source.blocked & FUTILE:
                source.block(FUTILE)
        else:
            unblock(source, FUTILE)


def _works_for_somebody(source: Worker) -> bool:
    """Whether it is left and works for one that has not ended and is no source itself."""
    return not source.blocked & (ENDED | DISABLED | RESTING) and any(
        not edge.joins() or not (edge.target.blocked & ENDED or edge.target.is_source)
        for edge in source.all_out_edges()
    )


def _for_nobody(sources: Collection[Worker]) -> set[Worker]:
    """Those with edges only into nodes that have ended, or into others of them: a source given up counts as ended."""
    found: set[Worker] = set()
    while more := {source for source in sources if source not in found and _feeds_only(source, found)}:
        found |= more
    return found


def _feeds_only(source: Worker, given_up: Collection[Worker]) -> bool:
    edges = list(source.all_out_edges())
    return bool(edges) and all(edge.joins() and (_is_over(edge.target) or edge.target in given_up) for edge in edges)


def _is_over(worker: Worker) -> bool:
    """Whether it has said END, too."""
    return bool(worker.blocked & ENDED) and worker.deferred is None

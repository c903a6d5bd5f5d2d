"""Which sources still have a consumer: the others are dead sources, which do not keep a run alive (rule R5).

Judged anew whenever a node ends, is enabled, disabled or reset, and when the structure changes; never per token. Stands
on `agenda`.
"""

from __future__ import annotations

from collections.abc import Collection

from hfg.engine.model import Core
from hfg.engine.model.running_node import DEAD_SOURCE, DISABLED, ENDED, RunningNode
from hfg.engine.rules.agenda import unblock

__all__ = ["find_dead_sources"]


def find_dead_sources(core: Core) -> None:
    """Find the dead sources, and let them rest: an endless one would hide that the others have stalled."""
    if not core.dead_sources and all(_works_for_somebody(one) for one in core.sources):
        return  # as mostly
    core.dead_sources = _for_nobody([one for one in core.sources if not one.blocked & (ENDED | DISABLED)])
    resting = _holding_nobody_up(core.dead_sources)
    for source in core.sources:
        if source not in resting:
            unblock(source, DEAD_SOURCE)
        elif not source.blocked & DEAD_SOURCE:
            source.block(DEAD_SOURCE)


def _works_for_somebody(source: RunningNode) -> bool:
    """Whether it is over itself, or feeds a node that has not ended and is not a source."""
    return bool(source.blocked & (ENDED | DISABLED)) or any(
        not edge.joins() or not (edge.target.blocked & ENDED or edge.target.is_source)
        for edge in source.all_out_edges()
    )


def _for_nobody(sources: Collection[RunningNode]) -> set[RunningNode]:
    """Those with edges only into nodes that have ended, or into others of them: a source given up counts as ended."""
    found: set[RunningNode] = set()
    while more := {source for source in sources if source not in found and _feeds_only(source, found)}:
        found |= more
    return found


def _feeds_only(source: RunningNode, given_up: Collection[RunningNode]) -> bool:
    edges = list(source.all_out_edges())
    return bool(edges) and all(edge.joins() and (_is_over(edge.target) or edge.target in given_up) for edge in edges)


def _holding_nobody_up(dead_sources: Collection[RunningNode]) -> set[RunningNode]:
    """Those to whom nothing more comes, but from others of them; who feeds one of the rest may work for others, too."""
    found = set(dead_sources)
    while fed := {source for source in found if any(_still_comes(edge.source, found) for edge in source.in_edges)}:
        found -= fed
    return found


def _still_comes(sender: RunningNode, resting: Collection[RunningNode]) -> bool:
    return sender not in resting and not sender.blocked & DISABLED and not _is_over(sender)


def _is_over(worker: RunningNode) -> bool:
    """Whether it has said END, too."""
    return bool(worker.blocked & ENDED) and (worker.ending is None or worker.ending.deferred is None)

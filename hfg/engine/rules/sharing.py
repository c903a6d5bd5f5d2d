"""What becomes of it when a value that is shared is changed (rule T1); in debug mode, which `core.sharing` tells.

Depends on `running_node`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.base.token import Token
from hfg.engine.model.running_node import RunningNode
from hfg.errors import UsageError
from hfg.ports.edges import Edge

__all__ = ["need_unchanged", "need_unwritten", "taken"]


def taken(worker: RunningNode, edges: Sequence[Edge], tokens: Sequence[Token[Any]]) -> None:
    """A firing or call has taken these tokens. If one was changed on its edge, its sender has failed."""
    sharing = worker.core.sharing
    if sharing is None:
        return
    for edge in sharing.take(worker, edges, tokens):
        problem = UsageError(
            f'a value that it sent on "{edge.label}" was changed before "{worker.path}" took it, but what is sent is '
            "shared and not changed (T1): send a copy, or make a new one each time"
        )
        worker.core.rules.fail(edge.source, "what it has sent", problem, answer=False)


def need_unchanged(worker: RunningNode) -> None:
    """The code of a firing or call is over: it has left what it took as it was.

    Raises:
      UsageError: it has not.
    """
    sharing = worker.core.sharing
    changed = None if sharing is None else sharing.changed_by(worker)
    if changed is not None:
        edge, sender_ran = changed
        perhaps = f', perhaps by "{edge.source.path}"' if sender_ran else ""
        raise UsageError(
            f'the value that it took from "{edge.label}" was changed meanwhile{perhaps}, but what is taken is shared '
            "and not changed (T1): change a copy, as in list(values) or copy.deepcopy(value)"
        )


def need_unwritten(worker: RunningNode, port: str, value: Any) -> None:
    """A node sends a value: refuse one that was sent before and written to since, while other nodes hold it.

    Raises:
      UsageError: it is.
    """
    sharing = worker.core.sharing
    if sharing is not None and sharing.rewritten(value.value if type(value) is Token else value):
        raise UsageError(
            f'"{worker.path}.{port}" sends an array again that was sent before and written to since, and somebody '
            "still holds what was sent before and has seen it change (T1): send a copy, as in frame.copy(), or a new "
            "array each time"
        )

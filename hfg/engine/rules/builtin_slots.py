"""What the automatic slots of every node do: enable, disable, activate, deactivate, reset (rules A7, A9).

And the graph's own: stop, abort (A10).

Depends on `node_lifecycle` and `modifiers`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hfg.base.token import Token
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import node_lifecycle, subgraphs
from hfg.engine.rules.modifiers import set_active
from hfg.errors import Aborted, shown

__all__ = ["run"]


def run(worker: RunningNode, name: str, token: Token[Any], then: Callable[[], None]) -> None:
    """Do what the slot says; `then` follows, at once unless setup or teardown waits."""
    host = worker.core.runtime
    if worker.scope is not None:
        subgraphs.run_slot(worker.scope, name, then)
    elif name == "activate":
        set_active(worker, True, "slot")
        then()
    elif name == "deactivate":
        worker.let_carry(False)
        set_active(worker, False, "slot")
        then()
    elif name == "enable":
        node_lifecycle.enable(worker, then)
    elif name == "disable":
        node_lifecycle.disable(worker)
        then()
    elif name == "reset":
        node_lifecycle.reset(worker, then)
    elif name == "stop":
        then()
        host.finish("stopped", None)
    else:
        caller = _caller(worker)
        then()
        reason = "" if token.value is None else f": {shown(token.value, 200)}"
        host.finish("aborted", Aborted(f'the graph\'s slot "abort" was called by "{caller}"{reason}'))


def _caller(worker: RunningNode) -> str:
    edge = worker.call_edge
    return edge.label.split(" -> ")[0] if edge is not None else "outside"

"""Declaring the inputs and outputs of the whole graph (rule P10). Depends on levels and types."""

from __future__ import annotations

from typing import Literal

from hfg.errors import GraphError
from hfg.graph.structure.level import Level
from hfg.graph.structure.naming import need_name
from hfg.types import is_hint

__all__ = ["need_new_port"]


def need_new_port(level: Level, kind: Literal["input", "output"], name: str, hint: object) -> None:
    """Refuse a port that cannot be, and what is no change by hand.

    Raises:
      GraphError: the name is taken or not allowed, the type is none, or this is the inside of a subgraph.
    """
    level.need_rest("declaring a port")
    if level.owner is not None:
        raise GraphError(
            f'the graph inside "{level.path}" has the ports of its subgraph; '
            f"declare `{name} = hfg.{kind.title()}(...)` in its class"
        )
    need_name(f"an {kind} of the graph", name)
    if name in level.ports.by_name():
        raise GraphError(f'{level.title} has a port "{name}" already; choose another name')
    if not is_hint(hint):
        raise GraphError(
            f'the type of {kind} "{name}" is {hint!r:.80}, which is no type; write graph.{kind}("{name}", int)'
        )

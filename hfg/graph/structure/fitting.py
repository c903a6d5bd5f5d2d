"""Which options fit which node: what a type's code cannot do is refused where it is asked for (rules F14, X1).

What depends on groups and edges too, which may come later, is for the check. Depends on options.
"""

from __future__ import annotations

from hfg.errors import GraphError
from hfg.graph.structure.options import NodeOptions
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node

__all__ = ["need_fitting"]


def need_fitting(node: Node, path: str, options: NodeOptions) -> None:
    """Refuse firings beside each other, or once more, for a node whose code does not allow that.

    Raises:
      GraphError: naming the option, with the remedy.
    """
    if options.concurrency > 1:
        _need_separate_firings(node, f'node "{path}": concurrency={options.concurrency}', options)
    if options.retries:
        _need_repeatable(node, f'node "{path}": retries={options.retries}')


def _need_separate_firings(node: Node, said: str, options: NodeOptions) -> None:
    """F14: several firings may be under way at once."""
    kind = node._type
    _need_firings_of_its_own(node, said)
    if kind.process_kind in ("generator", "async generator"):
        raise GraphError(
            f"{said} lets several firings be under way at once, but the firings of a generator are its steps, one "
            "after the other (rule F14); write an async function, or leave concurrency out"
        )
    if "ready" in kind.hooks:
        raise GraphError(
            f"{said} does not go together with ready(), which is asked between two firings (rule F14); "
            "leave concurrency out, or await in process() what ready() looks for"
        )
    if options.release == "sequential":
        raise GraphError(
            f'{said} does not go together with release="sequential", for its tokens count as processed as soon as they '
            "are taken (rule F14); leave release out"
        )


def _need_repeatable(node: Node, said: str) -> None:
    """X1: a firing that has failed is run again with the same values."""
    kind = node._type
    _need_firings_of_its_own(node, said)
    if kind.process_kind in ("generator", "async generator"):
        raise GraphError(
            f"{said} would run a firing again, but a generator that has raised is over (rule X1); "
            'leave retries out, or say on_error="restart"'
        )
    if kind.states:
        raise GraphError(
            f"{said} would run a firing again with what the failed attempt has left in its state "
            f'"{next(iter(kind.states))}" (rule X1); leave retries out, or keep the state in a node behind it'
        )


def _need_firings_of_its_own(node: Node, said: str) -> None:
    if is_box(node):
        raise GraphError(
            f"{said} is for nodes that run code, and a subgraph runs that of others; say it inside, in build()"
        )
    if node._type.process_kind == "none":
        raise GraphError(f"{said} is about firings, but {node._type.name} has no process function; leave it out")

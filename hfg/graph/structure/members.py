"""Who may become a member of a graph, and which options fit whom. Stands on nodes, options and naming."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hfg.errors import GraphError
from hfg.graph.structure.boxes import is_box
from hfg.graph.structure.naming import path_of, suggest
from hfg.graph.structure.options import NodeOptions
from hfg.nodetype import Node

__all__ = ["iterated_inputs", "need_new", "need_subgraph_options", "refuse_move"]


def need_new(node: Any) -> None:
    """Refuse what is no node or is in a graph already.

    Raises:
      GraphError: saying what to add instead.
    """
    if not isinstance(node, Node):
        name = getattr(node, "__name__", None)
        if name is not None and hasattr(node, "_type"):
            remedy = f"make a node of it: graph.add({name}())"
        else:
            remedy = "make a node type of a function with hfg.node, or derive a class from hfg.Node"
        raise GraphError(f"graph.add takes a node, got {node!r}; {remedy}")
    if type(node).__init__ is not Node.__init__:  # what a decorator such as @dataclass does behind the declaration
        raise GraphError(
            f"node type {type(node).__name__} was given an __init__, by a decorator such as @dataclass: leave that out "
            "and declare hfg.Parameter and hfg.State"
        )
    place = node._place
    if place is not None:
        raise GraphError(
            f'node "{place.path}" is in {place.graph._title} already, and a node is in one place; '
            f"make another: {node._type.qualname}(...)"
        )


def iterated_inputs(node: Node, path: str, given: Iterable[str]) -> tuple[str, ...]:
    """Give the names of the inputs that a subgraph iterates over, as said in `add` or else by its type (rule G4).

    Raises:
      GraphError: the node is no subgraph, or has no such input.
    """
    if not isinstance(given, Iterable):
        raise GraphError(f'node "{path}": iterate_over takes names of inputs, as in ("items",), got {given!r}')
    names = (given,) if isinstance(given, str) else tuple(given)
    if not is_box(node):
        if names:
            raise GraphError(
                f'node "{path}": iterate_over is for subgraphs, got {names!r}; put it into an hfg.Subgraph'
            )
        return ()
    names = names or tuple(getattr(node, "iterate_over", ()))
    for name in names:
        if name not in node._type.inputs:
            raise GraphError(
                f'subgraph "{path}": iterate_over names "{name}", which is no input; {suggest(name, node._type.inputs)}'
            )
    return names


def need_subgraph_options(node: Node, options: NodeOptions) -> None:
    """Refuse options about firings for a subgraph that is dissolved: it never fires.

    Raises:
      GraphError: naming the option.
    """
    if options.iterate_over:
        return
    fitting = NodeOptions(group=options.group, active_for_s=options.active_for_s, enabled=options.enabled)
    for name in NodeOptions.__struct_fields__:
        if getattr(options, name) != getattr(fitting, name):
            raise GraphError(
                f'subgraph "{path_of(node)}": it does not fire itself, so {name} means nothing; '
                "give it to the nodes inside, in build()"
            )


def refuse_move(graph: Any, node: Any, group: Any) -> None:
    """Refuse to let a node run in another group; changes nothing.

    Raises:
      GraphError: the node is not in the graph, or the group is not declared.
    """
    if not isinstance(node, Node):
        raise GraphError(f"graph.move takes a node of the graph, got {node!r}; give the node itself, graph[path]")
    if node._place is None or node._place.graph._root is not graph._root:
        raise GraphError(f'"{path_of(node)}" is not in {graph._title}, so it cannot be moved there; add it first')
    if group is not None and group not in graph.groups:
        hint = suggest(group, graph.groups) if isinstance(group, str) else f"it has {', '.join(graph.groups)}"
        raise GraphError(
            f'"{path_of(node)}" cannot move to group {group!r}, which is not declared: {hint}; '
            'declare it first, as in graph.group("vision", threads=1)'
        )

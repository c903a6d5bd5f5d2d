"""Adding a node: who may become a member of a graph, and which options fit whom. Depends on levels and options."""

from __future__ import annotations

from collections.abc import Iterable

from hfg.errors import GraphError
from hfg.graph.structure.fitting import need_fitting
from hfg.graph.structure.given import node_options
from hfg.graph.structure.level import Level, inside, level_of, nodes_within
from hfg.graph.structure.membership import close_box, leave, open_box, settle
from hfg.graph.structure.naming import need_name, path_of, suggest
from hfg.graph.structure.option import having
from hfg.graph.structure.options import PLAIN_NODE, NodeGiven, NodeOptions
from hfg.graph.structure.refusals import Refusable
from hfg.graph.structure.subgraph import Box, is_box
from hfg.nodetypes.node import Node

__all__ = ["add"]


def add(level: Level, node: Node, name: str | None, given: NodeGiven) -> None:
    """Add a node; a subgraph builds its inside now.

    Args:
      level: where to.
      node: belongs to no graph yet.
      name: None for the next free one of its type.
      given: its options by name, as in `Graph.add`.

    Raises:
      GraphError: something about it cannot be; nothing was changed.
    """
    level.need_rest("adding a node")
    _need_new(node)
    base, number = node._type.name, 0
    if name is None:
        name, number = level.members.free_name(base)
    elif need_name("a node", name) in level.nodes:
        raise GraphError(
            f'{level.title} has a node "{name}" already; choose another name, or leave name out for the next free one'
        )
    path = level.path_to(name)
    said = _with_iterated(node, path, given)
    options = PLAIN_NODE
    with Refusable(path):
        options = node_options(f'node "{path}"', said)
        if options.iterate_over or not is_box(node):  # one that is dissolved is told more below
            need_fitting(node, path, options)
    level.members.append(name, node)
    settle(node, level, name, options)
    if is_box(node):
        _build(level, node, options)
    if number:
        level.members.count(base, number)


def _build(level: Level, node: Box, options: NodeOptions) -> None:
    """Let a subgraph make its inside; if that fails, nothing of it remains."""
    groups = level.whole.groups.state()
    try:
        _need_subgraph_options(node, options)
        inner = level.make_inside(node)
        open_box(node, inner)
        node._build()
    except BaseException:
        level.whole.groups.restore(groups)
        _take_back(level, node)
        raise


def _take_back(level: Level, node: Node) -> None:
    """Undo an addition that failed half-way, with everything that was added or connected meanwhile."""
    gone = set(nodes_within(node))
    for one in gone:
        inner = inside(one)
        if inner is not None:
            inner.gates.keep(lambda gate: False)
    level.members.remove(node.place.name)
    level.connections.keep(lambda edge: gone.isdisjoint((getattr(edge.source, "node", None), edge.target.node)))
    level.gates.keep(lambda gate: gone.isdisjoint((gate.target, gate.by)))
    for one in gone:
        leave(one)
        close_box(one)


def _need_new(node: object) -> None:
    """Refuse what is no node or is in a graph already."""
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
            f'node "{place.path}" is in {level_of(place.graph).title} already, and a node is in one place; '
            f"make another: {node._type.qualname}(...)"
        )


def _with_iterated(node: Node, path: str, given: NodeGiven) -> NodeGiven:
    """Return the options with the inputs that a subgraph iterates over, from `add` or from its type (rule G4)."""
    said = given.get("iterate_over", ())
    if not isinstance(said, Iterable):
        raise GraphError(f'node "{path}": iterate_over takes names of inputs, as in ("items",), got {said!r}')
    names = (said,) if isinstance(said, str) else tuple(said)
    if not is_box(node):
        if names:
            raise GraphError(
                f'node "{path}": iterate_over is for subgraphs, got {names!r}; put it into an hfg.Subgraph'
            )
        return given
    names = names or tuple(getattr(node, "iterate_over", ()))
    for name in names:
        if name not in node._type.inputs:
            raise GraphError(
                f'subgraph "{path}": iterate_over names "{name}", which is no input; {suggest(name, node._type.inputs)}'
            )
    return {**given, "iterate_over": names} if names else given


def _need_subgraph_options(node: Node, options: NodeOptions) -> None:
    """Refuse options about firings for a subgraph that is dissolved: it never fires."""
    if options.iterate_over:
        return
    for name in having(NodeOptions, ""):
        if name in options.said():
            raise GraphError(
                f'subgraph "{path_of(node)}": it does not fire itself, so {name} means nothing; '
                "give it to the nodes inside, in build()"
            )

"""Adding a node: what can become a member of a graph, and which options fit which node (rules F14, X1).

Problems that depend on groups and edges, which may be added later, are left to the checks.
"""

from __future__ import annotations

from collections.abc import Iterable

from hfg.errors import GraphError
from hfg.graph.structure.given import node_options
from hfg.graph.structure.level import Level, inside, level_of, nodes_within
from hfg.graph.structure.membership import close_box, leave, open_box, settle
from hfg.graph.structure.naming import need_name, path_of, suggest
from hfg.graph.structure.option import having
from hfg.graph.structure.options import PLAIN_NODE, NodeGiven, NodeOptions
from hfg.graph.structure.refusals import Refusable
from hfg.graph.structure.subgraph import Box, is_box
from hfg.nodetypes.node import Node


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
        if options.iterate_over or not is_box(node):  # one that is dissolved gets a better message below
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
    if type(node).__init__ is not Node.__init__:  # a decorator such as @dataclass adds one after the declaration
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
                f'subgraph "{path}": iterate_over names "{name}", which is not an input; '
                f"{suggest(name, node._type.inputs)}"
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


def need_fitting(node: Node, path: str, options: NodeOptions) -> None:
    """Refuse concurrency or retries for a node whose code does not allow them.

    Raises:
      GraphError: naming the option, with the remedy.
    """
    if options.concurrency > 1:
        _need_separate_firings(node, f'node "{path}": concurrency={options.concurrency}', options)
    if options.retries:
        _need_repeatable(node, f'node "{path}": retries={options.retries}')


def _need_separate_firings(node: Node, said: str, options: NodeOptions) -> None:
    """F14: several firings may be in progress at once."""
    kind = node._type
    _need_firings_of_its_own(node, said)
    if kind.process_kind in ("generator", "async generator"):
        raise GraphError(
            f"{said} lets several firings be in progress at once, but the firings of a generator are its steps, one "
            "after the other (rule F14); write an async function, or leave concurrency out"
        )
    if "ready" in kind.hooks:
        raise GraphError(
            f"{said} does not go together with ready(), which is asked between two firings (rule F14); "
            "leave concurrency out, or await in process() what ready() looks for"
        )
    if options.release == "sequential":
        raise GraphError(
            f'{said} does not go together with release="sequential", because its tokens count as processed as soon as '
            "they are taken (rule F14); leave release out"
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
            f'"{next(iter(kind.states))}" (rule X1); leave retries out, or keep the state in a node after it'
        )


def _need_firings_of_its_own(node: Node, said: str) -> None:
    if is_box(node):
        raise GraphError(
            f"{said} is for nodes that run code, and a subgraph runs that of others; say it inside, in build()"
        )
    if node._type.process_kind == "none":
        raise GraphError(f"{said} is about firings, but {node._type.name} has no process function; leave it out")

"""Where a node is, said to the node itself: the one place that writes what a graph keeps on its nodes.

A node carries its place, its options and, if it is a subgraph, its inside, in fields that begin with an underscore
because all other names are its author's. Depends on levels.
"""

from __future__ import annotations

from hfg.base.values import own_copy
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.options import NodeOptions
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node, Place


def settle(node: Node, level: Level, name: str, options: NodeOptions) -> None:
    """Let a node know that it is in a graph; all inside it follow."""
    node._options = options
    place(node, level, name)


def leave(node: Node) -> None:
    """Let a node know that it is in no graph any more; what is inside of it stays there."""
    node._place = node._options = None


def place(node: Node, level: Level, name: str) -> None:
    """Return where a node is, and where all inside it are."""
    node._place = Place(level.face, name, level.path_to(name))
    waiting = [node]
    while waiting:
        inner_level = inside(waiting.pop())
        if inner_level is not None:
            for inner_name, inner in inner_level.nodes.items():
                inner._place = Place(inner_level.face, inner_name, inner_level.path_to(inner_name))
                if is_box(inner):
                    waiting.append(inner)


def set_options(node: Node, options: NodeOptions) -> None:
    """Return a node other options."""
    node._options = options


def open_box(node: Node, level: Level) -> None:
    """Return a subgraph its inside."""
    if is_box(node):
        node._level = level


def close_box(node: Node) -> None:
    """Take a subgraph's inside away, if it has one."""
    if is_box(node) and inside(node) is not None:
        del node._level


def write_parameter(node: Node, name: str, value: object) -> None:
    """Return a parameter a value that it had, or that was checked; no other parameter follows."""
    node._parameters[name] = own_copy(value)

"""Where nodes run: declaring groups, and moving nodes between them (rule R1). Depends on levels and options."""

from __future__ import annotations

from hfg.errors import GraphError
from hfg.graph.structure.given import group_spec
from hfg.graph.structure.level import Level
from hfg.graph.structure.membership import set_options
from hfg.graph.structure.naming import path_of, suggest
from hfg.graph.structure.options import GroupGiven, GroupSpec, in_group
from hfg.graph.structure.pointing import meant, node_at
from hfg.graph.structure.refusals import Refusable
from hfg.nodetypes.node import Node

__all__ = ["declare_group", "move"]


def declare_group(level: Level, name: str, given: GroupGiven) -> GroupSpec:
    """Declare a group of the whole graph.

    Raises:
      GraphError: a value is out of its range, or the group is declared otherwise already.
    """
    level.need_rest("declaring a group")
    groups = level.whole.groups
    declared: GroupSpec | None = None
    with Refusable(name):
        declared = group_spec(name, given)
        groups.declare(declared)
    # One that is refused while refusals are kept is there nevertheless, so that nodes in it are not refused as well.
    return declared if declared is not None else groups.by_name.setdefault(str(name), GroupSpec(str(name)))


def move(level: Level, node: Node | str, group: object) -> None:
    """Let a node run in another group.

    Raises:
      GraphError: the node is not in the graph, or the group is not declared; nothing was changed.
    """
    level.need_rest("moving a node")
    node = meant(level, node, node_at)
    if not isinstance(node, Node):
        raise GraphError(f"graph.move takes a node of the graph, got {node!r}; give the node or its path")
    if not level.holds(node):
        raise GraphError(f'"{path_of(node)}" is not in {level.title}, so it cannot be moved there; add it first')
    known = level.whole.groups.by_name
    if group is not None and not (isinstance(group, str) and group in known):
        hint = suggest(group, known) if isinstance(group, str) else f"it has {', '.join(known)}"
        raise GraphError(
            f'"{path_of(node)}" cannot move to group {group!r}, which is not declared: {hint}; '
            'declare it first, as in graph.group("vision", threads=1)'
        )
    set_options(node, in_group(node._options, group))

"""Checks of nodes by themselves: groups, scheduling, and whether their types can be found again (rules R1, R2).

Stands on `flat`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hfg.graph.flat.flattening import FlatGraph
from hfg.graph.structure.naming import suggest
from hfg.graph.structure.options import NodeOptions
from hfg.nodetype import Node
from hfg.problem import Problem

__all__ = ["async_in_threads", "names", "unknown_groups", "unused_scheduling"]


def unknown_groups(flat: FlatGraph) -> Iterator[Problem]:
    """Nodes in groups that nobody declared."""
    for path, node, options in _members(flat):
        group = options.group
        # Told where the group is named, not again for all that inherit it.
        if group is not None and group not in flat.groups and node._options.group is not None:
            yield Problem(
                path=path,
                severity="error",
                what=f'its group "{group}" is not declared',
                why=suggest(group, flat.groups),
                remedy=f'declare it with graph.group("{group}", threads=1), or correct the name',
                check="unknown-group",
            )


def _members(flat: FlatGraph) -> Iterator[tuple[str, Node, NodeOptions]]:
    """Give path, node and options of nodes and dissolved subgraphs."""
    for item in flat.nodes:
        yield item.path, item.node, item.options
    for scope in flat.scopes:
        yield scope.path, scope.subgraph, scope.options


def names(whole: FlatGraph) -> list[Problem]:
    """Types that no file or worker can find again; each told once."""
    found: dict[Any, tuple[str, int]] = {}
    for flat in whole.walk():
        for path, node, _ in _members(flat):
            first, count = found.get(node._type, (path, 0))
            found[node._type] = (first, count + 1)
    return [
        Problem(
            path=path,
            severity="warning",
            what=f'its type "{kind.name}" cannot be found by name'
            + (f", as for {count - 1} more nodes" if count > 1 else ""),
            why="files, workers and reload make nodes again from module and name",
            remedy="define it at the top of a module, not in a function or as a lambda",
            check="unnamed-type",
        )
        for kind, (path, count) in found.items()
        if kind.reference is None
    ]


def async_in_threads(flat: FlatGraph) -> Iterator[Problem]:
    """Async code in groups that are threads (rule R1)."""
    threads = {name: group for name, group in flat.groups.items() if group.threads}
    for node in flat.nodes if threads else ():
        kind = node.node._type
        group = threads.get(node.options.group or "loop")
        waits = kind.process_kind.startswith("async") or any(slot.is_async for slot in kind.slots.values())
        if waits and group is not None:
            yield Problem(
                path=node.path,
                severity="error",
                what=f'it is async, but its group "{group.name}" is a thread',
                why="async code runs on the loop (rule R1)",
                remedy="leave out group=, declare the group with threads=0, or make the function a plain one",
                check="async-in-thread",
            )


_SCHEDULING = {"priority": ("priority", 0), "deadline": ("deadline_s", None)}  # policy: the option it looks at


def unused_scheduling(whole: FlatGraph) -> Iterator[Problem]:
    """Policies without the options they look at, and options that no policy looks at (rule R2)."""
    said: dict[tuple[str, str], list[str]] = {}  # nodes by group and option
    for flat in whole.walk():
        for node in flat.nodes:
            for option, default in _SCHEDULING.values():
                if getattr(node.options, option) != default:
                    said.setdefault((node.options.group or "loop", option), []).append(node.path)
    for name, group in whole.groups.items():
        for policy, (option, _) in _SCHEDULING.items():
            paths = said.get((name, option), [])
            if group.policy == policy and not paths:
                yield Problem(
                    path=name,
                    severity="hint",
                    what=f'the policy of this group is "{policy}", but no node in it has {option}',
                    why="so it is first in, first out (rule R2)",
                    remedy=f"say {option}= in graph.add, or choose another policy",
                    check="unused-scheduling",
                )
            elif group.policy != policy and paths:
                yield Problem(
                    path=paths[0],
                    severity="hint",
                    what=f'{option} is said here{_more(len(paths) - 1)}, but the policy of group "{name}" is '
                    f'"{group.policy}"',
                    why=f'only policy "{policy}" looks at it (rule R2)',
                    remedy=f'declare graph.group("{name}", policy="{policy}"), or leave {option} out',
                    check="unused-scheduling",
                )


def _more(count: int) -> str:
    return f" and for {count} more" if count else ""

"""Checks of nodes by themselves: groups, scheduling, and whether their types can be found again (rules R1, R2).

Depends on `flat`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from types import CodeType, FunctionType

from hfg.errors import Problem
from hfg.graph.flat import FlatGraph, FlatNode
from hfg.graph.flat.deadlines import urgencies
from hfg.graph.structure.level import inside
from hfg.graph.structure.naming import suggest
from hfg.graph.structure.options import NodeOptions
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node
from hfg.ports import Port


def unknown_groups(flat: FlatGraph) -> Iterator[Problem]:
    """Nodes in groups that are not declared."""
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
    """Yield path, node and options of nodes and dissolved subgraphs."""
    for item in flat.nodes:
        yield item.path, item.node, item.options
    for scope in flat.scopes:
        yield scope.path, scope.subgraph, scope.options


def names(whole: FlatGraph) -> list[Problem]:
    """Types that no file or worker can find again; each told once."""
    found: dict[NodeType, tuple[str, int]] = {}
    for flat in whole.walk():
        for path, node, _ in _members(flat):
            first, count = found.get(node._type, (path, 0))
            found[node._type] = (first, count + 1)
    return [
        Problem(
            path=path,
            severity="hint",
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
    """Nodes that need the loop in groups that are threads (rule R1)."""
    threads = {name: group for name, group in flat.groups.items() if group.threads}
    for node in flat.nodes if threads else ():
        group = threads.get(node.options.group or "loop")
        why_loop = needs_loop(node.node) if group is not None else ""
        if group is not None and why_loop:
            remedy = "leave out group=, declare the group with threads=0, or make the function a plain one"
            if "start_soon" in why_loop:
                remedy = "leave out group=, or send an event to a node on the loop that begins the tasks"
            yield Problem(
                path=node.path,
                severity="error",
                what=f'{why_loop}, but its group "{group.name}" is a thread',
                why="async code runs on the loop (rule R1)",
                remedy=remedy,
                check="async-in-thread",
            )


def needs_loop(node: Node) -> str:
    """Return why a node cannot be in a group that is a thread (rule R1); nothing if it can."""
    kind = node._type
    if kind.process_kind.startswith("async"):
        return "it is async"
    slot = next((slot.name for slot in kind.slots.values() if slot.is_async), None)
    if slot is not None:
        return f"its slot {slot} is async"
    if "do" in kind.hooks:
        return "its do-activity is async"
    if not kind.is_function and _begins_tasks(type(node)):
        return "its code begins tasks (start_soon)"
    return ""


def _begins_tasks(cls: type) -> bool:
    """Whether methods of a node class begin tasks: they themselves, or functions and helper classes that they name."""
    waiting = list(functions_of(cls, until=Node))
    seen: set[object] = set()
    while waiting:
        function = waiting.pop()
        if function in seen:
            continue
        seen.add(function)
        for name in _names_in(function.__code__):
            if name == "start_soon":
                return True
            helper = function.__globals__.get(name)
            if isinstance(helper, FunctionType):
                waiting.append(helper)
            elif isinstance(helper, type) and not issubclass(helper, Node):
                waiting += functions_of(helper, until=object)
    return False


def missing_process(flat: FlatGraph) -> Iterator[Problem]:
    """Classes with inputs and no process function, which never fire: mostly a typo (rule F2)."""
    lacking = [
        node
        for node in flat.nodes
        if node.node._type.process_kind == "none" and node.node._type.inputs and inside(node.node) is None
        if node.node._type.is_there
    ]
    fed = {edge.target.node for edge in flat.edges if edge.target.kind == "input"} if lacking else set()
    for node in lacking:
        kind = node.node._type
        written = [name for name in _methods(type(node.node)) if name not in kind.slots and name not in kind.hooks]
        near = difflib.get_close_matches("process", written, n=1, cutoff=0.6)
        yield Problem(
            path=node.path,
            severity="error" if node.index in fed else "warning",
            what=f"{kind.qualname} has inputs, but no process(), so it never fires",
            why=f"its method {near[0]}() looks like a misspelt process()"
            if near
            else "what comes to its inputs is never taken (rules F1, F2)",
            remedy="name the method that takes the inputs `process`, or make its inputs slots",
            check="missing-process",
        )


def _methods(cls: type) -> Iterator[str]:
    for one in cls.__mro__[: cls.__mro__.index(Node)]:
        yield from (name for name, value in vars(one).items() if callable(value) and not name.startswith("__"))


def functions_of(cls: type, *, until: type) -> Iterator[FunctionType]:
    """Yield the methods of a class and of its bases below another."""
    for one in cls.__mro__[: cls.__mro__.index(until)]:
        for value in vars(one).values():
            function = getattr(value, "handler", getattr(value, "__func__", value))
            if isinstance(function, FunctionType):
                yield function


def empty_subgraphs(flat: FlatGraph) -> Iterator[Problem]:
    """Subgraphs with ports and nothing inside: what comes is lost (rule G1)."""
    for path, node, _ in _members(flat):
        level, kind = inside(node), node._type
        if level is None or level.nodes or level.edges:
            continue
        if kind.inputs or kind.outputs or kind.events or kind.slots:
            builds = sum("build" in vars(kind) for kind in type(node).__mro__)  # that of `Subgraph` adds nothing
            build = "build() adds nothing" if builds > 1 else "it has no build()"
            yield Problem(
                path=path,
                severity="warning",
                what=f"nothing is inside: {build}",
                why="a port of a subgraph only passes on, so what comes is lost (rule G1)",
                remedy=f"write `def build(self, graph)` in {kind.qualname}, and connect its ports there",
                check="empty-subgraph",
            )


def limits_without_effect(flat: FlatGraph) -> Iterator[Problem]:
    """Time limits of plain functions on the loop, which nothing can interrupt (rule X2)."""
    threads = {name for name, group in flat.groups.items() if group.threads}
    for node in flat.nodes:
        kind, limit = node.node._type, node.options.max_duration_s
        waits = kind.process_kind.startswith("async") or kind.process_kind == "none" or node.iteration is not None
        if limit is not None and not waits and (node.options.group or "loop") not in threads:
            yield Problem(
                path=node.path,
                severity="warning",
                what=f"max_duration_s={limit:g} has no effect",
                why="it is a plain function on the loop, and nothing can interrupt that before it is over (rule X2)",
                remedy="make it async"
                + ("" if needs_loop(node.node) else ', or give it a thread, graph.group("work") and group="work"'),
                check="limit-without-effect",
            )


def unknown_attributes(flat: FlatGraph) -> Iterator[Problem]:
    """What was written on a node from outside and nothing in its class knows: a typo, most likely."""
    for path, node, _ in _members(flat):
        written = [name for name, value in vars(node).items() if not isinstance(value, Port) and name.isidentifier()]
        known = _known_names(type(node)) if written else set()
        for name in written:
            if name not in known and not name.startswith("_"):
                yield Problem(
                    path=path,
                    severity="warning",
                    what=f'"{name}" was written on it, and nothing in {node._type.qualname} knows that name',
                    why=f"so it has no effect; {suggest(name, _names_of(node))}",
                    remedy=f"correct the name, or declare `{name} = hfg.Parameter(...)` or hfg.State",
                    check="unknown-attribute",
                )


def _names_of(node: Node) -> list[str]:
    kind = node._type
    return [name for name in (*kind.parameters, *kind.states, *kind.inputs, *kind.outputs) if name.isidentifier()]


def _known_names(cls: type) -> set[str]:
    """The attributes of a class and all names in its methods; other ways to reach an attribute cannot be seen."""
    known: set[str] = set()
    for one in cls.__mro__[: cls.__mro__.index(Node)]:
        known.update(vars(one), getattr(one, "__annotations__", ()))
    for function in functions_of(cls, until=Node):
        known.update(_names_in(function.__code__))
    return known


def codes_in(code: CodeType) -> Iterator[CodeType]:
    """Yield a function's code, and that of the functions and comprehensions inside."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes_in(constant)


def _names_in(code: CodeType) -> Iterator[str]:
    for one in codes_in(code):
        yield from one.co_names
        yield from (constant for constant in one.co_consts if isinstance(constant, str))


def concurrent_firings(flat: FlatGraph) -> Iterator[Problem]:
    """Nodes with several firings in progress at once that cannot have them (rule F14)."""
    concurrent = [node for node in flat.nodes if node.options.concurrency > 1]
    for node in concurrent:
        count, group = node.options.concurrency, flat.groups.get(node.options.group or "loop")
        if group is None:
            continue  # another check reports it
        what = remedy = ""
        if group.threads and count > group.threads:
            what = f'concurrency={count}, but its group "{group.name}" has threads={group.threads}'
            remedy = f'declare graph.group("{group.name}", threads={count}), or say concurrency={group.threads}'
        elif not group.threads and node.node._type.process_kind == "function":
            what = f"concurrency={count}, but its function is a plain one on the event loop"
            remedy = "make it async"
            if not needs_loop(node.node):
                remedy += f', or put it into graph.group("work", threads={count}) by group="work"'
        if what:
            why = "a function that never waits, or has no thread of its own, runs alone (rules R1, F14)"
            yield Problem(node.path, "error", what, why, remedy, "concurrency")
    indices = {node.index for node in concurrent}
    for edge in flat.edges if indices else ():
        ends = indices.intersection((edge.source.node, edge.target.node))
        if edge.active and ends:
            yield Problem(
                path=edge.label,
                severity="error",
                what=f'it is active, but "{flat.nodes[min(ends)].path}" has concurrency='
                f"{flat.nodes[min(ends)].options.concurrency}",
                why="activity belongs to one firing or call of a node at a time (rules A5, F14)",
                remedy="leave active= out, or leave out concurrency",
                check="concurrency",
            )


def unused_scheduling(whole: FlatGraph) -> Iterator[Problem]:
    """Policies without the options that they look at, and priorities at which no policy looks (rule R2)."""
    said: dict[tuple[str, str], list[str]] = {}  # nodes by group and option
    for flat in whole.walk():
        for node in flat.nodes:
            if node.options.priority:
                said.setdefault((_group(node), "priority"), []).append(node.path)
        for index in urgencies(flat):
            said.setdefault((_group(flat.nodes[index]), "deadline_s"), []).append(flat.nodes[index].path)
    for name, group in whole.groups.items():
        option = {"priority": "priority", "deadline": "deadline_s"}.get(group.policy)
        if option is not None and (name, option) not in said:
            yield Problem(
                path=name,
                severity="hint",
                what=f'the policy of this group is "{group.policy}", but no node in it has {option}',
                why="so it is first in, first out (rule R2)",
                remedy=f"say {option}= in graph.add, or choose another policy",
                check="unused-scheduling",
            )
        paths = said.get((name, "priority"), [])
        if group.policy != "priority" and paths:
            yield Problem(
                path=paths[0],
                severity="hint",
                what=f'priority is set here{_more(len(paths) - 1)}, but the policy of group "{name}" is '
                f'"{group.policy}"',
                why='only policy "priority" looks at it (rule R2)',
                remedy=f'declare graph.group("{name}", policy="priority"), or leave priority out',
                check="unused-scheduling",
            )


def _group(node: FlatNode) -> str:
    return node.options.group or "loop"


def _more(count: int) -> str:
    return f" and for {count} more" if count else ""

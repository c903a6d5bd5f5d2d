"""Sources that certainly never end and never wait (rules F2, R6), by their code and the graph downstream.

Only what is certain counts. A type is judged by the text of its process function: it may compute, write and trigger,
and must not call, raise or import anything else. A source is not reported if a node downstream may take its time:
its outputs or full queues then hold it back, or may end the run. Depends on `flat`.
"""

from __future__ import annotations

import ast
import builtins
import functools
import inspect
import textwrap
import tokenize
import types
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Final

from hfg.graph.flat import ROOT, FlatGraph, FlatNode, scope_end
from hfg.nodetypes.description import NodeType

_HARMLESS_CALLS: Final = frozenset(
    {"abs", "bool", "bytes", "dict", "float", "int", "isinstance", "len", "list", "max", "min", "print", "repr"}
    | {"round", "set", "str", "sum", "tuple"}
)

_HARMLESS_CODE: Final = (
    *(ast.arguments, ast.arg, ast.Expr, ast.Assign, ast.AugAssign, ast.AnnAssign, ast.Return, ast.If, ast.Pass),
    *(ast.Constant, ast.Name, ast.UnaryOp, ast.BinOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.JoinedStr),
    *(ast.FormattedValue, ast.Tuple, ast.List, ast.Set, ast.Dict, ast.Attribute, ast.Call, ast.keyword, ast.Yield),
    *(ast.While, ast.expr_context, ast.operator, ast.unaryop, ast.boolop, ast.cmpop),
)


def endless(flat: FlatGraph, *, virtual: bool = False) -> Iterator[FlatNode]:
    """Yield the sources that hold the run at one instant forever.

    Args:
      flat: where they are.
      virtual: on a virtual clock, which stands still while a thread works.
    """
    candidates = [node for node in flat.nodes if _may_be_endless(flat, node)]
    if not candidates or any(edge.target.node == ROOT and edge.target.kind == "slot" for edge in flat.edges):
        return  # a signal into `stop` or `abort` may come from anywhere
    behind = _neighbours(flat)
    for node in candidates:
        if not _is_held_back(flat, node, behind, virtual=virtual):
            yield node


def _may_be_endless(flat: FlatGraph, node: FlatNode) -> bool:
    options, kind = node.options, node.node._type
    if not kind.is_source or options.max_rate_hz is not None or not options.enabled or not runs_for_ever(kind):
        return False
    gated = any(gate.target == node.index or scope_end(gate.target) in node.scopes for gate in flat.gates)
    return not gated and all(flat.scopes[scope].options.enabled for scope in node.scopes)


def _neighbours(flat: FlatGraph) -> dict[int, list[int]]:
    """The ends of the edges that may hold back where they begin; queues that drop do not."""
    found: dict[int, list[int]] = {}
    for edge in flat.edges:
        if not edge.is_event_edge or edge.options.overflow == "wait":
            found.setdefault(edge.source.node, []).append(edge.target.node)
    return found


def _is_held_back(flat: FlatGraph, source: FlatNode, behind: dict[int, list[int]], *, virtual: bool) -> bool:
    """Whether a node may take its time: one downstream of the source, or one that joins it with something else."""
    reached = {source.index}
    waiting = deque(reached)
    while waiting:
        for index in behind.get(waiting.popleft(), ()):
            if index < 0 or _takes_time(flat, flat.nodes[index], virtual=virtual):
                return True
            if index not in reached:
                reached.add(index)
                waiting.append(index)
    return any(edge.target.node in reached and edge.source.node not in reached for edge in flat.edges)


def _takes_time(flat: FlatGraph, node: FlatNode, *, virtual: bool) -> bool:
    kind, options = node.node._type, node.options
    group = flat.groups.get(options.group or "loop")
    return (
        "async" in kind.process_kind
        or any(slot.is_async for slot in kind.slots.values())
        or "ready" in kind.hooks
        or options.max_rate_hz is not None
        or options.on_error == "restart"
        or node.iteration is not None
        or (not virtual and group is not None and bool(group.threads))
    )


@functools.lru_cache(maxsize=1024)
def runs_for_ever(kind: NodeType) -> bool:
    """Return whether a source of this type certainly never ends and never waits by itself; when in doubt it may."""
    if not kind.is_source or kind.process_kind not in ("function", "generator") or "ready" in kind.hooks:
        return False
    declares = getattr(kind.origin, "function", None) if kind.is_function else vars(kind.origin).get("process")
    if not isinstance(declares, types.FunctionType):
        return False
    try:
        code = ast.parse(textwrap.dedent(inspect.getsource(declares))).body[0]
    except (OSError, TypeError, SyntaxError, IndexError, tokenize.TokenError):
        return False  # no text to look at, or a file that has changed since
    if not isinstance(code, ast.FunctionDef) or code.name != declares.__name__:
        return False  # it has changed: another function is at its place
    if not _Judge(kind, declares, code).is_harmless():
        return False
    if kind.process_kind == "function":
        return True
    never_left = any(isinstance(one, ast.While) and _is_true(one.test) and not one.orelse for one in code.body)
    return never_left and not any(isinstance(one, ast.Return) for one in ast.walk(code))


def _is_true(test: ast.expr) -> bool:
    return isinstance(test, ast.Constant) and bool(test.value)


class _Judge:
    """Looks at the text of one process function."""

    def __init__(self, kind: NodeType, function: types.FunctionType, code: ast.FunctionDef) -> None:
        self._kind = kind
        self._globals = function.__globals__
        self._code = code
        given = [*code.args.args, *code.args.kwonlyargs]
        self._self = given[0].arg if not kind.is_function and given else ""
        stored = (one for one in ast.walk(code) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store))
        self._locals = {argument.arg for argument in given} | {one.id for one in stored}

    def is_harmless(self) -> bool:
        """Return whether it can do nothing but compute, write and trigger."""
        return all(self._allows(one) for line in self._code.body for one in ast.walk(line))

    def _allows(self, code: ast.AST) -> bool:
        if not isinstance(code, _HARMLESS_CODE):
            return False
        match code:
            case ast.While():
                return _is_true(code.test)
            case ast.Name():
                return code.id in self._locals or self._is_builtin(code.id)
            case ast.Attribute():
                return self._is_own(code) or self._is_sending(code)
            case ast.Call(func=ast.Name(id=name)):
                return self._is_builtin(name)
            case ast.Call(func=ast.Attribute() as called):
                return self._is_sending(called)
            case ast.BinOp(op=ast.Div() | ast.FloorDiv() | ast.Mod() | ast.Pow() | ast.LShift()):
                return isinstance(code.right, ast.Constant) and bool(code.right.value)
        return not isinstance(code, ast.Call)

    def _is_builtin(self, name: str) -> bool:
        return (
            name in _HARMLESS_CALLS
            and hasattr(builtins, name)
            and name not in self._globals
            and name not in self._locals
        )

    def _is_own(self, code: ast.Attribute) -> bool:
        """`self.name` of state, a parameter, a port, or of something that no class has a say in."""
        kind = self._kind
        if not isinstance(code.value, ast.Name) or not self._self or code.value.id != self._self:
            return False
        known: Iterable[str] = (*kind.states, *kind.parameters, *kind.outputs, *kind.events)
        return code.attr in known or not hasattr(kind.origin, code.attr)

    def _is_sending(self, code: ast.Attribute) -> bool:
        """`self.out.send` or `self.seen.trigger`."""
        port = code.value
        if not isinstance(port, ast.Attribute) or not self._is_own(port):
            return False
        ports = {"send": self._kind.outputs, "trigger": self._kind.events}.get(code.attr, {})
        return port.attr in ports

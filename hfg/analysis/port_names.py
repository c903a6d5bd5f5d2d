"""Which ports an expression in a node's code may stand for: `self.done`, `self.ways[number]`, a local name.

Depends on `sources`.
"""

from __future__ import annotations

import ast
from typing import Final

from hfg.analysis.sources import own
from hfg.nodetypes.description import NodeType

__all__ = ["HANDS_ON", "PortNames"]

HANDS_ON: Final = frozenset({"enumerate", "zip", "list", "tuple", "reversed", "range", "len", "min", "max", "sorted"})
"""Functions that give what they get."""


class PortNames:
    """The names of ports in the code of one type.

    Attributes:
      kind: the node type.
      sending: its outputs and events.
    """

    def __init__(self, kind: NodeType) -> None:
        self.kind = kind
        self.sending = frozenset((*kind.outputs, *kind.events))

    def aliases(self, tree: ast.AST, me: str) -> dict[str, frozenset[str]]:
        """Return the local names that may stand for ports."""
        found: dict[str, set[str]] = {}
        for one in ast.walk(tree):
            pairs: list[tuple[ast.expr, ast.expr]] = []
            if isinstance(one, ast.Assign):
                pairs = [(target, one.value) for target in one.targets]
            elif isinstance(one, ast.AnnAssign | ast.NamedExpr) and one.value is not None:
                pairs = [(one.target, one.value)]
            elif isinstance(one, ast.For | ast.AsyncFor | ast.comprehension):
                pairs = [(one.target, one.iter)]
            for target, value in pairs:
                ports = self.handed_on(value, me)
                for name in [part.id for part in ast.walk(target) if isinstance(part, ast.Name)] if ports else []:
                    found.setdefault(name, set()).update(ports)
        return {name: frozenset(ports) for name, ports in found.items()}

    def handed_on(self, value: ast.expr, me: str) -> set[str]:
        """Return the ports that the value of an expression may be, or contain."""
        port = self.port(value, me, {})
        if port:
            return set(port)
        parts: list[ast.expr] = []
        match value:
            case ast.IfExp():
                parts = [value.body, value.orelse]
            case ast.BoolOp():
                parts = value.values
            case ast.Tuple() | ast.List():
                parts = value.elts
            case ast.Call(func=ast.Name(id=name)) if name in HANDS_ON:
                parts = value.args
            case ast.Subscript() | ast.Starred():
                parts = [value.value]
        return set().union(*(self.handed_on(part, me) for part in parts))

    def port(self, one: ast.expr, me: str, names: dict[str, frozenset[str]]) -> frozenset[str]:
        """Return the ports that an expression may be; none if it is something else."""
        if isinstance(one, ast.Name):
            return names.get(one.id, frozenset())
        if isinstance(one, ast.IfExp):
            first, second = self.port(one.body, me, names), self.port(one.orelse, me, names)
            return first | second if first and second else frozenset()
        if isinstance(one, ast.Subscript):
            name = own(one.value, me)
            if name in self.kind.vectors and isinstance(one.slice, ast.Constant):
                element = f"{name}[{one.slice.value!r}]"
                return frozenset({element}) & self.sending
            inner = one.value
            group = inner.attr if isinstance(inner, ast.Attribute) and own(inner.value, me) == "ports" else ""
            if group in ("events", "outputs"):
                return self.sending  # which one is not known, but it is one
            return self.port(one.value, me, names)
        if isinstance(one, ast.Call) and own(one.func, me) == "_port":
            return self.sending
        name = own(one, me)
        if name is None:
            return frozenset()
        if name in self.kind.vectors:
            return frozenset(port for port in self.sending if port.startswith(f"{name}["))
        return frozenset({name}) & self.sending

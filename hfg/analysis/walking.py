"""Walks the syntax tree of a method along every way through it, and collects the bags that it may send.

Conditions are not looked at. Depends on `statements`, `port_names` and `words`.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import types
from collections.abc import Callable
from typing import Any, Final, Literal, TypeAlias

from hfg.analysis.bags import NOTHING, Bag, Sent, Unknown, free, product, some_of
from hfg.analysis.port_names import HANDS_ON, PortNames
from hfg.analysis.sources import (
    SENDS,
    above,
    function_of,
    functions_in,
    is_harmless,
    own,
    plain,
    resolved,
    tree_of,
)
from hfg.analysis.statements import Scope, Statements
from hfg.analysis.words import makes_tokens, sets_modifiers
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node

Modifier: TypeAlias = Literal[0, 1, -1, "any"] | None
"""An explicit modifier (rule A4); "any" if it is not known which, None if there is none."""

DEEPEST: Final = 12
HARMLESS: Final = frozenset({"isinstance", "id", "type", "repr", "str", "hash", "print", "len", "format"})


class Walk(Statements):
    """Walks through the methods of one class.

    Attributes:
      kind: the node type.
      ports: those over which sendings count.
      loose: ports that reach where they cannot be followed.
      later: methods that something else may call.
      inline: methods that a handler gave away, which may be called at once.
    """

    def __init__(self, kind: NodeType, ports: frozenset[str]) -> None:
        self.kind = kind
        self.ports = ports
        self.outputs = frozenset(kind.outputs)
        self._ports = PortNames(kind)
        self.loose: set[str] = set()  # ports that reach where they cannot be followed
        self.later: set[str] = set()  # methods that something else may call
        self.lost = ""  # why the node itself cannot be followed
        self.in_setup = False
        self.inline: set[str] = set()  # methods that a handler gave away, which may be called at once
        takes_token = any(one.token for one in kind.inputs.values())
        takes_token |= any(one.token for one in kind.slots.values())
        self.frees = takes_token or makes_tokens(kind)  # what is sent may be a token with a modifier of its own
        self.tells = self.frees or sets_modifiers(kind)

    def _sendings(self, port: str, modifier: Modifier = None) -> list[Sent]:
        """The possible sendings over a port with an explicit modifier, or without one."""
        if port not in self.ports or modifier == 0:
            return []
        if modifier == "any" or (modifier is None and self.frees):
            return free(port)
        return [(port, modifier)]

    def _unseen(self, port: str) -> list[Sent]:
        """The possible sendings over a port by code that is not followed."""
        return free(port) if self.tells else self._sendings(port)

    # --- functions

    def _method(
        self, function: types.FunctionType, *, is_process: bool, depth: int = 0, awaited: bool = False
    ) -> set[Bag]:
        if depth > DEEPEST:
            raise Unknown("its methods call each other too deeply")
        tree = tree_of(function)
        owner = next((one for one in self._mro() if function in functions_in(one)), self.kind.origin)
        arguments = [*tree.args.posonlyargs, *tree.args.args]
        me = arguments[0].arg if arguments else ""
        names = self._ports.aliases(tree, me)
        scope = Scope(function, owner, me, names, is_process, depth, awaited)
        ways = self._block(tree.body, scope)
        return set().union(*ways.values()) or {NOTHING}

    def _mro(self) -> tuple[type, ...]:
        origin: type = self.kind.origin
        return origin.__mro__

    def _returned(self, value: ast.expr | None, scope: Scope) -> frozenset[Bag]:
        """The bags that the process function sends by returning a value."""
        if not scope.is_process or scope.depth or value is None:
            return frozenset({NOTHING})
        if isinstance(value, ast.Constant) and value.value is None:
            return frozenset({NOTHING})
        outputs = list(self.kind.outputs)
        if isinstance(value, ast.Tuple) and len(value.elts) == len(outputs) and self.kind.result == "fields":
            silent = [isinstance(part, ast.Constant) and part.value is None for part in value.elts]
            outputs = [name for name, none in zip(outputs, silent, strict=True) if not none]
        certain = isinstance(value, ast.Subscript | ast.Tuple | ast.List | ast.Dict | ast.JoinedStr | ast.BinOp)
        if certain and self.kind.result == "single" and not self.kind.layout and not self.frees:
            return frozenset({frozenset(((name, None), 1) for name in outputs if name in self.ports)})
        return some_of(self._sendings(name) for name in outputs if name in self.ports)

    def _nested(self, one: ast.AST, scope: Scope) -> None:
        """A function inside: when it runs is not known, so its ports may be sent whenever."""
        for part in ast.walk(one):
            if not isinstance(part, ast.expr):
                continue
            self.loose |= self._ports.port(part, scope.me, scope.names)
            name = own(part, scope.me)
            if name is not None and function_of(self.kind, name) is not None:
                self.later.add(name)
                self.inline.add(name)
        bases = {id(part.value) for part in ast.walk(one) if isinstance(part, ast.Attribute)}
        if any(isinstance(p, ast.Name) and p.id == scope.me and id(p) not in bases for p in ast.walk(one)):
            raise Unknown("a function inside it hands the node on")

    # --- expressions

    def _value(self, one: ast.expr | None, scope: Scope, *, aliased: bool = False) -> set[Bag]:
        """The bags that are sent while an expression is evaluated."""
        if one is None:
            return {NOTHING}
        handle = _EXPRESSIONS.get(type(one))
        if handle is not None:
            found: set[Bag] = handle(self, one, scope, aliased)
            return found
        ports = self._ports.port(one, scope.me, scope.names)
        if ports:
            if not aliased:
                self.loose |= ports  # where it goes is not followed
            return self._all([one.slice], scope) if isinstance(one, ast.Subscript) else {NOTHING}
        name = own(one, scope.me)
        if name is not None:
            return self._attribute(name, scope)
        found = {NOTHING}
        for part in ast.iter_child_nodes(one):
            if isinstance(part, ast.expr):
                handed_on = aliased and isinstance(one, ast.Tuple | ast.List)
                found = product(found, self._value(part, scope, aliased=handed_on))
        return found

    def _constant(self, one: ast.Constant, scope: Scope, aliased: bool) -> set[Bag]:
        return {NOTHING}

    def _name(self, one: ast.Name, scope: Scope, aliased: bool) -> set[Bag]:
        if one.id == scope.me and scope.me:
            raise Unknown("it hands the node on")
        if one.id in scope.names and isinstance(one.ctx, ast.Load) and not aliased:
            self.loose |= scope.names[one.id]
        return {NOTHING}

    def _lambda(self, one: ast.Lambda, scope: Scope, aliased: bool) -> set[Bag]:
        self._nested(one, scope)
        return {NOTHING}

    def _choice(self, one: ast.IfExp, scope: Scope, aliased: bool) -> set[Bag]:
        choice = self._value(one.body, scope, aliased=aliased) | self._value(one.orelse, scope, aliased=aliased)
        return product(self._value(one.test, scope), choice)

    def _and_or(self, one: ast.BoolOp, scope: Scope, aliased: bool) -> set[Bag]:
        so_far = self._value(one.values[0], scope, aliased=aliased)
        found = set(so_far)
        for part in one.values[1:]:
            so_far = product(so_far, self._value(part, scope, aliased=aliased))
            found |= so_far
        return found

    def _await(self, one: ast.Await, scope: Scope, aliased: bool) -> set[Bag]:
        return self._value(one.value, scope)

    def _yield(self, one: ast.Yield, scope: Scope, aliased: bool) -> set[Bag]:
        sent = self._returned(one.value, scope) if scope.is_process and not scope.depth else {NOTHING}
        return product(self._all([one.value], scope), sent)

    def _yield_from(self, one: ast.YieldFrom, scope: Scope, aliased: bool) -> set[Bag]:
        sent = some_of(self._sendings(name) for name in self.outputs if name in self.ports)
        return product(self._all([one.value], scope), sent)

    def _attribute(self, name: str, scope: Scope) -> set[Bag]:
        """`self.name` as a value: a property runs; a method may be called by the code that receives it."""
        if name in ("ports", "__dict__"):
            raise Unknown(f"it reaches its ports by self.{name}")
        held = inspect.getattr_static(self.kind.origin, name, None)
        getter = held.fget if isinstance(held, property) else getattr(held, "func", None)
        if isinstance(getter, types.FunctionType):
            return self._method(getter, is_process=False, depth=scope.depth + 1)
        if function_of(self.kind, name) is not None:
            self.later.add(name)
            if not self.in_setup:
                self.inline.add(name)
        return {NOTHING}

    def _comprehension(self, one: Any, scope: Scope, aliased: bool) -> set[Bag]:
        values = [one.key, one.value] if isinstance(one, ast.DictComp) else [one.elt]
        conditions = [part for generator in one.generators for part in generator.ifs]
        inner = [generator.iter for generator in one.generators[1:]]
        often = self._loop({"next": self._all([*inner, *conditions, *values], scope)})["next"]
        before = {NOTHING}
        if not self._ports.handed_on(one.generators[0].iter, scope.me):
            before = self._value(one.generators[0].iter, scope)
        return product(before, often)

    def _call(self, one: ast.Call, scope: Scope, aliased: bool) -> set[Bag]:
        function = one.func
        if isinstance(function, ast.Attribute) and function.attr in SENDS:
            ports = self._ports.port(function.value, scope.me, scope.names)
            if ports:
                return self._sending(one, function.value, ports, scope)
        arguments = [*one.args, *(keyword.value for keyword in one.keywords)]
        given = [part.value if isinstance(part, ast.Starred) else part for part in arguments]
        others = [part for part in given if not (scope.me and isinstance(part, ast.Name) and part.id == scope.me)]
        if len(others) < len(given):
            self._need_harmless(function, scope)
        hands_on = isinstance(function, ast.Name) and function.id in HANDS_ON
        before = {NOTHING}
        for part in others:
            before = product(before, self._value(part, scope, aliased=hands_on))
        return product(before, self._called(function, scope))

    def _sending(self, one: ast.Call, over: ast.expr, ports: frozenset[str], scope: Scope) -> set[Bag]:
        """The bags of `self.port.trigger(...)`, over one of these ports."""
        inside = over.slice if isinstance(over, ast.Subscript) else None
        before = self._all([inside, *one.args, *(keyword.value for keyword in one.keywords)], scope)
        modifier = _modifier(one)
        sent: set[Bag] = set()
        for port in ports:
            sent |= {frozenset({(sending, 1)}) for sending in self._sendings(port, modifier)} or {NOTHING}
        if modifier == "any":
            sent.add(NOTHING)  # it may be 0
        return product(before, sent)

    def _called(self, function: ast.expr, scope: Scope) -> set[Bag]:
        """The bags that a called function sends, if it is one of the node's."""
        name = own(function, scope.me)
        upper = above(function)
        if name is not None or upper is not None:
            found = function_of(self.kind, name or "") if upper is None else self._inherited(upper, scope)
            if found is None:
                return {NOTHING} if upper is None else set(self._need_base(upper))
            if inspect.iscoroutinefunction(found) and not scope.awaited:
                self.later.add(found.__name__)  # only a coroutine is made
                return {NOTHING}
            return self._method(found, is_process=False, depth=scope.depth + 1, awaited=scope.awaited)
        return self._value(function, scope) if not isinstance(function, ast.Name) else {NOTHING}

    def _inherited(self, name: str, scope: Scope) -> types.FunctionType | None:
        mro = self._mro()
        for owner in mro[mro.index(scope.owner) + 1 :]:
            if name in vars(owner) and owner not in (Node, object):
                return plain(vars(owner)[name])
        return None

    def _need_base(self, name: str) -> list[Bag]:
        if hasattr(Node, name) or hasattr(object, name):
            return [NOTHING]  # those of `Node` do nothing
        raise Unknown(f"super().{name} is not found")

    def _need_harmless(self, function: ast.expr, scope: Scope) -> None:
        """Refuse a function that gets the node and may reach its ports."""
        called = resolved(function, scope.function)
        if isinstance(function, ast.Name) and function.id in HARMLESS and called is getattr(builtins, function.id):
            return
        name = ast.unparse(function)
        if called is None or not is_harmless(called):
            raise Unknown(f"it hands the node to {name}")


def _modifier(call: ast.Call) -> Modifier:
    """Read the modifier of a sending."""
    for keyword in call.keywords:
        if keyword.arg is None:
            return "any"  # as in trigger(value, **options)
        if keyword.arg == "activity":
            try:
                given = ast.literal_eval(keyword.value)
            except ValueError:
                return "any"
            return given if given in (0, 1, -1) else None
    return None


_EXPRESSIONS: Final[dict[type[ast.expr], Callable[..., set[Bag]]]] = {
    ast.Constant: Walk._constant,
    ast.Name: Walk._name,
    ast.Call: Walk._call,
    ast.Lambda: Walk._lambda,
    ast.IfExp: Walk._choice,
    ast.BoolOp: Walk._and_or,
    ast.ListComp: Walk._comprehension,
    ast.SetComp: Walk._comprehension,
    ast.GeneratorExp: Walk._comprehension,
    ast.DictComp: Walk._comprehension,
    ast.Await: Walk._await,
    ast.Yield: Walk._yield,
    ast.YieldFrom: Walk._yield_from,
}
"""What reads each kind of expression; all others send what their parts send."""

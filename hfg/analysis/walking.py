"""Walks the syntax tree of a method along every way through it, and collects the bags that it may send.

Conditions are not looked at. Depends on `bags` and `sources`.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import types
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Final

from hfg.analysis.bags import NOTHING, Bag, Sent, Unknown, Ways, after, either, parts, product, some_of
from hfg.analysis.sources import (
    SENDS,
    above,
    function_of,
    functions_in,
    is_harmless,
    own,
    plain,
    resolved,
    speaks_of_tokens,
    tree_of,
)
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node

DEEPEST: Final = 12
HARMLESS: Final = frozenset({"isinstance", "id", "type", "repr", "str", "hash", "print", "len", "format"})
HANDS_ON: Final = frozenset({"enumerate", "zip", "list", "tuple", "reversed", "range", "len", "min", "max", "sorted"})


@dataclass
class Scope:
    """The function that is being read."""

    function: types.FunctionType
    owner: type
    me: str
    names: dict[str, frozenset[str]]
    is_process: bool
    depth: int
    awaited: bool


class Walk:
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
        self.sending = frozenset((*kind.outputs, *kind.events))
        self.loose: set[str] = set()  # ports that reach where they cannot be followed
        self.later: set[str] = set()  # methods that something else may call
        self.lost = ""  # why the node itself cannot be followed
        self.in_setup = False
        self.inline: set[str] = set()  # methods that a handler gave away, which may be called at once
        takes_token = any(one.token for one in kind.inputs.values())
        takes_token |= any(one.token for one in kind.slots.values())
        self.frees = takes_token or speaks_of_tokens(kind)  # a sending may have a modifier of its own

    def _sendings(self, port: str, modifier: ast.expr | None) -> list[Sent]:
        """The possible modifiers of one sending over a port."""
        if port not in self.ports:
            return []
        if modifier is None:
            return [(port, None), (port, 1), (port, -1)] if self.frees else [(port, None)]
        try:
            given = ast.literal_eval(modifier)
        except ValueError:
            return [(port, None), (port, 1), (port, -1)]
        return [] if given == 0 else [(port, given)] if given in (1, -1) else [(port, None)]

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
        names = self._aliases(tree, me)
        scope = Scope(function, owner, me, names, is_process, depth, awaited)
        ways = self._block(tree.body, scope)
        return set().union(*ways.values()) or {NOTHING}

    def _mro(self) -> tuple[type, ...]:
        origin: type = self.kind.origin
        return origin.__mro__

    def _aliases(self, tree: ast.AST, me: str) -> dict[str, frozenset[str]]:
        """Local names that may stand for ports."""
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
                ports = self._ports_handed_on(value, me)
                for name in [part.id for part in ast.walk(target) if isinstance(part, ast.Name)] if ports else []:
                    found.setdefault(name, set()).update(ports)
        return {name: frozenset(ports) for name, ports in found.items()}

    def _ports_handed_on(self, value: ast.expr, me: str) -> set[str]:
        """The ports that the value of an expression may be, or contain."""
        port = self._port(value, me, {})
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
        return set().union(*(self._ports_handed_on(part, me) for part in parts))

    def _port(self, one: ast.expr, me: str, names: dict[str, frozenset[str]]) -> frozenset[str]:
        """The ports that an expression may be, such as `self.done`, `self.ways[number]`, a local name."""
        if isinstance(one, ast.Name):
            return names.get(one.id, frozenset())
        if isinstance(one, ast.IfExp):
            first, second = self._port(one.body, me, names), self._port(one.orelse, me, names)
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
            return self._port(one.value, me, names)
        if isinstance(one, ast.Call) and own(one.func, me) == "_port":
            return self.sending
        name = own(one, me)
        if name is None:
            return frozenset()
        if name in self.kind.vectors:
            return frozenset(port for port in self.sending if port.startswith(f"{name}["))
        return frozenset({name}) & self.sending

    # --- statements

    def _block(self, statements: Iterable[ast.stmt], scope: Scope) -> Ways:
        found: Ways = {}
        now: set[Bag] = {NOTHING}
        for statement in statements:
            ways = after(now, self._statement(statement, scope))
            now = ways.pop("next", set())
            found = either(found, ways)
            if not now:
                return found
        return either(found, {"next": now})

    def _statement(self, one: ast.stmt, scope: Scope) -> Ways:
        handle = _STATEMENTS.get(type(one))
        if handle is not None:
            found: Ways = handle(self, one, scope)
            return found
        return {"next": self._all([part for part in ast.iter_child_nodes(one) if isinstance(part, ast.expr)], scope)}

    def _return(self, one: ast.Return, scope: Scope) -> Ways:
        return {"return": product(self._value(one.value, scope), self._returned(one.value, scope))}

    def _raise(self, one: ast.Raise, scope: Scope) -> Ways:
        return {"raise": self._all([one.exc, one.cause], scope)}

    def _jump(self, one: ast.Break | ast.Continue, scope: Scope) -> Ways:
        return {"break" if isinstance(one, ast.Break) else "continue": {NOTHING}}

    def _if(self, one: ast.If, scope: Scope) -> Ways:
        choice = either(self._block(one.body, scope), self._block(one.orelse, scope))
        return after(self._value(one.test, scope), choice)

    def _while(self, one: ast.While, scope: Scope) -> Ways:
        loop = self._loop(after(self._value(one.test, scope), self._block(one.body, scope)))
        broken = loop.pop("broken", set())
        if isinstance(one.test, ast.Constant) and one.test.value:
            del loop["next"]
            return {**loop, "next": broken} if broken else loop
        loop["next"] |= broken
        return after(self._value(one.test, scope), loop)

    def _for(self, one: ast.For | ast.AsyncFor, scope: Scope) -> Ways:
        loop = self._loop(self._block(one.body, scope))
        loop["next"] |= loop.pop("broken", set())
        loop = either(
            {key: bags for key, bags in loop.items() if key != "next"},
            after(loop["next"], self._block(one.orelse, scope)),
            {"next": loop["next"]},
        )
        return after(self._value(one.iter, scope), loop)

    def _with(self, one: ast.With | ast.AsyncWith, scope: Scope) -> Ways:
        before = self._all([item.context_expr for item in one.items], scope)
        ways = self._block(one.body, scope)
        return after(before, either(ways, {"next": parts(ways)}))  # a context may swallow an exception

    def _match(self, one: ast.Match, scope: Scope) -> Ways:
        cases = [after(self._all([case.guard], scope), self._block(case.body, scope)) for case in one.cases]
        return after(self._value(one.subject, scope), either({"next": {NOTHING}}, *cases))

    def _define(self, one: ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef, scope: Scope) -> Ways:
        self._nested(one, scope)
        return {"next": {NOTHING}}

    def _assign(self, one: ast.Assign | ast.AnnAssign, scope: Scope) -> Ways:
        targets = one.targets if isinstance(one, ast.Assign) else [one.target]
        is_local = all(isinstance(target, ast.Name) for target in targets)
        value = self._value(one.value, scope, aliased=is_local)
        return {"next": product(value, self._all([t for t in targets if not isinstance(t, ast.Name)], scope))}

    def _loop(self, body: Ways) -> Ways:
        """None, once or often."""
        once = body.get("next", set()) | body.get("continue", set())
        often: set[Bag] = {NOTHING}
        while (more := often | product(often, once)) != often if once else False:
            often = more
        found: Ways = {exit_: product(often, body[exit_]) for exit_ in ("return", "raise") if exit_ in body}
        if "break" in body:
            found["broken"] = product(often, body["break"])
        return {**found, "next": often}

    def _try(self, one: ast.Try | ast.TryStar, scope: Scope) -> Ways:
        body = self._block(one.body, scope)
        failed = parts(body)
        whole = either({key: bags for key, bags in body.items() if key != "next"})
        if "next" in body:
            whole = either(whole, after(body["next"], self._block(one.orelse, scope)))
        ways = either(whole, *(after(failed, self._block(handler.body, scope)) for handler in one.handlers))
        if one.finalbody:
            last = self._block(one.finalbody, scope)
            leaves = {exit_: bags for exit_, bags in last.items() if exit_ != "next"}
            ends = set().union(*ways.values())
            ways = either(
                *({exit_: product(bags, last["next"])} for exit_, bags in ways.items() if "next" in last),
                after(ends, leaves),
            )
        return ways

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
        if certain and self.kind.result == "single" and not self.kind.layout:
            return frozenset({frozenset(((name, None), 1) for name in outputs if name in self.ports)})
        return some_of(name for name in outputs if name in self.ports)

    def _nested(self, one: ast.AST, scope: Scope) -> None:
        """A function inside: when it runs is not known, so its ports may be sent whenever."""
        for part in ast.walk(one):
            if not isinstance(part, ast.expr):
                continue
            self.loose |= self._port(part, scope.me, scope.names)
            name = own(part, scope.me)
            if name is not None and function_of(self.kind, name) is not None:
                self.later.add(name)
                self.inline.add(name)
        bases = {id(part.value) for part in ast.walk(one) if isinstance(part, ast.Attribute)}
        if any(isinstance(p, ast.Name) and p.id == scope.me and id(p) not in bases for p in ast.walk(one)):
            raise Unknown("a function inside it hands the node on")

    # --- expressions

    def _all(self, parts: Iterable[ast.expr | None], scope: Scope) -> set[Bag]:
        found = {NOTHING}
        for part in parts:
            found = product(found, self._value(part, scope))
        return found

    def _value(self, one: ast.expr | None, scope: Scope, *, aliased: bool = False) -> set[Bag]:
        """The bags that are sent while an expression is evaluated."""
        if one is None:
            return {NOTHING}
        handle = _EXPRESSIONS.get(type(one))
        if handle is not None:
            found: set[Bag] = handle(self, one, scope, aliased)
            return found
        ports = self._port(one, scope.me, scope.names)
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
        sent = some_of(name for name in self.outputs if name in self.ports)
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
        if not self._ports_handed_on(one.generators[0].iter, scope.me):
            before = self._value(one.generators[0].iter, scope)
        return product(before, often)

    def _call(self, one: ast.Call, scope: Scope, aliased: bool) -> set[Bag]:
        function = one.func
        if isinstance(function, ast.Attribute) and function.attr in SENDS:
            ports = self._port(function.value, scope.me, scope.names)
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
        modifier = next((keyword.value for keyword in one.keywords if keyword.arg == "activity"), None)
        sent: set[Bag] = set()
        for port in ports:
            sent |= {frozenset({(sending, 1)}) for sending in self._sendings(port, modifier)} or {NOTHING}
        if modifier is not None and not isinstance(modifier, ast.Constant | ast.UnaryOp):
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


_STATEMENTS: Final[dict[type[ast.stmt], Callable[..., Ways]]] = {
    ast.Return: Walk._return,
    ast.Raise: Walk._raise,
    ast.Break: Walk._jump,
    ast.Continue: Walk._jump,
    ast.If: Walk._if,
    ast.While: Walk._while,
    ast.For: Walk._for,
    ast.AsyncFor: Walk._for,
    ast.With: Walk._with,
    ast.AsyncWith: Walk._with,
    ast.Try: Walk._try,
    ast.TryStar: Walk._try,
    ast.Match: Walk._match,
    ast.FunctionDef: Walk._define,
    ast.AsyncFunctionDef: Walk._define,
    ast.ClassDef: Walk._define,
    ast.Assign: Walk._assign,
    ast.AnnAssign: Walk._assign,
}
"""What reads each kind of statement; of all others only the expressions in them matter."""
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

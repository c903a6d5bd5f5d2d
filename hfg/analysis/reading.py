"""Reads from the source of a node type which ports its code may send over, without running it.

A *bag* is what one firing or call may send over certain ports. `read` walks the syntax tree of each handler along every
way through branches and loops, and follows calls of the node's own methods. It does not look at conditions, so it may
find bags that never occur, but it never leaves one out. Code that it cannot follow counts as unknown: then any of the
ports may be sent, any number of times. Depends on node types only.
"""

from __future__ import annotations

import ast
import builtins
import functools
import inspect
import linecache
import types
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node

__all__ = ["NOTHING", "Bag", "Code", "Handler", "Sent", "parts_of", "read"]

Sent: TypeAlias = tuple[str, int | None]
"""A port and the explicit modifier, None for none (rule A4). An explicit 0 sends no activity, so it is left out."""

Bag: TypeAlias = frozenset[tuple[Sent, int]]
"""What one firing or call sends, and how often: 1, or 2 for twice or more."""

NOTHING: Final[Bag] = frozenset()
_MANY: Final = 2
_MOST_BAGS: Final = 64
_DEEPEST: Final = 12
_MOST_FUNCTIONS: Final = 200
_SENDS: Final = frozenset({"trigger", "trigger_wait", "send"})
_REACHES_PORTS: Final = frozenset(
    {*_SENDS, "getattr", "vars", "ports", "methodcaller", "attrgetter", "__dict__", "_port", "_emit", "_emit_wait"}
)
_HARMLESS: Final = frozenset({"isinstance", "id", "type", "repr", "str", "hash", "print", "len", "format"})
_HANDS_ON: Final = frozenset({"enumerate", "zip", "list", "tuple", "reversed", "range", "len", "min", "max", "sorted"})
_OUTSIDE: Final = ("setup", "ready", "teardown", "on_activated", "do")


class _Unknown(Exception):
    """Code that cannot be followed; the text says why."""


@dataclass(frozen=True)
class Handler:
    """The code of one kind of firing or call.

    Attributes:
      bags: what it may send.
      whole: one bag leaves in one step. Otherwise each sending is a step of its own, and others work in between.
      unknown: why the code could not be read; "" if it was.
    """

    bags: frozenset[Bag]
    whole: bool = True
    unknown: str = ""

    @property
    def sent(self) -> frozenset[Sent]:
        """All that it may send."""
        return frozenset(sent for bag in self.bags for sent, _ in bag)

    @property
    def sends_several(self) -> bool:
        """Whether there may be more than one sending in a firing or call."""
        return any(sum(count for _, count in bag) > 1 for bag in self.bags)


@dataclass(frozen=True)
class Code:
    """All sendings of a node type over certain ports.

    Attributes:
      firing: the process function; None if there is none.
      ending: the hook `end`; None if there is none.
      slots: by name.
      outside: what may be sent outside firings and calls: by timers, tasks and hooks.
    """

    firing: Handler | None = None
    ending: Handler | None = None
    slots: dict[str, Handler] = field(default_factory=dict)
    outside: frozenset[Sent] = frozenset()

    def unknown(self) -> Iterator[tuple[str, str]]:
        """Yield each handler that could not be read, and why."""
        for name, handler in (("process", self.firing), ("end", self.ending), *self.slots.items()):
            if handler is not None and handler.unknown:
                yield name, handler.unknown


@functools.lru_cache(maxsize=4096)
def read(kind: NodeType, ports: frozenset[str]) -> Code:
    """Read what a type's code may send over these ports: outputs, events and parameters."""
    if not isinstance(kind.origin, type):
        return Code(firing=_of_function(kind, ports))
    return _Type(kind, ports).code()


def _of_function(kind: NodeType, ports: frozenset[str]) -> Handler:
    """A function reaches no ports but by what it returns."""
    whole = "async" not in kind.process_kind
    try:
        return Handler(_some_of(name for name in kind.outputs if name in ports), whole)
    except _Unknown as why:
        return Handler(frozenset({NOTHING, frozenset(((name, None), 1) for name in kind.outputs)}), False, str(why))


def _some_of(names: Iterable[str]) -> frozenset[Bag]:
    """Each subset of ports: which values are None is not known."""
    found = {NOTHING}
    for name in names:
        found |= {_added(bag, {((name, None), 1)}) for bag in found}
        if len(found) > _MOST_BAGS:
            raise _Unknown("it has too many outputs with active edges")
    return frozenset(found)


def _added(bag: Bag, more: Iterable[tuple[Sent, int]]) -> Bag:
    counts = dict(bag)
    for sent, count in more:
        counts[sent] = min(_MANY, counts.get(sent, 0) + count)
    return frozenset(counts.items())


def _product(first: Iterable[Bag], second: Iterable[Bag]) -> set[Bag]:
    second = list(second)
    found = {_added(a, b) for a in first for b in second}
    if len(found) > _MOST_BAGS:
        raise _Unknown("there are too many ways through it")
    return found


_Ways: TypeAlias = dict[str, set[Bag]]
"""What was sent on the way to each exit: "next", "return", "break", "continue", "raise"."""


def _either(*ways: _Ways) -> _Ways:
    found: _Ways = {}
    for one in ways:
        for exit_, bags in one.items():
            found.setdefault(exit_, set()).update(bags)
    return found


def _after(before: Iterable[Bag], ways: _Ways) -> _Ways:
    before = list(before)
    return {exit_: _product(before, bags) for exit_, bags in ways.items()}


@dataclass
class _Scope:
    """The function that is being read."""

    function: types.FunctionType
    owner: type
    me: str
    names: dict[str, frozenset[str]]
    is_process: bool
    depth: int
    awaited: bool


class _Type:
    """Reads one class."""

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
        self.frees = takes_token or _speaks_of_tokens(kind)  # a sending may have a modifier of its own

    def code(self) -> Code:
        """Read all handlers, then what they hand on."""
        kind = self.kind
        firing = self._handler("process", kind.process_kind) if kind.process_kind != "none" else None
        ending = self._handler("end", "function") if "end" in kind.hooks else None
        slots = {}
        for name, spec in kind.slots.items():
            if spec.handler_name:
                slots[name] = self._handler(spec.handler_name, "async" if spec.is_async else "function", slot=name)
            elif name in self.ports:
                slots[name] = Handler(frozenset({frozenset({((name, None), 1)})}))  # a trigger parameter
        outside: set[Sent] = set()
        for name in _OUTSIDE:
            if name in kind.hooks:
                self.in_setup = name == "setup"
                outside |= self._sent_by(name)
        self.in_setup = False
        afterwards = self._sent_by("on_deactivated") if "on_deactivated" in kind.hooks else set()
        read_already: set[str] = set()
        at_once: set[Sent] = set()
        while self.later - read_already:
            name = min(self.later - read_already)
            read_already.add(name)
            sent = self._sent_by(name)
            outside |= sent
            if name in self.inline:
                at_once |= sent
        if self.lost:
            return self._all_unknown(self.lost)
        loose = {sent for name in self.loose for sent in self._sendings(name, None)} | at_once | afterwards
        if loose:
            outside |= loose
            firing = firing and _loosened(firing, loose)
            ending = ending and _loosened(ending, loose)
            slots = {name: _loosened(handler, loose) for name, handler in slots.items()}
        return Code(firing, ending, slots, frozenset(outside))

    def _all_unknown(self, why: str) -> Code:
        kind = self.kind
        everything = Handler(self._anything(), False, why)
        return Code(
            everything if kind.process_kind != "none" else None,
            everything if "end" in kind.hooks else None,
            dict.fromkeys(kind.slots, everything),
            everything.sent,
        )

    def _anything(self) -> frozenset[Bag]:
        modifiers = (None, 1, -1) if self.frees else (None,)
        return frozenset(frozenset({((name, one), _MANY)}) for name in self.ports for one in modifiers) | {NOTHING}

    def _handler(self, name: str, runs: str, slot: str = "") -> Handler:
        function = _function_of(self.kind, name)
        try:
            if function is None:
                raise _Unknown("it is no plain function")
            is_generator = "generator" in runs
            bags = self._method(function, is_process=name == "process", awaited="async" in runs)
        except _Unknown as why:
            return Handler(self._anything(), False, str(why))
        bags = {frozenset((sent, 1 if sent[0] in self.outputs else n) for sent, n in bag) for bag in bags}
        if is_generator:  # each firing goes from one yield to the next
            several = {sent for bag in bags for sent, _ in bag}
            whole = len(several) < 2 and all(sent[0] in self.outputs for sent in several)
            return Handler(frozenset(bags) | {NOTHING}, whole and "async" not in runs)
        return Handler(frozenset(bags), "async" not in runs)

    def _sent_by(self, name: str) -> set[Sent]:
        """All that a method sends that runs outside firings and calls."""
        function = _function_of(self.kind, name)
        try:
            if function is None:
                raise _Unknown("it is no plain function")
            bags = self._method(function, is_process=False, awaited=True)
        except _Unknown as why:
            self.lost = self.lost or f"{name}: {why}"
            return set()
        return {sent for bag in bags for sent, _ in bag}

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
        if depth > _DEEPEST:
            raise _Unknown("its methods call each other too deeply")
        tree = _tree_of(function)
        owner = next((one for one in self._mro() if function in _functions_in(one)), self.kind.origin)
        arguments = [*tree.args.posonlyargs, *tree.args.args]
        me = arguments[0].arg if arguments else ""
        names = self._aliases(tree, me)
        scope = _Scope(function, owner, me, names, is_process, depth, awaited)
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
            case ast.Call(func=ast.Name(id=name)) if name in _HANDS_ON:
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
            name = _own(one.value, me)
            if name in self.kind.vectors and isinstance(one.slice, ast.Constant):
                element = f"{name}[{one.slice.value!r}]"
                return frozenset({element}) & self.sending
            inner = one.value
            group = inner.attr if isinstance(inner, ast.Attribute) and _own(inner.value, me) == "ports" else ""
            if group in ("events", "outputs"):
                return self.sending  # which one is not known, but it is one
            return self._port(one.value, me, names)
        if isinstance(one, ast.Call) and _own(one.func, me) == "_port":
            return self.sending
        name = _own(one, me)
        if name is None:
            return frozenset()
        if name in self.kind.vectors:
            return frozenset(port for port in self.sending if port.startswith(f"{name}["))
        return frozenset({name}) & self.sending

    # --- statements

    def _block(self, statements: Iterable[ast.stmt], scope: _Scope) -> _Ways:
        found: _Ways = {}
        now: set[Bag] = {NOTHING}
        for statement in statements:
            ways = _after(now, self._statement(statement, scope))
            now = ways.pop("next", set())
            found = _either(found, ways)
            if not now:
                return found
        return _either(found, {"next": now})

    def _statement(self, one: ast.stmt, scope: _Scope) -> _Ways:
        handle = _STATEMENTS.get(type(one))
        if handle is not None:
            found: _Ways = handle(self, one, scope)
            return found
        return {"next": self._all([part for part in ast.iter_child_nodes(one) if isinstance(part, ast.expr)], scope)}

    def _return(self, one: ast.Return, scope: _Scope) -> _Ways:
        return {"return": _product(self._value(one.value, scope), self._returned(one.value, scope))}

    def _raise(self, one: ast.Raise, scope: _Scope) -> _Ways:
        return {"raise": self._all([one.exc, one.cause], scope)}

    def _jump(self, one: ast.Break | ast.Continue, scope: _Scope) -> _Ways:
        return {"break" if isinstance(one, ast.Break) else "continue": {NOTHING}}

    def _if(self, one: ast.If, scope: _Scope) -> _Ways:
        choice = _either(self._block(one.body, scope), self._block(one.orelse, scope))
        return _after(self._value(one.test, scope), choice)

    def _while(self, one: ast.While, scope: _Scope) -> _Ways:
        loop = self._loop(_after(self._value(one.test, scope), self._block(one.body, scope)))
        broken = loop.pop("broken", set())
        if isinstance(one.test, ast.Constant) and one.test.value:
            del loop["next"]
            return {**loop, "next": broken} if broken else loop
        loop["next"] |= broken
        return _after(self._value(one.test, scope), loop)

    def _for(self, one: ast.For | ast.AsyncFor, scope: _Scope) -> _Ways:
        loop = self._loop(self._block(one.body, scope))
        loop["next"] |= loop.pop("broken", set())
        loop = _either(
            {key: bags for key, bags in loop.items() if key != "next"},
            _after(loop["next"], self._block(one.orelse, scope)),
            {"next": loop["next"]},
        )
        return _after(self._value(one.iter, scope), loop)

    def _with(self, one: ast.With | ast.AsyncWith, scope: _Scope) -> _Ways:
        before = self._all([item.context_expr for item in one.items], scope)
        ways = self._block(one.body, scope)
        return _after(before, _either(ways, {"next": _parts(ways)}))  # a context may swallow an exception

    def _match(self, one: ast.Match, scope: _Scope) -> _Ways:
        cases = [_after(self._all([case.guard], scope), self._block(case.body, scope)) for case in one.cases]
        return _after(self._value(one.subject, scope), _either({"next": {NOTHING}}, *cases))

    def _define(self, one: ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef, scope: _Scope) -> _Ways:
        self._nested(one, scope)
        return {"next": {NOTHING}}

    def _assign(self, one: ast.Assign | ast.AnnAssign, scope: _Scope) -> _Ways:
        targets = one.targets if isinstance(one, ast.Assign) else [one.target]
        is_local = all(isinstance(target, ast.Name) for target in targets)
        value = self._value(one.value, scope, aliased=is_local)
        return {"next": _product(value, self._all([t for t in targets if not isinstance(t, ast.Name)], scope))}

    def _loop(self, body: _Ways) -> _Ways:
        """None, once or often."""
        once = body.get("next", set()) | body.get("continue", set())
        often: set[Bag] = {NOTHING}
        while (more := often | _product(often, once)) != often if once else False:
            often = more
        found: _Ways = {exit_: _product(often, body[exit_]) for exit_ in ("return", "raise") if exit_ in body}
        if "break" in body:
            found["broken"] = _product(often, body["break"])
        return {**found, "next": often}

    def _try(self, one: ast.Try | ast.TryStar, scope: _Scope) -> _Ways:
        body = self._block(one.body, scope)
        failed = _parts(body)
        whole = _either({key: bags for key, bags in body.items() if key != "next"})
        if "next" in body:
            whole = _either(whole, _after(body["next"], self._block(one.orelse, scope)))
        ways = _either(whole, *(_after(failed, self._block(handler.body, scope)) for handler in one.handlers))
        if one.finalbody:
            last = self._block(one.finalbody, scope)
            leaves = {exit_: bags for exit_, bags in last.items() if exit_ != "next"}
            ends = set().union(*ways.values())
            ways = _either(
                *({exit_: _product(bags, last["next"])} for exit_, bags in ways.items() if "next" in last),
                _after(ends, leaves),
            )
        return ways

    def _returned(self, value: ast.expr | None, scope: _Scope) -> frozenset[Bag]:
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
        return _some_of(name for name in outputs if name in self.ports)

    def _nested(self, one: ast.AST, scope: _Scope) -> None:
        """A function inside: when it runs is not known, so its ports may be sent whenever."""
        for part in ast.walk(one):
            if not isinstance(part, ast.expr):
                continue
            self.loose |= self._port(part, scope.me, scope.names)
            name = _own(part, scope.me)
            if name is not None and _function_of(self.kind, name) is not None:
                self.later.add(name)
                self.inline.add(name)
        bases = {id(part.value) for part in ast.walk(one) if isinstance(part, ast.Attribute)}
        if any(isinstance(p, ast.Name) and p.id == scope.me and id(p) not in bases for p in ast.walk(one)):
            raise _Unknown("a function inside it hands the node on")

    # --- expressions

    def _all(self, parts: Iterable[ast.expr | None], scope: _Scope) -> set[Bag]:
        found = {NOTHING}
        for part in parts:
            found = _product(found, self._value(part, scope))
        return found

    def _value(self, one: ast.expr | None, scope: _Scope, *, aliased: bool = False) -> set[Bag]:
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
        name = _own(one, scope.me)
        if name is not None:
            return self._attribute(name, scope)
        found = {NOTHING}
        for part in ast.iter_child_nodes(one):
            if isinstance(part, ast.expr):
                handed_on = aliased and isinstance(one, ast.Tuple | ast.List)
                found = _product(found, self._value(part, scope, aliased=handed_on))
        return found

    def _constant(self, one: ast.Constant, scope: _Scope, aliased: bool) -> set[Bag]:
        return {NOTHING}

    def _name(self, one: ast.Name, scope: _Scope, aliased: bool) -> set[Bag]:
        if one.id == scope.me and scope.me:
            raise _Unknown("it hands the node on")
        if one.id in scope.names and isinstance(one.ctx, ast.Load) and not aliased:
            self.loose |= scope.names[one.id]
        return {NOTHING}

    def _lambda(self, one: ast.Lambda, scope: _Scope, aliased: bool) -> set[Bag]:
        self._nested(one, scope)
        return {NOTHING}

    def _choice(self, one: ast.IfExp, scope: _Scope, aliased: bool) -> set[Bag]:
        choice = self._value(one.body, scope, aliased=aliased) | self._value(one.orelse, scope, aliased=aliased)
        return _product(self._value(one.test, scope), choice)

    def _and_or(self, one: ast.BoolOp, scope: _Scope, aliased: bool) -> set[Bag]:
        so_far = self._value(one.values[0], scope, aliased=aliased)
        found = set(so_far)
        for part in one.values[1:]:
            so_far = _product(so_far, self._value(part, scope, aliased=aliased))
            found |= so_far
        return found

    def _await(self, one: ast.Await, scope: _Scope, aliased: bool) -> set[Bag]:
        return self._value(one.value, scope)

    def _yield(self, one: ast.Yield, scope: _Scope, aliased: bool) -> set[Bag]:
        sent = self._returned(one.value, scope) if scope.is_process and not scope.depth else {NOTHING}
        return _product(self._all([one.value], scope), sent)

    def _yield_from(self, one: ast.YieldFrom, scope: _Scope, aliased: bool) -> set[Bag]:
        sent = _some_of(name for name in self.outputs if name in self.ports)
        return _product(self._all([one.value], scope), sent)

    def _attribute(self, name: str, scope: _Scope) -> set[Bag]:
        """`self.name` as a value: a property runs; a method may be called by the code that receives it."""
        if name in ("ports", "__dict__"):
            raise _Unknown(f"it reaches its ports by self.{name}")
        held = inspect.getattr_static(self.kind.origin, name, None)
        getter = held.fget if isinstance(held, property) else getattr(held, "func", None)
        if isinstance(getter, types.FunctionType):
            return self._method(getter, is_process=False, depth=scope.depth + 1)
        if _function_of(self.kind, name) is not None:
            self.later.add(name)
            if not self.in_setup:
                self.inline.add(name)
        return {NOTHING}

    def _comprehension(self, one: Any, scope: _Scope, aliased: bool) -> set[Bag]:
        values = [one.key, one.value] if isinstance(one, ast.DictComp) else [one.elt]
        conditions = [part for generator in one.generators for part in generator.ifs]
        inner = [generator.iter for generator in one.generators[1:]]
        often = self._loop({"next": self._all([*inner, *conditions, *values], scope)})["next"]
        before = {NOTHING}
        if not self._ports_handed_on(one.generators[0].iter, scope.me):
            before = self._value(one.generators[0].iter, scope)
        return _product(before, often)

    def _call(self, one: ast.Call, scope: _Scope, aliased: bool) -> set[Bag]:
        function = one.func
        if isinstance(function, ast.Attribute) and function.attr in _SENDS:
            ports = self._port(function.value, scope.me, scope.names)
            if ports:
                return self._sending(one, function.value, ports, scope)
        arguments = [*one.args, *(keyword.value for keyword in one.keywords)]
        given = [part.value if isinstance(part, ast.Starred) else part for part in arguments]
        others = [part for part in given if not (scope.me and isinstance(part, ast.Name) and part.id == scope.me)]
        if len(others) < len(given):
            self._need_harmless(function, scope)
        hands_on = isinstance(function, ast.Name) and function.id in _HANDS_ON
        before = {NOTHING}
        for part in others:
            before = _product(before, self._value(part, scope, aliased=hands_on))
        return _product(before, self._called(function, scope))

    def _sending(self, one: ast.Call, over: ast.expr, ports: frozenset[str], scope: _Scope) -> set[Bag]:
        """The bags of `self.port.trigger(...)`, over one of these ports."""
        inside = over.slice if isinstance(over, ast.Subscript) else None
        before = self._all([inside, *one.args, *(keyword.value for keyword in one.keywords)], scope)
        modifier = next((keyword.value for keyword in one.keywords if keyword.arg == "activity"), None)
        sent: set[Bag] = set()
        for port in ports:
            sent |= {frozenset({(sending, 1)}) for sending in self._sendings(port, modifier)} or {NOTHING}
        if modifier is not None and not isinstance(modifier, ast.Constant | ast.UnaryOp):
            sent.add(NOTHING)  # it may be 0
        return _product(before, sent)

    def _called(self, function: ast.expr, scope: _Scope) -> set[Bag]:
        """The bags that a called function sends, if it is one of the node's."""
        name = _own(function, scope.me)
        above = _above(function)
        if name is not None or above is not None:
            found = _function_of(self.kind, name or "") if above is None else self._inherited(above, scope)
            if found is None:
                return {NOTHING} if above is None else set(self._need_base(above))
            if inspect.iscoroutinefunction(found) and not scope.awaited:
                self.later.add(found.__name__)  # only a coroutine is made
                return {NOTHING}
            return self._method(found, is_process=False, depth=scope.depth + 1, awaited=scope.awaited)
        return self._value(function, scope) if not isinstance(function, ast.Name) else {NOTHING}

    def _inherited(self, name: str, scope: _Scope) -> types.FunctionType | None:
        mro = self._mro()
        for owner in mro[mro.index(scope.owner) + 1 :]:
            if name in vars(owner) and owner not in (Node, object):
                return _plain(vars(owner)[name])
        return None

    def _need_base(self, name: str) -> list[Bag]:
        if hasattr(Node, name) or hasattr(object, name):
            return [NOTHING]  # those of `Node` do nothing
        raise _Unknown(f"super().{name} is not found")

    def _need_harmless(self, function: ast.expr, scope: _Scope) -> None:
        """Refuse a function that gets the node and may reach its ports."""
        called = _resolved(function, scope.function)
        if isinstance(function, ast.Name) and function.id in _HARMLESS and called is getattr(builtins, function.id):
            return
        name = ast.unparse(function)
        if called is None or not _is_harmless(called):
            raise _Unknown(f"it hands the node to {name}")


_STATEMENTS: Final[dict[type[ast.stmt], Callable[..., _Ways]]] = {
    ast.Return: _Type._return,
    ast.Raise: _Type._raise,
    ast.Break: _Type._jump,
    ast.Continue: _Type._jump,
    ast.If: _Type._if,
    ast.While: _Type._while,
    ast.For: _Type._for,
    ast.AsyncFor: _Type._for,
    ast.With: _Type._with,
    ast.AsyncWith: _Type._with,
    ast.Try: _Type._try,
    ast.TryStar: _Type._try,
    ast.Match: _Type._match,
    ast.FunctionDef: _Type._define,
    ast.AsyncFunctionDef: _Type._define,
    ast.ClassDef: _Type._define,
    ast.Assign: _Type._assign,
    ast.AnnAssign: _Type._assign,
}
"""What reads each kind of statement; of all others only the expressions in them matter."""

_EXPRESSIONS: Final[dict[type[ast.expr], Callable[..., set[Bag]]]] = {
    ast.Constant: _Type._constant,
    ast.Name: _Type._name,
    ast.Call: _Type._call,
    ast.Lambda: _Type._lambda,
    ast.IfExp: _Type._choice,
    ast.BoolOp: _Type._and_or,
    ast.ListComp: _Type._comprehension,
    ast.SetComp: _Type._comprehension,
    ast.GeneratorExp: _Type._comprehension,
    ast.DictComp: _Type._comprehension,
    ast.Await: _Type._await,
    ast.Yield: _Type._yield,
    ast.YieldFrom: _Type._yield_from,
}
"""What reads each kind of expression; all others send what their parts send."""


def _loosened(handler: Handler, more: set[Sent]) -> Handler:
    """The same, in which these may be sent as well, whenever and however often."""
    return Handler(handler.bags | {frozenset({(sent, _MANY)}) for sent in more}, False, handler.unknown)


def _parts(ways: _Ways) -> set[Bag]:
    """All that may have been sent when something fails before the end."""
    found = {NOTHING}
    for bags in ways.values():
        for bag in bags:
            found |= set(parts_of(bag))
    return found


def parts_of(bag: Bag) -> Iterator[Bag]:
    """Yield each part of a bag: the code may fail before it has sent all of it."""
    found: list[dict[Sent, int]] = [{}]
    for sent, count in bag:
        found += [{**one, sent: number} for one in found for number in range(1, count + 1)]
        if len(found) > _MOST_BAGS:
            raise _Unknown("there are too many ways through it")
    yield from (frozenset(one.items()) for one in found)


def _own(one: ast.AST, me: str) -> str | None:
    """The name in `self.name`."""
    if isinstance(one, ast.Attribute) and isinstance(one.value, ast.Name) and one.value.id == me:
        return one.attr
    return None


def _above(one: ast.expr) -> str | None:
    """The name in `super().name`."""
    if isinstance(one, ast.Attribute) and isinstance(one.value, ast.Call):
        function = one.value.func
        if isinstance(function, ast.Name) and function.id == "super":
            return one.attr
    return None


def _function_of(kind: NodeType, name: str) -> types.FunctionType | None:
    """The plain function of a method or slot of the class; none for what `Node` itself has."""
    for owner in kind.origin.__mro__:
        if name in vars(owner):
            return None if owner in (Node, object) else _plain(vars(owner)[name])
    return None


def _plain(held: Any) -> types.FunctionType | None:
    for one in (held, getattr(held, "__func__", None), getattr(held, "handler", None)):
        if isinstance(one, types.FunctionType):
            inner = inspect.unwrap(one)
            return inner if isinstance(inner, types.FunctionType) else None
    return None


def _functions_in(owner: type) -> list[Any]:
    found = [_plain(value) for value in vars(owner).values()]
    return found + [value.fget for value in vars(owner).values() if isinstance(value, property)]


def _tree_of(function: types.FunctionType) -> ast.FunctionDef | ast.AsyncFunctionDef:
    code = function.__code__
    lines = linecache.getlines(code.co_filename, function.__globals__)
    found = _trees("".join(lines)).get((code.co_name, code.co_firstlineno)) if lines else None
    if found is None:
        raise _Unknown("its source is not there")
    return found


@functools.lru_cache(maxsize=256)
def _trees(text: str) -> dict[tuple[str, int], ast.FunctionDef | ast.AsyncFunctionDef]:
    """All functions of a source file by name and first line."""
    found = {}
    try:
        tree = ast.parse(text)
    except SyntaxError:
        return {}
    for one in ast.walk(tree):
        if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef):
            first = min([one.lineno, *(decorator.lineno for decorator in one.decorator_list)])
            found[one.name, first] = one
    return found


def _resolved(one: ast.expr, function: types.FunctionType) -> Any:
    """The object that a name means in a function; None if that is not known."""
    if isinstance(one, ast.Name):
        if one.id in function.__code__.co_freevars:
            cell = (function.__closure__ or ())[function.__code__.co_freevars.index(one.id)]
            return cell.cell_contents if cell != types.CellType() else None
        if one.id in function.__code__.co_varnames:
            return None
        return function.__globals__.get(one.id, getattr(builtins, one.id, None))
    if isinstance(one, ast.Attribute):
        held = _resolved(one.value, function)
        return inspect.getattr_static(held, one.attr, None) if isinstance(held, types.ModuleType | type) else None
    return None


def _is_harmless(called: Any) -> bool:
    """Whether nothing in a function, or in what it calls of its package, names what could reach a port."""
    waiting, seen = _code_of(called), set[int]()
    if not waiting:
        return False
    package = (getattr(called, "__module__", None) or "").partition(".")[0]
    while waiting:
        function = waiting.pop()
        if id(function) in seen:
            continue
        seen.add(id(function))
        words = set(_words(function.__code__))
        if words & _REACHES_PORTS or len(seen) > _MOST_FUNCTIONS:
            return False
        for word in words:
            value = function.__globals__.get(word)
            if (getattr(value, "__module__", None) or "").partition(".")[0] == package and value is not Node:
                waiting += _code_of(value)
    return True


def _code_of(value: Any) -> list[types.FunctionType]:
    if isinstance(value, types.FunctionType):
        return [value]
    if isinstance(value, type) and not issubclass(value, Node):
        return [one for one in map(_plain, vars(value).values()) if one is not None]
    return []


def _words(code: types.CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _words(constant)
        elif isinstance(constant, str):
            yield constant


def _speaks_of_tokens(kind: NodeType) -> bool:
    """Whether the code makes tokens, which bring modifiers of their own (rule A4)."""
    for owner in kind.origin.__mro__:
        if owner not in (Node, object):
            for function in _functions_in(owner):
                if isinstance(function, types.FunctionType) and "Token" in _words(function.__code__):
                    return True
    return False

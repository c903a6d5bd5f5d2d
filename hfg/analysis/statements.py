"""Every way through the statements of a function, and what is sent on the way to each exit. Depends on `bags`."""

from __future__ import annotations

import ast
import types
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from hfg.analysis.bags import NOTHING, Bag, Ways, after, either, parts, product

__all__ = ["Scope", "Statements"]


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


class Statements(ABC):
    """Walks through statements; what is sent while an expression is evaluated is up to the class below."""

    @abstractmethod
    def _value(self, one: ast.expr | None, scope: Scope, *, aliased: bool = False) -> set[Bag]:
        """The bags that are sent while an expression is evaluated."""

    @abstractmethod
    def _returned(self, value: ast.expr | None, scope: Scope) -> frozenset[Bag]:
        """The bags that the process function sends by returning a value."""

    @abstractmethod
    def _nested(self, one: ast.AST, scope: Scope) -> None:
        """A function inside: when it runs is not known."""

    def _all(self, parts: Iterable[ast.expr | None], scope: Scope) -> set[Bag]:
        found = {NOTHING}
        for part in parts:
            found = product(found, self._value(part, scope))
        return found

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


_STATEMENTS: Final[dict[type[ast.stmt], Callable[..., Ways]]] = {
    ast.Return: Statements._return,
    ast.Raise: Statements._raise,
    ast.Break: Statements._jump,
    ast.Continue: Statements._jump,
    ast.If: Statements._if,
    ast.While: Statements._while,
    ast.For: Statements._for,
    ast.AsyncFor: Statements._for,
    ast.With: Statements._with,
    ast.AsyncWith: Statements._with,
    ast.Try: Statements._try,
    ast.TryStar: Statements._try,
    ast.Match: Statements._match,
    ast.FunctionDef: Statements._define,
    ast.AsyncFunctionDef: Statements._define,
    ast.ClassDef: Statements._define,
    ast.Assign: Statements._assign,
    ast.AnnAssign: Statements._assign,
}
"""What reads each kind of statement; of all others only the expressions in them matter."""

"""Slots: handlers, what they take, and calling them by hand."""

from __future__ import annotations

import inspect
from typing import Any

import pytest

import hfg
from hfg.errors import DeclarationError
from hfg.ports import Relaying


class Base(hfg.Node):
    calls = hfg.State[list[Any]](factory=list)

    @hfg.slot
    def value(self, key: int) -> None:
        """Take a value."""
        self.calls.append(("Base", key))

    @hfg.slot
    def token(self, key: hfg.Token[int]) -> None:
        self.calls.append(key)

    @hfg.slot
    def anything(self) -> None:
        self.calls.append("anything")

    @hfg.slot(type=float)
    def typed(self, angle) -> None:  # type: ignore[no-untyped-def]
        self.calls.append(angle)

    @hfg.slot
    async def later(self, key: int = 3) -> None: ...


class Decorated(Base):
    @hfg.slot
    def value(self, key: int) -> None:
        super().value(key)
        self.calls.append(("Decorated", key))


class Plain(Base):
    def value(self, key):  # type: ignore[no-untyped-def, override]
        super().value(key)
        self.calls.append(("Plain", key))


def test_calling_a_slot_runs_its_handler() -> None:
    node = Base()
    node.value(3)
    node.anything()
    assert node.calls == [("Base", 3), "anything"]


@pytest.mark.parametrize("kind", [Decorated, Plain])
def test_an_override_is_a_slot_too_and_super_reaches_the_first(kind: type[Base]) -> None:
    node = kind()
    for _ in range(2):  # the second time the port is a plain attribute
        node.value(3)
    assert node.calls == [("Base", 3), (kind.__name__, 3)] * 2
    assert node.ports.slots["value"].type is int


def test_the_annotation_is_the_type_and_says_whether_the_token_is_wanted() -> None:
    slots = Base()._type.slots
    assert [(spec.name, spec.type, spec.takes_value, spec.token, spec.is_async) for spec in slots.values()] == [
        ("value", int, True, False, False),
        ("token", int, True, True, False),
        ("anything", object, False, False, False),
        ("typed", float, True, False, False),
        ("later", int, True, False, True),
    ]


@pytest.mark.rule("F6")
def test_a_runner_gives_the_token_and_the_handler_gets_what_it_wants() -> None:
    node, token = Base(), hfg.Token(3)
    for name in ("value", "token", "anything", "typed"):
        node._slot_call(name)(token)
    assert node.calls == [("Base", 3), token, "anything", 3]
    coroutine = node._slot_call("later")(token)
    assert inspect.iscoroutine(coroutine)
    coroutine.close()


def test_a_trigger_parameter_is_a_slot_and_an_event() -> None:
    class Button(hfg.Node):
        push = hfg.Parameter(trigger=True)

    node, got = Button(), []
    node.ports.events["push"]._emit = lambda *call: got.append(call)
    node._slot_call("push")(hfg.Token("hard"))
    assert got == [(None, None, None)]  # it has no value, whatever the signal carries
    assert list(node.ports.parameters) == []
    assert node._parameters == {}
    assert node.ports.slots["push"].kind == "slot"
    assert node.ports.events["push"].kind == "event"
    with pytest.raises(hfg.errors.UsageError, match=r'node\.ports\.slots\["push"\] or node\.ports\.events\["push"\]'):
        _ = node.push


def test_a_subgraphs_slot_needs_no_handler() -> None:
    class Box(hfg.Node, Relaying):
        begin = hfg.slot(type=int)

    assert Box().begin.type is int
    with pytest.raises(hfg.errors.UsageError, match="no handler to call"):
        Box().begin(3)


def test_a_nodes_slot_needs_a_handler() -> None:
    with pytest.raises(DeclarationError, match=r'slot "begin" has no handler; write `@hfg\.slot` above'):

        class Broken(hfg.Node):
            begin = hfg.slot(type=int)


def test_a_handler_without_annotation_is_refused() -> None:
    with pytest.raises(DeclarationError, match=r'argument "key" of slot "look" has no annotation; write `key: int`'):

        class Broken(hfg.Node):
            @hfg.slot
            def look(self, key): ...  # type: ignore[no-untyped-def]


def test_a_handler_of_two_arguments_is_refused() -> None:
    with pytest.raises(DeclarationError, match=r"takes 2 arguments \(a, b\), but a signal carries one value"):

        class Broken(hfg.Node):
            @hfg.slot  # type: ignore[arg-type]
            def look(self, a: int, b: int) -> None: ...

"""What the code of a node type may send is read from its source (rules A3, A4, A9)."""

from __future__ import annotations

from typing import Any

import pytest

import hfg
from hfg.activity import StateNode
from hfg.analysis.bags import Code, Handler
from hfg.analysis.reading import read
from hfg.nodes import activity
from hfg.nodes._alarm import Alarm


def code_of(node: hfg.Node) -> Code:
    kind = node._type
    return read(kind, frozenset((*kind.outputs, *kind.events)))


def bags(handler: Handler | None) -> set[str]:
    """Each bag as one text: "left+right", "left*2", "" for nothing."""
    assert handler is not None
    return {
        "+".join(
            sorted(
                port + (f"*{count}" if count > 1 else "") + ("" if modifier is None else f"@{modifier}")
                for (port, modifier), count in bag
            )
        )
        for bag in handler.bags
    }


class Two(hfg.Node):
    left = hfg.Event(int)
    right = hfg.Event(int)


class EitherOr(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        if value:
            self.left.trigger(value)
        else:
            self.right.trigger(value)


class Both(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        self.left.trigger(value)
        if value > 1:
            self.right.trigger(value)


class EarlyReturn(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        if value:
            self.left.trigger(value)
            return
        self.right.trigger(value)


class InALoop(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        for _ in range(value):
            self.left.trigger(value)


class WithHelpers(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        if self._is_left(value):
            return
        self._tell(value)

    def _is_left(self, value: int) -> bool:
        if value:
            self.left.trigger(value)
        return bool(value)

    def _tell(self, value: int) -> None:
        self.right.trigger(value)


class Inherited(EitherOr):
    @hfg.slot
    def go(self, value: int) -> None:
        super().go(value)


class ByLocalName(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        port = self.left if value else self.right
        port.trigger(value)


class ByConditionalExpression(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        (self.left if value else self.right).trigger(value)


class InATry(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        try:
            self.left.trigger(1 // value)
        except ZeroDivisionError:
            self.right.trigger(value)


class Matches(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        match value:
            case 1:
                self.left.trigger(value)
            case 2:
                self.right.trigger(value)


class Explicit(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        self.left.trigger(value, activity=1)
        self.right.trigger(value, activity=-1)

    @hfg.slot
    def hold(self) -> None:
        self.left.trigger(0, activity=0)

    @hfg.slot
    def some(self, value: int) -> None:
        self.left.trigger(0, activity=value)


class PassesTokens(Two):
    @hfg.slot
    def go(self, token: hfg.Token[int]) -> None:
        self.left.trigger(token)


class ByNumber(hfg.Node):
    ways = hfg.Events(int, 3)

    @hfg.slot
    def go(self, number: int) -> None:
        self.ways[number].trigger(number)

    @hfg.slot
    def first(self) -> None:
        self.ways[0].trigger(0)


@pytest.mark.parametrize(
    ("node", "expected"),
    [
        (EitherOr(), {"left", "right"}),
        (Both(), {"left", "left+right"}),
        (EarlyReturn(), {"left", "right"}),
        (InALoop(), {"", "left", "left*2"}),
        (WithHelpers(), {"", "left", "right", "left+right"}),  # conditions are not looked at
        (Inherited(), {"left", "right"}),
        (ByLocalName(), {"left", "right"}),
        (ByConditionalExpression(), {"left", "right"}),
        (InATry(), {"left", "right", "left+right"}),
        (Matches(), {"", "left", "right"}),
        (Explicit(), {"left@1+right@-1"}),
        (PassesTokens(), {"left", "left@1", "left@-1"}),
        (ByNumber(), {"ways[0]", "ways[1]", "ways[2]"}),
    ],
)
def test_all_ways_through_a_handler_are_found(node: hfg.Node, expected: set[str]) -> None:
    handler = code_of(node).slots["go"]
    assert bags(handler) == expected
    assert handler.whole
    assert not handler.unknown


def test_an_explicit_modifier_counts_as_what_it_may_be() -> None:
    code = code_of(Explicit())
    assert bags(code.slots["hold"]) == {""}
    assert bags(code.slots["some"]) == {"", "left", "left@1", "left@-1"}


def test_a_constant_index_names_one_port_of_a_vector() -> None:
    assert bags(code_of(ByNumber()).slots["first"]) == {"ways[0]"}


class Gives(hfg.Node):
    pose = hfg.Output(int)
    unknown = hfg.Event(int)

    def process(self, key: int) -> int | None:
        if key > 9:
            self.unknown.trigger(key)
            return None
        return key + 1


@hfg.node(outputs={"a": int, "b": int})
def split(value: int) -> tuple[int | None, int | None]:
    return value, None


def test_outputs_leave_by_what_is_returned() -> None:
    assert bags(code_of(Gives()).firing) == {"pose", "unknown"}
    assert bags(code_of(split()).firing) == {"", "a", "b", "a+b"}  # functions are not read: any may be None


class Waits(Two):
    async def process(self, value: int) -> None:
        self.left.trigger(value)
        self.right.trigger(value)


def test_code_that_may_wait_sends_in_several_steps() -> None:
    firing = code_of(Waits()).firing
    assert firing is not None
    assert not firing.whole
    assert firing.sends_several


class Rings(Two):
    def setup(self) -> None:
        self.alarm = Alarm(self, self._ring)

    def _ring(self) -> None:
        self.left.trigger(1)

    @hfg.slot
    def go(self) -> None:
        self.alarm.set(1.0)


def test_what_timers_send_leaves_outside_calls() -> None:
    code = code_of(Rings())
    assert bags(code.slots["go"]) == {""}
    assert code.outside == {("left", None)}


class HandsItselfOn(Two):
    @hfg.slot
    def go(self, name: str) -> None:
        getattr(self, name).trigger(1)


class HandsAPortOn(Two):
    @hfg.slot
    def go(self, tell: Any) -> None:
        tell(self.left)


class HasAFunctionInside(Two):
    @hfg.slot
    def go(self, value: int) -> None:
        def tell() -> None:
            self.left.trigger(value)

        tell()


def test_code_that_cannot_be_followed_is_unknown_and_may_send_anything() -> None:
    handler = code_of(HandsItselfOn()).slots["go"]
    assert handler.unknown == "it hands the node to getattr"
    assert {port for port, _ in handler.sent} == {"left", "right"}
    assert not handler.whole


@pytest.mark.parametrize("node", [HandsAPortOn(), HasAFunctionInside()])
def test_a_port_that_is_handed_on_may_be_sent_whenever(node: hfg.Node) -> None:
    code = code_of(node)
    assert ("left", None) in code.outside
    assert code.slots["go"].sends_several
    assert ("right", None) not in code.slots["go"].sent


def test_a_function_without_a_source_is_unknown() -> None:
    space: dict[str, Any] = {"hfg": hfg}
    exec(
        "class Made(hfg.Node):\n"
        "    left = hfg.Event()\n"
        "    @hfg.slot\n"
        "    def go(self) -> None:\n"
        "        self.left.trigger()\n",
        space,
    )
    assert code_of(space["Made"]()).slots["go"].unknown == "its source is not there"


class State(StateNode):
    push = hfg.Event()
    pull = hfg.Event()


def test_the_state_of_a_machine_answers_each_letter_by_one_event() -> None:
    assert bags(code_of(State()).slots["read"]) == {"push", "pull", "missing"}


@pytest.mark.parametrize(
    ("node", "slot", "expected"),
    [
        (activity.Branch(), "begin", {"ways[0]", "ways[1]", "other"}),
        (activity.Sequence(), "begin", {"steps[0]"}),
        (activity.Retry(), "gave_up", {"", "exhausted", "attempt"}),
        (activity.WaitForMessage(), "begin", {""}),
        (activity.TimeLimit(), "done", {"", "finished"}),
    ],
)
def test_nodes_of_the_library_are_read(node: hfg.Node, slot: str, expected: set[str]) -> None:
    assert bags(code_of(node).slots[slot]) == expected

"""Firing one node without a graph."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg.testing import fire
from hfg.testing.nodes import (
    Counter,
    Greeter,
    Merge,
    Passing,
    Scaled,
    Script,
    Stateful,
    Waiting,
    ascript,
    double,
    script,
)


class Diary(hfg.Node):
    """Writes down what is done with it."""

    page = hfg.Input(str, optional=True, default="nothing")
    pages = hfg.State(factory=list)

    def setup(self) -> None:
        self.pages.append("setup")

    def process(self, page: str) -> None:
        self.pages.append(page)

    def teardown(self) -> None:
        self.pages.append("teardown")


def test_a_function_gives_its_output() -> None:
    assert fire(double(), value=4).outputs == {"out": 8}


def test_silence_is_not_there() -> None:
    assert fire(script(values=(None,))).outputs == {}


def test_state_is_kept_from_one_firing_to_the_next() -> None:
    counter = Counter()
    assert [fire(counter, value=9).outputs["out"] for _ in range(3)] == [1, 2, 3]
    assert fire(counter, slot="tell").events == [("told", 3)]


def test_setup_runs_once_before_the_first_firing() -> None:
    diary = Diary()
    fire(diary, page="one")
    fire(diary)
    fire(diary, hook="teardown")
    assert diary.pages == ["setup", "one", "nothing", "teardown"]


def test_slots_take_a_value_and_signals_come_out() -> None:
    counter = Counter()
    fire(counter, slot="set", value=40)
    assert fire(counter, value=1).outputs == {"out": 41}


def test_a_hook_can_speak() -> None:
    counter = Counter()
    fire(counter, value=1)
    last = fire(counter, hook="end")
    assert (last.outputs, last.events) == ({"out": -1}, [("told", -1)])


def test_parameters_are_set_before() -> None:
    assert fire(Scaled(factor=3), value=2, parameters={"offset": 1}).outputs == {"out": 7}


def test_the_node_can_be_active() -> None:
    node = Stateful()
    assert fire(node, value=1).outputs == {"out": 0}
    assert fire(node, value=1, active=True).events == [("moved", 1)]


def test_modifiers_and_stamps_are_told() -> None:
    assert [(sent.name, sent.activity) for sent in fire(Greeter(), value=0).sent] == [("sign", 1), ("out", None)]
    passed = fire(Passing(), value=hfg.Token(3, activity=1, stamp=7.0))
    assert [(sent.value, sent.activity, sent.stamp) for sent in passed.sent] == [(3, 1, 7.0)] * 2


def test_a_generator_is_fired_until_its_end() -> None:
    node = script(values=(1, 2))
    assert [fire(node).outputs.get("out") for _ in range(2)] == [1, 2]
    assert fire(node).ended


def test_end_of_stream_is_an_end() -> None:
    assert fire(Script(count=0)).ended


def test_waiting_takes_no_time() -> None:
    assert fire(Waiting(pause_s=3600.0), value=2).events == [("before", 2), ("after", 2)]
    node = ascript(values=(5,), pause_s=60.0)
    assert fire(node).outputs == {"out": 5}
    assert fire(node).ended


def test_it_works_inside_a_running_loop_too() -> None:
    async def main() -> dict[str, object]:
        return fire(Waiting(), value=2).outputs

    assert asyncio.run(main()) == {"out": 2}


def test_code_that_waits_for_others_is_told_so() -> None:
    class Lonely(hfg.Node):
        async def process(self, value: int) -> None:
            await asyncio.get_running_loop().create_future()

    with pytest.raises(hfg.errors.UsageError, match="never comes outside a graph"):
        fire(Lonely(), value=1)


def test_optional_inputs_may_be_left_out_and_others_not() -> None:
    assert fire(Merge(), value=1).outputs == {"total": 101}
    with pytest.raises(hfg.errors.UsageError, match=r'needs a value for "value": fire\(node, value=...\)'):
        fire(Merge(), left=1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fire(double(), volume=1), 'has no input "volume"; its inputs are "value"'),
        (lambda: fire(Counter(), slot="shout"), 'has no slot "shout"'),
        (lambda: fire(Counter(), slot="set", loud=1), "a slot takes value="),
    ],
)
def test_wrong_names_are_answered_with_the_right_ones(call: object, message: str) -> None:
    with pytest.raises(hfg.errors.UsageError, match=message):
        call()  # type: ignore[operator]


def test_writing_an_output_twice_is_refused() -> None:
    class Twice(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)

        def process(self, value: int) -> int:
            self.out.send(value)
            return value

    with pytest.raises(hfg.errors.UsageError, match="written twice"):
        fire(Twice(), value=1)

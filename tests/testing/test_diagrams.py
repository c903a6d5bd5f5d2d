"""Token diagrams: reading, writing, driving."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

import hfg
from hfg.base.token import END, NO_MESSAGE
from hfg.testing.diagrams import Step, check, draw, parse, run
from hfg.testing.nodes import (
    Counter,
    Failing,
    Greeter,
    Passing,
    Relay,
    Sieve,
    Waiting,
    double,
)


def test_a_line_is_read_character_by_character() -> None:
    assert parse("1-a.|") == [Step(0, 1), Step(2, "a"), Step(3, NO_MESSAGE), Step(4, END)]


def test_a_group_is_one_tick() -> None:
    assert parse("-(12)3") == [Step(1, 1), Step(1, 2), Step(2, 3)]


def test_modifiers_stand_before_values_in_a_group_and_alone_for_signals() -> None:
    assert parse("+~!(+3~4)") == [Step(0, None, 1), Step(1, None, -1), Step(2, None), Step(3, 3, 1), Step(3, 4, -1)]


def test_letters_can_mean_anything() -> None:
    assert parse("x", {"x": (1, 2)}) == [Step(0, (1, 2))]
    assert draw([Step(0, (1, 2)), Step(1, [])], {"x": (1, 2)}) == "x?"


def test_what_means_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match=r'"\$" at 1 of the diagram "1\$" means nothing'):
        parse("1$")


steps = st.lists(
    st.tuples(st.sampled_from([0, 5, "a", None, END]), st.sampled_from([0, 1, -1]), st.integers(0, 3)), max_size=8
)


@pytest.mark.slow
@given(steps)
def test_what_is_drawn_reads_the_same(drawn: list[tuple[object, int, int]]) -> None:
    tick, line = 0, []
    for value, activity, pause in drawn:
        tick += pause
        line.append(Step(tick, value, activity))
    assert parse(draw(line)) == line


def test_a_node_is_driven_by_its_inputs() -> None:
    assert run(double(), value="1-2--3|") == {"out": "2-4--6|"}


def test_an_output_that_is_not_written_is_silent() -> None:
    check(Sieve(), value="124|", expected={"even": ".24|", "odd": "1..|"})


def test_slots_and_activity() -> None:
    check(Relay(), say="1-(+2)3|", expected={"said": "1-(+2)3", "activity": "--(+~)"})


def test_automatic_slots_can_be_driven() -> None:
    check(Counter(), value="-1-2-3|", activate="+", deactivate="----+", expected={"activity": "+---~"}, active=False)


def test_explicit_modifiers_are_drawn() -> None:
    check(Greeter(), value="01|", expected={"out": "0(~1)|", "sign": "(+0)1"})


def test_tokens_that_are_passed_on_keep_their_modifiers() -> None:
    check(Passing(), value="1(+2)|", expected={"out": "1(+2)|", "passed": "1(+2)", "activity": "-(+~)"})


def test_waiting_nodes_answer_later() -> None:
    check(
        Waiting(pause_s=0.02), value="2----4|", expected={"before": "2----4", "after": "--2----4", "out": "--2----(4|)"}
    )


def test_options_are_the_graph_s() -> None:
    check(Failing(), value="134|", options={"on_error": "skip"}, expected={"out": "1.4|"})


def test_a_difference_shows_both_lines() -> None:
    with pytest.raises(AssertionError, match=r"out:\n  expected  2-5\|\n  found     2-4\|"):
        check(double(), value="1-2|", expected={"out": "2-5|"})


def test_a_name_that_is_no_port_is_refused() -> None:
    with pytest.raises(ValueError, match='"valve" is not an input or a slot; there are value'):
        run(double(), valve="1")


def test_a_line_without_end_leaves_the_node_waiting() -> None:
    class Loud(hfg.Node):
        """Says goodbye."""

        out = hfg.Output(str)
        value = hfg.Input(int)

        def process(self, value: int) -> str:
            return str(value)

        def end(self) -> None:
            self.out.send("z")

    assert run(Loud(), value="1-") == {"out": "1"}
    assert run(Loud(), value="1-|") == {"out": "1-(z|)"}

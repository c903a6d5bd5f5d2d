"""The family `flow`: the ways that values take."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import hfg
from hfg.base.token import NO_MESSAGE
from hfg.nodes import flow
from hfg.testing import fire
from hfg.testing.diagrams import check, run


def listed(*lists: list[Any]) -> dict[str, Any]:
    """Give lists letters, A B C ..., with which a diagram shows them."""
    return {chr(ord("A") + number): one for number, one in enumerate(lists)}


@hfg.node
def script(*, values: tuple[Any, ...] = (), stamps: tuple[float, ...] = ()) -> Iterator[Any]:
    """Give values, None for silence."""
    yield from values


class Stamped(hfg.Node):
    """Give values with stamps of their own."""

    out = hfg.Output(Any)
    values = hfg.Parameter((), type=tuple[tuple[Any, float], ...])
    given = hfg.State(0)

    def process(self) -> None:
        if self.given == len(self.values):
            raise hfg.EndOfStream
        value, stamp = self.values[self.given]
        self.given += 1
        self.out.send(value, stamp=stamp)


class Heard(hfg.Node):
    """Write down what comes, with stamps."""

    tokens = hfg.State(factory=list[hfg.Token[Any]])

    @hfg.slot
    def hear(self, token: hfg.Token[Any]) -> None:
        self.tokens.append(token)

    @property
    def values(self) -> list[Any]:
        return [token.value for token in self.tokens]


# --- passing ---


def test_a_relay_passes_values_silence_and_the_end_on() -> None:
    check(flow.relay(), value="1-a--|", expected={"out": "1-a--|"})


@pytest.mark.rule("A4", "A5")
def test_a_relay_hands_activity_on_once() -> None:
    check(flow.relay(), value="1(+2)-3(~4)|", expected={"out": "1(+2)-34|", "activity": "-(+~)"})
    assert run(flow.relay(), active=False, value="(+1)|") == {"out": "1|"}


def test_take_passes_the_first_values_and_ends() -> None:
    check(flow.Take(count=2), value="1-2-3-4|", expected={"out": "1-(2|)"})
    check(flow.Take(count=3), value="1-|", expected={"out": "1-|"})
    check(flow.Take(count=0), value="-1-2|", expected={"out": "-|"})


def test_a_source_that_works_for_take_alone_is_given_up() -> None:
    @hfg.node
    def forever() -> Iterator[int]:
        number = 0
        while True:
            yield number
            number += 1

    graph = hfg.Graph()
    taken = graph.add(forever()) >> graph.add(flow.Take(count=3))
    graph.connect(taken.out, graph.output("taken", int))
    report = hfg.run(graph, clock="virtual")
    assert (report.outcome, report.outputs["taken"]) == ("done", [0, 1, 2])


def test_take_begins_anew_when_it_is_reset() -> None:
    check(flow.Take(count=3), value="12--34|", reset="--!", expected={"out": "12--34|"})


def test_skip_leaves_the_first_values_out_by_silence() -> None:
    check(flow.Skip(count=2), value="1-2-3-4|", expected={"out": ".-.-3-4|"})
    check(flow.Skip(count=0), value="1|", expected={"out": "1|"})


def test_take_while_ends_with_the_first_value_whose_condition_is_false() -> None:
    how: dict[str, Any] = {"values": {"T": True, "F": False}}
    check(flow.TakeWhile(), value="1-2-3-4", condition="T-T-F-T", expected={"out": "1-2-|"}, **how)
    check(flow.TakeWhile(), value="1-2|", condition="T-T|", expected={"out": "1-2|"}, **how)


def test_every_nth_value_passes_from_the_offset_on() -> None:
    check(flow.EveryNth(n=3), value="0123456|", expected={"out": "0..3..6|"})
    check(flow.EveryNth(n=2, offset=1), value="01234|", expected={"out": ".1.3.|"})


def test_different_values_pass_and_equal_ones_are_silence() -> None:
    check(flow.Different(), value="1-1-2-2-1|", expected={"out": "1-.-2-.-1|"})
    arrays = {"a": np.array([1, 2]), "b": np.array([1, 2]), "c": np.array([1, 3]), "d": np.array([[1, 3]])}
    node = flow.Different()
    passed = [bool(fire(node, value=arrays[name]).outputs) for name in "abcd"]
    assert passed == [True, False, True, True]


def test_nan_differs_from_itself() -> None:
    node = flow.Different()
    assert [bool(fire(node, value=float("nan")).outputs) for _ in range(2)] == [True, True]


def test_distinct_values_pass_once_as_long_as_they_are_remembered() -> None:
    check(flow.Distinct(), value="1213|", expected={"out": "12.3|"})
    check(flow.Distinct(remember=2), value="12131|", expected={"out": "12.3.|"})
    check(flow.Distinct(remember=1), value="1121|", expected={"out": "1.21|"})


def test_distinct_says_what_to_do_with_values_that_are_no_key() -> None:
    with pytest.raises(TypeError, match="which a list cannot be: send something that identifies the value"):
        fire(flow.Distinct(), value=[1])


def test_a_message_becomes_an_event() -> None:
    check(flow.MessageEvent(), value="1-2(+3)|", expected={"received": "1-2(+3)", "activity": "---(+~)"})


@pytest.mark.rule("F4")
def test_silence_signals_nothing() -> None:
    graph = hfg.Graph()
    source, node, heard = graph.add(script(values=(1, None, 3))), graph.add(flow.MessageEvent()), graph.add(Heard())
    graph.connect(source.out, node.value)
    graph.connect(node.received, heard.hear)
    hfg.run(graph, clock="virtual")
    assert heard.values == [1, 3]


def test_the_end_of_a_stream_is_signalled_with_the_number_of_its_values() -> None:
    check(flow.AtEnd(), value="1-2-|", expected={"out": "1-2-|", "ended": "----2"})


def test_a_run_stops_with_the_end_of_one_stream() -> None:
    graph = hfg.Graph()
    first = graph.add(script(values=(1, 2)), name="first", max_rate_hz=1)
    second = graph.add(script(values=tuple(range(100))), name="second", max_rate_hz=1)
    end, heard = graph.add(flow.AtEnd()), graph.add(Heard())
    graph.connect(first.out, end.value)
    graph.connect(second.out, heard.hear)
    graph.connect(end.ended, graph.stop)
    report = hfg.run(graph, clock="virtual")
    assert report.outcome == "stopped"
    assert len(heard.values) < 5


def test_silence_beside_a_reference_is_detected_and_so_is_the_end() -> None:
    graph = hfg.Graph()
    source = graph.add(script(values=(1, 2, 3, None, 5)))
    even = graph.add(flow.EveryNth(n=2))
    detector, silent, ended = graph.add(flow.MarkerDetector()), graph.add(Heard()), graph.add(Heard(), name="ended")
    graph.connect(source.out, even.value)
    graph.connect(source.out, detector.reference)
    graph.connect(even.out, detector.value)
    graph.connect(detector.silent, silent.hear)
    graph.connect(detector.ended, ended.hear)
    hfg.run(graph, clock="virtual")
    assert silent.values == [2, 5]
    assert ended.values == [None]


def test_a_value_of_none_is_no_silence() -> None:
    """A signal without a value has the value None (T2)."""
    assert fire(flow.MarkerDetector(), reference=1, value=None).events == []
    assert fire(flow.MarkerDetector(), reference=1).events == [("silent", 1)]


def test_a_signal_of_the_operating_system_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    raised: list[int] = []
    monkeypatch.setattr(signal, "raise_signal", raised.append)
    fire(flow.ProcessSignal(signal="SIGTERM"), value=1)
    fire(flow.ProcessSignal(), slot="emit")
    assert raised == [signal.SIGTERM, signal.SIGWINCH]
    monkeypatch.delattr(signal, "SIGUSR1")
    with pytest.raises(ValueError, match="this operating system has no signal SIGUSR1"):
        fire(flow.ProcessSignal(signal="SIGUSR1"), value=1)
    with pytest.raises(ValueError, match="SIGKILL"):
        flow.ProcessSignal(signal="SIGKILL")


# --- routing ---


def run_vector(node: hfg.Node, *lines: str, **how: Any) -> dict[str, str]:
    """Drive the vector `values` of a node by a line for each port."""
    by_port: dict[str, Any] = {f"values[{number}]": line for number, line in enumerate(lines)}
    return run(node, **by_port, **how)


def test_merge_brings_streams_into_one_as_the_values_come() -> None:
    assert run_vector(flow.Merge(), "1---3|", "-2-4|") == {"merged": "12-43"}


@pytest.mark.rule("A3", "A5")
def test_merge_hands_activity_on() -> None:
    assert run_vector(flow.Merge(), "(+1)--3", "-2") == {"merged": "(+1)2-3", "activity": "(+~)"}


@pytest.mark.rule("F13")
def test_a_consumer_of_a_merge_ends_when_all_is_over() -> None:
    graph = hfg.Graph()
    merge = graph.add(flow.Merge(values=2))
    for number in range(2):
        graph.connect(graph.add(script(values=(number, None, number)), name=f"s{number}").out, merge.values[number])
    count = graph.add(flow.AtEnd())
    graph.connect(merge.merged, count.value)
    heard = graph.add(Heard())
    graph.connect(count.ended, heard.hear)
    hfg.run(graph, clock="virtual")
    assert heard.values == [4]


def test_mux_passes_the_selected_input_on() -> None:
    lines: dict[str, Any] = {"values[0]": "a-b-c|", "values[1]": "x-y-z|", "select": "0-1-0|"}
    assert run(flow.Mux(), **lines) == {"out": "a-y-c|"}


def test_mux_is_silent_where_the_selected_input_is() -> None:
    graph = hfg.Graph()
    mux = graph.add(flow.Mux())
    for target, values in (("values[0]", (1, None, 3)), ("values[1]", (None, 20)), ("select", (0, 0, 1))):
        graph.connect(graph.add(script(values=values)).out, f"mux.{target}")
    graph.connect(mux.out, graph.output("out", Any))
    assert hfg.run(graph, clock="virtual").outputs["out"] == [1]


@pytest.mark.parametrize(
    ("select", "message"), [(2, r"values from 0 to 1, got select=2"), (-1, "from 0, got select=-1")]
)
def test_a_number_that_no_port_has_is_refused(select: int, message: str) -> None:
    with pytest.raises(IndexError, match=message):
        fire(flow.Mux(), values=[1, 2], select=select)
    with pytest.raises(IndexError, match=message.replace("values", "outputs")):
        fire(flow.Demux(), value=1, select=select)


def test_demux_passes_a_value_on_by_the_selected_output() -> None:
    found = run(flow.Demux(outputs=3), value="a-b-c|", select="0-2-0|")
    assert found == {"outputs[0]": "a-.-c|", "outputs[1]": ".-.-.|", "outputs[2]": ".-b-.|"}


def test_what_a_switch_parts_is_joined_again_in_order() -> None:
    graph = hfg.Graph()
    source, flags = (
        graph.add(script(values=(1, 2, None, 4, 5))),
        graph.add(script(values=(True, False, True, False, True))),
    )
    switch, rejoin = graph.add(flow.switch()), graph.add(flow.Rejoin())
    graph.connect(source.out, switch.value)
    graph.connect(flags.out, switch.ports.parameters["predicate"])
    graph.connect(switch.ports.outputs["true"], rejoin.values[0])
    graph.connect(switch.ports.outputs["false"], rejoin.values[1])
    graph.connect(rejoin.out, graph.output("out", Any))
    graph.connect(switch.ports.outputs["true"], graph.output("true", Any))
    report = hfg.run(graph, clock="virtual")
    assert report.outputs == {"out": [1, 2, 4, 5], "true": [1, 5]}


def test_a_switch_has_two_ways() -> None:
    check(flow.switch(), value="1-2|", expected={"true": "1-2|", "false": ".-.|"})
    check(flow.switch(predicate=False), value="1-2|", expected={"true": ".-.|", "false": "1-2|"})


def test_rejoin_refuses_two_values_at_once() -> None:
    with pytest.raises(ValueError, match="a value at the inputs 0, 2 at once"):
        fire(flow.Rejoin(values=3), values=[1, NO_MESSAGE, 2])


def test_a_gate_passes_values_while_it_is_open() -> None:
    check(flow.Gate(), value="12345|", close="-!", open="---!", expected={"out": "1..45|"})
    check(flow.Gate(is_open=False), value="1-2|", expected={"out": ".-.|"})


def test_a_gate_may_be_set_by_an_edge() -> None:
    graph = hfg.Graph()
    gate = graph.add(flow.Gate())
    graph.connect(graph.add(script(values=(1, 2, 3))).out, gate.value)
    graph.connect(graph.add(script(values=(False, True, False))).out, gate.ports.parameters["is_open"])
    graph.connect(gate.out, graph.output("out", Any))
    assert hfg.run(graph, clock="virtual").outputs["out"] == [2]


# --- joining ---


def test_a_join_lets_streams_go_on_together() -> None:
    found = run_vector(flow.Join(), "12--3|", "-a-b--c|")
    assert found == {"joined[0]": "-1-2--3|", "joined[1]": "-a-b--c|"}


@pytest.mark.rule("F4")
def test_a_join_is_silent_where_one_stream_is_and_ends_with_the_first() -> None:
    graph = hfg.Graph()
    join = graph.add(flow.Join())
    graph.connect(graph.add(script(values=(1, None, 3, 4))).out, join.values[0])
    graph.connect(graph.add(script(values=("a", "b", "c")), name="other").out, join.values[1])
    graph.connect(join.joined[1], graph.output("second", Any))
    assert hfg.run(graph, clock="virtual").outputs["second"] == ["a", "c"]


def test_a_synchronizer_keeps_streams_in_step() -> None:
    graph = hfg.Graph()
    fast, slow = graph.add(script(values=(1,) * 20), name="fast"), graph.add(script(values=(1,) * 4), max_rate_hz=1)
    sync, heard = graph.add(flow.Synchronizer()), graph.add(Heard())
    graph.connect(fast.out, sync.values[0])
    graph.connect(slow.out, sync.values[1])
    graph.connect(fast.out, heard.hear)
    hfg.run(graph, clock="virtual")
    assert [round(token.stamp) for token in heard.tokens[:4]] == [0, 0, 1, 2]
    assert len(heard.tokens) == 20  # behind the end of the slow one nobody waits for it


def test_sample_and_hold_gives_the_newest_value_at_each_tick() -> None:
    check(flow.SampleAndHold(), tick="1-2-3--4-5|", value="-a-bc", expected={"held": ".-a-b--c-c|"})
    check(flow.SampleAndHold(fresh=True), tick="1-2-3--4-5|", value="-a-b----d", expected={"held": ".-a-b--.-d|"})
    check(flow.SampleAndHold(), tick="-1-2-3-4|", value="a", forget="----!", expected={"held": "-a-a-.-.|"})


def test_sample_and_hold_tells_how_old_a_value_is() -> None:
    node = flow.SampleAndHold()
    fire(node, slot="value", value=hfg.Token("a", 0, 1.0))
    assert fire(node, tick=hfg.Token(0, 0, 1.5)).outputs == {"held": "a", "age": 0.5}


def test_streams_of_different_rates_meet_without_slowing_each_other() -> None:
    graph = hfg.Graph()
    slow = graph.add(script(values=("a", "b", "c")), name="slow", max_rate_hz=2)
    fast = graph.add(script(values=tuple(range(12))), name="fast", max_rate_hz=10)
    hold, at_slow = graph.add(flow.SampleAndHold()), graph.add(flow.SampleAndHold(), name="at_slow")
    graph.connect(fast.out, hold.tick)
    graph.connect(slow.out, hold.value)
    graph.connect(slow.out, at_slow.tick)
    graph.connect(fast.out, at_slow.value)
    held, sampled = graph.add(Heard(), name="held"), graph.add(Heard(), name="sampled")
    graph.connect(hold.held, held.hear)
    graph.connect(at_slow.held, sampled.hear)
    hfg.run(graph, clock="virtual")
    assert [round(token.stamp, 6) for token in held.tokens][1:] == [number / 10 for number in range(1, 12)]
    assert held.values[1:5] + held.values[6:10] == ["a"] * 4 + ["b"] * 4
    assert [token.stamp for token in sampled.tokens][-2:] == [0.5, 1.0]


def test_the_newest_of_each_stream_is_told_once_each_has_one() -> None:
    found = run_vector(flow.CombineLatest(), "1--2", "-a---b", values=listed([1, "a"], [2, "a"], [2, "b"]))
    assert found == {"combined": "-A-B-C"}


def joined_by_stamp(*streams: list[tuple[Any, float]], **parameters: Any) -> tuple[list[Any], list[Any]]:
    """Run streams of (value, stamp) into a join; give what was joined, with stamps, and what was not."""
    graph = hfg.Graph()
    join = graph.add(flow.JoinByStamp(values=len(streams), **parameters))
    joined, unmatched = graph.add(Heard(), name="joined"), graph.add(Heard(), name="unmatched")
    for number, stream in enumerate(streams):
        graph.connect(graph.add(Stamped(values=tuple(stream)), name=f"s{number}").out, join.values[number])
    graph.connect(join.joined, joined.hear)
    graph.connect(join.unmatched, unmatched.hear)
    hfg.run(graph, clock="virtual")
    return [(token.value, token.stamp) for token in joined.tokens], unmatched.values


def test_what_was_measured_at_one_moment_is_joined_by_stamp() -> None:
    near = [(f"n{number}", number * 0.1) for number in range(6)]
    far = [(f"f{number}", number * 0.2 + 0.01) for number in range(3)]
    joined, unmatched = joined_by_stamp(near, far)
    assert [value for value, _ in joined] == [["n0", "f0"], ["n2", "f1"], ["n4", "f2"]]
    assert [stamp for _, stamp in joined] == [stamp for _, stamp in far]
    assert unmatched == ["n1", "n3"]


@pytest.mark.parametrize("late", range(3))
def test_a_join_by_stamp_does_not_depend_on_who_comes_first(late: int) -> None:
    graph = hfg.Graph()
    join, joined = graph.add(flow.JoinByStamp(values=3, tolerance_s=0.4)), graph.add(Heard())
    for number, (name, offset) in enumerate([("a", 0.0), ("b", 0.3), ("c", 0.1)]):
        stream = tuple((f"{name}{count}", count + offset) for count in range(4) if (name, count) != ("b", 1))
        source = graph.add(Stamped(values=stream), name=name, max_rate_hz=1 if number == late else None)
        graph.connect(source.out, join.values[number])
    graph.connect(join.joined, joined.hear)
    hfg.run(graph, clock="virtual")
    assert joined.values == [[f"a{count}", f"b{count}", f"c{count}"] for count in (0, 2, 3)]


def test_a_stream_that_waits_too_long_is_dropped_from_its_oldest() -> None:
    joined, unmatched = joined_by_stamp([(number, float(number)) for number in range(5)], [("x", 4.0)], size=2)
    assert unmatched == [0, 1, 2, 3]
    assert [value for value, _ in joined] == [[4, "x"]]


def test_a_stamp_out_of_order_finds_its_place() -> None:
    joined, _ = joined_by_stamp([("b", 2.0), ("a", 1.0)], [])
    assert joined == []
    node = flow.JoinByStamp(tolerance_s=0.1)
    for value, stamp in (("b", 2.0), ("a", 1.0)):
        fire(node, slot="values[0]", value=hfg.Token(value, 0, stamp))
    assert fire(node, slot="values[1]", value=hfg.Token("x", 0, 1.0)).events == [("joined", ["a", "x"])]


# --- keeping ---


def test_a_latch_repeats_the_newest_value_at_its_rate_until_it_is_closed() -> None:
    how: dict[str, Any] = {"options": {"max_rate_hz": 50}}
    check(flow.Latch(), value="--1--2", close="---------!", expected={"out": "--1-1-2-2-|"}, **how)


def test_a_latch_that_forgets_gives_nothing_until_the_next_value() -> None:
    how: dict[str, Any] = {"options": {"max_rate_hz": 50}}
    check(flow.Latch(), value="1----2", forget="---!", close="---------!", expected={"out": "1-1--22-2-|"}, **how)


def test_a_triggered_latch_tells_when_asked() -> None:
    check(flow.TriggeredLatch(), value="-1-2", publish="!-!-!!", forget="----!", expected={"published": "--1"})
    check(flow.TriggeredLatch(), value="1-2", publish="-!-!!", expected={"published": "-1-22"})


@pytest.mark.rule("A3", "A6")
def test_a_triggered_latch_hands_on_the_activity_of_the_one_that_asks() -> None:
    check(flow.TriggeredLatch(), value="1", publish="-+!", expected={"published": "-(+1)1", "activity": "-(+~)"})


def test_a_buffer_on_hold_gives_one_of_the_values_it_has_kept() -> None:
    node = flow.HoldableBuffer(size=3)
    given = [fire(node, value=value).outputs.get("out") for value in range(5)]
    assert given == [0, 1, 2, 3, 4]
    held = [fire(node, value=9, parameters={"hold": True, "index": index}).outputs.get("out") for index in range(4)]
    assert held == [4, 3, 2, None]
    assert fire(node, value=9, parameters={"hold": False, "index": 0}).outputs == {"out": 9}


# --- collecting ---


def test_count_counts_values_and_begins_anew_when_it_is_reset() -> None:
    check(flow.Count(), value="a-b-c-d|", reset="---!", expected={"count": "1-2-1-2|"})


def test_items_of_collections_are_counted() -> None:
    node = flow.CountItems()
    assert [fire(node, value=value).outputs["count"] for value in ([1, 2], {}, {"a": 1}, (1, 2))] == [2, 2, 3, 5]


def test_accumulate_gives_the_last_values_with_each() -> None:
    how: dict[str, Any] = {"values": listed([1], [1, 2], [2, 3], [3, 4])}
    check(flow.Accumulate(size=2), value="1-2-34|", expected={"values": "A-B-CD|"}, **how)


def test_a_smaller_size_takes_effect_with_the_next_value() -> None:
    node = flow.Accumulate(size=3)
    for value in range(3):
        fire(node, value=value)
    assert fire(node, value=3, parameters={"size": 1}).outputs == {"values": [3]}


def test_the_values_of_the_last_seconds_are_given_by_their_stamps() -> None:
    node = flow.Recent(seconds=1.0)
    given = [
        fire(node, value=hfg.Token(name, 0, stamp)).outputs["values"]
        for name, stamp in (("a", 0.0), ("b", 0.5), ("c", 1.0), ("d", 3.0))
    ]
    assert given == [["a"], ["a", "b"], ["b", "c"], ["d"]]


def test_windows_side_by_side_are_given_when_they_are_full_and_the_rest_at_the_end() -> None:
    how: dict[str, Any] = {"values": listed([1, 2], [3, 4], [5])}
    check(flow.Window(size=2), value="12345|", expected={"values": ".A.B.(C|)"}, **how)
    check(flow.Window(size=2, partial=False), value="12345|", expected={"values": ".A.B.|"}, **how)
    check(flow.Window(size=2), value="1234|", expected={"values": ".A.B|"}, **how)


def windows(count: int, **parameters: Any) -> list[list[int]]:
    graph = hfg.Graph()
    window = graph.add(flow.Window(**parameters))
    graph.connect(graph.add(script(values=tuple(range(count)))).out, window.value)
    graph.connect(window.values, graph.output("windows", list[Any]))
    return list(hfg.run(graph, clock="virtual").outputs["windows"])


def test_windows_over_one_another_and_with_gaps() -> None:
    assert windows(6, size=4, step=2) == [[0, 1, 2, 3], [2, 3, 4, 5]]
    assert windows(7, size=4, step=2) == [[0, 1, 2, 3], [2, 3, 4, 5], [4, 5, 6]]
    assert windows(8, size=2, step=3) == [[0, 1], [3, 4], [6, 7]]
    assert windows(7, size=2, step=3) == [[0, 1], [3, 4], [6]]
    assert windows(7, size=2, step=3, partial=False) == [[0, 1], [3, 4]]
    assert windows(0, size=2) == []


def time_windows(stamps: list[float], **parameters: Any) -> list[Any]:
    graph = hfg.Graph()
    window, heard = graph.add(flow.TimeWindow(**parameters)), graph.add(Heard())
    source = graph.add(Stamped(values=tuple((stamp, stamp) for stamp in stamps)))
    graph.connect(source.out, window.value)
    graph.connect(window.window, heard.hear)
    hfg.run(graph, clock="virtual")
    assert [token.stamp for token in heard.tokens] == [max(token.value) for token in heard.tokens]
    return heard.values


def test_windows_of_time_follow_the_stamps() -> None:
    assert time_windows([10.0, 10.5, 11.0, 14.9, 15.0]) == [[10.0, 10.5], [11.0], [14.9], [15.0]]
    assert time_windows([0.0, 1.0, 2.0, 3.0], seconds=2.0, step_s=1.0) == [[0.0, 1.0], [1.0, 2.0], [2.0, 3.0], [3.0]]
    assert time_windows([0.0, 1.0, 2.0, 3.0], seconds=1.0, step_s=2.0) == [[0.0], [2.0]]
    assert time_windows([0.0, 1e9], seconds=0.5) == [[0.0], [1e9]]
    assert time_windows([]) == []


RATES_HZ = (1.0, 3.0, 7.0, 10.0, 24.0, 25.0, 30000 / 1001, 30.0, 50.0, 60.0, 99.9, 100.0, 120.0, 200.0, 1000.0)
OFFSETS_S = (0.0, 0.1, 1 / 3, 17.77, 1000.1, 86_400.0 + 1e-3, 1.7e9, 1.7e9 + 0.3)
"""Of stamps: from the start of a run, or of a clock that counts from 1970."""


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("offset_s", OFFSETS_S)
def test_a_window_of_time_always_has_the_same_number_of_samples(rate_hz: float, offset_s: float) -> None:
    """0.3 s at 10 Hz are three values, though 3 * 0.1 is more than 0.3 and 0.7 - 0.4 is less."""
    stamps = [offset_s + number / rate_hz for number in range(30)]
    for count in (1, 3, 7):
        seconds = count / rate_hz
        side_by_side, sliding = flow.TimeWindow(seconds=seconds), flow.TimeWindow(seconds=seconds, step_s=1 / rate_hz)
        recent, sizes = flow.Recent(seconds=seconds), []
        heard: dict[str, list[int]] = {"side by side": [], "sliding": []}
        for number, stamp in enumerate(stamps):
            token = hfg.Token(number, 0, stamp)
            sizes.append(len(fire(recent, value=token).outputs["values"]))
            for name, node in (("side by side", side_by_side), ("sliding", sliding)):
                heard[name] += [len(values) for _, values in fire(node, value=token).events]
        assert set(sizes[count - 1 :]) == {count}
        assert len(heard["side by side"]) == (len(stamps) - 1) // count
        assert set(heard["side by side"]) == {count}
        assert set(heard["sliding"]) == {count}


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_what_is_apart_by_the_tolerance_is_joined_however_stamps_are_rounded(rate_hz: float) -> None:
    for offset_s in OFFSETS_S:
        for number in range(20):
            node = flow.JoinByStamp(values=2, tolerance_s=1 / rate_hz)
            first = hfg.Token(1, 0, offset_s + number / rate_hz)
            second = hfg.Token(2, 0, offset_s + (number + 1) / rate_hz)
            told = fire(node, slot="values[0]", value=first).events + fire(node, slot="values[1]", value=second).events
            assert told == [("joined", [1, 2])]


def test_a_value_whose_windows_are_over_is_left_out() -> None:
    assert time_windows([0.0, 2.5, 0.5, 2.6]) == [[0.0], [2.5, 2.6]]

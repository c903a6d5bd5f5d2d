"""State machines as values, from dicts, into graphs and out of them: what they say and what they refuse.

That a machine and its graph accept the same words is in `tests/semantics/test_state_machines.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from itertools import pairwise
from typing import Any

import pytest

import hfg
from hfg.activity import StateMachine, StateNode, Transition
from hfg.activity.states import event_name, letter_name, state_type
from hfg.errors import MachineError
from hfg.registry import find

DOOR = StateMachine(
    ["closed", "open"], [("push", "closed", "open"), ("pull", "open", "closed")], initial="closed", final=["closed"]
)


def findings(make: Callable[[], object]) -> dict[str, str]:
    """Give the sentences behind the paths of everything that is wrong."""
    with pytest.raises(MachineError) as caught:
        make()
    for problem in caught.value.problems:
        assert problem.what
        assert problem.why
        assert problem.remedy
    return {problem.path: problem.what for problem in caught.value.problems}


# --- values ---


def test_a_machine_says_which_words_it_accepts() -> None:
    assert DOOR.accepts([])
    assert DOOR.accepts(["push", "pull"])
    assert not DOOR.accepts(["push"])
    assert DOOR.after(["push"]) == "open"


def test_a_missing_transition_is_dead_or_ignored() -> None:
    assert DOOR.after(["pull", "push"]) is None
    patient = StateMachine(DOOR.states, DOOR.transitions, initial="closed", final=["closed"], missing="ignore")
    assert patient.after(["pull", "push"]) == "open"


def test_a_machine_is_a_value() -> None:
    again = StateMachine(
        iter(DOOR.states), [*DOOR.transitions, DOOR.transitions[0]], initial="closed", final={"closed"}
    )
    assert again == DOOR
    assert hash(again) == hash(DOOR)
    with pytest.raises(AttributeError):
        DOOR.initial = "open"  # type: ignore[misc]


def test_everything_that_is_wrong_is_told_at_once() -> None:
    wrong: Any = StateMachine
    found = findings(
        lambda: wrong(
            ["closed", "open", "open", ""],
            [("push", "closed", "opne"), ("pull", "open"), ("", "open", "open"), ("x", 3, "open")],
            final=["shut"],
            missing="fail",
        )
    )
    assert found == {
        "states[2]": '"open" is there twice',
        "states[3]": "got ''",
        "initial": "there is none",
        "transitions[0]": 'there is no state "opne"',
        "transitions[1]": "got ('pull', 'open')",
        "transitions[2]": "its letter is ''",
        "transitions[3]": "got 3 for a state",
        "final": 'there is no state "shut"',
        "missing": "got 'fail'",
    }


def test_a_letter_that_leads_to_two_states_is_refused_and_unreachable_states_are_told() -> None:
    found = findings(lambda: StateMachine(list("abcd"), [("x", "a", "b"), ("x", "a", "c")], initial="a"))
    assert found == {"a": '"x" leads to "b" and "c"', "d": "no word leads to this state"}


def test_a_state_that_no_word_leads_to_is_a_warning() -> None:
    lonely = StateMachine(["a", "b"], [("x", "b", "a")], initial="a")
    (problem,) = lonely.check()
    assert (problem.path, problem.severity) == ("b", "warning")
    assert not DOOR.check()


# --- dicts ---


def test_a_dict_of_the_package_transitions_is_read() -> None:
    class Place(Enum):
        KITCHEN = 1

    machine = StateMachine.from_dict(
        {
            "states": ["idle", {"name": "busy"}, {"name": "done", "final": True}, Place.KITCHEN],
            "initial": "idle",
            "transitions": [
                ["begin", "idle", "busy"],
                {"trigger": "finish", "source": ["busy", Place.KITCHEN], "dest": "done"},
                ["stay", "*", "="],
                {"trigger": "look", "source": "busy", "dest": None, "conditions": []},
                ["cook", "idle", Place.KITCHEN, None],
            ],
            "ignore_invalid_triggers": True,
            "send_event": True,
        }
    )
    assert machine == StateMachine(
        ["idle", "busy", "done", "KITCHEN"],
        [
            ("begin", "idle", "busy"),
            ("finish", "busy", "done"),
            ("finish", "KITCHEN", "done"),
            *(("stay", state, state) for state in ["idle", "busy", "done", "KITCHEN"]),
            ("look", "busy", "busy"),
            ("cook", "idle", "KITCHEN"),
        ],
        initial="idle",
        final=["done"],
        missing="ignore",
    )


def test_a_dict_says_its_final_states_in_either_way() -> None:
    said = {"states": ["a", {"name": "b", "final": True}], "initial": "a", "transitions": [], "final": ["a", "b"]}
    assert StateMachine.from_dict(said).final == {"a", "b"}


def test_a_dict_of_the_wrong_shape_is_told_at_once() -> None:
    found = findings(
        lambda: StateMachine.from_dict(
            {
                "states": ["a", {"name": "b", "on_enter": "beep", "children": ["c"]}, {"title": "c"}],
                "transitions": [
                    ["go", "a"],
                    {"trigger": "go", "from": "a", "dest": "b"},
                    ["go", "a", "b", "is_ready"],
                    {"trigger": "go", "source": "b", "dest": "z", "after": print},
                    7,
                ],
                "initial": "q",
                "auto_transitions": True,
            }
        )
    )
    assert {path: what[:20] for path, what in found.items()} == {
        "auto_transitions": "got True",
        "states[1].on_enter": "got 'beep'",
        "states[1].children": "got ['c']",
        "states[2].title": "got 'c'",
        "states[2]": "got None",
        "transitions[0]": "got ['go', 'a']",
        "transitions[1].from": "got 'a'",
        "transitions[1]": '"source" is missing',
        "transitions[2].conditions": "got 'is_ready'",
        "transitions[3].after": "got <built-in functi",
        "transitions[3]": 'there is no state "z',
        "transitions[4]": "got 7",
        "initial": 'there is no state "q',
    }


@pytest.mark.parametrize("shape", [[], None, "states", {"states": "ab"}, {}, {"states": 3, "transitions": 4}])
def test_what_is_no_such_dict_is_refused(shape: Any) -> None:
    assert findings(lambda: StateMachine.from_dict(shape))


# --- into graphs ---


@pytest.mark.rule("A13")
def test_the_graph_is_the_papers_construction() -> None:
    assert [edge.label for edge in DOOR.graph().edges if edge.active] == [
        "start -> closed.enter",
        "closed.push -> open.enter",
        "open.pull -> closed.enter",
        "closed.missing -> dead.enter",
        "open.missing -> dead.enter",
    ]


def test_the_graph_of_a_machine_has_nothing_to_complain_of() -> None:
    assert not DOOR.graph().check()


@pytest.mark.parametrize("letters", [(), ("a", "b"), ("go home", "timeout", "a.b", "a,b", "<x>", "ß", "_", "enter")])
def test_types_of_states_are_found_by_name(letters: tuple[str, ...]) -> None:
    made = state_type(letters)
    assert made._type.reference is not None
    assert find(made._type.reference) is made


@pytest.mark.parametrize("letter", ["push", "go home", "letter_x", "_", "enter", "timeout", "\U0001f600", "a_b", " _ "])
def test_an_event_tells_its_letter(letter: str) -> None:
    assert event_name(letter).isidentifier()
    assert letter_name(event_name(letter)) == letter


def test_a_machine_begins_where_it_is_told_to() -> None:
    graph = hfg.Graph()
    boot = graph.add(StateNode(), name="boot")
    graph.start.activates(boot.enter)
    DOOR.build(graph, begin=boot.processed)
    assert [edge.label for edge in graph.edges if edge.active][:2] == [
        "start -> boot.enter",
        "boot.processed -> closed.enter",
    ]


def test_nodes_that_cannot_be_states_are_told_at_once_and_nothing_is_added() -> None:
    class Deaf(hfg.Node):
        pass

    class Box(hfg.Subgraph):
        push = hfg.Event()

    graph, other = hfg.Graph(), hfg.Graph("other")
    strange: Any = {"closed": Deaf(), "open": other.add(Deaf()), "shut": Deaf(), "ajar": 3}
    machine = StateMachine(["closed", "open", "ajar"], [*DOOR.transitions, ("push", "open", "ajar")], initial="closed")
    assert findings(lambda: machine.build(graph, nodes=strange)) == {
        "nodes['closed']": f'{Deaf.__qualname__} has no event "push"',
        "nodes['open']": 'it is in graph "other"',
        "nodes['shut']": "the machine has no such state",
        "nodes['ajar']": "got 3",
    }
    assert not graph.nodes
    assert "nodes['closed']" in findings(lambda: DOOR.build(graph, nodes={"closed": Box()}))


def test_names_that_nodes_cannot_have_are_told_at_once() -> None:
    graph = hfg.Graph()
    graph.add(StateNode(), name="c")
    machine = StateMachine(["a/b", "b.c", "c"], [("x", "a/b", "b.c"), ("x", "b.c", "c")], initial="a/b")
    assert list(findings(lambda: machine.build(graph))) == ["a/b", "b.c", "c"]


# --- and out of them ---


class Station(hfg.Node):
    """Whatever a robot does; it knows nothing of machines."""

    done = hfg.Event()
    failed_ = hfg.Event()
    out = hfg.Output(int)
    other = hfg.Output(int)
    value = hfg.Input(int, optional=True)

    @hfg.slot
    def begin(self) -> None: ...


def robot(*names: str) -> tuple[hfg.Graph, list[Station]]:
    graph = hfg.Graph("robot")
    stations = [graph.add(Station(), name=name) for name in names]
    graph.start.activates(stations[0].begin)
    return graph, stations


@pytest.mark.rule("A13")
def test_any_graph_whose_activity_never_forks_is_a_machine() -> None:
    graph, (fetch, bring, rest) = robot("fetch", "bring", "rest")
    fetch.done.activates(bring.begin)
    bring.done.activates(fetch.begin)
    bring.timeout.activates(rest.begin)
    rest.done.activates(graph.stop)  # the end of the run, and of no state
    graph.connect(fetch.failed_, bring.begin)
    machine = StateMachine.of(graph, final=["rest"])
    assert machine.transitions == (
        Transition("done", "fetch", "bring"),
        Transition("done", "bring", "fetch"),
        Transition("timeout", "bring", "rest"),
    )
    assert (machine.initial, machine.accepts(["done", "timeout"]), machine.check()) == ("fetch", True, [])


def test_a_region_is_entered_from_outside_and_a_box_stands_for_its_inside() -> None:
    class Box(hfg.Subgraph):
        begin = hfg.slot(type=object)
        done = hfg.Event()

        def build(self, graph: hfg.Graph) -> None:
            first, second = graph.add(Station(), name="first"), graph.add(Station(), name="second")
            graph.connect(self.begin.inner, first.begin, active=True)
            first.done.activates(second.begin)
            graph.connect(second.done, self.done.inner, active=True)

    graph, (before, after) = robot("before", "after")
    box = graph.add(Box(), name="box")
    graph.connect(before.done, box.begin, active=True)
    graph.connect(box.done, after.begin, active=True)
    assert StateMachine.of(graph, [box, "after"]).states == ("after", "box/first", "box/second")
    assert StateMachine.of(graph).initial == "before"
    found = findings(lambda: StateMachine.of(graph, [box]))
    assert found == {"box/second.done -> after.begin": "activity leaves the region"}


@pytest.mark.rule("A13")
def test_a_fork_of_activity_is_reported_as_such() -> None:
    graph, (fetch, bring, rest) = robot("fetch", "bring", "rest")
    fetch.done.activates(bring.begin)
    fetch.done.activates(rest.begin)
    graph.connect(bring.out, rest.value, active=True)
    graph.connect(bring.other, fetch.value, active=True)
    graph.start.activates(rest.begin)
    assert findings(lambda: StateMachine.of(graph)) == {
        "fetch": 'activity comes in at "fetch" and "rest"',
        "fetch.done": 'activity forks to "bring" and "rest"',
        "bring": 'activity forks to "rest" and "fetch"',
    }


def test_a_graph_without_a_beginning_or_without_activity_is_no_machine() -> None:
    graph = hfg.Graph("idle")
    station = graph.add(Station())
    assert findings(lambda: StateMachine.of(graph)) == {"idle": "no active edge leads to or from a node"}
    graph.connect(station.done, station.begin, active=True)
    assert findings(lambda: StateMachine.of(graph)) == {"station": "no state is the initial one"}


def test_a_subgraph_as_a_whole_is_no_state() -> None:
    class Box(hfg.Subgraph):
        begin = hfg.slot(type=object)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.begin.inner, graph.add(Station(), name="inside").begin, active=True)

    graph, (first,) = robot("first")
    box = graph.add(Box(), name="box")
    graph.connect(first.done, box.begin, active=True)
    graph.connect(box.timeout, first.begin, active=True)
    assert "activity comes from a subgraph as a whole" in findings(lambda: StateMachine.of(graph)).values()


def test_a_region_of_what_is_not_there_is_refused() -> None:
    graph, _ = robot("fetch")
    with pytest.raises(hfg.errors.GraphError, match='there is no "fetsch"'):
        StateMachine.of(graph, ["fetsch"])
    with pytest.raises(hfg.errors.GraphError, match="a region is nodes of"):
        StateMachine.of(graph, [Station()])


def test_a_machine_of_a_thousand_states_is_built_and_read_out_again() -> None:
    names = [f"s{number}" for number in range(1000)]
    big = StateMachine(names, [("next", a, b) for a, b in pairwise(names)], initial="s0", final=["s999"])
    assert StateMachine.of(big.graph()) == big
    assert big.accepts(["next"] * 999)

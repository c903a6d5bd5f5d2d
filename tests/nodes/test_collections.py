"""The family `collections`: lists and dicts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest

import hfg
from hfg.nodes import collections, values
from hfg.testing import fire
from hfg.testing.diagrams import run


@dataclass
class Pose:
    x: float
    y: float

    def drive(self) -> None:
        raise AssertionError("nobody asked for it")


class Named(NamedTuple):
    name: str
    pose: Pose


class Struct(msgspec.Struct):
    a: int
    b: int


PEOPLE = [
    {"name": "Eve", "age": 7, "at": Pose(1, 2)},
    {"name": "Bob", "age": 5, "at": Pose(3, 0)},
    {"name": "Ann", "age": 7, "at": Pose(0, 1)},
]
EVE, BOB, ANN = PEOPLE
ODD = [[1], [1], np.zeros(2), np.zeros(2), 1, 1.0, "a"]


@pytest.mark.parametrize(
    ("node", "inputs", "expected"),
    [
        (collections.build_list(items=3), {"items": [1, "a", [2]]}, [1, "a", [2]]),
        (collections.merge_lists(lists=3), {"lists": [[1], (2, 3), []]}, [1, 2, 3]),
        (collections.append_item(), {"items": (1, 2), "item": 3}, [1, 2, 3]),
        (collections.repeat_item(times=3), {"item": 1}, [1, 1, 1]),
        (collections.zip_lists(), {"lists": [[1, 2], ["a", "b"]]}, [(1, "a"), (2, "b")]),
        (collections.zip_lists(same_length=False), {"lists": [[1, 2], ["a"]]}, [(1, "a")]),
        (collections.enumerate_items(start=1), {"items": ["a", "b"]}, [(1, "a"), (2, "b")]),
        (collections.combine_lists(), {"a": [1, 2, 1], "b": [3, 2]}, [1, 2, 3]),
        (collections.combine_lists(operation="intersection"), {"a": [1, 2, 2], "b": [3, 2]}, [2]),
        (collections.combine_lists(operation="difference"), {"a": [1, 2, 1], "b": [3, 2]}, [1]),
        (collections.combine_lists(operation="symmetric difference"), {"a": [1, 2], "b": [3, 2]}, [1, 3]),
        (collections.combine_lists(operation="intersection"), {"a": [[1]], "b": [[2], [1]]}, [[1]]),
        (collections.size(), {"items": {"a": 1}}, 1),
        (collections.size(), {"items": "abc"}, 3),
        (collections.select_item(index=1), {"items": [1, 2, 3]}, 2),
        (collections.select_item(index=-1), {"items": (1, 2, 3)}, 3),
        (collections.slice_items(start=1, step=2), {"items": [1, 2, 3, 4]}, [2, 4]),
        (collections.slice_items(step=-1), {"items": (1, 2)}, [2, 1]),
        (collections.chunk_items(length=2), {"items": [1, 2, 3]}, [[1, 2], [3]]),
        (collections.windows(length=2), {"items": [1, 2, 3]}, [[1, 2], [2, 3]]),
        (collections.windows(length=2), {"items": [1]}, []),
        (collections.flatten(), {"items": [1, [2, [3]], (4,), "ab"]}, [1, 2, [3], 4, "ab"]),
        (collections.flatten(depth=9), {"items": [1, [2, [3]]]}, [1, 2, 3]),
        (collections.flatten(depth=0), {"items": [[1]]}, [[1]]),
        (collections.pluck(field="name"), {"items": PEOPLE}, ["Eve", "Bob", "Ann"]),
        (collections.pluck(field="at.x"), {"items": PEOPLE}, [1, 3, 0]),
        (collections.reverse_items(), {"items": [1, 2]}, [2, 1]),
        (collections.sort_items(), {"items": [3, 1, 2]}, [1, 2, 3]),
        (collections.sort_items(field="age"), {"items": PEOPLE}, [BOB, EVE, ANN]),
        (collections.sort_items(field="age", descending=True), {"items": PEOPLE}, [EVE, ANN, BOB]),
        (collections.min_by(field="at.y"), {"items": PEOPLE}, BOB),
        (collections.max_by(field="age"), {"items": PEOPLE}, EVE),
        (collections.min_by(), {"items": [2, 1]}, 1),
        (collections.unique_items(), {"items": [1, 2, 1.0, "a", [1], [1]]}, [1, 2, "a", [1]]),
        (collections.contains_item(), {"items": [1, [2]], "item": [2]}, True),
        (collections.contains_item(), {"items": {"a": 1}, "item": 1}, False),
        (collections.index_of(), {"items": ["a", "b", "b"], "item": "b"}, 1),
        (collections.count_item(), {"items": ["a", "b", "b"], "item": "b"}, 2),
        (collections.filter_items(), {"items": [0, 1, "", "a"]}, [1, "a"]),
        (collections.filter_items(operation="is false"), {"items": [0, 1, "", "a"]}, [0, ""]),
        (collections.filter_items(field="age", operation=">=", value=7), {"items": PEOPLE}, [EVE, ANN]),
        (collections.filter_items(field="age", operation="<", value=7), {"items": PEOPLE}, [BOB]),
        (collections.filter_items(field="age", operation="==", value=5), {"items": PEOPLE}, [BOB]),
        (collections.filter_items(field="age", operation="!=", value=5), {"items": PEOPLE}, [EVE, ANN]),
        (collections.filter_items(field="at.x", operation=">", value=1), {"items": PEOPLE}, [BOB]),
        (collections.filter_items(field="at.x", operation="<=", value=0), {"items": PEOPLE}, [ANN]),
        (collections.filter_items(field="name", operation="in", value=["Bob"]), {"items": PEOPLE}, [BOB]),
        (collections.filter_items(field="name", operation="not in", value=["Bob"]), {"items": PEOPLE}, [EVE, ANN]),
        (collections.group_by(field="age"), {"items": PEOPLE}, {7: [EVE, ANN], 5: [BOB]}),
        (collections.key_value(key="a"), {"value": 1}, ("a", 1)),
        (collections.dict_of_pairs(pairs=3), {"pairs": [("a", 1), ("b", 2), ("a", 3)]}, {"a": 3, "b": 2}),
        (collections.merge_dicts(), {"dicts": [{"a": 1, "b": 1}, {"b": 2}]}, {"a": 1, "b": 2}),
        (collections.keys_of(), {"mapping": {"a": 1}}, ["a"]),
        (collections.values_of(), {"mapping": {"a": 1}}, [1]),
        (collections.pairs_of(), {"mapping": {"a": 1}}, [("a", 1)]),
        (collections.get_field(field="at.y"), {"value": EVE}, 2),
        (collections.get_field(field="pose.x"), {"value": Named("a", Pose(5, 6))}, 5),
        (collections.get_field(field="b"), {"value": Struct(1, 2)}, 2),
        (collections.get_field(field="1.-1"), {"value": [0, [1, 2]]}, 2),
        (collections.get_field(field="3"), {"value": {3: "three"}}, "three"),
        (collections.set_key(key="b"), {"mapping": {"a": 1, "b": 1}, "value": 2}, {"a": 1, "b": 2}),
        (collections.pick_keys(keys=["b", "z", "a"]), {"mapping": {"a": 1, "b": 2, "c": 3}}, {"b": 2, "a": 1}),
        (collections.without_keys(keys=["b", "z"]), {"mapping": {"a": 1, "b": 2}}, {"a": 1}),
        (collections.rename_keys(names={"a": "A"}), {"mapping": {"a": 1, "b": 2}}, {"A": 1, "b": 2}),
        (collections.rename_keys(), {"mapping": {"a": 1}}, {"a": 1}),
        (collections.Compose(parts=3), {"parts": [1, "a", 2]}, (1, "a", 2)),
        (collections.ComposeDict(keys=["x", "y"]), {"values": [1, 2]}, {"x": 1, "y": 2}),
    ],
)
def test_collections(node: Any, inputs: dict[str, Any], expected: Any) -> None:
    (found,) = fire(node, **inputs).outputs.values()
    assert found == expected


def test_equal_items_without_a_hash_are_one_too() -> None:
    (found,) = fire(collections.unique_items(), items=ODD).outputs.values()
    assert [type(one) for one in found] == [list, np.ndarray, int, str]


@pytest.mark.parametrize("node", [collections.min_by(), collections.max_by()])
def test_nothing_is_the_smallest_of_an_empty_list(node: Any) -> None:
    assert fire(node, items=[]).outputs == {}


def test_an_item_that_is_not_there_has_no_place() -> None:
    assert fire(collections.index_of(), items=[1], item=2).outputs == {}


@pytest.mark.parametrize(
    ("node", "inputs", "error", "sentence"),
    [
        (collections.select_item(index=3), {"items": [1, 2]}, IndexError, "there is no item 3 in a list of 2"),
        (collections.slice_items(step=0), {"items": [1]}, ValueError, "zero"),
        (collections.zip_lists(), {"lists": [[1], [1, 2]]}, ValueError, "must be of one length, got 1, 2"),
        (collections.sort_items(), {"items": [1, "a"]}, TypeError, "not supported"),
        (collections.sort_items(), {"items": [np.zeros(2)] * 2}, ValueError, "truth value"),
        (collections.max_by(field="z"), {"items": PEOPLE}, LookupError, '"z" in a dict, which has name, age, at'),
        (collections.pluck(field="at.drive"), {"items": PEOPLE}, LookupError, '"at.drive" in a Pose, which has x, y'),
        (collections.get_field(field="__class__"), {"value": 1}, LookupError, "which has nothing that has a name"),
        (collections.get_field(field="0.real"), {"value": [1]}, LookupError, 'no "real"'),
        (collections.get_field(field="5"), {"value": [1]}, LookupError, "a list, which has 1 items"),
        (collections.get_field(field="--1"), {"value": [1]}, LookupError, 'no "--1"'),
        (collections.group_by(), {"items": [[1]]}, TypeError, "unhashable"),
        (collections.dict_of_pairs(), {"pairs": [([], 1), (1, 1)]}, TypeError, "unhashable"),
        (collections.filter_items(operation="in"), {"items": [1]}, TypeError, '"in" needs a list of values, got None'),
        (collections.filter_items(operation="<", value=1), {"items": ["a"]}, TypeError, "not supported"),
        (
            collections.Decompose(parts=3),
            {"composed": (1, 2)},
            ValueError,
            "2 parts came, but there are 3 outputs: make",
        ),
        (collections.Decompose(), {"composed": 7}, TypeError, "a int has no parts"),
        (collections.ComposeDict(keys=["a"]), {"values": [1, 2]}, ValueError, r"1 keys \(a\) for 2 inputs: make"),
        (collections.DecomposeDict(keys=["a"]), {"composed": {}}, ValueError, "for 2 outputs"),
    ],
)
def test_what_cannot_be_done_is_the_error_that_the_description_names(
    node: Any, inputs: dict[str, Any], error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error, match=sentence):
        fire(node, **inputs)
    assert error.__name__ in node._type.doc


@pytest.mark.parametrize("composed", [(1, None, 3), [1, None, 3]])
def test_parts_have_outputs_of_their_own_and_none_is_silence(composed: Any) -> None:
    assert fire(collections.Decompose(parts=3), composed=composed).outputs == {"parts[0]": 1, "parts[2]": 3}


def test_records_are_taken_apart_by_their_fields() -> None:
    assert fire(collections.Decompose(), composed=Pose(1, 2)).outputs == {"parts[0]": 1, "parts[1]": 2}
    assert fire(collections.Decompose(), composed=Struct(3, 4)).outputs == {"parts[0]": 3, "parts[1]": 4}


def test_what_is_composed_is_decomposed_again() -> None:
    graph = hfg.Graph()
    numbers = graph.add(values.IntRange(stop=3))
    squares = graph.add(values.multiply())
    together, apart = graph.add(collections.Compose()), graph.add(collections.Decompose())
    for target in (squares.a, squares.b, together.parts[0]):
        graph.connect(numbers.out, target)
    graph.connect(squares.out, together.parts[1])
    graph.connect(together.composed, apart.composed)
    for number, name in enumerate(("numbers", "squares")):
        graph.connect(apart.parts[number], graph.output(name, Any))
    report = hfg.run(graph, clock="virtual")
    assert report.outputs == {"numbers": [0, 1, 2], "squares": [0, 1, 4]}


def test_keys_of_a_dict_have_outputs_of_their_own_and_missing_ones_are_told() -> None:
    fired = fire(collections.DecomposeDict(values=3, keys=["at.x", "age", "hat"]), composed=EVE)
    assert (fired.outputs, fired.events) == ({"values[0]": 1, "values[1]": 7}, [("missing", "hat")])


def test_a_shuffled_list_has_the_same_items_and_every_run_the_same_order() -> None:
    orders = []
    for _ in range(2):
        node = collections.ShuffleItems()
        orders.append([fire(node, items=list(range(9))).outputs["shuffled"] for _ in range(3)])
    assert orders[0] == orders[1]
    assert all(sorted(order) == list(range(9)) for order in orders[0])
    assert orders[0][0] != orders[0][1]
    assert fire(collections.ShuffleItems(seed=1), items=list(range(9))).outputs["shuffled"] != orders[0][0]


# --- Fig. 18 ---

POSES = {1: "left", 2: "right", 3: None}


def test_a_lookup_gives_the_value_or_signals_the_key() -> None:
    found = run(collections.MapLookup(), values={"M": POSES, "L": "left", "R": "right"}, key="1432|", map="MMMM|")
    assert found == {"found": "L..R|", "unknown": "-43"}


def test_a_lookup_waits_for_no_map_that_comes_by_the_slot() -> None:
    found = run(collections.MapLookup(), values={"M": POSES, "L": "left"}, key="1-1-1|", use_map="-M")
    assert found == {"found": ".-L-L|", "unknown": "1"}


def test_a_map_may_be_a_function_of_the_key() -> None:
    node = collections.MapLookup()
    assert fire(node, key=1, map=POSES.get).outputs == {"found": "left"}
    assert fire(node, key=9).events == [("unknown", 9)]
    assert fire(node, key=8, map=POSES.__getitem__).events == [("unknown", 8)]


def test_a_key_that_no_dict_can_have_is_unknown() -> None:
    for key in ([1], (1, [2])):
        assert fire(collections.MapLookup(), key=key, map=POSES).events == [("unknown", key)]


class Deliver(hfg.Node):
    went = hfg.State(factory=list[str])

    @hfg.slot
    def go(self, pose: str) -> None:
        self.went.append(pose)


class Explore(hfg.Node):
    @hfg.slot
    def go(self) -> None: ...


@pytest.mark.rule("A3", "A5")
@pytest.mark.parametrize(("cube", "goes_on"), [(2, "deliver"), (3, "explore"), (7, "explore")])
def test_activity_is_routed_by_whether_the_pose_is_known(cube: int, goes_on: str) -> None:
    """Fig. 18 of the paper: the cube's number, active, with the sign map that is not."""
    graph = hfg.Graph("fig-18")
    cubes, signs = (
        graph.add(values.IntOnTrigger(value=cube), name="cubes"),
        graph.add(values.ListSource(values=[POSES])),
    )
    lookup = graph.add(collections.MapLookup())
    deliver, explore = graph.add(Deliver(), name="deliver"), graph.add(Explore(), name="explore")
    graph.start.activates(cubes.trigger)
    graph.connect(cubes.given, lookup.key, active=True)
    graph.connect(signs.out, lookup.map)
    graph.connect(lookup.found, deliver.go, active=True)
    graph.connect(lookup.unknown, explore.go, active=True)
    active: list[str] = []

    class Watch(hfg.Node):
        @hfg.slot
        def see(self, name: Any) -> None:
            active.extend(node.place.name for node in (deliver, explore) if node.active)

    watch = graph.add(Watch())
    graph.connect(deliver.activated, watch.see)
    graph.connect(explore.activated, watch.see)
    assert hfg.run(graph, clock="virtual").outcome == "done"
    assert active == [goes_on]


# --- one by one ---


def test_items_are_signalled_and_collected_again() -> None:
    graph = hfg.Graph()
    source = graph.add(values.ListSource(values=[[1, 2], [], [3]]))
    each, collected = graph.add(collections.EachItem()), graph.add(collections.CollectItems())
    graph.connect(source.out, each.items)
    graph.connect(each.item, collected.item)
    graph.connect(each.done, collected.finish)
    graph.connect(collected.collected, graph.output("lists", list[Any]))
    assert hfg.run(graph, clock="virtual").outputs["lists"] == [[1, 2], [], [3]]


@pytest.mark.rule("F8")
def test_a_long_list_finds_room_in_the_queue() -> None:
    graph = hfg.Graph()
    each = graph.add(collections.EachItem())
    graph.connect(graph.add(values.ListSource(values=[list(range(1000))])).out, each.items)
    graph.connect(each.item, graph.output("items", Any))
    assert hfg.run(graph, clock="virtual").outputs["items"] == list(range(1000))


def test_collecting_may_give_a_list_as_soon_as_it_is_full() -> None:
    node = collections.CollectItems(at=2)
    events = [fire(node, slot="item", value=value).events for value in "abc"]
    assert events == [[], [("collected", ["a", "b"])], []]
    assert fire(node, slot="finish").events == [("collected", ["c"])]


@pytest.mark.rule("G4")
def test_a_subgraph_that_iterates_sends_each_item_through_nodes_of_the_library() -> None:
    class Scaled(hfg.Subgraph):
        numbers = hfg.Input(float)
        scaled = hfg.Output(float)
        iterate_over = ("numbers",)

        def build(self, graph: hfg.Graph) -> None:
            scale = graph.add(values.scale(factor=2.0))
            graph.connect(self.numbers.inner, scale.ports.inputs["value"])
            graph.connect(scale.out, self.scaled.inner)

    graph = hfg.Graph()
    subgraph = graph.add(Scaled())
    graph.connect(graph.add(values.ListSource(values=[[1.0, 2.0], []])).out, subgraph.numbers)
    graph.connect(subgraph.scaled, graph.output("all", Any))
    assert hfg.run(graph, clock="virtual").outputs["all"] == [[2.0, 4.0], []]

"""Graphs as they are built: names, options, groups, gates and paths."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.errors import GraphError
from hfg.graph import Graph, Subgraph
from hfg.graph.checks import check
from hfg.graph.structure.level import level_of
from hfg.ports import EventPort, InputPort


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    yield from range(count)


@hfg.node
def double(value: int) -> int:
    return 2 * value


@hfg.node
def mirror(image: int) -> int:
    return image


@hfg.node
def show(value: object) -> None: ...


class MapLookup(hfg.Node):
    key = hfg.Input(int)
    pose = hfg.Output(float)
    unknown = hfg.Event(int)
    tolerance = hfg.Parameter(0.1)

    def process(self, key: int) -> float:
        return float(key)

    @hfg.slot
    def forget(self, key: int) -> None: ...


class Box(Subgraph):
    value = hfg.Input(int)

    def build(self, graph: Graph) -> None:
        graph.connect(self.value.inner, graph.add(double()).value)


@pytest.fixture
def graph() -> Graph:
    return Graph("fetch")


# --- names and places ---


def test_add_gives_the_node_back_with_its_place(graph: Graph) -> None:
    node = MapLookup()
    assert graph.add(node) is node
    assert (node.place.graph, node.place.name, node.place.path) == (graph, "map_lookup", "map_lookup")
    assert graph.nodes == {"map_lookup": node}


def test_default_names_count_in_order_of_adding(graph: Graph) -> None:
    for _ in range(3):
        graph.add(double())
    graph.add(MapLookup())
    assert list(graph.nodes) == ["double", "double_2", "double_3", "map_lookup"]


def test_default_name_steps_over_one_given_by_hand(graph: Graph) -> None:
    graph.add(double(), name="double_2")
    graph.add(double())
    graph.add(double())
    assert list(graph.nodes) == ["double_2", "double", "double_3"]


def test_refused_node_takes_no_number(graph: Graph) -> None:
    graph.add(double())
    with pytest.raises(GraphError):
        graph.add(double(), max_rate_hz=-1)
    graph.add(double())
    assert list(graph.nodes) == ["double", "double_2"]


@pytest.mark.rule("G3")
@pytest.mark.parametrize("name", ["a/b", "a.b", "", 3])
def test_names_that_would_break_paths_are_refused(graph: Graph, name: Any) -> None:
    with pytest.raises(GraphError, match="name"):
        graph.add(double(), name=name)
    assert not graph.nodes


def test_doubled_name_is_refused_and_changes_nothing(graph: Graph) -> None:
    graph.add(double(), name="it")
    late = double()
    with pytest.raises(GraphError, match='has a node "it" already'):
        graph.add(late, name="it")
    assert late._place is None
    assert len(graph.nodes) == 1


def test_node_is_in_one_graph_once(graph: Graph) -> None:
    node = graph.add(double())
    with pytest.raises(GraphError, match=r'node "double" is in graph "fetch" already.*make another'):
        Graph("other").add(node)


@pytest.mark.parametrize(
    ("found", "remedy"),
    [
        (double, r"graph\.add\(double\(\)\)"),
        (MapLookup, r"graph\.add\(MapLookup\(\)\)"),
        (print, "hfg.node"),
        (3, "hfg"),
    ],
)
def test_what_is_no_node_is_refused_with_what_to_write(graph: Graph, found: Any, remedy: str) -> None:
    with pytest.raises(GraphError, match=remedy):
        graph.add(found)


# --- options ---


def test_nodes_without_options_share_one_object(graph: Graph) -> None:
    first, second, other = graph.add(double()), graph.add(double()), graph.add(double(), priority=1)
    assert first._options is second._options
    assert first._options != other._options


@pytest.mark.parametrize(
    "wrong",
    [
        {"max_rate_hz": 0},
        {"max_rate_hz": float("nan")},
        {"max_rate_hz": "fast"},
        {"on_error": "ignore"},
        {"restart_limit": -1},
        {"restart_backoff_s": -0.1},
        {"max_duration_s": 0},
        {"release": "later"},
        {"concurrency": 0},
        {"concurrency": 2.0},
        {"concurrency": True},
        {"ordered": "yes"},
        {"retries": -1},
        {"retries": "3"},
        {"retry_on": (ConnectionError,)},
        {"retry_on": 3, "retries": 1},
        {"retry_on": (3,), "retries": 1},
        {"retry_on": (KeyboardInterrupt,), "retries": 1},
        {"retry_on": ("ConectionError",), "retries": 1},
        {"retry_on": ("hfg.errors:NoSuch",), "retries": 1},
        {"retry_backoff_s": -1},
        {"retry_backoff_max_s": float("nan")},
        {"retry_jitter": 1.5},
        {"active_for_s": -5},
        {"deadline_s": True},
        {"enabled": 1},
        {"priority": 1.5},
        {"group": ""},
        {"group": 3},
        {"iterate_over": ("value",)},
    ],
)
def test_options_out_of_range_are_refused_by_name(graph: Graph, wrong: dict[str, Any]) -> None:
    with pytest.raises(GraphError, match=rf'node "double".*{next(iter(wrong))}'):
        graph.add(double(), **wrong)
    assert not graph.nodes


# --- groups ---


@pytest.mark.rule("R1")
def test_loop_is_always_there_and_groups_belong_to_the_whole(graph: Graph) -> None:
    class Inside(Subgraph):
        def build(self, graph: Graph) -> None:
            graph.group("vision")

    graph.add(Inside())
    graph.group("arm", threads=0, policy="random", seed=7)
    assert list(graph.groups) == ["loop", "vision", "arm"]
    assert [graph.groups[name].threads for name in graph.groups] == [0, 1, 0]


@pytest.mark.rule("R1")
@pytest.mark.parametrize("threads", [0.5, -1, True, "one"])
def test_group_has_a_whole_number_of_threads(graph: Graph, threads: Any) -> None:
    with pytest.raises(GraphError, match="threads must be 0 .* or the number of its threads"):
        graph.group("vision", threads=threads)
    assert list(graph.groups) == ["loop"]


@pytest.mark.rule("R2")
def test_policy_of_the_loop_can_be_chosen_but_not_its_threads(graph: Graph) -> None:
    assert graph.group("loop", policy="priority").threads == 0
    with pytest.raises(GraphError, match="takes no thread"):
        graph.group("loop", threads=1)
    with pytest.raises(GraphError, match='policy must be one of "fifo"'):
        graph.group("vision", policy="best")  # type: ignore[arg-type]


def test_group_is_declared_the_same_or_once(graph: Graph) -> None:
    assert graph.group("vision") == graph.group("vision")
    with pytest.raises(GraphError, match="declared already"):
        graph.group("vision", policy="priority")


# --- gates ---


@pytest.mark.rule("A11")
def test_gate_couples_two_nodes_of_the_graph(graph: Graph) -> None:
    detector, fetch = graph.add(double()), graph.add(MapLookup())
    gate = graph.gate(detector, by=fetch, idle_rate_hz=1.0)
    assert graph.gates == [gate]
    assert (gate.target, gate.by, gate.idle_rate_hz) == (detector, fetch, 1.0)


@pytest.mark.rule("A11")
def test_gates_that_make_no_sense_are_refused(graph: Graph) -> None:
    detector, fetch = graph.add(double()), graph.add(MapLookup())
    with pytest.raises(GraphError, match="not in graph"):
        graph.gate(detector, by=MapLookup())
    with pytest.raises(GraphError, match="idle_rate_hz"):
        graph.gate(detector, by=fetch, idle_rate_hz=0)
    with pytest.raises(GraphError, match="give nodes or their paths"):
        graph.gate(detector, by=3)  # type: ignore[arg-type]
    assert not graph.gates
    graph.gate(detector, by=fetch)
    with pytest.raises(GraphError, match="has a gate already"):
        graph.gate(detector, by=fetch)


# --- paths ---


def test_path_leads_to_a_node_or_a_port(graph: Graph) -> None:
    lookup, box = graph.add(MapLookup()), graph.add(Box(), name="inside")
    assert graph["map_lookup"] is lookup
    assert graph["inside/double"] is box.graph.nodes["double"]
    assert graph["inside/double.value"].path == "inside/double.value"
    assert graph["map_lookup.unknown"] is lookup.unknown
    assert graph["map_lookup.processed"] is lookup.processed
    assert graph["map_lookup.tolerance"].value == 0.1
    assert graph["inside.value"] is box.value


@pytest.mark.rule("A10", "P10")
def test_path_leads_to_the_ports_of_the_whole(graph: Graph) -> None:
    keys, poses = graph.input("keys", int), graph.output("poses", float)
    assert graph["keys"] is keys
    assert graph["poses"] is poses
    assert graph["start"] is graph.start
    assert graph["stop"] is graph.stop


@pytest.mark.parametrize(
    ("path", "sentence"),
    [
        ("map_lokup", 'did you mean "map_lookup"?'),
        ("inside/dubble", '"inside" has no node "dubble"; did you mean "double"?'),
        ("map_lookup.unkown", 'has no port "unkown"; did you mean "unknown"?'),
        ("map_lookup/x", '"map_lookup" is not a subgraph'),
        ("nothing/like/it", 'there are "map_lookup", "inside"'),
    ],
)
def test_wrong_path_names_its_first_wrong_part(graph: Graph, path: str, sentence: str) -> None:
    graph.add(MapLookup())
    graph.add(Box(), name="inside")
    with pytest.raises(GraphError) as error:
        graph[path]
    assert sentence in str(error.value)


def test_path_to_a_name_that_is_two_ports_says_how_to_tell_them_apart(graph: Graph) -> None:
    both = hfg.node(lambda image: image, inputs={"image": int}, outputs={"image": int})
    graph.add(both(), name="both")
    with pytest.raises(
        GraphError, match=r'ambiguous.*node\.ports\.inputs\["image"\] or node\.ports\.outputs\["image"\]'
    ):
        graph["both.image"]


# --- >> ---


def test_arrows_connect_the_only_free_port_of_each_side(graph: Graph) -> None:
    source, middle, end = graph.add(numbers()), graph.add(double()), graph.add(show())
    assert source >> middle >> end is end
    assert [edge.label for edge in graph.edges] == ["numbers.out -> double.value", "double.out -> show.value"]


def test_arrows_do_not_look_through_all_edges(graph: Graph) -> None:
    class Edges(list[Any]):
        def __iter__(self) -> Any:
            raise AssertionError("the time for an arrow would grow with the graph")

    source, lookup = graph.add(numbers()), graph.add(MapLookup())
    graph.connect(source.out, lookup.key)
    level = level_of(graph)
    level.edges = level.connections.edges = Edges(level.edges)
    source >> lookup  # its slot alone is free now
    assert graph.edges[-1].target is lookup.forget


def test_ambiguous_arrow_names_the_candidates_and_changes_nothing(graph: Graph) -> None:
    source, lookup = graph.add(numbers()), graph.add(MapLookup())
    with pytest.raises(hfg.errors.UsageError, match=r'"map_lookup\.key" and slot "map_lookup\.forget"'):
        source >> lookup
    with pytest.raises(hfg.errors.UsageError, match=r'"map_lookup\.pose" and event "map_lookup\.unknown"'):
        lookup >> graph.add(show())
    assert not graph.edges


# --- ports of the whole ---


@pytest.mark.rule("P10")
def test_graph_has_inputs_and_outputs_of_its_own(graph: Graph) -> None:
    keys, poses = graph.input("keys", int), graph.output("poses", float)
    lookup = graph.add(MapLookup())
    graph.connect(keys, lookup.key)
    graph.connect(lookup.pose, poses)
    assert [edge.label for edge in graph.edges] == ["keys -> map_lookup.key", "map_lookup.pose -> poses"]
    assert not check(graph)


@pytest.mark.rule("P10")
@pytest.mark.parametrize("name", ["keys", "start", "a.b", ""])
def test_port_of_the_graph_needs_a_name_of_its_own(graph: Graph, name: str) -> None:
    graph.input("keys", int)
    with pytest.raises(GraphError):
        graph.output(name, int)
    assert not graph.outputs


@pytest.mark.rule("A10")
def test_start_stop_and_abort_are_ports_like_others(graph: Graph) -> None:
    lookup = graph.add(MapLookup())
    assert isinstance(graph.start, EventPort)
    graph.start.activates(lookup.activate)
    graph.connect(lookup.unknown, graph.stop)
    graph.connect(lookup.failed, graph.abort)
    assert [edge.label for edge in graph.edges] == [
        "start -> map_lookup.activate",
        "map_lookup.unknown -> stop",
        "map_lookup.failed -> abort",
    ]
    assert [edge.active for edge in graph.edges] == [True, False, False]


def test_repr_tells_what_is_in_it(graph: Graph) -> None:
    source, end = graph.add(numbers()), graph.add(show())
    edge = graph.connect(source.out, end.value, active=True)
    assert repr(graph) == '<graph "fetch": 2 nodes, 1 edges>'
    assert repr(edge) == "<active edge numbers.out -> show.value>"
    assert isinstance(edge.target, InputPort)

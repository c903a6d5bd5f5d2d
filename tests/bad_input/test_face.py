"""Node types, ports and calls as a newcomer gets them wrong: one sentence each, with the path and the remedy."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg.engine.runtime import engine
from hfg.errors import CheckFailed, DeclarationError, NodeError, RunError, UsageError, in_words
from tests.semantics.nodes import Ear, Keep, forward, numbers, run

# --- declaring ---


def keywords() -> None:
    @hfg.node
    def blur(value: int, **options: Any) -> int:
        return value


def keywords_of_process() -> None:
    class Blur(hfg.Node):
        def process(self, value: int, **options: Any) -> int:
            return value


def empty_class() -> None:
    @hfg.node
    class Pose: ...


def process_without_self() -> None:
    class Blur(hfg.Node):
        def process(value: int) -> int:  # type: ignore[misc]  # noqa: N805
            return value


def process_without_anything() -> None:
    class Source(hfg.Node):
        def process() -> int:  # type: ignore[misc]
            return 1


def slot_without_self() -> None:
    class Listens(hfg.Node):
        @hfg.slot
        def hear(value: int) -> None: ...  # noqa: N805


def hook_without_self() -> None:
    class Opens(hfg.Node):
        def setup() -> None: ...  # type: ignore[misc]


def stars() -> None:
    @hfg.node
    def merge(*values: int) -> int:
        return sum(values)


def a_node_as_a_function() -> None:
    hfg.node(forward())  # type: ignore[call-overload]


@pytest.mark.parametrize(
    ("declare", "sentence"),
    [
        (keywords, r'node type blur: "\*\*options" .* name each'),
        (keywords_of_process, r'Blur: "\*\*options" .* name each'),
        (empty_class, r"node type Pose: a class without inputs .*write `class Pose\(hfg.Node\)`"),
        (process_without_self, r"process is a method and takes the node first; write `def process\(self, value: "),
        (process_without_anything, r"write `def process\(self\)`"),
        (slot_without_self, r'the handler of slot "hear" is a method .* write `def hear\(self, value: '),
        (hook_without_self, r"setup is a method and takes the node first; write `def setup\(self\)`"),
        (stars, r'"\*values" does not say how many .* inputs=\{"values": hfg.Inputs\(int, 3\)\}'),
        (a_node_as_a_function, r"is already a node; add it to a graph"),
    ],
    ids=lambda item: getattr(item, "__name__", ""),
)
def test_what_is_no_node_type_says_what_to_write(declare: Callable[[], None], sentence: str) -> None:
    with pytest.raises(DeclarationError, match=sentence):
        declare()


# --- nodes and ports ---


def test_a_typo_in_a_port_lists_those_that_there_are() -> None:
    node: Any = hfg.Graph().add(Ear())
    with pytest.raises(AttributeError) as refused:
        node.pased.trigger()
    assert in_words(refused.value) == (
        'AttributeError: node "ear" has no "pased"; did you mean "passed"? '
        f"its ports and parameters are {', '.join([*node.ports.events, *node.ports.slots])}"
    )
    assert not hasattr(node, "pased")
    assert getattr(node, "pased", 3) == 3


def test_an_attribute_that_fails_says_so_itself() -> None:
    class Broken(hfg.Node):
        @property
        def length(self) -> int:
            return self.missing.length  # type: ignore[attr-defined,no-any-return]

    with pytest.raises(AttributeError) as refused:
        _ = Broken().length
    assert in_words(refused.value) == 'AttributeError: node "broken" has no "missing"; it has no ports'


def test_what_an_attribute_says_of_itself_is_what_is_said() -> None:
    class Sad(hfg.Node):
        out = hfg.Output(int)

        @property
        def speed(self) -> int:
            raise AttributeError("no calibration file: run calibrate first")

        def process(self) -> int:
            return self.speed

    graph = hfg.Graph()
    graph.add(Sad()) >> graph.add(forward())
    with pytest.raises(NodeError, match="firing 1: AttributeError: no calibration file: run calibrate first$"):
        hfg.run(graph)


def test_code_that_asks_for_a_port_that_there_is_not_is_told_the_path_and_those_there_are() -> None:
    class Lost(hfg.Node):
        out = hfg.Output(int)

        def process(self) -> None:
            lost: Any = self
            lost.outt.send(3)

    graph = hfg.Graph()
    graph.add(Lost()).out >> graph.add(forward())
    said = 'node "lost" failed in firing 1: AttributeError: node "lost" has no "outt"; did you mean "out"?'
    with pytest.raises(NodeError, match=re.escape(said)):
        hfg.run(graph)


def test_a_node_is_no_function() -> None:
    node: Any = forward()
    with pytest.raises(UsageError, match=r'"forward" is a node, .* forward.function: .*hfg.testing.fire'):
        node(3)


def test_a_port_holds_no_value() -> None:
    node: Any = hfg.Graph().add(forward())
    with pytest.raises(AttributeError, match=r'output "forward.out" has no "value": .*run.tap\(port\)'):
        _ = node.out.value
    with pytest.raises(AttributeError, match=r'input "forward.value" has no "connect": .* graph.connect\('):
        node.value.connect(3)
    with pytest.raises(AttributeError) as refused:
        _ = node.value.shape
    assert (
        'input "forward.value" has no "shape": it is only an end of edges; its attributes are name, type, node and path'
        in in_words(refused.value)
    )


def test_a_path_behind_an_arrow_is_connected() -> None:
    source: Any = hfg.Graph().add(numbers())
    with pytest.raises(UsageError, match=r'got the path "keep"; write graph.connect\(source, "keep"\)'):
        source >> "keep"


def checks(graph: hfg.Graph) -> dict[str, str]:
    return {problem.check: str(problem) for problem in graph.check()}


def test_an_attribute_that_nobody_knows_is_told_of() -> None:
    graph = hfg.Graph()
    node: Any = graph.add(numbers())
    node.cuont = 3
    assert 'did you mean "count"' in checks(graph)["unknown-attribute"]
    known = graph.add(Ear())
    known.heard = []
    assert '"heard"' not in checks(graph)["unknown-attribute"]


def test_a_subgraph_without_inside_is_told_of() -> None:
    class Box(hfg.Subgraph):
        value = hfg.Input(int)

    graph = hfg.Graph()
    graph.add(Box())
    assert "it has no build()" in checks(graph)["empty-subgraph"]


def test_a_graph_without_edges_is_told_of() -> None:
    graph = hfg.Graph("lonely")
    graph.add(numbers())
    graph.add(numbers())
    assert 'warning at "lonely": it has 2 nodes and no edge' in checks(graph)["unconnected-graph"]


def test_a_time_limit_that_nothing_can_keep_is_told_of() -> None:
    graph = hfg.Graph()
    graph.group("work")
    graph.add(numbers(), name="plain", max_duration_s=1)
    graph.add(numbers(), name="threaded", max_duration_s=1, group="work")
    told = [problem.path for problem in graph.check() if problem.check == "limit-without-effect"]
    assert told == ["plain"]


# --- runs ---


def test_a_block_that_is_not_async_says_what_to_write() -> None:
    block: Any = hfg.running(hfg.Graph("mine"))
    with pytest.raises(UsageError, match='"mine" is a block of async code: write `async with'), block:
        pass


@pytest.mark.parametrize("policy", [None, "fifo"])
def test_a_seed_that_no_policy_asks_for_is_refused(policy: str | None) -> None:
    graph = hfg.Graph("mine")
    graph.add(numbers())
    with pytest.raises(UsageError, match='seed=3 has no effect, .*"mine".* policy="random", seed=3'):
        run(graph, policy=policy, seed=3)
    assert run(graph, policy="random", seed=3).outcome == "done"


def test_an_endless_generator_is_named_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "_MOST_AT_ONE_INSTANT", 1000)

    @hfg.node
    def count() -> Iterator[int]:
        yield from itertools.count()

    graph = hfg.Graph()
    graph.connect(graph.add(count()).out, graph.add(Keep()).value)
    with pytest.raises(RunError, match=r'"count" fired most: give it max_rate_hz='):
        run(graph, until_s=1, debug=False)


def test_a_value_of_the_wrong_type_names_who_has_sent_it(fast: bool) -> None:
    @hfg.node
    def texts() -> Iterator[int]:
        yield "a"  # type: ignore[misc]

    @hfg.node
    def increase(value: int) -> int:
        return value + 1

    graph = hfg.Graph()
    graph.connect(graph.add(texts()).out, graph.add(increase()).value)
    with pytest.raises(NodeError) as failed:
        run(graph, fast)
    assert 'its input "value" is declared int and was given \'a\' by "texts.out"' in str(failed.value)


def test_a_value_that_the_code_itself_has_changed_is_nobody_elses_fault() -> None:
    @hfg.node
    def increase(value: int) -> int:
        value = str(value)  # type: ignore[assignment]
        return value + 1

    graph = hfg.Graph()
    graph.connect(graph.add(numbers()).out, graph.add(increase()).value)
    with pytest.raises(NodeError) as failed:
        run(graph)
    assert "was given" not in str(failed.value)


def test_a_thread_group_names_the_async_slot_that_it_cannot_have() -> None:
    class Mixed(hfg.Node):
        def process(self, value: int) -> None: ...

        @hfg.slot
        async def ask(self) -> None: ...

    graph = hfg.Graph()
    graph.group("work")
    mixed = graph.add(Mixed(), group="work")
    graph.connect(graph.add(numbers()).out, mixed.ports.inputs["value"])
    with pytest.raises(CheckFailed, match='its slot ask is async, but its group "work" is a thread'):
        run(graph)

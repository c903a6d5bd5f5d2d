"""`print(report)` and `print(run.statistics())` are tables."""

from __future__ import annotations

import hfg
from tests.semantics.nodes import Keep, drive, numbers, run


def two() -> hfg.Graph:
    graph = hfg.Graph()
    graph.connect(graph.add(numbers(count=3)).out, graph.add(Keep()).value)
    return graph


def test_a_report_is_a_table_of_nodes_and_one_of_edges() -> None:
    assert str(run(two())).splitlines() == [
        "done after 0 s, 8 firings",
        "",
        "node     firings  ended",
        "numbers        4    yes",
        "keep           4    yes",
        "",
        "edge                       sent",
        "numbers.out -> keep.value     4",
    ]


def test_statistics_are_one_too() -> None:
    async def main() -> str:
        async with hfg.running(two()) as run:
            run.statistics()
            await run.wait_finished()
            return str(run.statistics())

    lines = drive(main).splitlines()
    assert lines[0] == "done after 0 s, 8 firings"
    assert lines[2].split()[:3] == ["node", "group", "firings"]
    assert lines[3].split()[:3] == ["numbers", "loop", "4"]
    assert any(line.startswith("numbers.out -> keep.value") for line in lines)

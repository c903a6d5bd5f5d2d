"""Graphs around one faulty node."""

from __future__ import annotations

from typing import Any

import pytest

import hfg
from hfg.errors import NodeError
from tests.semantics.nodes import Keep, numbers, run


def one(node: hfg.Node, *, count: int = 3, **options: Any) -> hfg.Graph:
    """A source, the node, and a sink behind its output if it has one."""
    graph = hfg.Graph()
    source = graph.add(numbers(count=count))
    graph.add(node, name="node", **options)
    graph.connect(source.out, next(iter(node.ports.inputs.values())))
    for output in node.ports.outputs.values():
        graph.connect(output, graph.add(Keep()).value)
    return graph


def sentence(graph: hfg.Graph, fast: bool, **options: Any) -> str:
    """What the failing run says."""
    with pytest.raises(NodeError) as raised:
        run(graph, fast, **options)
    assert raised.value.report.outcome == "failed"  # type: ignore[attr-defined]
    assert graph._run is None
    return str(raised.value)

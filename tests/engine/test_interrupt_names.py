"""Ctrl-C names the graph and the groups that run in processes of their own."""

from __future__ import annotations

import hfg
from hfg.engine.runtime.interrupt import named


def test_a_graph_that_is_interrupted_is_named_with_its_process_groups() -> None:
    graph = hfg.Graph("robot")
    assert named(graph) == 'graph "robot"'
    graph.group("camera", process=True)
    graph.group("threads", threads=2)
    assert named(graph) == 'graph "robot" with the process of "camera"'
    graph.group("arm", host="base")
    assert named(graph) == 'graph "robot" with the processes of "camera", "arm"'

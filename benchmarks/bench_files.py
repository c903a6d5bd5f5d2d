"""A graph file of 1,000 nodes: reading, building and checking it, and writing it.

Measured: processor time, of which nearly all is ours, from the path of a file to a checked graph, and from a graph to
the file. The graph is a chain of functions whose module is imported already, each with an option, position and note.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import hfg
from benchmarks.measure import Case
from benchmarks.nodes import through
from hfg.testing.nodes import Script, sink

DISTRIBUTIONS = ("hfg",)
NODES = 1_000


def chain(length: int) -> hfg.Graph:
    """A chain of `length` nodes, as a user would draw it."""
    graph = hfg.Graph("chain")
    port = graph.add(Script(count=length), name="source").ports.outputs["out"]
    for number in range(length - 2):
        node = graph.add(through(), name=f"step_{number}", priority=number % 5)
        graph.connect(port, next(iter(node.ports.inputs.values())))
        port = next(iter(node.ports.outputs.values()))
        graph.edit(
            hfg.commands.Note(f"step_{number}", "position", [number % 40, number // 40]),
            hfg.commands.Note(f"step_{number}", "comment", f"the step after {number}"),
        )
    graph.connect(port, graph.add(sink(), name="last").ports.inputs["value"])
    return graph


def load(length: int) -> float:
    """Seconds from a file to a checked graph."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "chain.hfg.yaml")
        hfg.save(chain(length), file)
        began = time.process_time()
        problems = hfg.load(file, allow=("benchmarks",)).check()
        spent = time.process_time() - began
    if any(problem.severity == "error" for problem in problems):
        raise AssertionError(f"the chain has errors: {problems[:3]}")
    return spent


def save(length: int) -> float:
    """Seconds from a graph to a file."""
    graph = chain(length)
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        hfg.save(graph, Path(folder, "chain.hfg.yaml"))
        return time.process_time() - began


CASES = {"load and check": Case(load, NODES, "s"), "save": Case(save, NODES, "s")}

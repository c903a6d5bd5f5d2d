"""The difference of two graphs as commands (rule R4): carried out on the first, they make it like the second."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import pytest

import hfg
from hfg.errors import GraphError
from hfg.graph import commands as c
from hfg.graph.editing.differing import difference
from hfg.graph.structure.level import level_of
from tests.support.edits import random_edit
from tests.support.making import Allowed, SeededChooser, random_plan


def differences(one: hfg.Graph, other: hfg.Graph) -> list[c.Command]:
    return difference(level_of(one), level_of(other))


def unordered(graph: hfg.Graph) -> list[str]:
    return sorted(c.encode([one]) for one in graph.as_commands())


@pytest.mark.slow
@pytest.mark.rule("R4")
@pytest.mark.parametrize("block", range(8))
def test_what_random_edits_did_is_done_by_the_difference(block: int) -> None:
    done = 0
    for seed in range(block * 12, block * 12 + 12):
        plan, choose = random_plan(seed, replace(Allowed(), feeds=False)), SeededChooser(seed)
        graph, edited = plan.build(), plan.build()
        for number in range(6):
            with suppress(GraphError):
                edited.edit(*random_edit(edited, choose, number))
        commands = differences(graph, edited)
        if commands:
            graph.edit(*c.decode(c.encode(commands)))
            done += 1
        assert unordered(graph) == unordered(edited), f"seed {seed}"
        assert differences(graph, edited) == []
    assert done > 6


@pytest.mark.rule("R4")
def test_a_graph_does_not_differ_from_itself() -> None:
    graph = random_plan(3, Allowed()).build()
    assert differences(graph, graph) == []

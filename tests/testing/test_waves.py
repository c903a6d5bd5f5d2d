"""Waves go depth first under first-in first-out; a run with another order is found (rule R2)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Literal

import pytest

import hfg
from hfg.testing import Divergence, Recorder, recorder, reference_run, replay
from hfg.testing.nodes import Scaled, double, script, sink
from hfg.trace import FiringStarted
from tests.support.making import Allowed, random_plan
from tests.support.waves import replay_depth_first


def forked() -> hfg.Graph:
    """Two branches of two nodes each."""
    graph = hfg.Graph()
    source = graph.add(script(values=(1, 2)))
    for name in ("left", "right"):
        source >> graph.add(double(), name=name) >> graph.add(sink(), name=f"{name}_end")
    return graph


def called_and_fired() -> hfg.Graph:
    """One sending gives the second node a call and a firing, and the first a firing."""
    graph = hfg.Graph()
    source, first, second = graph.add(script(values=(1, 2))), graph.add(sink(), name="first"), graph.add(Scaled())
    graph.connect(source.out, first.value)
    graph.connect(source.out, second.value)
    graph.connect(source.out, second.ports.slots["ping"])
    return graph


def run(build: Callable[[], hfg.Graph], policy: Literal["fifo", "random"] = "fifo", seed: int = 0) -> Recorder:
    seen = recorder()
    hfg.run(build(), clock="virtual", trace=seen, policy=policy, seed=seed if policy == "random" else None)
    return seen


def order(seen: Recorder) -> list[str]:
    return [event.node for event in seen.of(FiringStarted)]


@pytest.mark.rule("R2")
def test_a_wave_goes_down_one_branch_before_the_next() -> None:
    seen = run(forked)
    assert order(seen)[:5] == ["script", "left", "left_end", "right", "right_end"]
    replay_depth_first(forked, seen)


@pytest.mark.rule("R2")
def test_breadth_first_is_permitted_by_the_other_rules_and_found() -> None:
    breadth = ["script", "left", "right"]
    seen = next(seen for seed in range(100) if order(seen := run(forked, "random", seed))[:3] == breadth)
    replay(forked, seen)
    with pytest.raises(Divergence, match=r'"left_end" was enabled by a wave and goes first \(R2\)'):
        replay_depth_first(forked, seen)


@pytest.mark.rule("R2", "F9")
def test_a_call_and_a_firing_by_one_sending_are_one_turn() -> None:
    seen = run(called_and_fired)
    assert order(seen)[:3] == ["script", "scaled", "first"]
    replay_depth_first(called_and_fired, seen)


@pytest.mark.slow
@pytest.mark.rule("R2")
@pytest.mark.parametrize("block", range(4))
def test_waves_of_random_graphs_go_depth_first(block: int) -> None:
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, Allowed(max_nodes=5 + seed % 6))
        try:
            reference_run(plan.build(), seed=seed, max_moves=1500)
        except RuntimeError:  # it goes round and round
            continue
        seen = recorder()
        with contextlib.suppress(hfg.errors.RunError):
            hfg.run(plan.build(), clock="virtual", trace=seen)
        replay_depth_first(plan.build, seen)

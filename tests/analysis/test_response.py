"""Bounds of response times are never below what happens, and are met where the theory says that they are."""

from __future__ import annotations

import heapq
import math
import random
from collections.abc import Callable

import pytest

from hfg.analysis.response import Task, response_times, utilisation

_KEYS: dict[str, Callable[[Task, float, int], tuple[float, ...]]] = {
    "fifo": lambda task, arrival, number: (arrival, number),
    "priority": lambda task, arrival, number: (-task.lowest, arrival, number),
    "deadline": lambda task, arrival, number: (arrival + task.deadline_s, number),
}


def simulated(tasks: list[Task], policy: str, offsets: list[float], rng: random.Random) -> list[float]:
    """The longest time from due to done of each task: a firing runs to its end, then the policy chooses."""
    coming: list[tuple[float, int, float]] = []
    for index, task in enumerate(tasks):
        due = offsets[index]
        while due < 1000:
            heapq.heappush(coming, (due + rng.random() * task.jitter_s, index, due))
            due += task.period_s
    ready: list[tuple[tuple[float, ...], int, float, int]] = []
    worst, now, number = [0.0] * len(tasks), 0.0, 0
    while coming or ready:
        while coming and coming[0][0] <= now + 1e-12:
            arrival, index, due = heapq.heappop(coming)
            number += 1
            choose = _KEYS.get(policy)
            key = (rng.random(),) if choose is None else choose(tasks[index], arrival, number)
            heapq.heappush(ready, (key, index, due, 0))
        if not ready:
            now = coming[0][0]
            continue
        key, index, due, done = heapq.heappop(ready)
        now += tasks[index].firings_s[done] * (1 if rng.random() < 0.7 else rng.uniform(0.5, 1))
        if done + 1 < len(tasks[index].firings_s):
            heapq.heappush(ready, (key, index, due, done + 1))
        else:
            worst[index] = max(worst[index], now - due)
    return worst


def random_tasks(rng: random.Random) -> list[Task]:
    count, load = rng.randint(2, 6), rng.uniform(0.3, 0.95)
    shares = [rng.random() for _ in range(count)]
    tasks = []
    for number, share in enumerate(shares):
        period = float(rng.choice([5, 10, 20, 25, 40, 50, 100]))
        cuts = [rng.random() + 0.1 for _ in range(rng.randint(1, 4))]
        firings = tuple(load * share / sum(shares) * period * cut / sum(cuts) for cut in cuts)
        deadline = period * rng.uniform(0.8, 2)
        tasks.append(Task(period, firings, rng.choice([0.0, 0.0, 1.0, 3.0]), -number, -number, deadline))
    return tasks


def never_below(seed: int, policy: str) -> float:
    rng = random.Random(seed)
    tasks = random_tasks(rng)
    bounds = response_times(tasks, policy)
    worst = [0.0] * len(tasks)
    for attempt in range(4):
        offsets = [0.0 if attempt == 0 else rng.uniform(0, task.period_s) for task in tasks]
        worst = [max(pair) for pair in zip(worst, simulated(tasks, policy, offsets, rng), strict=True)]
    for task, bound, seen in zip(tasks, bounds, worst, strict=True):
        assert seen <= bound + 1e-6, f"{policy}, seed {seed}: {task} took {seen}, bound {bound}"
    return max(bound / seen for bound, seen in zip(bounds, worst, strict=True) if seen)


POLICIES = ("fifo", "priority", "deadline", "random")


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.rule("R2")
def test_no_simulated_wave_takes_longer_than_the_bound(policy: str) -> None:
    for seed in range(25):
        never_below(seed, policy)


@pytest.mark.soak
@pytest.mark.parametrize("policy", POLICIES)
def test_no_wave_of_a_thousand_sets_takes_longer_than_the_bound(policy: str) -> None:
    for seed in range(1000, 2000):
        never_below(seed, policy)


def test_first_in_first_out_without_jitter_waits_for_one_wave_of_each() -> None:
    tasks = [Task(0.1, (0.01, 0.02)), Task(0.05, (0.005,))]
    assert response_times(tasks, "fifo") == pytest.approx([0.035, 0.035])


def test_a_higher_priority_waits_only_for_one_lower_firing() -> None:
    tasks = [Task(0.1, (0.03, 0.02), lowest=0, highest=0), Task(0.05, (0.01,), lowest=1, highest=1)]
    assert response_times(tasks, "priority") == pytest.approx([0.06, 0.04])


def test_deadlines_that_no_interval_overfills_are_the_bounds() -> None:
    tasks = [Task(0.1, (0.02,), deadline_s=0.045), Task(0.1, (0.02, 0.02), deadline_s=0.09)]
    assert response_times(tasks, "deadline") == pytest.approx([0.045, 0.06])
    tight = [Task(0.1, (0.02,), deadline_s=0.04), Task(0.1, (0.03,), deadline_s=0.041)]
    assert response_times(tight, "deadline") == pytest.approx([0.05, 0.05])


@pytest.mark.parametrize("policy", POLICIES)
def test_what_needs_more_than_the_processor_has_no_bound(policy: str) -> None:
    tasks = [Task(0.1, (0.06,)), Task(0.1, (0.05,))]
    assert utilisation(tasks) == pytest.approx(1.1)
    assert response_times(tasks, policy) == [math.inf, math.inf]

"""Response times of waves that share one processor: bounds that no run exceeds whose durations are as declared.

A group runs one firing at a time, and a firing is never interrupted. All firings that one source starts in a group are a
*task*, and one wave of it is a job. Times count from the moment at which a wave is due.

| policy | bound | source |
| --- | --- | --- |
| fifo | the work of all waves released up to then | George, Minet 1997 |
| priority | Joseph, Pandya 1986 and Audsley et al. 1993, with blocking by one firing, all jobs of a busy period | Davis, Burns, Bril, Lukkien 2007; Bril, Lukkien, Verhaegh 2009 |
| deadline | the deadline, if the demand of no interval exceeds it | Baruah, Rosier, Howell 1990; blocking: Baruah 2005 |
| fair, random | the longest busy period: it holds for each policy that never idles | |

Depends on nothing.
"""  # noqa: E501 - a table

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

_ENOUGH: Final = 100_000  # steps of an iteration, and points that are looked at
_MOST_STEPS: Final = 5_000_000  # some seconds
_ROUNDING: Final = 1e-9


class Effort:
    """The effort that is left for an analysis: rates in a small file can ask for hours of it (rule L4).

    Attributes:
      steps: how often the work of one task may still be added up.
    """

    def __init__(self, steps: int = _MOST_STEPS) -> None:
        self.steps = steps

    def spend(self, steps: int) -> bool:
        """Take some of it. Return whether there was enough."""
        self.steps -= steps
        return self.steps >= 0


@dataclass(frozen=True, slots=True)
class Task:
    """The waves that one source starts in one group.

    Attributes:
      period_s: the shortest time between two waves, above 0.
      firings_s: how long each firing of a wave takes at most.
      jitter_s: how much later than due a wave can begin.
      lowest: the lowest priority of its nodes; larger numbers come first.
      highest: the highest one.
      deadline_s: of all its nodes from the begin of the wave; infinity if they have none, or different ones.
      in_order: first in, first out takes it as a whole; otherwise parts of it may come after other waves.
    """

    period_s: float
    firings_s: tuple[float, ...]
    jitter_s: float = 0.0
    lowest: int = 0
    highest: int = 0
    deadline_s: float = math.inf
    in_order: bool = True
    work_s: float = field(init=False)
    """How long all firings of a wave take together."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "work_s", sum(self.firings_s))

    @property
    def longest_s(self) -> float:
        """How long its longest firing takes."""
        return max(self.firings_s, default=0.0)


def utilisation(tasks: Iterable[Task]) -> float:
    """Return the share of the processor that tasks need; above 1 their waves pile up."""
    return sum(task.work_s / task.period_s for task in tasks)


def response_times(tasks: Sequence[Task], policy: str, effort: Effort | None = None) -> list[float]:
    """Return a bound for the response time of each task, in seconds; infinity if there is none, or it was not found.

    Args:
      tasks: all of one group.
      policy: of the group.
      effort: what may be spent; a new one by default. Where it does not suffice, no bound is found.
    """
    try:
        return _bounds(tasks, policy, Effort() if effort is None else effort)
    except (OverflowError, ValueError):  # a number of waves in it is infinite
        return [math.inf] * len(tasks)


def _bounds(tasks: Sequence[Task], policy: str, effort: Effort) -> list[float]:
    if utilisation(tasks) > 1 + _ROUNDING and policy != "priority":
        return [math.inf] * len(tasks)
    if policy == "priority":
        return [_priority(tasks, number, effort) for number in range(len(tasks))]
    busy = _busy(tasks, effort)
    if policy == "fifo":
        whole = _fifo(tasks, busy, effort)
        return [(whole if task.in_order else busy) + task.jitter_s for task in tasks]
    if policy == "deadline" and _meets_deadlines(tasks, busy, effort):
        return [task.jitter_s + min(task.deadline_s, busy) for task in tasks]
    return [busy + task.jitter_s for task in tasks]


def _busy(tasks: Sequence[Task], effort: Effort, first: float = 0.0) -> float:
    """Return how long the processor can be busy without a break, after `first` seconds of other work."""
    begin = first + sum(task.work_s for task in tasks)

    def work_until(t: float) -> float:
        waves = ((math.ceil((t + task.jitter_s) / task.period_s - _ROUNDING), task) for task in tasks)
        return first + sum(count * task.work_s for count, task in waves)

    return _fixed_point(begin, work_until, len(tasks), effort)


def _fixed_point(begin: float, follow: Callable[[float], float], cost: int, effort: Effort) -> float:
    """Return the smallest number from `begin` on that is its own follower; infinity if it is not found."""
    now = begin
    for _ in range(_ENOUGH):
        if not effort.spend(1 + cost):
            break
        after = follow(now)
        if after <= now + _ROUNDING:
            return now
        now = after
    return math.inf


def _released(task: Task, t: float) -> int:
    """Return how many waves can come in an interval, both ends included."""
    return 1 + math.floor((t + task.jitter_s) / task.period_s + _ROUNDING)


def _steps(task: Task, busy: float) -> list[float]:
    """Return the moments of a busy period at which another wave can come."""
    first = max(1, math.ceil(task.jitter_s / task.period_s))
    last = math.floor((busy + task.jitter_s) / task.period_s)
    return [max(0.0, number * task.period_s - task.jitter_s) for number in range(first, last + 1)]


def _are_few(tasks: Sequence[Task], busy: float, effort: Effort) -> bool:
    """Return whether all work at each of these moments can be added up."""
    if busy == math.inf:
        return False
    moments = sum((busy + task.jitter_s) / task.period_s + 1 for task in tasks)
    return moments <= _ENOUGH + len(tasks) and effort.spend(math.ceil(moments) * len(tasks))


def _moments(tasks: Sequence[Task], busy: float, effort: Effort) -> set[float] | None:
    """Return all these moments; None if they are too many."""
    if not _are_few(tasks, busy, effort):
        return None
    return {0.0}.union(*(_steps(task, busy) for task in tasks))


def _fifo(tasks: Sequence[Task], busy: float, effort: Effort) -> float:
    moments = _moments(tasks, busy, effort)
    if moments is None:
        return math.inf
    return max(sum(_released(task, t) * task.work_s for task in tasks) - t for t in moments)


def _priority(tasks: Sequence[Task], number: int, effort: Effort) -> float:
    """Waves that may come first delay it, others only by one firing that has begun."""
    if not effort.spend(len(tasks)):
        return math.inf
    me = tasks[number]
    others = [task for index, task in enumerate(tasks) if index != number]
    first = [task for task in others if task.highest >= me.lowest]
    blocking = max((task.longest_s for task in others if task.highest < me.lowest), default=0.0)
    if utilisation([*first, me]) > 1 + _ROUNDING:
        return math.inf
    busy = _busy([*first, me], effort, blocking)
    if busy == math.inf:
        return math.inf
    last = me.firings_s[-1] if me.firings_s else 0.0
    worst = 0.0
    for job in range(max(1, min(math.ceil((busy + me.jitter_s) / me.period_s), _ENOUGH))):
        own = blocking + (job + 1) * me.work_s - last
        begun = _fixed_point(
            own,
            lambda t, own=own: own + sum(_released(task, t) * task.work_s for task in first),  # type: ignore[misc]
            len(first),
            effort,
        )
        if begun == math.inf:
            return math.inf
        worst = max(worst, begun + last - job * me.period_s + me.jitter_s)
    # beyond a period the next wave has come, whose firings may go ahead of the last ones of this wave
    return worst if worst <= me.period_s else max(worst, busy + me.jitter_s)


def _meets_deadlines(tasks: Sequence[Task], busy: float, effort: Effort) -> bool:
    """Return whether each wave is over by its deadline: no interval holds more work than time."""
    if any(task.deadline_s == math.inf for task in tasks):
        return False
    if not _are_few(tasks, busy, effort):
        return False
    moments = {
        number * task.period_s + task.deadline_s - task.jitter_s
        for task in tasks
        for number in range(math.floor((busy + task.jitter_s) / task.period_s) + 1)
    }
    moments |= {task.deadline_s for task in tasks}
    return all(_demand(tasks, t) <= t + _ROUNDING for t in moments if t >= 0)


def _demand(tasks: Sequence[Task], t: float) -> float:
    """Return the work that begins and must end in an interval, and a firing that has begun before."""
    blocking = max((task.longest_s for task in tasks if task.deadline_s > t), default=0.0)
    return blocking + sum(
        max(0, 1 + math.floor((t + task.jitter_s - task.deadline_s) / task.period_s + _ROUNDING)) * task.work_s
        for task in tasks
    )

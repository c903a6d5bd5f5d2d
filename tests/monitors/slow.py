"""Formulas evaluated as they are defined, over a whole trace: what the compiled ones must equal."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from hfg.monitors import formulas as f

__all__ = ["POINTS", "holds", "random_formula", "random_trace"]

POINTS = tuple(f.sent(name) for name in ("p.out", "q.out", "r.out"))
INF = float("inf")

Trace = list[tuple[float, dict[Any, bool]]]


def holds(formula: f.Formula, trace: Trace, at: int) -> bool:
    """Whether a formula holds at a point of a trace."""
    t, truths = trace[at]
    match formula:
        case f.Not(of):
            return not holds(of, trace, at)
        case f.And(one, other):
            return holds(one, trace, at) and holds(other, trace, at)
        case f.Or(one, other):
            return holds(one, trace, at) or holds(other, trace, at)
        case f.Previously(of):
            return at > 0 and holds(of, trace, at - 1)
        case f.Times(number, of, within_s):
            return sum(t - trace[j][0] <= within_s and holds(of, trace, j) for j in range(at + 1)) >= number
        case f.Since(meanwhile, began, at_least_s, within_s):
            return any(
                at_least_s <= t - trace[j][0] <= within_s
                and holds(began, trace, j)
                and (meanwhile is None or all(holds(meanwhile, trace, k) for k in range(j + 1, at + 1)))
                for j in range(at + 1)
            )
        case _:
            return truths[formula]


def random_formula(rng: random.Random, depth: int, atoms: Sequence[f.Formula] = POINTS) -> f.Formula:
    """Any formula over these atoms."""
    if depth == 0 or rng.random() < 0.2:
        return rng.choice(atoms)
    least = rng.choice([0.0, 0.0, 1.0, 2.0])
    bounds: Any = {"at_least_s": least, "within_s": rng.choice([least, least + 1, least + 3, INF])}
    one, other = random_formula(rng, depth - 1, atoms), random_formula(rng, depth - 1, atoms)
    match rng.randrange(9):
        case 0:
            return ~one
        case 1:
            return one & other
        case 2:
            return one | other
        case 3:
            return one.implies(other)
        case 4:
            return f.previously(one)
        case 5:
            return f.once(one, **bounds)
        case 6:
            return f.throughout(one, last_s=bounds["within_s"])
        case 7:
            return f.at_least(rng.randint(1, 3), one, within_s=bounds["within_s"])
        case _:
            return f.since(one, other, **bounds)


def random_trace(rng: random.Random) -> Trace:
    """Up to 15 points, several of which may be at one moment."""
    t, trace = 0.0, []
    for _ in range(rng.randint(1, 15)):
        t += rng.choice([0.0, 0.5, 1.0, 1.0, 2.0])
        trace.append((t, {atom: rng.random() < 0.5 for atom in POINTS}))
    return trace

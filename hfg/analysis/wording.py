"""A report on activity in words and as plain data. Depends on `proving`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.analysis.proving import Region, StatedFact, Verdict

__all__ = ["data_of_fact", "data_of_region", "lines_of_fact", "lines_of_region", "names"]


def lines_of_region(region: Region) -> list[str]:
    """Say which claims hold in a region."""
    where = names(region.nodes)
    if not region.begins:
        return [
            f"{where}: nothing in the graph makes any of them active; what your program may activate is not looked at"
        ]
    states = f"{region.states} states{'' if region.is_complete else ' and more'}"
    best = region.exactly_one if region.exactly_one.holds else region.at_most_one
    found = [f"{where}: {states}", f"  {_result(best)}"]
    if best is region.at_most_one and region.exactly_one.holds is not None and region.at_most_one.holds:
        found.append(f"  {_result(region.exactly_one)}")
        best = region.exactly_one
    found += [f"    {number}. {step.text}" for number, step in enumerate(best.steps, 1)]
    if best.steps:
        last = best.steps[-1]
        after = [
            *(f'"{path}" is active' for path in last.active),
            *(f'activity lies on "{one}"' for one in last.under_way),
        ]
        found.append(f"    then {' and '.join(after) or 'no node is active'}")
    if region.unproved:
        found.append(f"  {region.unproved}")
    return found


def _result(one: Verdict) -> str:
    if one.holds:
        return f"{one.claim} is active: proved by {one.method}{one.given_that()}"
    if one.holds is None:
        return f"{one.claim} is active: not proved: {one.why}"
    return f"{one.claim} is active: not so, as these steps may show:" if one.steps else f"{one.claim} is active: not so"


def names(paths: Sequence[str]) -> str:
    """Name the first few of some paths."""
    shown = ", ".join(f'"{path}"' for path in paths[:3])
    return shown if len(paths) <= 3 else f"{shown} and {len(paths) - 3} more"


def _data_of(verdict_: Verdict) -> dict[str, Any]:
    steps = [
        {"text": step.text, "path": step.path, "active": list(step.active), "under_way": list(step.under_way)}
        for step in verdict_.steps
    ]
    return {
        "holds": verdict_.holds,
        "method": verdict_.method,
        "states": verdict_.states,
        "steps": steps,
        "why": verdict_.why,
        "given": list(verdict_.given),
    }


def data_of_region(region: Region) -> dict[str, Any]:
    """Return a region as plain data."""
    return {
        "nodes": list(region.nodes),
        "begins": region.begins,
        "at_most_one": _data_of(region.at_most_one),
        "exactly_one": _data_of(region.exactly_one),
        "states": region.states,
        "is_complete": region.is_complete,
        "unproved": region.unproved,
    }


def data_of_fact(fact: StatedFact) -> dict[str, Any]:
    """Return a stated fact as plain data."""
    return {"fact": fact.fact, "without_it": None if fact.verdict is None else _data_of(fact.verdict)}


def lines_of_fact(fact: StatedFact) -> list[str]:
    """Say what is known of a stated fact."""
    one = fact.verdict
    if one is None:
        return [f"stated: {fact.fact}: not used, since the analysis does not go there"]
    if one.holds:
        return [f"stated: {fact.fact}: follows from the graph by {one.method}"]
    if one.holds is None:
        return [f"stated: {fact.fact}: taken for granted"]
    return [
        f"stated: {fact.fact}: taken for granted, although edges and code may allow these steps:",
        *(f"    {number}. {step.text}" for number, step in enumerate(one.steps, 1)),
    ]

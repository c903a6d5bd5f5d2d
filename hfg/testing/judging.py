"""Run a graph under monitors: what a property test needs, with or without Hypothesis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import hfg
from hfg.errors import MonitorViolated, UsageError
from hfg.graph import Graph
from hfg.monitors import Property, parse, watch
from hfg.monitors.watching import monitors_of

__all__ = ["judge_run", "properties_of", "violated_in"]


def judge_run(
    graph: Graph,
    monitors: Mapping[str, Property | str] | None = None,
    *,
    until_s: float | None = None,
    policy: str | None = None,
    seed: int | None = None,
    debug: bool = True,
) -> hfg.Report:
    """Run a graph in virtual time, and fail if a monitor is violated.

    In a test by Hypothesis build the graph from what is given: a violation is then found with the smallest example, and
    the error has the stretch that shows it.

    Args:
      graph: the graph. The monitors that it declares judge it, too, whatever they say about `on_violation`.
      monitors: further ones, by name: properties, or their texts.
      until_s: end the run at this time.
      policy: who is next in all groups, see `hfg.run`.
      seed: for policy "random".
      debug: check values against types, and that shared ones are not modified.

    Returns:
      The report of the run.

    Raises:
      MonitorViolated: a monitor is violated; the message has the stretch of points that shows it.
      RunError: the run failed.
      UsageError: something is not a property.

    Examples:
      >>> from hfg.testing.nodes import script, sink
      >>> graph = Graph()
      >>> edge = graph.add(script()) >> graph.add(sink())
      >>> judge_run(graph, {"sound": "never(sent(script.out, value == -1))"}).outcome
      'done'
    """
    if not isinstance(graph, Graph):
        raise UsageError(f"judge_run takes a graph, got {graph!r:.80}: call the function that builds it")
    properties = properties_of(monitors)
    runs: list[hfg.Run] = []

    def begin(run: hfg.Run) -> None:
        runs.append(run)
        if properties:
            watch(run, on_violation="note", **properties)

    options: dict[str, Any] = {"policy": policy, "seed": seed, "until_s": until_s, "debug": debug}
    report = hfg.run(graph, clock="virtual", begin=begin, **options)
    violated = violated_in(runs[0])
    if violated:
        raise MonitorViolated("\n".join(violated))
    return report


def properties_of(monitors: Mapping[str, Property | str] | None) -> dict[str, Property]:
    """Return properties, read from text where they are given so.

    Raises:
      UsageError: one is not a property; the message names it.
    """
    if monitors is not None and not isinstance(monitors, Mapping):
        raise UsageError(
            f'monitors= has properties by name, {{"dark": never(...)}}, got {monitors!r:.80}: give each a name'
        )
    found = {}
    for name, given in (monitors or {}).items():
        try:
            what = parse(given) if isinstance(given, str) else given
        except UsageError as error:
            raise UsageError(f'monitor "{name}": {error}') from None
        if not isinstance(what, Property):
            raise UsageError(
                f'monitor "{name}" needs a property, such as never(formula), or its text, got {given!r:.80}'
            )
        found[str(name)] = what
    return found


def violated_in(run: hfg.Run) -> list[str]:
    """Return what the monitors of a run have found, a text for each that is violated or judges nothing any more."""
    found = []
    for monitors in monitors_of(run):
        found += monitors.unknown()
        first = {violation.monitor: violation for violation in reversed(monitors.violations)}
        found += [
            f"{violation}" + (f"\n(and {more:,} more of this monitor)" if (more := monitors.counts[name] - 1) else "")
            for name, violation in reversed(first.items())
        ]
    return found

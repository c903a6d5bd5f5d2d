"""What can be compared of two runs that nobody traces: each call of a node's code, with all that the code can see.

The same notes are taken of fused runs, of interpreted runs, and of the oracle, which runs the same code.
"""

from __future__ import annotations

import asyncio
import inspect
import re
import threading
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest

import hfg
from hfg.base.token import Token
from hfg.engine.model.records import Counts
from hfg.testing.conformance import value_key
from hfg.testing.plans import GraphPlan
from hfg.testing.recording import Recorder
from hfg.trace import TokenSent

__all__ = ["Calls", "Ran", "begun", "by_node", "note_calls", "noted_run", "passed_by_trace"]

_PLACE = re.compile(r" at 0x[0-9a-f]+")  # in memory, where each run has its own

Note = tuple[Any, ...]
"""The path of the node, what was called, what it was given, and what else its code could see."""

Passed = dict[str, list[tuple[Any, ...]]]
"""By edge what passed it, in order: value, modifier, stamp, number."""


class Calls(list[Note]):
    """Each call of a node's code on the loop, in order, and the end of each that has waited.

    Attributes:
      aside: the same of code in threads, by node: between those there is no order.
      timed: the time is part of a note; not on the real clock.
      fused: how many firings and calls were part of a fused wave.
      may_fuse: how many there were in runs that nobody traces, and that may fuse.
    """

    def __init__(self) -> None:
        self.aside: dict[str, list[Note]] = {}
        self.timed = True
        self.fused = 0
        self.may_fuse = 0

    @property
    def share(self) -> float:
        """Of all firings and calls that may be fused, so many were."""
        return self.fused / max(1, self.may_fuse)

    def note(self, node: Any, what: str, given: object) -> None:
        """Something of the node's code begins or ends."""
        seen = (round(hfg.elapsed(), 7),) if self.timed else ()
        note = (str(node.place.path), what, self._told(given), node.active, *seen)
        if threading.current_thread() is threading.main_thread():
            self.append(note)
        else:
            self.aside.setdefault(note[0], []).append(note)

    def take(self) -> tuple[list[Note], dict[str, list[Note]]]:
        """What was noted since the last time."""
        taken = list(self), self.aside
        self.clear()
        self.aside = {}
        return taken

    def _told(self, given: object) -> str:
        """What the code was given, of tokens everything; but for stamps on the real clock."""
        if type(given) is tuple:
            return repr([self._told(one) for one in given])
        if type(given) is Token:
            stamp = given.stamp if self.timed else None
            return repr((value_key(given.value), given.activity, given.sequence, stamp))
        return repr(value_key(given))


def note_calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    """Have every call of the code of every node noted from now on."""
    calls = Calls()
    process_call, handler = hfg.Node._process_call, hfg.Node._handler

    def noted(node: Any, what: str, call: Callable[..., Any], *, is_async: bool) -> Callable[..., Any]:
        """As async as the code itself, because the engine asks."""

        async def to_its_end(*arguments: Any) -> Any:
            calls.note(node, what, arguments)
            result = await call(*arguments)
            calls.note(node, f"{what} ends", result)
            return result

        def called(*arguments: Any) -> Any:
            calls.note(node, what, arguments)
            return call(*arguments)

        return to_its_end if is_async else called

    def noted_process(self: Any) -> Callable[..., Any]:
        call = process_call(self)
        if self._type.process_kind == "generator":

            def draw(*arguments: Any) -> Iterator[Any]:
                values = iter(call(*arguments))
                while True:
                    calls.note(self, "next", ())
                    try:
                        value = next(values)
                    except StopIteration:
                        return
                    yield value

            return draw

        return noted(self, "process", call, is_async=self._type.process_kind == "async")

    def noted_handler(self: Any, name: str) -> Callable[..., Any] | None:
        call = handler(self, name)
        return call and noted(self, name, call, is_async=inspect.iscoroutinefunction(call))

    monkeypatch.setattr(hfg.Node, "_process_call", noted_process)
    monkeypatch.setattr(hfg.Node, "_handler", noted_handler)
    _count_fused(monkeypatch, calls)
    return calls


def _count_fused(monkeypatch: pytest.MonkeyPatch, calls: Calls) -> None:
    """Count what regions do from now on."""
    add_firings, add_calls = Counts.add_firings, Counts.add_calls

    def fired(self: Counts, times: int, silently: int = 0) -> None:
        calls.fused += times
        add_firings(self, times, silently)

    def called(self: Counts, times: int) -> None:
        calls.fused += times
        add_calls(self, times)

    monkeypatch.setattr(Counts, "add_firings", fired)
    monkeypatch.setattr(Counts, "add_calls", called)


class Ran(NamedTuple):
    """What is known of a run behind its end.

    Attributes:
      report: its counts, and which nodes are active; without what the machine's speed has to do with.
      error: what it failed with.
      calls: each call of a node's code, in order; those of threads by node.
      passed: what taps saw on each edge, if there were any.
    """

    report: hfg.Report
    error: str
    calls: tuple[list[Note], dict[str, list[Note]]]
    passed: Passed


def noted_run(
    calls: Calls,
    plan: GraphPlan,
    *,
    fast: bool,
    trace: Recorder | None = None,
    tapped: bool = False,
    measured: bool = False,
    real: bool = False,
) -> Ran:
    """Run a plan and note what it does.

    Args:
      calls: where calls are noted.
      plan: what to run.
      fast: fuse.
      trace: who listens.
      tapped: look at every edge.
      measured: have every call measured.
      real: on the real clock.
    """
    taps: dict[str, Any] = {}

    def begin(run: Any) -> None:
        for edge in run._engine.core.edges if tapped else ():
            taps[edge.label] = run.tap(edge, size=100_000)
        if measured:
            run.statistics()

    calls.take()
    calls.timed = not real
    error = ""
    try:
        clock: Any = "real" if real else "virtual"
        report = hfg.run(plan.build(), clock=clock, fast=fast, trace=trace, until_s=30.0, begin=begin)
    except hfg.errors.RunError as problem:
        report, error = problem.report, str(problem)  # type: ignore[attr-defined]
    if fast and trace is None:
        calls.may_fuse += sum(node.firings + node.calls for node in report.nodes.values())
    told = {"duration_s": 0.0 if real else report.duration_s, "errors": [_PLACE.sub("", one) for one in report.errors]}
    report, error = hfg.Report(**{**_fields(report), **told}), _PLACE.sub("", error)
    return Ran(report, error, calls.take(), asyncio.run(_passed(taps)) if tapped else {})


async def _passed(taps: dict[str, Any]) -> Passed:
    """What the taps of a run that is over have kept."""
    return {label: [_token(token) async for token in tap] for label, tap in taps.items()}


def _fields(report: hfg.Report) -> dict[str, Any]:
    return {name: getattr(report, name) for name in report.__struct_fields__}


def _token(token: Token[Any]) -> tuple[Any, ...]:
    return value_key(token.value), token.activity, token.stamp, token.sequence


def passed_by_trace(trace: Recorder) -> Passed:
    """What a trace says of the same."""
    found: Passed = {}
    for event in trace.of(TokenSent):
        found.setdefault(event.edge, []).append(_token(event.token))
    return found


def by_node(calls: list[Note], aside: dict[str, list[Note]]) -> dict[str, list[Note]]:
    """The notes of each node, in order."""
    found = {path: list(given) for path, given in aside.items()}
    for note in calls:
        found.setdefault(note[0], []).append(note)
    return found


def begun(calls: list[Note]) -> list[Note]:
    """Those that tell of a call, not of the end of one."""
    return [note for note in calls if not note[1].endswith(" ends")]

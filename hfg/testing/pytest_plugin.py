"""Fixtures and marks for pytest; loaded by itself where hfg is installed.

virtual_time   runs a coroutine in a loop whose time jumps to the next timer
run_graph      runs a graph in virtual time and gives report and trace
rule           a mark that names the rules a test checks: @pytest.mark.rule("F4")
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import pytest

if TYPE_CHECKING:  # a plugin must not import half of hfg before coverage is measured
    from hfg.engine import Report
    from hfg.graph import Graph
    from hfg.testing.recording import Recorder

__all__ = ["Ran", "pytest_configure", "run_graph", "virtual_time"]

T = TypeVar("T")


@dataclass(frozen=True)
class Ran:
    """A run that is over: its report, or the error that ended it, and its trace."""

    report: Report | None
    trace: Recorder
    error: Exception | None = None


def pytest_configure(config: pytest.Config) -> None:
    """Make the mark known."""
    config.addinivalue_line("markers", "rule(*numbers): the rules of docs/semantics.md that the test checks")


@pytest.fixture
def virtual_time() -> Callable[[Coroutine[Any, Any, T]], T]:
    """Return a function that runs a coroutine to its end in virtual time: hours of sleep take no time."""

    def run(main: Coroutine[Any, Any, T]) -> T:
        import hfg

        with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
            return runner.run(main)

    return run


@pytest.fixture
def run_graph() -> Callable[..., Ran]:
    """Return a function that runs a graph in virtual time, with the arguments of `hfg.run`; errors are reported.

    In debug mode, unless set otherwise: values match the types of their ports, and shared ones are not changed.
    """

    def run(graph: Graph, *, debug: bool = True, **options: Any) -> Ran:
        import hfg
        from hfg.testing.recording import Recorder

        trace = Recorder()
        try:
            return Ran(hfg.run(graph, clock="virtual", trace=trace, debug=debug, **options), trace)
        except hfg.errors.RunError as error:
            return Ran(None, trace, error)

    return run

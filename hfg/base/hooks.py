"""Functions that a lower layer calls and only an upper layer can provide.

`hfg.composing` provides them when hfg is imported. Depends on nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any


class _Hooks:
    """The functions by name; the ones they stand for are documented there.

    Attributes:
      record: `hfg.recording.record`, for `Run.record`.
      report_page: `hfg.reporting.report_page`, for `Run.report_page`.
      distribute: `hfg.parts.distribution.distribute`, for runs with groups in other processes.
      studio: `hfg.studio.notebook.serve_run`, for `Run.studio`.
      foxglove: `hfg.viewers.foxglove.serve_run`, for `Run.foxglove`.
      visit_studio: `hfg.studio.local.visit`, for other programs of the same user that steer a run.
      refusal: why a graph file may not name these references of node types and operators, references in values, or
        types, given which packages are allowed in addition; None if it may.
      states: the state diagram of a graph, as a graph that is drawn.
      judge: `hfg.monitors.judging.judge`, which begins to judge a run by the monitors and facts of its graph.
      add_checks: adds the checks of graphs that upper layers have, once.
    """

    record: Callable[..., Any]
    report_page: Callable[..., Any]
    distribute: Callable[..., Any]
    studio: Callable[..., Any]
    foxglove: Callable[..., Any]
    visit_studio: Callable[..., Any]
    refusal: Callable[[Iterable[str], Iterable[str], Iterable[str], Iterable[str]], str | None]
    states: Callable[[Any], Any]
    add_checks: Callable[[], None]
    judge: Callable[[Any, Any], None]


hooks = _Hooks()

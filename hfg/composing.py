"""Functions of a higher layer that a lower layer calls: registered here, imported on first use.

`import hfg` imports this module, so it must not import much. Depends on `hooks`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hfg.base.hooks import hooks

if TYPE_CHECKING:
    from hfg.engine import Run
    from hfg.graph import Graph
    from hfg.graph.flat import FlatGraph
    from hfg.graph.structure.level import Whole
    from hfg.parts.distribution import Distribution

__all__: list[str] = []


def _record(*arguments: Any, **options: Any) -> Any:
    """Implement `Run.record`, which has the types; its dependencies are imported only if a run is recorded."""
    from hfg.recording import record

    return record(*arguments, **options)


def _report_page(*arguments: Any, **options: Any) -> Any:
    """Implement `Run.report_page` in the same way."""
    from hfg.reporting import report_page

    return report_page(*arguments, **options)


def _distribute(
    graph: Graph, flat: FlatGraph, options: Mapping[str, Any], virtual: bool, settings: str | None
) -> Distribution:
    """Implement `hooks.distribute`; its dependencies are imported only if there are processes."""
    from hfg.parts.distribution import distribute

    return distribute(graph, flat, options, virtual=virtual, settings=settings)


def _studio(*arguments: Any, **options: Any) -> Any:
    """Implement `Run.studio`; its dependencies are an extra, and imported only if it is used."""
    from hfg.errors import UsageError

    try:
        from hfg.studio.notebook import serve_run
    except ImportError as error:
        raise UsageError(f'the studio needs {error.name}: pip install "hfg[studio]"') from None
    return serve_run(*arguments, **options)


def _foxglove(*arguments: Any, **options: Any) -> Any:
    """Implement `Run.foxglove` in the same way."""
    from hfg.errors import UsageError

    try:
        from hfg.viewers.foxglove import serve_run
    except ImportError as error:
        raise UsageError(f'viewers need {error.name}: pip install "hfg[studio]"') from None
    return serve_run(*arguments, **options)


def _visit_studio(door: Any, transport: Any) -> Any:
    """Implement `hooks.visit_studio`; its dependencies are imported only if another program steers the run."""
    from hfg.studio.local import visit

    return visit(door, transport)


def _refusal(
    references: Iterable[str], values: Iterable[str], types: Iterable[str], allow: Iterable[str]
) -> str | None:
    """Implement `hooks.refusal`: return why a graph file in the working directory could not use these."""
    from hfg.encoding import find_reference
    from hfg.errors import EncodingError
    from hfg.files.allowed import Allowed
    from hfg.files.boxes import file_of

    allowed = Allowed(Path("commands").absolute(), allow, 'hfg.commands.decode(..., allow=["{top}"])')

    def of_node(reference: str) -> str | None:
        file = file_of(reference)  # commands have no other name for a file that is included
        if file is not None and file.is_absolute() and file.resolve().is_relative_to(allowed.project):
            return None
        return allowed.refusal_of_reference(reference)

    def of_value(reference: str) -> str | None:
        why = allowed.refusal_of_reference(reference)
        if why is not None:
            return why
        try:
            return allowed.refusal_of_value(reference, find_reference(reference))
        except EncodingError:
            return None  # there is no such file, which is reported where it is used

    found = itertools.chain(map(of_node, references), map(of_value, values), map(allowed.refusal_of_type, types))
    return next(filter(None, found), None)


def _add_checks() -> None:
    """Implement `hooks.add_checks`: the module adds its own when it is imported."""
    import hfg.analysis.checks  # noqa: F401


def _states(graph: Any) -> Any:
    """Implement `hooks.states`."""
    from hfg.analysis import analyse_activity

    return analyse_activity(graph).diagram().graph()


def _judge(run: Run, whole: Whole) -> None:
    """Implement `hooks.judge`; its code is imported only if there is something to judge by, now or after an edit."""

    def judge() -> None:
        from hfg.monitors.judging import judge

        judge(run, whole)

    if whole.monitors or whole.facts:
        judge()
    else:
        whole.on_laws = judge


hooks.add_checks = _add_checks
hooks.judge = _judge
hooks.states = _states
hooks.refusal = _refusal
hooks.distribute = _distribute
hooks.studio = _studio
hooks.foxglove = _foxglove
hooks.visit_studio = _visit_studio
hooks.record = _record
hooks.report_page = _report_page

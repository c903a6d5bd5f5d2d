"""The monitors that a graph declares: what must hold of each of its runs. They belong to the whole graph.

Their paths begin at the outermost graph. Depends on `level`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from hfg.base.controls import name_problem
from hfg.errors import GraphError, UsageError
from hfg.graph.structure.level import Level
from hfg.graph.structure.option import refuse_values, unknown
from hfg.graph.structure.options import MonitorFields, MonitorSpec
from hfg.graph.structure.refusals import Refusable
from hfg.monitors.parsing import parse
from hfg.monitors.properties import Property

MOST_MONITORS: Final = 1_000
"""The history of edits keeps all monitors for each that was declared, and a file may hold many (rule L4)."""


def with_monitor(known: Mapping[str, MonitorSpec], spec: MonitorSpec) -> Mapping[str, MonitorSpec]:
    """Return monitors and one more, or another in the place of one of them.

    Raises:
      GraphError: they are too many.
    """
    if len(known) >= MOST_MONITORS and spec.name not in known:
        raise GraphError(
            f'monitor "{spec.name}": the graph declares {MOST_MONITORS:,} monitors already, as many as are allowed; '
            "join formulas with &, or call monitors.watch(run, ...)"
        )
    return {**known, spec.name: spec}


def monitor_spec(name: str, property_: object, given: Mapping[str, Any]) -> MonitorSpec:
    """Check a monitor.

    Args:
      name: for people.
      property_: what must hold, or its text.
      given: its options.

    Raises:
      GraphError: the property or an option is wrong; the message says where.
    """
    if type(name) is not str or not name:
        raise GraphError(f"a monitor needs a name, got {name!r}")
    problem = name_problem(name)
    if problem is not None:
        raise GraphError(f"a monitor {problem}")
    at = f'monitor "{name}"'
    if (wrong := unknown(MonitorFields, given, "graph.monitor")) is not None:
        raise GraphError(f"{at}: {wrong}")
    refuse_values(MonitorFields, at, given, GraphError)
    if isinstance(property_, str):
        try:
            property_ = parse(property_)
        except UsageError as error:
            raise GraphError(f"{at}: {error}") from error
    if not isinstance(property_, Property):
        raise GraphError(
            f"{at} needs a property, such as always(formula) or never(formula), or its text, got {property_!r:.80}"
        )
    return MonitorSpec(name=name, property=property_, **given)


def declare_monitor(level: Level, name: str, property_: object, given: Mapping[str, Any]) -> MonitorSpec | None:
    """Declare a monitor of the whole graph; declaring the same again is allowed.

    Raises:
      GraphError: it is wrong, or another one of this name is declared.
    """
    level.need_rest("declaring a monitor")
    with Refusable(name):
        spec = monitor_spec(name, property_, given)
        known = level.whole.monitors.get(name)
        if known is not None and known != spec:
            raise GraphError(
                f'monitor "{name}" is declared already, as {known.property}; declare it once, or choose another name'
            )
        level.whole.set_monitors(with_monitor(level.whole.monitors, spec))
        return spec
    return None


def moved_monitor(spec: MonitorSpec, to: Callable[[str], str]) -> MonitorSpec:
    """Return the same monitor where nodes have other paths: `to` gives that of each."""

    def moved(path: str) -> str:
        node = node_part(path)
        return to(node) + path[len(node) :]

    triggers = moved(spec.triggers) if spec.triggers else ""
    return MonitorSpec(
        name=spec.name, property=spec.property.moved(moved), on_violation=spec.on_violation, triggers=triggers
    )


def node_part(path: str) -> str:
    """Return the path of the node of a port; "" for a port of the whole graph, and a node for itself."""
    dot = path.find(".", path.rfind("/") + 1)
    return path if dot < 0 else path[:dot]

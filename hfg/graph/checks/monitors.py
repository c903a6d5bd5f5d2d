"""Monitors that cannot judge: what they name is not there."""

from __future__ import annotations

from collections.abc import Iterator

from hfg.errors import GraphError, Problem
from hfg.graph.flat.flat_graph import FlatGraph
from hfg.graph.structure.level import Level
from hfg.graph.structure.options import MonitorSpec
from hfg.graph.structure.paths import find
from hfg.monitors.formulas import Sent
from hfg.nodetypes.node import Node
from hfg.ports import Port
from hfg.types import why_not


def monitors(flat: FlatGraph) -> Iterator[Problem]:
    """Find monitors that name what is not there."""
    whole = flat.level.whole
    if flat.level.owner is not None or not whole.monitors:
        return
    for spec in whole.monitors.values():
        wrong = _unfound(flat.level, spec)
        if wrong is not None:
            yield _problem(spec, wrong, "correct the path, or remove the monitor")


def _unfound(level: Level, spec: MonitorSpec) -> str | None:
    """Return what of the paths of a monitor is wrong; None if nothing is."""
    try:
        for atom in spec.property.atoms():
            path = atom.port if isinstance(atom, Sent) else atom.node
            found = find(level, path)
            if isinstance(atom, Sent) == isinstance(found, Node):
                return f'"{path}" is {"a node: sent() takes a port" if isinstance(found, Node) else "no node"}'
            if isinstance(atom, Sent) and not isinstance(getattr(found, "node", None), Node):
                return f'"{path}" is a port of the whole graph: name the port of a node that is connected to it'
        return _untriggered(level, spec.triggers) if spec.triggers else None
    except GraphError as error:
        return str(error).partition(";")[0]


def _untriggered(level: Level, path: str) -> str | None:
    port = find(level, path)
    if not isinstance(port, Port) or port.kind not in ("slot", "event"):
        return f'"{path}", which it triggers, is neither a slot nor an event'
    reason = None if port.type in (None, type(None)) else why_not(str, port.type)
    if reason is not None:
        return f'"{path}" cannot be given a text, which says what was violated ({reason})'
    return None


def _problem(spec: MonitorSpec, what: str, remedy: str) -> Problem:
    return Problem(
        path=f"monitors.{spec.name}",
        severity="error",
        what=what,
        why="a monitor judges what happens at the nodes and ports that it names, in the order in which it happens",
        remedy=remedy,
        check="monitor",
    )

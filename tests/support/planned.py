"""The plan of a run as data, to compare one that was edited with one that is made afresh (rule R4)."""

from __future__ import annotations

from typing import Any

from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.settings import Settings
from hfg.graph.flat import flatten

__all__ = ["planned", "planned_afresh"]


def planned_afresh(engine: Any) -> dict[str, Any]:
    """Give the plan that a new run of the same graph would have; inside a running loop."""
    fresh = Engine(flatten(engine.graph), Settings())
    return planned(fresh)


def planned(engine: Any) -> dict[str, Any]:
    """Give all of a plan that does not depend on what the run has done."""
    core = engine.core
    workers = [worker for worker in core.workers if worker.node is not None or _edges(worker)]
    return {
        "workers": {_name(worker, number): _worker(worker, core) for number, worker in enumerate(workers)},
        "edges": [_edge(edge) for edge in core.edges if edge not in core.outside.values()],
        "in order": [
            [one.index for one in listed] == sorted(one.index for one in listed) for listed in (core.edges, core.scopes)
        ],
        "scopes": [
            (
                scope.path,
                scope.parent and scope.parent.path,
                [child.path for child in scope.children],
                [member.path for member in scope.members],
                scope.worker.path,
                id(scope.worker.node),
                [around.path for around in scope.worker.around],
            )
            for scope in core.scopes
        ],
        "paths": sorted((path, id(worker.node)) for path, worker in core.by_path.items()),
        "sources": [worker.path for worker in core.sources],
    }


def _name(worker: Any, number: int) -> str:
    """Those who stand for ports of the graph, or of what iterates, are in no order."""
    if worker.node is not None:
        return f"{worker.path} {number}"
    around = "" if worker.within is None else worker.within.worker.path
    return f"{around}.{worker.port_name} {'in' if worker.is_boundary_output else 'out'}"


def _edges(worker: Any) -> list[Any]:
    return [*worker.edges_in(), *worker.all_out_edges()]


def _worker(worker: Any, core: Any) -> dict[str, Any]:
    outside = core.outside.values()
    return {
        "node": id(worker.node) if worker.node is not None else None,
        "type": worker.type and id(worker.type),
        "group": worker.group.name,
        "options": worker.options,
        "in": [edge.label for edge in worker.in_edges],
        "slots": sorted(edge.label for edge in worker.slot_edges if edge not in outside),
        "out": [[edge.label for edge in edges] for edges in worker.wired_out],
        "names": worker.out_names,
        "events": {
            name: [edge.label for edge in event.edges] for name, event in sorted(worker.events.items()) if event.edges
        },
        "mandatory": worker.mandatory_ports,
        "kind": (worker.is_source, worker.is_async, worker.silent_code, worker.paced, worker.is_boundary_output),
        "around": [scope.path for scope in worker.around],
        "within": worker.within and worker.within.worker.path,
        "gates": [(getattr(gate.state, "path", ""), gate.idle_rate_hz) for gate in worker.gates_over],
        "state of": sorted(one.path for gate in worker.gates for one in gate.workers),
        "handlers": sorted({edge.port_name for edge in worker.slot_edges} & set(worker.handlers)),
    }


def _edge(edge: Any) -> tuple[Any, ...]:
    return (
        type(edge).__name__,
        edge.label,
        [one.label for one in edge.segments],
        (id(edge.source_port), id(edge.target_port)),
        edge.active,
        edge.target_kind,
        edge.port_name,
        edge.position,
        edge.mandatory,
        getattr(edge, "sequential", None),
        getattr(edge, "initial", None),
        getattr(edge, "room", None),
        getattr(edge, "overflow", None),
        getattr(edge, "capacity_limit", None),
        [scope.path for scope in edge.via],
        (edge.source.path, edge.source.port_name, edge.target.path, edge.target.port_name),
    )

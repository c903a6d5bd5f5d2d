"""Random commands, and what a drawn graph is made of, for tests of edits (rule R4).

Commands are mostly ones that are carried out; some are refused, as those of people are. Stands on `making`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.graph import Graph, NodeGiven
from hfg.graph import commands as c
from hfg.graph.structure.level import level_of
from hfg.testing.making import Chooser

__all__ = ["drawn", "random_command", "random_edit"]

_TYPES = ("double", "add", "some", "sink", "Passing", "Merge", "Latch", "Counter", "Pulse", "Tally", "Sieve", "Scaled")


def drawn(graph: Graph, *, identity: bool = True) -> dict[str, Any]:
    """Give all that a drawn graph is made of, in order, as data that can be compared.

    Args:
      graph: the whole graph, or the inside of a subgraph.
      identity: whether the nodes and ports themselves must be the same, or only what they are called.
    """
    level = level_of(graph)
    level.check_invariants()
    return {
        "nodes": {
            name: {
                "node": id(node) if identity else node._type.reference,
                "path": node.place.path,
                "options": node._options,
                "parameters": dict(node._parameters),
                "inside": drawn(node._graph, identity=identity) if hasattr(node, "_graph") else None,
            }
            for name, node in graph.nodes.items()
        },
        "order": list(graph.nodes),
        "edges": [
            (edge.label, edge.options, *((id(edge.source), id(edge.target)) if identity else ()))
            for edge in graph.edges
        ],
        "into": sorted(f"{target.path} <- {edge.label}" for target, edge in level.connections.into.items()),
        "pairs": sorted((_path(source), _path(target)) for source, target in level.connections.pairs),
        "gates": [(gate.target.place.path, gate.by.place.path, gate.idle_rate_hz) for gate in graph.gates],
        "groups": dict(graph.groups) if level.owner is None else {},
        "ports": [(port.path, port.kind, port.type) for port in (*graph.inputs.values(), *graph.outputs.values())],
        "notes": {path: graph.notes(path) for path in ("", *(node.place.path for node in _all_nodes(graph)))}
        if level.owner is None
        else {},
        "promoted": {name: [port.path for port in ports] for name, ports in level.promotions.by_name.items()},
        "gated": sorted(node.place.path for node in level.whole.gated if node._place is not None)
        if level.owner is None
        else (),
    }


def _path(end: Any) -> str:
    return str(getattr(end, "path", "observable"))


def random_edit(graph: Graph, choose: Chooser, number: int) -> list[c.Command]:
    """Give one command, sometimes two as one transaction."""
    commands = [random_command(graph, choose, f"e{number}")]
    if choose.chance(15):
        commands.append(random_command(graph, choose, f"f{number}"))
    if choose.chance(10):
        commands += _talker(graph, choose, f"t{number}")
    return commands


def _talker(graph: Graph, choose: Chooser, name: str) -> list[c.Command]:
    """Return the commands that add a node whose task speaks from `setup()` on, while this edit may still wait."""
    parameters = {
        "period_s": choose.one_of((0.0, 0.001, 0.002, 0.005)),
        "count": choose.number(1, 5),
        "greets": choose.chance(30),
    }
    commands: list[c.Command] = [c.Add("tests.support.kinds:Watch", name, parameters, {})]
    slots = [port.path for node in graph.nodes.values() for port in node.ports.slots.values()]
    if slots and choose.chance(70):
        commands.append(c.Connect(f"{name}.tick", choose.one_of(slots), active=choose.chance(20)))
    return commands


def random_command(graph: Graph, choose: Chooser, name: str) -> c.Command:
    """Give one command about what there is.

    Args:
      graph: as it is now.
      choose: whoever chooses.
      name: of what is new.
    """
    nodes = [node.place.path for node in _all_nodes(graph)]
    if not nodes or choose.chance(12):
        return _add(graph, choose, name)
    node = choose.one_of(nodes)
    what = choose.number(0, 99)
    if what < 30:
        return _connect(graph, choose)
    if what < 45:
        return _about_an_edge(graph, choose) or _connect(graph, choose)
    if what < 53:
        return c.Remove(node)
    if what < 59:
        return c.Disable(node) if choose.chance(50) else c.Enable(node)
    if what < 65:
        return c.Copy(node, f"{node.rpartition('/')[0]}/{name}".lstrip("/"))
    if what < 71:
        return c.Rename(node, name)
    if what < 77:
        return _set_parameter(graph, choose) or c.Rename(node, name)
    if what < 85:
        beside = [one for one in nodes if one.rpartition("/")[0] == node.rpartition("/")[0]]
        return c.Enclose(
            tuple(dict.fromkeys([node, *(choose.one_of(beside) for _ in range(choose.number(0, 2)))])), name
        )
    if what < 92:
        boxes = [one.place.path for one in _all_nodes(graph) if hasattr(one, "_graph")]
        return c.Dissolve(choose.one_of(boxes)) if boxes else c.Rename(node, name)
    if what < 95:
        kind = graph[node]._type.reference if choose.chance(50) else None
        return c.Replace(node, kind or f"hfg.testing.nodes:{choose.one_of(_TYPES)}")
    if what < 97:
        if choose.chance(40):
            return c.Note(node, choose.one_of(("position", "text")), choose.one_of(([1, 2], "here", None)))
        return c.Move(node, choose.one_of([None, *graph.groups]))
    return _about_a_gate(graph, choose, node)


def _all_nodes(graph: Graph) -> list[Any]:
    found: list[Any] = []
    waiting = [graph]
    while waiting:
        for node in waiting.pop(0).nodes.values():
            found.append(node)
            if hasattr(node, "_graph"):
                waiting.append(node._graph)
    return found


def _add(graph: Graph, choose: Chooser, name: str) -> c.Command:
    boxes = ["", *(f"{node.place.path}/" for node in _all_nodes(graph) if hasattr(node, "_graph"))]
    kind = choose.one_of(_TYPES)
    options: NodeGiven = {"release": "pipelined"} if choose.chance(20) else {}
    if choose.chance(10):
        options["max_rate_hz"] = 70.0
    return c.Add(f"hfg.testing.nodes:{kind}", choose.one_of(boxes) + name, {}, options)


def _connect(graph: Graph, choose: Chooser) -> c.Command:
    around = choose.one_of([graph, *(node._graph for node in _all_nodes(graph) if hasattr(node, "_graph"))])
    nodes = list(around.nodes.values())
    if not nodes:
        return c.Connect("start", "stop")
    first, second = choose.one_of(nodes), choose.one_of(nodes)
    if choose.chance(80) and nodes.index(first) > nodes.index(second):
        first, second = second, first
    free = [port.path for port in second.ports.inputs.values() if port not in level_of(around).connections.into]
    targets = free + [port.path for port in second.ports.slots.values()] + [f"{second.place.path}.activate"]
    sources = [port.path for port in [*first.ports.outputs.values(), *first.ports.events.values()]]
    sources.append("start" if choose.chance(20) else f"{first.place.path}.processed")
    box = level_of(around).owner
    if box is not None:
        sources += [f"{port.path}.inner" for port in [*box.ports.inputs.values(), *box.ports.slots.values()]]
        targets += [f"{port.path}.inner" for port in [*box.ports.outputs.values(), *box.ports.events.values()]]
    source, target = choose.one_of(sources), choose.one_of(targets)
    data = target in free and source in [port.path for port in first.ports.outputs.values()]
    return c.Connect(
        source, target, active=choose.chance(30), buffer=choose.number(1, 2) if data and choose.chance(25) else 0
    )


def _about_an_edge(graph: Graph, choose: Chooser) -> c.Command | None:
    edges = [edge for level in _levels(graph) for edge in level.edges]
    if not edges:
        return None
    edge = choose.one_of(edges)
    source, target = _path(edge.source), _path(edge.target)
    if choose.chance(60):
        return c.Disconnect(source, target)
    if choose.chance(50):
        return c.MakeActive(source, target, not edge.active)
    if getattr(edge.source, "kind", "event") == "event":
        return choose.one_of(
            (
                c.SetEdge(source, target, capacity=choose.number(1, 4)),
                c.SetEdge(source, target, overflow=choose.one_of(("wait", "latest", "drop_oldest"))),
                c.SetEdge(source, target, active=not edge.active, overflow="wait", capacity_limit=40, through=()),
                c.SetEdge(source, target, through=(c.Operator("reactivex.operators:skip", (1,)),)),
            )
        )
    return c.SetEdge(source, target, buffer=choose.number(0, 2), active=not edge.active)


def _about_a_gate(graph: Graph, choose: Chooser, node: str) -> c.Command:
    gated = [gate.target.place.path for level in _levels(graph) for gate in level.gates]
    if gated and choose.chance(40):
        return c.Ungate(choose.one_of(gated))
    by = choose.one_of([one.place.path for one in _all_nodes(graph)])
    return c.Gate(node, by, choose.one_of([None, None, 200.0]))


def _levels(graph: Graph) -> Sequence[Graph]:
    return [graph, *(node._graph for node in _all_nodes(graph) if hasattr(node, "_graph"))]


def _set_parameter(graph: Graph, choose: Chooser) -> c.Command | None:
    parameters = [port for node in _all_nodes(graph) for port in node.ports.parameters.values()]
    numbers = [port for port in parameters if port.type in (int, float)]
    return c.SetParameter(choose.one_of(numbers).path, choose.number(1, 4)) if numbers else None

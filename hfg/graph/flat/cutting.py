"""A flat graph cut into the parts that run in processes of their own (rule L1): plain data, like what it is made of.

A group with a process is a part; all other nodes, and the graph's own ports, are the main part. An edge between two
parts appears in both: in the first it ends at an `End` that stands for the link, in the second it begins at one, and a
`CutEdge` says what the two have in common. Everything keeps its path, its label and its number, so that whoever
watches a part finds what he knows of the whole. Depends on `flat_graph`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final, Literal, Unpack

import msgspec

from hfg.errors import Problem
from hfg.graph.flat.flat_graph import LINK, ROOT, End, FlatEdge, FlatGate, FlatGraph, FlatNode, Scope, scope_end
from hfg.graph.structure.options import EdgeGiven, GroupSpec

MAIN: Final = ""
"""The part that runs where the graph is run."""

DEFAULT_WINDOW: Final = 8
"""How many tokens may be under way over a synchronous edge between processes, where nobody says `buffer` (rule L1)."""


class CutEdge(msgspec.Struct, frozen=True, eq=False):
    """An edge whose ends are in two parts.

    Attributes:
      label: of the edge; no other has it.
      edge: as it is in the whole graph.
      source, target: the parts of its ends.
      guarantee: "exact" for whatever may lose nothing, "bounded" for signals with a policy that drops.
      window: maximum number of tokens in progress, if none may be lost.
      hint: the declared type of what it carries.
      within_host: whether both ends are on one host.
      number: among those of the cutting, by their labels: it stays the same as long as they do.
    """

    label: str
    edge: FlatEdge
    source: str
    target: str
    guarantee: Literal["exact", "bounded"]
    window: int
    hint: Any
    within_host: bool = True
    number: int = 0


class Cutting(msgspec.Struct, frozen=True, eq=False):
    """A graph in parts.

    Attributes:
      parts: flat graphs by name of the group, the main part first; those in which no node runs are not there.
      edges: between them, in order of connecting.
      findings: what cannot be cut so; errors.
    """

    parts: dict[str, FlatGraph]
    edges: list[CutEdge]
    findings: list[Problem]

    def edges_of(self, part: str) -> Iterator[CutEdge]:
        """Return those with an end in a part."""
        return (edge for edge in self.edges if part in (edge.source, edge.target))


def cut(flat: FlatGraph) -> Cutting:
    """Cut a graph where its groups say so; the graph stays as it is."""
    return _Cutter(flat).cutting()


def _part_of(group: GroupSpec | None) -> str:
    """Return the part in which the nodes of a group run."""
    return group.name if group is not None and group.process else MAIN


class _Cutter:
    def __init__(self, flat: FlatGraph) -> None:
        self.flat = flat
        self.findings: list[Problem] = []
        self.home = [self._part(flat.groups, node) for node in flat.nodes]
        self.scope_home = [self._home_of_scope(scope) for scope in flat.scopes]
        self.edges: list[CutEdge] = []

    def cutting(self) -> Cutting:
        names = dict.fromkeys([MAIN, *self.home])
        made = {name: _Part(self.flat, [home == name for home in self.home]) for name in names}
        for edge in self.flat.edges:
            source, target = self._end_home(edge.source, edge), self._end_home(edge.target, edge)
            if source is None or target is None:
                continue
            if source == target:
                made[source].add(edge, edge.source, edge.target)
                continue
            self._cross(edge, source, target, made)
        for gate in self.flat.gates:
            by, target = self._gate_home(gate.by), self._gate_home(gate.target)
            if by is None or by != target:
                self._wrong(
                    self._name(gate.target),
                    f'it is gated by "{self._name(gate.by)}", and the two are in different processes',
                    "a gate looks at activity at once (rule A11), which nobody can over a link",
                    "let both run in one group, or connect activity to the node instead of gating it",
                )
                continue
            made[by].add_gate(gate)
        return Cutting({name: part.flat for name, part in made.items()}, self._numbered(), self.findings)

    def _numbered(self) -> list[CutEdge]:
        numbers = {label: number for number, label in enumerate(sorted(edge.label for edge in self.edges))}
        return [msgspec.structs.replace(edge, number=numbers[edge.label]) for edge in self.edges]

    # --- who is where ---

    def _part(self, groups: Mapping[str, GroupSpec], node: FlatNode) -> str:
        home = _part_of(groups.get(node.options.group or "loop"))
        for inner in node.iteration.walk() if node.iteration is not None else ():
            for one in inner.nodes:
                if _part_of(groups.get(one.options.group or "loop")) != home:
                    self._wrong(
                        one.path,
                        f'it runs in group "{one.options.group}", inside of "{node.path}", which iterates elsewhere',
                        "what iterates is one node, and runs in one process (rule G4)",
                        "give the whole subgraph the group, or none inside of it",
                    )
        return home

    def _home_of_scope(self, scope: Scope) -> str | None:
        """Return the part that contains all of a subgraph; None if it is divided."""
        homes = {self.home[member] for member in scope.members}
        if len(homes) == 1:
            return homes.pop()
        if not homes:
            home = _part_of(self.flat.groups.get(scope.options.group or "loop"))
            return home if home in self.home else MAIN  # where no node runs there is no part
        if scope.options.active_for_s is not None:
            self._wrong_scope(scope, "it has active_for_s")
        return None

    def _end_home(self, end: End, edge: FlatEdge) -> str | None:
        """Return the part of one end; None, with a problem reported, if it has none."""
        if end.node >= 0:
            return self.home[end.node]
        if end.node == ROOT:
            other = edge.target if end is edge.source else edge.source
            if end.kind in ("slot", "event") and other.node != ROOT:  # each part has its own `start`, `stop`, `abort`
                return self._end_home(other, edge)
            return MAIN
        scope = self.flat.scopes[scope_end(end.node)]
        home = self.scope_home[scope.index]
        if home is None:
            self._wrong_scope(scope, f'an edge leads to or from its port "{end.name}"')
        return home

    def _gate_home(self, end: int) -> str | None:
        return self.home[end] if end >= 0 else self.scope_home[scope_end(end)]

    def _host(self, part: str) -> str:
        return self.flat.groups[part].host if part != MAIN else ""

    def _name(self, end: int) -> str:
        return self.flat.nodes[end].path if end >= 0 else self.flat.scopes[scope_end(end)].path

    def _wrong(self, path: str, what: str, why: str, remedy: str) -> None:
        self.findings.append(
            Problem(
                path=path,
                severity="error",
                what=what,
                why=why,
                remedy=remedy,
                check="process-border",
            )
        )

    def _wrong_scope(self, scope: Scope, what: str) -> None:
        self._wrong(
            scope.path,
            f"{what}, and its nodes are in different processes",
            "the automatic ports of a subgraph stand for all inside of it at one moment (rule G2)",
            "let all of it run in one group, or use the ports of the nodes inside",
        )

    # --- edges between parts ---

    def _cross(self, edge: FlatEdge, source: str, target: str, made: dict[str, _Part]) -> None:
        """An edge between two parts: in each of them a part of it, and what they have in common."""
        drops = edge.is_event_edge and edge.options.overflow not in ("wait", "error")
        buffer = 0
        if not edge.is_event_edge and edge.target.kind == "input" and not self._is_sequential(edge.target):
            buffer = edge.options.buffer or DEFAULT_WINDOW
        window = edge.options.capacity if edge.is_event_edge else buffer + 1
        hint = edge.source.port.type if edge.source.kind != "observable" else edge.target.port.type
        guarantee: Literal["exact", "bounded"] = "bounded" if drops else "exact"
        within_host = self._host(source) == self._host(target)
        crossing = CutEdge(edge.label, edge, source, target, guarantee, window, hint, within_host)
        self.edges.append(crossing)
        outside = End(LINK, "input", edge.label, edge.target.port)
        made[source].add(edge, edge.source, outside, initial=(), buffer=buffer)
        # Operators have done their work when a token crosses, and what lies on the edge at first lies at its end.
        inside = End(LINK, "event" if edge.is_event_edge else "output", edge.label, edge.source.port)
        if drops:
            made[target].add(edge, inside, edge.target, through=(), buffer=0)
        else:  # whether there is room is known where the tokens come from: they lie there until they are taken here
            made[target].add(edge, inside, edge.target, through=(), buffer=0, overflow="wait", capacity_limit=None)

    def _is_sequential(self, end: End) -> bool:
        return end.node >= 0 and self.flat.nodes[end.node].options.release == "sequential"


class _Part:
    """One part under construction: the nodes that are in it have other numbers there."""

    def __init__(self, flat: FlatGraph, here: list[bool]) -> None:
        self.number: dict[int, int] = {}
        for node, is_here in zip(flat.nodes, here, strict=True):
            if is_here:
                self.number[node.index] = len(self.number)
        nodes = [
            msgspec.structs.replace(node, index=self.number[node.index])
            for node, is_here in zip(flat.nodes, here, strict=True)
            if is_here
        ]
        scopes = [
            msgspec.structs.replace(
                scope, members=[self.number[member] for member in scope.members if member in self.number]
            )
            for scope in flat.scopes
        ]
        self.flat = FlatGraph(nodes, scopes, [], flat.groups, [], flat.graph, flat.findings)

    def add(self, edge: FlatEdge, source: End, target: End, **changed: Unpack[EdgeGiven]) -> None:
        """Add an edge, or the part of it that is here."""
        self.flat.edges.append(
            msgspec.structs.replace(
                edge,
                source=self._here(source),
                target=self._here(target),
                options=msgspec.structs.replace(edge.options, **changed) if changed else edge.options,
            )
        )

    def add_gate(self, gate: FlatGate) -> None:
        """Add a gate; both its nodes are here."""
        by, target = (self.number[end] if end >= 0 else end for end in (gate.by, gate.target))
        self.flat.gates.append(msgspec.structs.replace(gate, by=by, target=target))

    def _here(self, end: End) -> End:
        return end if end.node < 0 else End(self.number[end.node], end.kind, end.name, end.port)

"""From a state machine to a graph and back: the construction of the paper's §5.3.3, normalised as rule A13 says.

Each state is a node, the initial one too; each transition an event of its source and an active edge into its target.
Letters come to all states over edges that are not active. Depends on `description`, `states` and the graph floor.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from hfg.activity.description import Described, Transition, both, error, reject
from hfg.activity.states import StateNode, event_name, letter_name, one_by_one, state_type
from hfg.errors import GraphError, Problem
from hfg.graph import Graph
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, flatten
from hfg.graph.structure.level import level_of
from hfg.graph.structure.paths import candidates
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node
from hfg.ports import SlotPort

__all__ = ["build", "read_out"]

_MISSING = "missing"
_DEAD = "dead"


# --- to a graph ---


def build(machine: Described, graph: Graph, letters: Any, begin: Any, given: Mapping[str, Any]) -> dict[str, Node]:
    """Add the machine to a graph; see `StateMachine.build`."""
    answers: dict[str, list[str]] = {state: [] for state in machine.states}
    for one in machine.transitions:
        answers[one.source].append(one.letter)
    reject(f"{level_of(graph).title} cannot take this machine", _unfit(machine, graph, answers, given))
    nodes = {state: _node_of(one) for state, one in given.items()}
    states = {state: _state(machine, graph, state, answers[state], nodes.get(state)) for state in machine.states}
    entries = {state: _way_in(node, given.get(state)) for state, node in states.items()}
    source = graph.start if begin is None else begin
    graph.connect(source, entries[machine.initial], active=True)
    for one in machine.transitions:
        graph.connect(_way_out(states[one.source], one.letter), entries[one.target], active=True)
    if machine.missing == "dead":
        _add_dead(graph, states)
    if letters is not None:
        _tell(graph, letters, states.values())
    return states


def _state(machine: Described, graph: Graph, state: str, letters: list[str], given: Node | None) -> Node:
    if given is not None and given._place is not None:
        return given
    return graph.add(state_type(letters)(final=state in machine.final) if given is None else given, name=state)


def _way_in(node: Node, given: Any = None) -> Any:
    """Give the slot by which activity comes into a state; every node has one, if no other then the automatic one."""
    if isinstance(given, SlotPort):
        return given
    return node.ports.slots["enter" if "enter" in node._type.slots else "activate"]


def _node_of(given: Any) -> Any:
    """A state is given as its node, or as the slot of the node by which activity comes in."""
    return given.node if isinstance(given, SlotPort) else given


def _way_out(node: Node, letter: str) -> Any:
    """Give the event that answers a letter; for nodes of one's own also an automatic one, "timeout"; None if none."""
    for name in (event_name(letter), letter):
        for port in candidates(node, name):
            if port.kind == "event":
                return port
    return None


def _add_dead(graph: Graph, states: Mapping[str, Node]) -> None:
    """Lead letters without a transition to a state that nothing leaves."""
    knowing = [node for node in states.values() if isinstance(node, StateNode)]
    if knowing:
        name = _DEAD
        while name in graph.nodes:
            name += "_"
        dead = graph.add(StateNode(), name=name)
        for node in knowing:
            node.missing.activates(dead.enter)


def _tell(graph: Graph, letters: Any, states: Iterable[Node]) -> None:
    """Let every state that listens hear the letters, one letter after the other."""
    if getattr(letters, "kind", "event") == "event":
        waiting = graph.add(one_by_one())
        graph.connect(letters, waiting.letter)
        letters = waiting.out
    for node in states:
        if "read" in node._type.slots:
            graph.connect(letters, node.ports.slots["read"])


def _unfit(
    machine: Described, graph: Graph, answers: Mapping[str, list[str]], given: Mapping[str, Any]
) -> Iterator[Problem]:
    """Give every reason why the graph cannot be built."""
    for state, one in given.items():
        node = _node_of(one)
        if state not in answers:
            states = both(machine.states)
            yield error(f"nodes[{state!r}]", "the machine has no such state", f"it has {states}", "correct the name")
        elif not isinstance(node, Node):
            yield error(
                f"nodes[{state!r}]", f"got {node!r:.80}", "a state is a node", "make one: nodes={...: Closed()}"
            )
        elif node._place is not None and node._place.graph is not graph:
            where = level_of(node._place.graph).title
            yield error(
                f"nodes[{state!r}]",
                f"it is in {where}",
                f"the machine comes into {level_of(graph).title}",
                "make another",
            )
        else:
            yield from _unfit_node(node, state, answers[state], has_entry=node is not one)
    for state in machine.states:
        if state in given:
            continue
        if "/" in state or "." in state:
            yield error(
                state,
                "it cannot be the name of a node",
                'the parts of a path are separated by "/" and "."',
                "rename the state, or give it a node: nodes={...}",
            )
        elif state in graph.nodes:
            yield error(
                state,
                f"{level_of(graph).title} has a node of this name",
                "names tell nodes apart",
                "rename one of them",
            )


def _unfit_node(node: Node, state: str, letters: list[str], *, has_entry: bool) -> Iterator[Problem]:
    kind = node._type
    others = [name for name in kind.slots if name not in ("enter", "read")]
    if not has_entry and not is_box(node) and "enter" not in kind.slots and others:
        yield error(
            f"nodes[{state!r}]",
            f"{kind.qualname} has no slot `enter`, but {both(others)}",
            "by which of its slots activity comes into the state cannot be told",
            f"give the slot itself, nodes={{{state!r}: node.{others[0]}}}, or node.activate if none is to be called",
        )
    if is_box(node) and not has_entry and "enter" not in kind.slots:
        yield error(
            f"nodes[{state!r}]",
            f"the subgraph {kind.qualname} has no slot `enter`",
            "a subgraph cannot be activated from outside but by a slot of its own (rule G2)",
            "declare `enter = hfg.slot(type=object)` and connect its inner side",
        )
    for letter in letters:
        if _way_out(node, letter) is None:
            name = event_name(letter)
            yield error(
                f"nodes[{state!r}]",
                f'{kind.qualname} has no event "{name}"',
                f'the transition "{letter}" leaves the state by it',
                f"declare `{name} = hfg.Event()`",
            )


# --- and back ---


def read_out(graph: Graph, nodes: Iterable[Node | str] | None, final: Iterable[str]) -> Described:
    """Read the machine out of a graph or region; see `StateMachine.of`."""
    flat = flatten(graph)
    region = _Region(flat, _members(flat, graph, nodes), is_whole=nodes is None)
    reject(f"{level_of(graph).title} is no state machine", region.problems())
    return region.machine(final)


def _members(flat: FlatGraph, graph: Graph, nodes: Iterable[Node | str] | None) -> set[int]:
    """Give the numbers of the region's nodes."""
    if nodes is None:
        ends = {end.node for edge in flat.edges if edge.active for end in (edge.source, edge.target)}
        return {node.index for node in flat.nodes if node.index in ends or isinstance(node.node, StateNode)}
    wanted = [graph[one] if isinstance(one, str) else one for one in nodes]
    for one in wanted:
        if (
            not isinstance(one, Node)
            or one._place is None
            or level_of(one._place.graph).whole is not level_of(graph).whole
        ):
            raise GraphError(f"a region is nodes of {level_of(graph).title}, got {one!r}; name nodes, or their paths")
    members = {node.index for node in flat.nodes if node.node in wanted}
    for scope in flat.scopes:
        if scope.subgraph in wanted:
            members.update(scope.members)
    return members


class _Region:
    """The active edges of some nodes, sorted into those that stay, come in and leave."""

    def __init__(self, flat: FlatGraph, members: set[int], *, is_whole: bool) -> None:
        self.flat = flat
        self.is_whole = is_whole
        self.inside: list[FlatEdge] = []
        self.entering: list[FlatEdge] = []
        self.leaving: list[FlatEdge] = []
        to_dead: dict[int, bool] = {}
        for edge in flat.edges:
            if edge.active:
                source, target = edge.source.node in members, edge.target.node in members
                if source or target:
                    (self.inside if source and target else self.leaving if source else self.entering).append(edge)
                if target:
                    to_dead[edge.target.node] = self._is_missing(edge) and to_dead.get(edge.target.node, True)
        self.dead = {index for index, only in to_dead.items() if only}
        self.states = sorted(members - self.dead)

    def machine(self, final: Iterable[str]) -> Described:
        nodes = self.flat.nodes
        paths = {index: nodes[index].path for index in self.states}
        steps = [edge for edge in self.inside if not self._is_missing(edge)]
        own = [paths[i] for i in self.states if nodes[i].node._parameters.get("final") is True]
        return Described(
            list(paths.values()),
            [Transition(self._letter(edge), paths[edge.source.node], paths[edge.target.node]) for edge in steps],
            paths[self.entering[0].target.node],
            [*own, *final],
            "dead" if self.dead or not self._is_fed() else "ignore",
        )

    def problems(self) -> Iterator[Problem]:
        """Give every reason why this is no machine."""
        if not self.states:
            yield error(
                self.flat.level.name,
                "no active edge leads to or from a node",
                "the states of a graph are the nodes that activity moves between",
                "connect them with active=True",
            )
            return
        yield from self._beginnings()
        yield from self._forks()
        for edge in self.leaving:
            if edge.target.node != ROOT:  # the graph's own stop and abort end everything
                where = "a subgraph as a whole" if edge.target.node < ROOT else "no state of the region"
                yield error(
                    edge.label,
                    "activity leaves the region",
                    f"it leads to {where}, and then no state is active",
                    "take its target into the region, or make the edge not active",
                )

    def _beginnings(self) -> Iterator[Problem]:
        for edge in self.entering:
            if edge.source.node < ROOT:
                yield error(
                    edge.label,
                    "activity comes from a subgraph as a whole",
                    "a transition begins at one state (rule G2)",
                    "let it begin at a node inside",
                )
        targets = list(dict.fromkeys(edge.target.node for edge in self.entering))
        if len(targets) > 1:
            yield error(
                self._path(targets[0]),
                f"activity comes in at {both(map(self._path, targets))}",
                "a machine begins in one state, this graph could have several active nodes",
                "let one active edge lead in",
            )
        if not targets:
            yield error(
                self._path(self.states[0]),
                "no state is the initial one",
                "no active edge leads in from outside, so none ever becomes active",
                "activate it by the start: graph.start.activates(node.enter)",
            )

    def _forks(self) -> Iterator[Problem]:
        """What leaves in one sending can make one node active, or it is a fork (rule A3)."""
        sendings: dict[tuple[int, str], list[FlatEdge]] = defaultdict(list)
        for edge in (*self.inside, *self.leaving):
            # The outputs of a firing leave together.
            sendings[edge.source.node, edge.source.name if edge.source.kind == "event" else ""].append(edge)
        for (node, event), edges in sendings.items():
            targets = list(dict.fromkeys(edge.target.node for edge in edges if edge.target.node > ROOT))
            if len(targets) > 1:
                yield error(
                    f"{self._path(node)}.{event}" if event else self._path(node),
                    f"activity forks to {both(map(self._path, targets))}",
                    ("one signal makes" if event else "one firing's outputs make") + " all of them active (rule A3)",
                    "let one of the edges be active, or use an event for each way",
                )

    def _is_fed(self) -> bool:
        """Whether letters are read at all."""
        nodes = self.flat.nodes
        return any(isinstance(nodes[index].node, StateNode) for index in self.states)

    def _is_missing(self, edge: FlatEdge) -> bool:
        node = self.flat.nodes[edge.source.node].node if edge.source.node > ROOT else None
        return isinstance(node, StateNode) and edge.source.name == _MISSING

    def _letter(self, edge: FlatEdge) -> str:
        is_state = isinstance(self.flat.nodes[edge.source.node].node, StateNode)
        return letter_name(edge.source.name) if is_state else edge.source.name

    def _path(self, index: int) -> str:
        return self.flat.nodes[index].path

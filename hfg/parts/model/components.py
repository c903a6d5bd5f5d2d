"""The cost of a process's death, for each connected component of synchronous edges in its group (rule L2).

All nodes of a component fire equally often because each firing takes one token from every edge and puts one on every
edge. So its n-th tokens belong together wherever they are. The next incarnation can therefore resume after a loss
without pairing tokens that do not belong together: with the number after the last one that is known outside. The state
of one component says nothing about another, even in the same process. Decides, never waits. Depends on graphs that are
cut.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Any, Final, Literal, TypeAlias

import msgspec

from hfg.graph.flat import LINK, MAIN, ROOT, CutEdge, Cutting, FlatEdge, FlatGraph, FlatNode, scope_end
from hfg.graph.flat.order import strongly_connected

Cost: TypeAlias = Literal["nothing", "taken", "unknown"]
"""Cost of a death: nothing; the tokens that were taken and not passed on; or an unknown number of tokens."""

_SWITCHES: Final = ("enable", "disable")

_Key: TypeAlias = tuple[str, int]  # a node: its part, and its number there


class Component(msgspec.Struct, frozen=True):
    """A connected component of synchronous edges in a group.

    Attributes:
      part: the group.
      nodes: their paths.
      coming: labels of the edges from other parts; each firing takes one token from each.
      leaving: labels of the synchronous edges to other parts.
      answers: each incoming token yields exactly one token on each leaving edge, and nothing else.
      why: why this does not hold, in words; "" if it does.
      uncertain: why the number of tokens that a death costs is unknown; "" if it is known.
      joined: the node that would pair tokens that do not belong together if the number is unknown; "" if there is none.
      source: a source in it, which starts over; "" if there is none.
    """

    part: str
    nodes: tuple[str, ...]
    coming: tuple[str, ...]
    leaving: tuple[str, ...]
    answers: bool
    why: str
    uncertain: str
    joined: str
    source: str

    def in_words(self) -> tuple[str, str, str]:
        """Return the cost of a death, the reason, and a remedy."""
        if self.cost == "nothing":
            return "a death costs nothing", "each incoming token yields exactly one token on each leaving edge", ""
        what = "a death costs what was taken and not passed on; each token of it is counted, and joins stay aligned"
        if self.source:
            what += f', and source "{self.source}" starts over'
        if self.cost == "unknown":
            what = "a death costs an unknown number of tokens"
            if self.joined:
                what += f': it ends the run because "{self.joined}" would pair tokens that do not belong together'
        remedy = "give the group ledger=True so that nothing is lost"
        if self.joined:
            remedy += ", or may_misalign=True so that the run continues"
        return what, self.uncertain or self.why, remedy

    @property
    def cost(self) -> Cost:
        """The cost of a death without a ledger."""
        if self.answers:
            return "nothing"
        return "unknown" if self.uncertain else "taken"


def is_synchronous(edge: CutEdge) -> bool:
    """Return whether it is an edge from an output."""
    return edge.guarantee == "exact" and not edge.edge.is_event_edge


def is_numbered(edge: CutEdge) -> bool:
    """Return whether each firing of its consumer takes one token from it: the n-th token for the n-th firing."""
    kind = edge.edge.target.kind
    return edge.guarantee == "exact" and (kind == "input" or (kind == "parameter" and not edge.edge.is_event_edge))


def components(cutting: Cutting, kept: Collection[str] = ()) -> dict[str, tuple[Component, ...]]:
    """Return the components of each part except the main one. All parts of a run compute the same result.

    Args:
      cutting: of the graph.
      kept: the parts with ledgers (see `keeping`), which affect the cost of deaths of other parts; their own components
        do not depend on it.
    """
    whole = _Whole(cutting, kept)
    return {
        name: tuple(_component(whole, name, flat, numbers) for numbers in _connected(flat))
        for name, flat in cutting.parts.items()
        if name != MAIN
    }


def _connected(flat: FlatGraph) -> list[list[int]]:
    """The nodes of a part, by component, in order of adding."""
    beside: list[list[int]] = [[] for _ in flat.nodes]
    for edge in flat.edges:
        if edge.source.node >= 0 and edge.target.node >= 0 and _is_joined_by(edge):
            beside[edge.source.node].append(edge.target.node)
            beside[edge.target.node].append(edge.source.node)
    return sorted(strongly_connected(beside))


def _is_joined_by(edge: FlatEdge) -> bool:
    """Return whether its two ends fire equally often."""
    return edge.source.kind == "output" and edge.target.kind in ("input", "parameter")


def _component(whole: _Whole, part: str, flat: FlatGraph, numbers: list[int]) -> Component:
    inside = set(numbers)
    nodes = [flat.nodes[number] for number in numbers]
    touching = [edge for edge in flat.edges if edge.source.node in inside or edge.target.node in inside]
    cut = [whole.by_label[edge.label] for edge in touching if LINK in (edge.source.node, edge.target.node)]
    coming = tuple(edge.label for edge in cut if edge.target == part and is_numbered(edge))
    leaving = tuple(edge.label for edge in cut if edge.source == part and is_synchronous(edge))
    why = _why_no_answers(flat, nodes, touching) or whole.why_nothing_is_inherited
    uncertain = "" if not why else _why_uncertain(whole, flat, nodes, touching, part)
    joined = whole.joined(part, inside, leaving) if uncertain else ""
    source = next((node.path for node in nodes if node.node._type.is_source), "")
    paths = tuple(node.path for node in nodes)
    return Component(part, paths, coming, leaving, not why, why, uncertain, joined, source)


def _why_no_answers(flat: FlatGraph, nodes: list[FlatNode], touching: list[FlatEdge]) -> str:
    """Return why an incoming token need not yield exactly one on each leaving edge; "" if it does."""
    steered = _steered(flat)
    fed = {edge.target.node for edge in touching}
    sending = {edge.source.node for edge in touching}
    for edge in touching:
        if edge.source.kind != "output" or edge.target.kind != "input":
            return f'"{edge.label}" is not an edge from an output to an input'
        if edge.active:
            return f'"{edge.label}" carries activity'
        if edge.source.node < 0 and edge.source.node != LINK:
            return f'"{edge.label}" does not start at a node'
    for node in nodes:
        if node.index in steered:
            return f'"{node.path}" has a gate, or is steered by a subgraph around it'
        if node.index not in fed:
            return f'"{node.path}" works without being sent anything'
        if reason := _why_not_each(node, sends=node.index in sending):
            return f'"{node.path}" {reason}'
    if not any(edge.source.node == LINK for edge in touching):
        return "nothing is sent to it from another process"
    return ""


def _why_not_each(node: FlatNode, *, sends: bool) -> str:
    options = node.options
    if sends and node.node._hook("end") is not None:
        return "may send in end(), which does not answer a token"
    if not options.enabled:
        return "is disabled at the start"
    if options.concurrency != 1:
        return "has several firings in progress at once"
    if options.on_error != "stop":
        return f'has on_error="{options.on_error}"'
    return "has active_for_s" if options.active_for_s else ""


def _steered(flat: FlatGraph) -> set[int]:
    """Return the nodes that depend on gates, and those inside subgraphs that have automatic ports or gates."""
    ends = [end for gate in flat.gates for end in (gate.target, gate.by)]
    ends += [end.node for edge in flat.edges for end in (edge.source, edge.target) if end.node not in (LINK, ROOT)]
    found = {end for gate in flat.gates for end in (gate.target, gate.by) if end >= 0}
    for end in ends:
        if end < 0:
            found |= set(flat.scopes[scope_end(end)].members)
    return found


def _why_uncertain(whole: _Whole, flat: FlatGraph, nodes: list[FlatNode], touching: list[FlatEdge], part: str) -> str:
    """Why its nodes may not fire equally often, or why signals that are gone with it would have been paired."""
    switched = _switched(flat)
    for node in nodes:
        if not node.options.enabled or node.options.on_error == "disable" or node.index in switched:
            return f'"{node.path}" may be disabled while it runs'
    for edge in touching:
        if not edge.is_event_edge or edge.target.kind != "input" or edge.options.overflow not in ("wait", "error"):
            continue
        target = whole.key_of(part, edge, source=False)
        if edge.source.node >= 0 and target is not None and whole.inputs.get(target, 0) > 1:
            return f'signals of "{edge.label}" that are gone with it would have been paired with others'
    for edge in touching:
        if edge.target.node == LINK and whole.by_label[edge.label].target in whole.kept and not edge.is_event_edge:
            keeps = whole.by_label[edge.label].target
            return (
                f'"{edge.label}" leads to group "{keeps}", whose ledger knows the tokens that have arrived but '
                "not the lost ones"
            )
    if whole.comes_back(part, {node.index for node in nodes}):
        return "what it sends comes back to it by way of another process"
    return ""


def _switched(flat: FlatGraph) -> set[int]:
    """The nodes that an edge can enable or disable."""
    found: set[int] = set()
    for edge in flat.edges:
        if edge.target.kind == "slot" and edge.target.name in _SWITCHES:
            end = edge.target.node
            found |= (
                {end} if end >= 0 else set(flat.scopes[scope_end(end)].members) if end not in (LINK, ROOT) else set()
            )
    return found


class _Whole:
    """The whole graph as one, of whose nodes each is known by its part and its number there."""

    def __init__(self, cutting: Cutting, kept: Collection[str]) -> None:
        self.cutting = cutting
        self.kept = kept
        has_initial = any(edge.options.initial for flat in cutting.parts.values() for edge in flat.edges)
        self.why_nothing_is_inherited = (
            "another group has a ledger" if kept else "some edge has initial values" if has_initial else ""
        )
        self.by_label = {edge.label: edge for edge in cutting.edges}
        self._ends: dict[tuple[str, bool], _Key] = {}
        for part, flat in cutting.parts.items():
            for edge in flat.edges:
                if edge.target.node == LINK and edge.source.node >= 0:
                    self._ends[edge.label, True] = (part, edge.source.node)
                if edge.source.node == LINK and edge.target.node >= 0:
                    self._ends[edge.label, False] = (part, edge.target.node)
        self.inputs: dict[_Key, int] = {}
        self.data: list[tuple[_Key, _Key, str]] = []
        for part, flat in cutting.parts.items():
            for edge in flat.edges:
                self._add(part, edge)

    def _add(self, part: str, edge: FlatEdge) -> None:
        target = self.key_of(part, edge, source=False)
        if target is None or edge.target.node == LINK or edge.target.kind == "slot":
            return
        self.inputs[target] = self.inputs.get(target, 0) + 1
        source = self.key_of(part, edge, source=True)
        label = edge.label if edge.source.node == LINK else ""
        is_data = not self.by_label[label].edge.is_event_edge if label else edge.source.kind == "output"
        if source is not None and is_data:
            self.data.append((source, target, label))

    def key_of(self, part: str, edge: FlatEdge, *, source: bool) -> _Key | None:
        """Return the key of the node at one end of an edge, even in another part; None if there is no node."""
        end = edge.source if source else edge.target
        if end.node == LINK:
            return self._ends.get((edge.label, source))
        return (part, end.node) if end.node >= 0 else None

    def path(self, key: _Key) -> str:
        """How a node is called."""
        return self.cutting.parts[key[0]].nodes[key[1]].path

    def comes_back(self, part: str, inside: set[int]) -> bool:
        """Return whether tokens that leave a component come back to it through another process."""
        after: dict[_Key, list[_Key]] = {}
        for source, target, _ in self.data:
            after.setdefault(source, []).append(target)
        own = {(part, number) for number in inside}
        waiting = [key for one in own for key in after.get(one, ()) if key not in own]
        seen = set(waiting)
        while waiting:
            for key in after.get(waiting.pop(), ()):
                if key in own:
                    return True
                if key not in seen:
                    seen.add(key)
                    waiting.append(key)
        return False

    def joined(self, part: str, inside: set[int], leaving: Iterable[str]) -> str:
        """Return a node outside that pairs the component's tokens with others; "" if there is none."""
        own = {(part, number) for number in inside}
        for node in sorted(self._own_joins(own)):
            return self.path(node)
        sets = _Sets()
        for source, target, _ in self.data:
            if source not in own and target not in own:
                sets.join(source, target)
        roots: dict[Any, set[Any]] = {}
        begun: set[Any] = set()
        fed = {target for _, target, _ in self.data}
        for source, target, label in self.data:
            if target not in own:
                root = ("edge", label) if source in own else source if source not in fed else None
                if root is not None:
                    roots.setdefault(sets.of(target), set()).add(root)
                if source in own and label in leaving:
                    begun.add(sets.of(target))
        for target, count in sorted(self.inputs.items()):
            if count > 1 and sets.of(target) in begun and len(roots.get(sets.of(target), ())) > 1:
                return self.path(target)
        return ""

    def _own_joins(self, own: set[_Key]) -> Iterator[_Key]:
        """Where signals of the component, which are not numbered, meet others."""
        for part, flat in self.cutting.parts.items():
            for edge in flat.edges:
                if edge.target.kind == "input" and edge.target.node >= 0:
                    is_signal = edge.source.kind == "event"
                    target = (part, edge.target.node)
                    if is_signal and self.key_of(part, edge, source=True) in own and self.inputs[target] > 1:
                        yield target


class _Sets:
    """Sets of connected nodes."""

    def __init__(self) -> None:
        self._above: dict[Any, Any] = {}

    def of(self, one: Any) -> Any:
        """Return the representative of all nodes that are connected with one."""
        path = []
        while (above := self._above.get(one, one)) != one:
            path.append(one)
            one = above
        for passed in path:
            self._above[passed] = one
        return one

    def join(self, one: Any, other: Any) -> None:
        """These two do."""
        self._above[self.of(one)] = self.of(other)

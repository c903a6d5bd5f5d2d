"""The token game of activity: a finite abstraction of a graph, whose states are whole numbers.

    A(v)   one bit for each node that an active edge touches
    n(e)   two bits for each active edge: one token with +1 lies on it, or several
    r(v)   the right of A3, only if code sends more than once while other nodes work
    m(e)   a token with -1 lies on it, only if code sends -1

Values, stamps, capacities and time are forgotten: any node may fire or be called at any moment. So everything that a
run does is also possible in the game, and what never happens in the game never happens in a run; the other way round it
is only a hint. `Play.steps_from` yields what may happen next. Depends on the flat graph and `reading`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

from hfg.analysis.bags import NOTHING, Bag, Handler, Sent, parts_of
from hfg.analysis.reading import read
from hfg.errors import GraphError
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, FlatNode, scope_end
from hfg.nodetypes.description import NodeType
from hfg.ports.automatic import AUTOMATIC_EVENTS, sent_of

__all__ = ["Game", "Kind", "Play", "Rule", "Unread", "singles"]

Kind: TypeAlias = Literal["fires", "is called", "sends", "takes", "loses", "gets back", "is set", "times out"]

_MOST_GIVEN: Final = 2_000_000  # in all rules together
_FRAGILE_TOGETHER: Final = 4  # up to this number of edges that may not be live, each combination is a case


@dataclass(frozen=True, slots=True)
class Unread:
    """Code that could not be read, so anything is assumed of it."""

    path: str
    handler: str
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Rule:
    """One thing that may happen.

    Attributes:
      text: in words.
      actor: the node, or the subgraph as in `End.node`.
      take: the edge from which a token is taken; -1 for none.
      minus: the token taken has -1.
      gives: the active edges that get +1 if the actor is active, and how often.
      makes: those that get +1 even if it is not (rule A4).
      takes_away: the edges that get -1.
      sent: the ports it is sent over, for a replay: name, modifier and how often.
      keeps: A(v) after it, where nothing leaves: "active", "inactive", or "" for no change.
      right: the actor keeps the right of A3 after it.
      gates: the nodes or subgraphs that have to be active.
      clears: a subgraph's bits, all of which go (rule G2).
      needs: the subgraph's bits of which one must be set.
      after: edges from `start` whose tokens have to be taken first (rules A10, F9).
    """

    text: str
    kind: Kind
    actor: int
    take: int = -1
    minus: bool = False
    gives: tuple[tuple[int, int], ...] = ()
    makes: tuple[tuple[int, int], ...] = ()
    takes_away: tuple[int, ...] = ()
    sent: tuple[tuple[str, int | None, int], ...] = ()
    keeps: Literal["active", "inactive", ""] = ""
    right: bool = False
    gates: tuple[int, ...] = ()
    clears: int = 0
    needs: int = 0
    after: tuple[int, ...] = ()

    @property
    def may_lose(self) -> bool:
        """Whether activity may vanish by it."""
        return self.kind == "loses" or self.keeps == "inactive" or (bool(self.clears) and not self.gives)

    @property
    def most_made(self) -> int:
        """How many tokens with +1 it puts where one activity was; 2 if it makes activity out of nothing."""
        if self.makes or self.right or (self.kind == "is set" and self.keeps == "active"):
            return 2
        return sum(count for _, count in self.gives)


@dataclass(frozen=True)
class _Bits:
    """Where each place has its bits: of nodes, rights and -1 their numbers, of edges the bits themselves."""

    node: dict[int, int]
    one: list[int]
    two: list[int]
    right: dict[int, int]
    minus: dict[int, int]


class Game:
    """The game of one flat graph.

    Attributes:
      edges: the active edges; the game numbers them from 0.
      nodes: the nodes that they touch.
      rules: all that may happen.
      start: the edges that get +1 when the run starts.
      unread: the code that could not be read.
    """

    def __init__(self, flat: FlatGraph) -> None:
        self.flat = flat
        self.edges = [edge for edge in flat.edges if edge.active]
        ends = {end for edge in self.edges for end in (edge.source.node, edge.target.node) if end > ROOT}
        ends |= {
            edge.target.node
            for edge in flat.edges
            if edge.target.node > ROOT and edge.target.kind == "slot" and edge.target.name == "activate"
        }
        self.nodes = sorted(ends)
        self.out: dict[tuple[int, str], list[int]] = {}
        self.into: dict[int, list[int]] = {}
        for number, edge in enumerate(self.edges):
            self.out.setdefault((edge.source.node, edge.source.name), []).append(number)
            self.into.setdefault(edge.target.node, []).append(number)
        self.start = list(self.out.get((ROOT, "start"), ()))
        self.unread: list[Unread] = []
        self.rules: list[Rule] = []
        self._given = 0
        self._sent_from: dict[int, frozenset[str]] = {}
        for node, port in self.out:
            self._sent_from[node] = self._sent_from.get(node, frozenset()) | {port}
        self._slot_edges: dict[int, list[FlatEdge]] = {}
        for edge in flat.edges:
            if edge.target.kind == "slot":
                self._slot_edges.setdefault(edge.target.node, []).append(edge)
        self._first = self._find_first()
        self._gates = self._find_gates()
        self._fragile = self._find_fragile()
        self._ends = self._find_ending()
        self._rights: set[int] = set()
        for index in self.nodes:
            self._add_node(flat.nodes[index])
        self._away = {edge for rule in self.rules for edge in rule.takes_away}
        for number in sorted(self._away):
            target = self.edges[number].target.node
            if target > ROOT:
                text = f'"{self.flat.path(target)}" takes -1'
                self.rules.append(Rule(text, "takes", target, number, minus=True, keeps="inactive"))
        self.bits = self._number()
        for scope in flat.scopes:
            self._add_scope(scope.index)

    # --- making the rules

    def _find_first(self) -> dict[int, tuple[int, ...]]:
        """For each node the edges from `start` into its slots: nothing calls it before (rules A10, F9).

        Only the hook `setup` may send earlier.
        """
        if any("setup" in node.node._type.hooks for node in self.flat.nodes):
            return {}
        found: dict[int, tuple[int, ...]] = {}
        for number in self.start:
            target = self.edges[number].target
            if target.kind == "slot":
                found[target.node] = (*found.get(target.node, ()), number)
        return found

    def _after(self, index: int, kind: Kind, take: int = -1) -> tuple[int, ...]:
        """The edges from `start` that a step of a node comes after, if it is a call."""
        is_call = self.edges[take].target.kind == "slot" if take >= 0 else kind in ("is called", "is set")
        return () if not is_call or take in self.start else self._first.get(index, ())

    def _find_gates(self) -> dict[int, tuple[int, ...]]:
        found: dict[int, tuple[int, ...]] = {}
        for gate in self.flat.gates:
            if gate.idle_rate_hz is None:
                for member in self.flat.members(gate.target):
                    found[member] = (*found.get(member, ()), gate.by)
        return found

    def _find_fragile(self) -> set[int]:
        """The active edges that may not be live at times, or whose tokens may be discarded (rules A8, F10)."""
        shut: set[int] = set()
        for edge in self.flat.edges:
            if edge.target.kind == "slot" and edge.target.name == "disable" and edge.target.node != ROOT:
                shut.update(self.flat.members(edge.target.node))
        shut |= {node.index for node in self.flat.nodes if node.options.on_error == "disable"}
        shut |= {node.index for node in self.flat.nodes if not node.options.enabled}
        shut |= {one for scope in self.flat.scopes if not scope.options.enabled for one in scope.members}
        return {
            number
            for number, edge in enumerate(self.edges)
            if edge.target.node in shut or (edge.source.node in shut and edge.source.kind != "event")
        }

    def _find_ending(self) -> set[int]:
        """The nodes that may end while the graph still works: sources, what feeds bring, and what follows in step."""
        found: set[int] = set()
        waiting = [node.index for node in self.flat.nodes if node.node._type.is_source or node.iteration is not None]
        after: dict[int, list[int]] = {}
        for edge in self.flat.edges:
            if not edge.is_event_edge and edge.target.kind in ("input", "parameter") and edge.target.node > ROOT:
                after.setdefault(edge.source.node, []).append(edge.target.node)
        waiting += after.get(ROOT, [])
        waiting += [node.index for node in self.flat.nodes if _ends_itself(node.node._type)]
        while waiting:
            index = waiting.pop()
            if index not in found:
                found.add(index)
                waiting += after.get(index, [])
        return found

    def _edges_of(
        self, index: int, bag: Iterable[tuple[Sent, int]], modifiers: tuple[int | None, ...]
    ) -> dict[int, int]:
        found: dict[int, int] = {}
        for (port, modifier), count in bag:
            if modifier in modifiers:
                for number in self.out.get((index, port), ()):
                    found[number] = found.get(number, 0) + count
        return found

    def _sending(
        self, text: str, kind: Kind, index: int, bag: Bag, *, take: int = -1, right: bool = False, gated: bool = False
    ) -> Iterator[Rule]:
        """The rules of one bag that leaves in one step."""
        gives = self._edges_of(index, bag, (None, 1))
        makes = self._edges_of(index, bag, (1,))
        away = tuple(self._edges_of(index, bag, (-1,)))
        sent = tuple((port, modifier, count) for (port, modifier), count in sorted(bag, key=repr))
        gates = self._gates.get(index, ()) if gated else ()
        fragile = [number for number in gives if number in self._fragile]
        for missing in _subsets(fragile):
            gone = frozenset(missing)
            self._given += len(gives)
            if self._given > _MOST_GIVEN:
                raise GraphError(
                    f'"{self.flat.path(index)}" sends activity in too many ways to analyse: let fewer of its active '
                    "edges lead to nodes that can be disabled"
                )
            yield Rule(
                text,
                kind,
                index,
                take,
                gives=_without(gives, gone),
                makes=_without(makes, gone),
                takes_away=away,
                sent=sent,
                keeps="active" if take >= 0 else "",
                right=right,
                gates=gates,
                after=self._after(index, kind, take),
            )

    def _add_handler(self, node: FlatNode, name: str, handler: Handler, kind: Kind, *, gated: bool = False) -> None:
        """The rules of a firing or call that takes no activity itself."""
        path = f'"{node.path}"' if kind == "fires" else f'"{node.path}.{name}"'
        if handler.unknown:
            self.unread.append(Unread(node.path, name, handler.unknown))
        if self._is_whole(node, handler):
            for bag in self._cases(node, handler):
                if bag:
                    text = f"{path} {kind} and sends {_ports(bag)}"
                    self.rules += self._sending(text, kind, node.index, bag, gated=gated)
            return
        several = handler.sends_several
        if several:
            self._rights.add(node.index)
        for sent in sorted(handler.sent, key=repr):
            bag = frozenset({(sent, 1)})
            text = f'"{node.path}" sends {_ports(bag)}'
            self.rules += self._sending(text, "sends", node.index, bag, right=several, gated=gated)

    def _is_whole(self, node: FlatNode, handler: Handler) -> bool:
        group = self.flat.groups.get(node.options.group or "loop")
        return handler.whole and not (group is not None and group.threads)

    def _cases(self, node: FlatNode, handler: Handler) -> Iterable[Bag]:
        """The bags. If the run survives errors, also their parts."""
        if node.options.on_error == "stop":
            return handler.bags
        return {part for bag in handler.bags for part in parts_of(bag)}

    def _add_node(self, node: FlatNode) -> None:
        index = node.index
        kind = node.node._type
        ports = self._sent_from.get(index, frozenset())
        own = frozenset(port for port in ports if port in kind.outputs or port in kind.events)
        code = read(kind, own)
        if node.iteration is not None:
            self.unread.append(Unread(node.path, "its inside", "it iterates, and the analysis does not go inside"))
        parameters = frozenset(port for port in ports if port in kind.parameters and port not in own)
        firing = code.firing
        if firing is not None and parameters:
            more = frozenset({frozenset({((port, None), 2)}) for port in parameters})
            firing = Handler(firing.bags | more, False, firing.unknown)
        if firing is not None:
            self._add_handler(node, "process", firing, "fires", gated=True)
        if code.ending is not None:
            self._add_handler(node, "end", code.ending, "fires")
        for name, handler in code.slots.items():
            self._add_handler(node, name, handler, "is called")
        for sent in sorted(code.outside, key=repr):
            bag = frozenset({(sent, 1)})
            self.rules += self._sending(f'"{node.path}" sends {_ports(bag)}', "sends", index, bag)
        self._add_automatic(node, ports - own - parameters)
        outputs = frozenset(((port, None), 1) for port in own if port in kind.outputs)
        if outputs and index in self._ends:
            self.rules += self._sending(f'"{node.path}" ends', "fires", index, outputs)
        for number in self.into.get(index, ()):
            self._add_taking(node, number, code.slots)
        for edge in self._slot_edges.get(index, ()):
            if edge.active and edge.source.node == ROOT and edge.source.name == "start":
                continue  # it happens once, and brings activity
            after = self._after(index, "is set")
            if edge.target.name == "activate":
                text = f'"{edge.label}" activates "{node.path}"'
                self.rules.append(Rule(text, "is set", index, keeps="active", after=after))
            elif edge.target.name == "deactivate":
                text = f'"{edge.label}" deactivates "{node.path}"'
                self.rules.append(Rule(text, "is set", index, keeps="inactive", after=after))

    def _add_automatic(self, node: FlatNode, ports: frozenset[str]) -> None:
        """Automatic events that carry activity on; each is a sending of its own (rule A9)."""
        for port in sorted(ports):
            if port == "deactivated" or (port not in AUTOMATIC_EVENTS and sent_of(port) is None):
                continue
            if (port == "timeout" and node.options.active_for_s is None) or (
                port == "failed" and node.options.on_error == "stop"
            ):
                continue
            kind: Kind = "times out" if port == "timeout" else "sends"
            bag = frozenset({((port, None), 1)})
            gated = port in ("processed", "failed") or sent_of(port) is not None
            text = f'"{node.path}" {kind}' if kind == "times out" else f'"{node.path}" sends {port}'
            self.rules += self._sending(text, kind, node.index, bag, gated=gated)

    def _add_taking(self, node: FlatNode, number: int, slots: dict[str, Handler]) -> None:
        edge = self.edges[number]
        target = edge.target
        text = f'"{node.path}" takes the activity from "{edge.label}"'
        handler = slots.get(target.name) if target.kind == "slot" else None
        if target.kind == "slot" and target.name == "deactivate":
            after = self._after(node.index, "takes", number)
            text = f'"{edge.label}" ends in deactivate'
            self.rules.append(Rule(text, "loses", node.index, number, keeps="inactive", after=after))
        elif handler is None or not self._is_whole(node, handler):
            after = self._after(node.index, "takes", number)
            self.rules.append(Rule(text, "takes", node.index, number, keeps="active", after=after))
        else:
            for bag in self._cases(node, handler):
                kind: Kind = "is called" if bag else "takes"
                more = f" and sends {_ports(bag)}" if bag else ""
                self.rules += self._sending(text + more, kind, node.index, bag, take=number)
        if number in self._fragile:
            sender = edge.source.node
            back = f'the activity on "{edge.label}" is discarded'
            if sender > ROOT:
                self.rules.append(Rule(f"{back} and goes back", "gets back", sender, number, keeps="active"))
            else:
                self.rules.append(Rule(back, "loses", node.index, number))

    def _add_scope(self, index: int) -> None:
        """Activity that leaves by a subgraph's own events is taken from everything inside (rule G2)."""
        scope = self.flat.scopes[index]
        end = scope_end(index)
        inside = set(scope.members)
        mask = self.mask_of(end)
        rights = sum(1 << bit for node, bit in self.bits.right.items() if node in inside)
        for port in sorted(self._sent_from.get(end, ())):
            if port == "deactivated" or (port == "timeout" and scope.options.active_for_s is None):
                continue
            gives = tuple((number, 1) for number in self.out[end, port])
            text = f'"{scope.path}" {"times out" if port == "timeout" else f"sends {port}"}'
            kind: Kind = "times out" if port == "timeout" else "sends"
            sent = ((port, None, 1),)
            for missing in _subsets([number for number, _ in gives if number in self._fragile]):
                left = _without(dict(gives), frozenset(missing))
                if left:
                    self.rules.append(Rule(text, kind, end, gives=left, sent=sent, clears=mask | rights, needs=mask))
        for edge in self._slot_edges.get(end, ()):
            if edge.target.name == "deactivate":
                text = f'"{edge.label}" deactivates "{scope.path}"'
                self.rules.append(Rule(text, "is set", end, clears=mask | rights, needs=mask))
        for number in self.into.get(end, ()):  # a subgraph's own slots keep no activity
            self.rules.append(Rule(f'"{scope.path}" keeps no activity', "loses", end, number))

    def may_stay(self, end: int, port: str) -> bool:
        """Return whether activity may stay when a node or subgraph sends over a port (rule A8)."""
        return not set(self.out.get((end, port), ())) - self._fragile

    # --- places

    def _number(self) -> _Bits:
        place = itertools.count()
        node = {index: next(place) for index in self.nodes}
        of_edges = [(1 << next(place), 1 << next(place)) for _ in self.edges]
        return _Bits(
            node,
            one=[one for one, _ in of_edges],
            two=[two for _, two in of_edges],
            right={index: next(place) for index in sorted(self._rights)},
            minus={number: next(place) for number in sorted(self._away)},
        )

    def mask_of(self, end: int) -> int:
        """The bits of a node, or of a subgraph with the tokens inside (rule G2)."""
        inside = set(self.flat.members(end))
        mask = sum(1 << self.bits.node[one] for one in inside if one in self.bits.node)
        if end < ROOT:
            for number, edge in enumerate(self.edges):
                if edge.source.node in inside and edge.target.node in inside:
                    mask |= self.bits.one[number] | self.bits.two[number]
        return mask

    def places_of(self, nodes: Iterable[int]) -> int:
        """The bits that say that some nodes are active, or that activity is in transit to them."""
        mask = 0
        for index in nodes:
            if index in self.bits.node:
                mask |= 1 << self.bits.node[index]
            for number in self.into.get(index, ()):
                mask |= self.bits.one[number] | self.bits.two[number]
        return mask

    # --- reading states

    def active_in(self, state: int) -> list[str]:
        """The paths of the active nodes."""
        return [self.flat.nodes[index].path for index, bit in self.bits.node.items() if state >> bit & 1]

    def under_way_in(self, state: int) -> list[str]:
        """The edges on which activity lies."""
        bits = self.bits
        return [
            f"{edge.label} (twice or more)" if state & bits.two[number] else edge.label
            for number, edge in enumerate(self.edges)
            if state & bits.one[number]
        ]


class Play:
    """The game among some of the nodes; the others are left out, so gates that depend on them count as open.

    Attributes:
      nodes: those that take part.
      mask: the bits of all places among them.
      rules: what may happen among them.
      first: the state in which the run starts: its activity is in transit.
    """

    def __init__(self, game: Game, nodes: Iterable[int]) -> None:
        self.game = game
        self.nodes = frozenset(nodes)
        bits = game.bits
        self.mask = game.places_of(self.nodes)
        for number, edge in enumerate(game.edges):
            sources = game.flat.members(edge.source.node) if edge.source.node != ROOT else ()
            if not self.nodes.isdisjoint(sources):
                self.mask |= bits.one[number] | bits.two[number]  # also those that lead out of the graph
        self.first = 0
        for number in game.start:
            if bits.one[number] & self.mask:
                self.first = self._put(self.first, number)
        self._waits: dict[Rule, int] = {}
        self._open = {by: game.mask_of(by) for rule in game.rules for by in rule.gates}
        self._by_bit: dict[int, list[tuple[Rule, bool]]] = {}
        self._always: list[Rule] = []
        self.rules = self._choose()
        self._over = {
            index: Rule(f'what "{game.flat.path(index)}" was doing is over', "takes", index) for index in bits.right
        }

    def _choose(self) -> list[Rule]:
        """Order the rules by the bit that each needs; of two with the same effect one is enough."""
        found: list[Rule] = []
        seen: set[object] = set()
        for rule in self.game.rules:
            if not self._takes_part(rule):
                continue
            known = all(self._open[by] and not self._open[by] & ~self.mask for by in rule.gates)
            gates = rule.gates if known else ()
            effect = (rule.gives, rule.makes, rule.takes_away, rule.keeps, rule.right, rule.clears)
            key = (rule.actor, rule.take, rule.minus, rule.kind == "is set", rule.after, effect)
            if (key, gates) in seen or (key, ()) in seen:
                continue
            seen.add((key, gates))
            rule = rule if gates == rule.gates else replace(rule, gates=gates)
            found.append(rule)
            if rule.after:
                self._waits[rule] = sum(self.game.bits.one[number] for number in rule.after)
            for bit, by_right in self._needs(rule):
                if bit is None:
                    self._always.append(rule)
                else:
                    self._by_bit.setdefault(bit, []).append((rule, by_right))
        return found

    def _takes_part(self, rule: Rule) -> bool:
        if rule.actor > ROOT:
            return rule.actor in self.nodes
        if rule.take >= 0:
            return bool(self.game.bits.one[rule.take] & self.mask)
        return bool(rule.needs & self.mask)

    def _needs(self, rule: Rule) -> Iterator[tuple[int | None, bool]]:
        bits = self.game.bits
        if rule.clears:
            for low in singles(rule.needs & self.mask):
                yield low.bit_length() - 1, False
        elif rule.take >= 0:
            yield bits.minus[rule.take] if rule.minus else bits.one[rule.take].bit_length() - 1, False
        elif rule.kind == "is set":
            yield (bits.node[rule.actor] if rule.keeps == "inactive" else None), False
        else:
            if rule.makes or rule.takes_away:
                yield None, False
            if rule.gives:
                yield bits.node[rule.actor], False
                if rule.right:
                    yield bits.right[rule.actor], True

    def _put(self, state: int, number: int) -> int:
        one = self.game.bits.one[number]
        return state | self.game.bits.two[number] if state & one else state | one

    def _left(self, state: int, rule: Rule) -> tuple[int, ...]:
        """The possible states of an edge after one of its tokens is taken."""
        bits = self.game.bits
        if rule.minus:
            bit = 1 << bits.minus[rule.take]
            return (state & ~bit, state)
        two = bits.two[rule.take]
        return (state & ~two, state) if state & two else (state & ~bits.one[rule.take],)

    def steps_from(self, state: int) -> Iterator[tuple[Rule, int]]:
        """Yield each rule that may be applied and changes something, with the state after it."""
        for rule in self._always:
            yield from self._apply(rule, state, "nobody")
        cleared: set[int] = set()
        for low in singles(state):
            for rule, by_right in self._by_bit.get(low.bit_length() - 1, ()):
                if rule.clears:
                    if id(rule) in cleared:
                        continue
                    cleared.add(id(rule))
                yield from self._apply(rule, state, "right" if by_right else "active")
        for index, bit in self.game.bits.right.items():
            if state >> bit & 1:
                yield self._over[index], state & ~(1 << bit)

    def _apply(self, rule: Rule, state: int, by: Literal["nobody", "right", "active"]) -> Iterator[tuple[Rule, int]]:
        """Apply a rule in the name of a sender that is not active, that has the right of A3, or that is active."""
        bits = self.game.bits
        if rule.after and state & self._waits[rule]:
            return
        for before in self._left(state, rule) if rule.take >= 0 else (state,):
            after = before & ~rule.clears
            me = 1 << bits.node[rule.actor] if rule.actor in bits.node else 0
            if by == "nobody" and rule.makes and before & me:
                continue  # an active sender makes none out of nothing (rule A4)
            if rule.keeps == "active":
                after |= me
            elif rule.keeps == "inactive":
                after &= ~me
                if rule.actor in bits.right and not rule.minus:
                    after &= ~(1 << bits.right[rule.actor])
            if rule.gates and not all((state | after) & self._open[by_] for by_ in rule.gates):
                continue
            gives = bool(rule.gives) and by != "nobody"
            for number, count in rule.gives if gives else rule.makes:
                for _ in range(count):
                    after = self._put(after, number)
            if gives and not rule.clears:
                after &= ~me
                if rule.right:
                    after |= 1 << bits.right[rule.actor]
            for number in rule.takes_away:
                after |= 1 << bits.minus[number]
            if after != state:
                yield rule, after


def singles(mask: int) -> Iterator[int]:
    """Yield each bit of a mask as a number of its own, the lowest first."""
    while mask:
        low = mask & -mask
        yield low
        mask ^= low


def _ends_itself(kind: NodeType) -> bool:
    """Whether its code may raise `EndOfStream` (rule F2)."""
    origin = kind.origin
    functions = [getattr(origin, "function", None)]
    if isinstance(origin, type):
        functions = [getattr(value, "handler", value) for owner in origin.__mro__ for value in vars(owner).values()]
    codes = [getattr(function, "__code__", None) for function in functions]
    return any("EndOfStream" in code.co_names for code in codes if code is not None)


def _subsets(numbers: list[int]) -> Iterator[tuple[int, ...]]:
    """Which edges are not live: none, or each combination; of very many, also all."""
    most = len(numbers) if len(numbers) <= _FRAGILE_TOGETHER else 1
    for size in range(most + 1):
        yield from itertools.combinations(numbers, size)
    if most < len(numbers):
        yield tuple(numbers)


def _without(edges: dict[int, int], gone: frozenset[int]) -> tuple[tuple[int, int], ...]:
    return tuple(sorted((number, min(count, 2)) for number, count in edges.items() if number not in gone))


def _ports(bag: Bag) -> str:
    """Name what is sent: "done", "done twice and failed with -1"."""
    if bag == NOTHING:
        return "nothing"
    parts = []
    for (port, modifier), count in sorted(bag, key=repr):
        parts.append(port + (" twice" if count > 1 else "") + (f" with {modifier:+d}" if modifier is not None else ""))
    return " and ".join(parts)

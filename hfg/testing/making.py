"""Making random plans: one procedure for every kind of chooser, as Hypothesis, which shrinks, or a seeded generator.

`Making` draws the node types of `hfg.testing.nodes`. A class derived from it can add kinds of nodes and options; the
tests of hfg itself do so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, ClassVar, Final, Protocol, TypeVar

from hfg.ports.automatic import sent_name
from hfg.testing.plans import LIBRARY, BoxPlan, EdgePlan, GatePlan, GraphPlan, NodePlan

__all__ = ["SYNCHRONOUS", "Allowed", "Chooser", "Making"]

T = TypeVar("T")
End = tuple[str, str, str]


class Chooser(Protocol):
    """Makes choices."""

    def number(self, least: int, most: int) -> int:
        """Choose a whole number; `least` is the simplest."""

    def one_of(self, choices: Sequence[T]) -> T:
        """Choose one; the first is the simplest."""

    def chance(self, percent: int) -> bool:
        """Return True with this probability; False is simpler."""


@dataclass(frozen=True)
class Allowed:
    """Features that may occur in a plan; a test of one rule omits unrelated ones.

    Attributes:
      box_ports: edges and gates at the automatic ports of subgraphs themselves.
      start: edges from the graph's event `start`.
      failing_calls: edges into slots that fail.
    """

    max_nodes: int = 7
    events: bool = True
    activity: bool = True
    cycles: bool = True
    failures: bool = True
    boxes: bool = True
    box_ports: bool = True
    gates: bool = True
    rates: bool = True
    waiting: bool = True
    lossy: bool = True
    parameters: bool = True
    disabling: bool = True
    readiness: bool = True
    start: bool = True
    failing_calls: bool = True


SYNCHRONOUS: Final = Allowed(
    events=False, activity=False, failures=False, gates=False, lossy=False, disabling=False, readiness=False
)
"""Only features of rule F7."""

_INNER: Final = (
    *("double", "add", "some", "sink", "Passing", "Merge", "Latch", "Counter", "Pulse", "Greeter", "Stateful"),
    *("Sieve", "Tally"),
)
_BOUNDED_SLOTS: Final = {"say", "hand_on", "hear", "utter"}
"""Slots that answer so rarely that cycles of them end."""

_DELICATE_SLOTS: Final = ("activate", "deactivate", "reset", "disable", "enable")


class Making:
    """Makes one plan by asking a chooser again and again.

    The plan of a choice must stay the same from one version to the next: tests name seeds that once found a fault.

    Attributes:
      library: the module that has the node types.
      turned: parameters that edges set, by node type; a source with such an edge waits for it.
      wired: node types with outputs that are connected only to the nodes that they were made for.
      left_alone: node types without slots, or that would hang when they are reset.
      unboxed: node types that are never inside a subgraph.
      any_slots: slots that take any signal.
      longest: number of values of a source at most.
    """

    library = LIBRARY
    turned: ClassVar[dict[str, str]] = {"Scaled": "factor", "Pulse": "most", "Script": "count"}
    wired: tuple[str, ...] = ()
    left_alone: tuple[str, ...] = ()
    unboxed: tuple[str, ...] = ()
    failing: tuple[str, ...] = ("Failing",)
    any_slots = frozenset({"tell", "begin", "more", "hear", "ping", "gave"})
    longest = 5

    def __init__(self, choose: Chooser, allowed: Allowed) -> None:
        self.choose = choose
        self.allowed = allowed
        self.nodes: list[NodePlan] = []
        self.edges: list[EdgePlan] = []
        self.pairs: set[tuple[End, End]] = set()

    def plan(self) -> GraphPlan:
        """Make the plan."""
        self.make_nodes()
        self.make_edges()
        boxes = self.make_boxes() if self.allowed.boxes else []
        gates = self.make_gates() if self.allowed.gates else []
        if self.allowed.box_ports:
            boxes, gates = self.connect_boxes(boxes, gates)
        return GraphPlan(tuple(self.nodes), tuple(self.edges), tuple(boxes), tuple(gates), library=self.library)

    def chance(self, percent: int) -> bool:
        """Decide about a feature that keeps a node apart from its neighbours."""
        return self.choose.chance(percent)

    # --- nodes

    def make_nodes(self) -> None:
        """Make all nodes."""
        for number in range(self.choose.number(2, self.allowed.max_nodes)):
            self.make_node(f"n{number}", self.kind_of(number))

    def make_node(self, name: str, kind: str) -> None:
        """Make one node."""
        self.nodes.append(NodePlan(name, kind, self.parameters(kind), self.options(kind)))

    def kind_of(self, number: int) -> str:
        """Choose the type of a node; the first is a source."""
        is_source = number == 0 or self.chance(20)
        return self.choose.one_of(self.sources() if is_source else self.inner())

    def sources(self) -> list[str]:
        """Return the types of sources."""
        return ["script", "Script"] + (["ascript"] if self.allowed.waiting else [])

    def inner(self) -> list[str]:
        """Return the types of other nodes; a type that is in it several times is chosen as often."""
        allowed = self.allowed
        return [
            *_INNER,
            *["Failing"] * 2 * allowed.failures,
            *["slow_double", "Waiting"] * allowed.waiting,
            *["AsyncRelay"] * (allowed.waiting and allowed.events),
            *["Relay", "Relay", "Doubter"] * allowed.events,
            *["Scaled"] * allowed.parameters,
            *["OnlyTwice"] * allowed.readiness,
        ]

    def parameters(self, kind: str) -> dict[str, Any]:
        """Choose the parameters of a node."""
        choose = self.choose
        match kind:
            case "script" | "ascript":
                values = [choose.one_of([1, 2, 0, 3, 4, 6, None]) for _ in range(choose.number(0, self.longest))]
                given: dict[str, Any] = {"values": tuple(values)}
                if kind == "ascript":
                    given["pause_s"] = choose.one_of([0.0, 0.004, 0.01])
                return given
            case "Script":
                return {"count": choose.number(0, self.longest)}
            case "some":
                return {"modulus": choose.number(2, 3)}
            case "Failing":
                return {"at": choose.number(2, 3)}
            case "slow_double" | "Waiting":
                return {"pause_s": choose.one_of([0.0, 0.003, 0.01])}
        return {}

    def options(self, kind: str) -> dict[str, Any]:
        """Choose the options of a node."""
        return self.pace(kind) | self.handling(kind) | self.states(kind)

    def pace(self, kind: str) -> dict[str, Any]:
        """Choose when a node fires."""
        options: dict[str, Any] = {}
        if self.chance(25):
            options["release"] = self.choose.one_of(["sequential", "pipelined"])
        if self.allowed.rates and self.chance(15):
            options["max_rate_hz"] = self.choose.one_of([100.0, 30.0, 70.0])
        return options

    def handling(self, kind: str) -> dict[str, Any]:
        """Choose what follows an error of a node."""
        if kind not in self.failing and not (self.allowed.failures and self.choose.chance(5)):
            return {}
        seldom = self.choose.chance(30)
        return {"on_error": self.choose.one_of(["skip", "restart", "disable", "stop"][: 4 if seldom else 2])}

    def states(self, kind: str) -> dict[str, Any]:
        """Choose how long a node is active, and whether it is enabled."""
        options: dict[str, Any] = {}
        if self.allowed.activity and self.chance(10):
            options["active_for_s"] = self.choose.one_of([0.02, 0.005])
        if self.allowed.disabling and self.choose.chance(4):
            options["enabled"] = False
        return options

    # --- ends

    @classmethod
    def description(cls, kind: str) -> Any:
        """Return the description of a node type of the library."""
        made: Any = getattr(import_module(cls.library), kind)
        return (made if isinstance(made, type) else type(made()))._type  # type: ignore[attr-defined]

    def type_of(self, name: str) -> Any:
        """Return the description of a node's type."""
        return self.description(next(node.type for node in self.nodes if node.name == name))

    def outputs(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Return outputs that any node may be connected to."""
        return [
            (node.name, "output", port)
            for node in nodes
            if node.type not in self.wired
            for port in self.type_of(node.name).outputs
        ]

    def events(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Return events with a value; at times including the `sent` events of outputs."""
        return self.own_events(nodes) + (self._sent(nodes) if self.chance(40) else [])

    def own_events(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Return events with a value that the types declare."""
        return [
            (node.name, "event", port)
            for node in nodes
            for port, spec in self.type_of(node.name).events.items()
            if spec.type is not None
        ]

    def _sent(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Return the `sent` events of outputs; a subgraph has none."""
        return [
            (node, "event", sent_name(port))
            for node, _, port in self.outputs(nodes)
            if not self.type_of(node).is_subgraph
        ]

    def signals(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Return events without a value, including automatic ones."""
        automatic = ["processed", "activated", "deactivated", "failed", "timeout"]
        own = [
            (node.name, "event", port)
            for node in nodes
            for port, spec in self.type_of(node.name).events.items()
            if spec.type is None
        ]
        start = [("", "event", "start")] if self.allowed.start else []
        return own + [(node.name, "event", self.choose.one_of(automatic)) for node in self._callable(nodes)] + start

    def _callable(self, nodes: Sequence[NodePlan]) -> list[NodePlan]:
        return [node for node in nodes if node.type not in self.left_alone]

    # --- edges

    def make_edges(self) -> None:
        """Make all edges."""
        for index, node in enumerate(self.nodes):
            self.make_inputs(index, node)
        if self.allowed.events:
            self._make_slot_edges()
        if self.allowed.parameters and self.choose.chance(30):
            self._make_parameter_edge()

    def make_inputs(self, index: int, node: NodePlan) -> None:
        """Make the edges into the inputs of a node."""
        for port, spec in self.type_of(node.name).inputs.items():
            if self.choose.chance(60 if spec.optional else 92):
                self.connect_input(index, (node.name, "input", port))

    def connect_input(self, index: int, target: End) -> None:
        """Connect an input to an earlier node, or to a later one by an edge with initial tokens."""
        choose, allowed = self.choose, self.allowed
        candidates = self.near(self.outputs(self.nodes[:index]))
        if allowed.events and self.chance(30):
            candidates = self.events(self.nodes[:index]) or candidates
        if allowed.cycles and self._has_other_input(target) and self.chance(30):
            candidates = self.outputs(self.nodes[index:])
            if allowed.events and choose.chance(30):
                candidates = self.events(self.nodes[index:]) or candidates
            if candidates:
                source = choose.one_of(candidates)
                self.connect(source, target, initial=[choose.number(0, 3) for _ in range(choose.number(1, 2))])
        elif candidates:
            self.connect(choose.one_of(candidates), target)

    def near(self, ends: list[End]) -> list[End]:
        """Return the outputs from which an input is connected."""
        return ends

    def _has_other_input(self, target: End) -> bool:
        """Return whether something other than a cycle feeds the node, so that the cycle ends."""
        return any(
            edge.target[0] == target[0] and edge.target[1] == "input" and "initial" not in edge.options
            for edge in self.edges
        )

    def most_slot_edges(self) -> int:
        """Return the number of edges into slots at most."""
        return 2 * len(self.nodes)

    def _make_slot_edges(self) -> None:
        choose, allowed = self.choose, self.allowed
        slots = [(node, port) for node in self.nodes for port in self.type_of(node.name).slots]
        slots = [(node, port) for node, port in slots if port != "poke" or allowed.failing_calls]
        for _ in range(choose.number(0, self.most_slot_edges())):
            if not slots or choose.chance(12):
                self._delicate_edge()
                continue
            node, port = choose.one_of(slots)
            nearby = self.nodes
            if port not in _BOUNDED_SLOTS or not allowed.cycles:
                nearby = self.nodes[: self.nodes.index(node)]
            candidates = self.events(nearby) + self.outputs(nearby)
            if port in self.any_slots:
                candidates += self.signals(nearby)
            if candidates:
                self.connect(choose.one_of(candidates), (node.name, "slot", port))
        if allowed.activity and allowed.start:
            self.make_first_activity(slots)

    def make_first_activity(self, slots: list[tuple[NodePlan, str]]) -> None:
        """Let the activity of the start go to a slot."""
        if slots and self.choose.chance(60):
            begins = [(node.name, "slot", port) for node, port in slots if port in self.any_slots]
            begins += [(node.name, "slot", "activate") for node in self._callable(self.nodes)]
            self.connect(("", "event", "start"), self.choose.one_of(begins), active=True)

    def _delicate_edge(self) -> None:
        choose, allowed = self.choose, self.allowed
        names = _DELICATE_SLOTS[0 if allowed.activity else 2 : 5 if allowed.disabling else 2]
        if not names:
            return
        name = choose.one_of(names)
        index = choose.number(0, len(self.nodes) - 1)
        if self.nodes[index].type in self.left_alone:
            return
        nearby = self.nodes[:index] if name in ("reset", "enable") else self.nodes
        candidates = self.events(nearby) + self.signals(nearby)
        if candidates:
            self.connect(choose.one_of(candidates), (self.nodes[index].name, "slot", name))

    def _make_parameter_edge(self) -> None:
        choose = self.choose
        owners = [(index, node) for index, node in enumerate(self.nodes) if node.type in self.turned]
        if not owners:
            return
        index, node = choose.one_of(owners)
        candidates = self.outputs(self.nodes[:index]) + (self.events(self.nodes[:index]) if self.allowed.events else [])
        if candidates:
            self.connect(choose.one_of(candidates), (node.name, "parameter", self.turned[node.type]))
        targets = [(one.name, "slot", "note") for one in self.nodes[index + 1 :] if one.type == "Tally"]
        if targets and node.type == "Scaled":
            self.connect((node.name, "parameter", "offset"), choose.one_of(targets))

    def connect(
        self, source: End, target: End, *, initial: list[int] | None = None, active: bool | None = None
    ) -> None:
        """Make one edge, unless there is one already, and choose its options."""
        if (source, target) in self.pairs or any(
            edge.target == target and target[1] in ("input", "parameter") for edge in self.edges
        ):
            return
        active = self.carries(source, target) if active is None else active
        options: dict[str, Any] = {"active": True} if active else {}
        if source[1] == "event" and target[1] != "parameter":
            options |= self.queue(active=active)
        if initial:
            options["initial"] = initial
        if source[1] != "event" and target[1] in ("input", "parameter") and self.chance(15):
            options["buffer"] = self.choose.number(1, 3)
        self.pairs.add((source, target))
        self.edges.append(EdgePlan(source, target, options))

    def carries(self, source: End, target: End) -> bool:
        """Choose whether an edge is active."""
        return self.allowed.activity and self.chance(35)

    def queue(self, *, active: bool) -> dict[str, Any]:
        """Choose the options of an edge from an event."""
        choose = self.choose
        options: dict[str, Any] = {}
        if choose.chance(30):
            options["capacity"] = choose.number(1, 3)
        if self.allowed.lossy and not active and choose.chance(12):
            options["overflow"] = choose.one_of(["drop_oldest", "drop_newest", "latest"])
            if options["overflow"] == "latest":
                options.pop("capacity", None)
        return options

    # --- subgraphs and gates

    def make_boxes(self) -> list[BoxPlan]:
        """Make subgraphs around some nodes, and around other subgraphs."""
        choose = self.choose
        boxes: list[BoxPlan] = []
        free = [node.name for node in self.nodes if node.type not in self.unboxed and not self._is_turned(node.name)]
        while len(boxes) < 3 and len(free) > 1 and choose.chance(40):
            members = [name for name in free if choose.chance(45)]
            if not members:
                break
            options = {"enabled": False} if self.allowed.disabling and choose.chance(5) else {}
            box = BoxPlan(f"box{len(boxes)}", tuple(members), options)
            boxes.append(box)
            free = [name for name in free if name not in members] + [box.name]
        return boxes

    def _is_turned(self, name: str) -> bool:
        ends = [end for edge in self.edges for end in (edge.source, edge.target)]
        return any(end[:2] == (name, "parameter") for end in ends)

    def make_gates(self) -> list[GatePlan]:
        """Gate a node by another one."""
        choose = self.choose
        if len(self.nodes) < 2 or not choose.chance(15):
            return []
        target = choose.one_of(self.nodes)
        by = choose.one_of([node for node in self.nodes if node is not target])
        return [self._gate(target.name, by.name)]

    def _gate(self, target: str, by: str) -> GatePlan:
        return GatePlan(target, by, self.choose.one_of([None, 100.0, 20.0]))

    def connect_boxes(self, boxes: list[BoxPlan], gates: list[GatePlan]) -> tuple[list[BoxPlan], list[GatePlan]]:
        """Connect the automatic ports of subgraphs, limit how long they are active, gate them."""
        choose, allowed = self.choose, self.allowed
        inside: dict[str, set[str]] = {}
        found = []
        for box in boxes:
            members = inside[box.name] = set().union(*({one, *inside.get(one, ())} for one in box.members))
            within = [node for node in self.nodes if node.name in members]
            if allowed.events and choose.chance(25):
                self._call_box(box.name, self.nodes[: self.nodes.index(within[0])], resets=self.may_reset(within))
            if allowed.events and allowed.activity and choose.chance(25):
                self._hear_box(box.name)
            if allowed.activity and choose.chance(10):
                box = replace(box, options=box.options | {"active_for_s": choose.one_of([0.02, 0.005])})
            others = [node.name for node in self.nodes if node.name not in members]
            if allowed.gates and others and not gates and choose.chance(10):
                pair = [box.name, choose.one_of(others)]
                gates = [self._gate(*(pair if choose.chance(50) else pair[::-1]))]
            found.append(box)
        return found, gates

    def may_reset(self, nodes: Sequence[NodePlan]) -> bool:
        """Return whether a subgraph around these nodes may be reset."""
        return True

    def _call_box(self, name: str, before: Sequence[NodePlan], *, resets: bool) -> None:
        choose, allowed = self.choose, self.allowed
        slots = ["disable", "enable"] if allowed.disabling else []
        slots += ["reset"] if allowed.disabling and resets else []
        slots += ["deactivate"] if allowed.activity else []
        if slots:
            slot = choose.one_of(slots)
            nearby = self.nodes if slot in ("disable", "deactivate") else before
            candidates = self.events(nearby) + self.signals(nearby)
            if candidates:
                self.connect(choose.one_of(candidates), (name, "slot", slot))

    def _hear_box(self, name: str) -> None:
        slots = [(node.name, "slot", port) for node in self.nodes for port in self.type_of(node.name).slots]
        slots = [slot for slot in slots if slot[2] in self.any_slots]
        slots += [(one.name, "slot", port) for one in self._callable(self.nodes) for port in ("activate", "deactivate")]
        event = self.choose.one_of(["activated", "deactivated", "timeout"])
        self.connect((name, "event", event), self.choose.one_of(slots))

"""Making random plans: one procedure for every kind of chooser.

Hypothesis chooses so that it can shrink; a seeded generator chooses fast.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from hfg.base.values import Colour, Span
from hfg.ports.automatic import sent_name
from hfg.testing import nodes as types
from hfg.testing.operators import through
from hfg.testing.plans import BoxPlan, EdgePlan, GatePlan, GraphPlan, NodePlan
from hfg.testing.strange import STRANGE

__all__ = [
    "FEEDS",
    "SYNCHRONOUS",
    "WIDE",
    "Allowed",
    "Chooser",
    "SeededChooser",
    "description",
    "make_plan",
    "random_plan",
]

T = TypeVar("T")
End = tuple[str, str, str]


class Chooser(Protocol):
    """Somebody who can choose."""

    def number(self, least: int, most: int) -> int:
        """Choose a whole number; `least` is the simplest."""

    def one_of(self, choices: Sequence[T]) -> T:
        """Choose one; the first is the simplest."""

    def chance(self, percent: int) -> bool:
        """Say yes so often; no is simpler."""


class SeededChooser:
    """Chooses by a seeded generator."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)

    def number(self, least: int, most: int) -> int:
        """Choose a whole number."""
        return self._random.randint(least, most)

    def one_of(self, choices: Sequence[T]) -> T:
        """Choose one."""
        return choices[self._random.randrange(len(choices))]

    def chance(self, percent: int) -> bool:
        """Say yes so often."""
        return self._random.randrange(100) < percent


@dataclass(frozen=True)
class Allowed:
    """Features that may occur in a plan; a test of one rule omits unrelated ones."""

    max_nodes: int = 7
    events: bool = True
    activity: bool = True
    cycles: bool = True
    failures: bool = True
    boxes: bool = True
    box_ports: bool = True  # subgraphs are meant themselves: their automatic ports, gates on them and by them
    gates: bool = True
    rates: bool = True
    waiting: bool = True
    operators: bool = True
    lossy: bool = True
    parameters: bool = True
    disabling: bool = True
    readiness: bool = True
    concurrency: bool = False  # several firings of async nodes under way at once
    retries: bool = False  # firings that fail are tried again
    tasks: bool = False  # nodes start something beside their firings, outside of subgraphs
    doing: bool = False  # nodes have do-activities
    rings: bool = False  # of requests and answers, which only queues hold up, beside what goes on anyway
    through: bool = False  # operators on edges, with schedulers and without
    iteration: bool = False  # inside of iteration
    endings: bool = False  # last words, sources without end that work for who will have ended
    clinging: bool = False  # teardowns that hang
    tuned: bool = False  # parameters of every kind
    threads: bool = False
    feeds: bool = False
    sources: bool = True
    pairs: bool = False  # sources with several outputs
    start: bool = True
    failing_calls: bool = True
    sending: bool = False  # nodes send in every way there is, from plain code and async, which pauses or not
    strange: bool = False  # values that raise when they are looked at; most errors are skipped
    plain: bool = False  # mostly functions close to each other: the shapes of which regions are fused
    alive: bool = False  # activity everywhere: nodes that fire, are called and trigger, gates, active edges


SYNCHRONOUS = Allowed(
    events=False,
    activity=False,
    failures=False,
    gates=False,
    operators=False,
    lossy=False,
    disabling=False,
    readiness=False,
)
"""What rule F7 speaks of."""

WIDE = Allowed(through=True, iteration=True, endings=True, clinging=True)
"""All in which something was wrong once."""

_INNER = [
    "double",
    "add",
    "some",
    "sink",
    "Passing",
    "Merge",
    "Latch",
    "Counter",
    "Pulse",
    "Greeter",
    "Stateful",
    "Sieve",
    "Tally",
]
_INNER_WHERE: list[tuple[Callable[[Allowed], bool], list[str]]] = [
    (lambda allowed: allowed.failures, ["Failing"] * 2),
    (lambda allowed: allowed.waiting, ["slow_double", "Waiting"]),
    (lambda allowed: allowed.waiting and allowed.events, ["AsyncRelay"]),
    (lambda allowed: allowed.events, ["Relay", "Relay", "Doubter"]),
    (lambda allowed: allowed.parameters, ["Scaled"]),
    (lambda allowed: allowed.readiness, ["OnlyTwice"]),
    (lambda allowed: allowed.retries, ["Unsteady"] * 3 + ["Stubborn"] * 2),
    (lambda allowed: allowed.tasks, ["Tends"] * 4 + ["Beats"] * 3),
    (lambda allowed: allowed.strange, ["odd"] * 4),
    (lambda allowed: allowed.sending, ["Speaks", "SpeaksTwice", "Lends", "Passing"]),
    (lambda allowed: allowed.sending and allowed.waiting, ["SpeaksLater", "SpeaksTwiceLater", "LendsLater"]),
    (lambda allowed: allowed.sending and allowed.waiting, ["PassingLater"]),
    (lambda allowed: allowed.sending and allowed.events and allowed.failing_calls, ["Utters", "Utters"]),
    (lambda allowed: allowed.sending and allowed.waiting and allowed.events and allowed.failing_calls, ["UttersLater"]),
    (lambda allowed: allowed.doing, ["Works"] * 6),
    (lambda allowed: allowed.endings and not allowed.plain, ["LastWord", "LastWord", "Hums"]),
    (lambda allowed: allowed.iteration and not allowed.plain, ["EachOfEach"]),
    (lambda allowed: allowed.tuned, ["Tuned"] * 6),
    (lambda allowed: allowed.clinging and not allowed.plain, ["Clings"]),
]
"""More of them; a kind that stands there several times is chosen as often."""

_BEFORE = {"EachOfEach": "listed"}
_BEHIND = {"EachOfEach": "summed", "Hums": "add", "LastWord": "add", "Lends": "unlent", "LendsLater": "unlent"}
"""What such a node is made with: it needs a consumer, or a producer, of its own."""

_JOINS = ["add", "either", "with_default"]
_PLAIN = [*_JOINS * 3, "double", "some", "some", "some", "sink", "parted", "Sends", "mood", "calm"]
_STRANGE = [what for what in STRANGE if what not in ("huge number", "deep list")]  # which only take long

_ALIVE = ["Lives"] * 8 + ["LivesTwice"] * 4 + ["Heeds"] * 4 + ["Attentive", "Tally", "Stateful", "Passing"]
_PLAIN_WHERE_CODE_WAITS = ["restless", "calling"]
_PLAIN_WHERE_CODE_FAILS = ["picky", "picky", "gives_up"]
_PLAIN_WHERE_ACTIVITY_MOVES = ["handing"]
_PLAIN_SENDING = ["Speaks", "Speaks", "SpeaksTwice", "Lends"]
_PLAIN_SENDING_LATER = ["SpeaksLater", "SpeaksLater", "SpeaksTwiceLater", "LendsLater"]
_SPEAKING_SOURCES = ["Talks", "Draws"]
_SPEAKING_SOURCES_LATER = ["TalksLater"]
_SPEAKING = ("Speaks", "SpeaksLater", "SpeaksTwice", "SpeaksTwiceLater", *_SPEAKING_SOURCES, *_SPEAKING_SOURCES_LATER)
"""Whose way to answer is a parameter."""

_PAUSING = ("SpeaksLater", "SpeaksTwiceLater", "LendsLater", "PassingLater", "UttersLater", *_SPEAKING_SOURCES_LATER)
"""What their async code does before it answers is a parameter, too."""
FEEDS = ("red", "blue")
"""The inputs of graphs that are fed from outside."""

_TENDING = ("Tends", "Beats", "Gate", "Watch")
"""Whose code starts tasks."""

_ANSWERING = ["slow_double", "slow_double", "double", "Waiting", "some", "Pulse", "add"]
"""What stands between a question and its answer."""

_WAITING = {
    "ascript",
    "slow_double",
    "Waiting",
    "AsyncRelay",
    "calm",
    "restless",
    "calling",
    "Unsteady",
    *_TENDING,
    *_PAUSING,
    "Works",
}
_ANY_SLOTS = {"nudge", "tell", "begin", "more", "hear", "ping", "gave"}
_BOUNDED_SLOTS = {"say", "hand_on", "hear", "utter"}
_TURNED = {"Scaled": "factor", "Pulse": "most", "Script": "count", "Hums": "tone"}
"""Parameters that edges set; a source with such an edge waits for it."""

_WIRED = ("listed", "EachOfEach", "Hums", "LastWord", "Lends", "LendsLater")
"""Whose outputs lead where they were made for, and nowhere else."""

_LEFT_ALONE = ("EachOfEach", "Clings")
"""Who has no slots to be called, or would hang when it is reset."""

_OPERATORS: list[tuple[str, list[float]]] = [
    ("start_with", [5]),
    ("skip", [1]),
    ("take", [2]),
    ("retry", [2]),
    ("in_rows", [2, 3]),
    ("at_last", [8]),
    ("debounce", [0.004, 0.02]),
    ("delay", [0.003, 0.01]),
    ("throttle_first", [0.005]),
    ("beside_a_timer", [0.002, 0.02]),
]
_SEVERAL = ("slow_double", "Waiting", "restless", "calm", "Unsteady", "SpeaksLater", "SpeaksTwiceLater")
_TRIED_AGAIN = ("Unsteady", "Stubborn")

_TUNED: dict[str, list[Any]] = {
    "soft": [True],
    "effort": [types.Effort.MUCH, types.Effort.LITTLE],
    "code": [0, 8],
    "sides": [frozenset({"left"}), frozenset({"right", "left"})],
    "picks": [["b"], ["c", "a", "c"]],
    "share": [0.25, 1.0, 0],
    "band": [Span(1, 1), Span(-9, 9)],
    "frame": [Colour(0, 0, 0), Colour(1, 2, 3)],
    "file": [Path("b.jpg"), Path("a b/../ü: #.png")],
    "folder": [Path(), Path("/there")],
    "gains": [(3, 2, 1), (-1, 0, 10**12)],
    "turn": [np.zeros((2, 2)), np.array([[1.5, -2.0], [0.0, 7.25]])],
    "names": [["no"], ["- x", "", "a: b\nc "]],
}
"""What the parameters of every kind are set to."""

_DELICATE_SLOTS = ["activate", "deactivate", "reset", "disable", "enable"]


class _Making:
    def __init__(self, choose: Chooser, allowed: Allowed) -> None:
        self.choose = choose
        self.allowed = allowed
        self.nodes: list[NodePlan] = []
        self.edges: list[EdgePlan] = []
        self.pairs: set[tuple[End, End]] = set()

    # --- nodes

    def make_nodes(self) -> None:
        choose, allowed = self.choose, self.allowed
        sources = ["script", "Script"] + (["ascript"] if allowed.waiting else [])
        if allowed.sending:
            sources += _SPEAKING_SOURCES + (_SPEAKING_SOURCES_LATER if allowed.waiting else [])
        sources += ["Pairs"] * 2 * allowed.pairs + ["Ticks"] * 3 * allowed.alive
        count = choose.number(2, allowed.max_nodes)
        inner, plain = self._inner_kinds(), self._plain_kinds()
        for number in range(count):
            if allowed.sources and (number == 0 or choose.chance(self._seldom(20))):
                kind = choose.one_of(sources)
            else:
                kind = choose.one_of(plain if allowed.plain and not choose.chance(15) else inner)
            if kind in _BEFORE:
                self.nodes.append(NodePlan(f"n{number}before", _BEFORE[kind]))
            self.nodes.append(NodePlan(f"n{number}", kind, self._parameters(kind), self._options(kind)))
            if kind in _BEHIND:
                self.nodes.append(NodePlan(f"n{number}behind", _BEHIND[kind]))

    def make_rings(self) -> None:
        """Requests that come back as answers into a slot, and alongside them nodes that keep running."""
        choose = self.choose
        for number in range(choose.number(1, 2)):
            gate, worker = f"gate{number}", f"worker{number}"
            how = choose.one_of(["burst", "task", "both", "again"])
            self.nodes.append(NodePlan(gate, "Gate", {"count": choose.number(1, 9), "how": how}))
            kind = choose.one_of(_ANSWERING)
            answering = NodePlan(worker, kind, self._parameters(kind), self._options(kind))
            self.nodes.append(answering)
            inputs, outputs = description(kind).inputs, description(kind).outputs
            self._edge((gate, "event", "request"), (worker, "input", next(iter(inputs))))
            if "b" in inputs:
                self._edge((gate, "event", choose.one_of(["aside", "request"])), (worker, "input", "b"))
            answer = (worker, "event", "pulse") if kind == "Pulse" else (worker, "output", next(iter(outputs)))
            self._edge(answer, (gate, "slot", "answer"))
            self._edge(("", "event", "start"), (gate, "slot", "begin"))
        if choose.chance(80):
            given = {"period_s": choose.one_of([0.02, 0.007]), "count": choose.number(2, 8)}
            self.nodes.append(NodePlan("watch", "Watch", given))

    def _inner_kinds(self) -> list[str]:
        kinds = list(_INNER)
        for is_allowed, more in _INNER_WHERE:
            kinds += more if is_allowed(self.allowed) else []
        return kinds

    def _plain_kinds(self) -> list[str]:
        allowed = self.allowed
        kinds = list(_PLAIN)
        kinds += _PLAIN_WHERE_CODE_WAITS if allowed.waiting else []
        kinds += _PLAIN_WHERE_CODE_FAILS if allowed.failures else []
        kinds += _PLAIN_WHERE_ACTIVITY_MOVES if allowed.activity else []
        kinds += ["odd"] * 2 if allowed.strange else []
        kinds += _ALIVE + ["Works"] * allowed.doing if allowed.alive else []
        kinds += _PLAIN_SENDING if allowed.sending else []
        kinds += _PLAIN_SENDING_LATER if allowed.sending and allowed.waiting else []
        return kinds

    def _seldom(self, percent: int) -> int:
        """Features that keep a node out of a region, or split one, should be rare where regions are wanted."""
        return percent // 3 if self.allowed.plain else percent

    def _parameters(self, kind: str) -> dict[str, Any]:
        choose = self.choose
        match kind:
            case "script" | "ascript":
                most = 24 if self.allowed.plain else 5
                values = [choose.one_of([1, 2, 0, 3, 4, 6, None]) for _ in range(choose.number(0, most))]
                given: dict[str, Any] = {"values": tuple(values)}
                if kind == "ascript":
                    given["pause_s"] = choose.one_of([0.0, 0.004, 0.01])
                return given
            case "Lives" | "Heeds":
                return {"every": choose.number(1, 4)}
            case "Ticks":
                return {"count": choose.number(4, 14), "every": choose.number(2, 4)}
            case "Script" | "Pairs":
                return {"count": choose.number(0, 24 if self.allowed.plain else 5)}
            case _ if kind in (*_SPEAKING, *_PAUSING):
                return self._speaking(kind)
            case "odd":
                return {"what": choose.one_of(_STRANGE), "every": choose.number(1, 3)}
            case "some":
                return {"modulus": choose.number(2, 3)}
            case "Failing" | "picky" | "gives_up":
                return {"at": choose.number(2, 3)}
            case "Tends" | "Beats":  # whose steps of one moment are in the order in which they were set
                return {"pause_s": choose.one_of([0.003, 0.01])}
            case "Works":
                manners = ["at once", "later", "tells", "fails", "long"]
                manners += ["resists", "clings"] if self.allowed.clinging else []
                return {"manner": choose.one_of(manners), "pause_s": choose.one_of([0.003, 0.01])}
            case "slow_double" | "Waiting" | "Unsteady":
                return {"pause_s": choose.one_of([0.0, 0.003, 0.01])}
            case "Tuned":
                return {name: choose.one_of(values) for name, values in _TUNED.items() if choose.chance(40)}
        return {}

    def _speaking(self, kind: str) -> dict[str, Any]:
        """How a node answers, and what it does before."""
        choose, allowed = self.choose, self.allowed
        given: dict[str, Any] = {}
        if kind in _SPEAKING:
            ways = [way for way in types.WAYS if allowed.activity or way not in ("held", "given", "taken")]
            given["way"] = choose.one_of([*ways, "both"] if allowed.failures and choose.chance(10) else ways)
        if kind in _PAUSING:
            given["pause"] = choose.one_of(types.PAUSES)
        if kind in (*_SPEAKING_SOURCES, *_SPEAKING_SOURCES_LATER):
            given["count"] = choose.number(0, 24 if allowed.plain else 5)
        if kind == "SpeaksLater" and choose.chance(25):
            given["by_task"] = True
        return given

    def _options(self, kind: str) -> dict[str, Any]:
        choose, allowed = self.choose, self.allowed
        options: dict[str, Any] = {}
        if choose.chance(self._seldom(40 if allowed.threads else 25)):
            options["release"] = choose.one_of(["sequential", "pipelined"])
        if allowed.rates and choose.chance(self._seldom(15)):
            options["max_rate_hz"] = choose.one_of([100.0, 30.0, 70.0])
        if kind == "EachOfEach":
            return {name: value for name, value in options.items() if name == "release"}
        if kind == "Hums" and choose.chance(50):
            options["max_rate_hz"] = 100.0
        if kind == "Clings":
            return options
        if kind in ("Failing", "picky", "gives_up", "Utters", "UttersLater", "Works", *_TENDING, *_SPEAKING) or (
            allowed.failures and choose.chance(5)
        ):
            options["on_error"] = choose.one_of(
                ["skip", "restart", "disable", "stop"] if choose.chance(30) else ["skip", "restart"]
            )
        if allowed.strange and "on_error" not in options and not choose.chance(10):
            options["on_error"] = choose.one_of(["skip", "skip", "skip", "restart", "disable"])
        if kind in _TRIED_AGAIN:
            options |= self._trying_again(kind)
        if allowed.activity and choose.chance(self._seldom(10)):
            options["active_for_s"] = choose.one_of([0.02, 0.005])
        if allowed.disabling and choose.chance(4):
            options["enabled"] = False
        if allowed.threads and kind not in _WAITING and choose.chance(self._seldom(50)):
            options["group"] = choose.one_of(["left", "right"])
        return options

    def _trying_again(self, kind: str) -> dict[str, Any]:
        """How often, and when, a firing that has failed is tried again; what follows after the last attempt (X1)."""
        choose = self.choose
        options: dict[str, Any] = {"retries": choose.number(1, 4), "retry_backoff_s": choose.one_of([0.004, 0.0, 0.02])}
        if choose.chance(30):
            options["retry_backoff_max_s"] = 0.006
        if choose.chance(25):
            options["retry_on"] = choose.one_of([("OSError",), ("ValueError",), ("hfg.errors:FiringTimeout",)])
        if kind == "Unsteady" and choose.chance(20):
            options["max_duration_s"] = 0.005
        options["on_error"] = choose.one_of(["skip", "skip", "skip", "restart", "disable", "stop"])
        return options

    # --- ends

    def type_of(self, name: str) -> Any:
        plan = next(node for node in self.nodes if node.name == name)
        return description(plan.type)

    def outputs(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Return outputs that any node may be connected to."""
        return [
            (node.name, "output", port)
            for node in nodes
            if node.type not in _WIRED
            for port in self.type_of(node.name).outputs
        ]

    def events(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Events with a value; now and then what outputs have sent is among them."""
        own = [
            (node.name, "event", port)
            for node in nodes
            for port, spec in self.type_of(node.name).events.items()
            if spec.type is not None
        ]
        own += [(node.name, "event", "completed") for node in nodes if node.type == "Works"]
        return own + (self._sent(nodes) if self.choose.chance(self._seldom(40)) else [])

    def _sent(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Return the `sent` events of outputs; a subgraph has none."""
        return [
            (node, "event", sent_name(port))
            for node, _, port in self.outputs(nodes)
            if not self.type_of(node).is_subgraph
        ]

    def signals(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Events without a value, automatic ones too."""
        automatic = ["processed", "activated", "deactivated", "failed", "timeout"]
        own = [
            (node.name, "event", port)
            for node in nodes
            for port, spec in self.type_of(node.name).events.items()
            if spec.type is None
        ]
        told = [node for node in nodes if node.type not in _LEFT_ALONE]
        start = [("", "event", "start")] if self.allowed.start else []
        return own + [(node.name, "event", self.choose.one_of(automatic)) for node in told] + start

    # --- edges

    def make_edges(self) -> None:
        choose, allowed = self.choose, self.allowed
        for index, node in enumerate(self.nodes):
            near = self.outputs(self.nodes[:index]) if node.type == "Hums" and allowed.parameters else []
            if near and choose.chance(85):
                self._edge(choose.one_of(near), (node.name, "parameter", "tone"))
            for port, spec in self.type_of(node.name).inputs.items():
                if index and self.nodes[index - 1].type in _WIRED and port != "a":
                    self._wire(self.nodes[index - 1], (node.name, "input", port))
                    continue
                if choose.chance(92 if not spec.optional or allowed.plain else 60):
                    self._connect_input(index, (node.name, "input", port))
        if allowed.events:
            self._make_slot_edges()
        if allowed.parameters and choose.chance(30):
            self._make_parameter_edge()

    def _connect_input(self, index: int, target: End) -> None:
        choose, allowed = self.choose, self.allowed
        before = self.nodes[:index]
        candidates = self.outputs(before)
        if allowed.feeds and choose.chance(40):
            self._edge(("", "output", choose.one_of(FEEDS)), target)
            return
        if allowed.plain and choose.chance(90):
            candidates = candidates[-3:]
        if allowed.events and choose.chance(self._seldom(30)):
            candidates = self.events(before) or candidates
        if allowed.cycles and self._has_other_input(target) and choose.chance(self._seldom(30)):
            candidates = self.outputs(self.nodes[index:])
            if allowed.events and choose.chance(30):
                candidates = self.events(self.nodes[index:]) or candidates
            if candidates:
                self._edge(
                    choose.one_of(candidates), target, initial=[choose.number(0, 3) for _ in range(choose.number(1, 2))]
                )
            return
        if candidates:
            self._edge(choose.one_of(candidates), target)

    def _wire(self, before: NodePlan, target: End) -> None:
        """Connect a node to the one that it was made for."""
        source = (before.name, "output", next(iter(self.type_of(before.name).outputs)))
        if before.type == "LastWord" and self.allowed.activity:  # what it says at last is to lie before its END
            initial = [0] if self.choose.chance(50) else None
            self._edge(source, target, active=True, initial=initial)
            self._edge(("", "event", "start"), (before.name, "slot", "activate"))
        else:
            self._edge(source, target, active=False if before.type == "listed" else None)

    def _has_other_input(self, target: End) -> bool:
        """Return whether something else than a ring feeds the node, so that the ring ends."""
        return any(
            edge.target[0] == target[0] and edge.target[1] == "input" and "initial" not in edge.options
            for edge in self.edges
        )

    def _make_slot_edges(self) -> None:
        choose, allowed = self.choose, self.allowed
        slots = [(node, port) for node in self.nodes for port in self.type_of(node.name).slots]
        slots = [(node, port) for node, port in slots if port != "poke" or allowed.failing_calls]
        sparse = allowed.plain and not allowed.alive
        for _ in range(choose.number(0, (len(self.nodes) // 4) if sparse else 2 * len(self.nodes))):
            if not slots or choose.chance(12):
                self._delicate_edge()
                continue
            node, port = choose.one_of(slots)
            index = self.nodes.index(node)
            nearby = self.nodes if port in _BOUNDED_SLOTS and allowed.cycles else self.nodes[:index]
            candidates = self.events(nearby) + self.outputs(nearby)
            if port in _ANY_SLOTS:
                candidates += self.signals(nearby)
            if candidates:
                self._edge(choose.one_of(candidates), (node.name, "slot", port))
        for node in self.nodes:
            if node.type == "Works" and allowed.activity and allowed.start and choose.chance(40):
                self._edge(("", "event", "start"), (node.name, "slot", "activate"), active=True)
        for _ in range(choose.number(1, 3) if allowed.alive else 0):
            self._edge(("", "event", "start"), (choose.one_of(self.nodes).name, "slot", "activate"), active=True)
        if allowed.activity and allowed.start and slots and choose.chance(60):
            begins = [(node.name, "slot", port) for node, port in slots if port in _ANY_SLOTS]
            begins += [(node.name, "slot", "activate") for node in self.nodes if node.type not in _LEFT_ALONE]
            self._edge(("", "event", "start"), choose.one_of(begins), active=True)

    def _delicate_edge(self) -> None:
        choose, allowed = self.choose, self.allowed
        names = _DELICATE_SLOTS if allowed.disabling else _DELICATE_SLOTS[:2]
        if not allowed.activity:
            names = names[2:]
        if not names:
            return
        name = choose.one_of(names)
        index = choose.number(0, len(self.nodes) - 1)
        if self.nodes[index].type in _LEFT_ALONE:
            return
        nearby = self.nodes[:index] if name in ("reset", "enable") else self.nodes
        candidates = self.events(nearby) + self.signals(nearby)
        if candidates:
            self._edge(choose.one_of(candidates), (self.nodes[index].name, "slot", name))

    def _make_parameter_edge(self) -> None:
        choose = self.choose
        owners = [(index, node) for index, node in enumerate(self.nodes) if node.type in _TURNED]
        if not owners:
            return
        index, node = choose.one_of(owners)
        candidates = self.outputs(self.nodes[:index]) + (self.events(self.nodes[:index]) if self.allowed.events else [])
        if candidates:
            self._edge(choose.one_of(candidates), (node.name, "parameter", _TURNED[node.type]))
        targets = [(one.name, "slot", "note") for one in self.nodes[index + 1 :] if one.type == "Tally"]
        if targets and node.type == "Scaled":
            self._edge((node.name, "parameter", "offset"), choose.one_of(targets))

    def _edge(self, source: End, target: End, *, initial: list[int] | None = None, active: bool | None = None) -> None:
        choose, allowed = self.choose, self.allowed
        if (source, target) in self.pairs or any(
            edge.target == target and target[1] in ("input", "parameter") for edge in self.edges
        ):
            return
        options: dict[str, Any] = {}
        often = 60 if allowed.alive and "slot" in (source[1], target[1]) else self._seldom(35 * (1 + allowed.alive))
        active = (allowed.activity and choose.chance(often)) if active is None else active
        if active:
            options["active"] = True
        if source[1] == "event" and target[1] != "parameter":
            if choose.chance(30):
                options["capacity"] = choose.number(1, 3)
            if allowed.lossy and not active and choose.chance(12):
                options["overflow"] = choose.one_of(["drop_oldest", "drop_newest", "latest"])
                if options["overflow"] == "latest":
                    options.pop("capacity", None)
            if allowed.through and not active and choose.chance(15):
                name, amounts = choose.one_of(_OPERATORS)
                options["through"] = [through(name, choose.one_of(amounts))]
        if initial:
            options["initial"] = initial
        if source[1] != "event" and target[1] in ("input", "parameter") and choose.chance(self._seldom(15)):
            options["buffer"] = choose.number(1, 3)
        self.pairs.add((source, target))
        self.edges.append(EdgePlan(source, target, options))

    # --- the rest

    def make_concurrent(self) -> None:
        """Let some async nodes have several firings in progress; those with active edges may not (F14)."""
        choose = self.choose
        carrying = {end[0] for edge in self.edges if edge.options.get("active") for end in (edge.source, edge.target)}
        for index, node in enumerate(self.nodes):
            if node.type in _SEVERAL and node.name not in carrying and choose.chance(70):
                options = {name: value for name, value in node.options.items() if name != "release"}
                options |= {"concurrency": choose.number(2, 3)} | ({"ordered": False} if choose.chance(40) else {})
                self.nodes[index] = replace(node, options=options)

    def make_boxes(self) -> list[BoxPlan]:
        choose = self.choose
        boxes: list[BoxPlan] = []
        left = ("Clings", *_TENDING)
        free = [node.name for node in self.nodes if node.type not in left and not self._has_parameter_edge(node.name)]
        while len(boxes) < 3 and len(free) > 1 and choose.chance(40):
            members = [name for name in free if choose.chance(45)]
            if not members:
                break
            options: dict[str, Any] = {}
            if self.allowed.disabling and choose.chance(5):
                options["enabled"] = False
            box = BoxPlan(f"box{len(boxes)}", tuple(members), options)
            boxes.append(box)
            free = [name for name in free if name not in members] + [box.name]
        return boxes

    def _has_parameter_edge(self, name: str) -> bool:
        return any(
            end[0] == name and end[1] == "parameter" for edge in self.edges for end in (edge.source, edge.target)
        )

    def make_gates(self) -> list[GatePlan]:
        choose, alive = self.choose, self.allowed.alive
        if len(self.nodes) < 2 or not choose.chance(70 if alive else 15):
            return []
        gates: dict[str, GatePlan] = {}
        for _ in range(choose.number(1, 4) if alive else 1):
            target = choose.one_of(self.nodes).name
            by = choose.one_of([node for node in self.nodes if node.name != target])
            gates[target] = GatePlan(target, by.name, choose.one_of([None] * (1 + 7 * alive) + [100.0, 20.0]))
        return list(gates.values())

    def mean_boxes(self, boxes: list[BoxPlan], gates: list[GatePlan]) -> tuple[list[BoxPlan], list[GatePlan]]:
        """Connect the automatic ports of subgraphs, limit how long they are active, gate them."""
        choose, allowed = self.choose, self.allowed
        inside: dict[str, set[str]] = {}
        found = []
        for box in boxes:
            members = inside[box.name] = set().union(*({one, *inside.get(one, ())} for one in box.members))
            first = min(index for index, node in enumerate(self.nodes) if node.name in members)
            if allowed.events and choose.chance(25):
                does = any(node.type == "Works" and node.name in members for node in self.nodes)
                self._call_box(box.name, self.nodes[:first], resets=not does)  # which would have to wait for its end
            if allowed.events and allowed.activity and choose.chance(25):
                self._hear_box(box.name)
            if allowed.activity and choose.chance(10):
                box = replace(box, options=box.options | {"active_for_s": choose.one_of([0.02, 0.005])})
            others = [node.name for node in self.nodes if node.name not in members]
            if allowed.gates and others and not gates and choose.chance(10):
                pair = [box.name, choose.one_of(others)]
                target, by = pair if choose.chance(50) else pair[::-1]
                gates = [GatePlan(target, by, choose.one_of([None, 100.0, 20.0]))]
            found.append(box)
        return found, gates

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
                self._edge(choose.one_of(candidates), (name, "slot", slot))

    def _hear_box(self, name: str) -> None:
        choose = self.choose
        slots = [(node.name, "slot", port) for node in self.nodes for port in self.type_of(node.name).slots]
        slots = [slot for slot in slots if slot[2] in _ANY_SLOTS]
        told = [node for node in self.nodes if node.type not in _LEFT_ALONE]
        slots += [(node.name, "slot", port) for node in told for port in ("activate", "deactivate")]
        event = choose.one_of(["activated", "deactivated", "timeout"])
        self._edge((name, "event", event), choose.one_of(slots))


def description(kind: str) -> Any:
    """Return the type of a node of a plan, by its name."""
    made: Any = getattr(types, kind)
    return (made if isinstance(made, type) else type(made()))._type  # type: ignore[attr-defined]


def make_plan(choose: Chooser, allowed: Allowed | None = None) -> GraphPlan:
    """Make a plan by asking `choose` again and again."""
    allowed = allowed or Allowed()
    making = _Making(choose, allowed)
    making.make_nodes()
    if allowed.rings:
        making.make_rings()
    making.make_edges()
    boxes = making.make_boxes() if allowed.boxes else []
    gates = making.make_gates() if allowed.gates else []
    if allowed.box_ports:
        boxes, gates = making.mean_boxes(boxes, gates)
    if allowed.concurrency:
        making.make_concurrent()
    groups = ("left", "right") if allowed.threads else ()
    feeds = tuple(name for name in FEEDS if any(edge.source == ("", "output", name) for edge in making.edges))
    return GraphPlan(tuple(making.nodes), tuple(making.edges), tuple(boxes), tuple(gates), groups, feeds)


def random_plan(seed: int, allowed: Allowed | None = None) -> GraphPlan:
    """Make the plan of a seed; much faster than Hypothesis, but nothing shrinks."""
    return make_plan(SeededChooser(seed), allowed)

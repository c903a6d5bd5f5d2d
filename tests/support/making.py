"""Random plans for the tests of hfg itself: with every kind of node in which something was wrong once.

Node types are in `kinds`. The plan of a seed must stay the same: tests name seeds that once found a fault.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Final, TypeVar

import numpy as np
from hypothesis import strategies as st

from hfg.base.values import Colour, Span
from hfg.testing import making
from hfg.testing.making import End, Making
from hfg.testing.plans import GatePlan, GraphPlan, NodePlan
from hfg.testing.strategies import DrawingChooser
from tests.support import kinds
from tests.support.operators import through
from tests.support.strange import STRANGE

__all__ = ["FEEDS", "SYNCHRONOUS", "WIDE", "Allowed", "SeededChooser", "Wide", "graphs", "make_plan", "random_plan"]

T = TypeVar("T")


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
        """Return True with this probability."""
        return self._random.randrange(100) < percent


@dataclass(frozen=True)
class Allowed(making.Allowed):
    """More features.

    Attributes:
      concurrency: several firings of an async node at a time.
      retries: firings that fail are tried again.
      tasks: nodes start tasks next to their firings, outside subgraphs.
      doing: nodes have do-activities.
      rings: cycles of requests and answers that only queues limit, next to nodes that keep running.
      through: operators on edges, with schedulers and without.
      iteration: nodes inside iteration.
      endings: last words, and endless sources for consumers that will have ended.
      clinging: teardowns that hang.
      tuned: parameters of every kind.
      pairs: sources with several outputs.
      sending: nodes send in every way there is, from plain and async code, with and without pauses.
      strange: values that raise when they are inspected; most errors are skipped.
      plain: mostly functions next to each other: the shapes that regions are made of.
      large: regions of 10 to 60 members, with joins over several levels; only if `plain`.
      alive: activity everywhere: nodes that fire, are called and trigger, gates, active edges.
    """

    concurrency: bool = False
    retries: bool = False
    tasks: bool = False
    doing: bool = False
    rings: bool = False
    through: bool = False
    iteration: bool = False
    endings: bool = False
    clinging: bool = False
    tuned: bool = False
    threads: bool = False
    feeds: bool = False
    sources: bool = True
    pairs: bool = False
    sending: bool = False
    strange: bool = False
    plain: bool = False
    large: bool = False
    alive: bool = False


SYNCHRONOUS: Final = Allowed(
    events=False, activity=False, failures=False, gates=False, lossy=False, disabling=False, readiness=False
)
WIDE: Final = Allowed(through=True, iteration=True, endings=True, clinging=True)

FEEDS: Final = ("red", "blue")
"""The inputs of graphs that are fed from outside."""

_BEFORE: Final = {"EachOfEach": "listed"}
_AFTER: Final = {"EachOfEach": "summed", "Hums": "add", "LastWord": "add", "Lends": "unlent", "LendsLater": "unlent"}
"""Nodes that are made together with another one, as its only producer or consumer."""

_ALIVE: Final = (*("Lives",) * 8, *("LivesTwice",) * 4, *("Heeds",) * 4, "Attentive", "Tally", "Stateful", "Passing")
_JOINS: Final = ["add", "either", "with_default"]
_STRANGE: Final = [what for what in STRANGE if what not in ("huge number", "deep list")]  # which only take long
_SPEAKING_SOURCES: Final = ("Talks", "Draws")
_SPEAKING: Final = ("Speaks", "SpeaksLater", "SpeaksTwice", "SpeaksTwiceLater", *_SPEAKING_SOURCES, "TalksLater")
"""Types with a parameter that chooses how they answer."""

_PAUSING: Final = ("SpeaksLater", "SpeaksTwiceLater", "LendsLater", "PassingLater", "UttersLater", "TalksLater")
"""Types with a parameter that chooses what their async code does before it answers."""

_TENDING: Final = ("Tends", "Beats", "Gate", "Watch")
"""Types that start tasks."""

_ANSWERING: Final = ("slow_double", "slow_double", "double", "Waiting", "some", "Pulse", "add")
"""Types between a request and its answer."""

_WAITING: Final = {
    *("ascript", "slow_double", "Waiting", "AsyncRelay", "calm", "restless", "calling", "Unsteady", "Works"),
    *_TENDING,
    *_PAUSING,
}
_SEVERAL: Final = ("slow_double", "Waiting", "restless", "calm", "Unsteady", "SpeaksLater", "SpeaksTwiceLater")
_OPERATORS: Final[list[tuple[str, list[float]]]] = [
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
_TUNED: Final[dict[str, list[Any]]] = {
    "soft": [True],
    "effort": [kinds.Effort.MUCH, kinds.Effort.LITTLE],
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
"""Values of the parameters of every kind."""


class Wide(Making):
    """Adds the features of `Allowed`."""

    allowed: Allowed
    library = kinds.__name__
    turned: ClassVar = Making.turned | {"Hums": "tone"}
    wired = ("listed", "EachOfEach", "Hums", "LastWord", "Lends", "LendsLater")
    any_slots = Making.any_slots | {"nudge"}
    left_alone = ("EachOfEach", "Clings")
    unboxed = ("Clings", *_TENDING)
    failing = ("Failing", "picky", "gives_up", "Utters", "UttersLater", "Works", *_TENDING, *_SPEAKING)

    def __init__(self, choose: making.Chooser, allowed: Allowed) -> None:
        super().__init__(choose, allowed)
        self.longest = 24 if allowed.plain and not allowed.large else 5

    def plan(self) -> GraphPlan:
        """Make the plan."""
        plan = super().plan()
        if self.allowed.concurrency:
            self.make_concurrent()
        feeds = tuple(name for name in FEEDS if any(edge.source == ("", "output", name) for edge in self.edges))
        groups = ("left", "right") if self.allowed.threads else ()
        return replace(plan, nodes=tuple(self.nodes), groups=groups, feeds=feeds)

    def chance(self, percent: int) -> bool:
        """Such features keep a node out of a region, or split one, so they are rare where regions are wanted."""
        if self.allowed.large:
            return self.choose.chance(1) and super().chance(percent)
        return super().chance(percent // 3 if self.allowed.plain else percent)

    # --- nodes

    def make_nodes(self) -> None:
        """Make all nodes."""
        if self.allowed.large:
            for number in range(self.choose.number(11, 61)):
                self.make_node(f"n{number}", self.kind_of(number))
        else:
            super().make_nodes()
        if self.allowed.rings:
            self.make_rings()

    def make_node(self, name: str, kind: str) -> None:
        """Make one node, and those that belong to it."""
        if kind in _BEFORE:
            self.nodes.append(NodePlan(f"{name}before", _BEFORE[kind]))
        super().make_node(name, kind)
        if kind in _AFTER:
            self.nodes.append(NodePlan(f"{name}behind", _AFTER[kind]))

    def make_rings(self) -> None:
        """Make requests that come back as answers into a slot, and alongside them nodes that keep running."""
        choose = self.choose
        for number in range(choose.number(1, 2)):
            gate, worker = f"gate{number}", f"worker{number}"
            how = choose.one_of(["burst", "task", "both", "again"])
            self.nodes.append(NodePlan(gate, "Gate", {"count": choose.number(1, 9), "how": how}))
            kind = choose.one_of(_ANSWERING)
            super().make_node(worker, kind)
            inputs, outputs = self.description(kind).inputs, self.description(kind).outputs
            self.connect((gate, "event", "request"), (worker, "input", next(iter(inputs))))
            if "b" in inputs:
                self.connect((gate, "event", choose.one_of(["aside", "request"])), (worker, "input", "b"))
            answer = (worker, "event", "pulse") if kind == "Pulse" else (worker, "output", next(iter(outputs)))
            self.connect(answer, (gate, "slot", "answer"))
            self.connect(("", "event", "start"), (gate, "slot", "begin"))
        if choose.chance(80):
            given = {"period_s": choose.one_of([0.02, 0.007]), "count": choose.number(2, 8)}
            self.nodes.append(NodePlan("watch", "Watch", given))

    def kind_of(self, number: int) -> str:
        """Choose the type of a node."""
        if self.allowed.sources and (number == 0 or self.chance(20)):
            return self.choose.one_of(self.sources())
        is_plain = self.allowed.plain and not self.choose.chance(2 if self.allowed.large else 15)
        return self.choose.one_of(self.plain() if is_plain else self.inner())

    def sources(self) -> list[str]:
        """Return the types of sources."""
        allowed = self.allowed
        return [
            *super().sources(),
            *_SPEAKING_SOURCES * allowed.sending,
            *["TalksLater"] * (allowed.sending and allowed.waiting),
            *["Pairs"] * 2 * allowed.pairs,
            *["Ticks"] * 3 * allowed.alive,
        ]

    def inner(self) -> list[str]:
        """Return the types of other nodes."""
        allowed = self.allowed
        later, uttered = allowed.sending and allowed.waiting, allowed.events and allowed.failing_calls
        return [
            *super().inner(),
            *(["Unsteady"] * 3 + ["Stubborn"] * 2) * allowed.retries,
            *(["Tends"] * 4 + ["Beats"] * 3) * allowed.tasks,
            *["odd"] * 4 * allowed.strange,
            *["Speaks", "SpeaksTwice", "Lends", "Passing"] * allowed.sending,
            *["SpeaksLater", "SpeaksTwiceLater", "LendsLater", "PassingLater"] * later,
            *["Utters", "Utters"] * (allowed.sending and uttered),
            *["UttersLater"] * (later and uttered),
            *["Works"] * 6 * allowed.doing,
            *["LastWord", "LastWord", "Hums"] * (allowed.endings and not allowed.plain),
            *["EachOfEach"] * (allowed.iteration and not allowed.plain),
            *["Tuned"] * 6 * allowed.tuned,
            *["Clings"] * (allowed.clinging and not allowed.plain),
        ]

    def plain(self) -> list[str]:
        """Return the types that regions are made of."""
        allowed = self.allowed
        return [
            *(*_JOINS * 3, "double", "some", "some", "some", "sink", "parted", "Sends", "mood", "calm"),
            *["restless", "calling"] * allowed.waiting,
            *["picky", "picky", "gives_up"] * allowed.failures,
            *["handing"] * allowed.activity,
            *["odd"] * 2 * allowed.strange,
            *_ALIVE * allowed.alive,
            *["Works"] * (allowed.alive and allowed.doing),
            *["Speaks", "Speaks", "SpeaksTwice", "Lends"] * allowed.sending,
            *["SpeaksLater", "SpeaksLater", "SpeaksTwiceLater", "LendsLater"] * (allowed.sending and allowed.waiting),
        ]

    def parameters(self, kind: str) -> dict[str, Any]:
        """Choose the parameters of a node."""
        choose = self.choose
        match kind:
            case "Lives" | "Heeds":
                return {"every": choose.number(1, 4)}
            case "Ticks":
                return {"count": choose.number(4, 14), "every": choose.number(2, 4)}
            case "Pairs":
                return {"count": choose.number(0, self.longest)}
            case _ if kind in (*_SPEAKING, *_PAUSING):
                return self._speaking(kind)
            case "odd":
                return {"what": choose.one_of(_STRANGE), "every": choose.number(1, 3)}
            case "picky" | "gives_up":
                return {"at": choose.number(2, 3)}
            case "Tends" | "Beats":  # whose steps of one moment are in the order in which they were set
                return {"pause_s": choose.one_of([0.003, 0.01])}
            case "Works":
                manners = ["at once", "later", "tells", "fails", "long"]
                manners += ["resists", "clings", "stays"] if self.allowed.clinging else []
                return {"manner": choose.one_of(manners), "pause_s": choose.one_of([0.003, 0.01])}
            case "Unsteady":
                return {"pause_s": choose.one_of([0.0, 0.003, 0.01])}
            case "Tuned":
                return {name: choose.one_of(values) for name, values in _TUNED.items() if choose.chance(40)}
        return super().parameters(kind)

    def _speaking(self, kind: str) -> dict[str, Any]:
        """How a node answers, and what it does before."""
        choose, allowed = self.choose, self.allowed
        given: dict[str, Any] = {}
        if kind in _SPEAKING:
            ways = [way for way in kinds.WAYS if allowed.activity or way not in ("held", "given", "taken")]
            given["way"] = choose.one_of([*ways, "both"] if allowed.failures and choose.chance(10) else ways)
        if kind in _PAUSING:
            given["pause"] = choose.one_of(kinds.PAUSES)
        if kind in (*_SPEAKING_SOURCES, "TalksLater"):
            given["count"] = choose.number(0, self.longest)
        if kind == "SpeaksLater" and choose.chance(25):
            given["by_task"] = True
        return given

    def pace(self, kind: str) -> dict[str, Any]:
        """Choose when a node fires."""
        options: dict[str, Any] = {}
        if self.chance(40 if self.allowed.threads else 25):
            options["release"] = self.choose.one_of(["sequential", "pipelined"])
        if self.allowed.rates and self.chance(15):
            options["max_rate_hz"] = self.choose.one_of([100.0, 30.0, 70.0])
        if kind == "EachOfEach":
            options.pop("max_rate_hz", None)
        if kind == "Hums" and self.choose.chance(50):
            options["max_rate_hz"] = 100.0
        return options

    def handling(self, kind: str) -> dict[str, Any]:
        """Choose what follows an error of a node."""
        if kind in ("EachOfEach", "Clings"):
            return {}
        options = super().handling(kind)
        if self.allowed.strange and not options and not self.choose.chance(10):
            options["on_error"] = self.choose.one_of(["skip", "skip", "skip", "restart", "disable"])
        return options | (self._trying_again(kind) if kind in ("Unsteady", "Stubborn") else {})

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

    def states(self, kind: str) -> dict[str, Any]:
        """Choose how long a node is active, whether it is enabled, and its thread."""
        if kind in ("EachOfEach", "Clings"):
            return {}
        options = super().states(kind)
        if self.allowed.threads and kind not in _WAITING and self.chance(50):
            options["group"] = self.choose.one_of(["left", "right"])
        return options

    # --- edges

    def own_events(self, nodes: Sequence[NodePlan]) -> list[End]:
        """Return events with a value, including the results of do-activities."""
        return super().own_events(nodes) + [(one.name, "event", "completed") for one in nodes if one.type == "Works"]

    def make_inputs(self, index: int, node: NodePlan) -> None:
        """Make the edges into the inputs of a node."""
        near = self.outputs(self.nodes[:index]) if node.type == "Hums" and self.allowed.parameters else []
        if near and self.choose.chance(85):
            self.connect(self.choose.one_of(near), (node.name, "parameter", "tone"))
        most = 99 if self.allowed.large else 92  # a large region without an input here and there falls apart
        for port, spec in self.type_of(node.name).inputs.items():
            if index and self.nodes[index - 1].type in self.wired and port != "a":
                self._wire(self.nodes[index - 1], (node.name, "input", port))
            elif self.choose.chance(60 if spec.optional and not self.allowed.plain else most):
                self.connect_input(index, (node.name, "input", port))

    def connect_input(self, index: int, target: End) -> None:
        """Connect an input."""
        if self.allowed.feeds and self.choose.chance(40):
            self.connect(("", "output", self.choose.one_of(FEEDS)), target)
        else:
            super().connect_input(index, target)

    def near(self, ends: list[End]) -> list[End]:
        """Return the outputs from which an input is connected: where regions are wanted, mostly the last ones."""
        if self.allowed.large:
            return ends[-12:] if self.choose.chance(70) else ends
        return ends[-3:] if self.allowed.plain and self.choose.chance(90) else ends

    def _wire(self, before: NodePlan, target: End) -> None:
        """Connect a node to the one that it was made for."""
        source = (before.name, "output", next(iter(self.type_of(before.name).outputs)))
        if before.type == "LastWord" and self.allowed.activity:  # its last tokens should be queued before its END
            initial = [0] if self.choose.chance(50) else None
            self.connect(source, target, active=True, initial=initial)
            self.connect(("", "event", "start"), (before.name, "slot", "activate"))
        else:
            self.connect(source, target, active=False if before.type == "listed" else None)

    def most_slot_edges(self) -> int:
        """Return the number of edges into slots at most."""
        is_sparse = self.allowed.plain and not self.allowed.alive
        return len(self.nodes) // 4 if is_sparse else super().most_slot_edges()

    def make_first_activity(self, slots: list[tuple[NodePlan, str]]) -> None:
        """Give the activity of the start to slots and do-activities."""
        for node in self.nodes:
            if node.type == "Works" and self.choose.chance(40):
                self.connect(("", "event", "start"), (node.name, "slot", "activate"), active=True)
        for _ in range(self.choose.number(1, 3) if self.allowed.alive else 0):
            node = self.choose.one_of(self.nodes)
            self.connect(("", "event", "start"), (node.name, "slot", "activate"), active=True)
        super().make_first_activity(slots)

    def carries(self, source: End, target: End) -> bool:
        """Choose whether an edge is active."""
        if not self.allowed.alive or not self.allowed.activity:
            return super().carries(source, target)
        return self.choose.chance(60) if "slot" in (source[1], target[1]) else self.chance(70)

    def make_gates(self) -> list[GatePlan]:
        """Gate a node by another one; where there is much activity, several nodes."""
        choose = self.choose
        if not self.allowed.alive:
            return super().make_gates()
        if len(self.nodes) < 2 or not choose.chance(70):
            return []
        gates: dict[str, GatePlan] = {}
        for _ in range(choose.number(1, 4)):
            target = choose.one_of(self.nodes).name
            by = choose.one_of([node for node in self.nodes if node.name != target])
            gates[target] = GatePlan(target, by.name, choose.one_of([*[None] * 8, 100.0, 20.0]))
        return list(gates.values())

    def queue(self, *, active: bool) -> dict[str, Any]:
        """Choose the options of an edge from an event."""
        options = super().queue(active=active)
        if self.allowed.through and not active and self.choose.chance(15):
            name, amounts = self.choose.one_of(_OPERATORS)
            options["through"] = [through(name, self.choose.one_of(amounts))]
        return options

    def make_concurrent(self) -> None:
        """Let some async nodes have several firings in progress; those with active edges may not (F14)."""
        choose = self.choose
        carrying = {end[0] for edge in self.edges if edge.options.get("active") for end in (edge.source, edge.target)}
        for index, node in enumerate(self.nodes):
            if node.type in _SEVERAL and node.name not in carrying and choose.chance(70):
                options = {name: value for name, value in node.options.items() if name != "release"}
                options |= {"concurrency": choose.number(2, 3)} | ({"ordered": False} if choose.chance(40) else {})
                self.nodes[index] = replace(node, options=options)

    def may_reset(self, nodes: Sequence[NodePlan]) -> bool:
        """Return whether a subgraph may be reset; a do-activity would have to wait for its end."""
        return not any(node.type == "Works" for node in nodes)


def make_plan(choose: making.Chooser, allowed: Allowed) -> GraphPlan:
    """Make a plan by asking `choose` again and again."""
    return Wide(choose, allowed).plan()


def random_plan(seed: int, allowed: Allowed | None = None) -> GraphPlan:
    """Make the plan of a seed; much faster than Hypothesis, but nothing shrinks."""
    return make_plan(SeededChooser(seed), allowed or Allowed())


@st.composite
def graphs(draw: st.DrawFn, allowed: Allowed) -> GraphPlan:
    """Draw plans, which Hypothesis can shrink."""
    return make_plan(DrawingChooser(draw), allowed)

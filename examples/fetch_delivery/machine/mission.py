"""What the robot does when: the states, what leads from one to another, and what is done in each.

A hierarchical state machine next to the data flow, stepped ten times per second. Fetching and delivering have the same
states inside, for a visit at a station. Each state has a way in, something to do at each tick, and a time after which
it is left; the table `STATES` is the whole structure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

import numpy as np
from transitions.extensions import HierarchicalMachine
from transitions.extensions.nesting import NestedState

from examples.fetch_delivery.machine.driving import Dock, GoTo, Move, Position, Step
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, Station, wrapped
from examples.fetch_delivery.perception.signs import delivery_station
from hfg.nodes.robotics import Disk

_GRUDGE_S: Final = 40.0  # for how long a failure at a filling station counts
_ATTEMPTS: Final = 3  # at a station to deliver a cube
_BRINGS: Final = 2  # so often a sign is looked for anew, then nobody wants the cube
_VIEWS: Final = 16  # in a row are more than once around
_BEFORE_M: Final = 1.25  # a station, from where its sign is looked for


@dataclass
class Senses:
    """The robot's knowledge at a tick.

    Attributes:
      message: what the referee says.
      odometry: what the wheels say.
      scan: of the laser.
      localised: where the robot is; None before it has found itself.
      others: other robots.
      targets: the bull's-eyes that were seen since the last tick.
      signs: the digits that are known.
      filling: the filling stations that are known.
      basket: the cube that was seen there since it was last asked for: its number, 0 for none; None as long as nothing
        is certain.
    """

    message: str
    odometry: Odometry
    scan: Scan
    localised: Localised | None = None
    others: Sequence[Disk] = ()
    targets: Sequence[Sighting] = ()
    signs: Mapping[int, Sign] = field(default_factory=dict)
    filling: Sequence[Station] = ()
    basket: int | None = None

    @property
    def now(self) -> float:
        """The time of what was measured."""
        return self.scan.stamp


@dataclass
class Orders:
    """The actions of a tick.

    Attributes:
      command: the velocity.
      lamp: whether to switch the lamp, and to what.
      look_ahead: whether a picture of what is ahead shall be taken.
      look_into_basket: whether one of the basket shall be.
      ask: whether to begin anew with looking what lies in the basket.
      forget: the number of a sign that is not where it should be.
      report: the number of a cube that cannot be delivered.
    """

    command: Twist = field(default_factory=Twist)
    lamp: bool | None = None
    look_ahead: bool = False
    look_into_basket: bool = False
    ask: bool = False
    forget: int | None = None
    report: int | None = None


class _State(NestedState):
    separator = "/"


class _Machine(HierarchicalMachine):
    state_cls = _State


_VISIT: Final[dict[str, Any]] = {
    "name": "visit",
    "initial": "go_to",
    "on_enter": "count_attempt",
    "children": [
        {"name": "go_to", "on_enter": "begin_to_approach"},
        {"name": "position", "on_enter": "begin_to_position"},
        {"name": "dock", "on_enter": "begin_to_dock"},
        "settle",
        {"name": "wait", "on_enter": ["lamp_on", "ask_for_basket"], "on_exit": "lamp_off"},
        {"name": "leave", "on_enter": "begin_to_leave"},
        {"name": "retreat", "on_enter": "begin_to_retreat"},
    ],
}

_CONFIRM: Final[dict[str, Any]] = {"name": "confirm", "on_enter": "ask_for_basket"}

STATES: Final[list[Any]] = [
    "wait_for_start",
    {"name": "advance", "on_enter": "begin_to_advance"},
    {
        "name": "fetch",
        "initial": "select",
        "children": ["select", {"name": "look_around", "on_enter": "begin_to_turn"}, _VISIT],
    },
    {"name": "read_cube", "on_enter": "ask_for_basket"},
    {
        "name": "explore",
        "initial": "view",
        "on_enter": "begin_to_explore",
        "children": [
            "view",
            {"name": "look_around", "on_enter": "begin_to_turn"},
            {"name": "go_to", "on_enter": "begin_to_go_to_view"},
        ],
    },
    {"name": "deliver", "initial": "visit", "on_enter": "begin_to_deliver", "children": [_VISIT, _CONFIRM]},
]


def _visit(visit: str) -> list[Any]:
    """Return what leads from state to state within a visit; `served` and `failed` lead out of it."""
    states = ("go_to", "position", "dock", "settle", "wait", "leave")
    in_a_row = [["done", f"{visit}/{one}", f"{visit}/{other}"] for one, other in pairwise(states)]
    return [*in_a_row, ["lost", [f"{visit}/{state}" for state in ("position", "dock", "wait")], f"{visit}/retreat"]]


TRANSITIONS: Final[list[Any]] = [
    ["done", "wait_for_start", "advance"],
    ["done", "advance", "fetch"],
    ["chosen", "fetch/select", "fetch/visit"],
    ["lost", "fetch/select", "fetch/look_around"],
    ["done", "fetch/look_around", "fetch/select"],
    {"trigger": "failed", "source": "fetch/visit", "dest": "fetch/select", "before": "bear_a_grudge"},
    {"trigger": "served", "source": "fetch/visit", "dest": "read_cube", "before": "begin_to_bring"},
    {"trigger": "read", "source": "read_cube", "dest": "deliver", "conditions": "sign_is_known"},
    ["read", "read_cube", "explore"],
    ["lost", "read_cube", "fetch"],
    ["chosen", "explore/view", "explore/go_to"],
    ["lost", "explore/view", "explore/look_around"],
    {"trigger": "failed", "source": "explore/view", "dest": "fetch", "before": "give_the_cube_back"},
    ["done", ["explore/go_to", "explore/look_around"], "read_cube"],
    {"trigger": "failed", "source": "deliver/visit", "dest": "deliver/visit", "conditions": "may_try_again"},
    ["failed", "deliver/visit", "deliver/confirm"],
    {
        "trigger": "read",
        "source": "deliver/confirm",
        "dest": "read_cube",
        "conditions": "may_bring_again",
        "before": "forget_sign",
    },
    {
        "trigger": "read",
        "source": "deliver/confirm",
        "dest": "fetch",
        "before": ["forget_sign", "give_the_cube_back"],
    },
    ["lost", "deliver/confirm", "fetch"],
    ["served", "deliver/visit", "fetch"],
    *_visit("fetch/visit"),
    *_visit("deliver/visit"),
]

# How long a state may last in seconds, and what is triggered then.
LIMITS: Final[dict[str, tuple[float, str]]] = {
    "advance": (10.0, "done"),
    "select": (5.0, "lost"),
    "look_around": (15.0, "done"),
    "visit/go_to": (60.0, "failed"),
    "position": (20.0, "lost"),
    "dock": (10.0, "lost"),
    "settle": (0.5, "done"),
    "wait": (20.0, "lost"),
    "leave": (6.0, "served"),
    "retreat": (6.0, "failed"),
    "read_cube": (10.0, "lost"),
    "confirm": (4.0, "lost"),
    "view": (5.0, "lost"),
    "explore/go_to": (15.0, "done"),
}


class Mission:
    """Decides what the robot does.

    Attributes:
      state: the state it is in, as a path.
      station: where it goes, or is.
      entered: since when.
      senses: of this tick.
      orders: of this tick.
    """

    state: str
    trigger: Callable[[str], bool]  # made by the machine

    def __init__(self, changed: Callable[[str], object] = lambda state: None) -> None:
        """Begin to wait for the start; `changed` is told of each new state."""
        self.senses: Senses
        self.orders = Orders()
        self.entered: float | None = None
        self._changed = changed
        self._ticks = 0  # in this state
        self._number = 0  # of the cube that was read
        self._refused = 0  # number of a cube that is to be given back
        self.station: Station
        self._failures: dict[tuple[int, int], float] = {}
        self._attempts, self._in_vain = 0, 0
        self._wanted, self._views = 0, 0
        self._drive: Any = None
        self._view: Any = None
        self._activities: dict[str, Callable[[], str | None]] = {
            "wait_for_start": self._listen,
            "advance": self._advance,
            "select": self._select,
            "look_around": self._turn,
            "go_to": self._go_to,
            "position": self._position,
            "dock": self._dock,
            "wait": self._wait,
            "leave": self._leave,
            "retreat": self._retreat,
            "read_cube": self._read_cube,
            "confirm": self._read_cube,
            "view": self._choose_view,
        }
        self.machine = _Machine(
            self,
            states=STATES,
            transitions=TRANSITIONS,
            initial="wait_for_start",
            auto_transitions=False,
            after_state_change="note_change",
        )

    def step(self, senses: Senses) -> Orders:
        """Do what is to be done now, and change the state if it is time to."""
        self.senses, self.orders = senses, Orders()
        if self.entered is None:
            self.entered = senses.now
        event = self._late() or self._activities.get(self._leaf, _nothing)()
        self._ticks += 1
        if event:
            self.trigger(event)
        return self.orders

    @property
    def _leaf(self) -> str:
        return self.state.rpartition("/")[2]

    def _late(self) -> str | None:
        assert self.entered is not None
        for state, (longest, event) in LIMITS.items():
            if self.state.endswith(state) and self.senses.now - self.entered > longest:
                return event
        return None

    # --- what is done in the states ---

    def _listen(self) -> str | None:
        return "done" if self.senses.message == "start" else None

    def _select(self) -> str | None:
        """Choose a filling station: near, free, and not one where it has just failed.

        As long as no filling station is known, each side of the octagon may be one.
        """
        localised = self.senses.localised
        if localised is None or not localised.sure:
            return None
        stations = self.senses.filling or [Station.side(localised.shape, number) for number in range(8)]
        self.station = min(stations, key=lambda station: self._cost(station, localised))
        return "chosen"

    def _cost(self, station: Station, localised: Localised) -> float:
        x, y, _ = localised.pose
        turn = abs(math.remainder(math.atan2(y, x) - station.theta, 2 * math.pi))
        taken = any(math.dist((one.x, one.y), station.before(0.6)[:2]) < 0.9 for one in self.senses.others)
        failed = localised.stamp - self._failures.get(_key(station), -math.inf) < _GRUDGE_S
        return 2.5 * turn + 6.0 * taken + 12.0 * failed

    def _choose_view(self) -> str | None:
        """Say from where to look next: on along the wall, counter-clockwise, looking ahead and outwards."""
        localised = self.senses.localised
        if localised is None or not localised.sure:
            return None
        self._views += 1
        if self._views > _VIEWS:
            return "failed"
        at = math.atan2(localised.pose[1], localised.pose[0]) + 0.5
        self._view = np.array([4.0 * math.cos(at), 4.0 * math.sin(at), float(wrapped(at + 0.6))])
        return "chosen"

    def _move(self) -> str | None:
        return self._command(self._drive.step(self.senses.odometry))

    def _advance(self) -> str | None:
        self.orders.look_ahead = self._ticks % 4 == 0
        return self._move()

    def _leave(self) -> str | None:
        return "served" if self._move() else None

    def _retreat(self) -> str | None:
        return "failed" if self._move() else None

    def _turn(self) -> str | None:
        self.orders.look_ahead = self._ticks % 3 == 0
        return self._move()

    def _go_to(self) -> str | None:
        self.orders.look_ahead = self._ticks % 3 == 0
        end = self._command(self._drive.step(self.senses.localised, self.senses.scan, self.senses.others))
        if end == "blocked":
            return "done" if self.state == "explore/go_to" else "failed"
        return end

    def _position(self) -> str | None:
        self.orders.look_ahead = self._ticks % 2 == 0
        return self._command(self._drive.step(self.senses.localised, self.senses.scan, self.senses.targets))

    def _dock(self) -> str | None:
        return self._command(self._drive.step(self.senses.scan))

    def _wait(self) -> str | None:
        self.orders.look_into_basket = self._ticks % 4 == 0
        basket = self.senses.basket
        if basket is None:
            return None
        if self.state.startswith("deliver"):
            return "done" if basket == 0 else None
        if basket in (0, self._refused):
            return None
        self._refused = 0
        return "done"

    def _read_cube(self) -> str | None:
        self.orders.look_into_basket = self._ticks % 2 == 0
        if not self.senses.basket:
            return None
        self._number = self.senses.basket
        return "read"

    def _command(self, step: Step) -> str | None:
        self.orders.command, end = step
        return end

    # --- on the way from one state to another ---

    def note_change(self) -> None:
        """Begin to count the time and the ticks of a state."""
        self.entered, self._ticks = self.senses.now, 0
        self._changed(self.state)

    def begin_to_advance(self) -> None:
        """Clear of where it stands, and turned to the middle, to see which sides of the octagon are stations."""
        self._drive = Move(x=1.0, y=1.0, turn=math.pi / 2)

    def begin_to_turn(self) -> None:
        """Once around: what is seen tells a robot that is in doubt where it is."""
        self._drive = Move(turn=2 * math.pi)

    def begin_to_approach(self) -> None:
        """To before the station; where there are others that will do, the robot does not queue for long."""
        queueing = 8.0 if self.state.startswith("fetch") else 60.0
        self._drive = GoTo(self.station.before(_BEFORE_M), lane=0.9, queueing=queueing)

    def begin_to_go_to_view(self) -> None:
        """To where more is to be seen."""
        self._drive = GoTo(self._view, near=0.3, aligned=0.2)

    def begin_to_position(self) -> None:
        """Before the bull's-eye."""
        self._drive = Position(self.station)

    def begin_to_dock(self) -> None:
        """Up to the wall."""
        self._drive = Dock()

    def begin_to_leave(self) -> None:
        """Back, out of the way."""
        self._drive = Move(x=-0.7)

    def begin_to_retreat(self) -> None:
        """Back, after something has failed."""
        self._drive = Move(x=-0.5)

    def begin_to_deliver(self) -> None:
        """Where the sign says."""
        self.station = delivery_station(self.senses.signs[self._number])
        self._attempts, self._views = 0, 0

    def lamp_on(self) -> None:
        """Ask people for help."""
        self.orders.lamp = True

    def lamp_off(self) -> None:
        """Be ready to drive."""
        self.orders.lamp = False

    def ask_for_basket(self) -> None:
        """Check again what is in the basket."""
        self.orders.ask = True

    def bear_a_grudge(self) -> None:
        """Remember where it failed."""
        self._failures[_key(self.station)] = self.senses.now

    def count_attempt(self) -> None:
        """One more at this station."""
        self._attempts += 1

    def may_try_again(self) -> bool:
        """Say whether the cube is worth another attempt at its station."""
        return self._attempts < _ATTEMPTS

    def begin_to_bring(self) -> None:
        """Here is a new cube."""
        self._in_vain = 0

    def may_bring_again(self) -> bool:
        """Say whether another sign may be looked for with this cube."""
        return self._in_vain + 1 < _BRINGS

    def forget_sign(self) -> None:
        """It is not where the map has it."""
        self.orders.forget = self._number
        self._in_vain += 1

    def sign_is_known(self) -> bool:
        """Say whether the station of the cube is in the map."""
        return self._number in self.senses.signs

    def begin_to_explore(self) -> None:
        """Restart the count of views if another sign is looked for."""
        if self._number != self._wanted:
            self._wanted, self._views = self._number, 0

    def give_the_cube_back(self) -> None:
        """Nobody wants it: say so, and wait for another cube, once."""
        self._refused = self.orders.report = self._number
        self._views = 0


def _nothing() -> None:
    return None


def _key(station: Station) -> tuple[int, int]:
    return round(10 * station.x), round(10 * station.y)

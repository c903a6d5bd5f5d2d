"""A vacuum cleaner, twice: as activity that moves along edges, and as a state machine that reads letters.

    start ══ roam ══ bumped ══ back_off ══ timeout ══ roam
              ║ ╚═══ dirty ═══ spot ══ clean ══ roam
              ╚═ low ══ go_home ══ docked ══ charge ══ charged ══ roam                  (activity)
    room ── whoever is active ── drive ── room                                          (data, 10 Hz)

Shown: all behaviours see the room, and only the active one drives; how long a state may last is an option of its
node. The machine has the same states, and letters for what happens: one node judges, others drive as the state wants.
Both clean the same room in the same way, and so does tests/examples/plain_cleaner.py without hfg. Run it with
`python examples/cleaner.py`, or the machine with `hfg run examples/cleaner.py --arg by_letters=true --clock virtual`.
"""

from __future__ import annotations

import random
from typing import NamedTuple

import hfg
from hfg.activity import StateNode

HZ = 10
LOW, CHARGED, DIRTY, CLEAN, AT_HOME = 0.2, 0.9, 0.4, 0.1, 0.05
BACK_OFF_S, LOST_S = 1.25, 60.0  # never at the moment of a tick
ENOUGH = 0.8  # of all dirt
DOCK = 0.3 + 0.3j


class Senses(NamedTuple):
    """The cleaner's knowledge of its surroundings; the way home is in metres, as seen from its nose."""

    bumped: bool
    dirt: float
    battery: float
    home: complex
    cleaned: float


class Drive(NamedTuple):
    """Metres a second along the nose, and the direction to turn to, 1 being the nose's."""

    speed: float
    turn: complex = 1 + 0j


# --- How each behaviour drives.


@hfg.node
def roam(senses: Senses) -> Drive:
    return Drive(0.3)


@hfg.node
def back_off(senses: Senses) -> Drive:
    return Drive(-0.1, 1 + 0.25j)


@hfg.node
def spot(senses: Senses) -> Drive:
    return Drive(0.1, 1 + 0.5j)


@hfg.node
def go_home(senses: Senses) -> Drive:
    return Drive(min(0.3, abs(senses.home) * HZ), senses.home or 1)


@hfg.node
def charge(senses: Senses) -> Drive:
    return Drive(0.0)


# --- As activity: a node for each behaviour, which tells what has happened by an event. None knows who comes next.


class Behaviour(hfg.Node):
    """Drives while it is active: its gate lets nothing through otherwise."""

    senses = hfg.Input(Senses)
    drive = hfg.Output(Drive)

    @hfg.slot
    def enter(self) -> None:
        """Take over the activity; there is nothing else to do."""


class Roam(Behaviour):
    bumped, dirty, low, done = hfg.Event(), hfg.Event(), hfg.Event(), hfg.Event()

    def process(self, senses: Senses) -> Drive:
        if senses.cleaned > ENOUGH:
            self.done.trigger()
        elif senses.battery < LOW:
            self.low.trigger()
        elif senses.bumped:
            self.bumped.trigger()
        elif senses.dirt > DIRTY:
            self.dirty.trigger()
        return roam.function(senses)


class BackOff(Behaviour):
    def process(self, senses: Senses) -> Drive:
        return back_off.function(senses)


class Spot(Behaviour):
    clean = hfg.Event()

    def process(self, senses: Senses) -> Drive:
        if senses.dirt < CLEAN or senses.bumped:
            self.clean.trigger()
        return spot.function(senses)


class GoHome(Behaviour):
    docked = hfg.Event()

    def process(self, senses: Senses) -> Drive:
        if abs(senses.home) < AT_HOME:
            self.docked.trigger()
        return go_home.function(senses)


class Charge(Behaviour):
    charged = hfg.Event()

    def process(self, senses: Senses) -> Drive:
        if senses.battery > CHARGED:
            self.charged.trigger()
        return charge.function(senses)


def _by_activity(seed: int) -> hfg.Graph:
    graph = hfg.Graph("cleaner")
    room = graph.add(Room(seed=seed), max_rate_hz=HZ)
    roam, back_off = graph.add(Roam()), graph.add(BackOff(), active_for_s=BACK_OFF_S)
    spot, go_home, charge = graph.add(Spot()), graph.add(GoHome(), active_for_s=LOST_S), graph.add(Charge())
    for behaviour in (roam, back_off, spot, go_home, charge):
        graph.connect(room.senses, behaviour.senses)
        graph.connect(behaviour.drive, room.drive)
        graph.gate(behaviour, by=behaviour)
    graph.start.activates(roam.enter)
    roam.bumped.activates(back_off.enter)
    back_off.timeout.activates(roam.enter)
    roam.dirty.activates(spot.enter)
    spot.clean.activates(roam.enter)
    roam.low.activates(go_home.enter)
    go_home.docked.activates(charge.enter)
    charge.charged.activates(roam.enter)
    graph.connect(roam.done, graph.stop)
    graph.connect(go_home.timeout, graph.abort)
    return graph


# --- As a state machine: what happens are letters, whoever judges that knows of no state, and each state only drives.

MACHINE = hfg.StateMachine(
    ["roam", "back_off", "spot", "go_home", "charge", "clean"],
    [
        ("finished", "roam", "clean"),
        ("low", "roam", "go_home"),
        ("bumped", "roam", "back_off"),
        ("dirty", "roam", "spot"),
        ("bumped", "spot", "roam"),
        ("swept", "spot", "roam"),
        ("docked", "go_home", "charge"),
        ("charged", "charge", "roam"),
    ],
    initial="roam",
    final=["clean"],
    missing="ignore",
)
BEHAVIOURS = {"roam": roam, "back_off": back_off, "spot": spot, "go_home": go_home, "charge": charge}


class GoingHome(StateNode):
    """A state with a letter; a node of one's own, because it may last only so long."""

    docked = hfg.Event()


class Judge(hfg.Node):
    """Says what has happened, the most urgent first."""

    senses = hfg.Input(Senses)
    letter = hfg.Event(str)

    def process(self, senses: Senses) -> None:
        happened = {
            "finished": senses.cleaned > ENOUGH,
            "low": senses.battery < LOW,
            "bumped": senses.bumped,
            "dirty": senses.dirt > DIRTY and not senses.bumped,
            "swept": senses.dirt < CLEAN,
            "docked": abs(senses.home) < AT_HOME,
            "charged": senses.battery > CHARGED,
        }
        for letter, is_so in happened.items():
            if is_so:
                self.letter.trigger(letter)


def _by_letters(seed: int) -> hfg.Graph:
    graph = hfg.Graph("cleaner-machine")
    room, judge = graph.add(Room(seed=seed), name="room", max_rate_hz=HZ), graph.add(Judge(), name="judge")
    back_off = graph.add(StateNode(), name="back_off", active_for_s=BACK_OFF_S)
    home = graph.add(GoingHome(), name="go_home", active_for_s=LOST_S)
    states = MACHINE.build(graph, letters=judge.letter, nodes={"back_off": back_off, "go_home": home})
    for name, behaviour in BEHAVIOURS.items():
        driver = graph.add(behaviour(), name=f"{name}_drive")
        graph.connect(room.senses, driver.senses)
        graph.connect(driver.out, room.drive)
        graph.gate(driver, by=states[name])
    graph.connect(room.senses, judge.senses)
    graph.connect(back_off.timeout, states["roam"].ports.slots["enter"], active=True)
    graph.connect(states["clean"].activated, graph.stop)
    graph.connect(home.timeout, graph.abort)
    return graph


def build(seed: int = 1, by_letters: bool = False) -> hfg.Graph:
    return _by_letters(seed) if by_letters else _by_activity(seed)


# --- The world: a room of four by three metres, the cleaner in it, and its dock. The first class knows nothing of hfg.


class World:
    """The effects of the cleaner on the room, and its sensor data."""

    def __init__(self, seed: int) -> None:
        chance = random.Random(seed)
        self.dirt = {(x, y): chance.random() ** 3 for x in range(16) for y in range(12)}
        self.all_dirt = sum(self.dirt.values())
        self.at, self.nose, self.battery = DOCK, 1 + 0j, 0.4

    def move(self, drive: Drive) -> Senses:
        """Do it for a tenth of a second."""
        self.nose *= drive.turn / abs(drive.turn)
        at = self.at + self.nose * drive.speed / HZ
        bumped = not (0.1 <= at.real <= 3.9 and 0.1 <= at.imag <= 2.9)
        self.at = self.at if bumped else at
        cell = int(self.at.real * 4), int(self.at.imag * 4)
        self.dirt[cell] *= 0.7
        docked = abs(DOCK - self.at) < AT_HOME
        self.battery = min(1.0, self.battery + (0.01 if docked and not drive.speed else -0.0004))
        cleaned = 1 - sum(self.dirt.values()) / self.all_dirt
        return Senses(bumped, self.dirt[cell], self.battery, (DOCK - self.at) / self.nose, cleaned)


class Room(hfg.Node):
    """Moves the cleaner as commanded, ten times per second."""

    senses = hfg.Output(Senses)
    seed = hfg.Parameter(1)
    told = hfg.State(Drive(0.0))
    world = hfg.State[World | None](None)

    @hfg.slot
    def drive(self, drive: Drive) -> None:
        self.told = drive

    def process(self) -> Senses:
        told, self.told = self.told, Drive(0.0)  # a command holds for one moment, so that nobody has to say "stop"
        self.world = self.world or World(self.seed)
        return self.world.move(told)


if __name__ == "__main__":
    for graph in (build(), build(by_letters=True)):
        report = hfg.run(graph, clock="virtual")
        print(f"{graph.name}: {report.outcome} after {report.duration_s:.1f} s")

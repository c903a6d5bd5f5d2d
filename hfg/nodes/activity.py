"""What a system is doing now: nodes that look at activity, make and take it, and lead it on.

A behaviour is anything that is begun by a signal with activity and tells that it is done by another: a node with a slot
and an event, or a subgraph. The nodes below stand between behaviours. They hold the activity while they wait
themselves, so what is active shows what the system is doing; connect their events, and those that lead into their
slots, with `active=True`. Where no activity comes, by edges that are not active, they work just as well as plain
control of signals. Depends on nodetype and ports, and on graph where the paper draws a subgraph.
"""

from __future__ import annotations

from typing import Any

from annotated_types import Ge

from hfg.graph import Graph, Subgraph
from hfg.nodes._alarm import Alarm
from hfg.nodetypes.node import Node
from hfg.ports import Event, Events, Input, Inputs, Output, Outputs, Parameter, Slots, State, slot

__all__ = [
    "ActivityAbsorber",
    "ActivityGate",
    "ActivityGenerator",
    "ActivitySwitch",
    "Branch",
    "Fallback",
    "InactivityGenerator",
    "OneShotCommand",
    "Parallel",
    "Retry",
    "Sequence",
    "TimeLimit",
    "Wait",
    "WaitForMessage",
    "WaitForText",
]


# --- activity and data ---


class ActivityGate(Node):
    """Pass values on while the node is active.

    While it is not there is silence, so that a join after it stays in step. Activity may come by the slot, or with a
    value, which then passes. If an output has an active edge, the first value that passes takes the activity along, so
    exactly one does: figure 17 b of the paper. Fires when every connected input holds a token.

    Attributes:
      values: one stream or several in step.
      inverted: values pass while the node is not active.
      passed: each stream again.
      begin: where activity arrives; does nothing else.

    CS::APEX: state::ActivityGate.
    """

    values = Inputs(Any, 1)
    passed = Outputs(Any, "values")
    inverted = Parameter(False)

    def process(self, values: list[Any]) -> list[Any] | None:
        """Look at the activity."""
        return values if self.active is not self.inverted else None

    @slot
    def begin(self) -> None:
        """Take the activity."""


class ActivitySwitch(Node):
    """Pass a value on by one of two outputs, depending on whether the node is active.

    At the other output there is silence, so that both ways stay in step; `flow.Rejoin` makes one stream of them again.

    Attributes:
      value: anything.
      when_active: the value, if the node is active.
      when_inactive: the value, if it is not.
      begin: where activity arrives; does nothing else.

    CS::APEX: state::ActivitySwitch.
    """

    value = Input(Any)
    when_active = Output(Any)
    when_inactive = Output(Any)

    def process(self, value: Any) -> None:
        """Look at the activity."""
        (self.when_active if self.active else self.when_inactive).send(value)

    @slot
    def begin(self) -> None:
        """Take the activity."""


class ActivityGenerator(Node):
    """Pass every value on with activity.

    Over active edges each value activates whoever takes it, whether the generator is active or not (rule A4); over
    other edges it is a relay. In most graphs activity comes only from `graph.start`; use this node if data starts
    something.

    Attributes:
      value: anything.
      out: the same value, with +1.

    CS::APEX: state::ActivityGenerator.
    """

    value = Input(Any)
    out = Output(Any)

    def process(self, value: Any) -> None:
        """Send it with activity."""
        self.out.send(value, activity=1)


class _PassWithout(Node):
    """Pass a value on and keep the activity back."""

    value = Input(Any)
    out = Output(Any)

    def process(self, value: Any) -> None:
        self.out.send(value, activity=0)

    @slot
    def take(self) -> None:
        """Take the activity."""


class ActivityAbsorber(Subgraph):
    """Pass values on and let the activity that comes with them vanish.

    It is active for a moment, after the firing in which activity arrived; its tokens carry none. The final node of an
    activity diagram.

    Attributes:
      value: anything.
      out: the same value, without activity.
      take: where activity arrives by a signal, to vanish too.

    CS::APEX: state::ActivityAbsorber.
    """

    value = Input(Any)
    out = Output(Any)
    take = slot(type=object)

    def build(self, graph: Graph) -> None:
        """Lead a node's `activated` back to its `deactivate`."""
        inside = graph.add(_PassWithout(), name="pass_without")
        graph.connect(self.value.inner, inside.value, active=True)
        graph.connect(self.take.inner, inside.take, active=True)
        graph.connect(inside.out, self.out.inner, active=True)
        graph.connect(inside.activated, inside.deactivate)


class InactivityGenerator(Node):
    """Signal that whoever takes it is not active any more.

    Over active edges the signal deactivates (rule A4), whether this node is active or not; over other edges it is a
    plain signal.

    Attributes:
      emit: asks for the signal; a value is handed on.
      deactivation: the signal, with -1.

    CS::APEX: state::InactivityGenerator.
    """

    deactivation = Event(Any)

    @slot
    def emit(self, value: Any) -> None:
        """Send it."""
        self.deactivation.trigger(value, activity=-1)


# --- waiting, and doing once ---


class WaitForMessage(Node):
    """Hold the activity until the next message: figure 13 of the paper.

    Every message is signalled, active or not; over an active edge the first one after the activity takes it along. So
    what follows begins with the next message, and messages before that mean nothing to it.

    Attributes:
      message: anything.
      begin: where activity arrives; does nothing else.
      received: each message.
    """

    message = Input(Any)
    received = Event(Any)

    def process(self, message: Any) -> None:
        """Signal it."""
        self.received.trigger(message)

    @slot
    def begin(self) -> None:
        """Take the activity."""


class WaitForText(Node):
    """Hold the activity until a certain text arrives: figure 17 a of the paper, its node `streq`.

    Each text that is the wanted one is signalled, active or not; over an active edge the first one after the activity
    takes it along. A start signal that comes too early does nothing.

    Attributes:
      message: texts, such as what others send to a robot.
      wanted: the text that is waited for.
      begin: where activity arrives; does nothing else.
      received: the wanted text has come.
    """

    message = Input(str)
    received = Event(str)
    wanted = Parameter("start")

    def process(self, message: str) -> None:
        """Compare."""
        if message == self.wanted:
            self.received.trigger(message)

    @slot
    def begin(self) -> None:
        """Take the activity."""


class _Export(Node):
    """Pass a command on; its event `processed` tells that it has left."""

    def process(self, value: Any) -> Any:
        return value


class OneShotCommand(Subgraph):
    """Send one command when activity arrives, then pass the activity on: figure 17 b of the paper.

    Commands come again and again from somewhere, `flow.Latch` or a source with a rate; the gate inside passes the first
    one after the activity. The command carries none: the activity leaves by `done`, as soon as the command was sent.

    Attributes:
      value: the command, again and again.
      begin: where activity arrives.
      out: the command, once for each time that activity arrived.
      done: the command was sent; leads the activity on.
    """

    value = Input(Any)
    begin = slot(type=object)
    out = Output(Any)
    done = Event()

    def build(self, graph: Graph) -> None:
        """Put the gate before the node that exports."""
        gate, export = graph.add(ActivityGate(), name="gate"), graph.add(_Export(), name="export")
        graph.connect(self.value.inner, gate.values[0])
        graph.connect(self.begin.inner, gate.begin, active=True)
        graph.connect(gate.passed[0], export.ports.inputs["value"], active=True)
        graph.connect(export.ports.outputs["out"], self.out.inner)
        graph.connect(export.processed, self.done.inner, active=True)


# --- one behaviour after another ---


class Sequence(Node):
    """Run several behaviours one after the other.

    `begin` begins the first; when one is done the next one is begun, with the value that it gave. When the last is done
    so is the sequence. If one gives up the sequence is broken off. Signals of a step that is not running have no
    effect, and `begin` starts over.

    Attributes:
      begin: begins the first step with this value.
      steps: begins one behaviour each, with the value of the one before.
      done: one for each step: it is done, with this value.
      gave_up: one for each step: it cannot be done.
      finished: all steps are done; the value of the last.
      broken_off: a step gave up; its value.
    """

    steps = Events(Any, 2)
    finished = Event(Any)
    broken_off = Event(Any)
    current = State[int | None](None)
    """The step that is under way."""

    @slot
    def begin(self, value: Any) -> None:
        """Begin the first step."""
        self.current = 0
        self.steps[0].trigger(value)

    @Slots(Any, "steps")
    def done(self, number: int, value: Any) -> None:
        """Begin the next step, or be finished."""
        if number != self.current:
            return
        if number + 1 < len(self.steps):
            self.current = number + 1
            self.steps[number + 1].trigger(value)
        else:
            self.current = None
            self.finished.trigger(value)

    @Slots(Any, "steps")
    def gave_up(self, number: int, value: Any) -> None:
        """Break off."""
        if number == self.current:
            self.current = None
            self.broken_off.trigger(value)


class Fallback(Node):
    """Try several behaviours one after the other until one succeeds.

    `begin` begins the first; when one gives up the next one is begun, with the value of `begin`. Signals of a way that
    is not running have no effect, and `begin` starts over.

    Attributes:
      begin: begins the first way with this value.
      ways: begins one behaviour each.
      done: one for each way: it has succeeded, with this value.
      gave_up: one for each way: it has not.
      finished: a way has succeeded; its value.
      exhausted: all have given up; the value of the last.
    """

    ways = Events(Any, 2)
    finished = Event(Any)
    exhausted = Event(Any)
    current = State[int | None](None)
    """The way that is under way."""
    given = State[Any](None)

    @slot
    def begin(self, value: Any) -> None:
        """Begin the first way."""
        self.current, self.given = 0, value
        self.ways[0].trigger(value)

    @Slots(Any, "ways")
    def done(self, number: int, value: Any) -> None:
        """Be finished."""
        if number == self.current:
            self.current = None
            self.finished.trigger(value)

    @Slots(Any, "ways")
    def gave_up(self, number: int, value: Any) -> None:
        """Begin the next way."""
        if number != self.current:
            return
        if number + 1 < len(self.ways):
            self.current = number + 1
            self.ways[number + 1].trigger(self.given)
        else:
            self.current = None
            self.exhausted.trigger(value)


class Parallel(Node):
    """Run several behaviours at once, and continue when all are done.

    Activity goes to all of them (§5.2: more than one node at a time) and is gathered here; what a branch says twice
    counts once. `begin` restarts all of them.

    Attributes:
      begin: begins all branches with this value.
      branches: begins one behaviour each.
      done: one for each branch: it is done, with this value.
      finished: all are done; a list of their values.
    """

    branches = Events(Any, 2)
    finished = Event(list[Any])
    results = State[dict[int, Any] | None](None)
    """What the branches gave that are done, or None: none is under way."""

    @slot
    def begin(self, value: Any) -> None:
        """Begin all."""
        self.results = {}
        for branch in self.branches:
            branch.trigger(value)

    @Slots(Any, "branches")
    def done(self, number: int, value: Any) -> None:
        """Gather it."""
        if self.results is None:
            return
        self.results[number] = value
        if len(self.results) == len(self.branches):
            results, self.results = self.results, None
            self.finished.trigger([results[one] for one in range(len(results))])


class Branch(Node):
    """Run one of several behaviours, chosen by the number that arrives.

    Attributes:
      begin: the number of the behaviour, from 0.
      ways: begins one behaviour each.
      other: the number of no behaviour.
    """

    ways = Events(int, 2)
    other = Event(int)

    @slot
    def begin(self, number: int) -> None:
        """Begin it."""
        (self.ways[number] if 0 <= number < len(self.ways) else self.other).trigger(number)


# --- time ---


class Wait(Node):
    """Hold the activity for some seconds, then pass it on.

    A wait that is started during another one replaces it. It is broken off, and nothing is signalled, if the activity
    with which it was begun is taken away meanwhile. `active_for_s` of any node and its event `timeout` do the same for
    what a node does in that time (rule A12).

    Attributes:
      begin: begins to wait; a value is handed on.
      seconds: how long; looked at when the wait begins.
      done: the time is over; the value of `begin`.
    """

    done = Event(Any)
    seconds = Parameter(1.0, Ge(0), unit="s")
    given = State[Any](None)

    def setup(self) -> None:
        """Make the timer."""
        self.alarm = Alarm(self, self._ring)

    @slot
    def begin(self, value: Any) -> None:
        """Wait."""
        self.given = value
        self.alarm.set(self.seconds)

    def _ring(self) -> None:
        self.done.trigger(self.given)

    def on_deactivated(self) -> None:
        """Break off."""
        self.alarm.cancel()


class TimeLimit(Node):
    """Send a behaviour a limited time.

    `begin` begins it. If it is done in time the limit has no effect. Else the activity is taken away from it and led on
    by `expired`; if it was begun without activity, by edges that are not active, it is only told. Its later signals
    have no effect. `begin` starts over.

    Attributes:
      begin: begins the behaviour with this value.
      seconds: its time; looked at when it begins.
      work: begins the behaviour.
      done: it is done, with this value.
      finished: it was done in time; its value.
      cancel: its time is over; -1 over an active edge.
      expired: its time is over; the value with which it was begun, and +1 over an active edge.
    """

    work = Event(Any)
    finished = Event(Any)
    cancel = Event()
    expired = Event(Any)
    seconds = Parameter(1.0, Ge(0), unit="s")
    given = State[Any](None)
    activity = State(0)
    """What it was begun with."""

    def setup(self) -> None:
        """Make the timer."""
        self.alarm = Alarm(self, self._ring)

    @slot
    def begin(self, value: Any) -> None:
        """Begin it."""
        self.given, self.activity = value, 1 if self.active else 0
        self.alarm.set(self.seconds)
        self.work.trigger(value)

    @slot
    def done(self, value: Any) -> None:
        """Be finished, if it is in time."""
        if self.alarm.due is not None:
            self.alarm.cancel()
            self.finished.trigger(value)

    def _ring(self) -> None:
        self.cancel.trigger(activity=-1)
        self.expired.trigger(self.given, activity=self.activity)


class Retry(Node):
    """Run a behaviour repeatedly until it succeeds, a limited number of times.

    `begin` begins it with a value, and so does each further attempt after one gave up, after a pause. In the pause the
    activity is here; if it is taken away meanwhile all is broken off. `begin` starts over. Signals while no attempt is
    in progress have no effect.

    Attributes:
      begin: begins the first attempt with this value.
      attempts: how often it is begun at most.
      pause_s: how long to wait before the second attempt, and each further one, in seconds.
      attempt: begins the behaviour.
      done: it has succeeded, with this value.
      gave_up: it has not.
      finished: an attempt has succeeded; its value.
      exhausted: the last attempt gave up; its value.
    """

    attempt = Event(Any)
    finished = Event(Any)
    exhausted = Event(Any)
    attempts = Parameter(3, Ge(1))
    pause_s = Parameter(0.0, Ge(0), unit="s")
    begun = State(0)
    """How many attempts there were."""
    given = State[Any](None)
    under_way = State(False)

    def setup(self) -> None:
        """Make the timer."""
        self.alarm = Alarm(self, self._next)

    @slot
    def begin(self, value: Any) -> None:
        """Begin the first attempt."""
        self.alarm.cancel()
        self.begun, self.given = 0, value
        self._next()

    @slot
    def done(self, value: Any) -> None:
        """Be finished."""
        if self.under_way:
            self.under_way = False
            self.finished.trigger(value)

    @slot
    def gave_up(self, value: Any) -> None:
        """Begin the next attempt, or give up as well."""
        if not self.under_way:
            return
        self.under_way = False
        if self.begun >= self.attempts:
            self.exhausted.trigger(value)
        elif self.pause_s:
            self.alarm.set(self.pause_s)
        else:
            self._next()

    def _next(self) -> None:
        self.begun += 1
        self.under_way = True
        self.attempt.trigger(self.given)

    def on_deactivated(self) -> None:
        """Break a pause off."""
        if not self.under_way:
            self.alarm.cancel()

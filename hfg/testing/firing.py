"""Fire one node without a graph: give it inputs, get what it sends.

Runs the node's own code and nothing else: no edges, no markers, no rules of activity. Async code runs in virtual time.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Final
from weakref import WeakSet

from hfg.activity.rules import asked_for
from hfg.base.clock import time_told_by
from hfg.base.token import Token
from hfg.errors import EndOfStream, UsageError
from hfg.graph import Graph
from hfg.graph.structure.naming import suggest
from hfg.nodetypes.declaration import HOOKS
from hfg.nodetypes.functions import NodeFunction
from hfg.nodetypes.node import Node, Place
from hfg.ports.automatic import AUTOMATIC_EVENTS
from hfg.testing.reference.waiting import hand_turned_loop
from hfg.types import accepts, describe, describe_value

__all__ = ["Firing", "Sent", "fire"]

_SET_UP: Final[WeakSet[Node]] = WeakSet()
_OVER: Final = object()


@dataclass(frozen=True)
class Sent:
    """A signal or output as the node sent it; `activity` None leaves it to rule A3, `stamp` None to T5."""

    name: str
    value: Any
    activity: int | None = None
    stamp: float | None = None


@dataclass(frozen=True)
class Firing:
    """What one firing or call did.

    Attributes:
      outputs: what was written, by output; silence is not there.
      events: signals in order, as (event, value).
      sent: both with their modifiers and stamps, events first.
      ended: the source has nothing more to give.
      answer: the result of a hook, such as `ready` does.
    """

    outputs: dict[str, Any]
    events: list[tuple[str, Any]]
    sent: list[Sent] = field(repr=False, default_factory=list)
    ended: bool = False
    answer: Any = field(repr=False, default=None)


def fire(
    node: Node,
    /,
    *unnamed: Any,
    slot: str | None = None,
    hook: str | None = None,
    active: bool | None = None,
    parameters: Mapping[str, Any] | None = None,
    debug: bool = True,
    **values: Any,
) -> Firing:
    """Run one firing of a node, one slot call, or one hook. The node's state is kept between calls.

    `setup()` runs before the first call. A value can be a token. A generator yields its next value at each firing. A
    node that is not in a graph goes by the name of its type.

    Args:
      node: a node that is not running at the moment.
      *unnamed: not allowed; pass values by the names of inputs.
      slot: call this slot instead, with `value=` if it takes a value.
      hook: run this hook instead: "end", "teardown", "on_activated", "do" and so on. "do" runs to its end, and its
        event `completed` is among the events.
      active: the value of `node.active` from now on.
      parameters: parameters to set first, by name.
      debug: check values and results against the types of the ports.
      **values: the values by input; only optional inputs can be omitted.

    Returns:
      The values by output, the events with their values, and whether the node has ended.

    Raises:
      UsageError: an input is missing or unknown, an output was written twice, or the node has no such slot or hook.
      TypeError: the result does not fit the outputs, or a value does not fit its port.

    Examples:
      >>> import hfg
      >>> class Door(hfg.Node):
      ...     steps = hfg.State(0)
      ...     opened = hfg.Event(int)
      ...     def process(self, push: bool) -> int:
      ...         self.steps += push
      ...         if self.steps == 2:
      ...             self.opened.trigger(self.steps)
      ...         return self.steps
      ...     @hfg.slot
      ...     def close(self) -> None:
      ...         self.steps = 0
      >>> door = Door()
      >>> fire(door, push=True)
      Firing(outputs={'out': 1}, events=[], ended=False)
      >>> fire(door, push=True).events
      [('opened', 2)]
      >>> fire(door, slot="close").outputs
      {}
      >>> fire(door, push=True).outputs
      {'out': 1}
    """
    _need_node(node)
    if unnamed:
        named = ", ".join(f"{name}={value!r:.20}" for name, value in zip(node._type.inputs, unnamed, strict=False))
        raise UsageError(f"fire takes values by the names of inputs: write fire(node, {named})")
    _need_one(node, slot, hook, values)
    if active is not None and not isinstance(active, bool):
        raise UsageError(f"active= is what node.active says, True or False, got {active!r}")
    if parameters is not None and not isinstance(parameters, Mapping):
        raise UsageError(f'parameters= holds values by name, as in {{"limit": 3}}, got {parameters!r:.80}')
    for name, value in (parameters or {}).items():
        node._set_parameter(name, value)
    if active is not None:
        node._active = active
    with _placed(node):
        return _fire(node, _Firing(node, debug), slot, hook, values)


def _fire(node: Node, firing: _Firing, slot: str | None, hook: str | None, values: dict[str, Any]) -> Firing:
    if node not in _SET_UP:
        node._reset_states()
        setup = node._hook("setup")
        if setup is not None:
            firing.run(setup)
        _SET_UP.add(node)
    if hook is not None:
        return firing.of_hook(hook)
    if slot is not None:
        return firing.of_slot(slot, values)
    return firing.of_process(values)


def _need_node(node: object) -> None:
    if isinstance(node, type) and issubclass(node, Node):
        raise UsageError(f"fire takes a node, not its type: write fire({node._type.qualname}(...), ...)")
    if isinstance(node, Graph):
        raise UsageError(f'fire takes one node; graph "{node.name}" runs as a whole: hfg.run(graph, clock="virtual")')
    if isinstance(node, NodeFunction):
        raise UsageError(f"fire takes a node, not its type: write fire({node.__name__}(...), ...)")
    if not isinstance(node, Node):
        raise UsageError(
            f"fire takes a node, as a node type makes it when it is called, got {node!r:.80}: decorate a function "
            "with @hfg.node, then write fire(function(), ...)"
        )
    if node._type.is_subgraph:
        raise UsageError(
            f"{node._type.name} is a subgraph and does not fire itself: add it to a graph and run that, or fire a "
            "node inside"
        )
    place = node._place
    if place is not None and place.graph._run is not None:
        raise UsageError(f'"{place.path}" is running: fire a node that no run has')


def _need_one(node: Node, slot: str | None, hook: str | None, values: dict[str, Any]) -> None:
    """One thing at a time: a firing, a call or a hook."""
    if slot is not None and hook is not None:
        raise UsageError(f'fire runs slot "{slot}" or hook "{hook}", one at a time: write two calls')
    if hook is None:
        return
    if hook not in HOOKS:
        instead = ": leave hook= out for a firing" if hook == "process" else f"; {suggest(str(hook), HOOKS)}"
        raise UsageError(f'"{hook}" is not a hook of a node{instead}')
    if values:
        raise UsageError(f'hook "{hook}" takes no values, got {_names(values)}: leave them out')
    if hook not in node._type.hooks and hook != "teardown":
        raise UsageError(f'{node._type.name} does not define "{hook}", so there is nothing to run: leave it out')


@contextmanager
def _placed(node: Node) -> Iterator[None]:
    """Provide a place for a node that is not in a graph, so that its code can use its path."""
    if node._place is not None:
        yield
        return
    node._place = Place(Graph("fire"), node._type.name, node._type.name)
    try:
        yield
    finally:
        node._place = None


class _Firing:
    def __init__(self, node: Node, debug: bool) -> None:
        self.node = node
        self.debug = debug
        self.type = node._type
        self.now = 0.0
        self.loop = hand_turned_loop(lambda: self.now)
        self.outputs: dict[str, Sent] = {}
        self.signals: list[Sent] = []
        self.ended = False
        for name in self.type.outputs:
            node.ports.outputs[name]._connect(self._writer(name))
        automatic = (name for name in AUTOMATIC_EVENTS if name != "completed" or "do" in self.type.hooks)
        for name in (*self.type.events, *automatic):
            port = node.ports.events[name] if not self.type.is_subgraph else None
            if port is not None:
                port._connect(self._trigger(name), self._wait(name))

    def of_process(self, values: dict[str, Any]) -> Firing:
        if self.type.process_kind == "none":
            raise UsageError(f'{self.type.name} has no process function; name one of its slots: fire(node, slot="...")')
        kind = self.type.process_kind
        arguments = self._arguments(values)
        try:
            if kind in ("generator", "async generator"):
                result = self._next(kind)
            else:
                result = self.run(lambda: self.node._process_call()(*arguments))
        except EndOfStream:
            self.ended = True
            return self.result()
        if result is _OVER:
            self.ended = True
            return self.result()
        for name, value in zip(self.type.outputs, self.node._split(result), strict=False):
            if value is not None:
                self._writer(name)(value, None, None)
        return self.result()

    def of_slot(self, slot: str, values: dict[str, Any]) -> Firing:
        if slot not in self.type.slots:
            raise UsageError(f'{self.type.name} has no slot "{slot}"; it has {_names(self.type.slots)}')
        if strange := set(values) - {"value"}:
            raise UsageError(f"a slot takes value=..., got {_names(strange)}")
        value = values.get("value")
        spec = self.type.slots[slot]
        if spec.takes_value and "value" not in values:
            raise UsageError(f'slot "{self.type.name}.{slot}" takes a value: fire(node, slot="{slot}", value=...)')
        self._check("slot", slot, spec.type, value)
        token = value if isinstance(value, Token) else Token(value, 0, self.now)
        self.run(lambda: self.node._slot_call(slot)(token))
        return self.result()

    def of_hook(self, name: str) -> Firing:
        answer = self.run(getattr(self.node, name))
        if name == "do":  # it has returned by itself (A15)
            self._trigger("completed")(answer, None, None)
        if name == "teardown":
            _SET_UP.discard(self.node)
        return replace(self.result(), answer=answer)

    def result(self) -> Firing:
        outputs = {sent.name: _plain(sent.value) for sent in self.outputs.values() if _plain(sent.value) is not None}
        events = [(sent.name, _plain(sent.value)) for sent in self.signals]
        return Firing(outputs, events, [*self.signals, *self.outputs.values()], self.ended)

    def run(self, function: Callable[[], Any]) -> Any:
        """Run code to its end, waiting included."""
        with time_told_by(lambda: self.now):
            with self.loop.entered():
                result = function()
                if not inspect.iscoroutine(result):
                    return result
                task = self.loop.start(self, result)
            while not task.done():
                if self.loop.step(self):
                    continue
                due = self.loop.next_time()
                if due is None:
                    task.get_coro().close()
                    raise UsageError(f'"{self.type.name}" waits for something that never comes outside a graph')
                self.now = due
                self.loop.ring()
            return task.result()

    def _next(self, kind: str) -> Any:
        iterator = self.node.__dict__.get("_fired_iterator")
        if iterator is None:
            iterator = self.node._process_call()()
            self.node.__dict__["_fired_iterator"] = iterator
        if kind == "generator":
            return self.run(lambda: next(iterator, _OVER))

        async def step() -> Any:
            return await anext(iterator, _OVER)

        return self.run(step)

    def _arguments(self, values: dict[str, Any]) -> list[Any]:
        values = self.type.spread(values)
        if unknown := set(values) - set(self.type.inputs):
            raise UsageError(
                f"{self.type.name} has no input {_names(unknown)}; its inputs are {_names(self.type.inputs)}"
            )
        arguments = []
        for name, spec in self.type.inputs.items():
            if name in values:
                value = values[name]
                self._check("input", name, spec.type, value)
                if spec.token:
                    arguments.append(value if isinstance(value, Token) else Token(value, 0, self.now))
                else:
                    arguments.append(_plain(value))
            elif spec.optional:
                arguments.append(spec.default)
            else:
                raise UsageError(f'{self.type.name} needs a value for "{name}": fire(node, {name}=...)')
        return arguments

    def _writer(self, name: str) -> Callable[[Any, int | None, float | None], None]:
        def write(value: Any, activity: int | None, stamp: float | None) -> None:
            if name in self.outputs:
                raise UsageError(f'"{self.type.name}.{name}" was written twice in one firing')
            self._check("output", name, self.type.outputs[name].type, value)
            self.outputs[name] = _sent(name, value, activity, stamp)

        return write

    def _trigger(self, name: str) -> Callable[[Any, int | None, float | None], None]:
        def trigger(value: Any, activity: int | None, stamp: float | None) -> None:
            self._check("event", name, self.node.ports.events[name].type, value)
            self.signals.append(_sent(name, value, activity, stamp))

        return trigger

    def _wait(self, name: str) -> Callable[[Any, int | None, float | None], Any]:
        at_once = self._trigger(name)

        async def trigger(value: Any, activity: int | None, stamp: float | None) -> None:
            at_once(value, activity, stamp)

        return trigger

    def _check(self, kind: str, name: str, hint: Any, value: Any) -> None:
        """With `debug`, what goes through a port is of its type; no value is silence, or a signal without one (T2)."""
        plain = _plain(value)
        if self.debug and plain is not None and not accepts(plain, hint):
            raise TypeError(
                f'{kind} "{self.type.name}.{name}" is declared {describe(hint)}, got {describe_value(plain)}'
            )


def _sent(name: str, value: Any, activity: int | None, stamp: float | None) -> Sent:
    if isinstance(value, Token):  # A4: a token passed on keeps its modifier, unless that is 0, and its stamp
        asked = asked_for(activity, value.activity)
        return Sent(name, value.value, asked, value.stamp if stamp is None else stamp)
    return Sent(name, value, activity, stamp)


def _plain(value: Any) -> Any:
    return value.value if isinstance(value, Token) else value


def _names(names: Any) -> str:
    return ", ".join(f'"{name}"' for name in names) or "none"

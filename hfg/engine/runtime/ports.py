"""Connects the ports of a node to the run: what `send` and `trigger` do while its graph runs (rules F3, F8, A4).

This happens at each setup.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from hfg.base.token import Token
from hfg.engine.executing.room import trigger_wait
from hfg.engine.fusion import slots
from hfg.engine.model import RunningEvent, RunningNode
from hfg.engine.rules import concurrency, outputs, task_ports
from hfg.engine.rules.sending import trigger
from hfg.engine.rules.sharing import need_unwritten
from hfg.engine.runtime import plan, relays
from hfg.errors import UsageError
from hfg.ports.automatic import is_automatic_event
from hfg.ports.events import EventPort
from hfg.trace import ParameterSet
from hfg.types import accepts, describe, describe_value

__all__ = ["bind", "bind_automatic", "bind_event", "bind_start", "release_ports"]


def bind(worker: RunningNode) -> None:
    """Install the run's functions on all ports through which the node's code can send."""
    node = worker.node
    node_type = worker.type
    if node is None or worker.silent_code:
        return
    if worker.scope is None:
        node._start_task = partial(worker.core.runtime.start_task, worker)
    ports = node.ports
    for position, name in enumerate(node_type.outputs):
        beyond_one = worker.concurrent is not None
        emit = partial(concurrency.write, worker, position) if beyond_one else outputs.writer(worker, position)
        ports.outputs[name]._connect(emit if worker.tasks is None else task_ports.refusing(worker, position, emit))
    for name in node_type.events:
        bind_event(worker, name)
    for name, spec in node_type.parameters.items():
        if spec.read_only:
            ports.parameters[name]._report_to(partial(_show, worker, name))


def _show(worker: RunningNode, name: str, value: Any) -> None:
    """Trace a parameter that only the node sets (R7); from a thread, in order with what it sends."""
    core = worker.core
    if core.trace_changes is None:
        return
    if core.runtime.on_loop():
        _trace_set(worker, name, value)
        return
    tell = partial(_trace_set, worker, name, value)
    try:
        worker.group.signal(tell)  # type: ignore[attr-defined]
    except (AttributeError, UsageError):  # a thread of the node's own
        core.runtime.bring_in(tell)


def _trace_set(worker: RunningNode, name: str, value: Any) -> None:
    core = worker.core
    if core.trace_changes is not None:
        core.trace_changes(ParameterSet(core.now(), worker.path, name, value))


def bind_event(worker: RunningNode, name: str) -> RunningEvent:
    """Make the running event of a declared or automatic event, and let its port trigger it."""
    automatic = is_automatic_event(name)
    relayed = worker.scope is not None and not automatic
    event = worker.events.get(name)
    if event is None:
        event = worker.make_event(name, None)
        if relayed:
            for inner in relays.events_behind(worker.node.ports.events[name]):
                inner.subscribe(worker.node.ports.events[name]._notify)
    if worker.node is None:  # the graph's own `start`
        return event
    port = worker.node.ports.events[name]
    event.bind(port)
    if not relayed:
        _connect(event, port)
    worker.core.runtime.adopt_event(port)
    if automatic and worker.scope is not None:
        plan.watch_scope(worker.scope)
    if automatic and worker.core.started:
        worker.watch()
        worker.changed()
        bind(worker)  # what it triggers may have consequences from now on
    return event


def _connect(event: RunningEvent, port: EventPort[Any]) -> None:
    """Let a port trigger its event directly if possible, otherwise through a layer for each check that applies."""
    worker = event.worker
    debug = worker.core.debug
    overlapping = worker.concurrent is not None or worker.attempts is not None
    shortcut: Callable[..., None] | None = None
    wait: Callable[..., Any] = partial(trigger_wait, event)
    if worker.group.threaded:
        emit: Callable[..., Any] = partial(_from_thread, worker, event)
    else:
        plainly = debug or overlapping or worker.tasks is not None
        short = slots.emitter(event, plainly=plainly)
        shortcut = None if plainly else short
        emit = lambda value, activity, stamp: short(value, activity=activity, stamp=stamp)  # noqa: E731
    if overlapping:
        emit, wait = concurrency.triggering(worker, emit), concurrency.triggering(worker, wait)
    if worker.tasks is not None:
        emit = task_ports.triggering(event, emit)
    if debug:
        emit, wait = _checked(worker, port, emit), _checked(worker, port, wait)
    if worker.lifecycle.early is not None:
        emit, shortcut = partial(_keep, event), None
    port._connect(emit, wait, shortcut)


def _keep(event: RunningEvent, value: Any, activity: int | None, stamp: float | None) -> None:
    """R4: what a node sends that is set up ahead leaves when it takes part, with the time at which it was sent (T5)."""
    worker = event.worker
    early = worker.lifecycle.early
    assert early is not None, "a node that takes part keeps what it sends"
    if stamp is None and type(value) is not Token:
        stamp = worker.core.now()
    early.append(lambda: event.port._emit(value, activity, stamp))


def _checked(
    worker: RunningNode, port: EventPort[Any], emit: Callable[..., Any]
) -> Callable[[Any, int | None, float | None], Any]:
    """Check in debug mode that a signal's value is of its event's type; no value always is (T2)."""

    def checked(value: Any, activity: int | None, stamp: float | None) -> Any:
        plain = value.value if type(value) is Token else value
        if plain is not None and not accepts(plain, port.type):
            raise TypeError(f'event "{port.path}" is declared {describe(port.type)}, got {describe_value(plain)}')
        if host.on_loop():  # values from a thread are checked when they are on their edges
            need_unwritten(worker, port.name, value)
        return emit(value, activity, stamp)

    host = worker.core.runtime
    return checked


def bind_automatic(worker: RunningNode) -> None:
    """Bind the automatic events of a node, subgraph or graph that have edges or subscribers."""
    if worker.node is None:
        return
    made = [
        port
        for port in worker.node.__dict__.values()
        if isinstance(port, EventPort) and (is_automatic_event(port.name) or worker.scope is not None)
    ]
    for port in made:
        if port.name in worker.events or port._observers:
            bind_event(worker, port.name)


def _from_thread(
    worker: RunningNode, event: RunningEvent, value: Any, activity: int | None, stamp: float | None
) -> None:
    """A signal from a thread leaves in the loop's next pass, in order and before the outputs of its firing (F3)."""
    host = worker.core.runtime
    if host.on_loop():
        trigger(event, value, activity, stamp)
    else:
        worker.group.signal(partial(trigger, event, value, activity, stamp))  # type: ignore[attr-defined]


def bind_start(boundary: RunningNode, port: EventPort[None]) -> RunningEvent | None:
    """Bind the graph's `start` if it has edges or subscribers (A10)."""
    event = boundary.events.get("start")
    if event is None and port._observers:
        event = boundary.make_event("start", port)
    if event is not None:
        boundary.core.runtime.adopt_event(port)
    return event


def release_ports(worker: RunningNode) -> None:
    """The run is over: disconnect the ports and complete their subscriptions."""
    node = worker.node
    if node is not None:
        worker.hide_activity()
        node._start_task = None
    for event in worker.events.values():
        port = event.port
        if port is not None:
            port._disconnect()
    if node is not None and not worker.silent_code:
        for name, spec in worker.type.parameters.items():
            if spec.read_only:
                node.ports.parameters[name]._report_to(None)
        for name in worker.type.outputs:
            node.ports.outputs[name]._disconnect()

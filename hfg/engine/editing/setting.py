"""Parameters that are set from outside: between firings, and never without effect (rule P8)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from hfg.base.values import own_copy
from hfg.engine.model.running_node import BACKOFF, BETWEEN_FIRINGS, DISABLED, RunningNode
from hfg.engine.rules import node_lifecycle
from hfg.errors import NotRunning, UsageError
from hfg.graph.structure.declaring import stands_for
from hfg.graph.structure.level import inside
from hfg.nodetypes.description import read_only_refusal
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort
from hfg.trace import ParameterSet

if TYPE_CHECKING:
    from hfg.engine.runtime.engine import Engine

__all__ = ["need_settable", "refuse_without_effect", "set_parameter", "without_effect"]


def set_parameter(engine: Engine, port: ParameterPort[Any], value: Any) -> None:
    """Set a parameter, and the inner parameters that it stands for, each between firings of its node.

    Raises:
      ValueError: the value is out of the limits of one of them; nothing is changed.
      UsageError: it would have no effect.
    """
    reached = need_settable(engine, port, value)
    value = own_copy(value)  # a copy of now, because it may be set later
    workers = {worker.node: worker for worker in engine.core.workers if worker.node is not None}
    if any(one.node not in workers for one in reached):
        raise UsageError(f'"{port.path}" is no parameter of this run: its graph is another one, or it was never added')
    refuse_without_effect([(one.node, one.name) for one in reached], workers.values())
    for one in reached:
        write = partial(_write, workers[one.node], one.node, one.name, value)
        if engine.on_loop():
            _between_firings(workers[one.node], write)
        else:  # from a thread
            engine.bring_in(partial(_between_firings, workers[one.node], write))


def need_settable(engine: Engine, port: ParameterPort[Any], value: Any) -> list[ParameterPort[Any]]:
    """Return a parameter and the inner ones that it stands for, all of which may have this value now.

    Raises:
      ValueError: it is out of the limits of one of them, or set by the node alone.
      NotRunning: the run is over.
    """
    if engine.core.over:
        raise NotRunning(
            f"the run is over; to set the parameter for the next run, assign "
            f'node.ports.parameters["{port.name}"].value = ...'
        )
    reached = list(stands_for(port))
    for one in reached:
        if one.spec.read_only:
            raise ValueError(read_only_refusal(one.path))
        wrong = one.spec.check(value)
        if wrong is not None:
            raise ValueError(f'parameter "{one.path}" {wrong}')
    return reached


def _write(worker: RunningNode, node: Node, name: str, value: Any) -> None:
    """Pass the value to the node."""
    core = worker.core
    node._parameters[name] = own_copy(value)
    if core.trace_changes is not None:
        core.trace_changes(ParameterSet(core.now(), worker.path, name, value))


def _between_firings(worker: RunningNode, write: Callable[[], None]) -> None:
    """Write now, or when the current firing or call is over; the caller does not wait."""
    if worker.busy in BETWEEN_FIRINGS and not worker.is_on_fast_path():
        write()
        return

    def in_turn(_worker: RunningNode, over: Callable[[], None]) -> None:
        write()
        over()

    node_lifecycle.when_idle(worker, in_turn, node_lifecycle.nothing)


def refuse_without_effect(parameters: Sequence[tuple[Any, str]], workers: Iterable[RunningNode]) -> None:
    """Refuse a change that no running code would see.

    Args:
      parameters: nodes and subgraphs, with the names of the parameters that are set together.
      workers: those that continue with what they do; not those that start over with the new values.

    Raises:
      UsageError: with the remedy.
    """
    running = {worker.node: worker for worker in workers}
    for node, name in parameters:
        inner = inside(node)
        if inner is not None:
            if node in running and not inner.promotions.of(name):
                raise UsageError(
                    f'parameter "{node.place.path}.{name}" stands for none inside, and build() has run: nothing would '
                    f"change; call graph.promote(self.{name}, ...) in build(), or replace the subgraph, "
                    f"{_replacing(node, name)}"
                )
        elif node in running and _has_its_values(running[node]):
            raise without_effect(node, name)


def without_effect(node: Any, name: str) -> UsageError:
    """Return the error for setting a parameter that a generator function received when it started."""
    return UsageError(
        f'parameter "{node.place.path}.{name}" belongs to a generator function that was given it when it '
        "began and cannot see a new value: make it a class whose process() yields, or counts in an "
        f"hfg.State, and reads self.{name}; or begin it afresh, {_replacing(node, name)}"
    )


def _has_its_values(worker: RunningNode) -> bool:
    """Return whether its code has received the parameters once and continues with them."""
    if not worker.type.given_parameters_once or worker.blocked & (DISABLED | BACKOFF):
        return False  # these start over
    return worker.execution.generator is not None or worker.busy == "firing"


def _replacing(node: Any, name: str) -> str:
    reference = node._type.reference or "module:name"
    return f'run.edit(commands.Replace("{node.place.path}", "{reference}", parameters={{"{name}": ...}}))'
